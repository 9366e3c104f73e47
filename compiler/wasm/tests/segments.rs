//! Large graphs cut into several functions: where, how large these are, and that nothing they leave each other is
//! forgotten. That the cut never shows in a bit is also tested by every other comparison, see `support::compare`.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use isograd_graph::{Builder, NodeId, Precision, Scalar, Value, Verified};
use isograd_wasm::{Module, Options, Split, Vectors, emit};
use support::{PRECISIONS, Random, Running, TINY, compare, graph, wide};
use wasmparser::{Operator, Parser, Payload};
use wasmtime::OptLevel;

fn emitted(graph: &Verified, varying: &[bool], split: Split) -> Module {
    let precision = graph.precision.expect("a precision");
    let module = emit(graph, &Options { precision, varying, vectors: Some(Vectors::One), split }, b"").expect("emits");
    wasmparser::validate(&module.bytes).expect("valid");
    module
}

/// What matters here of a function: `at` and `size` are where a store stands in the module.
#[derive(Default)]
struct Function {
    arithmetic: usize,
    loops: usize,
    calls: Vec<u32>,
    stores: Vec<Store>,
}

struct Store {
    at: usize,
    size: usize,
    to: u64,
}

fn functions(module: &Module) -> Vec<Function> {
    let mut all = Vec::new();
    for payload in Parser::new(0).parse_all(&module.bytes) {
        let Payload::CodeSectionEntry(body) = payload.expect("parses") else { continue };
        let mut function = Function::default();
        let mut reader = body.get_operators_reader().expect("operators");
        while !reader.eof() {
            let (operator, at) = reader.read_with_offset().expect("an operator");
            let size = reader.original_position() - at;
            match operator {
                Operator::F32x4Add | Operator::F32x4Mul | Operator::F32x4Sub | Operator::F32x4Sqrt => {
                    function.arithmetic += 1;
                }
                Operator::Loop { .. } => function.loops += 1,
                Operator::Call { function_index } => function.calls.push(function_index),
                Operator::V128Store { memarg } => function.stores.push(Store { at, size, to: memarg.offset }),
                _ => {}
            }
        }
        all.push(function);
    }
    all
}

/// √(…√(√(x² + u²)·…)): each operation reads the one before, and each tenth the value ten before.
fn chain(b: &mut Builder<'_>, n: usize) -> NodeId {
    let (x, u) = (b.input("x", Scalar::Real), b.input("u", Scalar::Real));
    let mut y = b.add(x, u);
    let mut old = y;
    for k in 1..n {
        y = match k % 10 {
            0 => {
                let sum = b.sub(y, old);
                old = sum;
                sum
            }
            5 => b.sqrt(y),
            1 | 7 => b.add(y, u),
            _ => b.mul(y, x),
        };
    }
    y
}

#[test]
fn a_graph_above_the_threshold_has_several_functions_none_too_large() {
    let split = Split::default();
    for (n, cut) in [(split.above, false), (split.above + 1, true), (10_000, true)] {
        let verified = graph(Precision::F32, |b| {
            let y = chain(b, n);
            b.output("y", y);
        });
        assert_eq!(verified.operations(), n);
        let module = emitted(&verified, &[true, true], split);
        let functions = functions(&module);
        assert_eq!(functions.len() > 2, cut, "{n}");
        assert_eq!(functions.iter().map(|f| f.arithmetic).sum::<usize>(), n);
        if cut {
            let parts = &functions[2..];
            assert!(parts.iter().all(|part| part.arithmetic <= split.most && part.loops == 1), "{n}");
            assert!(parts.len() <= n.div_ceil(split.most / 2), "{n}: {} parts", parts.len());
            assert_eq!(functions[0].calls, (2..functions.len() as u32).collect::<Vec<_>>());
            assert_eq!(functions[0].arithmetic, 0);
        } else {
            let whole = emitted(&verified, &[true, true], Split::NEVER);
            assert!(whole == module, "small graphs are not touched");
        }
    }
}

