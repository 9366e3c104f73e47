//! The laws over the whole table of operations and over random graphs. `ISOGRAD_GRAPHS=20` takes twenty times as many
//! random graphs as usual. The long form, in which forward sweep, reverse sweep and reference agree on 10,200 random
//! graphs, and third derivatives in any mixture of sweeps on 10,080:
//!
//! ```sh
//! ISOGRAD_GRAPHS=34 cargo test --release --test laws dual_numbers -- --nocapture
//! ISOGRAD_GRAPHS=63 cargo test --release --test oracles random_graphs -- --nocapture
//! ```

#![allow(clippy::pedantic, reason = "tests")]

use isograd_graph::{Builder, Mode, Op, Precision, Scalar, Unwatched, Value};
use isograd_testkit::laws::{self, Count};
use isograd_testkit::points::{Random, operands, surprises};
use isograd_testkit::random::{self, INPUTS, Shape};
use isograd_transform::Sweep;

const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

const SWEEPS: [Sweep; 2] = [Sweep::Forward, Sweep::Reverse];

/// `n` seeds of random graphs, more in the long form.
fn seeds(from: u64, n: u64) -> std::ops::Range<u64> {
    let times = std::env::var("ISOGRAD_GRAPHS").ok().and_then(|x| x.parse().ok()).unwrap_or(1);
    from..from + n * times
}

fn holds(judgement: laws::Judgement) -> Count {
    judgement.unwrap_or_else(|failure| panic!("{failure}"))
}

#[test]
fn every_rule_is_its_derivative() {
    let mut all = Count::default();
    let mut judged = 0;
    for (k, op) in Op::ALL.iter().enumerate() {
        let count = holds(laws::derivative(*op, op.def(), 300, k as u64));
        judged += usize::from(count.judged > 0);
        all += count;
    }
    println!("derivative: {judged} operations, {all:?}");
    assert!(judged >= 30);
}

#[test]
fn every_operation_keeps_the_conventions_through_the_pipeline() {
    let mut all = Count::default();
    for op in Op::ALL {
        for sweep in SWEEPS {
            all += holds(laws::at_kinks(*op, 5, sweep));
        }
    }
    println!("at_kinks: {all:?}");
    assert!(all.judged > 300);
}

#[test]
fn every_kink_is_where_the_table_says() {
    let mut all = Count::default();
    for op in Op::ALL {
        all += holds(laws::kink(*op, op.def(), 40, 9));
    }
    println!("kink: {all:?}");
    assert!(all.judged > 2000);
}

#[test]
fn every_operation_is_the_same_in_webassembly() {
    let mut all = Count::default();
    for precision in PRECISIONS {
        for op in Op::ALL {
            let graph = laws::kernels_of(*op, precision).unwrap();
            let points = operands(*op, precision);
            all += holds(laws::wasm_equals_reference(&graph, &points));
            holds(laws::neighbours(&graph, &points[..points.len().min(60)], 3));
        }
    }
    println!("wasm_equals_reference: {all:?}");
}

fn graph_points(precision: Precision, n: usize, seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random::new(seed);
    let mut rows = surprises(&INPUTS, precision, n / 2, seed);
    rows.extend((0..n - n / 2).map(|_| {
        let value = |s: &Scalar| match random.value_within(*s, (-2.0, 3.0)) {
            Value::Real(x) => Value::Real(precision.round(x)),
            other => other,
        };
        INPUTS.iter().map(value).collect()
    }));
    rows
}

#[test]
fn random_graphs_are_the_same_in_webassembly_and_optimised() {
    let (mut wasm, mut optimised) = (Count::default(), Count::default());
    for seed in seeds(0, 300) {
        let shape = Shape { size: 25, depth: 3, transcendental: seed % 3 == 0, tame: seed % 2 == 0 };
        let graph = random::graph(seed, &shape);
        for precision in PRECISIONS {
            let points = graph_points(precision, 40, seed);
            optimised += holds(laws::optimised_equals_plain(&graph, precision, &points));
            let ready = laws::finished(&graph, precision, isograd_graph::ops::Family::Lanes, seed % 2 == 0)
                .unwrap_or_else(|e| panic!("{e}"));
            wasm += holds(laws::wasm_equals_reference(&ready, &points));
            if seed % 4 == 0 {
                holds(laws::neighbours(&ready, &points, seed));
            }
        }
    }
    println!("random graphs: wasm {wasm:?}, optimised {optimised:?}");
}

