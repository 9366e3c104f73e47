//! Random raw graphs over the whole table of operations, with branches and loops inside each other. Knows the kinds of
//! operands; knows nothing of what operations mean, except how to keep numbers small enough to be judged.

use isograd_graph::ops::Accuracy;
use isograd_graph::{Builder, Graph, Mode, NodeId, Op, Scalar, Unwatched};

use crate::points::{Random, SPECIAL_INTS, SPECIAL_REALS};

/// What to grow.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// About how many operations and structures.
    pub size: usize,
    /// How deep branches and loops lie inside each other.
    pub depth: usize,
    /// Whether operations may occur that are not bit-exact: their kernels are long.
    pub transcendental: bool,
    /// Whether to keep numbers near 1 by passing some results through x/√(1+x²), and constants harmless, so that
    /// derivatives can be judged. Otherwise everything may happen.
    pub tame: bool,
}

/// Real and int inputs of a random graph; one bool follows them.
pub const INPUTS: [Scalar; 6] = [Scalar::Real, Scalar::Real, Scalar::Real, Scalar::Int, Scalar::Int, Scalar::Bool];

/// What was grown, all in the outermost region.
#[derive(Debug, Clone)]
pub struct Grown {
    /// The inputs.
    pub inputs: Vec<NodeId>,
    /// Real values, in order.
    pub reals: Vec<NodeId>,
}

/// A random raw graph with three real outputs, an int and a bool.
///
/// # Panics
/// Never: the size is far below the budget.
#[must_use]
pub fn graph(seed: u64, shape: &Shape) -> Graph {
    let mut b = Builder::new(Mode::Raw, usize::MAX, &Unwatched);
    grow(&mut b, seed, shape);
    b.finish().expect("no budget")
}

/// Grows a random graph in a raw builder; the caller may add to it. The same seed and shape give the same nodes.
pub fn grow(b: &mut Builder<'_>, seed: u64, shape: &Shape) -> Grown {
    let inputs: Vec<NodeId> = INPUTS.iter().enumerate().map(|(i, kind)| b.input(format!("x{i}"), *kind)).collect();
    let mut gardener = Gardener { b, random: Random::new(seed), shape, values: Default::default(), left: shape.size };
    for (kind, node) in INPUTS.iter().zip(&inputs) {
        gardener.values[slot(*kind)].push(*node);
    }
    while gardener.left > 0 {
        gardener.step(shape.depth);
    }
    for (k, kind) in [Scalar::Real, Scalar::Real, Scalar::Real, Scalar::Int, Scalar::Bool].into_iter().enumerate() {
        let node = gardener.recent(kind);
        gardener.b.output(format!("y{k}"), node);
    }
    let [reals, ..] = gardener.values;
    Grown { inputs, reals }
}

const fn slot(kind: Scalar) -> usize {
    match kind {
        Scalar::Real => 0,
        Scalar::Int => 1,
        Scalar::Bool => 2,
    }
}

struct Gardener<'b, 'w, 's> {
    b: &'b mut Builder<'w>,
    random: Random,
    shape: &'s Shape,
    /// Visible values of each kind.
    values: [Vec<NodeId>; 3],
    left: usize,
}

