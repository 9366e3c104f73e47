//! What a target computes in which order. Cheap branches become selections, because a test of four lanes costs more
//! than computing both sides; nodes are put in the order that keeps fewer values alive.

use isograd_graph::{Builder, Exhausted, Graph, Mode, Node, NodeId, Precision, Watch};

use crate::copy::copy_flat;
use crate::order::depth_first;
use crate::pressure::max_live;

/// A branch whose sides together cost no more than this, in additions, is computed on both sides.
const CHEAP: u32 = 40;

/// Flattens cheap branches and chooses between the order of the graph and depth-first order.
///
/// # Errors
/// If the budget is spent.
pub fn schedule(graph: &Graph, precision: Precision, max_nodes: usize, watch: &dyn Watch) -> Result<Graph, Exhausted> {
    let cheap = cheap_gammas(graph);
    let flat = |gamma: NodeId| cheap.get(gamma.index()).copied().unwrap_or(false);
    let graph = if cheap.contains(&true) {
        copy_flat(graph, Mode::Real(precision), &flat, max_nodes, watch, |b, op, args| b.op(op, args))?
    } else {
        graph.clone()
    };
    let reordered = in_order(&graph, &depth_first(&graph), precision, max_nodes, watch)?;
    Ok(if max_live(&reordered) < max_live(&graph) { reordered } else { graph })
}

/// Which gammas are cheap: no loop inside, and no gamma that is not cheap itself.
fn cheap_gammas(graph: &Graph) -> Vec<bool> {
    let mut cheap = vec![false; graph.len()];
    // Costs of the open structures; `None` once something in it must stay a region.
    let mut open: Vec<Option<u32>> = Vec::new();
    for (_, node) in graph.iter() {
        match node {
            Node::Gamma { .. } => open.push(Some(0)),
            Node::Theta { .. } => open.push(None),
            Node::End { begin } => {
                let cost = open.pop().flatten().filter(|c| *c <= CHEAP);
                if let Some(place) = cheap.get_mut(begin.index()) {
                    *place = cost.is_some();
                }
                if let Some(outer) = open.last_mut() {
                    *outer = outer.zip(cost).map(|(a, b)| a + b);
                }
            }
            Node::Apply(op, _) => {
                if let Some(Some(cost)) = open.last_mut() {
                    *cost = cost.saturating_add(op.def().cost);
                }
            }
            _ => {}
        }
    }
    cheap
}

/// Rebuilds a graph with its nodes in this order.
fn in_order(
    graph: &Graph,
    order: &[NodeId],
    precision: Precision,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Graph, Exhausted> {
    let mut b = Builder::new(Mode::Real(precision), max_nodes, watch);
    let mut map = vec![NodeId::NONE; graph.len()];
    for id in order {
        let Some(node) = graph.get(*id) else { continue };
        let to = |x: NodeId| map.get(x.index()).copied().unwrap_or(NodeId::NONE);
        b.set_origin(graph.origin(*id));
        let copied = match node {
            Node::Input(i) => b.input(graph.inputs.get(i as usize).map_or("?", |x| x.name.as_str()), graph.scalar(*id)),
            Node::Real(bits) => b.real(f64::from_bits(bits)),
            Node::Int(x) => b.int(x),
            Node::Bool(x) => b.bool(x),
            Node::Apply(op, args) => b.op(op, args.map(to).as_slice()),
            Node::Gamma { cond, .. } => b.gamma(to(cond)),
            Node::Else { .. } => {
                b.otherwise();
                NodeId::NONE
            }
            Node::Theta { lo, hi, .. } => b.theta(to(lo), to(hi)),
            Node::Counter { .. } => b.counter(),
            Node::Carried { init, .. } => b.carried(to(init)),
            Node::End { .. } => b.end(),
            Node::Join { end, then, otherwise } => b.join(to(end), to(then), to(otherwise)),
            Node::Final { end, carried, next } => b.carry_out(to(end), to(carried), to(next)),
            Node::Tape { end, value, every } => b.tape(to(end), to(value), every),
            Node::Recall { tape, at } => b.recall(to(tape), to(at)),
            Node::Fresh(x) => to(x),
            Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => NodeId::NONE,
        };
        if let Some(place) = map.get_mut(id.index()) {
            *place = copied;
        }
        if let Some(why) = b.exhausted() {
            return Err(why);
        }
    }
    for output in &graph.outputs {
        let node = map.get(output.node.index()).copied().unwrap_or(NodeId::NONE);
        b.output(output.name.clone(), node);
    }
    b.finish()
}
