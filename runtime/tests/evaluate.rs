//! Evaluation does not depend on how the points are cut up: tails, threads, rates. And it stops when it must.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use std::time::{Duration, Instant};

use isograd_compiler::Precision;
use isograd_graph::{Builder, Scalar};
use isograd_runtime::{Column, EvalError, EvalOptions, LoadError, Runtime, Settings, Values};
use isograd_wasm::Vectors;
use support::{artefact, sphere};

const VECTORS: [Vectors; 3] = [Vectors::One, Vectors::Two, Vectors::Four];

fn numbers(n: usize, seed: f32) -> Vec<f32> {
    (0..n).map(|i| ((i as f32 + seed) * 0.37).sin() * 3.0).collect()
}

fn f32s(column: &Column) -> &[f32] {
    match column {
        Column::F32(x) => x,
        other => panic!("not f32: {other:?}"),
    }
}

/// The host computes each operation rounded on its own, as WebAssembly does.
fn host_sphere(x: f32, y: f32, z: f32, r: f32) -> f32 {
    (x * x + y * y + z * z).sqrt() - r
}

#[test]
fn tails_of_every_length() {
    let runtime = Runtime::default();
    let (x, y, z) = (numbers(40, 0.0), numbers(40, 7.0), numbers(40, 19.0));
    for vectors in VECTORS {
        let artefact = artefact(Precision::F32, &[true, true, true, false], Some(vectors), |b| sphere(b, true));
        let kernel = runtime.load(&artefact).expect("loads");
        for n in 0..=40 {
            let inputs = [Values::F32(&x[..n]), Values::F32(&y[..n]), Values::F32(&z[..n]), Values::F32(&[0.75])];
            let columns = kernel.evaluate(&inputs, n, &EvalOptions::default()).expect("evaluates");
            assert_eq!(columns.len(), 4);
            assert!(columns.iter().all(|column| column.len() == n));
            for (i, got) in f32s(&columns[0]).iter().enumerate() {
                assert_eq!(got.to_bits(), host_sphere(x[i], y[i], z[i], 0.75).to_bits(), "point {i} of {n}");
            }
        }
    }
}

#[test]
fn a_million_points_on_any_number_of_threads() {
    let n = 1_000_003;
    let runtime = Runtime::default();
    let artefact = artefact(Precision::F32, &[true, true, true, false], None, |b| sphere(b, true));
    let kernel = runtime.load(&artefact).expect("loads");
    let (x, y, z) = (numbers(n, 0.0), numbers(n, 7.0), numbers(n, 19.0));
    let inputs = [Values::F32(&x), Values::F32(&y), Values::F32(&z), Values::F32(&[1.5])];
    let evaluate =
        |threads| kernel.evaluate(&inputs, n, &EvalOptions { threads, ..EvalOptions::default() }).expect("evaluates");
    let alone = evaluate(Some(1));
    for (i, got) in f32s(&alone[0]).iter().enumerate() {
        assert_eq!(got.to_bits(), host_sphere(x[i], y[i], z[i], 1.5).to_bits(), "point {i}");
    }
    for threads in [None, Some(2), Some(7)] {
        assert_eq!(evaluate(threads), alone, "{threads:?} threads");
    }
}

/// The same points in one call, one by one, and with a uniform input given as a column.
#[test]
fn batches_and_rates_do_not_change_bits() {
    let runtime = Runtime::default();
    let n = 300;
    let (x, y, z) = (numbers(n, 0.0), numbers(n, 7.0), numbers(n, 19.0));
    let build = |b: &mut Builder<'_>| sphere(b, true);
    let uniform = runtime.load(&artefact(Precision::F32, &[true, true, true, false], None, build)).expect("loads");
    let varying = runtime.load(&artefact(Precision::F32, &[true; 4], None, build)).expect("loads");
    let radius = vec![0.3_f32; n];
    let options = EvalOptions::default();
    let all = [Values::F32(&x), Values::F32(&y), Values::F32(&z)];
    let with = |r| [all[0], all[1], all[2], r];
    let want = uniform.evaluate(&with(Values::F32(&[0.3])), n, &options).expect("evaluates");
    assert_eq!(varying.evaluate(&with(Values::F32(&radius)), n, &options).expect("evaluates"), want);
    // One number for a varying input stands for all points; f64 is rounded.
    assert_eq!(varying.evaluate(&with(Values::F32(&[0.3])), n, &options).expect("evaluates"), want);
    assert_eq!(varying.evaluate(&with(Values::F64(&[0.3])), n, &options).expect("evaluates"), want);
    for i in 0..n {
        let point = [Values::F32(&x[i..=i]), Values::F32(&y[i..=i]), Values::F32(&z[i..=i]), Values::F32(&[0.3])];
        let got = uniform.evaluate(&point, 1, &options).expect("evaluates");
        for (got, want) in got.iter().zip(&want) {
            assert_eq!(f32s(got)[0].to_bits(), f32s(want)[i].to_bits());
        }
    }
}

