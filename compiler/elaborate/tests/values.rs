//! The rows of LANGUAGE 21.1, 21.2 and 21.5 that need no transform, and single built-ins. Knows nothing of how a
//! graph is made.

mod common;

use common::{agree, codes, derivatives, example, graph, run};
use isograd_syntax::Code;

const INF: f64 = f64::INFINITY;

/// Row, signature, body, and inputs with results.
type Row = (&'static str, &'static str, &'static str, &'static [(&'static [f64], &'static [f64])]);

const ROWS: &[Row] = &[
    ("1", "f(v: vec2) -> vec2", "let m = [[1.0,2.0],[3.0,4.0]]; m * v", &[(&[1., 10.], &[31., 42.])]),
    ("2", "f(v: vec2) -> vec2", "let m = [[1.0,2.0],[3.0,4.0]]; v * m", &[(&[1., 10.], &[21., 43.])]),
    ("3", "f(k: real) -> mat2", "[[k,2.0],[3.0,4.0]] * [[0.0,1.0],[1.0,0.0]]", &[(&[1.], &[3., 4., 1., 2.])]),
    ("4", "f(v: vec2) -> vec2", "v * v", &[(&[2., 3.], &[4., 9.])]),
    ("5", "f(x: real) -> vec3", "cross([1.0,0.0,0.0], [0.0,1.0,0.0])", &[(&[0.], &[0., 0., 1.])]),
    ("6", "f(a: real) -> real", "mix(0.0, 10.0, a)", &[(&[1.5], &[15.])]),
    ("7", "f(a: real) -> real", "mod(a, 3.0)", &[(&[-1.], &[2.])]),
    ("8", "f(x: real) -> real", "clamp(x, 0.0, 1.0)", &[(&[2.], &[1.])]),
    ("9", "f(a: real) -> real", "let s = a; for i in 1..4 { s = s + i::<real>; } s", &[(&[0.], &[6.])]),
    ("10", "f(a: real) -> real", "let r = a; if a > 0.0 { let r = 5.0; r = 6.0; } r", &[(&[1.], &[1.])]),
    ("11", "f(a: real) -> real", "let r = a; if a > 0.0 { r = 6.0; } r", &[(&[1.], &[6.]), (&[-1.], &[-1.])]),
    (
        "12",
        "f(x: real) -> real",
        "let r = 1.0; let y = if x > 0.0 { r = 2.0; r } else { r }; r + y",
        &[(&[1.], &[3.]), (&[-1.], &[2.])],
    ),
    (
        "13",
        "f(x: real) -> real",
        "let r = 0.0; if x > 0.0 { if x > 1.0 { r = 2.0; } else { r = 1.0; } } r",
        &[(&[-1.], &[0.]), (&[0.5], &[1.]), (&[3.], &[2.])],
    ),
    ("14", "f(x: real) -> real", "if x < 0.0 {0.0} else { if x < 1.0 {1.0} else {2.0} }", &[(&[3.], &[2.])]),
    (
        "15",
        "f(x: real) -> real",
        "if x < 0.0 {0.0} else if x < 1.0 {1.0} else {2.0}",
        &[(&[-1.], &[0.]), (&[0.5], &[1.]), (&[3.], &[2.])],
    ),
    ("16", "f(x: real) -> bool", "1.0 + x*3.0 == 7.0 && x > 1.0 || x < -5.0", &[(&[2.], &[1.]), (&[3.], &[0.])]),
    ("17", "f(x: real) -> real", "let t = (x, ([x,5.0], 1.0)); t.0 + t.1.0.y", &[(&[4.], &[9.])]),
    ("18", "f(x: real) -> real", "x::<int>::<real>", &[(&[-1.7], &[-1.])]),
    ("19", "f(x: real) -> int", "x::<int>", &[(&[1e20], &[2147483647.]), (&[-1e20], &[-2147483648.])]),
    ("20", "f(x: real) -> real", "let b = x > 1.0; b::<real>", &[(&[2.], &[1.])]),
    ("21", "f(n: int) -> (int, int, int)", "let a = n - 8; (a / 2, a % 2, a / 0)", &[(&[1.], &[-3., 1., 0.])]),
    ("22", "f(x: real) -> real", "let k = 1.0; csg e = Shift(k); k = 100.0; eval e.D(x)", &[(&[0.], &[-1.])]),
    (
        "23",
        "f(x: real) -> real",
        "let k = 1.0; csg e = Add(){ k = k + 1.0; Plus(k) }{ Plus(k) }; eval e.D(x)",
        &[(&[0.], &[3.])],
    ),
    ("24", "f(x: real) -> real", "csg e = Tag(7.0){ Shift(1.0) }; eval e.D(x)", &[(&[4.], &[3.])]),
    ("25", "f(x: real) -> real", "csg c = Line(); for i in 0..7 { c = Inc(){ c }; } eval c.D(x)", &[(&[0.], &[7.])]),
    (
        "26",
        "f(x: real) -> real",
        "csg c = if x > 0.0 { Line() } else { Five() }; eval c.D(x)",
        &[(&[-1.], &[5.]), (&[2.], &[2.])],
    ),
    ("27", "f(x: real) -> real", "csg c = twice(Plus(1.0)); eval c.D(x)", &[(&[1.], &[4.])]),
    ("28", "f(a: real) -> real", "let r = for x = a in 0..4 { x = x * 2.0; }; r", &[(&[1.], &[16.])]),
    ("29", "f(x: real) -> real", "min(x, 0.0/0.0) + max(x, 0.0/0.0)", &[(&[3.], &[6.])]),
    ("30", "f(x: real) -> (real, real)", "(1.0 / min(-0.0, x), 1.0 / max(x, -0.0))", &[(&[0.], &[-INF, INF])]),
    ("31", "f(x: real) -> vec2", "2.0 * [x, 1.0] / 4.0 + ([x, x] * 1e-3)", &[(&[2.], &[1.002, 0.502])]),
    ("33", "f(x: real) -> real", "sign(x)", &[(&[-2.], &[7.])]),
    ("34", "f(v: vec3) -> vec2", "[[1.0,2.0],[3.0,4.0],[5.0,6.0],] * v", &[(&[1., 1., 1.], &[9., 12.])]),
    (
        "36",
        "f(x: real) -> (real, real, real)",
        "(smoothstep(0.0,1.0,x), saturate(3.0*x), fract(-x))",
        &[(&[0.25], &[0.15625, 0.75, 0.75])],
    ),
    ("37", "f(x: real) -> vec3", "rotate(quat([0.0,0.0,1.0], x), [1.0,0.0,0.0])", &[(&[1.5707964], &[0., 1., 0.])]),
    ("38", "f(x: real) -> quat", "quat(0.0,0.0,x,x) * quat(0.0,0.0,x,x)", &[(&[0.70710677], &[0., 0., 1., 0.])]),
    ("39", "f(x: real) -> (real, real)", "(round(x), round(-x))", &[(&[2.5], &[3., -3.])]),
];

