//! The fields that are measured: the four scenarios of the thesis's table 5.1 and a generated one of 8,000 operations,
//! each as Vola source and as the same expression, step by step, for peers. Knows nobody who evaluates them.

use std::fmt::Write;

/// One step of an expression; operands are indices of earlier steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// A coordinate: 0, 1, 2 for x, y, z.
    Axis(usize),
    Constant(f32),
    Add(usize, usize),
    Sub(usize, usize),
    Mul(usize, usize),
    Div(usize, usize),
    Min(usize, usize),
    Max(usize, usize),
    Neg(usize),
    Abs(usize),
    Sqrt(usize),
}

/// An expression as a list of steps. The last one is its value.
#[derive(Debug, Clone, Default)]
pub struct Steps(pub Vec<Step>);

/// A field in both forms.
pub struct Model {
    pub name: &'static str,
    /// The text of a program with `export fn field(at: vec3) -> real`.
    pub vola: String,
    pub steps: Steps,
    /// Small enough that a call's overhead shows.
    pub small: bool,
    /// One of the thesis's scenarios.
    pub scenario: bool,
}

/// All models, small ones first.
pub fn all() -> Vec<Model> {
    let scenario = |name, vola: &str, small, build: fn(&mut Steps)| {
        let mut steps = Steps::default();
        build(&mut steps);
        Model { name, vola: vola.to_owned(), steps, small, scenario: true }
    };
    let generated = generated(8_000, 1);
    vec![
        scenario("sphere", include_str!("../../examples/thesis/sphere.vola"), true, sphere),
        scenario("hard union", include_str!("../../examples/thesis/hard_union.vola"), true, hard_union),
        scenario("smooth union", include_str!("../../examples/thesis/smooth_union.vola"), true, smooth_union),
        scenario("blob", include_str!("../../examples/thesis/blob.vola"), false, blob),
        Model { name: "8,000 operations", vola: generated.to_vola(), steps: generated, small: false, scenario: false },
    ]
}

fn sphere(s: &mut Steps) {
    let p = s.axes();
    s.ball(p, 1.0);
}

fn hard_union(s: &mut Steps) {
    let (ball, block) = s.ball_and_block();
    s.push(Step::Min(ball, block));
}

fn smooth_union(s: &mut Steps) {
    let (ball, block) = s.ball_and_block();
    s.smooth_min(ball, block, 0.4);
}

fn blob(s: &mut Steps) {
    let p = s.axes();
    let by_hand =
        [([0.3, 0.1, 0.4], 0.5), ([-0.4, 0.2, 0.1], 0.45), ([0.1, -0.5, -0.2], 0.4), ([-0.2, 0.3, -0.5], 0.35)];
    let [a, b, c, d] = by_hand.map(|(center, radius)| s.moved_ball(p, center, radius));
    let upper = s.smooth_min(a, b, 0.3);
    let lower = s.smooth_min(c, d, 0.3);
    let mut all = s.smooth_min(upper, lower, 0.3);
    for i in 0..4 {
        for j in 0..4 {
            for k in 0..4 {
                let center = [i, j, k].map(|n: i8| f32::from(n) - 1.5);
                let ball = s.moved_ball(p, center, 0.3);
                all = s.smooth_min(all, ball, 0.3);
            }
        }
    }
}

impl Steps {
    fn push(&mut self, step: Step) -> usize {
        self.0.push(step);
        self.0.len() - 1
    }

    fn constant(&mut self, x: f32) -> usize {
        self.push(Step::Constant(x))
    }

    fn axes(&mut self) -> [usize; 3] {
        [0, 1, 2].map(|i| self.push(Step::Axis(i)))
    }

    fn moved(&mut self, p: [usize; 3], by: [f32; 3]) -> [usize; 3] {
        [0, 1, 2].map(|i| {
            let by = self.constant(by[i]);
            self.push(Step::Sub(p[i], by))
        })
    }

    /// √(Σ xᵢ²)
    fn length(&mut self, v: &[usize]) -> usize {
        let squares: Vec<_> = v.iter().map(|x| self.push(Step::Mul(*x, *x))).collect();
        let sum = squares.into_iter().reduce(|a, b| self.push(Step::Add(a, b))).unwrap_or_default();
        self.push(Step::Sqrt(sum))
    }

