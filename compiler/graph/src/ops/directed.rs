//! Directed rounding: the ends of enclosures (DESIGN 5). Each operation gives the number of `real` next to the exact
//! result on one side, by error-free transformations; it knows nothing of intervals and of which end it serves.
//!
//! Overflow is rounded like everything else: what exceeds the largest number has that number below it and ∞ above it.
//! Infinite operands have infinite results, and 0·∞ is 0. Operands are numbers: what a NaN gives is not specified. A zero
//! has the sign that rounding to nearest gives it.

#![allow(clippy::cast_possible_truncation, reason = "the f32 evaluation narrows on purpose")]

use super::{
    Accuracy, B, Derivative, Eval, Kink, Lowering, Op, OpDef, Partial, R, Shader, enclose, enclose::enclosed,
    enclose::nonnegative, eval, fragment, real, scalar, shader,
};
use crate::{Builder, NodeId, Precision, Range, Value};

const ANY: (f64, f64) = (-100.0, 100.0);
const SIZE: (f64, f64) = (0.0, 100.0);
const TRUTH: (f64, f64) = (0.0, 1.0);

/// A directed form of an operation: its derivative and what encloses it are those of the plain one.
const fn directed(
    name: &'static str,
    formula: &'static str,
    plain: &OpDef,
    derivative: Derivative,
    eval: Eval,
    cost: u32,
    lowering: Lowering,
) -> OpDef {
    OpDef {
        name,
        operands: plain.operands,
        result: R,
        formula,
        commutes: plain.commutes,
        eval,
        derivative,
        kink: Kink::None,
        domain: plain.domain,
        accuracy: Accuracy::Directed,
        enclosure: plain.enclosure,
        cost,
        lowering,
    }
}

/// Where an end of an interval meets operations: what was a constant of the program is one of `real` from here on.
pub const ROUNDED: OpDef = OpDef {
    name: "rounded",
    operands: &[R],
    result: R,
    formula: "a",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a }),
    derivative: Derivative::Partials(&[Partial::One]),
    kink: Kink::None,
    domain: &[ANY],
    accuracy: Accuracy::Directed,
    enclosure: enclosed!(|_b, x: real| -> Real { x }),
    cost: 0,
    lowering: Lowering::Fragment(|_, args, _| args.first().copied().unwrap_or(NodeId::NONE)),
};

pub const NEXT_UP: OpDef = OpDef {
    name: "next_up",
    operands: &[R],
    result: R,
    formula: "the least number above a; ∞ and NaN themselves",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.next_up() }),
    derivative: Derivative::Partials(&[Partial::One]),
    kink: Kink::None,
    domain: &[ANY],
    accuracy: Accuracy::Directed,
    // Rounding is identity (LANGUAGE 13.5); as computed the result lies one number further.
    enclosure: enclosed!(|b, x: real| -> Real { Range { hi: b.next_up(x.hi), ..x } }),
    cost: 6,
    // Bits of numbers of one sign are in order: one more above 0, one less below. Adding 0 makes −0 a 0.
    lowering: Lowering::Instructions {
        f32x4: "a i32:0 f32x4.add a i32:0 f32x4.lt i32:1 v128.or a i32:2139095040 f32x4.lt v128.and i32x4.add",
        f64x2: "a i64:0 f64x2.add a i64:0 f64x2.lt i64:1 v128.or a i64:9218868437227405312 f64x2.lt v128.and i64x2.add",
        shader: Shader::Scalar {
            f32: "a r:3.4028234663852886e38 fle \
                  a r:0 feq w:1 a bits a r:0 flt w:-1 w:1 select iadd select a bits select real",
            f64: "a r:1.7976931348623157e308 fle \
                  a r:0 feq w:1 a bits a r:0 flt w:-1 w:1 select iadd select a bits select real",
        },
    },
};

