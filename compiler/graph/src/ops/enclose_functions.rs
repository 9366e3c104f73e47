//! What encloses transcendental functions (LANGUAGE 15.4 to 15.6). A kernel's result is moved outward by more than the
//! error it may have (17.4); where a function turns, and where its domain ends, is decided here without error. Knows
//! nothing of how kernels compute, and not the precision.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use super::{Op, enclose};
use crate::{Builder, NodeId, Range};

/// Steps that cover the error of a kernel (2 ulp in f32, 4 in f64).
const STEPS: u32 = 4;

/// As far as kernels keep their promise for `sin`, `cos` and `tan`.
const LAST: f64 = 8192.0;

/// `x` as a lower end.
fn lower(b: &mut Builder<'_>, x: NodeId) -> NodeId {
    (0..STEPS).fold(x, |x, _| b.next_down(x))
}

/// `x` as an upper end.
fn upper(b: &mut Builder<'_>, x: NodeId) -> NodeId {
    (0..STEPS).fold(x, |x, _| b.next_up(x))
}

/// A bound that a function does not pass, rounded outward if it is not a number of both precisions.
fn bound(b: &mut Builder<'_>, x: f64) -> NodeId {
    let near = b.real(x);
    match (x.fract() == 0.0 || x.is_infinite(), x > 0.0) {
        (true, _) => near,
        (false, true) => b.next_up(near),
        (false, false) => b.next_down(near),
    }
}

/// From `lo` to `hi`, cut to what the function's values can be.
fn cut(b: &mut Builder<'_>, lo: NodeId, hi: NodeId, values: (f64, f64)) -> (NodeId, NodeId) {
    let lo = if values.0 == f64::NEG_INFINITY {
        lo
    } else {
        let least = bound(b, values.0);
        b.max(lo, least)
    };
    let hi = if values.1 == f64::INFINITY {
        hi
    } else {
        let most = bound(b, values.1);
        b.min(hi, most)
    };
    (lo, hi)
}

/// A function that only rises or only falls.
struct Monotone {
    /// The function.
    op: Op,
    /// Where it is defined.
    domain: (f64, f64),
    /// Between what its values lie.
    values: (f64, f64),
    /// Whether it falls.
    falls: bool,
}

const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

impl Monotone {
    /// One that rises from −∞ to ∞ and is defined everywhere.
    const fn rising(op: Op) -> Self {
        Self { op, domain: ALL, values: ALL, falls: false }
    }

    /// Defined only there.
    const fn defined(self, least: f64, most: f64) -> Self {
        Self { domain: (least, most), ..self }
    }

    /// With values only there.
    const fn between(self, least: f64, most: f64) -> Self {
        Self { values: (least, most), ..self }
    }

    /// Falling instead.
    const fn falling(self) -> Self {
        Self { falls: true, ..self }
    }

    /// What encloses its value: both ends, of what is left of the operand on the domain.
    fn enclose(&self, b: &mut Builder<'_>, x: Range) -> Range {
        let Defined { lo, hi, outside, none } = Defined::of(b, x, self.domain);
        let (from, to) = if self.falls { (hi, lo) } else { (lo, hi) };
        let (from, to) = (b.op(self.op, &[from]), b.op(self.op, &[to]));
        let (from, to) = (lower(b, from), upper(b, to));
        let (lo, hi) = cut(b, from, to, self.values);
        let Some((outside, none)) = outside.zip(none) else {
            return Range { lo, hi, nan: x.nan, tidy: true };
        };
        let nan = b.or(x.nan, outside);
        enclose::cut(b, none, lo, hi, nan)
    }
}

/// What a domain leaves of an operand.
struct Defined {
    lo: NodeId,
    hi: NodeId,
    /// Whether some of the operand lies outside, if the domain has an end.
    outside: Option<NodeId>,
    /// Whether all of it does.
    none: Option<NodeId>,
}