#[test]
fn a_cut_is_where_few_values_live() {
    // Sums of eight products each, of which only the sum goes on: with at most twelve operations to a part, every cut
    // is after a sum.
    let verified = graph(Precision::F32, |b| {
        let (x, y) = (b.input("x", Scalar::Real), b.input("y", Scalar::Real));
        let mut sum = x;
        for _ in 0..6 {
            let products: Vec<NodeId> = (0..4)
                .map(|k| {
                    let c = b.real(k as f64 + 0.5);
                    let left = b.add(sum, c);
                    b.mul(left, y)
                })
                .collect();
            sum = products.into_iter().reduce(|a, c| b.sub(a, c)).expect("four");
        }
        b.output("z", sum);
    });
    let module = emitted(&verified, &[true, true], Split { above: 0, most: 14, points: 16 });
    let functions = functions(&module);
    let shape: Vec<_> = functions[2..].iter().map(|f| (f.arithmetic, f.stores.len())).collect();
    // One store each: the sum for the next part, in the last the output.
    assert_eq!(shape, [(11, 1); 6]);
    // All chunks use the same column, behind the columns of the inputs and the output.
    let slots: Vec<u64> = functions[2..7].iter().map(|f| f.stores[0].to).collect();
    let output = &module.layout.outputs[0];
    assert!(slots.iter().all(|to| *to >= u64::from(output.offset + 4 * module.layout.block)), "{slots:?}");
    assert!(slots.iter().all(|to| *to < u64::from(output.offset + 4 * module.layout.block) + 4096), "{slots:?}");
}

#[test]
fn uniform_values_are_computed_once() {
    let verified = graph(Precision::F32, |b| {
        let (x, u) = (b.input("x", Scalar::Real), b.input("u", Scalar::Real));
        let mut slow = u;
        for _ in 0..30 {
            slow = b.mul(slow, u);
        }
        let mut y = x;
        for _ in 0..30 {
            y = b.add(y, slow);
        }
        b.output("y", y);
        b.output("slow", slow);
    });
    let module = emitted(&verified, &[true, false], Split { above: 0, most: 10, points: 16 });
    let functions = functions(&module);
    let shape: Vec<_> = functions[2..].iter().map(|f| (f.loops, f.arithmetic, f.stores.len())).collect();
    assert_eq!(shape, [(0, 10, 1), (0, 10, 1), (0, 10, 1), (1, 10, 1), (1, 10, 1), (1, 10, 2)]);
    let point = |k: i32| vec![Value::Real(f64::from(k)), Value::Real(1.0 + f64::from(k) / 64.0)];
    let points: Vec<_> = (0..40).map(point).collect();
    for varying in [[true, false], [false, true], [false, false]] {
        compare(&verified, &varying, &points);
    }
}

/// A loop larger than a part, and a branch with an operand that is computed after it, stay whole.
#[test]
fn branches_and_loops_are_never_cut() {
    for precision in PRECISIONS {
        let verified = graph(precision, |b| {
            let (x, n) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int));
            let (zero, one, half) = (b.int(0), b.real(1.0), b.real(0.5));
            let before = b.mul(x, half);
            b.theta(zero, n);
            let carried = b.carried(before);
            let mut next = carried;
            for _ in 0..20 {
                next = b.mul(next, half);
                next = b.add(next, before);
            }
            let end = b.end();
            let looped = b.carry_out(end, carried, next);
            let cond = b.lt(looped, one);
            b.gamma(cond);
            let then = b.add(looped, x);
            b.otherwise();
            let end = b.end();
            let mut after = b.sub(before, one);
            for _ in 0..12 {
                after = b.mul(after, x);
            }
            let join = b.join(end, then, after);
            let mut later = join;
            for _ in 0..12 {
                later = b.sub(later, x);
            }
            let last = b.join(end, later, before);
            let other = b.join(end, then, before);
            let sum = b.add(join, looped);
            b.output("sum", sum);
            b.output("other", other);
            b.output("last", last);
            b.output("looped", looped);
            b.output("after", after);
        });
        if precision == Precision::F32 {
            let functions = functions(&emitted(&verified, &[true, true], TINY));
            let shape: Vec<_> = functions[2..].iter().map(|f| (f.loops, f.arithmetic)).collect();
            // The comparison has no room beside the branch and what is computed for it.
            assert_eq!(shape, [(1, 1), (2, 40), (1, 0), (1, 26), (1, 1)]);
        }
        let points: Vec<_> =
            (0..50).map(|k| vec![Value::Real(f64::from(k) / 8.0 - 2.0), Value::Int(k % 7 - 1)]).collect();
        for varying in [[true, true], [true, false], [false, true], [false, false]] {
            compare(&verified, &varying, &points);
        }
    }
}

