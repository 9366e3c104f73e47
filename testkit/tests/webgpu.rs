//! The WGSL that the compiler writes, executed through a real WebGPU implementation: Dawn, the npm package `webgpu`, on a
//! Vulkan driver. The answers must lie within the bounds of WGSL, which cannot forbid contraction; how many of them have
//! the bits that the reference evaluator gets of the shader's graph is counted. The long form, for it downloads 60 MB:
//!
//! ```sh
//! npm install --prefix target/dawn webgpu          # node 20 or newer
//! XDG_RUNTIME_DIR=$(mktemp -d) VK_DRIVER_FILES=/usr/lib/chromium/vk_swiftshader_icd.json ISOGRAD_REQUIRE_WEBGPU=1 \
//! WEBGPU_PACKAGE=$PWD/target/dawn/node_modules/webgpu \
//!     cargo test --release -p isograd-testkit --no-default-features --test webgpu -- --ignored --nocapture
//! ```
//!
//! Chromium's package has SwiftShader; lavapipe serves from Mesa 25 on (22.3 lacks the dynamic indexing of uniform arrays
//! that Dawn demands). Without `ISOGRAD_REQUIRE_WEBGPU=1` a missing implementation is said, and nothing is executed.

#![allow(clippy::pedantic, reason = "tests")]

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use isograd_compiler::{Export, MemoryLoader, Options, Query, Rate, Request, ScalarKind, Target};
use isograd_graph::ops::Family;
use isograd_graph::{Builder, Evaluator, Graph, Mode, NodeId, Op, Precision, Scalar, Unwatched, Value, parse, verify};
use isograd_spirv::{Form, Plan};
use isograd_testkit::corpus;
use isograd_testkit::gpu::bounds::{Judge, Model, Tally, Verdict};
use isograd_testkit::points::{Random, in_domain};
use isograd_testkit::programs::{Choices, program};
use isograd_transform::{fold, kernels, optimise, schedule};
use serde_json::{Value as Json, json};

const POINTS: usize = 150;
const PROGRAMS: u64 = 150;
const NODES: usize = 4_000_000;

/// A kernel with its sidecar, its graph, and points to run it at.
struct Job {
    corpus: &'static str,
    name: String,
    wgsl: String,
    manifest: Json,
    graph: Graph,
    varying: Vec<bool>,
    points: Vec<Vec<Value>>,
}

#[test]
#[ignore = "needs node and the npm package `webgpu`: see the documentation of this file"]
fn wgsl_runs_within_the_bounds() {
    if let Err(missing) = probe() {
        let demanded = std::env::var("ISOGRAD_REQUIRE_WEBGPU").is_ok_and(|x| x == "1");
        assert!(!demanded, "ISOGRAD_REQUIRE_WEBGPU=1 demands WebGPU, but {missing}");
        println!("webgpu: {missing}; nothing was executed");
        return;
    }
    let mut jobs = Vec::new();
    for (corpus, folder) in [("examples", "examples"), ("standard library", "testkit/tests/stdlib")] {
        for (path, text) in corpus::folder(folder) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            assert!(of_program(&mut jobs, corpus, &name, &text) > 0, "{name} has no kernel");
        }
    }
    for op in Op::ALL {
        jobs.push(of_operation(*op));
    }
    for seed in 0..PROGRAMS {
        of_program(&mut jobs, "programs", &seed.to_string(), &program(Choices::Seeded(Random::new(seed))));
    }
    report(&jobs, executed(&jobs));
}

/// What implementations may merge in the texts is kept apart: without a device, and so always.
#[test]
fn chains_of_sums_and_products_are_kept_apart() {
    let mut jobs: Vec<Job> = Op::ALL.iter().map(|op| of_operation(*op)).collect();
    for folder in ["examples", "testkit/tests/stdlib"] {
        for (path, text) in corpus::folder(folder) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if ["along_curve.vola", "normals.vola", "box_frame.vola", "gyroid.vola", "twist.vola"].contains(&&*name) {
                of_program(&mut jobs, "programs", &name, &text);
            }
        }
    }
    assert!(jobs.len() > Op::ALL.len() + 20, "{} kernels", jobs.len());
    let mut barriers = 0;
    for job in &jobs {
        assert_eq!(merged(&job.wgsl), Vec::<String>::new(), "{}\n{}", job.name, job.wgsl);
        barriers += job.wgsl.matches("= rounded(").count();
    }
    let exp = jobs.iter().find(|job| job.name == "exp").expect("a kernel of exp");
    assert!(exp.wgsl.contains(" + 12582912.0);") && exp.wgsl.contains(" - 12582912.0;"), "{}", exp.wgsl);
    assert!(barriers > 100, "{barriers} barriers");
    // Without them the test would fail: what it looks for is there.
    let without = jobs.iter().filter(|job| !merged(&job.wgsl.replace("= rounded(", "= (")).is_empty()).count();
    assert!(without > 40, "{without} kernels need barriers");
}

