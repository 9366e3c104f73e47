//! Kernels against correctly rounded functions (core-math): the limits of LANGUAGE 17.4, the values that are exact, and
//! the shape of the fragments. Knows nothing of how a kernel works.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4, PI, SQRT_2, TAU};

use core_math as exact;
use isograd_graph::{Builder, Evaluator, Graph, Mode, Node, NodeId, Op, Precision, Scalar, Unwatched, Value, ops};

#[rustfmt::skip]
const KERNELS: &[Op] = &[
    Op::Exp, Op::Exp2, Op::Log, Op::Log2, Op::Pow,
    Op::Sin, Op::Cos, Op::Tan, Op::Asin, Op::Acos, Op::Atan, Op::Atan2,
    Op::Sinh, Op::Cosh, Op::Tanh, Op::Asinh, Op::Acosh, Op::Atanh,
    Op::Softplus, Op::Sigmoid,
];

const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

const INF: f64 = f64::INFINITY;
const NAN: f64 = f64::NAN;

/// The correctly rounded f64.
fn reference(op: Op, x: f64, y: f64) -> f64 {
    match op {
        Op::Exp => exact::exp(x),
        Op::Exp2 => exact::exp2(x),
        Op::Log => exact::log(x),
        Op::Log2 => exact::log2(x),
        Op::Pow => exact::pow(x, y),
        Op::Sin => exact::sin(x),
        Op::Cos => exact::cos(x),
        Op::Tan => exact::tan(x),
        Op::Asin => exact::asin(x),
        Op::Acos => exact::acos(x),
        Op::Atan => exact::atan(x),
        Op::Atan2 => exact::atan2(x, y),
        Op::Sinh => exact::sinh(x),
        Op::Cosh => exact::cosh(x),
        Op::Tanh => exact::tanh(x),
        Op::Asinh => exact::asinh(x),
        Op::Acosh => exact::acosh(x),
        Op::Atanh => exact::atanh(x),
        // Within 1½ units of the correctly rounded f64.
        Op::Softplus => exact::log1p(exact::exp(-x.abs())) + if x < 0.0 { 0.0 } else { x },
        Op::Sigmoid => (if x < 0.0 { exact::exp(x) } else { 1.0 }) / (1.0 + exact::exp(-x.abs())),
        _ => panic!("{op} is no kernel"),
    }
}

fn fragment(op: Op, mode: Mode, p: Precision) -> Graph {
    let mut b = Builder::new(mode, 100_000, &Unwatched);
    let args: Vec<NodeId> = op.def().operands.iter().map(|s| b.input("x", *s)).collect();
    let ops::Lowering::Fragment(kernel) = op.def().lowering else { panic!("{op} has no kernel") };
    let result = kernel(&mut b, &args, p);
    b.output("result", result);
    b.finish().unwrap()
}

/// Evaluates the fragment of one kernel.
struct Kernel<'g> {
    op: Op,
    p: Precision,
    evaluator: Evaluator<'g>,
}

impl<'g> Kernel<'g> {
    fn new(op: Op, p: Precision, graph: &'g Graph) -> Self {
        Self { op, p, evaluator: Evaluator::new(graph, p) }
    }

    fn at(&mut self, x: f64, y: f64) -> f64 {
        match self.evaluator.run(&[Value::Real(x), Value::Real(y)]).unwrap()[..] {
            [Value::Real(r)] => r,
            _ => panic!("no real"),
        }
    }