const MORE: &[Row] = &[
    ("vec*mat2x3", "f(v: vec3) -> vec2", "v * [[1.0,2.0,3.0],[4.0,5.0,6.0]]", &[(&[1., 10., 100.], &[321., 654.])]),
    (
        "mat2x3*mat3x2",
        "f(x: real) -> mat3",
        "[[x,2.0,3.0],[4.0,5.0,6.0]] * [[1.0,0.0],[0.0,1.0],[1.0,1.0]]",
        &[(&[1.], &[1., 2., 3., 4., 5., 6., 5., 7., 9.])],
    ),
    ("mod", "f(a: real, b: real) -> vec2", "[a % b, mod(-a, b)]", &[(&[7., 3.], &[1., 2.]), (&[7., -3.], &[-2., -1.])]),
    ("ints", "f(a: int) -> (int, int, int)", "(min(a, 3), clamp(a, 0, 4), abs(a) - -a)", &[(&[-5.], &[-5., 0., 0.])]),
    (
        "compare",
        "f(a: int, b: int) -> (bool, bool, bool, bool)",
        "(a > b, a >= b, a != b, a == b)",
        &[(&[2., 1.], &[1., 1., 1., 0.]), (&[1., 1.], &[0., 1., 0., 1.])],
    ),
    ("nan", "f(a: real) -> (bool, bool, bool)", "(a != a, a >= a, !(a < a))", &[(&[f64::NAN], &[1., 0., 1.])]),
    (
        "casts",
        "f(a: int) -> (bool, int, real)",
        "let b = a::<bool>; (b, b::<int>, a::<real>)",
        &[(&[5.], &[1., 1., 5.])],
    ),
    (
        "vectors",
        "f(v: vec3) -> (real, vec3, real)",
        "(dot(v, v), normalize(v), distance(v, [0.0; 3]))",
        &[(&[0., 3., 4.], &[25., 0., 0.6, 0.8, 5.]), (&[0., 0., 0.], &[0., 0., 0., 0., 0.])],
    ),
    ("reflect", "f(v: vec2) -> vec2", "reflect(v, [0.0, 1.0])", &[(&[1., -1.], &[1., 1.])]),
    ("step", "f(x: real) -> vec2", "[step(1.0, x), inversesqrt(x)]", &[(&[4.], &[1., 0.5]), (&[0.25], &[0., 2.])]),
    (
        "pow",
        "f(x: real) -> vec4",
        "[pow(x, 2.0), exp(log(x)), sqrt(x), atan2(x, x)]",
        &[(&[4.], &[16., 4., 2., std::f64::consts::FRAC_PI_4])],
    ),
    (
        "quaternion",
        "f(q: quat) -> (quat, real, mat3)",
        "(conjugate(q) / 2.0, length(q), to_mat3(q))",
        &[(&[0., 0., 1., 0.], &[0., 0., -0.5, 0., 1., -1., 0., 0., 0., -1., 0., 0., 0., 1.])],
    ),
    (
        "vectors of int",
        "f(a: vec2<int>, b: vec2<int>) -> (vec2<int>, vec2<int>, vec2<int>)",
        "(a * b - -a, a / b + a % b, max(abs(a), mod(b, a))::<vec2>::<vec2<int>>)",
        &[(&[7., -7., 2., 0.], &[21., -7., 4., 0., 7., 7.])],
    ),
    (
        "inverse",
        "f(a: real) -> (mat3, mat2, real)",
        "let m = [[2.0,0.0,1.0],[1.0,3.0,a],[0.0,1.0,1.0]]; (inverse(m) * m, invert([[a,2.0],[2.0,4.0]]), determinant(m))",
        &[(
            &[1.],
            &[
                1.,
                0.,
                0.,
                0.,
                1.,
                0.,
                0.,
                0.,
                1.,
                f64::INFINITY,
                f64::NEG_INFINITY,
                f64::NEG_INFINITY,
                f64::INFINITY,
                5.,
            ],
        )],
    ),
    (
        "inverse of a quaternion",
        "f(q: quat) -> (quat, quat)",
        "(inverse(q), q * invert(q))",
        &[(&[1., 2., 3., 4.], &[-1. / 30., -2. / 30., -0.1, 4. / 30., 0., 0., 0., 1.])],
    ),
    (
        "transpose",
        "f(m: mat2x3) -> (mat3x2, mat2)",
        "(transpose(m), transpose(m) * m)",
        &[(&[1., 2., 3., 4., 5., 6.], &[1., 4., 2., 5., 3., 6., 14., 32., 32., 77.])],
    ),
    (
        "hyperbolic",
        "f(x: real) -> (vec3, vec3)",
        "([sinh(x), cosh(x), tanh(x)], [asinh(x), acosh(x), log2(exp2(x))])",
        &[(&[1.], &[1.1752012, 1.5430806, 0.7615942, 0.8813736, 0., 1.])],
    ),
    (
        "counter",
        "f(n: int) -> int",
        "let s = 0; for i in 0..n { i = i * 2; s = s + i; } s",
        &[(&[4.], &[12.]), (&[-1.], &[0.])],
    ),
    (
        "nested loops",
        "f(n: int) -> int",
        "let s = 0; for i in 0..n { for j in i..n { if j % 2 == 0 { s = s + j; } } } s",
        &[(&[5.], &[0 as f64 + 2. * 3. + 4. * 5.])],
    ),
    (
        "swap in a loop",
        "f(a: real, b: real, n: int) -> vec2",
        "for i in 0..n { let t = a; a = b; b = t; } [a, b]",
        &[(&[1., 2., 3.], &[2., 1.]), (&[1., 2., 4.], &[1., 2.])],
    ),
    (
        "constant condition",
        "f(x: real) -> real",
        "let r = x; if 1.0 < 2.0 { r = r + 1.0; } else { r = 9.0; } r",
        &[(&[1.], &[2.])],
    ),
    ("constant else", "f(x: real) -> real", "if !(1 == 1) { 3.0 } else { x }", &[(&[1.], &[1.])]),
    (
        "parameters",
        "f(t: (real, bool), m: mat2) -> (bool, real)",
        "(t.1, t.0 + m.y.x)",
        &[(&[1., 1., 2., 3., 4., 5.], &[1., 5.])],
    ),
];

