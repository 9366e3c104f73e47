//! Enclosures of constants: the examples of LANGUAGE 15, facts about operands, and how ranges are read and joined.

use isograd_graph::{Builder, Enclosure, Evaluator, Facts, Mode, Op, Precision, Range, Scalar, Unwatched, Value};

use super::boxes::{Box, Random, next_up};
use super::{INF, NAN, PRECISIONS, Seen, contains, output};

/// What a rule gives for constants.
pub fn of_constants(op: Op, operands: &[Box], mode: Mode) -> Vec<Value> {
    let mut b = Builder::new(mode, 100_000, &Unwatched);
    let operands: Vec<Enclosure> = operands.iter().map(|x| constant(&mut b, *x)).collect();
    let result = b.enclose(op, &operands, Facts::default());
    values(&mut b, result)
}

fn constant(b: &mut Builder<'_>, x: Box) -> Enclosure {
    match x {
        Box::Real { lo, hi, nan } => {
            Enclosure::Real(Range { lo: b.real(lo), hi: b.real(hi), nan: b.bool(nan), tidy: false })
        }
        Box::Int(lo, hi) => Enclosure::Int { lo: b.int(lo), hi: b.int(hi) },
        Box::Bool { yes, no } => Enclosure::Bool { yes: b.bool(yes), no: b.bool(no) },
    }
}

fn values(b: &mut Builder<'_>, result: Enclosure) -> Vec<Value> {
    output(b, result);
    b.graph().outputs.iter().map(|o| b.value(o.node).expect("constants fold")).collect()
}

/// The ends and the flag of an operation on constant boxes in f32.
fn ends(op: Op, operands: &[Box], facts: Facts) -> (f64, f64, bool) {
    let mut b = Builder::new(Mode::Real(Precision::F32), 100_000, &Unwatched);
    let operands: Vec<Enclosure> = operands.iter().map(|x| constant(&mut b, *x)).collect();
    let result = b.enclose(op, &operands, facts);
    match values(&mut b, result)[..] {
        [Value::Real(lo), Value::Real(hi), Value::Bool(nan), ..] => (lo, hi, nan),
        _ => panic!("{op} is no real"),
    }
}

const fn real(lo: f64, hi: f64) -> Box {
    Box::Real { lo, hi, nan: false }
}

const fn flagged(lo: f64, hi: f64) -> Box {
    Box::Real { lo, hi, nan: true }
}

