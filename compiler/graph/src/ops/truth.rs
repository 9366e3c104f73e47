//! Comparisons, truth values and selection.

#![allow(clippy::cast_possible_truncation, reason = "the f32 evaluation narrows on purpose")]

use super::{
    Accuracy, B, Derivative, EnclosureRule, I, Kink, Lowering, OpDef, R, enclose::enclosed, enclose::truth, eval, kink,
    scalar,
};
use crate::{NodeId, Scalar};

const ANY: (f64, f64) = (-100.0, 100.0);
const TRUTH: (f64, f64) = (0.0, 1.0);

#[expect(clippy::too_many_arguments, reason = "the fields of one literal")]
const fn compare(
    name: &'static str,
    formula: &'static str,
    commutes: bool,
    eval: super::Eval,
    enclosure: EnclosureRule,
    f32x4: &'static str,
    f64x2: &'static str,
    shader: &'static str,
) -> OpDef {
    OpDef {
        name,
        operands: &[R, R],
        result: B,
        formula,
        commutes,
        eval,
        derivative: Derivative::Zero,
        kink: Kink::Where {
            set: "a = b",
            measure: "a − b",
            slopes: ["the branch taken for a < b", "the branch taken for a = b", "the branch taken for a > b"],
            jumps: true,
            discriminant: kink::difference,
        },
        domain: &[ANY, ANY],
        accuracy: Accuracy::Exact,
        enclosure,
        cost: 1,
        lowering: Lowering::Instructions { f32x4, f64x2, shader: scalar(shader) },
    }
}

#[expect(clippy::too_many_arguments, reason = "the fields of one literal")]
const fn logic(
    name: &'static str,
    operands: &'static [Scalar],
    domain: &'static [(f64, f64)],
    formula: &'static str,
    eval: super::Eval,
    enclosure: EnclosureRule,
    lanes: &'static str,
    shader: &'static str,
) -> OpDef {
    OpDef {
        name,
        operands,
        result: B,
        formula,
        commutes: operands.len() == 2,
        eval,
        derivative: Derivative::Zero,
        kink: Kink::None,
        domain,
        accuracy: Accuracy::Exact,
        enclosure,
        cost: 1,
        lowering: Lowering::Instructions { f32x4: lanes, f64x2: lanes, shader: scalar(shader) },
    }
}

pub const LT: OpDef = compare(
    "lt",
    "a < b",
    false,
    eval!(|a: Real, b: Real| -> Bool { a < b }),
    enclosed!(|b, facts; a: real, c: real| -> Bool { truth::lt(b, a, c, facts.same) }),
    "a b f32x4.lt",
    "a b f64x2.lt",
    "a b flt",
);
pub const LE: OpDef = compare(
    "le",
    "a ≤ b",
    false,
    eval!(|a: Real, b: Real| -> Bool { a <= b }),
    enclosed!(|b, facts; a: real, c: real| -> Bool { truth::le(b, a, c, facts.same) }),
    "a b f32x4.le",
    "a b f64x2.le",
    "a b fle",
);
pub const EQ: OpDef = compare(
    "eq",
    "a = b",
    true,
    eval!(|a: Real, b: Real| -> Bool { a == b }),
    enclosed!(|b, facts; a: real, c: real| -> Bool { truth::eq(b, a, c, facts.same) }),
    "a b f32x4.eq",
    "a b f64x2.eq",
    "a b feq",
);
pub const NE: OpDef = compare(
    "ne",
    "a ≠ b",
    true,
    eval!(|a: Real, b: Real| -> Bool { a != b }),
    enclosed!(|b, facts; a: real, c: real| -> Bool { truth::not(truth::eq(b, a, c, facts.same)) }),
    "a b f32x4.ne",
    "a b f64x2.ne",
    "a b fne",
);

pub const AND: OpDef = logic(
    "and",
    &[B, B],
    &[TRUTH; 2],
    "a and b",
    eval!(|a: Bool, b: Bool| -> Bool { a & b }),
    enclosed!(|b, p: truth, q: truth| -> Bool { truth::and(b, p, q) }),
    "a b v128.and",
    "a b and",
);
pub const OR: OpDef = logic(
    "or",
    &[B, B],
    &[TRUTH; 2],
    "a or b",
    eval!(|a: Bool, b: Bool| -> Bool { a | b }),
    enclosed!(|b, p: truth, q: truth| -> Bool { truth::or(b, p, q) }),
    "a b v128.or",
    "a b or",
);
pub const NOT: OpDef = logic(
    "not",
    &[B],
    &[TRUTH],
    "not a",
    eval!(|a: Bool| -> Bool { !a }),
    enclosed!(|_b, p: truth| -> Bool { truth::not(p) }),
    "a v128.not",
    "a not",
);

pub const SELECT: OpDef = OpDef {
    name: "select",
    operands: &[B, R, R],
    result: R,
    formula: "b if a, else c",
    commutes: false,
    eval: eval!(|a: Bool, b: Real, c: Real| -> Real { if a { b } else { c } }),
    derivative: Derivative::Choice {
        cond: |_, args| args.first().copied().unwrap_or(NodeId::NONE),
        then: 1,
        otherwise: 2,
    },
    kink: Kink::None,
    domain: &[TRUTH, ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, c: truth, x: real, y: real| -> Real { truth::select(b, c, x, y) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "b c a v128.bitselect",
        f64x2: "b c a v128.bitselect",
        shader: scalar("a b c select"),
    },
};

pub const SELECT_INT: OpDef = OpDef {
    name: "select_int",
    operands: &[B, I, I],
    result: I,
    formula: "b if a, else c",
    commutes: false,
    eval: eval!(|a: Bool, b: Int, c: Int| -> Int { if a { b } else { c } }),
    derivative: Derivative::Zero,
    kink: Kink::None,
    domain: &[TRUTH, ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, c: truth, x: int, y: int| -> Int { truth::select_int(b, c, x, y) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "b c a v128.bitselect",
        f64x2: "b c a low32 v128.bitselect",
        shader: scalar("a b c select"),
    },
};

pub const SELECT_BOOL: OpDef = OpDef {
    name: "select_bool",
    operands: &[B, B, B],
    result: B,
    formula: "b if a, else c",
    commutes: false,
    eval: eval!(|a: Bool, b: Bool, c: Bool| -> Bool { if a { b } else { c } }),
    derivative: Derivative::Zero,
    kink: Kink::None,
    domain: &[TRUTH; 3],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, c: truth, x: truth, y: truth| -> Bool { truth::select_bool(b, c, x, y) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "b c a v128.bitselect",
        f64x2: "b c a v128.bitselect",
        shader: scalar("a b c select"),
    },
};
