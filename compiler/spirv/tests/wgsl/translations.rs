//! The other languages: what a host binds, and that large programs are translated.

use isograd_graph::ops::Family;
use isograd_graph::{Precision, Scalar, Verified};
use isograd_spirv::{Dialect, Form, Plan};

use crate::garden::{Soil, graph, random, single};
use crate::{scalars, scenes, signature};

const DIALECTS: [Dialect; 3] = [Dialect::Glsl, Dialect::Hlsl, Dialect::Msl];

fn kernel(graph: &Verified, dialect: Dialect) -> String {
    let varying: Vec<bool> = (0..graph.inputs.len()).map(|i| i < 3).collect();
    let plan = Plan::new(graph, Form::Kernel { varying: &varying }).unwrap();
    plan.translated(dialect).unwrap_or_else(|error| panic!("{dialect:?}: {error}"))
}

fn library(graph: &Verified, dialect: Dialect) -> String {
    let signature = scalars(graph);
    let plan = Plan::new(graph, Form::Library(&signature)).unwrap();
    plan.translated(dialect).unwrap_or_else(|error| panic!("{dialect:?}: {error}"))
}

#[test]
fn bindings_are_those_of_the_layout() {
    let sphere = scenes::sphere();
    for (dialect, bound) in [
        (Dialect::Glsl, ["binding = 0", "binding = 1", "binding = 2", "binding = 3"]),
        (Dialect::Hlsl, ["register(t0)", "register(u1)", "register(b2)", "register(t3)"]),
        (Dialect::Msl, ["[[buffer(0)]]", "[[buffer(1)]]", "[[buffer(2)]]", "[[buffer(3)]]"]),
    ] {
        let text = kernel(&sphere, dialect);
        for binding in bound {
            assert_eq!(text.matches(binding).count(), 1, "{binding} in\n{text}");
        }
        let head = text.lines().next().unwrap();
        assert!(head.contains("convenience"), "{head}");
        insta::assert_snapshot!(format!("{dialect:?}"), text);
    }
}

#[test]
fn functions_stand_alone() {
    let graph = scenes::tape();
    for dialect in DIALECTS {
        let signature = signature("iterated", &[("x", 1)], &[("value", 1), ("gradient(x)", 1)]);
        let plan = Plan::new(&graph, Form::Library(&signature)).unwrap();
        let text = plan.translated(dialect).unwrap();
        for word in ["main", "#version", "local_size", "numthreads", "kernel", "binding", "register", "[[buffer"] {
            assert!(!text.contains(word), "{word} in\n{text}");
        }
        assert_eq!(text.matches(" iterated(").count(), 1, "{text}");
        insta::assert_snapshot!(format!("{dialect:?} library"), text);
    }
}

/// What keeps constants apart in WGSL does so in its translations.
#[test]
fn barriers_are_translated() {
    let graph = graph(Precision::F32, |b| {
        let (x, magic) = (b.input("x", Scalar::Real), b.real(12_582_912.0));
        let y = b.add(x, magic);
        let y = b.sub(y, magic);
        b.output("y", y);
    });
    for (dialect, barrier) in [
        (Dialect::Glsl, "uintBitsToFloat(min(floatBitsToUint(x), 4294967294u))"),
        (Dialect::Hlsl, "asfloat(min(asuint(x), 4294967294u))"),
        (Dialect::Msl, "as_type<float>(metal::min(as_type<uint>(x), 4294967294u))"),
    ] {
        let text = library(&graph, dialect);
        assert!(text.contains(barrier) && text.contains("f_rounded("), "{text}");
    }
}

#[test]
fn every_operation_and_control_flow_is_translated() {
    let singles = Soil::of(Family::Shader).operations.into_iter().map(|op| single(op, Precision::F32));
    for graph in singles.chain((0..60).map(|seed| random(seed, Precision::F32, &Soil::of(Family::Shader), 14))) {
        for dialect in DIALECTS {
            kernel(&graph, dialect);
            library(&graph, dialect);
        }
    }
}

/// naga calls itself for blocks in blocks and operands in operands.
#[test]
fn large_programs_need_no_large_stack() {
    for (name, graph) in
        [("straight", scenes::straight(8000)), ("nested", scenes::nested(100)), ("deep", scenes::nested(126))]
    {
        let run = move || {
            for dialect in DIALECTS {
                let start = std::time::Instant::now();
                let text = kernel(&graph, dialect);
                eprintln!("{name} {dialect:?}: {:?}, {} bytes", start.elapsed(), text.len());
                library(&graph, dialect);
            }
        };
        std::thread::Builder::new().stack_size(2 << 20).spawn(run).unwrap().join().unwrap();
    }
}
