//! Differentiation: expands every `diff` of a raw graph (LANGUAGE 13), by one rule per operation for both directions,
//! and every `bound`, by [`crate::bound`].
//!
//! A *seed* is a value that some `diff` differentiates by. The forward sweep, from left to right, carries beside each
//! value its tangents for up to 64 seeds; partial derivatives are built once and shared by all tangents. Only tangents
//! that lie on a path from a seed to a `diff` are made: `activity` finds the paths. Loops stay loops: a tangent of a
//! carried variable is a carried variable beside it. The reverse sweep walks from a differentiated value back to all
//! its seeds at once. A `diff` or `bound` on a path must be gone first, so
//! nested ones take one round each, the inner first.

mod activity;
mod forward;
mod reverse;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use isograd_graph::{Builder, Exhausted, Graph, Mode, Node, NodeId, Origin, Precision, Scalar, Watch};

use crate::bound;
use crate::live::live;
use crate::raw::RawCopy;

pub(crate) use activity::{Activity, carried_finals};
use reverse::{Allowance, Loops, tapes_fit};

/// Seeds of one sweep: bits of a word.
const BATCH: usize = 64;

/// How many `diff`s are tried to find one that depends on itself, for a message.
const TRIED: usize = 16;

/// Why a graph cannot be differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DifferentiateError {
    /// Out of budget.
    Exhausted(Exhausted),
    /// A `diff` in a loop depends, through carried variables, on itself (LANGUAGE 13.4).
    Growing {
        /// The `diff`.
        diff: Origin,
        /// One of the variables.
        carried: Option<Origin>,
    },
    /// A `diff` inside more others than allowed.
    Order(Origin),
    /// A `bound` in a loop depends, through carried variables, on itself.
    Nesting {
        /// The `bound`.
        bound: Origin,
        /// One of the variables.
        carried: Option<Origin>,
    },
    /// A loop on the way to what a `bound` encloses iterates as often as a value in its box says (LANGUAGE 15.5).
    LoopBound {
        /// The `bound`.
        call: Origin,
        /// The bound of the loop.
        bound: Origin,
    },
}

impl fmt::Display for DifferentiateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exhausted(why) => why.fmt(f),
            Self::Growing { .. } => f.write_str("the order of a derivative grows with the trip count of its loop"),
            Self::Order(_) => f.write_str("derivatives are nested too deeply"),
            Self::Nesting { .. } => f.write_str("a `bound` is nested in itself as often as its loop iterates"),
            Self::LoopBound { .. } => f.write_str("a number of iterations depends on what a `bound` replaces"),
        }
    }
}

impl std::error::Error for DifferentiateError {}

impl From<Exhausted> for DifferentiateError {
    fn from(why: Exhausted) -> Self {
        Self::Exhausted(why)
    }
}

/// Which way derivatives are computed; both give the same up to rounding (LANGUAGE 13.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Sweep {
    /// Tangents, with the values: one sweep for each value that is differentiated by.
    Forward,
    /// Adjoints, against the values, wherever fewer values are differentiated than they are differentiated by;
    /// tangents elsewhere: inside of branches and loops, and in loops whose trip count is not constant.
    Reverse,
}

/// One `diff` of a graph.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diff {
    pub node: NodeId,
    pub value: NodeId,
    pub wrt: NodeId,
}