    fn ball(&mut self, p: [usize; 3], radius: f32) -> usize {
        let length = self.length(&p);
        let radius = self.constant(radius);
        self.push(Step::Sub(length, radius))
    }

    fn moved_ball(&mut self, p: [usize; 3], center: [f32; 3], radius: f32) -> usize {
        let p = self.moved(p, center);
        self.ball(p, radius)
    }

    /// ‖max(q, 0)‖ + min(largest component of q, 0) of q = abs(p) − extent
    fn block(&mut self, p: [usize; 3], extent: [f32; 3]) -> usize {
        let q = [0, 1, 2].map(|i| {
            let (a, e) = (self.push(Step::Abs(p[i])), self.constant(extent[i]));
            self.push(Step::Sub(a, e))
        });
        let zero = self.constant(0.0);
        let outer = q.map(|x| self.push(Step::Max(x, zero)));
        let outer = self.length(&outer);
        let xy = self.push(Step::Max(q[0], q[1]));
        let largest = self.push(Step::Max(xy, q[2]));
        let inner = self.push(Step::Min(largest, zero));
        self.push(Step::Add(outer, inner))
    }

    fn ball_and_block(&mut self) -> (usize, usize) {
        let p = self.axes();
        let ball = self.ball(p, 1.0);
        let q = self.moved(p, [1.0, 0.5, 0.0]);
        (ball, self.block(q, [0.8, 0.6, 0.7]))
    }

    /// The function that `std::smooth_min` computes, ½(a + b) − s²/(4k) − k/4 where |s| < k with s = a − b and else
    /// min(a, b), in the usual form, which needs no comparison: min(a, b) − ¼h²/k with h = max(k − |s|, 0).
    fn smooth_min(&mut self, a: usize, b: usize, k: f32) -> usize {
        let [k, quarter, zero] = [k, 0.25, 0.0].map(|x| self.constant(x));
        let apart = self.push(Step::Sub(a, b));
        let apart = self.push(Step::Abs(apart));
        let near = self.push(Step::Sub(k, apart));
        let near = self.push(Step::Max(near, zero));
        let square = self.push(Step::Mul(near, near));
        let lowered = self.push(Step::Div(square, k));
        let lowered = self.push(Step::Mul(quarter, lowered));
        let least = self.push(Step::Min(a, b));
        self.push(Step::Sub(least, lowered))
    }

    /// Steps that compute something.
    pub fn operations(&self) -> usize {
        self.0.iter().filter(|s| !matches!(s, Step::Axis(_) | Step::Constant(_))).count()
    }

    /// A program whose export `field` is this expression, a line for each step.
    pub fn to_vola(&self) -> String {
        let name = |i: &usize| match self.0.get(*i) {
            Some(Step::Axis(axis)) => format!("at.{}", ["x", "y", "z"].get(*axis).unwrap_or(&"?")),
            // The shortest decimal that is this number: the compiler reads it in binary64.
            Some(Step::Constant(x)) if x.is_sign_negative() => format!("(-{:?})", f64::from(-x)),
            Some(Step::Constant(x)) => format!("{:?}", f64::from(*x)),
            _ => format!("t{i}"),
        };
        let mut text = String::from("/// A generated field.\nexport fn field(at: vec3) -> real {\n");
        for (i, step) in self.0.iter().enumerate() {
            let right = match step {
                Step::Axis(_) | Step::Constant(_) => continue,
                Step::Add(a, b) => format!("{} + {}", name(a), name(b)),
                Step::Sub(a, b) => format!("{} - {}", name(a), name(b)),
                Step::Mul(a, b) => format!("{} * {}", name(a), name(b)),
                Step::Div(a, b) => format!("{} / {}", name(a), name(b)),
                Step::Min(a, b) => format!("min({}, {})", name(a), name(b)),
                Step::Max(a, b) => format!("max({}, {})", name(a), name(b)),
                Step::Neg(a) => format!("-{}", name(a)),
                Step::Abs(a) => format!("abs({})", name(a)),
                Step::Sqrt(a) => format!("sqrt({})", name(a)),
            };
            // Writing to a string does not fail.
            let _ = writeln!(text, "    let t{i} = {right};");
        }
        let _ = writeln!(text, "    t{}\n}}", self.0.len().saturating_sub(1));
        text
    }
}