/// The lines whose sum or product an implementation may merge with its operands: an inner and the outer one have a
/// constant, or the outer one is a sum with what the inner one has already, or of two products with a common factor.
fn merged(wgsl: &str) -> Vec<String> {
    let mut values: HashMap<&str, (&str, [&str; 2])> = HashMap::new();
    let mut opposites: HashMap<&str, &str> = HashMap::new();
    let mut found = Vec::new();
    for line in wgsl.lines() {
        let Some((name, value)) = line.trim().strip_prefix("let ").and_then(|line| line.split_once(" = ")) else {
            continue;
        };
        let value = value.trim_end_matches(';');
        let value = value.strip_prefix('(').map_or(value, |value| value.trim_end_matches(')'));
        if value.contains('(') {
            continue;
        }
        let parts: Vec<&str> = value.split(' ').collect();
        if let (Some(negated), [_]) = (value.strip_prefix('-'), &*parts) {
            opposites.insert(name, opposites.get(negated).copied().unwrap_or(negated));
        }
        let [a, operator @ ("+" | "-" | "*" | "/"), b] = *parts else { continue };
        let is_sum = |operator| matches!(operator, "+" | "-");
        let [a, b] = [a, b].map(|x| opposites.get(x).copied().unwrap_or(x));
        let mut merges = false;
        for (inner, other) in [(a, b), (b, a)] {
            let Some((within, terms)) = values.get(inner) else { continue };
            let constants = is_real(other) && terms.iter().any(|x| is_real(x));
            let again = is_sum(operator) && terms.contains(&other);
            merges |= is_sum(within) == is_sum(operator) && (constants || again);
        }
        if let (true, Some((left, x)), Some((right, y))) = (is_sum(operator), values.get(a), values.get(b)) {
            merges |= (*left, *right) == ("*", "*") && x.iter().any(|x| y.contains(x));
            merges |= (*left, *right) == ("/", "/") && x[1] == y[1];
        }
        if merges {
            found.push(line.trim().to_owned());
        }
        values.insert(name, (operator, [a, b]));
    }
    found
}

/// Whether it is a constant; those of ints have neither point nor exponent.
fn is_real(text: &str) -> bool {
    text.parse::<f64>().is_ok() && text.contains(['.', 'e'])
}

/// What keeps WebGPU from running here.
fn probe() -> Result<(), String> {
    let node = Command::new("node").arg("--version").output();
    let version = match node {
        Ok(output) => String::from_utf8_lossy(&output.stdout).trim().to_owned(),
        Err(e) => return Err(format!("`node` does not start ({e}): install node 20 or newer")),
    };
    let major = version.trim_start_matches('v').split('.').next().and_then(|x| x.parse().ok()).unwrap_or(0);
    if major < 20 {
        return Err(format!("node is {version}: the package `webgpu` needs 20 or newer"));
    }
    run_script(&json!([]), &scratch()).map(|report| println!("webgpu: Dawn on {}", report["adapter"])).map_err(|e| {
        format!(
            "Dawn does not start: npm install --prefix target/dawn webgpu, and name its folder in WEBGPU_PACKAGE; {e}"
        )
    })
}

/// A folder of this process.
fn scratch() -> PathBuf {
    let folder = std::env::temp_dir().join(format!("isograd-webgpu-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn run_script(jobs: &Json, folder: &Path) -> Result<Json, String> {
    let list = folder.join("jobs.json");
    fs::write(&list, jobs.to_string()).map_err(|e| e.to_string())?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/webgpu/run.mjs");
    let output = Command::new("node").arg(script).arg(&list).arg("backend=vulkan").output();
    let output = output.map_err(|e| e.to_string())?;
    serde_json::from_slice(&output.stdout)
        .map_err(|_| format!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr)))
}