#[test]
fn enclosures_of_the_manual() {
    let plain = |op, operands: &[Box]| ends(op, operands, Facts::default());
    let tenth = f64::from(0.1_f32);
    assert_eq!(plain(Op::Add, &[real(1.0, 2.0), real(-4.0, 8.0)]), (-3.0, 10.0, false));
    assert_eq!(plain(Op::Add, &[real(0.0, INF), real(0.0, INF)]), (0.0, INF, false));
    assert_eq!(plain(Op::Add, &[real(0.0, INF), real(-INF, 0.0)]), (-INF, INF, true));
    assert_eq!(plain(Op::Sub, &[real(0.0, INF), real(0.0, INF)]), (-INF, INF, true));
    assert_eq!(plain(Op::Mul, &[real(-2.0, 3.0), real(-5.0, 7.0)]), (-15.0, 21.0, false));
    assert_eq!(plain(Op::Mul, &[real(0.0, 0.0), real(0.0, INF)]), (0.0, 0.0, true));
    assert_eq!(plain(Op::Mul, &[real(1.0, 2.0), real(-INF, INF)]), (-INF, INF, false));
    assert_eq!(plain(Op::Div, &[real(1.0, 1.0), real(-1.0, 1.0)]), (-INF, INF, false));
    assert_eq!(plain(Op::Div, &[real(-1.0, 1.0), real(-1.0, 1.0)]), (-INF, INF, true));
    assert_eq!(plain(Op::Div, &[real(-6.0, 3.0), real(-3.0, -1.5)]), (-2.0, 4.0, false));
    assert_eq!(plain(Op::Sqrt, &[real(-1.0, 4.0)]), (0.0, 2.0, true));
    let (lo, hi, nan) = plain(Op::Sqrt, &[real(-4.0, -1.0)]);
    assert!(lo.is_nan() && hi.is_nan() && nan);
    assert_eq!(plain(Op::InverseSqrt, &[real(-1.0, 4.0)]), (0.5, INF, true));
    assert_eq!(plain(Op::InverseSqrt, &[real(0.25, 4.0)]), (0.5, 2.0, false));
    assert_eq!(plain(Op::Abs, &[real(-3.0, 2.0)]), (0.0, 3.0, false));
    assert_eq!(plain(Op::Min, &[real(1.0, 5.0), flagged(0.0, 2.0)]), (0.0, 5.0, false));
    assert_eq!(plain(Op::Min, &[flagged(1.0, 5.0), real(0.0, 2.0)]), (0.0, 2.0, true));
    assert_eq!(plain(Op::Max, &[real(1.0, 5.0), flagged(2.0, 7.0)]), (1.0, 7.0, false));
    assert_eq!(plain(Op::Fract, &[real(2.25, 2.5)]), (0.25, 0.5, false));
    assert_eq!(plain(Op::Fract, &[real(1.75, 2.5)]), (0.0, 1.0, false));
    assert_eq!(plain(Op::Fract, &[real(1.75, INF)]), (0.0, 1.0, true));
    assert_eq!(plain(Op::Mod, &[real(7.0, 8.5), real(3.0, 3.0)]), (1.0, 2.5, false));
    let (lo, hi, nan) = plain(Op::Mod, &[real(7.0, 9.5), real(3.0, 3.0)]);
    assert!((-1e-5..=0.0).contains(&lo) && (3.0..3.00001).contains(&hi) && !nan);
    let (lo, hi, nan) = plain(Op::Mod, &[real(7.0, 7.0), real(-1.0, 3.0)]);
    assert!((-1.00001..=-1.0).contains(&lo) && (3.0..3.00001).contains(&hi) && nan);
    let (lo, hi, nan) = plain(Op::Mod, &[real(0.0, 5.0), real(0.0, 0.0)]);
    assert!(lo < 0.0 && 0.0 < hi && hi < 1e-5 && lo == -hi && nan);
    assert_eq!(plain(Op::Length2, &[real(-2.0, 1.0), real(4.0, 4.0)]).0, 4.0);
    assert_eq!(plain(Op::Length2, &[real(3.0, 3.0), real(4.0, 4.0)]), (5.0, 5.0, false));
    assert_eq!(plain(Op::Unit, &[real(0.5, 0.5), real(0.0, 4.0)]), (0.0, INF, false));
    assert_eq!(plain(Op::Unit, &[real(0.5, 0.5), real(1.0, 4.0)]), (0.125, 0.5, false));
    assert_eq!(plain(Op::Unit, &[real(-1.0, 1.0), real(0.0, 0.0)]), (0.0, 0.0, false));
    assert_eq!(plain(Op::Copysign, &[real(-2.0, 1.0), real(1.0, 3.0)]), (0.0, 2.0, false));
    assert_eq!(plain(Op::Copysign, &[real(1.0, 2.0), real(0.0, 3.0)]), (-2.0, 2.0, false));
    assert_eq!(plain(Op::IntToReal, &[Box::Int(16_777_217, 16_777_219)]), (16_777_216.0, 16_777_220.0, false));
    assert_eq!(plain(Op::IntToReal, &[Box::Int(i32::MAX, i32::MAX)]), (2_147_483_520.0, 2_147_483_648.0, false));
    let undecided = Box::Bool { yes: true, no: true };
    assert_eq!(plain(Op::Select, &[undecided, real(1.0, 1.0), real(0.0, 0.0)]), (0.0, 1.0, false));
    assert_eq!(plain(Op::Neg, &[real(tenth, 2.0)]), (-2.0, -tenth, false));

    let same = Facts { same: true, ..Facts::default() };
    assert_eq!(ends(Op::Mul, &[real(-3.0, 2.0); 2], same), (0.0, 9.0, false));
    assert_eq!(ends(Op::Mul, &[real(-3.0, -2.0); 2], same), (4.0, 9.0, false));
    assert_eq!(ends(Op::Mul, &[real(-INF, 2.0); 2], same), (0.0, INF, false));
    let part = Facts { part: true, ..Facts::default() };
    assert_eq!(ends(Op::Unit, &[real(-3.0, 2.0), real(0.0, 5.0)], part), (-1.0, 1.0, false));
    assert_eq!(ends(Op::Unit, &[real(3.0, 3.0), real(1.0, 2.0)], part), (1.0, 1.0, false));
    assert_eq!(ends(Op::Unit, &[real(3.0, 4.0), real(8.0, 16.0)], part), (0.1875, 0.5, false));
}

