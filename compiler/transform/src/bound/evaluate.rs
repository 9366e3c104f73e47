//! Enclosures of all values of a graph at once, as numbers: an abstract interpreter for proofs at compile time and for
//! specialisation. It computes with the rules of the op table, and knows no operation itself.

use isograd_graph::{Builder, Enclosure, Graph, Mode, Node, NodeId, Op, Precision, Range, Scalar, Value, Watch};

use super::facts::facts;
use crate::differentiate::carried_finals;

/// What is known of a scalar over everything that can run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hull {
    /// It is never computed: a branch that is decided leaves its side out.
    Never,
    /// A real; both ends are NaN if it is NaN always.
    Real {
        /// The lower end.
        lo: f64,
        /// The upper end.
        hi: f64,
        /// Whether it may be NaN.
        nan: bool,
    },
    /// An int.
    Int {
        /// The least.
        lo: i32,
        /// The largest.
        hi: i32,
    },
    /// A truth value.
    Bool {
        /// Whether it may be true.
        yes: bool,
        /// Whether it may be false.
        no: bool,
    },
}

impl Hull {
    /// Of one value.
    #[must_use]
    pub const fn point(value: Value) -> Self {
        match value {
            Value::Real(x) if x.is_nan() => Self::anything(Scalar::Real),
            Value::Real(x) => Self::Real { lo: x, hi: x, nan: false },
            Value::Int(x) => Self::Int { lo: x, hi: x },
            Value::Bool(x) => Self::Bool { yes: x, no: !x },
        }
    }

    /// Of every value of a kind.
    #[must_use]
    pub const fn anything(kind: Scalar) -> Self {
        match kind {
            Scalar::Real => Self::Real { lo: f64::NEG_INFINITY, hi: f64::INFINITY, nan: true },
            Scalar::Int => Self::Int { lo: i32::MIN, hi: i32::MAX },
            Scalar::Bool => Self::Bool { yes: true, no: true },
        }
    }

    /// Whether it holds this value.
    #[must_use]
    pub fn contains(self, value: Value) -> bool {
        match (self, value) {
            (Self::Real { nan, .. }, Value::Real(x)) if x.is_nan() => nan,
            (Self::Real { lo, hi, .. }, Value::Real(x)) => lo <= x && x <= hi,
            (Self::Int { lo, hi }, Value::Int(x)) => lo <= x && x <= hi,
            (Self::Bool { yes, no }, Value::Bool(x)) => {
                if x {
                    yes
                } else {
                    no
                }
            }
            _ => false,
        }
    }

    /// The truth value that it is always.
    #[must_use]
    pub const fn decided(self) -> Option<bool> {
        match self {
            Self::Bool { yes: true, no: false } => Some(true),
            Self::Bool { yes: false, no: true } => Some(false),
            _ => None,
        }
    }

    /// As an operation reads it: a real with ends in order, and anything if an end is NaN (LANGUAGE 15.2).
    fn tidied(self) -> Self {
        match self {
            Self::Real { lo, hi, nan } if lo <= hi => Self::Real { lo, hi, nan },
            Self::Real { lo, hi, nan } if hi <= lo => Self::Real { lo: hi, hi: lo, nan },
            Self::Real { .. } => Self::anything(Scalar::Real),
            other => other,
        }
    }

    /// What holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        match (self.tidied(), other.tidied()) {
            (Self::Real { lo, hi, nan }, Self::Real { lo: lo2, hi: hi2, nan: nan2 }) => {
                Self::Real { lo: lo.min(lo2), hi: hi.max(hi2), nan: nan || nan2 }
            }
            (Self::Int { lo, hi }, Self::Int { lo: lo2, hi: hi2 }) => Self::Int { lo: lo.min(lo2), hi: hi.max(hi2) },
            (Self::Bool { yes, no }, Self::Bool { yes: yes2, no: no2 }) => {
                Self::Bool { yes: yes || yes2, no: no || no2 }
            }
            (Self::Never, _) => other,
            _ => self,
        }
    }

    fn rounded(self, precision: Precision) -> Self {
        match self {
            Self::Real { lo, hi, nan } => Self::Real { lo: precision.round(lo), hi: precision.round(hi), nan },
            other => other,
        }
    }
}

/// What becomes of loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loops {
    /// Those with a known number of iterations run, as long as no more than so many nodes are computed in all.
    Run {
        /// That many.
        max_steps: u64,
    },
    /// Of what a loop carries, nothing is known.
    Unbounded,
}

