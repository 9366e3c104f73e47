//! The law of a graph's enclosure: over random boxes of its real inputs, what the `bound` transform makes of its outputs
//! and of their derivatives holds what is computed at points of the box (LANGUAGE 15.3 to 15.7). Knows regions and loops
//! only through the transforms that it judges; its oracle is the reference evaluator at single points.

use isograd_graph::ops::Family;
use isograd_graph::{Evaluator, Graph, Node, NodeId, Op, Precision, Scalar, Unwatched, Value, print};
use isograd_transform::{
    Asked, DifferentiateError, Form, Hull, Loops, Source, Sweep, answer, differentiate, enclosures, fold, kernels,
    optimise,
};

use super::enclosure::escapes;
use super::{Count, Failure, Judgement, show};
use crate::exact;
use crate::points::Random;
use crate::soundness::boxes::{Sampler, Side, least_normal};
use crate::soundness::tally::Tally;

const LAW: &str = "enclosed_graph";
const MANY: usize = 4_000_000;

/// How far out numbers are that a program must cope with (LANGUAGE A.4).
const FAR: f64 = 1e9;

/// What is asked of a graph: an output, or its derivative by an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct What {
    output: usize,
    by: Option<usize>,
}

/// A graph with the graph of its enclosures.
#[derive(Debug, Clone)]
pub struct Enclosed {
    /// For messages.
    name: String,
    precision: Precision,
    kinds: Vec<Scalar>,
    what: Vec<What>,
    /// At a point: what is asked for, as emitted.
    emitted: Graph,
    /// The same before kernels are put in the place of transcendental functions.
    folded: Graph,
    /// From the ends of all boxes and the other inputs to three outputs for each of `what`.
    enclosing: Graph,
}

impl Enclosed {
    /// Values and, if `gradient`, first derivatives of all real outputs of a raw graph over boxes of its real inputs.
    ///
    /// # Errors
    /// If a step fails; `None` if a number of iterations depends on a box (LANGUAGE 15.5).
    pub fn new(name: &str, raw: &Graph, precision: Precision, gradient: bool) -> Result<Option<Self>, Failure> {
        let failure = |e: &dyn std::fmt::Display| Failure::new(LAW, name, e);
        let kinds: Vec<Scalar> = raw.inputs.iter().map(|input| input.scalar).collect();
        let reals: Vec<usize> = (0..kinds.len()).filter(|i| kinds[*i] == Scalar::Real).collect();
        let mut what = Vec::new();
        for (output, _) in raw.outputs.iter().enumerate().filter(|(_, o)| raw.scalar(o.node) == Scalar::Real) {
            what.push(What { output, by: None });
            what.extend(reals.iter().filter(|_| gradient).map(|i| What { output, by: Some(*i) }));
        }
        let asked = |form: &Form, parts: usize| -> Vec<Asked> {
            let names = |k: usize| (0..parts).map(|part| format!("y{k}.{part}")).collect();
            let by = |w: &What| w.by.into_iter().collect();
            let one =
                |(k, w): (usize, &What)| Asked { names: names(k), output: w.output, by: by(w), form: form.clone() };
            what.iter().enumerate().map(one).collect()
        };
        let points: Vec<(String, Source)> = (0..kinds.len()).map(|i| (format!("x{i}"), Source::Point(i))).collect();
        let mut boxes = Vec::new();
        for (i, kind) in kinds.iter().enumerate() {
            if *kind == Scalar::Real {
                boxes.push((format!("x{i}.start"), Source::Start(i)));
                boxes.push((format!("x{i}.end"), Source::End(i)));
            } else {
                boxes.push((format!("x{i}"), Source::Point(i)));
            }
        }
        let expand = |inputs: &[(String, Source)], asked: &[Asked]| {
            let graph = answer(raw, inputs, asked, MANY, &Unwatched).map_err(|e| failure(&e))?.graph;
            match differentiate(graph, Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched) {
                Ok(graph) => Ok(Some(fold(&graph, precision, MANY, &Unwatched).map_err(|e| failure(&e))?)),
                Err(DifferentiateError::LoopBound { .. }) => Ok(None),
                Err(e) => Err(failure(&e)),
            }
        };
        let emit = |graph: &Graph| -> Result<Graph, Failure> {
            let graph = kernels(graph, precision, Family::Lanes, MANY, &Unwatched).map_err(|e| failure(&e))?;
            optimise(&graph, precision, MANY, &Unwatched).map_err(|e| failure(&e))
        };
        let Some(folded) = expand(&points, &asked(&Form::Itself, 1))? else { return Ok(None) };
        let Some(enclosing) = expand(&boxes, &asked(&Form::Enclosed(reals), 3))? else { return Ok(None) };
        let (emitted, enclosing) = (emit(&folded)?, emit(&enclosing)?);
        Ok(Some(Self { name: name.to_owned(), precision, kinds, what, emitted, folded, enclosing }))
    }

