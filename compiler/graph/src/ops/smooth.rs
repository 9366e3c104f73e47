//! The two functions that corners and steps are rounded with in `smooth` mode (LANGUAGE 14.3). They know no width and not
//! what they stand for: arguments come in units of the width.

#![allow(clippy::cast_possible_truncation, reason = "the f32 evaluation narrows on purpose")]

use super::{
    Accuracy, Derivative, EnclosureRule, Eval, Kink, Lowering, Op, OpDef, Partial, R, enclose::enclosed,
    enclose_functions, eval, rule,
};
use crate::kernels;

const fn function(
    name: &'static str,
    formula: &'static str,
    eval: Eval,
    partials: &'static [Partial],
    lowering: Lowering,
    enclosure: EnclosureRule,
) -> OpDef {
    OpDef {
        name,
        operands: &[R],
        result: R,
        formula,
        commutes: false,
        eval,
        derivative: Derivative::Partials(partials),
        kink: Kink::None,
        domain: &[(-20.0, 20.0)],
        accuracy: Accuracy::Ulp { f32: 2, f64: 4 },
        enclosure,
        cost: 20,
        lowering,
    }
}

pub const SOFTPLUS: OpDef = function(
    "softplus",
    "ln(1 + eᵃ)",
    eval!(|a: Real| -> Real { (-a.abs()).exp().ln_1p() + if a < 0.0 { 0.0 } else { a } }),
    &[rule!(|b, [x]| b.op(Op::Sigmoid, &[x]))],
    Lowering::Fragment(kernels::softplus),
    enclosed!(|b, x: real| -> Real { enclose_functions::softplus(b, x) }),
);

// σ(x)·σ(−x), which unlike σ·(1 − σ) keeps its digits where σ is near 1.
pub const SIGMOID: OpDef = function(
    "sigmoid",
    "1 / (1 + e⁻ᵃ)",
    eval!(|a: Real| -> Real {
        let power = (-a.abs()).exp();
        let part = if a < 0.0 { power } else { 1.0 };
        part / (1.0 + power)
    }),
    &[rule!(|b, [x], r| {
        let opposite = b.neg(x);
        let rest = b.op(Op::Sigmoid, &[opposite]);
        b.mul(r, rest)
    })],
    Lowering::Fragment(kernels::sigmoid),
    enclosed!(|b, x: real| -> Real { enclose_functions::sigmoid(b, x) }),
);
