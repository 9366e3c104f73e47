//! The programs in `examples/` compile without a diagnostic and have the values and gradients that their figures and
//! differences demand. Knows nothing of how they are evaluated.

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use isograd_compiler::{Precision, Query};
use isograd_graph::Value;
use isograd_testkit::points::in_box;
use support::{Graphs, Varying};

const EXAMPLES: &[(&str, &[f64])] = &[
    // The arguments that follow the point.
    ("csg_model.vola", &[]),
    ("normals.vola", &[0.5]),
    ("fractal.vola", &[5.0, 2.0]),
    ("thesis/sphere.vola", &[]),
    ("thesis/hard_union.vola", &[]),
    ("thesis/smooth_union.vola", &[]),
    ("thesis/blob.vola", &[]),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples")
}

fn source(name: &str) -> String {
    fs::read_to_string(folder().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn the_list_is_complete() {
    let mut found = Vec::new();
    for sub in ["", "thesis"] {
        for entry in fs::read_dir(folder().join(sub)).expect("the folder") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|e| e == "vola") {
                found.push(path.strip_prefix(folder()).expect("inside").to_string_lossy().into_owned());
            }
        }
    }
    for name in &found {
        assert!(EXAMPLES.iter().any(|(n, _)| n == name), "{name} is not tested");
    }
    assert_eq!(found.len(), EXAMPLES.len());
}

#[test]
fn each_compiles_without_a_diagnostic_and_says_how_to_run_it() {
    for (name, _) in EXAMPLES {
        let text = source(name);
        assert!(
            text.starts_with("//") && text.contains(&format!("isograd eval examples/{name}")),
            "{name}: no command"
        );
        let checked = support::check(&text);
        assert!(checked.diagnostics.is_empty(), "{name}: {}", support::listed(&checked.diagnostics));
        for export in checked.exports() {
            let late = support::compile(&checked, &export.name);
            let late = late.unwrap_or_else(|e| panic!("{name}: {}", support::listed(&e)));
            assert!(late.is_empty(), "{name}: {}", support::listed(&late));
        }
    }
}

#[test]
fn gradients_are_differences() {
    for (name, rest) in EXAMPLES {
        let checked = support::check_ok(&source(name));
        let function = support::export(&checked, "field");
        let kinds = support::inputs(function);
        let queries = [Query::Value, Query::Gradient("at".into())];
        let graphs = Graphs::of(&checked, "field", &queries, Precision::F64).expect("graphs");
        let values = |point: &[f64]| -> Vec<Value> {
            let all = point.iter().chain(*rest);
            kinds.iter().zip(all).map(|(k, x)| support::value(*k, *x, Precision::F64)).collect()
        };
        let points = in_box(&[(-2.0, 2.0); 3], 100, 0x0150_97ad);
        let arguments: Vec<_> = points.iter().map(|p| values(p)).collect();
        let emitted = graphs.emitted(&arguments);
        let lanes = support::wasm(&checked, function, &queries, Precision::F64, Varying::First, &arguments);
        let mut skipped = 0;
        for ((point, row), lane) in points.iter().zip(&emitted).zip(lanes.expect("wasm")) {
            assert!(row.iter().zip(&lane).all(|(a, b)| a.same_bits(*b)), "{name}: {point:?}: {row:?} is not {lane:?}");
            for axis in 0..3 {
                let value_at = |p: &[f64]| support::number(graphs.oracle(&[values(p)])[0][0]);
                let Some(slope) = support::slope(value_at, point, axis) else {
                    skipped += 1;
                    continue;
                };
                let gradient = support::number(row[1 + axis]);
                assert!((gradient - slope).abs() < 1e-5, "{name}: {point:?} along {axis}: {gradient}, not {slope}");
            }
        }
        println!("{name:28} {skipped:3} of 300 slopes too near a kink");
        assert!(skipped < 60, "{name}: {skipped} slopes could not be judged");
    }
}

#[test]
fn the_model_of_figure_a1() {
    let checked = support::check_ok(&source("csg_model.vola"));
    for (export, point, expected) in [
        ("field", [0.0, 0.0, 0.0], &[0.35][..]),
        ("field", [0.5, 0.5, 0.1], &[0.014_142_8]),
        ("color", [0.0, 0.0, 0.0], &[0.0, 1.0, 0.0]),
        ("color", [0.5, 0.5, 0.1], &[0.0, 0.0, 1.0]),
        ("color", [0.6, 0.0, 0.0], &[0.0, 1.0, 0.0]),
        ("color", [0.55, 0.3, 0.3], &[1.0, 0.0, 0.0]),
    ] {
        let point = vec![point.map(Value::Real).to_vec()];
        let function = support::export(&checked, export);
        let row = support::wasm(&checked, function, &[Query::Value], Precision::F32, Varying::First, &point);
        let row = row.expect("wasm").remove(0);
        let near = row.iter().zip(expected).all(|(a, b)| (support::number(*a) - b).abs() < 1e-5);
        assert!(near && row.len() == expected.len(), "{export} at {point:?}: {row:?}, not {expected:?}");
    }
}
