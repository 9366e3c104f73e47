//! sin, cos and tan by one reduction to a quadrant, which they share node by node. Knows arguments up to 8192 to the last
//! digit; to 65536 sin and cos are off by less than 2·10⁻⁶ in f32, to 2³⁰ by less than 10⁻⁷ in f64; and nothing beyond.

use std::f64::consts::FRAC_2_PI;

use super::write::{Real, Truth, write};
use crate::{Builder, NodeId, Precision};

/// Where the reduction ends (f32, f64); beyond, every finite argument counts as 0.
const LAST: (f64, f64) = (65_536.0, 1_073_741_824.0);

/// sin x.
pub fn sin(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let q = Quadrant::of(x);
        q.odd.select(q.cosine(), q.sine()) * q.sign
    })
}

/// cos x.
pub fn cos(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let q = Quadrant::of(x);
        q.odd.select(-q.sine(), q.cosine()) * q.sign
    })
}

/// tan x; for odd k as −1/tan r.
pub fn tan(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let q = Quadrant::of(x);
        let (tangent, rest) = q.tangent();
        let inverse = -1.0 / tangent;
        q.odd.select(inverse + (inverse * inverse) * rest, tangent)
    })
}

/// x = k·π/2 + r − t with k = ⌊2x/π⌉, so |r| ≤ π/4.
struct Quadrant<'k> {
    r: Real<'k>,
    /// What r is too large by, not much more than its last digit.
    t: Real<'k>,
    square: Real<'k>,
    /// Whether k is odd.
    odd: Truth<'k>,
    /// (−1)^⌊k/2⌋.
    sign: Real<'k>,
}

impl<'k> Quadrant<'k> {
    fn of(x: Real<'k>) -> Self {
        // Infinity and NaN stay NaN.
        let x = x.abs().less(x.by(LAST.0, LAST.1)).select(x, x * 0.0);
        let k = (x * FRAC_2_PI).nearest();
        // k has 13 bits for |x| ≤ 8192, so the products with all parts of π/2 but the last are exact; and so are the
        // differences but the last, whose rounding error t takes up.
        let (parts, part, last): (&[f64], _, _) = x.by(
            (&[1.570_312_5, 4.837_512_969_970_703e-4], 7.549_533_620_476_723e-8, 2.563_344_068_257_089e-12),
            (&[1.570_796_326_794_152_3], 7.443_547_480_480_255e-13, 6.368_317_163_510_95e-25),
        );
        let rest = parts.iter().fold(x, |rest, part| rest - k * *part);
        let product = k * part;
        let r = rest - product;
        let t = k * last - ((rest - r) - product);
        let quarter = k * 0.25;
        let phase = quarter - (quarter + 0.5).floor(); // −½, −¼, 0 or ¼
        Self { r, t, square: r * r, odd: phase.abs().equals(0.25), sign: x.constant(1.0).copysign(phase) }
    }

    /// sin(r − t) = r − (t − r·(r²·S(r²))). Relative error of the polynomial 2⁻²⁷·⁹, 2⁻⁵⁷·⁹. In this order −0 stays −0,
    /// for the bracket is then 0.
    fn sine(&self) -> Real<'k> {
        let coefficients: &[f64] = self.r.by(
            &[-0.166_666_55, 0.008_332_189, -0.000_195_182_61],
            &[
                -0.166_666_666_666_666_3,
                0.008_333_333_333_321_842,
                -0.000_198_412_698_293_608_97,
                2.755_731_353_959_064e-6,
                -2.505_073_458_912_171e-8,
                1.589_544_635_777_252e-10,
            ],
        );
        self.r - (self.t - self.r * (self.square * self.square.polynomial(coefficients)))
    }

    /// cos(r − t) = 1 + (r²·(−½ + r²·C(r²)) + r·t). Error of the polynomial 2⁻³³, 2⁻⁶⁴.
    fn cosine(&self) -> Real<'k> {
        let coefficients: &[f64] = self.r.by(
            &[-0.5, 0.041_666_646, -0.001_388_731, 2.443_237e-5],
            &[
                -0.5,
                0.041_666_666_666_666_595,
                -0.001_388_888_888_887_333,
                2.480_158_728_898_756_8e-5,
                -2.755_731_421_134_884_3e-7,
                2.087_570_445_251_566_6e-9,
                -1.135_869_285_343_129e-11,
            ],
        );
        1.0 + (self.square * self.square.polynomial(coefficients) + self.r * self.t)
    }

    /// tan(r − t) = r − (t − r·(r²·T(r²))), and what rounding the outer difference takes from it. Relative error of the
    /// polynomial 2⁻²⁹·⁵, 2⁻⁵⁶.
    fn tangent(&self) -> (Real<'k>, Real<'k>) {
        let coefficients: &[f64] = self.r.by(
            &[0.333_333_5, 0.133_326_75, 0.054_058_95, 0.021_285_817, 0.010_828_919, 9.586_296e-5, 0.004_374_095_7],
            &[
                0.333_333_333_333_327_7,
                0.133_333_333_334_155_62,
                0.053_968_253_926_223_93,
                0.021_869_489_619_588_033,
                0.008_863_219_015_510_453,
                0.003_592_290_419_563_009_5,
                0.001_454_749_817_404_943,
                0.000_595_099_087_024_770_6,
                0.000_222_278_341_292_165_25,
                0.000_136_734_998_853_411_53,
                -2.668_203_572_767_012e-5,
                8.972_485_713_604_797e-5,
                -4.502_401_456_356_335e-5,
                2.089_880_622_677_885e-5,
            ],
        );
        let correction = self.t - self.r * (self.square * self.square.polynomial(coefficients));
        let tangent = self.r - correction;
        (tangent, (self.r - tangent) - correction)
    }
}
