//! Real operations that are exact by IEEE 754 or defined by a formula of such (LANGUAGE 17.2).

#![allow(clippy::cast_possible_truncation, reason = "the f32 evaluation narrows on purpose")]

use super::{
    Accuracy, Derivative, Kink, Lowering, OpDef, Partial, R, enclose, enclose::enclosed, eval, fragment, kink, rule,
    scalar,
};
use crate::{Builder, NodeId, Op};

const ANY: (f64, f64) = (-100.0, 100.0);

pub const ADD: OpDef = OpDef {
    name: "add",
    operands: &[R, R],
    result: R,
    formula: "a + b",
    commutes: true,
    eval: eval!(|a: Real, b: Real| -> Real { a + b }),
    derivative: Derivative::Partials(&[Partial::One, Partial::One]),
    kink: Kink::None,
    domain: &[ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, c: real| -> Real { enclose::add(b, a, c) }),
    cost: 1,
    lowering: Lowering::Instructions { f32x4: "a b f32x4.add", f64x2: "a b f64x2.add", shader: scalar("a b fadd") },
};

pub const SUB: OpDef = OpDef {
    name: "sub",
    operands: &[R, R],
    result: R,
    formula: "a − b",
    commutes: false,
    eval: eval!(|a: Real, b: Real| -> Real { a - b }),
    derivative: Derivative::Partials(&[Partial::One, Partial::MinusOne]),
    kink: Kink::None,
    domain: &[ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, c: real| -> Real { enclose::sub(b, a, c) }),
    cost: 1,
    lowering: Lowering::Instructions { f32x4: "a b f32x4.sub", f64x2: "a b f64x2.sub", shader: scalar("a b fsub") },
};

pub const MUL: OpDef = OpDef {
    name: "mul",
    operands: &[R, R],
    result: R,
    formula: "a·b",
    commutes: true,
    eval: eval!(|a: Real, b: Real| -> Real { a * b }),
    derivative: Derivative::Partials(&[rule!(|_b, [_x, y]| y), rule!(|_b, [x, _y]| x)]),
    kink: Kink::None,
    domain: &[ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, facts; a: real, c: real| -> Real { enclose::mul(b, a, c, facts.same) }),
    cost: 1,
    lowering: Lowering::Instructions { f32x4: "a b f32x4.mul", f64x2: "a b f64x2.mul", shader: scalar("a b fmul") },
};

pub const DIV: OpDef = OpDef {
    name: "div",
    operands: &[R, R],
    result: R,
    formula: "a / b",
    commutes: false,
    eval: eval!(|a: Real, b: Real| -> Real { a / b }),
    derivative: Derivative::Partials(&[
        rule!(|b, [_x, y]| {
            let one = b.real(1.0);
            b.div(one, y)
        }),
        rule!(|b, [_x, y], r| {
            let slope = b.div(r, y);
            b.neg(slope)
        }),
    ]),
    kink: Kink::None,
    domain: &[ANY, (0.1, 100.0)],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, c: real| -> Real { enclose::div(b, a, c) }),
    cost: 4,
    lowering: Lowering::Instructions { f32x4: "a b f32x4.div", f64x2: "a b f64x2.div", shader: scalar("a b fdiv") },
};

pub const NEG: OpDef = OpDef {
    name: "neg",
    operands: &[R],
    result: R,
    formula: "−a",
    commutes: false,
    eval: eval!(|a: Real| -> Real { -a }),
    derivative: Derivative::Partials(&[Partial::MinusOne]),
    kink: Kink::None,
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::neg(b, a) }),
    cost: 1,
    // Cranelift builds the mask of `f32x4.neg` and `abs` anew each time; a constant is one operand in memory.
    lowering: Lowering::Instructions {
        f32x4: "a i32:-2147483648 v128.xor",
        f64x2: "a i64:-9223372036854775808 v128.xor",
        shader: scalar("a fneg"),
    },
};

pub const SQRT: OpDef = OpDef {
    name: "sqrt",
    operands: &[R],
    result: R,
    formula: "√a",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.sqrt() }),
    // 1/(2√a), and 0 at 0 (LANGUAGE 13.6).
    derivative: Derivative::Partials(&[rule!(|b, [_x], r| {
        let half = b.real(0.5);
        b.unit(half, r)
    })]),
    kink: Kink::Where {
        set: "a = 0",
        measure: "a",
        slopes: [kink::OUTSIDE, "0", "a′/(2√a)"],
        jumps: false,
        discriminant: kink::first,
    },
    domain: &[(0.0, 100.0)],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::sqrt(b, a) }),
    cost: 5,
    lowering: Lowering::Instructions { f32x4: "a f32x4.sqrt", f64x2: "a f64x2.sqrt", shader: scalar("a fsqrt") },
};

