//! The reverse sweep: copies a graph and, where the first `diff` of a value stands, walks from that value back to its
//! inputs, so that one walk gives the derivatives by all of them (Griewank and Walther, *Evaluating Derivatives*, 2008,
//! section 3.2). A branch is walked by a branch that computes the side it took once more; how a loop is walked is in
//! `loops`, which loops can be in `trips`.
//!
//! A value that a choice or a branch did not take has the adjoint 0. It contributes nothing even where its partial
//! derivative is infinite (LANGUAGE 13.7), so products with such *masked* adjoints are guarded.

mod loops;
mod trips;

use std::collections::BTreeMap;
use std::collections::hash_map::Entry;

use isograd_graph::ops::{Derivative, Partial};
use isograd_graph::{Args, Builder, Exhausted, Graph, Mode, Node, NodeId, Op, Scalar, Watch};
use rustc_hash::FxHashMap;

use super::activity::Activity;
use super::{Diff, Orders, each_live};
use crate::raw::RawCopy;
use loops::Turn;
pub use trips::{Allowance, Loops, tapes_fit};

/// Copies `graph` with the `wanted` diffs, all of the outermost region and all ready, replaced by adjoints.
pub fn expand(
    graph: &Graph,
    activity: &Activity<'_>,
    wanted: &[Diff],
    loops: &Loops<'_>,
    mut orders: Orders<'_>,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<(Graph, Vec<u32>), Exhausted> {
    let first_seed = wanted.iter().map(|d| d.wrt).min().unwrap_or(NodeId(0));
    let wanted: FxHashMap<NodeId, Diff> = wanted.iter().map(|d| (d.node, *d)).collect();
    let mut sweep = Reverse {
        graph,
        activity,
        live: loops.live,
        loops,
        first_seed,
        b: Builder::new(Mode::Raw, max_nodes, watch),
        copy: RawCopy::new(graph),
        zero: NodeId::NONE,
        one: NodeId::NONE,
        frames: Vec::new(),
        pending: FxHashMap::default(),
    };
    // The adjoints of everything that a value depends on, by the value.
    let mut gradients: FxHashMap<NodeId, FxHashMap<NodeId, Adjoint>> = FxHashMap::default();
    each_live(graph, loops.live, |at, node| {
        if !matches!(node, Node::Input(_)) && sweep.zero == NodeId::NONE {
            (sweep.zero, sweep.one) = (sweep.b.real(0.0), sweep.b.real(1.0));
        }
        if let Some(diff) = wanted.get(&at) {
            let gradient = match gradients.entry(diff.value) {
                Entry::Occupied(found) => found.into_mut(),
                Entry::Vacant(place) => {
                    sweep.b.set_origin(graph.origin(at));
                    place.insert(sweep.walk(diff.value)?)
                }
            };
            let adjoint = gradient.get(&diff.wrt).map_or(sweep.zero, |a| a.node);
            let result = sweep.b.fresh(adjoint);
            sweep.copy.set(at, result);
            orders.note(result, orders.old(at).max(orders.of(sweep.copy.to(diff.value))) + 1);
        } else {
            let copied = sweep.copy.node(&mut sweep.b, at, node);
            let mut order = orders.old(at);
            node.each_operand(|x| order = order.max(orders.of(sweep.copy.to(x))));
            orders.note(copied, order);
        }
        sweep.budget()
    })?;
    for output in &graph.outputs {
        sweep.b.output(output.name.clone(), sweep.copy.to(output.node));
    }
    let graph = sweep.b.finish()?;
    Ok((graph, orders.into_new()))
}

/// How much the value changes with one of the values it is computed from.
#[derive(Clone, Copy)]
struct Adjoint {
    /// In the new graph.
    node: NodeId,
    /// Whether it may be 0 because a choice or branch went another way.
    masked: bool,
}

/// A side of a branch or the body of a loop that is being walked; the first frame is the outermost region.
#[derive(Default)]
struct Frame {
    /// The mark before its first node, in the old graph.
    begin: Option<NodeId>,
    /// Adjoints of its own values.
    own: FxHashMap<NodeId, Adjoint>,
    /// Adjoints of values outside of it, in order.
    outer: BTreeMap<NodeId, Adjoint>,
    /// Of the side walked before this one.
    other: BTreeMap<NodeId, Adjoint>,
    /// What stood for its nodes before they were copied once more.
    saved: Vec<(NodeId, NodeId)>,
    /// Of a loop, what ends it.
    turn: Option<Turn>,
}

