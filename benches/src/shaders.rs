//! What the shader targets cost: emission and its growth, the validator's time, and a Vulkan device beside WebAssembly.
//! Uses the compiler, the runtime and the Vulkan runner as a host does.

use std::process::Command;

use isograd_compiler::{Artefact, Query, Target};
use isograd_runtime::{EvalOptions, Runtime, Values};
use isograd_vulkan::{Choice, Device};

use crate::measure::{Effort, Stopwatch, median, race};
use crate::models::{Model, generated, points};
use crate::ours::{Failure, Job};
use crate::report::{Line, Section, digits};

/// Seed of all points.
const SEED: u64 = 13;

fn job(name: &str, text: &str, target: Target, gradient: bool) -> Result<Job, Failure> {
    let mut queries = vec![Query::Value];
    if gradient {
        queries.push("gradient(at)".parse()?);
    }
    let mut job = Job::unlimited(name, text, queries);
    job.request.target = target;
    Ok(job)
}

/// The artefact, and the median time of the step `emit` in milliseconds.
fn emitted(job: &Job, effort: Effort) -> Result<(Artefact, f64), Failure> {
    let mut artefact = job.compiled(&isograd_compiler::Unwatched)?;
    let mut runs = Vec::new();
    for _ in 0..effort.rounds {
        let watch = Stopwatch::default();
        artefact = job.compiled(&watch)?;
        runs.push(watch.finish().iter().filter(|s| s.0 == "emit").map(|s| s.1).sum::<f64>());
    }
    Ok((artefact, median(runs.into_iter()) * 1e3))
}

/// From the scheduled graph to the text or the bytes. Goal: 20 ms for 8,000 operations.
pub fn emission(models: &[Model], effort: Effort) -> Result<Section, Failure> {
    let mut lines = Vec::new();
    for (model, gradient) in models.iter().flat_map(|m| [(m, false), (m, true)]) {
        let of = |target| emitted(&job(model.name, &model.vola, target, gradient)?, effort);
        let (spirv, figure) = of(Target::Spirv)?;
        let (_, wasm) = of(Target::Wasm)?;
        let (wgsl, text) = of(Target::Wgsl)?;
        let cells = vec![
            spirv.manifest.operations.to_string(),
            spirv.bytes.len().to_string(),
            wgsl.bytes.len().to_string(),
            digits(wasm),
            digits(text),
        ];
        let name = if gradient { format!("{}, gradient", model.name) } else { model.name.to_owned() };
        lines.push(Line { name, cells, figure, goal: (!gradient).then_some(20.0) });
    }
    let title = "Emission, from the scheduled graph (bytes; ms for WebAssembly, WGSL, SPIR-V)".to_owned();
    let heads = vec!["operations", "SPIR-V bytes", "WGSL bytes", "WebAssembly", "WGSL"];
    Ok(Section { title, heads, figure: "SPIR-V", lines })
}

/// How its time grows with the graph.
pub fn growth(effort: Effort) -> Result<Section, Failure> {
    let mut lines = Vec::new();
    let mut first = None;
    for size in [1_000, 10_000, 100_000] {
        let job = job("generated", &generated(size, 1).to_vola(), Target::Spirv, false)?;
        let (artefact, millis) = emitted(&job, Effort { rounds: effort.rounds.min(5), ..effort })?;
        let each = millis * 1e6 / f64::from(artefact.manifest.operations);
        let base = *first.get_or_insert(each);
        let cells = vec![digits(millis), digits(each)];
        lines.push(Line { name: format!("{size} operations"), cells, figure: each / base, goal: Some(1.5) });
    }
    let title = "Growth of SPIR-V's".to_owned();
    Ok(Section { title, heads: vec!["ms", "ns/operation"], figure: "to the first", lines })
}

/// The validator, its start included. Goal: 200 ms for 8,000 operations. `None` if it is not installed.
pub fn validation(models: &[Model], effort: Effort) -> Result<Option<Section>, Failure> {
    if Command::new("spirv-val").arg("--version").output().is_err() {
        eprintln!("spirv-val is not installed: not measured");
        return Ok(None);
    }
    let folder = tempfile::tempdir()?;
    let mut lines = Vec::new();
    for model in models {
        let artefact = job(model.name, &model.vola, Target::Spirv, false)?.compiled(&isograd_compiler::Unwatched)?;
        let path = folder.path().join("module.spv");
        std::fs::write(&path, &artefact.bytes)?;
        let mut runs = Vec::new();
        for _ in 0..effort.rounds.min(5) {
            let begin = std::time::Instant::now();
            let output = Command::new("spirv-val").args(["--target-env", "vulkan1.1"]).arg(&path).output()?;
            runs.push(begin.elapsed().as_secs_f64());
            if !output.status.success() {
                return Err(format!("{}: {}", model.name, String::from_utf8_lossy(&output.stderr)).into());
            }
        }
        let figure = median(runs.into_iter()) * 1e3;
        lines.push(Line { name: model.name.to_owned(), cells: Vec::new(), figure, goal: Some(200.0) });
    }
    let title = "spirv-val on a model's values".to_owned();
    Ok(Some(Section { title, heads: Vec::new(), figure: "ms", lines }))
}

/// The device beside WebAssembly on all cores, with the copies that both make. `None` if there is no device.
pub fn device(models: &[Model], many: usize, effort: Effort) -> Result<Option<Section>, Failure> {
    let device = match Device::open(&Choice::default()) {
        Ok(device) => device,
        Err(why) => {
            eprintln!("no Vulkan device: {why}");
            return Ok(None);
        }
    };
    let effort = Effort { rounds: effort.rounds.min(5), ..effort };
    let columns = points(many, SEED);
    let inputs: Vec<Values<'_>> = columns.iter().map(|column| Values::F32(column)).collect();
    let mut lines = Vec::new();
    for (model, gradient) in models.iter().flat_map(|m| [(m, false), (m, true)]) {
        let of = |target| job(model.name, &model.vola, target, gradient)?.compiled(&isograd_compiler::Unwatched);
        let kernel = Runtime::default().load(&of(Target::Wasm)?)?;
        let artefact = of(Target::Spirv)?;
        let begin = std::time::Instant::now();
        let shader = device.load(&artefact)?;
        let first = shader.evaluate(&inputs, many)?;
        let first_call = begin.elapsed().as_secs_f64();
        let wasm = kernel.evaluate(&inputs, many, &EvalOptions::default())?;
        if first != wasm {
            eprintln!("{}: the device gives other bits than WebAssembly", model.name);
        }
        let race = race(
            effort,
            || _ = std::hint::black_box(shader.evaluate(&inputs, many).is_ok()),
            || _ = std::hint::black_box(kernel.evaluate(&inputs, many, &EvalOptions::default()).is_ok()),
        );
        let rate = |seconds: f64| digits(many as f64 / seconds / 1e6);
        let cells = vec![digits(first_call * 1e3), rate(race.theirs), rate(race.ours)];
        let name = if gradient { format!("{}, gradient", model.name) } else { model.name.to_owned() };
        lines.push(Line { name, cells, figure: race.ratio, goal: None });
    }
    let title =
        format!("{}: first call in ms, millions of points a second, time beside WebAssembly's", device.info().name);
    Ok(Some(Section { title, heads: vec!["first call", "WebAssembly", "device"], figure: "ratio", lines }))
}
