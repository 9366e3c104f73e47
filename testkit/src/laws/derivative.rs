//! The law of one operation's derivative: what a definition says = dual numbers = differences of its values; at kinks,
//! what LANGUAGE 13.6 says, within the hull of the one-sided differences.
//!
//! The definition is an argument, so that an altered one can be judged. Its rules are built into a raw graph here and
//! run by the reference evaluator: neither `differentiate` nor the rest of the pipeline takes part.

use isograd_graph::ops::{Derivative, Kink, Partial, discriminant};
use isograd_graph::{Builder, Evaluator, Graph, Mode, NodeId, Op, OpDef, Precision, Scalar, Unwatched, Value};

use super::{Count, Failure, Judgement, real, show};
use crate::differences::{Side, central, one_sided};
use crate::dual::{Seeds, run};
use crate::points::{Random, grid, in_domain};

const LAW: &str = "derivative";

/// Judges the rules in `def`, a definition of `op`, at `points` points of its domain and at its kinks.
///
/// # Errors
/// At the first point where two of them disagree, or if too many could not be judged.
pub fn derivative(op: Op, def: &OpDef, points: usize, seed: u64) -> Judgement {
    if matches!(&def.derivative, Derivative::Zero) && def.result != Scalar::Real {
        return Ok(Count::default());
    }
    if let Some((k, _)) = def.operands.iter().enumerate().find(|(k, s)| **s != Scalar::Real && !is_zero(def, *k)) {
        return Err(Failure::new(LAW, op, format!("operand {k} is no real, but has a partial derivative")));
    }
    let (rules, plain) = (rules(op, def), plain(op));
    let kinks = kink_points(op, seed);
    if kinks.is_empty() && matches!(def.kink, Kink::Where { .. }) {
        return Err(Failure::new(LAW, op, "no point was found in its kink"));
    }
    let mut law = Law { op, def, plain, rules: Evaluator::new(&rules, Precision::F64), count: Count::default(), seed };
    for point in in_domain(def, points, seed) {
        law.dual(&point)?;
        law.difference(&point)?;
    }
    let smooth = law.count.at_least(80, LAW, op)?;
    for point in kinks {
        law.dual(&point)?;
        law.hull(&point)?;
    }
    Ok(Count { judged: law.count.judged, unjudged: smooth.unjudged })
}

/// Points in the kink of an operation: of some candidates per operand, those where the discriminant is 0.
#[must_use]
pub fn kink_points(op: Op, seed: u64) -> Vec<Vec<Value>> {
    let def = op.def();
    if matches!(def.kink, Kink::None) {
        return Vec::new();
    }
    let mut rows = special_points(def, seed);
    rows.retain(|row| {
        let reals: Vec<f64> = row.iter().map(|v| real(*v)).collect();
        // The convention of the term with ln 0 holds for exponents too at which `pow` is differentiable.
        let limit = op == Op::Pow && matches!(reals[..], [a, b] if a == 0.0 && b >= 1.0);
        // Multiples of what is so small lie closer together than differences can be taken.
        let dense = op == Op::Mod && matches!(reals[..], [_, b] if b.abs() < 1e-6);
        limit || (discriminant(op, &reals) == 0.0 && !dense)
    });
    rows
}

/// All rows of some candidates per operand, among which there are some of each kink.
pub(super) fn special_points(def: &OpDef, seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random::new(seed);
    let (r, s) = (random.within((0.1, 3.0)), random.within((0.1, 3.0)));
    let reals = [0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -3.0, 7.5, r, -r, s, 1e-200];
    let reals: Vec<Value> = reals.iter().map(|x| Value::Real(*x)).collect();
    let candidates: Vec<Vec<Value>> = def
        .operands
        .iter()
        .map(|scalar| match scalar {
            Scalar::Real => reals.clone(),
            Scalar::Int => vec![Value::Int(0), Value::Int(2)],
            Scalar::Bool => vec![Value::Bool(false), Value::Bool(true)],
        })
        .collect();
    grid(&candidates, 30_000)
}

/// Whether a definition says that the result does not depend on operand `k`.
fn is_zero(def: &OpDef, k: usize) -> bool {
    match &def.derivative {
        Derivative::Zero => true,
        Derivative::Partials(partials) => matches!(partials.get(k), None | Some(Partial::Zero)),
        Derivative::Choice { then, otherwise, .. } => k != *then && k != *otherwise,
    }
}

/// A raw graph of the operation alone.
fn plain(op: Op) -> Graph {
    let mut b = Builder::new(Mode::Raw, 100, &Unwatched);
    let (_, result) = applied(&mut b, op);
    b.output("value", result);
    b.finish().expect("small")
}

fn applied(b: &mut Builder<'_>, op: Op) -> (Vec<NodeId>, NodeId) {
    let args: Vec<NodeId> = op.def().operands.iter().enumerate().map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
    let result = b.op(op, &args);
    (args, result)
}

/// A raw graph whose outputs are the partial derivatives that a definition says.
pub(super) fn rules(op: Op, def: &OpDef) -> Graph {
    let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
    let (args, result) = applied(&mut b, op);
    let (zero, one, minus) = (b.real(0.0), b.real(1.0), b.real(-1.0));
    for k in 0..args.len() {
        let partial = match &def.derivative {
            Derivative::Zero => zero,
            Derivative::Partials(partials) => match partials.get(k) {
                None | Some(Partial::Zero) => zero,
                Some(Partial::One) => one,
                Some(Partial::MinusOne) => minus,
                Some(Partial::Of(rule)) => rule(&mut b, &args, result),
            },
            Derivative::Choice { cond, then, otherwise } => {
                let cond = cond(&mut b, &args);
                let side = |operand: usize| if operand == k { one } else { zero };
                b.select(cond, side(*then), side(*otherwise))
            }
        };
        b.output(format!("d{k}"), partial);
    }
    b.finish().expect("small")
}

