//! Prints the table "Speed to reach": how long it takes from source to a first gradient, and how values and gradients
//! in bulk compare with Fidget's native code. Says what is measured and what the goals are.
//!
//! `cargo run --release -p isograd-benches` takes about a minute; `--quick` a few seconds, with less certain figures.
#![allow(clippy::print_stdout, reason = "the table is what this program is for")]

mod derivatives;
mod http;
mod measure;
mod models;
mod ours;
mod peers;
mod report;
mod shaders;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use isograd_runtime::{EvalOptions, Kernel, Runtime, Values};
use measure::{Effort, Stopwatch, median, race, time};
use models::{Model, points};
use ours::{Asked, Failure, Ours, compiled};
use peers::Fidget;
use report::{Line, Section, digits};

/// Measures Isograd against its goals and against Fidget.
#[derive(Parser)]
struct Arguments {
    /// Fewer repetitions and points: a smoke test
    #[arg(long)]
    quick: bool,
    /// Write the figures to this file, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Measure one model alone
    #[arg(long, value_name = "MODEL")]
    only: Option<String>,
}

/// Seed of all points.
const SEED: u64 = 7;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("isograd-benches: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (effort, many) = if arguments.quick {
        (Effort { rounds: 5, turn: Duration::from_micros(500) }, 50_000)
    } else {
        (Effort { rounds: 101, turn: Duration::from_micros(500) }, 1_000_000)
    };
    let mut models = models::all();
    if let Some(name) = &arguments.only {
        models.retain(|model| model.name == name);
        if models.is_empty() {
            return Err(format!("there is no model `{name}`").into());
        }
    }
    let mut sections = vec![
        first_gradient(&models, effort)?,
        in_cache(&models, Asked::Value, effort)?,
        in_cache(&models, Asked::Gradient, effort)?,
        in_bulk(&models, many, effort)?,
    ];
    sections.push(derivatives::transform(&models, effort)?);
    sections.push(shaders::emission(&models, effort)?);
    sections.extend(shaders::validation(&models, effort)?);
    sections.extend(shaders::device(&models, many, effort)?);
    if arguments.only.is_none() {
        sections.push(derivatives::growth(effort)?);
        sections.push(shaders::growth(effort)?);
        sections.push(derivatives::ratios(effort)?);
        sections.extend(derivatives::choice(Effort { rounds: effort.rounds.div_ceil(4), ..effort })?);
        sections.push(requests(&models, many, effort)?);
    }
    print!("{}", report::text(&sections));
    let (goals, within) = report::count(&sections);
    println!("\n{within} of {goals} figures are within their goal.");
    if let Some(path) = &arguments.json {
        std::fs::write(path, format!("{:#}\n", report::json(&sections)))
            .map_err(|e| format!("cannot write `{}`: {e}", path.display()))?;
    }
    Ok(())
}

