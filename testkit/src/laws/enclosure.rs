//! The law of one operation's enclosure: over random boxes of its operands, what it computes of points of the box lies
//! inside, the exact result too (LANGUAGE 15.4, 15.6), and no end is further out than it may be. Knows nothing of how a
//! rule works, and takes no part of the `bound` transform.
//!
//! The definition is an argument, so that an altered one can be judged, and so may the rule's graph be altered.

use isograd_graph::ops::{Accuracy, Family};
use isograd_graph::{
    Builder, Enclosure, Evaluator, Facts, Graph, Mode, NodeId, Op, OpDef, Precision, Range, Scalar, Unwatched, Value,
    parse, print,
};
use isograd_transform::{fold, kernels, optimise};

use super::{Count, Failure, Judgement, show};
use crate::exact;
use crate::points::Random;
use crate::soundness::boxes::{Sampler, Side, least_normal, next_up, steps};
use crate::soundness::tally::Tally;

const LAW: &str = "enclosure";
const TIGHT: &str = "tightness";
const MANY: usize = 4_000_000;
const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

/// As far as kernels keep their promise for `sin`, `cos` and `tan`.
const LAST: f64 = 8192.0;

/// How the operands of a rule are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Each a box of its own.
    Boxes,
    /// This operand is one value of the run.
    Point(usize),
    /// Both are the same value, and the rule knows.
    Same,
    /// The first is a component of a vector whose length is the second, and the rule knows.
    Part,
}

impl Form {
    /// Those of an operation.
    #[must_use]
    pub fn of(op: Op) -> Vec<Self> {
        let operands = op.def().operands;
        let mut all = vec![Self::Boxes];
        all.extend((0..operands.len()).map(Self::Point));
        if matches!(operands, [a, b] if a == b) {
            all.push(Self::Same);
        }
        if op == Op::Unit {
            all.push(Self::Part);
        }
        all
    }
}

/// A rule as a graph: from the ends and flags of its operands to those of its result.
#[derive(Debug, Clone)]
pub struct Rule {
    op: Op,
    precision: Precision,
    form: Form,
    graph: Graph,
    /// The operation by its kernel; others are computed by the table, which has the same bits.
    kernel: Option<Graph>,
}

impl Rule {
    /// The rule in `def`, a definition of `op`.
    ///
    /// # Errors
    /// If a step fails on it.
    pub fn new(op: Op, def: &OpDef, precision: Precision, form: Form) -> Result<Self, Failure> {
        Self::altered(op, def, precision, form, str::to_owned)
    }

    /// The same with its graph altered as text, before any step of the pipeline.
    ///
    /// # Errors
    /// If a step fails on it.
    pub fn altered(
        op: Op,
        def: &OpDef,
        precision: Precision,
        form: Form,
        alter: impl Fn(&str) -> String,
    ) -> Result<Self, Failure> {
        let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
        let given: Vec<Scalar> = if form == Form::Same { def.operands[..1].to_vec() } else { def.operands.to_vec() };
        let inputs: Vec<Vec<NodeId>> = given.iter().map(|scalar| inputs(&mut b, *scalar)).collect();
        let mut operands: Vec<Enclosure> = Vec::new();
        for (k, (scalar, ends)) in given.iter().zip(&inputs).enumerate() {
            operands.push(operand(&mut b, *scalar, ends, form == Form::Point(k)));
        }
        let facts = Facts { same: form == Form::Same, part: form == Form::Part };
        match form {
            Form::Same => operands.push(operands[0]),
            Form::Part => operands[1] = b.enclose(Op::Length2, &operands, Facts::default()),
            Form::Boxes | Form::Point(_) => {}
        }
        let result = (def.enclosure)(&mut b, &operands, facts);
        for (name, node) in ["lo", "hi", "nan"].into_iter().zip(parts(result)) {
            b.output(name, node);
        }
        let failure = |e: &dyn std::fmt::Display| Failure::new(LAW, op, e);
        let graph = b.finish().map_err(|e| failure(&e))?;
        let graph = parse(&alter(&print(&graph))).map_err(|e| failure(&e))?;
        let kernel = match def.accuracy {
            Accuracy::Ulp { .. } => {
                let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
                let args: Vec<NodeId> = def.operands.iter().map(|s| b.input("x", *s)).collect();
                let value = b.op(op, &args);
                b.output("y", value);
                Some(ready(&b.finish().map_err(|e| failure(&e))?, precision).map_err(|e| failure(&e))?)
            }
            Accuracy::Exact | Accuracy::Directed => None,
        };
        Ok(Self { op, precision, form, graph: ready(&graph, precision).map_err(|e| failure(&e))?, kernel })
    }

