//! The bounds of what GPUs may answer, tried on simulated devices: what errs as much as the model allows is accepted at
//! every point, what has a mistake is not, and the bounds are so narrow that this means something.
//!
//! ```sh
//! cargo test --release -p isograd-testkit --no-default-features --test bounds -- --nocapture
//! ```

#![allow(clippy::pedantic, reason = "tests")]

use std::sync::OnceLock;

use isograd_compiler::{MemoryLoader, Options, Query, Request, Target};
use isograd_graph::ops::Family;
use isograd_graph::{Builder, Evaluator, Graph, Mode, Node, NodeId, Op, Precision, Scalar, Unwatched, Value, parse};
use isograd_testkit::corpus;
use isograd_testkit::gpu::bounds::{Device, Judge, Mistake, Model, Style, Tally, Verdict, judge};
use isograd_testkit::points::{Random, in_domain, surprises};
use isograd_testkit::random::{self, INPUTS, Shape};
use isograd_transform::{fold, kernels, optimise, schedule};

const NODES: usize = 4_000_000;

/// A graph with points to judge it at.
struct Subject {
    name: String,
    graph: Graph,
    points: Vec<Vec<Value>>,
}

/// A raw graph as a shader is made of it.
fn shader(raw: &Graph) -> Graph {
    let graph = fold(raw, Precision::F32, NODES, &Unwatched).unwrap();
    let graph = kernels(&graph, Precision::F32, Family::Shader, NODES, &Unwatched).unwrap();
    let graph = optimise(&graph, Precision::F32, NODES, &Unwatched).unwrap();
    schedule(&graph, Precision::F32, NODES, &Unwatched).unwrap()
}

fn operation(op: Op) -> Graph {
    let mut b = Builder::new(Mode::Raw, NODES, &Unwatched);
    let args: Vec<NodeId> = op.def().operands.iter().enumerate().map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
    let result = b.op(op, &args);
    b.output("y", result);
    shader(&b.finish().unwrap())
}

fn rounded(rows: Vec<Vec<Value>>) -> Vec<Vec<Value>> {
    let round = |v| if let Value::Real(x) = v { Value::Real(Precision::F32.round(x)) } else { v };
    rows.into_iter().map(|row| row.into_iter().map(round).collect()).collect()
}

/// Every operation of the table, on its domain.
fn operations() -> Vec<Subject> {
    let subject = |op: &Op| Subject {
        name: op.to_string(),
        graph: operation(*op),
        points: rounded(in_domain(op.def(), 2000, *op as u64)),
    };
    Op::ALL.iter().map(subject).collect()
}

/// Random graphs over the whole table.
fn grown(n: u64) -> Vec<Subject> {
    let shape = Shape { size: 40, depth: 2, transcendental: true, tame: true };
    let subject = |seed: u64| {
        let mut random = Random::new(seed);
        let range = |kind: &Scalar| if *kind == Scalar::Real { (-2.0, 2.0) } else { (-3.0, 3.0) };
        let row = |random: &mut Random| INPUTS.iter().map(|kind| random.value_within(*kind, range(kind))).collect();
        let points = rounded((0..60).map(|_| row(&mut random)).collect());
        Subject { name: format!("random graph {seed}"), graph: shader(&random::graph(seed, &shape)), points }
    };
    (0..n).map(subject).collect()
}