#[test]
fn every_nan_has_all_bits_set() {
    let runtime = Runtime::default();
    let roots = |b: &mut Builder<'_>| {
        let x = b.input("x", Scalar::Real);
        let root = b.sqrt(x);
        let negated = b.neg(root);
        b.output("x", x);
        b.output("root", root);
        b.output("negated", negated);
    };
    let x = [-1.0, f32::from_bits(0x7fc0_1234), -f32::NAN, 4.0, -0.0, f32::from_bits(0xffff_fffe)];
    let kernel = runtime.load(&artefact(Precision::F32, &[true], None, roots)).expect("loads");
    let columns = kernel.evaluate(&[Values::F32(&x)], x.len(), &EvalOptions::default()).expect("evaluates");
    for column in &columns {
        for (got, x) in f32s(column).iter().zip(x) {
            assert!(!got.is_nan() || got.to_bits() == u32::MAX, "{x} gives {:08x}", got.to_bits());
        }
    }
    assert_eq!(f32s(&columns[1])[3..5], [2.0, -0.0]);

    let kernel = runtime.load(&artefact(Precision::F64, &[true], None, roots)).expect("loads");
    let columns = kernel.evaluate(&[Values::F32(&x)], x.len(), &EvalOptions::default()).expect("evaluates");
    let Column::F64(root) = &columns[1] else { panic!("not f64") };
    assert_eq!(
        root.iter().map(|x| x.to_bits() == u64::MAX).collect::<Vec<_>>(),
        [true, true, true, false, false, true]
    );
}

/// A loop to n that squares x.
fn powers(b: &mut Builder<'_>) {
    let (x, n) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int));
    let zero = b.int(0);
    b.theta(zero, n);
    let power = b.carried(x);
    let square = b.mul(power, power);
    let end = b.end();
    let result = b.carry_out(end, power, square);
    b.output("y", result);
}

#[test]
fn a_deadline_ends_a_loop_of_two_thousand_million_iterations() {
    let runtime = Runtime::default();
    for varying in [[true, true], [true, false]] {
        let kernel = runtime.load(&artefact(Precision::F32, &varying, None, powers)).expect("loads");
        let run = |n: i32, left: Duration| {
            let options = EvalOptions { deadline: Some(Instant::now() + left), threads: None };
            kernel.evaluate(&[Values::F32(&[1.5, 1.25]), Values::I32(&[n])], 2, &options)
        };
        let begin = Instant::now();
        assert_eq!(run(i32::MAX, Duration::from_millis(100)), Err(EvalError::Deadline));
        let took = begin.elapsed();
        assert!(took >= Duration::from_millis(60) && took < Duration::from_secs(2), "{took:?}");
        // It still works afterwards.
        assert_eq!(run(2, Duration::from_secs(60)), Ok(vec![Column::F32(vec![5.0625, 2.441_406_3])]));
    }
}

#[test]
fn a_deadline_in_the_past_ends_before_the_first_block() {
    let runtime = Runtime::default();
    let artefact = artefact(Precision::F32, &[true, true, true, false], None, |b| sphere(b, false));
    let kernel = runtime.load(&artefact).expect("loads");
    let options = EvalOptions { deadline: Some(Instant::now()), threads: None };
    let one = Values::F32(&[1.0]);
    assert_eq!(kernel.evaluate(&[one; 4], 1, &options), Err(EvalError::Deadline));
}

