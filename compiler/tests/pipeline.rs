//! The pipeline from source to module: its steps, its ids, and what it says of bad requests.

use isograd_compiler::{
    Checked, Code, DerivativeMode, Derivatives, Differentiability, MemoryLoader, Options, Query, Rate, Request, STEPS,
    Sensitivity, Unwatched, Watch, check, compile, print_step,
};
use std::cell::RefCell;

const SPHERE: &str = "
module std::sphere;
/// A ball.
export fn field(at: vec3, radius: real) -> real {
    csg ball = Sphere(radius);
    eval ball.Sdf3d(at)
}
";

fn checked(source: &str) -> Checked {
    check("main.vola", source.into(), &MemoryLoader::default(), &options(), &Unwatched)
}

fn options() -> Options {
    Options { verify: true, ..Options::default() }
}

fn request(queries: &[&str]) -> Request {
    Request {
        export: "field".into(),
        queries: queries.iter().map(|q| q.parse().unwrap()).collect(),
        ..Request::default()
    }
}

#[test]
fn a_sphere_compiles_with_its_gradient() {
    let program = checked(SPHERE);
    assert!(program.is_ok(), "{:?}", program.diagnostics);
    let export = &program.exports()[0];
    assert_eq!((export.name.as_str(), export.doc.as_deref()), ("field", Some("A ball.")));
    let artefact =
        compile(&program, &request(&["value", "gradient(at)", "hessian(at)"]), &options(), &Unwatched).unwrap();
    let manifest = &artefact.manifest;
    let names = |i: usize| manifest.outputs[i].columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>();
    assert_eq!(manifest.outputs[0].ty, "real");
    assert_eq!((manifest.outputs[1].ty.as_str(), names(1)), ("vec3", vec!["at.x", "at.y", "at.z"]));
    assert_eq!((manifest.outputs[2].ty.as_str(), names(2)[1]), ("mat3", "at.y/at.x"));
    assert_eq!(manifest.inputs[0].rate, Rate::Varying);
    assert_eq!(manifest.inputs[1].rate, Rate::Uniform);
    // The file alone is enough to call it.
    let text = serde_json::to_vec(manifest).unwrap();
    assert!(artefact.bytes.windows(text.len()).any(|w| w == text), "the manifest is in the module");
}

