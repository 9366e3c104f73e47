//! Enclosures of transcendental functions against correctly rounded ones (core-math): nothing escapes, little is given
//! away, and the flag says exactly where a function is undefined. Knows nothing of the rules.

#![allow(clippy::pedantic, reason = "tests")]

use std::f64::consts::{FRAC_PI_2, PI};

use core_math as exact;
use isograd_graph::{Builder, Enclosure, Facts, Mode, Op, Precision, Range, Unwatched, Value};

const INF: f64 = f64::INFINITY;
const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

type Function = fn(f64) -> f64;

#[rustfmt::skip]
const UNARY: &[(Op, Function)] = &[
    (Op::Exp, exact::exp), (Op::Exp2, exact::exp2), (Op::Log, exact::log), (Op::Log2, exact::log2),
    (Op::Sin, exact::sin), (Op::Cos, exact::cos), (Op::Tan, exact::tan),
    (Op::Asin, exact::asin), (Op::Acos, exact::acos), (Op::Atan, exact::atan),
    (Op::Sinh, exact::sinh), (Op::Cosh, exact::cosh), (Op::Tanh, exact::tanh),
    (Op::Asinh, exact::asinh), (Op::Acosh, exact::acosh), (Op::Atanh, exact::atanh),
];

/// `SplitMix64`: seeded boxes and points.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 * 2f64.powi(-53))
    }

    /// Of either sign, the logarithm of its magnitude uniform.
    fn scaled(&mut self, low: f64, high: f64) -> f64 {
        let size = self.between(low, high).exp2();
        if self.bits() & 1 == 0 { size } else { -size }
    }

    /// A number where functions have something to lose.
    fn end(&mut self, p: Precision) -> f64 {
        let range = if p == Precision::F32 { 149.0 } else { 1074.0 };
        let digits = if p == Precision::F32 { 24.0 } else { 53.0 };
        let x = match self.below(9) {
            0 => self.scaled(-range, range),
            1 => self.scaled(-8.0, 13.0),
            2 => self.between(-1.0, 1.0),
            3 => self.scaled(-1.0, 0.0).signum() * (1.0 - self.scaled(-digits, 0.0).abs()),
            4 => self.below(5215) as f64 * FRAC_PI_2 * self.scaled(0.0, 1.0).signum(),
            5 => self.between(-8.0, 8.0),
            6 => self.between(-110.0, 110.0) * if p == Precision::F32 { 1.0 } else { 7.0 },
            7 => self.below(12) as f64 - 6.0,
            _ => [0.0, -0.0, INF, -INF, 1.0, -1.0, 8192.0, -8192.0, 8192.5, 1e30][self.below(10) as usize],
        };
        p.round(x)
    }

    /// A range of any size: a point, a few numbers, some part of its magnitude, or wide.
    fn range(&mut self, p: Precision) -> (f64, f64) {
        let x = self.end(p);
        let y = match self.below(6) {
            0 => x,
            1 | 2 => {
                let few = self.below(12) as i64;
                from_order(order(x, p) + few, p)
            }
            3 if x.is_finite() => p.round(x + x.abs() * self.scaled(-12.0, 1.0)),
            4 => p.round(x + self.scaled(-3.0, 4.0)),
            _ => self.end(p),
        };
        if y < x { (y, x) } else { (x, y) }
    }

    /// Points of a range: its ends, and between them by value and by digits.
    fn points(&mut self, (lo, hi): (f64, f64), count: u64) -> Vec<f64> {
        let mut all = vec![lo, hi];
        for _ in 0..count {
            let (a, b) = (order(lo, Precision::F64), order(hi, Precision::F64));
            let way = self.below(3);
            let x = match way {
                0 => from_order(a + ((self.bits() as f64 / 2f64.powi(64)) * (b - a) as f64) as i64, Precision::F64),
                1 => self.between(lo.max(-1e300), hi.min(1e300)),
                _ => [lo, hi][self.below(2) as usize] * (1.0 + self.scaled(-52.0, -3.0)),
            };
            if lo <= x && x <= hi {
                all.push(x);
            }
        }
        all
    }
}

