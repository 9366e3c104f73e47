//! The text form of a graph: one node a line, regions indented.

use std::fmt::Write as _;

use crate::{Graph, Node, NodeId};

/// The text form.
#[must_use]
pub fn print(graph: &Graph) -> String {
    let mut out = String::new();
    let mut depth = 0_usize;
    for (id, node) in graph.iter() {
        if matches!(node, Node::Else { .. } | Node::End { .. }) {
            depth = depth.saturating_sub(1);
        }
        let _ = writeln!(out, "{:indent$}{}", "", line(graph, id, node), indent = depth * 2);
        if matches!(node, Node::Gamma { .. } | Node::Theta { .. } | Node::Else { .. }) {
            depth += 1;
        }
    }
    for output in &graph.outputs {
        let _ = writeln!(out, "output {} %{}", output.name, output.node.0);
    }
    out
}

fn line(graph: &Graph, id: NodeId, node: Node) -> String {
    let n = id.0;
    match node {
        Node::Input(i) => {
            let name = graph.inputs.get(i as usize).map_or("?", |input| input.name.as_str());
            format!("%{n} = input {name}: {}", graph.scalar(id))
        }
        Node::Real(bits) => format!("%{n} = real {:?}", f64::from_bits(bits)),
        Node::Int(x) => format!("%{n} = int {x}"),
        Node::Bool(x) => format!("%{n} = bool {x}"),
        Node::Apply(op, args) => {
            let mut text = format!("%{n} = {op}");
            for arg in args.as_slice() {
                let _ = write!(text, " %{}", arg.0);
            }
            text
        }
        Node::Fresh(x) => format!("%{n} = fresh %{}", x.0),
        Node::Diff { value, wrt } => format!("%{n} = diff %{} %{}", value.0, wrt.0),
        Node::Gamma { cond, .. } => format!("%{n} = gamma %{}", cond.0),
        Node::Else { .. } => format!("%{n} = else"),
        Node::Theta { lo, hi, .. } => format!("%{n} = theta %{} %{}", lo.0, hi.0),
        Node::Counter { theta } => format!("%{n} = counter %{}", theta.0),
        Node::Carried { theta, init } => format!("%{n} = carried %{} %{}", theta.0, init.0),
        Node::End { .. } => format!("%{n} = end"),
        Node::Join { end, then, otherwise } => format!("%{n} = join %{} %{} %{}", end.0, then.0, otherwise.0),
        Node::Final { end, carried, next } => format!("%{n} = final %{} %{} %{}", end.0, carried.0, next.0),
    }
}