    /// A random box about the origin; inputs that are no reals are points of it.
    pub fn random_box(&self, random: &mut Random) -> Vec<Side> {
        const NEAR: (f64, f64) = (-2.0, 2.0);
        let p = self.precision;
        let ordered = |x: f64, y: f64| {
            let (x, y) = (p.round(x), p.round(y));
            Side::Real { lo: x.min(y), hi: x.max(y), nan: false }
        };
        let (way, scale) = (random.below(20), 4.0 * 0.5_f64.powi(random.int(0, 24)));
        let far = FAR * 0.5_f64.powi(random.int(0, 30));
        let open = random.below(self.kinds.len());
        let mut sides = Vec::with_capacity(self.kinds.len());
        for (i, kind) in self.kinds.iter().enumerate() {
            let x = random.within(NEAR);
            sides.push(match (kind, way) {
                (Scalar::Int | Scalar::Bool, _) => Side::random(random, *kind, (-3.0, 4.0), p).narrowed(),
                (_, 0 | 1) => ordered(x, x),
                (_, 2 | 3) => ordered(far * random.within(NEAR), far * random.within(NEAR)),
                (_, 4) => {
                    let (lo, hi) = Side::ends(random, NEAR, p);
                    Side::Real { lo, hi, nan: false }
                }
                (_, 5) if i == open => {
                    let end = random.pick(&[f64::INFINITY, f64::NEG_INFINITY]);
                    ordered(x, end)
                }
                (_, 6) => ordered(least_normal(p) * x, least_normal(p) * random.within(NEAR)),
                // Faces and axes of shapes.
                (_, 7 | 8) => ordered((2.0 * x).round() / 2.0, (2.0 * x).round() / 2.0 + scale.min(1.0)),
                _ => ordered(x, x + scale * random.unit()),
            });
        }
        sides
    }

    /// Ready to judge boxes.
    #[must_use]
    pub fn judge(&self) -> GraphJudge<'_> {
        GraphJudge {
            of: self,
            emitted: Evaluator::new(&self.emitted, self.precision),
            folded: Evaluator::new(&self.folded, self.precision),
            wide: Evaluator::new(&self.folded, Precision::F64),
            enclosing: Evaluator::new(&self.enclosing, self.precision),
            sampler: Sampler::default(),
        }
    }
}

/// Judges boxes of one graph.
#[derive(Debug)]
pub struct GraphJudge<'g> {
    of: &'g Enclosed,
    emitted: Evaluator<'g>,
    folded: Evaluator<'g>,
    wide: Evaluator<'g>,
    enclosing: Evaluator<'g>,
    sampler: Sampler,
}