/// An operation of its own, because by the rules of `/` and `√` the slope at the pole would be ∞·0 (LANGUAGE 13.5, 13.6).
pub const INVERSE_SQRT: OpDef = OpDef {
    name: "inversesqrt",
    operands: &[R],
    result: R,
    formula: "1 / √a",
    commutes: false,
    eval: eval!(|a: Real| -> Real { 1.0 / a.sqrt() }),
    // −1/(2a√a)
    derivative: Derivative::Partials(&[rule!(|b, [x], r| {
        let half = b.real(-0.5);
        let steep = b.div(r, x);
        b.mul(half, steep)
    })]),
    kink: Kink::None,
    domain: &[(0.1, 100.0)],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::inverse_sqrt(b, a) }),
    cost: 9,
    lowering: fragment!(|b, [x], _p| {
        let (one, root) = (b.real(1.0), b.sqrt(x));
        b.div(one, root)
    }),
};

pub const ABS: OpDef = OpDef {
    name: "abs",
    operands: &[R],
    result: R,
    formula: "|a|",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.abs() }),
    derivative: Derivative::Partials(&[rule!(|b, [x]| b.sign(x))]),
    kink: Kink::Where {
        set: "a = 0",
        measure: "a",
        slopes: ["−a′", "0", "a′"],
        jumps: false,
        discriminant: kink::first,
    },
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::abs(b, a) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "a i32:2147483647 v128.and",
        f64x2: "a i64:9223372036854775807 v128.and",
        shader: scalar("a fabs"),
    },
};

pub const MIN: OpDef = OpDef {
    name: "min",
    operands: &[R, R],
    result: R,
    formula: "b if b < a, else a",
    commutes: false,
    eval: eval!(|a: Real, b: Real| -> Real { if b < a { b } else { a } }),
    derivative: Derivative::Choice {
        cond: |b, args| match *args {
            [x, y] => b.lt(y, x),
            _ => NodeId::NONE,
        },
        then: 1,
        otherwise: 0,
    },
    kink: Kink::Where {
        set: "a = b",
        measure: "a − b",
        slopes: ["a′", "a′", "b′"],
        jumps: false,
        discriminant: kink::difference,
    },
    domain: &[ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, c: real| -> Real { enclose::min(b, a, c) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "a b f32x4.pmin",
        f64x2: "a b f64x2.pmin",
        shader: scalar("b a flt b a select"),
    },
};

pub const MAX: OpDef = OpDef {
    name: "max",
    operands: &[R, R],
    result: R,
    formula: "b if a < b, else a",
    commutes: false,
    eval: eval!(|a: Real, b: Real| -> Real { if a < b { b } else { a } }),
    derivative: Derivative::Choice {
        cond: |b, args| match *args {
            [x, y] => b.lt(x, y),
            _ => NodeId::NONE,
        },
        then: 1,
        otherwise: 0,
    },
    kink: Kink::Where {
        set: "a = b",
        measure: "a − b",
        slopes: ["b′", "a′", "a′"],
        jumps: false,
        discriminant: kink::difference,
    },
    domain: &[ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, c: real| -> Real { enclose::max(b, a, c) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "a b f32x4.pmax",
        f64x2: "a b f64x2.pmax",
        shader: scalar("a b flt b a select"),
    },
};

pub const FLOOR: OpDef = OpDef {
    name: "floor",
    operands: &[R],
    result: R,
    formula: "⌊a⌋",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.floor() }),
    derivative: Derivative::Zero,
    kink: Kink::Where {
        set: "a is an integer",
        measure: "a − round(a)",
        slopes: kink::FLAT,
        jumps: true,
        discriminant: kink::past_integer,
    },
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::ends(b, Op::Floor, a) }),
    cost: 1,
    lowering: Lowering::Instructions { f32x4: "a f32x4.floor", f64x2: "a f64x2.floor", shader: scalar("a ffloor") },
};

/// An operation of its own, because it is enclosed more tightly than its formula (LANGUAGE 15.4).
pub const FRACT: OpDef = OpDef {
    name: "fract",
    operands: &[R],
    result: R,
    formula: "a − ⌊a⌋",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a - a.floor() }),
    derivative: Derivative::Partials(&[Partial::One]),
    kink: Kink::Where {
        set: "a is an integer",
        measure: "a − round(a)",
        slopes: ["a′"; 3],
        jumps: true,
        discriminant: kink::past_integer,
    },
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::fract(b, a) }),
    cost: 2,
    lowering: fragment!(|b, [x], _p| {
        let whole = b.floor(x);
        b.sub(x, whole)
    }),
};

