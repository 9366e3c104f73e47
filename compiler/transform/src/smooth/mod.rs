//! `smooth` mode: puts smooth functions in the place of operations that have kinks or jumps, values included (LANGUAGE
//! 14.3). Knows nothing of derivatives, which it comes before, and treats what later steps add as none of its business.
//!
//! One sweep from left to right. Beside each truth value that a comparison of reals has a part in goes its *weight*, a
//! real from 0 to 1, and what is left of 1: through `&&` and `!`, out of branches and around loops. A branch that such a
//! value decides is no branch any more: both sides are computed, in scopes of their own, and their results are blended.
//!
//! Every value of the program becomes one node again, so `diff` finds by which it differentiates. The nodes that a
//! formula needs inside are set apart: what happens to look like a value of the program is none (LANGUAGE 13.3).

mod formulas;
mod jumps;
mod softness;

use isograd_graph::{Builder, Exhausted, Graph, Mode, Node, NodeId, Op, Scalar, Value, Watch};

use crate::raw::RawCopy;
use formulas::{Formulas, Weight};
use softness::Softness;

pub use formulas::{Width, WidthError};
pub use jumps::{Jump, kept_jumps};

/// What [`smooth`] makes.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothed {
    /// The graph.
    pub graph: Graph,
    /// What stands for each node of the graph before, by its index; `NONE` for marks.
    pub places: Vec<NodeId>,
}

/// Makes a raw graph smooth, before any `diff` in it is expanded.
///
/// # Errors
/// If the budget is spent.
pub fn smooth(graph: &Graph, width: Width, max_nodes: usize, watch: &dyn Watch) -> Result<Smoothed, Exhausted> {
    let mut sweep = Sweep {
        graph,
        softness: Softness::of(graph),
        formulas: Formulas::of(width),
        b: Builder::new(Mode::Raw, max_nodes, watch),
        copy: RawCopy::new(graph),
        weights: vec![None; graph.len()],
    };
    let mut at = NodeId(0);
    while let Some(node) = graph.get(at) {
        at = sweep.node(at, node);
        if let Some(why) = sweep.b.exhausted() {
            return Err(why);
        }
    }
    for output in &graph.outputs {
        sweep.b.output(output.name.clone(), sweep.copy.to(output.node));
    }
    let places = graph.iter().map(|(id, _)| sweep.copy.to(id)).collect();
    Ok(Smoothed { graph: sweep.b.finish()?, places })
}

struct Sweep<'g, 'w> {
    graph: &'g Graph,
    softness: Softness,
    formulas: Formulas,
    b: Builder<'w>,
    copy: RawCopy<'g>,
    /// Of the truth values that need one.
    weights: Vec<Option<Weight>>,
}

impl Sweep<'_, '_> {
    /// Copies or replaces a node, or the variables of a loop together, and says which comes next.
    fn node(&mut self, at: NodeId, node: Node) -> NodeId {
        let next = NodeId(at.0 + 1);
        self.b.set_origin(self.graph.origin(at));
        match node {
            Node::Apply(op, args) => self.apply(at, node, op, args.as_slice()),
            Node::Gamma { cond, .. } if self.softness.is_soft(cond) => self.b.open_scope(),
            Node::Else { gamma } if self.is_blended(gamma) => {
                self.b.close_scope();
                self.b.open_scope();
            }
            Node::End { begin } if self.is_blended(begin) => self.b.close_scope(),
            Node::Join { end, then, otherwise } => self.join(at, node, end, then, otherwise),
            Node::Fresh(x) if self.softness.is_soft(at) => {
                let weight = self.weight(x);
                self.put(at, weight);
                self.settle(at);
            }
            Node::Theta { .. } => {
                self.copy.node(&mut self.b, at, node);
                let own = |node: &Node| match node {
                    Node::Carried { theta, .. } | Node::Counter { theta } => *theta == at,
                    _ => false,
                };
                return self.together(next, own);
            }
            Node::End { .. } => {
                self.copy.node(&mut self.b, at, node);
                return self.together(next, |node| matches!(node, Node::Final { end, .. } if *end == at));
            }
            Node::Carried { .. } | Node::Final { .. } => {
                self.variable(at, node);
                self.settle(at);
            }
            _ => {
                self.copy.node(&mut self.b, at, node);
                self.settle(at);
            }
        }
        next
    }

    /// Copies the variables of a loop from `first` on: nothing may stand between them, so what follows from them comes
    /// after the last.
    fn together(&mut self, first: NodeId, own: impl Fn(&Node) -> bool) -> NodeId {
        let is_constant = |node: &Node| matches!(node, Node::Real(_) | Node::Int(_) | Node::Bool(_));
        let mut at = first;
        while let Some(node) = self.graph.get(at).filter(|node| own(node) || is_constant(node)) {
            self.b.set_origin(self.graph.origin(at));
            self.variable(at, node);
            at = NodeId(at.0 + 1);
        }
        for id in first.0..at.0 {
            self.b.set_origin(self.graph.origin(NodeId(id)));
            self.settle(NodeId(id));
        }
        at
    }

    /// A carried variable, or what is left of it after the loop; of a soft truth value its weight instead.
    fn variable(&mut self, at: NodeId, node: Node) {
        if !self.softness.is_soft(at) {
            self.copy.node(&mut self.b, at, node);
            return;
        }
        let weight = match node {
            Node::Carried { init, .. } => {
                let Weight { yes, no } = self.weight(init);
                Weight { yes: self.b.carried(yes), no: self.b.carried(no) }
            }
            Node::Final { end, carried, next } => {
                let (end, next) = (self.copy.to(end), self.weight(next));
                let Weight { yes, no } = self.weight(carried);
                Weight { yes: self.b.carry_out(end, yes, next.yes), no: self.b.carry_out(end, no, next.no) }
            }
            _ => return,
        };
        self.put(at, weight);
    }

