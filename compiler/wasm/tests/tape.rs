//! Tapes in lanes: what a loop leaves of each iteration is what another loop reads, wherever the two stand and whatever
//! is the same in all lanes; and where tapes lie in memory.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use isograd_graph::{Builder, NodeId, Precision, Scalar, Value, Verified, parse, print, verify};
use isograd_wasm::{EmitError, Module, Options, Split, Vectors, emit};
use support::{PRECISIONS, Random, compare, graph};

const INPUTS: [(&str, Scalar); 4] = [("x", Scalar::Real), ("y", Scalar::Real), ("n", Scalar::Int), ("f", Scalar::Bool)];

fn points(count: usize, seed: u64) -> Vec<Vec<Value>> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let real = |random: &mut Random| Value::Real(random.unit() * 4.0 - 2.0);
            let (x, y) = (real(&mut random), real(&mut random));
            vec![x, y, Value::Int(random.below(6) as i32 - 1), Value::Bool(random.below(2) == 0)]
        })
        .collect()
}

/// x ← x·y + i, with an int and a truth beside it, from `lo` up to `hi`; then what each `every`-th iteration started
/// with, last first, is summed up. Returns the sum.
fn there_and_back(b: &mut Builder<'_>, i: &[NodeId], lo: i32, hi: i32, every: i32) -> NodeId {
    let (zero, none) = (b.real(0.0), b.int(0));
    let (from, to) = (b.int(lo), b.int(hi));
    b.theta(from, to);
    let counter = b.counter();
    let (x, k, t) = (b.carried(i[0]), b.carried(i[2]), b.carried(i[3]));
    let number = b.int_to_real(counter);
    let product = b.mul(x, i[1]);
    let next_x = b.add(product, number);
    let next_k = b.iadd(k, counter);
    let next_t = b.lt(x, i[1]);
    let end = b.end();
    let last = b.carry_out(end, x, next_x);
    b.carry_out(end, k, next_k);
    b.carry_out(end, t, next_t);
    let tapes = [x, k, t].map(|x| b.tape(end, x, every as u32));

    let held = (hi - lo + every - 1) / every;
    let (held, top) = (b.int(held), b.int(held - 1));
    b.theta(none, held);
    let counter = b.counter();
    let at = b.isub(top, counter);
    let sum = b.carried(last);
    let [x, k, t] = tapes.map(|tape| b.recall(tape, at));
    let k = b.int_to_real(k);
    let chosen = b.select(t, x, zero);
    let term = b.mul(chosen, k);
    let half = b.real(0.5);
    let less = b.mul(sum, half);
    let more = b.add(term, less);
    let next = b.add(more, x);
    let end = b.end();
    b.carry_out(end, sum, next)
}

