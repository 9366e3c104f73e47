//! The law of an operation's kink: what the table says of it agrees with the operation's values. Derivatives of the
//! table are judged only where it says in words what they are on which side.

use isograd_graph::ops::{Accuracy, Kink};
use isograd_graph::{Builder, Evaluator, Mode, Op, OpDef, Precision, Scalar, Unwatched, Value};

use super::derivative::{rules, special_points};
use super::{Count, Failure, Judgement, real, show};
use crate::points::{Random, in_domain};

const LAW: &str = "kink";

/// How far beside a point slopes are compared.
const STEP: f64 = 1e-6;

/// Judges the kink in `def`, a definition of `op`, at special points and along `lines` lines through its domain:
/// * Where the discriminant is 0, in f32 and in f64, the operation has a kink: along some operand, or two together, its
///   value jumps, its slopes on the two sides differ, or there is no value on one side.
/// * Where it jumps or its slope does, as found from values alone, the discriminant is 0 or changes its sign.
/// * The slopes that are said in words are those of the rules.
///
/// # Errors
/// At the first point where one of these does not hold.
pub fn kink(op: Op, def: &OpDef, lines: usize, seed: u64) -> Judgement {
    let mut law = Law { op, def, lines, seed, count: Count::default() };
    let Kink::Where { discriminant, .. } = def.kink else {
        // Which way is rounded counts as identity (LANGUAGE 13.5); bits are counted inside of kernels only.
        if def.accuracy != Accuracy::Directed && op != Op::Exponent {
            law.found(None)?;
        }
        return Ok(law.count);
    };
    let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
    let args: Vec<_> = def.operands.iter().enumerate().map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
    let off = discriminant(&mut b, &args);
    b.output("off", off);
    let graph = b.finish().map_err(|e| Failure::new(LAW, op, e))?;
    for precision in [Precision::F32, Precision::F64] {
        law.real(&mut Evaluator::new(&graph, precision), precision)?;
    }
    let mut off = Evaluator::new(&graph, Precision::F64);
    law.found(Some(&mut off))?;
    law.slopes(&mut off)?;
    Ok(law.count)
}

struct Law<'a> {
    op: Op,
    def: &'a OpDef,
    lines: usize,
    seed: u64,
    count: Count,
}

fn first(off: &mut Evaluator<'_>, point: &[Value]) -> f64 {
    off.run(point).map_or(f64::NAN, |all| real(all[0]))
}

/// A value of any kind as a number, so that changes show.
fn number(value: Value) -> f64 {
    match value {
        Value::Real(x) => x,
        Value::Int(x) => f64::from(x),
        Value::Bool(x) => f64::from(u8::from(x)),
    }
}

