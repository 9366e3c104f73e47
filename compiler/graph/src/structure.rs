//! What an emitter asks of a graph besides its nodes: which it needs, and what belongs to the same branch or loop. Knows
//! nothing of targets, but which operations their families have.

use std::ops::{Index, IndexMut};

use rustc_hash::FxHashMap;

use crate::ops::Family;
use crate::{Graph, Node, NodeId, Op};

/// A table with an entry for every node.
#[derive(Debug, Clone)]
pub struct PerNode<T>(Vec<T>);

impl<T: Clone> PerNode<T> {
    /// The same entry for every node.
    #[must_use]
    pub fn new(graph: &Graph, entry: T) -> Self {
        Self(vec![entry; graph.len()])
    }
}

#[expect(clippy::indexing_slicing, reason = "ids come from the graph that the table was made for")]
impl<T> Index<NodeId> for PerNode<T> {
    type Output = T;

    fn index(&self, id: NodeId) -> &T {
        &self.0[id.index()]
    }
}

#[expect(clippy::indexing_slicing, reason = "ids come from the graph that the table was made for")]
impl<T> IndexMut<NodeId> for PerNode<T> {
    fn index_mut(&mut self, id: NodeId) -> &mut T {
        &mut self.0[id.index()]
    }
}

/// Why a graph cannot be emitted: a mistake of the compiler.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unready {
    /// `fresh`, `diff` or `bound`.
    #[error("node %{} should have been expanded before emission", .0.0)]
    Unexpanded(NodeId),
    /// An operation that the family has no instructions for.
    #[error("the operation {0} has no instructions and should have been expanded before emission")]
    NoInstructions(Op),
    /// A carried variable is to become a value that is computed after the loop.
    #[error("final %{} names a value that is computed after its loop", .0.0)]
    LateNext(NodeId),
}

/// What belongs together in a graph that is ready for emission.
#[derive(Debug, Clone)]
pub struct Structure {
    /// Whether an output depends on it.
    pub needed: PerNode<bool>,
    /// The needed joins of a gamma, by its end.
    pub joins: FxHashMap<NodeId, Vec<NodeId>>,
    /// The needed carried variables of a theta.
    pub carried: FxHashMap<NodeId, Vec<NodeId>>,
    /// The needed tapes of a theta.
    pub tapes: FxHashMap<NodeId, Vec<NodeId>>,
    /// What an iteration gives a carried variable.
    pub next: PerNode<NodeId>,
    /// What the work of a point is.
    pub work: Work,
}

/// What the work of a point is, which a host needs to know before it compiles a module.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Work {
    /// Needed operations of the table, each once.
    pub operations: usize,
    /// Whether there is a loop whose trip count is not constant, or constant ones that run the innermost body more
    /// than 10,000 times for a point: a deadline must be able to interrupt it (DESIGN 9).
    pub long_loop: bool,
}

/// Iterations of a loop that a host may wait for.
const LONG: u64 = 10_000;

impl Structure {
    /// Finds it.
    ///
    /// # Errors
    /// If the graph is not ready for emission on a family of targets.
    pub fn new(graph: &Graph, family: Family) -> Result<Self, Unready> {
        let next = ready(graph, family)?;
        let needed = needed(graph, &next);
        let (joins, carried, tapes) = Default::default();
        let work = work(graph, &needed);
        let mut this = Self { needed, joins, carried, tapes, next, work };
        for (id, node) in graph.iter().filter(|(id, _)| this.needed[*id]) {
            match node {
                Node::Join { end, .. } => this.joins.entry(end).or_default().push(id),
                Node::Carried { theta, .. } => this.carried.entry(theta).or_default().push(id),
                Node::Tape { end, .. } => this.tapes.entry(graph.owner(end)).or_default().push(id),
                _ => {}
            }
        }
        Ok(this)
    }
}

impl Node {
    /// Whether it is a constant: written where it is used.
    #[must_use]
    pub const fn is_constant(&self) -> bool {
        matches!(self, Self::Real(_) | Self::Int(_) | Self::Bool(_))
    }
}

