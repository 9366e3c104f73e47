//! Interval rules against samples: what an operation computes of points of its operands lies in the enclosure, the exact
//! result of arithmetic too, and no end is further out than LANGUAGE 15.4 says. Knows nothing of how a rule works.

#![allow(clippy::pedantic, reason = "tests")]

use std::cmp::Ordering;

use dashu_float::{FBig, round::mode::Zero};
use isograd_graph::{
    Builder, Enclosure, Evaluator, Facts, Graph, Mode, NodeId, Op, Precision, Range, Scalar, Unwatched, Value,
    ops::Accuracy,
};

mod boxes;
mod cases;

use boxes::{Box, Random, next_down, next_up};
use cases::of_constants;

const INF: f64 = f64::INFINITY;
const NAN: f64 = f64::NAN;
const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

/// Arithmetic of LANGUAGE 15.4: ends are exact if they can be, else at most 2 ulp outside.
#[rustfmt::skip]
const ARITHMETIC: [Op; 14] = [
    Op::Add, Op::Sub, Op::Mul, Op::Div, Op::Sqrt, Op::Abs, Op::Neg, Op::Min, Op::Max, Op::Floor, Op::Ceil, Op::Trunc,
    Op::Round, Op::Sign,
];

/// How the operands of a rule are made.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Form {
    /// All boxes.
    Boxes,
    /// This operand is a value of the run.
    Point(usize),
}

/// One way to break a rule.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Break {
    None,
    /// The rule does not see the upper or lower end of an operand.
    ForgetEnd(usize, bool),
    /// Not whether an operand is flagged, or whether a bool may be true or false.
    ForgetFlag(usize, bool),
    /// The result is not flagged.
    Unflag,
    /// An end lies one step inside.
    PullLower,
    PullUpper,
    /// The ends are exchanged, or the sides of a truth value.
    Swap,
}

struct Law {
    op: Op,
    p: Precision,
    form: Form,
    graph: Graph,
}

impl Law {
    fn new(op: Op, p: Precision, form: Form, mode: Mode, broken: Break) -> Self {
        let def = op.def();
        let mut b = Builder::new(mode, 100_000, &Unwatched);
        let inputs: Vec<Vec<NodeId>> = def
            .operands
            .iter()
            .map(|s| match s {
                Scalar::Real => vec![b.input("lo", *s), b.input("hi", *s), b.input("nan", Scalar::Bool)],
                _ => vec![b.input("lo", *s), b.input("hi", *s)],
            })
            .collect();
        let mut operands = Vec::new();
        for (i, (scalar, ends)) in def.operands.iter().zip(&inputs).enumerate() {
            let mut ends = ends.clone();
            match broken {
                Break::ForgetEnd(k, upper) if k == i => ends[usize::from(upper)] = ends[usize::from(!upper)],
                Break::ForgetFlag(k, true) if k == i => *ends.last_mut().unwrap() = b.bool(false),
                Break::ForgetFlag(k, false) if k == i => ends[0] = b.bool(false),
                _ => {}
            }
            operands.push(match scalar {
                _ if form == Form::Point(i) => {
                    let none = b.real(NAN);
                    let x = if *scalar == Scalar::Real { b.select(ends[2], none, ends[0]) } else { ends[0] };
                    Enclosure::point(&mut b, x)
                }
                Scalar::Real => Enclosure::Real(Range { lo: ends[0], hi: ends[1], nan: ends[2], tidy: true }),
                Scalar::Int => Enclosure::Int { lo: ends[0], hi: ends[1] },
                Scalar::Bool => Enclosure::Bool { yes: ends[0], no: ends[1] },
            });
        }
        let result = b.enclose(op, &operands, Facts::default());
        let result = break_result(&mut b, result, broken);
        output(&mut b, result);
        Self { op, p, form, graph: b.finish().unwrap() }
    }

    /// What is wrong with one of so many random boxes.
    fn fails(&self, boxes: usize, seed: u64) -> Option<String> {
        let mut r = Random(seed ^ (self.op as u64) << 32);
        let mut evaluator = Evaluator::new(&self.graph, self.p);
        for _ in 0..boxes {
            let operands = self.operands(&mut r);
            let mut inputs = Vec::new();
            operands.iter().for_each(|x| x.inputs(&mut inputs));
            let result = evaluator.run(&inputs).unwrap();
            if let Err(why) = self.check(&operands, &result, &mut r) {
                return Some(format!(
                    "{} {} {:?}: {why}\n  of {operands:?}\n  is {result:?}",
                    self.p.name(),
                    self.op,
                    self.form
                ));
            }
        }
        None
    }

