//! A small generator: results of random operations, branches and loops over three inputs. Knows nothing of enclosures.

use super::*;

pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % n
    }

    pub fn real(&mut self) -> f64 {
        (self.below(2001) as f64 - 1000.0) / 250.0
    }
}

pub struct Gardener<'b, 'w> {
    pub b: &'b mut Builder<'w>,
    pub random: Random,
    pub reals: Vec<NodeId>,
    pub bools: Vec<NodeId>,
}

impl Gardener<'_, '_> {
    fn pick(&mut self) -> NodeId {
        if self.random.below(8) == 0 {
            let x = self.random.real();
            return self.b.real(x);
        }
        let n = self.reals.len();
        let at = self.random.below(n).max(self.random.below(n));
        self.reals[at]
    }

    fn cond(&mut self) -> NodeId {
        let n = self.bools.len();
        self.bools[self.random.below(n)]
    }

    pub fn grow(&mut self, size: usize, depth: usize) {
        for _ in 0..size {
            let (x, y) = (self.pick(), self.pick());
            match self.random.below(20) {
                0 | 1 if depth > 0 => self.branch(size / 2, depth - 1),
                2 if depth > 0 => self.repeat(size / 2, depth - 1),
                3..6 => {
                    let cond = self.b.lt(x, y);
                    self.bools.push(cond);
                }
                6 => {
                    let cond = self.cond();
                    let selected = self.b.select(cond, x, y);
                    self.reals.push(selected);
                }
                7 => {
                    let fresh = self.b.fresh(x);
                    self.reals.push(fresh);
                }
                kind => {
                    let unary = [Op::Abs, Op::Sin, Op::Floor, Op::Sqrt, Op::Neg, Op::Sign];
                    let binary = [Op::Add, Op::Sub, Op::Mul, Op::Min, Op::Max, Op::Length2, Op::Div];
                    let result = if kind < 12 {
                        let op = unary[self.random.below(unary.len())];
                        self.b.op(op, &[x])
                    } else {
                        let op = binary[self.random.below(binary.len())];
                        self.b.op(op, &[x, y])
                    };
                    self.reals.push(result);
                }
            }
        }
    }

    fn branch(&mut self, size: usize, depth: usize) {
        let cond = self.cond();
        let (reals, bools) = (self.reals.len(), self.bools.len());
        self.b.gamma(cond);
        self.grow(size, depth);
        let then = (self.pick(), self.pick(), self.cond());
        self.reals.truncate(reals);
        self.bools.truncate(bools);
        self.b.otherwise();
        self.grow(size, depth);
        let other = (self.pick(), self.pick(), self.cond());
        self.reals.truncate(reals);
        self.bools.truncate(bools);
        let end = self.b.end();
        let results = [self.b.join(end, then.0, other.0), self.b.join(end, then.1, other.1)];
        self.reals.extend(results);
        let result = self.b.join(end, then.2, other.2);
        self.bools.push(result);
    }

    fn repeat(&mut self, size: usize, depth: usize) {
        let (lo, hi) = (self.b.int(0), self.b.int(3));
        let (reals, bools) = (self.reals.len(), self.bools.len());
        let inits = (self.pick(), self.pick(), self.cond());
        self.b.theta(lo, hi);
        let carried = (self.b.carried(inits.0), self.b.carried(inits.1), self.b.carried(inits.2));
        let counter = self.b.counter();
        let count = self.b.int_to_real(counter);
        self.reals.extend([carried.0, carried.1, count]);
        self.bools.push(carried.2);
        self.grow(size, depth);
        let next = (self.pick(), self.pick(), self.cond());
        self.reals.truncate(reals);
        self.bools.truncate(bools);
        let end = self.b.end();
        let results = [self.b.carry_out(end, carried.0, next.0), self.b.carry_out(end, carried.1, next.1)];
        self.reals.extend(results);
        let result = self.b.carry_out(end, carried.2, next.2);
        self.bools.push(result);
    }
}

/// A graph in x, y, z and its last values, without `bound`.
pub fn plain<'w>(seed: u64, depth: usize, b: &mut Builder<'w>, inputs: &[NodeId]) -> Vec<NodeId> {
    let cond = b.lt(inputs[0], inputs[1]);
    let mut gardener = Gardener { b, random: Random(seed), reals: inputs[..3].to_vec(), bools: vec![cond] };
    gardener.grow(16, depth);
    let n = gardener.reals.len();
    gardener.reals[n - 3..].to_vec()
}