    /// Whether the branch that begins with this gamma is none any more. Loops are not.
    fn is_blended(&self, begin: NodeId) -> bool {
        matches!(self.graph.get(begin), Some(Node::Gamma { cond, .. }) if self.softness.is_soft(cond))
    }

    fn weight(&self, of: NodeId) -> Weight {
        self.weights.get(of.index()).copied().flatten().unwrap_or(Weight { yes: NodeId::NONE, no: NodeId::NONE })
    }

    fn put(&mut self, of: NodeId, weight: Weight) {
        if let Some(place) = self.weights.get_mut(of.index()) {
            *place = Some(weight);
        }
    }

    /// Makes the truth value of a weight, or the weight of a truth value that needs one.
    fn settle(&mut self, at: NodeId) {
        self.b.set_apart(true);
        if self.softness.is_soft(at) {
            let weight = self.weight(at);
            let truth = self.formulas.truth(&mut self.b, weight);
            self.copy.set(at, truth);
        } else if self.softness.is_weighed(at) {
            let weight = self.formulas.crisp(&mut self.b, self.copy.to(at));
            self.put(at, weight);
        }
        self.b.set_apart(false);
    }

    /// A value of the program that a formula gives.
    fn value(&mut self, at: NodeId, result: NodeId) {
        self.b.set_apart(false);
        let result = self.b.fresh(result);
        self.copy.set(at, result);
    }

    fn apply(&mut self, at: NodeId, node: Node, op: Op, args: &[NodeId]) {
        let to = |i: usize| args.get(i).map_or(NodeId::NONE, |x| self.copy.to(*x));
        let weight = |i: usize| args.get(i).map_or_else(|| self.weight(NodeId::NONE), |x| self.weight(*x));
        let (x, y, z) = (to(0), to(1), to(2));
        let (s, t, u) = (weight(0), weight(1), weight(2));
        let is_soft = self.softness.is_soft(at);
        let by_weight = args.first().is_some_and(|x| self.softness.is_soft(*x));
        let (f, b) = (self.formulas, &mut self.b);
        b.set_apart(true);
        match op {
            Op::Max | Op::Min => {
                let result = f.extreme(b, op, x, y);
                self.value(at, result);
            }
            Op::Abs => {
                let result = f.abs(b, x);
                self.value(at, result);
            }
            Op::Sign => {
                let result = f.sign(b, x);
                self.value(at, result);
            }
            Op::Select if by_weight => {
                let result = f.blend(b, s, x, y, z);
                self.value(at, result);
            }
            _ if is_soft => {
                let weight = match op {
                    Op::Lt | Op::Le => f.less(b, op, x, y),
                    Op::And => f.both(b, s, t),
                    Op::Or => f.both(b, s.not(), t.not()).not(),
                    Op::Not => s.not(),
                    _ => Weight { yes: b.select(x, t.yes, u.yes), no: b.select(x, t.no, u.no) },
                };
                self.put(at, weight);
                self.settle(at);
            }
            _ => {
                b.set_apart(false);
                self.copy.node(&mut self.b, at, node);
                self.settle(at);
            }
        }
    }

    fn join(&mut self, at: NodeId, node: Node, end: NodeId, then: NodeId, otherwise: NodeId) {
        let begin = match self.graph.get(end) {
            Some(Node::End { begin }) => begin,
            _ => NodeId::NONE,
        };
        let Some(Node::Gamma { cond, .. }) = self.graph.get(begin).filter(|_| self.is_blended(begin)) else {
            if self.softness.is_soft(at) {
                let (end, s, t) = (self.copy.to(end), self.weight(then), self.weight(otherwise));
                let weight = Weight { yes: self.b.join(end, s.yes, t.yes), no: self.b.join(end, s.no, t.no) };
                self.put(at, weight);
            } else {
                self.copy.node(&mut self.b, at, node);
            }
            return self.settle(at);
        };
        let (x, y, z) = (self.copy.to(cond), self.copy.to(then), self.copy.to(otherwise));
        let (s, t, u) = (self.weight(cond), self.weight(then), self.weight(otherwise));
        let (f, b) = (self.formulas, &mut self.b);
        b.set_apart(true);
        match self.graph.scalar(at) {
            Scalar::Real => {
                let result = f.blend(b, s, x, y, z);
                self.value(at, result);
            }
            Scalar::Bool if self.softness.is_soft(at) => {
                let weight = Weight { yes: b.select(x, t.yes, u.yes), no: b.select(x, t.no, u.no) };
                self.put(at, weight);
                self.settle(at);
            }
            Scalar::Bool => {
                let chosen = b.select_bool(x, y, z);
                self.copy.set(at, chosen);
                self.settle(at);
            }
            Scalar::Int => {
                let chosen = b.select_int(x, y, z);
                b.set_apart(false);
                self.copy.set(at, chosen);
            }
        }
    }
}

/// The number that a node is, if it is a literal.
fn literal(b: &Builder<'_>, x: NodeId) -> Option<f64> {
    match b.value(x) {
        Some(Value::Real(x)) => Some(x),
        _ => None,
    }
}