    /// The error at a point in units in the last place. In f64 it is a bound: the distance to the correctly rounded
    /// result, plus the ½ that this may be away from the exact one. Infinite if the kind of result is wrong.
    fn error(&mut self, x: f64, y: f64) -> f64 {
        let (got, want) = (self.at(x, y), reference(self.op, x, y));
        let (least, digits, bias, beyond) = match self.p {
            Precision::F32 => (f64::from(f32::MIN_POSITIVE), 23, -126, 0.0),
            Precision::F64 => (f64::MIN_POSITIVE, 52, -1022, 0.5),
        };
        if want.is_nan() || got.is_nan() {
            return if want.is_nan() && got.is_nan() { 0.0 } else { INF };
        }
        if want.abs() < least {
            // Not normal: from 0 up to the least normal number, with the right sign.
            let sign = got == 0.0 || want == 0.0 || got.is_sign_negative() == want.is_sign_negative();
            return if got.abs() <= least && sign { 0.0 } else { INF };
        }
        let rounded = self.p.round(want);
        if rounded.is_infinite() || got.is_infinite() {
            return if got == rounded { 0.0 } else { INF };
        }
        let exponent = i32::try_from(want.to_bits() >> 52 & 0x7ff).unwrap() - 1023;
        // In two steps: the unit itself may be subnormal.
        (got - want).abs() * 2f64.powi(-exponent.max(bias)) * 2f64.powi(digits) + beyond
    }
}

/// The worst error of a kernel and where it is.
struct Worst {
    error: f64,
    at: (f64, f64),
    points: u32,
}

fn sweep(kernel: &mut Kernel<'_>, points: impl Iterator<Item = (f64, f64)>) -> Worst {
    let mut worst = Worst { error: -1.0, at: (NAN, NAN), points: 0 };
    for (x, y) in points {
        let (x, y) = (kernel.p.round(x), kernel.p.round(y));
        worst.points += 1;
        if matches!(kernel.op, Op::Sin | Op::Cos | Op::Tan) && x.abs() > 8192.0 {
            let r = kernel.at(x, y);
            let fits = if x.is_finite() { !r.is_nan() && (kernel.op == Op::Tan || r.abs() <= 1.0) } else { r.is_nan() };
            assert!(fits, "{} {} at {x:e} is {r:e}", kernel.p.name(), kernel.op);
            continue;
        }
        let error = kernel.error(x, y);
        if error > worst.error {
            (worst.error, worst.at) = (error, (x, y));
        }
    }
    worst
}

/// `SplitMix64`: seeded points.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 * 2f64.powi(-53))
    }

    /// Of either sign, the logarithm of its magnitude uniform.
    fn scaled(&mut self, low: f64, high: f64) -> f64 {
        let size = self.between(low, high).exp2();
        if self.bits() & 1 == 0 { size } else { -size }
    }

    /// Arguments with which the kernel has something to lose.
    fn interesting(&mut self, op: Op, p: Precision) -> (f64, f64) {
        let way = self.bits() % 4;
        let (digits, range) = if p == Precision::F32 { (24.0, 128.0) } else { (53.0, 1024.0) };
        let one = match (op, way) {
            (Op::Exp, 0) => self.between(-0.7 * range, 0.7 * range),
            (Op::Sinh | Op::Cosh, 0) => self.between(-0.7 * range, 0.7 * range),
            (Op::Exp2, 0) => self.between(-range - digits, range),
            (Op::Exp | Op::Exp2 | Op::Tanh, 1) => self.between(-1.0, 1.0),
            (Op::Tanh, 0) => self.between(-20.0, 20.0),
            (Op::Sinh | Op::Cosh | Op::Asinh, 1) => self.between(-2.0, 2.0),
            (Op::Sinh | Op::Cosh | Op::Tanh | Op::Asinh | Op::Atanh, 2) => self.scaled(-digits, 3.0),
            (Op::Atanh, 0 | 1) => self.between(-1.0, 1.0),
            (Op::Atanh, _) => 1.0 - self.scaled(-digits, -1.0).abs(),
            (Op::Acosh, 0) => 1.0 + self.scaled(-digits, 3.0).abs(),
            (Op::Acosh, 1) => self.between(1.0, 4.0),
            (Op::Acosh, _) => self.scaled(0.0, range).abs(),
            (Op::Log | Op::Log2, 0) => 1.0 + self.scaled(-digits, -1.0),
            (Op::Log | Op::Log2, 1) => self.between(0.5, 2.0),
            (Op::Log | Op::Log2, _) => self.scaled(-range - 10.0, range).abs(),
            (Op::Asin | Op::Acos, 0 | 1) => self.between(-1.0, 1.0),
            (Op::Asin | Op::Acos, 2) => 1.0 - self.scaled(-digits, -1.0).abs(),
            (Op::Atan, 0 | 1) => self.between(-4.0, 4.0),
            (Op::Sin | Op::Cos | Op::Tan, 0) => self.between(-8192.0, 8192.0),
            (Op::Sin | Op::Cos | Op::Tan, 1) => self.between(-7.0, 7.0),
            (Op::Sin | Op::Cos | Op::Tan, 2) => {
                let multiple = (self.bits() % 5215) as f64 * FRAC_PI_2;
                multiple + self.scaled(-digits, 0.0)
            }
            (Op::Pow, 3) => return (self.scaled(-8.0, 8.0).abs(), (self.between(-8.0, 8.0) * 2.0).round() / 2.0),
            (Op::Pow, _) => {
                let base = match way {
                    0 => self.between(0.0, 4.0),
                    1 => 1.0 + self.scaled(2.0 - digits, -1.0),
                    _ => self.scaled(-range, range).abs(),
                };
                let limit = range / base.log2();
                return (base, self.between(-limit, limit));
            }
            (Op::Atan2, 0) => return (self.between(-1.0, 1.0), self.between(-1.0, 1.0)),
            (Op::Atan2, _) => {
                let scale = self.scaled(-100.0, 100.0);
                return (scale * self.between(-1.0, 1.0), scale * self.scaled(-9.0, 3.0));
            }
            _ => self.scaled(-range, range),
        };
        (one, 0.0)
    }
}