#[test]
fn values() {
    for (row, signature, body, cases) in ROWS.iter().chain(MORE) {
        let graph = graph(&example(signature, body));
        for (input, want) in *cases {
            let got = run(&graph, input);
            assert!(agree(&got, want), "row {row}, at {input:?}: {got:?} instead of {want:?}");
        }
    }
}

/// Which values are the same (LANGUAGE 13.3), by first derivatives of straight code.
const SAME: &[Row] = &[
    ("46", "f(x: real) -> real", "let y = sq(x); diff(y, x)", &[(&[2.], &[4.])]),
    ("47", "f(x: real) -> vec2", "let c = 2.0*3.0; let y = x*x; [diff(c, x), diff(y, x)]", &[(&[3.], &[0., 6.])]),
    ("48", "f(x: real) -> real", "let y = 2.0*x; let z = sin(y); diff(z, y)", &[(&[0.5], &[0.5403023])]),
    ("49", "f(x: real) -> real", "let y = x*x; x = x - 1.0; diff(y, x)", &[(&[3.], &[0.])]),
    ("51", "f(x: real) -> real", "csg c = Square(); diff(eval c.D(x), x)", &[(&[3.], &[6.])]),
    ("53", "f(x: real) -> real", "dprod(x, x)", &[(&[5.], &[10.])]),
    ("54", "f(x: real) -> real", "let c = 3.0; diff(c*c*x, c)", &[(&[2.], &[12.])]),
    (
        "55",
        "f(x: real) -> (real, real)",
        "let y = x * 1.0; (diff(sin(2.0*x), 2.0*x), diff(sin(x), y))",
        &[(&[0.5], &[0.5403023, 0.])],
    ),
    ("57", "f(x: real) -> (real, real)", "let y = x*x; (diff(x*y, x), diff(x*y, y))", &[(&[2.], &[12., 2.])]),
    (
        "43",
        "f(x: real) -> real",
        "let y = if x > 0.0 {x*x} else {x*3.0}; diff(y, x)",
        &[(&[3.], &[6.]), (&[-1.], &[3.])],
    ),
    ("an argument", "f(x: real) -> real", "csg c = Plus(x); diff(eval c.D(2.0) * x, x)", &[(&[3.], &[8.])]),
    ("two constants", "f(x: real) -> real", "let a = 2.0; let b = 2.0; diff(a*b*b, a)", &[(&[0.], &[4.])]),
    ("a copy", "f(x: real) -> real", "let a = 2.0; let b = a; diff(a*b, b)", &[(&[0.], &[4.])]),
    ("components", "f(x: real) -> vec2", "let v = [1.0, 1.0]; diff(v.x*v.x*v.y, v)", &[(&[0.], &[2., 1.])]),
    ("a component", "f(p: vec2) -> real", "let q = [p, p]; diff(p.x*p.y, q.y.x)", &[(&[2., 5.], &[5.])]),
    ("an unnamed constant", "f(x: real) -> vec2", "diff(x*x, [x, 1.0])", &[(&[3.], &[6., 0.])]),
    ("a constant argument", "f(x: real) -> real", "dprod(2.0, 2.0)", &[(&[0.], &[2.])]),
    (
        "inside a branch",
        "f(x: real) -> real",
        "let y = 2.0*x; if x > 0.0 { diff(sin(2.0*x), y) } else { diff(sin(y), y) }",
        &[(&[1.], &[0.]), (&[-1.], &[-0.4161468])],
    ),
    (
        "inside a branch that is picked",
        "f(x: real) -> real",
        "let y = 2.0*x; let d = 0.0; if 1 < 2 { d = diff(sin(2.0*x), y); } d + 1.0",
        &[(&[1.], &[1.])],
    ),
    (
        "an if is a new value",
        "f(x: real) -> real",
        "let y = if 1 < 2 { x } else { 0.0 }; diff(x*x*y, y)",
        &[(&[3.], &[9.])],
    ),
    (
        "what an if writes is new",
        "f(x: real) -> real",
        "let y = x; if 1 < 2 { y = x; } diff(x*x*y, y)",
        &[(&[3.], &[9.])],
    ),
    (
        "a call in place",
        "f(x: real) -> vec2",
        "let y = sq(x); [diff(sin(sq(x)), y), diff(sin(x*x), y)]",
        &[(&[1.], &[0.5403023, 0.5403023])],
    ),
    (
        "iterations of a csg loop",
        "f(x: real) -> real",
        "csg c = Line(); let y = sin(x); let d = 0.0; for i in 0..2 { c = Inc(){ c }; d = d + diff(sin(x), y); } d + eval c.D(0.0)",
        &[(&[1.], &[2.])],
    ),
];

