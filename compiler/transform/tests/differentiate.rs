//! Differentiation of hand-made graphs: the rules of LANGUAGE 13 that need no source text.

mod support;

use isograd_graph::{
    Builder, Graph, Mode, NodeId, Op, Origin, Precision, Scalar, Unwatched, Value, evaluate, print, verify,
};
use isograd_transform::{DifferentiateError, Sweep, Wanted, derive, differentiate, fold, optimise, schedule};
use support::lane_kernels;

const MANY: usize = 1_000_000;

fn build(inputs: &[&str], make: impl FnOnce(&mut Builder<'_>, &[NodeId]) -> Vec<NodeId>) -> Graph {
    let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
    let inputs: Vec<_> = inputs.iter().map(|n| b.input(*n, Scalar::Real)).collect();
    for (i, node) in make(&mut b, &inputs).into_iter().enumerate() {
        b.output(format!("out{i}"), node);
    }
    b.finish().unwrap()
}

fn real(graph: &Graph, inputs: &[f64]) -> Vec<f64> {
    let inputs: Vec<_> = inputs.iter().map(|x| Value::Real(*x)).collect();
    evaluate(graph, Precision::F64, &inputs)
        .unwrap()
        .into_iter()
        .map(|v| match v {
            Value::Real(x) => x,
            other => panic!("{other:?}"),
        })
        .collect()
}

/// Expands, verifies, and checks that the rest of the pipeline changes no bit in f64 (no kernels involved).
fn expand(graph: Graph, sweep: Sweep) -> Graph {
    let graph =
        differentiate(verify(graph).unwrap().into_inner(), sweep, isograd_graph::Precision::F32, 6, MANY, &Unwatched)
            .unwrap();
    verify(graph).unwrap().into_inner()
}

fn finish(graph: &Graph) -> Graph {
    let p = Precision::F64;
    let mut graph = verify(fold(graph, p, MANY, &Unwatched).unwrap()).unwrap().into_inner();
    for step in [lane_kernels, optimise, schedule] {
        graph = verify(step(&graph, p, MANY, &Unwatched).unwrap()).unwrap().into_inner();
    }
    graph
}

/// Both sweeps give these numbers, which are exact.
fn check(graph: Graph, cases: &[(&[f64], &[f64])]) {
    for sweep in [Sweep::Forward, Sweep::Reverse] {
        let expanded = expand(graph.clone(), sweep);
        let finished = finish(&expanded);
        for (inputs, want) in cases {
            assert_eq!(real(&expanded, inputs), *want, "{sweep:?} at {inputs:?}\n{}", print(&expanded));
            assert_eq!(real(&finished, inputs), *want, "{sweep:?}, finished, at {inputs:?}\n{}", print(&finished));
        }
    }
}

#[test]
fn square_and_its_second_derivative() {
    let graph = build(&["x"], |b, i| {
        let y = b.mul(i[0], i[0]);
        let first = b.diff(y, i[0]);
        let second = b.diff(first, i[0]);
        vec![first, second]
    });
    check(graph, &[(&[3.0], &[6.0, 2.0])]);
}

#[test]
fn by_an_intermediate_value() {
    // let y = x*x; diff(x*y, x) = 3x², diff(x*y, y) = x
    let graph = build(&["x"], |b, i| {
        let y = b.mul(i[0], i[0]);
        let z = b.mul(i[0], y);
        vec![b.diff(z, i[0]), b.diff(z, y)]
    });
    check(graph, &[(&[2.0], &[12.0, 2.0])]);
}

#[test]
fn a_tangent_that_looks_like_a_value_of_the_program_does_not_depend_on_it() {
    // q = x + x; d(x·x)/dx = x + x looks like q, but diff(…, q) is 0.
    let graph = build(&["x"], |b, i| {
        let q = b.add(i[0], i[0]);
        let y = b.mul(i[0], i[0]);
        let slope = b.diff(y, i[0]);
        vec![b.diff(slope, q), b.diff(slope, i[0])]
    });
    check(graph, &[(&[2.0], &[0.0, 2.0])]);
}

#[test]
fn the_result_of_diff_is_a_value_of_its_own() {
    // g = diff(x·y, y) is x; diff(x·g, g) is x, not 2x.
    let graph = build(&["x", "y"], |b, i| {
        let product = b.mul(i[0], i[1]);
        let g = b.diff(product, i[1]);
        let h = b.mul(i[0], g);
        vec![b.diff(h, g), b.diff(h, i[0])]
    });
    check(graph, &[(&[3.0, 5.0], &[3.0, 6.0])]);
}

#[test]
fn fresh_constants_are_variables() {
    let graph = build(&["x"], |b, i| {
        let three = b.real(3.0);
        let c = b.fresh(three);
        let square = b.mul(c, c);
        let y = b.mul(square, i[0]);
        vec![b.diff(y, c)]
    });
    check(graph, &[(&[2.0], &[12.0])]);
}

/// y = xⁿ by a loop, and its derivative.
fn power(n: i32) -> Graph {
    build(&["x"], |b, i| {
        let (lo, hi, one) = (b.int(0), b.int(n), b.real(1.0));
        b.theta(lo, hi);
        let y = b.carried(one);
        let next = b.mul(y, i[0]);
        let end = b.end();
        let y = b.carry_out(end, y, next);
        vec![y, b.diff(y, i[0])]
    })
}

#[test]
fn loops_stay_loops() {
    check(power(3), &[(&[2.0], &[8.0, 12.0])]);
    check(power(0), &[(&[2.0], &[1.0, 0.0])]);
    for sweep in [Sweep::Forward, Sweep::Reverse] {
        assert_eq!(finish(&expand(power(10), sweep)).len(), finish(&expand(power(10_000), sweep)).len());
    }
}

#[test]
fn second_derivative_of_a_loop() {
    let graph = derive(&power(4), &[Wanted { name: "h".into(), output: 0, by: vec![0, 0] }], MANY, &Unwatched).unwrap();
    check(graph, &[(&[2.0], &[48.0])]);
}

#[test]
fn carried_variables_that_trade_places() {
    // (a, b) → (b, a·x) three times from (x, 1): a = x·1, then …
    let graph = build(&["x"], |b, i| {
        let (lo, hi, one) = (b.int(0), b.int(3), b.real(1.0));
        b.theta(lo, hi);
        let a = b.carried(i[0]);
        let c = b.carried(one);
        let product = b.mul(a, i[0]);
        let end = b.end();
        let a = b.carry_out(end, a, c);
        let c = b.carry_out(end, c, product);
        vec![a, c, b.diff(a, i[0]), b.diff(c, i[0])]
    });
    // (x,1) → (1,x²) → (x²,x) → (x,x³)
    check(graph, &[(&[2.0], &[2.0, 8.0, 1.0, 12.0])]);
}

#[test]
fn branches() {
    let graph = build(&["x"], |b, i| {
        let zero = b.real(0.0);
        let cond = b.lt(zero, i[0]);
        b.gamma(cond);
        let square = b.mul(i[0], i[0]);
        b.otherwise();
        let minus = b.neg(i[0]);
        let end = b.end();
        let y = b.join(end, square, minus);
        vec![b.diff(y, i[0]), b.diff(y, square)]
    });
    // `square` lies in a closed region: that would be malformed.
    assert!(verify(graph).is_err());
    let graph = build(&["x"], |b, i| {
        let zero = b.real(0.0);
        let cond = b.lt(zero, i[0]);
        b.gamma(cond);
        let square = b.mul(i[0], i[0]);
        b.otherwise();
        let minus = b.neg(i[0]);
        let end = b.end();
        let y = b.join(end, square, minus);
        vec![b.diff(y, i[0])]
    });
    check(graph, &[(&[3.0], &[6.0]), (&[-3.0], &[-1.0]), (&[0.0], &[-1.0])]);
}

#[test]
fn diff_in_a_loop_by_a_value_from_outside() {
    // for 3 iterations { y = y·x; s = s + dy/dx }: y = x, x², x³; s = 1 + 2x + 3x².
    let graph = build(&["x"], |b, i| {
        let (lo, hi) = (b.int(0), b.int(3));
        let (one, zero) = (b.real(1.0), b.real(0.0));
        b.theta(lo, hi);
        let y = b.carried(one);
        let s = b.carried(zero);
        let y_next = b.mul(y, i[0]);
        let slope = b.diff(y_next, i[0]);
        let s_next = b.add(s, slope);
        let end = b.end();
        b.carry_out(end, y, y_next);
        vec![b.carry_out(end, s, s_next)]
    });
    check(graph, &[(&[2.0], &[17.0])]);
}

#[test]
fn diff_in_a_loop_by_a_value_of_the_iteration() {
    // for 3 iterations { y = x·x; x = diff(y, x) }: x doubles each time, and nothing grows.
    let graph = build(&["x"], |b, i| {
        let (lo, hi) = (b.int(0), b.int(3));
        b.theta(lo, hi);
        let x = b.carried(i[0]);
        let y = b.mul(x, x);
        let slope = b.diff(y, x);
        let end = b.end();
        let x = b.carry_out(end, x, slope);
        vec![x, b.diff(x, i[0])]
    });
    check(graph, &[(&[3.0], &[24.0, 8.0])]);
}

#[test]
fn an_order_that_grows_with_the_trip_count_is_refused() {
    // for … { z = z + diff(y·x, x); y = diff(y·x, x) } with x from outside: y is to blame, not z
    let graph = build(&["x"], |b, i| {
        let (lo, hi) = (b.int(0), b.int(3));
        b.theta(lo, hi);
        let counted = b.carried(i[0]);
        b.set_origin(Origin(7));
        let y = b.carried(i[0]);
        b.set_origin(Origin(8));
        let product = b.mul(y, i[0]);
        let slope = b.diff(product, i[0]);
        let more = b.add(counted, slope);
        let end = b.end();
        vec![b.carry_out(end, counted, more), b.carry_out(end, y, slope)]
    });
    let growing = DifferentiateError::Growing { diff: Origin(8), carried: Some(Origin(7)) };
    assert_eq!(differentiate(graph, Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched), Err(growing));
}

#[test]
fn order_is_limited() {
    let nest = |n: usize| {
        build(&["x"], |b, i| {
            let mut y = b.mul(i[0], i[0]);
            for _ in 0..n {
                y = b.mul(y, i[0]);
                y = b.diff(y, i[0]);
            }
            vec![y]
        })
    };
    assert!(differentiate(nest(6), Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched).is_ok());
    assert!(matches!(
        differentiate(nest(7), Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched),
        Err(DifferentiateError::Order(_))
    ));
}

#[test]
fn operands_not_chosen_contribute_nothing() {
    // diff(min(x, 1/(x·x)), x) at 0 is 1: the other operand's derivative is infinite (LANGUAGE 21, row 70a).
    let graph = build(&["x"], |b, i| {
        let one = b.real(1.0);
        let square = b.mul(i[0], i[0]);
        let pole = b.div(one, square);
        let least = b.min(i[0], pole);
        vec![b.diff(least, i[0])]
    });
    check(graph, &[(&[0.0], &[1.0])]);
}

/// The same for a walk back: two seeds, and the pole behind a choice or outside of a branch.
#[test]
fn what_was_not_chosen_contributes_nothing_to_a_gradient() {
    let chosen = build(&["x", "y"], |b, i| {
        let one = b.real(1.0);
        let square = b.mul(i[0], i[0]);
        let pole = b.div(one, square);
        let least = b.min(i[0], pole);
        let sum = b.add(least, i[1]);
        vec![b.diff(sum, i[0]), b.diff(sum, i[1])]
    });
    check(chosen, &[(&[0.0, 5.0], &[1.0, 1.0])]);
    let taken = build(&["x", "y"], |b, i| {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        let square = b.mul(i[0], i[0]);
        let pole = b.div(one, square);
        let cond = b.lt(i[1], zero);
        b.gamma(cond);
        let far = b.mul(pole, i[1]);
        b.otherwise();
        let near = b.mul(i[0], i[1]);
        let end = b.end();
        let value = b.join(end, far, near);
        vec![b.diff(value, i[0]), b.diff(value, i[1])]
    });
    check(taken, &[(&[0.0, 2.0], &[2.0, 0.0]), (&[2.0, -1.0], &[0.25, 0.25])]);
}

/// A branch in a branch and a loop in a branch, walked back: by four seeds.
#[test]
fn nested_structures_by_many_seeds() {
    let graph = build(&["x", "y", "z", "w"], |b, i| {
        let (zero, four, none) = (b.real(0.0), b.int(4), b.int(0));
        let outer = b.lt(zero, i[0]);
        b.gamma(outer);
        let product = b.mul(i[1], i[2]);
        let inner = b.lt(product, i[3]);
        b.gamma(inner);
        let a = b.mul(product, i[3]);
        b.otherwise();
        b.theta(none, four);
        let power = b.carried(i[1]);
        let next = b.mul(power, i[2]);
        let end = b.end();
        let power = b.carry_out(end, power, next);
        let c = b.mul(power, product);
        let end = b.end();
        let joined = b.join(end, a, c);
        let then = b.mul(joined, i[0]);
        b.otherwise();
        let otherwise = b.sub(i[3], i[2]);
        let end = b.end();
        let value = b.join(end, then, otherwise);
        (0..4).map(|k| b.diff(value, i[k])).collect()
    });
    // x·(yz)w; x·(y·z⁴)·(yz) = x·y²·z⁵; w − z.
    check(
        graph,
        &[
            (&[2.0, 3.0, 1.0, 5.0], &[15.0, 10.0, 30.0, 6.0]),
            (&[2.0, 3.0, 2.0, 1.0], &[288.0, 384.0, 1440.0, 0.0]),
            (&[-1.0, 3.0, 2.0, 1.0], &[0.0, 0.0, -1.0, 1.0]),
        ],
    );
}

#[test]
fn more_seeds_than_a_word_has_bits() {
    let graph = build(&["x"], |b, i| {
        let mut outs = Vec::new();
        for k in 0..150 {
            let k = b.real(f64::from(k));
            let shifted = b.add(i[0], k);
            let y = b.mul(shifted, shifted);
            outs.push(b.diff(y, shifted));
        }
        outs
    });
    let want: Vec<f64> = (0..150).map(|k| 2.0 * (1.0 + f64::from(k))).collect();
    check(graph, &[(&[1.0], &want)]);
}

#[test]
fn length_is_smooth_enough_at_zero() {
    let graph = build(&["x", "y"], |b, i| {
        let l = b.op(Op::Length2, &[i[0], i[1]]);
        let gx = b.diff(l, i[0]);
        let gy = b.diff(l, i[1]);
        vec![gx, gy, b.diff(gx, i[0]), b.diff(gx, i[1])]
    });
    check(graph, &[(&[0.0, 0.0], &[0.0; 4])]);
}

#[test]
fn the_gradient_of_a_sphere_is_small() {
    let sphere = build(&["x", "y", "z", "r"], |b, i| {
        let l = b.op(Op::Length3, &[i[0], i[1], i[2]]);
        vec![b.sub(l, i[3])]
    });
    let wanted: Vec<_> = (0..3).map(|k| Wanted { name: format!("g{k}"), output: 0, by: vec![k] }).collect();
    let graph = finish(&expand(derive(&sphere, &wanted, MANY, &Unwatched).unwrap(), Sweep::Forward));
    // The thesis needs 20 nodes (fig. 4.8).
    assert!(graph.len() <= 20, "{}", print(&graph));
}
