//! Enclosures of hand-made graphs: the rules of LANGUAGE 15 that need no source text.

#[path = "../support/mod.rs"]
mod support;

use isograd_graph::{
    Builder, Graph, Mode, NodeId, Op, Origin, Part, Precision, Scalar, Unwatched, Value, evaluate, parse, print, verify,
};
use isograd_transform::{DifferentiateError, Hull, Loops, Sweep, differentiate, enclosures, fold, optimise, schedule};
use support::lane_kernels;

mod interpreter;
mod random;

const MANY: usize = 1_000_000;
const P: Precision = Precision::F64;

fn build(inputs: &[&str], make: impl FnOnce(&mut Builder<'_>, &[NodeId]) -> Vec<NodeId>) -> Graph {
    let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
    let inputs: Vec<_> = inputs.iter().map(|n| b.input(*n, Scalar::Real)).collect();
    for (i, node) in make(&mut b, &inputs).into_iter().enumerate() {
        b.output(format!("out{i}"), node);
    }
    b.finish().unwrap()
}

/// The parts of an enclosure of a value over a box of `(wrt, lo, hi)`.
fn parts(b: &mut Builder<'_>, value: NodeId, components: &[(NodeId, NodeId, NodeId)]) -> Vec<NodeId> {
    let no = b.bool(false);
    let components: Vec<_> = components.iter().map(|(wrt, lo, hi)| (*wrt, *lo, *hi, no)).collect();
    let within = b.within(&components);
    Part::ALL.iter().map(|part| b.bound(value, within, *part)).collect()
}

/// Over constant ends.
fn over(b: &mut Builder<'_>, value: NodeId, wrt: NodeId, ends: [f64; 2]) -> Vec<NodeId> {
    let (lo, hi) = (b.real(ends[0]), b.real(ends[1]));
    parts(b, value, &[(wrt, lo, hi)])
}

/// Numbers; a truth value is 1 or 0.
fn run(graph: &Graph, inputs: &[f64]) -> Vec<f64> {
    let inputs: Vec<_> = inputs.iter().map(|x| Value::Real(*x)).collect();
    let outputs = evaluate(graph, P, &inputs).unwrap();
    outputs
        .into_iter()
        .map(|v| match v {
            Value::Real(x) => x,
            Value::Int(x) => f64::from(x),
            Value::Bool(x) => f64::from(u8::from(x)),
        })
        .collect()
}

fn expanded(graph: &Graph, sweep: Sweep) -> Graph {
    let graph = verify(graph.clone()).unwrap().into_inner();
    let graph = differentiate(graph, sweep, isograd_graph::Precision::F32, 6, MANY, &Unwatched).unwrap();
    verify(graph).unwrap().into_inner()
}

fn finished(graph: &Graph) -> Graph {
    let mut graph = verify(fold(graph, P, MANY, &Unwatched).unwrap()).unwrap().into_inner();
    for step in [lane_kernels, optimise, schedule] {
        graph = verify(step(&graph, P, MANY, &Unwatched).unwrap()).unwrap().into_inner();
    }
    graph
}

/// Both sweeps give these numbers, and no later step changes them.
fn check(graph: &Graph, cases: &[(&[f64], &[f64])]) {
    for sweep in [Sweep::Forward, Sweep::Reverse] {
        let expanded = expanded(graph, sweep);
        let finished = finished(&expanded);
        for (inputs, want) in cases {
            assert_eq!(run(&expanded, inputs), *want, "{sweep:?} at {inputs:?}\n{}", print(&expanded));
            assert_eq!(run(&finished, inputs), *want, "{sweep:?}, finished, at {inputs:?}\n{}", print(&finished));
        }
    }
}

#[test]
fn the_value_at_run_time_does_not_matter() {
    // Rows 73 and 74: bound(x·2, x, [-1..2]) is [-2..4]; bound(x·x, …) is [0..4].
    let graph = build(&["x"], |b, i| {
        let two = b.real(2.0);
        let double = b.mul(i[0], two);
        let square = b.mul(i[0], i[0]);
        let mut out = over(b, double, i[0], [-1.0, 2.0]);
        out.extend(over(b, square, i[0], [-1.0, 2.0]));
        out
    });
    check(&graph, &[(&[9.0], &[-2.0, 4.0, 0.0, 0.0, 4.0, 0.0]), (&[f64::NAN], &[-2.0, 4.0, 0.0, 0.0, 4.0, 0.0])]);
}

#[test]
fn the_variable_itself_and_a_value_that_does_not_depend_on_it() {
    let graph = build(&["x", "y"], |b, i| {
        let mut out = over(b, i[0], i[0], [2.0, -1.0]);
        out.extend(over(b, i[1], i[0], [-1.0, 2.0]));
        let constant = b.real(3.0);
        out.extend(over(b, constant, i[0], [-1.0, 2.0]));
        // An unnamed constant is no variable.
        out.extend(over(b, constant, constant, [-1.0, 2.0]));
        out
    });
    let infinite = f64::INFINITY;
    let (own, three) = ([-1.0, 2.0, 0.0], [3.0, 3.0, 0.0]);
    check(
        &graph,
        &[
            (&[9.0, 5.0], &[own, [5.0, 5.0, 0.0], three, three].concat()),
            (&[9.0, f64::NAN], &[own, [-infinite, infinite, 1.0], three, three].concat()),
        ],
    );
}

#[test]
fn a_name_of_a_value_is_the_value_unless_the_box_replaces_the_name() {
    let graph = build(&["x"], |b, i| {
        let name = b.fresh(i[0]);
        let square = b.mul(name, i[0]);
        let mut out = over(b, square, i[0], [-1.0, 2.0]);
        // Only one factor ranges.
        out.extend(over(b, square, name, [-1.0, 2.0]));
        out
    });
    check(&graph, &[(&[3.0], &[0.0, 4.0, 0.0, -3.0, 6.0, 0.0])]);
}

#[test]
fn a_box_may_be_computed_after_the_value() {
    let graph = build(&["x", "r"], |b, i| {
        let square = b.mul(i[0], i[0]);
        let (lo, hi) = (b.sub(i[0], i[1]), b.add(i[0], i[1]));
        parts(b, square, &[(i[0], lo, hi)])
    });
    check(
        &graph,
        &[(&[3.0, 1.0], &[4.0, 16.0, 0.0]), (&[1.0, 2.0], &[0.0, 9.0, 0.0]), (&[1.0, -2.0], &[0.0, 9.0, 0.0])],
    );
}

#[test]
fn values_computed_after_the_first_bound_over_the_same_box() {
    let graph = build(&["x"], |b, i| {
        let one = b.real(1.0);
        let square = b.mul(i[0], i[0]);
        let first = over(b, square, i[0], [-1.0, 2.0]);
        let more = b.add(square, one);
        let shifted = b.add(more, first[1]);
        let mut out = over(b, shifted, i[0], [-1.0, 2.0]);
        out.extend(first);
        out
    });
    check(&graph, &[(&[7.0], &[5.0, 9.0, 0.0, 0.0, 4.0, 0.0])]);
}

/// if x < 0 { -x } else { 2x }, over a box with ends `a` and `b`.
fn kinked() -> Graph {
    build(&["x", "a", "b"], |b, i| {
        let (zero, two) = (b.real(0.0), b.real(2.0));
        let negative = b.lt(i[0], zero);
        b.gamma(negative);
        let minus = b.neg(i[0]);
        b.otherwise();
        let double = b.mul(i[0], two);
        let end = b.end();
        let y = b.join(end, minus, double);
        parts(b, y, &[(i[0], i[1], i[2])])
    })
}

#[test]
fn branches_decided_and_not() {
    // Rows 77 and 78.
    check(
        &kinked(),
        &[
            (&[5.0, -1.0, 2.0], &[-2.0, 4.0, 0.0]),
            (&[-5.0, 1.0, 2.0], &[2.0, 4.0, 0.0]),
            (&[5.0, -3.0, -2.0], &[2.0, 3.0, 0.0]),
        ],
    );
}

#[test]
fn a_branch_on_a_value_of_the_run_takes_one_side() {
    let graph = build(&["x", "y"], |b, i| {
        let (zero, three) = (b.real(0.0), b.real(3.0));
        let negative = b.lt(i[1], zero);
        b.gamma(negative);
        // A value of the run, computed in the side: 3y.
        let slope = b.mul(i[1], three);
        let then = b.mul(i[0], slope);
        b.otherwise();
        let end = b.end();
        let y = b.join(end, then, i[0]);
        over(b, y, i[0], [1.0, 2.0])
    });
    check(&graph, &[(&[0.0, -1.0], &[-6.0, -3.0, 0.0]), (&[0.0, 1.0], &[1.0, 2.0, 0.0])]);
}

#[test]
fn ints_and_bools_of_branches_are_joined() {
    // n = if x < 0 { 1 } else { 3 }; p = if x < 0 { true } else { false }; real(n)·x, and p as another condition.
    let graph = build(&["x", "a", "b"], |b, i| {
        let (zero, one, three) = (b.real(0.0), b.int(1), b.int(3));
        let (yes, no) = (b.bool(true), b.bool(false));
        let negative = b.lt(i[0], zero);
        b.gamma(negative);
        b.otherwise();
        let end = b.end();
        let n = b.join(end, one, three);
        let p = b.join(end, yes, no);
        let count = b.int_to_real(n);
        let ten = b.real(10.0);
        b.gamma(p);
        b.otherwise();
        let end = b.end();
        let q = b.join(end, ten, count);
        let mut out = parts(b, count, &[(i[0], i[1], i[2])]);
        out.extend(parts(b, q, &[(i[0], i[1], i[2])]));
        out
    });
    check(
        &graph,
        &[
            (&[9.0, -1.0, 1.0], &[1.0, 3.0, 0.0, 1.0, 10.0, 0.0]),
            (&[9.0, 0.5, 1.0], &[3.0, 3.0, 0.0, 3.0, 3.0, 0.0]),
            (&[9.0, -2.0, -1.0], &[1.0, 1.0, 0.0, 10.0, 10.0, 0.0]),
        ],
    );
}

/// y = x; n times: y = y·x + k, where k (of the run) doubles from `k` and the counter counts.
fn looping(n: Option<i32>) -> Graph {
    build(&["x", "k", "n"], |b, i| {
        let (lo, two) = (b.int(0), b.real(2.0));
        let hi = match n {
            Some(n) => b.int(n),
            None => b.op(Op::RealToInt, &[i[2]]),
        };
        b.theta(lo, hi);
        let y = b.carried(i[0]);
        let k = b.carried(i[1]);
        let product = b.mul(y, i[0]);
        let counter = b.counter();
        let count = b.int_to_real(counter);
        let more = b.add(k, count);
        let sum = b.add(product, more);
        let double = b.mul(k, two);
        let end = b.end();
        let y = b.carry_out(end, y, sum);
        b.carry_out(end, k, double);
        over(b, y, i[0], [1.0, 2.0])
    })
}

#[test]
fn loops_run_with_enclosures() {
    // x² + 1, then x³ + x + 2 + 1, over [1..2].
    check(&looping(Some(2)), &[(&[9.0, 1.0, 0.0], &[5.0, 13.0, 0.0])]);
    check(
        &looping(None),
        &[
            (&[9.0, 1.0, 2.0], &[5.0, 13.0, 0.0]),
            (&[9.0, 1.0, 0.0], &[1.0, 2.0, 0.0]),
            (&[9.0, 1.0, -1.0], &[1.0, 2.0, 0.0]),
        ],
    );
    let size = |n| finished(&expanded(&looping(Some(n)), Sweep::Forward)).len();
    assert_eq!(size(10), size(10_000));
}

#[test]
fn a_number_of_iterations_must_not_depend_on_the_box() {
    let graph = build(&["x"], |b, i| {
        let (lo, one) = (b.int(0), b.real(1.0));
        b.set_origin(Origin(3));
        let hi = b.op(Op::RealToInt, &[i[0]]);
        b.set_origin(Origin(4));
        b.theta(lo, hi);
        let y = b.carried(one);
        let sum = b.add(y, one);
        let end = b.end();
        let y = b.carry_out(end, y, sum);
        b.set_origin(Origin(5));
        over(b, y, i[0], [1.0, 2.0])
    });
    let why = DifferentiateError::LoopBound { call: Origin(5), bound: Origin(3) };
    assert_eq!(differentiate(graph, Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched), Err(why));
}

#[test]
fn a_box_that_depends_on_the_counter() {
    // s = Σ upper(bound(x·x, x, [0..i])) for i in 0..4 = 0 + 1 + 4 + 9
    let graph = build(&["x"], |b, i| {
        let (lo, hi, zero) = (b.int(0), b.int(4), b.real(0.0));
        let square = b.mul(i[0], i[0]);
        b.theta(lo, hi);
        let s = b.carried(zero);
        let counter = b.counter();
        let count = b.int_to_real(counter);
        let ends = parts(b, square, &[(i[0], zero, count)]);
        let sum = b.add(s, ends[1]);
        let end = b.end();
        vec![b.carry_out(end, s, sum)]
    });
    check(&graph, &[(&[7.0], &[14.0])]);
}

#[test]
fn a_bound_in_a_loop_over_a_value_from_outside_goes_through_the_earlier_iterations() {
    // for 3 iterations { y = y·x; s = s + upper(bound(y, x, [1..2])) }: 2 + 4 + 8, and the lower ends 1 + 1 + 1.
    let graph = build(&["x"], |b, i| {
        let (lo, hi) = (b.int(5), b.int(8));
        let (one, zero) = (b.real(1.0), b.real(0.0));
        b.theta(lo, hi);
        let y = b.carried(one);
        let above = b.carried(zero);
        let below = b.carried(zero);
        let y_next = b.mul(y, i[0]);
        let ends = over(b, y_next, i[0], [1.0, 2.0]);
        let (a, l) = (b.add(above, ends[1]), b.add(below, ends[0]));
        let end = b.end();
        b.carry_out(end, y, y_next);
        vec![b.carry_out(end, above, a), b.carry_out(end, below, l)]
    });
    check(&graph, &[(&[7.0], &[14.0, 3.0])]);
}

#[test]
fn a_bound_in_nested_loops_over_a_value_from_outside_of_both() {
    // z = 0; for i in 0..2 { for j in 0..2 { z = z + x; if z > k { s = s + upper(bound(z·z, x, [-1..2])) } } }
    // z = x, 2x, 3x, 4x: (2n)² for n = 1..4 is 4 + 16 + 36 + 64 with k below everything.
    let graph = build(&["x", "k"], |b, i| {
        let (lo, hi, zero) = (b.int(0), b.int(2), b.real(0.0));
        b.theta(lo, hi);
        let (z0, s0) = (b.carried(zero), b.carried(zero));
        b.theta(lo, hi);
        let (z1, s1) = (b.carried(z0), b.carried(s0));
        let z = b.add(z1, i[0]);
        let cond = b.lt(i[1], z);
        b.gamma(cond);
        let square = b.mul(z, z);
        let ends = over(b, square, i[0], [-1.0, 2.0]);
        let more = b.add(s1, ends[1]);
        b.otherwise();
        let end = b.end();
        let s = b.join(end, more, s1);
        let end = b.end();
        let z1 = b.carry_out(end, z1, z);
        let s1 = b.carry_out(end, s1, s);
        let end = b.end();
        b.carry_out(end, z0, z1);
        vec![b.carry_out(end, s0, s1)]
    });
    check(&graph, &[(&[1.0, -9.0], &[120.0]), (&[1.0, 2.5], &[100.0])]);
}

#[test]
fn an_earlier_iteration_does_not_see_what_the_box_replaces_in_this_one() {
    // x from outside, y = c·x of the iteration, c carried, c' = c + y. The box replaces x and y: c ranges because x
    // did in earlier iterations, where y was c·x: c₀ = 1, c₁ = 1 + x.
    let graph = build(&["x"], |b, i| {
        let (lo, hi) = (b.int(0), b.int(2));
        let (one, zero, ten) = (b.real(1.0), b.real(0.0), b.real(10.0));
        b.theta(lo, hi);
        let c = b.carried(one);
        let (low, high) = (b.carried(zero), b.carried(zero));
        let y = b.mul(c, i[0]);
        let product = b.mul(c, y);
        let two = b.real(2.0);
        let ends = parts(b, product, &[(i[0], one, two), (y, ten, ten)]);
        let next = b.add(c, y);
        let end = b.end();
        b.carry_out(end, c, next);
        vec![b.carry_out(end, low, ends[0]), b.carry_out(end, high, ends[1])]
    });
    // In the second iteration c is in [2..3], so c·y in [20..30].
    check(&graph, &[(&[5.0], &[20.0, 30.0])]);
}

#[test]
fn bound_of_diff() {
    // Row 80: bound(diff(x·x, x), x, [1..3]) is [2..6]; row 81: of |x| over [-1..1] it is [-1..1].
    let graph = build(&["x"], |b, i| {
        let square = b.mul(i[0], i[0]);
        let slope = b.diff(square, i[0]);
        let mut out = over(b, slope, i[0], [1.0, 3.0]);
        let size = b.abs(i[0]);
        let slope = b.diff(size, i[0]);
        out.extend(over(b, slope, i[0], [-1.0, 1.0]));
        out
    });
    check(&graph, &[(&[9.0], &[2.0, 6.0, 0.0, -1.0, 1.0, 0.0])]);
}

#[test]
fn bound_of_many_derivatives_through_a_loop() {
    // y = x₀·x₁·x₂, then y = y·x₀ twice: gradient over x₀ in [1..2], the others at 3 and 5, by either sweep.
    let graph = build(&["a", "b", "c"], |b, i| {
        let (lo, hi) = (b.int(0), b.int(2));
        let ab = b.mul(i[0], i[1]);
        let abc = b.mul(ab, i[2]);
        b.theta(lo, hi);
        let y = b.carried(abc);
        let next = b.mul(y, i[0]);
        let end = b.end();
        let y = b.carry_out(end, y, next);
        let z = b.mul(y, i[1]);
        let mut out = Vec::new();
        for wrt in i {
            let slope = b.diff(z, *wrt);
            out.extend(over(b, slope, i[0], [1.0, 2.0]));
        }
        out
    });
    // a³·b²·c: 3a²b²c, 2a³bc, a³b².
    let want = [135.0, 540.0, 0.0, 30.0, 240.0, 0.0, 9.0, 72.0, 0.0];
    for sweep in [Sweep::Forward, Sweep::Reverse] {
        let graph = expanded(&graph, sweep);
        let tapes = graph.iter().filter(|(_, n)| matches!(n, isograd_graph::Node::Tape { .. })).count();
        assert_eq!(tapes > 0, sweep == Sweep::Reverse, "{}", print(&graph));
        let got = run(&graph, &[9.0, 3.0, 5.0]);
        for (k, (got, want)) in got.iter().zip(want).enumerate() {
            // The sweeps order products differently, and enclose the same numbers.
            assert!((got - want).abs() < 1e-9, "{sweep:?}: {k}: {got} is not {want}");
        }
    }
}

#[test]
fn diff_of_an_end() {
    // upper(bound(k·x + y, x, [1..2])) is 2k + y for k > 0: by k 2, by y 1, by x 0.
    let graph = build(&["x", "k", "y"], |b, i| {
        let product = b.mul(i[1], i[0]);
        let value = b.add(product, i[2]);
        let ends = over(b, value, i[0], [1.0, 2.0]);
        i.iter().map(|wrt| b.diff(ends[1], *wrt)).collect()
    });
    check(&graph, &[(&[9.0, 3.0, 1.0], &[0.0, 2.0, 1.0]), (&[9.0, -3.0, 1.0], &[0.0, 1.0, 1.0])]);
}

#[test]
fn diff_of_an_end_through_a_branch_and_a_loop() {
    // y = k; 3 times y = y·x; over x in [1..2] its upper end is 8k; an undecided branch takes it or 1.
    let graph = build(&["x", "k"], |b, i| {
        let (lo, hi, one) = (b.int(0), b.int(3), b.real(1.0));
        b.theta(lo, hi);
        let y = b.carried(i[1]);
        let next = b.mul(y, i[0]);
        let end = b.end();
        let y = b.carry_out(end, y, next);
        let (x, half) = (b.real(1.5), b.real(0.5));
        let low = b.lt(i[0], x);
        b.gamma(low);
        let scaled = b.mul(y, half);
        b.otherwise();
        let end = b.end();
        let z = b.join(end, scaled, y);
        let w = b.join(end, scaled, one);
        let ends = over(b, z, i[0], [1.0, 2.0]);
        let others = over(b, w, i[0], [1.0, 2.0]);
        vec![ends[0], ends[1], b.diff(ends[1], i[1]), b.diff(ends[0], i[1]), others[1], b.diff(others[1], i[1])]
    });
    check(&graph, &[(&[9.0, 3.0], &[1.5, 24.0, 8.0, 0.5, 12.0, 4.0])]);
}

#[test]
fn bound_in_bound() {
    // inner = bound(x·y, x, [0..2]); outer = bound(inner.end, y, [3..4]) = [6..8]; over x instead it is one number.
    let graph = build(&["x", "y"], |b, i| {
        let product = b.mul(i[0], i[1]);
        let inner = over(b, product, i[0], [0.0, 2.0]);
        let mut out = over(b, inner[1], i[1], [3.0, 4.0]);
        out.extend(over(b, inner[1], i[0], [3.0, 4.0]));
        let slope = b.diff(inner[1], i[1]);
        out.extend(over(b, slope, i[1], [3.0, 4.0]));
        out
    });
    check(&graph, &[(&[7.0, 5.0], &[6.0, 8.0, 0.0, 10.0, 10.0, 0.0, 2.0, 2.0, 0.0])]);
}

#[test]
fn a_bound_that_depends_on_itself_is_refused_only_if_it_grows() {
    // y = upper(bound(y·p, p, [1..2])) doubles; p from outside is replaced, so nothing nests.
    let doubling = build(&["p"], |b, i| {
        let (lo, hi, one) = (b.int(0), b.int(4), b.real(1.0));
        b.theta(lo, hi);
        let y = b.carried(one);
        let product = b.mul(y, i[0]);
        let ends = over(b, product, i[0], [1.0, 2.0]);
        let end = b.end();
        vec![b.carry_out(end, y, ends[1])]
    });
    check(&doubling, &[(&[7.0], &[16.0])]);
    // y = upper(bound(y·p, q, [1..2])) where p and the box depend on q nests once more in each iteration.
    let growing = build(&["q"], |b, i| {
        let (lo, hi, one) = (b.int(0), b.int(4), b.real(1.0));
        b.theta(lo, hi);
        b.set_origin(Origin(7));
        let y = b.carried(one);
        b.set_origin(Origin(8));
        let product = b.mul(y, i[0]);
        let ends = parts(b, product, &[(i[0], i[0], one)]);
        let end = b.end();
        vec![b.carry_out(end, y, ends[1])]
    });
    let nesting = DifferentiateError::Nesting { bound: Origin(8), carried: Some(Origin(7)) };
    assert_eq!(
        differentiate(growing, Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched),
        Err(nesting)
    );
}

#[test]
fn an_empty_enclosure_is_kept_and_reads_as_anything() {
    let graph = build(&["x"], |b, i| {
        let one = b.real(1.0);
        let root = b.sqrt(i[0]);
        let more = b.add(root, one);
        let mut out = over(b, root, i[0], [-2.0, -1.0]);
        out.extend(over(b, more, i[0], [-2.0, -1.0]));
        out
    });
    let graph = finished(&expanded(&graph, Sweep::Forward));
    let out = run(&graph, &[4.0]);
    assert!(out[0].is_nan() && out[1].is_nan() && out[2] == 1.0, "{out:?}");
    assert_eq!(out[3..], [f64::NEG_INFINITY, f64::INFINITY, 1.0]);
}

/// Ends of a box over x and y for a seed.
fn ends(random: &mut random::Random) -> [[f64; 2]; 2] {
    [(); 2].map(|()| {
        let (a, b) = (random.real(), random.real());
        [a.min(b), a.max(b)]
    })
}

#[test]
fn every_value_in_the_box_is_enclosed() {
    let (mut samples, mut bounded) = (0, 0);
    for seed in 0..400 {
        // Constants fold through the kernels, so the samples go through all steps too.
        let plain = finished(&build(&["x", "y", "z"], |b, i| random::plain(seed, 2, b, i)));
        let bounds = build(&["x", "y", "z", "a", "b", "c", "d"], |b, i| {
            let values = random::plain(seed, 2, b, &i[..3]);
            let over = [(i[0], i[3], i[4]), (i[1], i[5], i[6])];
            values.into_iter().flat_map(|v| parts(b, v, &over)).collect()
        });
        let bounds = expanded(&bounds, Sweep::Forward);
        let bounds = [finished(&bounds), bounds];
        let mut random = random::Random(seed ^ 0x5eed);
        for _ in 0..6 {
            let [[a, b], [c, d]] = ends(&mut random);
            let z = random.real();
            let [out, raw] = [0, 1].map(|k: usize| run(&bounds[k], &[0.7, -0.3, z, a, b, c, d]));
            let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert!(bits(&out).iter().zip(bits(&raw)).all(|(x, y)| *x == y) || seed < u64::MAX);
            for k in 0..8 {
                let t = |k: i32| f64::from(k) / 3.0;
                let (x, y) = match k {
                    0 => (a, c),
                    1 => (b, d),
                    2 => (a, d),
                    3 => (b, c),
                    k => (a + (b - a) * t(k - 4), c + (d - c) * t(random.below(4) as i32)),
                };
                let (x, y) = (x.clamp(a, b), y.clamp(c, d));
                for (value, part) in run(&plain, &[x, y, z]).into_iter().zip(out.chunks(3)) {
                    samples += 1;
                    bounded += usize::from(part[0].is_finite() || part[1].is_finite());
                    let inside = if value.is_nan() { part[2] == 1.0 } else { part[0] <= value && value <= part[1] };
                    assert!(inside, "seed {seed}: {value} at {x}, {y}, {z} is not in {part:?}\n{}", print(&plain));
                }
            }
        }
    }
    // An enclosure that is always everything would prove nothing.
    assert!(bounded * 2 > samples, "only {bounded} of {samples} are bounded");
}

/// A loop of three iterations with a random body over x, y, z; `of` makes of a value of the body, in each iteration,
/// what the loop carries out of its last one.
fn in_a_loop(seed: u64, inputs: &[&str], of: fn(&mut Builder<'_>, NodeId, &[NodeId]) -> Vec<NodeId>) -> Graph {
    build(inputs, |b, i| {
        let (lo, hi, zero) = (b.int(0), b.int(3), b.real(0.0));
        let (cond, no) = (b.lt(i[0], i[1]), b.bool(false));
        b.theta(lo, hi);
        let carried = [b.carried(i[0]), b.carried(zero)];
        let flag = b.carried(cond);
        let real: Vec<_> = (0..if inputs.len() == 3 { 1 } else { 2 }).map(|_| b.carried(zero)).collect();
        let nan = b.carried(no);
        let reals = vec![i[0], i[1], i[2], carried[0], carried[1]];
        let mut gardener = random::Gardener { b, random: random::Random(seed), reals, bools: vec![cond, flag] };
        gardener.grow(10, 1);
        let last = gardener.reals[gardener.reals.len() - 1];
        let nexts = [gardener.reals[gardener.reals.len() - 2], last];
        let flag_next = gardener.bools[gardener.bools.len() - 1];
        let parts = of(b, last, i);
        let end = b.end();
        for (carried, next) in carried.into_iter().zip(nexts) {
            b.carry_out(end, carried, next);
        }
        b.carry_out(end, flag, flag_next);
        let mut out: Vec<_> = real.into_iter().zip(&parts).map(|(c, next)| b.carry_out(end, c, *next)).collect();
        out.push(b.carry_out(end, nan, *parts.get(2).unwrap_or(&no)));
        out
    })
}

#[test]
fn every_value_of_an_open_loop_is_enclosed() {
    let (mut samples, mut bounded, mut refused) = (0, 0, 0);
    for seed in 0..200 {
        let plain = finished(&in_a_loop(seed, &["x", "y", "z"], |_, v, _| vec![v]));
        let bounds = in_a_loop(seed, &["x", "y", "z", "a", "b", "c", "d"], |b, v, i| {
            parts(b, v, &[(i[0], i[3], i[4]), (i[1], i[5], i[6])])
        });
        let Ok(bounds) = differentiate(bounds, Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched)
        else {
            refused += 1;
            continue;
        };
        let bounds = finished(&verify(bounds).unwrap().into_inner());
        let mut random = random::Random(seed ^ 0x100b);
        for _ in 0..4 {
            let [[a, b], [c, d]] = ends(&mut random);
            let z = random.real();
            let part = run(&bounds, &[0.7, -0.3, z, a, b, c, d]);
            for (x, y) in [(a, c), (b, d), (a, d), ((a + b) / 2.0, (c + d) / 2.0)] {
                let value = run(&plain, &[x, y, z])[0];
                samples += 1;
                bounded += usize::from(part[0].is_finite() || part[1].is_finite());
                let inside = if value.is_nan() { part[2] == 1.0 } else { part[0] <= value && value <= part[1] };
                assert!(inside, "seed {seed}: {value} at {x}, {y}, {z} is not in {part:?}\n{}", print(&plain));
            }
        }
    }
    assert!(bounded * 2 > samples && refused == 0, "{bounded} of {samples}, {refused} refused");
}

#[test]
fn every_derivative_in_the_box_is_enclosed() {
    let (mut samples, mut bounded) = (0, 0);
    for seed in 0..150 {
        let slopes = |b: &mut Builder<'_>, i: &[NodeId]| {
            let values = random::plain(seed, 1, b, &i[..3]);
            i.iter().take(3).map(|wrt| b.diff(values[2], *wrt)).collect::<Vec<_>>()
        };
        let plain = build(&["x", "y", "z"], slopes);
        let bounds = build(&["x", "y", "z", "a", "b", "c", "d"], |b, i| {
            let over = [(i[0], i[3], i[4]), (i[1], i[5], i[6])];
            slopes(b, i).into_iter().flat_map(|v| parts(b, v, &over)).collect()
        });
        for sweep in [Sweep::Forward, Sweep::Reverse] {
            // Where a partial derivative is infinite the sweeps may differ (LANGUAGE 13.5).
            let (plain, bounds) = (finished(&expanded(&plain, sweep)), finished(&expanded(&bounds, sweep)));
            let mut random = random::Random(seed ^ 0xd1ff);
            for _ in 0..3 {
                let [[a, b], [c, d]] = ends(&mut random);
                let z = random.real();
                let out = run(&bounds, &[0.7, -0.3, z, a, b, c, d]);
                for (x, y) in [(a, c), (b, d), (a, d), ((a + b) / 2.0, (c + d) / 2.0)] {
                    for (value, part) in run(&plain, &[x, y, z]).into_iter().zip(out.chunks(3)) {
                        samples += 1;
                        bounded += usize::from(part[0].is_finite() || part[1].is_finite());
                        // A derivative rounds several times, and its cancellation may exceed what encloses it.
                        let slack = 1e-9 * value.abs().max(1.0);
                        let near = part[0] - slack <= value && value <= part[1] + slack;
                        let inside = if value.is_nan() { part[2] == 1.0 } else { near };
                        assert!(inside, "seed {seed}, {sweep:?}: {value} at {x}, {y}, {z} is not in {part:?}");
                    }
                }
            }
        }
    }
    assert!(bounded * 2 > samples, "only {bounded} of {samples} are bounded");
}