#[test]
fn identity() {
    for (row, signature, body, cases) in SAME {
        let graph = graph(&example(signature, body));
        for (input, want) in *cases {
            let got = derivatives(&graph, input);
            assert!(agree(&got, want), "row {row}, at {input:?}: {got:?} instead of {want:?}");
        }
    }
}

#[test]
fn names_of_columns() {
    let graph = graph("export fn f(t: (vec2, int), q: quat) -> (mat2, bool) { ([t.0, [q.w, 0.0]], t.1 > 0) }");
    let inputs: Vec<&str> = graph.inputs.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(inputs, ["t.0.x", "t.0.y", "t.1", "q.x", "q.y", "q.z", "q.w"]);
    let outputs: Vec<&str> = graph.outputs.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(outputs, ["value.0.x.x", "value.0.x.y", "value.0.y.x", "value.0.y.y", "value.1"]);
}

/// The order of LANGUAGE 5.1 and 5.2, visible through overflow and cancellation: another order gives other bits.
#[test]
fn determinants_expand_along_row_0() {
    let body = "determinant([[a, 1.0, 0.0], [b, 0.0, 1.0], [c, 1.0, 1.0]])";
    let graph = graph(&example("f(a: real, b: real, c: real) -> real", body));
    // a·(0·1 − 1·1) − b·(1·1 − 1·0) + c·(1·1 − 0·0)
    for (a, b, c) in [(0.1, 0.2, 0.3), (1e16, 1.0, 1e16), (1.0, 1e-17, 1.0), (0.7, 0.1, 0.8)] {
        assert_eq!(run(&graph, &[a, b, c]), [(-a - b) + c]);
    }
}

