//! The report of kinks on hand-made graphs: what is on the path taken, how far it is, on which side the point lies.

mod support;

use isograd_graph::{Builder, Graph, Mode, NodeId, Op, Precision, Scalar, Unwatched, Value, evaluate, print, verify};
use isograd_transform::{KinkPlace, KinkReport, Sweep, differentiate, fold, kinks, optimise, schedule};
use support::lane_kernels;

const MANY: usize = 1_000_000;

fn build(inputs: &[&str], make: impl FnOnce(&mut Builder<'_>, &[NodeId]) -> Vec<NodeId>) -> Graph {
    let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
    let inputs: Vec<_> = inputs.iter().map(|n| b.input(*n, Scalar::Real)).collect();
    for (i, node) in make(&mut b, &inputs).into_iter().enumerate() {
        b.output(format!("out{i}"), node);
    }
    b.finish().unwrap()
}

fn report(by: &[usize], tolerance: f64) -> KinkReport {
    KinkReport {
        names: ["near", "distance", "kink", "side"].map(str::to_owned),
        by: by.to_vec(),
        tolerance,
        smooth: false,
    }
}

/// What a report says at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Said {
    near: bool,
    distance: f64,
    /// The operation of the nearest kink.
    kink: Option<Op>,
    side: i32,
}

fn said(near: bool, distance: f64, kink: Op, side: i32) -> Said {
    Said { near, distance, kink: Some(kink), side }
}

const NOTHING: Said = Said { near: false, distance: f64::INFINITY, kink: None, side: 1 };

struct Reported {
    plain: Graph,
    finished: Graph,
    places: Vec<KinkPlace>,
    results: usize,
}

impl Reported {
    fn new(graph: Graph, by: &[usize], tolerance: f64) -> Self {
        let results = graph.outputs.len();
        let graph = differentiate(graph, Sweep::Forward, isograd_graph::Precision::F32, 6, MANY, &Unwatched).unwrap();
        let (plain, places) = kinks(&graph, results, &report(by, tolerance), MANY, &Unwatched).unwrap();
        let plain = verify(plain).unwrap().into_inner();
        let p = Precision::F64;
        let mut finished = verify(fold(&plain, p, MANY, &Unwatched).unwrap()).unwrap().into_inner();
        for step in [lane_kernels, optimise, schedule] {
            finished = verify(step(&finished, p, MANY, &Unwatched).unwrap()).unwrap().into_inner();
        }
        Self { plain, finished, places, results }
    }

    /// What the report says, the same before and after the rest of the pipeline.
    fn at(&self, point: &[f64]) -> Said {
        let point: Vec<_> = point.iter().map(|x| Value::Real(*x)).collect();
        let both = [&self.plain, &self.finished].map(|graph| {
            let all = evaluate(graph, Precision::F64, &point).unwrap();
            let [Value::Bool(near), Value::Real(distance), Value::Int(kink), Value::Int(side)] = all[self.results..]
            else {
                panic!("{all:?}")
            };
            let kink = usize::try_from(kink).ok().map(|k| self.places[k].op);
            Said { near, distance, kink, side }
        });
        assert_eq!(both[0], both[1], "at {point:?}\n{}", print(&self.plain));
        both[0]
    }

    fn operations(&self) -> Vec<Op> {
        self.places.iter().map(|p| p.op).collect()
    }
}

#[test]
fn a_crease_is_near_exactly_or_within_a_tolerance() {
    let graph = || build(&["x"], |b, i| vec![b.abs(i[0])]);
    let exact = Reported::new(graph(), &[0], 0.0);
    assert_eq!(exact.at(&[-2.0]), said(false, 2.0, Op::Abs, -1));
    assert_eq!(exact.at(&[0.0]), said(true, 0.0, Op::Abs, 0));
    assert_eq!(exact.at(&[-0.0]), said(true, 0.0, Op::Abs, 0));
    assert_eq!(exact.at(&[1e-300]), said(false, 1e-300, Op::Abs, 1));
    assert_eq!(exact.at(&[f64::NAN]), NOTHING);
    let within = Reported::new(graph(), &[0], 0.5);
    assert_eq!(within.at(&[-0.5]), said(true, 0.5, Op::Abs, -1));
    assert_eq!(within.at(&[0.75]), said(false, 0.75, Op::Abs, 1));
}

