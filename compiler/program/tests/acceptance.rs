//! The rows of LANGUAGE 21: all programs of 21.1 and 21.2 that this version compiles are accepted without a
//! diagnostic or with the warnings named, the errors of 21.5 that need no specialisation are found.

mod common;

use common::{PRELUDE, check_text, codes};

fn row(signature: &str, body: &str) -> String {
    let (loaded, checked) = check_text(&format!("{PRELUDE}\nexport fn {signature} {{ {body} }}"));
    codes(&loaded, &checked)
}

/// (row, signature, body, codes)
const ROWS: &[(&str, &str, &str, &str)] = &[
    ("1", "f(v: vec2) -> vec2", "let m = [[1.0,2.0],[3.0,4.0]]; m * v", ""),
    ("2", "f(v: vec2) -> vec2", "let m = [[1.0,2.0],[3.0,4.0]]; v * m", ""),
    ("3", "f(k: real) -> mat2", "[[k,2.0],[3.0,4.0]] * [[0.0,1.0],[1.0,0.0]]", ""),
    ("4", "f(v: vec2) -> vec2", "v * v", ""),
    ("5", "f(x: real) -> vec3", "cross([1.0,0.0,0.0], [0.0,1.0,0.0])", ""),
    ("6", "f(a: real) -> real", "mix(0.0, 10.0, a)", ""),
    ("7", "f(a: real) -> real", "mod(a, 3.0)", ""),
    ("8", "f(x: real) -> real", "clamp(x, 0.0, 1.0)", ""),
    ("9", "f(a: real) -> real", "let s = a; for i in 1..4 { s = s + i::<real>; } s", ""),
    ("10", "f(a: real) -> real", "let r = a; if a > 0.0 { let r = 5.0; r = 6.0; } r", ""),
    ("11", "f(a: real) -> real", "let r = a; if a > 0.0 { r = 6.0; } r", ""),
    ("12", "f(x: real) -> real", "let r = 1.0; let y = if x > 0.0 { r = 2.0; r } else { r }; r + y", ""),
    ("13", "f(x: real) -> real", "let r = 0.0; if x > 0.0 { if x > 1.0 { r = 2.0; } else { r = 1.0; } } r", ""),
    ("14", "f(x: real) -> real", "if x < 0.0 {0.0} else { if x < 1.0 {1.0} else {2.0} }", ""),
    ("15", "f(x: real) -> real", "if x < 0.0 {0.0} else if x < 1.0 {1.0} else {2.0}", ""),
    ("16", "f(x: real) -> bool", "1.0 + x*3.0 == 7.0 && x > 1.0 || x < -5.0", ""),
    ("17", "f(x: real) -> real", "let t = (x, ([x,5.0], 1.0)); t.0 + t.1.0.y", ""),
    ("18", "f(x: real) -> real", "x::<int>::<real>", ""),
    ("19", "f(x: real) -> int", "x::<int>", ""),
    ("20", "f(x: real) -> real", "let b = x > 1.0; b::<real>", ""),
    ("21", "f(n: int) -> (int, int, int)", "let a = n - 8; (a / 2, a % 2, a / 0)", "W0403"),
    ("22", "f(x: real) -> real", "let k = 1.0; csg e = Shift(k); k = 100.0; eval e.D(x)", ""),
    ("23", "f(x: real) -> real", "let k = 1.0; csg e = Add(){ k = k + 1.0; Plus(k) }{ Plus(k) }; eval e.D(x)", ""),
    ("24", "f(x: real) -> real", "csg e = Tag(7.0){ Shift(1.0) }; eval e.D(x)", ""),
    ("25", "f(x: real) -> real", "csg c = Line(); for i in 0..7 { c = Inc(){ c }; } eval c.D(x)", ""),
    ("26", "f(x: real) -> real", "csg c = if x > 0.0 { Line() } else { Five() }; eval c.D(x)", ""),
    ("27", "f(x: real) -> real", "csg c = twice(Plus(1.0)); eval c.D(x)", ""),
    ("28", "f(a: real) -> real", "let r = for x = a in 0..4 { x = x * 2.0; }; r", ""),
    ("29", "f(x: real) -> real", "min(x, 0.0/0.0) + max(x, 0.0/0.0)", ""),
    ("30", "f(x: real) -> (real, real)", "(1.0 / min(-0.0, x), 1.0 / max(x, -0.0))", ""),
    ("31", "f(x: real) -> vec2", "2.0 * [x, 1.0] / 4.0 + ([x, x] * 1e-3)", ""),
    ("32", "f(p: vec2) -> real", "(p + p).y + [1.0, 2.0].x + p::<vec2<int>>.x::<real>", ""),
    ("33", "f(x: real) -> real", "sign(x)", ""),
    ("34", "f(v: vec3) -> vec2", "[[1.0,2.0],[3.0,4.0],[5.0,6.0],] * v", ""),
    ("35", "f(x: real) -> mat2", "inverse([[2.0,x],[1.0,3.0]])", ""),
    ("36", "f(x: real) -> (real, real, real)", "(smoothstep(0.0,1.0,x), saturate(3.0*x), fract(-x))", ""),
    ("37", "f(x: real) -> vec3", "rotate(quat([0.0,0.0,1.0], x), [1.0,0.0,0.0])", ""),
    ("38", "f(x: real) -> quat", "quat(0.0,0.0,x,x) * quat(0.0,0.0,x,x)", ""),
    ("39", "f(x: real) -> (real, real)", "(round(x), round(-x))", ""),
    ("40", "f(p: vec3) -> mat3x2", "diff([p.x*p.y, p.x+p.y+p.z], p)", ""),
    ("41", "f(p: vec2) -> mat2", "let y = p.x*p.x + p.x*p.y; let g = diff(y, p); diff(g, p)", ""),
    ("42", "f(x: real) -> real", "let y = x*x*x; diff(diff(y, x), x)", ""),
    ("45", "f(x: real, n: int) -> real", "let y = 1.0; for i in 0..n { y = y*x; } diff(y, x)", ""),
    ("47", "f(x: real) -> vec2", "let c = 2.0*3.0; let y = x*x; [diff(c, x), diff(y, x)]", ""),
    ("49", "f(x: real) -> real", "let y = x*x; x = x - 1.0; diff(y, x)", ""),
    ("50", "f(x: real, t: real) -> vec2", "csg c = Along(t*t*t, t){ Line() }; eval c.V(x)", ""),
    ("51", "f(x: real) -> real", "csg c = Square(); diff(eval c.D(x), x)", ""),
    ("52", "f(p: vec2) -> mat2", "let l = length(p); let g = diff(l, p); diff(g, p) * 1.25", ""),
    ("55", "f(x: real) -> (real, real)", "let y = x * 1.0; (diff(sin(2.0*x), 2.0*x), diff(sin(x), y))", ""),
    ("66", "f(y: real, x: real) -> vec2", "diff(atan2(y, x), [y, x])", ""),
    ("68", "f(a: real) -> vec3", "diff(rotate(quat([0.0,0.0,1.0], a), [1.0,0.0,0.0]), a)", ""),
    ("69", "f(q: quat) -> mat4x3", "diff(rotate(q, [1.0,0.0,0.0]), q)", ""),
    ("70", "f(v: vec2) -> mat2", "diff(normalize(v), v)", ""),
    ("71", "f(x: real) -> interval<real>", "[-1.0..2.0] * [3.0..4.0]", ""),
    ("72", "f(i: interval<real>) -> interval<real>", "[0.0..1.0] - i", ""),
    ("73", "f(x: real) -> interval<real>", "bound(x*2.0, x, [-1.0..2.0])", ""),
    ("74", "f(x: real) -> interval<real>", "bound(x*x, x, [-1.0..2.0])", ""),
    ("75", "f(x: real) -> (real, real)", "let a = [2.0 .. x]; let b = a + [0.0 .. 0.0]; (a.start, b.start)", ""),
    ("76", "f(p: vec2) -> interval<real>", "bound(length(p), p, [[-2.0,0.0] .. [1.0,3.0]])", ""),
    ("77", "f(x: real) -> interval<real>", "let y = if x < 0.0 { -x } else { 2.0*x }; bound(y, x, [-1.0..2.0])", ""),
    ("78", "f(x: real) -> interval<real>", "let y = if x < 0.0 { -x } else { 2.0*x }; bound(y, x, [1.0..2.0])", ""),
    (
        "79",
        "f(x: real) -> (real, real, bool)",
        "let i = bound(sqrt(x), x, [-1.0..4.0]); (i.start, i.end, i.may_be_nan)",
        "",
    ),
    ("80", "f(x: real) -> interval<real>", "bound(diff(x*x, x), x, [1.0..3.0])", ""),
    ("81", "f(x: real) -> interval<real>", "bound(diff(abs(x), x), x, [-1.0..1.0])", ""),
    ("82", "f(x: real) -> real", "let i = [[0.0,1.0] .. [2.0,x]]; i.y.end + i.1.x", ""),
    ("83", "f(x: real) -> interval<real>", "bound(1.0/x, x, [-1.0..1.0])", ""),
    ("84", "f(x: real) -> interval<real>", "bound(sin(x), x, [0.0..2.0])", ""),
    ("88", "f(x: real) -> real", "x + 1", "E0401"),
    ("89", "f(x: real) -> real", "let v = [1, 2, 3]; v.x", "E0405"),
    ("90", "f(x: real) -> real", "let x = 2.0; x", "E0302"),
    ("91", "f(x: real) -> real", "y", "E0301"),
    ("94", "f(x: real) -> real", "csg e = if x > 0.0 { Line() } else { 1.0 }; eval e.D(x)", "E0601"),
    ("95", "f(x: real) -> real", "let e = Line(); x", "E0602"),
    ("96", "f(x: real) -> real", "let s = 0.0; for i in 0..x { s = s + 1.0; } s", "E0504"),
    ("98", "f(x: real) -> real", "let r = if x > 0.0 { [x, x] } else { [x, x, x] }; r.x", "E0502"),
    ("99", "f(x: real) -> real", "let m = [[1.0,2.0,3.0],[4.0,5.0,6.0]]; (m * [x, x, x]).x", "E0404"),
    ("100", "f(x: real) -> real", "diff(x::<int>, x)", "E0701"),
    ("104", "f(x: real) -> real", "csg e = Add(){ let k = 1.0; Plus(k) }{ Plus(k) }; eval e.D(x)", "E0301"),
];

