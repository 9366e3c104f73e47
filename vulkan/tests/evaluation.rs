//! Kernels of the compiler on a Vulkan device, with the validation layer watching: the bits of WebAssembly, however the
//! points are cut up.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use isograd_compiler::{Abi, Precision, Target};
use isograd_runtime::{Column, EvalError, Values};
use isograd_vulkan::{Choice, Device, Settings, Shader, VulkanError, devices};
use support::{BALL, MIXED, assert_same, bools, compiled, device, ints, numbers, wasm};

const QUERIES: [&str; 2] = ["value", "gradient(at)"];

fn small(memory: u64, groups: u32, staged: bool) -> Settings {
    Settings { memory, groups, staged: Some(staged), ..Settings::default() }
}

fn silent(device: &Device) {
    assert_eq!(device.messages(), Vec::<String>::new(), "the validation layer speaks");
}

#[test]
fn values_are_those_of_webassembly() {
    let Some(device) = device(Settings::default()) else { return };
    for precision in [Precision::F32, Precision::F64] {
        for varying in [&["at", "n", "on", "radius", "m", "inside"][..], &["at", "n", "on"], &["radius"], &[]] {
            let [on_host, on_device] =
                [Target::Wasm, Target::Spirv].map(|target| compiled(MIXED, &["value"], varying, target, precision));
            let shader = device.load(&on_device).expect("loads");
            for n in [0, 1, 63, 64, 65, 1000] {
                // A number for each point where the parameter varies, else one.
                let count = |name: &str| if varying.contains(&name) { n } else { 1 };
                let [x, y, z] = [1.0, 5.0, 11.0].map(|seed| numbers(count("at"), seed));
                let (radius, on, inside) = (numbers(count("radius"), 17.0), bools(count("on")), bools(count("inside")));
                let (first, second) = (ints(count("n")), ints(count("m")));
                let inputs = [
                    Values::F32(&x),
                    Values::F32(&y),
                    Values::F32(&z),
                    Values::I32(&first),
                    Values::I32(&on),
                    Values::F32(&radius),
                    Values::I32(&second),
                    Values::I32(&inside),
                ];
                let got = shader.evaluate(&inputs, n).expect("evaluates");
                assert!(got.iter().all(|column| column.len() == n));
                let what = format!("{precision:?}, {varying:?} varying, {n} points");
                assert_same(&got, &wasm(&on_host, &inputs, n), &what);
            }
        }
    }
    silent(&device);
}

/// Many chunks of several dispatches, copied to the device's memory and not.
#[test]
fn it_does_not_matter_how_points_are_cut_up() {
    let n = 10_007;
    let (x, y, z) = (numbers(n, 0.0), numbers(n, 7.0), numbers(n, 19.0));
    let inputs = [Values::F32(&x), Values::F32(&y), Values::F32(&z), Values::F32(&[1.5])];
    let host = compiled(BALL, &QUERIES, &["at"], Target::Wasm, Precision::F32);
    let wanted = wasm(&host, &inputs, n);
    let artefact = compiled(BALL, &QUERIES, &["at"], Target::Spirv, Precision::F32);
    for (memory, groups) in [(0, 1), (28 * 640, 3), (28 * 10_000, 20), (64 << 20, 7), (64 << 20, u32::MAX)] {
        for staged in [false, true] {
            let Some(device) = device(small(memory, groups, staged)) else { return };
            let shader = device.load(&artefact).expect("loads");
            for _ in 0..2 {
                let got = shader.evaluate(&inputs, n).expect("evaluates");
                assert_same(&got, &wanted, &format!("{memory} bytes, {groups} groups, staged {staged}"));
            }
            silent(&device);
        }
    }
}

#[test]
fn hundreds_of_shaders_one_after_the_other() {
    let Some(device) = device(Settings::default()) else { return };
    let artefacts = [BALL, MIXED].map(|source| compiled(source, &["value"], &["at"], Target::Spirv, Precision::F32));
    let kept: Vec<Shader<'_>> = artefacts.iter().map(|artefact| device.load(artefact).expect("loads")).collect();
    for round in 0..300 {
        let n = 1 + round * 37 % 500;
        let x = numbers(n, round as f32);
        let inputs = [Values::F32(&x), Values::F32(&x), Values::F32(&x), Values::F32(&[1.0])];
        let fresh = device.load(&artefacts[0]).expect("loads");
        let got = fresh.evaluate(&inputs, n).expect("evaluates");
        assert_same(&got, &kept[0].evaluate(&inputs, n).expect("evaluates"), "an older shader");
    }
    silent(&device);
}