/// An interval has a flag for each component on the machine and none in the interface (LANGUAGE 9.2).
#[test]
fn intervals_at_the_interface() {
    let signature =
        "f(n: int, i: interval<vec2>, t: (bool, interval<int>)) -> ((interval<int>, bool), interval<vec2>, real)";
    let body = "let k = if t.0 { t.1 } else { [n .. 7] }; ((k, i.may_be_nan), [i.y, i.x], i.1.x + t.1.end::<real>)";
    let graph = graph(&example(signature, body));
    let inputs: Vec<&str> = graph.inputs.iter().map(|i| i.name.as_str()).collect();
    let of_i = ["i.start.x", "i.start.y", "i.end.x", "i.end.y"];
    assert_eq!(inputs, [&["n"], &of_i[..], &["t.0", "t.1.start", "t.1.end"]].concat());
    let outputs: Vec<&str> = graph.outputs.iter().map(|o| o.name.as_str()).collect();
    let of_tuple = ["value.0.0.start", "value.0.0.end", "value.0.1"];
    let of_interval = ["value.1.start.x", "value.1.start.y", "value.1.end.x", "value.1.end.y"];
    assert_eq!(outputs, [&of_tuple[..], &of_interval, &["value.2"]].concat());
    assert_eq!(run(&graph, &[5., 1., 2., 3., 4., 1., 8., 6.]), [8., 6., 0., 2., 1., 4., 3., 9.]);
    assert_eq!(run(&graph, &[5., 1., 2., 3., 4., 0., 8., 6.]), [5., 7., 0., 2., 1., 4., 3., 9.]);
}

