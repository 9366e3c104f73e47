//! Rebuilding a graph through a folding builder: the driver that `fold`, `kernels` and `optimise` share. Copies live
//! nodes in order, takes decided branches, drops loops that do not run and variables that do not change.

use isograd_graph::{Builder, Exhausted, Graph, Mode, Node, NodeId, Op, Scalar, Value, Watch};

use crate::live::{finals, live};

/// What became of a gamma or theta.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    /// Copied, or not reached.
    Kept,
    /// The condition is constant: one side was copied in its place.
    Decided(bool),
    /// Both sides are copied in its place, and results selected.
    Flat,
    /// The loop has no iteration.
    Empty,
}

/// Copies `graph` into a builder of `mode`; `apply` makes what stands for an operation on copied operands.
///
/// # Errors
/// If the budget is spent.
pub fn copy(
    graph: &Graph,
    mode: Mode,
    max_nodes: usize,
    watch: &dyn Watch,
    apply: impl FnMut(&mut Builder<'_>, Op, &[NodeId]) -> NodeId,
) -> Result<Graph, Exhausted> {
    copy_flat(graph, mode, &|_| false, max_nodes, watch, apply)
}

/// As [`copy`]; `apply` is told which node it makes anew.
///
/// # Errors
/// If the budget is spent.
pub fn copy_each(
    graph: &Graph,
    mode: Mode,
    max_nodes: usize,
    watch: &dyn Watch,
    apply: impl FnMut(&mut Builder<'_>, NodeId, Op, &[NodeId]) -> NodeId,
) -> Result<Graph, Exhausted> {
    run(graph, mode, &|_| false, max_nodes, watch, apply)
}

/// As [`copy`]; the gammas that `flat` names become selections: both sides are computed, results selected.
///
/// # Errors
/// If the budget is spent.
pub fn copy_flat(
    graph: &Graph,
    mode: Mode,
    flat: &dyn Fn(NodeId) -> bool,
    max_nodes: usize,
    watch: &dyn Watch,
    mut apply: impl FnMut(&mut Builder<'_>, Op, &[NodeId]) -> NodeId,
) -> Result<Graph, Exhausted> {
    run(graph, mode, flat, max_nodes, watch, |b, _, op, args| apply(b, op, args))
}

fn run(
    graph: &Graph,
    mode: Mode,
    flat: &dyn Fn(NodeId) -> bool,
    max_nodes: usize,
    watch: &dyn Watch,
    apply: impl FnMut(&mut Builder<'_>, NodeId, Op, &[NodeId]) -> NodeId,
) -> Result<Graph, Exhausted> {
    let mut copier = Copier {
        graph,
        live: live(graph),
        map: vec![NodeId::NONE; graph.len()],
        fate: vec![Fate::Kept; graph.len()],
        flat,
        final_of: finals(graph),
        algebra: matches!(mode, Mode::Real(_)),
        builder: Builder::new(mode, max_nodes, watch),
        apply,
    };
    let mut at = NodeId(0);
    while let Some(node) = graph.get(at) {
        at = copier.node(at, node);
        if let Some(why) = copier.builder.exhausted() {
            return Err(why);
        }
    }
    for output in &graph.outputs {
        let node = copier.to(output.node);
        copier.builder.output(output.name.clone(), node);
    }
    copier.builder.finish()
}

struct Copier<'g, 'w, F> {
    graph: &'g Graph,
    live: Vec<bool>,
    map: Vec<NodeId>,
    fate: Vec<Fate>,
    flat: &'g dyn Fn(NodeId) -> bool,
    final_of: Vec<NodeId>,
    /// Whether loops may be simplified: what that finds constant is no constant of the program (LANGUAGE 17.3).
    algebra: bool,
    builder: Builder<'w>,
    apply: F,
}

impl<F: FnMut(&mut Builder<'_>, NodeId, Op, &[NodeId]) -> NodeId> Copier<'_, '_, F> {
    fn to(&self, id: NodeId) -> NodeId {
        self.map.get(id.index()).copied().unwrap_or(NodeId::NONE)
    }

    fn set(&mut self, id: NodeId, to: NodeId) {
        if let Some(place) = self.map.get_mut(id.index()) {
            *place = to;
        }
    }

    fn fate(&self, id: NodeId) -> Fate {
        self.fate.get(id.index()).copied().unwrap_or(Fate::Kept)
    }

    fn decide(&mut self, id: NodeId, fate: Fate) {
        if let Some(place) = self.fate.get_mut(id.index()) {
            *place = fate;
        }
    }

    /// Copies one node and says which comes next.
    fn node(&mut self, at: NodeId, node: Node) -> NodeId {
        let next = NodeId(at.0 + 1);
        if let Node::Input(i) = node {
            let input = self.graph.inputs.get(i as usize);
            let to = self.builder.input(input.map_or("?", |x| x.name.as_str()), self.graph.scalar(at));
            self.set(at, to);
            return next;
        }
        if !self.live.get(at.index()).copied().unwrap_or(false) {
            return match node {
                Node::Gamma { end, .. } | Node::Theta { end, .. } => NodeId(end.0 + 1),
                _ => next,
            };
        }
        self.builder.set_origin(self.graph.origin(at));
        let to = match node {
            Node::Input(_) => return next,
            Node::Real(bits) => self.builder.real(f64::from_bits(bits)),
            Node::Int(x) => self.builder.int(x),
            Node::Bool(x) => self.builder.bool(x),
            Node::Apply(op, args) => {
                let operands = args.map(|x| self.to(x));
                (self.apply)(&mut self.builder, at, op, operands.as_slice())
            }
            Node::Fresh(x) => {
                let x = self.to(x);
                self.builder.fresh(x)
            }
            Node::Diff { value, wrt } => {
                let (value, wrt) = (self.to(value), self.to(wrt));
                self.builder.diff(value, wrt)
            }
            // No copy is made before enclosures are gone.
            Node::Within { .. } | Node::Bound { .. } => NodeId::NONE,
            Node::Gamma { cond, otherwise, .. } => {
                let cond = self.to(cond);
                if let Some(Value::Bool(truth)) = self.builder.value(cond) {
                    self.decide(at, Fate::Decided(truth));
                    return if truth { next } else { NodeId(otherwise.0 + 1) };
                }
                if (self.flat)(at) {
                    self.decide(at, Fate::Flat);
                    self.set(at, cond);
                    return next;
                }
                self.builder.gamma(cond)
            }
            Node::Else { gamma } => {
                if self.fate(gamma) == Fate::Flat {
                    return next;
                }
                if let (Fate::Decided(_), Some(Node::Gamma { end, .. })) = (self.fate(gamma), self.graph.get(gamma)) {
                    return end;
                }
                self.builder.otherwise();
                return next;
            }
            Node::End { begin } => {
                if self.fate(begin) != Fate::Kept {
                    return next;
                }
                self.builder.end()
            }
            Node::Join { end, then, otherwise } => {
                let begin = self.begin(end);
                let (then, otherwise) = (self.to(then), self.to(otherwise));
                match self.fate(begin) {
                    Fate::Decided(truth) => {
                        if truth {
                            then
                        } else {
                            otherwise
                        }
                    }
                    Fate::Flat => {
                        let select = match self.graph.scalar(at) {
                            Scalar::Real => Op::Select,
                            Scalar::Int => Op::SelectInt,
                            Scalar::Bool => Op::SelectBool,
                        };
                        let cond = self.to(begin);
                        self.builder.op(select, &[cond, then, otherwise])
                    }
                    _ => self.builder.join(self.to(end), then, otherwise),
                }
            }
            Node::Theta { lo, hi, end } => {
                let (lo, hi) = (self.to(lo), self.to(hi));
                if let (true, Some(Value::Int(a)), Some(Value::Int(b))) =
                    (self.algebra, self.builder.value(lo), self.builder.value(hi))
                    && a >= b
                {
                    self.decide(at, Fate::Empty);
                    return NodeId(end.0 + 1);
                }
                self.round_inits(at, end);
                self.builder.theta(lo, hi)
            }
            Node::Counter { .. } => self.builder.counter(),
            Node::Carried { init, .. } => {
                let init = self.to(init);
                if self.unchanging(at) { init } else { self.builder.carried(init) }
            }
            Node::Tape { end, value, every } => match self.fate(self.begin(end)) {
                // Of an iteration that there is not.
                Fate::Empty => self.builder.constant(Value::zero(self.graph.scalar(at))),
                _ => self.builder.tape(self.to(end), self.to(value), every),
            },
            Node::Recall { tape, at } => {
                let (tape, at) = (self.to(tape), self.to(at));
                self.builder.recall(tape, at)
            }
            Node::Final { end, carried, next } => match (self.fate(self.begin(end)), self.graph.get(carried)) {
                (Fate::Empty, Some(Node::Carried { init, .. })) => self.to(init),
                _ if self.unchanging(carried) => self.to(carried),
                _ => self.builder.carry_out(self.to(end), self.to(carried), self.to(next)),
            },
        };
        self.set(at, to);
        next
    }

    /// Rounds what the variables of a loop hold at first, while the builder is still outside of it.
    fn round_inits(&mut self, theta: NodeId, end: NodeId) {
        for index in theta.0 + 1..end.0 {
            if let Some(Node::Carried { theta: of, init }) = self.graph.get(NodeId(index))
                && of == theta
            {
                let init = self.to(init);
                self.builder.rounded(init);
            }
        }
    }

    fn begin(&self, end: NodeId) -> NodeId {
        match self.graph.get(end) {
            Some(Node::End { begin }) => begin,
            _ => NodeId::NONE,
        }
    }

    /// Whether an iteration gives a carried variable its own content.
    fn unchanging(&self, carried: NodeId) -> bool {
        let final_of = self.final_of.get(carried.index()).copied().unwrap_or(NodeId::NONE);
        self.algebra && matches!(self.graph.get(final_of), Some(Node::Final { next, .. }) if next == carried)
    }
}
