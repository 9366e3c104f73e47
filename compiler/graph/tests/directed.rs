//! Directed operations against exact arithmetic: every result is the one right number of its side, in both precisions.
//! Knows nothing of how they are computed.

#![allow(clippy::pedantic, reason = "tests")]

use std::cmp::Ordering;

use dashu_float::{FBig, round::mode::Zero};
use isograd_graph::ops::Family;
use isograd_graph::{Builder, Evaluator, Graph, Mode, Node, NodeId, Op, Precision, Scalar, Unwatched, Value};

const INF: f64 = f64::INFINITY;
const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];
/// The two families differ in f32 only.
const KINDS: [(Precision, Family); 3] =
    [(Precision::F32, Family::Lanes), (Precision::F64, Family::Lanes), (Precision::F32, Family::Shader)];
const PAIRS: [(Op, Op); 4] =
    [(Op::AddDown, Op::AddUp), (Op::MulDown, Op::MulUp), (Op::DivDown, Op::DivUp), (Op::SqrtDown, Op::SqrtUp)];
#[rustfmt::skip]
const NEW: [Op; 17] = [
    Op::NextDown, Op::NextUp, Op::AddDown, Op::AddUp, Op::MulDown, Op::MulUp, Op::DivDown, Op::DivUp, Op::SqrtDown,
    Op::SqrtUp, Op::Above, Op::Below, Op::ProductBelow, Op::WideProductBelow,
    Op::WideProductAbove, Op::Raised, Op::Lowered,
];

/// `SplitMix64`: seeded points.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number of any size, with many or few digits; close to `near` in one of two cases.
    fn number(&mut self, p: Precision, near: f64) -> f64 {
        let bits = self.bits();
        let keep = self.bits() % 54;
        let mut x = f64::from_bits(bits & (!0 << keep));
        if p == Precision::F32 {
            let bits = (bits as u32) & (!0_u32 << (keep % 25));
            x = f64::from(f32::from_bits(bits));
        }
        if keep.is_multiple_of(2) && near.is_finite() && near != 0.0 {
            let exponent = (self.bits() % 120) as i32 - 60;
            x = p.round(near * 2f64.powi(exponent) * (1.0 + (bits >> 12) as f64 * 2f64.powi(-52)));
        }
        if x.is_nan() { 1.0 } else { x }
    }
}

/// A graph of one operation, its fragment expanded as far as a family of targets wants it.
fn graph(op: Op, p: Precision, family: Family) -> Graph {
    let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
    let args: Vec<NodeId> = op.def().operands.iter().map(|s| b.input("x", *s)).collect();
    let result = b.op(op, &args);
    b.output("result", result);
    expanded(b.finish().unwrap(), p, family)
}

/// A graph of one result, with fragments expanded until only instructions are left.
fn expanded(mut graph: Graph, p: Precision, family: Family) -> Graph {
    loop {
        let mut expanded = false;
        let mut b = Builder::new(Mode::Real(p), 1000, &Unwatched);
        let mut to: Vec<NodeId> = Vec::new();
        for (id, node) in graph.iter() {
            let id = match node {
                Node::Input(_) => b.input("x", graph.scalar(id)),
                Node::Real(bits) => b.real(f64::from_bits(bits)),
                Node::Int(x) => b.int(x),
                Node::Bool(x) => b.bool(x),
                Node::Apply(op, args) => {
                    let args: Vec<NodeId> = args.as_slice().iter().map(|a| to[a.index()]).collect();
                    match op.def().fragment(family) {
                        Some(fragment) => {
                            expanded = true;
                            fragment(&mut b, &args, p)
                        }
                        None => b.op(op, &args),
                    }
                }
                other => panic!("{other:?}"),
            };
            to.push(id);
        }
        let result = to[graph.outputs[0].node.index()];
        b.output("result", result);
        graph = b.finish().unwrap();
        if !expanded {
            return graph;
        }
    }
}

fn run(evaluator: &mut Evaluator<'_>, args: &[f64]) -> f64 {
    let args: Vec<Value> = args.iter().map(|x| Value::Real(*x)).collect();
    match evaluator.run(&args).unwrap()[..] {
        [Value::Real(r)] => r,
        _ => panic!("no real"),
    }
}

