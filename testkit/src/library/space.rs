//! Points, vectors and seeded sets of them. Knows no fields.

use crate::points::Random;

/// A point or a vector; in the plane the third coordinate is 0.
pub type Point = [f64; 3];

pub fn along(p: Point, t: f64, v: Point) -> Point {
    [p[0] + t * v[0], p[1] + t * v[1], p[2] + t * v[2]]
}

pub fn minus(a: Point, b: Point) -> Point {
    along(a, -1.0, b)
}

pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn norm(v: Point) -> f64 {
    dot(v, v).sqrt()
}

pub fn distance(a: Point, b: Point) -> f64 {
    norm(minus(a, b))
}

pub fn scaled(v: Point, by: f64) -> Point {
    v.map(|x| x * by)
}

/// Whether a number is above a limit, or none at all.
pub fn exceeds(x: f64, limit: f64) -> bool {
    x > limit || x.is_nan()
}

/// A vector of length 1, or nothing for the zero vector.
pub fn direction_of(v: Point) -> Option<Point> {
    let length = norm(v);
    (length > 0.0 && length.is_finite()).then(|| scaled(v, 1.0 / length))
}

/// Seeded vectors of a dimension. They use arithmetic and roots alone, so they have the same bits on every machine.
pub struct Sampler {
    pub random: Random,
    dimension: usize,
}

impl Sampler {
    /// The sequence of a name: its FNV-1a hash is the seed.
    pub fn new(name: &str, dimension: usize) -> Self {
        let hash = |h: u64, b: u8| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
        Self { random: Random::new(name.bytes().fold(0xcbf2_9ce4_8422_2325, hash)), dimension }
    }

    /// Uniform in a cube.
    pub fn within(&mut self, side: (f64, f64)) -> Point {
        let mut p = [0.0; 3];
        for x in p.iter_mut().take(self.dimension) {
            *x = self.random.within(side);
        }
        p
    }

    /// Uniform on the sphere around the origin.
    pub fn direction(&mut self) -> Point {
        loop {
            let v = self.within((-1.0, 1.0));
            if let Some(u) = direction_of(v).filter(|_| (1e-3..1.0).contains(&norm(v))) {
                return u;
            }
        }
    }

    /// A length from 2^−`least` to 1 whose logarithm is uniform.
    pub fn scale(&mut self, least: usize) -> f64 {
        let mut scale = self.random.within((0.5, 1.0));
        for _ in 0..self.random.below(least) {
            scale *= 0.5;
        }
        scale
    }
}
