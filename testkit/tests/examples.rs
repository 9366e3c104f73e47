//! The programs in `examples/` compile without a diagnostic and have the values and gradients that their figures and
//! differences demand. Knows nothing of how they are evaluated.

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use isograd_compiler::{Checked, DerivativeMode, Differentiability, Number, Precision, Query, Request, Sensitivity};
use isograd_graph::{Unwatched, Value};
use isograd_testkit::points::in_box;
use support::{Graphs, Sweep, Varying};

const EXAMPLES: &[(&str, &[f64])] = &[
    // The arguments that follow the point.
    ("csg_model.vola", &[]),
    ("normals.vola", &[0.5]),
    ("fractal.vola", &[5.0, 2.0]),
    ("along_curve.vola", &[0.7]),
    ("edge_sharpness.vola", &[]),
    ("bevelled_union.vola", &[]),
    ("ranged_parameters.vola", &[1.0, 1.5, 0.1, 0.2, 0.3, 2.0]),
    ("thesis/sphere.vola", &[]),
    ("thesis/hard_union.vola", &[]),
    ("thesis/smooth_union.vola", &[]),
    ("thesis/blob.vola", &[]),
];

/// Examples of queries, each with numbers of its own.
const QUERIES: &[&str] = &[
    "queries/directional.vola",
    "queries/enclosure.vola",
    "queries/kinks.vola",
    "queries/smooth.vola",
    "queries/specialise.vola",
    "queries/strict.vola",
    "queries/third_derivative.vola",
];

/// All examples.
fn names() -> impl Iterator<Item = &'static str> {
    EXAMPLES.iter().map(|(name, _)| *name).chain(QUERIES.iter().copied())
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples")
}

fn source(name: &str) -> String {
    fs::read_to_string(folder().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn the_list_is_complete() {
    let mut found = Vec::new();
    for sub in ["", "thesis", "queries"] {
        for entry in fs::read_dir(folder().join(sub)).expect("the folder") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|e| e == "vola") {
                found.push(path.strip_prefix(folder()).expect("inside").to_string_lossy().into_owned());
            }
        }
    }
    for name in &found {
        assert!(names().any(|n| n == name), "{name} is not tested");
    }
    assert_eq!(found.len(), names().count());
}