pub const NEXT_DOWN: OpDef = OpDef {
    name: "next_down",
    operands: &[R],
    result: R,
    formula: "the largest number below a; −∞ and NaN themselves",
    commutes: false,
    eval: eval!(|a: Real| -> Real { a.next_down() }),
    derivative: Derivative::Partials(&[Partial::One]),
    kink: Kink::None,
    domain: &[ANY],
    accuracy: Accuracy::Directed,
    enclosure: enclosed!(|b, x: real| -> Real { Range { lo: b.next_down(x.lo), ..x } }),
    cost: 7,
    // −next_up(−a)
    lowering: Lowering::Instructions {
        f32x4: "i32:0 a f32x4.sub i32:0 a f32x4.lt i32:1 v128.or a i32:-8388608 f32x4.gt v128.and i32x4.add \
                i32:-2147483648 v128.xor",
        f64x2: "i64:0 a f64x2.sub i64:0 a f64x2.lt i64:1 v128.or a i64:-4503599627370496 f64x2.gt v128.and i64x2.add \
                i64:-9223372036854775808 v128.xor",
        shader: Shader::Scalar {
            f32: "r:-3.4028234663852886e38 a fle \
                  a r:0 feq w:-2147483647 a bits a r:0 flt w:1 w:-1 select iadd select a bits select real",
            f64: "r:-1.7976931348623157e308 a fle \
                  a r:0 feq w:-9223372036854775807 a bits a r:0 flt w:1 w:-1 select iadd select a bits select real",
        },
    },
};

/// What the directed operations choose by: for a rounded result there is always a number on the other side, and its
/// zeros have the sign of the exact result, so that both are left in the right direction by one step of the bits.
pub const ABOVE: OpDef = OpDef {
    name: "above",
    operands: &[R, B],
    result: R,
    formula: "if b the least number above a, else a; a is not −0 if b",
    commutes: false,
    eval: Eval {
        f64: |v| chosen(v, |a| f64::from_bits(stepped(a.to_bits().cast_signed(), 1).cast_unsigned())),
        f32: |v| {
            chosen(v, |a| {
                let bits = (a as f32).to_bits().cast_signed();
                f64::from(f32::from_bits(bits.wrapping_add(bits >> 31 | 1).cast_unsigned()))
            })
        },
    },
    derivative: Derivative::Partials(&[Partial::One, Partial::Zero]),
    kink: Kink::None,
    domain: &[ANY, TRUTH],
    accuracy: Accuracy::Directed,
    enclosure: enclosed!(|b, x: real, _c: truth| -> Real { Range { hi: b.next_up(x.hi), ..x } }),
    cost: 4,
    lowering: Lowering::Instructions {
        f32x4: "a a i32x4.shr_s:31 i32:1 v128.or b v128.and i32x4.add",
        f64x2: "a a i64:0 i64x2.lt_s i64:1 v128.or b v128.and i64x2.add",
        shader: Shader::Scalar {
            f32: "a bits b a bits i:31 ishr w:1 ior w:0 select iadd real",
            f64: "a bits b a bits i:63 ishr w:1 ior w:0 select iadd real",
        },
    },
};

pub const BELOW: OpDef = OpDef {
    name: "below",
    operands: &[R, B],
    result: R,
    formula: "if b the largest number below a, else a; a is not +0 if b",
    commutes: false,
    eval: Eval {
        f64: |v| chosen(v, |a| f64::from_bits(stepped(a.to_bits().cast_signed(), -1).cast_unsigned())),
        f32: |v| {
            chosen(v, |a| {
                let bits = (a as f32).to_bits().cast_signed();
                f64::from(f32::from_bits(bits.wrapping_sub(bits >> 31 | 1).cast_unsigned()))
            })
        },
    },
    derivative: Derivative::Partials(&[Partial::One, Partial::Zero]),
    kink: Kink::None,
    domain: &[ANY, TRUTH],
    accuracy: Accuracy::Directed,
    enclosure: enclosed!(|b, x: real, _c: truth| -> Real { Range { lo: b.next_down(x.lo), ..x } }),
    cost: 4,
    lowering: Lowering::Instructions {
        f32x4: "a a i32x4.shr_s:31 i32:1 v128.or b v128.and i32x4.sub",
        f64x2: "a a i64:0 i64x2.lt_s i64:1 v128.or b v128.and i64x2.sub",
        shader: Shader::Scalar {
            f32: "a bits b a bits i:31 ishr w:1 ior w:0 select isub real",
            f64: "a bits b a bits i:63 ishr w:1 ior w:0 select isub real",
        },
    },
};