/// Expands every `diff` and `bound` that an output needs, the inner ones first. `max_order` counts `diff` inside `diff`.
///
/// Reverse differentiation walks a loop with a constant trip count back by tapes, of 64 KiB a point at most altogether;
/// any other loop takes part by its Jacobian by all it reads, made forward.
///
/// # Errors
/// If an order grows with a trip count or exceeds `max_order`, if a number of iterations depends on what a `bound`
/// replaces, or the budget is spent.
pub fn differentiate(
    graph: Graph,
    sweep: Sweep,
    precision: Precision,
    max_order: u64,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Graph, DifferentiateError> {
    if sweep == Sweep::Forward {
        return rounds(graph, sweep, Allowance::NONE, max_order, max_nodes, watch);
    }
    for allowance in Allowance::of(precision) {
        let result = rounds(graph.clone(), sweep, allowance, max_order, max_nodes, watch)?;
        if allowance == Allowance::NONE || tapes_fit(&result, &live(&result), precision) {
            return Ok(result);
        }
    }
    Ok(graph)
}

/// The rounds of [`differentiate`], with tapes as allowed.
fn rounds(
    mut graph: Graph,
    sweep: Sweep,
    allowance: Allowance,
    max_order: u64,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Graph, DifferentiateError> {
    let mut orders = vec![0_u32; graph.len()];
    loop {
        if let Some(at) = orders.iter().position(|o| u64::from(*o) > max_order) {
            let node = NodeId(u32::try_from(at).unwrap_or(u32::MAX));
            return Err(DifferentiateError::Order(graph.origin(node)));
        }
        let live = live(&graph);
        let is_live = |id: NodeId| live.get(id.index()).copied().unwrap_or(false);
        let diffs: Vec<Diff> = diffs(&graph).filter(|d| is_live(d.node)).collect();
        let bounds: Vec<_> = bound::bounds(&graph).filter(|b| is_live(b.node)).collect();
        if diffs.is_empty() && bounds.is_empty() {
            return cleared(graph, &live, max_nodes, watch);
        }
        if !bounds.is_empty() {
            let before = Orders { old: &orders, new: Vec::new() };
            if let Some(expanded) = bound::expand(&graph, &bounds, &live, before, max_nodes, watch)? {
                (graph, orders) = expanded;
                continue;
            }
        }
        if sweep == Sweep::Reverse {
            let loops = Loops::of(&graph, &live, allowance);
            if let Some((activity, ready)) = reversible(&graph, &diffs, &loops, |values, seeds| values < seeds) {
                let before = Orders { old: &orders, new: Vec::new() };
                (graph, orders) = reverse::expand(&graph, &activity, &ready, &loops, before, max_nodes, watch)?;
                continue;
            }
        }
        let mut progress = false;
        for batch in batches(&diffs) {
            let activity = activity::Activity::of(&graph, &batch);
            let ready: Vec<Diff> =
                diffs.iter().copied().filter(|d| activity.seed(d.wrt).is_some() && activity.ready(d)).collect();
            if ready.is_empty() {
                continue;
            }
            let before = Orders { old: &orders, new: Vec::new() };
            (graph, orders) = forward::expand(&graph, &activity, &ready, &live, before, max_nodes, watch)?;
            progress = true;
            break;
        }
        if !progress {
            return Err(growing(&graph, &diffs, &bounds));
        }
    }
}

/// Without what is left of expanded `bound`s.
fn cleared(graph: Graph, live: &[bool], max_nodes: usize, watch: &dyn Watch) -> Result<Graph, DifferentiateError> {
    if !graph.iter().any(|(_, node)| matches!(node, Node::Within { .. } | Node::Bound { .. })) {
        return Ok(graph);
    }
    let mut b = Builder::new(Mode::Raw, max_nodes, watch);
    let mut copy = RawCopy::new(&graph);
    each_live(&graph, live, |at, node| {
        copy.node(&mut b, at, node);
        b.exhausted().map_or(Ok(()), Err)
    })?;
    for output in &graph.outputs {
        b.output(output.name.clone(), copy.to(output.node));
    }
    Ok(b.finish()?)
}

/// The first of these `diff`s and `bound`s that depends on its own result, with a carried variable on the way to it.
/// Without the variable, and of the first, if none of those that are tried is found to.
fn growing(graph: &Graph, diffs: &[Diff], bounds: &[bound::Bound]) -> DifferentiateError {
    let finals = graph.iter().filter_map(|(_, node)| match node {
        Node::Final { carried, next, .. } => Some((carried, next)),
        _ => None,
    });
    let next_of: BTreeMap<NodeId, NodeId> = finals.collect();
    let candidates = diffs.iter().map(|d| (d.node, d.value)).chain(bounds.iter().map(|b| (b.node, b.value)));
    let mut tried = candidates.clone().take(TRIED);
    let cycle = tried.find_map(|(node, value)| Some((node, Some(carried_result(graph, &next_of, node, value)?))));
    let first = candidates.clone().next().map_or(NodeId::NONE, |(node, _)| node);
    let (node, carried) = cycle.unwrap_or((first, None));
    let (place, carried) = (graph.origin(node), carried.map(|c| graph.origin(c)));
    match graph.get(node) {
        Some(Node::Bound { .. }) => DifferentiateError::Nesting { bound: place, carried },
        _ => DifferentiateError::Growing { diff: place, carried },
    }
}

/// The carried variable through which the result of a `diff` or `bound` comes back to its value.
fn carried_result(graph: &Graph, next_of: &BTreeMap<NodeId, NodeId>, result: NodeId, value: NodeId) -> Option<NodeId> {
    // Against the dependences: for each node found, the one it was found from.
    let mut from: BTreeMap<NodeId, NodeId> = BTreeMap::from([(value, NodeId::NONE)]);
    let mut open = vec![value];
    while let Some(at) = open.pop() {
        if at == result {
            let user = |id: &NodeId| from.get(id).copied();
            let path = std::iter::successors(Some(at), user).zip(std::iter::successors(user(&at), user));
            return path.filter(|(x, user)| next_of.get(user) == Some(x)).map(|(_, user)| user).next();
        }
        let mut visit = |x: NodeId| {
            if graph.scalar(x) == Scalar::Real && !from.contains_key(&x) {
                from.insert(x, at);
                open.push(x);
            }
        };
        match graph.get(at) {
            Some(Node::Diff { value, .. }) => visit(value),
            Some(node) => node.each_operand(&mut visit),
            None => {}
        }
        next_of.get(&at).into_iter().for_each(|next| visit(*next));
    }
    None
}

/// Whether [`Sweep::Reverse`] may pay for this graph: whether some values are differentiated by at least four times as
/// many. A walk back costs about as much as three or four tangents.
#[must_use]
pub fn reverse_is_plausible(graph: &Graph) -> bool {
    let live = live(graph);
    let diffs: Vec<Diff> = diffs(graph).filter(|d| live.get(d.node.index()).copied().unwrap_or(false)).collect();
    let [most, ..] = Allowance::of(Precision::F32);
    let loops = Loops::of(graph, &live, most);
    reversible(graph, &diffs, &loops, |values, seeds| values.saturating_mul(4) <= seeds).is_some()
}

fn diffs(graph: &Graph) -> impl Iterator<Item = Diff> {
    graph.iter().filter_map(|(node, n)| match n {
        Node::Diff { value, wrt } => Some(Diff { node, value, wrt }),
        _ => None,
    })
}

/// The `diff`s on a path from what they differentiate by to what they differentiate; the value of any other is 0
/// (LANGUAGE 13.2). Stops early, and calls all others active, if time is up.
#[must_use]
pub fn active_diffs(graph: &Graph, watch: &dyn Watch) -> BTreeSet<NodeId> {
    let mut diffs: Vec<Diff> = diffs(graph).collect();
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

/// The `diff`s that one walk each for their distinct values expands, if their numbers of distinct values and seeds are
/// worth it. They stand in the outermost region, and not at the end of a loop whose Jacobian is made forward; nor does
/// any lie behind a tape: there is no walk back through one.
fn reversible<'g>(
    graph: &'g Graph,
    diffs: &[Diff],
    loops: &Loops<'_>,
    worth_it: impl Fn(usize, usize) -> bool,
) -> Option<(activity::Activity<'g>, Vec<Diff>)> {
    let mut depth = 0_usize;
    let outermost = graph.iter().filter(|(_, node)| {
        match node {
            Node::Gamma { .. } | Node::Theta { .. } => depth += 1,
            Node::End { .. } => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth == 0
    });
    let outermost: Vec<NodeId> = outermost.map(|(id, _)| id).collect();
    let stands = |d: &&Diff| outermost.binary_search(&d.node).is_ok() && !loops.stuck_at(graph, d.value);
    let distinct = |of: fn(&Diff) -> NodeId, diffs: &[Diff]| diffs.iter().map(of).collect::<BTreeSet<NodeId>>();
    let mut ready: Vec<Diff> = diffs.iter().filter(stands).copied().collect();
    let seeds: Vec<NodeId> = distinct(|d| d.wrt, &ready).into_iter().collect();
    let activity = activity::Activity::together(graph, &seeds);
    ready.retain(|d| activity.ready(d));
    if graph.iter().any(|(id, node)| matches!(node, Node::Tape { .. }) && activity.active(id) != 0) {
        return None;
    }
    let (values, seeds) = (distinct(|d| d.value, &ready).len(), distinct(|d| d.wrt, &ready).len());
    (values > 0 && worth_it(values, seeds)).then_some((activity, ready))
}

/// Calls `visit` with each live node, structures as a whole.
pub(crate) fn each_live(
    graph: &Graph,
    live: &[bool],
    mut visit: impl FnMut(NodeId, Node) -> Result<(), Exhausted>,
) -> Result<(), Exhausted> {
    let mut at = NodeId(0);
    while let Some(node) = graph.get(at) {
        let dead = !live.get(at.index()).copied().unwrap_or(false);
        at = match node {
            Node::Gamma { end, .. } | Node::Theta { end, .. } if dead => end,
            Node::Input(_) => {
                visit(at, node)?;
                at
            }
            _ if dead => at,
            _ => {
                visit(at, node)?;
                at
            }
        };
        at = NodeId(at.0 + 1);
    }
    Ok(())
}

/// How many rounds of expansion each value has been through: of the graph a round starts from, and of the one it makes.
pub(crate) struct Orders<'o> {
    old: &'o [u32],
    new: Vec<u32>,
}

impl Orders<'_> {
    /// Of a value of the old graph.
    pub(crate) fn old(&self, id: NodeId) -> u32 {
        self.old.get(id.index()).copied().unwrap_or(0)
    }

    /// Of a value of the new graph.
    pub(crate) fn of(&self, id: NodeId) -> u32 {
        self.new.get(id.index()).copied().unwrap_or(0)
    }

    /// Of a value of the new graph from now on.
    pub(crate) fn note(&mut self, id: NodeId, order: u32) {
        if id == NodeId::NONE || order == 0 {
            return;
        }
        if self.new.len() <= id.index() {
            self.new.resize(id.index() + 1, 0);
        }
        if let Some(place) = self.new.get_mut(id.index()) {
            *place = order;
        }
    }

    /// For each value of the new graph that has been through any.
    pub(crate) fn into_new(self) -> Vec<u32> {
        self.new
    }
}

/// The distinct seeds in order, at most [`BATCH`] at a time.
fn batches(diffs: &[Diff]) -> Vec<Vec<NodeId>> {
    let mut seeds: Vec<NodeId> = diffs.iter().map(|d| d.wrt).collect();
    seeds.sort_unstable();
    seeds.dedup();
    seeds.chunks(BATCH).map(<[NodeId]>::to_vec).collect()
}