/// The kernels of all exports of a program: their value and their first derivatives by the first parameter with reals.
fn of_program(jobs: &mut Vec<Job>, corpus: &'static str, name: &str, text: &str) -> usize {
    let options = Options::default();
    let checked =
        isograd_compiler::check("main.vola", text.as_bytes().to_vec(), &MemoryLoader::default(), &options, &Unwatched);
    let before = jobs.len();
    for export in checked.exports() {
        for request in requests(&export) {
            // Grown programs may exceed a limit.
            let Ok(artefact) = isograd_compiler::compile(&checked, &request, &options, &Unwatched) else { continue };
            let printed = isograd_compiler::print_step(&checked, &request, "schedule", &options, &Unwatched);
            let graph = parse(&printed.expect("it was compiled")).expect("what is printed can be parsed");
            let ports = &artefact.manifest.inputs;
            let varying: Vec<bool> =
                ports.iter().flat_map(|p| p.columns.iter().map(|_| p.rate == Rate::Varying)).collect();
            let ranges: Vec<(f64, f64)> = ports
                .iter()
                .flat_map(|p| &p.columns)
                .map(|c| c.range.map_or((-2.0, 2.0), |[lo, hi]| (lo.0.max(-1e3), hi.0.min(1e3))))
                .collect();
            let points = points(&graph, &varying, &ranges, jobs.len() as u64);
            jobs.push(Job {
                corpus,
                name: format!("{name}: {}: {}", export.name, artefact.manifest.outputs.len()),
                wgsl: String::from_utf8(artefact.bytes).expect("WGSL is text"),
                manifest: serde_json::to_value(&artefact.manifest).expect("a manifest is JSON"),
                graph,
                varying,
                points,
            });
        }
    }
    jobs.len() - before
}

/// Value and gradient, or Jacobian, of an export; the value alone where it has no derivative.
fn requests(export: &Export) -> Vec<Request> {
    let real = export.parameters.iter().find(|p| p.ty.scalars().contains(&ScalarKind::Real)).map(|p| p.name.clone());
    let request =
        |queries| Request { export: export.name.clone(), queries, target: Target::Wgsl, ..Request::default() };
    let derived = real.map(|p| request(vec![Query::Value, Query::Jacobian(p.as_str().into())]));
    std::iter::once(request(vec![Query::Value])).chain(derived).collect()
}

fn points(graph: &Graph, varying: &[bool], ranges: &[(f64, f64)], seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random::new(seed);
    let mut rows: Vec<Vec<Value>> = Vec::new();
    for _ in 0..POINTS {
        let row = graph.inputs.iter().enumerate().map(|(k, input)| match rows.first() {
            Some(first) if !varying[k] => first[k],
            _ => rounded(random.value_within(input.scalar, ranges[k])),
        });
        let row = row.collect();
        rows.push(row);
    }
    rows
}

fn rounded(value: Value) -> Value {
    if let Value::Real(x) = value { Value::Real(Precision::F32.round(x)) } else { value }
}

/// A kernel of one operation.
fn of_operation(op: Op) -> Job {
    let mut b = Builder::new(Mode::Raw, NODES, &Unwatched);
    let args: Vec<NodeId> = op.def().operands.iter().enumerate().map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
    let result = b.op(op, &args);
    b.output("y", result);
    let graph = fold(&b.finish().unwrap(), Precision::F32, NODES, &Unwatched).unwrap();
    let graph = kernels(&graph, Precision::F32, Family::Shader, NODES, &Unwatched).unwrap();
    let graph = optimise(&graph, Precision::F32, NODES, &Unwatched).unwrap();
    let graph = verify(schedule(&graph, Precision::F32, NODES, &Unwatched).unwrap()).unwrap();
    let varying = vec![true; args.len()];
    let wgsl = Plan::new(&graph, Form::Kernel { varying: &varying }).and_then(|plan| plan.wgsl());
    let points = in_domain(op.def(), POINTS, op as u64);
    Job {
        corpus: "operations",
        name: op.to_string(),
        wgsl: wgsl.unwrap_or_else(|e| panic!("{op}: {e}")),
        manifest: json!({
            "entry": isograd_spirv::ENTRY,
            "workgroup": isograd_spirv::WORKGROUP,
            "element": 4,
            "bindings": {
                "set": isograd_spirv::SET,
                "inputs": isograd_spirv::INPUTS,
                "outputs": isograd_spirv::OUTPUTS,
                "call": isograd_spirv::CALL,
            },
            "outputs": [{ "columns": [{}] }],
        }),
        graph: graph.into_inner(),
        varying,
        points: points.into_iter().map(|row| row.into_iter().map(rounded).collect()).collect(),
    }
}

/// What the device answers to each job, row by row, or why it does not.
fn executed(jobs: &[Job]) -> Vec<Result<Vec<Vec<Value>>, String>> {
    let folder = scratch();
    let mut all = Vec::new();
    // A process for some, so that one that crashes takes few with it.
    for (part, jobs) in jobs.chunks(100).enumerate() {
        let described: Vec<Json> = jobs.iter().enumerate().map(|(k, job)| written(job, &folder, k)).collect();
        match run_script(&Json::Array(described), &folder) {
            Err(e) => all.extend(jobs.iter().map(|_| Err(format!("part {part}: {e}")))),
            Ok(report) => {
                let results = report["results"].as_array().cloned().unwrap_or_default();
                assert_eq!(results.len(), jobs.len());
                all.extend(jobs.iter().zip(results).enumerate().map(|(k, (job, wrong))| match wrong {
                    Json::Null => read(job, &fs::read(folder.join(format!("{k}.out"))).expect("the outputs")),
                    wrong => Err(wrong.to_string()),
                }));
            }
        }
    }
    fs::remove_dir_all(&folder).expect("it was made");
    all
}

