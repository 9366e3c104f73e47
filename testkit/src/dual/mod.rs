//! The oracle of dual numbers: runs a graph on numbers that carry their derivatives, with the host's mathematical
//! library in f64. Has an operation set of its own and knows nothing of the op table's rules, of tangents in graphs and
//! of kernels.
//!
//! A [`Jet`] is a hyper-dual number v + a·ε₁ + b·ε₂ + c·ε₁ε₂ with ε₁² = ε₂² = 0 (Fike, Alonso, *The development of
//! hyper-dual numbers for exact second-derivative calculations*, 2011): a and b are first derivatives by two seeds, c is
//! the second derivative by both. Read `a` alone and it is a dual number.
//!
//! A run may be *shaken*: each rounded result and each sum of derivatives is changed at random by 2⁻⁴⁶ of its terms, a
//! hundred times what rounding does. How far the results move tells the conditioning at the point, and so the
//! tolerance there (Parker, *Monte Carlo arithmetic*, 1997); if a decision on the way comes out differently, the point
//! is too near a kink to be judged.

mod rules;

use isograd_graph::ops::{Kink, discriminant};
use isograd_graph::{Graph, Node, NodeId, Op, Scalar, Value};

use crate::points::Random;

/// How much a shaken run changes what it computes, relatively.
pub const SHAKE: f64 = 1.0 / (1_u64 << 46) as f64;

/// Where |discriminant| is less than this, relatively, a kink is too near.
const NEAR: f64 = 1e-7;

/// A hyper-dual number. A part that is `None` is structurally 0: no product with it is formed (LANGUAGE 13.7).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// The number.
    pub value: f64,
    /// Its derivative by the first seed.
    pub a: Option<f64>,
    /// Its derivative by the second seed.
    pub b: Option<f64>,
    /// Its second derivative by both.
    pub ab: Option<f64>,
}

impl Jet {
    /// A number that depends on no seed.
    #[must_use]
    pub const fn constant(value: f64) -> Self {
        Self { value, a: None, b: None, ab: None }
    }

    const fn is_active(&self) -> bool {
        self.a.is_some() || self.b.is_some()
    }

    fn is_finite(&self) -> bool {
        [Some(self.value), self.a, self.b, self.ab].into_iter().flatten().all(|x| x.abs() < 1e150)
    }
}

/// A value of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// A real.
    Real(Jet),
    /// An int.
    Int(i32),
    /// A truth value.
    Bool(bool),
}

impl Cell {
    /// The value without derivatives.
    #[must_use]
    pub const fn value(self) -> Value {
        match self {
            Self::Real(jet) => Value::Real(jet.value),
            Self::Int(x) => Value::Int(x),
            Self::Bool(x) => Value::Bool(x),
        }
    }

    /// The jet of a real; NaN of other kinds.
    #[must_use]
    pub const fn jet(self) -> Jet {
        match self {
            Self::Real(jet) => jet,
            Self::Int(_) | Self::Bool(_) => Jet::constant(f64::NAN),
        }
    }
}

impl From<Value> for Cell {
    fn from(value: Value) -> Self {
        match value {
            Value::Real(x) => Self::Real(Jet::constant(x)),
            Value::Int(x) => Self::Int(x),
            Value::Bool(x) => Self::Bool(x),
        }
    }
}

/// What a run differentiates by: nodes of the outermost region. What a seed depends on itself does not matter
/// (LANGUAGE 13.2).
#[derive(Debug, Clone, Copy, Default)]
pub struct Seeds {
    /// The first.
    pub a: Option<NodeId>,
    /// The second; an input.
    pub b: Option<NodeId>,
}

/// What a run found.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The outputs.
    pub outputs: Vec<Cell>,
    /// A digest of all decisions: comparisons, operands chosen, sides taken, trips, integers rounded to.
    pub decisions: u64,
    /// Whether an active operand came near a kink (LANGUAGE 13.6), derivatives grew out of all bounds, or a partial
    /// derivative was infinite by an operand that depends on a seed on some way, be it not the one taken: the
    /// pipeline then multiplies it by a 0 that is not structural.
    pub doubtful: bool,
}

/// The steps after which a run gives up.
const STEPS: u64 = 10_000_000;

/// Runs a raw graph without `diff` at a point. `shake` seeds the changes of a shaken run. `None` if the run takes too
/// long or the graph contains a `diff`.
#[must_use]
pub fn run(graph: &Graph, inputs: &[Value], seeds: Seeds, shake: Option<u64>) -> Option<Outcome> {
    let mut machine = Machine {
        graph,
        cells: graph.iter().map(|(id, _)| Value::zero(graph.scalar(id)).into()).collect(),
        arithmetic: Arithmetic {
            shake: shake.map(Random::new),
            decisions: 0xcbf2_9ce4_8422_2325,
            doubtful: false,
            dependent: [false; 4],
        },
        dependent: dependent(graph, seeds),
        seeds,
    };
    let mut at = NodeId(0);
    for _ in 0..STEPS {
        let Some(node) = graph.get(at) else {
            let outputs = graph.outputs.iter().map(|o| machine.cell(o.node)).collect();
            let Arithmetic { decisions, doubtful, .. } = machine.arithmetic;
            return Some(Outcome { outputs, decisions, doubtful });
        };
        at = machine.step(at, node, inputs)?;
    }
    None
}

