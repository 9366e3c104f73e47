//! eˣ and 2ˣ, ln x and log₂ x, and what powers and hyperbolic functions share with them: the reductions to a power of two
//! and to a mantissa near 1. Knows no other base.

use std::f64::consts::{LN_2, LOG2_E, SQRT_2};

use super::write::{Real, write};
use crate::{Builder, NodeId, Precision};

/// eˣ = 2ᵏ·eʳ.
pub fn exp(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        // Far beyond overflow and underflow the reduction would lose all digits.
        let (least, most) = x.by((-104.0, 89.0), (-746.0, 710.0));
        let (power, k) = exp_reduced(x.at_least(least).at_most(most));
        times_power_of_two(power, k)
    })
}

/// eʳ and k with eˣ = 2ᵏ·eʳ: k = ⌊x/ln 2⌉ and r = x − k·ln 2, |r| ≤ ½ ln 2, for a k of at most 8 (f32) or 11 bits (f64),
/// so that its product with the upper part of ln 2 is exact.
pub fn exp_reduced(x: Real<'_>) -> (Real<'_>, Real<'_>) {
    let k = (x * LOG2_E).nearest();
    let (high, low) = ln_2(x);
    (exp_of_small((x - k * high) - k * low), k)
}

/// ln 2 in two parts, the first of 16 (f32) or 42 bits (f64).
fn ln_2(x: Real<'_>) -> (f64, f64) {
    x.by((0.693_145_751_953_125, 1.428_606_765_330_187e-6), (0.693_147_180_559_890_3, 5.497_923_018_708_371e-14))
}

/// 2ˣ = 2ᵏ·2ᶠ with k = ⌊x⌉.
pub fn exp2(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let (least, most) = x.by((-150.0, 128.0), (-1075.0, 1024.0));
        let x = x.at_least(least).at_most(most);
        let k = x.nearest();
        times_power_of_two(exp2_of_small(x - k), k)
    })
}

/// 2ᶠ for |f| ≤ ½, as 1 + f·P(f) with P(0) = ln 2. Relative error of the polynomial 2⁻²⁸·³ (f32), 2⁻⁵⁷·⁷ (f64).
fn exp2_of_small(f: Real<'_>) -> Real<'_> {
    let coefficients: &[f64] = f.by(
        &[LN_2, 0.240_226_48, 0.055_503_596, 0.009_618_5, 0.001_339_096_9, 0.000_153_292_64],
        &[
            LN_2,
            0.240_226_506_959_101_08,
            0.055_504_108_664_821_72,
            0.009_618_129_107_601_6,
            0.001_333_355_814_654_644_8,
            0.000_154_035_304_490_419_16,
            1.525_273_363_380_107_9e-5,
            1.321_543_883_320_106_7e-6,
            1.017_816_012_528_425_1e-7,
            7.073_233_459_969_632e-9,
            4.438_850_317_041_748e-10,
        ],
    );
    1.0 + f * f.polynomial(coefficients)
}

/// eʳ for |r| ≤ ½ ln 2, as 1 + (r + r²·E(r)). Relative error of the polynomial 2⁻²⁸ (f32), 2⁻⁵⁶·⁵ (f64).
pub fn exp_of_small(r: Real<'_>) -> Real<'_> {
    let coefficients: &[f64] = r.by(
        &[0.499_999_94, 0.166_665_21, 0.041_668_385, 0.008_368_743, 0.001_381_498],
        &[
            0.500_000_000_000_001_1,
            0.166_666_666_666_664_13,
            0.041_666_666_666_529_51,
            0.008_333_333_333_493_79,
            0.001_388_888_894_380_949_5,
            0.000_198_412_695_088_836_85,
            2.480_149_290_423_413e-5,
            2.755_758_370_573_02e-6,
            2.763_032_075_780_559_3e-7,
            2.500_106_995_055_397e-8,
        ],
    );
    1.0 + (r + (r * r) * r.polynomial(coefficients))
}

/// x·2ᵏ, rounded once, for an x near 1 and an integral k within twice the exponents of normal numbers. Each half of the
/// factor is a normal number, so subnormal results are as good as others.
pub fn times_power_of_two<'k>(x: Real<'k>, k: Real<'k>) -> Real<'k> {
    let half = (k * 0.5).to_int();
    x.scale(half).scale(k.to_int() - half)
}

/// ln x = e·ln 2 + ln m with x = 2ᵉ·m.
pub fn log(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let (m, e) = mantissa(x);
        let (f, less) = log_of_mantissa(m);
        let (high, low) = ln_2(x);
        on_domain(x, e * high - ((less - e * low) - f))
    })
}

