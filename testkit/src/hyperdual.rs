//! The oracle of third derivatives: runs a raw graph on the hyper-hyper-dual numbers of the crate `num-dual`. Has the
//! operations as compositions of that crate's functions, and knows nothing of the op table's derivative rules, of this
//! crate's own dual numbers and of kernels.
//!
//! A number carries its derivatives by three seeds, by each two of them and by all three (Fike, Alonso, *The
//! development of hyper-dual numbers for exact second-derivative calculations*, 2011). Conventions in kinks (LANGUAGE
//! 13.6) are none of its business: a point at which an active operand comes near a kink is doubtful, and so is one at
//! which a part is not finite.
//!
//! A run may be *shaken*, as those of [`crate::dual`] are: each part of each operand and of each result is changed at
//! random by 2⁻⁴⁶ of itself. How far the results move tells what rounding may do.

use isograd_graph::ops::{Kink, discriminant};
use isograd_graph::{Graph, Node, NodeId, Op, Scalar, Value};
use num_dual::{DualNum, HyperHyperDual64 as Number};

use crate::dual::SHAKE;
use crate::points::Random;

/// Where |discriminant| is less than this, relatively, a kink is too near: third derivatives grow like its −3rd power.
const NEAR: f64 = 1e-4;

/// Parts above this are not judged.
const HUGE: f64 = 1e100;

/// The steps after which a run gives up.
const STEPS: u64 = 1_000_000;

/// What a run found.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The derivatives of each output: none for an int or bool.
    pub outputs: Vec<Option<Derivatives>>,
    /// A digest of all decisions.
    pub decisions: u64,
    /// Whether the point cannot be judged.
    pub doubtful: bool,
}

/// A number with derivatives by three seeds a, b, c.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Derivatives {
    /// The number.
    pub value: f64,
    /// By a, b and c.
    pub first: [f64; 3],
    /// By a and b, a and c, b and c.
    pub second: [f64; 3],
    /// By all three.
    pub third: f64,
}

/// Runs a raw graph without `diff` at a point. The seeds are inputs, by their indices, and may be the same one. `None`
/// if the run takes too long, or a node is in the way that only transforms make.
#[must_use]
pub fn run(graph: &Graph, inputs: &[Value], seeds: [usize; 3], shake: Option<u64>) -> Option<Outcome> {
    let mut machine = Machine {
        graph,
        cells: vec![Cell::Int(0); graph.len()],
        seeds,
        run: Run { shake: shake.map(Random::new), decisions: 0xcbf2_9ce4_8422_2325, doubtful: false },
    };
    let mut at = NodeId(0);
    for _ in 0..STEPS {
        let Some(node) = graph.get(at) else {
            let outputs = graph.outputs.iter().map(|o| machine.cell(o.node).derivatives()).collect();
            return Some(Outcome { outputs, decisions: machine.run.decisions, doubtful: machine.run.doubtful });
        };
        at = machine.step(at, node, inputs)?;
    }
    None
}

#[derive(Debug, Clone, Copy)]
enum Cell {
    Real(Number),
    Int(i32),
    Bool(bool),
}

impl Cell {
    fn derivatives(self) -> Option<Derivatives> {
        let Self::Real(x) = self else { return None };
        let first = [x.eps1, x.eps2, x.eps3];
        let second = [x.eps1eps2, x.eps1eps3, x.eps2eps3];
        Some(Derivatives { value: x.re, first, second, third: x.eps1eps2eps3 })
    }

    fn real(self) -> Number {
        match self {
            Self::Real(x) => x,
            Self::Int(_) | Self::Bool(_) => Number::from_re(f64::NAN),
        }
    }

    const fn int(self) -> i32 {
        match self {
            Self::Int(x) => x,
            Self::Real(_) | Self::Bool(_) => 0,
        }
    }

    const fn truth(self) -> bool {
        matches!(self, Self::Bool(true))
    }
}

struct Machine<'g> {
    graph: &'g Graph,
    cells: Vec<Cell>,
    seeds: [usize; 3],
    run: Run,
}

