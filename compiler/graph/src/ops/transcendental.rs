//! Transcendental functions (LANGUAGE 17.4). No target has dependable instructions for them, so each is lowered to a
//! fragment of exact operations: see `kernels`.

#![allow(clippy::cast_possible_truncation, reason = "the f32 evaluation narrows on purpose")]

use super::{
    Accuracy, Derivative, EnclosureRule, Eval, Kink, Lowering, OpDef, Partial, R, enclose::enclosed, enclose_functions,
    eval, kink, rule,
};
use crate::{Scalar, kernels};

/// The limits of LANGUAGE 17.4.
const LIMIT: Accuracy = Accuracy::Ulp { f32: 2, f64: 4 };

#[expect(clippy::too_many_arguments, reason = "one for each field in which functions differ")]
const fn function(
    name: &'static str,
    formula: &'static str,
    eval: Eval,
    partials: &'static [Partial],
    kink: Kink,
    domain: &'static [(f64, f64)],
    lowering: Lowering,
    enclosure: EnclosureRule,
) -> OpDef {
    const OPERANDS: &[Scalar] = &[R, R];
    OpDef {
        name,
        operands: if domain.len() == 1 { &[R] } else { OPERANDS },
        result: R,
        formula,
        commutes: false,
        eval,
        derivative: Derivative::Partials(partials),
        kink,
        domain,
        accuracy: LIMIT,
        enclosure,
        cost: 20,
        lowering,
    }
}

pub const EXP: OpDef = function(
    "exp",
    "eᵃ",
    eval!(|a: Real| -> Real { a.exp() }),
    &[rule!(|_b, [_x], r| r)],
    Kink::None,
    &[(-20.0, 20.0)],
    Lowering::Fragment(kernels::exp),
    enclosed!(|b, x: real| -> Real { enclose_functions::exp(b, x) }),
);

pub const EXP2: OpDef = function(
    "exp2",
    "2ᵃ",
    eval!(|a: Real| -> Real { a.exp2() }),
    &[rule!(|b, [_x], r| {
        let log = b.real(std::f64::consts::LN_2);
        b.mul(r, log)
    })],
    Kink::None,
    &[(-30.0, 30.0)],
    Lowering::Fragment(kernels::exp2),
    enclosed!(|b, x: real| -> Real { enclose_functions::exp2(b, x) }),
);

pub const LOG: OpDef = function(
    "log",
    "ln a",
    eval!(|a: Real| -> Real { a.ln() }),
    &[rule!(|b, [x]| {
        let one = b.real(1.0);
        b.div(one, x)
    })],
    Kink::None,
    &[(1e-3, 100.0)],
    Lowering::Fragment(kernels::log),
    enclosed!(|b, x: real| -> Real { enclose_functions::log(b, x) }),
);

// x′/(x·ln 2), with the constant as its reciprocal: one rounding less.
pub const LOG2: OpDef = function(
    "log2",
    "log₂ a",
    eval!(|a: Real| -> Real { a.log2() }),
    &[rule!(|b, [x]| {
        let base = b.real(std::f64::consts::LOG2_E);
        b.div(base, x)
    })],
    Kink::None,
    &[(1e-3, 100.0)],
    Lowering::Fragment(kernels::log2),
    enclosed!(|b, x: real| -> Real { enclose_functions::log2(b, x) }),
);

pub const POW: OpDef = function(
    "pow",
    "aᵇ",
    eval!(|a: Real, b: Real| -> Real { a.powf(b) }),
    &[
        // b·a^(b−1), and 0 where a = 0 ≤ b < 1: the slope is infinite there, and at b = 0 the formula is 0·∞.
        rule!(|b, [x, y]| {
            let (zero, one) = (b.real(0.0), b.real(1.0));
            let less = b.sub(y, one);
            let power = b.pow(x, less);
            let slope = b.mul(y, power);
            let (at_zero, from, below) = (b.eq(x, zero), b.le(zero, y), b.lt(y, one));
            let steep = b.and(from, below);
            let steep = b.and(at_zero, steep);
            b.select(steep, zero, slope)
        }),
        // a^b·ln a, and 0 where a = 0 ≤ b: the limit.
        rule!(|b, [x, y], r| {
            let zero = b.real(0.0);
            let log = b.log(x);
            let slope = b.mul(r, log);
            let (at_zero, from) = (b.eq(x, zero), b.le(zero, y));
            let limit = b.and(at_zero, from);
            b.select(limit, zero, slope)
        }),
    ],
    Kink::Where {
        set: "a = 0 and 0 ≤ b < 1",
        measure: "a where 0 ≤ b < 1, else +∞",
        slopes: [kink::OUTSIDE, "0", "b·aᵇ⁻¹·a′ + aᵇ·ln a·b′"],
        jumps: false,
        discriminant: kink::root,
    },
    &[(0.01, 10.0), (-4.0, 4.0)],
    Lowering::Fragment(kernels::pow),
    enclosed!(|b, x: real, y: real| -> Real { enclose_functions::pow(b, x, y) }),
);

