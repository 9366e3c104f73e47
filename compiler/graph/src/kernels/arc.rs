//! The inverse functions: angles from a sine, a cosine, a tangent or a point. Knows nothing of the functions they
//! invert.

use std::f64::consts::{FRAC_PI_2, PI};

use super::write::{Real, Truth, write};
use crate::{Builder, NodeId, Precision};

/// arcsin x; for |x| ≥ ½ as π/2 − 2·arcsin √((1 − |x|)/2).
pub fn asin(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let h = HalfAngle::of(x);
        let near = h.s + h.rest;
        // The rounding error of π/2 − 2s would weigh more in a result below 1.
        let twice = h.s + h.s;
        let complement = FRAC_PI_2 - twice;
        let error = (FRAC_PI_2 - complement) - twice;
        let far = complement - ((h.rest + h.rest) - (error + tail(x)));
        h.far.select(far, near).copysign(x)
    })
}

/// arccos x; for |x| ≥ ½ as 2·arcsin √((1 − |x|)/2), from π for negative x; else as π/2 − arcsin x.
pub fn acos(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let h = HalfAngle::of(x);
        let near = FRAC_PI_2 - (x - (tail(x) - h.rest.copysign(x)));
        let half = h.s + h.rest;
        let twice = half + half;
        let far = x.less(0.0).select(PI - (twice - 2.0 * tail(x)), twice);
        h.far.select(far, near)
    })
}

/// What rounding takes from π/2; from π it takes twice as much.
fn tail(x: Real<'_>) -> f64 {
    x.by(-4.371_139_000_186_241e-8, 6.123_233_995_736_766e-17)
}

/// arcsin s = s + `rest` for an s ≤ ½.
struct HalfAngle<'k> {
    s: Real<'k>,
    rest: Real<'k>,
    /// Whether |x| ≥ ½ and s = √((1 − |x|)/2), else s = |x|.
    far: Truth<'k>,
}

impl<'k> HalfAngle<'k> {
    /// arcsin s = s + s·s²·A(s²). Relative error of the polynomial 2⁻²⁷·⁶, 2⁻⁵⁵·⁹.
    fn of(x: Real<'k>) -> Self {
        let coefficients: &[f64] = x.by(
            &[0.166_667_52, 0.074_953_124, 0.045_468_662, 0.024_187_358, 0.042_153_887],
            &[
                0.166_666_666_666_654_1,
                0.075_000_000_003_365_96,
                0.044_642_856_828_602_07,
                0.030_381_959_128_006_83,
                0.022_371_758_219_403_962,
                0.017_359_702_796_519_785,
                0.013_885_250_005_809_813,
                0.012_169_143_801_804_075,
                0.006_528_164_548_507_732,
                0.019_527_998_411_686_16,
                -0.016_224_185_277_380_395,
                0.031_912_439_955_908_15,
            ],
        );
        let size = x.abs();
        let far = x.constant(0.5).less(size);
        let square = far.select(0.5 * (1.0 - size), size * size);
        let s = far.select(square.sqrt(), size);
        Self { s, rest: s * (square * square.polynomial(coefficients)), far }
    }
}

/// arctan x; for |x| > 1 as π/2 − arctan(1/|x|).
pub fn atan(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let size = x.abs();
        let steep = x.constant(1.0).less(size);
        let near = atan_of_ratio(steep.select(1.0, size) / steep.select(size, 1.0));
        steep.select(FRAC_PI_2 - (near - tail(x)), near).copysign(x)
    })
}

/// The angle of (x, y) as arctan of the lesser coordinate over the greater, reflected into its octant.
pub fn atan2(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[y, x]| {
        let (up, along) = (y.abs(), x.abs());
        let steep = along.less(up);
        let (lesser, greater) = (steep.select(along, up), steep.select(up, along));
        // 0/0 and ∞/∞ count as 0 and 1.
        let diagonal = greater.equals(0.0).select(0.0, 1.0);
        let near = atan_of_ratio(lesser.equals(greater).select(diagonal, lesser / greater));
        // π/2 ± `near` if steep, else `near` from 0 or π; what rounding takes from the axis is in proportion.
        let axis = steep.select(FRAC_PI_2, FRAC_PI_2 - x.constant(FRAC_PI_2).copysign(x));
        let turn = near.copysign(steep.select(-x, x));
        (axis + (turn + axis * (tail(x) / FRAC_PI_2))).copysign(y)
    })
}

/// arctan t = t + t·t²·B(t²) for 0 ≤ t ≤ 1. Relative error of the polynomial 2⁻²⁵·⁷, 2⁻⁵⁴·⁹.
fn atan_of_ratio(t: Real<'_>) -> Real<'_> {
    let coefficients: &[f64] = t.by(
        &[
            -0.333_331_53,
            0.199_937_67,
            -0.142_110_08,
            0.106_658_2,
            -0.075_518_27,
            0.043_207_362,
            -0.016_365_19,
            0.002_920_01,
        ],
        &[
            -0.333_333_333_333_318_6,
            0.199_999_999_997_552,
            -0.142_857_142_713_425_53,
            0.111_111_106_789_295_07,
            -0.090_909_012_380_133_34,
            0.076_922_129_560_970_16,
            -0.066_658_605_394_919_41,
            0.058_773_086_623_289_825,
            -0.052_392_363_776_471_98,
            0.046_739_593_508_714_35,
            -0.040_926_598_344_950_94,
            0.034_068_180_802_286_55,
            -0.025_827_284_074_911_565,
            0.016_978_525_421_616_5,
            -0.009_184_927_297_518_665,
            0.003_856_175_333_470_424,
            -0.001_164_146_370_923_950_4,
            0.000_223_039_381_882_308_91,
            -2.026_033_505_492_168e-5,
        ],
    );
    let square = t * t;
    t + t * (square * square.polynomial(coefficients))
}
