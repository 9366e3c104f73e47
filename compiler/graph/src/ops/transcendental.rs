//! Transcendental functions (LANGUAGE 17.4). No target has dependable instructions for them, so each is lowered to a
//! fragment of exact operations: see `kernels`.

#![allow(clippy::cast_possible_truncation, reason = "the f32 evaluation narrows on purpose")]

use super::{Accuracy, Derivative, Eval, Kink, Lowering, OpDef, Partial, R, eval, rule};
use crate::{Scalar, kernels};

/// The limits of LANGUAGE 17.4.
const LIMIT: Accuracy = Accuracy::Ulp { f32: 2, f64: 4 };

const fn function(
    name: &'static str,
    formula: &'static str,
    eval: Eval,
    partials: &'static [Partial],
    kink: Kink,
    domain: &'static [(f64, f64)],
    lowering: Lowering,
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
        cost: 20,
        lowering,
    }
}

/// 1 − |a|: where the arc functions of the unit interval have a vertical tangent.
fn to_unit(v: &[f64]) -> f64 {
    v.first().map_or(f64::NAN, |a| 1.0 - a.abs())
}

pub const EXP: OpDef = function(
    "exp",
    "eᵃ",
    eval!(|a: Real| -> Real { a.exp() }),
    &[rule!(|_b, [_x], r| r)],
    Kink::None,
    &[(-20.0, 20.0)],
    Lowering::Fragment(kernels::exp),
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
    Kink::Where { set: "a = 0", discriminant: |v| v.first().copied().unwrap_or(f64::NAN) },
    &[(0.01, 10.0), (-4.0, 4.0)],
    Lowering::Fragment(kernels::pow),
);

pub const SIN: OpDef = function(
    "sin",
    "sin a",
    eval!(|a: Real| -> Real { a.sin() }),
    &[rule!(|b, [x]| b.cos(x))],
    Kink::None,
    &[(-100.0, 100.0)],
    Lowering::Fragment(kernels::sin),
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
);

pub const ASIN: OpDef = function(
    "asin",
    "arcsin a",
    eval!(|a: Real| -> Real { a.asin() }),
    &[rule!(|b, [x]| inverse_chord(b, x))],
    Kink::Where { set: "|a| = 1", discriminant: to_unit },
    &[(-1.0, 1.0)],
    Lowering::Fragment(kernels::asin),
);

pub const ACOS: OpDef = function(
    "acos",
    "arccos a",
    eval!(|a: Real| -> Real { a.acos() }),
    &[rule!(|b, [x]| {
        let slope = inverse_chord(b, x);
        b.neg(slope)
    })],
    Kink::Where { set: "|a| = 1", discriminant: to_unit },
    &[(-1.0, 1.0)],
    Lowering::Fragment(kernels::acos),
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
    Kink::Where { set: "a = b = 0", discriminant: |v| v.iter().map(|x| x * x).sum::<f64>().sqrt() },
    &[(-10.0, 10.0), (-10.0, 10.0)],
    Lowering::Fragment(kernels::atan2),
);

pub const SINH: OpDef = function(
    "sinh",
    "sinh a",
    eval!(|a: Real| -> Real { a.sinh() }),
    &[rule!(|b, [x]| b.op(super::Op::Cosh, &[x]))],
    Kink::None,
    &[(-20.0, 20.0)],
    Lowering::Fragment(kernels::sinh),
);

pub const COSH: OpDef = function(
    "cosh",
    "cosh a",
    eval!(|a: Real| -> Real { a.cosh() }),
    &[rule!(|b, [x]| b.op(super::Op::Sinh, &[x]))],
    Kink::None,
    &[(-20.0, 20.0)],
    Lowering::Fragment(kernels::cosh),
);

pub const TANH: OpDef = function(
    "tanh",
    "tanh a",
    eval!(|a: Real| -> Real { a.tanh() }),
    &[rule!(|b, [_x], r| complement_of_square(b, r))],
    Kink::None,
    &[(-4.0, 4.0)],
    Lowering::Fragment(kernels::tanh),
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
    Kink::Where { set: "a = 1", discriminant: |v| v.first().map_or(f64::NAN, |a| a - 1.0) },
    &[(1.0, 100.0)],
    Lowering::Fragment(kernels::acosh),
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
);