    fn operands(&self, r: &mut Random) -> Vec<Box> {
        let def = self.op.def();
        let mut operands: Vec<Box> = Vec::new();
        for (i, (s, d)) in def.operands.iter().zip(def.domain).enumerate() {
            let mut x = Box::random(r, *s, *d, self.p);
            if self.form == Form::Point(i) {
                x = match x {
                    Box::Real { lo, nan, .. } => Box::Real { lo, hi: lo, nan },
                    Box::Int(lo, _) => Box::Int(lo, lo),
                    Box::Bool { yes, .. } => Box::Bool { yes, no: !yes },
                };
            }
            // Operands with ends in common.
            let x = match (operands.first(), x) {
                (Some(first), x) if r.one_in(8) && self.form == Form::Boxes => first.like(x),
                _ => x,
            };
            operands.push(x);
        }
        operands
    }

    fn check(&self, operands: &[Box], result: &[Value], r: &mut Random) -> Result<(), String> {
        let mut samples: Vec<Vec<Value>> = operands.iter().map(|x| x.samples(r, operands, self.p)).collect();
        // A point that is NaN has no other value.
        if let Form::Point(i) = self.form
            && let Box::Real { nan: true, .. } = operands[i]
        {
            samples[i] = vec![Value::Real(NAN)];
        }
        let mut seen = Seen::default();
        let all: usize = samples.iter().map(Vec::len).product();
        let tries = if all <= 250 { all } else { 64 };
        let mut point = Vec::new();
        for n in 0..tries {
            let mut code = n;
            point.clear();
            for s in &samples {
                let values = if all <= 250 || n >= 16 { s.len() } else { s.len().min(2) };
                point.push(if all > 250 && n >= 16 { r.of(s) } else { s[code % values] });
                code /= values;
            }
            let value = (self.op.def().eval.at(self.p))(&point);
            if !outside_of_the_law(self.op, &point, self.p) {
                contains(result, value).map_err(|why| format!("{why} {value:?} at {point:?}"))?;
            }
            if n < 4 || r.one_in(8) {
                self.contains_exactly(result, &point)?;
            }
            seen.add(value);
        }
        self.tight(operands, result, &seen, all <= 250)
    }

    /// The exact result of arithmetic lies inside too.
    fn contains_exactly(&self, result: &[Value], point: &[Value]) -> Result<(), String> {
        let x: Vec<f64> = point.iter().filter_map(|v| if let Value::Real(x) = v { Some(*x) } else { None }).collect();
        if x.iter().any(|x| !x.is_finite()) {
            return Ok(());
        }
        for (end, wrong) in [(0, Ordering::Less), (1, Ordering::Greater)] {
            let Value::Real(end) = result[end] else { return Ok(()) };
            if end.is_finite() && exact(self.op, &x, end) == Some(wrong) {
                return Err(format!("the exact result lies outside of the end {end:e} at {point:?}"));
            }
        }
        Ok(())
    }

    /// No end, flag or side without need.
    fn tight(&self, operands: &[Box], result: &[Value], seen: &Seen, complete: bool) -> Result<(), String> {
        let clean = operands.iter().all(|x| !matches!(x, Box::Real { nan: true, .. }));
        // A point that is NaN is read as everything.
        if matches!(self.form, Form::Point(i) if matches!(operands[i], Box::Real { nan: true, .. })) {
            return Ok(());
        }
        match result {
            [Value::Real(lo), Value::Real(hi), Value::Bool(nan), ..] => {
                if *nan && !seen.nan && complete && self.op.def().accuracy == Accuracy::Exact && clean {
                    return Err("flagged without need".into());
                }
                let pole = self.op == Op::Div
                    && matches!(operands[1], Box::Real { lo, hi, nan } if lo <= 0.0 && 0.0 <= hi || nan);
                // An undefined end is as far out as it can be, and 0·∞ is 0 at ends.
                let endless =
                    operands.iter().any(|x| matches!(x, Box::Real { lo, hi, .. } if lo == hi && lo.is_infinite()));
                if !ARITHMETIC.contains(&self.op) || pole || endless || seen.lo > seen.hi || !complete {
                    return Ok(());
                }
                let (p, down, up) = (self.p, next_down(self.p, seen.lo), next_up(self.p, seen.hi));
                // The nearest is ½ ulp from the exact end at most, and so is the end when it is directed.
                if *lo < down || *hi > up || next_down(p, *lo) > seen.lo {
                    return Err(format!("loose: sampled {:e} to {:e}", seen.lo, seen.hi));
                }
                Ok(())
            }
            [Value::Int(lo), Value::Int(hi)] => {
                let loose = (seen.int.0, seen.int.1) != (*lo, *hi);
                let exact = !matches!(self.op, Op::IntRem | Op::Exponent | Op::RealToInt);
                if exact && complete && loose && !self.leaves(operands) {
                    return Err(format!("loose: sampled {:?}", seen.int));
                }
                Ok(())
            }
            [Value::Bool(yes), Value::Bool(no)] => {
                if self.op.def().accuracy == Accuracy::Exact && complete && (*yes && !seen.yes || *no && !seen.no) {
                    return Err(format!("undecided: sampled {} {}", seen.yes, seen.no));
                }
                Ok(())
            }
            _ => Err("no enclosure".into()),
        }
    }

