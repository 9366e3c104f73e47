//! Seeded points and differences: what derivatives are compared with. Knows nothing of how derivatives are made.

/// A reproducible stream of numbers (Steele, Lea, Flood, *Fast splittable pseudorandom number generators*, 2014).
pub struct Seeded(pub u64);

impl Seeded {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number of [lo, hi).
    pub fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// An index below n.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// A point of the cube [-size, size)³.
    pub fn point(&mut self, size: f64) -> Vec<f64> {
        (0..3).map(|_| self.within(-size, size)).collect()
    }
}

/// Step of the differences.
const STEP: f64 = 1e-4;

/// The points that [`difference`] needs: around `point` along the coordinate `axis`.
pub fn stencil(point: &[f64], axis: usize) -> Vec<Vec<f64>> {
    let moved = |by: f64| {
        let mut p = point.to_vec();
        p[axis] += by;
        p
    };
    [-1.0, -0.5, 0.0, 0.5, 1.0].iter().map(|k| moved(k * STEP)).collect()
}

/// The derivative from the values on a [`stencil`]: central differences of two steps, extrapolated (Richardson).
/// `None` where they cannot judge: the one-sided differences disagree, or the two steps do.
pub fn difference(values: &[f64]) -> Option<f64> {
    let [a, b, c, d, e] = *values else { panic!("five values") };
    let (wide, narrow) = ((e - a) / (2.0 * STEP), (d - b) / STEP);
    let (forward, backward) = ((e - c) / STEP, (c - a) / STEP);
    let size = 1.0 + narrow.abs();
    let judged = (wide - narrow).abs() < 2e-6 * size && (forward - backward).abs() < 1e-2 * size;
    judged.then_some((4.0 * narrow - wide) / 3.0)
}