    /// Ready to judge boxes.
    #[must_use]
    pub fn judge(&self) -> Judge<'_> {
        Judge {
            rule: self,
            enclose: Evaluator::new(&self.graph, self.precision),
            compute: self.kernel.as_ref().map(|graph| Evaluator::new(graph, self.precision)),
            sampler: Sampler::default(),
            inputs: Vec::new(),
        }
    }

    /// A random box of the operands.
    #[must_use]
    pub fn random_box(&self, random: &mut Random) -> Vec<Side> {
        let def = self.op.def();
        let mut sides: Vec<Side> = Vec::new();
        for (k, (scalar, domain)) in def.operands.iter().zip(def.domain).enumerate() {
            let mut side = Side::random(random, *scalar, *domain, self.precision);
            if self.form == Form::Point(k) {
                side = side.narrowed();
            }
            // Operands with ends in common.
            if self.form == Form::Boxes && random.chance(12) {
                side = match (sides.first(), side) {
                    (Some(Side::Real { lo, hi, .. }), Side::Real { nan, .. }) => Side::Real { lo: *lo, hi: *hi, nan },
                    (Some(first @ Side::Int { .. }), Side::Int { .. }) => *first,
                    _ => side,
                };
            }
            sides.push(side);
            if self.form == Form::Same {
                break;
            }
        }
        sides
    }
}

/// A graph as targets compute it.
fn ready(graph: &Graph, precision: Precision) -> Result<Graph, isograd_graph::Exhausted> {
    let graph = fold(graph, precision, MANY, &Unwatched)?;
    let graph = kernels(&graph, precision, Family::Lanes, MANY, &Unwatched)?;
    optimise(&graph, precision, MANY, &Unwatched)
}

fn inputs(b: &mut Builder<'_>, scalar: Scalar) -> Vec<NodeId> {
    match scalar {
        Scalar::Real => vec![b.input("lo", scalar), b.input("hi", scalar), b.input("nan", Scalar::Bool)],
        Scalar::Int | Scalar::Bool => vec![b.input("lo", scalar), b.input("hi", scalar)],
    }
}

fn operand(b: &mut Builder<'_>, scalar: Scalar, ends: &[NodeId], point: bool) -> Enclosure {
    match (scalar, ends) {
        (Scalar::Real, &[x, _, nan]) if point => {
            let none = b.real(f64::NAN);
            let x = b.select(nan, none, x);
            Enclosure::point(b, x)
        }
        (_, &[x, ..]) if point => Enclosure::point(b, x),
        (Scalar::Real, &[lo, hi, nan]) => Enclosure::Real(Range { lo, hi, nan, tidy: true }),
        (Scalar::Bool, &[yes, no]) => Enclosure::Bool { yes, no },
        _ => Enclosure::Int { lo: ends[0], hi: ends[1] },
    }
}

fn parts(enclosure: Enclosure) -> Vec<NodeId> {
    match enclosure {
        Enclosure::Real(x) => vec![x.lo, x.hi, x.nan],
        Enclosure::Int { lo, hi } => vec![lo, hi],
        Enclosure::Bool { yes, no } => vec![yes, no],
    }
}

/// Why an enclosure does not hold a value; `None` if it does.
#[must_use]
pub fn escapes(enclosure: &[Value], value: Value) -> Option<&'static str> {
    let (ordered, inside) = match (enclosure, value) {
        ([Value::Real(lo), Value::Real(hi), Value::Bool(nan)], Value::Real(x)) => {
            let nothing = lo.is_nan() && hi.is_nan() && *nan;
            (lo <= hi || nothing, if x.is_nan() { *nan } else { *lo <= x && x <= *hi })
        }
        ([Value::Int(lo), Value::Int(hi)], Value::Int(x)) => (lo <= hi, *lo <= x && x <= *hi),
        ([Value::Bool(yes), Value::Bool(no)], Value::Bool(x)) => (*yes || *no, if x { *yes } else { *no }),
        _ => (false, false),
    };
    match (inside, ordered) {
        (false, _) => Some("does not hold"),
        (_, false) => Some("is no interval around"),
        _ => None,
    }
}