/// Leaving out any single store of a value for a later function is found by comparing results.
#[test]
fn a_forgotten_value_shows() {
    let mut random = Random(7);
    let verified = graph(Precision::F32, |b| {
        let (x, u) = (b.input("x", Scalar::Real), b.input("u", Scalar::Real));
        let mut values = vec![b.add(x, u), b.mul(u, u)];
        for _ in 0..120 {
            let last = values.len() - 1;
            let (a, c) = (values[last], values[last - 1 - random.below(last.min(20))]);
            let half = b.real(0.5);
            let sum = if random.below(2) == 0 { b.add(a, c) } else { b.sub(c, a) };
            values.push(b.mul(sum, half));
        }
        // Often enough that rounding does not hide what goes in.
        for (k, value) in values.iter().rev().step_by(6).enumerate() {
            b.output(format!("y{k}"), *value);
        }
    });
    let points: Vec<_> = (0..70).map(|_| vec![Value::Real(random.unit() + 1.0), Value::Real(random.unit())]).collect();
    let mut planted = 0;
    for varying in [[true, true], [true, false]] {
        let module = emitted(&verified, &varying, TINY);
        // Uniform inputs are those of the first point.
        let points: Vec<_> = points.iter().map(|p| vec![p[0], if varying[1] { p[1] } else { points[0][1] }]).collect();
        let right = Running::new(&module, OptLevel::None).run(&points);
        let mut evaluator = isograd_graph::Evaluator::new(&verified, Precision::F32);
        let same = |a: &[Value], b: &[Value]| a.iter().zip(b).all(|(a, b)| a.same_bits(*b));
        assert!(points.iter().zip(&right).all(|(point, got)| same(&evaluator.run(point).expect("ends"), got)));
        let last = module.layout.outputs.last().expect("an output");
        let columns = u64::from(last.offset + 4 * module.layout.block);
        for store in functions(&module).iter().flat_map(|f| &f.stores).filter(|store| store.to >= columns) {
            let mut wrong = module.clone();
            let code = &mut wrong.bytes[store.at..store.at + store.size];
            code.fill(0x01); // nop
            code[..2].fill(0x1a); // drop
            let got = Running::new(&wrong, OptLevel::None).run(&points);
            assert!(right.iter().zip(&got).any(|(a, b)| !same(a, b)), "the store to {} is not needed", store.to);
            planted += 1;
        }
    }
    assert!(planted > 60, "{planted}");
}

#[test]
fn memory_between_functions_is_part_of_the_layout() {
    let verified = wide(Precision::F64, 5_000);
    let size = |split| emitted(&verified, &[true], split).layout.memory;
    let (whole, cut) = (size(Split::NEVER), size(Split::default()));
    // 5,000 columns: of one vector of 16 bytes at least, 512 KiB if that is more.
    assert!(cut > whole && cut <= whole + (576 << 10), "{whole} {cut}");
    let points: Vec<_> = (0..100).map(|k| vec![Value::Real(f64::from(k))]).collect();
    let mut running = Running::new(&emitted(&verified, &[true], Split::default()), OptLevel::None);
    let mut evaluator = isograd_graph::Evaluator::new(&verified, Precision::F64);
    for (point, got) in points.iter().zip(running.run(&points)) {
        assert!(evaluator.run(point).expect("ends")[0].same_bits(got[0]));
    }
}