/// [`ABOVE`] and [`BELOW`] without their look at the sign: squares, roots and sums of such have none.
pub const RAISED: OpDef = OpDef {
    name: "raised",
    formula: "if b the least number above a, else a; a ≥ 0",
    eval: ABOVE.eval,
    domain: &[SIZE, TRUTH],
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "a b i32x4.sub",
        f64x2: "a b i64x2.sub",
        shader: scalar("a bits b w:1 w:0 select iadd real"),
    },
    ..ABOVE
};

pub const LOWERED: OpDef = OpDef {
    name: "lowered",
    formula: "if b the largest number below a, else a; a > 0 if b, else a ≥ 0",
    eval: BELOW.eval,
    domain: &[(0.1, 100.0), TRUTH],
    cost: 1,
    lowering: Lowering::Instructions {
        f32x4: "a b i32x4.add",
        f64x2: "a b i64x2.add",
        shader: scalar("a bits b w:1 w:0 select isub real"),
    },
    ..BELOW
};

/// The bits of a number moved away from 0 (`by` 1) or towards it if it is positive, the other way if it is negative.
const fn stepped(bits: i64, by: i64) -> i64 {
    bits.wrapping_add((bits >> 63 | 1) * by)
}

/// `step` of the first operand if the second holds.
fn chosen(v: &[Value], step: fn(f64) -> f64) -> Value {
    match v {
        [Value::Real(a), Value::Bool(b)] => Value::Real(if *b && !a.is_nan() { step(*a) } else { *a }),
        _ => Value::Real(f64::NAN),
    }
}

/// In f32 the product of two numbers has 48 bits and is exact in f64, whatever its size; in f64 this is only a part of
/// [`PRODUCT_BELOW`].
pub const WIDE_PRODUCT_BELOW: OpDef = OpDef {
    name: "wide_product_below",
    operands: &[R, R, R],
    result: B,
    formula: "a·b < c, the product rounded to f64",
    commutes: true,
    eval: Eval { f64: wide_product_below, f32: wide_product_below },
    derivative: Derivative::Zero,
    kink: Kink::None,
    domain: &[ANY, ANY, ANY],
    accuracy: Accuracy::Directed,
    enclosure: |b, _, _| enclose::anything(b, B),
    cost: 12,
    lowering: Lowering::Instructions {
        f32x4: "a f64x2.promote_low_f32x4 b f64x2.promote_low_f32x4 f64x2.mul c f64x2.promote_low_f32x4 f64x2.lt \
                a high64 f64x2.promote_low_f32x4 b high64 f64x2.promote_low_f32x4 f64x2.mul \
                c high64 f64x2.promote_low_f32x4 f64x2.lt even32",
        f64x2: "a b f64x2.mul c f64x2.lt",
        shader: shader!(|b, [x, y, z], p| match p {
            Precision::F32 => product_below(b, x, y, z, p),
            Precision::F64 => {
                let product = b.mul(x, y);
                b.lt(product, z)
            }
        }),
    },
};

