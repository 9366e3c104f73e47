//! Graphs for the tests of the emitters: random ones with all operations, branches, loops and tapes inside each other, and
//! what builds chosen ones. Knows the families of targets; knows no target.

#![allow(dead_code, clippy::pedantic, reason = "shared by test programs, of which each uses a part")]

use isograd_graph::ops::Family;
use isograd_graph::{Builder, Mode, NodeId, Op, Precision, Scalar, Unwatched, Value, Verified, verify};

pub const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

/// A deterministic generator (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A value of a kind, often a special one.
    pub fn value(&mut self, scalar: Scalar) -> Value {
        const REALS: [f64; 22] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.5,
            -0.5,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            1e-40,
            -1e-40,
            5e-324,
            -5e-324,
            1e-310,
            3.4e38,
            1.7e308,
            f64::MIN_POSITIVE,
            f32::MIN_POSITIVE as f64,
            2147483647.0,
            -2147483648.0,
            4294967296.0,
            -1e30,
        ];
        const INTS: [i32; 10] = [0, 1, -1, 2, -2, i32::MIN, i32::MAX, i32::MIN + 1, 65536, 31];
        match scalar {
            Scalar::Real if self.below(3) == 0 => Value::Real(REALS[self.below(REALS.len())]),
            Scalar::Real if self.below(5) == 0 => Value::Real(f64::from_bits(self.next())),
            Scalar::Real => Value::Real(self.unit() * 200.0 - 100.0),
            Scalar::Int if self.below(2) == 0 => Value::Int(INTS[self.below(INTS.len())]),
            Scalar::Int if self.below(3) == 0 => Value::Int(self.next() as i32),
            Scalar::Int => Value::Int(self.below(21) as i32 - 10),
            Scalar::Bool => Value::Bool(self.below(2) == 0),
        }
    }
}