impl Defined {
    fn of(b: &mut Builder<'_>, x: Range, domain: (f64, f64)) -> Self {
        let mut left = Self { lo: x.lo, hi: x.hi, outside: None, none: None };
        if domain.0 != f64::NEG_INFINITY {
            let least = b.real(domain.0);
            left.lo = b.max(x.lo, least);
            let (outside, none) = (b.lt(x.lo, least), b.lt(x.hi, least));
            left.add(b, outside, none);
        }
        if domain.1 != f64::INFINITY {
            let most = b.real(domain.1);
            left.hi = b.min(x.hi, most);
            let (outside, none) = (b.lt(most, x.hi), b.lt(most, x.lo));
            left.add(b, outside, none);
        }
        left
    }

    fn add(&mut self, b: &mut Builder<'_>, outside: NodeId, none: NodeId) {
        self.outside = Some(self.outside.map_or(outside, |other| b.or(other, outside)));
        self.none = Some(self.none.map_or(none, |other| b.or(other, none)));
    }
}

/// Even, and rising with the magnitude.
pub fn cosh(b: &mut Builder<'_>, x: Range) -> Range {
    let (least, most) = enclose::magnitudes(b, x);
    let (lo, hi) = (b.op(Op::Cosh, &[least]), b.op(Op::Cosh, &[most]));
    let (lo, hi) = (lower(b, lo), upper(b, hi));
    let (lo, hi) = cut(b, lo, hi, (1.0, f64::INFINITY));
    Range { lo, hi, nan: x.nan, tidy: true }
}

/// Whether the ends lie where kernels keep their promise, and whether one is infinite, where there is no value.
fn reach(b: &mut Builder<'_>, x: Range) -> (NodeId, NodeId) {
    let (least, most) = (b.real(-LAST), b.real(LAST));
    let (from, to) = (b.le(least, x.lo), b.le(x.hi, most));
    let near = b.and(from, to);
    let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
    let (from, to) = (b.eq(x.lo, least), b.eq(x.hi, most));
    (near, b.or(from, to))
}

/// A wave falls and rises in turn. On which piece x lies is known without error: the sign of the slope (a kernel of small
/// relative error) says whether it is a rising one, and of those the nearest is ¼ period closer than the next, which no
/// rounding of x/2π bridges.
pub fn sin(b: &mut Builder<'_>, x: Range) -> Range {
    wave(b, x, Op::Sin, 0.0, |b, x| {
        let (zero, slope) = (b.real(0.0), b.cos(x));
        b.lt(zero, slope)
    })
}

/// cos x = sin(x + π/2).
pub fn cos(b: &mut Builder<'_>, x: Range) -> Range {
    wave(b, x, Op::Cos, 0.25, |b, x| {
        let (zero, slope) = (b.real(0.0), b.sin(x));
        b.lt(slope, zero)
    })
}

/// The wave that rises through 0 where x/2π + `phase` is an integer; `rises` says whether it does at x.
fn wave(b: &mut Builder<'_>, x: Range, op: Op, phase: f64, rises: fn(&mut Builder<'_>, NodeId) -> NodeId) -> Range {
    let (near, infinite) = reach(b, x);
    let rising = rises(b, x.lo);
    let (from, to) = (piece(b, x.lo, phase, rising), {
        let rising = rises(b, x.hi);
        piece(b, x.hi, phase, rising)
    });
    let periods = b.sub(to, from);
    let (half, one, minus) = (b.real(0.5), b.real(1.0), b.real(-1.0));
    let (turns, whole) = (b.le(half, periods), b.le(one, periods));
    let falling = b.not(rising);
    let (top, bottom) = (b.and(turns, rising), b.and(turns, falling));
    let (top, bottom) = (b.or(top, whole), b.or(bottom, whole));
    let far = b.not(near);
    let (top, bottom) = (b.or(top, far), b.or(bottom, far));

    let (from, to) = (b.op(op, &[x.lo]), b.op(op, &[x.hi]));
    let (lo, hi) = (b.min(from, to), b.max(from, to));
    let (lo, hi) = (lower(b, lo), upper(b, hi));
    let (lo, hi) = cut(b, lo, hi, (-1.0, 1.0));
    let (lo, hi) = (b.select(bottom, minus, lo), b.select(top, one, hi));
    Range { lo, hi, nan: b.or(x.nan, infinite), tidy: true }
}