/// Numbers of a precision in order as integers.
fn order(x: f64, p: Precision) -> i64 {
    let bits = match p {
        Precision::F32 => (x as f32).to_bits() as i32 as i64,
        Precision::F64 => x.to_bits() as i64 / 2,
    };
    let most = if p == Precision::F32 { i64::from(i32::MIN) } else { i64::MIN / 2 };
    // Halved in f64, so that differences fit.
    if bits < 0 { most - bits } else { bits }
}

fn from_order(n: i64, p: Precision) -> f64 {
    match p {
        Precision::F32 => {
            let n = n.clamp(-0x7f80_0000, 0x7f80_0000) as i32;
            f64::from(f32::from_bits(if n < 0 { (i32::MIN - n) as u32 } else { n as u32 }))
        }
        Precision::F64 => {
            let most = 0x7ff0_0000_0000_0000_i64 / 2;
            let n = n.clamp(-most, most) * 2;
            f64::from_bits(if n < 0 { (i64::MIN - n) as u64 } else { n as u64 })
        }
    }
}

/// Steps from `a` up to `b`.
fn steps(a: f64, b: f64, p: Precision) -> i64 {
    match p {
        Precision::F32 => order(b, p) - order(a, p),
        // Twice the halved difference, and an odd bit at either end.
        Precision::F64 => 2 * (order(b, p) - order(a, p)),
    }
}

#[derive(Clone, Copy, Debug)]
struct Ends {
    lo: f64,
    hi: f64,
    nan: bool,
}

/// What the table says encloses the operation on boxes.
fn enclose(op: Op, boxes: &[(f64, f64)], mode: Mode) -> Ends {
    let mut b = Builder::new(mode, 100_000, &Unwatched);
    let operands: Vec<Enclosure> = boxes
        .iter()
        .map(|(lo, hi)| {
            let (lo, hi) = (b.real(*lo), b.real(*hi));
            Enclosure::Real(Range::of(&mut b, lo, hi))
        })
        .collect();
    let Enclosure::Real(range) = b.enclose(op, &operands, Facts::default()) else { panic!("{op} is real") };
    match [range.lo, range.hi, range.nan].map(|id| b.value(id)) {
        [Some(Value::Real(lo)), Some(Value::Real(hi)), Some(Value::Bool(nan))] => Ends { lo, hi, nan },
        other => panic!("{op} {boxes:?} did not fold: {other:?}"),
    }
}

/// Values that are reached, and never passed.
fn reached(x: f64) -> bool {
    x == 0.0 || x.abs() == 1.0 || x.is_infinite()
}

/// Every value inside; the ends at most 8 numbers outside of the least and the largest of them. Equality with an end
/// that is not exact would hide what rounding the value took.
fn judge(what: &str, ends: Ends, values: &[f64], p: Precision) {
    let (mut least, mut most) = (INF, -INF);
    for &v in values {
        assert!(!v.is_nan(), "{what}");
        let over = ends.lo < v || (ends.lo == v && reached(v)) || (v.abs() < 1e-300 && ends.lo <= v);
        let under = v < ends.hi || (ends.hi == v && reached(v)) || (v.abs() < 1e-300 && v <= ends.hi);
        assert!(over && under, "{what}: {v:e} escapes {ends:?}");
        (least, most) = (least.min(v), most.max(v));
    }
    let (below, above) = (steps(ends.lo, p.round(least), p), steps(p.round(most), ends.hi, p));
    assert!(below <= 8 && above <= 8, "{what}: {ends:?} is {below} and {above} outside of {least:e}, {most:e}");
}

/// The domain.
fn domain(op: Op) -> (f64, f64) {
    match op {
        Op::Log | Op::Log2 => (0.0, INF),
        Op::Asin | Op::Acos | Op::Atanh => (-1.0, 1.0),
        Op::Acosh => (1.0, INF),
        _ => (-INF, INF),
    }
}

/// Where the function turns inside of a range.
fn turns(op: Op, (lo, hi): (f64, f64)) -> Vec<f64> {
    let phase = match op {
        Op::Sin => FRAC_PI_2,
        Op::Cos => 0.0,
        Op::Cosh => return if lo <= 0.0 && 0.0 <= hi { vec![0.0] } else { vec![] },
        _ => return vec![],
    };
    let first = ((lo - phase) / PI).ceil();
    (0..2).map(|k| (first + f64::from(k)) * PI + phase).filter(|x| lo <= *x && *x <= hi).collect()
}

