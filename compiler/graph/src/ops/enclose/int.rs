//! Interval rules of ints and of the bits of reals, "in wide arithmetic" (LANGUAGE 15.4): by 32-bit operations that
//! notice when a wider result would not fit. They know nothing of the precision of `real`.

use super::{Ints, Truth, magnitudes};
use crate::{Builder, NodeId, Op, Range};

impl Builder<'_> {
    fn imin(&mut self, x: NodeId, y: NodeId) -> NodeId {
        self.op(Op::IntMin, &[x, y])
    }

    fn imax(&mut self, x: NodeId, y: NodeId) -> NodeId {
        self.op(Op::IntMax, &[x, y])
    }

    fn ile(&mut self, x: NodeId, y: NodeId) -> NodeId {
        self.op(Op::IntLe, &[x, y])
    }

    fn irem(&mut self, x: NodeId, y: NodeId) -> NodeId {
        self.op(Op::IntRem, &[x, y])
    }

    fn differ(&mut self, p: NodeId, q: NodeId) -> NodeId {
        let not_q = self.not(q);
        self.select_bool(p, not_q, q)
    }
}

/// From `lo` to `hi`, or every int if a result does not fit.
fn fitting(b: &mut Builder<'_>, overflow: NodeId, lo: NodeId, hi: NodeId) -> Ints {
    let (least, most) = (b.int(i32::MIN), b.int(i32::MAX));
    Ints { lo: b.select_int(overflow, least, lo), hi: b.select_int(overflow, most, hi) }
}

fn zero_in(b: &mut Builder<'_>, x: Ints) -> NodeId {
    let zero = b.int(0);
    let (below, above) = (b.ile(x.lo, zero), b.ile(zero, x.hi));
    b.and(below, above)
}

/// Both ends of an operation that never falls.
pub fn ends(b: &mut Builder<'_>, op: Op, x: Ints) -> Ints {
    Ints { lo: b.op(op, &[x.lo]), hi: b.op(op, &[x.hi]) }
}

/// Ends pairwise.
pub fn pairwise(b: &mut Builder<'_>, op: Op, x: Ints, y: Ints) -> Ints {
    Ints { lo: b.op(op, &[x.lo, y.lo]), hi: b.op(op, &[x.hi, y.hi]) }
}

pub fn add(b: &mut Builder<'_>, x: Ints, y: Ints) -> Ints {
    // p + q < p is q < 0 unless the sum wraps.
    let sum = |b: &mut Builder<'_>, p: NodeId, q: NodeId| {
        let zero = b.int(0);
        let r = b.iadd(p, q);
        let (falls, fell) = (b.ilt(q, zero), b.ilt(r, p));
        (r, b.differ(falls, fell))
    };
    let ((lo, below), (hi, above)) = (sum(b, x.lo, y.lo), sum(b, x.hi, y.hi));
    let overflow = b.or(below, above);
    fitting(b, overflow, lo, hi)
}

pub fn sub(b: &mut Builder<'_>, x: Ints, y: Ints) -> Ints {
    // p − q < p is 0 < q unless the difference wraps.
    let difference = |b: &mut Builder<'_>, p: NodeId, q: NodeId| {
        let zero = b.int(0);
        let r = b.isub(p, q);
        let (falls, fell) = (b.ilt(zero, q), b.ilt(r, p));
        (r, b.differ(falls, fell))
    };
    let ((lo, below), (hi, above)) = (difference(b, x.lo, y.hi), difference(b, x.hi, y.lo));
    let overflow = b.or(below, above);
    fitting(b, overflow, lo, hi)
}

