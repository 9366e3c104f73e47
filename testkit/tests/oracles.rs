//! Programs and random graphs against oracles that know nothing of the compiler: hyper-dual numbers of an independent
//! crate to the third derivative, and shapes derived by hand. `ISOGRAD_GRAPHS=20` takes twenty times as many random
//! graphs as usual.

#![allow(clippy::pedantic, reason = "tests")]

#[cfg(feature = "run")]
#[path = "oracles/shapes.rs"]
mod shapes;

use isograd_compiler::{MemoryLoader, Options, check};
use isograd_elaborate::elaborate;
use isograd_graph::{Graph, Node, Scalar, Unwatched, Value};
use isograd_testkit::corpus;
use isograd_testkit::laws::{self, Count, Judgement};
use isograd_testkit::points::Random;
use isograd_testkit::random::{self, INPUTS, Shape};
use isograd_transform::Sweep;

/// Random graphs, more in the long form.
fn seeds(from: u64, n: u64) -> std::ops::Range<u64> {
    let times = std::env::var("ISOGRAD_GRAPHS").ok().and_then(|x| x.parse().ok()).unwrap_or(1);
    from..from + n * times
}

/// The sweeps of three nested `diff`s: all eight mixtures in turn.
fn mixture(n: u64) -> [Sweep; 3] {
    [1, 2, 4].map(|bit| if n & bit == 0 { Sweep::Reverse } else { Sweep::Forward })
}

fn holds(judgement: Judgement) -> Count {
    judgement.unwrap_or_else(|failure| panic!("{failure}"))
}

fn tame_points(n: usize, seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random::new(seed);
    (0..n).map(|_| INPUTS.iter().map(|s| random.value_within(*s, (-2.0, 3.0))).collect()).collect()
}

#[test]
fn third_derivatives_of_random_graphs_are_hyper_dual_numbers() {
    let mut all = Count::default();
    for seed in seeds(0, 160) {
        let shape = Shape { size: 14, depth: 2, transcendental: seed % 2 == 0, tame: true };
        let graph = random::graph(seed, &shape);
        all += holds(laws::higher_derivatives(&graph, &[0, 1, 2], mixture(seed / 2), &tame_points(4, seed), seed));
    }
    println!("higher_derivatives of random graphs: {all:?}");
    holds(all.at_least(40, "higher_derivatives", "random graphs"));
}

#[test]
fn reverse_is_the_transpose_of_forward() {
    let mut all = Count::default();
    for seed in seeds(0, 300) {
        let shape = Shape { size: 25, depth: 3, transcendental: seed % 2 == 0, tame: true };
        all += holds(laws::transposed(seed, &shape, &tame_points(6, seed)));
    }
    println!("transposed: {all:?}");
    holds(all.at_least(60, "transposed", "random graphs"));
}

/// The exports of a program, elaborated, that have at least one real input and one real output and no `diff` or `bound`
/// of their own: those are expanded by the rules that are to be judged.
fn exports(source: &str) -> Vec<(String, Graph)> {
    let options = Options::default();
    let checked = check("main.vola", source.into(), &MemoryLoader::default(), &options, &Unwatched);
    let Some(program) = checked.program.as_ref() else { return Vec::new() };
    let mut all = Vec::new();
    for id in &program.exports {
        let function = &program.functions[id.0 as usize];
        let Ok(elaborated) = elaborate(program, *id, &options.limits, &Unwatched) else { continue };
        let graph = elaborated.graph;
        let queries = |node: Node| matches!(node, Node::Diff { .. } | Node::Bound { .. });
        let has = graph.outputs.iter().any(|o| graph.scalar(o.node) == Scalar::Real);
        if has && !graph.iter().any(|(_, node)| queries(node)) {
            all.push((function.name.clone(), graph));
        }
    }
    all
}

/// Judges all exports of programs by up to three of their real inputs.
fn programs(sources: Vec<(String, String)>, points: usize) -> (usize, Count) {
    let (mut judged, mut all) = (0, Count::default());
    for (n, (name, source)) in (0..).zip(sources) {
        for (export, graph) in exports(&source) {
            let reals = graph.inputs.iter().enumerate().filter(|(_, input)| input.scalar == Scalar::Real);
            let by: Vec<usize> = reals.map(|(i, _)| i).take(3).collect();
            if by.is_empty() {
                continue;
            }
            let mut random = Random::new(n);
            let mut value = |scalar: Scalar| match scalar {
                Scalar::Int => Value::Int(random.int(1, 4)),
                scalar => random.value_within(scalar, (-1.75, 2.0)),
            };
            let points: Vec<Vec<Value>> =
                (0..points).map(|_| graph.inputs.iter().map(|input| value(input.scalar)).collect()).collect();
            let count = laws::higher_derivatives(&graph, &by, mixture(n), &points, n);
            let count = count.unwrap_or_else(|failure| panic!("{name}, {export}: {failure}"));
            judged += usize::from(count.judged > 0);
            all += count;
        }
    }
    (judged, all)
}

#[test]
fn third_derivatives_of_the_standard_library_are_hyper_dual_numbers() {
    let specimens = corpus::folder("testkit/tests/stdlib");
    let named = specimens.into_iter().map(|(path, text)| (path.to_string_lossy().into_owned(), text)).collect();
    let (judged, all) = programs(named, 8);
    println!("higher_derivatives of the standard library: {judged} exports, {all:?}");
    assert!(judged > 100);
    holds(all.at_least(80, "higher_derivatives", "the standard library"));
}

#[test]
fn third_derivatives_of_the_examples_are_hyper_dual_numbers() {
    let named = |(path, text): (std::path::PathBuf, String)| (path.to_string_lossy().into_owned(), text);
    let (judged, all) = programs(corpus::folder("examples").into_iter().map(named).collect(), 20);
    println!("higher_derivatives of the examples: {judged} exports, {all:?}");
    assert!(judged >= 6);
}