/// Facts about operands are used, and nothing is lost by them.
#[test]
fn squares_and_parts_contain_what_is_computed() {
    for p in PRECISIONS {
        let mut b = Builder::new(Mode::Real(p), 1000, &Unwatched);
        let mut inputs = || {
            let (lo, hi) = (b.input("lo", Scalar::Real), b.input("hi", Scalar::Real));
            (lo, hi, b.input("nan", Scalar::Bool))
        };
        let [x, y] = [inputs(), inputs()].map(|(lo, hi, nan)| Enclosure::Real(Range { lo, hi, nan, tidy: true }));
        let square = b.enclose(Op::Mul, &[x, x], Facts { same: true, ..Facts::default() });
        let length = b.enclose(Op::Length2, &[x, y], Facts::default());
        let unit = b.enclose(Op::Unit, &[x, length], Facts { part: true, ..Facts::default() });
        output(&mut b, square);
        output(&mut b, unit);
        let graph = b.finish().unwrap();
        let mut evaluator = Evaluator::new(&graph, p);
        let mut r = Random(4);
        let eval = |op: Op, args: &[Value]| (op.def().eval.at(p))(args);
        for _ in 0..50_000 {
            let boxes = [(); 2].map(|()| Box::random(&mut r, Scalar::Real, (-2.0, 2.0), p));
            let mut inputs = Vec::new();
            boxes.iter().for_each(|x| x.inputs(&mut inputs));
            let result = evaluator.run(&inputs).unwrap();
            let (square, unit) = result.split_at(6);
            let [xs, ys] = boxes.map(|x| x.samples(&mut r, &[], p));
            let mut seen = Seen::default();
            for x in &xs {
                let value = eval(Op::Mul, &[*x, *x]);
                contains(square, value)
                    .unwrap_or_else(|why| panic!("{why} {value:?} of {x:?} in {boxes:?}: {square:?}"));
                seen.add(value);
                for y in &ys {
                    let length = eval(Op::Length2, &[*x, *y]);
                    let value = eval(Op::Unit, &[*x, length]);
                    // Components and squares that underflow are longer than their vector.
                    let small = matches!(length, Value::Real(l) if l < 1e-15 || l == INF);
                    if !small {
                        contains(unit, value)
                            .unwrap_or_else(|why| panic!("{why} {value:?} of {x:?} {y:?} in {boxes:?}: {unit:?}"));
                    }
                }
            }
            let [Value::Real(lo), Value::Real(hi), ..] = *square else { panic!("no real") };
            assert!(next_up(p, lo) >= seen.lo && hi <= next_up(p, seen.hi), "{boxes:?}: {square:?}");
            let [Value::Real(lo), Value::Real(hi), ..] = *unit else { panic!("no real") };
            assert!(-1.0 <= lo && lo <= hi && hi <= 1.0, "{boxes:?}: {unit:?}");
        }
    }
}

#[test]
fn ranges_are_tidied_and_joined() {
    let whole = [Value::Real(-INF), Value::Real(INF), Value::Bool(true)];
    let ends = [0.1, -2.0, 3.0, INF, -INF, NAN];
    for lo in ends {
        for hi in ends {
            let (x, y) = (Precision::F32.round(lo), Precision::F32.round(hi));
            let unknown = x.is_nan() || y.is_nan();
            let want = [Value::Real(x.min(y)), Value::Real(x.max(y)), Value::Bool(false)];
            let want = if unknown { whole } else { want };
            for mode in [Mode::Real(Precision::F32), Mode::Exact(Precision::F32)] {
                let mut b = Builder::new(mode, 1000, &Unwatched);
                let range = constant(&mut b, real(lo, hi)).tidied(&mut b);
                assert_eq!(values(&mut b, range)[..3], want, "{lo} {hi} {mode:?}");
            }
            let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
            let (lo, hi) = (b.input("lo", Scalar::Real), b.input("hi", Scalar::Real));
            let nan = b.bool(false);
            output(&mut b, Enclosure::Real(Range { lo, hi, nan, tidy: false }));
            let point = Enclosure::point(&mut b, lo);
            output(&mut b, point);
            let got = isograd_graph::evaluate(&b.finish().unwrap(), Precision::F32, &[Value::Real(x), Value::Real(y)]);
            let got = got.unwrap();
            assert_eq!(got[3..6], want, "{x} {y}");
            let point = if x.is_nan() { whole } else { [Value::Real(x), Value::Real(x), Value::Bool(false)] };
            assert_eq!(got[6..9], point, "{x}");
        }
    }
    let mut b = Builder::new(Mode::Real(Precision::F32), 1000, &Unwatched);
    let operand = constant(&mut b, real(-4.0, -1.0));
    let nothing = b.enclose(Op::Sqrt, &[operand], Facts::default());
    let one = constant(&mut b, real(0.5, 2.0));
    let hull = nothing.hull(one, &mut b);
    assert_eq!(values(&mut b, hull)[..3], whole);
    for (x, y, want) in [
        (real(0.5, 2.0), flagged(-1.0, 1.0), vec![Value::Real(-1.0), Value::Real(2.0), Value::Bool(true)]),
        (Box::Int(-3, 4), Box::Int(2, 9), vec![Value::Int(-3), Value::Int(9)]),
        (Box::Bool { yes: true, no: false }, Box::Bool { yes: false, no: true }, vec![Value::Bool(true); 2]),
        (
            Box::Bool { yes: true, no: false },
            Box::Bool { yes: true, no: false },
            vec![Value::Bool(true), Value::Bool(false)],
        ),
    ] {
        let mut b = Builder::new(Mode::Real(Precision::F32), 1000, &Unwatched);
        let [x, y] = [x, y].map(|x| constant(&mut b, x));
        let hull = x.hull(y, &mut b);
        assert_eq!(values(&mut b, hull)[..want.len()], want);
    }
}