/// How the exact result compares with a number, in exact arithmetic; operands and number are finite.
fn compare(op: Op, x: f64, y: f64, t: f64, p: Precision) -> Ordering {
    if p == Precision::F64 {
        return compare_big(op, x, y, t);
    }
    let order = |a: f64, b: f64| a.partial_cmp(&b).unwrap();
    match op {
        // s + e = x + y exactly; s − t is exact where e could matter.
        Op::AddDown | Op::AddUp => {
            let s = x + y;
            let second = s - x;
            let e = (x - (s - second)) + (y - second);
            order((s - t) + e, 0.0)
        }
        Op::MulDown | Op::MulUp => order(x * y, t),
        Op::DivDown | Op::DivUp if y < 0.0 => order(t * y, x),
        Op::DivDown | Op::DivUp => order(x, t * y),
        _ if t < 0.0 => Ordering::Greater,
        _ => order(x, t * t),
    }
}

type Big = FBig<Zero, 2>;

/// A number of unlimited precision: sums and products of such are exact.
fn big(x: f64) -> Big {
    Big::try_from(x).unwrap().with_precision(0).value()
}

fn compare_big(op: Op, x: f64, y: f64, t: f64) -> Ordering {
    match op {
        Op::AddDown | Op::AddUp => (big(x) + big(y)).cmp(&big(t)),
        Op::MulDown | Op::MulUp => (big(x) * big(y)).cmp(&big(t)),
        Op::DivDown | Op::DivUp if y < 0.0 => (big(t) * big(y)).cmp(&big(x)),
        Op::DivDown | Op::DivUp => big(x).cmp(&(big(t) * big(y))),
        _ if t < 0.0 => Ordering::Greater,
        _ => big(x).cmp(&(big(t) * big(t))),
    }
}

fn up(x: f64, p: Precision) -> f64 {
    if p == Precision::F32 { f64::from((x as f32).next_up()) } else { x.next_up() }
}

/// Whether `got` is the largest number that is not above the exact result, which is finite.
fn is_lower(op: Op, x: f64, y: f64, got: f64, p: Precision) -> bool {
    let largest = if p == Precision::F32 { f64::from(f32::MAX) } else { f64::MAX };
    let above = up(got, p);
    let under = got == -INF || (got.is_finite() && compare(op, x, y, got, p).is_ge());
    let tight = got == largest || compare(op, x, y, if got == -INF { -largest } else { above }, p).is_lt();
    under && tight
}

/// One pair of operands through both sides.
fn judge(pair: (Op, Op), down: &mut Evaluator<'_>, upward: &mut Evaluator<'_>, x: f64, y: f64, p: Precision) {
    let (y, args) = if pair.0 == Op::SqrtDown { (1.0, vec![x]) } else { (y, vec![x, y]) };
    let (lo, hi) = (run(down, &args), run(upward, &args));
    let place = format!("{} {} of {x:e}, {y:e}: {lo:e}, {hi:e}", p.name(), pair.0);
    for (op, got) in [(pair.0, lo), (pair.1, hi)] {
        let values: Vec<Value> = args.iter().map(|x| Value::Real(*x)).collect();
        let eval = (op.def().eval.at(p))(&values);
        assert!(eval.same_bits(Value::Real(got)), "{place}, by reference {op} {eval:?}");
    }
    let plain = match pair.0 {
        Op::AddDown => x + y,
        Op::MulDown if (x == 0.0 && y.is_infinite()) || (y == 0.0 && x.is_infinite()) => 0.0,
        Op::MulDown => x * y,
        Op::DivDown => x / y,
        _ => x.sqrt(),
    };
    let finite = x.is_finite() && y.is_finite() && !(pair.0 == Op::DivDown && y == 0.0) && !plain.is_nan();
    if !finite {
        assert!([lo, hi].iter().all(|r| *r == plain || (r.is_nan() && plain.is_nan())), "{place}");
        return;
    }
    // √ is positive, so its mirror image is not √: the upper side is judged as the number above the lower, or the same.
    let exact = compare(pair.0, x, y, if lo.is_finite() { lo } else { 0.0 }, p).is_eq() && lo.is_finite();
    assert!(is_lower(pair.0, x, y, lo, p), "{place}");
    assert!(if exact { hi == lo } else { hi == up(lo, p) }, "{place}");
}