/// Whether tan has a pole inside: whether the ends are nearest to different multiples of π. Of which parity those are
/// says the sign of the cosine.
fn pole((lo, hi): (f64, f64)) -> bool {
    let nearest = |x: f64| {
        let periods = x / (2.0 * PI);
        if exact::cos(x) > 0.0 { periods.round() } else { periods.floor() + 0.5 }
    };
    nearest(lo) != nearest(hi)
}

fn check(op: Op, f: Function, given: (f64, f64), p: Precision, mode: Mode, random: &mut Random) {
    let ends = enclose(op, &[given], mode);
    let what = format!("{} {op} of [{:e}, {:e}]", p.name(), given.0, given.1);
    let domain = domain(op);
    let (lo, hi) = (given.0.max(domain.0), given.1.min(domain.1));
    let wave = matches!(op, Op::Sin | Op::Cos | Op::Tan);
    let infinite = given.0 == -INF || given.1 == INF;
    let undefined = given.0 < domain.0 || domain.1 < given.1 || (wave && infinite);
    assert_eq!(ends.nan, undefined, "{what} {ends:?}");
    if hi < lo {
        assert!(ends.lo.is_nan() && ends.hi.is_nan(), "{what} {ends:?}");
        return;
    }
    if wave && (given.0 < -8192.0 || 8192.0 < given.1) {
        let whole = if op == Op::Tan { INF } else { 1.0 };
        assert!(ends.lo == -whole && ends.hi == whole, "{what} {ends:?}");
        return;
    }
    let mut points = random.points((lo, hi), 200);
    points.extend(turns(op, (lo, hi)));
    let values: Vec<f64> = points.iter().map(|x| f(*x)).collect();
    if op == Op::Tan && pole((lo, hi)) {
        assert!(ends.lo == -INF && ends.hi == INF, "{what} {ends:?}");
        return;
    }
    judge(&what, ends, &values, p);
}

#[test]
fn functions_of_one_argument_are_enclosed() {
    for p in PRECISIONS {
        for (op, f) in UNARY {
            let mut random = Random(17);
            for _ in 0..4000 {
                let given = random.range(p);
                check(*op, *f, given, p, Mode::Real(p), &mut random);
            }
        }
    }
}

/// In an exact builder kernels are computed in f64 and only the steps in `real`.
#[test]
fn constant_boxes_are_enclosed() {
    for p in PRECISIONS {
        for (op, f) in UNARY {
            let mut random = Random(19);
            for _ in 0..500 {
                let given = random.range(p);
                check(*op, *f, given, p, Mode::Exact(p), &mut random);
            }
        }
    }
}

/// Next to each peak and pole that kernels reach, on either side and across: where one digit decides.
#[test]
fn peaks_and_poles_are_found() {
    for p in PRECISIONS {
        for (op, f) in &UNARY[4..7] {
            let mut random = Random(23);
            for k in 0..5215_u32 {
                let at = order(p.round(f64::from(k) * FRAC_PI_2), p);
                let (down, up) = (random.below(3) as i64, random.below(3) as i64);
                let given = (from_order(at - down, p), from_order(at + up, p));
                check(*op, *f, given, p, Mode::Real(p), &mut random);
                check(*op, *f, (-given.1, -given.0), p, Mode::Real(p), &mut random);
                // The same end with another, up to two periods away.
                let other = p.round(given.0 + random.between(0.0, 13.0));
                if other <= 8192.0 {
                    check(*op, *f, (given.0, other), p, Mode::Real(p), &mut random);
                }
            }
        }
    }
}

#[test]
fn angles_are_enclosed() {
    for p in PRECISIONS {
        let mut random = Random(29);
        for _ in 0..30_000 {
            let (y, x) = (random.range(p), random.range(p));
            let ends = enclose(Op::Atan2, &[y, x], Mode::Real(p));
            let what = format!("{} atan2 of {y:?}, {x:?}", p.name());
            assert!(!ends.nan, "{what}");
            if x.0 <= 0.0 && y.0 <= 0.0 && 0.0 <= y.1 {
                assert!(ends.lo < -PI && PI < ends.hi, "{what} {ends:?}");
                assert!(steps(ends.lo, p.round(-PI), p) <= 2 && steps(p.round(PI), ends.hi, p) <= 2, "{what} {ends:?}");
                continue;
            }
            let (ys, xs) = (random.points(y, 14), random.points(x, 14));
            let values: Vec<f64> = ys.iter().flat_map(|y| xs.iter().map(|x| exact::atan2(*y, *x))).collect();
            judge(&what, ends, &values, p);
        }
    }
}