/// The hull of the products; as for reals, the sign of an end of Y says which end of X gives the least product.
pub fn mul(b: &mut Builder<'_>, x: Ints, y: Ints) -> Ints {
    // q·p / p is q unless the product wraps; only −2³¹·−1 = −2³¹ deceives.
    let product = |b: &mut Builder<'_>, p: NodeId, q: NodeId| {
        let (zero, minus, least) = (b.int(0), b.int(-1), b.int(i32::MIN));
        let r = b.imul(p, q);
        let again = b.idiv(r, p);
        let (same, nothing) = (b.ieq(again, q), b.ieq(p, zero));
        let fits = b.or(same, nothing);
        let (minus, least) = (b.ieq(p, minus), b.ieq(q, least));
        let (wraps, deceives) = (b.not(fits), b.and(minus, least));
        (r, b.or(wraps, deceives))
    };
    let at = |b: &mut Builder<'_>, q: NodeId| {
        let zero = b.int(0);
        let rises = b.ile(zero, q);
        let (p_lo, p_hi) = (b.select_int(rises, x.lo, x.hi), b.select_int(rises, x.hi, x.lo));
        let ((lo, below), (hi, above)) = (product(b, p_lo, q), product(b, p_hi, q));
        (lo, hi, b.or(below, above))
    };
    let ((lo, hi, wraps), (lo_too, hi_too, wraps_too)) = (at(b, y.lo), at(b, y.hi));
    let (lo, hi, overflow) = (b.imin(lo, lo_too), b.imax(hi, hi_too), b.or(wraps, wraps_too));
    fitting(b, overflow, lo, hi)
}

pub fn neg(b: &mut Builder<'_>, x: Ints) -> Ints {
    let least = b.int(i32::MIN);
    let overflow = b.ieq(x.lo, least);
    let (lo, hi) = (b.op(Op::IntNeg, &[x.hi]), b.op(Op::IntNeg, &[x.lo]));
    fitting(b, overflow, lo, hi)
}

pub fn abs(b: &mut Builder<'_>, x: Ints) -> Ints {
    let (zero, least) = (b.int(0), b.int(i32::MIN));
    let overflow = b.ieq(x.lo, least);
    let (below, above) = (b.op(Op::IntNeg, &[x.lo]), b.op(Op::IntNeg, &[x.hi]));
    let right = b.imax(zero, x.lo);
    let (lo, hi) = (b.imax(right, above), b.imax(below, x.hi));
    fitting(b, overflow, lo, hi)
}

/// The hull of the quotients by the positive and by the negative part of Y, and x / 0 = 0.
pub fn div(b: &mut Builder<'_>, x: Ints, y: Ints) -> Ints {
    let (zero, one, minus) = (b.int(0), b.int(1), b.int(-1));
    let (least, most) = (b.int(i32::MIN), b.int(i32::MAX));
    // Over a part of Y that runs from `near` 0 to `far`, the end of X says at which of them its quotient is extreme.
    let (low_up, high_up) = (b.ile(zero, x.lo), b.ile(zero, x.hi));
    let (near, far) = (b.imax(one, y.lo), b.imax(one, y.hi));
    let (by_lo, by_hi) = (b.select_int(low_up, far, near), b.select_int(high_up, near, far));
    let (lo, hi) = (b.idiv(x.lo, by_lo), b.idiv(x.hi, by_hi));
    let (near, far) = (b.imin(minus, y.hi), b.imin(minus, y.lo));
    let (by_lo, by_hi) = (b.select_int(high_up, near, far), b.select_int(low_up, far, near));
    let (lo_too, hi_too) = (b.idiv(x.hi, by_lo), b.idiv(x.lo, by_hi));

    let (positive, negative, nothing) = (b.ilt(zero, y.hi), b.ilt(y.lo, zero), zero_in(b, y));
    let (lo, hi) = (b.select_int(positive, lo, most), b.select_int(positive, hi, least));
    let (lo_too, hi_too) = (b.select_int(negative, lo_too, most), b.select_int(negative, hi_too, least));
    let (lo, hi) = (b.imin(lo, lo_too), b.imax(hi, hi_too));
    let (by_zero_lo, by_zero_hi) = (b.select_int(nothing, zero, most), b.select_int(nothing, zero, least));
    let (lo, hi) = (b.imin(lo, by_zero_lo), b.imax(hi, by_zero_hi));

    let (lowest, before, after) = (b.ieq(x.lo, least), b.ile(y.lo, minus), b.ile(minus, y.hi));
    let by_minus = b.and(before, after);
    let overflow = b.and(lowest, by_minus);
    fitting(b, overflow, lo, hi)
}

