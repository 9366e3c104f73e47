//! Functions with linkage, of values of every shape.

use isograd_graph::ops::Family;
use isograd_graph::{Scalar, Verified};
use isograd_spirv::{Form, Group, Plan, Signature, disassemble};

use crate::garden::{KINDS, PRECISIONS, Soil, graph, random};
use crate::tools::{have, validate};

fn signature(parameters: &[(&str, usize)], results: &[(&str, usize)]) -> Signature {
    let groups = |all: &[(&str, usize)]| {
        all.iter().map(|(name, scalars)| Group { name: (*name).to_owned(), scalars: *scalars }).collect()
    };
    Signature { name: "shape".to_owned(), parameters: groups(parameters), results: groups(results) }
}

/// Checks the function alone; the test `gpu` of the testkit links such with a kernel and runs them.
fn exported(graph: &Verified, signature: &Signature, name: &str) {
    let plan = Plan::new(graph, Form::Library(signature)).expect("a plan");
    let library = plan.spirv().expect("emits");
    let text = disassemble(&library).unwrap();
    assert!(text.contains("\"shape\" Export") && !text.contains("OpEntryPoint"), "{text}");
    if have("spirv-val")
        && let Err(error) = validate(&library, "spv1.3")
    {
        panic!("{name}: {error}\n{text}");
    }
}

#[test]
fn values_of_every_shape_are_passed() {
    for precision in PRECISIONS {
        let graph = graph(precision, |b| {
            let mut reals = Vec::new();
            for i in 0..1 + 3 + 6 {
                reals.push(b.input(format!("r{i}"), Scalar::Real));
            }
            let (n, t) = (b.input("mixed.n", Scalar::Int), b.input("mixed.t", Scalar::Bool));
            let (ints, truths): (Vec<_>, Vec<_>) =
                (0..2).map(|i| (b.input(format!("i{i}"), Scalar::Int), b.input(format!("t{i}"), Scalar::Bool))).unzip();
            let sum = reals.iter().copied().reduce(|x, y| b.sub(x, y)).unwrap();
            let chosen = b.select(t, sum, reals[3]);
            let more = b.iadd(n, ints[0]);
            let both = b.and(truths[0], truths[1]);
            let mut outputs = vec![sum, more, both, n, t, chosen];
            outputs.extend(&reals[..5]);
            outputs.push(ints[1]);
            outputs.extend([both, t, both, t, both]);
            for (i, node) in outputs.into_iter().enumerate() {
                b.output(format!("o{i}"), node);
            }
        });
        // i0 t0 i1 t1 stand interleaved: one struct.
        let parameters = [("one", 1), ("three", 3), ("six", 6), ("mixed", 2), ("more", 4)];
        let results = [("first", 1), ("pair", 2), ("other", 2), ("real", 1), ("five", 5), ("int", 1), ("truths", 5)];
        exported(&graph, &signature(&parameters, &results), &format!("shapes-{}", precision.name()));
    }
}

#[test]
fn one_result_is_returned_as_it_is() {
    for precision in PRECISIONS {
        for scalar in KINDS {
            for count in 1..=5 {
                let graph = graph(precision, |b| {
                    for i in 0..count {
                        let x = b.input(format!("x{i}"), scalar);
                        b.output(format!("y{i}"), x);
                    }
                });
                let name = format!("one-{}-{scalar}-{count}", precision.name());
                exported(&graph, &signature(&[("x", count)], &[("y", count)]), &name);
            }
        }
    }
}

#[test]
fn control_flow_and_tapes_are_exported() {
    for precision in PRECISIONS {
        for seed in 0..12 {
            let graph = random(seed, precision, &Soil::of(Family::Shader), 14);
            let all = signature(&[("a", 2), ("b", 4)], &[("c", 1), ("d", 5)]);
            exported(&graph, &all, &format!("random-{}-{seed}", precision.name()));
        }
    }
}

#[test]
fn a_function_of_nothing() {
    for precision in PRECISIONS {
        let graph = graph(precision, |b| {
            let x = b.real(1.5);
            b.output("x", x);
        });
        exported(&graph, &signature(&[], &[("x", 1)]), &format!("nothing-{}", precision.name()));
    }
}