impl Graph {
    /// The gamma or theta that an end closes.
    #[must_use]
    pub fn owner(&self, end: NodeId) -> NodeId {
        match self.get(end) {
            Some(Node::End { begin }) => begin,
            _ => end,
        }
    }

    /// Whether an operand of a join is computed only after the branch.
    #[must_use]
    pub fn is_late(&self, end: NodeId, operand: NodeId) -> bool {
        operand > end && !self[operand].is_constant()
    }

    /// How many iterations a tape holds, one for the end included: entry ⌈k/n⌉ is written in iteration k of a tape that
    /// holds every n-th, so that iteration j·n is the last to write entry j. `None` if the trip count is not constant or
    /// does not fit.
    #[must_use]
    pub fn tape_length(&self, end: NodeId, every: u32) -> Option<u32> {
        let Some(Node::Theta { lo, hi, .. }) = self.get(self.owner(end)) else { return None };
        let (Some(Node::Int(lo)), Some(Node::Int(hi))) = (self.get(lo), self.get(hi)) else { return None };
        let last = u32::try_from(i64::from(hi) - i64::from(lo) - 1).ok()?;
        last.checked_add(every.saturating_sub(1))?.checked_div(every)?.checked_add(1)
    }
}

/// Refuses graphs that are not ready for emission, and finds what each carried variable becomes.
fn ready(graph: &Graph, family: Family) -> Result<PerNode<NodeId>, Unready> {
    let mut nexts = PerNode::new(graph, NodeId::NONE);
    for (id, node) in graph.iter() {
        match node {
            Node::Fresh(_) | Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => {
                return Err(Unready::Unexpanded(id));
            }
            Node::Apply(op, _) if op.def().fragment(family).is_some() => return Err(Unready::NoInstructions(op)),
            Node::Final { end, carried, next } => {
                // After its end an iteration cannot compute anything any more.
                if graph.is_late(end, next) {
                    return Err(Unready::LateNext(id));
                }
                nexts[carried] = next;
            }
            _ => {}
        }
    }
    Ok(nexts)
}

/// What the outputs depend on: a walk backwards over operands and the marks of their regions.
fn needed(graph: &Graph, nexts: &PerNode<NodeId>) -> PerNode<bool> {
    let mut needed = PerNode::new(graph, false);
    let mut open: Vec<NodeId> = graph.outputs.iter().map(|output| output.node).collect();
    while let Some(id) = open.pop() {
        if std::mem::replace(&mut needed[id], true) {
            continue;
        }
        let node = graph[id];
        node.each_operand(|x| open.push(x));
        match node {
            Node::Gamma { otherwise, end, .. } => open.extend([otherwise, end]),
            Node::Theta { end, .. } => open.push(end),
            Node::Counter { theta } => open.push(theta),
            Node::Carried { theta, .. } => open.extend([theta, nexts[id]]),
            Node::End { begin } => open.push(begin),
            Node::Join { end, .. } | Node::Final { end, .. } | Node::Tape { end, .. } => open.push(end),
            _ => {}
        }
    }
    needed
}

fn work(graph: &Graph, needed: &PerNode<bool>) -> Work {
    let mut work = Work::default();
    // How often the body of each open loop runs.
    let mut runs = vec![1_u64];
    for (_, node) in graph.iter().filter(|(id, _)| needed[*id]) {
        match node {
            Node::Apply(..) => work.operations += 1,
            Node::Theta { lo, hi, .. } => {
                let trips = match (graph[lo], graph[hi]) {
                    (Node::Int(lo), Node::Int(hi)) => u64::try_from(i64::from(hi) - i64::from(lo)).unwrap_or(0),
                    _ => u64::MAX,
                };
                let total = runs.last().copied().unwrap_or(1).saturating_mul(trips);
                work.long_loop |= total > LONG;
                runs.push(total);
            }
            Node::End { begin } if matches!(graph[begin], Node::Theta { .. }) => {
                runs.pop();
            }
            _ => {}
        }
    }
    work
}
