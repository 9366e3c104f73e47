//! What derivatives and enclosures cost: the transform's time and its growth, derived graphs against the value's, and
//! the choice of direction against both directions. Uses the compiler and the runtime as a host does.

use std::fmt::Write;

use isograd_compiler::{DerivativeMode, Query, Unwatched};

use crate::measure::{Effort, Stopwatch, median, race};
use crate::models::{Model, generated, points};
use crate::ours::{Failure, Job, Ours};
use crate::report::{Line, Section, digits};

/// A name, and the program of so many parameters.
type Family = (&'static str, fn(usize) -> String);

/// Seed of all points.
const SEED: u64 = 11;

fn query(text: &str) -> Result<Query, Failure> {
    Ok(text.parse()?)
}

/// The time from the program's graph to its derivatives, with the sizes of both. Goals: 100 µs for the first three
/// scenarios of the thesis; no more time per node at 100,000 nodes than half as much again as at 1,000.
pub fn transform(models: &[Model], effort: Effort) -> Result<Section, Failure> {
    let mut lines = Vec::new();
    for model in models.iter().filter(|m| m.scenario) {
        let job = Job::new(model.name, &model.vola, vec![Query::Value, query("gradient(at)")?]);
        let (micros, _) = transform_time(&job, effort)?;
        let nodes = |step| job.nodes(step);
        let cells =
            vec![nodes("elaborate")?.to_string(), nodes("differentiate")?.to_string(), nodes("optimise")?.to_string()];
        let goal = model.small.then_some(100.0);
        lines.push(Line { name: model.name.to_owned(), cells, figure: micros, goal });
    }
    let title = "Derivatives of a gradient, from graph to graph (nodes: the program's, derived, optimised)".to_owned();
    Ok(Section { title, heads: vec!["program", "derived", "optimised"], figure: "µs", lines })
}

/// How the transform's time grows with the graph.
pub fn growth(effort: Effort) -> Result<Section, Failure> {
    let mut lines = Vec::new();
    let mut first = None;
    for size in [1_000, 10_000, 100_000] {
        let text = generated(size, 1).to_vola();
        let job = Job::unlimited("generated", &text, vec![query("gradient(at)")?]);
        let (micros, nodes) = transform_time(&job, Effort { rounds: effort.rounds.min(5), ..effort })?;
        let each = micros * 1e3 / nodes as f64;
        let base = *first.get_or_insert(each);
        let cells = vec![nodes.to_string(), digits(micros / 1e3), digits(each)];
        lines.push(Line { name: format!("{size} operations"), cells, figure: each / base, goal: Some(1.5) });
    }
    let title = "Growth of that time".to_owned();
    Ok(Section { title, heads: vec!["nodes", "ms", "ns/node"], figure: "to the first", lines })
}

/// Microseconds of the steps that make derivatives, and the program's nodes.
fn transform_time(job: &Job, effort: Effort) -> Result<(f64, usize), Failure> {
    let mut runs = Vec::new();
    for _ in 0..effort.rounds {
        let watch = Stopwatch::default();
        job.compiled(&watch)?;
        let steps = watch.finish();
        runs.push(steps.iter().filter(|s| ["derive", "differentiate"].contains(&s.0)).map(|s| s.1).sum::<f64>());
    }
    Ok((median(runs.into_iter()) * 1e6, job.nodes("elaborate")?))
}

/// Derived results in units of the value's time, raced in one run.
pub fn ratios(effort: Effort) -> Result<Section, Failure> {
    let big = generated(8_000, 1).to_vola();
    let smooth = include_str!("../../examples/thesis/smooth_union.vola").to_owned();
    let parameters = |n| chain(n);
    let cases: [(&str, String, &[&str], f64); 6] = [
        ("gradient, 8,000 operations", big.clone(), &["value", "gradient(at)"], 4.5),
        ("gradient by 1,000 parameters", parameters(1_000), &["value", "gradient(*)"], 4.0),
        ("gradient by 100 parameters", parameters(100), &["value", "gradient(*)"], 4.0),
        ("Hessian, smooth union", smooth, &["hessian(at)"], 8.0),
        ("enclosure, 8,000 operations", big, &["bound(at)"], 15.0),
        ("enclosure, products", products(200), &["bound(at)"], 40.0),
    ];
    let mut lines = Vec::new();
    for (name, text, queries, goal) in cases {
        let queries = queries.iter().map(|q| query(q)).collect::<Result<Vec<_>, _>>()?;
        let value = Job::new(name, &text, vec![Query::Value]);
        let mut value = Ours::filled(&value.compiled(&Unwatched)?, &filled)?;
        let derived = Job::new(name, &text, queries);
        let mut derived = Ours::filled(&derived.compiled(&Unwatched)?, &filled)?;
        // A point's time, as blocks differ in size.
        let (points, values) = (derived.block() as f64, value.block() as f64);
        let result = race(effort, || derived.run(), || value.run());
        let operations = |ours: &Ours| ours.kernel.manifest().operations.to_string();
        let cells = vec![
            operations(&value),
            operations(&derived),
            digits(result.theirs * 1e9 / values),
            digits(result.ours * 1e9 / points),
        ];
        lines.push(Line { name: name.to_owned(), cells, figure: result.ratio * values / points, goal: Some(goal) });
    }
    let title = "Derivatives and enclosures against the value, in cache, one thread".to_owned();
    let heads = vec!["operations", "derived", "value, ns", "derived, ns"];
    Ok(Section { title, heads, figure: "ratio", lines })
}

/// Programs of 1 to 1,000 parameters: what `auto` takes against the better direction, by operations and measured.
/// Goals: 10 % more operations, 25 % more time.
pub fn choice(effort: Effort) -> Result<Vec<Section>, Failure> {
    let families: [Family; 3] = [("chain", chain), ("sum", sum), ("union", union)];
    let (mut counted, mut measured) = (Vec::new(), Vec::new());
    for (family, program) in families {
        for n in [1, 2, 4, 8, 16, 32, 100, 316, 1_000] {
            let name = format!("{family} of {n}");
            let text = program(n);
            let of = |mode| -> Result<Ours, Failure> {
                let mut job = Job::unlimited(&name, &text, vec![Query::Value, query("gradient(*)")?]);
                job.request.mode = mode;
                Ours::filled(&job.compiled(&Unwatched)?, &filled)
            };
            // A direction that exceeds a limit is none to choose.
            let directions = [of(DerivativeMode::Forward).ok(), of(DerivativeMode::Reverse).ok()];
            let mut auto = of(DerivativeMode::Auto)?;
            let operations = |ours: &Ours| f64::from(ours.kernel.manifest().operations);
            let costs = directions.each_ref().map(|d| d.as_ref().map_or(f64::NAN, operations));
            let chosen = auto.kernel.manifest().derivatives.mode.name();
            let cells = vec![costs[0].to_string(), costs[1].to_string(), chosen.to_owned()];
            let figure = operations(&auto) / costs[0].min(costs[1]);
            counted.push(Line { name: name.clone(), cells, figure, goal: Some(1.1) });
            let mut times = [f64::NAN; 2];
            for (time, direction) in times.iter_mut().zip(directions) {
                let Some(mut direction) = direction else { continue };
                let (ours, theirs) = (auto.block() as f64, direction.block() as f64);
                *time = race(effort, || auto.run(), || direction.run()).ratio * theirs / ours;
            }
            let cells = vec![digits(times[0]), digits(times[1]), chosen.to_owned()];
            measured.push(Line { name, cells, figure: times[0].max(times[1]), goal: Some(1.25) });
        }
    }
    let section = |title: &str, figure, heads, lines| Section { title: title.to_owned(), heads, figure, lines };
    Ok(vec![
        section(
            "The choice of direction, by operations emitted (gradient by all parameters)",
            "to the better",
            vec!["forward", "reverse", "chosen"],
            counted,
        ),
        section(
            "The choice of direction, measured (time of what is chosen, to that of each direction)",
            "to the better",
            vec!["to forward", "to reverse", "chosen"],
            measured,
        ),
    ])
}

/// `export fn field(at: vec3, p0: real, …) -> real` of n reals, and a line for each.
fn with_parameters(n: usize, first: &str, line: impl Fn(usize) -> String, last: &str) -> String {
    let mut text = "export fn field(at: vec3".to_owned();
    for i in 0..n {
        let _ = write!(text, ", p{i}: real");
    }
    let _ = writeln!(text, ") -> real {{\n    {first}");
    for i in 0..n {
        let _ = writeln!(text, "    {}", line(i));
    }
    let _ = writeln!(text, "    {last}\n}}");
    text
}

/// Each parameter acts on all that was computed before, by slopes near 1 (adjoints that die out would be subnormal,
/// which processors compute slowly).
fn chain(n: usize) -> String {
    let line = |i| format!("d = d + length(at - [p{i}, {}.0, 0.5])/(8.0 + d*d);", i % 7);
    with_parameters(n, "let d = at.x;", line, "d")
}

/// Each parameter acts on one term.
fn sum(n: usize) -> String {
    let line = |i| format!("d = d + p{i}*sqrt(1.0 + (at.x - {}.0)*p{i});", i % 5);
    with_parameters(n, "let d = at.y;", line, "d")
}

/// Balls of n radii.
fn union(n: usize) -> String {
    let line = |i| format!("d = min(d, length(at - [{}.0, {}.0, {}.0]) - p{i});", i % 5, i / 5 % 5, i / 25);
    with_parameters(n, "let d = at.z;", line, "d")
}

/// A product of n factors, all of which change sign.
fn products(n: usize) -> String {
    let mut text = "export fn field(at: vec3) -> real {\n    let d = 1.0;\n".to_owned();
    for i in 0..n {
        let axis = ["x", "y", "z"][i % 3];
        let _ = writeln!(text, "    d = d*at.{axis}*0.75;");
    }
    text + "    d\n}\n"
}

/// The content of an input column: a coordinate of a point, an end of a box around it, a parameter.
fn filled(name: &str, place: usize) -> f32 {
    // Points of a whole block are made once.
    static POINTS: std::sync::LazyLock<[Vec<f32>; 3]> = std::sync::LazyLock::new(|| points(1 << 14, SEED));
    let Some(coordinate) = name.strip_prefix("at.") else { return 0.05 };
    let axis = match coordinate.as_bytes().first() {
        Some(b'x') => 0,
        Some(b'y') => 1,
        _ => 2,
    };
    let x = POINTS[axis].get(place % (1 << 14)).copied().unwrap_or(0.5);
    match coordinate.rsplit_once('.') {
        Some((_, "start")) => x - 0.03125,
        Some((_, "end")) => x + 0.03125,
        _ => x,
    }
}
