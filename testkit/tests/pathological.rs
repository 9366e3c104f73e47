//! Large, deep and hostile programs: the ones within the limits have the values and gradients of models written here,
//! the others are answered with the limit's diagnostic. Knows nothing of how the compiler walks them.

mod support;

use std::fmt::Write as _;

use isograd_compiler::{DerivativeMode, Precision, Query};
use isograd_graph::Value;
use isograd_testkit::points::Random;
use support::{Sweep, Varying};

/// Value and gradient by `p` of an export `f(p: vec3) -> real`.
fn evaluate(source: &str, precision: Precision, points: &[[f64; 3]]) -> Vec<Vec<f64>> {
    let checked = support::check_ok(source);
    let function = support::export(&checked, "f");
    let queries = [Query::Value, Query::Gradient("p".into())];
    let points: Vec<Vec<Value>> = points.iter().map(|p| p.map(|x| Value::Real(precision.round(x))).to_vec()).collect();
    let rows = support::wasm(&checked, function, &queries, precision, DerivativeMode::Auto, Varying::First, &points);
    let rows = rows.unwrap_or_else(|e| panic!("{e}"));
    rows.into_iter().map(|row| row.into_iter().map(support::number).collect()).collect()
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64) {
    let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= tolerance * b.abs().max(1.0));
    assert!(near && found.len() == expected.len(), "{found:?}, not {expected:?}");
}

/// The first error of a program, from checking or from compiling `f`.
fn error(source: &str) -> &'static str {
    let checked = support::check(source);
    let late = if checked.is_ok() { support::compile(&checked, "f").err().unwrap_or_default() } else { Vec::new() };
    let all = checked.diagnostics.iter().chain(&late).map(|d| d.code.name()).find(|c| c.starts_with('E'));
    all.unwrap_or("none")
}

/// A value with its gradient.
#[derive(Clone, Copy)]
struct Dual([f64; 4]);

impl Dual {
    fn combine(a: Self, ka: f64, b: Self, kb: f64, value: f64) -> Self {
        let mut all = [0.0; 4];
        for (x, (a, b)) in all.iter_mut().zip(a.0.iter().zip(&b.0)) {
            *x = ka * a + kb * b;
        }
        all[0] = value;
        Self(all)
    }
}

/// Writes a program of that many operations, all of which matter and stay within [-1, 1], and runs its model.
fn generated(operations: usize, points: &[[f64; 3]]) -> (String, Vec<Vec<f64>>) {
    let mut random = Random::new(8000);
    let mut text = String::from("export fn f(p: vec3) -> real {\nlet v0 = p.x;\nlet v1 = p.y;\nlet v2 = p.z;\n");
    let variable = |axis: usize, x: f64| {
        let mut all = [x, 0.0, 0.0, 0.0];
        all[1 + axis] = 1.0;
        Dual(all)
    };
    let mut models: Vec<Vec<Dual>> = points.iter().map(|p| (0..3).map(|i| variable(i, p[i])).collect()).collect();
    let mut count = 0;
    let mut last = 2;
    while count < operations {
        // The newest value always takes part, so nothing is dead; the other is mostly near, sometimes from long ago.
        let far = if random.chance(25) { last + 1 } else { (last + 1).min(32) };
        let (a, b) = (last, last - random.below(far));
        last += 1;
        let kind = random.below(7);
        let (formula, cost) = match kind {
            0 => (format!("(v{a} + v{b}) * 0.5"), 2),
            1 => (format!("v{a} * v{b}"), 1),
            2 => (format!("(v{b} - v{a}) * 0.5"), 2),
            3 => (format!("min(v{a}, v{b})"), 1),
            4 => (format!("max(v{a}, v{b})"), 1),
            5 => (format!("sqrt(v{a} * v{a} + 1.0) - v{b} * 0.25 - 0.5"), 6),
            _ => (format!("abs(v{a}) - 0.5"), 2),
        };
        let _ = writeln!(text, "let v{last} = {formula};");
        count += cost;
        for model in &mut models {
            let (a, b) = (model[a], model[b]);
            let (x, y) = (a.0[0], b.0[0]);
            model.push(match kind {
                0 => Dual::combine(a, 0.5, b, 0.5, (x + y) * 0.5),
                1 => Dual::combine(a, y, b, x, x * y),
                2 => Dual::combine(b, 0.5, a, -0.5, (y - x) * 0.5),
                3 => {
                    if y < x {
                        b
                    } else {
                        a
                    }
                }
                4 => {
                    if x < y {
                        b
                    } else {
                        a
                    }
                }
                5 => {
                    let root = (x * x + 1.0).sqrt();
                    Dual::combine(a, x / root, b, -0.25, root - y * 0.25 - 0.5)
                }
                _ => {
                    let sign = if x == 0.0 { 0.0 } else { x.signum() };
                    Dual::combine(a, sign, a, 0.0, x.abs() - 0.5)
                }
            });
        }
    }
    let _ = writeln!(text, "v{last}\n}}");
    (text, models.iter().map(|m| m[last].0.to_vec()).collect())
}

