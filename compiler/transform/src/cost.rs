//! What a graph costs per point, by the costs of the op table: what the choice between two graphs of the same meaning
//! goes by. Knows no target and measures nothing.

use isograd_graph::{Graph, Node, NodeId};

use crate::live::live;

/// How often a loop is taken to run whose trip count is not known.
const TRIPS: u64 = 16;

/// What it costs to put a value on a tape, or to read it, in additions.
const MOVE: u64 = 1;

/// The sum of the costs of all live operations and of what tapes move, those of loops times their trip counts.
#[must_use]
pub fn cost(graph: &Graph) -> u64 {
    let live = live(graph);
    let mut total = 0_u64;
    let mut trips = vec![1_u64];
    for ((id, node), live) in graph.iter().zip(live) {
        let around = trips.last().copied().unwrap_or(1);
        match node {
            Node::Apply(op, _) if live => total = total.saturating_add(around.saturating_mul(op.def().cost.into())),
            Node::Gamma { .. } => trips.push(around),
            Node::Recall { .. } if live => total = total.saturating_add(around.saturating_mul(MOVE)),
            Node::Tape { end, every, .. } if live => {
                let trips = match graph.get(end) {
                    Some(Node::End { begin }) => trip_count(graph, begin),
                    _ => None,
                };
                let held = trips.unwrap_or(TRIPS).div_ceil(u64::from(every.max(1)));
                total = total.saturating_add(around.saturating_mul(held).saturating_mul(MOVE));
            }
            Node::Theta { .. } => trips.push(around.saturating_mul(trip_count(graph, id).unwrap_or(TRIPS))),
            Node::End { .. } if trips.len() > 1 => {
                trips.pop();
            }
            _ => {}
        }
    }
    total
}

/// How often a loop runs, if its bounds are constants.
fn trip_count(graph: &Graph, theta: NodeId) -> Option<u64> {
    let Some(Node::Theta { lo, hi, .. }) = graph.get(theta) else { return None };
    match (graph.get(lo), graph.get(hi)) {
        (Some(Node::Int(lo)), Some(Node::Int(hi))) => Some(u64::try_from(i64::from(hi) - i64::from(lo)).unwrap_or(0)),
        _ => None,
    }
}
