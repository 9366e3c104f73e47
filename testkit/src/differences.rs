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

/// Extrapolates differences: `difference(h)` gives the quotient and the size of the terms it subtracts over h. The
/// error series begins with the power of h that halving divides by `first`, and each next by `ratio` more.
fn tableau(step: f64, first: f64, ratio: f64, difference: impl Fn(f64) -> (f64, f64)) -> Estimate {
    let mut h = step.log2().floor().exp2();
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
    fn infinite_slopes_do_not_converge_to_a_number() {
        let estimate = one_sided(f64::sqrt, 0.0, 0.1, Side::Above);
        assert!(estimate.error > 0.1, "{estimate:?}");
        let jump = one_sided(f64::floor, 1.0, 0.1, Side::Below);
        assert!(jump.error > 0.1, "{jump:?}");
        assert!(!central(f64::sqrt, -1.0, 0.1).is_finite());
    }
}