    /// Whether the wide result of an int operation leaves the ints at some pair of ends.
    fn leaves(&self, operands: &[Box]) -> bool {
        let ends = |k: usize| match operands.get(k) {
            Some(Box::Int(lo, hi)) => vec![i64::from(*lo), i64::from(*hi)],
            _ => vec![0],
        };
        let ints = i64::from(i32::MIN)..=i64::from(i32::MAX);
        let mut wide = Vec::new();
        for x in ends(0) {
            for y in ends(1) {
                wide.push(match self.op {
                    Op::IntAdd => x + y,
                    Op::IntSub => x - y,
                    Op::IntMul => x * y,
                    Op::IntNeg | Op::IntAbs => -x,
                    _ => 0,
                });
            }
        }
        // −2³¹ / −1 with −1 inside.
        let divided =
            self.op == Op::IntDiv && ends(0)[0] == i64::from(i32::MIN) && (ends(1)[0]..=ends(1)[1]).contains(&-1);
        divided || wide.iter().any(|x| !ints.contains(x))
    }
}

/// The hull of the values seen.
struct Seen {
    lo: f64,
    hi: f64,
    nan: bool,
    int: (i32, i32),
    yes: bool,
    no: bool,
}

impl Default for Seen {
    fn default() -> Self {
        Self { lo: INF, hi: -INF, nan: false, int: (i32::MAX, i32::MIN), yes: false, no: false }
    }
}

impl Seen {
    fn add(&mut self, value: Value) {
        match value {
            Value::Real(x) if x.is_nan() => self.nan = true,
            Value::Real(x) => (self.lo, self.hi) = (self.lo.min(x), self.hi.max(x)),
            Value::Int(x) => self.int = (self.int.0.min(x), self.int.1.max(x)),
            Value::Bool(true) => self.yes = true,
            Value::Bool(false) => self.no = true,
        }
    }
}

fn contains(result: &[Value], value: Value) -> Result<(), &'static str> {
    let inside = match (result, value) {
        ([Value::Real(_), Value::Real(_), Value::Bool(nan), ..], Value::Real(x)) if x.is_nan() => *nan,
        ([Value::Real(lo), Value::Real(hi), _, Value::Real(tidy_lo), Value::Real(tidy_hi), _], Value::Real(x)) => {
            *lo <= x && x <= *hi && *tidy_lo <= x && x <= *tidy_hi
        }
        ([Value::Int(lo), Value::Int(hi)], Value::Int(x)) => *lo <= x && x <= *hi,
        ([Value::Bool(yes), Value::Bool(no)], Value::Bool(x)) => {
            if x {
                *yes
            } else {
                *no
            }
        }
        _ => false,
    };
    let ordered = match result {
        [_, _, Value::Bool(nan), Value::Real(lo), Value::Real(hi), Value::Bool(tidy_nan)] => {
            lo <= hi && (*tidy_nan || !nan)
        }
        _ => true,
    };
    match (inside, ordered) {
        (false, _) => Err("outside is"),
        (_, false) => Err("no interval, with"),
        _ => Ok(()),
    }
}

