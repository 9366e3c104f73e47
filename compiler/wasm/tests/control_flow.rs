//! Branches and loops in lanes: chosen ones, and random graphs with everything nested.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use isograd_graph::ops::Family;
use isograd_graph::{Op, Precision, Scalar, Unready, Value, Verified};
use isograd_wasm::{EmitError, Options, Plan, Split, Vectors, emit};
use support::{KINDS, PRECISIONS, Random, Running, Soil, compare, graph, random, wide};

fn real(x: f64) -> Value {
    Value::Real(x)
}

/// a, b = b, a + b for n iterations, n different in each lane.
fn fibonacci(precision: Precision) -> Verified {
    graph(precision, |b| {
        let (from, to) = (b.input("from", Scalar::Int), b.input("to", Scalar::Int));
        let (zero, one) = (b.int(0), b.int(1));
        b.theta(from, to);
        let counter = b.counter();
        let x = b.carried(zero);
        let y = b.carried(one);
        let last = b.carried(zero);
        let sum = b.iadd(x, y);
        let end = b.end();
        for (name, (carried, next)) in [("x", (x, y)), ("y", (y, sum)), ("last", (last, counter))] {
            let result = b.carry_out(end, carried, next);
            b.output(name, result);
        }
    })
}

#[test]
fn loops_swap_and_lanes_leave_one_by_one() {
    let mut random = Random(2);
    let points: Vec<_> = (0..200)
        .map(|_| {
            let from = random.below(9) as i32 - 4;
            vec![Value::Int(from), Value::Int(random.below(40) as i32 - 6)]
        })
        .collect();
    for precision in PRECISIONS {
        let verified = fibonacci(precision);
        for varying in [[true, true], [false, true], [true, false], [false, false]] {
            compare(&verified, &varying, &points);
        }
    }
}

/// A lane near the largest int leaves at once; its counter must not come around while its neighbour goes on.
#[test]
fn a_lane_that_is_done_stays_done() {
    let verified = fibonacci(Precision::F32);
    let points = vec![
        vec![Value::Int(i32::MAX - 1), Value::Int(i32::MAX)],
        vec![Value::Int(i32::MIN), Value::Int(i32::MIN + 500)],
        vec![Value::Int(5), Value::Int(5)],
        vec![Value::Int(i32::MAX), Value::Int(i32::MIN)],
    ];
    compare(&verified, &[true, true], &points);
}

#[test]
fn branches_nest_and_loops_stand_in_branches() {
    let mut random = Random(3);
    let points: Vec<_> = (0..150)
        .map(|_| {
            vec![real(random.unit() * 4.0 - 2.0), real(random.unit() * 4.0 - 2.0), Value::Int(random.below(7) as i32)]
        })
        .collect();
    for precision in PRECISIONS {
        let verified = graph(precision, |b| {
            let (x, y, n) = (b.input("x", Scalar::Real), b.input("y", Scalar::Real), b.input("n", Scalar::Int));
            let zero = b.real(0.0);
            let none = b.int(0);
            let outer = b.lt(x, zero);
            b.gamma(outer);
            let inner = b.lt(y, zero);
            b.gamma(inner);
            let product = b.mul(x, y);
            b.otherwise();
            b.theta(none, n);
            let sum = b.carried(y);
            let more = b.add(sum, x);
            let end = b.end();
            let total = b.carry_out(end, sum, more);
            let end = b.end();
            let first = b.join(end, product, total);
            let second = b.join(end, y, x);
            b.otherwise();
            let quotient = b.div(x, y);
            let end = b.end();
            let late = b.sqrt(y);
            let chosen = b.join(end, first, quotient);
            let other = b.join(end, second, zero);
            let after = b.join(end, late, quotient);
            for (name, node) in [("a", chosen), ("b", other), ("c", after)] {
                b.output(name, node);
            }
        });
        for bits in 0..8 {
            compare(&verified, &[bits & 1 > 0, bits & 2 > 0, bits & 4 > 0], &points);
        }
    }
}

/// Everything uniform is computed once: the loop over the points only stores.
#[test]
fn uniform_work_is_done_once() {
    let verified = graph(Precision::F32, |b| {
        let (x, n) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int));
        let zero = b.int(0);
        b.theta(zero, n);
        let power = b.carried(x);
        let square = b.mul(power, power);
        let end = b.end();
        let result = b.carry_out(end, power, square);
        b.output("y", result);
    });
    compare(&verified, &[false, false], &[vec![real(1.01), Value::Int(6)], vec![real(9.0), Value::Int(0)]]);
    let options = Options {
        precision: Precision::F32,
        varying: &[false, false],
        vectors: Some(Vectors::One),
        split: Split::default(),
    };
    let module = emit(&verified, &options, b"").expect("emits");
    // 4,096 points at 2^25 iterations each would take minutes.
    let mut running = Running::new(&module, wasmtime::OptLevel::None);
    let points = vec![vec![real(1.0), Value::Int(1 << 25)]; 4096];
    assert_eq!(running.run(&points), vec![vec![real(1.0)]; 4096]);
    assert!(module.work.long_loop);
}