impl Machine<'_> {
    fn cell(&self, id: NodeId) -> Cell {
        self.cells[id.index()]
    }

    /// An input with the seeds that it is.
    fn input(&self, index: usize, value: Value) -> Cell {
        match value {
            Value::Int(x) => Cell::Int(x),
            Value::Bool(x) => Cell::Bool(x),
            Value::Real(x) => {
                let [a, b, c] = self.seeds.map(|seed| seed == index);
                let mut number = Number::from_re(x);
                number = if a { number.derivative1() } else { number };
                number = if b { number.derivative2() } else { number };
                Cell::Real(if c { number.derivative3() } else { number })
            }
        }
    }

    /// Executes a node and says which comes next.
    fn step(&mut self, at: NodeId, node: Node, inputs: &[Value]) -> Option<NodeId> {
        let next = NodeId(at.0 + 1);
        let cell = match node {
            Node::Input(i) => self.input(i as usize, *inputs.get(i as usize)?),
            Node::Real(bits) => Cell::Real(Number::from_re(f64::from_bits(bits))),
            Node::Int(x) => Cell::Int(x),
            Node::Bool(x) => Cell::Bool(x),
            Node::Fresh(x) => self.cell(x),
            Node::Apply(op, args) => {
                let operands: Vec<Cell> = args.as_slice().iter().map(|x| self.cell(*x)).collect();
                self.run.apply(op, &operands)
            }
            Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => return None,
            Node::Tape { .. } | Node::Recall { .. } => return None,
            Node::Gamma { cond, otherwise, .. } => {
                let holds = self.cell(cond).truth();
                self.run.decide(u64::from(holds));
                self.cells[at.index()] = Cell::Bool(holds);
                return Some(if holds { next } else { NodeId(otherwise.0 + 1) });
            }
            Node::Else { gamma } => {
                let Node::Gamma { end, .. } = self.graph.get(gamma)? else { return None };
                return Some(end);
            }
            Node::Join { end, then, otherwise } => {
                let Node::End { begin } = self.graph.get(end)? else { return None };
                self.cell(if self.cell(begin).truth() { then } else { otherwise })
            }
            Node::Theta { lo, hi, end } => {
                let (lo, hi) = (self.cell(lo), self.cell(hi).int());
                self.cells[at.index()] = lo;
                for (carried, _) in self.variables(end) {
                    let Node::Carried { init, .. } = self.graph.get(carried)? else { return None };
                    self.cells[carried.index()] = self.cell(init);
                }
                self.run.decide(u64::from(lo.int() < hi));
                return Some(if lo.int() < hi { next } else { NodeId(end.0 + 1) });
            }
            Node::Counter { theta } => self.cell(theta),
            // Given by the theta and by its end.
            Node::Carried { .. } => return Some(next),
            Node::End { begin } => return self.end(at, begin),
            Node::Final { carried, .. } => self.cell(carried),
        };
        self.cells[at.index()] = cell;
        Some(next)
    }

    /// After a branch, or after an iteration: all variables change at once.
    fn end(&mut self, at: NodeId, begin: NodeId) -> Option<NodeId> {
        let Node::Theta { hi, .. } = self.graph.get(begin)? else { return Some(NodeId(at.0 + 1)) };
        let counter = self.cell(begin).int().wrapping_add(1);
        let given: Vec<_> = self.variables(at).into_iter().map(|(carried, next)| (carried, self.cell(next))).collect();
        for (carried, cell) in given {
            self.cells[carried.index()] = cell;
        }
        self.cells[begin.index()] = Cell::Int(counter);
        let again = counter < self.cell(hi).int();
        self.run.decide(u64::from(again));
        Some(NodeId(if again { begin.0 + 1 } else { at.0 + 1 }))
    }

    /// The variables of the loop with this end, with what an iteration gives them.
    fn variables(&self, end: NodeId) -> Vec<(NodeId, NodeId)> {
        let of_this = |node: Node| match node {
            Node::Final { end: of, carried, next } if of == end => Some((carried, next)),
            _ => None,
        };
        self.graph.iter().skip(end.index() + 1).filter_map(|(_, node)| of_this(node)).collect()
    }
}

