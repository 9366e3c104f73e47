//! Intervals of f32 numbers, ends included, and their arithmetic on devices that round as a [`Model`] says. Knows nothing
//! of graphs and of decisions.
//!
//! Ends are f32 numbers held in f64: their products are exact there, their sums are with a second f64. An end is rounded
//! as a device may round it. As rounding is monotone, whatever it makes of numbers between the ends lies between the
//! rounded ends; and what is representable stays as it is, so exact operations have no error.

use super::Model;

/// All numbers from `lo` to `hi`; both finite, or both the same infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    pub lo: f64,
    pub hi: f64,
}

/// Why an operation has no interval.
pub type Lost = &'static str;

const LEAST: f64 = f32::MIN_POSITIVE as f64;
const MOST: f64 = f32::MAX as f64;

impl Interval {
    pub const fn point(x: f64) -> Self {
        Self { lo: x, hi: x }
    }

    /// The numbers from one to another, as they are on a device: subnormal ones may be 0 there.
    pub fn settled(lo: f64, hi: f64, model: &Model) -> Result<Self, Lost> {
        if lo.is_nan() || hi.is_nan() {
            return Err("NaN");
        }
        if lo < -MOST || hi > MOST {
            return Err("overflow");
        }
        let subnormal = lo < LEAST && hi > -LEAST && (lo != 0.0 || hi != 0.0);
        Ok(if model.flushes && subnormal { Self { lo: lo.min(0.0), hi: hi.max(0.0) } } else { Self { lo, hi } })
    }

    pub fn is_point(self) -> bool {
        self.lo == self.hi
    }

    pub fn is_zero(self) -> bool {
        self.lo == 0.0 && self.hi == 0.0
    }

    pub fn is_infinite(self) -> bool {
        self.lo.is_infinite() || self.hi.is_infinite()
    }

    pub fn contains(self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    pub fn middle(self) -> f64 {
        if self.is_point() { self.lo } else { f64::midpoint(self.lo, self.hi) }
    }

    pub fn width(self) -> f64 {
        if self.is_point() { 0.0 } else { self.hi - self.lo }
    }

    pub fn radius(self) -> f64 {
        0.5 * self.width()
    }

    /// How far a number of it lies from the middle; the ends are at 1.
    pub fn ratio(self, x: f64) -> f64 {
        if self.is_point() { 0.0 } else { (x - self.middle()).abs() / self.radius() }
    }

    /// Half the width in units in the last place of the middle.
    pub fn ulps(self) -> f64 {
        self.radius() / ulp(self.middle())
    }

    /// The largest and the smallest size of its numbers.
    pub fn size(self) -> Self {
        let (a, b) = (self.lo.abs(), self.hi.abs());
        Self { lo: if self.contains(0.0) { 0.0 } else { a.min(b) }, hi: a.max(b) }
    }

    pub const fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }

    /// The least that contains both.
    pub fn hull(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    pub fn add(self, other: Self, model: &Model) -> Result<Self, Lost> {
        finite([self, other])?;
        let (lo, below) = two_sum(self.lo, other.lo);
        let (hi, above) = two_sum(self.hi, other.hi);
        Self::settled(lower(lo, below, model), upper(hi, above, model), model)
    }

    pub fn mul(self, other: Self, model: &Model) -> Result<Self, Lost> {
        finite([self, other])?;
        let (lo, hi) = extremes(self, other, |a, b| a * b);
        Self::settled(lower(lo, 0.0, model), upper(hi, 0.0, model), model)
    }

    /// x·x, which is nowhere negative.
    pub fn square(self, model: &Model) -> Result<Self, Lost> {
        self.size().mul(self.size(), model)
    }

    /// A quotient; the divisor must be one that devices promise something about. 0 divided by such a number is 0: an
    /// error of 2.5 units in the last place of 0 is not even a subnormal number that is kept.
    pub fn div(self, other: Self, model: &Model) -> Result<Self, Lost> {
        finite([self, other])?;
        let size = other.size();
        if model.quotient == 0.0 {
            if other.contains(0.0) {
                return Err("division by 0");
            }
        } else if size.lo < LEAST || size.hi > 2_f64.powi(126) {
            return Err("division by what may be almost 0, or is huge");
        }
        if self.is_zero() {
            return Ok(Self::point(self.lo / other.lo));
        }
        let (lo, hi) = extremes(self, other, |a, b| a / b);
        let Self { lo, hi } = Self { lo, hi }.within(model.quotient * ulp(lo.abs().max(hi.abs())));
        Self::settled(lo, hi, model)
    }

    /// √x as 1 / inversesqrt(x): with a relative error of 2 · 2⁻²³ in the root and one of the quotient. The root of 0 is
    /// 0, by way of the infinity that inversesqrt gives there.
    pub fn sqrt(self, model: &Model) -> Result<Self, Lost> {
        finite([self])?;
        if self.lo < 0.0 {
            return Err("the root of what may be negative");
        }
        let (lo, hi) = (self.lo.sqrt(), self.hi.sqrt());
        if !model.root_by_inverse {
            return Self::settled(nearest(lo), nearest(hi), model);
        }
        if hi == 0.0 {
            return Ok(self);
        }
        let inverse = 2.0 * f64::from(f32::EPSILON);
        let ends = Self { lo: lo * (1.0 - inverse), hi: hi * (1.0 + 1.01 * inverse) };
        let Self { lo, hi } = ends.within(model.quotient * ulp(ends.hi));
        Self::settled(lo.max(0.0), hi, model)
    }

    /// The f32 numbers that are at most so far from it; with 0 the nearest. The ends themselves are those of f64
    /// arithmetic, a little away from the exact ones.
    fn within(self, far: f64) -> Self {
        if far == 0.0 {
            return Self { lo: nearest(self.lo), hi: nearest(self.hi) };
        }
        let slack = 4.0 * f64::EPSILON;
        let (lo, hi) = (self.lo - far - self.lo.abs() * slack, self.hi + far + self.hi.abs() * slack);
        Self { lo: up(lo, 0.0), hi: down(hi, 0.0) }
    }

    /// A function that never decreases and is exact on devices.
    pub fn monotone(self, f: impl Fn(f64) -> f64, model: &Model) -> Result<Self, Lost> {
        Self::settled(f(self.lo), f(self.hi), model)
    }

    /// The nearest real to an int, or either neighbour.
    pub fn of_int(n: i32, model: &Model) -> Self {
        let n = f64::from(n);
        Self { lo: lower(n, 0.0, model), hi: upper(n, 0.0, model) }
    }
}

fn finite<const N: usize>(operands: [Interval; N]) -> Result<(), Lost> {
    if operands.iter().any(|x| x.is_infinite()) { Err("infinity") } else { Ok(()) }
}

/// The least and the largest value of a function that is monotone in each operand.
fn extremes(a: Interval, b: Interval, f: impl Fn(f64, f64) -> f64) -> (f64, f64) {
    let first = f(a.lo, b.lo);
    let others = [f(a.lo, b.hi), f(a.hi, b.lo), f(a.hi, b.hi)];
    // Not `min`, which may exchange zeros: points keep their sign.
    others.into_iter().fold((first, first), |(lo, hi), x| (if x < lo { x } else { lo }, if x > hi { x } else { hi }))
}

/// a + b as s + e, exactly (Knuth).
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let b_part = s - a;
    (s, (a - (s - b_part)) + (b - b_part))
}