impl Gardener<'_, '_, '_> {
    /// Adds an operation, a value of its own or a structure.
    fn step(&mut self, depth: usize) {
        self.left = self.left.saturating_sub(1);
        match self.random.below(100) {
            0..4 if depth > 0 && self.left > 2 => self.branch(depth),
            4..8 if depth > 0 && self.left > 2 => self.repeat(depth),
            8..11 => {
                let kind = self.random.pick(&[Scalar::Real, Scalar::Int, Scalar::Bool]);
                let x = self.any(kind);
                let fresh = self.b.fresh(x);
                self.values[slot(kind)].push(fresh);
            }
            _ => self.operation(),
        }
    }

    fn operation(&mut self) {
        let op = loop {
            let op = self.random.pick(Op::ALL);
            let def = op.def();
            let exact = def.accuracy == Accuracy::Exact;
            // Reals are what matters: an int or bool operation is kept in one of three cases.
            let wanted = def.result == Scalar::Real || self.random.chance(33);
            if wanted && (exact || self.shape.transcendental) && !op.is_partial() {
                break op;
            }
        };
        let def = op.def();
        let mut args: Vec<NodeId> = def.operands.iter().map(|kind| self.any(*kind)).collect();
        if op == Op::Copysign {
            args[1] = self.no_nan(args[1]);
        }
        if self.shape.tame {
            self.make_harmless(op, &mut args);
        }
        let mut result = self.b.op(op, &args);
        if self.shape.tame && def.result == Scalar::Real && self.random.chance(60) {
            result = self.tamed(result);
        }
        self.values[slot(def.result)].push(result);
    }

    /// Moves operands into the domain of the operation, in one of ten cases not.
    fn make_harmless(&mut self, op: Op, args: &mut [NodeId]) {
        if self.random.chance(10) {
            return;
        }
        match op {
            // √(1 + x²) is at least 1.
            Op::Sqrt | Op::InverseSqrt | Op::Log | Op::Log2 | Op::Acosh | Op::Pow => {
                args[0] = self.at_least_one(args[0])
            }
            Op::Div | Op::Unit => args[1] = self.at_least_one(args[1]),
            Op::Exp | Op::Exp2 | Op::Sinh | Op::Cosh | Op::Asin | Op::Acos | Op::Atanh | Op::Tan => {
                args[0] = self.tamed(args[0]);
            }
            Op::Scale => {
                let (least, most) = (self.b.int(-3), self.b.int(3));
                let n = self.b.op(Op::IntMax, &[args[1], least]);
                args[1] = self.b.op(Op::IntMin, &[n, most]);
            }
            _ => {}
        }
        if op == Op::Pow {
            args[1] = self.tamed(args[1]);
        }
    }

    /// x, or 1 where it is NaN: the sign of a NaN is unspecified (LANGUAGE 17.1), and `copysign` would show it.
    fn no_nan(&mut self, x: NodeId) -> NodeId {
        let one = self.b.real(1.0);
        let is_number = self.b.eq(x, x);
        self.b.select(is_number, x, one)
    }

    fn at_least_one(&mut self, x: NodeId) -> NodeId {
        let one = self.b.real(1.0);
        self.b.op(Op::Length2, &[one, x])
    }

    /// x/√(1 + x²), smooth and below 1.
    fn tamed(&mut self, x: NodeId) -> NodeId {
        let l = self.at_least_one(x);
        self.b.unit(x, l)
    }

    /// A visible value of a kind, a new constant in one of ten cases.
    fn any(&mut self, kind: Scalar) -> NodeId {
        if self.random.chance(10) {
            return self.constant(kind);
        }
        // Of two candidates the later, so that graphs get long.
        let n = self.values[slot(kind)].len();
        let place = self.random.below(n).max(self.random.below(n));
        self.values[slot(kind)][place]
    }

    /// One of the last values of a kind.
    fn recent(&mut self, kind: Scalar) -> NodeId {
        let values = &self.values[slot(kind)];
        values[values.len() - 1 - self.random.below(values.len().min(4))]
    }

    fn constant(&mut self, kind: Scalar) -> NodeId {
        match kind {
            Scalar::Real if self.shape.tame || self.random.chance(60) => {
                let x = self.random.pick(&[0.5, 2.0, -1.0, 1.0, 0.1, -0.75, 3.0, 1e-3]);
                self.b.real(x)
            }
            Scalar::Real => {
                let x = self.random.pick(&SPECIAL_REALS);
                self.b.real(x)
            }
            Scalar::Int if self.shape.tame || self.random.chance(60) => {
                let x = self.random.int(-4, 4);
                self.b.int(x)
            }
            Scalar::Int => {
                let x = self.random.pick(&SPECIAL_INTS);
                self.b.int(x)
            }
            Scalar::Bool => {
                let x = self.random.chance(50);
                self.b.bool(x)
            }
        }
    }

    /// A few steps in a region; what they made is forgotten but for `count` values, chosen of what is visible inside.
    fn region(&mut self, depth: usize, kinds: &[Scalar]) -> Vec<NodeId> {
        let visible = [0, 1, 2].map(|k| self.values[k].len());
        let steps = 1 + self.random.below(8);
        for _ in 0..steps {
            self.step(depth - 1);
        }
        let chosen = kinds.iter().map(|kind| self.recent(*kind)).collect();
        for (values, n) in self.values.iter_mut().zip(visible) {
            values.truncate(n);
        }
        chosen
    }

    fn kinds(&mut self) -> Vec<Scalar> {
        let mut kinds = vec![Scalar::Real];
        for _ in 0..self.random.below(3) {
            kinds.push(self.random.pick(&[Scalar::Real, Scalar::Real, Scalar::Int, Scalar::Bool]));
        }
        kinds
    }

    fn branch(&mut self, depth: usize) {
        let kinds = self.kinds();
        let cond = self.any(Scalar::Bool);
        self.b.gamma(cond);
        let then = self.region(depth, &kinds);
        self.b.otherwise();
        let otherwise = self.region(depth, &kinds);
        let end = self.b.end();
        for (kind, (then, otherwise)) in kinds.iter().zip(then.into_iter().zip(otherwise)) {
            let join = self.b.join(end, then, otherwise);
            self.values[slot(*kind)].push(join);
        }
    }

    fn repeat(&mut self, depth: usize) {
        let kinds = self.kinds();
        let inits: Vec<NodeId> = kinds.iter().map(|kind| self.any(*kind)).collect();
        let (lo, hi) = self.bounds();
        self.b.theta(lo, hi);
        let visible = [0, 1, 2].map(|k| self.values[k].len());
        let counter = self.b.counter();
        self.values[slot(Scalar::Int)].push(counter);
        let carried: Vec<NodeId> = inits.into_iter().map(|init| self.b.carried(init)).collect();
        for (kind, variable) in kinds.iter().zip(&carried) {
            self.values[slot(*kind)].push(*variable);
        }
        let mut next = self.region(depth, &kinds);
        if self.shape.tame {
            for (kind, x) in kinds.iter().zip(&mut next) {
                if *kind == Scalar::Real {
                    *x = self.tamed(*x);
                }
            }
        }
        for (values, n) in self.values.iter_mut().zip(visible) {
            values.truncate(n);
        }
        let end = self.b.end();
        for ((kind, variable), next) in kinds.iter().zip(carried).zip(next) {
            let last = self.b.carry_out(end, variable, next);
            self.values[slot(*kind)].push(last);
        }
    }

    /// Bounds of a loop of at most five iterations: constants, or an int of the program cut to 0..5.
    fn bounds(&mut self) -> (NodeId, NodeId) {
        if self.random.chance(50) {
            let lo = self.random.int(-2, 2);
            let n = self.random.int(0, 4);
            return (self.b.int(lo), self.b.int(lo + n));
        }
        let (zero, most) = (self.b.int(0), self.b.int(5));
        let cut = |this: &mut Self| {
            let n = this.any(Scalar::Int);
            let n = this.b.op(Op::IntMax, &[n, zero]);
            this.b.op(Op::IntMin, &[n, most])
        };
        let hi = cut(self);
        let lo = if self.random.chance(30) { cut(self) } else { zero };
        (lo, hi)
    }
}

#[cfg(test)]
mod tests {
    use isograd_graph::{Node, verify};

    use super::*;

    #[test]
    fn graphs_are_well_formed_and_cover_everything() {
        let mut ops = std::collections::BTreeSet::new();
        let (mut branches, mut loops, mut trips) = (0, 0, 0);
        for seed in 0..300 {
            let shape = Shape { size: 60, depth: 3, transcendental: true, tame: seed % 2 == 0 };
            let graph = graph(seed, &shape);
            for (_, node) in graph.iter() {
                match node {
                    Node::Apply(op, _) => {
                        ops.insert(op);
                    }
                    Node::Gamma { .. } => branches += 1,
                    Node::Theta { hi, .. } => {
                        loops += 1;
                        trips += usize::from(!matches!(graph[hi], Node::Int(_)));
                    }
                    _ => {}
                }
            }
            verify(graph).expect("well formed");
        }
        assert_eq!(ops.len(), Op::ALL.iter().filter(|op| !op.is_partial()).count());
        assert!(branches > 200 && loops > 200 && trips > 80, "{branches} {loops} {trips}");
    }
}
