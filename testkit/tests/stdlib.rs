//! What LANGUAGE Appendix A promises of every entry of the standard library: it stands alone, is documented, never
//! gives a NaN, has the gradient that differences see, and the class it claims. Values at single points are in
//! `language/library.cases`.

mod support;

use isograd_compiler::{Precision, Query, standard_library};
use isograd_graph::Value;
use isograd_program::ScalarKind;
use isograd_testkit::points::in_box;
use support::{Graphs, Varying};

/// The classes of LANGUAGE A.3.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Class {
    /// Right zero set and sign only.
    Neither,
    /// Lipschitz constant 1.
    Lower,
    /// Gradient of length 1 wherever there is one.
    Unit,
    /// The distance.
    Exact,
}
use Class::{Exact, Lower, Neither, Unit};

/// A tree for each entry, with the class it must have.
const FIELDS: &[(&str, &str, Class)] = &[
    ("Sphere", "Sphere(1.0)", Exact),
    ("Box", "Box([1.0, 0.5, 1.5])", Exact),
    ("Box, flat", "Box([1.0, 0.0, 1.0])", Exact),
    ("Cylinder", "Cylinder(1.0, 0.5)", Exact),
    ("Cylinder, thin", "Cylinder(0.0, 0.5)", Exact),
    ("Capsule", "Capsule([0.0, 0.0, -1.0], [0.0, 0.0, 1.0], 0.5)", Exact),
    ("Capsule, oblique", "Capsule([-1.0, 0.5, 0.0], [1.0, 1.0, -0.5], 0.25)", Exact),
    ("Capsule, short", "Capsule([0.0; 3], [0.0, 1e-25, 0.0], 0.5)", Exact),
    ("Round", "Round(0.25){ Box([1.0, 0.5, 1.5]) }", Exact),
    ("Round, inwards", "Round(-0.25){ Box([1.0, 0.5, 1.5]) }", Unit),
    ("Union", "Union(){ Sphere(1.0) }{ Box([0.5, 1.5, 0.5]) }", Unit),
    ("Intersect", "Intersect(){ Sphere(1.0) }{ Box([0.5, 1.5, 0.5]) }", Unit),
    ("Subtract", "Subtract(){ Sphere(1.0) }{ Box([0.5, 1.5, 0.5]) }", Unit),
    ("SmoothUnion", "SmoothUnion(0.5){ Sphere(1.0) }{ Box([0.5, 1.5, 0.5]) }", Lower),
    ("SmoothUnion, equal", "SmoothUnion(0.5){ Sphere(1.0) }{ Sphere(1.0) }", Lower),
    ("SmoothUnion, narrow", "SmoothUnion(1e-30){ Sphere(1.0) }{ Box([0.5, 1.5, 0.5]) }", Lower),
    ("UnionChamfer", "UnionChamfer(0.25){ Sphere(1.0) }{ Box([0.5, 1.5, 0.5]) }", Neither),
    ("UnionStairs", "UnionStairs(0.5, 3.0){ Sphere(1.0) }{ Box([0.5, 1.5, 0.5]) }", Unit),
    ("Trans3d", "Trans3d([1.0, 0.5, -1.0]){ Box([1.0, 0.5, 1.5]) }", Exact),
    ("Tran3d", "Tran3d([1.0, 0.5, -1.0]){ Box([1.0, 0.5, 1.5]) }", Exact),
    ("Rot3dAxis", "Rot3dAxis([1.0, 2.0, -1.0], 0.75){ Box([1.0, 0.5, 1.5]) }", Exact),
    ("SetColor", "SetColor([1.0, 0.5, 0.0]){ Cylinder(1.0, 0.5) }", Exact),
    ("NormalToColor", "NormalToColor(){ Cylinder(1.0, 0.5) }", Exact),
    ("Sharpness", "Sharpness(1.0, [0.0; 3], [1.0; 3]){ Cylinder(1.0, 0.5) }", Exact),
    ("ObjectAlong", "ObjectAlong([sin(time), 3.0 * time, time * time], time){ Box([1.0, 0.5, 1.5]) }", Lower),
    ("ObjectAlong, upwards", "ObjectAlong([0.0, 0.0, time * time], time){ Box([1.0, 0.5, 1.5]) }", Lower),
    ("ObjectAlong, at rest", "ObjectAlong([0.5, 0.0, 0.0], time){ Box([1.0, 0.5, 1.5]) }", Exact),
];