/// The state of a run beside its values.
struct Run {
    shake: Option<Random>,
    decisions: u64,
    doubtful: bool,
}

impl Run {
    /// Takes note of a decision (FNV-1a).
    const fn decide(&mut self, what: u64) {
        self.decisions = (self.decisions ^ what).wrapping_mul(0x0100_0000_01b3);
    }

    fn side(&mut self, holds: bool) -> bool {
        self.decide(u64::from(holds));
        holds
    }

    /// `x`, in a shaken run with each part changed by at most [`SHAKE`] of itself.
    fn shaken(&mut self, x: Number) -> Number {
        let Some(random) = &mut self.shake else { return x };
        let mut moved = |part: f64| part + part * SHAKE * (2.0 * random.unit() - 1.0);
        Number::new(
            moved(x.re),
            moved(x.eps1),
            moved(x.eps2),
            moved(x.eps3),
            moved(x.eps1eps2),
            moved(x.eps1eps3),
            moved(x.eps2eps3),
            moved(x.eps1eps2eps3),
        )
    }

    /// One function of the crate, shaken.
    fn of(&mut self, x: Number, f: impl Fn(Number) -> Number) -> Number {
        let x = self.shaken(x);
        self.shaken(f(x))
    }

    /// One function of the crate of two numbers, shaken.
    fn of2(&mut self, x: Number, y: Number, f: impl Fn(Number, Number) -> Number) -> Number {
        let (x, y) = (self.shaken(x), self.shaken(y));
        self.shaken(f(x, y))
    }

    fn apply(&mut self, op: Op, operands: &[Cell]) -> Cell {
        let def = op.def();
        if def.result == Scalar::Real {
            let reals = def.operands.iter().zip(operands).filter(|(scalar, _)| **scalar == Scalar::Real);
            let moving = reals.clone().any(|(_, x)| is_active(x.real()));
            if moving && matches!(def.kink, Kink::Where { .. }) {
                let at: Vec<f64> = operands.iter().map(|x| x.real().re).collect();
                let size = at.iter().filter(|x| !x.is_nan()).fold(1.0_f64, |most, x| most.max(x.abs()));
                // `!(>)`: a NaN is doubtful too.
                let far = discriminant(op, &at).abs() > NEAR * size;
                self.doubtful |= !far;
            }
            let result = self.real(op, operands);
            // Where no operand moves too: a slope that is not finite makes NaN of a 0 that is not structural.
            self.doubtful |= !is_tame(result);
            return Cell::Real(if moving { result } else { Number::from_re(result.re) });
        }
        self.decision(op, operands)
    }