#[test]
fn each_compiles_without_a_diagnostic_and_says_how_to_run_it() {
    for name in names() {
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

/// A request for some queries of an export.
fn request(export: &str, queries: &[&str]) -> Request {
    let queries = queries.iter().map(|q| q.parse().expect("a query")).collect();
    Request { export: export.to_owned(), queries, ..Request::default() }
}

/// The same in the mode `smooth`.
fn smooth(request: Request, sensitivity: &str) -> Request {
    let sensitivity: Sensitivity = sensitivity.parse().expect("a sensitivity");
    Request { differentiability: Differentiability::Smooth, sensitivity: Some(sensitivity), ..request }
}

/// Rows of a request, whose inputs are all real, and what they must be, to 2e-6 of their size; a truth value is 0 or 1.
fn expect_answers(name: &str, request: &Request, rows: &[(&[f64], &[f64])]) {
    let checked = support::check_ok(&source(name));
    for (point, expected) in rows {
        let row = support::evaluated(&checked, request, &[point.iter().map(|x| Value::Real(*x)).collect()]);
        let row = row.expect("an artefact").remove(0);
        let near = |a: f64, b: f64| (a - b).abs() <= 2e-6 * b.abs().max(1.0);
        let all = row.iter().zip(*expected).all(|(a, b)| near(support::number(*a), *b));
        assert!(all && row.len() == expected.len(), "{name} at {point:?}: {row:?}, not {expected:?}");
    }
}

#[test]
fn a_disc_is_enclosed_and_grows_no_faster_than_its_gradient() {
    let name = "queries/enclosure.vola";
    let far: &[f64] = &[4.0, 32f64.sqrt() - 1.0, 0.0, 1.28f64.sqrt(), 0.0];
    let around: &[f64] = &[-1.0, 2f64.sqrt() - 1.0, 0.0, 2f64.sqrt(), 0.0];
    let asked = request("field", &["bound(at)", "lipschitz(at)"]);
    expect_answers(name, &asked, &[(&[3.0, 4.0, 4.0, 4.0], far), (&[-1.0, 1.0, -1.0, 1.0], around)]);
    expect_answers(name, &request("empty", &["value"]), &[(&[3.0, 4.0, 0.5], &[1.0]), (&[0.0, 1.5, 0.75], &[0.0])]);
}

#[test]
fn polar_coordinates_along_directions() {
    let across: (&[f64], &[f64]) = (&[3.0, 4.0, -4.0, 3.0], &[0.0, 1.0]);
    let outwards: (&[f64], &[f64]) = (&[3.0, 4.0, 3.0, 4.0], &[5.0, 0.0]);
    expect_answers("queries/directional.vola", &request("polar", &["directional(at)"]), &[across, outwards]);
}

#[test]
fn a_union_tells_where_it_has_no_gradient() {
    let (five, aside) = (5f64.sqrt(), 4.25f64.sqrt());
    let asked = request("pair", &["value", "gradient(at)", "kinks(at)"]);
    // Kink 2 is `min`, after the two lengths.
    let in_the_middle: &[f64] = &[five - 1.0, 1.0 / five, 2.0 / five, 0.0, 1.0, 0.0, 2.0, 0.0];
    let beside: &[f64] = &[aside - 1.0, -0.5 / aside, 2.0 / aside, 0.0, 0.0, 2.5 - aside, 2.0, 1.0];
    expect_answers("queries/kinks.vola", &asked, &[(&[0.0, 2.0, 0.0], in_the_middle), (&[0.5, 2.0, 0.0], beside)]);
}

#[test]
fn a_range_proves_that_a_derivative_exists() {
    let name = "queries/strict.vola";
    let strict = |export| Request {
        differentiability: Differentiability::Strict,
        ..request(export, &["value", "gradient(x)", "hessian(x)"])
    };
    expect_answers(name, &strict("beside"), &[(&[2.0], &[1.5, 1.0, 0.0])]);
    let checked = support::check_ok(&source(name));
    let refused = support::evaluated(&checked, &strict("slab"), &[vec![Value::Real(2.0)]]);
    assert!(refused.as_ref().is_err_and(|e| e.starts_with("E0703")), "{refused:?}");
    expect_answers(name, &request("slab", &["value", "gradient(x)"]), &[(&[2.0], &[1.5, 1.0])]);
}

#[test]
fn a_smooth_crease_has_a_width() {
    let name = "queries/smooth.vola";
    let asked = request("crease", &["value", "gradient(x)", "hessian(x)"]);
    let at = |x: f64| [(2.0 * x).exp().ln_1p() - x, x.tanh(), x.cosh().powi(-2)];
    expect_answers(name, &smooth(asked.clone(), "1000"), &[(&[0.0], &at(0.0)), (&[0.5], &at(0.5))]);
    expect_answers(name, &asked, &[(&[0.0], &[0.0; 3]), (&[0.5], &[0.5, 1.0, 0.0])]);
}

#[test]
fn one_ball_is_left_in_its_box() {
    let name = "queries/specialise.vola";
    let [lo, hi] = [[4.0, -1.0, -1.0], [6.0, 1.0, 1.0]];
    let ends = lo.iter().zip(hi).map(|(lo, hi)| [Number(*lo), Number(hi)]).collect();
    let whole = request("row", &["value", "gradient(at)"]);
    let inside = Request { within: [("at".to_owned(), ends)].into(), ..whole.clone() };
    let checked = support::check_ok(&source(name));
    let manifest = |request| {
        isograd_compiler::compile(&checked, request, &support::options(), &Unwatched).expect("an artefact").manifest
    };
    let (all, left) = (manifest(&whole), manifest(&inside));
    assert!(3 * left.operations <= all.operations, "{left:?}");
    assert!(left.specialised.is_some_and(|s| s.to < s.from) && all.specialised.is_none(), "{left:?}");
    for point in in_box(&[(4.0, 6.0), (-1.0, 1.0), (-1.0, 1.0)], 50, 0x0150_97ad) {
        let point = [point.iter().map(|x| Value::Real(Precision::F32.round(*x))).collect()];
        let bits = |request| support::evaluated(&checked, request, &point).expect("an artefact").remove(0);
        assert!(bits(&whole).iter().zip(bits(&inside)).all(|(a, b)| a.same_bits(b)), "{point:?}");
    }
    expect_answers(name, &inside, &[(&[5.5, 0.0, 0.0], &[-0.5, 1.0, 0.0, 0.0])]);
}

#[test]
fn third_derivatives_by_indexing() {
    let (x, y, z) = (1.0, 2.0, 3.0);
    let by_x = [0.0, 4.0 * y * z, 2.0 * y * y];
    let by_y = [4.0 * y * z, 4.0 * x * z, 4.0 * x * y];
    let by_z = [2.0 * y * y, 4.0 * x * y, 0.0];
    let expected = [by_x, by_y, by_z].concat();
    expect_answers("queries/third_derivative.vola", &request("third", &["value"]), &[(&[x, y, z], &expected)]);
}

#[test]
fn edges_have_a_bend_where_they_have_a_width() {
    let name = "bevelled_union.vola";
    // A face of the cube near its edge, the top of the ball, and below the bevel.
    let [face, ball, bevel] = [[0.75, 0.745, 0.5], [0.0, 1.25, 0.0], [0.56, 0.79, 0.0]];
    let radius = (0.56f64 * 0.56 + 0.04 * 0.04).sqrt();
    let exact = [(&face[..], &[0.0][..]), (&ball, &[2.0]), (&bevel, &[0.5f64.sqrt() / radius])];
    expect_answers(name, &request("sharpness", &["value"]), &exact);
    let checked = support::check_ok(&source(name));
    let bend = |request: &Request, point: &[f64]| {
        let row = support::evaluated(&checked, request, &[point.iter().map(|x| Value::Real(*x)).collect()]);
        support::number(row.expect("an artefact")[0][0])
    };
    let smoothed = smooth(request("sharpness", &["value"]), "10");
    let approximated = request("approximated", &["value"]);
    // By the edge both see one. Further in the largest of three zeros is all that smoothing leaves: w·ln 3 for w = 0.01.
    assert!(bend(&smoothed, &face) > 30.0 && bend(&approximated, &face) > 30.0);
    let inside = [0.75, 0.6, 0.5];
    assert!((bend(&smoothed, &inside) - 0.01 * 3f64.ln()).abs() < 1e-4, "{}", bend(&smoothed, &inside));
    assert!(bend(&approximated, &inside) > 0.1, "{}", bend(&approximated, &inside));
}