/// Value and gradient of every specimen of the standard library.
fn specimens() -> &'static [Subject] {
    static ALL: OnceLock<Vec<Subject>> = OnceLock::new();
    ALL.get_or_init(|| {
        let mut all = Vec::new();
        for (path, text) in corpus::folder("testkit/tests/stdlib") {
            let checked = isograd_compiler::check(
                "main.vola",
                text.clone().into_bytes(),
                &MemoryLoader::default(),
                &Options::default(),
                &Unwatched,
            );
            for export in checked.exports() {
                let request = Request {
                    export: export.name.clone(),
                    queries: vec![Query::Value, Query::Gradient("p".into())],
                    target: Target::Spirv,
                    ..Request::default()
                };
                let printed =
                    isograd_compiler::print_step(&checked, &request, "schedule", &Options::default(), &Unwatched)
                        .unwrap_or_else(|e| panic!("{}: {}: {e:?}", path.display(), export.name));
                let graph = parse(&printed).unwrap();
                let mut random = Random::new(all.len() as u64);
                let point = |random: &mut Random| {
                    (0..graph.inputs.len()).map(|_| Value::Real(random.within((-2.0, 2.0)))).collect()
                };
                let points = rounded((0..100).map(|_| point(&mut random)).collect());
                all.push(Subject { name: format!("{}: {}", path.display(), export.name), graph, points });
            }
        }
        all
    })
}

/// What a device answers at all points of a subject, judged; a miss fails at once.
fn judged(subject: &Subject, model: Model, device: &mut dyn FnMut(&[Value]) -> Option<Vec<Value>>) -> Tally {
    let mut judge = Judge::new(&subject.graph, model);
    let mut tally = Tally::default();
    for point in &subject.points {
        let Some(got) = device(point) else { continue };
        let verdict = judge.judge(point, &got);
        assert!(!matches!(verdict, Verdict::Outside { .. }), "{} at {point:?}: {verdict:?}", subject.name);
        tally.add(&verdict);
    }
    tally
}

/// What was judged by each model.
#[derive(Default)]
struct Judged {
    vulkan: Tally,
    to_nearest: Tally,
    webgpu: Tally,
}

impl Judged {
    fn print(&self, what: &str) {
        println!("{what}, Vulkan: {}", self.vulkan);
        println!("{what}, Vulkan, to nearest: {}", self.to_nearest);
        println!("{what}, WebGPU: {}", self.webgpu);
    }
}

/// The reference, and devices that err at will and as much as they may, by each model.
fn devices(subject: &Subject, seed: u64) -> Judged {
    let of = |model: Model| {
        let mut reference = Evaluator::new(&subject.graph, Precision::F32);
        let mut tally = judged(subject, model, &mut |point| reference.run(point));
        for style in [Style::Any, Style::Extreme] {
            let mut device = Device::new(&subject.graph, model, style, seed);
            tally += judged(subject, model, &mut |point| device.run(point));
        }
        tally
    };
    Judged { vulkan: of(Model::vulkan()), to_nearest: of(Model::vulkan_to_nearest()), webgpu: of(Model::webgpu()) }
}

fn all(subjects: &[Subject]) -> Judged {
    let mut all = Judged::default();
    for (seed, subject) in subjects.iter().enumerate() {
        let Judged { vulkan, to_nearest, webgpu } = devices(subject, seed as u64);
        all.vulkan += vulkan;
        all.to_nearest += to_nearest;
        all.webgpu += webgpu;
    }
    all
}

/// Of all points at least so many in a thousand were judged.
fn most_judged(tally: &Tally, least: usize) {
    assert!(tally.within * 1000 >= tally.points() * least, "{tally}");
}

#[test]
fn operations_of_conforming_devices_are_within_the_bounds() {
    let subjects = operations();
    for subject in &subjects {
        let judged = devices(subject, 1);
        // There is a rule for each operation that shaders have.
        assert!(
            judged.to_nearest.within * 10 > judged.to_nearest.points() * 9,
            "{}: {}",
            subject.name,
            judged.to_nearest
        );
    }
    let all = all(&subjects);
    all.print("operations");
    most_judged(&all.to_nearest, 990);
    most_judged(&all.vulkan, 980);
    most_judged(&all.webgpu, 980);
}

#[test]
fn random_graphs_of_conforming_devices_are_within_the_bounds() {
    let all = all(&grown(120));
    all.print("random graphs");
    most_judged(&all.to_nearest, 750);
    most_judged(&all.vulkan, 500);
}

