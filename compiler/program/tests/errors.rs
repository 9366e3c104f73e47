//! Diagnostics of single mistakes, source by source: which codes, and a phrase that each message must contain.

mod common;

use common::{PRELUDE, check_text, codes, said};

/// (items or body, codes, phrases that must be said). A source with `{` at the start is a body of
/// `f(x: real, v: vec3, n: int) -> real`, another one stands for items in front of `f`.
const CASES: &[(&str, &str, &[&str])] = &[
    // Names.
    ("{ radius }", "E0301", &["variable `radius`"]),
    ("{ let radius = x; radus }", "E0301", &["did you mean `radius`"]),
    ("{ lenght(v) }", "E0301", &["function, entity or operation `lenght`", "`length`"]),
    ("{ csg e = line(); x }", "E0301", &["`Line`"]),
    ("{ z + z + z }", "E0301", &[]),
    ("{ z = 1.0; x }", "E0301", &["to assign to"]),
    ("{ eval tree.D(x) }", "E0301", &["`tree` to evaluate"]),
    ("{ csg e = Line(); eval e.Tome(x) }", "E0301", &["concept `Tome`", "`Tone`"]),
    ("{ csg e = Line(); eval e.Line(x) }", "E0301", &["`Line` is an entity"]),
    ("impl Nothing for D(x) { x + k }", "E0301", &["entity or operation `Nothing`"]),
    ("impl Line for Nothing(p) { p + 1.0 }", "E0301", &["concept `Nothing`"]),
    ("{ sq }", "E0303", &["`sq` is a function", "`sq(…)`"]),
    ("{ let y = 1.0; y(x) }", "E0303", &["variable of type `real`"]),
    ("{ Line }", "E0303", &["an entity"]),
    ("entity Line(); ", "E0302", &["declared twice", "first declared"]),
    ("fn Line(x: real) -> real { x }", "E0302", &[]),
    ("fn D(x: real) -> real { x }", "E0302", &[]),
    ("concept Line: real -> real;", "", &[]),
    ("fn g(a: real, a: real) -> real { a }", "E0302", &["in this scope"]),
    ("entity E(a: real, a: real);", "E0302", &[]),
    ("{ for i in 0..n { let i = 1; } x }", "E0302", &[]),
    ("{ let y = x; let y = x; y }", "E0302", &[]),
    ("impl Shift for Tone(k) { k }", "E0302", &[]),
    ("fn sin(x: real) -> real { x }", "W0302", &[]),
    // Operators.
    ("{ x + 1 }", "E0401", &["write `1.0`", "`real` and `int`"]),
    ("{ n + x }", "E0401", &["`n::<real>`"]),
    ("{ -1 * x }", "E0401", &["write `-1.0`"]),
    ("{ (n + n) * x }", "E0401", &["`(n + n)::<real>`"]),
    ("{ (v + x).x }", "E0401", &["`[x; 3]`"]),
    ("{ let b = 0.0 < x < 1.0; x }", "E0401", &["`0.0 < x && x < 1.0`"]),
    ("{ let b = v < v; x }", "E0401", &["compare components"]),
    ("{ let b = !x; x }", "E0401", &["`x > 0.0`"]),
    ("{ let b = -(x > 0.0); x }", "E0401", &["`!(x > 0.0)`"]),
    ("{ let b = true == false; x }", "E0401", &[]),
    ("{ let q = quat(v, x); (q * v).x }", "E0401", &["`rotate(q, v)`"]),
    ("{ let m = [v, v]; (m * v).x }", "E0404", &["2 columns", "3 components", "mat2x3"]),
    ("{ let m = [v, v]; (m * m).x.x }", "E0404", &[]),
    ("{ let a = n / 0; a::<real> }", "W0403", &["always 0"]),
    // Arguments.
    ("{ sq(x, x) }", "E0402", &["takes 1 argument, not 2", "fn sq(a: real) -> real"]),
    ("{ sq(1) }", "E0403", &["`a` of `sq`", "write `1.0`"]),
    ("{ sq(v) }", "E0403", &["`real`", "`vec3`", "v.x"]),
    ("{ max(x) }", "E0402", &["the signature is"]),
    ("{ length(x) }", "E0403", &["argument 1 of `length`"]),
    ("{ max(v, 0.0).x }", "E0403", &["`[0.0; 3]`"]),
    ("{ max(0.0, v).x }", "E0403", &["argument 1", "`[0.0; 3]`"]),
    ("{ max(1, x) }", "E0403", &["write `1.0`"]),
    ("{ sqrt(n) }", "E0403", &["`n::<real>`"]),
    ("{ pow(x, 2) }", "E0403", &["write `2.0`"]),
    ("{ atan2(v, x) }", "E0403", &[]),
    ("{ quat(v, v).x }", "E0403", &["argument 2"]),
    ("{ quat(x, x).x }", "E0403", &[]),
    ("{ quat(x).x }", "E0402", &[]),
    ("{ csg e = Shift(1); eval e.D(x) }", "E0403", &["entity Shift(k: real)"]),
    ("{ csg e = Shift(); eval e.D(x) }", "E0402", &[]),
    ("{ csg e = Line(); eval e.D(v) }", "E0403", &["concept D: real -> real"]),
    ("{ csg e = Line(); eval e.D(x, x) }", "E0402", &[]),
    ("{ csg e = twice(x); eval e.D(x) }", "E0403", &["`c` of `twice` is `csg`"]),
    ("{ diff(x) }", "E0402", &[]),
    // Lists, access, casts.
    ("{ [1, 2, 3].x::<real> }", "E0405", &["`[1.0, 2.0, 3.0]`"]),
    ("{ [x, v].x }", "E0405", &["`real` and `vec3`"]),
    ("{ [x, n].x }", "E0405", &["`[x, n::<real>]`"]),
    ("{ [x].x }", "E0406", &["without brackets"]),
    ("{ [x, x, x, x, x].x }", "E0406", &["this one has 5"]),
    ("{ [x; 7].x }", "E0406", &[]),
    ("{ [1; 3].x }", "E0405", &["write `1.0`"]),
    ("{ v.q }", "E0407", &["`vec3` has no `.q`", "`.x`, `.y`, `.z`"]),
    ("{ v.w }", "E0407", &[]),
    ("{ v.xy.x }", "E0407", &["`[v.x, v.y]`"]),
    ("{ (x, n).2 }", "E0407", &["`.0` to `.1`"]),
    ("{ x.x }", "E0407", &["no components"]),
    ("{ v.1 + v.start + (x, n).0 }", "", &[]),
    ("{ quat(v, x).start }", "E0407", &[]),
    ("{ let b = x::<bool>; x }", "E0408", &["`x > 0.0`"]),
    ("{ v::<real> }", "E0408", &[]),
    ("{ x::<real> }", "W0401", &[]),
    ("{ n::<bool>::<real> + (x > 0.0)::<int>::<real> }", "", &[]),
    // Types.
    ("fn g(a: float) -> real { a }", "E0410", &["did you mean `real`"]),
    ("fn g(a: vec5) -> real { 1.0 }", "E0410", &["vec2 to vec4"]),
    ("fn g(a: complex) -> real { 1.0 }", "E0410", &[]),
    ("fn g(a: vec3<bool>) -> real { 1.0 }", "E0410", &["reals or ints"]),
    ("fn g(a: mat3<int>) -> real { 1.0 }", "E0410", &["reals only"]),
    ("fn g(a: interval<quat>) -> real { 1.0 }", "E0410", &["ends of type `quat`", "intervals of real"]),
    ("fn g(a: interval<vec2<int>>, b: interval<interval<real>>) -> real { 1.0 }", "E0410 E0410", &[]),
    ("fn g(a: interval<csg>) -> real { 1.0 }", "E0603", &["an interval"]),
    ("fn g(a: interval<int>, b: interval<mat2x3>) -> (interval<s>, bool) { (b.x.y, a.may_be_nan) }", "", &[]),
    ("fn g(a: tensor<2, 2, 2>) -> real { 1.0 }", "E0410", &[]),
    ("fn g(a: mat2x3, b: mat3x3<real>, c: s, d: i) -> real { 1.0 }", "", &[]),
    ("fn g(a: (real, csg)) -> real { 1.0 }", "E0603", &[]),
    ("{ determinant([v, v, v]) + determinant(transpose([[x, x], [x, x]])) }", "", &[]),
    ("{ determinant([v, v]) }", "E0403", &["`mat2x3`", "determinant(matN)"]),
    ("{ inverse([v, v]).x.x }", "E0403", &["`mat2x3`"]),
    ("{ inverse(x) }", "E0403", &["inverse(matN)"]),
    ("{ inverse([v, v, v], x).x.x }", "E0402", &[]),
    ("{ transpose(v).x }", "E0403", &["`vec3`"]),
    ("{ (transpose([v, v]) * [x, x]).x }", "E0404", &["`mat3x2`"]),
    ("{ (transpose([v, v]) * [v, v]).x.x + (inverse(quat(v, x)) * invert(quat(v, x))).w }", "", &[]),
    ("{ log2(x) + exp2(x) + sinh(x) + cosh(x) + tanh(x) + asinh(x) + acosh(x) + atanh(v).x }", "", &[]),
    ("fn determinant(m: mat3) -> real { 1.0 } fn g(m: mat3) -> real { determinant(m) }", "", &[]),
    // The look-up order.
    ("entity sin(); impl sin for D(x) { x } fn g(x: real) -> real { csg e = sin(); eval e.D(x) }", "", &[]),
    ("entity log2(); fn g(x: real) -> real { log2(x) }", "E0402 E0409", &[]),
    ("fn quat(x: int) -> int { x } fn g(x: int) -> int { quat(x) + log2(1.0, x) } fn log2(a: real, b: int) -> int { b }", "", &[]),
    ("fn bound(x: real) -> real { x }", "W0302", &["built-in"]),
    ("fn diff(x: real) -> real { x }", "W0302", &[]),
    ("fn inverse(x: real) -> real { x } fn g(x: real) -> real { inverse(x) }", "W0302 E0403", &[]),
    // Vectors of int.
    ("fn g(a: vec3<int>, b: vec3<int>) -> vec3<int> { -a + b * a / b % max(a, min(b, a)) - clamp(a, b, mod(a, b)) }", "", &[]),
    ("fn g(a: vec3<int>) -> (int, vec3, vec3<int>) { (a.x + a.2, a::<vec3>, abs(a::<vec3<real>>::<vec3<int>>)) }", "", &[]),
    ("fn g(a: vec3<int>, v: vec3) -> vec3 { a * v }", "E0401", &["`vec3<int>` and `vec3`", "`a::<vec3>`"]),
    ("fn g(a: vec3<int>, v: vec3) -> vec3 { v + a }", "E0401", &["`a::<vec3>`"]),
    ("fn g(a: vec3<int>, n: int) -> vec3<int> { a * n }", "E0401", &["`vec3<int>` and `int`"]),
    ("fn g(a: vec3<int>, b: vec2<int>) -> vec3<int> { a + b }", "E0401", &[]),
    ("fn g(a: vec2<int>) -> bool { a == a }", "E0401", &[]),
    ("fn g(a: vec2<int>) -> int { a.z }", "E0407", &["`vec2<int>` has the components `.x`, `.y`"]),
    ("fn g(a: vec2<int>) -> real { length(a) }", "E0403", &["`a::<vec2>`"]),
    ("fn g(a: vec2<int>) -> vec2 { sqrt(a) }", "E0403", &["`a::<vec2>`"]),
    ("fn g(a: vec2<int>) -> vec2 { max(a, [0.0, 0.0]) }", "E0403", &["argument 1", "`a::<vec2>`"]),
    ("fn g(a: vec2<int>) -> vec3<int> { a::<vec3<int>> }", "E0408", &["`vec2<int>`", "`vec3<int>`"]),
    ("fn g(a: vec2<int>) -> vec2<int> { a::<vec2<int>> }", "W0401", &[]),
    ("fn g(a: vec2<int>) -> mat2 { [a, a] }", "E0405", &["`vec2<int>`"]),
    ("fn g(a: vec2<int>, x: real) -> real { diff(a, x).x + diff(x, a).x }", "E0701 E0702", &["cast at the end"]),
    ("fn g(a: vec2) -> vec2<int> { a }", "E0409", &["`a::<vec2<int>>`"]),
    // Int division by constants.
    ("{ let a = n / (2 - 2) + n % (3 * 0) + n / (7 % 7); x }", "W0403 W0403 W0403", &["always 0"]),
    ("{ let a = n / (-1 % 4 - 2) + n / (5 / 0 + 1); x }", "W0403", &["`/` by 0"]),
    ("{ let a = [n..n] / 0; x }", "W0403", &[]),
    // Intervals.
    ("{ let i = [x .. 1.0] * 2.0 + x - [0.0..1.0] / x; i.start + (-i).end + i.0 + i.1 }", "", &[]),
    ("{ let i = [v .. v]; let b = (i + v) * 2.0 * i; b.x.start + b.start.x + b.1.z + b.w.end }", "E0407", &[
        "`interval<vec3>` has `.start` (`.0`), `.end` (`.1`) and `.may_be_nan`", "components `.x`, `.y`, `.z`",
    ]),
    ("{ let i = [x .. x]; i.x.start }", "E0407", &["`interval<real>` has no `.x`"]),
    ("{ let i = [x .. x]; i.2 }", "E0407", &[]),
    ("{ let i = [[v, v] .. [v, v]]; (i.x.z.start + i.start.y.z + (i * [[x, x] .. [x, x]]).x.end + i.1.0.0) }", "", &[]),
    ("{ let i = [x .. 1.0]; let v2 = [i, i * i]; let v3 = [i; 3]; v2.y.end + v3.end.z + length(v3 % v3).start }", "", &[]),
    ("{ let i = [n .. 2]; let j = max(abs(i), mod(i, i)) * i / 2 - 1; (j.start + j.end)::<real> }", "", &[]),
    ("{ let i = [x .. 1]; x }", "E0411", &["`real` and `int`", "write `1.0`"]),
    ("{ let i = [0 .. x]; x }", "E0411", &["write `0.0`"]),
    ("{ let i = [x .. v]; x }", "E0411", &["`real` and `vec3`", "`[x; 3]`"]),
    ("{ let i = [true .. false]; x }", "E0411", &["ends of type `bool`"]),
    ("{ let k = v::<vec3<int>>; let i = [k .. k]; x }", "E0411", &["`vec3<int>`", "`k::<vec3>`"]),
    ("{ let i = [[x .. x] .. [x .. x]]; x }", "E0411", &["`interval<real>`"]),
    ("{ csg e = Line(); let i = [e .. e]; x }", "E0603", &["an interval"]),
    ("{ let i = [v .. v]; let m = [i, i]; x }", "E0405", &["`[[i.start, i.start] .. [i.end, i.end]]`"]),
    ("{ let m = [[v .. 2.0 * v], [v .. v]]; x }", "E0405", &["`[[v, v] .. [2.0 * v, v]]`"]),
    ("{ let i = [v .. v]; let m = [i; 2]; x }", "E0405", &["`[[i.start; 2] .. [i.end; 2]]`"]),
    ("{ let m = [[x .. x], x]; x }", "E0405", &["`interval<real>` and `real`", "`[x .. x]`"]),
    ("{ let m = [x, [x .. 1.0]]; x }", "E0405", &["`[x .. x]`"]),
    ("{ let m = [[n .. n], [n .. n]]; x }", "E0405", &["`interval<int>`"]),
    ("{ let b = [x .. x] < [x .. 1.0]; x }", "E0804", &["`[x .. x].start`", "no order"]),
    ("{ let i = [x .. x]; let b = i == x; x }", "E0804", &["`i.start` or `i.end`"]),
    ("{ let i = [x .. x]; let b = x > i; x }", "E0804", &["`i.start` or `i.end`"]),
    ("{ let i = [x .. x]; let b = i && true; x }", "E0401", &["`interval<real>` and `bool`"]),
    ("{ let b = !([x .. x]); x }", "E0401", &[]),
    ("{ let i = [x .. x] + 1; x }", "E0401", &["write `1.0`"]),
    ("{ let i = [x .. x] * v; x }", "E0401", &["`interval<real>` and `vec3`", "`[v .. v]`"]),
    ("{ let m = [v, v, v]; let i = m * [v .. v]; x }", "E0401", &["`[m .. m]`"]),
    ("{ let m = [v, v]; let i = [m .. m] * [v .. v]; x }", "E0404", &["2 columns"]),
    ("{ let i = [v .. v] + [x .. x]; x }", "E0401", &[]),
    ("{ let i = min([x .. x], x); x }", "E0403", &["`[x .. x]`", "intervals with such ends"]),
    ("{ let i = sqrt([n .. n]); x }", "E0403", &["`interval<real>` is needed"]),
    ("{ let i = length([x .. x]); x }", "E0403", &[]),
    ("{ let i = quat([x .. x], [x .. x], [x .. x], [x .. x]); x }", "E0804", &["no enclosure", "bound("]),
    ("{ let i = rotate(quat(v, x), [v .. v]); x }", "E0804", &["`rotate`"]),
    ("{ let i = dot([v .. v], [v .. v]) + determinant([[v,v,v] .. [v,v,v]]) + atan2([x..x], [x..x]); i.start }", "", &[]),
    ("{ let i = [x .. x]::<interval<int>>; x }", "E0408", &["`interval<int>`"]),
    ("{ let i = [x .. x]; i }", "E0409", &["`i.start` or `i.end`"]),
    ("{ sq([x .. x]) }", "E0403", &["`[x .. x].start`"]),
    ("fn g(i: interval<real>) -> real { i.end } fn h(x: real) -> real { g(x) }", "E0403", &["`[x .. x]`"]),
    ("{ let i = [1.0 .. 0.0]; i.start }", "W0801", &["`[0.0 .. 1.0]`"]),
    ("{ let i = [[0.0; 3] .. [1.0, -1.0, 2.0]]; i.start.x }", "W0801", &[]),
    ("{ let i = [2 .. 1 - 4]; let j = [-1.0 .. 2.0 * 3.0]; let k = [INF .. x]; x }", "W0801", &[]),
    ("{ let i = [x .. x]; if x > 0.0 { i = i + x; } for k in 0..n { i = i * i; } i.start }", "", &[]),
    ("{ let i = [x .. x]; if x > 0.0 { i = x; } i.start }", "E0412", &["`interval<real>`"]),
    ("{ let i = if x > 0.0 { [x .. x] } else { x }; x }", "E0502", &["`interval<real>`, `real`"]),
    ("{ if [x .. x] { 1.0 } else { 2.0 } }", "E0501", &[]),
    ("{ for k in 0..[n .. n] { } x }", "E0504", &["`interval<int>`"]),
    ("concept R: interval<vec2> -> (interval<real>, bool); impl Line for R(i) { (i.x, i.may_be_nan) }
      fn g(x: real) -> real { csg e = Line(); (eval e.R([[x, x] .. [x, x]])).0.start }", "", &[]),
    ("entity Slab(i: interval<real>); impl Slab for D(x) { max(x - i.end, i.start - x) }
      fn g(x: real) -> real { csg e = Slab([0.0 .. x]); eval e.D(x) }", "", &[]),
    ("{ diff([x .. x], x) }", "E0701", &["`interval<real>`", "take an end first"]),
    ("{ diff(x, [x .. x]) }", "E0702", &["`interval<real>`"]),
    ("{ diff(bound(x*x, x, [x .. 2.0]).end, x) }", "", &[]),
    ("{ let i = bound([v, v], v, [v .. v]); let j = bound(v * x, x, [x .. x]); i.x.y.end + j.y.start }", "", &[]),
    ("{ bound(x, x).start }", "E0402", &["3 arguments"]),
    ("{ let i = bound(n, x, [x .. x]); x }", "E0801", &["`int`", "`n::<real>`"]),
    ("{ let i = bound((x, x), x, [x .. x]); x }", "E0801", &["`(x, x).0`"]),
    ("{ let i = bound(quat(v, x), x, [x .. x]); x }", "E0801", &["`quat`"]),
    ("{ let i = bound([x .. x], x, [x .. x]); x }", "E0801", &["`interval<real>`"]),
    ("{ let i = bound(x, v, [x .. x]); x }", "E0802", &["`vec3`", "`interval<real>`"]),
    ("{ let i = bound(x, n, [n .. n]); x }", "E0802", &["`int`", "`interval<int>`"]),
    ("{ let i = bound(x, x, x); x }", "E0803", &["`real`", "`[lower .. upper]`"]),
    ("{ let i = bound(n, n, x); x }", "E0801 E0802 E0803", &[]),
    ("{ csg e = Line(); let i = bound(e, x, [x .. x]); x }", "E0603", &[]),
    ("{ let i = bound(y, x, [x .. x]); i.start + 1 }", "E0301", &[]),
    // Defaults and ranges.
    ("export fn g(a: real = 1.0 in [0.1 .. 2.0 * PI], b: vec3 in [-2.0 .. 2.0], c: vec2 = [1.0; 2] in [[0.0; 2] .. sqrt([4.0, 9.0])],
      d: int = 4 in [1 .. 16], e: bool = !true, q: quat = quat(0.0, 0.0, 0.0, 1.0), m: mat2 in [[[0.0; 2]; 2] .. INF],
      k: vec2<int> in [0 .. 9], t: (int, bool) = (1, false), i: interval<real>=[0.0..1.0]) -> real { a }", "", &[]),
    ("export g(a: real = min(1.0, 2.0) in [0.0 .. 1.0]) { a }", "", &[]),
    ("export fn g(a: real = 1) -> real { a }", "E0902", &["the default of `a` must be `real`, but this is `int`", "`1.0`"]),
    ("export fn g(a: vec3 = 1.0) -> real { 1.0 }", "E0902", &["`vec3`", "`[1.0; 3]`"]),
    ("export fn g(a: vec3 in [0 .. 1.0]) -> real { 1.0 }", "E0902", &["`vec3` or `real`", "lower end", "`0.0`"]),
    ("export fn g(a: int in [0 .. 1.5]) -> real { 1.0 }", "E0902", &["upper end of the range of `a`"]),
    ("export fn g(a: real, b: real = a) -> real { a }", "E0902", &["the name `a`"]),
    ("export fn g(a: real = sq(2.0)) -> real { a }", "E0902", &["a call of a function"]),
    ("export fn g(a: real = sign(2.0)) -> real { a }", "E0902", &["a call of a function"]),
    ("export fn g(a: real = if true { 1.0 } else { 2.0 }) -> real { a }", "E0902", &["an `if`"]),
    ("export fn g(a: real = noise(1.0)) -> real { a }", "E0301", &["`noise`"]),
    ("export fn g(a: real = 1.0 + true) -> real { a }", "E0401", &[]),
    ("export fn g(a: bool in [false .. true]) -> real { 1.0 }", "E0904", &["`a` is `bool`"]),
    ("export fn g(a: quat in [0.0 .. 1.0], b: (real, real) in [0.0 .. 1.0]) -> real { 1.0 }", "E0904 E0904", &["`quat`"]),
    ("export fn g(a: interval<real> in [0.0 .. 1.0]) -> real { 1.0 }", "E0904", &["`interval<real>`"]),
    ("fn g(a: real = 1.0) -> real { a }", "E0904", &["a parameter of the function `g`", "parameters of exports"]),
    ("entity Ring(a: real in [0.0 .. 1.0]);", "E0904", &["a range", "the entity `Ring`"]),
    ("operation Ring(a: real = 1.0 in [0.0 .. 1.0]);", "E0904", &["the operation `Ring`"]),
    ("define g(a: real = 1.0) { Line() }", "E0904", &[]),
    ("export fn g(a: csg = 1.0) -> real { 1.0 }", "E0901", &[]),
    // Bodies and control flow.
    ("fn g(a: real) -> int { a }", "E0409", &["`int`", "`a::<int>`"]),
    ("fn g(a: real) -> real { let b = a; }", "E0505", &["`g` needs a value"]),
    ("impl Line for V(p) { p }", "E0409", &["`vec2`"]),
    ("{ if x { 1.0 } else { 2.0 } }", "E0501", &["`x > 0.0`"]),
    ("{ let y = if x > 0.0 { 1.0 }; y }", "E0503", &["no `else`"]),
    ("{ let y = if x > 0.0 { 1.0 } else { let z = 2.0; }; y }", "E0503", &["this branch has no value"]),
    ("{ if x > 0.0 { 1.0 } else { 1 } }", "E0502", &["`real`, `int`", "write `1.0`"]),
    ("{ if x > 0.0 { 1.0 } else { x2 } }", "E0301", &[]),
    ("{ for i in 0.0..n { } x }", "E0504", &["lower bound", "::<int>"]),
    ("{ for i in 0..n::<real> { } x }", "E0504", &["upper bound"]),
    ("{ x + 1.0; x }", "W0501", &[]),
    ("{ ; x }", "W0501", &["empty"]),
    ("{ if x > 0.0 { 1.0 } x }", "W0501", &[]),
    ("fn g(a: real) -> real { g(a) }", "E0506", &["`g` → `g`"]),
    (
        "fn a(x: real) -> real { b(x) } fn b(x: real) -> real { c(x) + a(x) } fn c(x: real) -> real { a(x) }",
        "E0506 E0506 E0506",
        &["`a` → `b` → `a`", "`c` → `a` → `b` → `c`"],
    ),
    ("{ let r = for a = x in 0..n { a = a + x; v = v; }; r }", "E0507", &["statement"]),
    ("{ let r = for a = x in 0..n { a + 1.0 }; r }", "E0507 W0501", &["ends with a value"]),
    ("{ let r = for x = x in 0..n { let t = x; x = t + 1.0; }; r }", "", &[]),
    // Assignment.
    ("{ let a = 1; a = x; a }", "W0402", &["from `int` to `real`"]),
    ("{ let a = 1; if x > 0.0 { a = x; } x }", "E0412", &["`a` is `int` outside", "::<int>"]),
    ("{ let a = 1; for i in 0..n { a = x; } x }", "E0412", &[]),
    ("{ for i in 0..n { let a = 1; a = x; } x }", "W0402", &[]),
    ("{ let a = 1; let y = if x > 0.0 { a = x; a } else { x }; y }", "E0412", &[]),
    ("{ let a = 1; csg e = Inc(){ a = x; Shift(a) }; eval e.D(a::<real>) }", "W0402", &[]),
    ("{ let a = 1.0; let y = if x > 0.0 { a = 2.0; x } else { x }; y + a }", "W0502", &["`a` is lost"]),
    ("{ let a = 1.0; csg e = Inc(){ a = 2.0; Line() }; eval e.D(a) }", "W0502", &[]),
    ("{ let a = 1.0; let y = if x > 0.0 { if x > 1.0 { a = 2.0; } a } else { x }; y + a }", "", &[]),
    ("{ let a = 1.0; let y = if x > 0.0 { for i in 0..n { a = a + x; } a } else { x }; y + a }", "", &[]),
    // csg.
    ("{ csg e = x + 1.0; eval e.D(x) }", "E0601", &["write `let e = …;`"]),
    ("{ csg e = sq(x); eval e.D(x) }", "E0601", &["`sq` returns `real`"]),
    ("{ csg e = Line(); e = x; eval e.D(x) }", "E0601", &[]),
    ("{ let y = x; y = Line(); y }", "E0602", &[]),
    ("{ let e = twice(Line()); x }", "E0602", &["write `csg e = …;`", "`twice` returns `csg`"]),
    ("{ csg c = Line(); let e = if x > 0.0 { c } else { c }; x }", "E0602", &["`c` is defined here"]),
    ("{ let e = if x > 0.0 { 1.0 } else { Line() }; x }", "E0602", &[]),
    ("{ csg e = Line(); [e, e].x }", "E0603", &["a list"]),
    ("{ csg e = Line(); (e, x).1 }", "E0603", &["a tuple"]),
    ("{ csg e = Line(); e + x }", "E0603", &["an operand of `+`", "`eval e.Concept(…)`"]),
    ("{ csg e = Line(); sin(e) }", "E0603", &["built-in"]),
    ("{ csg e = Line(); diff(e, x) }", "E0603", &[]),
    ("{ csg e = Shift(Line()); eval e.D(x) }", "E0603", &[]),
    ("{ csg e = Line(); eval e.D(e) }", "E0603", &[]),
    ("entity E(a: csg);", "E0603", &[]),
    ("concept C: csg -> real;", "E0603", &[]),
    ("{ csg e = Line(){ Five() }; eval e.D(x) }", "E0604", &["an entity"]),
    ("{ sq(x){ Five() } }", "E0604", &["a function"]),
    ("{ csg e = Inc(){ x }; eval e.D(x) }", "E0409", &["must be csg"]),
    ("{ csg e = Inc(){ let y = x; }; eval e.D(x) }", "E0505", &[]),
    ("{ eval x.D(x) }", "E0609", &["`x` is `real`"]),
    ("impl Line for D(y) { y }", "E0610", &["two impls", "first impl"]),
    ("impl Line<a> for Tone(y) { y }", "E0611", &["no operands"]),
    ("impl Line for Tone(y, z) { y + z }", "E0611", &["1 argument of type `real`"]),
    ("concept P: (real, vec2) -> real; impl Line for P(a, b) { a + b.x } impl Five for P(t) { t.0 }", "", &[]),
    ("concept P: (real, vec2) -> real; impl Line for P(a, b, c) { a }", "E0611", &["or 2 arguments"]),
    ("concept P: -> real; impl Line for P { 1.0 } impl Five for P() { 1.0 }", "", &[]),
    ("concept P: -> real; impl Line for P(a) { a }", "E0611", &["no source"]),
    (
        "operation Op(); fn mk(c: csg) -> csg { deep(c) } fn deep(c: csg) -> csg { Op(){ c } }
         impl Op<s> for D(x) { csg t = mk(s); eval t.D(x) }",
        "E0607",
        &["the impl of `Op` for `D` → calls `mk` → calls `deep` → builds `Op`"],
    ),
    ("{ csg e = Line(); let y = eval e.D(x); x }", "W0601", &[]),
    ("{ csg e = Line(); let y = eval e.Tone(x); let z = y + 1.0; x }", "W0601", &[]),
    ("{ csg e = Line(); let y = 1.0; y = eval e.D(x); y = x; y }", "W0601", &[]),
    ("{ csg e = Line(); let y = x; for i in 0..n { y = y + eval e.D(y); } y }", "", &[]),
    ("{ csg e = Line(); let y = x; for i in 0..n { y = eval e.D(x); } x }", "W0601", &[]),
    ("{ csg e = Line(); if eval e.D(x) > 0.0 { x = 1.0; } x }", "", &[]),
    ("{ csg e = Line(); if eval e.D(x) > 0.0 { let y = 1.0; } x }", "W0601", &[]),
    ("{ csg e = Line(); e.D(x) }", "W0603", &["`eval e.D(…)`"]),
    ("{ csg e = Line(); csg f = e(); eval f.D(x) }", "W0603", &["write `e`"]),
    // Derivatives.
    ("{ let b = diff(x > 0.0, x); x }", "E0701", &["`bool`"]),
    ("{ diff([v, v, v], x).x }", "E0701", &["`mat3`"]),
    ("{ diff(x, n) }", "E0702", &["`int`"]),
    ("{ diff(n, n) }", "E0701 E0702", &[]),
    // Exports, attributes.
    ("export fn g(c: csg) -> real { 1.0 }", "E0901", &["parameter `c`"]),
    ("export fn g(x: real) -> csg { Line() }", "E0901", &["result"]),
    ("export g(x: real) { Line() }", "E0901", &[]),
    ("#[inline()] fn g(x: real) -> real { x }", "W0901", &["`inline`"]),
    ("#[no_inline()] fn g(x: real) -> real { x }", "", &[]),
    ("#[define(no_identity)] operation Op();", "", &[]),
    ("#[define(identity)] operation Op();", "W0901", &[]),
    ("export g(x: real) { h(x) } export h(x: real) { (x, 1) } fn k(x: real) -> real { g(x).0 }", "", &[]),
];

fn source(case: &str) -> String {
    match case.strip_prefix('{') {
        Some(body) => format!("{PRELUDE}\nexport fn f(x: real, v: vec3, n: int) -> real {{{body}"),
        None => format!("{PRELUDE}\n{case}\nexport fn f(x: real) -> real {{ x }}"),
    }
}

#[test]
fn each_mistake_has_its_codes_and_says_what_it_must() {
    let mut wrong = Vec::new();
    for (case, expected, phrases) in CASES {
        let (loaded, checked) = check_text(&source(case));
        let found = codes(&loaded, &checked);
        let all: Vec<String> = loaded.diagnostics.iter().chain(&checked.diagnostics).map(said).collect();
        let silent: Vec<&&str> = phrases.iter().filter(|p| !all.iter().any(|s| s.contains(**p))).collect();
        if found != *expected || !silent.is_empty() {
            wrong.push(format!(
                "{case}\n  expected [{expected}] found [{found}], not said: {silent:?}\n  {}",
                all.join("\n  ")
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn one_error_causes_no_others() {
    let text = "
        fn broken(x: real) -> real { nowhere + 1 }
        fn user(x: real) -> real { broken(x) * 2.0 }
        fn poisoned(x: real) -> real {
            let a = unknown(x);
            let b = a + 1;
            let c = [b, b.x, 3.0];
            if a { b } else { c.w }
            csg t = a;
            let d = eval t.None(b);
            for i in a..b { d = d + 1; }
            diff(d, sin(c)).q + max(d, c)
        }";
    let (loaded, checked) = check_text(text);
    assert_eq!(codes(&loaded, &checked), "E0301 E0301 E0301");
}

#[test]
fn an_unknown_global_name_is_reported_once_with_the_number_of_its_uses() {
    let text = "
        fn g(x: real) -> real { hum(x) + hum(x) }
        fn h(x: real) -> real { hum(x) + hun(x) }";
    let (loaded, checked) = check_text(text);
    assert_eq!(codes(&loaded, &checked), "E0301 E0301");
    let [hum, hun] = checked.diagnostics.as_slice() else { panic!() };
    assert_eq!(hum.labels[0].span.start as usize, text.find("hum").unwrap());
    assert_eq!(hum.notes, ["it is used in 2 more places"]);
    assert_eq!(hun.notes, [""; 0]);
    assert!(checked.program.unsound.functions.len() == 2, "both functions have an error");
}

#[test]
fn names_are_reported_beside_type_errors_in_source_order() {
    let text = "
        fn a(x: real) -> real { x + 1 }
        fn b(x: real) -> real { missing_one(x) + true }
        impl Ghost for Spirit(x) { x }
        fn c(x: real) -> int { missing_two }";
    let (loaded, checked) = check_text(text);
    assert_eq!(codes(&loaded, &checked), "E0401 E0301 E0301 E0301 E0301");
    let starts: Vec<u32> = checked.diagnostics.iter().map(|d| d.labels[0].span.start).collect();
    assert!(starts.is_sorted());
}
