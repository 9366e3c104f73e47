//! Random boxes of operands and values in them: points, a few numbers, narrow, wide, huge, half-infinite, subnormal.
//! Knows kinds, ranges and the numbers of a precision; knows no operation.

use isograd_graph::{Precision, Scalar, Value};

use crate::points::{Random, SPECIAL_INTS, SPECIAL_REALS};

/// What one operand ranges over, its ends in order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Side {
    /// A real from `lo` to `hi`, or NaN if it may be.
    Real {
        /// The lower end.
        lo: f64,
        /// The upper end.
        hi: f64,
        /// Whether it may be NaN.
        nan: bool,
    },
    /// An int.
    Int {
        /// The least.
        lo: i32,
        /// The largest.
        hi: i32,
    },
    /// A truth value.
    Bool {
        /// Whether it may be true.
        yes: bool,
        /// Whether it may be false.
        no: bool,
    },
}

/// The next number above.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "an f32 held in an f64")]
pub fn next_up(precision: Precision, x: f64) -> f64 {
    match precision {
        Precision::F32 => f64::from((x as f32).next_up()),
        Precision::F64 => x.next_up(),
    }
}

/// The next number below.
#[must_use]
pub fn next_down(precision: Precision, x: f64) -> f64 {
    -next_up(precision, -x)
}

/// The least positive normal number.
#[must_use]
pub fn least_normal(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => f64::from(f32::MIN_POSITIVE),
        Precision::F64 => f64::MIN_POSITIVE,
    }
}

/// Numbers in order as integers.
#[expect(clippy::cast_possible_truncation, reason = "an f32 held in an f64")]
fn rank(precision: Precision, x: f64) -> i64 {
    let bits = match precision {
        Precision::F32 => i64::from((x as f32).to_bits().cast_signed()) << 32,
        Precision::F64 => x.to_bits().cast_signed(),
    };
    let rank = if bits < 0 { i64::MIN.wrapping_sub(bits) } else { bits };
    if precision == Precision::F32 { rank >> 32 } else { rank }
}

#[expect(clippy::cast_possible_truncation, reason = "ranks of f32 have 32 bits")]
fn of_rank(precision: Precision, rank: i64) -> f64 {
    match precision {
        Precision::F32 => {
            let rank = rank as i32;
            f64::from(f32::from_bits(if rank < 0 { i32::MIN.wrapping_sub(rank) } else { rank }.cast_unsigned()))
        }
        Precision::F64 => f64::from_bits(if rank < 0 { i64::MIN.wrapping_sub(rank) } else { rank }.cast_unsigned()),
    }
}

/// How many numbers lie from `a` up to `b`; what does not fit is the most.
#[must_use]
pub fn steps(precision: Precision, a: f64, b: f64) -> i64 {
    rank(precision, b).saturating_sub(rank(precision, a))
}

/// A real where rules have something to lose: a special one, one of the domain, any bits, a subnormal.
fn some_real(random: &mut Random, domain: (f64, f64), precision: Precision) -> f64 {
    let x = match random.below(8) {
        0 => random.pick(&SPECIAL_REALS),
        1 => random.pick(&[0.0, 1.0, -1.0, 0.5, 1.5, 2.0, 3.0, f64::INFINITY, f64::NEG_INFINITY]),
        2 => random.within(domain).round(),
        3 => of_rank(precision, random.bits().cast_signed() >> if precision == Precision::F32 { 32 } else { 0 }),
        4 if random.chance(40) => least_normal(precision) * random.within((-1.0, 1.0)),
        _ => random.within(domain),
    };
    if x.is_nan() { 1.0 } else { precision.round(x) }
}

#[expect(clippy::cast_possible_truncation, reason = "ranges of ints are small")]
fn some_int(random: &mut Random, domain: (f64, f64)) -> i32 {
    match random.below(6) {
        0 => random.pick(&SPECIAL_INTS),
        1 => random.pick(&[46341, -46341, 1 << 24, (1 << 24) + 1]),
        2 => random.int(i32::MIN, i32::MAX),
        _ => random.within(domain) as i32,
    }
}

