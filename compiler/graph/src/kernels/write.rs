//! A notation for kernels: handles to nodes with the usual operators, so that a kernel reads as its formula. Knows the
//! operations of the table that kernels may use, and no function in particular.

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::{Builder, NodeId, Op, Precision};

/// Where handles put their nodes.
pub trait Tape {
    fn precision(&self) -> Precision;
    fn op(&self, op: Op, args: &[NodeId]) -> NodeId;
    fn real(&self, x: f64) -> NodeId;
    fn int(&self, x: i32) -> NodeId;
}

struct Writer<'b, 'w> {
    builder: RefCell<&'b mut Builder<'w>>,
    precision: Precision,
}

impl Tape for Writer<'_, '_> {
    fn precision(&self) -> Precision {
        self.precision
    }

    fn op(&self, op: Op, args: &[NodeId]) -> NodeId {
        self.builder.borrow_mut().op(op, args)
    }

    fn real(&self, x: f64) -> NodeId {
        self.builder.borrow_mut().real(self.precision.round(x))
    }

    fn int(&self, x: i32) -> NodeId {
        self.builder.borrow_mut().int(x)
    }
}

/// Writes a kernel of `N` arguments; `NONE` if there are not so many.
pub fn write<const N: usize>(
    builder: &mut Builder<'_>,
    args: &[NodeId],
    precision: Precision,
    kernel: impl for<'k> FnOnce([Real<'k>; N]) -> Real<'k>,
) -> NodeId {
    let Ok(args) = <[NodeId; N]>::try_from(args) else { return NodeId::NONE };
    let writer = Writer { builder: RefCell::new(builder), precision };
    kernel(args.map(|id| Real { tape: &writer, id })).id
}

/// A real of the kernel being written.
#[derive(Clone, Copy)]
pub struct Real<'k> {
    tape: &'k dyn Tape,
    id: NodeId,
}

/// A truth value of the kernel being written.
#[derive(Clone, Copy)]
pub struct Truth<'k> {
    tape: &'k dyn Tape,
    id: NodeId,
}

/// An int of the kernel being written.
#[derive(Clone, Copy)]
pub struct Int<'k> {
    tape: &'k dyn Tape,
    id: NodeId,
}

/// An operand: a real, or a constant, which is rounded to the precision.
pub trait Operand<'k> {
    fn id(self, tape: &'k dyn Tape) -> NodeId;
}

impl<'k> Operand<'k> for Real<'k> {
    fn id(self, _: &'k dyn Tape) -> NodeId {
        self.id
    }
}

impl<'k> Operand<'k> for f64 {
    fn id(self, tape: &'k dyn Tape) -> NodeId {
        tape.real(self)
    }
}

macro_rules! operators {
    ($( $trait:ident $name:ident $op:ident; )+) => { $(
        impl<'k, T: Operand<'k>> $trait<T> for Real<'k> {
            type Output = Real<'k>;
            fn $name(self, other: T) -> Real<'k> {
                self.with(Op::$op, other)
            }
        }
        impl<'k> $trait<Real<'k>> for f64 {
            type Output = Real<'k>;
            fn $name(self, other: Real<'k>) -> Real<'k> {
                other.constant(self).with(Op::$op, other)
            }
        }
    )+ };
}

operators! {
    Add add Add;
    Sub sub Sub;
    Mul mul Mul;
    Div div Div;
}

impl<'k> Neg for Real<'k> {
    type Output = Self;
    fn neg(self) -> Self {
        self.apply(Op::Neg)
    }
}

impl<'k> Real<'k> {
    fn apply(self, op: Op) -> Self {
        Self { tape: self.tape, id: self.tape.op(op, &[self.id]) }
    }

    fn with(self, op: Op, other: impl Operand<'k>) -> Self {
        let other = other.id(self.tape);
        Self { tape: self.tape, id: self.tape.op(op, &[self.id, other]) }
    }