/// Points whose neighbourhoods are swept densely: where ranges, octants and formulas meet.
#[rustfmt::skip]
const SPECIAL: &[f64] = &[
    0.0, 0.25, 0.5, 0.55, FRAC_1_SQRT_2, FRAC_PI_4, 0.9, 1.0, SQRT_2, FRAC_PI_2, 2.0, 3.0 * FRAC_PI_4, 3.0, PI, 4.0,
    TAU, 9.01, 19.06, 20.0, 87.336_54, 88.376_26, 88.722_84, 89.415_99, 89.5, 103.97, 126.0, 128.0, 149.0, 150.0,
    252.898_21, 708.396, 709.78, 710.475_86, 710.5, 745.13, 1022.0, 1024.0, 1074.0, 1075.0, 8192.0, 65_536.0,
    1_152_921_504_606_846_976.0, 1.175_494_4e-38, 2.225_073_858_507_201_4e-308, 8.5e37, 1.7e38, 3.4e38, 4.49e307, 1.79e308,
];

fn neighbours(p: Precision) -> impl Iterator<Item = f64> {
    SPECIAL.iter().flat_map(move |special| {
        (-40_i32..=40).flat_map(move |step| {
            let x = match p {
                Precision::F32 => f64::from(f32::from_bits((*special as f32).to_bits().saturating_add_signed(step))),
                Precision::F64 => f64::from_bits(special.to_bits().saturating_add_signed(step.into())),
            };
            [x, -x]
        })
    })
}

/// Worst errors in a precision, against the limit.
fn check(p: Precision, stride: usize, random: u32, limit: f64) {
    let mut failures = Vec::new();
    for &op in KERNELS {
        let graph = fragment(op, Mode::Raw, p);
        let mut kernel = Kernel::new(op, p, &graph);
        let mut seeds = Random(42);
        let seeded = (0..random).map(|_| seeds.interesting(op, p));
        let worst = if op.def().operands.len() == 2 {
            let near: Vec<f64> = neighbours(p).step_by(37).collect();
            let pairs = near.iter().flat_map(|x| near.iter().map(|y| (*x, *y)));
            sweep(&mut kernel, seeded.chain(pairs))
        } else {
            let bits = (0..=u32::MAX).step_by(stride).map(|bits| f64::from(f32::from_bits(bits)));
            sweep(&mut kernel, seeded.chain(bits.chain(neighbours(p)).map(|x| (x, 0.0))))
        };
        println!(
            "{} {:6} {:3} operations, worst {:.3} ulp at {:e}, {:e} ({} points)",
            p.name(),
            op.def().name,
            graph.operations(),
            worst.error,
            worst.at.0,
            worst.at.1,
            worst.points
        );
        if worst.error > limit {
            failures.push((op, worst.error, worst.at));
        }
    }
    assert!(failures.is_empty(), "above {limit} ulp: {failures:?}");
}

