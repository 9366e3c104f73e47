//! 32-bit ints with the total semantics of LANGUAGE 4.4, and their casts.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_lossless,
    reason = "casts are the point"
)]

use super::{
    Accuracy, B, Derivative, EnclosureRule, Eval, I, Kink, Lowering, OpDef, R, enclose::enclosed, enclose::int as ints,
    eval, fragment, kink, scalar,
};
use crate::{Op, Scalar};

const SMALL: (f64, f64) = (-100.0, 100.0);

#[expect(clippy::too_many_arguments, reason = "the fields of one literal")]
const fn int(
    name: &'static str,
    operands: &'static [Scalar],
    result: Scalar,
    formula: &'static str,
    commutes: bool,
    eval: Eval,
    enclosure: EnclosureRule,
    cost: u32,
    lowering: Lowering,
) -> OpDef {
    OpDef {
        name,
        operands,
        result,
        formula,
        commutes,
        eval,
        derivative: Derivative::Zero,
        kink: Kink::None,
        domain: if operands.len() == 1 { &[SMALL] } else { &[SMALL; 2] },
        accuracy: Accuracy::Exact,
        enclosure,
        cost,
        lowering,
    }
}

const fn same(lanes: &'static str, shader: &'static str) -> Lowering {
    Lowering::Instructions { f32x4: lanes, f64x2: lanes, shader: scalar(shader) }
}