#[test]
fn several_threads_may_use_a_device() {
    let Some(device) = device(small(1 << 14, 2, false)) else { return };
    let artefact = compiled(BALL, &QUERIES, &["at"], Target::Spirv, Precision::F32);
    let host = compiled(BALL, &QUERIES, &["at"], Target::Wasm, Precision::F32);
    let shader = device.load(&artefact).expect("loads");
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (device, shader, artefact, host) = (&device, &shader, &artefact, &host);
            scope.spawn(move || {
                let own = device.load(artefact).expect("loads");
                let x = numbers(3000 + thread * 100, thread as f32);
                let inputs = [Values::F32(&x), Values::F32(&x), Values::F32(&x), Values::F32(&[0.5])];
                let wanted = wasm(host, &inputs, x.len());
                for shader in [&own, shader, &own] {
                    assert_same(&shader.evaluate(&inputs, x.len()).expect("evaluates"), &wanted, "a thread");
                }
            });
        }
    });
    silent(&device);
}

#[test]
fn a_device_says_how_long_it_worked() {
    let Some(device) = device(Settings::default()) else { return };
    let shader = device.load(&compiled(BALL, &QUERIES, &["at"], Target::Spirv, Precision::F32)).expect("loads");
    let x = numbers(100_000, 0.0);
    let inputs = [Values::F32(&x), Values::F32(&x), Values::F32(&x), Values::F32(&[0.5])];
    shader.evaluate(&inputs, x.len()).expect("evaluates");
    let start = std::time::Instant::now();
    let (columns, time) = shader.evaluate_timed(&inputs, x.len()).expect("evaluates");
    let whole = start.elapsed().as_nanos() as f64;
    assert_eq!(columns.len(), 4);
    println!("{}: {time:?} ns of {whole} ns", device.info().name);
    if let Some(time) = time {
        assert!(time > 0.0 && time < whole, "{time} ns of {whole} ns");
    }
    silent(&device);
}