/// A result of a branch or loop that has an adjoint.
#[derive(Clone, Copy)]
struct Pending {
    result: NodeId,
    adjoint: Adjoint,
}

struct Reverse<'g, 'w> {
    graph: &'g Graph,
    activity: &'g Activity<'g>,
    live: &'g [bool],
    loops: &'g Loops<'g>,
    first_seed: NodeId,
    b: Builder<'w>,
    copy: RawCopy<'g>,
    /// The constants 0 and 1, in the outermost region so that they are visible everywhere.
    zero: NodeId,
    one: NodeId,
    frames: Vec<Frame>,
    /// Results with adjoints, by the end of their branch or loop.
    pending: FxHashMap<NodeId, Vec<Pending>>,
}

impl Reverse<'_, '_> {
    fn budget(&self) -> Result<(), Exhausted> {
        self.b.exhausted().map_or(Ok(()), Err)
    }

    /// All adjoints of one value of the outermost region.
    fn walk(&mut self, value: NodeId) -> Result<FxHashMap<NodeId, Adjoint>, Exhausted> {
        self.b.set_apart(true);
        self.frames = vec![Frame::default()];
        self.pending.clear();
        self.add(value, Adjoint { node: self.one, masked: false });
        let mut at = Some(value);
        while let Some(id) = at.filter(|id| *id >= self.first_seed) {
            at = self.back(id).0.checked_sub(1).map(NodeId);
            self.budget()?;
        }
        self.b.set_apart(false);
        Ok(self.frames.pop().map_or_else(FxHashMap::default, |f| f.own))
    }

    /// Walks one node; returns it, or the begin of the structure that it ends if that is done with.
    fn back(&mut self, at: NodeId) -> NodeId {
        let Some(node) = self.graph.get(at) else { return at };
        match node {
            Node::End { begin } => match (self.pending.remove(&at), self.graph.get(begin)) {
                (None, _) | (_, None) => return begin,
                (Some(results), Some(Node::Gamma { cond, otherwise, .. })) => {
                    let taken = self.b.not(self.copy.to(cond));
                    self.b.gamma(taken);
                    self.enter(otherwise, at, Frame::default());
                    for Pending { result, adjoint } in &results {
                        if let Some(Node::Join { otherwise, .. }) = self.graph.get(*result) {
                            self.add(otherwise, *adjoint);
                        }
                    }
                    // The other side starts with the same results.
                    self.pending.insert(begin, results);
                }
                (Some(results), Some(_)) => {
                    if !self.turn(begin, at, &results) {
                        return begin;
                    }
                }
            },
            Node::Theta { .. } => self.leave_loop(),
            Node::Else { gamma } => {
                let side = self.leave();
                self.b.otherwise();
                self.enter(gamma, at, Frame { other: side.outer, ..Frame::default() });
                for Pending { result, adjoint } in self.pending.remove(&gamma).unwrap_or_default() {
                    if let Some(Node::Join { then, .. }) = self.graph.get(result) {
                        self.add(then, adjoint);
                    }
                }
            }
            Node::Gamma { .. } => {
                let side = self.leave();
                let end = self.b.end();
                let (then, otherwise) = (side.outer, side.other);
                let mut both: Vec<NodeId> = then.keys().chain(otherwise.keys()).copied().collect();
                both.sort_unstable();
                both.dedup();
                for of in both {
                    let (yes, no) = (then.get(&of), otherwise.get(&of));
                    let node = |a: Option<&Adjoint>| a.map_or(self.zero, |a| a.node);
                    // The new branch asks the opposite question.
                    let joined = self.b.join(end, node(no), node(yes));
                    let masked = yes.zip(no).is_none_or(|(a, b)| a.masked || b.masked);
                    self.add(of, Adjoint { node: joined, masked });
                }
            }
            _ => {
                let Some(adjoint) = self.frames.last().and_then(|f| f.own.get(&at)).copied() else { return at };
                match node {
                    Node::Apply(op, args) => self.apply(at, op, args.as_slice(), adjoint),
                    Node::Fresh(x) => self.add(x, adjoint),
                    Node::Join { end, .. } | Node::Final { end, .. } => {
                        self.pending.entry(end).or_default().push(Pending { result: at, adjoint });
                    }
                    _ => {}
                }
            }
        }
        at
    }

    /// Begins to walk the side between two marks: its values are computed once more, here.
    fn enter(&mut self, begin: NodeId, end: NodeId, frame: Frame) {
        let saved = self.again(NodeId(begin.0 + 1), end);
        self.frames.push(Frame { begin: Some(begin), saved, ..frame });
    }