pub const SIN: OpDef = function(
    "sin",
    "sin a",
    eval!(|a: Real| -> Real { a.sin() }),
    &[rule!(|b, [x]| b.cos(x))],
    Kink::None,
    &[(-100.0, 100.0)],
    Lowering::Fragment(kernels::sin),
    enclosed!(|b, x: real| -> Real { enclose_functions::sin(b, x) }),
);

pub const COS: OpDef = function(
    "cos",
    "cos a",
    eval!(|a: Real| -> Real { a.cos() }),
    &[rule!(|b, [x]| {
        let sine = b.sin(x);
        b.neg(sine)
    })],
    Kink::None,
    &[(-100.0, 100.0)],
    Lowering::Fragment(kernels::cos),
    enclosed!(|b, x: real| -> Real { enclose_functions::cos(b, x) }),
);

pub const TAN: OpDef = function(
    "tan",
    "tan a",
    eval!(|a: Real| -> Real { a.tan() }),
    &[rule!(|b, [_x], r| {
        let one = b.real(1.0);
        let square = b.mul(r, r);
        b.add(one, square)
    })],
    Kink::None,
    &[(-1.5, 1.5)],
    Lowering::Fragment(kernels::tan),
    enclosed!(|b, x: real| -> Real { enclose_functions::tan(b, x) }),
);

pub const ASIN: OpDef = function(
    "asin",
    "arcsin a",
    eval!(|a: Real| -> Real { a.asin() }),
    &[rule!(|b, [x]| inverse_chord(b, x))],
    Kink::Where {
        set: "|a| = 1",
        measure: "1 − |a|",
        slopes: [kink::OUTSIDE, "0", "a′/√(1 − a²)"],
        jumps: false,
        discriminant: kink::inside_unit,
    },
    &[(-1.0, 1.0)],
    Lowering::Fragment(kernels::asin),
    enclosed!(|b, x: real| -> Real { enclose_functions::asin(b, x) }),
);

pub const ACOS: OpDef = function(
    "acos",
    "arccos a",
    eval!(|a: Real| -> Real { a.acos() }),
    &[rule!(|b, [x]| {
        let slope = inverse_chord(b, x);
        b.neg(slope)
    })],
    Kink::Where {
        set: "|a| = 1",
        measure: "1 − |a|",
        slopes: [kink::OUTSIDE, "0", "−a′/√(1 − a²)"],
        jumps: false,
        discriminant: kink::inside_unit,
    },
    &[(-1.0, 1.0)],
    Lowering::Fragment(kernels::acos),
    enclosed!(|b, x: real| -> Real { enclose_functions::acos(b, x) }),
);

/// 1/√(1−x²), 0 at ±1 (LANGUAGE 13.6).
fn inverse_chord(b: &mut crate::Builder<'_>, x: crate::NodeId) -> crate::NodeId {
    let one = b.real(1.0);
    let square = complement_of_square(b, x);
    let chord = b.sqrt(square);
    b.unit(one, chord)
}

/// 1 − x² as (1−x)(1+x), which keeps the digits that 1 − x² loses near ±1.
fn complement_of_square(b: &mut crate::Builder<'_>, x: crate::NodeId) -> crate::NodeId {
    let one = b.real(1.0);
    let (below, above) = (b.sub(one, x), b.add(one, x));
    b.mul(below, above)
}

pub const ATAN: OpDef = function(
    "atan",
    "arctan a",
    eval!(|a: Real| -> Real { a.atan() }),
    &[rule!(|b, [x]| {
        let one = b.real(1.0);
        let square = b.mul(x, x);
        let sum = b.add(one, square);
        b.div(one, sum)
    })],
    Kink::None,
    &[(-100.0, 100.0)],
    Lowering::Fragment(kernels::atan),
    enclosed!(|b, x: real| -> Real { enclose_functions::atan(b, x) }),
);

