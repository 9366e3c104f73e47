//! xʸ as 2^(y·log₂ x), with the logarithm and the product in two parts. Knows no exponent in particular but 0 and 1.

use super::exp::{exp_of_small, mantissa, times_power_of_two};
use super::write::{Real, write};
use crate::{Builder, NodeId, Precision};

/// xʸ, with the special cases of C's `pow` (C23, annex F).
pub fn pow(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x, y]| {
        let base = x.abs();
        // A larger exponent changes nothing: every base but 1 has left the range long before.
        let huge = x.by(2f64.powi(60), 2f64.powi(100));
        let exponent = y.at_least(-huge).at_most(huge);
        let (log, rest) = log2_in_parts(base);
        let upper = exponent.upper();
        let high = upper * log;
        let low = (exponent - upper) * log + exponent * rest;

        // The exponent of 2 decides overflow and underflow, so special cases are set there.
        let no_power = y.floor().differs(y).and(x.less(0.0));
        let edge = base.equals(0.0).or(base.equals(f64::INFINITY));
        let limit = base.less(1.0).select(f64::NEG_INFINITY, f64::INFINITY) * y;
        let total = edge.select(limit, no_power.select(f64::NAN, high + low));

        let k = total.nearest();
        let r = ((high - k) + low) * std::f64::consts::LN_2;
        let power = times_power_of_two(exp_of_small(r), k);
        // The least is half the least subnormal.
        let (least, greatest) = x.by((-150.0, 128.0), (-1075.0, 1024.0));
        let power = total.less(least).select(0.0, power);
        let power = total.reaches(greatest).select(f64::INFINITY, power);

        let half = y * 0.5;
        let odd = y.floor().equals(y).and(half.floor().differs(half));
        let power = odd.select(power.copysign(x), power);
        let power = y.equals(1.0).select(x, power);
        x.equals(1.0).or(y.equals(0.0)).select(1.0, power)
    })
}

/// log₂ x in two parts, the first of half the digits, for a positive finite x.
///
/// x = 2ᵉ·m, s = (m − 1)/(m + 1), log₂ m = 2/(3 ln 2)·s·(3 + s² + s⁴·Q(s²)). Each factor is split into an upper half,
/// whose products are exact, and a rest, whose products need not be.
fn log2_in_parts(x: Real<'_>) -> (Real<'_>, Real<'_>) {
    let (m, e) = mantissa(x);
    let f = m - 1.0;
    let d = m + 1.0;
    let inverse = 1.0 / d;
    let s = f * inverse;
    let s1 = s.upper();
    let d1 = d.upper();
    let d2 = m - (d1 - 1.0);
    let s2 = ((f - s1 * d1) - s1 * d2) * inverse;

    let z = s * s;
    let z1 = s1 * s1;
    let z2 = s2 * (s + s1) + (z * z) * z.polynomial(artanh(x));
    let t1 = ((3.0 + z1) + z2).upper();
    let t2 = z2 - ((t1 - 3.0) - z1);

    let product = s1 * t1;
    let rest = s2 * t1 + t2 * s;
    let p1 = (product + rest).upper();
    let p2 = rest - (p1 - product);

    let whole = 2.0 / (3.0 * std::f64::consts::LN_2);
    let (c1, c2) =
        x.by((0.961_914_062_5, -1.173_685_741_377_994_4e-4), (0.961_796_700_954_437_3, -7.028_461_650_952_758e-9));
    let upper = c1 * p1;
    let lower = c2 * p1 + p2 * whole;
    let log1 = ((upper + lower) + e).upper();
    let log2 = lower - ((log1 - e) - upper);
    (log1, log2)
}

/// 3·(artanh(s)/s − 1 − s²/3)/s⁴ as a polynomial in s², |s| ≤ (√2 − 1)/(√2 + 1). Relative error of the logarithm
/// 2⁻³⁶·⁸, 2⁻⁶⁶·³.
fn artanh(x: Real<'_>) -> &'static [f64] {
    x.by(
        &[0.600_002_3, 0.428_206_32, 0.351_294_64],
        &[
            0.600_000_000_000_033_8,
            0.428_571_428_551_496_44,
            0.333_333_337_798_036_4,
            0.272_726_765_597_594_7,
            0.230_801_355_051_553_55,
            0.198_852_394_882_048_5,
            0.197_943_623_675_326_5,
        ],
    )
}
