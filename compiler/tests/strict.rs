//! The mode `strict` (LANGUAGE 14.2, 21.4): what is accepted is what `exact` computes, and what is refused has its code.

#![allow(clippy::pedantic, reason = "tests")]

use isograd_compiler::{
    Artefact, Code, Diagnostic, Differentiability, MemoryLoader, Options, Request, Unwatched, check, compile,
    print_step,
};

fn compiled(
    text: &str,
    query: &str,
    differentiability: Differentiability,
) -> Result<(Artefact, String), Vec<Diagnostic>> {
    let options = Options { verify: true, ..Options::default() };
    let checked = check("main.vola", text.as_bytes().to_vec(), &MemoryLoader::default(), &options, &Unwatched);
    assert!(checked.is_ok(), "{:?}", checked.diagnostics);
    let queries = vec![query.parse().expect("a query")];
    let request = Request { export: "f".to_owned(), queries, differentiability, ..Request::default() };
    let artefact = compile(&checked, &request, &options, &Unwatched)?;
    Ok((artefact, print_step(&checked, &request, "schedule", &options, &Unwatched).expect("prints")))
}

/// Refused with this code, once for each place.
fn refused(text: &str, query: &str, codes: &[Code]) {
    let found = compiled(text, query, Differentiability::Strict).expect_err(text);
    assert_eq!(found.iter().map(|d| d.code).collect::<Vec<_>>(), codes, "{text}");
    assert!(compiled(text, query, Differentiability::Exact).is_ok(), "{text}");
}

/// Accepted, and computed as in `exact`.
fn accepted(text: &str, query: &str) {
    let strict = compiled(text, query, Differentiability::Strict).unwrap_or_else(|e| panic!("{text}: {e:?}"));
    let exact = compiled(text, query, Differentiability::Exact).expect("compiles");
    assert_eq!(strict.1, exact.1, "{text}");
    assert_eq!(strict.0.manifest.differentiability, Differentiability::Strict);
}

#[test]
fn the_examples_of_the_language() {
    let abs = |range| format!("export fn f(x: real{range}) -> real {{ diff(abs(x), x) }}");
    refused(&abs(""), "value", &[Code::E0703]);
    accepted(&abs(" in [1.0 .. 2.0]"), "value");
    let branch =
        |range| format!("export fn f(x: real{range}) -> real {{ let y = if x > 0.0 {{x*x}} else {{-x}}; diff(y, x) }}");
    refused(&branch(""), "value", &[Code::E0704]);
    accepted(&branch(" in [1.0 .. 5.0]"), "value");
    let length = |range| format!("export fn f(p: vec3{range}) -> vec3 {{ diff(length(p), p) }}");
    refused(&length(""), "value", &[Code::E0703]);
    accepted(&length(" in [[0.5; 3] .. [2.0; 3]]"), "value");
}

#[test]
fn derivatives_that_a_host_asks_for_count() {
    let text = "export fn f(x: real) -> real { abs(x) }";
    accepted(text, "value");
    for query in ["gradient(x)", "hessian(x)", "directional(x)", "lipschitz(x)"] {
        refused(text, query, &[Code::E0703]);
    }
}

#[test]
fn only_what_depends_on_the_variable_counts() {
    accepted("export fn f(x: real, y: real) -> real { x*abs(y) }", "gradient(x)");
    refused("export fn f(x: real, y: real) -> real { x*abs(y) }", "gradient(*)", &[Code::E0703]);
    accepted("export fn f(x: real, y: real) -> real { if y > 0.0 { x*x } else { x } }", "gradient(x)");
    accepted("export fn f(x: real) -> real { let y = floor(abs(x)); diff(x*x, x) + y }", "value");
}

#[test]
fn jumps_are_proved_absent_between_them() {
    let floor = |range| format!("export fn f(x: real in {range}) -> real {{ x*floor(x) + fract(x) + mod(x, 2.0) }}");
    accepted(&floor("[0.25 .. 0.75]"), "gradient(x)");
    refused(&floor("[0.25 .. 1.25]"), "gradient(x)", &[Code::E0703, Code::E0703]);
    refused(&floor("[0.0 .. 0.75]"), "gradient(x)", &[Code::E0703, Code::E0703, Code::E0703]);
}

#[test]
fn poles_and_domains_are_no_kinks() {
    accepted("export fn f(x: real) -> real { 1.0/x + log(x) + tan(x) }", "gradient(x)");
    refused("export fn f(x: real) -> real { sqrt(x) }", "gradient(x)", &[Code::E0703]);
    accepted("export fn f(x: real in [0.5 .. 4.0]) -> real { sqrt(x) }", "gradient(x)");
    refused("export fn f(y: real, x: real) -> real { atan2(y, x) }", "gradient(*)", &[Code::E0703]);
    accepted("export fn f(y: real, x: real in [0.5 .. 1.0]) -> real { atan2(y, x) }", "gradient(*)");
}

#[test]
fn loops_are_run_by_the_proof() {
    let text = |n: &str, by: &str| {
        format!(
            "export fn f(x: real in [1.0 .. 1.5], n: int) -> real {{ \
             let s = x; for i in 0..{n} {{ s = s + abs(s{by}); }} s }}"
        )
    };
    accepted(&text("4", ""), "gradient(x)");
    refused(&text("n", ""), "gradient(x)", &[Code::E0703]);
    refused(&text("4", " - 3.0"), "gradient(x)", &[Code::E0703]);
}

#[test]
fn the_message_says_what_would_help() {
    let errors = compiled(
        "export fn f(x: real, k: real in [0.0 .. 1.0]) -> real { max(x, k) }",
        "gradient(x)",
        Differentiability::Strict,
    )
    .expect_err("refused");
    let text = format!("{:?}", errors[0]);
    for part in ["max", "a = b", "`x`, which has no range", "`k`", "exact", "smooth"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