/// For every node the hull, over everything that can run, of the enclosure of its value (LANGUAGE 15) while each input
/// lies in its box. Of what a loop carries whose number of iterations is not known, or that would take too many steps,
/// nothing is known, nor of a `diff` or `bound`. The graph is raw or folded. `None` if time is up.
#[must_use]
pub fn enclosures(
    graph: &Graph,
    inputs: &[Hull],
    precision: Precision,
    loops: Loops,
    watch: &dyn Watch,
) -> Option<Vec<Hull>> {
    let never = vec![Hull::Never; graph.len()];
    let mut run = Run {
        graph,
        inputs,
        precision,
        steps_left: match loops {
            Loops::Run { max_steps } => max_steps,
            Loops::Unbounded => 0,
        },
        current: never.clone(),
        hulls: never,
        constants: vec![None; graph.len()],
        real: Folder::new(Mode::Real(precision), watch),
        exact: graph.precision.is_none().then(|| Folder::new(Mode::Exact(precision), watch)),
        frames: Vec::new(),
    };
    // What an iteration gives a variable may be a constant that stands after the loop's end.
    for (id, node) in graph.iter() {
        let value = match node {
            Node::Real(bits) => Value::Real(f64::from_bits(bits)),
            Node::Int(x) => Value::Int(x),
            Node::Bool(x) => Value::Bool(x),
            _ => continue,
        };
        run.constant(id, value);
    }
    let mut at = NodeId(0);
    let mut polled = 0_u32;
    while let Some(node) = graph.get(at) {
        polled += 1;
        if polled.is_multiple_of(4096) && watch.expired() {
            return None;
        }
        run.steps_left = run.steps_left.saturating_sub(1);
        at = run.node(at, node)?;
    }
    Some(run.hulls)
}

/// A loop that runs.
struct Frame {
    /// The counter, of one iteration or of all that are left.
    counter: (i32, i32),
    /// One past the last counter.
    stop: i32,
    /// Whether this iteration stands for all that are left.
    all: bool,
    /// Whether there may be no iteration.
    may_skip: bool,
}

struct Run<'g, 'w> {
    graph: &'g Graph,
    inputs: &'g [Hull],
    precision: Precision,
    steps_left: u64,
    /// In this iteration.
    current: Vec<Hull>,
    /// In all so far.
    hulls: Vec<Hull>,
    /// Of a raw graph: what `fold` will compute.
    constants: Vec<Option<Value>>,
    real: Folder<'w>,
    exact: Option<Folder<'w>>,
    frames: Vec<Frame>,
}

impl Run<'_, '_> {
    fn of(&self, id: NodeId) -> Hull {
        self.current.get(id.index()).copied().unwrap_or(Hull::Never)
    }

    /// Sets what holds now, without its having been computed.
    fn put(&mut self, id: NodeId, hull: Hull) {
        if let Some(place) = self.current.get_mut(id.index()) {
            *place = hull;
        }
    }

    fn note(&mut self, id: NodeId, hull: Hull) {
        self.put(id, hull);
        if let Some(place) = self.hulls.get_mut(id.index()) {
            *place = if *place == Hull::Never { hull } else { place.union(hull) };
        }
    }

    fn constant(&mut self, id: NodeId, value: Value) {
        if let Some(place) = self.constants.get_mut(id.index()).filter(|_| self.exact.is_some()) {
            *place = Some(value);
        }
        self.put(id, Hull::point(value).rounded(self.precision));
    }

    fn known(&self, id: NodeId) -> Option<Value> {
        self.constants.get(id.index()).copied().flatten()
    }

