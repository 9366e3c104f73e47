//! Laws of differentiation as a whole: `derive` and `differentiate` on a program's graph give what dual numbers give.

use isograd_graph::{Builder, Evaluator, Graph, Mode, Node, NodeId, Op, Precision, Scalar, Unwatched, Value};
use isograd_transform::{Sweep, Wanted, derive, differentiate};

use super::{Count, Failure, Judgement, kink_points, real, show, verifier_accepts};
use crate::differences::central;
use crate::dual::{Jet, Outcome, Seeds, run};
use crate::points::Random;
use crate::random::{self, Grown, Shape};

const MANY: usize = 4_000_000;

/// Shaken runs per point.
const RUNS: u64 = 4;

/// A derivative is not judged if its tolerance is above this, relative to it or to 1.
const VACUOUS: f64 = 1e-6;

/// One scalar asked for: an output differentiated by one input, or by two.
#[derive(Debug, Clone, Copy)]
struct Asked {
    output: usize,
    by: [usize; 2],
    second: bool,
}

impl Asked {
    /// All first and second derivatives by the real inputs: of the real outputs, or for the reverse sweep, which is
    /// made where values are fewer than what they are differentiated by, of fewer outputs than inputs.
    fn all(graph: &Graph, sweep: Sweep) -> Vec<Self> {
        let inputs: Vec<usize> = (0..graph.inputs.len()).filter(|i| graph.inputs[*i].scalar == Scalar::Real).collect();
        let most = match sweep {
            Sweep::Forward => usize::MAX,
            Sweep::Reverse => inputs.len().saturating_sub(1),
        };
        let is_real = |i: &usize| graph.scalar(graph.outputs[*i].node) == Scalar::Real;
        let outputs: Vec<usize> = (0..graph.outputs.len()).filter(is_real).take(most).collect();
        let mut all = Vec::new();
        for output in outputs {
            for (n, i) in inputs.iter().enumerate() {
                all.push(Self { output, by: [*i, *i], second: false });
                all.extend(inputs[n..].iter().map(|j| Self { output, by: [*i, *j], second: true }));
            }
        }
        all
    }

    fn wanted(&self) -> Wanted {
        let [i, j] = self.by;
        let by = if self.second { vec![i, j] } else { vec![i] };
        Wanted { name: format!("d{}/{by:?}", self.output), output: self.output, by }
    }

    /// The wanted part of a run by the seeds `by`; structurally 0 is 0.
    fn of(&self, outcome: &Outcome) -> f64 {
        let Jet { a, ab, .. } = outcome.outputs[self.output].jet();
        if self.second { ab } else { a }.unwrap_or(0.0)
    }

    fn seeds(&self) -> Seeds {
        let node = |i: usize| u32::try_from(i).ok().map(NodeId);
        Seeds { a: node(self.by[0]), b: node(self.by[1]) }
    }
}

/// First and second derivatives of all real outputs of a raw graph by all its real inputs, expanded: what the laws of
/// equal bits are asked about too.
///
/// # Errors
/// If a step fails.
pub fn expanded_derivatives(graph: &Graph, sweep: Sweep) -> Result<Graph, Failure> {
    expanded(graph, &Asked::all(graph, sweep), sweep)
}

/// Expands the derivatives of a raw graph, verifying each step.
fn expanded(graph: &Graph, asked: &[Asked], sweep: Sweep) -> Result<Graph, Failure> {
    let wanted: Vec<Wanted> = asked.iter().map(Asked::wanted).collect();
    let text = || isograd_graph::print(graph);
    let derived = derive(graph, &wanted, MANY, &Unwatched).map_err(|e| Failure::new("derive", text(), e))?;
    let derived = verifier_accepts("derive", derived)?.into_inner();
    let graph = differentiate(derived, sweep, isograd_graph::Precision::F32, 6, MANY, &Unwatched);
    let graph = graph.map_err(|e| Failure::new("differentiate", text(), format!("{sweep:?}: {e}")))?;
    Ok(verifier_accepts("differentiate", graph)?.into_inner())
}

/// First and second derivatives of all real outputs of a raw graph by all its real inputs, as the pipeline makes them
/// in a forward or in a reverse sweep, are those of dual numbers. Points are judged where no active operand comes near a kink, no decision changes under
/// shaking, and the tolerance means something.
///
/// # Errors
/// At the first derivative that differs, or if a step fails.
pub fn pipeline_derivative(graph: &Graph, points: &[Vec<Value>], sweep: Sweep) -> Judgement {
    compare(graph, points, false, sweep)
}