#[test]
fn a_program_of_8000_operations() {
    let points = [[0.3, -0.2, 0.7], [-0.9, 0.4, 0.1], [0.05, 0.6, -0.55]];
    let (source, models) = generated(8000, &points);
    for (found, model) in evaluate(&source, Precision::F64, &points).iter().zip(&models) {
        assert_near(found, model, 1e-9);
    }
    for (found, model) in evaluate(&source, Precision::F32, &points).iter().zip(&models) {
        assert_near(&found[..1], &model[..1], 1e-3);
    }
}

const TREE: &str = "
concept D: vec3 -> real;
entity Leaf(k: real);
operation Sum();
operation Half();
impl Leaf for D(p) { p.x * k + p.y }
impl Sum<a, b> for D(p) { eval a.D(p) + eval b.D(p) }
impl Half<a> for D(p) { 0.5 * eval a.D(p) }

fn leaf(k: int) -> csg { if k % 4 == 0 { Half(){ Leaf(k::<real>) } } else { Leaf(k::<real>) } }
fn grown(tree: csg, k: int) -> csg { Sum(){ leaf(k) }{ tree } }
";

/// Σ over the leaves of `chain(n)`: the gradient of the whole by p.x and p.y.
fn sum_of_leaves(n: i32) -> [f64; 2] {
    let weight = |k: i32| if k % 4 == 0 { 0.5 } else { 1.0 };
    let x = (0..n).map(|k| weight(k) * f64::from(k)).sum();
    [x, (0..n).map(weight).sum()]
}

#[test]
fn a_tree_of_2000_nodes_900_deep() {
    // 899 sums, 900 leaves, every fourth of them halved: 2,024 nodes.
    let source = format!(
        "{TREE}
        fn chain() -> csg {{
            csg tree = leaf(0);
            for i in 1..900 {{ tree = grown(tree, i); }}
            tree
        }}
        export fn f(p: vec3) -> real {{ csg tree = chain(); eval tree.D(p) * 0.001 }}"
    );
    let [x, y] = sum_of_leaves(900);
    let (x, y) = (x * 0.001, y * 0.001);
    for precision in [Precision::F32, Precision::F64] {
        for row in evaluate(&source, precision, &[[1.0, 2.0, 3.0]]) {
            assert_near(&row, &[x + 2.0 * y, x, y, 0.0], 1e-5);
        }
    }
}

#[test]
fn a_tree_deeper_than_the_limit() {
    let source = format!(
        "{TREE}
        export fn f(p: vec3) -> real {{
            csg tree = Leaf(1.0);
            for i in 0..3000 {{ tree = Half(){{ tree }}; }}
            eval tree.D(p)
        }}"
    );
    assert_eq!(error(&source), "E1005");
}

#[test]
fn a_chain_that_doubles_60_times() {
    let source = "
        module std::prelude;
        fn doubled(c: csg) -> csg { SmoothUnion(0.25){ c }{ Union(){ c }{ c } } }
        export fn f(p: vec3) -> real {
            csg c = Sphere(1.0);
            for i in 0..60 { c = doubled(c); }
            eval c.Sdf3d(p)
        }";
    // Each smooth union of equal operands takes a quarter of its radius.
    for row in evaluate(source, Precision::F64, &[[0.0, 3.0, 4.0]]) {
        assert_near(&row, &[4.0 - 60.0 * 0.0625, 0.0, 0.6, 0.8], 1e-9);
    }
}

#[test]
fn a_tuple_that_doubles_and_a_long_sum() {
    let mut source = String::from("export fn f(p: vec3) -> real {\nlet v = p.x;\n");
    for _ in 0..60 {
        source += "v = v + v;\n";
    }
    source += "v * 8.673617379884035e-19";
    for _ in 0..20_000 {
        source += " + p.y";
    }
    source += "\n}";
    for row in evaluate(&source, Precision::F64, &[[0.5, 0.25, 0.0]]) {
        assert_near(&row, &[0.5 + 5000.0, 1.0, 20_000.0, 0.0], 1e-9);
    }
}

