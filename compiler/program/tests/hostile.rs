//! Large and hostile sources: no recursion in proportion to their length, no exponential work, bounded messages.

mod common;

use common::{check_text, codes};
use isograd_program::{check, load, typed::Instruction};
use isograd_syntax::{Limits, tree};

/// Large sources are allowed here; tests run in threads with 2 MiB of stack.
fn codes_of(text: &str) -> String {
    let limits = Limits { source_bytes: 1 << 24, total_source_bytes: 1 << 24, ..Limits::default() };
    let loaded = load("main.vola", text.as_bytes().to_vec(), &common::Memory::default(), &limits);
    let checked = check(&loaded, &limits);
    codes(&loaded, &checked)
}

#[test]
fn operator_chains_of_100_000_operands() {
    let sum = format!("export fn f(x: real) -> real {{ x{} }}", " + x".repeat(99_999));
    let (loaded, checked) = check_text(&sum);
    assert_eq!(codes(&loaded, &checked), "");
    let code = &checked.program.functions[0].code;
    let additions = code
        .instructions
        .iter()
        .filter(|(i, _)| matches!(i, Instruction::Binary { op: tree::BinaryOp::Add, .. }))
        .count();
    assert_eq!(additions, 99_999);
    assert_eq!(codes_of(&format!("fn f(x: real) -> real {{ 1{} }}", " + x".repeat(99_999))), "E0401");
}

#[test]
fn chains_of_casts_and_accesses() {
    let casts = "::<int>::<real>".repeat(20_000);
    assert_eq!(codes_of(&format!("fn f(x: real) -> real {{ x{casts} }}")), "");
    assert_eq!(codes_of(&format!("fn f(x: vec3) -> real {{ x{} }}", ".x".repeat(100_000))), "E0407");
}

#[test]
fn else_if_chains_up_to_the_limit() {
    let chain = |n: usize| {
        let arms: String = (0..n).map(|i| format!("if x < {i}.0 {{ y = {i}.0; }} else ")).collect();
        format!("fn f(x: real) -> real {{ let y = x; {arms}{{ y = 0.0; }} y }}")
    };
    assert_eq!(codes_of(&chain(1000)), "");
    assert_eq!(codes_of(&chain(20_000)), "E1005");
}

#[test]
fn nesting_to_the_limit_of_256() {
    let around = |open: &str, inner: &str, close: &str, n: usize| {
        format!("fn f(x: real) -> real {{ {}{inner}{} }}", open.repeat(n), close.repeat(n))
    };
    assert_eq!(codes_of(&around("(", "x", ")", 250)), "");
    assert_eq!(codes_of(&around("sin(", "x", ")", 250)), "");
    assert_eq!(codes_of(&around("(if x > 0.0 { ", "x", " } else { x })", 120)), "");
    assert_eq!(codes_of(&around("- ", "x", "", 250)), "");
    let statements = |open: &str| format!("fn f(x: real) -> real {{ {}{} x }}", open.repeat(250), "}".repeat(250));
    assert_eq!(codes_of(&statements("if x > 0.0 { x = 1.0; ")), "");
    assert_eq!(codes_of(&statements("for i in 0..3 { x = x + 1.0; ")), "");
    let tree = format!("{}E(){}", "O(){ ".repeat(250), " }".repeat(250));
    assert_eq!(codes_of(&format!("entity E(); operation O(); fn f() -> csg {{ {tree} }}")), "");
}

#[test]
fn types_that_double_with_each_line_are_refused() {
    let lines: String = (0..60).map(|i| format!("let t{} = (t{i}, t{i}); ", i + 1)).collect();
    let found = codes_of(&format!("fn f(x: real) -> real {{ let t0 = (x, x); {lines} x }}"));
    assert_eq!(found, "E1010");
}

#[test]
fn many_lines_and_functions_take_linear_time() {
    let lets: String = (0..20_000).map(|i| format!("let a{} = a{i} + x;\n", i + 1)).collect();
    assert_eq!(codes_of(&format!("fn f(x: real) -> real {{ let a0 = x; {lets} a20000 }}")), "");
    let functions: String = (0..20_000).map(|i| format!("fn f{i}(x: real) -> real {{ f{}(x) }}\n", i + 1)).collect();
    assert_eq!(codes_of(&format!("{functions} fn f20000(x: real) -> real {{ x }}")), "");
}

#[test]
fn long_cycles_end() {
    let functions: String =
        (0..5000).map(|i| format!("fn f{i}(x: real) -> real {{ f{}(x) }}\n", (i + 1) % 5000)).collect();
    assert!(codes_of(&functions).starts_with("E0506 E0506"));
    let exports: String = (0..5000).map(|i| format!("export f{i}(x: real) {{ f{}(x) }}\n", i + 1)).collect();
    assert_eq!(codes_of(&format!("{exports} export f5000(x: real) {{ x }}")), "");
}

#[test]
fn many_definitions_and_impls_take_little_time() {
    let items: String = (0..4000)
        .map(|i| {
            format!(
                "operation O{i}(); fn f{i}() -> csg {{ f{}() }} impl O{i}<a> for C(x) {{ csg e = f0(); eval e.C(x) }}\n",
                i + 1
            )
        })
        .collect();
    let nodes: String = (0..4000).map(|i| format!("csg e{i} = O{i}();\n")).collect();
    let head = "concept C: real -> real; entity E();";
    let apart = format!("{head}{items} fn f4000() -> csg {{ E() }} fn all() -> csg {{ {nodes} f0() }}");
    assert_eq!(codes_of(&apart), "");
    let built = format!("{head}{items} fn f4000() -> csg {{ {nodes} E() }}");
    assert!(codes_of(&built).starts_with("E0607 E0607"));
}

#[test]
fn errors_beyond_the_limit_are_counted() {
    let limits = Limits { source_bytes: 1 << 24, diagnostics: 10, ..Limits::default() };
    let text: String = (0..5000).map(|i| format!("fn f{i}(x: real) -> real {{ y{i} }}\n")).collect();
    let loaded = load("main.vola", text.into_bytes(), &common::Memory::default(), &limits);
    let checked = check(&loaded, &limits);
    assert_eq!(checked.diagnostics.len() as u64 + checked.omitted_errors, 5000);
    assert!(checked.diagnostics.len() < 200);
}