    /// An operation with a real result.
    fn real(&mut self, op: Op, operands: &[Cell]) -> Number {
        let cell = |i: usize| operands.get(i).copied().unwrap_or(Cell::Int(0));
        let (x, y) = (cell(0).real(), cell(1).real());
        let constant = |re: f64| Number::from_re(re);
        let one = constant(1.0);
        match op {
            // Directed rounding: the exact result is the same up to rounding.
            Op::Add | Op::AddDown | Op::AddUp => self.of2(x, y, |x, y| x + y),
            Op::Sub => self.of2(x, y, |x, y| x - y),
            Op::Mul | Op::MulDown | Op::MulUp => self.of2(x, y, |x, y| x * y),
            Op::Div | Op::DivDown | Op::DivUp => self.of2(x, y, |x, y| x / y),
            Op::Unit if y.re == 0.0 => constant(0.0),
            Op::Unit => self.of2(x, y, |x, y| x / y),
            Op::Neg => -x,
            Op::Sqrt | Op::SqrtDown | Op::SqrtUp => self.of(x, |x| x.sqrt()),
            Op::InverseSqrt => {
                let root = self.of(x, |x| x.sqrt());
                self.of(root, |x| x.recip())
            }
            Op::Abs if self.side(x.re < 0.0) => -x,
            Op::Abs => x,
            Op::Min if self.side(y.re < x.re) => y,
            Op::Max if self.side(x.re < y.re) => y,
            Op::Min | Op::Max => x,
            Op::Fract => self.without(x, one, x.re.floor()),
            Op::Mod => self.without(x, y, (x.re / y.re).floor()),
            Op::Floor => self.jump(x.re.floor()),
            Op::Ceil => self.jump(x.re.ceil()),
            Op::Trunc => self.jump(x.re.trunc()),
            Op::Round => self.jump(x.re.round()),
            Op::Sign if x.re == 0.0 || x.re.is_nan() => self.jump(x.re),
            Op::Sign => self.jump(x.re.signum()),
            Op::Length2 | Op::Length3 | Op::Length4 => {
                let squares: Vec<Number> = operands.iter().map(|c| self.of(c.real(), |x| x * x)).collect();
                let sum = squares.into_iter().fold(constant(0.0), |sum, square| self.of2(sum, square, |x, y| x + y));
                self.of(sum, |x| x.sqrt())
            }
            Op::Exp => self.of(x, |x| x.exp()),
            Op::Exp2 => self.of(x, |x| x.exp2()),
            Op::Log => self.of(x, |x| x.ln()),
            Op::Log2 => self.of(x, |x| x.log2()),
            Op::Pow if is_active(y) => {
                let log = self.of(x, |x| x.ln());
                let exponent = self.of2(log, y, |x, y| x * y);
                self.of(exponent, |x| x.exp())
            }
            Op::Pow => self.of(x, |x| x.powf(y.re)),
            Op::Sin => self.of(x, |x| x.sin()),
            Op::Cos => self.of(x, |x| x.cos()),
            Op::Tan => {
                let (sine, cosine) = (self.of(x, |x| x.sin()), self.of(x, |x| x.cos()));
                self.of2(sine, cosine, |x, y| x / y)
            }
            Op::Asin => self.of(x, |x| x.asin()),
            Op::Acos => self.of(x, |x| x.acos()),
            Op::Atan => self.of(x, |x| x.atan()),
            Op::Atan2 => self.angle(x, y),
            Op::Sinh => self.of(x, |x| x.sinh()),
            Op::Cosh => self.of(x, |x| x.cosh()),
            Op::Tanh => {
                let (sine, cosine) = (self.of(x, |x| x.sinh()), self.of(x, |x| x.cosh()));
                self.of2(sine, cosine, |x, y| x / y)
            }
            Op::Asinh => self.of(x, |x| x.asinh()),
            Op::Acosh => self.of(x, |x| x.acosh()),
            Op::Atanh => self.of(x, |x| x.atanh()),
            // ln(1 + eˣ) and its derivative 1/(1 + e⁻ˣ).
            Op::Softplus => {
                let power = self.of(x, |x| x.exp());
                self.of(power, |x| x.ln_1p())
            }
            Op::Sigmoid => {
                let power = self.of(x, |x| (-x).exp());
                let sum = self.of2(power, one, |x, y| x + y);
                self.of(sum, |x| x.recip())
            }
            Op::Rounded => x,
            Op::NextDown => at(x, x.re.next_down()),
            Op::NextUp => at(x, x.re.next_up()),
            // What these give of a zero is not said.
            Op::Below | Op::Lowered | Op::Above | Op::Raised if cell(1).truth() => {
                self.doubtful |= x.re == 0.0;
                let lower = matches!(op, Op::Below | Op::Lowered);
                at(x, if lower { x.re.next_down() } else { x.re.next_up() })
            }
            Op::Below | Op::Lowered | Op::Above | Op::Raised => x,
            Op::Copysign => {
                let negative = self.side(y.re.is_sign_negative());
                if self.side(x.re.is_sign_negative()) == negative { x } else { -x }
            }
            Op::Scale => x * f64::from(cell(1).int().clamp(-1022, 1023)).exp2(),
            Op::Select if cell(0).truth() => y,
            Op::Select => cell(2).real(),
            Op::IntToReal => constant(f64::from(cell(0).int())),
            // The rest have results of other kinds.
            _ => constant(f64::NAN),
        }
    }

