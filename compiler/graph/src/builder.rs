//! The only way to make a graph: appends nodes and shares equal ones. What an operation means is in `ops`; which
//! rewrites a folding builder applies is in `ops::rewrite`.

use std::fmt;

use rustc_hash::FxHashMap;

use crate::ops::Accuracy;
use crate::{Args, Graph, Input, Node, NodeId, Op, Origin, Output, Part, Precision, Scalar, Value, Watch, ops};

/// How a [`Builder`] treats what it is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Shares equal nodes of one region and does nothing else, so that `diff` finds the values that LANGUAGE 13.3
    /// tells apart. Real constants are unrounded f64.
    Raw,
    /// Computes operations on constants in f64 and rounds a constant where it meets a value that is none
    /// (LANGUAGE 17.3), and shares equal nodes. No other algebra.
    Exact(Precision),
    /// Shares equal nodes, computes operations on constants in `real`, and applies the rewrites that preserve bits.
    Real(Precision),
}

impl Mode {
    /// The precision that real constants are rounded to in the finished graph.
    #[must_use]
    pub const fn precision(self) -> Option<Precision> {
        match self {
            Self::Raw => None,
            Self::Exact(p) | Self::Real(p) => Some(p),
        }
    }
}

/// Why a builder stopped growing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exhausted {
    /// More nodes than allowed.
    Nodes(usize),
    /// The [`Watch`] said so.
    Time,
}

impl fmt::Display for Exhausted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nodes(n) => write!(f, "more than {n} nodes"),
            Self::Time => f.write_str("out of time"),
        }
    }
}

impl std::error::Error for Exhausted {}

/// How often the watch is asked, in nodes.
const POLL: usize = 4096;

/// Added to the scope of nodes made with [`Builder::set_apart`].
const APART: u32 = 1 << 31;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Scope {
    id: u32,
    /// The gamma or theta that owns the region; `NONE` for the outermost and for scopes without a region.
    owner: NodeId,
}

/// Builds one graph. Never fails: over its budget it stops growing, and [`Builder::finish`] says so; loops over
/// user-sized input ask [`Builder::exhausted`] now and then.
pub struct Builder<'w> {
    graph: Graph,
    mode: Mode,
    shared: FxHashMap<(u32, Node), NodeId>,
    scopes: Vec<Scope>,
    next_scope: u32,
    /// The scope each node was made in, as a depth in `scopes` at that time.
    depths: Vec<u32>,
    origin: Origin,
    max_nodes: usize,
    watch: &'w dyn Watch,
    exhausted: Option<Exhausted>,
    apart: bool,
}

impl<'w> Builder<'w> {
    /// An empty graph with a budget.
    #[must_use]
    pub fn new(mode: Mode, max_nodes: usize, watch: &'w dyn Watch) -> Self {
        Self {
            graph: Graph { precision: mode.precision(), ..Graph::default() },
            mode,
            shared: FxHashMap::default(),
            scopes: vec![Scope { id: 0, owner: NodeId::NONE }],
            next_scope: 1,
            depths: Vec::new(),
            origin: Origin::default(),
            max_nodes,
            watch,
            exhausted: None,
            apart: false,
        }
    }

    /// The mode.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The graph so far.
    #[must_use]
    pub const fn graph(&self) -> &Graph {
        &self.graph
    }

    /// Sets where the nodes made from now on come from.
    pub const fn set_origin(&mut self, origin: Origin) {
        self.origin = origin;
    }

    /// Whether the budget is spent.
    #[must_use]
    pub const fn exhausted(&self) -> Option<Exhausted> {
        self.exhausted
    }

    /// The finished graph.
    ///
    /// # Errors
    /// If the budget was spent; the graph is then incomplete.
    pub fn finish(self) -> Result<Graph, Exhausted> {
        match self.exhausted {
            Some(why) => Err(why),
            None => Ok(self.graph),
        }
    }