/// Writes the files of a job and names them.
fn written(job: &Job, folder: &Path, k: usize) -> Json {
    let file = |ending: &str, bytes: &[u8]| {
        let path = folder.join(format!("{k}.{ending}"));
        fs::write(&path, bytes).expect("a writable folder");
        path
    };
    let element = |value: Value| match value {
        Value::Real(x) => (x as f32).to_le_bytes(),
        Value::Int(x) => x.to_le_bytes(),
        Value::Bool(x) => i32::from(x).to_le_bytes(),
    };
    let (mut columns, mut uniforms) = (Vec::new(), Vec::new());
    for (input, varying) in job.varying.iter().enumerate() {
        let column = job.points.iter().map(|row| element(row[input]));
        if *varying { columns.extend(column.flatten()) } else { uniforms.extend(element(job.points[0][input])) }
    }
    json!({
        "shader": file("wgsl", job.wgsl.as_bytes()),
        "manifest": file("json", job.manifest.to_string().as_bytes()),
        "points": job.points.len(),
        "varying": file("varying", &columns),
        "uniforms": file("uniforms", &uniforms),
        "output": folder.join(format!("{k}.out")),
    })
}

fn read(job: &Job, bytes: &[u8]) -> Result<Vec<Vec<Value>>, String> {
    let n = job.points.len();
    if bytes.len() != 4 * n * job.graph.outputs.len() {
        return Err(format!("{} bytes of outputs", bytes.len()));
    }
    let element = |column: usize, row: usize| -> [u8; 4] {
        let at = 4 * (column * n + row);
        [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]
    };
    let value = |column: usize, row: usize| match job.graph.scalar(job.graph.outputs[column].node) {
        Scalar::Real => Value::Real(f64::from(f32::from_le_bytes(element(column, row)))),
        Scalar::Int => Value::Int(i32::from_le_bytes(element(column, row))),
        Scalar::Bool => Value::Bool(i32::from_le_bytes(element(column, row)) != 0),
    };
    Ok((0..n).map(|row| (0..job.graph.outputs.len()).map(|column| value(column, row)).collect()).collect())
}

/// What was found, of one corpus.
#[derive(Default)]
struct Found {
    kernels: usize,
    /// Kernels all of whose numbers have the bits of the reference.
    equal_kernels: usize,
    numbers: usize,
    equal: usize,
    tally: Tally,
}

fn report(jobs: &[Job], answers: Vec<Result<Vec<Vec<Value>>, String>>) {
    let mut all: BTreeMap<&str, Found> = BTreeMap::new();
    let mut failures = Vec::new();
    for (job, answer) in jobs.iter().zip(answers) {
        let found = all.entry(job.corpus).or_default();
        let name = format!("{}: {}", job.corpus, job.name);
        let rows = match answer {
            Ok(rows) => rows,
            Err(e) => {
                failures.push(format!("{name}: {e}"));
                continue;
            }
        };
        found.kernels += 1;
        let mut judge = Judge::new(&job.graph, Model::webgpu());
        let mut reference = Evaluator::new(&job.graph, Precision::F32);
        let (mut different, mut failed) = (0, false);
        for (point, got) in job.points.iter().zip(&rows) {
            let want = reference.run(point).expect("few steps");
            let equal = want.iter().zip(got).filter(|(a, b)| a.same_bits(**b)).count();
            found.numbers += want.len();
            found.equal += equal;
            different += want.len() - equal;
            let verdict = judge.judge(point, got);
            // The first point of a kernel says enough.
            if let (Verdict::Outside { .. }, false) = (&verdict, failed) {
                failed = true;
                failures.push(format!("{name} at {point:?}: {got:?}, the reference {want:?}: {verdict:?}"));
            }
            found.tally.add(&verdict);
        }
        found.equal_kernels += usize::from(different == 0);
    }
    for (corpus, found) in &all {
        println!(
            "webgpu: {corpus}: {} kernels, {} of them bit-equal to the reference; {} numbers, {} differ in bits\n    {}",
            found.kernels,
            found.equal_kernels,
            found.numbers,
            found.numbers - found.equal,
            found.tally
        );
    }
    assert!(failures.is_empty(), "{} kernels fail:\n{}", failures.len(), failures.join("\n"));
    for (corpus, found) in &all {
        let judged = found.tally.within;
        assert!(judged * 10 >= found.tally.points() * 7, "{corpus}: only {judged} points are judged");
    }
}
