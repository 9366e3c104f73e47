//! Derivatives from values alone: Richardson-extrapolated differences in f64, each with its own error estimate. Knows
//! nothing of graphs and rules.
//!
//! C. J. F. Ridders, *Accurate computation of F′(x) and F′(x)F″(x)*, Advances in Engineering Software 4 (1982): a
//! tableau of differences at steps h, h/2, h/4, …, each column of which cancels one more term of the error series; the
//! entry whose neighbours agree best is the result.

/// A derivative and how far from the truth it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The derivative.
    pub value: f64,
    /// An estimate of its error, truncation and rounding together; ∞ if the differences did not converge.
    pub error: f64,
}

impl Estimate {
    const NONE: Self = Self { value: f64::NAN, error: f64::INFINITY };

    /// Whether the differences converged to a number.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.value.is_finite() && self.error.is_finite()
    }
}

/// Rows of the tableau.
const ROWS: usize = 10;

/// From which side a difference looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// From x upwards.
    Above,
    /// From x downwards.
    Below,
}

/// f′(x) from both sides: (f(x + h) − f(x − h)) / 2h, whose error has the powers h², h⁴, … The function is asked within
/// `step` of x, which is cut to a power of 2.
#[must_use]
pub fn central(f: impl Fn(f64) -> f64, x: f64, step: f64) -> Estimate {
    tableau(step, 4.0, 4.0, |h| {
        let (above, below) = (x + h, x - h);
        let (up, down) = (f(above), f(below));
        ((up - down) / (above - below), up.abs().max(down.abs()) / h)
    })
}

/// The derivative from one side: (f(x ± h) − f(x)) / ±h, whose error has the powers h, h², … The two sides' values span
/// the hull in which a derivative at a kink lies (LANGUAGE 13.6, DESIGN 11).
#[must_use]
pub fn one_sided(f: impl Fn(f64) -> f64, x: f64, step: f64, side: Side) -> Estimate {
    let at = f(x);
    tableau(step, 2.0, 2.0, |h| {
        let there = if side == Side::Above { x + h } else { x - h };
        let value = f(there);
        ((value - at) / (there - x), at.abs().max(value.abs()) / h)
    })
}

/// The places at which [`slopes`] wants a function's values, so that they can be had in one batch: x, then above and
/// below it at each step.
#[must_use]
pub fn stencil(x: f64, step: f64) -> Vec<f64> {
    let mut at = vec![x];
    let mut h = whole(step);
    for _ in 0..ROWS {
        at.extend([x + h, x - h]);
        h *= 0.5;
    }
    at
}

/// f′(x) from both sides, from above and from below: see [`central`] and [`one_sided`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slopes {
    /// From both sides.
    pub central: Estimate,
    /// From x upwards, and from x downwards.
    pub sides: [Estimate; 2],
}

impl Slopes {
    /// The derivative, if the differences can judge one: all three are this sure of it, relative to it or to 1, and
    /// agree. Near a kink they do not.
    #[must_use]
    pub fn agreed(self, sure: f64) -> Option<Estimate> {
        let Estimate { value, .. } = self.central;
        let scale = sure * (1.0 + value.abs());
        let agrees = |e: &Estimate| e.error < scale && (e.value - value).abs() < scale;
        (agrees(&self.central) && self.sides.iter().all(agrees)).then_some(self.central)
    }
}

/// The derivative at `at[0]` from the values at all places of a [`stencil`].
///
/// # Panics
/// If there are fewer places or values than a stencil has.
#[must_use]
pub fn slopes(at: &[f64], values: &[f64]) -> Slopes {
    let step = at[1] - at[0];
    let quotient = |i: usize, j: usize| {
        let size = values[i].abs().max(values[j].abs()) / (at[i] - at[j]).abs();
        ((values[i] - values[j]) / (at[i] - at[j]), size)
    };
    let rows = |first: f64, ratio: f64, pair: &dyn Fn(usize) -> (usize, usize)| {
        let mut k = 0;
        tableau(step, first, ratio, |_| {
            let (i, j) = pair(k);
            k += 1;
            quotient(i, j)
        })
    };
    Slopes {
        central: rows(4.0, 4.0, &|k| (1 + 2 * k, 2 + 2 * k)),
        sides: [rows(2.0, 2.0, &|k| (1 + 2 * k, 0)), rows(2.0, 2.0, &|k| (2 + 2 * k, 0))],
    }
}