/// Judges boxes of one rule.
#[derive(Debug)]
pub struct Judge<'r> {
    rule: &'r Rule,
    enclose: Evaluator<'r>,
    compute: Option<Evaluator<'r>>,
    sampler: Sampler,
    inputs: Vec<Value>,
}

impl Judge<'_> {
    /// Encloses the operation over a box.
    ///
    /// # Errors
    /// If it takes too long.
    pub fn enclosure(&mut self, sides: &[Side]) -> Result<Vec<Value>, Failure> {
        self.inputs.clear();
        sides.iter().for_each(|side| side.write(&mut self.inputs));
        self.enclose.run(&self.inputs).ok_or_else(|| Failure::new(LAW, self.rule.op, "too many steps"))
    }

    /// The values at a point of the box: as computed, and with negligible error if that is known.
    fn values(&mut self, point: &[Value]) -> (Value, Option<f64>) {
        let Rule { op, precision, form, .. } = *self.rule;
        let def = op.def();
        let mut args = [Value::Int(0); 4];
        let count = def.operands.len();
        args[..point.len()].copy_from_slice(point);
        match form {
            Form::Same => args[1] = args[0],
            Form::Part => args[1] = (Op::Length2.def().eval.at(precision))(&args[..2]),
            Form::Boxes | Form::Point(_) => {}
        }
        let computed = match &mut self.compute {
            Some(compute) => compute.run(&args[..count]).map_or(Value::Real(f64::NAN), |all| all[0]),
            None => (def.eval.at(precision))(&args[..count]),
        };
        if precision == Precision::F64 {
            return (computed, None);
        }
        if form == Form::Part {
            args[1] = (Op::Length2.def().eval.f64)(point);
        }
        let reals = def.result == Scalar::Real && def.accuracy != Accuracy::Directed;
        let exact = match (op, &args[..count]) {
            // In f64 more powers of 2 are numbers.
            (Op::Scale, [Value::Real(x), Value::Int(n)]) => (-126..=127).contains(n).then(|| x * 2.0_f64.powi(*n)),
            (_, args) => match (def.eval.f64)(args) {
                Value::Real(x) if reals && !coarse(op, args) => Some(x),
                _ => None,
            },
        };
        (computed, exact)
    }

    /// Judges `samples` points of a box.
    ///
    /// # Errors
    /// At the first value that is not enclosed.
    pub fn judge(
        &mut self,
        sides: &[Side],
        samples: usize,
        random: &mut Random,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let Rule { op, precision, form, .. } = *self.rule;
        let enclosure = self.enclosure(sides)?;
        let mut sampler = std::mem::take(&mut self.sampler);
        sampler.begin(sides, random, precision);
        let grid = sampler.grid(samples / 2).min(samples);
        let mut hull = (f64::INFINITY, f64::NEG_INFINITY);
        let mut wrong = None;
        for n in 0..samples {
            // A point that is NaN has no other value.
            let mut unknown = [Value::Real(f64::NAN); 4];
            let point = sampler.point(n, grid, sides, random, precision);
            let point = match form {
                Form::Point(k) if matches!(sides[k], Side::Real { nan: true, .. }) => {
                    unknown[..point.len()].copy_from_slice(point);
                    unknown[k] = Value::Real(f64::NAN);
                    &unknown[..point.len()]
                }
                _ => point,
            };
            let (computed, near) = self.values(point);
            if !outside_of_the_law(op, form, point, precision) {
                if let Some(why) = escapes(&enclosure, computed) {
                    wrong = Some((why, computed, point.to_vec()));
                    break;
                }
                if let Value::Real(x) = computed {
                    hull = (hull.0.min(x), hull.1.max(x));
                }
            }
            if let Some(x) = near.filter(|x| !x.is_nan()) {
                if let Some(why) = escapes(&enclosure, Value::Real(x)) {
                    wrong = Some((why, Value::Real(x), point.to_vec()));
                    break;
                }
            } else if n % 16 == 1 && form == Form::Boxes && exact::outside(op, point, &enclosure) {
                wrong = Some(("does not hold the exact result", computed, point.to_vec()));
                break;
            }
        }
        self.sampler = sampler;
        tally.boxes += 1;
        tally.samples += samples as u64;
        if let [Value::Real(lo), Value::Real(hi), Value::Bool(nan)] = enclosure[..] {
            tally.measure((lo, hi), hull);
            tally.flagged += u64::from(nan);
        }
        let Some((why, value, point)) = wrong else { return Ok(()) };
        let (enclosure, value) = (show(&enclosure), show(&[value]));
        let what = format!(
            "{} {form:?}: over {sides:?} the enclosure {enclosure} {why} {value} at {}",
            precision.name(),
            show(&point)
        );
        Err(Failure::new(LAW, op, what))
    }

    /// Judges how far out the ends over a box are.
    fn tight(&mut self, sides: &[Side], random: &mut Random) -> Result<bool, Failure> {
        let Rule { op, precision, .. } = *self.rule;
        let point = sides.iter().all(|side| *side == side.narrowed());
        let Some(slack) = slack(op, sides, point) else { return Ok(false) };
        let enclosure = self.enclosure(sides)?;
        let mut sampler = std::mem::take(&mut self.sampler);
        sampler.begin(sides, random, precision);
        let Some(grid) = Some(sampler.grid(3000)).filter(|grid| point || *grid > 1 << sides.len()) else {
            return Ok(self.back(sampler));
        };
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for n in 0..grid {
            let point = sampler.point(n, grid, sides, random, precision);
            let open = outside_of_the_law(op, self.rule.form, point, precision);
            match self.values(point).0 {
                Value::Real(x) if !x.is_finite() || open => return Ok(self.back(sampler)),
                Value::Real(x) => (least, most) = (least.min(x), most.max(x)),
                Value::Int(x) => (least, most) = (least.min(x.into()), most.max(x.into())),
                Value::Bool(x) => {
                    (least, most) = (least.min(f64::from(u8::from(x))), most.max(f64::from(u8::from(x))));
                }
            }
        }
        self.back(sampler);
        let loose = match enclosure[..] {
            [Value::Real(lo), Value::Real(hi), Value::Bool(nan)] => {
                let near = match slack {
                    Slack::Steps(n) => steps(precision, lo, least) <= n && steps(precision, most, hi) <= n,
                    Slack::Ulps(n, of) => {
                        let ulp = next_up(precision, of) - of;
                        lo >= least - n * ulp && hi <= most + n * ulp
                    }
                };
                !near || nan
            }
            [Value::Int(lo), Value::Int(hi)] => f64::from(lo) < least || f64::from(hi) > most,
            [Value::Bool(yes), Value::Bool(no)] => (yes && most == 0.0) || (no && least == 1.0),
            _ => true,
        };
        if !loose {
            return Ok(true);
        }
        let what = format!(
            "{}: over {sides:?} the enclosure {} is wider than what lies from {least:?} to {most:?} needs",
            precision.name(),
            show(&enclosure)
        );
        Err(Failure::new(TIGHT, op, what))
    }

    fn back(&mut self, sampler: Sampler) -> bool {
        self.sampler = sampler;
        false
    }
}