// With h = √(a² + b²): b/h² and −a/h², 0 where h computes 0. Dividing twice keeps h² from underflowing.
pub const ATAN2: OpDef = function(
    "atan2",
    "the angle of the point (b, a)",
    eval!(|a: Real, b: Real| -> Real { a.atan2(b) }),
    &[
        rule!(|b, [y, x]| {
            let h = b.op(super::Op::Length2, &[y, x]);
            let cosine = b.unit(x, h);
            b.unit(cosine, h)
        }),
        rule!(|b, [y, x]| {
            let h = b.op(super::Op::Length2, &[y, x]);
            let sine = b.unit(y, h);
            let slope = b.unit(sine, h);
            b.neg(slope)
        }),
    ],
    Kink::Where {
        set: "a = 0 and b ≤ 0",
        measure: "the distance of (b, a) to that half-line, with the sign of a",
        slopes: ["(b·a′ − a·b′)/(a² + b²)", "the same; 0 at a = b = 0", "(b·a′ − a·b′)/(a² + b²)"],
        jumps: true,
        discriminant: kink::off_cut,
    },
    &[(-10.0, 10.0), (-10.0, 10.0)],
    Lowering::Fragment(kernels::atan2),
    enclosed!(|b, y: real, x: real| -> Real { enclose_functions::atan2(b, y, x) }),
);

pub const SINH: OpDef = function(
    "sinh",
    "sinh a",
    eval!(|a: Real| -> Real { a.sinh() }),
    &[rule!(|b, [x]| b.op(super::Op::Cosh, &[x]))],
    Kink::None,
    &[(-20.0, 20.0)],
    Lowering::Fragment(kernels::sinh),
    enclosed!(|b, x: real| -> Real { enclose_functions::sinh(b, x) }),
);

pub const COSH: OpDef = function(
    "cosh",
    "cosh a",
    eval!(|a: Real| -> Real { a.cosh() }),
    &[rule!(|b, [x]| b.op(super::Op::Sinh, &[x]))],
    Kink::None,
    &[(-20.0, 20.0)],
    Lowering::Fragment(kernels::cosh),
    enclosed!(|b, x: real| -> Real { enclose_functions::cosh(b, x) }),
);

pub const TANH: OpDef = function(
    "tanh",
    "tanh a",
    eval!(|a: Real| -> Real { a.tanh() }),
    &[rule!(|b, [_x], r| complement_of_square(b, r))],
    Kink::None,
    &[(-4.0, 4.0)],
    Lowering::Fragment(kernels::tanh),
    enclosed!(|b, x: real| -> Real { enclose_functions::tanh(b, x) }),
);

pub const ASINH: OpDef = function(
    "asinh",
    "arsinh a",
    eval!(|a: Real| -> Real { a.asinh() }),
    &[rule!(|b, [x]| {
        let one = b.real(1.0);
        let square = b.mul(x, x);
        let sum = b.add(square, one);
        let root = b.sqrt(sum);
        b.div(one, root)
    })],
    Kink::None,
    &[(-100.0, 100.0)],
    Lowering::Fragment(kernels::asinh),
    enclosed!(|b, x: real| -> Real { enclose_functions::asinh(b, x) }),
);

// 1/√(x²−1), 0 at 1 (LANGUAGE 13.6). The product of two roots keeps the digits that x² − 1 loses near 1, and is NaN
// everywhere below 1.
pub const ACOSH: OpDef = function(
    "acosh",
    "arcosh a",
    eval!(|a: Real| -> Real { a.acosh() }),
    &[rule!(|b, [x]| {
        let one = b.real(1.0);
        let (below, above) = (b.sub(x, one), b.add(x, one));
        let (below, above) = (b.sqrt(below), b.sqrt(above));
        let root = b.mul(below, above);
        b.unit(one, root)
    })],
    Kink::Where {
        set: "a = 1",
        measure: "a − 1",
        slopes: [kink::OUTSIDE, "0", "a′/√(a² − 1)"],
        jumps: false,
        discriminant: kink::past_one,
    },
    &[(1.0, 100.0)],
    Lowering::Fragment(kernels::acosh),
    enclosed!(|b, x: real| -> Real { enclose_functions::acosh(b, x) }),
);

pub const ATANH: OpDef = function(
    "atanh",
    "artanh a",
    eval!(|a: Real| -> Real { a.atanh() }),
    &[rule!(|b, [x]| {
        let one = b.real(1.0);
        let rest = complement_of_square(b, x);
        b.div(one, rest)
    })],
    Kink::None,
    &[(-0.9, 0.9)],
    Lowering::Fragment(kernels::atanh),
    enclosed!(|b, x: real| -> Real { enclose_functions::atanh(b, x) }),
);