    /// Marks what is made from now on as no part of the program: it is shared among itself, never with what the
    /// program wrote. Differentiation makes its nodes so, because a derivative that happens to look like a value of
    /// the program must not depend on it (LANGUAGE 13.3.6).
    pub const fn set_apart(&mut self, apart: bool) {
        self.apart = apart;
    }

    /// Adds a copy of a node, never shared: transforms of raw graphs keep apart what elaboration kept apart. Not for
    /// marks, inputs and carried variables.
    pub fn append(&mut self, node: Node, scalar: Scalar) -> NodeId {
        self.push(node, scalar)
    }

    fn push(&mut self, node: Node, scalar: Scalar) -> NodeId {
        let n = self.graph.nodes.len();
        if self.exhausted.is_none() {
            if n >= self.max_nodes {
                self.exhausted = Some(Exhausted::Nodes(self.max_nodes));
            } else if n % POLL == POLL - 1 && self.watch.expired() {
                self.exhausted = Some(Exhausted::Time);
            }
        }
        if self.exhausted.is_some() && n > 0 {
            return NodeId(0);
        }
        self.graph.nodes.push(node);
        self.graph.scalars.push(scalar);
        self.graph.origins.push(self.origin);
        self.depths.push(self.depth());
        NodeId(u32::try_from(n).unwrap_or(u32::MAX))
    }

    fn depth(&self) -> u32 {
        u32::try_from(self.scopes.len()).unwrap_or(u32::MAX).saturating_sub(1)
    }

    /// A node equal to one that is visible here, or a new one. Raw graphs share within one region only, but
    /// constants, which are no values of their own, everywhere.
    fn share(&mut self, node: Node, scalar: Scalar) -> NodeId {
        let here = self.scopes.len().saturating_sub(1);
        let constant = matches!(node, Node::Real(_) | Node::Int(_) | Node::Bool(_));
        let mut deepest = 0;
        node.each_operand(|x| deepest = deepest.max(self.depths.get(x.index()).copied().unwrap_or(0) as usize));
        let outermost = if self.mode == Mode::Raw && !constant && !self.apart { here } else { deepest.min(here) };
        let apart = if self.apart && !constant { APART } else { 0 };
        for scope in self.scopes.get(outermost..).unwrap_or(&[]).iter().rev() {
            if let Some(id) = self.shared.get(&(scope.id | apart, node)) {
                return *id;
            }
        }
        let id = self.push(node, scalar);
        let scope = self.scopes.last().map_or(0, |s| s.id) | apart;
        if self.exhausted.is_none() {
            self.shared.insert((scope, node), id);
        }
        id
    }

    /// Adds a parameter scalar. All inputs are made before anything else.
    pub fn input(&mut self, name: impl Into<String>, scalar: Scalar) -> NodeId {
        let index = u32::try_from(self.graph.inputs.len()).unwrap_or(u32::MAX);
        self.graph.inputs.push(Input { name: name.into(), scalar });
        self.push(Node::Input(index), scalar)
    }

    /// Adds a result scalar: a node of the outermost region.
    pub fn output(&mut self, name: impl Into<String>, node: NodeId) {
        let node = self.rounded(node);
        self.graph.outputs.push(Output { name: name.into(), node });
    }

    /// A constant.
    pub fn constant(&mut self, value: Value) -> NodeId {
        match value {
            Value::Real(x) => self.real(x),
            Value::Int(x) => self.int(x),
            Value::Bool(x) => self.bool(x),
        }
    }

    /// A real constant. All NaNs are one.
    pub fn real(&mut self, x: f64) -> NodeId {
        let x = if x.is_nan() { f64::NAN } else { x };
        let x = if let Mode::Real(precision) = self.mode { precision.round(x) } else { x };
        self.share(Node::real(x), Scalar::Real)
    }

    /// An int constant.
    pub fn int(&mut self, x: i32) -> NodeId {
        self.share(Node::Int(x), Scalar::Int)
    }