struct Law<'a> {
    op: Op,
    def: &'a OpDef,
    plain: Graph,
    rules: Evaluator<'a>,
    count: Count,
    seed: u64,
}

impl Law<'_> {
    fn failure(&self, point: &[Value], k: usize, what: impl std::fmt::Display) -> Failure {
        Failure::new(LAW, self.op, format!("at {}, by operand {k}: {what}", show(point)))
    }

    /// What the rules give.
    fn said(&mut self, point: &[Value]) -> Vec<f64> {
        self.rules.run(point).unwrap_or_default().into_iter().map(real).collect()
    }

    fn real_operands(&self) -> impl Iterator<Item = usize> + use<> {
        let operands = self.def.operands;
        (0..operands.len()).filter(|k| operands[*k] == Scalar::Real)
    }

    /// The rules agree with dual numbers, in kinks too.
    fn dual(&mut self, point: &[Value]) -> Result<(), Failure> {
        let said = self.said(point);
        for k in self.real_operands() {
            let node = u32::try_from(k).map_or(NodeId::NONE, NodeId);
            let seeds = Seeds { a: Some(node), b: None };
            let by = |shake| run(&self.plain, point, seeds, shake).map(|o| o.outputs[0].jet().a.unwrap_or(0.0));
            let Some(want) = by(None) else { continue };
            let shaken: Vec<f64> = (0..4).filter_map(|i| by(Some(self.seed ^ i))).collect();
            let spread = shaken.iter().fold(0.0_f64, |most, x| most.max((x - want).abs()));
            let tolerance = 2.0 * spread + 8.0 * f64::EPSILON * want.abs();
            // At poles both must say the same of infinity; NaN is said of NaN.
            let same = said[k] == want || (said[k].is_nan() && want.is_nan()) || (said[k] - want).abs() <= tolerance;
            if !same {
                let what = format!("the rule says {:?}, dual numbers {want:?} ± {tolerance:.1e}", said[k]);
                return Err(self.failure(point, k, what));
            }
            self.count.judged += 1;
        }
        Ok(())
    }

    /// The operation as a function of operand `k` alone.
    fn line<'p>(&self, point: &'p [Value], k: usize) -> impl Fn(f64) -> f64 + use<'p> {
        let eval = self.def.eval.f64;
        move |x| {
            let mut row = point.to_vec();
            row[k] = Value::Real(x);
            real(eval(&row))
        }
    }

    /// How much nearer the kink comes for a step of an operand, at least 1: of `mod` it is as fast as a/b is large.
    fn approach(&self, reals: &[f64], k: usize) -> f64 {
        let mut moved = reals.to_vec();
        let step = 1e-7 * (1.0 + reals[k].abs());
        moved[k] += step;
        let slope = (discriminant(self.op, &moved) - discriminant(self.op, reals)) / step;
        if slope.is_finite() { slope.abs().max(1.0) } else { 1.0 }
    }

    /// Away from kinks the rules agree with differences.
    fn difference(&mut self, point: &[Value]) -> Result<(), Failure> {
        let reals: Vec<f64> = point.iter().map(|v| real(*v)).collect();
        let distance = discriminant(self.op, &reals).abs();
        let said = self.said(point);
        for k in self.real_operands() {
            let x = reals[k];
            // Far enough inside the domain that poles at its ends do not come near.
            let step = (x.abs() / 4.0).clamp(1e-4, 0.125).min(distance / (2.0 * self.approach(&reals, k)));
            let estimate =
                if step > 1e-7 { central(self.line(point, k), x, step) } else { central(|_| f64::NAN, x, 1.0) };
            let tolerance = 4.0 * estimate.error + 1e-12 * said[k].abs();
            if !estimate.is_finite() || estimate.error > 1e-5 * (1.0 + estimate.value.abs()) {
                self.count.unjudged += 1;
            } else if (said[k] - estimate.value).abs() <= tolerance {
                self.count.judged += 1;
            } else {
                let (value, said) = (estimate.value, said[k]);
                let what = format!("the rule says {said:?}, differences {value:?} ± {tolerance:.1e}");
                return Err(self.failure(point, k, what));
            }
        }
        Ok(())
    }

    /// In a kink the rule lies between the one-sided differences, where both are finite.
    fn hull(&mut self, point: &[Value]) -> Result<(), Failure> {
        let said = self.said(point);
        for k in self.real_operands() {
            let sides = [Side::Below, Side::Above].map(|s| one_sided(self.line(point, k), real(point[k]), 1e-3, s));
            if sides.iter().any(|e| !e.is_finite() || e.error > 1e-6 * (1.0 + e.value.abs())) {
                continue;
            }
            let (lo, hi) = (sides[0].value.min(sides[1].value), sides[0].value.max(sides[1].value));
            let tolerance = 4.0 * (sides[0].error + sides[1].error) + 1e-12 * said[k].abs();
            if said[k] < lo - tolerance || said[k] > hi + tolerance || said[k].is_nan() {
                let what = format!("in a kink, the rule says {:?}, differences {lo:?} to {hi:?}", said[k]);
                return Err(self.failure(point, k, what));
            }
            self.count.judged += 1;
        }
        Ok(())
    }
}
