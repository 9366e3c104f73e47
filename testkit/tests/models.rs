//! Compiled programs of the standard library against models written by hand: value, gradient and Hessian.

#![allow(clippy::pedantic, reason = "tests")]

use glam::DVec3;
use isograd_compiler::{Artefact, MemoryLoader, Options, Precision, Query, Rate, Request, check, compile};
use isograd_graph::Unwatched;
use isograd_runtime::{EvalOptions, Runtime, Settings, Values};
use isograd_testkit::laws;
use isograd_testkit::models::{Field, cuboid, smooth_union, sphere, translated, union};
use isograd_testkit::points::{Random, in_box};

const SHAPES: &str = "
module std::sphere;
module std::box;
module std::smooth_union;
module std::union;
module std::trans3d;

export fn ball(at: vec3, radius: real) -> real {
    csg s = Sphere(radius);
    eval s.Sdf3d(at)
}
export fn cuboid(at: vec3, extent: vec3) -> real {
    csg s = Box(extent);
    eval s.Sdf3d(at)
}
export fn melted(at: vec3, offset: vec3, k: real) -> real {
    csg s = SmoothUnion(k){ Sphere(1.0) }{ Trans3d(offset){ Box([0.75, 0.5, 1.0]) } };
    eval s.Sdf3d(at)
}
";

fn compiled(source: &str, export: &str, precision: Precision) -> Artefact {
    let options = Options { verify: true, ..Options::default() };
    let checked = check("main.vola", source.into(), &MemoryLoader::default(), &options, &Unwatched);
    assert!(checked.is_ok(), "{:?}", checked.diagnostics);
    let parameters = checked.exports().into_iter().find(|e| e.name == export).expect("the export").parameters;
    let request = Request {
        export: export.into(),
        queries: vec![Query::Value, Query::Gradient("at".into()), Query::Hessian("at".into(), "at".into())],
        precision,
        rates: parameters.into_iter().map(|p| (p.name, Rate::Varying)).collect(),
        ..Request::default()
    };
    compile(&checked, &request, &options, &Unwatched).unwrap_or_else(|e| panic!("{e:?}"))
}

/// Columns of the rows.
fn columns(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    (0..rows[0].len()).map(|k| rows.iter().map(|row| row[k]).collect()).collect()
}

/// 13 numbers per row: value, gradient, Hessian.
fn evaluate(artefact: &Artefact, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let kernel = Runtime::new(Settings::default()).load(artefact).expect("loads");
    let inputs = columns(rows);
    let inputs: Vec<Values<'_>> = inputs.iter().map(|c| Values::F64(c)).collect();
    let outputs = kernel.evaluate(&inputs, rows.len(), &EvalOptions::default()).expect("evaluates");
    assert_eq!(outputs.len(), 13, "value, gradient and Hessian");
    (0..rows.len()).map(|i| outputs.iter().map(|c| c.get(i).expect("a row")).collect()).collect()
}

fn numbers(field: &Field) -> Vec<f64> {
    let mut all = vec![field.value];
    all.extend(field.gradient.to_array());
    all.extend(field.hessian.to_cols_array());
    all
}

/// Compares a program with its model at rows of parameters, `at` first. The tolerance is so many units in the last
/// place of the sizes that enter, a derivative's divided by the clearance for each order: rounding moves the point by
/// that much, and curvature grows with one over the distance to the next edge.
fn agree(source: &str, export: &str, rows: Vec<Vec<f64>>, model: impl Fn(&[f64]) -> Field) {
    const ULPS: f64 = 32.0;
    for precision in [Precision::F64, Precision::F32] {
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|x| precision.round(*x)).collect()).collect();
        let unit = if precision == Precision::F32 { f64::from(f32::EPSILON) } else { f64::EPSILON };
        let artefact = compiled(source, export, precision);
        let (mut judged, mut unjudged) = (0, 0);
        for (row, got) in rows.iter().zip(evaluate(&artefact, &rows)) {
            let field = model(row);
            if field.clearance < 1e-2 {
                unjudged += 1;
                continue;
            }
            judged += 1;
            let size = row.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
            let near = field.clearance.min(1.0);
            for (k, (got, want)) in got.iter().zip(numbers(&field)).enumerate() {
                let order = match k {
                    0 => 0,
                    1..4 => 1,
                    _ => 2,
                };
                let tolerance = ULPS * unit * size / near.powi(order);
                assert!(
                    (got - want).abs() <= tolerance,
                    "{export} {precision:?} at {row:?}, number {k}: {got:?}, the model says {want:?} ± {tolerance:.1e}"
                );
            }
        }
        println!("{export} {precision:?}: {judged} points judged, {unjudged} not");
        assert!(judged > 9 * unjudged, "{judged} {unjudged}");
    }
}