pub const WIDE_PRODUCT_ABOVE: OpDef = OpDef {
    name: "wide_product_above",
    operands: &[R, R, R],
    result: B,
    formula: "c < a·b, the product rounded to f64",
    commutes: true,
    eval: Eval { f64: wide_product_above, f32: wide_product_above },
    derivative: Derivative::Zero,
    kink: Kink::None,
    domain: &[ANY, ANY, ANY],
    accuracy: Accuracy::Directed,
    enclosure: |b, _, _| enclose::anything(b, B),
    cost: 12,
    lowering: Lowering::Instructions {
        f32x4: "a f64x2.promote_low_f32x4 b f64x2.promote_low_f32x4 f64x2.mul c f64x2.promote_low_f32x4 f64x2.gt \
                a high64 f64x2.promote_low_f32x4 b high64 f64x2.promote_low_f32x4 f64x2.mul \
                c high64 f64x2.promote_low_f32x4 f64x2.gt even32",
        f64x2: "a b f64x2.mul c f64x2.gt",
        shader: shader!(|b, [x, y, z], p| match p {
            Precision::F32 => product_above(b, x, y, z, p),
            Precision::F64 => {
                let product = b.mul(x, y);
                b.lt(z, product)
            }
        }),
    },
};

fn wide_product_below(v: &[Value]) -> Value {
    Value::Bool(matches!(v, [Value::Real(a), Value::Real(b), Value::Real(c)] if a * b < *c))
}

fn wide_product_above(v: &[Value]) -> Value {
    Value::Bool(matches!(v, [Value::Real(a), Value::Real(b), Value::Real(c)] if *c < a * b))
}

pub const PRODUCT_BELOW: OpDef = OpDef {
    name: "product_below",
    operands: &[R, R, R],
    result: B,
    formula: "a·b < c, exactly",
    commutes: true,
    eval: Eval { f64: product_below_by_fma, f32: wide_product_below },
    derivative: Derivative::Zero,
    kink: Kink::None,
    domain: &[ANY, ANY, ANY],
    accuracy: Accuracy::Directed,
    enclosure: |b, _, _| enclose::anything(b, B),
    cost: 12,
    lowering: fragment!(|b, [x, y, z], p| match p {
        Precision::F32 => b.op(Op::WideProductBelow, &[x, y, z]),
        Precision::F64 => product_below(b, x, y, z, p),
    }),
};

fn product_below_by_fma(v: &[Value]) -> Value {
    Value::Bool(matches!(v, [Value::Real(a), Value::Real(b), Value::Real(c)] if product_less(*a, *b, *c)))
}

/// a·b < c by the sign of fma(a, b, −c), which is right unless the difference underflows to 0. So where c is small,
/// the smaller factor and c are scaled up: either a·b is much larger than c, or the difference has no bit below 2⁻¹⁰⁷⁴.
fn product_less(a: f64, b: f64, c: f64) -> bool {
    let (a, b) = if a.abs() <= b.abs() { (a, b) } else { (b, a) };
    if c == 0.0 {
        return a != 0.0 && b != 0.0 && a.is_sign_negative() != b.is_sign_negative();
    }
    if c.abs() < 2f64.powi(-500) && a.abs() < 2f64.powi(-200) {
        let up = 2f64.powi(700);
        return (a * up).mul_add(b, -(c * up)) < 0.0;
    }
    a.mul_add(b, -c) < 0.0
}

/// a·b < c, exactly, for all numbers; 0·∞ is below nothing.
///
/// With h + e = a·b by Dekker's product of Veltkamp's halves (Dekker, *A floating-point technique for extending the
/// available precision*, 1971), a·b < c means h < c, or h = c and e < 0. The smaller factor is scaled to about ¼, then
/// the larger, so nothing overflows and e is a number; and so is c·2ᵐ, unless c is far from a·b. If it is as large as
/// a·b, then on the way it is as large as the larger factor, hence exact. Beside 0 and ∞ it must not be scaled.
fn product_below(b: &mut Builder<'_>, x: NodeId, y: NodeId, z: NodeId, p: Precision) -> NodeId {
    let (size_x, size_y) = (b.abs(x), b.abs(y));
    let ordered = b.le(size_x, size_y);
    let (small, large) = (b.select(ordered, x, y), b.select(ordered, y, x));
    let (x, less) = scaled(b, small, z);
    let (y, less) = scaled(b, large, less);
    let product = b.mul(x, y);
    // 0 and ∞ are their own doubles.
    let double = b.add(product, product);
    let extreme = b.eq(double, product);
    let z = b.select(extreme, z, less);
    let (xh, xl) = halves(b, x, p);
    let (yh, yl) = halves(b, y, p);
    let (hh, hl, lh, ll) = (b.mul(xh, yh), b.mul(xh, yl), b.mul(xl, yh), b.mul(xl, yl));
    let rest = b.sub(hh, product);
    let rest = b.add(rest, hl);
    let rest = b.add(rest, lh);
    let error = b.add(rest, ll);
    let zero = b.real(0.0);
    let (less, same, under) = (b.lt(product, z), b.eq(product, z), b.lt(error, zero));
    let nearly = b.and(same, under);
    b.or(less, nearly)
}