#[test]
fn specimens_of_conforming_devices_are_within_the_bounds() {
    let all = all(specimens());
    all.print("specimens");
    for tally in [&all.vulkan, &all.to_nearest, &all.webgpu] {
        most_judged(tally, 950);
        // A bound that is never tight would prove nothing.
        assert!(tally.ratio(0.5) > 0.1 && tally.ulps(0.5) < 20.0, "{tally}");
    }
}

/// The rules for operations are those of the table: with rounding to nearest the intervals are points, and these are
/// the bits of the reference.
#[test]
fn without_freedom_the_bounds_are_the_reference() {
    let mut tally = Tally::default();
    let mut subjects = grown(120);
    for op in Op::ALL.iter().filter(|op| !op.is_partial()) {
        let points = rounded(surprises(op.def().operands, Precision::F32, 2000, *op as u64));
        subjects.push(Subject { name: format!("surprised {op}"), graph: operation(*op), points });
    }
    subjects.extend(operations());
    for subject in subjects.iter().chain(specimens()) {
        let mut reference = Evaluator::new(&subject.graph, Precision::F32);
        let mut judge = Judge::new(&subject.graph, Model::exact());
        for point in &subject.points {
            let want = reference.run(point).unwrap();
            let verdict = judge.judge(point, &want);
            match &verdict {
                Verdict::Within { ulps, .. } => assert_eq!(*ulps, 0.0, "{}", subject.name),
                Verdict::Special(_) => {}
                _ => panic!("{} at {point:?}: {verdict:?}", subject.name),
            }
            tally.add(&verdict);
        }
    }
    println!("exact: {tally}");
    assert!(tally.within * 10 > tally.points() * 8 && tally.ambiguous == 0, "{tally}");
}

/// Decisions of the kernels near ties are judged by their alternatives, and are rare.
#[test]
fn kernels_are_seldom_ambiguous() {
    for (op, range) in [
        (Op::Exp, (-20.0, 20.0)),
        (Op::Exp2, (-20.0, 20.0)),
        (Op::Log, (1e-3, 1e3)),
        (Op::Log2, (1e-3, 1e3)),
        (Op::Sin, (-100.0, 100.0)),
        (Op::Cos, (-100.0, 100.0)),
        (Op::Tan, (-10.0, 10.0)),
        (Op::Asin, (-1.0, 1.0)),
        (Op::Atan, (-10.0, 10.0)),
        (Op::Tanh, (-5.0, 5.0)),
        (Op::Sinh, (-5.0, 5.0)),
    ] {
        let mut random = Random::new(op as u64);
        let points = rounded((0..20_000).map(|_| vec![Value::Real(random.within(range))]).collect());
        let subject = Subject { name: op.to_string(), graph: operation(op), points };
        let mut reference = Evaluator::new(&subject.graph, Precision::F32);
        // Where the direction is free, each rounding to an integer is a decision.
        let free = judged(&subject, Model::vulkan(), &mut |point| reference.run(point));
        println!("{op} within {range:?}, free: {free}");
        let tally = judged(&subject, Model::vulkan_to_nearest(), &mut |point| reference.run(point));
        println!("{op} within {range:?}, to nearest: {tally}");
        for tally in [&free, &tally] {
            assert!(tally.within == tally.points(), "{op}: {tally}");
        }
        assert!(tally.ambiguous * 1000 <= tally.points(), "{op}: {tally}");
    }
}

