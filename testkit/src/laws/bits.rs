//! Laws of equal bits: WebAssembly computes what the reference evaluator computes, a point does not see its neighbours,
//! and optimisation never shows.

use isograd_graph::ops::Family;
use isograd_graph::{Evaluator, Graph, Mode, NodeId, Op, Precision, Unwatched, Value, Verified};
use isograd_transform::{fold, kernels, optimise, schedule};
use isograd_wasm::{Split, Vectors};

use super::{Count, Failure, Judgement, show, verifier_accepts};
use crate::points::Random;
use crate::wasm::{Broken, Machine, TINY};

const MANY: usize = 4_000_000;

fn same(a: &[Value], b: &[Value]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.same_bits(*b))
}

fn text(graph: &Graph) -> String {
    isograd_graph::print(graph)
}

/// The graph of one operation alone, ready for emission.
///
/// # Errors
/// If a step fails on it.
pub fn kernels_of(op: Op, precision: Precision) -> Result<Verified, Failure> {
    let mut b = isograd_graph::Builder::new(Mode::Raw, MANY, &Unwatched);
    let args: Vec<NodeId> = op.def().operands.iter().enumerate().map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
    let result = b.op(op, &args);
    b.output("y", result);
    let graph = b.finish().map_err(|e| Failure::new("kernels_of", op, e))?;
    finished(&graph, precision, Family::Lanes, false)
}

/// Folds a graph and expands its kernels for a family of targets, and if asked for optimises and schedules it, verifying each step.
///
/// # Errors
/// If a step fails or the verifier does not accept what it made.
pub fn finished(graph: &Graph, precision: Precision, family: Family, optimised: bool) -> Result<Verified, Failure> {
    let mut graph = graph.clone();
    for name in ["fold", "kernels", "optimise", "schedule"].into_iter().take(if optimised { 4 } else { 2 }) {
        let next = match name {
            "fold" => fold(&graph, precision, MANY, &Unwatched),
            "kernels" => kernels(&graph, precision, family, MANY, &Unwatched),
            "optimise" => optimise(&graph, precision, MANY, &Unwatched),
            _ => schedule(&graph, precision, MANY, &Unwatched),
        };
        let next = next.map_err(|e| Failure::new(name, text(&graph), e))?;
        graph = verifier_accepts(name, next)?.into_inner();
    }
    verifier_accepts("schedule", graph)
}

/// WebAssembly ≡ reference, bit for bit, all NaNs being one: for each number of vectors per iteration, with all inputs
/// varying, and with each second one uniform; in one function, and cut into many. The graph is one that can be emitted.
///
/// # Errors
/// At the first point where they differ.
pub fn wasm_equals_reference(graph: &Verified, points: &[Vec<Value>]) -> Judgement {
    const LAW: &str = "wasm_equals_reference";
    let Some(precision) = graph.precision else { return Err(Failure::new(LAW, text(graph), "no precision")) };
    let inputs = graph.inputs.len();
    let each_second = |of: usize| -> Vec<bool> { (0..inputs).map(|k| k % 2 == of).collect() };
    let settings = [
        (vec![true; inputs], None, Split::NEVER),
        (vec![true; inputs], Some(Vectors::Two), Split::NEVER),
        (each_second(0), Some(Vectors::One), Split::NEVER),
        (each_second(1), Some(Vectors::Four), Split::NEVER),
        (vec![true; inputs], None, TINY),
        (each_second(0), Some(Vectors::Two), TINY),
        (each_second(1), Some(Vectors::One), TINY),
        (vec![false; inputs], None, TINY),
    ];
    let mut evaluator = Evaluator::new(graph, precision);
    let mut count = Count::default();
    for (varying, vectors, split) in settings {
        let how = format!("{precision:?}, {vectors:?}, {split:?}");
        let failed = |what: String| Failure::new(LAW, text(graph), format!("{how}: {what}"));
        let mut machine = Machine::new(graph, &varying, vectors, split).map_err(|Broken(e)| failed(e))?;
        // Uniform inputs change from call to call: two calls, if there are uniform ones.
        let calls = if varying.contains(&false) { points.len().div_ceil(2).max(1) } else { machine.block() };
        for chunk in points.chunks(calls.min(machine.block())) {
            let chunk: Vec<Vec<Value>> = chunk
                .iter()
                .map(|point| (0..inputs).map(|k| if varying[k] { point[k] } else { chunk[0][k] }).collect())
                .collect();
            let got = machine.run(&chunk).map_err(|Broken(e)| failed(e))?;
            for (point, got) in chunk.iter().zip(got) {
                let Some(want) = evaluator.run(point) else {
                    count.unjudged += 1;
                    continue;
                };
                if !same(&want, &got) {
                    let (point, want, got) = (show(point), show(&want), show(&got));
                    return Err(failed(format!("varying {varying:?}, at {point}: {want}, but WebAssembly {got}")));
                }
                count.judged += 1;
            }
        }
    }
    Ok(count)
}

