//! Evaluates a sphere without copies, and prints what a point takes on one thread with its columns in the cache.

#![allow(clippy::pedantic, reason = "a measurement")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::Instant;

use isograd_compiler::Precision;
use isograd_runtime::Runtime;
use isograd_wasm::Vectors;

fn main() {
    let runtime = Runtime::default();
    for precision in [Precision::F32, Precision::F64] {
        for (name, gradient) in [("value", false), ("value and gradient", true)] {
            for vectors in [None, Some(Vectors::One), Some(Vectors::Two), Some(Vectors::Four)] {
                let artefact = support::artefact(precision, &[true, true, true, false], vectors, |b| {
                    support::sphere(b, gradient);
                });
                let kernel = runtime.load(&artefact).expect("loads");
                let mut instance = kernel.instance().expect("an instance");
                for column in 0..3 {
                    match precision {
                        Precision::F32 => instance.input::<f32>(column).fill(0.7),
                        Precision::F64 => instance.input::<f64>(column).fill(0.7),
                    }
                }
                let block = instance.block();
                // The least of many short runs: what the others measure is the machine's other work.
                let mut least = f64::INFINITY;
                for _ in 0..300 {
                    let begin = Instant::now();
                    for _ in 0..20 {
                        instance.run(block, None).expect("runs");
                    }
                    least = least.min(begin.elapsed().as_secs_f64() * 1e9 / (20 * block) as f64);
                }
                let pad = artefact.manifest.memory().expect("a WebAssembly module").pad;
                println!("sphere {name}, {}, {pad} points at a time, {block} a call: {least:.3} ns", precision.name());
            }
        }
    }
}