/// Random graphs: regions to depth 3, all kinds, tapes.
fn random_graph(seed: u64, precision: Precision) -> Verified {
    random(seed, precision, &Soil::to_evaluate(Family::Lanes), 14)
}

#[test]
fn random_graphs_agree_with_the_reference() {
    let kinds: Vec<Scalar> = KINDS.into_iter().chain(KINDS).collect();
    for seed in 0..150 {
        let mut random = Random(seed ^ 0x5555);
        let points: Vec<Vec<Value>> = (0..40).map(|_| kinds.iter().map(|s| random.value(*s)).collect()).collect();
        let varying: Vec<bool> = kinds.iter().map(|_| random.below(3) > 0).collect();
        for precision in PRECISIONS {
            let verified = random_graph(seed, precision);
            compare(&verified, &varying, &points);
        }
    }
}

#[test]
fn the_same_graph_gives_the_same_bytes() {
    for seed in 0..20 {
        let emitted = || {
            let verified = random_graph(seed, Precision::F32);
            emit(
                &verified,
                &Options { precision: Precision::F32, varying: &[true; 6], vectors: None, split: Split::default() },
                b"m",
            )
            .expect("emits")
        };
        assert_eq!(emitted(), emitted());
    }
}

#[test]
fn code_grows_linearly_with_the_graph() {
    let chain = |n: usize| {
        graph(Precision::F32, |b| {
            let x = b.input("x", Scalar::Real);
            let mut y = x;
            for k in 0..n {
                let c = b.real(k as f64);
                y = b.add(y, c);
                y = b.mul(y, x);
            }
            b.output("y", y);
        })
    };
    let size = |verified: &Verified| {
        let module = emit(
            verified,
            &Options { precision: Precision::F32, varying: &[true], vectors: None, split: Split::default() },
            b"",
        );
        let module = module.expect("emits");
        assert_eq!(module.work.operations, verified.operations());
        module.bytes.len()
    };
    let (small, large) = (size(&chain(10_000)), size(&chain(100_000)));
    assert!(large < small * 11, "{small} bytes for 20,000 operations, {large} for 200,000");
}

#[test]
fn pressure_decides_the_vectors() {
    let wide = |n| wide(Precision::F32, n);
    // Long, with few values alive.
    let chain = graph(Precision::F32, |b| {
        let x = b.input("x", Scalar::Real);
        let mut y = x;
        for k in 0..300 {
            let c = b.real(k as f64 + 0.5);
            y = b.div(y, c);
        }
        b.output("y", y);
    });
    let cases = [(wide(3), Vectors::Two), (wide(20), Vectors::Two), (wide(80), Vectors::One), (chain, Vectors::Four)];
    for (verified, want) in cases {
        let plan = Plan::new(
            &verified,
            &Options { precision: Precision::F32, varying: &[true], vectors: None, split: Split::default() },
        );
        let plan = plan.expect("plans");
        assert_eq!(plan.vectors(), want);
        assert_eq!(plan.layout().pad, 4 * want as u32);
        assert_eq!(plan.layout().block % plan.layout().pad, 0);
    }
}

#[test]
fn graphs_that_are_not_ready_are_refused() {
    let verified = graph(Precision::F32, |b| {
        let x = b.input("x", Scalar::Real);
        let y = b.sin(x);
        b.output("y", y);
    });
    let refused = |precision, varying: &[bool]| {
        Plan::new(&verified, &Options { precision, varying, vectors: None, split: Split::default() })
            .map(|_| ())
            .expect_err("is refused")
    };
    assert_eq!(refused(Precision::F32, &[true]), EmitError::Unready(Unready::NoInstructions(Op::Sin)));
    assert!(matches!(refused(Precision::F64, &[true]), EmitError::Options { .. }));
    assert!(matches!(refused(Precision::F32, &[]), EmitError::Options { .. }));
}

#[test]
fn constants_and_inputs_can_be_outputs() {
    for precision in PRECISIONS {
        let verified = graph(precision, |b| {
            let (x, n, t) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int), b.input("t", Scalar::Bool));
            let nan = b.real(f64::NAN);
            let (seven, truth) = (b.int(7), b.bool(true));
            for (k, node) in [x, n, t, nan, seven, truth].into_iter().enumerate() {
                b.output(format!("y{k}"), node);
            }
        });
        let points: Vec<_> = [1.5, f64::NAN, -0.0]
            .iter()
            .enumerate()
            .map(|(k, x)| vec![real(*x), Value::Int(k as i32 - 1), Value::Bool(k % 2 == 0)])
            .collect();
        compare(&verified, &[true; 3], &points);
        compare(&verified, &[false; 3], &points);
    }
}
