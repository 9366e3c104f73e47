//! Every limit of LANGUAGE 18 at its boundary: a program that is exactly at it compiles, with a limit one lower it is
//! refused by a diagnostic that names the limit, its value, the place and what to do. Knows no step that counts.

use isograd_compiler::{
    Checked, Diagnostic, Limit, Limits, MemoryLoader, Options, Query, Request, Unwatched, Watch, check, compile,
    inspect,
};
use std::cell::Cell;

/// Everything that checking, inspecting and compiling say of a program, once.
fn said(source: &str, files: &[(&str, &str)], queries: &[&str], limits: Limits, watch: &dyn Watch) -> Vec<Diagnostic> {
    let loader = MemoryLoader {
        files: files.iter().map(|(n, t)| ((*n).to_owned(), t.as_bytes().to_vec())).collect(),
        ..MemoryLoader::default()
    };
    let options = Options { limits, verify: true };
    let checked: Checked = check("main.vola", source.as_bytes().to_vec(), &loader, &options, watch);
    let mut all = inspect(&checked, &options, || Unwatched);
    for export in checked.exports() {
        let queries = queries.iter().map(|q| q.parse::<Query>().unwrap()).collect();
        let request = Request { export: export.name, queries, ..Request::default() };
        let late = compile(&checked, &request, &options, watch).err().unwrap_or_default();
        all.extend(late.into_iter().filter(|d| d.is_error()));
    }
    all.dedup_by(|a, b| a.message == b.message);
    all.retain(Diagnostic::is_error);
    all
}

fn limit(name: &str) -> &'static Limit {
    Limits::ALL.iter().find(|l| l.name == name).unwrap()
}

fn with(name: &str, value: u64) -> Limits {
    let mut limits = Limits::default();
    (limit(name).set)(&mut limits, value);
    limits
}

/// The program needs exactly `needs` of the limit.
fn exactly(name: &str, needs: u64, source: &str, files: &[(&str, &str)], queries: &[&str]) {
    let fine = said(source, files, queries, with(name, needs), &Unwatched);
    assert!(fine.is_empty(), "`{name}` of {needs} is enough: {fine:?}");
    let refused = said(source, files, queries, with(name, needs - 1), &Unwatched);
    let [only] = refused.as_slice() else { panic!("`{name}` of {}: {refused:?}", needs - 1) };
    assert_eq!(only.code, limit(name).code, "{only:?}");
    let text = format!("{} {} {:?}", only.message, only.notes.join(" "), only.help);
    assert!(text.contains(&format!("`{name}`")), "does not name the limit `{name}`: {text}");
    assert!(text.contains(&(needs - 1).to_string()), "does not say its value {}: {text}", needs - 1);
    assert!(text.contains("raise"), "does not say how to raise it: {text}");
}

const TREE: &str = "concept D: real -> real; entity L(); operation O(); impl L for D(x) { x }
    impl O<a> for D(x) { eval a.D(x) + 1.0 }";

#[test]
fn source_bytes() {
    let source = "export fn f(x: real) -> real { x } // ä";
    exactly("source_bytes", source.len() as u64, source, &[], &["value"]);
    let long = format!("// {}", "x".repeat(500));
    exactly("source_bytes", long.len() as u64, "module a;", &[("a.vola", &long)], &[]);
}

#[test]
fn total_source_bytes() {
    let (entry, a, b) = ("module a; module b;", "// aaaa", "// bb");
    let all = entry.len() + a.len() + b.len();
    exactly("total_source_bytes", all as u64, entry, &[("a.vola", a), ("b.vola", b)], &[]);
    exactly("total_source_bytes", entry.len() as u64, entry.trim(), &[("a.vola", ""), ("b.vola", "")], &[]);
}

#[test]
fn modules() {
    let files = [("a.vola", "module b;"), ("b.vola", "module c; module a;"), ("c.vola", "")];
    exactly("modules", 4, "module a; module b; module self::main;", &files, &[]);
}

#[test]
fn nesting() {
    for (open, close) in [("(", ")"), ("-", ""), ("[", ", x].x"), ("if x > 0.0 { ", " } else { x }")] {
        let n = 40;
        let source = format!("export fn f(x: real) -> real {{ {}x{} }}", open.repeat(n), close.repeat(n));
        exactly("nesting", n as u64 + 1, &source, &[], &["value"]);
    }
    let blocks = format!(
        "{TREE} export fn f(x: real) -> real {{ csg t = {}L(){}; eval t.D(x) }}",
        "O(){ ".repeat(30),
        " }".repeat(30)
    );
    exactly("nesting", 32, &blocks, &[], &["value"]);
    // Operators in a row are not inside each other.
    let long = format!("export fn f(x: real) -> real {{ x{} }}", " + x * x - x".repeat(500));
    assert_eq!(said(&long, &[], &["value"], with("nesting", 8), &Unwatched), []);
}

