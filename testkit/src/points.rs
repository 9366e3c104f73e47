//! Seeded points: the same on every machine, for every seed another. Knows kinds and ranges of operands; knows nothing
//! of what is computed at the points.

use isograd_graph::{Op, OpDef, Precision, Scalar, Value};

/// A generator of pseudo-random numbers: splitmix64 (Steele, Lea, Flood, *Fast splittable pseudorandom number
/// generators*, 2014, fig. 15).
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 bits.
    pub const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number from 0 to `n` − 1.
    ///
    /// # Panics
    /// If `n` is 0.
    #[expect(clippy::cast_possible_truncation, reason = "less than a usize")]
    pub const fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// An int from `lo` to `hi`, both included.
    pub fn int(&mut self, lo: i32, hi: i32) -> i32 {
        let span = usize::try_from(i64::from(hi) - i64::from(lo) + 1).unwrap_or(1);
        lo + i32::try_from(self.below(span)).unwrap_or(0)
    }

    /// Uniform in [0, 1).
    #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
    pub const fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [lo, hi).
    pub fn within(&mut self, (lo, hi): (f64, f64)) -> f64 {
        lo + (hi - lo) * self.unit()
    }

    /// True in `percent` of 100 cases.
    pub const fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    /// One of a list.
    ///
    /// # Panics
    /// If the list is empty.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// Exchanges the elements of a list at random (Fisher and Yates).
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for i in (1..list.len()).rev() {
            list.swap(i, self.below(i + 1));
        }
    }

    /// A value of a kind in a range: ints are rounded, `≥ ½` is true.
    pub fn value_within(&mut self, scalar: Scalar, range: (f64, f64)) -> Value {
        let x = self.within(range);
        match scalar {
            Scalar::Real => Value::Real(x),
            #[expect(clippy::cast_possible_truncation, reason = "ranges of ints are small")]
            Scalar::Int => Value::Int(x.round() as i32),
            Scalar::Bool => Value::Bool(x >= 0.5),
        }
    }

    /// A value of a kind to surprise: one of the special ones, any bits, or a tame one.
    pub fn surprise(&mut self, scalar: Scalar, precision: Precision) -> Value {
        match scalar {
            Scalar::Real => {
                let x = match self.below(6) {
                    0 | 1 => self.pick(&SPECIAL_REALS),
                    // Two neighbours of zeros, ones and roots of overflow meet more often this way.
                    2 => self.pick(&SPECIAL_REALS) * (1.0 + self.unit() * 1e-7),
                    3 => f64::from_bits(self.bits()),
                    4 => f64::from(f32::from_bits((self.bits() >> 32) as u32)),
                    _ => self.within((-100.0, 100.0)),
                };
                Value::Real(precision.round(x))
            }
            Scalar::Int => match self.below(3) {
                0 => Value::Int(self.pick(&SPECIAL_INTS)),
                1 => Value::Int((self.bits() as u32).cast_signed()),
                _ => Value::Int(self.int(-10, 10)),
            },
            Scalar::Bool => Value::Bool(self.chance(50)),
        }
    }
}

/// Reals where implementations like to differ: zeros, ones, halves, subnormals, extremes, infinities, NaN, the ends of
/// the ints, and arguments at which transcendental functions change their behaviour, in both precisions.
pub const SPECIAL_REALS: [f64; 44] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    1.5,
    2.5,
    -2.5,
    2.0,
    3.0,
    -7.0,
    1e-30,
    -1e-30,
    1e30,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    5e-324,
    -5e-324,
    1e-310,
    f64::MIN_POSITIVE,
    f64::MAX,
    f64::MIN,
    1e-40,
    -1e-40,
    1.401_298_464_324_817e-45,
    1.175_494_350_822_287_5e-38,
    3.402_823_466_385_288_6e38,
    -3.402_823_466_385_288_6e38,
    2_147_483_647.0,
    2_147_483_648.0,
    -2_147_483_648.0,
    -2_147_483_649.0,
    4_294_967_296.0,
    8_388_608.5,
    std::f64::consts::PI,
    -std::f64::consts::FRAC_PI_2,
    88.722_839,
    -87.336_55,
    709.782_712_893_384,
    -745.133_219_101_941_1,
    8192.0,
    0.999_999_94,
];

