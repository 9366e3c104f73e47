//! The sweep: copies a graph and makes the needed tangents beside each value.

use isograd_graph::ops::{Derivative, Partial};
use isograd_graph::{Args, Builder, Exhausted, Graph, Mode, Node, NodeId, Op, Watch};
use rustc_hash::{FxHashMap, FxHashSet};

use super::activity::Activity;
use super::{Diff, Orders, each_live};
use crate::raw::RawCopy;

/// A needed tangent: the value's id in the old graph and the seed's index.
type Key = (NodeId, u32);

/// Copies `graph` with the `wanted` diffs replaced by tangents. Also returns how many rounds each value of the new
/// graph has been through.
pub fn expand(
    graph: &Graph,
    activity: &Activity<'_>,
    wanted: &[Diff],
    live: &[bool],
    orders: Orders<'_>,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<(Graph, Vec<u32>), Exhausted> {
    let mut sweep = Forward {
        graph,
        activity,
        needed: activity.needed(wanted),
        wanted: wanted.iter().map(|d| d.node).collect(),
        b: Builder::new(Mode::Raw, max_nodes, watch),
        copy: RawCopy::new(graph),
        tangents: FxHashMap::default(),
        zero: NodeId::NONE,
        one: NodeId::NONE,
        orders,
    };
    each_live(graph, live, |at, node| {
        sweep.node(at, node);
        sweep.b.exhausted().map_or(Ok(()), Err)
    })?;
    for output in &graph.outputs {
        sweep.b.output(output.name.clone(), sweep.copy.to(output.node));
    }
    Ok((sweep.b.finish()?, sweep.orders.into_new()))
}

struct Forward<'g, 'w> {
    graph: &'g Graph,
    activity: &'g Activity<'g>,
    needed: Vec<u64>,
    wanted: FxHashSet<NodeId>,
    b: Builder<'w>,
    copy: RawCopy<'g>,
    tangents: FxHashMap<Key, NodeId>,
    /// The constants 0 and 1, in the outermost region so that they are visible everywhere.
    zero: NodeId,
    one: NodeId,
    orders: Orders<'g>,
}

impl Forward<'_, '_> {
    fn node(&mut self, at: NodeId, node: Node) {
        if !matches!(node, Node::Input(_)) && self.zero == NodeId::NONE {
            (self.zero, self.one) = (self.b.real(0.0), self.b.real(1.0));
        }
        let order = self.orders.old(at);
        if let (Node::Diff { value, wrt }, true) = (node, self.wanted.contains(&at)) {
            self.b.set_origin(self.graph.origin(at));
            let tangent = self.activity.seed(wrt).and_then(|bit| self.tangent(value, bit.trailing_zeros()));
            let order = order.max(self.order_below(value)) + u32::from(tangent.is_some());
            let result = self.b.fresh(tangent.unwrap_or(self.zero));
            self.copy.set(at, result);
            self.orders.note(result, order);
            return;
        }
        let copied = self.copy.node(&mut self.b, at, node);
        let mut below = order;
        node.each_operand(|x| below = below.max(self.order_below(x)));
        self.orders.note(copied, below);
        let seed = self.activity.seed(at).unwrap_or(0);
        let bits = self.needed.get(at.index()).copied().unwrap_or(0) & self.activity.active(at);
        let bits = bits & !seed;
        if bits != 0 {
            self.b.set_apart(true);
            self.derive(at, node, bits);
            self.b.set_apart(false);
        }
    }

    fn order_below(&self, old: NodeId) -> u32 {
        self.orders.of(self.copy.to(old))
    }

    /// The tangent of a value by the seed with this index, if it depends on it.
    fn tangent(&self, of: NodeId, seed: u32) -> Option<NodeId> {
        if self.activity.seed(of) == Some(1 << seed) {
            return Some(self.one);
        }
        self.tangents.get(&(of, seed)).copied()
    }

    /// Makes the tangents of a node for the seeds in `bits`.
    fn derive(&mut self, at: NodeId, node: Node, bits: u64) {
        match node {
            Node::Apply(op, args) => self.apply(at, op, args.as_slice(), bits),
            _ => {
                for seed in indices(bits) {
                    if let Some(tangent) = self.structural(node, seed) {
                        self.tangents.insert((at, seed), tangent);
                    }
                }
            }
        }
    }

    /// The tangent of a node that is no operation.
    fn structural(&mut self, node: Node, seed: u32) -> Option<NodeId> {
        match node {
            Node::Fresh(x) => self.tangent(x, seed),
            Node::Join { end, then, otherwise } => {
                let then = self.tangent(then, seed).unwrap_or(self.zero);
                let otherwise = self.tangent(otherwise, seed).unwrap_or(self.zero);
                Some(self.b.join(self.copy.to(end), then, otherwise))
            }
            Node::Carried { init, .. } => {
                let init = self.tangent(init, seed).unwrap_or(self.zero);
                Some(self.b.carried(init))
            }
            Node::Final { end, carried, next } => {
                let tangent = self.tangent(carried, seed)?;
                let next = self.tangent(next, seed).unwrap_or(self.zero);
                Some(self.b.carry_out(self.copy.to(end), tangent, next))
            }
            Node::Tape { end, value, every } => {
                let tangent = self.tangent(value, seed)?;
                Some(self.b.tape(self.copy.to(end), tangent, every))
            }
            Node::Recall { tape, at } => {
                let tangent = self.tangent(tape, seed)?;
                Some(self.b.recall(tangent, self.copy.to(at)))
            }
            _ => None,
        }
    }

    fn apply(&mut self, at: NodeId, op: Op, args: &[NodeId], bits: u64) {
        let operands = Args::new(args).map(|x| self.copy.to(x));
        let operands = operands.as_slice();
        let result = self.copy.to(at);
        match &op.def().derivative {
            Derivative::Zero => {}
            Derivative::Choice { cond, then, otherwise } => {
                let (Some(then), Some(otherwise)) = (args.get(*then), args.get(*otherwise)) else { return };
                let cond = cond(&mut self.b, operands);
                for seed in indices(bits) {
                    let yes = self.tangent(*then, seed).unwrap_or(self.zero);
                    let no = self.tangent(*otherwise, seed).unwrap_or(self.zero);
                    let tangent = if yes == no { yes } else { self.b.select(cond, yes, no) };
                    self.tangents.insert((at, seed), tangent);
                }
            }
            Derivative::Partials(partials) => {
                let mut sums: FxHashMap<u32, NodeId> = FxHashMap::default();
                for (arg, partial) in args.iter().zip(partials.iter()) {
                    let mut slope = None;
                    for seed in indices(bits & self.activity.active(*arg)) {
                        let Some(inner) = self.tangent(*arg, seed) else { continue };
                        let term = match partial {
                            Partial::Zero => continue,
                            Partial::One => inner,
                            Partial::MinusOne => self.b.neg(inner),
                            Partial::Of(rule) => {
                                let slope = *slope.get_or_insert_with(|| rule(&mut self.b, operands, result));
                                if inner == self.one { slope } else { self.b.mul(slope, inner) }
                            }
                        };
                        let sum = match sums.get(&seed) {
                            Some(sum) => self.b.add(*sum, term),
                            None => term,
                        };
                        sums.insert(seed, sum);
                    }
                }
                for seed in indices(bits) {
                    if let Some(sum) = sums.get(&seed) {
                        self.tangents.insert((at, seed), *sum);
                    }
                }
            }
        }
    }
}

/// Indices of the bits set.
fn indices(bits: u64) -> impl Iterator<Item = u32> {
    (0..u64::BITS).filter(move |i| bits >> i & 1 == 1)
}