    /// Ends the walk of a side.
    fn leave(&mut self) -> Frame {
        let mut side = self.frames.pop().unwrap_or_default();
        self.restore(std::mem::take(&mut side.saved));
        side
    }

    fn is_live(&self, id: NodeId) -> bool {
        self.live.get(id.index()).copied().unwrap_or(false)
    }

    /// Copies the nodes from the first up to the end once more; returns what stood for them.
    fn again(&mut self, first: NodeId, end: NodeId) -> Vec<(NodeId, NodeId)> {
        let mut saved = Vec::new();
        let mut at = first;
        while at < end {
            let Some(node) = self.graph.get(at) else { break };
            at = match node {
                Node::Gamma { end, .. } | Node::Theta { end, .. } if !self.is_live(at) => NodeId(end.0 + 1),
                _ if !self.is_live(at) => NodeId(at.0 + 1),
                // Of the loop whose body this is: the caller says what stands for it.
                Node::Counter { theta } | Node::Carried { theta, .. } if theta < first => NodeId(at.0 + 1),
                _ => {
                    saved.push((at, self.copy.to(at)));
                    self.copy.node(&mut self.b, at, node);
                    NodeId(at.0 + 1)
                }
            };
        }
        saved
    }

    fn restore(&mut self, saved: Vec<(NodeId, NodeId)>) {
        for (id, to) in saved.into_iter().rev() {
            self.copy.set(id, to);
        }
    }

    fn apply(&mut self, at: NodeId, op: Op, args: &[NodeId], adjoint: Adjoint) {
        let operands = Args::new(args).map(|x| self.copy.to(x));
        let operands = operands.as_slice();
        match &op.def().derivative {
            Derivative::Zero => {}
            Derivative::Choice { cond, then, otherwise } => {
                let (Some(then), Some(otherwise)) = (args.get(*then), args.get(*otherwise)) else { return };
                if then == otherwise {
                    return self.add(*then, adjoint);
                }
                let cond = cond(&mut self.b, operands);
                if self.is_active(*then) {
                    let node = self.b.select(cond, adjoint.node, self.zero);
                    self.add(*then, Adjoint { node, masked: true });
                }
                if self.is_active(*otherwise) {
                    let node = self.b.select(cond, self.zero, adjoint.node);
                    self.add(*otherwise, Adjoint { node, masked: true });
                }
            }
            Derivative::Partials(partials) => {
                let result = self.copy.to(at);
                for (arg, partial) in args.iter().zip(partials.iter()) {
                    if !self.is_active(*arg) {
                        continue;
                    }
                    let term = match partial {
                        Partial::Zero => continue,
                        Partial::One => adjoint,
                        Partial::MinusOne => Adjoint { node: self.b.neg(adjoint.node), ..adjoint },
                        Partial::Of(rule) => {
                            let slope = rule(&mut self.b, operands, result);
                            self.product(slope, adjoint)
                        }
                    };
                    self.add(*arg, term);
                }
            }
        }
    }

    fn is_active(&self, id: NodeId) -> bool {
        self.activity.active(id) != 0 && self.graph.scalar(id) == Scalar::Real
    }

    /// A partial derivative times an adjoint; 0 where the adjoint is 0 because another way was taken.
    fn product(&mut self, slope: NodeId, adjoint: Adjoint) -> Adjoint {
        if adjoint.node == self.one {
            return Adjoint { node: slope, masked: false };
        }
        let product = self.b.mul(slope, adjoint.node);
        if !adjoint.masked {
            return Adjoint { node: product, masked: false };
        }
        let off = self.b.eq(adjoint.node, self.zero);
        Adjoint { node: self.b.select(off, self.zero, product), masked: true }
    }

    fn sum(&mut self, a: Adjoint, b: Adjoint) -> Adjoint {
        Adjoint { node: self.b.add(a.node, b.node), masked: a.masked && b.masked }
    }

    /// Adds to the adjoint of a value, which is the walked side's own or lies outside of it.
    fn add(&mut self, of: NodeId, term: Adjoint) {
        if self.activity.active(of) == 0 {
            return;
        }
        let Some(frame) = self.frames.last() else { return };
        let own = frame.begin.is_none_or(|begin| of > begin);
        let before = if own { frame.own.get(&of) } else { frame.outer.get(&of) }.copied();
        let sum = match before {
            Some(before) => self.sum(before, term),
            None => term,
        };
        let Some(frame) = self.frames.last_mut() else { return };
        if own {
            frame.own.insert(of, sum);
        } else {
            frame.outer.insert(of, sum);
        }
    }
}