    /// x − y·n, n being piecewise constant.
    fn without(&mut self, x: Number, y: Number, n: f64) -> Number {
        self.decide(n.to_bits());
        let whole = self.of(y, |y| y * n);
        self.of2(x, whole, |x, whole| x - whole)
    }

    fn jump(&mut self, value: f64) -> Number {
        self.decide(value.to_bits());
        Number::from_re(value)
    }

    /// The angle of (x, y): arctan(y/x), or minus arctan(x/y), up to a constant.
    fn angle(&mut self, y: Number, x: Number) -> Number {
        let flat = y.re.abs() < x.re.abs();
        let ratio = if flat { self.of2(y, x, |y, x| y / x) } else { self.of2(x, y, |x, y| -(x / y)) };
        let angle = self.of(ratio, |x| x.atan());
        let value = self.of(Number::from_re(y.re.atan2(x.re)), |x| x);
        at(angle, value.re)
    }

    /// An operation whose result is an int or a bool.
    #[expect(clippy::cast_possible_truncation, reason = "ints wrap; reals saturate, and NaN gives 0")]
    fn decision(&mut self, op: Op, operands: &[Cell]) -> Cell {
        let cell = |i: usize| operands.get(i).copied().unwrap_or(Cell::Int(0));
        let real = |i: usize| cell(i).real().re;
        let (x, y) = (cell(0).int(), cell(1).int());
        let (a, b) = (i64::from(x), i64::from(y));
        let truth = |i: usize| cell(i).truth();
        let int = |x: i64| Cell::Int(x as i32);
        let result = match op {
            Op::Lt => Cell::Bool(real(0) < real(1)),
            Op::Le => Cell::Bool(real(0) <= real(1)),
            #[expect(clippy::float_cmp, reason = "the operation")]
            Op::Eq => Cell::Bool(real(0) == real(1)),
            #[expect(clippy::float_cmp, reason = "the operation")]
            Op::Ne => Cell::Bool(real(0) != real(1)),
            Op::ProductBelow | Op::WideProductBelow => Cell::Bool(real(0).mul_add(real(1), -real(2)) < 0.0),
            Op::WideProductAbove => Cell::Bool(0.0 < real(0).mul_add(real(1), -real(2))),
            Op::And => Cell::Bool(truth(0) && truth(1)),
            Op::Or => Cell::Bool(truth(0) || truth(1)),
            Op::Not => Cell::Bool(!truth(0)),
            Op::SelectInt => Cell::Int(if truth(0) { y } else { cell(2).int() }),
            Op::SelectBool => Cell::Bool(if truth(0) { truth(1) } else { truth(2) }),
            Op::IntAdd => int(a + b),
            Op::IntSub => int(a - b),
            Op::IntMul => int(a * b),
            Op::IntDiv => int(if b == 0 { 0 } else { a / b }),
            // Floored: the sign of b (LANGUAGE 4.4).
            Op::IntRem => int(if b == 0 { 0 } else { (a % b + b) % b }),
            Op::IntNeg => int(-a),
            Op::IntAbs => int(a.abs()),
            Op::IntMin => Cell::Int(x.min(y)),
            Op::IntMax => Cell::Int(x.max(y)),
            Op::IntSign => Cell::Int(x.signum()),
            Op::IntEq => Cell::Bool(x == y),
            Op::IntLt => Cell::Bool(x < y),
            Op::IntLe => Cell::Bool(x <= y),
            Op::RealToInt => Cell::Int(real(0) as i32),
            Op::Exponent => Cell::Int(exponent(real(0))),
            // The rest have real results.
            _ => Cell::Int(0),
        };
        self.decide(match result {
            Cell::Int(x) => u64::from(x.cast_unsigned()),
            Cell::Bool(x) => u64::from(x),
            Cell::Real(x) => x.re.to_bits(),
        });
        result
    }
}

/// `x` with another value.
const fn at(x: Number, value: f64) -> Number {
    Number { re: value, ..x }
}

const fn parts(x: Number) -> [f64; 7] {
    [x.eps1, x.eps2, x.eps3, x.eps1eps2, x.eps1eps3, x.eps2eps3, x.eps1eps2eps3]
}

