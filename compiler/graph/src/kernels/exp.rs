//! eˣ and ln x, and the two reductions that powers share with them: to a power of two and to a mantissa near 1. Knows
//! nothing of other bases.

use super::write::{Real, write};
use crate::{Builder, NodeId, Precision};

/// eˣ = 2ᵏ·eʳ with k = ⌊x/ln 2⌉ and r = x − k·ln 2, |r| ≤ ½ ln 2. Where the result would be subnormal it is 0.
pub fn exp(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        // Far above overflow the reduction would lose all digits. (k fits 8 and 11 bits, so k·`high` is exact.)
        let above = x.at_most(x.by(89.0, 710.0));
        let k = (above * std::f64::consts::LOG2_E).nearest();
        let (high, low) = ln_2(x);
        let r = (above - k * high) - k * low;
        let underflow = x.less(x.by(-87.336_547_851_562_5, -708.396_418_532_264_1));
        underflow.select(0.0, times_power_of_two(exp_of_small(r), k))
    })
}

/// ln 2 in two parts, the first of 16 (f32) or 42 bits (f64).
fn ln_2(x: Real<'_>) -> (f64, f64) {
    x.by((0.693_145_751_953_125, 1.428_606_765_330_187e-6), (0.693_147_180_559_890_3, 5.497_923_018_708_371e-14))
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

/// x·2ᵏ, rounded once, for an integral k not below the exponent of the least normal number. The largest that `scale`
/// takes is one too small for √½ ≤ x < 1, so what lies above it is multiplied first; from two above it, that gives
/// infinity.
pub fn times_power_of_two<'k>(x: Real<'k>, k: Real<'k>) -> Real<'k> {
    let excess = (k - x.by(126.0, 1022.0)).at_least(1.0);
    (x * excess).scale(k.to_int())
}

/// ln x = e·ln 2 + ln m, x = 2ᵉ·m. With f = m − 1 and s = f/(2 + f), ln m = 2 artanh s = s·(2 + R(s²)); because
/// f − f²/2 = 2s − s·f²/2, that is f − (f²/2 − s·(f²/2 + R)), where f is exact and the rest small.
pub fn log(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let (m, e) = mantissa(x);
        let f = m - 1.0;
        let s = f / (2.0 + f);
        let z = s * s;
        let r = z * z.polynomial(artanh(x));
        let half = 0.5 * (f * f);
        let (high, low) = ln_2(x);
        let log = e * high - ((half - (s * (half + r) + e * low)) - f);
        let finite = x.less(f64::INFINITY).select(log, x);
        let below = x.equals(0.0).select(f64::NEG_INFINITY, f64::NAN);
        x.constant(0.0).less(x).select(finite, below)
    })
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
    let n = (scaled * std::f64::consts::SQRT_2).exponent();
    (scaled.scale(n.neg()), n.to_real() - small.select(f64::from(up), -2.0))
}