#[test]
fn without_kinks_there_is_nothing_near() {
    let graph = build(&["x"], |b, i| {
        let sine = b.sin(i[0]);
        vec![b.mul(sine, i[0])]
    });
    let reported = Reported::new(graph, &[0], 1e300);
    assert_eq!(reported.at(&[0.0]), NOTHING);
    assert!(reported.places.is_empty());
}

#[test]
fn only_what_moves_has_kinks() {
    let graph = || {
        build(&["x", "y"], |b, i| {
            let (x, y) = (b.abs(i[0]), b.abs(i[1]));
            vec![b.add(x, y)]
        })
    };
    assert_eq!(Reported::new(graph(), &[0], 0.0).at(&[3.0, 0.0]), said(false, 3.0, Op::Abs, 1));
    assert_eq!(Reported::new(graph(), &[0, 1], 0.0).at(&[3.0, 0.0]), said(true, 0.0, Op::Abs, 0));
    assert_eq!(Reported::new(graph(), &[], 0.0).at(&[3.0, 0.0]), NOTHING);
}

#[test]
fn the_operand_that_was_not_chosen_has_no_say() {
    // min(|x| + 1, y)
    let graph = build(&["x", "y"], |b, i| {
        let one = b.real(1.0);
        let size = b.abs(i[0]);
        let more = b.add(size, one);
        vec![b.min(more, i[1])]
    });
    let reported = Reported::new(graph, &[0, 1], 0.0);
    assert_eq!(reported.at(&[0.0, 9.0]), said(true, 0.0, Op::Abs, 0));
    assert_eq!(reported.at(&[0.0, 0.5]), said(false, 0.5, Op::Min, 1), "y is returned");
    assert_eq!(reported.at(&[-2.0, 3.0]), said(true, 0.0, Op::Min, 0));
    assert_eq!(reported.at(&[-2.0, 4.0]), said(false, 1.0, Op::Min, -1));
}

#[test]
fn piecewise_constant_operations_hide_creases_and_show_jumps() {
    // ⌊min(x, y)⌋ jumps at integers, where x = y it does nothing; ⌊⌊x⌋ + ½⌋ jumps where its inner does.
    let graph = build(&["x", "y"], |b, i| {
        let half = b.real(0.5);
        let least = b.min(i[0], i[1]);
        let inner = b.floor(i[0]);
        let inner = b.add(inner, half);
        vec![b.floor(least), b.floor(inner)]
    });
    let reported = Reported::new(graph, &[0, 1], 0.0);
    assert_eq!(reported.at(&[0.25, 0.25]), said(false, 0.25, Op::Floor, 1));
    assert_eq!(reported.at(&[0.75, 0.875]), said(false, 0.25, Op::Floor, -1));
    assert_eq!(reported.at(&[4.0, 0.875]), said(true, 0.0, Op::Floor, 0));
    assert_eq!(reported.operations(), [Op::Floor, Op::Floor], "the second floor of a floor has no jump of its own");
}

#[test]
fn conditions_flip_and_only_the_side_taken_counts() {
    // if x < y { |x − 1| } else { |x + 1| }, by x
    let graph = build(&["x", "y"], |b, i| {
        let one = b.real(1.0);
        let cond = b.lt(i[0], i[1]);
        b.gamma(cond);
        let below = b.sub(i[0], one);
        let below = b.abs(below);
        b.otherwise();
        let above = b.add(i[0], one);
        let above = b.abs(above);
        let end = b.end();
        vec![b.join(end, below, above)]
    });
    let reported = Reported::new(graph, &[0], 0.25);
    assert_eq!(reported.at(&[1.0, 9.0]), said(true, 0.0, Op::Abs, 0));
    assert_eq!(reported.at(&[1.0, -9.0]), said(false, 2.0, Op::Abs, 1));
    assert_eq!(reported.at(&[5.0, 5.25]), said(true, 0.25, Op::Lt, -1));
    assert_eq!(reported.at(&[5.0, 5.0]), said(true, 0.0, Op::Lt, 0));
    assert_eq!(reported.at(&[-1.0, -3.0]), said(true, 0.0, Op::Abs, 0));
}