/// How far out an end may be.
#[derive(Debug, Clone, Copy)]
enum Slack {
    /// So many numbers.
    Steps(i64),
    /// So many units in the last place of a number.
    Ulps(f64, f64),
}

/// How far outside of what is computed an end may be: of a point, or of a box at whose corners and zeros the operation
/// has its extremes. `None` where that is not promised.
fn slack(op: Op, sides: &[Side], point: bool) -> Option<Slack> {
    let mut reals = sides.iter().filter_map(|side| match side {
        Side::Real { lo, hi, nan } => Some((*lo, *hi, *nan)),
        _ => None,
    });
    if reals.clone().any(|(lo, hi, nan)| nan || lo.is_infinite() || hi.is_infinite()) {
        return None;
    }
    let ints = |n: usize| match sides.get(n) {
        Some(Side::Int { lo, .. }) => i64::from(*lo),
        _ => 0,
    };
    let fits = |x: i64| i32::try_from(x).is_ok().then_some(Slack::Steps(0));
    let (first, second) = (reals.next().unwrap_or_default(), reals.next().unwrap_or_default());
    let pole = second.0 <= 0.0 && 0.0 <= second.1;
    match (op, op.def().accuracy) {
        // Rounding both ways, and what a zero is.
        (Op::Add | Op::Sub | Op::Mul | Op::Sqrt, _) => Some(Slack::Steps(1)),
        (Op::Div, _) => (!pole).then_some(Slack::Steps(1)),
        (Op::Neg | Op::Abs | Op::Min | Op::Max | Op::Floor | Op::Ceil | Op::Trunc | Op::Round | Op::Sign, _) => {
            Some(Slack::Steps(0))
        }
        (Op::InverseSqrt, _) => Some(Slack::Steps(3)),
        // Squares of what is small underflow.
        (Op::Length2 | Op::Length3 | Op::Length4, _) => {
            let small = |x: f64| x != 0.0 && x.abs() < 1e-15;
            let tiny = sides.iter().any(|s| matches!(s, Side::Real { lo, hi, .. } if small(*lo) || small(*hi)));
            (!tiny).then_some(Slack::Steps(4))
        }
        (Op::IntToReal, _) => Some(Slack::Steps(1)),
        (Op::Lt | Op::Le | Op::Eq | Op::Ne | Op::IntLt | Op::IntLe | Op::IntEq, _) => Some(Slack::Steps(0)),
        _ if !point => None,
        (Op::Mod, _) => {
            (!pole).then_some(Slack::Ulps(4.0, first.0.abs().max(second.0.abs()).max(f64::from(f32::MIN_POSITIVE))))
        }
        (Op::Unit, _) => (second.0 > 0.0).then_some(Slack::Steps(2)),
        (Op::Atan2, _) => (first.0 != 0.0 || second.0 > 0.0).then_some(Slack::Steps(8)),
        (Op::Sin | Op::Cos | Op::Tan, _) => (first.0.abs() <= LAST).then_some(Slack::Steps(8)),
        (Op::Pow, _) => (first.0 > 0.0).then_some(Slack::Steps(8)),
        // Which sign a zero has is not known.
        (Op::Copysign, _) => (second.0 != 0.0).then_some(Slack::Steps(0)),
        (Op::IntAdd, _) => fits(ints(0) + ints(1)),
        (Op::IntSub, _) => fits(ints(0) - ints(1)),
        (Op::IntMul, _) => fits(ints(0) * ints(1)),
        (Op::IntNeg | Op::IntAbs, _) => fits(-ints(0)),
        (Op::IntDiv, _) => fits(ints(0).checked_div(ints(1)).unwrap_or(0)),
        (Op::IntRem, _) => (ints(1) != 0).then_some(Slack::Steps(0)),
        (_, Accuracy::Ulp { .. }) => Some(Slack::Steps(8)),
        (_, Accuracy::Directed) => (op.def().result == Scalar::Real).then_some(Slack::Steps(2)),
        (_, Accuracy::Exact) => Some(Slack::Steps(1)),
    }
}