/// As [`pipeline_derivative`] for one operation alone, in its kinks (LANGUAGE 13.6). Second derivatives of `pow` at 0
/// are left out: which of the two mixed ones a convention reaches is not said.
///
/// # Errors
/// At the first derivative that differs, or if a step fails.
pub fn at_kinks(op: Op, seed: u64, sweep: Sweep) -> Judgement {
    let mut b = Builder::new(Mode::Raw, 100, &Unwatched);
    let args: Vec<NodeId> = op.def().operands.iter().enumerate().map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
    let result = b.op(op, &args);
    b.output("y", result);
    let graph = b.finish().map_err(|e| Failure::new("at_kinks", op, e))?;
    if op.def().result != Scalar::Real {
        return Ok(Count::default());
    }
    let points = kink_points(op, seed);
    let points: Vec<_> = points.iter().step_by(1 + points.len() / 60).cloned().collect();
    compare(&graph, &points, true, sweep)
}

/// First derivatives of a random graph's real outputs by values on the way to them, as `diff` in a program asks for
/// them (LANGUAGE 13.2, 13.3), are those of dual numbers seeded there.
///
/// # Errors
/// At the first derivative that differs, or if a step fails.
pub fn derivative_by_values(seed: u64, shape: &Shape, points: &[Vec<Value>], sweep: Sweep) -> Judgement {
    const LAW: &str = "derivative_by_values";
    let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
    let Grown { reals, .. } = random::grow(&mut b, seed, shape);
    let graph = b.graph().clone();
    let is_literal = |id: &NodeId| matches!(graph[*id], Node::Real(_));
    let values: Vec<NodeId> = reals.into_iter().filter(|id| !is_literal(id)).collect();
    let mut random = Random::new(seed);
    let mut asked: Vec<(usize, NodeId)> = Vec::new();
    for (k, output) in graph.outputs.iter().enumerate().filter(|(_, o)| graph.scalar(o.node) == Scalar::Real) {
        asked.extend((0..4).map(|_| (k, random.pick(&values))));
        asked.push((k, output.node));
    }
    for (i, (k, value)) in asked.iter().enumerate() {
        let diff = b.diff(graph.outputs[*k].node, *value);
        b.output(format!("d{i}"), diff);
    }
    let full = b.finish().map_err(|e| Failure::new(LAW, isograd_graph::print(&graph), e))?;
    let text = isograd_graph::print(&full);
    let full = differentiate(full, sweep, isograd_graph::Precision::F32, 6, MANY, &Unwatched)
        .map_err(|e| Failure::new(LAW, &text, e))?;
    let full = verifier_accepts("differentiate", full)?.into_inner();
    let mut evaluator = Evaluator::new(&full, Precision::F64);
    let mut count = Count::default();
    for point in points {
        let got = evaluator.run(point).unwrap_or_default();
        let derivatives = got.get(graph.outputs.len()..).unwrap_or_default();
        for ((k, value), got) in asked.iter().zip(derivatives) {
            let ask = Asked { output: *k, by: [0, 0], second: false };
            let judged = Judged::of(&graph, point, Seeds { a: Some(*value), b: None }, false);
            match judged.and_then(|judged| judged.wanted(&ask)) {
                None => count.unjudged += 1,
                Some((want, tolerance)) if (real(*got) - want).abs() <= tolerance => count.judged += 1,
                Some((want, tolerance)) => {
                    let what = format!(
                        "{sweep:?}, output {k} by %{} at {}: the pipeline gives {:?}, dual numbers {want:?} ± {tolerance:.1e}",
                        value.0,
                        show(point),
                        real(*got)
                    );
                    return Err(Failure::new(LAW, text, what));
                }
            }
        }
    }
    Ok(count)
}

