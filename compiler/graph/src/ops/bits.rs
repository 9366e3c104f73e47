//! The three operations that hide the bits of a real, so that kernels are ordinary graphs (DESIGN 4).

#![allow(clippy::cast_possible_truncation, reason = "the f32 evaluation narrows on purpose")]

use super::{
    Accuracy, Derivative, I, Kink, Lowering, OpDef, Partial, R, Shader, enclose, enclose::enclosed, eval, kink, rule,
};

const ANY: (f64, f64) = (-100.0, 100.0);

pub const COPYSIGN: OpDef = OpDef {
    name: "copysign",
    operands: &[R, R],
    result: R,
    formula: "|a| with the sign bit of b",
    commutes: false,
    eval: eval!(|a: Real, b: Real| -> Real { a.copysign(b) }),
    derivative: Derivative::Partials(&[
        rule!(|b, [x, y]| {
            let slope = b.sign(x);
            let one = b.real(1.0);
            let side = b.copysign(one, y);
            b.mul(slope, side)
        }),
        Partial::Zero,
    ]),
    kink: Kink::Where {
        set: "a = 0 or b = 0",
        measure: "the nearer to 0 of a and b",
        slopes: ["±a′", "±a′; 0 at a = 0", "±a′"],
        jumps: true,
        discriminant: kink::nearer_to_zero,
    },
    domain: &[ANY, ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, s: real| -> Real { enclose::copysign(b, a, s) }),
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "b a i32:-2147483648 v128.bitselect",
        f64x2: "b a i64:-9223372036854775808 v128.bitselect",
        shader: Shader::Scalar {
            f32: "a bits w:2147483647 iand b bits w:-2147483648 iand ior real",
            f64: "a bits w:9223372036854775807 iand b bits w:-9223372036854775808 iand ior real",
        },
    },
};

pub const EXPONENT: OpDef = OpDef {
    name: "exponent",
    operands: &[R],
    result: I,
    formula: "⌊log₂|a|⌋ of a normal number; of 0 and subnormals one below the least, of ∞ and NaN one above the largest",
    commutes: false,
    eval: super::Eval {
        f64: |v| match v {
            [crate::Value::Real(a)] => crate::Value::Int(((a.to_bits() >> 52) & 0x7ff) as i32 - 1023),
            _ => crate::Value::Int(0),
        },
        f32: |v| match v {
            [crate::Value::Real(a)] => crate::Value::Int((((*a as f32).to_bits() >> 23) & 0xff).cast_signed() - 127),
            _ => crate::Value::Int(0),
        },
    },
    derivative: Derivative::Zero,
    kink: Kink::None,
    domain: &[ANY],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real| -> Int { enclose::int::exponent(b, a) }),
    cost: 3,
    lowering: Lowering::Instructions {
        f32x4: "a f32x4.abs i32x4.shr_u:23 i32:127 i32x4.sub",
        f64x2: "a f64x2.abs i64x2.shr_u:52 low32 i32:1023 i32x4.sub",
        shader: Shader::Scalar {
            f32: "a bits w:2147483647 iand i:23 ushr i:127 isub",
            f64: "a bits w:9223372036854775807 iand i:52 ushr narrow i:1023 isub",
        },
    },
};

pub const SCALE: OpDef = OpDef {
    name: "scale",
    operands: &[R, I],
    result: R,
    formula: "a·2ᵇ, b cut to the exponents of normal numbers; rounded once",
    commutes: false,
    eval: super::Eval {
        f64: |v| match v {
            [crate::Value::Real(a), crate::Value::Int(n)] => {
                let biased = u64::from(((*n).clamp(-1022, 1023) + 1023).unsigned_abs());
                crate::Value::Real(a * f64::from_bits(biased << 52))
            }
            _ => crate::Value::Real(f64::NAN),
        },
        f32: |v| match v {
            [crate::Value::Real(a), crate::Value::Int(n)] => {
                let biased = ((*n).clamp(-126, 127) + 127).unsigned_abs();
                crate::Value::Real(f64::from(*a as f32 * f32::from_bits(biased << 23)))
            }
            _ => crate::Value::Real(f64::NAN),
        },
    },
    derivative: Derivative::Partials(&[
        rule!(|b, [_x, n]| {
            let one = b.real(1.0);
            b.scale(one, n)
        }),
        Partial::Zero,
    ]),
    kink: Kink::None,
    domain: &[ANY, (-20.0, 20.0)],
    accuracy: Accuracy::Exact,
    enclosure: enclosed!(|b, a: real, n: int| -> Real { enclose::int::scale(b, a, n) }),
    cost: 5,
    lowering: Lowering::Instructions {
        f32x4: "a b i32:-126 i32x4.max_s i32:127 i32x4.min_s i32:127 i32x4.add i32x4.shl:23 f32x4.mul",
        f64x2: "a b i32:-1022 i32x4.max_s i32:1023 i32x4.min_s i32:1023 i32x4.add i64x2.extend_low_i32x4_s \
                i64x2.shl:52 f64x2.mul",
        shader: Shader::Scalar {
            f32: "a b i:-126 imax i:127 imin i:127 iadd i:23 ishl real fmul",
            f64: "a b i:-1022 imax i:1023 imin i:1023 iadd widen i:52 ishl real fmul",
        },
    },
};
