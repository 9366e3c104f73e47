//! Where a derivative goes past a jump that `smooth` mode leaves as it is (LANGUAGE 14.3). Finds places; what is said
//! about them is another's business.

use std::collections::BTreeSet;

use isograd_graph::{Graph, Node, NodeId, Op, Origin, Watch};

use crate::live::live;

/// `diff`s of one sweep: bits of a word.
const BATCH: usize = 64;

/// A jump on the way from what a live `diff` differentiates by to what it differentiates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Jump {
    /// Where it comes from.
    pub origin: Origin,
    /// The operation.
    pub op: Op,
}

/// The jumps in a raw graph, without repetition. Stops early if time is up.
#[must_use]
pub fn kept_jumps(graph: &Graph, watch: &dyn Watch) -> BTreeSet<Jump> {
    let live = live(graph);
    let is_live = |id: NodeId| live.get(id.index()).copied().unwrap_or(false);
    let candidates: Vec<(NodeId, Op)> = graph
        .iter()
        .filter_map(|(id, node)| match node {
            Node::Apply(op, _) if jumping(op) && is_live(id) => Some((id, op)),
            _ => None,
        })
        .collect();
    let mut found = BTreeSet::new();
    if candidates.is_empty() {
        return found;
    }
    let diffs: Vec<(NodeId, NodeId)> = graph
        .iter()
        .filter_map(|(id, node)| match node {
            Node::Diff { value, wrt } if is_live(id) => Some((value, wrt)),
            _ => None,
        })
        .collect();
    let conditions = conditions(graph);
    for batch in diffs.chunks(BATCH) {
        if watch.expired() {
            break;
        }
        let (from, to) = (reached(graph, &conditions, batch), reaching(graph, &conditions, batch));
        let bits = |sets: &[u64], id: NodeId| sets.get(id.index()).copied().unwrap_or(0);
        for (id, op) in &candidates {
            let mut below = 0;
            graph.get(*id).into_iter().for_each(|node| node.each_operand(|x| below |= bits(&from, x)));
            if below & bits(&to, *id) != 0 {
                found.insert(Jump { origin: graph.origin(*id), op: *op });
            }
        }
    }
    found
}

/// Whether an operation keeps its jumps.
const fn jumping(op: Op) -> bool {
    matches!(op, Op::Floor | Op::Ceil | Op::Round | Op::Trunc | Op::Fract | Op::Mod | Op::RealToInt)
}

/// What decides about the result of a branch or the variable of a loop beside its operands, by index.
fn conditions(graph: &Graph) -> Vec<[NodeId; 2]> {
    let begin = |end: NodeId| match graph.get(end) {
        Some(Node::End { begin }) => graph.get(begin),
        _ => None,
    };
    let decides = |structure: Option<Node>| match structure {
        Some(Node::Gamma { cond, .. }) => [cond, NodeId::NONE],
        Some(Node::Theta { lo, hi, .. }) => [lo, hi],
        _ => [NodeId::NONE; 2],
    };
    graph
        .iter()
        .map(|(_, node)| match node {
            Node::Join { end, .. } | Node::Final { end, .. } => decides(begin(end)),
            Node::Counter { theta } => decides(graph.get(theta)),
            _ => [NodeId::NONE; 2],
        })
        .collect()
}

/// Calls `f` with all that a node depends on.
fn each_source(graph: &Graph, conditions: &[[NodeId; 2]], id: NodeId, mut f: impl FnMut(NodeId)) {
    if let Some(node) = graph.get(id) {
        node.each_operand(&mut f);
    }
    conditions.get(id.index()).into_iter().flatten().filter(|x| **x != NodeId::NONE).for_each(|x| f(*x));
}

/// For each node, the `diff`s by whose variable it changes.
fn reached(graph: &Graph, conditions: &[[NodeId; 2]], batch: &[(NodeId, NodeId)]) -> Vec<u64> {
    let mut sets = vec![0_u64; graph.len()];
    for (i, (_, wrt)) in batch.iter().enumerate() {
        add(&mut sets, *wrt, 1 << i);
    }
    // Around a loop once more for each variable that learns something from its end.
    loop {
        let mut again = false;
        for (id, node) in graph.iter() {
            let mut bits = 0;
            each_source(graph, conditions, id, |x| bits |= sets.get(x.index()).copied().unwrap_or(0));
            add(&mut sets, id, bits);
            if let Node::Final { carried, next, .. } = node {
                let bits = sets.get(next.index()).copied().unwrap_or(0);
                again |= add(&mut sets, carried, bits);
            }
        }
        if !again {
            return sets;
        }
    }
}

/// For each node, the `diff`s whose value depends on it.
fn reaching(graph: &Graph, conditions: &[[NodeId; 2]], batch: &[(NodeId, NodeId)]) -> Vec<u64> {
    let mut sets = vec![0_u64; graph.len()];
    for (i, (value, _)) in batch.iter().enumerate() {
        add(&mut sets, *value, 1 << i);
    }
    let finals: Vec<(NodeId, NodeId)> = graph
        .iter()
        .filter_map(|(_, node)| match node {
            Node::Final { carried, next, .. } => Some((carried, next)),
            _ => None,
        })
        .collect();
    loop {
        for (id, _) in graph.iter().rev() {
            let bits = sets.get(id.index()).copied().unwrap_or(0);
            if bits != 0 {
                each_source(graph, conditions, id, |x| {
                    add(&mut sets, x, bits);
                });
            }
        }
        let mut again = false;
        for (carried, next) in &finals {
            let bits = sets.get(carried.index()).copied().unwrap_or(0);
            again |= add(&mut sets, *next, bits);
        }
        if !again {
            return sets;
        }
    }
}

/// Adds to a set; whether that was news.
fn add(sets: &mut [u64], id: NodeId, bits: u64) -> bool {
    let Some(place) = sets.get_mut(id.index()) else { return false };
    let news = *place | bits != *place;
    *place |= bits;
    news
}
