//! The reverse sweep through loops: the same numbers as the forward sweep, from graphs that do not grow with the trip
//! count and whose tapes keep to their limit.

mod support;

use isograd_graph::{
    Builder, Graph, Mode, Node, NodeId, Precision, Scalar, Unwatched, Value, evaluate, parse, print, verify,
};
use isograd_transform::{Sweep, cost, differentiate, fold, live, optimise, schedule};
use support::lane_kernels;

const MANY: usize = 1_000_000;
/// Bytes of a point's tapes at most, and of a scalar on them.
const LIMIT: usize = 64 << 10;
const SCALAR: usize = 8;

/// The real inputs of the graphs under test; an int follows them.
const REALS: [&str; 4] = ["a", "b", "c", "d"];

/// A raw graph of values and of their derivatives by all real inputs.
fn gradients(make: impl FnOnce(&mut Builder<'_>, &[NodeId], NodeId) -> Vec<NodeId>) -> Graph {
    let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
    let reals: Vec<_> = REALS.iter().map(|n| b.input(*n, Scalar::Real)).collect();
    let n = b.input("n", Scalar::Int);
    for (i, value) in make(&mut b, &reals, n).into_iter().enumerate() {
        b.output(format!("out{i}"), value);
        for (name, x) in REALS.iter().zip(&reals) {
            let slope = b.diff(value, *x);
            b.output(format!("out{i}.{name}"), slope);
        }
    }
    verify(b.finish().unwrap()).unwrap().into_inner()
}

fn expand(graph: &Graph, sweep: Sweep) -> Graph {
    let expanded = differentiate(graph.clone(), sweep, isograd_graph::Precision::F32, 6, MANY, &Unwatched).unwrap();
    verify(expanded).unwrap().into_inner()
}

fn finish(graph: &Graph) -> Graph {
    let p = Precision::F64;
    let mut graph = verify(fold(graph, p, MANY, &Unwatched).unwrap()).unwrap().into_inner();
    for step in [lane_kernels, optimise, schedule] {
        graph = verify(step(&graph, p, MANY, &Unwatched).unwrap()).unwrap().into_inner();
        let again = parse(&print(&graph)).unwrap();
        assert_eq!(print(&again), print(&graph));
        assert_eq!(verify(again).unwrap().into_inner(), without_origins(&graph));
    }
    graph
}

/// A graph compared by what its text says.
fn without_origins(graph: &Graph) -> Graph {
    parse(&print(graph)).unwrap()
}

fn numbers(graph: &Graph, reals: &[f64], n: i32) -> Vec<f64> {
    let mut inputs: Vec<_> = reals.iter().map(|x| Value::Real(*x)).collect();
    inputs.push(Value::Int(n));
    let outputs = evaluate(graph, Precision::F64, &inputs).unwrap();
    outputs
        .into_iter()
        .map(|v| match v {
            Value::Real(x) => x,
            other => panic!("{other:?}"),
        })
        .collect()
}

/// How many scalars the tapes of a finished graph hold.
fn taped(graph: &Graph) -> usize {
    let live = live(graph);
    let held = |(id, node): (NodeId, Node)| match node {
        Node::Tape { end, every, .. } if live[id.index()] => {
            let Node::End { begin } = graph[end] else { panic!() };
            let Node::Theta { lo, hi, .. } = graph[begin] else { panic!() };
            let (Node::Int(lo), Node::Int(hi)) = (graph[lo], graph[hi]) else { panic!("not constant") };
            usize::try_from(hi - lo).unwrap().div_ceil(every as usize)
        }
        _ => 0,
    };
    graph.iter().map(held).sum()
}

const POINTS: [[f64; 4]; 5] = [
    [0.5, -0.25, 0.75, 1.0],
    [-0.5, 0.3, 0.1, -0.7],
    [0.9, 0.8, -0.6, 0.2],
    [-0.1, -0.9, -0.3, 0.4],
    [0.0, 0.0, 0.0, 0.0],
];

/// Both sweeps agree, before and after the rest of the pipeline. Returns the finished reverse graph.
fn agree(graph: &Graph) -> Graph {
    agree_at(graph, &POINTS, &[0, 1, 2, 5])
}

/// As [`agree`], for loops that take long.
fn agree_once(graph: &Graph) -> Graph {
    agree_at(graph, &POINTS[..1], &[1])
}

fn agree_at(graph: &Graph, points: &[[f64; 4]], trips: &[i32]) -> Graph {
    let (forward, reverse) = (expand(graph, Sweep::Forward), expand(graph, Sweep::Reverse));
    let finished = finish(&reverse);
    for point in points {
        for n in trips {
            let (point, n) = (*point, *n);
            let (want, got) = (numbers(&forward, &point, n), numbers(&reverse, &point, n));
            near(&want, &got, &reverse, (point, n));
            // The kernels give other last bits than the host's functions.
            near(&want, &numbers(&finished, &point, n), &finished, (point, n));
        }
    }
    assert!(taped(&finished) * SCALAR <= LIMIT, "{} scalars", taped(&finished));
    finished
}

fn near(want: &[f64], got: &[f64], graph: &Graph, at: ([f64; 4], i32)) {
    for (i, (want, got)) in want.iter().zip(got).enumerate() {
        let near = (want - got).abs() <= 1e-10 * want.abs().max(1.0) || (want.is_nan() && got.is_nan());
        assert!(near, "output {i} at {at:?}: {got}, forward {want}\n{}", print(graph));
    }
}

/// x ← body(x) from the given starts, for the counter from `lo` up to `hi`.
fn repeat(
    b: &mut Builder<'_>,
    lo: NodeId,
    hi: NodeId,
    inits: &[NodeId],
    body: impl FnOnce(&mut Builder<'_>, NodeId, &[NodeId]) -> Vec<NodeId>,
) -> Vec<NodeId> {
    b.theta(lo, hi);
    let counter = b.counter();
    let carried: Vec<_> = inits.iter().map(|x| b.carried(*x)).collect();
    let nexts = body(b, counter, &carried);
    let end = b.end();
    carried.iter().zip(nexts).map(|(x, next)| b.carry_out(end, *x, next)).collect()
}

fn times(
    b: &mut Builder<'_>,
    n: i32,
    inits: &[NodeId],
    body: impl FnOnce(&mut Builder<'_>, NodeId, &[NodeId]) -> Vec<NodeId>,
) -> Vec<NodeId> {
    let (lo, hi) = (b.int(0), b.int(n));
    repeat(b, lo, hi, inits, body)
}

/// x ← sin(a·x + b)·c + i·d, n times.
fn recurrence(n: i32) -> Graph {
    gradients(|b, i, _| {
        times(b, n, &[i[3]], |b, counter, x| {
            let product = b.mul(i[0], x[0]);
            let sum = b.add(product, i[1]);
            let sine = b.sin(sum);
            let scaled = b.mul(sine, i[2]);
            let number = b.int_to_real(counter);
            let small = b.real(0.01);
            let number = b.mul(number, small);
            let shift = b.mul(number, i[3]);
            vec![b.add(scaled, shift)]
        })
    })
}

#[test]
fn a_recurrence() {
    for n in [1, 2, 7, 50] {
        let finished = agree(&recurrence(n));
        assert_eq!(taped(&finished), n as usize);
    }
}

#[test]
fn no_iteration() {
    for n in [0, -3] {
        assert_eq!(taped(&agree(&recurrence(n))), 0);
    }
}

#[test]
fn bounds_that_fold_and_do_not_begin_at_zero() {
    let graph = gradients(|b, i, _| {
        let (two, three) = (b.int(2), b.int(3));
        let lo = b.isub(two, three);
        let lo = b.fresh(lo);
        let hi = b.imul(two, three);
        repeat(b, lo, hi, &[i[3], i[0]], |b, counter, x| {
            let number = b.int_to_real(counter);
            let p = b.mul(x[0], i[1]);
            let q = b.mul(x[1], number);
            let small = b.real(0.1);
            let q = b.mul(q, small);
            vec![b.add(p, x[1]), b.add(q, i[2])]
        })
    });
    // Only the first variable is read by a slope.
    assert_eq!(taped(&agree(&graph)), 7);
}

#[test]
fn loops_in_loops() {
    let graph = gradients(|b, i, _| {
        times(b, 4, &[i[0], i[1]], |b, _, x| {
            let inner = times(b, 3, &[x[0], i[2]], |b, counter, y| {
                let number = b.int_to_real(counter);
                let p = b.mul(y[0], y[1]);
                let q = b.mul(x[1], number);
                let p = b.add(p, q);
                let sine = b.sin(p);
                let more = b.mul(y[1], i[3]);
                vec![sine, b.add(more, x[0])]
            });
            let next = b.mul(inner[1], x[1]);
            vec![inner[0], b.sin(next)]
        })
    });
    let finished = agree(&graph);
    // Two values, each with a walk of its own; what the outer loop starts with is recorded once.
    assert_eq!(taped(&finished), 4 * 2 + 2 * 3 * 2);
    assert!(!finished.iter().any(|(_, n)| matches!(n, Node::Diff { .. })));
}

/// The inner loop takes part by its Jacobian, the outer one has a tape.
#[test]
fn a_loop_that_runs_as_often_as_an_input_says_in_one_that_does_not() {
    let graph = gradients(|b, i, n| {
        times(b, 3, &[i[0]], |b, _, x| {
            let zero = b.int(0);
            repeat(b, zero, n, x, |b, _, y| {
                let p = b.mul(y[0], i[1]);
                let sum = b.add(p, i[2]);
                vec![b.sin(sum)]
            })
        })
    });
    assert_eq!(taped(&agree(&graph)), 3);
}

#[test]
fn a_loop_in_one_that_runs_as_often_as_an_input_says() {
    let graph = gradients(|b, i, n| {
        let zero = b.int(0);
        repeat(b, zero, n, &[i[0]], |b, _, x| {
            times(b, 3, x, |b, _, y| {
                let p = b.mul(y[0], i[1]);
                let sum = b.add(p, i[2]);
                vec![b.sin(sum)]
            })
        })
    });
    assert_eq!(taped(&agree(&graph)), 0);
}

#[test]
fn a_loop_in_a_branch_and_a_branch_in_a_loop() {
    let graph = gradients(|b, i, _| {
        let zero = b.real(0.0);
        let cond = b.lt(i[0], zero);
        b.gamma(cond);
        let looped = times(b, 5, &[i[1]], |b, _, x| {
            let inner = b.lt(x[0], i[2]);
            b.gamma(inner);
            let p = b.mul(x[0], i[3]);
            let p = b.add(p, i[2]);
            b.otherwise();
            let root = b.sqrt(x[0]);
            let q = b.sub(root, i[0]);
            let end = b.end();
            vec![b.join(end, p, q)]
        });
        b.otherwise();
        let other = b.mul(i[1], i[2]);
        let end = b.end();
        let result = b.join(end, looped[0], other);
        vec![b.mul(result, i[3])]
    });
    assert_eq!(taped(&agree(&graph)), 5);
}

#[test]
fn ints_and_truths_are_carried_too() {
    let graph = gradients(|b, i, _| {
        let (one, yes) = (b.int(1), b.bool(true));
        let results = times(b, 6, &[i[0], one, yes, i[1]], |b, counter, x| {
            let number = b.int_to_real(x[1]);
            let small = b.real(0.1);
            let number = b.mul(number, small);
            let p = b.mul(x[0], number);
            let q = b.mul(x[0], i[2]);
            let real = b.select(x[2], p, q);
            let int = b.iadd(x[1], counter);
            let half = b.real(0.3);
            let truth = b.lt(real, half);
            let other = b.mul(x[3], real);
            vec![real, int, truth, b.add(other, i[3])]
        });
        vec![results[0], results[3]]
    });
    assert_eq!(taped(&agree(&graph)), 6 * 4);
}

/// What the last iteration gives a variable that nothing reads has the adjoint 0, and √ at 0 an infinite slope: at the
/// point of zeros, of which the tested ones have one.
#[test]
fn what_nothing_reads_contributes_nothing() {
    let graph = gradients(|b, i, _| {
        let results = times(b, 3, &[i[0], i[1]], |b, counter, x| {
            let two = b.int(2);
            let left = b.isub(two, counter);
            let left = b.int_to_real(left);
            let under = b.add(i[2], left);
            let root = b.sqrt(under);
            vec![b.add(x[0], x[1]), root]
        });
        vec![results[0]]
    });
    agree(&graph);
}

/// The second iteration takes another value than what the first one computes, as √ at 0.
#[test]
fn what_an_iteration_does_not_take_contributes_nothing() {
    let graph = gradients(|b, i, _| {
        times(b, 3, &[i[0]], |b, counter, x| {
            let one = b.int(1);
            let second = b.ieq(counter, one);
            let taken = b.select(second, i[3], x[0]);
            let number = b.int_to_real(counter);
            let under = b.add(taken, number);
            vec![b.sqrt(under)]
        })
    });
    agree(&graph);
}

/// The inner loop starts a variable that nothing reads with one that nothing else reads.
#[test]
fn variables_that_nothing_needs_are_left_out() {
    let graph = gradients(|b, i, _| {
        let squared = b.mul(i[1], i[1]);
        let unneeded = b.sin(squared);
        let results = times(b, 2, &[i[0], unneeded], |b, _, x| {
            let under = b.mul(x[1], i[2]);
            let unread = b.sin(under);
            let inner = times(b, 3, &[x[0], unread], |b, _, y| vec![b.mul(y[0], i[3]), b.mul(y[1], i[3])]);
            vec![inner[0], under]
        });
        vec![results[0]]
    });
    assert_eq!(taped(&agree(&graph)), 2 + 3);
}

/// Variables that are swapped, one that keeps its content, one that comes from outside, one nobody asks for.
#[test]
fn variables_of_all_kinds() {
    let graph = gradients(|b, i, _| {
        let results = times(b, 5, &[i[0], i[1], i[2], i[3], i[0]], |b, _, x| {
            let p = b.mul(x[0], x[2]);
            let q = b.mul(x[3], x[1]);
            let unused = b.mul(x[4], x[4]);
            vec![b.add(x[1], p), x[0], x[2], i[3], b.add(unused, q)]
        });
        vec![results[0], results[1], results[3]]
    });
    agree(&graph);
}

#[test]
fn second_derivatives_and_sweeps_in_any_mix() {
    let graph = |n: i32| {
        gradients(|b, i, _| {
            let results = times(b, n, &[i[0], i[1]], |b, _, x| {
                let p = b.mul(x[0], i[2]);
                let q = b.mul(x[1], i[3]);
                let sum = b.add(p, q);
                vec![b.sin(sum), b.mul(x[0], x[1])]
            });
            let sum = b.add(results[0], results[1]);
            let first = b.diff(sum, i[0]);
            let other = b.diff(sum, i[2]);
            let third = b.diff(other, i[3]);
            let mixed = b.mul(first, third);
            vec![first, other, mixed]
        })
    };
    agree(&graph(4));
    agree(&graph(1));
}

#[test]
fn results_of_one_loop_are_what_the_next_starts_with() {
    let graph = gradients(|b, i, _| {
        let first = times(b, 4, &[i[0], i[1]], |b, _, x| {
            let p = b.mul(x[0], i[2]);
            vec![b.sin(p), b.add(x[1], p)]
        });
        let product = b.mul(first[0], first[1]);
        times(b, 3, &[product], |b, _, x| {
            let p = b.mul(x[0], first[0]);
            vec![b.add(p, i[3])]
        })
    });
    assert_eq!(taped(&agree(&graph)), 4 + 3);
}

#[test]
fn the_graph_does_not_grow_with_the_trip_count() {
    let size = |n| finish(&expand(&recurrence(n), Sweep::Reverse)).len();
    assert_eq!(size(10), size(10_000));
    // Longer ones keep every so many iterations, which is another graph, again of one size.
    assert_eq!(size(40_000), size(1_000_000));
    assert!(size(40_000) < 2 * size(10));
    let raw = |n| expand(&recurrence(n), Sweep::Reverse).len();
    assert_eq!(raw(10), raw(10_000));
}

#[test]
fn long_loops_recompute() {
    // 40,000 is 200 · 200; of a prime, the last chunk is shorter.
    for n in [40_000, 40_009] {
        let finished = agree_once(&recurrence(n));
        assert!((1..1_000).contains(&taped(&finished)), "{}", taped(&finished));
    }
}

/// Several variables, and chunks whose last one is shorter: the same as without.
#[test]
fn chunks_of_several_variables() {
    let graph = |n: i32| {
        gradients(|b, i, _| {
            let zero = b.int(0);
            let results = times(b, n, &[i[0], i[1], zero, i[2], i[3], i[0], i[1], i[2], i[3]], |b, counter, x| {
                let one = b.int(1);
                let more = b.iadd(x[2], one);
                let number = b.int_to_real(x[2]);
                let other = b.int_to_real(counter);
                let number = b.mul(number, other);
                let small = b.real(1e-8);
                let number = b.mul(number, small);
                let p = b.mul(x[0], i[2]);
                let q = b.mul(x[1], number);
                let sum = b.add(p, q);
                let half = b.real(0.5);
                let limited = b.mul(sum, half);
                let sine = b.sin(limited);
                vec![sine, b.mul(x[1], i[3]), more, x[4], x[5], x[6], x[7], x[8], sine]
            });
            vec![results[0], results[3]]
        })
    };
    for n in [2_039, 2_048] {
        let finished = agree_once(&graph(n));
        assert!((1..1_000).contains(&taped(&finished)), "{}", taped(&finished));
    }
}

/// Tapes fit one by one but not together: all loops but the shortest recompute.
#[test]
fn the_limit_is_for_all_loops_together() {
    let graph = gradients(|b, i, _| {
        let mut x = i[0];
        for k in 0..3 {
            x = times(b, 6_000, &[x], |b, _, x| {
                let p = b.mul(x[0], i[1]);
                let sum = b.add(p, i[2 + k % 2]);
                vec![b.sin(sum)]
            })[0];
        }
        vec![x]
    });
    let finished = agree_once(&graph);
    assert!(taped(&finished) > 0);
}

/// Too long even for chunks: by the Jacobian, as if the trip count were not constant.
#[test]
fn what_no_tape_can_hold_is_differentiated_forward() {
    let graph = gradients(|b, i, _| {
        let inits: Vec<NodeId> = i.iter().cycle().take(40).copied().collect();
        times(b, 60_000, &inits, |b, _, x| {
            let mut next = x[1..].to_vec();
            let p = b.mul(x[0], i[0]);
            next.push(b.sin(p));
            next
        })
        .drain(..1)
        .collect()
    });
    let finished = finish(&expand(&graph, Sweep::Reverse));
    assert_eq!(taped(&finished), 0);
}

/// What the sweep is for: many parameters, read by a loop of 50 iterations.
#[test]
fn the_cost_does_not_grow_with_the_parameters() {
    let graph = |parameters: usize, slopes: bool| {
        let mut b = Builder::new(Mode::Raw, MANY, &Unwatched);
        let x = b.input("x", Scalar::Real);
        let p: Vec<_> = (0..parameters).map(|k| b.input(format!("p{k}"), Scalar::Real)).collect();
        let y = times(&mut b, 50, &[x], |b, _, x| {
            let terms: Vec<NodeId> = p.iter().map(|p| b.mul(x[0], *p)).collect();
            let sum = terms.into_iter().reduce(|a, c| b.add(a, c)).unwrap();
            vec![b.sin(sum)]
        })[0];
        b.output("y", y);
        for p in p.iter().filter(|_| slopes) {
            let slope = b.diff(y, *p);
            b.output("slope", slope);
        }
        b.finish().unwrap()
    };
    for parameters in [10, 100, 1_000] {
        let done = |slopes, sweep| {
            cost(&fold(&expand(&graph(parameters, slopes), sweep), Precision::F32, MANY, &Unwatched).unwrap())
        };
        let value = done(false, Sweep::Forward);
        let reverse = done(true, Sweep::Reverse);
        let ratio = reverse as f64 / value as f64;
        println!("{parameters} parameters: value {value}, gradient in reverse {reverse}, {ratio:.2}×");
        if parameters <= 100 {
            println!("    forward {}", done(true, Sweep::Forward));
        }
        assert!(ratio < 4.0, "{ratio}");
    }
}
