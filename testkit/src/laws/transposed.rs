//! The law that the reverse sweep is the transpose of the forward one: ⟨v, J·u⟩ = ⟨Jᵀ·v, u⟩ for all u and v. Knows the
//! steps that expand derivatives; knows no rule of any operation, and no oracle of derivatives.

use isograd_graph::{Builder, Evaluator, Graph, Mode, NodeId, Precision, Scalar, Unwatched, Value};
use isograd_transform::{Sweep, Wanted, derive, differentiate};

use super::{Count, Failure, Judgement, real, show, verifier_accepts};
use crate::dual::{Seeds, run};
use crate::points::Random;
use crate::random::{self, Shape};

const LAW: &str = "transposed";

const MANY: usize = 1_000_000;

/// Shaken runs per point.
const RUNS: u64 = 3;

/// A product is not judged if its tolerance is above this, relative to it or to 1.
const VACUOUS: f64 = 1e-6;

/// For a random graph with real outputs y and real inputs x, and random vectors u and v: the Jacobian of y by x in
/// forward sweeps, times u from the right and v from the left, is the gradient of ⟨v, y⟩ in a reverse sweep times u.
/// Both keep the conventions in kinks, so kinks are judged too; not judged are points where a number is not finite, or
/// where rounding on the way decides.
///
/// # Errors
/// At the first point where they differ, or if a step fails.
pub fn transposed(seed: u64, shape: &Shape, points: &[Vec<Value>]) -> Judgement {
    let mut random = Random::new(seed);
    let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
    random::grow(&mut b, seed, shape);
    let is_real = |b: &Builder<'_>, node: NodeId| b.graph().scalar(node) == Scalar::Real;
    let outputs: Vec<NodeId> = b.graph().outputs.iter().map(|o| o.node).filter(|node| is_real(&b, *node)).collect();
    let v: Vec<f64> = outputs.iter().map(|_| random.within((-2.0, 2.0))).collect();
    let mut sum = b.real(0.0);
    for (output, v) in outputs.iter().zip(&v) {
        let v = b.real(*v);
        let term = b.mul(v, *output);
        sum = b.add(sum, term);
    }
    b.output("along", sum);
    let graph = b.finish().map_err(|e| Failure::new(LAW, seed, e))?;

    let inputs: Vec<usize> = (0..graph.inputs.len()).filter(|i| graph.inputs[*i].scalar == Scalar::Real).collect();
    let u: Vec<f64> = inputs.iter().map(|_| random.within((-2.0, 2.0))).collect();
    let rows: Vec<usize> =
        (0..graph.outputs.len() - 1).filter(|i| graph.scalar(graph.outputs[*i].node) == Scalar::Real).collect();
    let jacobian = expanded(&graph, &rows, &inputs, Sweep::Forward)?;
    let gradient = expanded(&graph, &[graph.outputs.len() - 1], &inputs, Sweep::Reverse)?;

    // ⟨v, J·u⟩ with the sizes of its terms, of the numbers of J, row by row.
    let product = |numbers: &[f64], v: &[f64]| {
        let terms = numbers.iter().enumerate().map(|(k, x)| x * v[k / u.len()] * u[k % u.len()]);
        terms.fold((0.0, 0.0), |(sum, size), term| (sum + term, size + term.abs()))
    };
    let (mut forward, mut reverse) =
        (Evaluator::new(&jacobian, Precision::F64), Evaluator::new(&gradient, Precision::F64));
    let mut count = Count::default();
    for point in points {
        let numbers = |values: Option<Vec<Value>>| -> Vec<f64> { values.into_iter().flatten().map(real).collect() };
        let (want, size) = product(&numbers(forward.run(point)), &v);
        let (got, _) = product(&numbers(reverse.run(point)), &[1.0]);
        let Some(spread) = spread(&jacobian, point, |numbers| product(numbers, &v).0) else {
            count.unjudged += 1;
            continue;
        };
        let tolerance = 2.0 * spread + 64.0 * f64::EPSILON * size + 1e-290;
        if !want.is_finite() || !tolerance.is_finite() || tolerance > VACUOUS * want.abs().max(1.0) {
            count.unjudged += 1;
            continue;
        }
        count.judged += 1;
        // `!(≤)`: a NaN fails.
        let close = (got - want).abs() <= tolerance;
        if !close {
            let what = format!("at {}: ⟨v, J·u⟩ = {want:?} ± {tolerance:.1e}, ⟨Jᵀ·v, u⟩ = {got:?}", show(point));
            return Err(Failure::new(LAW, isograd_graph::print(&graph), what));
        }
    }
    Ok(count)
}

/// Some outputs by some inputs, row by row.
fn expanded(graph: &Graph, outputs: &[usize], inputs: &[usize], sweep: Sweep) -> Result<Graph, Failure> {
    let all = outputs.iter().flat_map(|output| inputs.iter().map(|input| (*output, *input)));
    let wanted: Vec<Wanted> =
        all.map(|(output, by)| Wanted { name: format!("d{output}/{by}"), output, by: vec![by] }).collect();
    let failure = |e: &dyn std::fmt::Display| Failure::new(LAW, isograd_graph::print(graph), format!("{sweep:?}: {e}"));
    let derived = derive(graph, &wanted, MANY, &Unwatched).map_err(|e| failure(&e))?;
    let expanded = differentiate(derived, sweep, Precision::F64, 6, MANY, &Unwatched).map_err(|e| failure(&e))?;
    Ok(verifier_accepts("differentiate", expanded)?.into_inner())
}

/// How far shaking moves a function of a graph's outputs; `None` if it changes a decision.
fn spread(graph: &Graph, point: &[Value], of: impl Fn(&[f64]) -> f64) -> Option<f64> {
    let numbers =
        |outcome: &crate::dual::Outcome| -> Vec<f64> { outcome.outputs.iter().map(|cell| cell.jet().value).collect() };
    let clean = run(graph, point, Seeds::default(), None)?;
    let mut most = 0.0_f64;
    for seed in 1..=RUNS {
        let shaken = run(graph, point, Seeds::default(), Some(seed))?;
        if shaken.decisions != clean.decisions {
            return None;
        }
        let moved = (of(&numbers(&shaken)) - of(&numbers(&clean))).abs();
        most = if moved.is_nan() { f64::INFINITY } else { most.max(moved) };
    }
    Some(most)
}