/// Where even f64 cannot tell the exact result of operands that are f32 numbers.
fn coarse(op: Op, point: &[Value]) -> bool {
    match (op, point) {
        (Op::Mod, [Value::Real(x), Value::Real(y)]) => (x / y).abs() > 1e6 || *y == 0.0,
        (Op::InverseSqrt, [Value::Real(x)]) | (Op::Pow, [Value::Real(x), _]) => *x == 0.0 || x.is_infinite(),
        (Op::Sin | Op::Cos | Op::Tan, [Value::Real(x)]) => x.abs() > LAST,
        _ => false,
    }
}

/// What LANGUAGE 15.4 does not promise: values that overflow or underflow on the way, and arguments that the operations
/// under the directed ones are not made for.
fn outside_of_the_law(op: Op, form: Form, point: &[Value], precision: Precision) -> bool {
    if form == Form::Part {
        let tiny = least_normal(precision) * 2.0_f64.powi(60);
        return point.iter().any(
            |v| matches!(v, Value::Real(x) if *x != 0.0 && (x * x < tiny || precision.round(x * x).is_infinite())),
        );
    }
    let point = match (form, point) {
        (Form::Same, &[x]) => &[x, x],
        _ => point,
    };
    match (op, point) {
        // 1/√−0 is −∞, which the table leaves out; −0 is 0.
        (Op::InverseSqrt, [Value::Real(x)]) => *x == 0.0 && x.is_sign_negative(),
        // So do negative powers of −0; those of −∞ have limits, while the table asks for an integer exponent.
        (Op::Pow, [Value::Real(x), _]) => (*x == 0.0 && x.is_sign_negative()) || *x == f64::NEG_INFINITY,
        (Op::Mod, [Value::Real(x), Value::Real(y)]) => {
            let quotient = precision.round(x / y);
            let product = precision.round(quotient.floor() * y);
            let overflows = x.is_finite() && y.is_finite() && *y != 0.0;
            (overflows && !(quotient.is_finite() && product.is_finite()))
                || (quotient != 0.0 && quotient.abs() < 2.0 * least_normal(precision))
                || (quotient == 0.0 && *x != 0.0)
        }
        // Steps of the bits of a rounded result.
        (_, [Value::Real(x), Value::Bool(_)]) if op.def().accuracy == Accuracy::Directed => *x == 0.0 || !x.is_finite(),
        _ => op.def().accuracy == Accuracy::Directed && point.iter().any(|v| matches!(v, Value::Real(x) if x.is_nan())),
    }
}