const AROUND: (f64, f64) = (-2.5, 2.5);

#[test]
fn a_sphere() {
    agree(SHAPES, "ball", in_box(&[AROUND, AROUND, AROUND, (0.2, 2.0)], 20_000, 1), |p| {
        sphere(DVec3::new(p[0], p[1], p[2]), p[3])
    });
}

#[test]
fn a_box() {
    let sides = [AROUND, AROUND, AROUND, (0.3, 2.0), (0.3, 2.0), (0.3, 2.0)];
    agree(SHAPES, "cuboid", in_box(&sides, 20_000, 2), |p| {
        cuboid(DVec3::new(p[0], p[1], p[2]), DVec3::new(p[3], p[4], p[5]))
    });
}

#[test]
fn a_smooth_union() {
    let sides = [AROUND, AROUND, AROUND, (-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0), (0.25, 1.0)];
    agree(SHAPES, "melted", in_box(&sides, 20_000, 3), |p| {
        let at = DVec3::new(p[0], p[1], p[2]);
        let block = |p| cuboid(p, DVec3::new(0.75, 0.5, 1.0));
        smooth_union(sphere(at, 1.0), translated(at, DVec3::new(p[3], p[4], p[5]), block), p[6])
    });
}

/// Scenarios of the thesis's table 5.1, as they stand in `examples`.
#[test]
fn the_scenarios_of_the_thesis() {
    let block = |at: DVec3| translated(at, DVec3::new(1.0, 0.5, 0.0), |p| cuboid(p, DVec3::new(0.8, 0.6, 0.7)));
    let points = || in_box(&[AROUND; 3], 5_000, 4);
    let at = |p: &[f64]| DVec3::new(p[0], p[1], p[2]);
    agree(include_str!("../../examples/thesis/sphere.vola"), "field", points(), |p| sphere(at(p), 1.0));
    agree(include_str!("../../examples/thesis/hard_union.vola"), "field", points(), |p| {
        union(sphere(at(p), 1.0), block(at(p)))
    });
    agree(include_str!("../../examples/thesis/smooth_union.vola"), "field", points(), |p| {
        smooth_union(sphere(at(p), 1.0), block(at(p)), 0.4)
    });
}

/// Where other libraries give NaN: centres, faces, edges, corners, the interior, and points whose squares underflow.
#[test]
fn derivatives_are_numbers_everywhere() {
    let mut points = vec![[0.0; 3], [1e-30, 0.0, 0.0], [-1e-300, 1e-300, 0.0]];
    let marks = [-1.5, -1.0, -0.5, -0.0, 0.0, 0.5, 1.0, 1.5];
    for x in marks {
        for y in marks {
            points.extend(marks.map(|z| [x, y, z]));
        }
    }
    let cases: [(&str, &[f64]); 3] =
        [("ball", &[1.0]), ("cuboid", &[1.0, 0.5, 1.5]), ("melted", &[1.0, 0.5, 0.0, 0.5])];
    for (export, rest) in cases {
        for precision in [Precision::F32, Precision::F64] {
            let rows: Vec<Vec<f64>> = points.iter().map(|p| p.iter().chain(rest).copied().collect()).collect();
            for (row, got) in rows.iter().zip(evaluate(&compiled(SHAPES, export, precision), &rows)) {
                assert!(got.iter().all(|x| x.is_finite()), "{export} {precision:?} at {row:?}: {got:?}");
                let slope = DVec3::new(got[1], got[2], got[3]).length();
                assert!(slope < 1.0 + 1e-6, "{export} {precision:?} at {row:?}: slope {slope}");
            }
        }
    }
    let centre = evaluate(&compiled(SHAPES, "ball", Precision::F32), &[vec![0.0, 0.0, 0.0, 2.0]]);
    assert_eq!(centre[0][0], -2.0);
    assert!(centre[0][1..].iter().all(|x| *x == 0.0), "LANGUAGE 13.6: {centre:?}");
}

#[test]
fn batches_and_threads_do_not_show() {
    let mut random = Random::new(5);
    for precision in [Precision::F32, Precision::F64] {
        for (export, n) in [("cuboid", 6), ("melted", 7)] {
            let columns: Vec<Vec<f64>> =
                (0..n).map(|_| (0..30_011).map(|_| precision.round(random.within((0.1, 2.0)))).collect()).collect();
            let count = laws::batches(&compiled(SHAPES, export, precision), &columns).unwrap_or_else(|e| panic!("{e}"));
            assert!(count.judged > 1_000_000);
        }
    }
}