impl Side {
    /// One of a kind, about a domain worth testing.
    pub fn random(random: &mut Random, scalar: Scalar, domain: (f64, f64), precision: Precision) -> Self {
        match scalar {
            Scalar::Real => {
                let (lo, hi) = Self::ends(random, domain, precision);
                Self::Real { lo, hi, nan: random.chance(10) }
            }
            Scalar::Int => {
                let (x, y) = (some_int(random, domain), some_int(random, domain));
                let y = match random.below(4) {
                    0 => x,
                    1 => x.saturating_add(random.int(0, 5)),
                    _ => y,
                };
                Self::Int { lo: x.min(y), hi: x.max(y) }
            }
            Scalar::Bool => {
                let yes = random.chance(50);
                Self::Bool { yes, no: !yes || random.chance(50) }
            }
        }
    }

    /// The ends of a real's range.
    pub fn ends(random: &mut Random, domain: (f64, f64), precision: Precision) -> (f64, f64) {
        let x = some_real(random, domain, precision);
        let narrow = |random: &mut Random| {
            let width = (domain.1 - domain.0).min(x.abs().max(1e-3)) * 0.5_f64.powi(random.int(1, 20));
            precision.round(x + width * random.unit())
        };
        let (x, y) = match random.below(10) {
            0 => (x, x),
            1 => (x, of_rank(precision, rank(precision, x).saturating_add(random.int(0, 9).into()))),
            2 | 3 => (x, narrow(random)),
            4 => (-x.abs(), some_real(random, domain, precision).abs()),
            5 => (x, f64::INFINITY),
            6 => (f64::NEG_INFINITY, x),
            _ => (x, some_real(random, domain, precision)),
        };
        let y = if y.is_nan() { x } else { y };
        (x.min(y), x.max(y))
    }

    /// A single value of this box.
    #[must_use]
    pub const fn narrowed(self) -> Self {
        match self {
            Self::Real { lo, nan, .. } => Self::Real { lo, hi: lo, nan },
            Self::Int { lo, .. } => Self::Int { lo, hi: lo },
            Self::Bool { yes, .. } => Self::Bool { yes, no: !yes },
        }
    }

    /// The scalars that it is given by.
    pub fn write(self, to: &mut Vec<Value>) {
        match self {
            Self::Real { lo, hi, nan } => to.extend([Value::Real(lo), Value::Real(hi), Value::Bool(nan)]),
            Self::Int { lo, hi } => to.extend([Value::Int(lo), Value::Int(hi)]),
            Self::Bool { yes, no } => to.extend([Value::Bool(yes), Value::Bool(no)]),
        }
    }

    /// Values of it that matter: its ends first, then what lies inside of the ends of the others, zeros, the middle, the
    /// neighbours of the ends, whole numbers.
    pub fn special(self, others: &[Self], random: &mut Random, precision: Precision, to: &mut Vec<Value>) {
        to.clear();
        match self {
            Self::Real { lo, hi, nan } => {
                to.extend([Value::Real(lo), Value::Real(hi)]);
                let middle = 0.5 * lo + 0.5 * hi;
                let (near, far) = (next_up(precision, lo), next_down(precision, hi));
                let special = random.pick(&SPECIAL_REALS);
                let own = [0.0, -0.0, middle, near, far, lo.ceil(), hi.floor(), lo.floor() + 0.5, special];
                let others = others.iter().flat_map(|other| match other {
                    Self::Real { lo, hi, .. } => [*lo, *hi],
                    _ => [f64::NAN; 2],
                });
                for x in own.into_iter().chain(others) {
                    let x = precision.round(x);
                    if lo <= x && x <= hi {
                        to.push(Value::Real(x));
                    }
                }
                if nan {
                    to.push(Value::Real(f64::NAN));
                }
            }
            Self::Int { lo, hi } => {
                to.extend([Value::Int(lo), Value::Int(hi)]);
                let own = [0, 1, -1, lo.saturating_add(1), hi.saturating_sub(1), random.pick(&SPECIAL_INTS)];
                let others = others.iter().flat_map(|other| match other {
                    Self::Int { lo, hi } => [*lo, *hi],
                    _ => [lo; 2],
                });
                let inside = own.into_iter().chain(others).filter(|x| (lo..=hi).contains(x));
                to.extend(inside.map(Value::Int));
            }
            Self::Bool { yes, no } => {
                to.extend([(yes, true), (no, false)].into_iter().filter(|(may, _)| *may).map(|(_, x)| Value::Bool(x)));
            }
        }
    }