/// Judges the rule in `def`, a definition of `op`, over `boxes` random boxes in each form and precision: computed
/// values lie inside, in f32 those of f64 too, which have next to no error, in f64 exact ones where they are known.
///
/// # Errors
/// At the first value that is not enclosed.
pub fn enclosure(op: Op, def: &OpDef, boxes: usize, seed: u64) -> Judgement {
    altered_enclosure(op, def, boxes, seed, str::to_owned)
}

/// The same with the rule's graph altered as text.
///
/// # Errors
/// At the first value that is not enclosed.
pub fn altered_enclosure(
    op: Op,
    def: &OpDef,
    boxes: usize,
    seed: u64,
    alter: impl Fn(&str) -> String + Copy,
) -> Judgement {
    const SAMPLES: usize = 24;
    let mut tally = Tally::default();
    for form in Form::of(op) {
        for precision in PRECISIONS {
            let rule = Rule::altered(op, def, precision, form, alter)?;
            let mut judge = rule.judge();
            let mut random = Random::new(seed);
            for _ in 0..boxes {
                let sides = rule.random_box(&mut random);
                judge.judge(&sides, SAMPLES, &mut random, &mut tally)?;
            }
        }
    }
    Ok(Count { judged: usize::try_from(tally.samples).unwrap_or(usize::MAX), unjudged: 0 })
}

/// Judges how far out the ends are that the rule in `def` gives: over points, and over boxes of operations that have
/// their extremes at corners and zeros.
///
/// # Errors
/// At the first end that is further out than it may be, and the first flag without need.
pub fn tightness(op: Op, def: &OpDef, boxes: usize, seed: u64) -> Judgement {
    altered_tightness(op, def, boxes, seed, str::to_owned)
}

/// The same with the rule's graph altered as text.
///
/// # Errors
/// At the first end that is further out than it may be, and the first flag without need.
pub fn altered_tightness(
    op: Op,
    def: &OpDef,
    boxes: usize,
    seed: u64,
    alter: impl Fn(&str) -> String + Copy,
) -> Judgement {
    let mut count = Count::default();
    for precision in PRECISIONS {
        let rule = Rule::altered(op, def, precision, Form::Boxes, alter)?;
        let mut judge = rule.judge();
        let mut random = Random::new(seed);
        for k in 0..boxes {
            let mut sides = rule.random_box(&mut random);
            if k % 3 != 0 {
                sides.iter_mut().for_each(|side| *side = side.narrowed());
            }
            if judge.tight(&sides, &mut random)? {
                count.judged += 1;
            } else {
                count.unjudged += 1;
            }
        }
    }
    Ok(count)
}