/// A number of the monotone piece on which x lies, ½ more with each.
fn piece(b: &mut Builder<'_>, x: NodeId, phase: f64, rising: NodeId) -> NodeId {
    let (periods, phase) = (b.real(0.5 * FRAC_1_PI), b.real(phase));
    let (half, zero) = (b.real(0.5), b.real(0.0));
    let shift = b.select(rising, half, zero);
    let place = b.mul(x, periods);
    let place = b.add(place, phase);
    let place = b.add(place, shift);
    let whole = b.floor(place);
    b.sub(whole, shift)
}

/// Rises between poles. The sign of the tangent says on which side of its 0 x lies, so between which poles is known
/// without error.
pub fn tan(b: &mut Builder<'_>, x: Range) -> Range {
    let (near, infinite) = reach(b, x);
    let (from, to) = (b.op(Op::Tan, &[x.lo]), b.op(Op::Tan, &[x.hi]));
    let (left, right) = (branch(b, x.lo, from), branch(b, x.hi, to));
    let same = b.eq(left, right);
    let known = b.and(same, near);
    let (lo, hi) = (lower(b, from), upper(b, to));
    let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
    let (lo, hi) = (b.select(known, lo, least), b.select(known, hi, most));
    Range { lo, hi, nan: b.or(x.nan, infinite), tidy: true }
}

/// ⌊x/π⌉ by the sign of tan x.
fn branch(b: &mut Builder<'_>, x: NodeId, tangent: NodeId) -> NodeId {
    let (zero, quarter, more, inverse) = (b.real(0.0), b.real(0.25), b.real(0.75), b.real(FRAC_1_PI));
    let negative = b.lt(tangent, zero);
    let shift = b.select(negative, more, quarter);
    let place = b.mul(x, inverse);
    let place = b.add(place, shift);
    b.floor(place)
}

/// The angle turns one way along each edge of a box that misses the cut, and from the signs follows which way: so two
/// corners are all.
pub fn atan2(b: &mut Builder<'_>, y: Range, x: Range) -> Range {
    let zero = b.real(0.0);
    let (from_right, to_right) = (b.lt(zero, x.lo), b.lt(zero, x.hi));
    let (up, down) = (b.lt(zero, y.hi), b.lt(y.lo, zero));

    // Above the axis the angle is largest on the left, below on the right; on the right it is largest at the top.
    let along = b.select(up, x.lo, x.hi);
    let right = b.select_bool(up, from_right, to_right);
    let across = b.select(right, y.hi, y.lo);
    let hi = b.op(Op::Atan2, &[across, along]);
    let along = b.select(down, x.lo, x.hi);
    let right = b.select_bool(down, from_right, to_right);
    let across = b.select(right, y.lo, y.hi);
    let lo = b.op(Op::Atan2, &[across, along]);

    let (lo, hi) = (lower(b, lo), upper(b, hi));
    let (lo, hi) = cut(b, lo, hi, (-PI, PI));
    let (least, most) = (bound(b, -PI), bound(b, PI));
    let (from_left, from_below, to_above) = (b.le(x.lo, zero), b.le(y.lo, zero), b.le(zero, y.hi));
    let level = b.and(from_below, to_above);
    let meets = b.and(from_left, level);
    let (lo, hi) = (b.select(meets, least, lo), b.select(meets, most, hi));
    Range { lo, hi, nan: b.or(y.nan, x.nan), tidy: true }
}