#[test]
fn powers_are_enclosed() {
    for p in PRECISIONS {
        let mut random = Random(31);
        let mut kinds = [0; 4];
        for _ in 0..30_000 {
            let x = random.range(p);
            let y = match random.below(4) {
                0 => random.range(p),
                1 => {
                    let n = random.below(20) as f64 - 10.0;
                    (n, n)
                }
                2 => {
                    let (from, wide) = (random.between(-4.0, 4.0), random.between(0.0, 2.0));
                    (p.round(from), p.round(from + wide))
                }
                _ => (-(random.below(3) as f64), random.below(3) as f64),
            };
            let ends = enclose(Op::Pow, &[x, y], Mode::Real(p));
            let what = format!("{} pow of {x:?}, {y:?}", p.name());
            let integer = y.0 == y.1 && y.0.is_finite() && y.0.fract() == 0.0;
            let odd = integer && (y.0 * 0.5).fract() != 0.0;
            assert_eq!(ends.nan, x.0 < 0.0 && !integer, "{what} {ends:?}");
            if x.0 < 0.0 && !integer {
                kinds[0] += 1;
                let none = x.1 < 0.0 && y.1.floor() < y.0;
                let given = if none { ends.lo.is_nan() && ends.hi.is_nan() } else { ends.lo == -INF && ends.hi == INF };
                assert!(given, "{what} {ends:?}");
                continue;
            }
            if odd && y.0 < 0.0 && x.0 < 0.0 && 0.0 <= x.1 {
                kinds[1] += 1;
                assert!(ends.lo == -INF && ends.hi == INF, "{what} {ends:?}");
                continue;
            }
            kinds[if x.0 < 0.0 { 2 } else { 3 }] += 1;
            let (mut xs, ys) = (random.points((x.0 + 0.0, x.1 + 0.0), 14), random.points(y, 14));
            if x.0 <= 0.0 && 0.0 <= x.1 {
                xs.push(0.0);
            }
            let values: Vec<f64> = xs.iter().flat_map(|x| ys.iter().map(|y| exact::pow(*x + 0.0, *y))).collect();
            judge(&what, ends, &values, p);
        }
        assert!(kinds.iter().all(|k| *k > 200), "{kinds:?}");
    }
}

/// A flag is never lost, and everything that may be NaN gives everything.
#[test]
fn flags_travel() {
    let p = Precision::F32;
    let all = UNARY.iter().map(|(op, _)| *op).chain([Op::Atan2, Op::Pow, Op::Rounded]);
    for op in all {
        for flagged in 0..op.def().operands.len() {
            let mut b = Builder::new(Mode::Real(p), 100_000, &Unwatched);
            let operands: Vec<Enclosure> = (0..op.def().operands.len())
                .map(|k| {
                    let (lo, hi, nan) = (b.real(1.0), b.real(1.0), b.bool(k == flagged));
                    Enclosure::Real(Range { lo, hi, nan, tidy: true })
                })
                .collect();
            let Enclosure::Real(range) = b.enclose(op, &operands, Facts::default()) else { panic!("{op}") };
            assert_eq!(b.value(range.nan), Some(Value::Bool(true)), "{op}");
        }
        let whole = vec![(f64::NAN, 1.0); op.def().operands.len()];
        let mut b = Builder::new(Mode::Real(p), 100_000, &Unwatched);
        let operands: Vec<Enclosure> = whole
            .iter()
            .map(|(lo, hi)| {
                let (lo, hi, nan) = (b.real(*lo), b.real(*hi), b.bool(false));
                Enclosure::Real(Range { lo, hi, nan, tidy: false })
            })
            .collect();
        let Enclosure::Real(range) = b.enclose(op, &operands, Facts::default()) else { panic!("{op}") };
        assert_eq!(b.value(range.nan), Some(Value::Bool(true)), "{op}");
    }
}