#[test]
fn wrong_inputs_are_named() {
    let runtime = Runtime::default();
    let kernel = runtime.load(&artefact(Precision::F32, &[true, false], None, powers)).expect("loads");
    let run = |inputs: &[Values<'_>], points| kernel.evaluate(inputs, points, &EvalOptions::default());
    let (two, three) = ([1.0_f32; 2], [1.0_f32; 3]);
    assert!(matches!(run(&[Values::F32(&two)], 2), Err(EvalError::Columns { given: 1, wanted: 2 })));
    let result = run(&[Values::F32(&three), Values::I32(&[1])], 2);
    assert!(matches!(result, Err(EvalError::Length { given: 3, .. })), "{result:?}");
    let result = run(&[Values::F32(&two), Values::I32(&[1, 2])], 2);
    assert!(matches!(result, Err(EvalError::Length { given: 2, .. })), "a uniform input with two values: {result:?}");
    let result = run(&[Values::F32(&two), Values::F32(&[1.0])], 2);
    assert!(matches!(result, Err(EvalError::Kind { .. })), "{result:?}");
}

#[test]
fn limits_refuse_before_compiling() {
    let artefact = artefact(Precision::F32, &[true, true, true, false], None, |b| sphere(b, true));
    let with = |settings| Runtime::new(settings).load(&artefact).map(|_| ());
    assert_eq!(with(Settings::default()), Ok(()));
    let few = Settings { max_operations: 3, ..Settings::default() };
    assert!(matches!(with(few), Err(LoadError::Operations { limit: 3, .. })));
    let small = Settings { max_memory: 65_536, ..Settings::default() };
    assert!(matches!(with(small), Err(LoadError::Memory { limit: 65_536, .. })));
    let mut broken = artefact.clone();
    broken.bytes.truncate(20);
    assert!(matches!(Runtime::default().load(&broken), Err(LoadError::Module(_))));
}

fn memory(manifest: &mut isograd_compiler::Manifest) -> &mut isograd_compiler::Memory {
    match &mut manifest.abi {
        isograd_compiler::Abi::Memory(memory) => memory,
        other => panic!("{other:?}"),
    }
}

/// A manifest is read from files: it may say anything.
#[test]
fn manifests_that_do_not_fit_are_refused() {
    let good = artefact(Precision::F32, &[true, true, true, false], None, |b| sphere(b, true));
    let refused = |change: &dyn Fn(&mut isograd_compiler::Manifest)| {
        let mut wrong = good.clone();
        change(&mut wrong.manifest);
        matches!(Runtime::default().load(&wrong), Err(LoadError::Module(_)))
    };
    assert!(!refused(&|_| {}));
    assert!(refused(&|m| m.outputs[0].columns[0].offset = memory(m).memory));
    assert!(refused(&|m| m.inputs[1].columns[0].offset += 1));
    assert!(refused(&|m| memory(m).pad = 3));
    let mut larger = good.clone();
    memory(&mut larger.manifest).memory += 65_536;
    let kernel = Runtime::default().load(&larger).expect("compiles");
    assert!(matches!(kernel.instance(), Err(EvalError::Instance(_))));
}

#[test]
fn an_instance_computes_in_place() {
    let runtime = Runtime::default();
    let artefact = artefact(Precision::F32, &[true, true, true, false], None, |b| sphere(b, false));
    let kernel = runtime.load(&artefact).expect("loads");
    let mut instance = kernel.instance().expect("an instance");
    let n = instance.block() - 5;
    let columns = [numbers(n, 0.0), numbers(n, 7.0), numbers(n, 19.0)];
    for (k, column) in columns.iter().enumerate() {
        let place = instance.input::<f32>(k);
        place[..n].copy_from_slice(column);
        place[n..].fill(column[n - 1]);
    }
    instance.input::<f32>(3)[0] = 0.5;
    instance.run(n, None).expect("runs");
    for (i, got) in instance.output::<f32>(0)[..n].iter().enumerate() {
        let [x, y, z] = [0, 1, 2].map(|k| columns[k][i]);
        assert_eq!(got.to_bits(), host_sphere(x, y, z, 0.5).to_bits());
    }
    assert!(matches!(instance.run(0, None), Err(EvalError::Count { .. })));
    assert!(matches!(instance.run(n + 6, None), Err(EvalError::Count { .. })));
}

#[test]
fn ints_and_bools_travel_in_both_precisions() {
    let runtime = Runtime::default();
    for precision in [Precision::F32, Precision::F64] {
        let artefact = artefact(precision, &[true, true], None, |b| {
            let (n, t) = (b.input("n", Scalar::Int), b.input("t", Scalar::Bool));
            let one = b.int(1);
            let more = b.iadd(n, one);
            let chosen = b.select_int(t, more, n);
            let not = b.not(t);
            b.output("n", chosen);
            b.output("t", not);
        });
        let kernel = runtime.load(&artefact).expect("loads");
        let n: Vec<i32> = (0..9000).map(|i| i * 7 - 100).collect();
        let t: Vec<i32> = (0..9000).map(|i| i % 3 % 2).collect();
        let columns = kernel.evaluate(&[Values::I32(&n), Values::I32(&t)], n.len(), &EvalOptions::default());
        let want = n.iter().zip(&t).map(|(n, t)| n + t).collect();
        let not = t.iter().map(|t| 1 - t).collect();
        assert_eq!(columns, Ok(vec![Column::I32(want), Column::I32(not)]));
    }
}