#[test]
fn every_step_is_announced_in_order_and_can_be_printed() {
    struct Recorder(RefCell<Vec<&'static str>>);
    impl Watch for Recorder {
        fn step(&self, name: &'static str) {
            self.0.borrow_mut().push(name);
        }
    }
    let recorder = Recorder(RefCell::default());
    let program = check("main.vola", SPHERE.into(), &MemoryLoader::default(), &options(), &recorder);
    compile(&program, &request(&["value"]), &options(), &recorder).unwrap();
    assert_eq!(*recorder.0.borrow(), STEPS);
    for step in STEPS {
        let text = print_step(&program, &request(&["gradient(at)"]), step, &options(), &Unwatched).unwrap();
        assert!(!text.is_empty(), "{step}");
    }
    assert!(print_step(&program, &request(&["value"]), "nonsense", &options(), &Unwatched).is_err());
}

#[test]
fn the_gradient_of_a_sphere_has_few_nodes() {
    let program = checked(SPHERE);
    let text = print_step(&program, &request(&["gradient(at)"]), "optimise", &options(), &Unwatched).unwrap();
    let nodes = text.lines().filter(|l| l.contains(" = ")).count();
    // The thesis needs 20 (fig. 4.8).
    assert!(nodes <= 20, "{nodes} nodes:\n{text}");
}

#[test]
fn derivatives_of_loops_do_not_grow_with_the_trip_count() {
    let size = |n: u32| {
        let source =
            format!("export fn field(x: real) -> real {{ let y = 1.0; for i in 0..{n} {{ y = y * x + 0.5; }} y }}");
        let program = checked(&source);
        let request = Request { queries: vec![Query::Gradient("x".into())], ..request(&["value"]) };
        print_step(&program, &request, "optimise", &options(), &Unwatched).unwrap().lines().count()
    };
    assert_eq!(size(10), size(10_000));
}

#[test]
fn every_field_of_a_request_changes_its_id() {
    let program = checked(SPHERE);
    let id =
        |program: &Checked, request: &Request| compile(program, request, &options(), &Unwatched).unwrap().manifest.id;
    let plain = request(&["value"]);
    let mut ids = vec![id(&program, &plain)];
    assert_eq!(ids[0], id(&checked(SPHERE), &plain), "the same request has the same id");
    let spelled_out = Request { rates: [("at".into(), Rate::Varying)].into(), ..plain.clone() };
    assert_eq!(ids[0], id(&program, &spelled_out), "a default that is spelled out changes nothing");
    ids.push(id(&program, &request(&["gradient(at)"])));
    ids.push(id(&program, &Request { precision: isograd_compiler::Precision::F64, ..plain.clone() }));
    ids.push(id(&program, &Request { rates: [("radius".into(), Rate::Varying)].into(), ..plain.clone() }));
    ids.push(id(&program, &Request { mode: DerivativeMode::Forward, ..plain.clone() }));
    ids.push(id(&program, &Request { mode: DerivativeMode::Reverse, ..plain.clone() }));
    let smooth = Request { differentiability: Differentiability::Smooth, ..plain.clone() };
    let with = |s: f64| Request { sensitivity: Some(Sensitivity::new(s).unwrap()), ..smooth.clone() };
    ids.push(id(&program, &smooth));
    assert_eq!(ids.last(), Some(&id(&program, &with(1.0))), "a default that is spelled out changes nothing");
    ids.push(id(&program, &with(0.5)));
    ids.push(id(&checked(&SPHERE.replace("ball.", " ball.")), &plain));
    let count = ids.len();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), count);
}

fn derivatives(program: &Checked, queries: &[&str], mode: DerivativeMode) -> Derivatives {
    let request = Request { mode, ..request(queries) };
    compile(program, &request, &options(), &Unwatched).unwrap().manifest.derivatives
}

#[test]
fn many_parameters_are_differentiated_by_in_reverse() {
    let program = checked(
        "export fn field(a: vec4, b: vec4, c: vec4) -> real {
            let products = dot(a, b) + dot(b, c) + dot(c, a);
            let roots = sqrt(products * products + 1.0) * min(products, 3.0);
            sqrt(roots * roots + products)
        }",
    );
    let of = |mode| derivatives(&program, &["value", "gradient(a)", "gradient(b)", "gradient(c)"], mode);
    let (forward, reverse) = (of(DerivativeMode::Forward), of(DerivativeMode::Reverse));
    let (Some(ahead), Some(back)) = (forward.forward, reverse.reverse) else { panic!("{forward:?} {reverse:?}") };
    assert_eq!((forward.mode, forward.reverse), (DerivativeMode::Forward, None));
    assert_eq!((reverse.mode, reverse.forward), (DerivativeMode::Reverse, None));
    let taken = Derivatives { mode: DerivativeMode::Reverse, forward: Some(ahead), reverse: Some(back) };
    assert_eq!(of(DerivativeMode::Auto), taken);
    assert!(back < ahead);
}

#[test]
fn many_results_are_differentiated_forward() {
    let program = checked(
        "export fn field(x: real) -> (vec4, vec4, vec4) {
            ([sin(x), x * x, sqrt(x), exp(x)], [x, cos(x), x + 1.0, 2.0 * x], [1.0 / x, tan(x), x * sin(x), atan(x)])
        }",
    );
    let auto = derivatives(&program, &["gradient(x)"], DerivativeMode::Auto);
    let forward = derivatives(&program, &["gradient(x)"], DerivativeMode::Forward);
    assert_eq!((auto.mode, auto.forward), (DerivativeMode::Forward, forward.forward));
    assert!(auto.reverse.is_none_or(|reverse| auto.forward.is_some_and(|forward| forward <= reverse)), "{auto:?}");
}