#[test]
fn what_devices_need_not_compute_is_not_judged() {
    let real = |x| vec![Value::Real(x)];
    let root = operation(Op::Sqrt);
    let verdict = |graph: &Graph, inputs: &[f64], got| {
        let inputs: Vec<Value> = inputs.iter().map(|x| Value::Real(*x)).collect();
        judge(graph, Model::vulkan(), &inputs, &real(got))
    };
    assert!(matches!(verdict(&root, &[-1.0], f64::NAN), Verdict::Special(_)));
    assert!(matches!(verdict(&root, &[4.0], 2.0), Verdict::Within { .. }));
    assert!(matches!(verdict(&root, &[4.0], f64::NAN), Verdict::Outside { .. }));
    assert!(matches!(verdict(&root, &[4.0], 2.000_01), Verdict::Outside { .. }));
    let quotient = operation(Op::Div);
    assert!(matches!(verdict(&quotient, &[1.0, 1e-40], 7.0), Verdict::Special(_)));
    assert!(matches!(verdict(&quotient, &[0.0, 3.0], 0.0), Verdict::Within { .. }));
    let product = operation(Op::Mul);
    assert!(matches!(verdict(&product, &[3e38, 2.0], f64::INFINITY), Verdict::Special("overflow")));
    // A subnormal product may be kept or flushed, and is nothing else.
    let (a, b) = (Precision::F32.round(1e-30), Precision::F32.round(1e-9));
    for (got, within) in [(Precision::F32.round(a * b), true), (0.0, true), (-1e-40, false), (1e-37, false)] {
        let verdict = verdict(&product, &[a, b], got);
        assert_eq!(matches!(verdict, Verdict::Within { .. }), within, "{got}: {verdict:?}");
    }
}

/// The operations that may stand for another by mistake.
fn mistaken(op: Op) -> Option<Op> {
    Some(match op {
        Op::Add => Op::Sub,
        Op::Sub => Op::Add,
        Op::Mul => Op::Div,
        Op::Div => Op::Mul,
        Op::Min => Op::Max,
        Op::Max => Op::Min,
        Op::Floor => Op::Ceil,
        Op::Ceil | Op::Trunc => Op::Floor,
        Op::Abs => Op::Neg,
        Op::Neg | Op::Sqrt => Op::Abs,
        Op::Lt => Op::Le,
        Op::Le => Op::Lt,
        Op::Eq => Op::Ne,
        _ => return None,
    })
}

/// Devices with one mistake each: how many of those whose answers it changes somewhere are found out.
#[test]
fn mistakes_are_found() {
    let mut random = Random::new(77);
    let mut found = [(0, 0); 3];
    for subject in specimens().iter().step_by(3) {
        let operations: Vec<(NodeId, Op)> = subject
            .graph
            .iter()
            .filter_map(|(id, node)| if let Node::Apply(op, _) = node { Some((id, op)) } else { None })
            .filter(|(_, op)| op.def().result == Scalar::Real || mistaken(*op).is_some())
            .collect();
        for _ in 0..12 {
            if operations.is_empty() {
                break;
            }
            let (node, op) = random.pick(&operations);
            let mistakes = [
                (op.def().result == Scalar::Real).then_some(Mistake::Relative(1e-4)),
                matches!(op, Op::Add | Op::Sub | Op::Mul).then_some(Mistake::Missing),
                mistaken(op).map(Mistake::Other),
            ];
            for (kind, mistake) in mistakes.into_iter().enumerate() {
                let Some(mistake) = mistake else { continue };
                let mut reference = Evaluator::new(&subject.graph, Precision::F32);
                let mut device = Device::new(&subject.graph, Model::exact(), Style::Any, 0).with(node, mistake);
                let mut judge = Judge::new(&subject.graph, Model::vulkan());
                let (mut changed, mut caught) = (false, false);
                for point in &subject.points {
                    let (want, got) = (reference.run(point).unwrap(), device.run(point).unwrap());
                    // By more than rounding changes it.
                    changed |= want.iter().zip(&got).any(|pair| match pair {
                        (Value::Real(a), Value::Real(b)) => (a - b).abs() > 1e-5 * a.abs().max(1e-2),
                        (a, b) => a != b,
                    });
                    caught |= matches!(judge.judge(point, &got), Verdict::Outside { .. });
                    if caught {
                        break;
                    }
                }
                found[kind].0 += usize::from(caught);
                found[kind].1 += usize::from(changed || caught);
            }
        }
    }
    for (what, (caught, changed)) in ["relative 1e-4", "a term is missing", "another operation"].iter().zip(found) {
        println!("mistakes: {what}: {caught} of {changed} devices whose answers it changes are found");
        assert!(changed > 100 && caught * 100 >= changed * 97, "{what}: {caught} of {changed}");
    }
}