    fn compare(self, op: Op, other: impl Operand<'k>) -> Truth<'k> {
        let other = other.id(self.tape);
        Truth { tape: self.tape, id: self.tape.op(op, &[self.id, other]) }
    }

    pub fn constant(self, x: f64) -> Self {
        Self { tape: self.tape, id: self.tape.real(x) }
    }

    /// One of two things, by the precision.
    pub fn by<T>(self, f32: T, f64: T) -> T {
        match self.tape.precision() {
            Precision::F32 => f32,
            Precision::F64 => f64,
        }
    }

    pub fn abs(self) -> Self {
        self.apply(Op::Abs)
    }

    pub fn sqrt(self) -> Self {
        self.apply(Op::Sqrt)
    }

    pub fn floor(self) -> Self {
        self.apply(Op::Floor)
    }

    /// `limit` if it is less, else `self`: NaN stays NaN.
    pub fn at_most(self, limit: f64) -> Self {
        self.with(Op::Min, limit)
    }

    /// `limit` if it is greater, else `self`: NaN stays NaN.
    pub fn at_least(self, limit: f64) -> Self {
        self.with(Op::Max, limit)
    }

    /// |self| with the sign of `other`.
    pub fn copysign(self, other: Self) -> Self {
        self.with(Op::Copysign, other)
    }

    pub fn less(self, other: impl Operand<'k>) -> Truth<'k> {
        self.compare(Op::Lt, other)
    }

    /// Whether limit ≤ self.
    pub fn reaches(self, limit: f64) -> Truth<'k> {
        self.constant(limit).compare(Op::Le, self)
    }

    pub fn equals(self, other: impl Operand<'k>) -> Truth<'k> {
        self.compare(Op::Eq, other)
    }

    pub fn differs(self, other: impl Operand<'k>) -> Truth<'k> {
        self.compare(Op::Ne, other)
    }

    /// ⌊log₂|self|⌋.
    pub fn exponent(self) -> Int<'k> {
        Int { tape: self.tape, id: self.tape.op(Op::Exponent, &[self.id]) }
    }

    /// self·2ⁿ, n cut to the exponents of normal numbers.
    pub fn scale(self, n: Int<'k>) -> Self {
        Self { tape: self.tape, id: self.tape.op(Op::Scale, &[self.id, n.id]) }
    }

    /// The int that equals this integral real.
    pub fn to_int(self) -> Int<'k> {
        Int { tape: self.tape, id: self.tape.op(Op::RealToInt, &[self.id]) }
    }

    /// The nearest integer, ties to even, for |self| < 2²² (f32), 2⁵¹ (f64): beside 1.5·2²³ (1.5·2⁵²) the unit in the
    /// last place is 1. What larger arguments give is integral or not finite.
    pub fn nearest(self) -> Self {
        let magic = self.by(12_582_912.0, 6_755_399_441_055_744.0);
        (self + magic) - magic
    }

    /// c₀ + c₁·self + c₂·self² + …, by Horner's rule.
    pub fn polynomial(self, coefficients: &[f64]) -> Self {
        let Some((last, rest)) = coefficients.split_last() else { return self.constant(0.0) };
        rest.iter().rev().fold(self.constant(*last), |sum, c| sum * self + *c)
    }

    /// The upper half of the digits, 12 of 24 or 26 of 53, rounded: self minus it is exact, and so is the product of two
    /// such halves (Veltkamp; Dekker 1971, eq. 5.7). NaN if |self| is within 2¹³ (2²⁸) of overflow.
    pub fn upper(self) -> Self {
        let shifted = self * self.by(4097.0, 134_217_729.0);
        shifted - (shifted - self)
    }
}

impl<'k> Truth<'k> {
    pub fn and(self, other: Self) -> Self {
        Self { tape: self.tape, id: self.tape.op(Op::And, &[self.id, other.id]) }
    }

    pub fn or(self, other: Self) -> Self {
        Self { tape: self.tape, id: self.tape.op(Op::Or, &[self.id, other.id]) }
    }

    pub fn select(self, then: impl Operand<'k>, otherwise: impl Operand<'k>) -> Real<'k> {
        let (then, otherwise) = (then.id(self.tape), otherwise.id(self.tape));
        Real { tape: self.tape, id: self.tape.op(Op::Select, &[self.id, then, otherwise]) }
    }
}

impl Sub for Int<'_> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { tape: self.tape, id: self.tape.op(Op::IntSub, &[self.id, other.id]) }
    }
}

impl<'k> Int<'k> {
    pub fn neg(self) -> Self {
        Self { tape: self.tape, id: self.tape.op(Op::IntNeg, &[self.id]) }
    }

    pub fn to_real(self) -> Real<'k> {
        Real { tape: self.tape, id: self.tape.op(Op::IntToReal, &[self.id]) }
    }
}
