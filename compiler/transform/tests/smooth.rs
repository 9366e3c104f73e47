//! `smooth` mode on hand-made graphs (LANGUAGE 14.3): values within their bounds of the exact ones, derivatives those of
//! the values, weights through truth values, branches and loops, and the exact operation where nothing is finite.

mod support;

use isograd_graph::{
    Builder, Graph, Mode, Node, NodeId, Op, Origin, Precision, Scalar, Unwatched, Value, evaluate, print, verify,
};
use isograd_transform::{Sweep, Width, differentiate, fold, kept_jumps, optimise, schedule, smooth};
use support::lane_kernels;

const MANY: usize = 1_000_000;
const LN_2: f64 = std::f64::consts::LN_2;
const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

fn build(inputs: &[Scalar], make: impl FnOnce(&mut Builder<'_>, &[NodeId]) -> Vec<NodeId>) -> Graph {
    let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
    let inputs: Vec<_> = inputs.iter().map(|s| b.input("x", *s)).collect();
    for (i, node) in make(&mut b, &inputs).into_iter().enumerate() {
        b.output(format!("out{i}"), node);
    }
    verify(b.finish().unwrap()).unwrap().into_inner()
}

/// Of reals only.
fn reals(count: usize, make: impl FnOnce(&mut Builder<'_>, &[NodeId]) -> Vec<NodeId>) -> Graph {
    build(&vec![Scalar::Real; count], make)
}

fn smoothed(graph: &Graph, sensitivity: f64, precision: Precision) -> Graph {
    let width = Width::of(sensitivity, precision).unwrap();
    verify(smooth(graph, width, MANY, &Unwatched).unwrap().graph).unwrap().into_inner()
}

/// A smooth graph with its derivatives, before transcendental functions are expanded and after.
struct Finished {
    folded: Graph,
    scheduled: Graph,
    precision: Precision,
}

impl Finished {
    fn of(graph: &Graph, sensitivity: f64, precision: Precision, sweep: Sweep) -> Self {
        let plain = differentiate(
            smoothed(graph, sensitivity, precision),
            sweep,
            isograd_graph::Precision::F32,
            6,
            MANY,
            &Unwatched,
        )
        .unwrap();
        let step = |graph: Graph| verify(graph).unwrap().into_inner();
        let folded = step(fold(&step(plain), precision, MANY, &Unwatched).unwrap());
        let mut scheduled = folded.clone();
        for transform in [lane_kernels, optimise, schedule] {
            scheduled = step(transform(&scheduled, precision, MANY, &Unwatched).unwrap());
        }
        Self { folded, scheduled, precision }
    }

    /// What is emitted gives. The oracle must give nearly the same.
    fn at(&self, inputs: &[Value]) -> Vec<f64> {
        let inputs: Vec<Value> = inputs.iter().map(|v| rounded(*v, self.precision)).collect();
        let numbers = |graph| evaluate(graph, self.precision, &inputs).unwrap().into_iter().map(number).collect();
        let (whole, found): (Vec<f64>, Vec<f64>) = (numbers(&self.folded), numbers(&self.scheduled));
        let tolerance = if self.precision == Precision::F32 { 2e-5 } else { 1e-12 };
        for (a, b) in whole.iter().zip(&found) {
            let near = (a - b).abs() <= tolerance * (1.0 + b.abs());
            assert!(near || a.is_nan() && b.is_nan() || a == b, "{a} by the host, {b} by kernels at {inputs:?}");
        }
        found
    }
}

fn rounded(value: Value, precision: Precision) -> Value {
    match value {
        Value::Real(x) => Value::Real(precision.round(x)),
        other => other,
    }
}

fn number(value: Value) -> f64 {
    match value {
        Value::Real(x) => x,
        Value::Int(x) => f64::from(x),
        Value::Bool(x) => f64::from(u8::from(x)),
    }
}

fn run(graph: &Graph, sensitivity: f64, precision: Precision, inputs: &[f64]) -> Vec<f64> {
    let inputs: Vec<Value> = inputs.iter().map(|x| Value::Real(*x)).collect();
    Finished::of(graph, sensitivity, precision, Sweep::Forward).at(&inputs)
}

/// In both precisions and with both sweeps, to five digits.
fn check(graph: &Graph, cases: &[(&[Value], &[f64])]) {
    for precision in PRECISIONS {
        for sweep in [Sweep::Forward, Sweep::Reverse] {
            let finished = Finished::of(graph, 1.0, precision, sweep);
            for (inputs, want) in cases {
                let got = finished.at(inputs);
                assert_eq!(got.len(), want.len());
                for (got, want) in got.iter().zip(*want) {
                    let near = (got - want).abs() <= 1e-5 * want.abs().max(1.0) || got == want;
                    let shown = print(&finished.folded);
                    assert!(near, "{got} instead of {want} at {inputs:?}, {sweep:?} in {}\n{shown}", precision.name());
                }
            }
        }
    }
}

fn real(x: f64) -> Value {
    Value::Real(x)
}

/// σ(t)
fn share(t: f64) -> f64 {
    1.0 / (1.0 + (-t).exp())
}

#[test]
fn the_acceptance_rows() {
    let row_85 = reals(1, |b, i| {
        let size = b.abs(i[0]);
        let first = b.diff(size, i[0]);
        vec![size, first, b.diff(first, i[0])]
    });
    check(&row_85, &[(&[real(0.0)], &[0.000_693_15, 0.0, 1000.0])]);
    let row_86 = reals(1, |b, i| {
        let zero = b.real(0.0);
        let larger = b.max(i[0], zero);
        vec![larger, b.diff(larger, i[0])]
    });
    check(&row_86, &[(&[real(0.0)], &[0.000_693_15, 0.5]), (&[real(1.0)], &[1.0, 1.0])]);
    let row_87 = reals(1, |b, i| {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        let negative = b.lt(i[0], zero);
        b.gamma(negative);
        b.otherwise();
        let end = b.end();
        let y = b.join(end, zero, one);
        vec![y, b.diff(y, i[0])]
    });
    check(&row_87, &[(&[real(0.0)], &[0.5, 250.0])]);
}

/// The operations of two reals and of one that become smooth, with their exact forms.
type Exact = fn(f64, f64) -> f64;
const CORNERS: [(Op, Exact); 3] = [(Op::Max, f64::max), (Op::Min, f64::min), (Op::Abs, |x, _| x.abs())];

fn corner(op: Op, derivatives: usize) -> Graph {
    reals(2, |b, i| {
        let mut all = vec![b.op(op, &i[..op.def().operands.len()])];
        for _ in 0..derivatives {
            let last = *all.last().unwrap();
            all.push(b.diff(last, i[0]));
        }
        all
    })
}

#[test]
fn corners_are_off_by_at_most_the_width_times_ln_2() {
    for (op, exact) in CORNERS {
        for precision in PRECISIONS {
            for sensitivity in [1e-6, 1e-2, 1.0, 37.0, 1e4] {
                let (w, graph) = (1e-3 * sensitivity, corner(op, 0));
                let finished = Finished::of(&graph, sensitivity, precision, Sweep::Forward);
                for middle in [0.0, -0.3, 12.0] {
                    for apart in [0.0, 1e-3, 0.1, -0.7, 1.0, -3.0, 9.0, -30.0, 200.0, -740.0, 760.0, -5e4] {
                        let x = precision.round(if op == Op::Abs { apart * w / 2.0 } else { middle + apart * w });
                        let y = precision.round(middle);
                        let (got, want) = (finished.at(&[real(x), real(y)])[0], exact(x, y));
                        let unit = (x.abs() + y.abs()) * if precision == Precision::F32 { 1e-7 } else { 2e-16 };
                        let off = if op == Op::Min { want - got } else { got - want };
                        assert!(off >= -unit && off <= w * LN_2 * (1.0 + 1e-6) + unit, "{op} {x} {y}: off by {off}");
                        let t = if op == Op::Abs { 2.0 * x / w } else { (x - y) / w };
                        let bump = w * (-t.abs()).exp().ln_1p();
                        let near = w * 1e-5 + 2.0 * unit;
                        assert!((off - bump).abs() <= near, "{op} {x} {y} {}: {off}, not {bump}", precision.name());
                        if t.abs() > 110.0 && precision == Precision::F32 || t.abs() > 750.0 {
                            assert_eq!(got, want, "{op} far away");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_smaller_sensitivity_is_nearer_to_exact() {
    for (op, exact) in CORNERS {
        let mut before = f64::INFINITY;
        for sensitivity in [10.0, 1.0, 0.1, 1e-3, 1e-9] {
            let found = run(&corner(op, 2), sensitivity, Precision::F64, &[0.02, -0.01]);
            let off = (found[0] - exact(0.02, -0.01)).abs();
            assert!(off <= before, "{op} {sensitivity}: {off} after {before}");
            before = off;
        }
        assert_eq!(before, 0.0, "{op}");
        let slope = if op == Op::Min { 0.0 } else { 1.0 };
        let found = run(&corner(op, 2), 1e-9, Precision::F64, &[0.02, -0.01]);
        assert_eq!(found[1..], [slope, 0.0], "{op}");
    }
}

/// The derivatives of `b + w·sp((a−b)/w)` by a and of its relatives, up to the third.
fn closed_form(op: Op, x: f64, y: f64, w: f64) -> [f64; 3] {
    let t = if op == Op::Abs { 2.0 * x / w } else { (x - y) / w };
    let (s, r) = (share(t), share(-t));
    let (first, second, third) = (s, s * r / w, s * r * (r - s) / (w * w));
    match op {
        Op::Max => [first, second, third],
        Op::Min => [r, -second, -third],
        _ => [s - r, 4.0 * second, 8.0 * third],
    }
}

#[test]
fn derivatives_to_the_third_are_those_of_the_formula() {
    for (op, _) in CORNERS {
        for (precision, tolerance) in [(Precision::F32, 1e-4), (Precision::F64, 1e-11)] {
            for sweep in [Sweep::Forward, Sweep::Reverse] {
                let (w, finished) = (1e-3, Finished::of(&corner(op, 3), 1.0, precision, sweep));
                for t in [0.0, 0.5, -0.5, 1.0, -2.0, 7.0, -20.0, 80.0, -200.0, 749.0, -751.0, 1e5] {
                    let (x, y) = if op == Op::Abs { (t * w / 2.0, 0.0) } else { (0.25 + t * w, 0.25) };
                    let (x, y) = (precision.round(x), precision.round(y));
                    let got = finished.at(&[real(x), real(y)]);
                    let want = closed_form(op, x, y, w);
                    for (order, (got, want)) in got[1..].iter().zip(want).enumerate() {
                        let size = w.powi(-(order as i32));
                        let near = (got - want).abs() <= tolerance * size;
                        assert!(near, "{op} order {} at {t}: {got}, not {want}", order + 1);
                    }
                }
            }
        }
    }
}

/// A program with everything in it: corners, a step, a sign, a branch, a choice, truth values.
fn everything(b: &mut Builder<'_>, x: NodeId, y: NodeId) -> NodeId {
    let zero = b.real(0.0);
    let (left, above) = (b.lt(x, zero), b.le(zero, y));
    let both = b.and(left, above);
    let (larger, smaller, size, sign) = (b.max(x, y), b.min(x, y), b.abs(y), b.sign(x));
    b.gamma(both);
    let product = b.mul(larger, size);
    b.otherwise();
    let sum = b.add(smaller, sign);
    let end = b.end();
    let joined = b.join(end, product, sum);
    let other = b.not(left);
    let either = b.or(other, above);
    let chosen = b.select(either, joined, x);
    b.mul(chosen, sign)
}

#[test]
fn first_derivatives_are_slopes_of_the_value() {
    let graph = reals(2, |b, i| {
        let value = everything(b, i[0], i[1]);
        vec![value, b.diff(value, i[0]), b.diff(value, i[1])]
    });
    let sensitivity = 100.0;
    for sweep in [Sweep::Forward, Sweep::Reverse] {
        let finished = Finished::of(&graph, sensitivity, Precision::F64, sweep);
        let value = |x: f64, y: f64| finished.at(&[real(x), real(y)])[0];
        for (x, y) in [(0.0, 0.0), (0.05, 0.0), (-0.2, 0.03), (0.1, 0.1), (-0.4, -0.1), (0.0, 0.3), (2.0, -1.0)] {
            let found = finished.at(&[real(x), real(y)]);
            // Central differences of two steps, extrapolated (Richardson).
            let slope = |f: &dyn Fn(f64) -> f64| {
                let at = |h: f64| (f(h) - f(-h)) / (2.0 * h);
                (4.0 * at(5e-4) - at(1e-3)) / 3.0
            };
            for (got, want) in [(found[1], slope(&|h| value(x + h, y))), (found[2], slope(&|h| value(x, y + h)))] {
                assert!((got - want).abs() < 1e-6 * (1.0 + want.abs()), "{got}, not {want} at {x}, {y}");
            }
        }
    }
}

#[test]
fn truth_values_have_weights() {
    let graph = reals(2, |b, i| {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        let (s, t) = (b.lt(i[0], zero), b.le(i[1], zero));
        let (both, either, other) = (b.and(s, t), b.or(s, t), b.not(s));
        let picked = b.select_bool(s, t, other);
        [s, t, both, either, other, picked].map(|c| b.select(c, one, zero)).to_vec()
    });
    for (x, y) in [(0.0, 0.0), (1e-3, -2e-3), (-3e-3, 5e-4), (4.0, 1e-3), (-4.0, -4.0)] {
        let (s, t) = (share(-x / 1e-3), share(-y / 1e-3));
        let picked = if x <= 0.0 { t } else { 1.0 - s };
        let want = [s, t, s * t, 1.0 - (1.0 - s) * (1.0 - t), 1.0 - s, picked];
        check(&graph, &[(&[real(x), real(y)], &want)]);
    }
}

#[test]
fn truth_values_that_are_crisp_have_weight_0_or_1() {
    use Scalar::{Bool, Int, Real};
    let graph = build(&[Real, Int, Bool], |b, i| {
        let (zero, one, none) = (b.real(0.0), b.real(1.0), b.int(0));
        let (equal, differs, less) = (b.eq(i[0], zero), b.ne(i[0], zero), b.ilt(i[1], none));
        let soft = b.lt(i[0], zero);
        let mixed = [b.and(i[2], soft), b.or(less, soft), b.and(equal, soft), b.not(differs)];
        mixed.map(|c| b.select(c, one, zero)).to_vec()
    });
    let row = |x: f64, n: i32, c: bool| [real(x), Value::Int(n), Value::Bool(c)];
    let s = share(-0.5);
    check(
        &graph,
        &[
            (&row(5e-4, 3, true), &[s, s, 0.0, 0.0]),
            (&row(5e-4, -3, false), &[0.0, 1.0, 0.0, 0.0]),
            (&row(0.0, 0, true), &[0.5, 0.5, 0.5, 1.0]),
        ],
    );
}

#[test]
fn what_leaves_the_program_or_counts_is_at_least_one_half() {
    // Outputs, ints and loop bounds; at a tie `<` has the weight ½ and so holds.
    let graph = reals(1, |b, i| {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        let (none, three) = (b.int(0), b.int(3));
        let less = b.lt(i[0], zero);
        let count = b.select_int(less, three, none);
        b.theta(none, count);
        let sum = b.carried(zero);
        let next = b.add(sum, one);
        let end = b.end();
        vec![less, count, b.carry_out(end, sum, next)]
    });
    check(&graph, &[(&[real(-1e-4)], &[1.0, 3.0, 3.0]), (&[real(0.0)], &[1.0, 3.0, 3.0])]);
    check(&graph, &[(&[real(1e-4)], &[0.0, 0.0, 0.0])]);
}

#[test]
fn a_branch_blends_reals_and_picks_the_rest() {
    let graph = reals(1, |b, i| {
        let (zero, one, two) = (b.real(0.0), b.real(1.0), b.real(2.0));
        let (three, four) = (b.int(3), b.int(4));
        let negative = b.lt(i[0], zero);
        b.gamma(negative);
        let product = b.mul(i[0], two);
        let (inner, yes) = (b.lt(i[0], one), b.bool(true));
        b.otherwise();
        let (sum, no) = (b.add(i[0], one), b.bool(false));
        let end = b.end();
        let value = b.join(end, product, sum);
        let count = b.join(end, three, four);
        let (soft, crisp) = (b.join(end, inner, no), b.join(end, yes, no));
        let (soft, crisp) = (b.select(soft, one, zero), b.select(crisp, one, zero));
        vec![value, count, soft, crisp, b.diff(value, i[0])]
    });
    for x in [-2e-3, -1e-4, 3e-4, 5e-3] {
        let t = -x / 1e-3;
        let (s, r) = (share(t), share(-t));
        let value = s * 2.0 * x + r * (x + 1.0);
        let slope = s * 2.0 + r - s * r / 1e-3 * (2.0 * x - (x + 1.0));
        let picked = f64::from(u8::from(x < 0.0));
        check(&graph, &[(&[real(x)], &[value, 4.0 - picked, picked, picked, slope])]);
    }
}

#[test]
fn a_weight_goes_around_a_loop() {
    // c = true; for k in 0..3 { c = !(c && x < k); n = n + c } with crisp and soft variables beside.
    let graph = reals(1, |b, i| {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        let (none, three) = (b.int(0), b.int(3));
        let (yes, no) = (b.bool(true), b.bool(false));
        b.theta(none, three);
        let k = b.counter();
        let (sum, c, flip) = (b.carried(zero), b.carried(yes), b.carried(no));
        let level = b.int_to_real(k);
        let below = b.lt(i[0], level);
        let both = b.and(c, below);
        let next = b.not(both);
        let weight = b.select(next, one, zero);
        let more = b.add(sum, weight);
        let flipped = b.not(flip);
        let end = b.end();
        let (sum, c) = (b.carry_out(end, sum, more), b.carry_out(end, c, next));
        let flip = b.carry_out(end, flip, flipped);
        let weight = b.select(c, one, zero);
        vec![sum, weight, c, flip, b.diff(sum, i[0])]
    });
    for x in [1e-3, 1.0 + 5e-4, 2.0 - 2e-3, 7.0] {
        let along = |x: f64| {
            let (mut c, mut sum) = (1.0, 0.0);
            for k in 0..3 {
                c = 1.0 - c * share((f64::from(k) - x) / 1e-3);
                sum += c;
            }
            (sum, c)
        };
        let found = run(&graph, 1.0, Precision::F64, &[x]);
        let (sum, c) = along(x);
        let slope = (along(x + 1e-7).0 - along(x - 1e-7).0) / 2e-7;
        let want = [sum, c, f64::from(u8::from(c >= 0.5)), 1.0, slope];
        for (got, want) in found.iter().zip(want) {
            assert!((got - want).abs() < 1e-4 * (1.0 + want.abs()), "{found:?}, not {want} at {x}");
        }
        for precision in PRECISIONS {
            let finished = Finished::of(&graph, 1.0, precision, Sweep::Reverse);
            assert!((finished.at(&[real(x)])[0] - found[0]).abs() < 1e-3, "{}", precision.name());
        }
    }
}

#[test]
fn crisp_branches_stay_branches() {
    let graph = build(&[Scalar::Real, Scalar::Bool], |b, i| {
        b.gamma(i[1]);
        let zero = b.real(0.0);
        let larger = b.max(i[0], zero);
        b.otherwise();
        let root = b.sqrt(i[0]);
        let end = b.end();
        let value = b.join(end, larger, root);
        vec![value, b.diff(value, i[0])]
    });
    let gammas = |graph: &Graph| graph.iter().filter(|(_, n)| matches!(n, Node::Gamma { .. })).count();
    assert_eq!(gammas(&smoothed(&graph, 1.0, Precision::F64)), 1);
    // The side not taken contributes nothing, not even NaN.
    check(&graph, &[(&[real(-1.0), Value::Bool(true)], &[0.0, 0.0]), (&[real(4.0), Value::Bool(false)], &[2.0, 0.25])]);
}

#[test]
fn the_exact_operation_stands_where_nothing_is_finite() {
    // min(x, 1/x²) at 0
    let graph = reals(1, |b, i| {
        let one = b.real(1.0);
        let square = b.mul(i[0], i[0]);
        let pole = b.div(one, square);
        let least = b.min(i[0], pole);
        vec![least, b.diff(least, i[0])]
    });
    // At 1e-15 the slope of 1/x² is beyond f32, and it is out of the question.
    for x in [0.0, 1e-30, 1e-15] {
        check(&graph, &[(&[real(x)], &[x, 1.0])]);
    }
    let extremes = reals(2, |b, i| vec![b.min(i[0], i[1]), b.max(i[0], i[1]), b.abs(i[0]), b.sign(i[0])]);
    let infinite = f64::INFINITY;
    check(&extremes, &[(&[real(infinite), real(1.0)], &[1.0, infinite, infinite, 1.0])]);
    check(&extremes, &[(&[real(-infinite), real(-infinite)], &[-infinite, -infinite, infinite, -1.0])]);
    for precision in PRECISIONS {
        // As LANGUAGE 5.1: the first operand if the second is NaN; a NaN in the first stays.
        let least = run(&extremes, 1.0, precision, &[2.0, f64::NAN]);
        assert_eq!(least[..2], [2.0, 2.0]);
        assert!(run(&extremes, 1.0, precision, &[f64::NAN, 2.0]).iter().all(|x| x.is_nan()));
    }
    // if x < 0 { √(−x) } else { 1/x }: each side is no number, or infinite, somewhere on the other.
    let branch = reals(1, |b, i| {
        let (zero, one) = (b.real(0.0), b.real(1.0));
        let negative = b.lt(i[0], zero);
        b.gamma(negative);
        let opposite = b.neg(i[0]);
        let root = b.sqrt(opposite);
        b.otherwise();
        let inverse = b.div(one, i[0]);
        let end = b.end();
        let value = b.join(end, root, inverse);
        vec![value, b.diff(value, i[0])]
    });
    check(&branch, &[(&[real(0.5)], &[2.0, -4.0]), (&[real(1e-4)], &[1e4, -1e8]), (&[real(-4.0)], &[2.0, -0.25])]);
    // At 0 the weight is ½ and 1/0 is infinite: √0 it is, with the slope 0 of LANGUAGE 13.6.
    check(&branch, &[(&[real(0.0)], &[0.0, 0.0])]);
}

#[test]
fn what_is_far_from_chosen_contributes_nothing() {
    // The fourth derivative of x^2.5 is infinite at 0, where max(x^2.5, 5) is 5 by 5000 widths.
    let graph = reals(1, |b, i| {
        let (power, five) = (b.real(2.5), b.real(5.0));
        let steep = b.pow(i[0], power);
        let mut result = b.max(steep, five);
        let near = b.lt(i[0], five);
        let chosen = b.select(near, five, steep);
        let mut other = b.add(chosen, i[0]);
        for _ in 0..4 {
            (result, other) = (b.diff(result, i[0]), b.diff(other, i[0]));
        }
        vec![result, other]
    });
    check(&graph, &[(&[real(0.0)], &[0.0, 0.0])]);
}

#[test]
fn values_keep_their_identity() {
    let graph = reals(2, |b, i| {
        let (x, y) = (i[0], i[1]);
        let (larger, opposite, difference, size) = (b.max(x, y), b.neg(x), b.sub(x, y), b.abs(x));
        let same = b.max(x, opposite);
        let square = b.mul(larger, larger);
        let (below, zero) = (b.lt(x, y), b.real(0.0));
        let chosen = b.select(below, x, zero);
        let product = b.mul(chosen, x);
        vec![
            // By a value that is replaced: 2·max.
            b.diff(square, larger),
            // `max(x, −x)` and `abs(x)` are two values.
            b.diff(same, size),
            b.diff(size, same),
            // The formulas inside are no values of the program.
            b.diff(larger, difference),
            b.diff(size, opposite),
            b.diff(product, chosen),
        ]
    });
    check(&graph, &[(&[real(2.0), real(-3.0)], &[4.0, 0.0, 0.0, 0.0, 0.0, 2.0])]);
}

#[test]
fn a_diff_inside_of_a_blended_branch_works() {
    let graph = reals(1, |b, i| {
        let zero = b.real(0.0);
        let negative = b.lt(i[0], zero);
        b.gamma(negative);
        let square = b.mul(i[0], i[0]);
        let slope = b.diff(square, i[0]);
        b.otherwise();
        let end = b.end();
        vec![b.join(end, slope, zero)]
    });
    check(&graph, &[(&[real(-3.0)], &[-6.0]), (&[real(3.0)], &[0.0]), (&[real(-1e-3)], &[-2e-3 * share(1.0)])]);
}

#[test]
fn a_width_must_be_a_normal_number() {
    for precision in PRECISIONS {
        assert!(Width::of(1.0, precision).is_ok_and(|w| w.get() == 1e-3));
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-320] {
            assert!(Width::of(wrong, precision).is_err(), "{wrong}");
        }
    }
    assert!(Width::of(1e-40, Precision::F32).is_err() && Width::of(1e-40, Precision::F64).is_ok());
    // The least and the largest still compute.
    for (precision, x) in [(Precision::F32, 1e-37), (Precision::F64, 1e-303)] {
        let error = Width::of(0.0, precision).unwrap_err();
        for sensitivity in [error.least, error.most] {
            let found = run(&corner(Op::Max, 1), sensitivity, precision, &[precision.round(x), 0.0]);
            assert!(found.iter().all(|x| x.is_finite()), "{sensitivity}: {found:?}");
        }
    }
}

#[test]
fn jumps_on_the_way_of_a_derivative_are_found() {
    let jumps = |make: fn(&mut Builder<'_>, NodeId, NodeId) -> NodeId| {
        let graph = reals(2, |b, i| {
            b.set_origin(Origin(7));
            vec![make(b, i[0], i[1])]
        });
        kept_jumps(&graph, &Unwatched).into_iter().map(|j| (j.op, j.origin)).collect::<Vec<_>>()
    };
    let floor = [(Op::Floor, Origin(7))];
    assert_eq!(
        jumps(|b, x, y| {
            let z = b.floor(x);
            let z = b.mul(z, y);
            b.diff(z, x)
        }),
        floor
    );
    // Off the way: of another variable, not differentiated, or beside what is.
    assert_eq!(
        jumps(|b, x, y| {
            let z = b.floor(x);
            let z = b.mul(z, y);
            b.diff(z, y)
        }),
        []
    );
    assert_eq!(jumps(|b, x, _| b.floor(x)), []);
    assert_eq!(
        jumps(|b, x, _| {
            let z = b.mul(x, x);
            let z = b.diff(z, x);
            let w = b.floor(x);
            b.add(z, w)
        }),
        []
    );
    // Through ints, conditions and around a loop.
    let through = jumps(|b, x, y| {
        let n = b.real_to_int(x);
        let none = b.int(0);
        let positive = b.ilt(none, n);
        let z = b.select(positive, y, x);
        b.diff(z, x)
    });
    assert_eq!(through, [(Op::RealToInt, Origin(7))]);
    let around = jumps(|b, x, y| {
        let (none, three) = (b.int(0), b.int(3));
        b.theta(none, three);
        let (first, second) = (b.carried(y), b.carried(y));
        let whole = b.floor(first);
        let sum = b.add(second, whole);
        let next = b.add(first, x);
        let end = b.end();
        let (_, z) = (b.carry_out(end, first, next), b.carry_out(end, second, sum));
        b.diff(z, x)
    });
    assert_eq!(around, floor);
}
