//! Reports of kinks from the source text on: what is near, on which side, and what the manifest says of it.

use isograd_compiler::{
    Artefact, Checked, ColumnType, MemoryLoader, Options, Precision, Query, Request, Tolerance, Unwatched, check,
    compile, print_step,
};
use isograd_graph::{Evaluator, Graph, Value, parse};

fn checked(source: &str) -> Checked {
    let checked = check("main.vola", source.into(), &MemoryLoader::default(), &options(), &Unwatched);
    assert!(checked.is_ok(), "{:?}", checked.diagnostics);
    checked
}

fn options() -> Options {
    Options { verify: true, ..Options::default() }
}

fn request(export: &str, queries: &[&str]) -> Request {
    let queries = queries.iter().map(|q| q.parse().unwrap()).collect();
    Request { export: export.to_owned(), queries, precision: Precision::F64, ..Request::default() }
}

/// The optimised graph of a request, and its artefact.
struct Field {
    graph: Graph,
    artefact: Artefact,
}

impl Field {
    fn of(checked: &Checked, export: &str, queries: &[&str]) -> Self {
        let request = request(export, queries);
        let text = print_step(checked, &request, "optimise", &options(), &Unwatched).unwrap();
        let artefact = compile(checked, &request, &options(), &Unwatched).unwrap();
        Self { graph: parse(&text).unwrap(), artefact }
    }

    fn at(&self, point: &[f64]) -> Vec<f64> {
        let point: Vec<_> = point.iter().map(|x| Value::Real(*x)).collect();
        let all = Evaluator::new(&self.graph, Precision::F64).run(&point).unwrap();
        let number = |value: Value| match value {
            Value::Real(x) => x,
            Value::Int(x) => f64::from(x),
            Value::Bool(x) => f64::from(u8::from(x)),
        };
        all.into_iter().map(number).collect()
    }
}

const BALLS: &str = "\
module std::sphere;
module std::trans3d;
module std::union;

fn left() -> csg { Trans3d([-1.0, 0.0, 0.0]){ Sphere(1.5) } }
fn right() -> csg { Trans3d([1.0, 0.25, 0.0]){ Sphere(1.25) } }

export fn a(at: vec3) -> real { csg tree = left(); eval tree.Sdf3d(at) }
export fn b(at: vec3) -> real { csg tree = right(); eval tree.Sdf3d(at) }
export fn both(at: vec3) -> real { csg tree = Union(){ left() }{ right() }; eval tree.Sdf3d(at) }
";

#[test]
fn the_side_says_whose_gradient_a_union_gave() {
    let program = checked(BALLS);
    let [a, b] = ["a", "b"].map(|export| Field::of(&program, export, &["value", "gradient(at)"]));
    let both = Field::of(&program, "both", &["gradient(at)", "kinks(at)", "kinks(at, 0.125)"]);
    let kinks = &both.artefact.manifest.outputs[1].kinks;
    let union = kinks.iter().position(|k| k.operation == "min").unwrap();
    assert!(kinks[union].place.starts_with("std/union.vola:"), "{}", kinks[union].place);
    assert_eq!((&*kinks[union].set, &*kinks[union].discriminant), ("a = b", "a − b"));
    assert_eq!(kinks[union].derivatives, ["a′", "a′", "b′"]);
    let mut seen = [0; 2];
    let mut x = 1_u32;
    let mut random = || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(x >> 8) / f64::from(1 << 23) * 3.0 - 3.0
    };
    for _ in 0..500 {
        let point = [random(), random(), random()];
        let [of_a, of_b] = [&a, &b].map(|field| field.at(&point));
        let said = both.at(&point);
        let (gradient, distance, kink, side) = (&said[..3], said[4], said[5], said[6]);
        let off = of_a[0] - of_b[0];
        assert_eq!(said[7] == 1.0, distance <= 0.125, "{said:?}");
        if kink != union as f64 {
            // The nearer centre: the length of what was chosen.
            let chosen = if side_of(off) > 0.0 { of_b[0] + 1.25 } else { of_a[0] + 1.5 };
            assert!((distance - chosen).abs() < 1e-12 && distance <= off.abs(), "{said:?}");
            continue;
        }
        assert_eq!((distance, side), (off.abs(), side_of(off)), "{point:?}");
        let own = if side > 0.0 { &of_b } else { &of_a };
        assert_eq!(gradient, &own[1..], "{point:?}");
        seen[usize::from(side > 0.0)] += 1;
    }
    assert!(seen.iter().all(|n| *n > 50), "{seen:?}");
    // Equally far: 1.5 from the left centre less 1.5 is 1.25 from the right one less 1.25.
    let middle =
        Field::of(&checked(&BALLS.replace("0.25, 0.0", "0.0, 0.0").replace("1.25", "1.5")), "both", &["kinks(at)"]);
    assert_eq!(middle.at(&[0.0, 2.0, -1.0])[..2], [1.0, 0.0]);
    assert_eq!(middle.at(&[0.0, 2.0, -1.0])[3], 0.0);
}

fn side_of(off: f64) -> f64 {
    if off == 0.0 { 0.0 } else { off.signum() }
}