    /// Any value of it: uniform, or of uniform rank, so that every magnitude is met.
    pub fn sample(self, random: &mut Random, precision: Precision) -> Value {
        match self {
            Self::Real { lo, hi, .. } => {
                let x = if random.bits() & 1 == 0 {
                    let (lo, hi) = (lo.max(-1e30), hi.min(1e30));
                    lo + (hi - lo) * random.unit()
                } else {
                    let (a, b) = (rank(precision, lo), rank(precision, hi));
                    let span = b.wrapping_sub(a).cast_unsigned();
                    of_rank(precision, a.wrapping_add((random.bits() % span.saturating_add(1).max(1)).cast_signed()))
                };
                // Rounding may leave the box.
                let x = precision.round(x);
                Value::Real(if x < lo || x.is_nan() {
                    lo
                } else if x > hi {
                    hi
                } else {
                    x
                })
            }
            Self::Int { lo, hi } => Value::Int(random.int(lo, hi)),
            Self::Bool { yes, no } => Value::Bool(if yes && no { random.bits() & 1 == 0 } else { yes }),
        }
    }
}

/// Points of a box: first its corners, then mixtures of values that matter with any others. Reused for many boxes.
#[derive(Debug, Default)]
pub struct Sampler {
    special: Vec<Vec<Value>>,
    point: Vec<Value>,
}

impl Sampler {
    /// Begins with a box.
    pub fn begin(&mut self, sides: &[Side], random: &mut Random, precision: Precision) {
        self.special.resize(sides.len(), Vec::new());
        for (side, special) in sides.iter().zip(&mut self.special) {
            side.special(sides, random, precision, special);
        }
    }

    /// The corners, and then as many grid points as there are if that is at most `most`; the rest is up to chance.
    #[must_use]
    pub fn grid(&self, most: usize) -> usize {
        let all: usize = self.special.iter().map(Vec::len).product();
        if all <= most { all } else { self.corners() }
    }

    fn corners(&self) -> usize {
        self.special.iter().map(|s| s.len().min(2)).product()
    }

    /// The `n`th point, of which the first `grid` lie on the grid.
    pub fn point(&mut self, n: usize, grid: usize, sides: &[Side], random: &mut Random, p: Precision) -> &[Value] {
        self.point.clear();
        let most = if grid == self.corners() { 2 } else { usize::MAX };
        let mut code = n;
        for (side, special) in sides.iter().zip(&self.special) {
            let value = if n < grid {
                let values = special.len().min(most);
                let value = special[code % values];
                code /= values;
                value
            } else if random.bits() & 3 == 0 {
                random.pick(special)
            } else {
                side.sample(random, p)
            };
            self.point.push(value);
        }
        &self.point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_in_their_boxes_and_reach_the_ends() {
        let mut random = Random::new(5);
        let mut sampler = Sampler::default();
        for precision in [Precision::F32, Precision::F64] {
            let (mut points, mut half, mut tiny) = (0, 0, 0);
            for _ in 0..5000 {
                let side = Side::random(&mut random, Scalar::Real, (-10.0, 10.0), precision);
                let Side::Real { lo, hi, nan } = side else { panic!("a real") };
                assert!(lo <= hi && precision.round(lo) == lo && precision.round(hi) == hi, "{side:?}");
                points += usize::from(lo == hi);
                half += usize::from(lo.is_infinite() != hi.is_infinite());
                tiny += usize::from(hi.abs() < least_normal(precision) && hi != 0.0);
                sampler.begin(&[side], &mut random, precision);
                let grid = sampler.grid(32);
                let mut seen = (f64::INFINITY, f64::NEG_INFINITY);
                for n in 0..40 {
                    let Value::Real(x) = sampler.point(n, grid, &[side], &mut random, precision)[0] else { panic!() };
                    assert!(if x.is_nan() { nan } else { lo <= x && x <= hi }, "{x} of {side:?}");
                    seen = (seen.0.min(x), seen.1.max(x));
                }
                assert_eq!(seen, (lo, hi));
            }
            assert!(points > 300 && half > 500 && tiny > 50, "{points} {half} {tiny}");
        }
    }

    #[test]
    fn ranks_are_in_order() {
        for p in [Precision::F32, Precision::F64] {
            for x in SPECIAL_REALS.into_iter().map(|x| p.round(x)).filter(|x| x.is_finite()) {
                assert_eq!(of_rank(p, rank(p, x)), x);
                assert_eq!(rank(p, next_up(p, x)), rank(p, x) + 1, "{x}");
            }
            assert_eq!(rank(p, -0.0), 0);
            assert_eq!(steps(p, -1.0, next_up(p, -1.0)), 1);
        }
    }
}