impl GraphJudge<'_> {
    /// Judges `samples` points of a box. In f32 some are computed in f64 as well, nearly without error.
    ///
    /// # Errors
    /// At the first value that is not enclosed though nothing overflows or underflows on the way to it.
    pub fn judge(
        &mut self,
        sides: &[Side],
        samples: usize,
        random: &mut Random,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let p = self.of.precision;
        let inputs = inputs(sides);
        let finite = inputs.iter().all(|x| !matches!(x, Value::Real(x) if x.abs() > FAR));
        let slow = || Failure::new(LAW, &self.of.name, "too many steps");
        let enclosure = self.enclosing.run(&inputs).ok_or_else(slow)?;
        for part in enclosure.chunks(3) {
            let flagged = part.last() == Some(&Value::Bool(true));
            tally.flagged += u64::from(flagged);
            tally.flagged_finite += u64::from(flagged && finite);
        }
        let mut sampler = std::mem::take(&mut self.sampler);
        sampler.begin(sides, random, p);
        let grid = sampler.grid(samples / 2).min(samples);
        let mut hulls = vec![(f64::INFINITY, f64::NEG_INFINITY); self.of.what.len()];
        let mut result = Ok(());
        for n in 0..samples {
            let point = sampler.point(n, grid, sides, random, p);
            if point.iter().any(|x| matches!(x, Value::Real(x) if !x.is_finite())) {
                continue;
            }
            result = self.point(point, &enclosure, &mut hulls, n % 4 == 0, finite, tally);
            if let Err(failure) = &mut result {
                failure.what += &format!("\nover {sides:?}");
                break;
            }
        }
        self.sampler = sampler;
        tally.boxes += 1;
        for (part, hull) in enclosure.chunks(3).zip(hulls) {
            if let [Value::Real(lo), Value::Real(hi), _] = part {
                tally.measure((*lo, *hi), hull);
            }
        }
        result
    }

    fn point(
        &mut self,
        point: &[Value],
        enclosure: &[Value],
        hulls: &mut [(f64, f64)],
        wide: bool,
        near: bool,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let p = self.of.precision;
        let failure = |what: String| Failure::new(LAW, &self.of.name, what);
        let values = self.emitted.run(point).ok_or_else(|| failure("too many steps".into()))?;
        tally.samples += 1;
        for (k, ((value, part), hull)) in values.iter().zip(enclosure.chunks(3)).zip(hulls).enumerate() {
            if let Value::Real(x) = value {
                tally.nan += u64::from(near && x.is_nan());
                *hull = (hull.0.min(*x), hull.1.max(*x));
            }
            let Some(why) = escapes(part, *value) else { continue };
            self.folded.run(point);
            let endless = matches!(value, Value::Real(x) if x.is_infinite());
            if endless || beyond(&self.of.folded, &self.folded, p) {
                tally.open += 1;
                continue;
            }
            let What { output, by } = self.of.what[k];
            let of = by.map_or(String::new(), |i| format!(", differentiated by input {i},"));
            let (enclosure, value, point) = (show(part), show(&[*value]), show(point));
            let p = p.name();
            return Err(failure(format!("{p}: output {output}{of} is {value} at {point}, which {enclosure} {why}")));
        }
        // What depends on no box is enclosed as it is computed.
        if !wide || p == Precision::F64 || self.of.kinds.iter().any(|kind| *kind != Scalar::Real) {
            return Ok(());
        }
        let values = self.wide.run(point).ok_or_else(|| failure("too many steps".into()))?;
        for (k, (value, part)) in values.iter().zip(enclosure.chunks(3)).enumerate() {
            // That nothing has a value there is said of computed values.
            if matches!(value, Value::Real(x) if x.is_nan()) || escapes(part, *value).is_none() {
                continue;
            }
            if beyond(&self.of.folded, &self.wide, Precision::F64) {
                tally.open += 1;
                continue;
            }
            let (enclosure, value, point) = (show(part), show(&[*value]), show(point));
            let what = self.of.what[k];
            return Err(failure(format!(
                "f32, computed in f64: {what:?} is {value} at {point}, outside of {enclosure}"
            )));
        }
        Ok(())
    }
}