/// An operation of its own for the same reason.
pub const MOD: OpDef = OpDef {
    name: "mod",
    operands: &[R, R],
    result: R,
    formula: "a − b⌊a/b⌋",
    commutes: false,
    eval: eval!(|a: Real, b: Real| -> Real { a - b * (a / b).floor() }),
    derivative: Derivative::Partials(&[
        Partial::One,
        rule!(|b, [x, y]| {
            let ratio = b.div(x, y);
            let whole = b.floor(ratio);
            b.neg(whole)
        }),
    ]),
    kink: Kink::Where {
        set: "a/b is an integer",
        measure: "b·(a/b − round(a/b))",
        slopes: ["a′ − ⌊a/b⌋·b′"; 3],
        jumps: true,
        discriminant: kink::past_multiple,
    },
    domain: &[ANY, (0.1, 100.0)],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, c: real| -> Real { enclose::modulo(b, a, c) }),
    cost: 7,
    lowering: fragment!(|b, [x, y], _p| {
        let ratio = b.div(x, y);
        let whole = b.floor(ratio);
        let less = b.mul(y, whole);
        b.sub(x, less)
    }),
};

pub const CEIL: OpDef = OpDef {
    name: "ceil",
    operands: &[R],
    result: R,
    formula: "⌈a⌉",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.ceil() }),
    derivative: Derivative::Zero,
    kink: Kink::Where {
        set: "a is an integer",
        measure: "a − round(a)",
        slopes: kink::FLAT,
        jumps: true,
        discriminant: kink::past_integer,
    },
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::ends(b, Op::Ceil, a) }),
    cost: 1,
    lowering: Lowering::Instructions { f32x4: "a f32x4.ceil", f64x2: "a f64x2.ceil", shader: scalar("a fceil") },
};

pub const TRUNC: OpDef = OpDef {
    name: "trunc",
    operands: &[R],
    result: R,
    formula: "a without its fraction",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.trunc() }),
    derivative: Derivative::Zero,
    kink: Kink::Where {
        set: "a is an integer other than 0",
        measure: "a − the nearest of them",
        slopes: kink::FLAT,
        jumps: true,
        discriminant: kink::past_integer_not_zero,
    },
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::ends(b, Op::Trunc, a) }),
    cost: 1,
    lowering: Lowering::Instructions { f32x4: "a f32x4.trunc", f64x2: "a f64x2.trunc", shader: scalar("a ftrunc") },
};

pub const ROUND: OpDef = OpDef {
    name: "round",
    operands: &[R],
    result: R,
    formula: "the integer nearest to a, ties away from 0",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.round() }),
    derivative: Derivative::Zero,
    kink: Kink::Where {
        set: "a is an integer and a half",
        measure: "|a| − ⌊|a|⌋ − ½",
        slopes: kink::FLAT,
        jumps: true,
        discriminant: kink::past_half,
    },
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::ends(b, Op::Round, a) }),
    cost: 6,
    // x − trunc(x) is exact, so no double rounding as in trunc(x + ½).
    lowering: fragment!(|b, [x], _p| {
        let (half, one) = (b.real(0.5), b.real(1.0));
        let whole = b.trunc(x);
        let rest = b.sub(x, whole);
        let rest = b.abs(rest);
        let away = b.le(half, rest);
        let step = b.copysign(one, x);
        let next = b.add(whole, step);
        b.select(away, next, whole)
    }),
};

pub const SIGN: OpDef = OpDef {
    name: "sign",
    operands: &[R],
    result: R,
    formula: "1 if 0 < a, −1 if a < 0, else a",
    commutes: false,
    eval: eval!(|a: Real| -> Real {
        if 0.0 < a {
            1.0
        } else if a < 0.0 {
            -1.0
        } else {
            a
        }
    }),
    derivative: Derivative::Zero,
    kink: Kink::Where { set: "a = 0", measure: "a", slopes: kink::FLAT, jumps: true, discriminant: kink::first },
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Real { enclose::ends(b, Op::Sign, a) }),
    cost: 4,
    lowering: fragment!(|b, [x], _p| {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        // ±1 where a is not 0 nor NaN, else a: one comparison and one selection.
        let size = b.abs(x);
        let positive = b.lt(zero, size);
        let signed = b.copysign(one, x);
        b.select(positive, signed, x)
    }),
};

/// √(Σxᵢ²), i ascending (LANGUAGE 5.1).
fn length(b: &mut Builder<'_>, v: &[NodeId]) -> NodeId {
    let mut sum = None;
    for x in v {
        let square = b.mul(*x, *x);
        sum = Some(sum.map_or(square, |s| b.add(s, square)));
    }
    sum.map_or(NodeId::NONE, |s| b.sqrt(s))
}