    /// A truth constant.
    pub fn bool(&mut self, x: bool) -> NodeId {
        self.share(Node::Bool(x), Scalar::Bool)
    }

    /// The value of a constant node.
    #[must_use]
    pub fn value(&self, id: NodeId) -> Option<Value> {
        match self.graph.get(id)? {
            Node::Real(bits) => Some(Value::Real(f64::from_bits(bits))),
            Node::Int(x) => Some(Value::Int(x)),
            Node::Bool(x) => Some(Value::Bool(x)),
            _ => None,
        }
    }

    /// In an exact builder, a constant rounded to `real`, for use beside a value that is not constant. What a loop's
    /// variables hold at first must be rounded before the loop begins, or the constant would lie inside.
    pub fn rounded(&mut self, id: NodeId) -> NodeId {
        let Mode::Exact(precision) = self.mode else { return id };
        match self.value(id) {
            Some(Value::Real(x)) if precision.round(x).to_bits() != x.to_bits() && !x.is_nan() => {
                self.share(Node::real(precision.round(x)), Scalar::Real)
            }
            _ => id,
        }
    }

    /// `x`; a constant of the program is rounded to `real` here (LANGUAGE 15.3).
    pub fn rounded_to_real(&mut self, x: NodeId) -> NodeId {
        self.op(Op::Rounded, &[x])
    }

    /// Applies an operation of the table.
    pub fn op(&mut self, op: Op, args: &[NodeId]) -> NodeId {
        let precision = match self.mode {
            Mode::Raw => return self.share(Node::Apply(op, Args::new(args)), op.def().result),
            Mode::Exact(precision) if op.def().accuracy == Accuracy::Directed => precision,
            Mode::Exact(_) => Precision::F64,
            Mode::Real(precision) => precision,
        };
        let mut values = [Value::Int(0); 4];
        let constant = args.iter().zip(&mut values).all(|(arg, place)| match self.value(*arg) {
            Some(Value::Real(x)) => {
                *place = Value::Real(precision.round(x));
                true
            }
            Some(value) => {
                *place = value;
                true
            }
            None => false,
        });
        if constant && let Some(value) = ops::constant(op, values.get(..args.len()).unwrap_or(&[]), precision) {
            return self.constant(value);
        }
        let mut operands = [NodeId::NONE; 4];
        for (place, arg) in operands.iter_mut().zip(args) {
            *place = self.rounded(*arg);
        }
        let operands = operands.get_mut(..args.len().min(4)).unwrap_or(&mut []);
        if let Mode::Real(_) = self.mode
            && let Some(id) = ops::rewrite(self, op, operands)
        {
            return id;
        }
        if let [a, b, ..] = operands
            && op.def().commutes
            && a > b
        {
            std::mem::swap(a, b);
        }
        self.share(Node::Apply(op, Args::new(operands)), op.def().result)
    }

    /// A value of its own that equals `x` (LANGUAGE 13.3); in a folding builder `x` itself.
    pub fn fresh(&mut self, x: NodeId) -> NodeId {
        match self.mode {
            Mode::Raw => self.push(Node::Fresh(x), self.graph.scalar(x)),
            Mode::Exact(_) | Mode::Real(_) => x,
        }
    }

    /// The derivative of `value` by `wrt`; raw graphs only.
    pub fn diff(&mut self, value: NodeId, wrt: NodeId) -> NodeId {
        self.share(Node::Diff { value, wrt }, Scalar::Real)
    }

    /// A box of these components `(wrt, lo, hi, nan)`; raw graphs only. `NONE` if there are none.
    pub fn within(&mut self, components: &[(NodeId, NodeId, NodeId, NodeId)]) -> NodeId {
        components.iter().rev().fold(NodeId::NONE, |next, (wrt, lo, hi, nan)| {
            self.share(Node::Within { wrt: *wrt, lo: *lo, hi: *hi, nan: *nan, next }, Scalar::Bool)
        })
    }