fn program(tree: &str) -> String {
    format!(
        "module std::prelude;
        export fn f(p: vec3, time: real) -> real {{ csg tree = {tree}; eval tree.Sdf3d(p) }}
        export fn colors(p: vec3, time: real) -> vec3 {{
            csg tree = NormalToColor(){{ {tree} }};
            csg marked = Sharpness(1.0, [0.0; 3], [0.5; 3]){{ {tree} }};
            eval tree.Color3d(p) + eval marked.Color3d(p)
        }}"
    )
}

fn all_queries() -> [Query; 3] {
    [Query::Value, Query::Gradient("p".into()), Query::Hessian("p".into())]
}

fn reals(point: &[f64], precision: Precision) -> Vec<Value> {
    let time = 0.75;
    point.iter().chain([&time]).map(|x| support::value(ScalarKind::Real, *x, precision)).collect()
}

fn numbers(rows: Vec<Vec<Value>>) -> Vec<Vec<f64>> {
    rows.into_iter().map(|row| row.into_iter().map(support::number).collect()).collect()
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn every_file_stands_alone() {
    for (file, _) in standard_library() {
        let stem = file.trim_end_matches(".vola");
        for library in ["std", "stdlib"] {
            let source = format!("module {library}::{stem};\nexport fn f(p: vec3) -> real {{ p.x }}");
            let checked = support::check(&source);
            assert!(checked.diagnostics.is_empty(), "{file}: {}", support::listed(&checked.diagnostics));
            support::compile(&checked, "f").unwrap_or_else(|e| panic!("{file}: {}", support::listed(&e)));
        }
    }
}

#[test]
fn the_prelude_imports_every_file() {
    let files = standard_library();
    let (_, prelude) = files.iter().find(|(name, _)| name == "prelude.vola").expect("the prelude");
    for (file, _) in files.iter().filter(|(name, _)| name != "prelude.vola") {
        let import = format!("module self::{};", file.trim_end_matches(".vola"));
        assert!(prelude.lines().any(|line| line == import), "no `{import}`");
    }
}

#[test]
fn every_declaration_is_documented() {
    for (file, text) in standard_library() {
        let mut doc = String::new();
        for line in text.lines() {
            let declares = |word: &str| line.starts_with(word);
            if let Some(rest) = line.strip_prefix("///") {
                doc += rest;
            } else if declares("entity ") || declares("operation ") || declares("concept ") {
                assert!(doc.contains("Source:"), "{file}: no source: {line}");
                assert!(doc.contains("Needs:") || doc.contains("any real"), "{file}: no needs: {line}");
                let classed = declares("concept ") || doc.contains("Class") || doc.contains("class");
                assert!(classed, "{file}: no class: {line}");
            } else if !line.starts_with('#') {
                doc.clear();
            }
        }
    }
}

#[test]
fn every_operation_and_entity_is_tested() {
    for (file, text) in standard_library() {
        for line in text.lines().filter(|l| l.starts_with("entity ") || l.starts_with("operation ")) {
            let name = line.split([' ', '(']).nth(1).expect("a name");
            assert!(FIELDS.iter().any(|(entry, ..)| *entry == name), "{file}: `{name}` is not in FIELDS");
        }
    }
}

/// Faces, edges, corners, axes, rims, centres and diagonals of the shapes above, far points and tiny ones.
fn critical_points() -> Vec<Vec<f64>> {
    const AT: &[f64] = &[0.0, 1e-30, -1e-20, 0.25, 0.5, -0.5, 1.0, -1.0, 1.5, 2.0, 1e9, -1e9];
    let mut all = Vec::new();
    for x in AT {
        for y in AT {
            all.extend(AT.iter().map(|z| vec![*x, *y, *z]));
        }
    }
    all
}

#[test]
fn no_nan_at_critical_points() {
    for precision in [Precision::F32, Precision::F64] {
        let points: Vec<Vec<Value>> = critical_points().iter().map(|p| reals(p, precision)).collect();
        for (name, tree, _) in FIELDS {
            let checked = support::check_ok(&program(tree));
            for (export, queries) in [("f", &all_queries()[..]), ("colors", &all_queries()[..1])] {
                let graphs = Graphs::of(&checked, export, queries, precision)
                    .unwrap_or_else(|e| panic!("{name}: {}", support::listed(&e)));
                let emitted = graphs.emitted(&points);
                for (point, row) in points.iter().zip(&emitted) {
                    let nan = row.iter().position(|x| support::number(*x).is_nan());
                    assert!(nan.is_none(), "{name}, {export}, {}: NaN at {point:?}: {row:?}", precision.name());
                }
                let function = support::export(&checked, export);
                let lanes = support::wasm(&checked, function, queries, precision, Varying::First, &points)
                    .unwrap_or_else(|e| panic!("{name}: {e}"));
                for ((point, a), b) in points.iter().zip(&emitted).zip(&lanes) {
                    let same = a.iter().zip(b).all(|(a, b)| a.same_bits(*b));
                    assert!(same, "{name}, {export}, {}: at {point:?}: reference {a:?}, wasm {b:?}", precision.name());
                }
            }
        }
    }
}

/// Gradients at seeded points against differences; then the laws of the entry's class, where differences could judge.
#[test]
fn gradients_and_classes() {
    const POINTS: usize = 200;
    let mut table = String::new();
    for (name, tree, class) in FIELDS {
        let checked = support::check_ok(&program(tree));
        let graphs = |queries: &[Query]| Graphs::of(&checked, "f", queries, Precision::F64).expect("graphs");
        let (derived, plain) = (graphs(&all_queries()[..2]), graphs(&all_queries()[..1]));
        let value_at = |point: &[f64]| numbers(plain.oracle(&[reals(point, Precision::F64)]))[0][0];
        let mut skipped = 0;
        let mut previous: Option<(Vec<f64>, f64)> = None;
        for point in in_box(&[(-2.5, 2.5); 3], POINTS, 0x0150_9ead) {
            let row = numbers(derived.oracle(&[reals(&point, Precision::F64)])).remove(0);
            let (value, gradient) = (row[0], &row[1..]);
            let slopes: Vec<_> = (0..3).map(|axis| support::slope(value_at, &point, axis)).collect();
            if let Some((other, there)) = previous.replace((point.clone(), value))
                && *class >= Lower
            {
                let apart: Vec<f64> = point.iter().zip(&other).map(|(a, b)| a - b).collect();
                assert!((value - there).abs() <= norm(&apart) + 1e-9, "{name}: too steep from {other:?} to {point:?}");
            }
            if slopes.iter().any(Option::is_none) {
                skipped += 1;
                continue;
            }
            for (axis, slope) in slopes.iter().flatten().enumerate() {
                let off = (gradient[axis] - slope).abs();
                assert!(off < 1e-5, "{name}: at {point:?} gradient {gradient:?}, difference {slope} along {axis}");
            }
            let length = norm(gradient);
            assert!(*class < Lower || length < 1.0 + 1e-9, "{name}: at {point:?} the gradient is {length} long");
            assert!(*class < Unit || (length - 1.0).abs() < 1e-9, "{name}: at {point:?} the gradient is {length} long");
            if *class == Exact {
                let foot: Vec<f64> = point.iter().zip(gradient).map(|(x, g)| x - value * g).collect();
                let there = value_at(&foot);
                assert!(there.abs() < 1e-9, "{name}: at {point:?}, {there} is left after walking {value} home");
            }
        }
        table += &format!("{name:24} {skipped:3} of {POINTS} points too near a kink\n");
        assert!(skipped <= POINTS / 5, "{name}: {skipped} points could not be judged");
    }
    println!("{table}");
}