    /// Computes one node and says which comes next.
    fn node(&mut self, at: NodeId, node: Node) -> Option<NodeId> {
        let next = NodeId(at.0 + 1);
        match node {
            // What will stand here is not known yet.
            Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => {
                self.note(at, Hull::anything(self.graph.scalar(at)));
            }
            Node::Input(i) => {
                let given = self.inputs.get(i as usize).copied();
                let given = given.unwrap_or(Hull::anything(self.graph.scalar(at)));
                self.note(at, given.rounded(self.precision).tidied());
            }
            Node::Real(_) | Node::Int(_) | Node::Bool(_) => self.note(at, self.of(at)),
            Node::Fresh(x) => self.same(at, x),
            Node::Apply(op, args) => self.apply(at, op, args.as_slice()),
            Node::Gamma { cond, otherwise, .. } => {
                let cond = self.of(cond);
                self.put(at, cond);
                if cond.decided() == Some(false) {
                    return Some(NodeId(otherwise.0 + 1));
                }
            }
            Node::Else { gamma } => {
                if let (Some(true), Some(Node::Gamma { end, .. })) = (self.of(gamma).decided(), self.graph.get(gamma)) {
                    return Some(end);
                }
            }
            Node::Join { end, then, otherwise } => {
                let Some(Node::End { begin }) = self.graph.get(end) else { return Some(next) };
                let chosen = match self.of(begin).decided() {
                    Some(true) => then,
                    Some(false) => otherwise,
                    None => {
                        self.note(at, self.of(then).union(self.of(otherwise)));
                        return Some(next);
                    }
                };
                let constant =
                    matches!(self.graph.get(begin), Some(Node::Gamma { cond, .. }) if self.known(cond).is_some());
                if constant { self.same(at, chosen) } else { self.note(at, self.of(chosen)) }
            }
            Node::Theta { lo, hi, end } => return Some(self.begin_loop(at, end, self.of(lo), self.of(hi))),
            Node::Counter { .. } => {
                let (lo, hi) = self.frames.last().map_or((i32::MIN, i32::MAX), |f| f.counter);
                self.note(at, Hull::Int { lo, hi });
            }
            Node::Carried { .. } => self.note(at, self.of(at)),
            Node::Final { carried, .. } => self.note(at, self.of(carried)),
            // What it was in any iteration.
            Node::Tape { value, .. } => {
                let content = self.hulls.get(value.index()).copied().unwrap_or(Hull::Never);
                self.note(at, content);
            }
            Node::Recall { tape, .. } => {
                let content = self.of(tape);
                let nothing = content == Hull::Never;
                self.note(at, if nothing { Hull::anything(self.graph.scalar(at)) } else { content });
            }
            Node::End { begin } => {
                if let Some(Node::Theta { .. }) = self.graph.get(begin) {
                    return Some(self.end_loop(at, begin));
                }
            }
        }
        Some(next)
    }

    /// A value that is another under a name of its own.
    fn same(&mut self, at: NodeId, x: NodeId) {
        let known = self.known(x);
        if let Some(place) = self.constants.get_mut(at.index()) {
            *place = known;
        }
        self.note(at, self.of(x));
    }

    fn apply(&mut self, at: NodeId, op: Op, args: &[NodeId]) {
        let mut values = [Value::Int(0); 4];
        let all = args.iter().zip(&mut values).all(|(x, place)| self.known(*x).map(|v| *place = v).is_some());
        let values = values.get(..args.len()).unwrap_or(&[]);
        if let Some(value) = self.exact.as_mut().filter(|_| all).and_then(|f| f.apply(op, values)) {
            self.constant(at, value);
            self.note(at, self.of(at));
            return;
        }
        let mut operands = [Hull::Never; 4];
        for (place, x) in operands.iter_mut().zip(args) {
            *place = self.of(*x);
        }
        let facts = facts(self.graph, args, |_| false);
        let operands = operands.get(..args.len()).unwrap_or(&[]);
        let hull = self.real.enclose(op, operands, facts).unwrap_or(Hull::anything(op.def().result));
        self.note(at, hull);
    }

    fn begin_loop(&mut self, at: NodeId, end: NodeId, lo: Hull, hi: Hull) -> NodeId {
        let range = |h| if let Hull::Int { lo, hi } = h { (lo, hi) } else { (i32::MIN, i32::MAX) };
        let ((first, last_first), (least_stop, stop)) = (range(lo), range(hi));
        for (_, carried, _) in self.variables(end) {
            self.put(carried, self.init(carried));
        }
        if first >= stop {
            return NodeId(end.0 + 1);
        }
        let known = first == last_first && least_stop == stop;
        if known && self.steps_left > 0 {
            self.frames.push(Frame { counter: (first, first), stop, all: false, may_skip: false });
        } else {
            self.frames.push(Frame { counter: (first, stop - 1), stop, all: true, may_skip: last_first >= least_stop });
            self.know_nothing(end);
        }
        NodeId(at.0 + 1)
    }