fn compare(graph: &Graph, points: &[Vec<Value>], in_kinks: bool, sweep: Sweep) -> Judgement {
    const LAW: &str = "pipeline_derivative";
    let asked = Asked::all(graph, sweep);
    let derived = expanded(graph, &asked, sweep)?;
    let mut evaluator = Evaluator::new(&derived, Precision::F64);
    let is_power = graph.iter().any(|(_, n)| matches!(n, Node::Apply(Op::Pow, _)));
    let mut count = Count::default();
    for point in points {
        let Some(got) = evaluator.run(point) else {
            count.unjudged += asked.len();
            continue;
        };
        let mut runs: Vec<([usize; 2], Option<Judged>)> = Vec::new();
        for (ask, got) in asked.iter().zip(got) {
            if !runs.iter().any(|(by, _)| *by == ask.by) {
                runs.push((ask.by, Judged::of(graph, point, ask.seeds(), in_kinks)));
            }
            let judged = runs.iter().find(|(by, _)| *by == ask.by).and_then(|(_, judged)| judged.as_ref());
            let open = in_kinks && is_power && ask.second;
            let Some((want, tolerance)) = judged.filter(|_| !open).and_then(|judged| judged.wanted(ask)) else {
                count.unjudged += 1;
                continue;
            };
            let got = real(got);
            count.judged += 1;
            // `!(≤)`: a NaN fails.
            let close = (got - want).abs() <= tolerance;
            if !close {
                let what = format!(
                    "{sweep:?}, {} at {}: the pipeline gives {got:?}, dual numbers {want:?} ± {tolerance:.1e}",
                    ask.wanted().name,
                    show(point)
                );
                return Err(Failure::new(LAW, isograd_graph::print(graph), what));
            }
        }
    }
    Ok(count)
}

/// A point that can be judged: a run, and shaken ones that took the same way.
struct Judged {
    clean: Outcome,
    shaken: Vec<Outcome>,
}

impl Judged {
    fn of(graph: &Graph, point: &[Value], seeds: Seeds, in_kinks: bool) -> Option<Self> {
        let clean = run(graph, point, seeds, None)?;
        if clean.doubtful && !in_kinks {
            return None;
        }
        let mut shaken = Vec::new();
        for seed in 0..RUNS {
            let outcome = run(graph, point, seeds, Some(seed + 1))?;
            if outcome.decisions != clean.decisions || (outcome.doubtful && !in_kinks) {
                return None;
            }
            shaken.push(outcome);
        }
        Some(Self { clean, shaken })
    }

    /// What is asked for and its tolerance; `None` if that means nothing.
    fn wanted(&self, ask: &Asked) -> Option<(f64, f64)> {
        let want = ask.of(&self.clean);
        let spread = self.shaken.iter().fold(0.0_f64, |most, run| most.max((ask.of(run) - want).abs()));
        let tolerance = 2.0 * spread + 64.0 * f64::EPSILON * want.abs() + 1e-290;
        (want.is_finite() && tolerance <= VACUOUS * want.abs().max(1.0)).then_some((want, tolerance))
    }
}

/// The two oracles that know no rules of each other agree: first derivatives by dual numbers are differences of the
/// values that the dual oracle computes.
///
/// # Errors
/// At the first derivative that differs.
pub fn oracles_agree(graph: &Graph, points: &[Vec<Value>]) -> Judgement {
    let mut count = Count::default();
    for point in points {
        for ask in Asked::all(graph, Sweep::Forward).iter().filter(|ask| !ask.second) {
            let Some(judged) = Judged::of(graph, point, ask.seeds(), false) else {
                count.unjudged += 1;
                continue;
            };
            let line = |x: f64| {
                let mut row = point.clone();
                row[ask.by[0]] = Value::Real(x);
                match run(graph, &row, Seeds::default(), None) {
                    Some(there) if there.decisions == judged.clean.decisions => there.outputs[ask.output].jet().value,
                    _ => f64::NAN,
                }
            };
            let estimate = central(line, real(point[ask.by[0]]), 1e-2);
            let want = ask.of(&judged.clean);
            if !estimate.is_finite() || estimate.error > 1e-6 * (1.0 + want.abs()) {
                count.unjudged += 1;
                continue;
            }
            count.judged += 1;
            // What rounding on the way does to a value, over the least step.
            let value = |o: &Outcome| o.outputs[ask.output].jet().value;
            let spread =
                judged.shaken.iter().fold(0.0_f64, |most, run| most.max((value(run) - value(&judged.clean)).abs()));
            let tolerance = 8.0 * estimate.error + 1e-10 * want.abs() + spread * 1e4;
            if (estimate.value - want).abs() > tolerance {
                let what = format!(
                    "{} at {}: differences {:?} ± {tolerance:.1e}, dual numbers {want:?}",
                    ask.wanted().name,
                    show(point),
                    estimate.value
                );
                return Err(Failure::new("oracles_agree", isograd_graph::print(graph), what));
            }
        }
    }
    Ok(count)
}