struct Machine<'g> {
    graph: &'g Graph,
    cells: Vec<Cell>,
    arithmetic: Arithmetic,
    /// Per node whether it depends on a seed on some way.
    dependent: Vec<bool>,
    seeds: Seeds,
}

/// Which nodes depend on a seed on some way through the graph. Sweeps until loops bring no news.
fn dependent(graph: &Graph, seeds: Seeds) -> Vec<bool> {
    let mut depends = vec![false; graph.len()];
    for seed in [seeds.a, seeds.b].into_iter().flatten() {
        depends[seed.index()] = true;
    }
    loop {
        let mut news = Vec::new();
        for (id, node) in graph.iter() {
            let on = |x: NodeId| depends[x.index()];
            let yes = match node {
                Node::Apply(op, args) => {
                    let args = args.as_slice();
                    let reals = if op == Op::Copysign { &args[..1] } else { args };
                    !rules::is_constant(op) && reals.iter().any(|x| on(*x))
                }
                Node::Fresh(x) => on(x),
                Node::Join { then, otherwise, .. } => on(then) || on(otherwise),
                Node::Carried { init, .. } => on(init),
                Node::Final { carried, next, .. } => {
                    if on(next) && !on(carried) {
                        news.push(carried);
                    }
                    on(carried) || on(next)
                }
                _ => false,
            };
            if yes && graph.scalar(id) == Scalar::Real {
                depends[id.index()] = true;
            }
        }
        news.retain(|id| graph.scalar(*id) == Scalar::Real);
        if news.is_empty() {
            return depends;
        }
        for id in news {
            depends[id.index()] = true;
        }
    }
}

impl Machine<'_> {
    fn cell(&self, id: NodeId) -> Cell {
        self.cells[id.index()]
    }

    fn int(&self, id: NodeId) -> i32 {
        match self.cell(id) {
            Cell::Int(x) => x,
            _ => 0,
        }
    }

    fn truth(&self, id: NodeId) -> bool {
        self.cell(id) == Cell::Bool(true)
    }

    fn set(&mut self, id: NodeId, cell: Cell) {
        let mut cell = cell;
        if let Cell::Real(jet) = &mut cell {
            if self.seeds.a == Some(id) {
                (jet.a, jet.ab) = (Some(1.0), None);
            }
            if self.seeds.b == Some(id) {
                (jet.b, jet.ab) = (Some(1.0), None);
            }
        }
        self.cells[id.index()] = cell;
    }

    /// Executes a node and says which comes next.
    fn step(&mut self, at: NodeId, node: Node, inputs: &[Value]) -> Option<NodeId> {
        let next = NodeId(at.0 + 1);
        match node {
            Node::Input(i) => self.set(at, inputs.get(i as usize).copied()?.into()),
            Node::Real(bits) => self.set(at, Value::Real(f64::from_bits(bits)).into()),
            Node::Int(x) => self.set(at, Cell::Int(x)),
            Node::Bool(x) => self.set(at, Cell::Bool(x)),
            Node::Fresh(x) => self.set(at, self.cell(x)),
            Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => return None,
            // Made by the reverse sweep, which this is an oracle of.
            Node::Tape { .. } | Node::Recall { .. } => return None,
            Node::Apply(op, args) => {
                let operands: Vec<Cell> = args.as_slice().iter().map(|x| self.cell(*x)).collect();
                for (place, x) in self.arithmetic.dependent.iter_mut().zip(args.as_slice()) {
                    *place = self.dependent[x.index()];
                }
                let result = self.arithmetic.apply(op, &operands);
                self.set(at, result);
            }
            Node::Gamma { cond, otherwise, .. } => {
                let holds = self.truth(cond);
                self.set(at, Cell::Bool(holds));
                self.arithmetic.decide(u64::from(holds));
                if !holds {
                    return Some(NodeId(otherwise.0 + 1));
                }
            }
            Node::Else { gamma } => {
                let Some(Node::Gamma { end, .. }) = self.graph.get(gamma) else { return None };
                return Some(end);
            }
            Node::Join { end, then, otherwise } => {
                let Some(Node::End { begin }) = self.graph.get(end) else { return None };
                self.set(at, self.cell(if self.truth(begin) { then } else { otherwise }));
            }
            Node::Theta { lo, hi, end } => {
                let (lo, hi) = (self.int(lo), self.int(hi));
                self.set(at, Cell::Int(lo));
                for (carried, _) in self.finals(end) {
                    let Some(Node::Carried { init, .. }) = self.graph.get(carried) else { return None };
                    self.set(carried, self.cell(init));
                }
                self.arithmetic.decide(u64::from(lo < hi));
                if lo >= hi {
                    return Some(NodeId(end.0 + 1));
                }
            }
            Node::Counter { theta } => self.set(at, self.cell(theta)),
            // Given by the theta and by its end.
            Node::Carried { .. } => {}
            Node::End { begin } => {
                if let Some(Node::Theta { hi, .. }) = self.graph.get(begin) {
                    let counter = self.int(begin).wrapping_add(1);
                    self.set(begin, Cell::Int(counter));
                    let given: Vec<_> = self.finals(at).into_iter().map(|(c, next)| (c, self.cell(next))).collect();
                    for (carried, cell) in given {
                        self.set(carried, cell);
                    }
                    let again = counter < self.int(hi);
                    self.arithmetic.decide(u64::from(again));
                    if again {
                        return Some(NodeId(begin.0 + 1));
                    }
                }
            }
            Node::Final { carried, .. } => self.set(at, self.cell(carried)),
        }
        Some(next)
    }

    /// The carried variables of the loop with this end, with what an iteration gives them.
    fn finals(&self, end: NodeId) -> Vec<(NodeId, NodeId)> {
        let after = self.graph.iter().skip(end.index() + 1);
        let constants = |n: &Node| matches!(n, Node::Real(_) | Node::Int(_) | Node::Bool(_));
        after
            .take_while(|(_, n)| constants(n) || matches!(n, Node::Final { end: of, .. } if *of == end))
            .filter_map(|(_, n)| match n {
                Node::Final { carried, next, .. } => Some((carried, next)),
                _ => None,
            })
            .collect()
    }
}

