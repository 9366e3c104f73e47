//! The formulas of LANGUAGE 14.3 in graph operations, each so that it and all its derivatives are right and finite
//! wherever the operands are. Knows nothing of the graph around them.
//!
//! `max(a, b)` is `b + w·sp((a−b)/w)`. The same function of the operands in order, `hi + w·sp((lo−hi)/w)`, loses no digits,
//! and because both orders give one function, so do their derivatives at ties, if `hi` and `lo` then are different
//! operands. Beyond [`FAR`] widths the smooth part has vanished in every precision, with all its derivatives: there, and
//! where nothing is finite, the exact operation stands, so that an operand which is out of the question cannot bring in
//! an infinite derivative either (LANGUAGE 13.7).

use std::fmt;

use isograd_graph::{Builder, NodeId, Op, Precision};

use super::literal;

/// In widths: e^−FAR is less than half of the least f64.
const FAR: f64 = 750.0;

/// The width of LANGUAGE 14.3 for a sensitivity of 1.
const UNIT: f64 = 1e-3;

/// How far from a kink or jump values are changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Width(f64);

/// A width that `real` cannot compute with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WidthError {
    /// The least sensitivity that is possible.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

impl fmt::Display for WidthError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the sensitivity must lie between {:e} and {:e}", self.least, self.most)
    }
}

impl std::error::Error for WidthError {}

impl Width {
    /// The width for a sensitivity in a precision: it, its inverse and the largest distance that it matters at must be
    /// normal numbers.
    ///
    /// # Errors
    /// If they are not.
    pub fn of(sensitivity: f64, precision: Precision) -> Result<Self, WidthError> {
        let (least, most) = match precision {
            Precision::F32 => (1e-34, 1e34),
            Precision::F64 => (1e-300, 1e300),
        };
        if (least..=most).contains(&sensitivity) {
            Ok(Self(UNIT * sensitivity))
        } else {
            Err(WidthError { least, most })
        }
    }

    /// The number, in the units of operands.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

/// The weight of a truth value, and what is left of 1, which has digits of its own where the weight is near 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Weight {
    pub yes: NodeId,
    pub no: NodeId,
}

impl Weight {
    /// `1 − s`
    pub const fn not(self) -> Self {
        Self { yes: self.no, no: self.yes }
    }
}

/// The formulas for one width.
#[derive(Debug, Clone, Copy)]
pub struct Formulas {
    width: f64,
    inverse: f64,
    far: f64,
}

impl Formulas {
    pub fn of(width: Width) -> Self {
        Self { width: width.0, inverse: 1.0 / width.0, far: FAR * width.0 }
    }

    /// x/w
    fn scaled(self, b: &mut Builder<'_>, x: NodeId) -> NodeId {
        let inverse = b.real(self.inverse);
        b.mul(x, inverse)
    }

    /// `w·sp(d/w)` for a d ≤ 0, and whether d is finite and not so far below 0 that this is 0.
    fn corner(self, b: &mut Builder<'_>, d: NodeId) -> (NodeId, NodeId) {
        let scaled = self.scaled(b, d);
        let (width, far) = (b.real(self.width), b.real(-self.far));
        let softplus = b.op(Op::Softplus, &[scaled]);
        (b.mul(width, softplus), b.lt(far, d))
    }

    /// Whether |d| is finite and not so large that a step has ended.
    fn is_near(self, b: &mut Builder<'_>, d: NodeId) -> NodeId {
        let (size, far) = (b.abs(d), b.real(self.far));
        b.lt(size, far)
    }

    /// `max(x, y) = hi + w·sp((lo−hi)/w)`, `min(x, y) = lo − w·sp((lo−hi)/w)`.
    pub fn extreme(self, b: &mut Builder<'_>, op: Op, x: NodeId, y: NodeId) -> NodeId {
        // With the operands exchanged, the other extreme is the other operand on ties, and NaN if one is.
        let (exact, other) = if op == Op::Max { (b.max(x, y), b.min(y, x)) } else { (b.min(x, y), b.max(y, x)) };
        let (hi, lo) = if op == Op::Max { (exact, other) } else { (other, exact) };
        let (difference, zero) = (b.sub(lo, hi), b.real(0.0));
        // Changes no value: an enclosure of the difference does not know that it is never positive.
        let difference = b.min(difference, zero);
        let (bump, near) = self.corner(b, difference);
        let smooth = if op == Op::Max { b.add(hi, bump) } else { b.sub(lo, bump) };
        b.select(near, smooth, exact)
    }