/// A step cut to a power of 2, so that places are exact.
fn whole(step: f64) -> f64 {
    step.log2().floor().exp2()
}

/// Extrapolates differences: `difference(h)` gives the quotient and the size of the terms it subtracts over h. The
/// error series begins with the power of h that halving divides by `first`, and each next by `ratio` more.
fn tableau(step: f64, first: f64, ratio: f64, mut difference: impl FnMut(f64) -> (f64, f64)) -> Estimate {
    let mut h = whole(step);
    let mut best = Estimate::NONE;
    let mut previous: Vec<f64> = Vec::new();
    for _ in 0..ROWS {
        let (quotient, size) = difference(h);
        let rounding = 4.0 * f64::EPSILON * size;
        let mut row = vec![quotient];
        let mut factor = first;
        for (k, above) in previous.iter().enumerate() {
            let left = row[k];
            let value = (left * factor - above) / (factor - 1.0);
            let error = (value - left).abs().max((value - above).abs()) + rounding;
            if error < best.error {
                best = Estimate { value, error };
            }
            row.push(value);
            factor *= ratio;
        }
        previous = row;
        h *= 0.5;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_functions_have_their_derivatives() {
        for x in [0.1, 0.7, 1.3, 2.9] {
            let cases = [
                (central(f64::sin, x, 0.1), x.cos()),
                (central(f64::exp, x, 0.1), x.exp()),
                (central(|x| 1.0 / x, x, x / 4.0), -1.0 / (x * x)),
                (one_sided(f64::sin, x, 0.1, Side::Above), x.cos()),
                (one_sided(f64::exp, x, 0.1, Side::Below), x.exp()),
            ];
            for (got, want) in cases {
                assert!((got.value - want).abs() <= got.error, "at {x}: {got:?}, {want}");
                assert!(got.error < 1e-9 * (1.0 + want.abs()), "at {x}: {got:?}");
            }
        }
    }

    #[test]
    fn the_sides_of_a_kink_differ() {
        let (above, below) = (one_sided(f64::abs, 0.0, 0.1, Side::Above), one_sided(f64::abs, 0.0, 0.1, Side::Below));
        assert_eq!((above.value, below.value), (1.0, -1.0));
    }

    #[test]
    fn a_batch_gives_what_single_values_give() {
        let judge = |f: fn(f64) -> f64, x: f64| {
            let at = stencil(x, 0.1);
            let values: Vec<f64> = at.iter().map(|x| f(*x)).collect();
            slopes(&at, &values)
        };
        for x in [0.1, 0.7, 2.9] {
            let agreed = judge(f64::sin, x).agreed(1e-6).expect("sin is smooth");
            assert!((agreed.value - x.cos()).abs() < 1e-9, "at {x}: {agreed:?}");
        }
        assert_eq!(judge(f64::abs, 1e-5).agreed(1e-6), None, "a kink within the least step");
        assert_eq!(judge(f64::abs, 0.0).agreed(1e-6), None, "a kink at the place");
        assert_eq!(judge(f64::sqrt, 0.0).agreed(1e-6), None, "no value below");
    }

    #[test]
    fn infinite_slopes_do_not_converge_to_a_number() {
        let estimate = one_sided(f64::sqrt, 0.0, 0.1, Side::Above);
        assert!(estimate.error > 0.1, "{estimate:?}");
        let jump = one_sided(f64::floor, 1.0, 0.1, Side::Below);
        assert!(jump.error > 0.1, "{jump:?}");
        assert!(!central(f64::sqrt, -1.0, 0.1).is_finite());
    }
}
