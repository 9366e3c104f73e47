//! What a graph costs per point, by the costs of the op table: what the choice between two graphs of the same meaning
//! goes by. Knows no target and measures nothing.

use isograd_graph::{Graph, Node};

use crate::live::live;

/// How often a loop is taken to run whose trip count is not known.
const TRIPS: u64 = 16;

/// The sum of the costs of all live operations, those of loops times their trip counts.
#[must_use]
pub fn cost(graph: &Graph) -> u64 {
    let live = live(graph);
    let mut total = 0_u64;
    let mut trips = vec![1_u64];
    for ((_, node), live) in graph.iter().zip(live) {
        let around = trips.last().copied().unwrap_or(1);
        match node {
            Node::Apply(op, _) if live => total = total.saturating_add(around.saturating_mul(op.def().cost.into())),
            Node::Gamma { .. } => trips.push(around),
            Node::Theta { lo, hi, .. } => {
                let known = match (graph.get(lo), graph.get(hi)) {
                    (Some(Node::Int(lo)), Some(Node::Int(hi))) => {
                        Some(u64::try_from(i64::from(hi) - i64::from(lo)).unwrap_or(0))
                    }
                    _ => None,
                };
                trips.push(around.saturating_mul(known.unwrap_or(TRIPS)));
            }
            Node::End { .. } if trips.len() > 1 => {
                trips.pop();
            }
            _ => {}
        }
    }
    total
}