fn is_active(x: Number) -> bool {
    parts(x).into_iter().any(|part| part != 0.0)
}

/// Whether value and parts are numbers that can be judged. `<`: a NaN is none.
fn is_tame(x: Number) -> bool {
    x.re.abs() < HUGE && parts(x).into_iter().all(|part| part.abs() < HUGE)
}

/// ⌊log₂|x|⌋; −1023 below the least normal number, 1024 of what is not finite (LANGUAGE has no such operation: the
/// table's own words).
fn exponent(x: f64) -> i32 {
    let field = (x.to_bits() >> 52) & 0x7ff;
    i32::try_from(field).unwrap_or(0) - 1023
}

#[cfg(test)]
mod tests {
    use isograd_graph::{Builder, Mode, Unwatched};

    use super::*;

    /// An operation of inputs, differentiated by three of them.
    fn by(op: Op, inputs: &[f64], seeds: [usize; 3]) -> Derivatives {
        let mut b = Builder::new(Mode::Raw, 100, &Unwatched);
        let nodes: Vec<NodeId> = inputs.iter().map(|_| b.input("x", Scalar::Real)).collect();
        let result = b.op(op, &nodes);
        b.output("y", result);
        let graph = b.finish().expect("small");
        let inputs: Vec<Value> = inputs.iter().map(|x| Value::Real(*x)).collect();
        let outcome = run(&graph, &inputs, seeds, None).expect("ends");
        assert!(!outcome.doubtful, "{op}");
        outcome.outputs[0].expect("a real")
    }

    fn near(x: f64, want: f64) -> bool {
        (x - want).abs() <= 1e-14 * want.abs().max(1.0)
    }

    #[test]
    fn known_derivatives() {
        let cube = by(Op::Pow, &[2.0, 3.0], [0, 0, 0]);
        assert!(near(cube.first[2], 12.0) && near(cube.second[1], 12.0) && near(cube.third, 6.0), "{cube:?}");
        let quotient = by(Op::Div, &[1.0, 2.0], [1, 1, 1]);
        assert!(near(quotient.second[0], 0.25) && near(quotient.third, -0.375), "{quotient:?}");
        // ∂³‖(x, y)‖/∂x²∂y = y(2x² − y²)/‖(x, y)‖⁵.
        let length = by(Op::Length2, &[3.0, 4.0], [0, 0, 1]);
        assert!(near(length.third, 4.0 * (18.0 - 16.0) / 3125.0), "{length:?}");
        // ∂³ angle/∂x³ = 2y(3x² − y²)/‖(x, y)‖⁶, on both sides of the diagonal.
        for (y, x) in [(1.0_f64, 3.0), (3.0, -1.0), (-3.0, 1.0)] {
            let h2 = x * x + y * y;
            let angle = by(Op::Atan2, &[y, x], [1, 1, 1]);
            assert!(near(angle.third, -2.0 * y * (3.0 * x * x - y * y) / h2.powi(3)), "{angle:?}");
            assert!(near(angle.value, y.atan2(x)) && near(angle.first[0], -y / h2), "{angle:?}");
        }
    }

    /// Every real operation of reals has its own case here: the values are the table's.
    #[test]
    fn values_are_those_of_the_table() {
        for op in Op::ALL.iter().filter(|op| op.def().result == Scalar::Real) {
            for point in crate::points::in_domain(op.def(), 50, 3) {
                let mut b = Builder::new(Mode::Raw, 100, &Unwatched);
                let nodes: Vec<NodeId> = op.def().operands.iter().map(|kind| b.input("x", *kind)).collect();
                let result = b.op(*op, &nodes);
                b.output("y", result);
                let graph = b.finish().expect("small");
                let got = run(&graph, &point, [9; 3], None).expect("ends").outputs[0].expect("a real").value;
                let Value::Real(want) = (op.def().eval.f64)(&point) else { panic!("{op}") };
                assert!((got - want).abs() <= 1e-13 * want.abs().max(1.0), "{op} at {point:?}: {got:?}, {want:?}");
            }
        }
    }
}