/// Whether something overflowed or underflowed in the last run, which LANGUAGE 15.4 leaves open, or a wave was asked for
/// where the accuracy of 17.4 ends: kernels may give −0 there, whose reciprocal is on the other side.
fn beyond(graph: &Graph, run: &Evaluator<'_>, precision: Precision) -> bool {
    let tiny = least_normal(precision);
    let real = |id: NodeId| if let Value::Real(x) = run.last(id) { x } else { 1.0 };
    graph.iter().any(|(id, node)| {
        let Node::Apply(op, args) = node else { return false };
        let x = real(id);
        let small = |x: f64| x != 0.0 && x.abs() < tiny;
        let vanished = match op {
            Op::Mul | Op::Div | Op::Unit | Op::Scale => x == 0.0 && real(args.as_slice()[0]) != 0.0,
            Op::Exp | Op::Exp2 | Op::Sigmoid | Op::Softplus => x == 0.0,
            Op::Pow => x == 0.0 && real(args.as_slice()[0]) != 0.0,
            Op::Length2 | Op::Length3 | Op::Length4 => {
                args.as_slice().iter().any(|a| small(real(*a) * real(*a)) || (real(*a) != 0.0 && x.powi(2) < tiny))
            }
            Op::Sin | Op::Cos | Op::Tan => real(args.as_slice()[0]).abs() > 8192.0,
            Op::Mod => small(real(args.as_slice()[0]) / real(args.as_slice()[1])),
            _ => false,
        };
        graph.scalar(id) == Scalar::Real && (x.is_infinite() || small(x) || vanished)
    })
}

/// Random boxes of a raw graph's real inputs, in both precisions: the expanded enclosures of values and gradients hold
/// what is computed at points. How many of those enclosures are bounded on a side is what counts as judged.
///
/// # Errors
/// At the first value that is not enclosed, or if a step fails.
pub fn enclosed_graph(raw: &Graph, boxes: usize, seed: u64) -> Judgement {
    let mut count = Count::default();
    for precision in [Precision::F32, Precision::F64] {
        let Some(enclosed) = Enclosed::new(&print(raw), raw, precision, true)? else {
            count.unjudged += boxes;
            continue;
        };
        let (mut judge, mut random, mut tally) = (enclosed.judge(), Random::new(seed), Tally::default());
        for _ in 0..boxes {
            let sides = enclosed.random_box(&mut random);
            judge.judge(&sides, 32, &mut random, &mut tally)?;
        }
        count.judged += usize::try_from(tally.samples - tally.open.min(tally.samples)).unwrap_or(usize::MAX);
        count.unjudged += usize::try_from(tally.open).unwrap_or(usize::MAX);
    }
    Ok(count)
}

/// The enclosures that the interpreter finds hold what is computed at points, and are those that the expanded graph
/// computes. One may be wider than the other where it encloses what depends on no box, which counts as not judged.
///
/// # Errors
/// At the first that differs, or if a step fails.
pub fn interpreter_agrees(raw: &Graph, precision: Precision, boxes: usize, seed: u64) -> Judgement {
    const LAW: &str = "interpreter_agrees";
    let mut count = Count::default();
    let Some(enclosed) = Enclosed::new(&print(raw), raw, precision, false)? else { return Ok(count) };
    let mut random = Random::new(seed);
    let (mut judge, mut sampler) = (enclosed.judge(), Sampler::default());
    for _ in 0..boxes {
        let sides = enclosed.random_box(&mut random);
        let hulls: Vec<Hull> = sides.iter().map(|side| hull(*side)).collect();
        let failure = |what: String| Failure::new(LAW, print(raw), format!("over {sides:?}: {what}"));
        let found = enclosures(raw, &hulls, precision, Loops::Run { max_steps: 1_000_000 }, &Unwatched);
        let found = found.ok_or_else(|| failure("the interpreter gave up".into()))?;
        let expanded = judge.enclosing.run(&inputs(&sides)).ok_or_else(|| failure("too many steps".into()))?;
        let hulls: Vec<Hull> = enclosed.what.iter().map(|what| found[raw.outputs[what.output].node.index()]).collect();
        for (hull, part) in hulls.iter().zip(expanded.chunks(3)) {
            match compared(*hull, part) {
                Some(Agreement::Same) => count.judged += 1,
                Some(Agreement::Wider) => count.unjudged += 1,
                None => return Err(failure(format!("the interpreter says {hull:?}, the graph {}", show(part)))),
            }
        }
        sampler.begin(&sides, &mut random, precision);
        for n in 0..8 {
            let point = sampler.point(n, 4, &sides, &mut random, precision);
            if point.iter().any(|x| matches!(x, Value::Real(x) if !x.is_finite())) {
                continue;
            }
            let values = judge.emitted.run(point).ok_or_else(|| failure("too many steps".into()))?;
            for (hull, value) in hulls.iter().zip(values) {
                judge.folded.run(point);
                let endless = matches!(value, Value::Real(x) if x.is_infinite());
                if !hull.contains(value) && !endless && !beyond(&enclosed.folded, &judge.folded, precision) {
                    return Err(failure(format!("{hull:?} does not hold {value:?} at {}", show(point))));
                }
            }
        }
    }
    Ok(count)
}