#[test]
fn a_box_has_creases_and_a_ball_a_centre() {
    let program = checked(
        "export fn box(at: vec2) -> real {
             let q = abs(at) - [1.0, 2.0];
             length(max(q, [0.0; 2])) + min(max(q.x, q.y), 0.0)
         }
         export fn ball(at: vec3) -> real { length(at) - 1.0 }
         export fn wave(x: real) -> real { sin(x) * exp(x) }",
    );
    let field = Field::of(&program, "box", &["kinks(at)"]);
    let kinks = &field.artefact.manifest.outputs[0].kinks;
    let operation = |said: &[f64]| kinks[said[2] as usize].operation.as_str();
    // Inside of the box the length is that of constants.
    let inside = field.at(&[0.25, 0.5]);
    assert_eq!((inside[0], inside[1], operation(&inside)), (0.0, 0.25, "abs"));
    // Where two faces are equally near.
    let diagonal = field.at(&[0.5, 1.5]);
    assert_eq!((diagonal[0], diagonal[1], operation(&diagonal)), (1.0, 0.0, "max"));
    // Above the flat top it does not matter where the sides are mirrored.
    assert_eq!(field.at(&[0.0, 9.0])[..2], [0.0, 1.0]);
    assert_eq!(field.at(&[0.25, 9.0])[..2], [0.0, 0.75]);
    assert_eq!(field.at(&[1.0, 9.0])[..2], [1.0, 0.0]);
    assert!(kinks.iter().all(|k| k.place.starts_with("main.vola:")), "{kinks:?}");
    assert!(kinks.iter().any(|k| k.place == "main.vola:2:22" && k.operation == "abs"), "{kinks:?}");

    let ball = Field::of(&program, "ball", &["kinks(at)"]);
    assert_eq!(ball.at(&[0.0; 3]), [1.0, 0.0, 0.0, 0.0]);
    assert_eq!(ball.at(&[3.0, 4.0, 0.0]), [0.0, 5.0, 0.0, 1.0]);
    let wave = Field::of(&program, "wave", &["kinks"]);
    assert_eq!(wave.at(&[0.0]), [0.0, f64::INFINITY, -1.0, 1.0]);
    assert!(wave.artefact.manifest.outputs[0].kinks.is_empty());
}

#[test]
fn conditions_and_loops_have_kinks() {
    let program = checked(
        "export fn folded(x: real, r: real) -> real { if x < r && x > -r { x * x } else { r * (2.0 * x - r) } }
         export fn nearest(x: real) -> real {
             let best = 100.0;
             for i in 0..4 { best = min(best, abs(x - 2.0 * i::<real>)); }
             best
         }",
    );
    let folded = Field::of(&program, "folded", &["kinks(x)", "value"]);
    assert_eq!(folded.at(&[1.5, 2.0])[1], 0.5);
    assert_eq!(folded.at(&[2.0, 2.0])[..2], [1.0, 0.0]);
    assert_eq!(folded.at(&[-2.25, 2.0])[1], 0.25);
    let nearest = Field::of(&program, "nearest", &["kinks(x)"]);
    let kinks = &nearest.artefact.manifest.outputs[0].kinks;
    assert_eq!(kinks.len(), 2, "one for each operation, however long the loop");
    assert_eq!(nearest.at(&[4.25])[1..], [0.25, 0.0, 1.0]);
    assert_eq!(nearest.at(&[3.0])[..2], [1.0, 0.0], "between two");
}

#[test]
fn forms_columns_and_mistakes() {
    for (written, canonical) in [
        ("kinks", "kinks(*)"),
        ("kinks( at )", "kinks(at)"),
        ("kinks(at, 0)", "kinks(at)"),
        ("kinks(at, 1e-3)", "kinks(at, 0.001)"),
        ("kinks(*,2)", "kinks(*, 2)"),
    ] {
        let query: Query = written.parse().unwrap();
        assert_eq!(query.to_string(), canonical);
        assert_eq!(canonical.parse(), Ok(query));
    }
    for wrong in ["kinks()", "kinks(at, )", "kinks(at, -1)", "kinks(at, inf)", "kinks(at, nan)", "kinks(a, b)"] {
        assert!(wrong.parse::<Query>().is_err(), "{wrong}");
    }
    assert_eq!(Tolerance::new(-0.0), Some(Tolerance::default()));
    let program =
        checked("export fn f(x: real, n: int) -> (real, int) { (abs(x), n) }\nexport fn g(n: int) -> int { n }");
    let artefact = compile(&program, &request("f", &["kinks", "value"]), &options(), &Unwatched).unwrap();
    let port = &artefact.manifest.outputs[0];
    let columns: Vec<_> = port.columns.iter().map(|c| (c.name.as_str(), c.scalar)).collect();
    use ColumnType::{Bool, Int, Real};
    assert_eq!(columns, [("near", Bool), ("distance", Real), ("kink", Int), ("side", Int)]);
    assert_eq!(port.ty, "(bool, real, int, int)");
    let said = |export, query| compile(&program, &request(export, &[query]), &options(), &Unwatched).unwrap_err();
    assert!(said("f", "kinks(n)")[0].message.contains("`n` is int"), "{:?}", said("f", "kinks(n)"));
    assert!(said("g", "kinks(n)")[0].message.contains("no reals"), "{:?}", said("g", "kinks(n)"));
}
