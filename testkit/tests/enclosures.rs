//! The short form of the soundness run, and the laws of enclosures over the table of operations and over random graphs.
//! The long form: `cargo run --release --bin soundness -- --samples 100000000`; `ISOGRAD_GRAPHS=20` takes twenty times
//! as many random graphs as usual.

#![allow(clippy::pedantic, reason = "tests")]

use isograd_graph::{Builder, Graph, Mode, NodeId, Op, Precision, Scalar, Unwatched, parse, print};
use isograd_testkit::laws::enclosed_graph::{enclosed_graph, exact_values_enclosed, interpreter_agrees};
use isograd_testkit::laws::enclosure::tightness;
use isograd_testkit::laws::{Count, Judgement};
use isograd_testkit::points::Random;
use isograd_testkit::random::{self, Shape};
use isograd_testkit::soundness::{Plan, run};

fn holds(judgement: Judgement) -> Count {
    judgement.unwrap_or_else(|failure| panic!("{failure}"))
}

fn seeds(from: u64, n: u64) -> std::ops::Range<u64> {
    let times = std::env::var("ISOGRAD_GRAPHS").ok().and_then(|x| x.parse().ok()).unwrap_or(1);
    from..from + n * times
}

#[test]
fn nothing_escapes() {
    let report = run(Plan { samples: 1_000_000, seed: 4, threads: 2 }).unwrap();
    println!("{report}");
    assert!(report.is_sound(), "{}", report.failures.join("\n"));
    let [operations, shapes] = report.totals();
    assert!(operations.samples > 700_000 && shapes.samples > 200_000);
    assert_eq!(report.rows.iter().filter(|row| !row.is_shape).count(), Op::ALL.len());
    assert!(report.rows.iter().filter(|row| row.is_shape).count() > 80);
    // What is open, or has no width, proves nothing.
    assert!(shapes.open * 1000 < shapes.samples && operations.tightness().unwrap() < 3.0);
}

#[test]
fn no_end_is_further_out_than_it_may_be() {
    let mut all = Count::default();
    for op in Op::ALL {
        all += holds(tightness(*op, op.def(), 600, 3));
    }
    println!("tightness: {all:?}");
    holds(all.at_least(50, "tightness", "all operations"));
}

/// A random graph of what programs are made of: directed operations and those on bits stand only in what the compiler
/// makes of it, and have others in their place here.
fn program(seed: u64, shape: &Shape) -> Graph {
    let mut b = Builder::new(Mode::Raw, 100_000, &Unwatched);
    let mut reals = random::grow(&mut b, seed, shape).reals;
    let mut random = Random::new(seed);
    // Branches that a box leaves undecided, and what loops make of their results.
    for k in 0..3 {
        let mut any = || reals[random.below(reals.len()).min(random.below(reals.len()))];
        let (x, y, u, v) = (any(), any(), any(), any());
        let cond = b.lt(x, y);
        b.gamma(cond);
        let then = b.min(x, u);
        b.otherwise();
        let otherwise = b.sub(v, y);
        let end = b.end();
        let join = b.join(end, then, otherwise);
        let (zero, two) = (b.int(0), b.int(2));
        b.theta(zero, two);
        let carried = b.carried(join);
        let next = b.max(carried, x);
        let next = b.sub(u, next);
        let end = b.end();
        let last = b.carry_out(end, carried, next);
        b.output(format!("join{k}"), join);
        b.output(format!("last{k}"), last);
        reals.push(join);
    }
    let text = print(&b.finish().expect("small"));
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let plain = |name: &str| line.replacen(words[2], name, 1);
        lines.push(match (words.get(2).copied().unwrap_or(""), &words[..]) {
            ("add_down" | "add_up", _) => plain("add"),
            ("mul_down" | "mul_up", _) => plain("mul"),
            ("div_down" | "div_up", _) => plain("div"),
            ("sqrt_down" | "sqrt_up", _) => plain("sqrt"),
            ("next_down" | "next_up" | "rounded", _) => plain("abs"),
            ("exponent", _) => plain("real_to_int"),
            ("scale", &[id, equals, _, x, _]) => format!("{id} {equals} floor {x}"),
            ("above" | "below" | "raised" | "lowered", &[id, equals, _, x, c]) => {
                format!("{id} {equals} select {c} {x} {x}")
            }
            ("product_below" | "wide_product_below" | "wide_product_above", &[id, equals, _, x, y, _]) => {
                format!("{id} {equals} lt {x} {y}")
            }
            _ => line.to_owned(),
        });
    }
    parse(&lines.join("\n")).unwrap()
}

#[test]
fn values_and_gradients_of_random_graphs_are_enclosed() {
    let mut all = Count::default();
    for seed in seeds(0, 120) {
        let shape = Shape { size: 18, depth: 2, transcendental: seed % 2 == 0, tame: seed % 3 != 0 };
        all += holds(enclosed_graph(&program(seed, &shape), 12, seed));
    }
    println!("enclosed_graph: {all:?}");
    holds(all.at_least(70, "enclosed_graph", "random graphs"));
}

#[test]
fn the_interpreter_finds_what_the_expanded_graph_computes() {
    let mut all = Count::default();
    for seed in seeds(500, 120) {
        let shape = Shape { size: 25, depth: 2, transcendental: seed % 2 == 0, tame: seed % 3 != 0 };
        let graph = program(seed, &shape);
        for precision in [Precision::F32, Precision::F64] {
            all += holds(interpreter_agrees(&graph, precision, 12, seed));
        }
    }
    println!("interpreter_agrees: {all:?}");
    assert!(all.judged > 2000);
    holds(all.at_least(60, "interpreter_agrees", "random graphs"));
}

/// Random compositions of `+ − × ÷ √` against arbitrary precision.
#[test]
fn exact_values_are_enclosed() {
    let mut all = Count::default();
    for seed in seeds(0, 150) {
        let mut random = Random::new(seed);
        let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
        let mut values: Vec<NodeId> = (0..3).map(|i| b.input(format!("x{i}"), Scalar::Real)).collect();
        for x in [0.1, 3.0, -1.0 / 3.0] {
            values.push(b.real(x));
        }
        for _ in 0..12 {
            let mut any = || values[random.below(values.len()).max(random.below(values.len()))];
            let (x, y) = (any(), any());
            let op = random.pick(&[Op::Add, Op::Sub, Op::Mul, Op::Div, Op::Sqrt, Op::Mul, Op::Add]);
            values.push(if op == Op::Sqrt { b.op(op, &[x]) } else { b.op(op, &[x, y]) });
        }
        for (k, value) in values.iter().rev().take(4).enumerate() {
            b.output(format!("y{k}"), *value);
        }
        let graph = b.finish().unwrap();
        for precision in [Precision::F32, Precision::F64] {
            all += holds(exact_values_enclosed(&graph, precision, 6, seed));
        }
    }
    println!("exact_values_enclosed: {all:?}");
    holds(all.at_least(30, "exact_values_enclosed", "random compositions"));
}