/// Numbers at every exponent: the least, the largest and some between, of both signs.
fn structured(p: Precision, stride: u64) -> Vec<f64> {
    let (exponents, digits): (u64, u64) = if p == Precision::F32 { (255, 23) } else { (2047, 52) };
    let most = (1 << digits) - 1;
    let mantissas = [0, 1, 1 << (digits / 2), most / 3, (most / 2) + 2, most - 1, most];
    let near = [0, 1, 2, digits, digits + 1, exponents / 2 - 1, exponents / 2, exponents / 2 + 1, exponents - 1];
    let mut all = vec![INF, -INF];
    for exponent in (0..exponents).filter(|e| e.is_multiple_of(stride) || near.contains(e)) {
        for mantissa in mantissas {
            let bits = exponent << digits | mantissa;
            let x = if p == Precision::F32 { f64::from(f32::from_bits(bits as u32)) } else { f64::from_bits(bits) };
            all.extend([x, -x]);
        }
    }
    all
}

fn sweep((p, family): (Precision, Family), stride: u64, other_stride: u64, random: u32) {
    for pair in PAIRS {
        let (one, other) = (graph(pair.0, p, family), graph(pair.1, p, family));
        let (mut down, mut upward) = (Evaluator::new(&one, p), Evaluator::new(&other, p));
        let seconds = if pair.0 == Op::SqrtDown { vec![1.0] } else { structured(p, other_stride) };
        for x in structured(p, stride) {
            for y in &seconds {
                judge(pair, &mut down, &mut upward, x, *y, p);
            }
        }
        let mut seeds = Random(42);
        for _ in 0..random {
            let x = seeds.number(p, 1.0);
            let y = seeds.number(p, x);
            judge(pair, &mut down, &mut upward, x, y, p);
        }
    }
}

#[test]
fn f32_has_the_one_right_answer() {
    sweep(KINDS[0], 1, 17, 400_000);
}

/// Without f64 beside it.
#[test]
fn f32_of_shaders_has_the_one_right_answer() {
    sweep(KINDS[2], 1, 17, 400_000);
}

#[test]
fn f64_has_the_one_right_answer() {
    sweep(KINDS[1], 61, 173, 30_000);
}

/// The long form.
#[test]
#[ignore = "minutes"]
fn many_pairs_have_the_one_right_answer() {
    sweep(KINDS[0], 1, 3, 10_000_000);
    sweep(KINDS[2], 1, 3, 10_000_000);
    sweep(KINDS[1], 13, 61, 1_000_000);
}

#[test]
fn neighbours_are_neighbours() {
    for p in PRECISIONS {
        let (down, above) = (graph(Op::NextDown, p, Family::Lanes), graph(Op::NextUp, p, Family::Lanes));
        let (mut down, mut above) = (Evaluator::new(&down, p), Evaluator::new(&above, p));
        for x in structured(p, 1) {
            assert_eq!(run(&mut above, &[x]).to_bits(), up(x, p).to_bits(), "{x:e}");
            assert_eq!(run(&mut down, &[x]).to_bits(), (-up(-x, p)).to_bits(), "{x:e}");
        }
    }
}

/// Constants are computed by the same fragments, in every mode but the raw one.
#[test]
fn constants_are_rounded_once_to_their_side() {
    for p in PRECISIONS {
        for op in NEW {
            let args: Vec<Value> = (op.def().operands.iter().zip([0.1, 0.3, 0.03]))
                .map(|(s, x)| if *s == Scalar::Bool { Value::Bool(true) } else { Value::Real(p.round(x)) })
                .collect();
            let want = (op.def().eval.at(p))(&args);
            assert!(isograd_graph::ops::constant(op, &args, p).unwrap().same_bits(want), "{op}");
            for mode in [Mode::Exact(p), Mode::Real(p)] {
                let mut b = Builder::new(mode, 1000, &Unwatched);
                let nodes: Vec<NodeId> = args.iter().map(|v| b.constant(*v)).collect();
                let got = b.op(op, &nodes);
                assert!(b.value(got).unwrap().same_bits(want), "{op} {mode:?}");
            }
        }
    }
}