#[test]
fn a_long_chain_of_else_ifs() {
    let mut source = String::from("export fn f(p: vec3) -> real {\nif p.x < 0.0 { 0.0 }\n");
    for i in 1..800 {
        let _ = writeln!(source, "else if p.x < {i}.0 {{ {i}.0 * p.x }}");
    }
    source += "else { p.y }\n}";
    let rows = evaluate(&source, Precision::F64, &[[-1.0, 7.0, 0.0], [499.5, 7.0, 0.0], [1000.0, 7.0, 0.0]]);
    assert_near(&rows[0], &[0.0, 0.0, 0.0, 0.0], 0.0);
    assert_near(&rows[1], &[500.0 * 499.5, 500.0, 0.0, 0.0], 1e-12);
    assert_near(&rows[2], &[7.0, 0.0, 1.0, 0.0], 0.0);
}

#[test]
fn derivatives_of_a_long_loop_are_no_longer_than_of_a_short_one() {
    let graph_size = |n: u32| {
        let source = format!(
            "export fn f(p: vec3) -> real {{
                let z = p;
                for i in 0..{n} {{ z = [z.y * 0.5, z.z + z.x * 0.25, sin(z.x)]; }}
                length(z)
            }}"
        );
        let checked = support::check_ok(&source);
        let queries = [Query::Value, Query::Gradient("p".into()), Query::Hessian("p".into(), "p".into())];
        support::Graphs::of(&checked, "f", &queries, Precision::F32, Sweep::Forward).expect("graphs").scheduled.len()
    };
    assert_eq!(graph_size(10), graph_size(10_000));
}

#[test]
fn hostile_sources_are_answered_with_their_limit() {
    let nested = |open: &str, n: usize, close: &str| {
        format!("export fn f(x: real) -> real {{ {}x{} }}", open.repeat(n), close.repeat(n))
    };
    assert_eq!(error(&nested("(", 100_000, ")")), "E1004");
    assert_eq!(error(&nested("[", 100_000, "")), "E1004");
    assert_eq!(error(&nested("-", 100_000, "")), "E1004");
    assert_eq!(error(&nested("if x > 0.0 {", 20_000, "} else { x }")), "E1004");
    assert_eq!(error(&nested("(", 200, ")")), "none");
    assert_eq!(error(&"// ten megabytes\n".repeat(10 * 1024 * 1024 / 17)), "E1001");
    let loops = "concept D: real -> real; entity L(); operation O(); impl L for D(x) { x }
        impl O<a> for D(x) { eval a.D(x) + 1.0 }
        export fn f(x: real) -> real { csg c = L(); for i in 0..1000000000 { c = O(){ L() }; } eval c.D(x) }";
    assert_eq!(error(loops), "E1006");
    let wide =
        "export fn f(x: real) -> real { let m = x;\n".to_owned() + &"m = diff(m * m * x, x);\n".repeat(9) + "m }";
    assert_eq!(error(&wide), "E1009");
}

#[test]
fn a_run_time_loop_of_a_thousand_million_iterations_compiles() {
    let source = "export fn f(x: real) -> real { let s = x; for i in 0..1000000000 { s = s * 0.5; } diff(s, x) }";
    assert_eq!(error(source), "none");
}

#[test]
fn impls_that_build_each_other() {
    let source = "
        concept A: real -> real;
        concept B: real -> real;
        operation P();
        operation Q();
        impl P<s> for A(x) { csg t = Q(){ s }; eval t.B(x) }
        impl Q<s> for B(x) { csg t = P(){ s }; eval t.A(x) }
        entity L();
        impl L for A(x) { x }
        export fn f(x: real) -> real { csg t = P(){ L() }; eval t.A(x) }";
    assert_eq!(error(source), "E0607");
    // One is evaluated around the other, but it builds only nodes of the other: that is no cycle.
    let nested = source
        .replace("csg t = P(){ s }; eval t.A(x)", "1.0 + eval s.B(x)")
        .replace("for A(x) { x }", "for B(x) { x }");
    let nested = nested
        .replace("csg t = P(){ L() }", "csg t = Q(){ Q(){ P(){ L() } } }")
        .replace("eval t.A(x) }", "eval t.B(x) }");
    assert_eq!(error(&nested), "none");
}