#[test]
fn f32_is_within_2_ulp() {
    check(Precision::F32, 16_411, 60_000, 2.0);
}

#[test]
fn f64_is_within_4_ulp() {
    check(Precision::F64, 200_003, 60_000, 4.0);
}

/// sin, cos and tan next to all multiples of π/4 that LANGUAGE 17.4 covers: where the reduction has least to hold on to,
/// and where quadrants meet.
#[test]
fn quadrants_are_accurate() {
    for (p, limit) in [(Precision::F32, 2.0), (Precision::F64, 4.0)] {
        for op in [Op::Sin, Op::Cos, Op::Tan] {
            let graph = fragment(op, Mode::Raw, p);
            let mut kernel = Kernel::new(op, p, &graph);
            let points = (0..2 * 5215).flat_map(|k| {
                let x = p.round(f64::from(k) * FRAC_PI_4);
                let up = if p == Precision::F32 { f64::from((x as f32).next_up()) } else { x.next_up() };
                [(x, 0.0), (-up, 0.0)]
            });
            let worst = sweep(&mut kernel, points);
            assert!(worst.error <= limit, "{op} {} {:?} {}", p.name(), worst.at, worst.error);
        }
    }
}

/// Where the reduction of sin and cos loses digits: the error that `kernels::trig` states.
#[test]
fn beyond_8192_the_error_grows_slowly() {
    for (p, last, limit) in [(Precision::F32, 65_536.0, 2e-6), (Precision::F64, 1_073_741_824.0, 1e-7)] {
        for op in [Op::Sin, Op::Cos] {
            let graph = fragment(op, Mode::Raw, p);
            let mut kernel = Kernel::new(op, p, &graph);
            let mut seeds = Random(7);
            let mut worst: f64 = 0.0;
            for _ in 0..20_000 {
                let x = p.round(seeds.scaled(13.0, f64::log2(last)));
                worst = worst.max((kernel.at(x, 0.0) - reference(op, x, 0.0)).abs());
            }
            println!("{} {op} up to {last}: off by {worst:e}", p.name());
            assert!(worst <= limit, "{} {op} {worst:e}", p.name());
        }
    }
}

fn assert_exact(op: Op, cases: &[(f64, f64, f64)]) {
    for p in PRECISIONS {
        let graph = fragment(op, Mode::Raw, p);
        let mut kernel = Kernel::new(op, p, &graph);
        for &(x, y, want) in cases {
            let (x, y, want) = (p.round(x), p.round(y), p.round(want));
            let got = kernel.at(x, y);
            let same = Value::Real(got).same_bits(Value::Real(want));
            assert!(same, "{} {op}({x:e}, {y:e}) is {got:e}, not {want:e}", p.name());
        }
    }
}

fn assert_exact_unary(op: Op, cases: &[(f64, f64)]) {
    assert_exact(op, &cases.iter().map(|(x, r)| (*x, 0.0, *r)).collect::<Vec<_>>());
}

#[test]
fn special_values_of_one_argument_are_exact() {
    let exp = [(0.0, 1.0), (-0.0, 1.0), (INF, INF), (-INF, 0.0), (NAN, NAN), (1e30, INF), (-1e30, 0.0), (1e-40, 1.0)];
    assert_exact_unary(Op::Exp, &exp);
    let log = [(1.0, 0.0), (0.0, -INF), (-0.0, -INF), (-1.0, NAN), (-INF, NAN), (-1e-40, NAN), (INF, INF), (NAN, NAN)];
    assert_exact_unary(Op::Log, &log);
    assert_exact_unary(Op::Log2, &log);
    let exp2 = [(0.0, 1.0), (-0.0, 1.0), (INF, INF), (-INF, 0.0), (NAN, NAN), (1e30, INF), (-1e30, 0.0), (1e-40, 1.0)];
    assert_exact_unary(Op::Exp2, &exp2);
    let undefined = [(INF, NAN), (-INF, NAN), (NAN, NAN)];
    for op in [Op::Sin, Op::Cos, Op::Tan, Op::Asin, Op::Acos] {
        assert_exact_unary(op, &undefined);
    }
    for op in [Op::Sin, Op::Tan, Op::Asin, Op::Atan] {
        assert_exact_unary(op, &[(0.0, 0.0), (-0.0, -0.0), (1e-30, 1e-30), (-1e-30, -1e-30), (1e-40, 1e-40)]);
    }
    assert_exact_unary(Op::Cos, &[(0.0, 1.0), (-0.0, 1.0), (1e-20, 1.0)]);
    assert_exact_unary(Op::Asin, &[(1.0, FRAC_PI_2), (-1.0, -FRAC_PI_2), (1.000_001, NAN), (-1.000_001, NAN)]);
    let acos = [(1.0, 0.0), (-1.0, PI), (0.0, FRAC_PI_2), (-0.0, FRAC_PI_2), (1.000_001, NAN), (-1.000_001, NAN)];
    assert_exact_unary(Op::Acos, &acos);
    assert_exact_unary(Op::Atan, &[(INF, FRAC_PI_2), (-INF, -FRAC_PI_2), (NAN, NAN), (1.0, FRAC_PI_4)]);
}

