//! The law of third derivatives: `diff` nested three deep, each level in a sweep of its own, gives what the hyper-dual
//! numbers of an independent crate give. Knows the steps that expand derivatives; knows no rule of any operation.

use isograd_graph::{Evaluator, Graph, Precision, Scalar, Unwatched, Value};
use isograd_transform::{Sweep, Wanted, derive, differentiate};

use super::{Count, Failure, Judgement, real, show, verifier_accepts};
use crate::hyperdual::{self, Derivatives};
use crate::{dual, points::Random};

const LAW: &str = "higher_derivatives";

/// Graphs above this are left out.
const MANY: usize = 400_000;

/// Shaken runs per point.
const RUNS: u64 = 3;

/// A derivative is not judged if its tolerance is above this, relative to it or to 1.
const VACUOUS: f64 = 1e-6;

/// First, second and third derivatives of each real output of a raw graph by some of its real inputs p, as
/// `diff(diff(diff(s, p).x, p).y, p)` has them: x and y are two random components, and the sweeps are those of the
/// innermost to the outermost `diff`. A point is judged where no active operand comes near a kink, no decision changes
/// under shaking, and the tolerance means something; that is how far shaking moves both the oracle and the graph.
///
/// # Errors
/// At the first derivative that differs, or if a step fails.
pub fn higher_derivatives(
    graph: &Graph,
    by: &[usize],
    sweeps: [Sweep; 3],
    points: &[Vec<Value>],
    seed: u64,
) -> Judgement {
    let mut random = Random::new(seed);
    let mut count = Count::default();
    let outputs = graph.outputs.iter().enumerate().filter(|(_, o)| graph.scalar(o.node) == Scalar::Real);
    for (output, _) in outputs {
        let picked = [random.below(by.len()), random.below(by.len())];
        let nest = Nest { graph, output, by, picked };
        let (Some(mixed), Some(forward)) = (nest.expanded(sweeps)?, nest.expanded([Sweep::Forward; 3])?) else {
            count.unjudged += points.len() * by.len() * 3;
            continue;
        };
        let mut evaluator = Evaluator::new(&mixed, Precision::F64);
        for point in points {
            let Some(judged) = nest.judged(&forward, point) else {
                count.unjudged += by.len() * 3;
                continue;
            };
            let got = evaluator.run(point).unwrap_or_default();
            for (k, (want, tolerance)) in judged.into_iter().enumerate() {
                if !want.is_finite() || tolerance.is_nan() || tolerance > VACUOUS * want.abs().max(1.0) {
                    count.unjudged += 1;
                    continue;
                }
                count.judged += 1;
                let got = got.get(k).copied().map_or(f64::NAN, real);
                // `!(≤)`: a NaN fails.
                let close = (got - want).abs() <= tolerance;
                if !close {
                    let what = format!(
                        "{sweeps:?}, output {output} by {:?} at {}: the pipeline gives {got:?}, hyper-dual numbers \
                         {want:?} ± {tolerance:.1e}",
                        nest.name(k),
                        show(point)
                    );
                    return Err(Failure::new(LAW, isograd_graph::print(graph), what));
                }
            }
        }
    }
    Ok(count)
}

/// An output with what it is differentiated by: all of `by`, then the component `picked[0]` of that by all, then the
/// component `picked[1]` of that.
struct Nest<'g> {
    graph: &'g Graph,
    output: usize,
    by: &'g [usize],
    picked: [usize; 2],
}

impl Nest<'_> {
    /// The inputs that the derivative number `k` is by.
    fn name(&self, k: usize) -> Vec<usize> {
        let n = self.by.len();
        let picked = self.picked.iter().take(k / n).copied();
        picked.chain([k % n]).map(|place| self.by[place]).collect()
    }

    /// A graph of the three gradients, expanded level by level; `None` if it grows out of bounds.
    fn expanded(&self, sweeps: [Sweep; 3]) -> Result<Option<Graph>, Failure> {
        let n = self.by.len();
        let mut graph = self.graph.clone();
        for (level, sweep) in sweeps.into_iter().enumerate() {
            // What the level before made stays; one of its last gradient's components is differentiated.
            let kept = (0..n * level).map(|output| (output, Vec::new()));
            let output = level.checked_sub(1).map_or(self.output, |before| n * before + self.picked[before]);
            let gradient = self.by.iter().map(|input| (output, vec![*input]));
            let all = kept.chain(gradient).enumerate();
            let wanted: Vec<Wanted> =
                all.map(|(k, (output, by))| Wanted { name: format!("d{k}"), output, by }).collect();
            let text = || isograd_graph::print(self.graph);
            let Ok(derived) = derive(&graph, &wanted, MANY, &Unwatched) else { return Ok(None) };
            let derived = verifier_accepts("derive", derived)?.into_inner();
            graph = match differentiate(derived, sweep, Precision::F64, 6, MANY, &Unwatched) {
                Ok(graph) => verifier_accepts("differentiate", graph)?.into_inner(),
                Err(isograd_transform::DifferentiateError::Exhausted(_)) => return Ok(None),
                Err(e) => return Err(Failure::new(LAW, text(), format!("{sweeps:?}, level {level}: {e}"))),
            };
        }
        Ok(Some(graph))
    }

    /// Each derivative with its tolerance; `None` if the point cannot be judged.
    fn judged(&self, forward: &Graph, point: &[Value]) -> Option<Vec<(f64, f64)>> {
        let mut want = self.oracle(point, None)?;
        let clean = dual::run(forward, point, dual::Seeds::default(), None)?;
        let mut spread = vec![0.0_f64; want.numbers.len()];
        for seed in 1..=RUNS {
            let shaken = self.oracle(point, Some(seed))?;
            let moved = dual::run(forward, point, dual::Seeds::default(), Some(seed))?;
            if shaken.decisions != want.decisions || moved.decisions != clean.decisions {
                return None;
            }
            let values =
                |outcome: &dual::Outcome| -> Vec<f64> { outcome.outputs.iter().map(|cell| cell.jet().value).collect() };
            let graph = values(&moved).into_iter().zip(values(&clean)).map(|(a, b)| (a - b).abs());
            let oracle = shaken.numbers.iter().zip(&want.numbers).map(|(a, b)| (a - b).abs());
            for (spread, (graph, oracle)) in spread.iter_mut().zip(graph.zip(oracle)) {
                *spread = spread.max(2.0 * (graph + oracle));
            }
        }
        let rounding = |x: f64| 64.0 * f64::EPSILON * x.abs() + 1e-290;
        Some(want.numbers.drain(..).zip(spread).map(|(x, spread)| (x, spread + rounding(x))).collect())
    }

    /// The three gradients by hyper-dual numbers.
    fn oracle(&self, point: &[Value], shake: Option<u64>) -> Option<Oracle> {
        let [x, y] = self.picked.map(|place| self.by[place]);
        let mut all: Vec<Derivatives> = Vec::new();
        let mut decisions = 0;
        for input in self.by {
            let outcome = hyperdual::run(self.graph, point, [x, y, *input], shake)?;
            if outcome.doubtful {
                return None;
            }
            decisions = outcome.decisions;
            all.push(outcome.outputs[self.output]?);
        }
        let first = all.iter().map(|d| d.first[2]);
        let numbers = first.chain(all.iter().map(|d| d.second[1])).chain(all.iter().map(|d| d.third)).collect();
        Some(Oracle { numbers, decisions })
    }
}

struct Oracle {
    numbers: Vec<f64>,
    decisions: u64,
}
