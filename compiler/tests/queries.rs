//! Queries: how they are written, what they need to be given, what a manifest says of their answers, and what is
//! answered where one makes no sense. What they compute is tested where modules run.

use isograd_compiler::{
    Artefact, Checked, Code, Diagnostic, FORMS, MemoryLoader, Options, Port, Query, Request, Role, Unwatched, check,
    compile, print_step, query_forms,
};

const SPHERE: &str = "export fn field(at: vec3, radius: real = 1.0 in [0.5 .. 2.0]) -> real { length(at) - radius }";

fn checked(source: &str) -> Checked {
    let checked = check("main.vola", source.into(), &MemoryLoader::default(), &options(), &Unwatched);
    assert!(checked.is_ok(), "{:?}", checked.diagnostics);
    checked
}

fn options() -> Options {
    Options { verify: true, ..Options::default() }
}

fn request(queries: &[&str]) -> Request {
    let queries = queries.iter().map(|q| q.parse().unwrap()).collect();
    Request { export: "field".into(), queries, ..Request::default() }
}

fn compiled(source: &str, queries: &[&str]) -> Result<Artefact, Vec<Diagnostic>> {
    compile(&checked(source), &request(queries), &options(), &Unwatched)
}

fn names(port: &Port) -> Vec<&str> {
    port.columns.iter().map(|c| c.name.as_str()).collect()
}

#[test]
fn queries_read_as_they_are_written() {
    for text in [
        "value",
        "gradient(*)",
        "jacobian(p)",
        "hessian(p)",
        "hessian(p, q)",
        "directional(p)",
        "bound(*)",
        "bound(p)",
        "bound(p, mean)",
        "bound(mean)",
        "bound(gradient(p), q)",
        "bound(gradient(p), mean)",
        "bound(gradient(p), q, mean)",
        "bound(hessian(p, q), *)",
        "lipschitz(p)",
    ] {
        assert_eq!(text.parse::<Query>().unwrap().to_string(), text);
    }
    assert_eq!(" bound ".parse::<Query>().unwrap().to_string(), "bound(*)");
    assert_eq!("bound( hessian( p,p ) ,q )".parse::<Query>().unwrap().to_string(), "bound(hessian(p), q)");
    for text in [
        "",
        "values",
        "value()",
        "gradient",
        "gradient()",
        "gradient(p, q)",
        "gradient(p",
        "gradient(p))",
        "gradient((p))",
        "gradient(bound(p))",
        "directional",
        "bound()",
        "bound(p, q)",
        "bound(value, p)",
        "bound(bound(p), q)",
        "bound(lipschitz(p), q)",
        "bound(gradient(p), q, r)",
        "bound(gradient(), q)",
        "lipschitz(p, mean)",
    ] {
        let error = text.parse::<Query>().unwrap_err().to_string();
        assert!(error.contains(&format!("unknown query `{text}`")) && error.contains(&query_forms()), "{error}");
    }
}

#[test]
fn every_form_is_a_query() {
    for form in FORMS {
        let text = form.form.replace("DERIVATIVE", "gradient(p)").replace("PARAMETER", "p").replace("TOLERANCE", "0.1");
        assert!(text.parse::<Query>().is_ok(), "{text}");
        assert!(!form.gives.is_empty());
    }
}

#[test]
fn a_manifest_says_what_is_given_for_what() {
    let manifest = compiled(SPHERE, &["bound(at)"]).unwrap().manifest;
    let [at, radius] = manifest.inputs.as_slice() else { panic!("{manifest:?}") };
    let ends = ["at.x.start", "at.x.end", "at.y.start", "at.y.end", "at.z.start", "at.z.end"];
    assert_eq!((at.name.as_str(), at.ty.as_str(), at.role, names(at)), ("at", "vec3", Role::Box, ends.to_vec()));
    assert_eq!((radius.role, names(radius)), (Role::Point, vec!["radius"]));
    let json = serde_json::to_value(&manifest).unwrap();
    assert_eq!(json["inputs"][0]["role"], "box");
    assert!(json["inputs"][1].get("role").is_none(), "an input is a point by default");

    let manifest = compiled(SPHERE, &["bound", "value", "directional(at)"]).unwrap().manifest;
    let given: Vec<_> = manifest.inputs.iter().map(|p| (p.name.as_str(), p.role, p.columns.len())).collect();
    let (point, boxed, direction) = (Role::Point, Role::Box, Role::Direction);
    let at = [("at", point, 3), ("at.box", boxed, 6), ("at.direction", direction, 3)];
    assert_eq!(given, [&at[..], &[("radius", point, 1), ("radius.box", boxed, 2)]].concat());
    let offsets: Vec<u32> = manifest.inputs.iter().flat_map(|p| p.columns.iter().map(|c| c.offset)).collect();
    assert!(offsets.windows(2).all(|w| w[0] != w[1]), "every column has a place of its own: {offsets:?}");
    let radius = &manifest.inputs[4].columns;
    assert!(radius.iter().all(|c| c.default.is_some() && c.range.is_some()), "{radius:?}");
}