/// The state of a run beside its values.
struct Arithmetic {
    shake: Option<Random>,
    decisions: u64,
    doubtful: bool,
    /// Which operands of the operation depend on a seed on some way.
    dependent: [bool; 4],
}

impl Arithmetic {
    /// Takes note of a decision (FNV-1a).
    const fn decide(&mut self, what: u64) {
        self.decisions = (self.decisions ^ what).wrapping_mul(0x0100_0000_01b3);
    }

    /// `x`, in a shaken run changed by at most `size`·[`SHAKE`].
    fn shaken(&mut self, x: f64, size: f64) -> f64 {
        match &mut self.shake {
            Some(random) if size != 0.0 => x + size.abs() * SHAKE * (2.0 * random.unit() - 1.0),
            _ => x,
        }
    }

    /// One operation: value and derivatives by the rules of this module's own, doubt by the table's discriminants.
    fn apply(&mut self, op: Op, operands: &[Cell]) -> Cell {
        let active = operands.iter().any(|x| matches!(x, Cell::Real(jet) if jet.is_active()));
        if active && matches!(op.def().kink, Kink::Where { .. }) {
            let reals: Vec<f64> = operands.iter().map(|x| x.jet().value).collect();
            let size = reals.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
            // `!(>)`: a NaN is doubtful too.
            let far = discriminant(op, &reals).abs() > NEAR * size;
            self.doubtful |= !far;
        }
        let result = rules::apply(self, op, operands);
        if let Cell::Real(jet) = result {
            self.doubtful |= active && !jet.is_finite();
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use isograd_graph::{Builder, Mode, Scalar, Unwatched};

    use super::*;

    fn second(op: Op, inputs: &[f64], by: (usize, usize)) -> Jet {
        let mut b = Builder::new(Mode::Raw, 100, &Unwatched);
        let nodes: Vec<NodeId> = inputs.iter().map(|_| b.input("x", Scalar::Real)).collect();
        let result = b.op(op, &nodes);
        b.output("y", result);
        let graph = b.finish().expect("small");
        let inputs: Vec<Value> = inputs.iter().map(|x| Value::Real(*x)).collect();
        let seeds = Seeds { a: Some(nodes[by.0]), b: Some(nodes[by.1]) };
        run(&graph, &inputs, seeds, None).expect("ends").outputs[0].jet()
    }

    #[test]
    fn known_derivatives() {
        // x³ by a loop would do as well; these are by hand.
        let jet = second(Op::Pow, &[2.0, 3.0], (0, 0));
        assert_eq!((jet.value, jet.a, jet.ab), (8.0, Some(12.0), Some(12.0)));
        let jet = second(Op::Mul, &[2.0, 3.0], (0, 1));
        assert_eq!((jet.a, jet.b, jet.ab), (Some(3.0), Some(2.0), Some(1.0)));
        let jet = second(Op::Div, &[1.0, 2.0], (1, 1));
        assert_eq!((jet.a, jet.ab), (Some(-0.25), Some(0.25)));
        let jet = second(Op::Length2, &[3.0, 4.0], (0, 1));
        assert_eq!((jet.value, jet.a), (5.0, Some(0.6)));
        assert!((jet.ab.unwrap() + 0.096).abs() < 1e-15);
        let jet = second(Op::Length3, &[0.0, 0.0, 0.0], (0, 0));
        assert_eq!((jet.a, jet.ab.unwrap_or(0.0)), (Some(0.0), 0.0));
    }

    #[test]
    fn operands_not_chosen_contribute_nothing() {
        let jet = second(Op::Min, &[1.0, 2.0], (1, 1));
        assert_eq!((jet.a, jet.ab), (None, None));
    }
}