/// Builds and verifies a graph.
pub fn graph(precision: Precision, build: impl FnOnce(&mut Builder<'_>)) -> Verified {
    let mut builder = Builder::new(Mode::Real(precision), 1_000_000, &Unwatched);
    build(&mut builder);
    verify(builder.finish().expect("within budget")).expect("well formed")
}

/// A graph of one operation.
pub fn single(op: Op, precision: Precision) -> Verified {
    graph(precision, |b| {
        let operands = op.def().operands.iter().enumerate();
        let args: Vec<NodeId> = operands.map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
        let result = b.op(op, &args);
        b.output("y", result);
    })
}

pub const KINDS: [Scalar; 3] = [Scalar::Real, Scalar::Int, Scalar::Bool];

/// What random graphs are grown of.
pub struct Soil {
    /// The operations.
    pub operations: Vec<Op>,
    /// Whether loops run a few times at most, so that the graph can be evaluated.
    pub short: bool,
}

impl Soil {
    /// All operations that a family of targets has instructions for, and loops of any length.
    pub fn of(family: Family) -> Self {
        let operations = Op::ALL.iter().copied().filter(|op| op.def().fragment(family).is_none()).collect();
        Self { operations, short: false }
    }

    /// The same for graphs that are evaluated: without operations that mean nothing for some operands.
    pub fn to_evaluate(family: Family) -> Self {
        let mut soil = Self { short: true, ..Self::of(family) };
        soil.operations.retain(|op| !op.is_partial());
        soil
    }
}

/// A random graph with two inputs and two outputs of each kind, of so many steps in the outermost region.
pub fn random(seed: u64, precision: Precision, soil: &Soil, steps: usize) -> Verified {
    graph(precision, |b| {
        let visible = (0..6).map(|i| b.input(format!("in{i}"), KINDS[i % 3])).collect();
        let mut garden = Garden { b, random: &mut Random(seed), visible, soil };
        garden.grow(3, steps);
        for i in 0..6 {
            let node = garden.pick(KINDS[i % 3]);
            garden.b.output(format!("out{i}"), node);
        }
    })
}

struct Garden<'a, 'w> {
    b: &'a mut Builder<'w>,
    random: &'a mut Random,
    visible: Vec<NodeId>,
    soil: &'a Soil,
}

impl Garden<'_, '_> {
    fn pick(&mut self, scalar: Scalar) -> NodeId {
        let fitting: Vec<NodeId> =
            self.visible.iter().copied().filter(|id| self.b.graph().scalar(*id) == scalar).collect();
        if fitting.is_empty() || self.random.below(10) == 0 {
            let value = self.random.value(scalar);
            return self.b.constant(value);
        }
        // Prefer recent values, so that graphs get deep.
        let back = self.random.below(fitting.len()).min(self.random.below(fitting.len()));
        fitting[fitting.len() - 1 - back]
    }

    fn kinds(&mut self, most: usize) -> Vec<Scalar> {
        (0..1 + self.random.below(most)).map(|_| KINDS[self.random.below(3)]).collect()
    }

    fn operation(&mut self) {
        let op = self.soil.operations[self.random.below(self.soil.operations.len())];
        let args: Vec<NodeId> = op.def().operands.iter().map(|s| self.pick(*s)).collect();
        let id = self.b.op(op, &args);
        self.visible.push(id);
    }

    fn grow(&mut self, depth: usize, steps: usize) {
        for _ in 0..steps {
            match self.random.below(if depth > 0 { 12 } else { 8 }) {
                8 | 9 => self.branch(depth - 1),
                10 => self.cycle(depth - 1),
                11 => self.taped(depth - 1),
                _ => self.operation(),
            }
        }
    }

    /// Joins of values of the sides, of values around them and of values that come later.
    fn branch(&mut self, depth: usize) {
        let cond = self.pick(Scalar::Bool);
        let outside = self.visible.len();
        let kinds = self.kinds(4);
        self.b.gamma(cond);
        let steps = self.random.below(7);
        self.grow(depth, steps);
        let thens: Vec<NodeId> = kinds.iter().map(|s| self.pick(*s)).collect();
        self.visible.truncate(outside);
        self.b.otherwise();
        let steps = self.random.below(7);
        self.grow(depth, steps);
        let others: Vec<NodeId> = kinds.iter().map(|s| self.pick(*s)).collect();
        self.visible.truncate(outside);
        let end = self.b.end();
        if self.random.below(3) == 0 {
            self.operation();
            self.operation();
        }
        let mut joins = Vec::new();
        for ((kind, then), other) in kinds.iter().zip(thens).zip(others) {
            let (then, other) = match self.random.below(6) {
                0 => (self.pick(*kind), other),
                1 => (then, self.pick(*kind)),
                2 => (self.pick(*kind), self.pick(*kind)),
                _ => (then, other),
            };
            joins.push(self.b.join(end, then, other));
        }
        self.visible.extend(joins);
    }

    /// An end of a loop.
    fn end(&mut self) -> NodeId {
        let x = self.pick(Scalar::Int);
        if !self.soil.short {
            return x;
        }
        let (lo, hi) = (self.b.int(-2), self.b.int(3));
        let x = self.b.op(Op::IntMax, &[x, lo]);
        self.b.op(Op::IntMin, &[x, hi])
    }

    fn cycle(&mut self, depth: usize) {
        let (lo, hi) = (self.end(), self.end());
        self.body(depth, lo, hi, &[]);
    }

    /// A loop that leaves tapes, and one that reads them.
    fn taped(&mut self, depth: usize) {
        let (lo, hi) = (self.b.int(-2), self.b.int(5));
        let every = 1 + self.random.below(3) as u32;
        let (end, carried) = self.body(depth, lo, hi, &[]);
        let tapes: Vec<NodeId> = carried.iter().map(|variable| self.b.tape(end, *variable, every)).collect();
        let (none, length) = (self.b.int(0), self.b.int(7_u32.div_ceil(every) as i32));
        self.body(depth, none, length, &tapes);
    }

    fn body(&mut self, depth: usize, lo: NodeId, hi: NodeId, tapes: &[NodeId]) -> (NodeId, Vec<NodeId>) {
        let outside = self.visible.len();
        let kinds = self.kinds(3);
        let inits: Vec<NodeId> = kinds.iter().map(|s| self.pick(*s)).collect();
        self.b.theta(lo, hi);
        let counter = self.b.counter();
        let carried: Vec<NodeId> = inits.into_iter().map(|init| self.b.carried(init)).collect();
        self.visible.push(counter);
        self.visible.extend(&carried);
        for tape in tapes {
            let recalled = self.b.recall(*tape, counter);
            self.visible.push(recalled);
        }
        let steps = self.random.below(8);
        self.grow(depth, steps);
        let nexts: Vec<NodeId> = kinds.iter().map(|s| self.pick(*s)).collect();
        self.visible.truncate(outside);
        let end = self.b.end();
        for (variable, next) in carried.iter().zip(nexts) {
            let last = self.b.carry_out(end, *variable, next);
            self.visible.push(last);
        }
        (end, carried)
    }
}