#[test]
fn bad_requests_say_what_exists() {
    let program = checked(SPHERE);
    let refuse = |request: Request| {
        let diagnostics = compile(&program, &request, &options(), &Unwatched).unwrap_err();
        assert_eq!(diagnostics[0].code, Code::E1102);
        format!("{} {}", diagnostics[0].message, diagnostics[0].help.as_deref().unwrap_or(""))
    };
    assert!(refuse(Request { export: "nothing".into(), ..request(&["value"]) }).contains("`field`"));
    assert!(refuse(request(&["gradient(size)"])).contains("`radius`"));
    assert!(refuse(request(&["value", "value"])).contains("twice"));
    assert!(refuse(request(&[])).contains("no query"));
    assert!(refuse(Request { rates: [("r".into(), Rate::Varying)].into(), ..request(&["value"]) }).contains("`at`"));
    assert!("gradient".parse::<Query>().is_err());
    let sensitivity = |s: f64| Some(Sensitivity::new(s).unwrap());
    assert!(refuse(Request { sensitivity: sensitivity(2.0), ..request(&["value"]) }).contains("`exact`"));
    let smooth = |s: f64| {
        let differentiability = Differentiability::Smooth;
        Request { differentiability, sensitivity: sensitivity(s), ..request(&["value"]) }
    };
    assert!(refuse(smooth(1e-40)).contains("f32"));
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Sensitivity::new(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn the_manifest_says_how_smooth_it_is() {
    let program = checked(SPHERE);
    let manifest = |request: Request| {
        let json = serde_json::to_value(compile(&program, &request, &options(), &Unwatched).unwrap().manifest).unwrap();
        (json["differentiability"].clone(), json["sensitivity"].clone())
    };
    assert_eq!(manifest(request(&["value"])), ("exact".into(), serde_json::Value::Null));
    let smooth = Request { differentiability: Differentiability::Smooth, ..request(&["value"]) };
    assert_eq!(manifest(smooth.clone()), ("smooth".into(), 1.0.into()));
    let sensitivity = Some(Sensitivity::new(0.25).unwrap());
    assert_eq!(manifest(Request { sensitivity, ..smooth }), ("smooth".into(), 0.25.into()));
}

/// The warnings of an export `f` in a mode.
fn warnings(source: &str, queries: &[&str], differentiability: Differentiability) -> Vec<String> {
    let program = checked(source);
    let request = Request { export: "f".into(), differentiability, ..request(queries) };
    let found = compile(&program, &request, &options(), &Unwatched).unwrap().warnings;
    found.iter().map(|d| format!("{} {}", d.code.name(), d.message)).collect()
}

#[test]
fn jumps_that_smooth_keeps_are_told() {
    use Differentiability::{Exact, Smooth};
    let told = |body: &str, queries: &[&str], mode| {
        warnings(&format!("export fn f(x: real) -> real {{ {body} }}"), queries, mode)
    };
    let gradient = ["gradient(x)"];
    for (body, name) in [
        ("x * floor(x)", "`floor`"),
        ("x + ceil(x * 2.0)", "`ceil`"),
        ("x * round(x)", "`round`"),
        ("x * trunc(x)", "`trunc`"),
        ("x * x::<int>::<real>", "cast to int"),
    ] {
        let found = told(body, &gradient, Smooth);
        assert!(found.len() == 1 && found[0].starts_with("W0702") && found[0].contains(name), "{body}: {found:?}");
        assert_eq!(told(body, &gradient, Exact), [""; 0], "{body}");
        assert_eq!(told(body, &["value"], Smooth), [""; 0], "{body}");
    }
    for body in ["fract(x) * x", "mod(x, 2.0) * x", "(x % 2.0) * x"] {
        assert_eq!(told(body, &gradient, Smooth).len(), 1, "{body}");
    }
    // A `diff` of the program counts as a query does, if anything comes of it.
    assert_eq!(told("diff(x * floor(x), x)", &["value"], Smooth).len(), 1);
    assert_eq!(told("let d = diff(x * floor(x), x); x", &["value"], Smooth), [""; 0]);
    // Not on the way, and nothing that becomes smooth.
    assert_eq!(told("let y = x * x; diff(y, x) + floor(x)", &["value"], Smooth), [""; 0]);
    let smooth = "clamp(x, 0.0, 1.0) + saturate(x) + abs(x) * sign(x) + step(0.5, x) + if x < 2.0 { x } else { 1.0 }";
    assert_eq!(told(smooth, &gradient, Smooth), [""; 0]);
}

#[test]
fn a_condition_has_a_derivative_in_smooth_only() {
    let source = "export fn f(x: real) -> real { let y = if x < 0.0 { 0.0 } else { 1.0 }; diff(y, x) }";
    assert_eq!(warnings(source, &["value"], Differentiability::Exact), ["W0701 this derivative is always 0"]);
    assert_eq!(warnings(source, &["value"], Differentiability::Smooth), [""; 0]);
}

#[test]
fn limits_of_derivatives_are_diagnostics() {
    let program = checked(SPHERE);
    let mut options = options();
    options.limits.derived_nodes = 20;
    let diagnostics = compile(&program, &request(&["hessian(at)"]), &options, &Unwatched).unwrap_err();
    assert_eq!(diagnostics[0].code, Code::E1008);
    options = self::options();
    options.limits.diff_order = 1;
    let diagnostics = compile(&program, &request(&["hessian(at)"]), &options, &Unwatched).unwrap_err();
    assert_eq!(diagnostics[0].code, Code::E1009);
}

#[test]
fn queries_have_types_and_columns() {
    let text = "export fn f(p: vec2, n: int, k: real) -> real { p.x * p.y * k }
        export fn g(p: vec2, k: real) -> (real, vec2) { (p.x * k, p) }";
    let checked = check("main.vola", text.into(), &MemoryLoader::default(), &Options::default(), &Unwatched);
    let port = |export: &str, query: &str| {
        let queries = vec![query.parse().unwrap()];
        let request = Request { export: export.into(), queries, ..Request::default() };
        let artefact = compile(&checked, &request, &Options::default(), &Unwatched).unwrap();
        let port = artefact.manifest.outputs[0].clone();
        (port.name, port.ty, port.columns.into_iter().map(|c| c.name).collect::<Vec<_>>().join(" "))
    };
    let expected = |name: &str, ty: &str, columns: &str| (name.to_owned(), ty.to_owned(), columns.to_owned());
    assert_eq!(port("f", "gradient(p)"), expected("gradient(p)", "vec2", "p.x p.y"));
    assert_eq!(port("f", "gradient(*)"), expected("gradient(*)", "real[3]", "p.x p.y k"));
    assert_eq!(port("f", "hessian(p)"), expected("hessian(p)", "mat2", "p.x/p.x p.y/p.x p.x/p.y p.y/p.y"));
    assert_eq!(port("f", "hessian( p,k )"), expected("hessian(p, k)", "vec2", "p.x/k p.y/k"));
    assert_eq!(port("f", "hessian(k, k)"), expected("hessian(k)", "real", "k/k"));
    let columns = "value.0/p.x value.1.x/p.x value.1.y/p.x value.0/p.y value.1.x/p.y value.1.y/p.y";
    assert_eq!(port("g", "jacobian(p)"), expected("jacobian(p)", "real[6]", columns));
    for wrong in ["gradient()", "gradient(p, k)", "hessian(p, k, k)", "hessian(p,)", "laplacian(p)", "gradient(p"] {
        assert!(wrong.parse::<isograd_compiler::Query>().is_err(), "{wrong}");
    }
}