    fn end_loop(&mut self, end: NodeId, begin: NodeId) -> NodeId {
        let variables = self.variables(end);
        let given: Vec<Hull> = variables.iter().map(|(_, _, next)| self.of(*next)).collect();
        for ((_, carried, _), given) in variables.iter().zip(given) {
            let may_skip = self.frames.last().is_some_and(|f| f.may_skip);
            let content = if may_skip { given.union(self.init(*carried)) } else { given };
            self.put(*carried, content);
        }
        let again = self.frames.last_mut().filter(|f| !f.all && f.counter.0.saturating_add(1) < f.stop);
        let Some(frame) = again else {
            self.frames.pop();
            return NodeId(end.0 + 1);
        };
        let count = frame.counter.0.saturating_add(1);
        if self.steps_left > 0 {
            frame.counter = (count, count);
        } else {
            (frame.counter, frame.all) = ((count, frame.stop - 1), true);
            self.know_nothing(end);
        }
        NodeId(begin.0 + 1)
    }

    fn variables(&self, end: NodeId) -> Vec<(NodeId, NodeId, NodeId)> {
        carried_finals(self.graph, end).collect()
    }

    fn init(&self, carried: NodeId) -> Hull {
        match self.graph.get(carried) {
            Some(Node::Carried { init, .. }) => self.of(init),
            _ => Hull::Never,
        }
    }

    /// Makes the variables of a loop anything, but those that an iteration gives their own content.
    fn know_nothing(&mut self, end: NodeId) {
        for (_, carried, next) in self.variables(end) {
            if next != carried {
                self.put(carried, Hull::anything(self.graph.scalar(carried)));
            }
        }
    }
}

/// Computes by folding constants.
struct Folder<'w> {
    b: Builder<'w>,
    mode: Mode,
    watch: &'w dyn Watch,
}

impl<'w> Folder<'w> {
    /// Constants it keeps before it begins anew.
    const MANY: usize = 10_000;

    fn new(mode: Mode, watch: &'w dyn Watch) -> Self {
        Self { b: Builder::new(mode, usize::MAX, watch), mode, watch }
    }

    fn builder(&mut self) -> &mut Builder<'w> {
        if self.b.graph().len() > Self::MANY {
            self.b = Builder::new(self.mode, usize::MAX, self.watch);
        }
        &mut self.b
    }

    fn apply(&mut self, op: Op, operands: &[Value]) -> Option<Value> {
        let b = self.builder();
        let mut nodes = [NodeId::NONE; 4];
        for (place, x) in nodes.iter_mut().zip(operands) {
            *place = b.constant(*x);
        }
        let result = b.op(op, nodes.get(..operands.len())?);
        b.value(result)
    }

    fn enclose(&mut self, op: Op, operands: &[Hull], facts: isograd_graph::Facts) -> Option<Hull> {
        let b = self.builder();
        let mut nodes = [Enclosure::Int { lo: NodeId::NONE, hi: NodeId::NONE }; 4];
        for ((place, x), kind) in nodes.iter_mut().zip(operands).zip(op.def().operands) {
            let x = if *x == Hull::Never { Hull::anything(*kind) } else { x.tidied() };
            *place = match x {
                Hull::Real { lo, hi, nan } => {
                    Enclosure::Real(Range { lo: b.real(lo), hi: b.real(hi), nan: b.bool(nan), tidy: true })
                }
                Hull::Int { lo, hi } => Enclosure::Int { lo: b.int(lo), hi: b.int(hi) },
                Hull::Bool { yes, no } => Enclosure::Bool { yes: b.bool(yes), no: b.bool(no) },
                Hull::Never => return None,
            };
        }
        let truth = |b: &Builder<'_>, x| match b.value(x) {
            Some(Value::Bool(x)) => Some(x),
            _ => None,
        };
        Some(match b.enclose(op, nodes.get(..operands.len())?, facts) {
            Enclosure::Real(range) => match (b.value(range.lo)?, b.value(range.hi)?) {
                (Value::Real(lo), Value::Real(hi)) => Hull::Real { lo, hi, nan: truth(b, range.nan)? },
                _ => return None,
            },
            Enclosure::Int { lo, hi } => match (b.value(lo)?, b.value(hi)?) {
                (Value::Int(lo), Value::Int(hi)) => Hull::Int { lo, hi },
                _ => return None,
            },
            Enclosure::Bool { yes, no } => Hull::Bool { yes: truth(b, yes)?, no: truth(b, no)? },
        })
    }
}