#[test]
fn csg_depth() {
    let tree = |n: usize| {
        format!(
            "{TREE} export fn f(x: real) -> real {{ csg t = L(); for i in 0..{n} {{ t = O(){{ t }}; }} eval t.D(x) }}"
        )
    };
    exactly("csg_depth", 50, &tree(49), &[], &["value"]);
    let chain = |n: usize| {
        let calls: String = (1..n).map(|i| format!("fn g{i}(x: real) -> real {{ g{}(x) }}\n", i - 1)).collect();
        format!("fn g0(x: real) -> real {{ x + 1.0 }}\n{calls} export fn f(x: real) -> real {{ g{}(x) }}", n - 1)
    };
    exactly("csg_depth", 30, &chain(30), &[], &["value"]);
    let loops = format!(
        "export fn f(x: real) -> real {{ let s = x; {} s = s + 1.0; {} s }}",
        "for i in 0..2 { if s > 0.0 { ".repeat(10),
        "} }".repeat(10)
    );
    exactly("csg_depth", 20, &loops, &[], &["value"]);
}

#[test]
fn unrolled_iterations() {
    let source = format!(
        "{TREE} export fn f(x: real) -> real {{ csg t = L(); for i in 0..5 {{ for j in 0..4 {{ t = O(){{ t }}; }} }} eval t.D(x) }}"
    );
    exactly("unrolled_iterations", 25, &source, &[], &["value"]);
}

/// The least value of a limit under which the program compiles.
fn least(name: &str, source: &str, queries: &[&str]) -> u64 {
    let (mut low, mut high) = (0, 100_000);
    while low + 1 < high {
        let middle = u64::midpoint(low, high);
        match said(source, &[], queries, with(name, middle), &Unwatched).is_empty() {
            true => high = middle,
            false => low = middle,
        }
    }
    high
}

#[test]
fn graph_nodes_and_derived_nodes() {
    let sum = |n: usize| format!("export fn f(x: real) -> real {{ let y = x; {} y }}", "y = sin(y) * x;".repeat(n));
    for (name, queries) in [("graph_nodes", &["value"][..]), ("derived_nodes", &["value", "hessian(x)"])] {
        let (small, large) = (least(name, &sum(10), queries), least(name, &sum(20), queries));
        exactly(name, small, &sum(10), &[], queries);
        assert!(large > small + 10 && large < small * 3, "{name}: {small}, {large}");
    }
}

#[test]
fn diff_order() {
    exactly("diff_order", 3, "export fn f(x: real) -> real { diff(diff(diff(sin(x), x), x), x) }", &[], &["value"]);
    exactly("diff_order", 3, "export fn f(x: real) -> real { diff(sin(x), x) }", &[], &["hessian(x)"]);
    exactly("diff_order", 1, "export fn f(x: real) -> real { sin(x) }", &[], &["gradient(x)"]);
    // Side by side is not inside each other.
    let beside = "export fn f(x: real, y: real) -> real { diff(sin(x), x) + diff(sin(y), y) * diff(x * y, x) }";
    exactly("diff_order", 1, beside, &[], &["value"]);
    let default =
        |n: usize| format!("export fn f(x: real) -> real {{ {}exp(x){} }}", "diff(".repeat(n), ", x)".repeat(n));
    assert_eq!(said(&default(6), &[], &["value"], Limits::default(), &Unwatched), []);
    assert_eq!(said(&default(7), &[], &["value"], Limits::default(), &Unwatched).len(), 1);
    assert_eq!(said(&default(6), &[], &["gradient(x)"], Limits::default(), &Unwatched).len(), 1);
}

#[test]
fn export_scalars() {
    exactly("export_scalars", 19, "export fn f(a: mat4, b: vec3) -> real { a.x.x }", &[], &["value"]);
    exactly("export_scalars", 32, "export fn f(a: mat4) -> (mat4, mat4) { (a, a) }", &[], &["value"]);
    // 9 results of one query.
    exactly("export_scalars", 9, "export fn f(p: vec3) -> vec3 { p * p.x }", &[], &["gradient(p)"]);
    exactly("export_scalars", 27, "export fn f(p: vec3) -> vec3 { p * p.x }", &[], &["hessian(p)"]);
}

#[test]
fn compile_time() {
    struct Impatient(Cell<u32>);
    impl Watch for Impatient {
        fn expired(&self) -> bool {
            self.0.set(self.0.get() + 1);
            self.0.get() > 3
        }
    }
    let sum = format!("export fn f(x: real) -> real {{ let y = x; {} y }}", "y = sin(y) * x;".repeat(4000));
    let late = said(&sum, &[], &["value", "hessian(x)"], Limits::default(), &Impatient(Cell::new(0)));
    assert_eq!(late.len(), 1, "{late:?}");
    assert_eq!(late[0].code, limit("compile_time_ms").code);
    let text = format!("{} {:?}", late[0].message, late[0].help);
    assert!(text.contains("`compile_time_ms`") && text.contains("10000"), "{text}");
}

#[test]
fn diagnostics() {
    let wrong = |n: usize| {
        format!(
            "export fn f(x: real) -> real {{ {} x }}",
            (0..n).map(|i| format!("let a{i} = y{i};")).collect::<String>()
        )
    };
    let of = |n: usize, cap: u64| said(&wrong(n), &[], &[], with("diagnostics", cap), &Unwatched);
    assert_eq!(of(7, 7).len(), 7);
    let cut = of(8, 7);
    assert_eq!(cut.len(), 8, "seven and the count");
    let last = cut.last().unwrap();
    assert_eq!(last.code, limit("diagnostics").code);
    assert!(last.message.contains('1') && format!("{:?}", last.help).contains("`diagnostics`"), "{last:?}");
    let many = of(5000, 100);
    assert_eq!(many.len(), 101);
    assert!(many.last().unwrap().message.contains("4900"), "{:?}", many.last());
}
