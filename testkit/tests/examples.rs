//! The programs in `examples/` compile without a diagnostic and have the values and gradients that their figures and
//! differences demand. Knows nothing of how they are evaluated.

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use isograd_compiler::{Checked, DerivativeMode, Precision, Query};
use isograd_graph::Value;
use isograd_testkit::points::in_box;
use support::{Graphs, Sweep, Varying};

const EXAMPLES: &[(&str, &[f64])] = &[
    // The arguments that follow the point.
    ("csg_model.vola", &[]),
    ("normals.vola", &[0.5]),
    ("fractal.vola", &[5.0, 2.0]),
    ("along_curve.vola", &[0.7]),
    ("edge_sharpness.vola", &[]),
    ("ranged_parameters.vola", &[1.0, 1.5, 0.1, 0.2, 0.3, 2.0]),
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

/// The gradient of a `field` by a parameter at random points, against differences. Gives the number of slopes that lie
/// too near a kink to be judged.
fn gradient_is_a_difference(name: &str, rest: &[f64], parameter: &str, points: &[Vec<f64>]) -> usize {
    let checked = support::check_ok(&source(name));
    let function = support::export(&checked, "field");
    let kinds = support::inputs(function);
    let queries = [Query::Value, Query::Gradient(parameter.into())];
    let graphs = Graphs::of(&checked, "field", &queries, Precision::F64, Sweep::Forward).expect("graphs");
    let position = function.params.iter().position(|p| p.name == parameter).expect("the parameter");
    let first: u32 = function.params[..position].iter().map(|p| p.ty.len()).sum();
    let count = function.params[position].ty.len();
    let values = |point: &[f64]| -> Vec<Value> {
        kinds.iter().zip(point).map(|(k, x)| support::value(*k, *x, Precision::F64)).collect()
    };
    let points: Vec<Vec<f64>> = points.iter().map(|p| p.iter().chain(rest).copied().collect()).collect();
    let arguments: Vec<_> = points.iter().map(|p| values(p)).collect();
    let emitted = graphs.emitted(&arguments);
    let lanes = support::wasm(
        &checked,
        function,
        &queries,
        Precision::F64,
        DerivativeMode::Forward,
        Varying::First,
        &arguments,
    );
    let mut skipped = 0;
    for ((point, row), lane) in points.iter().zip(&emitted).zip(lanes.expect("wasm")) {
        assert!(row.iter().zip(&lane).all(|(a, b)| a.same_bits(*b)), "{name}: {point:?}: {row:?} is not {lane:?}");
        for axis in 0..count as usize {
            let value_at = |p: &[f64]| support::number(graphs.oracle(&[values(p)])[0][0]);
            let Some(slope) = support::slope(value_at, point, first as usize + axis) else {
                skipped += 1;
                continue;
            };
            let gradient = support::number(row[1 + axis]);
            let near = (gradient - slope).abs() < 1e-5;
            assert!(near, "{name}: {point:?} by {parameter}, {axis}: {gradient}, not {slope}");
        }
    }
    skipped
}

#[test]
fn gradients_are_differences() {
    let points = in_box(&[(-2.0, 2.0); 3], 100, 0x0150_97ad);
    for (name, rest) in EXAMPLES {
        let skipped = gradient_is_a_difference(name, rest, "at", &points);
        println!("{name:28} {skipped:3} of 300 slopes too near a kink");
        assert!(skipped < 60, "{name}: {skipped} slopes could not be judged");
    }
}

/// Rows of an export and what they must be, to 1e-5.
fn expect_rows(checked: &Checked, rows: &[(&str, &[f64], &[f64])]) {
    for (export, point, expected) in rows {
        let function = support::export(checked, export);
        let kinds = support::inputs(function);
        let arguments = kinds.iter().zip(*point).map(|(k, x)| support::value(*k, *x, Precision::F32)).collect();
        let row = support::wasm(
            checked,
            function,
            &[Query::Value],
            Precision::F32,
            DerivativeMode::Auto,
            Varying::First,
            &[arguments],
        );
        let row = row.expect("wasm").remove(0);
        let near = row.iter().zip(*expected).all(|(a, b)| (support::number(*a) - b).abs() < 1e-5);
        assert!(near && row.len() == expected.len(), "{export} at {point:?}: {row:?}, not {expected:?}");
    }
}

#[test]
fn the_model_of_figure_a1() {
    let checked = support::check_ok(&source("csg_model.vola"));
    expect_rows(
        &checked,
        &[
            ("field", &[0.0, 0.0, 0.0], &[0.35]),
            ("field", &[0.5, 0.5, 0.1], &[0.014_142_8]),
            ("color", &[0.0, 0.0, 0.0], &[0.0, 1.0, 0.0]),
            ("color", &[0.5, 0.5, 0.1], &[0.0, 0.0, 1.0]),
            ("color", &[0.6, 0.0, 0.0], &[0.0, 1.0, 0.0]),
            ("color", &[0.55, 0.3, 0.3], &[1.0, 0.0, 0.0]),
        ],
    );
}

#[test]
fn the_object_on_the_curve() {
    // At time 0 the curve is at its top, with velocity (3, 0, 0); its acceleration −15 stretches by k = 1.6.
    let checked = support::check_ok(&source("along_curve.vola"));
    let k: f64 = 1.6;
    let (ahead, above) = ((4.0 / k - 1.0) / k.sqrt(), (2.0 * k.sqrt() - 0.5) / k.sqrt());
    expect_rows(
        &checked,
        &[
            ("motion", &[0.0], &[0.0, 5.0, 0.0, 3.0, 0.0, 0.0, 0.0, -15.0, 0.0]),
            ("field", &[4.0, 5.0, 0.0, 0.0], &[ahead]),
            ("field", &[0.0, 7.0, 0.0, 0.0], &[above]),
            ("shade", &[4.0, 5.0, 0.0, 0.0], &[1.0, 0.0, 0.0]),
            ("shade", &[0.0, 7.0, 0.0, 0.0], &[0.0, 1.0, 0.0]),
        ],
    );
}

#[test]
fn the_surface_on_the_curve_moves_as_differences_say() {
    let points = in_box(&[(-4.0, 4.0), (-1.0, 6.0), (-2.0, 2.0)], 60, 0x0150_97ad);
    for time in [0.7, 2.0, 4.5] {
        let skipped = gradient_is_a_difference("along_curve.vola", &[time], "time", &points);
        assert!(skipped < 12, "at {time}: {skipped} slopes could not be judged");
    }
}

#[test]
fn edges_are_found_where_they_have_a_width() {
    const BLACK: &[f64] = &[0.0, 0.0, 0.0];
    const WHITE: &[f64] = &[1.0, 1.0, 1.0];
    // An edge of the block, its top face, the ball, and the seam between block and ball.
    let [edge, face, ball, seam] = [[0.4, 0.67, 0.67], [0.0, 0.7, 0.0], [2.0, 0.0, 0.0], [0.534, 0.7, 0.0]];
    let checked = support::check_ok(&source("edge_sharpness.vola"));
    expect_rows(
        &checked,
        &[
            ("edges", &edge, WHITE),
            ("edges", &face, BLACK),
            ("edges", &ball, BLACK),
            ("edges", &seam, WHITE),
            ("hard", &edge, WHITE),
            ("hard", &seam, BLACK),
            // The core of the edge is 0.07·√2 below the point, and both axes have √½ of the bend each.
            ("sharpness", &edge, &[1.0 / 0.14]),
            ("sharpness", &face, &[0.0]),
            ("sharpness", &ball, &[1.0 / 0.9]),
        ],
    );
}

/// The design parameters of the bracket.
const DESIGN: &[(&str, f64, (f64, f64))] = &[
    ("width", 1.0, (0.3, 2.0)),
    ("arm", 1.5, (1.0, 3.0)),
    ("thickness", 0.1, (0.02, 0.25)),
    ("hole", 0.2, (0.05, 0.3)),
    ("fillet", 0.3, (0.01, 0.5)),
    ("rows", 2.0, (1.0, 4.0)),
];

#[test]
fn design_parameters_tell_their_defaults_and_ranges() {
    let checked = support::check_ok(&source("ranged_parameters.vola"));
    for export in checked.exports() {
        let (at, design) = export.parameters.split_first().expect("a point");
        assert_eq!(at.default, None);
        assert_eq!(at.range, Some((vec![-4.0; 3], vec![4.0; 3])));
        let told = design.iter().map(|p| (p.name.as_str(), p.default.clone(), p.range.clone()));
        let declared =
            DESIGN.iter().map(|(n, d, (lower, upper))| (*n, Some(vec![*d]), Some((vec![*lower], vec![*upper]))));
        assert!(told.eq(declared), "{}: {design:?}", export.name);
    }
}

#[test]
fn each_design_parameter_has_its_gradient() {
    let points = in_box(&[(-0.5, 2.0), (-1.5, 1.5), (-0.5, 2.0)], 60, 0x0150_97ad);
    let design = DESIGN.iter().map(|(_, default, _)| *default).collect::<Vec<_>>();
    for rows in [1.0, 2.0, 3.0] {
        let mut rest = design.clone();
        *rest.last_mut().expect("the rows") = rows;
        for (parameter, ..) in DESIGN.iter().filter(|(name, ..)| *name != "rows") {
            let skipped = gradient_is_a_difference("ranged_parameters.vola", &rest, parameter, &points);
            assert!(skipped < 12, "{parameter}, {rows} rows: {skipped} slopes could not be judged");
        }
    }
}

#[test]
fn the_bracket_grows_where_its_parameters_do() {
    let checked = support::check_ok(&source("ranged_parameters.vola"));
    // On the end face, in a hole of the lying plate, on the side, and on the floor near the fillet.
    expect_rows(
        &checked,
        &[
            ("field", &[0.9, 0.5, 0.1, 1.0, 1.5, 0.1, 0.2, 0.3, 2.0], &[0.2]),
            ("field", &[0.1, 0.5, 0.9, 1.0, 1.5, 0.1, 0.2, 0.3, 2.0], &[0.2]),
            ("field", &[0.9, 0.0, 0.1, 1.0, 1.5, 0.1, 0.2, 0.3, 3.0], &[0.2]),
            ("sensitivity", &[1.5, 0.3, 0.1, 1.0, 1.5, 0.1, 0.2, 0.3, 2.0], &[0.0, 1.0, 0.0, 0.0, 0.0]),
            ("sensitivity", &[0.9, 0.3, 0.1, 1.0, 1.5, 0.1, 0.2, 0.3, 2.0], &[0.5, 0.0, 0.0, -1.0, 0.0]),
            ("sensitivity", &[1.2, 1.0, 0.1, 1.0, 1.5, 0.1, 0.2, 0.3, 2.0], &[1.0, 0.0, 0.0, 0.0, 0.0]),
        ],
    );
}