/// `x` and `z` times the power of 2 that makes `x` about ¼.
fn scaled(b: &mut Builder<'_>, x: NodeId, z: NodeId) -> (NodeId, NodeId) {
    let (quarter, exponent) = (b.int(-2), b.exponent(x));
    let power = b.isub(quarter, exponent);
    (b.scale(x, power), b.scale(z, power))
}

/// a·b > c by the same.
fn product_above(b: &mut Builder<'_>, x: NodeId, y: NodeId, z: NodeId, p: Precision) -> NodeId {
    let (x, z) = (b.neg(x), b.neg(z));
    product_below(b, x, y, z, p)
}

/// Veltkamp's halves of 12 bits, in f64 of 26: h + l = x.
fn halves(b: &mut Builder<'_>, x: NodeId, p: Precision) -> (NodeId, NodeId) {
    let splitter = match p {
        Precision::F32 => 4097.0,        // 2¹² + 1
        Precision::F64 => 134_217_729.0, // 2²⁷ + 1
    };
    let splitter = b.real(splitter);
    let big = b.mul(splitter, x);
    let over = b.sub(big, x);
    let high = b.sub(big, over);
    (high, b.sub(x, high))
}

/// The side of the exact result on which a rounded one lies.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Down,
    Up,
}

impl Side {
    const fn other(self) -> Self {
        match self {
            Self::Down => Self::Up,
            Self::Up => Self::Down,
        }
    }

    /// `x` moved to this side if `wrong`.
    fn corrected(self, b: &mut Builder<'_>, x: NodeId, wrong: NodeId) -> NodeId {
        b.op(if self == Self::Up { Op::Above } else { Op::Below }, &[x, wrong])
    }

    /// The same of an `x` that is not negative.
    fn corrected_size(self, b: &mut Builder<'_>, x: NodeId, wrong: NodeId) -> NodeId {
        b.op(if self == Self::Up { Op::Raised } else { Op::Lowered }, &[x, wrong])
    }

    /// Whether the exact x·y lies beyond z on this side.
    fn product_beyond(self, b: &mut Builder<'_>, x: NodeId, y: NodeId, z: NodeId, p: Precision) -> NodeId {
        match (self, p) {
            (Self::Down, _) => b.product_below(x, y, z),
            (Self::Up, Precision::F32) => b.op(Op::WideProductAbove, &[x, y, z]),
            (Self::Up, Precision::F64) => product_above(b, x, y, z, p),
        }
    }
}