#[test]
fn the_nearest_of_a_compound_condition_counts() {
    // select(x < 1 and not (x < −3), x, 0): a truth value is chosen, too.
    let graph = build(&["x"], |b, i| {
        let (one, low, zero) = (b.real(1.0), b.real(-3.0), b.real(0.0));
        let (below, out) = (b.lt(i[0], one), b.lt(i[0], low));
        let inside = b.not(out);
        let no = b.bool(false);
        let cond = b.select_bool(below, inside, no);
        vec![b.select(cond, i[0], zero)]
    });
    let reported = Reported::new(graph, &[0], 0.0);
    assert_eq!(reported.at(&[0.5]), said(false, 0.5, Op::Lt, -1));
    assert_eq!(reported.at(&[-2.5]), said(false, 0.5, Op::Lt, 1));
    assert_eq!(reported.at(&[1.0]), said(true, 0.0, Op::Lt, 0));
}

#[test]
fn chosen_constants_have_no_kinks() {
    // length(max(x, 0), max(y, 0)), then the same in branches and in a loop: inside it is a constant 0.
    let by_max = |b: &mut Builder<'_>, i: &[NodeId]| {
        let zero = b.real(0.0);
        let (x, y) = (b.max(i[0], zero), b.max(i[1], zero));
        vec![b.op(Op::Length2, &[x, y])]
    };
    let by_branches = |b: &mut Builder<'_>, i: &[NodeId]| {
        let zero = b.real(0.0);
        let cut = [i[0], i[1]].map(|x| {
            let cond = b.lt(x, zero);
            b.gamma(cond);
            b.otherwise();
            let end = b.end();
            b.join(end, zero, x)
        });
        vec![b.op(Op::Length2, &cut)]
    };
    let by_loop = |b: &mut Builder<'_>, i: &[NodeId]| {
        let (zero, lo, hi) = (b.real(0.0), b.int(0), b.int(2));
        b.theta(lo, hi);
        let largest = b.carried(zero);
        let next = b.max(largest, i[0]);
        let end = b.end();
        let x = b.carry_out(end, largest, next);
        let y = b.max(i[1], zero);
        vec![b.op(Op::Length2, &[x, y])]
    };
    let graphs = [build(&["x", "y"], by_max), build(&["x", "y"], by_branches), build(&["x", "y"], by_loop)];
    for graph in graphs {
        let reported = Reported::new(graph, &[0, 1], 0.0);
        let inside = reported.at(&[-2.0, -3.0]);
        assert!(!inside.near && inside.distance == 2.0 && inside.kink != Some(Op::Length2), "{inside:?}");
        let beside = reported.at(&[-3.0, 4.0]);
        assert!(!beside.near && beside.distance == 3.0, "{beside:?}");
        assert!(reported.at(&[0.0, -3.0]).near);
    }
}

#[test]
fn loops_carry_the_nearest() {
    // The least of |x − 3k| + k/8 for k = 0, 1, 2, in a loop.
    let graph = build(&["x"], |b, i| {
        let (lo, hi, far, three) = (b.int(0), b.int(3), b.real(100.0), b.real(3.0));
        let eighth = b.real(0.125);
        let theta = b.theta(lo, hi);
        let _ = theta;
        let k = b.counter();
        let least = b.carried(far);
        let k = b.int_to_real(k);
        let centre = b.mul(three, k);
        let off = b.sub(i[0], centre);
        let size = b.abs(off);
        let lift = b.mul(k, eighth);
        let size = b.add(size, lift);
        let next = b.min(least, size);
        let end = b.end();
        vec![b.carry_out(end, least, next)]
    });
    let reported = Reported::new(graph, &[0], 0.0);
    assert_eq!(reported.at(&[0.0]), said(true, 0.0, Op::Abs, 0));
    assert_eq!(reported.at(&[3.0]), said(true, 0.0, Op::Abs, 0));
    assert_eq!(reported.at(&[2.5]), said(false, 0.5, Op::Abs, -1), "|x| is not on the path any more");
    // |x| = |x − 3| + 1/8
    assert_eq!(reported.at(&[1.5625]), said(true, 0.0, Op::Min, 0));
    assert_eq!(reported.at(&[1.5]), said(false, 0.125, Op::Min, -1));
    assert_eq!(reported.operations(), [Op::Abs, Op::Min]);
}