#[test]
fn powers_of_two_are_exact() {
    let powers = [-1074, -1022, -149, -126, -100, -2, -1, 0, 1, 2, 52, 100, 127, 1023];
    for p in PRECISIONS {
        let (exp2, log2) = (fragment(Op::Exp2, Mode::Raw, p), fragment(Op::Log2, Mode::Raw, p));
        let (mut exp2, mut log2) = (Kernel::new(Op::Exp2, p, &exp2), Kernel::new(Op::Log2, p, &log2));
        for n in powers.map(f64::from) {
            let power = p.round(n.exp2());
            assert_eq!(exp2.at(n, 0.0), power, "{} exp2({n})", p.name());
            if power > 0.0 && power.is_finite() {
                assert_eq!(log2.at(power, 0.0), n, "{} log2({power:e})", p.name());
            }
        }
    }
}

/// The limits of LANGUAGE 17.4 end at normal results, but subnormal numbers are numbers (17.1).
#[test]
fn subnormal_powers_are_within_a_unit() {
    for (p, from, to, unit) in
        [(Precision::F32, -151.0, -126.0, 2f64.powi(-149)), (Precision::F64, -1076.0, -1022.0, f64::from_bits(1))]
    {
        for (op, base) in [(Op::Exp, std::f64::consts::E), (Op::Exp2, 2.0), (Op::Pow, 3.0)] {
            let graph = fragment(op, Mode::Raw, p);
            let mut kernel = Kernel::new(op, p, &graph);
            let mut seeds = Random(5);
            for _ in 0..20_000 {
                let exponent = p.round(seeds.between(from, to) / base.log2());
                let (x, y) = if op == Op::Pow { (base, exponent) } else { (exponent, 0.0) };
                let (got, want) = (kernel.at(x, y), p.round(reference(op, x, y)));
                assert!((got - want).abs() <= unit, "{} {op}({x:e}, {y:e}) is {got:e}, not {want:e}", p.name());
            }
        }
    }
}

#[test]
fn hyperbolic_functions_follow_c() {
    for op in [Op::Sinh, Op::Tanh, Op::Asinh, Op::Atanh] {
        let small = [0.0, 1e-40, 1e-38, 1e-30, 1e-20];
        assert_exact_unary(op, &small.map(|x| (x, x)));
        assert_exact_unary(op, &small.map(|x| (-x, -x)));
        assert_exact_unary(op, &[(NAN, NAN)]);
    }
    assert_exact_unary(Op::Sinh, &[(INF, INF), (-INF, -INF), (1e30, INF), (-1e30, -INF)]);
    let cosh = [(0.0, 1.0), (-0.0, 1.0), (1e-40, 1.0), (INF, INF), (-INF, INF), (1e30, INF), (NAN, NAN)];
    assert_exact_unary(Op::Cosh, &cosh);
    assert_exact_unary(Op::Tanh, &[(INF, 1.0), (-INF, -1.0), (1e30, 1.0), (-25.0, -1.0)]);
    assert_exact_unary(Op::Asinh, &[(INF, INF), (-INF, -INF)]);
    let acosh =
        [(1.0, 0.0), (INF, INF), (-INF, NAN), (NAN, NAN), (0.0, NAN), (-1.0, NAN), (-3.0, NAN), (0.999_999, NAN)];
    assert_exact_unary(Op::Acosh, &acosh);
    let atanh = [(1.0, INF), (-1.0, -INF), (1.000_001, NAN), (-1.000_001, NAN), (3.0, NAN), (INF, NAN), (-INF, NAN)];
    assert_exact_unary(Op::Atanh, &atanh);
}