/// From text to the first gradient: compiler, native code, instance and one point. Goals: 5 ms for the small
/// scenarios, 2 ms and 7 µs for each emitted operation for the others.
fn first_gradient(models: &[Model], effort: Effort) -> Result<Section, Failure> {
    let mut heads = vec!["operations", "bytes"];
    let mut lines = Vec::new();
    for model in models {
        let mut runs: Vec<Vec<(&'static str, f64)>> = Vec::new();
        let mut artefact = compiled(model, Asked::Gradient, &isograd_compiler::Unwatched)?;
        for _ in 0..effort.rounds.div_ceil(2) {
            let watch = Stopwatch::default();
            artefact = compiled(model, Asked::Gradient, &watch)?;
            step(&watch, "native code");
            let kernel = Runtime::default().load(&artefact)?;
            step(&watch, "one point");
            let mut instance = kernel.instance()?;
            (0..3).for_each(|axis| instance.input::<f32>(axis).fill(0.7));
            instance.run(1, None)?;
            std::hint::black_box(instance.output::<f32>(1).first());
            runs.push(watch.finish());
        }
        let names: Vec<_> = runs.first().into_iter().flatten().map(|s| s.0).collect();
        let steps: Vec<_> =
            (0..names.len()).map(|i| median(runs.iter().filter_map(|r| r.get(i)).map(|s| s.1))).collect();
        let total = median(runs.iter().map(|r| r.iter().map(|s| s.1).sum()));
        let operations = f64::from(artefact.manifest.operations);
        let mut cells = vec![operations.to_string(), artefact.bytes.len().to_string()];
        cells.extend(steps.iter().map(|s| digits(s * 1e3)));
        let goal = if model.small { 5.0 } else { 0.007f64.mul_add(operations, 2.0) };
        let goal = model.scenario.then_some(goal);
        lines.push(Line { name: model.name.to_owned(), cells, figure: total * 1e3, goal });
        heads.truncate(2);
        heads.extend(names);
    }
    let title = "Source to first gradient, warm, one thread (steps in ms)".to_owned();
    Ok(Section { title, heads, figure: "ms", lines })
}

fn step(watch: &Stopwatch, name: &'static str) {
    isograd_compiler::Watch::step(watch, name);
}

/// One block again and again, its columns in place on both sides: what the code itself takes.
fn in_cache(models: &[Model], asked: Asked, effort: Effort) -> Result<Section, Failure> {
    let mut lines = Vec::new();
    for model in models {
        let artefact = compiled(model, asked, &isograd_compiler::Unwatched)?;
        let points = points(artefact.manifest.memory().map_or(1, |memory| memory.block as usize), SEED);
        let mut ours = Ours::new(&artefact, &points)?;
        let block = ours.block();
        let mut fidget = Fidget::new(&model.steps, &points, block)?;
        let result = match asked {
            Asked::Value => race(effort, || ours.run(), || fidget.run_values()),
            Asked::Gradient => race(effort, || ours.run(), || fidget.run_gradients()),
        };
        let apart = disagreement(model, asked, &mut ours, &mut fidget)?;
        let each = |seconds: f64| digits(seconds * 1e9 / block as f64);
        let operations = ours.kernel.manifest().operations.to_string();
        let cells = vec![operations, block.to_string(), each(result.ours), each(result.theirs), format!("{apart:.0e}")];
        let goal = match asked {
            Asked::Gradient => 0.35,
            Asked::Value if model.small => 1.2,
            Asked::Value => 0.8,
        };
        lines.push(Line { name: model.name.to_owned(), cells, figure: result.ratio, goal: Some(goal) });
    }
    let title = match asked {
        Asked::Value => "Values, in cache, one thread",
        Asked::Gradient => "Gradients (value and three partial derivatives), in cache, one thread",
    };
    let heads = vec!["operations", "block", "ns/point", "Fidget's", "apart"];
    Ok(Section { title: title.to_owned(), heads, figure: "ratio", lines })
}

/// The largest difference of a result between the two. Fails if they do not do the same work.
fn disagreement(model: &Model, asked: Asked, ours: &mut Ours, fidget: &mut Fidget) -> Result<f32, Failure> {
    ours.run();
    let theirs: Vec<Vec<f32>> = match asked {
        Asked::Value => vec![fidget.values()],
        Asked::Gradient => {
            let all = fidget.gradients();
            let partials = (0..3).map(|axis| all.iter().map(|g| g.d(axis)).collect());
            std::iter::once(all.iter().map(|g| g.v).collect()).chain(partials).collect()
        }
    };
    let mut apart = 0.0;
    let mut at_kinks = 0;
    for (index, column) in theirs.iter().enumerate() {
        let pairs = ours.column(index).iter().zip(column);
        if pairs.len() != ours.block() {
            return Err(format!("{}: Fidget gave {} of {} results", model.name, column.len(), ours.block()).into());
        }
        for (a, b) in pairs {
            let difference = (a - b).abs();
            if difference <= 1e-3 {
                apart = difference.max(apart);
            } else if index > 0 && b.is_nan() && a.is_finite() {
                // Fidget's length has no derivative at 0, which is where the inside of a box is.
            } else if index > 0 && a.is_finite() {
                // Rounding may choose another side of a kink, where the derivative jumps.
                at_kinks += 1;
            } else {
                return Err(format!("{}: result {index} is {a} here and {b} by Fidget", model.name).into());
            }
        }
    }
    if at_kinks * 1000 > 3 * ours.block() {
        return Err(format!("{}: {at_kinks} partial derivatives differ from Fidget's", model.name).into());
    }
    Ok(apart)
}

/// The way of every host: many points, copied in and out, by one thread and by all.
fn in_bulk(models: &[Model], count: usize, effort: Effort) -> Result<Section, Failure> {
    // A turn is one call here.
    let effort = Effort { rounds: effort.rounds.div_ceil(10), turn: Duration::ZERO };
    let columns = points(count, SEED);
    let mut lines = Vec::new();
    for model in models {
        for asked in [Asked::Value, Asked::Gradient] {
            let kernel = Runtime::default().load(&compiled(model, asked, &isograd_compiler::Unwatched)?)?;
            let spent = |threads| time(effort, || evaluate(&kernel, &columns, threads));
            let (one, all) = (spent(Some(1)), spent(None));
            let name = match asked {
                Asked::Value => format!("{}, value", model.name),
                Asked::Gradient => format!("{}, gradient", model.name),
            };
            let cells = vec![digits(one * 1e9 / count as f64), digits(all * 1e9 / count as f64)];
            lines.push(Line { name, cells, figure: count as f64 / all / 1e6, goal: None });
        }
    }
    let title = format!("{count} points by `Kernel::evaluate`, copies included");
    Ok(Section { title, heads: vec!["ns/point, one thread", "ns/point, all threads"], figure: "Mpoints/s", lines })
}

fn evaluate(kernel: &Kernel, columns: &[Vec<f32>; 3], threads: Option<usize>) {
    let count = columns[0].len();
    let inputs = columns.each_ref().map(|c| Values::F32(c));
    let results = kernel.evaluate(&inputs, count, &EvalOptions { deadline: None, threads });
    std::hint::black_box(results.is_ok());
}

/// Requests for value and gradient of the smooth union: evaluation should be the smaller part of their time, HTTP and
/// JSON the larger.
fn requests(models: &[Model], many: usize, effort: Effort) -> Result<Section, Failure> {
    let model = models.iter().find(|m| m.name == "smooth union").ok_or("the smooth union is gone")?;
    let server = http::Server::new(&model.vola)?;
    let kernel = Runtime::default().load(&compiled(model, Asked::Gradient, &isograd_compiler::Unwatched)?)?;
    let mut lines = Vec::new();
    for count in [1, many] {
        let columns = points(count, SEED);
        let question = http::Server::question(&columns);
        let bytes = question.len() + server.evaluate(&question)?;
        let effort = if count == 1 { effort } else { Effort { rounds: 3, turn: Duration::ZERO } };
        let request = time(effort, || {
            std::hint::black_box(server.evaluate(&question).is_ok());
        });
        let evaluation = time(effort, || evaluate(&kernel, &columns, None));
        let cells = vec![bytes.to_string(), digits(request * 1e3), digits(evaluation * 1e3)];
        let name = if count == 1 { "1 point".to_owned() } else { format!("{count} points") };
        lines.push(Line { name, cells, figure: evaluation / request, goal: Some(0.5) });
    }
    let title = "Requests for value and gradient of the smooth union, without a socket, compiled before".to_owned();
    let heads = vec!["bytes in and out", "request, ms", "evaluation, ms"];
    Ok(Section { title, heads, figure: "evaluation's share", lines })
}