/// What a fragment leaves out because it knows an operand makes no difference.
#[test]
fn known_operands_change_no_result() {
    let constants = [0.1, -3.0, 0.0, -0.0, 1e-42, 1e30, 3e38, -3e38, INF, -INF].map(Some);
    for ((p, family), op) in KINDS.into_iter().flat_map(|kind| PAIRS.map(|pair| (kind, pair.0))) {
        let other = PAIRS.into_iter().find(|pair| pair.0 == op).unwrap().1;
        for (op, constant) in [op, other].into_iter().flat_map(|op| {
            let none = [None, None];
            none.into_iter().chain(constants).enumerate().map(move |(form, c)| (op, (form, c)))
        }) {
            let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
            let inputs = [b.input("x", Scalar::Real), b.input("y", Scalar::Real)];
            let operands = match constant {
                (0, _) => inputs.map(|x| b.abs(x)),
                (_, None) => [inputs[0], inputs[0]],
                (_, Some(c)) => [inputs[0], b.real(p.round(c))],
            };
            let result = b.op(op, &operands[..op.def().operands.len()]);
            b.output("result", result);
            let graph = expanded(b.finish().unwrap(), p, family);
            let mut evaluator = Evaluator::new(&graph, p);
            let numbers = structured(p, if p == Precision::F32 { 17 } else { 211 });
            let mut seeds = Random(3);
            let random = (0..2_000).map(|_| {
                let x = seeds.number(p, 1.0);
                (x, seeds.number(p, x))
            });
            let pairs = numbers.iter().flat_map(|x| numbers.iter().step_by(3).map(|y| (*x, *y)));
            for (x, y) in pairs.chain(random) {
                let values = match constant {
                    (0, _) => [x.abs(), y.abs()],
                    (_, None) => [x, x],
                    (_, Some(c)) => [x, p.round(c)],
                }
                .map(Value::Real);
                let want = (op.def().eval.at(p))(&values[..op.def().operands.len()]);
                let got = Value::Real(run(&mut evaluator, &[x, y]));
                let undefined = matches!(want, Value::Real(r) if r.is_nan());
                assert!(undefined || got.same_bits(want), "{} {op} of {values:?}: {got:?}, not {want:?}", p.name());
            }
        }
    }
}

/// Products that are next to the number they are compared with, on it and beside it.
#[test]
fn products_are_compared_exactly() {
    for (p, family) in KINDS {
        let product = graph(Op::ProductBelow, p, family);
        let mut evaluator = Evaluator::new(&product, p);
        let mut seeds = Random(1);
        let numbers = structured(p, 89);
        let pairs = numbers.iter().flat_map(|x| numbers.iter().map(|y| (*x, *y))).collect::<Vec<_>>();
        let random = (0..20_000).map(|_| {
            let x = seeds.number(p, 1.0);
            (x, seeds.number(p, x))
        });
        for (x, y) in pairs.into_iter().chain(random) {
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            let near = p.round(x * y);
            for z in [near, up(near, p), -up(-near, p), 0.0, INF, -INF] {
                let args = [Value::Real(x), Value::Real(y), Value::Real(z)];
                let want = match z {
                    INF => true,
                    _ if z == -INF => false,
                    _ => (big(x) * big(y)) < big(z),
                };
                assert_eq!(evaluator.run(&args).unwrap(), [Value::Bool(want)], "{} {x:e} {y:e} {z:e}", p.name());
                let eval = (Op::ProductBelow.def().eval.at(p))(&args);
                assert_eq!(eval, Value::Bool(want), "{} {x:e} {y:e} {z:e}", p.name());
            }
        }
    }
}
