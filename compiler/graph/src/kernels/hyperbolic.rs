//! The hyperbolic functions by eˣ and their inverses by ln(1 + x), each with its own care where a difference would cancel.
//! Knows nothing of circles.

use super::exp::{exp_reduced, log_1p};
use super::write::{Real, write};
use crate::{Builder, NodeId, Precision};

/// sinh x = h − 1/(4h) with h = e^|x|/2; for |x| < 0.9, where sinh x passes 1, a polynomial.
pub fn sinh(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let size = x.abs();
        let h = half_exp(size);
        size.less(0.9).select(sinh_of_small(size), h - 0.25 / h).copysign(x)
    })
}

/// cosh x = h + 1/(4h) with h = e^|x|/2.
pub fn cosh(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let h = half_exp(x.abs());
        h + 0.25 / h
    })
}

/// eˣ/2 for x ≥ 0, infinite where sinh x is.
fn half_exp(x: Real<'_>) -> Real<'_> {
    let (power, k) = exp_reduced(x.at_most(x.by(89.5, 710.5)));
    // k − 1 may be one more than `scale` takes.
    (power * 2.0).scale((k - 2.0).to_int())
}

/// sinh x = x + x·x²·S(x²) for 0 ≤ x < 0.9. Relative error of the polynomial 2⁻²⁶·⁵, 2⁻⁵⁵·³.
fn sinh_of_small(x: Real<'_>) -> Real<'_> {
    let coefficients: &[f64] = x.by(
        &[0.166_666_92, 0.008_331_348, 0.000_202_696_1],
        &[
            0.166_666_666_666_664_94,
            0.008_333_333_333_375_367,
            0.000_198_412_698_073_703,
            2.755_733_176_490_098e-6,
            2.504_976_727_725_401_2e-8,
            1.627_356_380_605_062_5e-10,
        ],
    );
    let square = x * x;
    x + x * (square * square.polynomial(coefficients))
}

/// tanh x = 1 − 2/(e^2|x| + 1); for |x| < 0.55 a polynomial.
pub fn tanh(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let size = x.abs();
        // Beyond 20 the result is 1.
        let (power, k) = exp_reduced((size + size).at_most(40.0));
        let far = 1.0 - 2.0 / (power.scale(k.to_int()) + 1.0);
        size.less(0.55).select(tanh_of_small(size), far).copysign(x)
    })
}

/// tanh x = x + x·x²·T(x²) for 0 ≤ x < 0.55. Relative error of the polynomial 2⁻²⁹·⁷, 2⁻⁵⁵·⁵.
fn tanh_of_small(x: Real<'_>) -> Real<'_> {
    let coefficients: &[f64] = x.by(
        &[-0.333_333_16, 0.133_325_44, -0.053_847_548, 0.021_050_714, -0.006_242_849_4],
        &[
            -0.333_333_333_333_323_16,
            0.133_333_333_331_689_4,
            -0.053_968_253_876_168_285,
            0.021_869_485_976_563_015,
            -0.008_863_194_524_354_212,
            0.003_591_719_840_981_847_3,
            -0.001_453_217_390_753_004_5,
            0.000_579_138_719_994_456_9,
            -0.000_210_304_949_350_175_86,
            5.102_310_695_150_196e-5,
        ],
    );
    let square = x * x;
    x + x * (square * square.polynomial(coefficients))
}

/// arsinh x = ln(1 + u) with u = |x| + x²/(1 + √(1 + x²)).
pub fn asinh(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let size = x.abs();
        let square = size * size;
        let rest = square / (1.0 + (1.0 + square).sqrt());
        log_1p_of_sum(size, size, rest).copysign(x)
    })
}

/// arcosh x = ln(1 + u) with u = √(2t + t²) + t, t = x − 1.
pub fn acosh(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let t = x - 1.0;
        let root = ((t + t) + t * t).sqrt();
        x.less(1.0).select(f64::NAN, log_1p_of_sum(x, root, t))
    })
}

/// ln(1 + a + b) for 0 ≤ b ≤ a, or ln 2x where x is so large that a and b may have overflowed.
fn log_1p_of_sum<'k>(x: Real<'k>, a: Real<'k>, b: Real<'k>) -> Real<'k> {
    let sum = a + b;
    let error = (a - sum) + b;
    // ln 2x = ln(x/4) + 3·ln 2, where 1 + x/4 = x/4.
    let large = x.reaches(2f64.powi(60));
    let log = log_1p(large.select(0.25 * x, sum), large.select(0.0, error), Some(large.select(3.0, 0.0)));
    x.less(f64::INFINITY).select(log, x)
}

/// artanh x = ½ ln(1 + u) with u = 2|x|/(1 − |x|) = 2|x| + 2|x|·|x|/(1 − |x|).
pub fn atanh(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let size = x.abs();
        let twice = size + size;
        let rest = twice * size / (1.0 - size);
        let sum = twice + rest;
        let log = 0.5 * log_1p(sum, (twice - sum) + rest, None);
        let end = size.equals(1.0).select(f64::INFINITY, f64::NAN);
        size.less(1.0).select(log, end).copysign(x)
    })
}
