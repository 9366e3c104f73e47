//! Where a difference begins: the shader's graph with all its values as outputs. Knows graphs; judges nothing.

use isograd_compiler::{Manifest, Rate};
use isograd_graph::{Graph, Node, NodeId, Output, Value, Verified, verify};
use isograd_runtime::Values;
use isograd_spirv::{Form, Plan};
use isograd_vulkan::Device;

use super::columns::{Held, held, rows};
use super::prepared::manifest_of;
use crate::laws::show;

/// The first value outside of branches and loops that the device computes otherwise than the reference at a point, with
/// its operands, in words. `None` if there is none, for looking at values changes how a driver optimises.
pub fn first(graph: &Verified, like: &Manifest, point: &[Value], device: &Device) -> Option<String> {
    let varying: Vec<bool> =
        like.inputs.iter().flat_map(|port| port.columns.iter().map(|_| port.rate == Rate::Varying)).collect();
    let looked_at: Vec<NodeId> = outermost(graph);
    let mut opened: Graph = (**graph).clone();
    opened.outputs = looked_at.iter().map(|node| Output { name: format!("n{}", node.index()), node: *node }).collect();
    let opened = verify(opened).ok()?;
    let plan = Plan::new(&opened, Form::Kernel { varying: &varying }).ok()?;
    let manifest = manifest_of(&opened, plan.layout());
    let points = [point.to_vec()];
    let inputs = held(&manifest, &points);
    let inputs: Vec<Values<'_>> = inputs.iter().map(Held::values).collect();
    let columns = device.load_bytes(&plan.spirv().ok()?, &manifest).ok()?.evaluate(&inputs, 1).ok()?;
    let found = rows(&manifest, &columns, 1, false).ok()?.pop()?;
    let wanted = isograd_graph::evaluate(&opened, opened.precision?, point)?;
    let place = |node: NodeId| looked_at.iter().position(|n| *n == node);
    let at = (0..looked_at.len()).find(|i| !found[*i].same_bits(wanted[*i]))?;
    let operands = match opened[looked_at[at]] {
        Node::Apply(_, arguments) => arguments.as_slice().to_vec(),
        _ => Vec::new(),
    };
    let operands: Vec<Value> = operands.iter().filter_map(|node| place(*node)).map(|i| wanted[i]).collect();
    let text = isograd_graph::print(&opened);
    let number = format!("%{} = ", looked_at[at].index());
    let line = text.lines().find(|line| line.trim_start().starts_with(&number)).unwrap_or_default();
    Some(format!(
        "`{line}` of {} is {} by the reference, {} on the device",
        show(&operands),
        show(&wanted[at..=at]),
        show(&found[at..=at]),
    ))
}

/// The values outside of branches and loops.
fn outermost(graph: &Graph) -> Vec<NodeId> {
    let mut depth = 0_u32;
    let mut all = Vec::new();
    for (id, node) in graph.iter() {
        match node {
            Node::Gamma { .. } | Node::Theta { .. } => depth += 1,
            Node::End { .. } => depth -= 1,
            Node::Apply(..) | Node::Join { .. } | Node::Final { .. } | Node::Input(_) | Node::Real(_) if depth == 0 => {
                all.push(id);
            }
            _ => {}
        }
    }
    all
}