pub const LENGTH2: OpDef = OpDef {
    name: "length2",
    operands: &[R, R],
    result: R,
    formula: "√(a² + b²)",
    commutes: true,
    eval: eval!(|a: Real, b: Real| -> Real { (a * a + b * b).sqrt() }),
    derivative: Derivative::Partials(&[rule!(|b, [x, _y], r| b.unit(x, r)), rule!(|b, [_x, y], r| b.unit(y, r))]),
    kink: Kink::Where {
        set: "the length is 0",
        measure: "the length",
        slopes: [kink::NEVER, "0", "(a·a′ + b·b′) / the length"],
        jumps: false,
        discriminant: kink::length,
    },
    domain: &[ANY; 2],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, x: real, y: real| -> Real { enclose::length(b, &[x, y]) }),
    cost: 8,
    lowering: fragment!(|b, [x, y], _p| length(b, &[x, y])),
};

pub const LENGTH3: OpDef = OpDef {
    name: "length3",
    operands: &[R, R, R],
    result: R,
    formula: "√(a² + b² + c²)",
    commutes: true,
    eval: eval!(|a: Real, b: Real, c: Real| -> Real { (a * a + b * b + c * c).sqrt() }),
    derivative: Derivative::Partials(&[
        rule!(|b, [x, _y, _z], r| b.unit(x, r)),
        rule!(|b, [_x, y, _z], r| b.unit(y, r)),
        rule!(|b, [_x, _y, z], r| b.unit(z, r)),
    ]),
    kink: Kink::Where {
        set: "the length is 0",
        measure: "the length",
        slopes: [kink::NEVER, "0", "(a·a′ + b·b′ + c·c′) / the length"],
        jumps: false,
        discriminant: kink::length,
    },
    domain: &[ANY; 3],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, x: real, y: real, z: real| -> Real { enclose::length(b, &[x, y, z]) }),
    cost: 10,
    lowering: fragment!(|b, [x, y, z], _p| length(b, &[x, y, z])),
};

pub const LENGTH4: OpDef = OpDef {
    name: "length4",
    operands: &[R, R, R, R],
    result: R,
    formula: "√(a² + b² + c² + d²)",
    commutes: true,
    eval: eval!(|a: Real, b: Real, c: Real, d: Real| -> Real { (a * a + b * b + c * c + d * d).sqrt() }),
    derivative: Derivative::Partials(&[
        rule!(|b, [x, _y, _z, _w], r| b.unit(x, r)),
        rule!(|b, [_x, y, _z, _w], r| b.unit(y, r)),
        rule!(|b, [_x, _y, z, _w], r| b.unit(z, r)),
        rule!(|b, [_x, _y, _z, w], r| b.unit(w, r)),
    ]),
    kink: Kink::Where {
        set: "the length is 0",
        measure: "the length",
        slopes: [kink::NEVER, "0", "(a·a′ + b·b′ + c·c′ + d·d′) / the length"],
        jumps: false,
        discriminant: kink::length,
    },
    domain: &[ANY; 4],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, x: real, y: real, z: real, w: real| -> Real { enclose::length(b, &[x, y, z, w]) }),
    cost: 12,
    lowering: fragment!(|b, [x, y, z, w], _p| length(b, &[x, y, z, w])),
};

/// A component of `normalize`: b is the length of a vector with component a. Its own partial derivatives, ¹⁄ᵦ and
/// −(a/b)/b with the same 0, make the Hessian of a length 0 where the length is (LANGUAGE 13.6).
pub const UNIT: OpDef = OpDef {
    name: "unit",
    operands: &[R, R],
    result: R,
    formula: "0 if b = 0, else a / b",
    commutes: false,
    eval: eval!(|a: Real, b: Real| -> Real { if b == 0.0 { 0.0 } else { a / b } }),
    derivative: Derivative::Partials(&[
        rule!(|b, [_x, l]| {
            let one = b.real(1.0);
            b.unit(one, l)
        }),
        rule!(|b, [_x, l], r| {
            let slope = b.unit(r, l);
            b.neg(slope)
        }),
    ]),
    kink: Kink::Where {
        set: "b = 0",
        measure: "b",
        slopes: ["(a′ − (a/b)·b′)/b", "0", "(a′ − (a/b)·b′)/b"],
        jumps: true,
        discriminant: kink::second,
    },
    domain: &[(-1.0, 1.0), (1.0, 100.0)],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, facts; a: real, l: real| -> Real { enclose::unit(b, a, l, facts.part) }),
    cost: 6,
    lowering: fragment!(|b, [x, l], _p| {
        let zero = b.real(0.0);
        let none = b.eq(l, zero);
        let quotient = b.div(x, l);
        b.select(none, zero, quotient)
    }),
};