#[test]
fn steps_and_corners_saturate() {
    let sigmoid = [(0.0, 0.5), (-0.0, 0.5), (INF, 1.0), (-INF, 0.0), (1e30, 1.0), (-1e30, 0.0), (NAN, NAN)];
    assert_exact_unary(Op::Sigmoid, &sigmoid);
    let softplus = [(0.0, std::f64::consts::LN_2), (INF, INF), (-INF, 0.0), (1e30, 1e30), (-1e30, 0.0), (NAN, NAN)];
    assert_exact_unary(Op::Softplus, &softplus);
}

#[test]
fn atan2_follows_the_quadrants() {
    let mut cases = Vec::new();
    for sign in [1.0, -1.0] {
        for x in [0.0, 1e-40, 1.0, 1e30, INF] {
            cases.extend([(sign * 0.0, x, sign * 0.0), (sign * 0.0, -x, sign * PI)]);
        }
        for y in [1e-40, 1.0, 1e30, INF] {
            cases.extend([(sign * y, 0.0, sign * FRAC_PI_2), (sign * y, -0.0, sign * FRAC_PI_2)]);
        }
        for size in [1e-40, 1.0, 1e30] {
            cases.extend([(sign * size, INF, sign * 0.0), (sign * size, -INF, sign * PI)]);
            cases.extend([(sign * INF, size, sign * FRAC_PI_2), (sign * INF, -size, sign * FRAC_PI_2)]);
        }
        cases.extend([(sign * INF, INF, sign * FRAC_PI_4), (sign * INF, -INF, sign * 3.0 * FRAC_PI_4)]);
        for other in [0.0, 1.0, INF, NAN] {
            cases.extend([(NAN, sign * other, NAN), (sign * other, NAN, NAN)]);
        }
    }
    assert_exact(Op::Atan2, &cases);
}

#[test]
fn pow_follows_c() {
    let mut cases = Vec::new();
    for x in [0.0, -0.0, 1.0, -1.0, 0.3, -0.3, 7.5, -7.5, 1e-40, -1e-40, 1e30, INF, -INF, NAN] {
        cases.extend([(x, 0.0, 1.0), (x, -0.0, 1.0), (x, 1.0, x), (1.0, x, 1.0)]);
    }
    for (odd, even, part) in [(3.0, 2.0, 0.5), (1.0, 16_777_216.0, 2.5), (8_388_607.0, 1e10, 4_194_303.5)] {
        cases.extend([(0.0, odd, 0.0), (-0.0, odd, -0.0), (0.0, -odd, INF), (-0.0, -odd, -INF)]);
        cases.extend([(INF, odd, INF), (-INF, odd, -INF), (INF, -odd, 0.0), (-INF, -odd, -0.0)]);
        cases.extend([(-1.0, odd, -1.0), (-1.0, -odd, -1.0), (-1.0, even, 1.0), (-1.0, part, NAN)]);
        for (zero, far) in [(0.0, INF), (-0.0, -INF)] {
            for y in [even, part, INF] {
                cases.extend([(zero, y, 0.0), (zero, -y, INF), (far, y, INF), (far, -y, 0.0)]);
            }
        }
        cases.extend([(-2.0, part, NAN), (-2.0, -part, NAN), (-0.5, part, NAN)]);
    }
    for (small, large) in [(0.5, 2.0), (0.999_999, 1.000_001), (1e-40, 1e38), (-0.5, -2.0)] {
        cases.extend([(small, INF, 0.0), (small, -INF, INF), (large, INF, INF), (large, -INF, 0.0)]);
        cases.extend([(small, 1e30, 0.0), (small, -1e30, INF), (large, 1e30, INF), (large, -1e30, 0.0)]);
    }
    cases.extend([(-1.0, INF, 1.0), (-1.0, -INF, 1.0), (-2.0, 3.0, -8.0), (-2.0, -1.0, -0.5), (-2.0, 4.0, 16.0)]);
    cases.extend([(2.0, 10.0, 1024.0), (2.0, -126.0, 2f64.powi(-126)), (2.0, 127.0, 2f64.powi(127)), (4.0, 0.5, 2.0)]);
    cases.extend([
        (2.0, NAN, NAN),
        (NAN, 2.0, NAN),
        (0.0, NAN, NAN),
        (INF, NAN, NAN),
        (NAN, INF, NAN),
        (NAN, NAN, NAN),
    ]);
    assert_exact(Op::Pow, &cases);
}