    /// A part of the enclosure of `value` in a box; raw graphs only.
    pub fn bound(&mut self, value: NodeId, within: NodeId, part: Part) -> NodeId {
        self.share(Node::Bound { value, within, part }, part.scalar())
    }

    /// Opens a scope without a region: what is made inside is not shared with what was made outside of it, as if it
    /// stood in a branch (LANGUAGE 13.3.5).
    pub fn open_scope(&mut self) {
        self.enter(NodeId::NONE);
    }

    /// Closes the scope opened last.
    pub fn close_scope(&mut self) {
        self.leave();
    }

    fn enter(&mut self, owner: NodeId) {
        self.scopes.push(Scope { id: self.next_scope, owner });
        self.next_scope += 1;
    }

    fn leave(&mut self) -> NodeId {
        if self.scopes.len() > 1 { self.scopes.pop().map_or(NodeId::NONE, |s| s.owner) } else { NodeId::NONE }
    }

    fn owner(&self) -> NodeId {
        self.scopes.last().map_or(NodeId::NONE, |s| s.owner)
    }

    /// Ids of the scopes around this place, the innermost first. Equal nodes are found through them; a producer may
    /// key its own memory by them.
    pub fn scopes(&self) -> impl Iterator<Item = u32> + '_ {
        self.scopes.iter().rev().map(|s| s.id)
    }

    /// Begins a branch; what follows up to [`Builder::otherwise`] is the side for true.
    pub fn gamma(&mut self, cond: NodeId) -> NodeId {
        let node = Node::Gamma { cond, otherwise: NodeId::NONE, end: NodeId::NONE };
        let id = self.push(node, Scalar::Bool);
        self.enter(id);
        id
    }

    /// Ends the side for true and begins the other.
    pub fn otherwise(&mut self) {
        let gamma = self.leave();
        let mark = self.push(Node::Else { gamma }, Scalar::Bool);
        if let Some(Node::Gamma { otherwise, .. }) = self.graph.nodes.get_mut(gamma.index()) {
            *otherwise = mark;
        }
        self.enter(gamma);
    }

    /// Ends the branch or loop begun last and returns its end.
    pub fn end(&mut self) -> NodeId {
        let begin = self.leave();
        let mark = self.push(Node::End { begin }, Scalar::Bool);
        if let Some(Node::Gamma { end, .. } | Node::Theta { end, .. }) = self.graph.nodes.get_mut(begin.index()) {
            *end = mark;
        }
        mark
    }

    /// A result of the branch with this end.
    pub fn join(&mut self, end: NodeId, then: NodeId, otherwise: NodeId) -> NodeId {
        let (then, otherwise) = (self.rounded(then), self.rounded(otherwise));
        if matches!(self.mode, Mode::Real(_)) && then == otherwise && self.visible(then) {
            return then;
        }
        let node = Node::Join { end, then, otherwise };
        if self.mode == Mode::Raw && !self.apart {
            // Each variable that a branch writes is a new value, even if two are given the same (LANGUAGE 13.3.3).
            return self.push(node, self.graph.scalar(then));
        }
        self.share(node, self.graph.scalar(then))
    }

    /// Whether a node made earlier lies in a region that is still open.
    fn visible(&self, id: NodeId) -> bool {
        let depth = self.depths.get(id.index()).copied().unwrap_or(u32::MAX) as usize;
        match self.scopes.get(depth) {
            // A node of this depth may belong to a closed sibling: the owner of the open scope must precede it.
            Some(scope) => depth == 0 || (scope.owner != NodeId::NONE && self.after_mark(scope.owner, id)),
            None => false,
        }
    }

    fn after_mark(&self, owner: NodeId, id: NodeId) -> bool {
        match self.graph.get(owner) {
            Some(Node::Gamma { otherwise, .. }) if otherwise != NodeId::NONE => id > otherwise,
            _ => id > owner,
        }
    }

    /// Begins a loop over `lo..hi`.
    pub fn theta(&mut self, lo: NodeId, hi: NodeId) -> NodeId {
        let id = self.push(Node::Theta { lo, hi, end: NodeId::NONE }, Scalar::Int);
        self.enter(id);
        id
    }

    /// The counter of the loop begun last.
    pub fn counter(&mut self) -> NodeId {
        let theta = self.owner();
        self.share(Node::Counter { theta }, Scalar::Int)
    }

    /// A new carried variable of the loop begun last; [`Builder::carry_out`] must name it after the end.
    pub fn carried(&mut self, init: NodeId) -> NodeId {
        let theta = self.owner();
        let init = self.rounded(init);
        self.push(Node::Carried { theta, init }, self.graph.scalar(init))
    }

    /// The content of a carried variable after the loop with this end; `next` is what an iteration gives it.
    pub fn carry_out(&mut self, end: NodeId, carried: NodeId, next: NodeId) -> NodeId {
        let next = self.rounded(next);
        self.push(Node::Final { end, carried, next }, self.graph.scalar(carried))
    }

    /// What a value was in the first of every so many iterations of the loop with this end, whose bounds are constant;
    /// to be read with [`Builder::recall`]. The loop's finals have been made.
    pub fn tape(&mut self, end: NodeId, value: NodeId, every: u32) -> NodeId {
        match self.value(value) {
            Some(constant) => self.constant(constant),
            None if matches!(self.mode, Mode::Real(_)) && self.visible(value) => value,
            None => self.share(Node::Tape { end, value, every }, self.graph.scalar(value)),
        }
    }

    /// What a tape has of one of the iterations that it holds, by number from 0.
    pub fn recall(&mut self, tape: NodeId, at: NodeId) -> NodeId {
        match (self.value(tape), self.graph.get(tape)) {
            (Some(constant), _) => self.constant(constant),
            (None, Some(Node::Tape { .. })) => self.share(Node::Recall { tape, at }, self.graph.scalar(tape)),
            // The same in all iterations.
            (None, _) => tape,
        }
    }
}

