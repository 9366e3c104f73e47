//! Shapes of the standard library against formulas derived by hand: value, gradient and Hessian, compiled to
//! WebAssembly in both precisions and both sweeps. Knows nothing of how derivatives are made.

#[path = "../support/mod.rs"]
mod support;

use glam::DVec3;
use isograd_compiler::{DerivativeMode, Precision, Query};
use isograd_graph::Value;
use isograd_testkit::models::{
    Field, capsule, cuboid, cylinder, ellipsoid, gyroid, intersection, plane, repeated, round_box, smooth_union,
    sphere, torus, translated, twisted, union,
};
use isograd_testkit::points::in_box;
use support::{Varying, check_ok, export, request};

const PROGRAM: &str = "
module std::prelude;

export fn a_sphere(at: vec3) -> real { csg s = Sphere(1.25); eval s.Sdf3d(at) }
export fn a_box(at: vec3) -> real { csg s = Box([1.0, 0.75, 1.25]); eval s.Sdf3d(at) }
export fn a_torus(at: vec3) -> real { csg s = Torus(1.25, 0.5); eval s.Sdf3d(at) }
export fn a_capsule(at: vec3) -> real {
    csg s = Capsule([-1.0, 0.5, 0.0], [1.0, -0.5, 0.75], 0.5);
    eval s.Sdf3d(at)
}
export fn a_cylinder(at: vec3) -> real { csg s = Cylinder(1.0, 0.75); eval s.Sdf3d(at) }
export fn a_plane(at: vec3) -> real { csg s = Plane([1.0, -2.0, 0.5], 0.25); eval s.Sdf3d(at) }
export fn a_round_box(at: vec3) -> real { csg s = RoundBox([1.0, 0.75, 1.25], 0.25); eval s.Sdf3d(at) }
export fn melted(at: vec3) -> real {
    csg s = SmoothUnion(0.5){ Sphere(1.0) }{ Trans3d([1.0, 0.5, 0.0]){ Sphere(0.75) } };
    eval s.Sdf3d(at)
}
export fn united(at: vec3) -> real {
    csg s = Union(){ Sphere(1.0) }{ Trans3d([1.0, 0.5, 0.0]){ Sphere(0.75) } };
    eval s.Sdf3d(at)
}
export fn cut(at: vec3) -> real {
    csg s = Intersect(){ Sphere(1.0) }{ Trans3d([1.0, 0.5, 0.0]){ Sphere(0.75) } };
    eval s.Sdf3d(at)
}
export fn a_gyroid(at: vec3) -> real { csg s = Gyroid(2.5); eval s.Sdf3d(at) }
export fn an_ellipsoid(at: vec3) -> real { csg s = Ellipsoid([1.5, 0.75, 1.25]); eval s.Sdf3d(at) }
export fn many(at: vec3) -> real {
    csg s = Repeat([1.5, 2.0, 1.25]){ Sphere(0.5) };
    eval s.Sdf3d(at)
}
export fn turned(at: vec3) -> real {
    csg s = Twist(0.75){ Trans3d([1.0, 0.0, 0.0]){ Ellipsoid([1.5, 0.75, 1.25]) } };
    eval s.Sdf3d(at)
}
";

type Model = fn(DVec3) -> Field;

const fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The two balls of the booleans.
fn balls(p: DVec3) -> (Field, Field) {
    (sphere(p, 1.0), translated(p, v(1.0, 0.5, 0.0), |p| sphere(p, 0.75)))
}

const SHAPES: [(&str, Model); 14] = [
    ("a_sphere", |p| sphere(p, 1.25)),
    ("a_box", |p| cuboid(p, v(1.0, 0.75, 1.25))),
    ("a_torus", |p| torus(p, 1.25, 0.5)),
    ("a_capsule", |p| capsule(p, v(-1.0, 0.5, 0.0), v(1.0, -0.5, 0.75), 0.5)),
    ("a_cylinder", |p| cylinder(p, 1.0, 0.75)),
    ("a_plane", |p| plane(p, v(1.0, -2.0, 0.5), 0.25)),
    ("a_round_box", |p| round_box(p, v(1.0, 0.75, 1.25), 0.25)),
    ("melted", |p| {
        let (a, b) = balls(p);
        smooth_union(a, b, 0.5)
    }),
    ("united", |p| {
        let (a, b) = balls(p);
        union(a, b)
    }),
    ("cut", |p| {
        let (a, b) = balls(p);
        intersection(a, b)
    }),
    ("a_gyroid", |p| gyroid(p, 2.5)),
    ("an_ellipsoid", |p| ellipsoid(p, v(1.5, 0.75, 1.25))),
    ("many", |p| repeated(p, v(1.5, 2.0, 1.25), |p| sphere(p, 0.5))),
    ("turned", |p| twisted(p, 0.75, |p| translated(p, DVec3::X, |p| ellipsoid(p, v(1.5, 0.75, 1.25))))),
];

fn numbers(field: &Field) -> Vec<f64> {
    let mut all = vec![field.value];
    all.extend(field.gradient.to_array());
    all.extend(field.hessian.to_cols_array());
    all
}

/// The tolerance is so many units in the last place of the sizes that enter, a derivative's divided by the clearance
/// for each order: rounding moves the point by that much, and curvature grows with one over the distance to an edge.
/// Points nearer to an edge than 1/50 are not judged.
#[test]
fn shapes_are_their_formulas() {
    const ULPS: f64 = 64.0;
    let checked = check_ok(PROGRAM);
    let points = in_box(&[(-2.5, 2.5); 3], 2_000, 21);
    let queries = [Query::Value, Query::Gradient("at".into()), Query::Hessian("at".into(), "at".into())];
    for (name, model) in SHAPES {
        let function = export(&checked, name);
        for precision in [Precision::F64, Precision::F32] {
            let unit = if precision == Precision::F32 { f64::from(f32::EPSILON) } else { f64::EPSILON };
            let points: Vec<Vec<f64>> =
                points.iter().map(|p| p.iter().map(|x| precision.round(*x)).collect()).collect();
            let rows: Vec<Vec<Value>> = points.iter().map(|p| p.iter().map(|x| Value::Real(*x)).collect()).collect();
            for mode in [DerivativeMode::Forward, DerivativeMode::Reverse] {
                let request = request(function, &queries, precision, mode, Varying::All);
                let all = support::evaluated(&checked, &request, &rows).unwrap_or_else(|e| panic!("{name}: {e}"));
                let (mut judged, mut unjudged) = (0, 0);
                for (point, got) in points.iter().zip(all) {
                    let field = model(DVec3::from_slice(point));
                    if field.clearance < 0.02 {
                        unjudged += 1;
                        continue;
                    }
                    judged += 1;
                    let near = field.clearance.min(1.0);
                    let want = numbers(&field);
                    assert_eq!(got.len(), want.len(), "{name}");
                    for (k, (got, want)) in got.into_iter().map(support::number).zip(want).enumerate() {
                        let order = match k {
                            0 => 0,
                            1..4 => 1,
                            _ => 2,
                        };
                        let tolerance = ULPS * unit * (1.0 + want.abs()) / near.powi(order);
                        assert!(
                            (got - want).abs() <= tolerance,
                            "{name} {precision:?} {mode:?} at {point:?}, number {k}: {got:?}, by hand {want:?} ± \
                             {tolerance:.1e}"
                        );
                    }
                }
                println!("{name} {precision:?} {mode:?}: {judged} points judged, {unjudged} not");
                assert!(judged > 7 * unjudged, "{name}: {judged} {unjudged}");
            }
        }
    }
}