/// log₂ x = e + log₂ m with x = 2ᵉ·m. f is split, so that its product with the upper part of 1/ln 2 is exact, and so is
/// the sum with e, but for an error that is carried along.
pub fn log2(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let (m, e) = mantissa(x);
        let (f, less) = log_of_mantissa(m);
        let (high, low) =
            x.by((1.442_871_093_75, -1.760_528_6e-4), (1.442_695_051_431_655_9, -1.054_269_247_642_913_8e-8));
        let upper = f.upper();
        let product = upper * high;
        let rest = ((f - upper) - less) * LOG2_E + upper * low;
        let sum = e + product;
        on_domain(x, sum + (((e - sum) + product) + rest))
    })
}

/// A logarithm, given for positive finite x, continued to all x.
fn on_domain<'k>(x: Real<'k>, log: Real<'k>) -> Real<'k> {
    let finite = x.less(f64::INFINITY).select(log, x);
    let below = x.equals(0.0).select(f64::NEG_INFINITY, f64::NAN);
    x.constant(0.0).less(x).select(finite, below)
}

/// ln(1 + u + t) for u ≥ 0 and a t that is a rounding error of u, plus `shift`·ln 2. With 1 + u = 2ᵉ·m it is
/// e·ln 2 + ln m, corrected by what rounding 1 + u takes from it, which is all that a small u leaves. NaN for infinite u.
pub fn log_1p<'k>(u: Real<'k>, t: Real<'k>, shift: Option<Real<'k>>) -> Real<'k> {
    let sum = 1.0 + u;
    let rest = (u - (sum - 1.0)) + t;
    // √½ ≤ m ≤ √2, as in `mantissa`.
    let n = (sum * SQRT_2).exponent();
    let (f, less) = log_of_mantissa(sum.scale(n.neg()));
    let e = shift.map_or(n.to_real(), |shift| n.to_real() + shift);
    let (high, low) = ln_2(u);
    e * high - ((less - (e * low + rest / sum)) - f)
}

/// ln m as f minus a rest that is small beside it. f = m − 1 is exact; with s = f/(2 + f), ln m = 2 artanh s = s·(2 + R(s²)),
/// and because f − f²/2 = 2s − s·f²/2, that is f − (f²/2 − s·(f²/2 + R)).
fn log_of_mantissa(m: Real<'_>) -> (Real<'_>, Real<'_>) {
    let f = m - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let r = z * z.polynomial(artanh(m));
    let half = 0.5 * (f * f);
    (f, half - s * (half + r))
}

/// (2 artanh(s)/s − 2)/s² as a polynomial in s², |s| ≤ (√2 − 1)/(√2 + 1). Error of the logarithm 2⁻³⁰, 2⁻⁵⁹·⁵.
fn artanh(x: Real<'_>) -> &'static [f64] {
    x.by(
        &[0.666_667_76, 0.399_775_9, 0.298_706_14],
        &[
            0.666_666_666_666_673_4,
            0.399_999_999_994_169_74,
            0.285_714_287_419_435,
            0.222_221_986_127_882_2,
            0.181_835_625_396_971_2,
            0.153_140_900_641_607_46,
            0.147_956_104_606_272_4,
        ],
    )
}

/// m and e with x = m·2ᵉ exactly, √½ ≤ m ≤ √2, for a positive normal or subnormal x.
pub fn mantissa(x: Real<'_>) -> (Real<'_>, Real<'_>) {
    // Subnormals are scaled up, all else down by 4, so that −n and √2·x stay within range.
    let small = x.less(x.by(2f64.powi(-100), 2f64.powi(-960)));
    let up = x.by(62, 120);
    let scaled = x * small.select(2f64.powi(up), 0.25);
    let n = (scaled * SQRT_2).exponent();
    (scaled.scale(n.neg()), n.to_real() - small.select(f64::from(up), -2.0))
}
