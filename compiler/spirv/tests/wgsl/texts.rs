//! What modules look like.

use isograd_graph::{Op, Precision, Scalar};
use isograd_spirv::{Form, Plan};

use crate::garden::graph;
use crate::{checked, kernel, library, scalars, scenes, signature};

#[test]
fn a_kernel_of_a_sphere() {
    let graph = scenes::sphere();
    let plan = Plan::new(&graph, Form::Kernel { varying: &[true, true, true, false] }).unwrap();
    let text = plan.wgsl().unwrap();
    checked(&text);
    insta::assert_snapshot!(text);
}

#[test]
fn a_library_of_a_smooth_union() {
    let graph = scenes::smooth_union();
    let signature =
        signature("smooth_union", &[("at", 3), ("radius", 1), ("k", 1)], &[("value", 1), ("gradient(at)", 3)]);
    let text = library(&graph, &signature).unwrap();
    checked(&text);
    insta::assert_snapshot!(text);
}

#[test]
fn branches_loops_and_tapes() {
    for (name, graph) in [("branch", scenes::branch()), ("loop", scenes::cycle()), ("tape", scenes::tape())] {
        let text = library(&graph, &scalars(&graph)).unwrap();
        checked(&text);
        insta::assert_snapshot!(name, text);
        checked(&kernel(&graph).unwrap());
    }
}

/// Elements of every kind, constants that are none in WGSL, names that mean something else there.
#[test]
fn a_kernel_of_every_kind() {
    let graph = graph(Precision::F32, |b| {
        let (x, n) = (b.input("select", Scalar::Real), b.input("point", Scalar::Int));
        let t = b.input("größe.0", Scalar::Bool);
        let (inf, nan, least) = (b.real(f64::NEG_INFINITY), b.real(f64::NAN), b.int(i32::MIN));
        let (tiny, minus) = (b.real(1e-40), b.real(-0.0));
        let y = b.select(t, x, inf);
        let y = b.max(y, tiny);
        let y = b.copysign(y, x);
        let m = b.op(Op::IntMax, &[n, least]);
        let m = b.idiv(m, n);
        let outputs = [x, n, t, y, m, inf, nan, least, tiny, minus];
        outputs.iter().enumerate().for_each(|(k, node)| b.output(format!("y{k}\n"), *node));
    });
    let plan = Plan::new(&graph, Form::Kernel { varying: &[true, false, true] }).unwrap();
    let text = plan.wgsl().unwrap();
    checked(&text);
    insta::assert_snapshot!(text);
}

/// Arrays, structs of several kinds, and constants as results.
#[test]
fn a_library_of_every_shape() {
    let graph = graph(Precision::F32, |b| {
        let m: Vec<_> = (0..6).map(|k| b.input(format!("m.{k}"), Scalar::Real)).collect();
        let mixed = [b.input("hit.n", Scalar::Int), b.input("hit.t", Scalar::Bool), b.input("hit.real", Scalar::Real)];
        let flags = [b.input("fn.x", Scalar::Bool), b.input("fn.y", Scalar::Bool)];
        let both = b.and(flags[0], flags[1]);
        let either = b.or(mixed[1], both);
        let sum = b.add(m[5], mixed[2]);
        let infinite = b.real(f64::INFINITY);
        for (k, node) in m.iter().rev().chain(&[sum, mixed[0], either, infinite, both, either]).enumerate() {
            b.output(format!("{k}"), *node);
        }
    });
    let parameters = [("m", 6), ("hit", 3), ("fn", 2)];
    let results = [("jacobian(m)", 6), ("kinks(value, m)", 3), ("value", 1), ("fn", 2)];
    let text = library(&graph, &signature("return", &parameters, &results)).unwrap();
    checked(&text);
    insta::assert_snapshot!(text);
}