/// Short names for the operations that rules and kernels are written in.
macro_rules! shorthand {
    ($( $name:ident ( $($arg:ident),+ ) $op:ident; )+) => {
        #[allow(missing_docs, reason = "each is the operation of its name")]
        impl Builder<'_> {
            $( pub fn $name(&mut self, $($arg: NodeId),+) -> NodeId { self.op(Op::$op, &[$($arg),+]) } )+
        }
    };
}

shorthand! {
    add(a, b) Add; sub(a, b) Sub; mul(a, b) Mul; div(a, b) Div; neg(a) Neg; sqrt(a) Sqrt; abs(a) Abs;
    floor(a) Floor; ceil(a) Ceil; trunc(a) Trunc; min(a, b) Min; max(a, b) Max; sign(a) Sign; unit(a, l) Unit;
    copysign(a, b) Copysign; exponent(a) Exponent; scale(a, n) Scale;
    lt(a, b) Lt; le(a, b) Le; eq(a, b) Eq; ne(a, b) Ne;
    and(a, b) And; or(a, b) Or; not(a) Not;
    select(c, a, b) Select; select_int(c, a, b) SelectInt; select_bool(c, a, b) SelectBool;
    iadd(a, b) IntAdd; isub(a, b) IntSub; imul(a, b) IntMul; idiv(a, b) IntDiv; ieq(a, b) IntEq; ilt(a, b) IntLt;
    int_to_real(a) IntToReal; real_to_int(a) RealToInt;
    sin(a) Sin; cos(a) Cos; exp(a) Exp; log(a) Log; pow(a, b) Pow;
    next_down(a) NextDown; next_up(a) NextUp; add_down(a, b) AddDown; add_up(a, b) AddUp; mul_down(a, b) MulDown;
    mul_up(a, b) MulUp; div_down(a, b) DivDown; div_up(a, b) DivUp; sqrt_down(a) SqrtDown; sqrt_up(a) SqrtUp;
    product_below(a, b, c) ProductBelow;
}