#[test]
fn rows_of_language_21() {
    let wrong: Vec<String> = ROWS
        .iter()
        .filter_map(|(number, signature, body, expected)| {
            let found = row(signature, body);
            (found != *expected).then(|| format!("row {number}: expected [{expected}], found [{found}]"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn rows_with_items() {
    let items = |items: &str| {
        let (loaded, checked) = check_text(&format!("{PRELUDE}\n{items}\nexport fn f(x: real) -> real {{ x }}"));
        codes(&loaded, &checked)
    };
    assert_eq!(items("fn a(x: real) -> real { b(x) } fn b(x: real) -> real { a(x) }"), "E0506 E0506", "row 101");
    assert_eq!(items("operation Op(); impl Op<s> for D(x) { csg t = Op(){ s }; eval t.D(x) }"), "E0607", "row 102");
    let indirect = "operation P(); operation Q(); impl P<s> for D(x) { csg t = Q(){ s }; eval t.D(x) }
        impl Q<s> for D(x) { csg t = P(){ s }; eval t.D(x) }";
    assert_eq!(items(indirect), "", "row 103 is found by elaboration");
}

#[test]
fn the_2024_program_of_section_20_is_accepted() {
    let std = "concept Sdf3d: vec3 -> real; concept Color3d: vec3 -> vec3;
        entity Sphere(radius: real); entity Box(extent: vec3); entity Cylinder(radius: real, half: real);
        operation UnionStairs(radius: real, n: real); operation SmoothUnion(radius: real);
        operation Trans3d(offset: vec3); operation Round(radius: real);
        fn max_element(v: vec3) -> real { max(v.x, max(v.y, v.z)) }";
    let program = "module stdlib::prelude;
        operation NormalToColor();
        impl NormalToColor<sub> for Color3d(at){
            let grad = diff(eval sub.Sdf3d(at), at);
            abs(grad / [length(grad); 3])
        }
        operation Sharpness(threshold: s, color_a: vec3, color_b: vec3);
        impl Sharpness<sub> for Color3d(at){
            let ddist = diff(eval sub.Sdf3d(at), at);
            let second = diff(ddist, at);
            let maxes = [length(second.x), length(second.y), length(second.z)];
            let sharpness = max_element(maxes);
            let is_sharp = if sharpness > threshold{ 1.0 }else{ 0.0 };
            mix(color_a, color_b, [is_sharp; 3])
        }
        define myugf(time: s){
            NormalToColor(){
                UnionStairs(0.2, 5.0 + sin(time)){
                    Sphere(1.0)
                }{
                    SmoothUnion(0.2){
                        Trans3d([1.5, 1.0, 0.0]){ Box([1.0; 3]) }
                    }{
                        Trans3d([2.0, -0.0, 0.0]){ Cylinder(0.2, 0.5) }
                    }
                }
            }
        }
        define edges(){ Sharpness(3.0, [0.0; 3], [1.0; 3]){ Round(0.1){ Box([1.0; 3]) } } }
        export shade(at: vec3, time: s){
            csg field = myugf(time);
            csg marked = edges();
            (eval field.Color3d(at), eval marked.Color3d(at))
        }
        export field_only(at: vec3, time: s){
            csg field = myugf(time);
            eval field.Sdf3d(at)
        }";
    let loader = common::Memory::new(&[("std/prelude", std)], &["std", "stdlib"]);
    let (loaded, checked) = common::check_files(program, &loader);
    assert_eq!(codes(&loaded, &checked), "");
    let results: Vec<String> = checked
        .program
        .exports
        .iter()
        .map(|f| {
            let f = &checked.program.functions[f.0 as usize];
            format!("{} {}", f.name, f.result)
        })
        .collect();
    assert_eq!(results, ["shade (vec3, vec3)", "field_only real"]);
}
