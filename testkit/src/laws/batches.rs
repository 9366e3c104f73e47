//! The law of batches: what the runtime answers for a point depends neither on how many points are asked for, nor on
//! which part of them, nor on the threads.

use isograd_compiler::Artefact;
use isograd_runtime::{Column, EvalOptions, Runtime, Settings, Values};

use super::{Count, Failure, Judgement};

const LAW: &str = "batches";

/// Evaluates an artefact whose inputs all vary and are reals, one column each: all points on 1, 2, 3 and all threads,
/// and parts of them, and compares bits.
///
/// # Errors
/// At the first point whose bits differ, or if the artefact does not run.
pub fn batches(artefact: &Artefact, columns: &[Vec<f64>]) -> Judgement {
    let failed = |what: String| Failure::new(LAW, &artefact.manifest.export, what);
    let kernel = Runtime::new(Settings::default()).load(artefact).map_err(|e| failed(e.to_string()))?;
    let points = columns.first().map_or(0, Vec::len);
    let run = |from: usize, to: usize, threads: Option<usize>| {
        let inputs: Vec<Values<'_>> = columns.iter().map(|c| Values::F64(&c[from..to])).collect();
        let options = EvalOptions { threads, ..EvalOptions::default() };
        kernel.evaluate(&inputs, to - from, &options).map_err(|e| failed(e.to_string()))
    };
    let whole = run(0, points, None)?;
    let mut count = Count::default();
    let mut compare = |from: usize, part: &[Column], how: &str| {
        for (whole, part) in whole.iter().zip(part) {
            for i in 0..part.len() {
                let bits = |x: Option<f64>| x.map(f64::to_bits);
                if bits(whole.get(from + i)) != bits(part.get(i)) {
                    let (want, got) = (whole.get(from + i), part.get(i));
                    return Err(failed(format!("point {}: {want:?} among all, {got:?} {how}", from + i)));
                }
                count.judged += 1;
            }
        }
        Ok(())
    };
    for threads in [1, 2, 3] {
        compare(0, &run(0, points, Some(threads))?, &format!("on {threads} threads"))?;
    }
    let block = kernel.manifest().memory().map_or(1, |memory| memory.block as usize);
    for size in [1, 2, 7, block - 1, block + 1, 3 * block] {
        for from in [0, 5, points / 3, points.saturating_sub(size)] {
            let to = (from + size).min(points);
            compare(from, &run(from, to, None)?, &format!("in a batch of {size} from {from}"))?;
        }
    }
    Ok(count)
}