#[test]
fn branches_inside_branches_that_carry_csg() {
    // A full tree of choices: 512 leaves, of which `p.x` decides.
    let mut choices: Vec<String> = (0..512).map(|k| format!("Leaf({k}.0)")).collect();
    let mut width = 1;
    while choices.len() > 1 {
        let joined = choices.chunks(2).enumerate().map(|(i, pair)| {
            let border = (2 * i + 1) * width;
            format!("if p.x < {border}.0 {{ {} }} else {{ {} }}", pair[0], pair[1])
        });
        choices = joined.collect();
        width *= 2;
    }
    let source = format!("{TREE} export fn f(p: vec3) -> real {{ csg t = {}; eval t.D(p) }}", choices[0]);
    for row in evaluate(&source, Precision::F64, &[[300.5, 2.0, 0.0]]) {
        assert_near(&row, &[300.5 * 300.0 + 2.0, 300.0, 1.0, 0.0], 1e-12);
    }
    // Each choice is between the tree so far and something around it: not 2⁶⁰ trees, but a chain.
    let mut chain = format!("{TREE} export fn f(p: vec3) -> real {{ csg t = Leaf(1.0);\n");
    for i in 0..60 {
        let _ = writeln!(chain, "if p.x > {i}.0 {{ t = Sum(){{ t }}{{ Leaf({i}.0) }}; }}");
    }
    chain += "eval t.D(p) }";
    for row in evaluate(&chain, Precision::F64, &[[10.5, 2.0, 0.0]]) {
        assert_near(&row, &[10.5 * 56.0 + 2.0 * 12.0, 56.0, 12.0, 0.0], 1e-12);
    }
}

#[test]
fn a_hundred_thousand_statements() {
    let source = |n: usize| format!("export fn f(x: real) -> real {{\nlet y=x;\n{}y }}", "y=y+x;\n".repeat(n));
    assert_eq!(error(&source(100_000)), "none");
    assert_eq!(error(&source(149_000)), "none");
    assert_eq!(error(&source(150_000)), "E1001");
}

#[test]
fn five_thousand_functions() {
    let calls = |n: usize| -> String {
        (1..n).map(|i| format!("fn g{i}(x: real) -> real {{ g{}(x) + 1.0 }}\n", i - 1)).collect()
    };
    let chain = |n: usize| {
        format!("fn g0(x: real) -> real {{ x }}\n{}export fn f(x: real) -> real {{ g{}(x) }}", calls(n), n - 1)
    };
    assert_eq!(error(&chain(5000)), "E1005");
    assert_eq!(error(&chain(1000)), "none");
    let beside: String = (0..5000).map(|i| format!("fn g{i}(x: real) -> real {{ x + {i}.0 }}\n")).collect();
    let sum: Vec<String> = (0..5000).map(|i| format!("g{i}(x)")).collect();
    assert_eq!(error(&format!("{beside}export fn f(x: real) -> real {{ {} }}", sum.join(" + "))), "none");
    let circle: String =
        (0..5000).map(|i| format!("fn g{i}(x: real) -> real {{ g{}(x) }}\n", (i + 1) % 5000)).collect();
    assert_eq!(error(&format!("{circle}export fn f(x: real) -> real {{ x }}")), "E0506");
}

#[test]
fn texts_of_every_kind() {
    let codes = |bytes: &[u8]| -> Vec<&str> {
        let loader = isograd_compiler::MemoryLoader::default();
        let options = support::options();
        let checked =
            isograd_compiler::check("main.vola", bytes.to_vec(), &loader, &options, &isograd_compiler::Unwatched);
        checked.diagnostics.iter().map(|d| d.code.name()).collect()
    };
    let none: [&str; 0] = [];
    for text in [
        "",
        " \t\r\n",
        "\u{feff}",
        "// only a comment",
        "\u{feff}// a mark\r\n/// Doc\r\nexport fn f(x: real) -> real {\r\n  let y = x; // c\r\n  y\r\n}\r\n",
        "entity Kugel_ß(größe: real); concept 距離: vec3 -> real; impl Kugel_ß for 距離(п) { length(п) - größe }
         export fn fläche(п: vec3) -> real { csg ё = Kugel_ß(1.0); eval ё.距離(п) }",
    ] {
        assert_eq!(codes(text.as_bytes()), none, "{text:?}");
    }
    assert_eq!(codes(b"export fn f(x: real) -> real { x } // \xFF"), ["E0101"]);
    assert_eq!(codes(b"\xFF\xFEe\0x\0"), ["E0101"], "UTF-16");
    assert_eq!(codes(b"export fn f(x: real) -> real { x \0 }"), ["E0102"]);
    assert_eq!(codes("export fn f(x: real) -> real { x \u{feff} }".as_bytes()), ["E0102"], "a mark inside");
    assert_eq!(codes("export fn f(x: real) -> real { x\u{a0}+ x }".as_bytes()), ["E0102"], "a space that is none");
}

#[test]
fn a_tuple_that_doubles_is_reported_once() {
    let source = format!("export fn f(x: real) -> real {{ let t = (x, x); {} x }}", "t = (t, t);".repeat(40));
    let found = support::check(&source).diagnostics;
    assert_eq!(found.iter().filter(|d| d.code.name() == "E1010").count(), 1, "{}", support::listed(&found));
}