/// a + b with the sign of Knuth's error: with s = a + b, b′ = s − a and a′ = s − b′ the error is (a − a′) + (b − b′),
/// exactly (Knuth, *The Art of Computer Programming* 2, 4.2.2, theorem B). Only its sign matters, and a′ − a < b − b′
/// says it without the sum.
///
/// Where s overflows, a′ is NaN and b − b′ = ∓∞ tells it from infinite operands, where that is NaN too: `min` and `max`
/// with a number that no error reaches make the comparison fall out right. Beside a small constant s cannot overflow.
fn add(b: &mut Builder<'_>, x: NodeId, y: NodeId, side: Side, p: Precision) -> NodeId {
    let far = if p == Precision::F32 { 2f64.powi(127) } else { 2f64.powi(1023) };
    let sum = b.add(x, y);
    let second = b.sub(sum, x);
    let first = b.sub(sum, second);
    let (over_first, under_second) = (b.sub(first, x), b.sub(y, second));
    let overflows =
        ![x, y].iter().any(|x| matches!(b.value(*x), Some(Value::Real(x)) if x.abs() < far * 2f64.powi(-60)));
    let wrong = if side == Side::Up {
        let far = b.real(far);
        let over_first = if overflows { b.min(far, over_first) } else { over_first };
        b.lt(over_first, under_second)
    } else {
        let far = b.real(-far);
        let over_first = if overflows { b.max(far, over_first) } else { over_first };
        b.lt(under_second, over_first)
    };
    if nonnegative(b, x) && nonnegative(b, y) {
        side.corrected_size(b, sum, wrong)
    } else {
        side.corrected(b, sum, wrong)
    }
}

/// a·b, and 0 where that is 0·∞. Without a 0 or an ∞ beside it, or with itself, no operand makes that.
fn mul(b: &mut Builder<'_>, x: NodeId, y: NodeId, side: Side, p: Precision) -> NodeId {
    let mut product = b.mul(x, y);
    let regular = |x: &NodeId| matches!(b.value(*x), Some(Value::Real(x)) if x.is_normal());
    if x != y && ![x, y].iter().any(regular) {
        let (zero, defined) = (b.real(0.0), b.eq(product, product));
        product = b.select(defined, product, zero);
    }
    let wrong = side.product_beyond(b, x, y, product, p);
    if x == y || (nonnegative(b, x) && nonnegative(b, y)) {
        side.corrected_size(b, product, wrong)
    } else {
        side.corrected(b, product, wrong)
    }
}

/// a / b: with q the rounded quotient, q·|b| is compared with a or, below 0, −a.
fn div(b: &mut Builder<'_>, x: NodeId, y: NodeId, side: Side, p: Precision) -> NodeId {
    let quotient = b.div(x, y);
    let one = b.real(1.0);
    let sign = b.copysign(one, y);
    let (x, y) = (b.mul(x, sign), b.abs(y));
    let wrong = side.other().product_beyond(b, quotient, y, x, p);
    side.corrected(b, quotient, wrong)
}

/// √a: the square of the rounded root is compared with a.
fn sqrt(b: &mut Builder<'_>, x: NodeId, side: Side, p: Precision) -> NodeId {
    let root = b.sqrt(x);
    let wrong = side.other().product_beyond(b, root, root, x, p);
    side.corrected_size(b, root, wrong)
}

/// Reference evaluation, by other means: fused multiplication and, in f32, arithmetic in f64.
struct Nearest {
    side: Side,
    single: bool,
}

impl Nearest {
    fn round(&self, x: f64) -> f64 {
        if self.single { f64::from(x as f32) } else { x }
    }

    /// `x`, or the number next to it on the side if `wrong`.
    fn corrected(&self, x: f64, wrong: bool) -> Value {
        let next = match (wrong, self.side, self.single) {
            (false, ..) => x,
            (true, Side::Up, false) => x.next_up(),
            (true, Side::Up, true) => f64::from((x as f32).next_up()),
            (true, Side::Down, false) => x.next_down(),
            (true, Side::Down, true) => f64::from((x as f32).next_down()),
        };
        Value::Real(next)
    }

    /// Whether a·b lies beyond c on this side.
    fn product_beyond(&self, side: Side, a: f64, b: f64, c: f64) -> bool {
        let (a, c) = if side == Side::Up { (-a, -c) } else { (a, c) };
        if self.single { a * b < c } else { product_less(a, b, c) }
    }

    /// With the larger operand first, s − a is exact (Dekker 1971), and b − (s − a) the error.
    fn add(&self, a: f64, b: f64) -> Value {
        let sum = if self.single { f64::from(a as f32 + b as f32) } else { a + b };
        let (large, small) = if a.abs() < b.abs() { (b, a) } else { (a, b) };
        let second = sum - large;
        self.corrected(sum, if self.side == Side::Up { second < small } else { small < second })
    }