#[test]
fn wrong_inputs_are_refused() {
    let Some(device) = device(Settings::default()) else { return };
    let shader = device.load(&compiled(BALL, &QUERIES, &["at"], Target::Spirv, Precision::F32)).expect("loads");
    let x = numbers(10, 0.0);
    let at = Values::F32(&x);
    let one = Values::F32(&[1.0]);
    let refused = |inputs: &[Values<'_>], n| shader.evaluate(inputs, n).expect_err("refused");
    let columns = EvalError::Columns { given: 3, wanted: 4 };
    assert_eq!(refused(&[at, at, at], 10), VulkanError::Inputs(columns));
    assert!(matches!(refused(&[at, at, at, at], 10), VulkanError::Inputs(EvalError::Length { .. })));
    assert!(matches!(refused(&[at, at, at, one], 11), VulkanError::Inputs(EvalError::Length { .. })));
    assert!(matches!(refused(&[at, at, at, Values::I32(&[1])], 10), VulkanError::Inputs(EvalError::Kind { .. })));
    // So many points have no place in memory, whatever the device.
    let most = usize::MAX / 8;
    assert!(matches!(refused(&[one, one, one, one], most), VulkanError::Memory { bytes } if bytes >= 1 << 60));
    assert!(shader.evaluate(&[at, at, at, one], 10).is_ok(), "and it still works");
    silent(&device);
}

#[test]
fn what_is_no_kernel_is_refused() {
    let Some(device) = device(Settings::default()) else { return };
    let good = compiled(BALL, &QUERIES, &["at"], Target::Spirv, Precision::F32);
    let refused = |artefact: &isograd_compiler::Artefact, says: &str| match device.load(artefact).err() {
        Some(VulkanError::Unsupported(text)) => assert!(text.contains(says), "{text}"),
        other => panic!("{says}: {other:?}"),
    };
    refused(&compiled(BALL, &["value"], &["at"], Target::Wasm, Precision::F32), "--target spirv");
    refused(&compiled(BALL, &["value"], &["at"], Target::Wgsl, Precision::F32), "`wgsl`");
    let mut cut = good.clone();
    cut.bytes.pop();
    refused(&cut, "little-endian words");
    let mut other = good.clone();
    other.bytes = compiled(BALL, &QUERIES, &["at"], Target::Wasm, Precision::F32).bytes;
    refused(&other, "no SPIR-V module");
    let mut library = good.clone();
    library.manifest.form = isograd_compiler::Form::Library;
    refused(&library, "--form kernel");
    type Change = fn(&mut isograd_compiler::Buffers);
    let contradictions: [Change; 6] = [
        |b| b.element = 8,
        |b| b.bindings.set = 1,
        |b| b.bindings.call = b.bindings.outputs,
        |b| b.bindings.uniforms = None,
        |b| b.workgroup = 0,
        |b| b.entry = "ma\0in".to_owned(),
    ];
    for change in contradictions {
        let mut bad = good.clone();
        let Abi::Buffers(buffers) = &mut bad.manifest.abi else { panic!("no buffers") };
        change(buffers);
        refused(&bad, "contradicts itself");
    }
    let mut far = good.clone();
    far.manifest.outputs[0].columns[0].offset = u32::MAX;
    refused(&far, "contradicts itself");
    let mut wide = good.clone();
    let Abi::Buffers(buffers) = &mut wide.manifest.abi else { panic!("no buffers") };
    buffers.workgroup = 1 << 20;
    refused(&wide, "takes workgroups of at most");
    assert!(device.load(&good).is_ok());
    silent(&device);
}

#[test]
fn an_unknown_device_is_answered_with_those_there_are() {
    if device(Settings::default()).is_none() {
        return;
    }
    let infos = devices().expect("devices");
    assert!(infos.windows(2).all(|pair| pair[0].kind <= pair[1].kind), "{infos:?}");
    let unknown = Choice { device: Some("Voodoo 2".to_owned()), validation: false };
    let Err(VulkanError::NoDevice(text)) = Device::open(&unknown) else { panic!("it is opened") };
    assert!(text.contains("Voodoo 2"), "{text}");
    for info in &infos {
        assert!(text.contains(&info.name), "{text}");
        let part = info.name.chars().take(6).collect::<String>().to_uppercase();
        let named = Device::open(&Choice { device: Some(part), validation: false }).expect("opens by name");
        assert!(infos.contains(named.info()));
        let kind = Choice { device: Some(info.kind.name().to_owned()), validation: false };
        assert_eq!(Device::open(&kind).expect("opens by kind").info().kind, info.kind);
        assert!(info.max_buffer >= 1 << 27 && info.max_groups >= 65_535, "{info:?}");
    }
}

/// The words of numbers are those that were given, where the kernel only passes them on; a NaN that it stores has all
/// bits set.
#[test]
fn numbers_pass_unchanged() {
    let Some(device) = device(Settings::default()) else { return };
    let same = "export fn same(x: real, n: int, on: bool) -> (real, int, bool) { (x, n, on) }";
    let reals = [0x0000_0000, 0x8000_0000, 0x7f80_0000, 0xff80_0000, 0x3f80_0001, 0xffff_ffff].map(f32::from_bits);
    let ints = [0, -1, i32::MIN, i32::MAX, 65_536, -65_537];
    let bools = [0, 1, 1, 0, 1, 0];
    let inputs = [Values::F32(&reals), Values::I32(&ints), Values::I32(&bools)];
    for precision in [Precision::F32, Precision::F64] {
        let artefact = compiled(same, &["value"], &["x", "n", "on"], Target::Spirv, precision);
        let got = device.load(&artefact).expect("loads").evaluate(&inputs, 6).expect("evaluates");
        assert_eq!(got[1..], [Column::I32(ints.to_vec()), Column::I32(bools.to_vec())]);
        let wanted = reals.map(|x| if x.is_nan() { f64::NAN } else { f64::from(x) });
        for (i, wanted) in wanted.iter().enumerate() {
            let got = got[0].get(i).expect("a number");
            assert!(got.to_bits() == wanted.to_bits() || got.is_nan() && wanted.is_nan(), "{got} for {wanted}");
        }
    }
    silent(&device);
}

const fn shared<T: Send + Sync>() {}
const _: () = (shared::<Device>(), shared::<Shader<'_>>()).0;