/// What LANGUAGE 15.4 does not promise: values that overflow or underflow on the way, and arguments that the operations
/// under the directed ones are not made for.
fn outside_of_the_law(op: Op, point: &[Value], p: Precision) -> bool {
    match (op, point) {
        // 1/√−0 is −∞, which the table leaves out; −0 is 0.
        (Op::InverseSqrt, [Value::Real(x)]) => *x == 0.0 && x.is_sign_negative(),
        // So do negative powers of −0; those of −∞ have limits, while the table asks for an integer exponent.
        (Op::Pow, [Value::Real(x), _]) => *x == 0.0 && x.is_sign_negative() || *x == -INF,
        (Op::Mod, [Value::Real(x), Value::Real(y)]) => {
            let quotient = p.round(x / y);
            x.is_finite()
                && y.is_finite()
                && *y != 0.0
                && (!quotient.is_finite() || !p.round(quotient.floor() * y).is_finite())
                || quotient != 0.0 && quotient.abs() < 1e-37
                || quotient == 0.0 && *x != 0.0
        }
        (Op::Above | Op::Below, [Value::Real(x), _]) => *x == 0.0 || !x.is_finite(),
        (Op::Raised | Op::Lowered, [Value::Real(x), _]) => *x <= 0.0 || !x.is_finite(),
        _ => op.def().accuracy == Accuracy::Directed && point.iter().any(|v| matches!(v, Value::Real(x) if x.is_nan())),
    }
}

/// How the exact result of arithmetic compares with a number.
fn exact(op: Op, x: &[f64], end: f64) -> Option<Ordering> {
    let big = |x: f64| FBig::<Zero, 2>::try_from(x).unwrap().with_precision(0).value();
    let zero = FBig::<Zero, 2>::ZERO;
    Some(match (op, x) {
        (Op::Add, [x, y]) => (big(*x) + big(*y)).cmp(&big(end)),
        (Op::Sub, [x, y]) => (big(*x) - big(*y)).cmp(&big(end)),
        (Op::Mul, [x, y]) => (big(*x) * big(*y)).cmp(&big(end)),
        (Op::Div, [_, y]) if *y == 0.0 => return None,
        (Op::Div, [x, y]) => {
            let order = big(*x).cmp(&(big(end) * big(*y)));
            if *y < 0.0 { order.reverse() } else { order }
        }
        (Op::Sqrt, [x]) if *x < 0.0 => return None,
        (Op::Sqrt, [_]) if end < 0.0 => Ordering::Greater,
        (Op::Sqrt, [x]) => big(*x).cmp(&(big(end) * big(end))),
        (Op::Length2 | Op::Length3 | Op::Length4, v) => {
            if end < 0.0 {
                return Some(Ordering::Greater);
            }
            v.iter().fold(zero, |s, x| s + big(*x) * big(*x)).cmp(&(big(end) * big(end)))
        }
        (Op::Fract, [x]) => (big(*x) - big(x.floor())).cmp(&big(end)),
        _ => return None,
    })
}

fn output(b: &mut Builder<'_>, result: Enclosure) {
    let nodes = match result {
        Enclosure::Real(x) => {
            let tidy = x.tidied(b);
            vec![x.lo, x.hi, x.nan, tidy.lo, tidy.hi, tidy.nan]
        }
        Enclosure::Int { lo, hi } => vec![lo, hi],
        Enclosure::Bool { yes, no } => vec![yes, no],
    };
    for node in nodes {
        b.output("end", node);
    }
}

fn break_result(b: &mut Builder<'_>, result: Enclosure, broken: Break) -> Enclosure {
    let one = b.int(1);
    match (result, broken) {
        (Enclosure::Real(x), Break::Unflag) => Enclosure::Real(Range { nan: b.bool(false), ..x }),
        (Enclosure::Real(x), Break::PullLower) => Enclosure::Real(Range { lo: b.next_up(x.lo), ..x }),
        (Enclosure::Real(x), Break::PullUpper) => Enclosure::Real(Range { hi: b.next_down(x.hi), ..x }),
        (Enclosure::Real(x), Break::Swap) => Enclosure::Real(Range { lo: x.hi, hi: x.lo, ..x }),
        (Enclosure::Int { lo, hi }, Break::PullLower) => Enclosure::Int { lo: b.iadd(lo, one), hi },
        (Enclosure::Int { lo, hi }, Break::PullUpper) => Enclosure::Int { lo, hi: b.isub(hi, one) },
        (Enclosure::Int { lo, hi }, Break::Swap) => Enclosure::Int { lo: hi, hi: lo },
        (Enclosure::Bool { no, .. }, Break::PullLower) => Enclosure::Bool { yes: b.bool(false), no },
        (Enclosure::Bool { yes, .. }, Break::PullUpper) => Enclosure::Bool { yes, no: b.bool(false) },
        (Enclosure::Bool { yes, no }, Break::Swap) => Enclosure::Bool { yes: no, no: yes },
        (result, _) => result,
    }
}