    fn mul(&self, a: f64, b: f64) -> Value {
        let product = self.round(a * b);
        let product = if product.is_nan() { 0.0 } else { product };
        self.corrected(product, self.product_beyond(self.side, a, b, product))
    }

    fn div(&self, a: f64, b: f64) -> Value {
        let quotient = if self.single { f64::from(a as f32 / b as f32) } else { a / b };
        let a = if b.is_sign_negative() { -a } else { a };
        self.corrected(quotient, self.product_beyond(self.side.other(), quotient, b.abs(), a))
    }

    fn sqrt(&self, a: f64) -> Value {
        let root = if self.single { f64::from((a as f32).sqrt()) } else { a.sqrt() };
        self.corrected(root, self.product_beyond(self.side.other(), root, root, a))
    }
}

/// The evaluation of a directed operation by [`Nearest`].
macro_rules! nearest {
    ($side:ident, $method:ident, $($x:ident),+) => {
        Eval {
            f64: |v| match v {
                [$(Value::Real($x)),+] => Nearest { side: Side::$side, single: false }.$method($(*$x),+),
                _ => Value::Real(f64::NAN),
            },
            f32: |v| match v {
                [$(Value::Real($x)),+] => Nearest { side: Side::$side, single: true }.$method($(*$x),+),
                _ => Value::Real(f64::NAN),
            },
        }
    };
}

pub const ADD_DOWN: OpDef = directed(
    "add_down",
    "the largest number up to a + b",
    &real::ADD,
    real::ADD.derivative,
    nearest!(Down, add, a, b),
    11,
    fragment!(|b, [x, y], p| add(b, x, y, Side::Down, p)),
);

pub const ADD_UP: OpDef = directed(
    "add_up",
    "the least number from a + b",
    &real::ADD,
    real::ADD.derivative,
    nearest!(Up, add, a, b),
    11,
    fragment!(|b, [x, y], p| add(b, x, y, Side::Up, p)),
);

pub const MUL_DOWN: OpDef = directed(
    "mul_down",
    "the largest number up to a·b, with 0·∞ = 0",
    &real::MUL,
    real::MUL.derivative,
    nearest!(Down, mul, a, b),
    19,
    fragment!(|b, [x, y], p| mul(b, x, y, Side::Down, p)),
);

pub const MUL_UP: OpDef = directed(
    "mul_up",
    "the least number from a·b, with 0·∞ = 0",
    &real::MUL,
    real::MUL.derivative,
    nearest!(Up, mul, a, b),
    19,
    fragment!(|b, [x, y], p| mul(b, x, y, Side::Up, p)),
);

pub const DIV_DOWN: OpDef = directed(
    "div_down",
    "the largest number up to a / b",
    &real::DIV,
    real::DIV.derivative,
    nearest!(Down, div, a, b),
    24,
    fragment!(|b, [x, y], p| div(b, x, y, Side::Down, p)),
);

pub const DIV_UP: OpDef = directed(
    "div_up",
    "the least number from a / b",
    &real::DIV,
    real::DIV.derivative,
    nearest!(Up, div, a, b),
    24,
    fragment!(|b, [x, y], p| div(b, x, y, Side::Up, p)),
);

pub const SQRT_DOWN: OpDef = directed(
    "sqrt_down",
    "the largest number up to √a",
    &real::SQRT,
    real::SQRT.derivative,
    nearest!(Down, sqrt, a),
    21,
    fragment!(|b, [x], p| sqrt(b, x, Side::Down, p)),
);

pub const SQRT_UP: OpDef = directed(
    "sqrt_up",
    "the least number from √a",
    &real::SQRT,
    real::SQRT.derivative,
    nearest!(Up, sqrt, a),
    21,
    fragment!(|b, [x], p| sqrt(b, x, Side::Up, p)),
);
