//! From the 2024 dialect to the current one: the text of each construct, and that the result is the same program
//! without an outdated form.

use isograd_compiler::{Checked, Code, MemoryLoader, Options, Request, Unwatched, check, migrate, print_step};

fn migrated(text: &str) -> String {
    let loader = MemoryLoader::default();
    let check = |text: &str| check("main.vola", text.as_bytes().to_vec(), &loader, &Options::default(), &Unwatched);
    let checked = check(text);
    let once = migrate(&checked, &loader).unwrap_or_else(|| panic!("{:?}", checked.diagnostics));
    let again = check(&once);
    assert!(again.is_ok(), "{once}\n{:?}", again.diagnostics);
    assert!(again.diagnostics.iter().all(|d| d.code != Code::W0603), "{once}");
    assert_eq!(again.exports(), checked.exports(), "{once}");
    assert_eq!(migrate(&again, &loader).as_deref(), Some(once.as_str()), "not at rest");
    once
}

#[test]
fn every_form() {
    let text = "
concept D: s -> s;
concept Pair: (s, s) -> vec2<s>;
entity Line();
operation Shift(k: s, n: i);
impl Line for D(x) { x }
impl Line for Pair(x, y) { [x, y] }
impl Shift<sub> for D(x) { sub.D(x - k) }
define moved(k: s) { Shift(k, 1){ Line() } }
fn same(t: CSG) -> CSG { t() }
export value(x: s) {
    csg t = moved(1.0); // a tree
    csg u = same(t());
    let r = for v = x in 0..3 { let k = v; v = v * 2.0 + k; };
    let x3 = (for y = x in 0..1 { y = y; });
    (t.D(r), eval u.Pair(x, x3).x, for q = 1 in 0..2 { q = q + 1; })
}
";
    // `Pair` has no impl for the operation, which is the identity on its operand.
    let expected = "\
concept D: real -> real;
concept Pair: (real, real) -> vec2<real>;
entity Line();
operation Shift(k: real, n: int);
impl Line for D(x) { x }
impl Line for Pair(x, y) { [x, y] }
impl Shift<sub> for D(x) { eval sub.D(x - k) }
fn moved(k: real) -> csg { Shift(k, 1){ Line() } }
fn same(t: csg) -> csg { t }
export fn value(x: real) -> (real, real, int) {
    csg t = moved(1.0); // a tree
    csg u = same(t);
    let r = x;
    for i2 in 0..3 { let k = r; r = r * 2.0 + k; }
    let x3 = x;
    for i3 in 0..1 { x3 = x3; }
    (eval t.D(r), eval u.Pair(x, x3).x, for q = 1 in 0..2 { q = q + 1; })
}
";
    let result = migrated(text);
    assert_eq!(result, expected);
}

#[test]
fn loops_that_would_change_their_meaning_stay() {
    for text in [
        // The bound name means another variable in the bounds, or in the body.
        "export fn f(n: int) -> real { if n > 0 { let n = for v = 0.0 in 0..n { v = v + 1.0; }; n } else { 1.0 } }",
        "export fn f(n: real) -> real { if n > 0.0 { let n = for v = 0.0 in 0..3 { v = v + n; }; n } else { 1.0 } }",
        // The body hides the name.
        "export fn f(n: real) -> real { let r = for v = n in 0..3 { if v > 1.0 { let v = 2.0; v = v + 1.0; } v = v + 1.0; }; r }",
    ] {
        let result = migrated(text);
        assert!(result.contains("for v ="), "{result}");
    }
}

#[test]
fn a_current_program_is_only_formatted() {
    let text =
        "module std::sphere;\nexport fn f(p: vec3) -> real {\n    csg s = Sphere(1.0);\n    eval s.Sdf3d(p)\n}\n";
    assert_eq!(migrated(text), text);
}

/// Migrating changes the text; the value and the gradient of every export stay the same graph.
#[test]
fn the_graphs_stay_the_same() {
    let items = "
concept D: s -> s;
concept N: -> s;
entity Line();
entity Plus(k: s);
operation Inc();
operation Both();
impl Line for D(x) { x }
impl Line for N() { 3.0 }
impl Plus for D(x) { x + k }
impl Inc<sub> for D(x) { sub.D(x) + 1.0 }
impl Both<a, b> for D(x) { a.D(x) * b.D(x) }
";
    for text in [
        "define t(k: s) { Plus(k) }\nexport f(x: s) { csg u = t(x); csg t = Line(); csg v = t(2.0); u.D(x) + v.D(x) + t.D(x) }",
        "export f(x: s) { csg t = Line(); -t.D(x) * t.D(x)::<i>::<s> - t.D(t.D(t.N())) }",
        "export f(x: s) { csg t = for c = Line() in 0..3 { c = Inc(){ c() }; }; t.D(x) }",
        "export f(x: s) { let r = for v = (for w = x in 0..2 { w = w + 1.0; }) in 0..3 { v = v * x; }; (r, [r, x]) }",
        "export f(x: s) { let r = (for v = x in 0..3 { let k = v; if k > 1.0 { v = k * 2.0; } else { let z = k; v = z + x; } }); let q = diff(r, x); q * r }",
        "export f(x: s, n: i) { let i = 2.0; let i2 = x; let r = for v = i in 0..n { v = v * i2; }; let t = for v = r in 0..n { v = v + i; }; r + t }",
        "export f(x: s) { let y = if x > 0.0 { let r = for v = x in 0..2 { v = v + x; }; r } else { let r = 1.0; r }; y }",
        "export f(x: s) { let r = x; if x > 0.0 { let r = for v = r in 0..2 { v = v + x; }; x = r; } r + x }",
        "export f(x: s) { let v = 5.0; let r = for v = v in 0..2 { v = v * x; }; r + v }",
        "export f(x: s) { let r = for x = x in 0..2 { x = x * x; }; r + x }",
        "export f(x: s) { csg a = Both(){ let r = for v = x in 0..2 { v = v + 1.0; }; Plus(r) }{ Line() }; csg b = a(); b.D(x) }",
        "export f(x: s) { let v = [x, x]; let r = for q = v.x in 0..2 { q = q + v.y; }; r }",
        "export f(r: s) { let a = for v = r in 0..2 { let r = v; v = r * 2.0; }; a }",
    ] {
        let text = format!("{items}{text}\n");
        let loader = MemoryLoader::default();
        let check = |t: &str| check("main.vola", t.as_bytes().to_vec(), &loader, &Options::default(), &Unwatched);
        let before = check(&text);
        let migrated = migrate(&before, &loader).unwrap_or_else(|| panic!("{:?}", before.diagnostics));
        let after = check(&migrated);
        for export in before.exports() {
            let request =
                Request { export: export.name, queries: vec!["value".parse().unwrap()], ..Request::default() };
            let graph = |c: &Checked| print_step(c, &request, "elaborate", &Options::default(), &Unwatched).unwrap();
            assert_eq!(graph(&before), graph(&after), "{migrated}");
        }
    }
}