fn forms(op: Op) -> Vec<Form> {
    let mut forms = vec![Form::Boxes];
    forms.extend((0..op.def().operands.len()).map(Form::Point));
    forms
}

#[test]
fn enclosures_contain_what_is_computed() {
    let mut failures = Vec::new();
    for op in Op::ALL {
        for p in PRECISIONS {
            for form in forms(*op) {
                let boxes = if form == Form::Boxes { 20_000 } else { 4_000 };
                failures.extend(Law::new(*op, p, form, Mode::Real(p), Break::None).fails(boxes, 1));
            }
        }
    }
    assert!(failures.is_empty(), "{} fail\n{}", failures.len(), failures.join("\n"));
}

fn breaks(op: Op) -> Vec<Break> {
    let def = op.def();
    let mut breaks = vec![Break::Swap];
    for (i, scalar) in def.operands.iter().enumerate() {
        breaks.extend(match scalar {
            Scalar::Real => vec![Break::ForgetEnd(i, false), Break::ForgetEnd(i, true), Break::ForgetFlag(i, true)],
            Scalar::Int => vec![Break::ForgetEnd(i, false), Break::ForgetEnd(i, true)],
            Scalar::Bool => vec![Break::ForgetFlag(i, false), Break::ForgetFlag(i, true)],
        });
    }
    if def.result == Scalar::Real && def.operands.contains(&Scalar::Real) {
        breaks.push(Break::Unflag);
    }
    breaks.extend([Break::PullLower, Break::PullUpper]);
    match def.accuracy {
        Accuracy::Exact => {}
        // They are enclosed like what they round, which has another end; what they give for a NaN is not specified.
        Accuracy::Directed => breaks.retain(|x| matches!(x, Break::Swap | Break::ForgetEnd(..))),
        // Kernels are widened by more than one step.
        Accuracy::Ulp { .. } => breaks.retain(|x| !matches!(x, Break::PullLower | Break::PullUpper)),
    }
    breaks
}

#[test]
fn broken_rules_are_caught() {
    let mut survivors = Vec::new();
    // Truth values that directed operations choose by are in no program, and enclosed by everything.
    let part = |op: &Op| op.def().accuracy == Accuracy::Directed && op.def().result == Scalar::Bool;
    for op in Op::ALL.iter().filter(|op| !part(op)) {
        for broken in breaks(*op) {
            let caught = PRECISIONS
                .iter()
                .any(|p| Law::new(*op, *p, Form::Boxes, Mode::Real(*p), broken).fails(5_000, 2).is_some());
            if !caught {
                survivors.push(format!("{op} {broken:?}"));
            }
        }
    }
    assert_eq!(survivors, [""; 0]);
}

#[test]
fn every_builder_makes_the_same_enclosure() {
    for op in Op::ALL {
        // Constants are computed in f64, where these two tell more exponents apart.
        let by_bits = matches!(op, Op::Exponent | Op::Scale);
        for p in PRECISIONS {
            let law = Law::new(*op, p, Form::Boxes, Mode::Real(p), Break::None);
            let raw = Law::new(*op, p, Form::Boxes, Mode::Raw, Break::None);
            let mut r = Random(3);
            for _ in 0..300 {
                let operands = law.operands(&mut r);
                let mut inputs = Vec::new();
                operands.iter().for_each(|x| x.inputs(&mut inputs));
                let want = Evaluator::new(&law.graph, p).run(&inputs).unwrap();
                let same = |got: &[Value]| got.iter().zip(&want).all(|(x, y)| x == y || x.same_bits(*y));
                let got = Evaluator::new(&raw.graph, p).run(&inputs).unwrap();
                assert!(same(&got), "{op} of {operands:?}: {want:?}, raw {got:?}");
                for mode in [Mode::Real(p), Mode::Exact(p)] {
                    let got = of_constants(*op, &operands, mode);
                    let kernel = matches!(op.def().accuracy, Accuracy::Ulp { .. });
                    assert!(same(&got) || by_bits || kernel, "{op} of {operands:?}: {want:?}, {mode:?} {got:?}");
                }
            }
        }
    }
}