enum Agreement {
    Same,
    Wider,
}

/// What the interpreter says against what the graph computes; `None` if neither holds the other.
fn compared(hull: Hull, part: &[Value]) -> Option<Agreement> {
    let (Hull::Real { lo, hi, nan }, &[Value::Real(lo2), Value::Real(hi2), Value::Bool(nan2)]) = (hull, part) else {
        return None;
    };
    let same = |x: f64, y: f64| x == y || (x.is_nan() && y.is_nan());
    let nothing = nan && nan2;
    if same(lo, lo2) && same(hi, hi2) && nan == nan2 {
        Some(Agreement::Same)
    } else if lo2 <= hi2 && ((lo <= lo2 && hi2 <= hi) || (lo2 <= lo && hi <= hi2)) || nothing {
        Some(Agreement::Wider)
    } else {
        None
    }
}

const fn hull(side: Side) -> Hull {
    match side {
        Side::Real { lo, hi, nan } => Hull::Real { lo, hi, nan },
        Side::Int { lo, hi } => Hull::Int { lo, hi },
        Side::Bool { yes, no } => Hull::Bool { yes, no },
    }
}

/// The inputs of an enclosing graph.
fn inputs(sides: &[Side]) -> Vec<Value> {
    let mut inputs = Vec::new();
    for side in sides {
        match side {
            Side::Real { lo, hi, .. } => inputs.extend([Value::Real(*lo), Value::Real(*hi)]),
            Side::Int { lo, .. } => inputs.push(Value::Int(*lo)),
            Side::Bool { yes, .. } => inputs.push(Value::Bool(*yes)),
        }
    }
    inputs
}

/// The exact values of a raw graph of `+ − × ÷ √` without regions lie in its enclosures.
///
/// # Errors
/// At the first that does not, or if a step fails.
pub fn exact_values_enclosed(raw: &Graph, precision: Precision, boxes: usize, seed: u64) -> Judgement {
    const LAW: &str = "exact_values_enclosed";
    let mut count = Count::default();
    let Some(enclosed) = Enclosed::new(&print(raw), raw, precision, false)? else { return Ok(count) };
    // Its constants are those that the enclosure sees.
    let graph = &enclosed.folded;
    let mut random = Random::new(seed);
    let mut evaluator = Evaluator::new(&enclosed.enclosing, precision);
    let mut sampler = Sampler::default();
    for _ in 0..boxes {
        let sides = enclosed.random_box(&mut random);
        let failure = |what: String| Failure::new(LAW, print(raw), what);
        let enclosure = evaluator.run(&inputs(&sides)).ok_or_else(|| failure("too many steps".into()))?;
        sampler.begin(&sides, &mut random, precision);
        for n in 0..12 {
            let point: Vec<f64> =
                sampler.point(n, 8, &sides, &mut random, precision).iter().map(|x| super::real(*x)).collect();
            let values = exact::values(graph, &point);
            for (output, part) in graph.outputs.iter().zip(enclosure.chunks(3)) {
                let [Value::Real(lo), Value::Real(hi), _] = part else { continue };
                match &values[output.node.index()] {
                    None => count.unjudged += 1,
                    Some(x) if exact::inside(x, *lo, *hi) => count.judged += 1,
                    Some(x) => {
                        let near = x.to_f64().value();
                        let what =
                            format!("at {point:?} the exact value {near:e} is not in {}, over {sides:?}", show(part));
                        return Err(failure(what));
                    }
                }
            }
        }
    }
    Ok(count)
}