fn with_inputs(precision: Precision, make: impl FnOnce(&mut Builder<'_>, &[NodeId]) -> Vec<NodeId>) -> Verified {
    graph(precision, |b| {
        let inputs: Vec<NodeId> = INPUTS.iter().map(|(name, kind)| b.input(*name, *kind)).collect();
        for (i, node) in make(b, &inputs).into_iter().enumerate() {
            b.output(format!("out{i}"), node);
        }
    })
}

/// For every choice of varying inputs.
fn everywhere(make: impl Fn(&mut Builder<'_>, &[NodeId]) -> Vec<NodeId>) {
    for precision in PRECISIONS {
        let verified = with_inputs(precision, &make);
        let again = verify(parse(&print(&verified)).expect("parses")).expect("well formed");
        for bits in 0..16 {
            let varying = [bits & 1 > 0, bits & 2 > 0, bits & 4 > 0, bits & 8 > 0];
            compare(&verified, &varying, &points(70, 5));
        }
        compare(&again, &[true; 4], &points(30, 6));
    }
}

#[test]
fn what_a_loop_writes_the_next_one_reads() {
    everywhere(|b, i| vec![there_and_back(b, i, 0, 7, 1)]);
}

#[test]
fn counters_begin_anywhere() {
    everywhere(|b, i| vec![there_and_back(b, i, -3, 2, 1), there_and_back(b, i, 5, 6, 1)]);
}

#[test]
fn tapes_of_every_so_many_iterations() {
    everywhere(|b, i| {
        let cases = [(0, 12, 4), (-2, 11, 5), (1, 4, 7), (0, 9, 2)];
        cases.iter().map(|(lo, hi, every)| there_and_back(b, i, *lo, *hi, *every)).collect()
    });
}

/// Lanes that are off write and read their own places only.
#[test]
fn in_branches_and_loops_that_lanes_leave_one_by_one() {
    everywhere(|b, i| {
        let zero = b.int(0);
        b.theta(zero, i[2]);
        let x = b.carried(i[0]);
        let below = b.lt(x, i[1]);
        b.gamma(below);
        let one = there_and_back(b, &[x, i[1], i[2], i[3]], 0, 3, 1);
        b.otherwise();
        let other = there_and_back(b, &[i[1], x, i[2], below], 0, 5, 2);
        let end = b.end();
        let joined = b.join(end, one, other);
        let shrunk = b.real(0.125);
        let next = b.mul(joined, shrunk);
        let end = b.end();
        let result = b.carry_out(end, x, next);
        vec![result, there_and_back(b, &[result, i[0], i[2], i[3]], 0, 4, 1)]
    });
}

/// The loop that reads stands in a later function, after work that does not fit one.
#[test]
fn across_functions() {
    everywhere(|b, i| {
        let (lo, hi, one) = (b.int(0), b.int(6), b.real(0.9));
        b.theta(lo, hi);
        let (x, u) = (b.carried(i[0]), b.carried(one));
        let (next, next_u) = (b.mul(x, i[1]), b.mul(u, one));
        let end = b.end();
        let last = b.carry_out(end, x, next);
        let last_u = b.carry_out(end, u, next_u);
        let (xs, us) = (b.tape(end, x, 1), b.tape(end, u, 1));
        let between = (0..40).fold(last, |sum, k| {
            let c = b.real(f64::from(k) + 0.5);
            let quotient = b.div(i[0], c);
            b.sub(sum, quotient)
        });
        b.theta(lo, hi);
        let counter = b.counter();
        let sum = b.carried(between);
        let (x, u) = (b.recall(xs, counter), b.recall(us, counter));
        let product = b.mul(x, u);
        let more = b.add(sum, product);
        let next = b.add(more, last_u);
        let end = b.end();
        vec![b.carry_out(end, sum, next)]
    });
}

fn emitted(verified: &Verified, varying: bool, vectors: Vectors, split: Split) -> Module {
    let precision = verified.precision.expect("a precision");
    let varying = vec![varying; verified.inputs.len()];
    emit(verified, &Options { precision, varying: &varying, vectors: Some(vectors), split }, b"").expect("emits")
}

/// Three tapes of 50 iterations: a vector of points for each, or of all points alike.
#[test]
fn the_layout_counts_their_bytes() {
    for precision in PRECISIONS {
        let verified = with_inputs(precision, |b, i| vec![there_and_back(b, i, 0, 50, 1)]);
        for (vectors, n) in [(Vectors::One, 1), (Vectors::Two, 2), (Vectors::Four, 4)] {
            assert_eq!(emitted(&verified, true, vectors, Split::NEVER).layout.scratch, 3 * 50 * 16 * n);
            assert_eq!(emitted(&verified, false, vectors, Split::NEVER).layout.scratch, 3 * 50 * 16);
        }
        let cut = emitted(&verified, true, Vectors::One, Split { above: 0, most: 4, points: 16 }).layout;
        assert!(cut.scratch >= 3 * 50 * 16 * precision.bytes());
        let none = with_inputs(precision, |b, i| vec![b.add(i[0], i[1])]);
        assert_eq!(emitted(&none, true, Vectors::One, Split::NEVER).layout.scratch, 0);
    }
}

/// Each lane would read another place.
#[test]
fn a_number_that_lanes_differ_in_is_refused() {
    let verified = with_inputs(Precision::F32, |b, i| {
        let (lo, hi) = (b.int(0), b.int(3));
        b.theta(lo, hi);
        let x = b.carried(i[0]);
        let next = b.mul(x, i[1]);
        let end = b.end();
        b.carry_out(end, x, next);
        let tape = b.tape(end, x, 1);
        vec![b.recall(tape, i[2])]
    });
    let options = Options { precision: Precision::F32, varying: &[true; 4], vectors: None, split: Split::NEVER };
    assert!(matches!(emit(&verified, &options, b""), Err(EmitError::Tape(_))));
}

#[test]
fn the_verifier_knows_what_a_tape_is() {
    let text = |bound: &str, tape: &str, rest: &str| {
        format!(
            "precision f32\n%0 = input x: real\n%1 = input n: int\n%2 = int 0\n%3 = int 4\n%4 = theta %2 {bound}\n\
             %5 = carried %4 %0\n%6 = add %5 %5\n%7 = end\n%8 = final %7 %5 %6\n%9 = tape {tape}\n{rest}"
        )
    };
    let good = "%10 = recall %9 %2\noutput y %10\n";
    let check = |text: String| verify(parse(&text).expect("parses")).map(|_| ()).map_err(|e| e.what);
    assert_eq!(check(text("%3", "%7 %5 1", good)), Ok(()));
    assert_eq!(check(text("%3", "%7 %6 2", good)), Ok(()));
    for (bound, tape, rest) in [
        ("%1", "%7 %5 1", good),
        ("%2", "%7 %5 1", good),
        ("%3", "%7 %5 0", good),
        ("%3", "%4 %5 1", good),
        ("%3", "%7 %5 1", "%10 = recall %8 %2\noutput y %10\n"),
        ("%3", "%7 %5 1", "%10 = recall %9 %8\noutput y %10\n"),
        ("%3", "%7 %5 1", "%10 = add %9 %9\noutput y %10\n"),
        ("%3", "%7 %5 1", "output y %9\n"),
    ] {
        assert!(check(text(bound, tape, rest)).is_err(), "{bound}, {tape}, {rest}");
    }
}