/// Between 0 and the divisor, which is left out; both ends if the divisor is a point and both have one quotient.
pub fn rem(b: &mut Builder<'_>, x: Ints, y: Ints) -> Ints {
    let (zero, one, minus) = (b.int(0), b.int(1), b.int(-1));
    let (below, above) = (b.imin(minus, y.lo), b.imax(one, y.hi));
    let (lo, hi) = (b.iadd(below, one), b.isub(above, one));
    let (first, last) = (b.irem(x.lo, y.lo), b.irem(x.hi, y.lo));
    // Within one period, and nowhere else, the ends are in order and as far apart as their remainders. That the
    // distances may wrap does not matter: they are less than 2³² and differ by a multiple of the divisor.
    let (apart, left) = (b.isub(x.hi, x.lo), b.isub(last, first));
    let (point, equal, order, undefined) =
        (b.ieq(y.lo, y.hi), b.ieq(apart, left), b.ile(first, last), b.ieq(y.lo, zero));
    let (period, regular) = (b.and(equal, order), b.not(undefined));
    let smooth = b.and(point, period);
    let smooth = b.and(smooth, regular);
    Ints { lo: b.select_int(smooth, first, lo), hi: b.select_int(smooth, last, hi) }
}

pub fn eq(b: &mut Builder<'_>, x: Ints, y: Ints) -> Truth {
    let (left, right) = (b.ile(x.lo, y.hi), b.ile(y.lo, x.hi));
    let (touch, touch_too) = (b.ieq(x.lo, y.hi), b.ieq(x.hi, y.lo));
    let surely = b.and(touch, touch_too);
    Truth { yes: b.and(left, right), no: b.not(surely) }
}

pub fn lt(b: &mut Builder<'_>, x: Ints, y: Ints) -> Truth {
    Truth { yes: b.ilt(x.lo, y.hi), no: b.ile(y.lo, x.hi) }
}

pub fn le(b: &mut Builder<'_>, x: Ints, y: Ints) -> Truth {
    Truth { yes: b.ile(x.lo, y.hi), no: b.ilt(y.lo, x.hi) }
}

/// Both ends, moved outward where the nearest real lies inside: the int itself is enclosed too.
pub fn to_real(b: &mut Builder<'_>, x: Ints) -> Range {
    let (lo, hi) = (b.int_to_real(x.lo), b.int_to_real(x.hi));
    let (lo, hi) = (b.rounded_to_real(lo), b.rounded_to_real(hi));
    // The nearest real to 2³¹ − 1 may be 2³¹, which is no int.
    let beyond = b.real(2_147_483_648.0);
    let (whole_lo, whole_hi) = (b.real_to_int(lo), b.real_to_int(hi));
    let (above, out, below) = (b.ilt(x.lo, whole_lo), b.le(beyond, lo), b.ilt(whole_hi, x.hi));
    let above = b.or(above, out);
    let (less, more) = (b.next_down(lo), b.next_up(hi));
    let (lo, hi) = (b.select(above, less, lo), b.select(below, more, hi));
    Range { lo, hi, nan: b.bool(false), tidy: true }
}

/// Both ends, and 0 for NaN.
pub fn from_real(b: &mut Builder<'_>, a: Range) -> Ints {
    let zero = b.int(0);
    let (lo, hi) = (b.real_to_int(a.lo), b.real_to_int(a.hi));
    let (lo_too, hi_too) = (b.imin(lo, zero), b.imax(hi, zero));
    Ints { lo: b.select_int(a.nan, lo_too, lo), hi: b.select_int(a.nan, hi_too, hi) }
}

/// Rises with |a|; NaN has the exponent of ∞.
pub fn exponent(b: &mut Builder<'_>, a: Range) -> Ints {
    let (least, most) = magnitudes(b, a);
    let endless = b.real(f64::INFINITY);
    let most = b.select(a.nan, endless, most);
    Ints { lo: b.exponent(least), hi: b.exponent(most) }
}

/// Products with the powers of 2, which are normal numbers; the sign of an end of A says with which.
pub fn scale(b: &mut Builder<'_>, a: Range, n: Ints) -> Range {
    let (zero, one) = (b.real(0.0), b.real(1.0));
    let (small, large) = (b.scale(one, n.lo), b.scale(one, n.hi));
    let (right, left) = (b.le(zero, a.lo), b.le(a.hi, zero));
    let (by_lo, by_hi) = (b.select(right, small, large), b.select(left, small, large));
    Range { lo: b.mul_down(a.lo, by_lo), hi: b.mul_up(a.hi, by_hi), nan: a.nan, tidy: true }
}