/// A model of exactly so many operations in the manner of a drawing in CSG: clusters of balls, blocks, rings and
/// half-spaces, each cluster around its own centre and with coordinates that its parts share, joined, cut and
/// intersected in pairs, as a tree of operations would be evaluated.
pub fn generated(operations: usize, seed: u64) -> Steps {
    /// More than a cluster with its joins takes; more than a part takes.
    const CLUSTER: usize = 320;
    const PART: usize = 40;
    let mut random = Random(seed);
    let mut s = Steps::default();
    let p = s.axes();
    // Like the digits of a binary number: trees of 2ⁿ clusters, the largest first.
    let mut trees: Vec<(u32, usize)> = Vec::new();
    loop {
        let room = operations.saturating_sub(s.operations() + 2 * trees.len());
        let parts = if room > CLUSTER { random.below(6) + 6 } else { 1 };
        if room < PART {
            break;
        }
        let cluster = s.cluster(p, parts, &mut random);
        trees.push((0, cluster));
        while let [.., (m, a), (n, b)] = *trees
            && m == n
        {
            trees.truncate(trees.len() - 2);
            trees.push((n + 1, s.pair(a, b, &mut random)));
        }
    }
    let mut last = trees.pop().map_or(0, |t| t.1);
    while let Some((_, tree)) = trees.pop() {
        last = s.pair(tree, last, &mut random);
    }
    // What is missing yet: half-spaces that cut a little off.
    while s.operations() < operations {
        last = if s.operations() + 1 == operations {
            s.push(Step::Abs(last))
        } else {
            let by = s.constant(random.raster(1.0, 2.0, 0.015_625));
            let plane = s.push(Step::Sub(p[s.operations() % 3], by));
            s.push(Step::Max(last, plane))
        };
    }
    s
}

impl Steps {
    /// Some parts, joined one by one.
    fn cluster(&mut self, p: [usize; 3], parts: u64, random: &mut Random) -> usize {
        let mut frame = self.frame(p, random);
        let mut all = self.part(frame, random);
        for _ in 1..parts {
            if random.below(3) == 0 {
                frame = self.frame(p, random);
            }
            let part = self.part(frame, random);
            all = self.pair(all, part, random);
        }
        all
    }

    /// Coordinates around a random centre, sometimes turned about z.
    fn frame(&mut self, p: [usize; 3], random: &mut Random) -> [usize; 3] {
        let q = self.moved(p, [0; 3].map(|_| random.raster(-1.5, 1.5, 0.015_625)));
        if random.below(2) == 0 {
            return q;
        }
        let (sin, cos) = random.between(-3.0, 3.0).sin_cos();
        let [sin, cos] = [sin, cos].map(|x| self.constant(x));
        let turned = |s: &mut Self, a, b, sign: fn(usize, usize) -> Step| {
            let (a, b) = (s.push(Step::Mul(cos, a)), s.push(Step::Mul(sin, b)));
            s.push(sign(a, b))
        };
        [turned(self, q[0], q[1], Step::Add), turned(self, q[1], q[0], Step::Sub), q[2]]
    }

    fn part(&mut self, q: [usize; 3], random: &mut Random) -> usize {
        match random.below(5) {
            0 => self.ball(q, random.raster(0.125, 0.625, 0.0625)),
            1 => self.block(q, [0; 3].map(|_| random.raster(0.125, 0.5, 0.0625))),
            2 => {
                // A ring: ‖(‖(x, y)‖ − major, z)‖ − minor.
                let around = self.length(&q[..2]);
                let major = self.constant(random.raster(0.25, 0.625, 0.0625));
                let across = self.push(Step::Sub(around, major));
                let tube = self.length(&[across, q[2]]);
                let minor = self.constant(random.raster(0.0625, 0.25, 0.0625));
                self.push(Step::Sub(tube, minor))
            }
            3 => {
                // A box by its faces alone, as drawings in the plane have it.
                let sides = [0, 1, 2].map(|i| {
                    let (a, e) = (self.push(Step::Abs(q[i])), self.constant(random.raster(0.125, 0.5, 0.0625)));
                    self.push(Step::Sub(a, e))
                });
                let xy = self.push(Step::Max(sides[0], sides[1]));
                self.push(Step::Max(xy, sides[2]))
            }
            _ => {
                let terms = [0, 1, 2].map(|i| {
                    let weight = self.constant(random.raster(-1.0, 1.0, 0.0625));
                    self.push(Step::Mul(weight, q[i]))
                });
                let xy = self.push(Step::Add(terms[0], terms[1]));
                let xyz = self.push(Step::Add(xy, terms[2]));
                let offset = self.constant(random.raster(0.0, 0.5, 0.0625));
                self.push(Step::Sub(xyz, offset))
            }
        }
    }