/// Ints where implementations like to differ.
pub const SPECIAL_INTS: [i32; 14] =
    [0, 1, -1, 2, -2, 7, -7, 31, 32, 65_536, i32::MAX, i32::MIN, i32::MIN + 1, i32::MAX - 1];

/// `n` points, uniform in a box.
#[must_use]
pub fn in_box(sides: &[(f64, f64)], n: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Random::new(seed);
    (0..n).map(|_| sides.iter().map(|side| random.within(*side)).collect()).collect()
}

/// `n` rows of operands of an operation, uniform in its domain.
#[must_use]
pub fn in_domain(def: &OpDef, n: usize, seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random::new(seed);
    let kinds: Vec<_> = def.operands.iter().zip(def.domain).collect();
    (0..n).map(|_| kinds.iter().map(|(scalar, range)| random.value_within(**scalar, **range)).collect()).collect()
}

/// `n` rows of values of these kinds, to surprise.
#[must_use]
pub fn surprises(kinds: &[Scalar], precision: Precision, n: usize, seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random::new(seed);
    (0..n).map(|_| kinds.iter().map(|scalar| random.surprise(*scalar, precision)).collect()).collect()
}

/// All combinations of candidates, one list per place; the first `most` of them.
#[must_use]
pub fn grid<T: Copy>(candidates: &[Vec<T>], most: usize) -> Vec<Vec<T>> {
    let mut rows: Vec<Vec<T>> = vec![Vec::new()];
    for list in candidates {
        let longer = rows.iter().flat_map(|row| {
            list.iter().map(|x| {
                let mut row = row.clone();
                row.push(*x);
                row
            })
        });
        rows = longer.take(most).collect();
    }
    rows
}

/// Values that random choice might not bring together, for each kind.
fn special(scalar: Scalar, precision: Precision, few: bool) -> Vec<Value> {
    let reals = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -2.5,
        3.0,
        1e-40,
        -5e-324,
        1e30,
        3.4e38,
        1.7e308,
        2_147_483_648.0,
        -2_147_483_649.0,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
    ];
    let ints = [0, 1, -1, 2, 7, -7, 200, -2000, i32::MAX, i32::MIN, i32::MIN + 1];
    match scalar {
        Scalar::Real => {
            reals.iter().step_by(if few { 3 } else { 1 }).map(|x| Value::Real(precision.round(*x))).collect()
        }
        Scalar::Int => ints.iter().map(|x| Value::Int(*x)).collect(),
        Scalar::Bool => vec![Value::Bool(false), Value::Bool(true)],
    }
}

/// Rows of operands of an operation: special values against each other, surprising ones, and the domain.
#[must_use]
pub fn operands(op: Op, precision: Precision) -> Vec<Vec<Value>> {
    let kinds = op.def().operands;
    let candidates: Vec<_> = kinds.iter().map(|s| special(*s, precision, kinds.len() > 2)).collect();
    let mut rows = grid(&candidates, 1500);
    rows.extend(surprises(kinds, precision, 300, 11));
    let round = |v: Value| match v {
        Value::Real(x) => Value::Real(precision.round(x)),
        other => other,
    };
    if op.is_partial() {
        rows.retain(|row| matches!(row.first(), Some(Value::Real(x)) if *x > 0.0 && x.is_finite()));
    }
    rows.extend(in_domain(op.def(), 200, 12).into_iter().map(|row| row.into_iter().map(round).collect()));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        // The first numbers for the seed 1234567, from the authors' reference implementation.
        let mut random = Random::new(1_234_567);
        assert_eq!([random.bits(), random.bits()], [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    #[test]
    fn points_stay_in_their_box_and_repeat() {
        let sides = [(-1.0, 2.0), (5.0, 5.5)];
        let points = in_box(&sides, 1000, 3);
        assert!(points.iter().all(|p| p.iter().zip(&sides).all(|(x, (lo, hi))| (lo..hi).contains(&x))));
        assert_eq!(points, in_box(&sides, 1000, 3));
        assert_ne!(points, in_box(&sides, 1000, 4));
        let mean = points.iter().map(|p| p[0]).sum::<f64>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.1, "{mean}");
    }

    #[test]
    fn a_grid_has_all_combinations() {
        assert_eq!(grid(&[vec![1, 2], vec![3]], 10), [[1, 3], [2, 3]]);
        assert_eq!(grid(&[vec![1, 2], vec![3, 4]], 3).len(), 3);
    }
}