/// x^y is monotone in each operand for x ≥ 0, so its extremes are corners; also those of infinite operands and of 0⁰, by
/// the special cases of `pow`. For one integer y it is even or odd in x; else a negative base may have no power at all.
pub fn pow(b: &mut Builder<'_>, x: Range, y: Range) -> Range {
    let (zero, half) = (b.real(0.0), b.real(0.5));
    let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
    let size = b.abs(y.lo);
    let (one, whole, finite) = (b.eq(y.lo, y.hi), integral(b, y.lo), b.lt(size, most));
    let one = b.and(one, finite);
    let integer = b.and(one, whole);
    let halved = b.mul(y.lo, half);
    let even = integral(b, halved);
    let even = b.and(integer, even);

    // 1/−0 would be −∞ in the place of ∞.
    let (from, to) = (b.add(x.lo, zero), b.add(x.hi, zero));
    let (near, far) = enclose::magnitudes(b, x);
    let (from, to) = (b.select(even, near, from), b.select(even, far, to));
    let corners = [(from, y.lo), (from, y.hi), (to, y.lo), (to, y.hi)].map(|(x, y)| b.pow(x, y));
    let [first, others @ ..] = corners;
    let lo = others.iter().fold(first, |a, c| b.min(a, *c));
    let hi = others.iter().fold(first, |a, c| b.max(a, *c));
    let (lo, hi) = (lower(b, lo), upper(b, hi));
    let (positive, cut) = (b.le(zero, from), b.max(lo, zero));
    let lo = b.select(positive, cut, lo);

    let negative = b.lt(x.lo, zero);
    let other = b.not(integer);
    let undefined = b.and(negative, other);
    // An odd negative power of both signs has a pole between.
    let (odd, reaches, inverse) = (b.not(even), b.le(zero, x.hi), b.lt(y.lo, zero));
    let pole = b.and(odd, reaches);
    let pole = b.and(pole, inverse);
    let pole = b.and(pole, negative);
    let unknown = b.or(undefined, pole);
    let (lo, hi) = (b.select(unknown, least, lo), b.select(unknown, most, hi));

    let last = b.floor(y.hi);
    let (below, between) = (b.lt(x.hi, zero), b.lt(last, y.lo));
    let none = b.and(below, between);
    let nan = b.or(x.nan, y.nan);
    let nan = b.or(nan, undefined);
    enclose::cut(b, none, lo, hi, nan)
}

fn integral(b: &mut Builder<'_>, x: NodeId) -> NodeId {
    let whole = b.floor(x);
    b.eq(whole, x)
}

/// Rules of functions that rise or fall throughout.
macro_rules! monotone {
    ($( $name:ident $shape:expr; )+) => {
        $( pub fn $name(b: &mut Builder<'_>, x: Range) -> Range {
            const SHAPE: Monotone = $shape;
            SHAPE.enclose(b, x)
        } )+
    };
}

monotone! {
    exp Monotone::rising(Op::Exp).between(0.0, f64::INFINITY);
    exp2 Monotone::rising(Op::Exp2).between(0.0, f64::INFINITY);
    log Monotone::rising(Op::Log).defined(0.0, f64::INFINITY);
    log2 Monotone::rising(Op::Log2).defined(0.0, f64::INFINITY);
    asin Monotone::rising(Op::Asin).defined(-1.0, 1.0).between(-FRAC_PI_2, FRAC_PI_2);
    acos Monotone::rising(Op::Acos).defined(-1.0, 1.0).between(0.0, PI).falling();
    atan Monotone::rising(Op::Atan).between(-FRAC_PI_2, FRAC_PI_2);
    sinh Monotone::rising(Op::Sinh);
    tanh Monotone::rising(Op::Tanh).between(-1.0, 1.0);
    asinh Monotone::rising(Op::Asinh);
    acosh Monotone::rising(Op::Acosh).defined(1.0, f64::INFINITY).between(0.0, f64::INFINITY);
    atanh Monotone::rising(Op::Atanh).defined(-1.0, 1.0);
    softplus Monotone::rising(Op::Softplus).between(0.0, f64::INFINITY);
    sigmoid Monotone::rising(Op::Sigmoid).between(0.0, 1.0);
}