/// The lower end of what a device makes of x + e, a sum of two f64.
fn lower(x: f64, e: f64, model: &Model) -> f64 {
    if model.nearest { nearest_sum(x, e) } else { down(x, e) }
}

fn upper(x: f64, e: f64, model: &Model) -> f64 {
    if model.nearest { nearest_sum(x, e) } else { up(x, e) }
}

/// The nearest f32.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
pub fn nearest(x: f64) -> f64 {
    f64::from(x as f32)
}

/// The f32 nearest to x + e, |e| at most half a unit in the last place of x: rounding x may be wrong only where it lies
/// half way between two f32, which e then decides.
fn nearest_sum(x: f64, e: f64) -> f64 {
    let (below, above) = (down(x, 0.0), up(x, 0.0));
    if e != 0.0 && below < above && x - below == above - x {
        return if e < 0.0 { below } else { above };
    }
    nearest(x)
}

/// The largest f32 up to x + e.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
pub fn down(x: f64, e: f64) -> f64 {
    let near = x as f32;
    let over = f64::from(near) > x || (f64::from(near) == x && e < 0.0);
    f64::from(if over { near.next_down() } else { near })
}

/// The least f32 from x + e.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
pub fn up(x: f64, e: f64) -> f64 {
    let near = x as f32;
    let under = f64::from(near) < x || (f64::from(near) == x && e > 0.0);
    f64::from(if under { near.next_up() } else { near })
}

/// The distance of the f32 numbers around a number, on the side away from 0.
#[expect(clippy::cast_possible_truncation, reason = "a number of f32's range")]
pub fn ulp(x: f64) -> f64 {
    let below = down(x.abs(), 0.0) as f32;
    if below < f32::MIN_POSITIVE {
        return 2_f64.powi(-149);
    }
    let exponent = (below.to_bits() >> 23).cast_signed() - 127;
    2_f64.powi(exponent - 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_rounded_outwards_and_exact_results_stay() {
        let model = Model::vulkan();
        let one = Interval::point(1.0);
        let tiny = Interval::point(2_f64.powi(-30));
        assert_eq!(one.add(one, &model), Ok(Interval::point(2.0)));
        let sum = one.add(tiny, &model).unwrap();
        assert_eq!((sum.lo, sum.hi), (1.0, 1.0 + 2_f64.powi(-23)));
        // Exact in f64 only with its second part.
        let least = Interval::point(-2_f64.powi(-100));
        let sum = one.add(least, &model).unwrap();
        assert_eq!((sum.lo, sum.hi), (1.0 - 2_f64.powi(-24), 1.0));
        assert_eq!(one.add(least, &Model::exact()), Ok(one));
    }

    #[test]
    fn subnormal_numbers_may_be_zero() {
        let half_least = Interval::point(LEAST).mul(Interval::point(0.5), &Model::vulkan()).unwrap();
        assert_eq!((half_least.lo, half_least.hi), (0.0, 0.5 * LEAST));
        let kept = Interval::point(LEAST).mul(Interval::point(0.5), &Model::exact());
        assert_eq!(kept, Ok(Interval::point(0.5 * LEAST)));
    }

    #[test]
    fn quotients_and_roots_are_as_wide_as_promised() {
        let model = Model::vulkan();
        let third = Interval::point(1.0).div(Interval::point(3.0), &model).unwrap();
        assert!(third.contains(1.0 / 3.0) && third.ulps() >= 2.0 && third.ulps() <= 2.5, "{third:?}");
        let root = Interval::point(2.0).sqrt(&model).unwrap();
        assert!(root.contains(2_f64.sqrt()) && root.ulps() > 4.0 && root.ulps() < 6.5, "{root:?}");
        let unknown = Interval { lo: -1.0, hi: 1.0 };
        assert!(Interval::point(1.0).div(unknown, &model).is_err() && unknown.sqrt(&model).is_err());
        assert_eq!(ulp(1.0), 2_f64.powi(-23));
        assert_eq!(ulp(-1.999), 2_f64.powi(-23));
    }
}