/// Graphs as programs have them: with derivatives, which share much with the values.
#[test]
fn derivatives_of_random_graphs_are_the_same_in_webassembly_and_optimised() {
    let (mut wasm, mut optimised) = (Count::default(), Count::default());
    for seed in seeds(1000, 40) {
        let shape = Shape { size: 15, depth: 2, transcendental: seed % 4 == 0, tame: seed % 3 != 0 };
        let sweep = SWEEPS[usize::from(seed % 2 == 0)];
        let graph = laws::expanded_derivatives(&random::graph(seed, &shape), sweep).unwrap_or_else(|e| panic!("{e}"));
        for precision in PRECISIONS {
            let points = graph_points(precision, 30, seed);
            optimised += holds(laws::optimised_equals_plain(&graph, precision, &points));
            let ready = laws::finished(&graph, precision, isograd_graph::ops::Family::Lanes, true)
                .unwrap_or_else(|e| panic!("{e}"));
            wasm += holds(laws::wasm_equals_reference(&ready, &points));
        }
    }
    println!("derivatives of random graphs: wasm {wasm:?}, optimised {optimised:?}");
}

/// In f64, where constants are not rounded, and without kernels, no step of the pipeline changes a bit.
#[test]
fn no_step_changes_a_bit() {
    let mut all = Count::default();
    for seed in seeds(2000, 300) {
        let shape = Shape { size: 40, depth: 3, transcendental: false, tame: seed % 2 == 0 };
        let graph = random::graph(seed, &shape);
        all += holds(laws::finished_equals_raw(&graph, &graph_points(Precision::F64, 20, seed)));
    }
    println!("finished_equals_raw: {all:?}");
}

fn tame_points(n: usize, seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random::new(seed);
    (0..n).map(|_| INPUTS.iter().map(|s| random.value_within(*s, (-2.0, 3.0))).collect()).collect()
}

#[test]
fn derivatives_of_random_graphs_are_dual_numbers() {
    let mut all = Count::default();
    for seed in seeds(0, 300) {
        let shape = Shape { size: 25, depth: 3, transcendental: seed % 2 == 0, tame: true };
        let graph = random::graph(seed, &shape);
        let points = tame_points(6, seed);
        for sweep in SWEEPS {
            all += holds(laws::pipeline_derivative(&graph, &points, sweep));
        }
        if seed % 5 == 0 {
            all += holds(laws::oracles_agree(&graph, &points[..2]));
        }
    }
    println!("pipeline_derivative: {all:?}");
    holds(all.at_least(50, "pipeline_derivative", "random graphs"));
}

#[test]
fn derivatives_by_values_on_the_way_are_dual_numbers() {
    let mut all = Count::default();
    for seed in seeds(0, 300) {
        let shape = Shape { size: 30, depth: 2, transcendental: seed % 2 == 0, tame: true };
        for sweep in SWEEPS {
            all += holds(laws::derivative_by_values(seed, &shape, &tame_points(6, seed), sweep));
        }
    }
    println!("derivative_by_values: {all:?}");
    holds(all.at_least(50, "derivative_by_values", "random graphs"));
}

/// Constants that `fold` rounds where they enter a loop and where an iteration gives them to a variable: the first must
/// lie before the loop, the second stands after it.
#[test]
fn rounded_constants_of_loops() {
    let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
    let trips = b.input("n", Scalar::Int);
    let (zero, tenth, third) = (b.int(0), b.real(0.1), b.real(1.0 / 3.0));
    b.theta(zero, trips);
    let (x, y) = (b.carried(tenth), b.carried(tenth));
    let sum = b.add(x, y);
    let end = b.end();
    let (x, y) = (b.carry_out(end, x, sum), b.carry_out(end, y, third));
    b.output("x", x);
    b.output("y", y);
    let graph = b.finish().unwrap();
    let points: Vec<_> = (0..4).map(|n| vec![Value::Int(n)]).collect();
    for precision in PRECISIONS {
        holds(laws::optimised_equals_plain(&graph, precision, &points));
        let ready = laws::finished(&graph, precision, isograd_graph::ops::Family::Lanes, false)
            .unwrap_or_else(|e| panic!("{e}"));
        holds(laws::wasm_equals_reference(&ready, &points));
        let got = isograd_graph::evaluate(&ready, precision, &points[2]).unwrap();
        let (tenth, third) = (precision.round(0.1), precision.round(1.0 / 3.0));
        let want = precision.round(precision.round(tenth + tenth) + third);
        assert_eq!(got, [Value::Real(want), Value::Real(third)], "{precision:?}");
    }
}