#[test]
fn a_trip_count_that_depends_on_a_real_jumps() {
    // x added ⌊y⌋ times, and a loop without any kink inside.
    let graph = build(&["x", "y"], |b, i| {
        let (lo, zero) = (b.int(0), b.real(0.0));
        let hi = b.real_to_int(i[1]);
        b.theta(lo, hi);
        let sum = b.carried(zero);
        let next = b.add(sum, i[0]);
        let end = b.end();
        vec![b.carry_out(end, sum, next)]
    });
    let reported = Reported::new(graph, &[0, 1], 0.0);
    assert_eq!(reported.at(&[1.0, 3.25]), said(false, 0.25, Op::RealToInt, 1));
    assert_eq!(reported.at(&[1.0, 2.0]), said(true, 0.0, Op::RealToInt, 0));
    assert_eq!(reported.at(&[1.0, -0.25]), said(false, 0.75, Op::RealToInt, 1));
}

#[test]
fn derivatives_inside_the_program_are_expanded() {
    // diff(|x|, x)·y: the sign jumps.
    let graph = build(&["x", "y"], |b, i| {
        let size = b.abs(i[0]);
        let slope = b.diff(size, i[0]);
        vec![b.mul(slope, i[1])]
    });
    let reported = Reported::new(graph, &[0, 1], 0.0);
    assert_eq!(reported.at(&[-0.5, 2.0]), said(false, 0.5, Op::Sign, -1));
    assert_eq!(reported.operations(), [Op::Sign]);
}

#[test]
fn what_is_not_a_number_is_far() {
    // max(√x, y): where √x is NaN, so is the discriminant of max.
    let graph = build(&["x", "y"], |b, i| {
        let root = b.sqrt(i[0]);
        vec![b.max(root, i[1])]
    });
    let reported = Reported::new(graph, &[0, 1], 0.0);
    assert_eq!(reported.at(&[-4.0, 1.0]), said(false, 4.0, Op::Sqrt, -1));
    assert_eq!(reported.at(&[4.0, 1.0]), said(false, 1.0, Op::Max, 1));
    assert_eq!(reported.at(&[0.0, -1.0]), said(true, 0.0, Op::Sqrt, 0));
    assert_eq!(reported.at(&[f64::INFINITY, f64::INFINITY]), NOTHING);
}

#[test]
fn every_operation_with_a_kink_reports_it() {
    for op in Op::ALL {
        let def = op.def();
        if matches!(def.kink, isograd_graph::ops::Kink::None) {
            continue;
        }
        let names: Vec<String> = (0..def.operands.len()).map(|k| format!("x{k}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let graph = build(&names, |b, i| {
            let result = b.op(*op, i);
            vec![match def.result {
                Scalar::Real => result,
                Scalar::Int => b.int_to_real(result),
                Scalar::Bool => {
                    let (one, zero) = (b.real(1.0), b.real(0.0));
                    b.select(result, one, zero)
                }
            }]
        });
        let all: Vec<usize> = (0..names.len()).collect();
        let reported = Reported::new(graph, &all, 0.0);
        assert_eq!(reported.operations(), [*op]);
        let point = vec![0.25; names.len()];
        let want = isograd_graph::ops::discriminant(*op, &point);
        let got = reported.at(&point);
        assert!(got.distance == want.abs() && got.near == (want == 0.0), "{op}: {got:?}, {want}");
    }
}

#[test]
fn the_report_grows_with_the_graph_only() {
    let deep = |n: usize| {
        let graph = build(&["x", "y"], |b, i| {
            let mut x = i[0];
            for _ in 0..n {
                let less = b.sub(x, i[1]);
                x = b.abs(less);
            }
            vec![x]
        });
        let (reported, places) = kinks(&graph, 1, &report(&[0], 0.0), MANY, &Unwatched).unwrap();
        assert_eq!(places.len(), n);
        (reported.len(), graph.len())
    };
    let (small, large) = (deep(100), deep(10_000));
    assert!(large.0 * small.1 <= small.0 * large.1 * 11 / 10, "{small:?}, {large:?}");
    let graph = build(&["x"], |b, i| vec![b.abs(i[0])]);
    assert!(kinks(&graph, 1, &report(&[0], 0.0), 4, &Unwatched).is_err(), "the budget is kept");
}