pub const ADD: OpDef = int(
    "iadd",
    &[I, I],
    I,
    "a + b mod 2³²",
    true,
    eval!(|a: Int, b: Int| -> Int { a.wrapping_add(b) }),
    enclosed!(|b, x: int, y: int| -> Int { ints::add(b, x, y) }),
    1,
    same("a b i32x4.add", "a b iadd"),
);
pub const SUB: OpDef = int(
    "isub",
    &[I, I],
    I,
    "a − b mod 2³²",
    false,
    eval!(|a: Int, b: Int| -> Int { a.wrapping_sub(b) }),
    enclosed!(|b, x: int, y: int| -> Int { ints::sub(b, x, y) }),
    1,
    same("a b i32x4.sub", "a b isub"),
);
pub const MUL: OpDef = int(
    "imul",
    &[I, I],
    I,
    "a·b mod 2³²",
    true,
    eval!(|a: Int, b: Int| -> Int { a.wrapping_mul(b) }),
    enclosed!(|b, x: int, y: int| -> Int { ints::mul(b, x, y) }),
    2,
    same("a b i32x4.mul", "a b imul"),
);
// Quotients of 32-bit ints are exact in f64 after truncation. Only −2³¹/−1 = 2³¹ saturates where it must wrap, and
// only division by 0 is not finite.
pub const DIV: OpDef = int(
    "idiv",
    &[I, I],
    I,
    "a / b toward 0; 0 if b = 0",
    false,
    eval!(|a: Int, b: Int| -> Int { if b == 0 { 0 } else { a.wrapping_div(b) } }),
    enclosed!(|b, x: int, y: int| -> Int { ints::div(b, x, y) }),
    16,
    Lowering::Instructions {
        f32x4: "a f64x2.convert_low_i32x4_s b f64x2.convert_low_i32x4_s f64x2.div i32x4.trunc_sat_f64x2_s_zero \
                a high64 f64x2.convert_low_i32x4_s b high64 f64x2.convert_low_i32x4_s f64x2.div \
                i32x4.trunc_sat_f64x2_s_zero pair64 \
                a i32:-2147483648 i32x4.eq b i32:-1 i32x4.eq v128.and i32x4.sub \
                b i32:0 i32x4.eq v128.andnot",
        f64x2: "a f64x2.convert_low_i32x4_s b f64x2.convert_low_i32x4_s f64x2.div i32x4.trunc_sat_f64x2_s_zero \
                a i32:-2147483648 i32x4.eq b i32:-1 i32x4.eq v128.and i32x4.sub \
                b i32:0 i32x4.eq v128.andnot",
        shader: scalar("b i:0 ieq i:0 a b i:0 ieq a i:-2147483648 ieq b i:-1 ieq and or i:1 b select idiv select"),
    },
);
pub const REM: OpDef = int(
    "irem",
    &[I, I],
    I,
    "a − b⌊a/b⌋; 0 if b = 0",
    false,
    eval!(|a: Int, b: Int| -> Int {
        if b == 0 {
            0
        } else {
            let r = a.wrapping_rem(b);
            if r != 0 && ((r < 0) != (b < 0)) { r.wrapping_add(b) } else { r }
        }
    }),
    enclosed!(|b, x: int, y: int| -> Int { ints::rem(b, x, y) }),
    24,
    fragment!(|b, [x, y], _p| {
        let zero = b.int(0);
        let quotient = b.idiv(x, y);
        let whole = b.imul(quotient, y);
        let rest = b.isub(x, whole);
        // The truncated remainder has the sign of x; where it is not 0 and the signs differ, one y is missing.
        let exact = b.ieq(rest, zero);
        let (x_below, y_below) = (b.ilt(rest, zero), b.ilt(y, zero));
        let y_above = b.not(y_below);
        let differs = b.select_bool(x_below, y_above, y_below);
        let inexact = b.not(exact);
        let wrong = b.and(inexact, differs);
        let mended = b.iadd(rest, y);
        let floored = b.select_int(wrong, mended, rest);
        let nothing = b.ieq(y, zero);
        b.select_int(nothing, zero, floored)
    }),
);
pub const NEG: OpDef = int(
    "ineg",
    &[I],
    I,
    "−a mod 2³²",
    false,
    eval!(|a: Int| -> Int { a.wrapping_neg() }),
    enclosed!(|b, x: int| -> Int { ints::neg(b, x) }),
    1,
    same("a i32x4.neg", "a ineg"),
);
pub const ABS: OpDef = int(
    "iabs",
    &[I],
    I,
    "|a| mod 2³²",
    false,
    eval!(|a: Int| -> Int { a.wrapping_abs() }),
    enclosed!(|b, x: int| -> Int { ints::abs(b, x) }),
    1,
    same("a i32x4.abs", "a i:0 ilt a ineg a select"),
);
pub const MIN: OpDef = int(
    "imin",
    &[I, I],
    I,
    "the smaller",
    true,
    eval!(|a: Int, b: Int| -> Int { a.min(b) }),
    enclosed!(|b, x: int, y: int| -> Int { ints::pairwise(b, Op::IntMin, x, y) }),
    1,
    same("a b i32x4.min_s", "a b imin"),
);
pub const MAX: OpDef = int(
    "imax",
    &[I, I],
    I,
    "the larger",
    true,
    eval!(|a: Int, b: Int| -> Int { a.max(b) }),
    enclosed!(|b, x: int, y: int| -> Int { ints::pairwise(b, Op::IntMax, x, y) }),
    1,
    same("a b i32x4.max_s", "a b imax"),
);
pub const SIGN: OpDef = int(
    "isign",
    &[I],
    I,
    "1 if 0 < a, −1 if a < 0, else 0",
    false,
    eval!(|a: Int| -> Int { a.signum() }),
    enclosed!(|b, x: int| -> Int { ints::ends(b, Op::IntSign, x) }),
    2,
    same("a i32:-1 i32x4.max_s i32:1 i32x4.min_s", "a i:-1 imax i:1 imin"),
);
pub const EQ: OpDef = int(
    "ieq",
    &[I, I],
    B,
    "a = b",
    true,
    eval!(|a: Int, b: Int| -> Bool { a == b }),
    enclosed!(|b, x: int, y: int| -> Bool { ints::eq(b, x, y) }),
    1,
    Lowering::Instructions {
        f32x4: "a b i32x4.eq",
        f64x2: "a b i32x4.eq i64x2.extend_low_i32x4_s",
        shader: scalar("a b ieq"),
    },
);
pub const LT: OpDef = int(
    "ilt",
    &[I, I],
    B,
    "a < b",
    false,
    eval!(|a: Int, b: Int| -> Bool { a < b }),
    enclosed!(|b, x: int, y: int| -> Bool { ints::lt(b, x, y) }),
    1,
    Lowering::Instructions {
        f32x4: "a b i32x4.lt_s",
        f64x2: "a b i32x4.lt_s i64x2.extend_low_i32x4_s",
        shader: scalar("a b ilt"),
    },
);
pub const LE: OpDef = int(
    "ile",
    &[I, I],
    B,
    "a ≤ b",
    false,
    eval!(|a: Int, b: Int| -> Bool { a <= b }),
    enclosed!(|b, x: int, y: int| -> Bool { ints::le(b, x, y) }),
    1,
    Lowering::Instructions {
        f32x4: "a b i32x4.le_s",
        f64x2: "a b i32x4.le_s i64x2.extend_low_i32x4_s",
        shader: scalar("a b ile"),
    },
);
pub const TO_REAL: OpDef = OpDef {
    name: "int_to_real",
    operands: &[I],
    result: R,
    formula: "the nearest real, ties to even",
    commutes: false,
    eval: eval!(|a: Int| -> Real { a as F }),
    derivative: Derivative::Zero,
    kink: Kink::None,
    domain: &[SMALL],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, n: int| -> Real { ints::to_real(b, n) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "a f32x4.convert_i32x4_s",
        f64x2: "a f64x2.convert_low_i32x4_s",
        shader: scalar("a itof"),
    },
};
pub const FROM_REAL: OpDef = OpDef {
    name: "real_to_int",
    operands: &[R],
    result: I,
    formula: "a without its fraction, saturated; 0 for NaN",
    commutes: false,
    eval: eval!(|a: Real| -> Int { a as i32 }),
    derivative: Derivative::Zero,
    kink: Kink::Where {
        set: "a is an integer other than 0",
        measure: "a − the nearest of them",
        slopes: kink::FLAT,
        jumps: true,
        discriminant: kink::past_integer_not_zero,
    },
    domain: &[SMALL],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Int { ints::from_real(b, a) }),
    cost: 3,
    lowering: Lowering::Instructions {
        f32x4: "a i32x4.trunc_sat_f32x4_s",
        f64x2: "a i32x4.trunc_sat_f64x2_s_zero",
        shader: scalar(
            "r:2147483648 a fle i:2147483647 a r:-2147483648 fle i:-2147483648 \
             a fabs r:2147483648 flt a r:0 select ftoi select select",
        ),
    },
};