/// No kernel needs another, so expanding fragments ends; and its constants are reals of the precision already.
#[test]
fn fragments_are_made_of_exact_operations() {
    for &op in KERNELS {
        for p in PRECISIONS {
            for mode in [Mode::Raw, Mode::Real(p)] {
                for (_, node) in fragment(op, mode, p).iter() {
                    match node {
                        Node::Apply(inner, _) => {
                            let direct = matches!(inner.def().lowering, ops::Lowering::Instructions { .. });
                            assert!(direct, "{op} contains {inner}");
                        }
                        Node::Real(bits) => {
                            let x = f64::from_bits(bits);
                            let fits = Value::Real(x).same_bits(Value::Real(p.round(x)));
                            assert!(fits, "{op} contains {x:e} in {}", p.name());
                        }
                        Node::Input(_) | Node::Int(_) | Node::Bool(_) => {}
                        other => panic!("{op} contains {other:?}"),
                    }
                }
            }
        }
    }
}

/// A folding builder computes a kernel of constants to one constant: the bits that the reference evaluator finds in the
/// raw fragment, and in the folded one.
#[test]
fn folding_preserves_bits() {
    for &op in KERNELS {
        for p in PRECISIONS {
            let (raw, folded) = (fragment(op, Mode::Raw, p), fragment(op, Mode::Real(p), p));
            assert!(folded.operations() <= raw.operations(), "{op}");
            let (mut raw, mut folded) = (Kernel::new(op, p, &raw), Kernel::new(op, p, &folded));
            let mut seeds = Random(3);
            let special = [0.0, -0.0, 1.0, -1.0, 0.5, INF, -INF, NAN, 1e-40, 1e38];
            let pairs = special.iter().flat_map(|x| special.iter().map(|y| (*x, *y)));
            let points: Vec<_> = pairs.chain((0..200).map(|_| seeds.interesting(op, p))).collect();
            for (x, y) in points {
                let (x, y) = (p.round(x), p.round(y));
                let mut args = vec![Value::Real(x), Value::Real(y)];
                args.truncate(op.def().operands.len());
                let constant = ops::constant(op, &args, p).unwrap_or_else(|| panic!("{op} did not fold"));
                assert!(constant.same_bits(Value::Real(raw.at(x, y))), "{op}({x:e}, {y:e})");
                assert!(constant.same_bits(Value::Real(folded.at(x, y))), "{op}({x:e}, {y:e})");
            }
        }
    }
}

/// sin and cos of one argument share the reduction and both polynomials, sinh and cosh the power.
#[test]
fn pairs_share() {
    for (one, other, more) in [(Op::Sin, Op::Cos, 3), (Op::Sinh, Op::Cosh, 1)] {
        for p in PRECISIONS {
            let mut b = Builder::new(Mode::Real(p), 100_000, &Unwatched);
            let x = b.input("x", Scalar::Real);
            for op in [one, other] {
                let ops::Lowering::Fragment(kernel) = op.def().lowering else { panic!("{op} has no kernel") };
                let result = kernel(&mut b, &[x], p);
                b.output(op.def().name, result);
            }
            let both = b.finish().unwrap().operations();
            assert!(both <= fragment(one, Mode::Real(p), p).operations() + more, "{one} {other}: {both}");
        }
    }
}