#[test]
fn answers_have_types_and_names() {
    let source = "export fn field(at: vec2, k: int) -> (vec2, int) { (at * 2.0, k) }";
    let queries = ["directional(at)", "bound(at)", "lipschitz(at)", "bound(gradient(at), at)"];
    let manifest = compiled(source, &queries).unwrap().manifest;
    let [along, bound, norm, gradient] = manifest.outputs.as_slice() else { panic!() };
    assert_eq!((along.ty.as_str(), names(along)), ("real[2]", vec!["value.0.x", "value.0.y"]));
    let ends = ["value.0.x.start", "value.0.x.end", "value.0.x.may_be_nan", "value.0.y.start"];
    assert_eq!((bound.ty.as_str(), &names(bound)[..4], bound.columns.len()), ("interval<real>[2]", &ends[..], 6));
    let norms = ["value.0.x.norm", "value.0.x.may_be_nan", "value.0.y.norm", "value.0.y.may_be_nan"];
    assert_eq!(names(norm), norms);
    assert_eq!((gradient.ty.as_str(), names(gradient)[0]), ("interval<real>[4]", "value.0.x/at.x.start"));

    let manifest = compiled(SPHERE, &["bound(at)", "lipschitz(at)", "bound(gradient(at), at)"]).unwrap().manifest;
    let [bound, norm, gradient] = manifest.outputs.as_slice() else { panic!() };
    assert_eq!((bound.ty.as_str(), names(bound)), ("interval<real>", vec!["start", "end", "may_be_nan"]));
    assert_eq!((norm.ty.as_str(), names(norm)), ("real", vec!["norm", "may_be_nan"]));
    assert_eq!((gradient.ty.as_str(), names(gradient)[5]), ("interval<vec3>", "at.y.may_be_nan"));
}

#[test]
fn what_is_structurally_zero_is_said_and_costs_nothing() {
    let source = "export fn field(p: vec3, r: real) -> real { p.x*p.x + p.y*r + floor(p.z) }";
    let queries = ["gradient(*)", "hessian(p)", "directional(p)", "value"];
    let artefact = compiled(source, &queries).unwrap();
    let zeros = |i: usize| {
        let port: &Port = &artefact.manifest.outputs[i];
        port.columns.iter().filter(|c| c.zero).map(|c| c.name.as_str()).collect::<Vec<_>>()
    };
    assert_eq!(zeros(0), ["p.z"]);
    let hessian = ["p.y/p.x", "p.z/p.x", "p.x/p.y", "p.y/p.y", "p.z/p.y", "p.x/p.z", "p.y/p.z", "p.z/p.z"];
    assert_eq!(zeros(1), hessian);
    assert_eq!((zeros(2), zeros(3)), (vec![], vec![]));
    let without = compiled(source, &["gradient(p)"]).unwrap().manifest.operations;
    let with = compiled(source, &["gradient(p)", "hessian(p)"]).unwrap().manifest.operations;
    assert_eq!(with, without, "the second derivatives are constants");
    // A zero that only the numbers have is none.
    let source = "export fn field(x: real, k: real) -> real { x * k - x * k }";
    assert!(!compiled(source, &["gradient(x)"]).unwrap().manifest.outputs[0].columns[0].zero);
}

#[test]
fn each_entry_of_a_symmetric_hessian_is_computed_once() {
    let source = "export fn field(p: vec3) -> real { sin(p.x * p.y) * exp(p.z * p.x) }";
    for step in ["derive", "fold", "optimise"] {
        let text = print_step(&checked(source), &request(&["hessian(p)"]), step, &options(), &Unwatched).unwrap();
        let node = |i: &str, j: &str| {
            let output = format!("output hessian(p):p.{i}/p.{j} ");
            text.lines().find_map(|l| l.strip_prefix(output.as_str())).unwrap_or_else(|| panic!("{text}")).to_owned()
        };
        for (i, j) in [("x", "y"), ("x", "z"), ("y", "z")] {
            assert_eq!(node(i, j), node(j, i), "{step}");
        }
    }
}

#[test]
fn what_may_jump_is_said() {
    let source = "
export fn field(x: real, k: real) -> (real, real, real, real) {
    let kinked = abs(x) + min(x, k);
    let jumping = floor(x) + x;
    let chosen = if k < 0.0 { x } else { -x };
    let branching = if x < k { x } else { -x };
    (kinked, jumping, chosen, branching)
}";
    let jumps = |query: &str| compiled(source, &[query]).unwrap().manifest.outputs[0].jumps.clone();
    assert_eq!(jumps("bound(x, mean)"), ["value.1", "value.3"]);
    assert_eq!(jumps("lipschitz(x)"), ["value.1", "value.3"]);
    assert_eq!(jumps("lipschitz(k)"), ["value.2", "value.3"]);
    assert_eq!(jumps("bound(gradient(x), x, mean)"), ["value.0/x", "value.1/x", "value.3/x"]);
    assert_eq!(jumps("bound(x)"), [""; 0], "the natural enclosure asks for no continuity");
}

#[test]
fn a_query_that_makes_no_sense_is_answered_with_what_would() {
    let error = |source: &str, queries: &[&str]| {
        let diagnostics = compiled(source, queries).unwrap_err();
        assert_eq!(diagnostics[0].code, Code::E1102, "{diagnostics:?}");
        diagnostics[0].message.clone()
    };
    let counts = "export fn field(n: int, x: real) -> int { n }";
    assert_eq!(error(counts, &["bound(x)"]), "bound(x): the result of `field` is int and has no reals");
    assert_eq!(error(counts, &["lipschitz(x)"]), "lipschitz(x): the result of `field` is int and has no reals");
    assert_eq!(error(counts, &["directional(x)"]), "directional(x): the result of `field` is int and has no reals");
    let none = "the parameter `n` is int and has no reals";
    assert!(error(counts, &["bound(n)"]).contains(none));
    assert!(error(counts, &["directional(n)"]).contains(none));
    assert!(error(SPHERE, &["bound(to)"]).contains("has no parameter `to`"));
    assert!(error(SPHERE, &["bound(gradient(to), at)"]).contains("has no parameter `to`"));
    assert!(error(SPHERE, &["bound", "bound(*)"]).contains("`bound(*)` is asked for twice"));
}