/// The bits of a point do not depend on the size of the batch, the place in it and the neighbours: the points are run
/// all at once, one by one, in batches of odd sizes, and shuffled among surprising neighbours.
///
/// # Errors
/// At the first point whose bits change.
pub fn neighbours(graph: &Verified, points: &[Vec<Value>], seed: u64) -> Judgement {
    const LAW: &str = "neighbours";
    let mut random = Random::new(seed);
    let mut count = Count::default();
    let kinds: Vec<_> = graph.inputs.iter().map(|input| input.scalar).collect();
    let precision = graph.precision.unwrap_or_default();
    let settings = [
        (None, Split::default()),
        (Some(Vectors::One), Split::NEVER),
        (Some(Vectors::Two), Split::NEVER),
        (Some(Vectors::Four), Split::NEVER),
        (None, TINY),
        (Some(Vectors::Four), TINY),
    ];
    for (vectors, split) in settings {
        let how = format!("{precision:?}, {vectors:?}, {split:?}");
        let failed = |what: String| Failure::new(LAW, text(graph), format!("{how}: {what}"));
        let mut machine =
            Machine::new(graph, &vec![true; kinds.len()], vectors, split).map_err(|Broken(e)| failed(e))?;
        let points = &points[..points.len().min(machine.block() / 2)];
        let mut run = |points: &[Vec<Value>]| machine.run(points).map_err(|Broken(e)| failed(e));
        let together = run(points)?;
        let mut check = |i: usize, got: &[Value], how: &str| {
            count.judged += 1;
            if same(&together[i], got) {
                return Ok(());
            }
            let (point, want, got) = (show(&points[i]), show(&together[i]), show(got));
            Err(failed(format!("at {point}: {want} with all others, {got} {how}")))
        };
        for (i, point) in points.iter().enumerate() {
            check(i, &run(std::slice::from_ref(point))?[0], "alone")?;
        }
        for size in [3, 5, 17] {
            for (n, chunk) in points.chunks(size).enumerate() {
                for (k, got) in run(chunk)?.iter().enumerate() {
                    check(n * size + k, got, &format!("in a batch of {size}"))?;
                }
            }
        }
        let mut crowd: Vec<(Option<usize>, Vec<Value>)> =
            points.iter().enumerate().map(|(i, p)| (Some(i), p.clone())).collect();
        crowd.extend(points.iter().map(|_| (None, kinds.iter().map(|s| random.surprise(*s, precision)).collect())));
        random.shuffle(&mut crowd);
        let rows: Vec<Vec<Value>> = crowd.iter().map(|(_, row)| row.clone()).collect();
        for ((i, _), got) in crowd.iter().zip(run(&rows)?) {
            if let Some(i) = i {
                check(*i, &got, "among strangers")?;
            }
        }
    }
    Ok(count)
}

/// A raw graph without `diff`, after fold and kernels, has the bits it has after optimise and schedule too, by the
/// reference evaluator.
///
/// # Errors
/// At the first point where they differ.
pub fn optimised_equals_plain(graph: &Graph, precision: Precision, points: &[Vec<Value>]) -> Judgement {
    let (plain, optimised) =
        (finished(graph, precision, Family::Lanes, false)?, finished(graph, precision, Family::Lanes, true)?);
    equal("optimised_equals_plain", &plain, &optimised, precision, points)
}

/// A raw graph without `diff` and without operations that are not bit-exact has, in f64, the bits it has at the end of
/// the pipeline, by the reference evaluator.
///
/// # Errors
/// At the first point where they differ.
pub fn finished_equals_raw(graph: &Graph, points: &[Vec<Value>]) -> Judgement {
    let finished = finished(graph, Precision::F64, Family::Lanes, true)?;
    equal("finished_equals_raw", graph, &finished, Precision::F64, points)
}

fn equal(law: &'static str, one: &Graph, other: &Graph, precision: Precision, points: &[Vec<Value>]) -> Judgement {
    let (mut first, mut second) = (Evaluator::new(one, precision), Evaluator::new(other, precision));
    let mut count = Count::default();
    for point in points {
        let (Some(want), Some(got)) = (first.run(point), second.run(point)) else {
            count.unjudged += 1;
            continue;
        };
        if !same(&want, &got) {
            let what = format!("{precision:?}, at {}: {}, but {}", show(point), show(&want), show(&got));
            return Err(Failure::new(law, format!("{}\nthe other:\n{}", text(one), text(other)), what));
        }
        count.judged += 1;
    }
    Ok(count)
}
