//! Specialisation to a box: the same bits inside, less to compute, and a manifest that says so.

#![allow(clippy::pedantic, reason = "tests")]

use isograd_compiler::{
    Artefact, Code, Diagnostic, MemoryLoader, Number, Options, Request, Unwatched, Within, check, compile, print_step,
};
use isograd_graph::{Graph, Precision, Value, evaluate, parse};

const UNION: &str = "export fn f(p: vec3, k: real) -> real {
    let ball = length(p) - 1.0;
    let far = length(p - [10.0, 0.0, 0.0]) - 1.0;
    let d = min(ball, far);
    if p.x > 0.0 { d } else { d + k*floor(p.y) }
}";

fn request(within: &[&str]) -> Request {
    let boxes = within.iter().map(|text| text.parse::<Within>().expect("a box"));
    Request {
        export: "f".to_owned(),
        queries: vec!["value".parse().expect("a query"), "gradient(*)".parse().expect("a query")],
        within: boxes.map(|w| (w.parameter, w.ends)).collect(),
        ..Request::default()
    }
}

fn compiled(text: &str, within: &[&str]) -> Result<(Artefact, Graph), Vec<Diagnostic>> {
    let options = Options { verify: true, ..Options::default() };
    let checked = check("main.vola", text.as_bytes().to_vec(), &MemoryLoader::default(), &options, &Unwatched);
    let request = request(within);
    let artefact = compile(&checked, &request, &options, &Unwatched)?;
    let graph = print_step(&checked, &request, "optimise", &options, &Unwatched).expect("prints");
    Ok((artefact, parse(&graph).expect("reads back")))
}

/// Points of a box, its corners among them.
fn points(lo: [f64; 4], hi: [f64; 4]) -> impl Iterator<Item = Vec<Value>> {
    (0..256_u32).map(move |i| {
        let at = |k: usize| f64::from(i >> (2 * k) & 3) / 3.0;
        (0..4).map(|k| Value::Real(Precision::F32.round(lo[k] + (hi[k] - lo[k]) * at(k)))).collect()
    })
}

#[test]
fn inside_of_the_box_the_bits_are_the_same() {
    let (_, whole) = compiled(UNION, &[]).expect("compiles");
    for (within, lo, hi) in [
        ("p=[-2, -2, -2]:[-1, 2, 2]", [-2.0, -2.0, -2.0], [-1.0, 2.0, 2.0]),
        ("p=[0.5, 0, 0]:[1, 1, 1]", [0.5, 0.0, 0.0], [1.0, 1.0, 1.0]),
        ("p=[9, 0, 0]:[11, 0, 0]", [9.0, 0.0, 0.0], [11.0, 0.0, 0.0]),
        // Neither ball is decided here, nor the branch.
        ("p=[-9, -9, -9]:[9, 9, 9]", [-9.0; 3], [9.0; 3]),
    ] {
        let (artefact, graph) = compiled(UNION, &[within]).expect("compiles");
        let sizes = artefact.manifest.specialised.expect("it says so");
        assert_eq!(sizes.to < sizes.from, within != "p=[-9, -9, -9]:[9, 9, 9]", "{within}: {sizes:?}");
        for point in points([lo[0], lo[1], lo[2], -3.0], [hi[0], hi[1], hi[2], 3.0]) {
            let bits = |graph: &Graph| -> Vec<u64> {
                let values = evaluate(graph, Precision::F32, &point).expect("ends");
                values.iter().map(|v| if let Value::Real(x) = v { x.to_bits() } else { panic!("a real") }).collect()
            };
            assert_eq!(bits(&whole), bits(&graph), "{within} at {point:?}");
        }
    }
}

#[test]
fn what_is_decided_is_dropped() {
    let (artefact, graph) = compiled(UNION, &["p=[0.5, 0, 0]:[1, 1, 1]"]).expect("compiles");
    let text = isograd_graph::print(&graph);
    for gone in ["gamma", "floor", "min", "select"] {
        assert!(!text.contains(gone), "{gone}:\n{text}");
    }
    let x = &artefact.manifest.inputs[0].columns[0];
    assert_eq!(x.within, Some([Number(0.5), Number(1.0)]));
    let (whole, _) = compiled(UNION, &[]).expect("compiles");
    assert_ne!(whole.manifest.id, artefact.manifest.id);
    assert_eq!(whole.manifest.specialised, None);
}

#[test]
fn decisions_in_loops_hold_in_every_iteration() {
    let text = "export fn f(p: vec3, k: real) -> real {
        let d = p.x;
        for i in 0..5 { d = min(d + 1.0, abs(p.y) + k); }
        d
    }";
    let (_, whole) = compiled(text, &[]).expect("compiles");
    let (_, graph) = compiled(text, &["p=[0, 1, 0]:[1, 2, 0]", "k=4:9"]).expect("compiles");
    assert!(isograd_graph::print(&graph).contains("min"), "it decides otherwise in the last iterations");
    for point in points([0.0, 1.0, 0.0, 4.0], [1.0, 2.0, 0.0, 9.0]) {
        assert_eq!(evaluate(&whole, Precision::F32, &point), evaluate(&graph, Precision::F32, &point), "{point:?}");
    }
}

#[test]
fn boxes_that_do_not_fit() {
    for within in ["q=0:1", "p=[0, 0]:[1, 1]", "k=2:1", "k=NaN:1"] {
        let errors = compiled(UNION, &[within]).expect_err(within);
        assert_eq!(errors[0].code, Code::E1102, "{within}");
    }
    for text in ["p", "p=", "p=1", "p=[1:2", "=1:2", "p=a:b", "p=[1,2]:[1]"] {
        assert!(text.parse::<Within>().is_err(), "{text}");
    }
}