impl Law<'_> {
    fn failure(&self, point: &[Value], what: impl std::fmt::Display) -> Failure {
        Failure::new(LAW, self.op, format!("at {}: {what}", show(point)))
    }

    fn real_operands(&self) -> impl Iterator<Item = usize> + use<> {
        let operands = self.def.operands;
        (0..operands.len()).filter(|k| operands[*k] == Scalar::Real)
    }

    /// The operation as a function of operand `k` alone, in f64.
    fn line<'p>(&self, point: &'p [Value], k: usize) -> impl Fn(f64) -> f64 + use<'p> {
        let eval = self.def.eval.f64;
        move |x| {
            let mut row = point.to_vec();
            row[k] = Value::Real(x);
            number(eval(&row))
        }
    }

    /// Where the discriminant is 0 there is a kink.
    fn real(&mut self, off: &mut Evaluator<'_>, precision: Precision) -> Result<(), Failure> {
        let mut seen = 0;
        for mut point in special_points(self.def, self.seed) {
            for x in &mut point {
                if let Value::Real(x) = x {
                    *x = precision.round(*x);
                }
            }
            // Multiples of what is so small lie closer together than slopes can be compared.
            let dense = self.op == Op::Mod && point.get(1).is_some_and(|b| real(*b).abs() < STEP);
            if first(off, &point) != 0.0 || dense {
                continue;
            }
            seen += 1;
            if !self.real_operands().any(|k| self.is_rough(&point, &[k])) && !self.is_rough(&point, &[0, 1]) {
                return Err(self.failure(&point, "the discriminant is 0, but the operation is smooth there"));
            }
        }
        self.count.judged += seen;
        if seen == 0 {
            return Err(Failure::new(LAW, self.op, "no point was found in its kink"));
        }
        Ok(())
    }

    /// Whether the operation jumps or bends where these operands move together.
    fn is_rough(&self, point: &[Value], moving: &[usize]) -> bool {
        let f = |by: f64| {
            let mut row = point.to_vec();
            for (k, x) in row.iter_mut().enumerate() {
                if let (true, Value::Real(x)) = (moving.contains(&k), x) {
                    *x += by;
                }
            }
            number((self.def.eval.f64)(&row))
        };
        let (up, down) = (f(STEP) - f(0.0), f(0.0) - f(-STEP));
        let bend = (up - down) / STEP;
        !bend.is_finite() || bend.abs() > 1e-3 || up.abs() > 1e-3 || down.abs() > 1e-3
    }

    /// Kinks along lines are where the discriminant says; nowhere if there is none.
    fn found(&mut self, mut off: Option<&mut Evaluator<'_>>) -> Result<(), Failure> {
        let mut random = Random::new(self.seed);
        for point in in_domain(self.def, self.lines, self.seed) {
            for k in self.real_operands() {
                let (lo, hi) = self.def.domain[k];
                // Not symmetric about anything.
                let lo = random.within((lo, lo + (hi - lo) / 3.0));
                let Some(ends) = rough(self.line(&point, k), lo, hi) else { continue };
                let mut there = point.clone();
                let mut at = |x: f64| {
                    there[k] = Value::Real(x);
                    off.as_mut().map_or(f64::INFINITY, |off| first(off, &there))
                };
                let offs = ends.map(&mut at);
                let crosses = offs[0].signum() != offs[2].signum();
                let least = offs.iter().fold(f64::INFINITY, |least, x| least.min(x.abs()));
                if least > 1e-2 || !(crosses || least < 1e-5) {
                    there[k] = Value::Real(ends[1]);
                    let what = format!("the operation has a kink there, where the discriminant is {offs:?}");
                    return Err(self.failure(&there, what));
                }
                self.count.judged += 1;
            }
        }
        Ok(())
    }

    /// What is said of the sides in words.
    fn slopes(&mut self, off: &mut Evaluator<'_>) -> Result<(), Failure> {
        let Kink::Where { slopes, .. } = self.def.kink else { return Ok(()) };
        if self.def.result != Scalar::Real {
            return Ok(());
        }
        let rules = rules(self.op, self.def);
        let mut rules = Evaluator::new(&rules, Precision::F64);
        let mut points = in_domain(self.def, self.lines, self.seed);
        points.extend(special_points(self.def, self.seed));
        for point in points {
            let off = first(off, &point);
            let Some(side) = [off < 0.0, off == 0.0, off > 0.0].iter().position(|is| *is) else { continue };
            let wanted: Option<&[f64]> = match slopes[side] {
                "0" => Some(&[0.0; 4]),
                "a′" => Some(&[1.0, 0.0]),
                "−a′" => Some(&[-1.0]),
                "b′" => Some(&[0.0, 1.0]),
                _ => None,
            };
            let Some(wanted) = wanted else { continue };
            let given: Vec<f64> = rules.run(&point).unwrap_or_default().into_iter().map(real).collect();
            if given.iter().zip(wanted).any(|(given, wanted)| given != wanted) {
                let said = slopes[side];
                let what = format!("where the discriminant is {off:?}, `{said}` is said, but the rules give {given:?}");
                return Err(self.failure(&point, what));
            }
            self.count.judged += 1;
        }
        Ok(())
    }
}

/// Three neighbouring points between `lo` and `hi` among which a function jumps or bends, if it does anywhere: there the
/// second difference shrinks no faster than the distance of the points. Of a smooth function it shrinks with its square.
fn rough(f: impl Fn(f64) -> f64, lo: f64, hi: f64) -> Option<[f64; 3]> {
    const CELLS: u32 = 32;
    let mut ends = [lo, lo, hi];
    let mut bends = Vec::new();
    while (ends[2] - ends[0]) / f64::from(CELLS) > STEP {
        let (from, step) = (ends[0], (ends[2] - ends[0]) / f64::from(CELLS));
        let at = |i: u32| from + f64::from(i) * step;
        let bend = |i: u32| ((f(at(i + 1)) - f(at(i))) / step - (f(at(i)) - f(at(i - 1))) / step).abs();
        let i = (1..CELLS).max_by(|i, j| bend(*i).total_cmp(&bend(*j)))?;
        ends = [at(i - 1), at(i), at(i + 1)];
        bends.push((step, bend(i) / (1.0 + f(at(i)).abs())));
    }
    let [.., (long, before), (short, after)] = bends[..] else { return None };
    (after > 1e-3 && after > before * (short / long).sqrt()).then_some(ends)
}