/// `[lo .. hi]` makes no new values of its ends (LANGUAGE 13.3.1), and keeps them as given (LANGUAGE 15.2).
#[test]
fn ends_are_the_values_given() {
    let ends = "let i = [y .. x]; [diff(x * y, i.start), diff(x * y, i.1), i.start, diff(i.end * x, i.end)]";
    let graph = graph(&example("f(x: real, y: real) -> vec4", ends));
    assert_eq!(derivatives(&graph, &[2., 3.]), [2., 3., 3., 4.]);
}

/// What is not live, or stands in a branch that is never taken, costs nothing.
#[test]
fn intervals_that_nobody_reads() {
    let unused = "fn g(i: interval<real>) -> real { (i * i).end } export fn f(x: real) -> real { if 1 < 2 { x } else { g([x .. x]) } }";
    assert_eq!(graph(unused).operations(), 1, "the comparison");
    let ends = graph(&example("f(x: real) -> real", "let n = ([1 .. 2].end + 1)::<real>; [x .. n].end * x"));
    assert_eq!(run(&ends, &[2.]), [6.]);
}

/// Ends of ints are constant where they are constant, and may bound csg loops (LANGUAGE 11.7).
#[test]
fn constant_ends() {
    let body = "let i = [1 .. 3]; csg c = Line(); for k in i.start .. i.end { c = Inc(){ c }; } eval c.D(x)";
    assert_eq!(run(&graph(&example("f(x: real) -> real", body)), &[2.]), [4.]);
}

#[test]
fn errors() {
    let one = "f(x: real) -> real";
    assert_eq!(codes(&example(one, "csg e = Line(); eval e.Tone(x)")), [Code::E0605]);
    assert_eq!(codes(&example(one, "csg e = Add(){ Line() }; eval e.D(x)")), [Code::E0606]);
    let body = "csg c = Line(); for i in 0..x::<int> { c = Inc(){ c }; } eval c.D(x)";
    assert_eq!(codes(&example(one, body)), [Code::E0608]);
    let cycle = "operation P(); operation Q();
        impl P<s> for D(x) { csg t = Q(){ s }; eval t.D(x) }
        impl Q<s> for D(x) { csg t = P(){ s }; eval t.D(x) }";
    assert_eq!(codes(&format!("{cycle}{}", example(one, "csg e = P(){ Line() }; eval e.D(x)"))), [Code::E0607]);
}
