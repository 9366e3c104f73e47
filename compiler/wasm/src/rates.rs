//! Which nodes are computed at all, which are the same in every lane, and which once per call. Knows the graph;
//! knows nothing of instructions.

use isograd_graph::ops::Family;
use isograd_graph::{Graph, Node, NodeId, PerNode, Structure, Work};
use rustc_hash::FxHashMap;

use crate::EmitError;

/// The facts about a graph that emission needs.
pub struct Rates {
    /// Whether an output depends on it.
    pub needed: PerNode<bool>,
    /// Whether it has the same value in every lane that computes it. A uniform node inside of a branch that lanes
    /// take one by one is computed when any takes it.
    pub uniform: PerNode<bool>,
    /// Whether it is computed before the loop over the points.
    pub early: PerNode<bool>,
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

impl Rates {
    /// Computes the facts.
    pub fn new(graph: &Graph, varying: &[bool]) -> Result<Self, EmitError> {
        let Structure { needed, joins, carried, tapes, next, work } = Structure::new(graph, Family::Lanes)?;
        let uniform = uniform(graph, varying, &next);
        let early = early(graph, &needed, &uniform, &next, &joins);
        Ok(Self { needed, uniform, early, joins, carried, tapes, next, work })
    }
}

/// Calls `f` with each node whose rate decides this node's.
fn rate_operands(graph: &Graph, id: NodeId, node: Node, nexts: &PerNode<NodeId>, mut f: impl FnMut(NodeId)) {
    match node {
        Node::Join { end, then, otherwise } => {
            f(then);
            f(otherwise);
            if let Some(Node::Gamma { cond, .. }) = graph.get(graph.owner(end)) {
                f(cond);
            }
        }
        // All running lanes have made the same number of iterations.
        Node::Counter { theta } => {
            if let Some(Node::Theta { lo, .. }) = graph.get(theta) {
                f(lo);
            }
        }
        Node::Carried { theta, init } => {
            f(init);
            f(nexts[id]);
            if let Some(Node::Theta { lo, hi, .. }) = graph.get(theta) {
                f(lo);
                f(hi);
            }
        }
        Node::Final { carried, .. } => f(carried),
        Node::Apply(..) | Node::Tape { .. } | Node::Recall { .. } => node.each_operand(f),
        _ => {}
    }
}

/// Spreads "varying" from the varying inputs to everything that depends on it. Each edge is looked at once.
fn uniform(graph: &Graph, varying: &[bool], nexts: &PerNode<NodeId>) -> PerNode<bool> {
    // The users of each node, one list after the other: those of node n are at starts[n]..starts[n + 1].
    let mut starts = vec![0_usize; graph.len() + 2];
    for (id, node) in graph.iter() {
        rate_operands(graph, id, node, nexts, |x| {
            if let Some(count) = starts.get_mut(x.index() + 2) {
                *count += 1;
            }
        });
    }
    let mut sum = 0;
    for start in &mut starts {
        sum += *start;
        *start = sum;
    }
    let mut users = vec![NodeId::NONE; sum];
    for (id, node) in graph.iter() {
        rate_operands(graph, id, node, nexts, |x| {
            if let Some(place) = starts.get_mut(x.index() + 1) {
                if let Some(user) = users.get_mut(*place) {
                    *user = id;
                }
                *place += 1;
            }
        });
    }

    let mut uniform = PerNode::new(graph, true);
    let inputs =
        graph.iter().filter(|(_, node)| matches!(node, Node::Input(i) if varying.get(*i as usize) == Some(&true)));
    let mut open: Vec<NodeId> = inputs.map(|(id, _)| id).collect();
    while let Some(id) = open.pop() {
        if !std::mem::replace(&mut uniform[id], false) {
            continue;
        }
        let range = starts.get(id.index()).zip(starts.get(id.index() + 1));
        if let Some((from, to)) = range {
            open.extend_from_slice(users.get(*from..*to).unwrap_or(&[]));
        }
    }
    uniform
}

/// What can be computed once, before the loop over the points: uniform nodes of the outermost region, and branches
/// and loops there if all that they compute, read and give is.
fn early(
    graph: &Graph,
    needed: &PerNode<bool>,
    uniform: &PerNode<bool>,
    nexts: &PerNode<NodeId>,
    joins: &FxHashMap<NodeId, Vec<NodeId>>,
) -> PerNode<bool> {
    let mut early = PerNode::new(graph, false);
    let mut nodes = graph.iter();
    while let Some((id, node)) = nodes.next() {
        if let Node::Gamma { end, .. } | Node::Theta { end, .. } = node {
            let ready = |early: &PerNode<bool>, x: NodeId| uniform[x] && ((x > id && x < end) || early[x]);
            let all_ready = |early: &PerNode<bool>, at: NodeId, node: Node| {
                let mut all = true;
                node.each_operand(|x| all &= ready(early, x));
                if let Node::Carried { .. } = node {
                    all &= ready(early, nexts[at]) || graph[nexts[at]].is_constant();
                }
                all
            };
            let mut whole = all_ready(&early, id, node);
            for (at, node) in nodes.by_ref() {
                whole &= !needed[at] || (uniform[at] && all_ready(&early, at, node));
                if at == end {
                    break;
                }
            }
            // The results too: an operand of a join may be varying, or may be computed after the branch.
            for join in joins.get(&end).into_iter().flatten() {
                if let Node::Join { then, otherwise, .. } = graph[*join] {
                    let fits = |x| ready(&early, x) || graph[x].is_constant();
                    whole &= uniform[*join] && fits(then) && fits(otherwise);
                }
            }
            (id.0..=end.0).map(NodeId).for_each(|at| early[at] = whole);
        } else {
            let mut all = uniform[id];
            node.each_operand(|x| all &= early[x]);
            if let Node::Join { end, .. } | Node::Final { end, .. } | Node::Tape { end, .. } = node {
                all &= early[end];
            }
            early[id] = all;
        }
    }
    early
}