    /// One of two joined with the other, or what one leaves of the other.
    fn pair(&mut self, a: usize, b: usize, random: &mut Random) -> usize {
        match random.below(6) {
            0 => {
                let outside = self.push(Step::Neg(b));
                self.push(Step::Max(a, outside))
            }
            1 => self.push(Step::Max(a, b)),
            _ => self.push(Step::Min(a, b)),
        }
    }
}

/// SplitMix64: reproducible on every machine (Steele, Lea, Flood, *Fast splittable pseudorandom number generators*,
/// 2014).
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    /// Uniform in [low, high), a multiple of (high − low)/2²⁴.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        let unit = (self.next() >> 40) as f32 / 16_777_216.0;
        low + (high - low) * unit
    }

    /// A multiple of `grain` in [low, high), both multiples of it: lengths in drawings are round numbers.
    fn raster(&mut self, low: f32, high: f32, grain: f32) -> f32 {
        low + self.between(0.0, (high - low) / grain).floor() * grain
    }
}

/// Columns x, y, z of points of the cube [−2, 2]³ on a grid, row by row as a renderer or mesher visits them, each moved
/// a little from its place. (In random order a peer that branches would pay for branches that no processor can
/// predict.)
pub fn points(count: usize, seed: u64) -> [Vec<f32>; 3] {
    let mut random = Random(seed);
    let side = (1..).find(|n: &usize| n.pow(3) >= count).unwrap_or(1);
    let cell = 4.0 / side as f32;
    let mut coordinate = |place: usize| ((place % side) as f32 + random.between(0.25, 0.75)).mul_add(cell, -2.0);
    let [mut x, mut y, mut z] = [0; 3].map(|_| Vec::with_capacity(count));
    for i in 0..count {
        x.push(coordinate(i));
        y.push(coordinate(i / side));
        z.push(coordinate(i / (side * side)));
    }
    [x, y, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generated_models_have_the_size_asked_for() {
        for size in [50, 500, 8_000] {
            assert_eq!(generated(size, 1).operations(), size);
        }
    }

    #[test]
    fn every_step_of_a_generated_model_counts() {
        let steps = generated(2_000, 1);
        let mut used = vec![false; steps.0.len()];
        let mut mark = |i: usize| used[i] = true;
        for step in &steps.0 {
            match *step {
                Step::Axis(_) | Step::Constant(_) => {}
                Step::Neg(a) | Step::Abs(a) | Step::Sqrt(a) => mark(a),
                Step::Add(a, b) | Step::Sub(a, b) | Step::Mul(a, b) | Step::Div(a, b) => {
                    [a, b].into_iter().for_each(&mut mark)
                }
                Step::Min(a, b) | Step::Max(a, b) => [a, b].into_iter().for_each(&mut mark),
            }
        }
        // Two of the three coordinates of a turned frame may be all that its parts use.
        let unused = used.iter().filter(|u| !**u).count();
        assert!(unused * 50 < used.len(), "{unused} of {} steps are not used", used.len());
    }

    #[test]
    fn points_fill_the_cube() {
        for column in points(1_000, 7) {
            assert_eq!(column.len(), 1_000);
            assert!(column.iter().all(|x| x.abs() <= 2.0));
            assert!(column.iter().any(|x| *x < -1.5) && column.iter().any(|x| *x > 1.5));
        }
    }
}
