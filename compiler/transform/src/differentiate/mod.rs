//! Forward-mode differentiation: expands every `diff` of a raw graph (LANGUAGE 13).
//!
//! A *seed* is a value that some `diff` differentiates by. One sweep from left to right carries, beside each value,
//! its tangents for up to 64 seeds; partial derivatives are built once and shared by all tangents. Only tangents that
//! lie on a path from a seed to a `diff` are made: `activity` finds the paths. A `diff` on such a path must be gone
//! first, so nested ones take one round each, the inner first. Loops stay loops: a tangent of a carried variable is
//! a carried variable beside it.

mod activity;
mod forward;

use std::collections::BTreeSet;
use std::fmt;

use isograd_graph::{Exhausted, Graph, Node, NodeId, Origin, Watch};

use crate::live::live;

/// Seeds of one sweep: bits of a word.
const BATCH: usize = 64;

/// Why a graph cannot be differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DifferentiateError {
    /// Out of budget.
    Exhausted(Exhausted),
    /// A `diff` in a loop depends, through carried variables, on itself (LANGUAGE 13.4).
    Growing(Origin),
    /// A `diff` inside more others than allowed.
    Order(Origin),
}

impl fmt::Display for DifferentiateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exhausted(why) => why.fmt(f),
            Self::Growing(_) => f.write_str("the order of a derivative grows with the trip count of its loop"),
            Self::Order(_) => f.write_str("derivatives are nested too deeply"),
        }
    }
}

impl std::error::Error for DifferentiateError {}

impl From<Exhausted> for DifferentiateError {
    fn from(why: Exhausted) -> Self {
        Self::Exhausted(why)
    }
}

/// One `diff` of a graph.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diff {
    pub node: NodeId,
    pub value: NodeId,
    pub wrt: NodeId,
}

/// Expands every `diff` that an output needs. `max_order` counts `diff` inside `diff`.
///
/// # Errors
/// If an order grows with a trip count or exceeds `max_order`, or the budget is spent.
pub fn differentiate(
    graph: Graph,
    max_order: u64,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Graph, DifferentiateError> {
    let mut graph = graph;
    // How many rounds of expansion a value has been through; rides along with the graph.
    let mut orders = vec![0_u32; graph.len()];
    loop {
        let live = live(&graph);
        let diffs: Vec<Diff> = graph
            .iter()
            .filter_map(|(node, n)| match n {
                Node::Diff { value, wrt } if live.get(node.index()) == Some(&true) => Some(Diff { node, value, wrt }),
                _ => None,
            })
            .collect();
        let Some(first) = diffs.first() else { return Ok(graph) };
        let mut progress = false;
        for batch in batches(&diffs) {
            let activity = activity::Activity::of(&graph, &batch);
            let ready: Vec<Diff> =
                diffs.iter().copied().filter(|d| activity.seed(d.wrt).is_some() && activity.ready(d)).collect();
            if ready.is_empty() {
                continue;
            }
            (graph, orders) = forward::expand(&graph, &activity, &ready, &live, &orders, max_nodes, watch)?;
            if let Some(at) = orders.iter().position(|o| u64::from(*o) > max_order) {
                let node = NodeId(u32::try_from(at).unwrap_or(u32::MAX));
                return Err(DifferentiateError::Order(graph.origin(node)));
            }
            progress = true;
            break;
        }
        if !progress {
            return Err(DifferentiateError::Growing(graph.origin(first.node)));
        }
    }
}

/// The `diff`s on a path from what they differentiate by to what they differentiate; the value of any other is 0
/// (LANGUAGE 13.2). Stops early, and calls all others active, if time is up.
#[must_use]
pub fn active_diffs(graph: &Graph, watch: &dyn Watch) -> BTreeSet<NodeId> {
    let mut diffs: Vec<Diff> = graph
        .iter()
        .filter_map(|(node, n)| match n {
            Node::Diff { value, wrt } => Some(Diff { node, value, wrt }),
            _ => None,
        })
        .collect();
    let mut active = BTreeSet::new();
    for batch in batches(&diffs) {
        if watch.expired() {
            break;
        }
        let activity = activity::Activity::of(graph, &batch);
        diffs.retain(|d| {
            let Some(bit) = activity.seed(d.wrt) else { return true };
            if activity.active(d.value) & bit != 0 {
                active.insert(d.node);
            }
            false
        });
    }
    active.extend(diffs.iter().map(|d| d.node));
    active
}

/// The distinct seeds in order, at most [`BATCH`] at a time.
fn batches(diffs: &[Diff]) -> Vec<Vec<NodeId>> {
    let mut seeds: Vec<NodeId> = diffs.iter().map(|d| d.wrt).collect();
    seeds.sort_unstable();
    seeds.dedup();
    seeds.chunks(BATCH).map(<[NodeId]>::to_vec).collect()
}