    /// `abs(x) = max(x, −x)`, where `lo` is `−hi`.
    pub fn abs(self, b: &mut Builder<'_>, x: NodeId) -> NodeId {
        let opposite = b.neg(x);
        let (size, zero) = (b.max(x, opposite), b.real(0.0));
        // Changes no value, as above.
        let size = b.max(size, zero);
        let minus_two = b.real(-2.0);
        let difference = b.mul(minus_two, size);
        let (bump, near) = self.corner(b, difference);
        let smooth = b.add(size, bump);
        b.select(near, smooth, size)
    }

    /// `tanh(x/w)`
    pub fn sign(self, b: &mut Builder<'_>, x: NodeId) -> NodeId {
        let near = self.is_near(b, x);
        let scaled = self.scaled(b, x);
        let (smooth, exact) = (b.op(Op::Tanh, &[scaled]), b.sign(x));
        b.select(near, smooth, exact)
    }

    /// `x < y` or `x ≤ y`: `σ((y−x)/w)`.
    pub fn less(self, b: &mut Builder<'_>, op: Op, x: NodeId, y: NodeId) -> Weight {
        let difference = b.sub(y, x);
        let near = self.is_near(b, difference);
        let exact = b.op(op, &[x, y]);
        let Weight { yes, no } = self.crisp(b, exact);
        let scaled = self.scaled(b, difference);
        let opposite = b.neg(scaled);
        let (share, rest) = (b.op(Op::Sigmoid, &[scaled]), b.op(Op::Sigmoid, &[opposite]));
        Weight { yes: b.select(near, share, yes), no: b.select(near, rest, no) }
    }

    /// The weight of a truth value that has none: 1 or 0.
    pub fn crisp(self, b: &mut Builder<'_>, truth: NodeId) -> Weight {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        match b.value(truth) {
            Some(isograd_graph::Value::Bool(true)) => Weight { yes: one, no: zero },
            Some(_) => Weight { yes: zero, no: one },
            None => Weight { yes: b.select(truth, one, zero), no: b.select(truth, zero, one) },
        }
    }

    /// Whether a weight is at least ½.
    pub fn truth(self, b: &mut Builder<'_>, weight: Weight) -> NodeId {
        let half = b.real(0.5);
        b.le(half, weight.yes)
    }

    /// `s·t`, and `1 − s·t = (1−s) + s·(1−t)`.
    pub fn both(self, b: &mut Builder<'_>, s: Weight, t: Weight) -> Weight {
        let only = b.mul(s.yes, t.no);
        Weight { yes: b.mul(s.yes, t.yes), no: b.add(s.no, only) }
    }

    /// `s·then + (1−s)·otherwise`, or the side that the truth value says.
    pub fn blend(self, b: &mut Builder<'_>, s: Weight, truth: NodeId, then: NodeId, otherwise: NodeId) -> NodeId {
        if then == otherwise {
            return then;
        }
        match (literal(b, then), literal(b, otherwise)) {
            (Some(1.0), Some(0.0)) => return s.yes,
            (Some(0.0), Some(1.0)) => return s.no,
            _ => {}
        }
        let (zero, infinity) = (b.real(0.0), b.real(f64::INFINITY));
        let mut both = b.lt(zero, s.yes);
        let left = b.lt(zero, s.no);
        both = b.and(both, left);
        for side in [then, otherwise] {
            let size = b.abs(side);
            let finite = b.lt(size, infinity);
            both = b.and(both, finite);
        }
        let (left, right) = (b.mul(s.yes, then), b.mul(s.no, otherwise));
        let (blended, chosen) = (b.add(left, right), b.select(truth, then, otherwise));
        b.select(both, blended, chosen)
    }
}
