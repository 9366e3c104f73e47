//! Artefacts of small programs, the device of the tests, and what WebAssembly computes.

#![allow(dead_code, clippy::pedantic, reason = "shared by programs of which each uses a part")]

use std::collections::BTreeMap;

use isograd_compiler::{
    Artefact, MemoryLoader, Options, Precision, Query, Rate, Request, Target, Unwatched, check, compile,
};
use isograd_runtime::{Column, EvalOptions, Runtime, Values};
use isograd_vulkan::{Choice, Device, Settings, VulkanError};

/// Reals, an int and a bool, each varying and uniform; results of all three kinds.
pub const MIXED: &str = "
export fn mixed(at: vec3, n: int, on: bool, radius: real, m: int, inside: bool) -> (real, int, bool) {
    let d = length(at) - radius;
    let k = n * 3 - m;
    (if on { d } else { 0.0 - d * radius }, if inside { k } else { n }, on && d < 0.5)
}
";

pub const BALL: &str = "export fn ball(at: vec3, radius: real = 1.0) -> real { length(at) - radius }";

pub fn compiled(source: &str, queries: &[&str], varying: &[&str], target: Target, precision: Precision) -> Artefact {
    let options = Options { verify: true, ..Options::default() };
    let checked = check("main.vola", source.into(), &MemoryLoader::default(), &options, &Unwatched);
    assert!(checked.is_ok(), "{:?}", checked.diagnostics);
    let export = checked.exports().into_iter().next().expect("an export");
    let rate = |name: &str| if varying.contains(&name) { Rate::Varying } else { Rate::Uniform };
    let request = Request {
        queries: queries.iter().map(|q| q.parse::<Query>().expect("a query")).collect(),
        precision,
        rates: export.parameters.iter().map(|p| (p.name.clone(), rate(&p.name))).collect::<BTreeMap<_, _>>(),
        export: export.name,
        target,
        ..Request::default()
    };
    compile(&checked, &request, &options, &Unwatched).unwrap_or_else(|e| panic!("{e:?}"))
}

/// A device with the validation layer. Where there is none, the test says that it is skipped, unless one is required.
pub fn device(settings: Settings) -> Option<Device> {
    let validation = Choice { validation: true, ..Choice::default() };
    let opened = Device::open_with(&validation, settings.clone());
    let why = match opened {
        Ok(device) => return Some(device),
        Err(why @ (VulkanError::NoLoader(_) | VulkanError::NoDevice(_) | VulkanError::Validation)) => why,
        Err(other) => panic!("{other}"),
    };
    let required = std::env::var("ISOGRAD_REQUIRE_VULKAN").is_ok_and(|v| v == "1");
    assert!(!required, "ISOGRAD_REQUIRE_VULKAN is set, but: {why}");
    println!("skipped: {why}");
    None
}

/// What WebAssembly computes.
pub fn wasm(artefact: &Artefact, inputs: &[Values<'_>], points: usize) -> Vec<Column> {
    let kernel = Runtime::default().load(artefact).expect("loads");
    kernel.evaluate(inputs, points, &EvalOptions::default()).expect("evaluates")
}

/// The bits of a column.
pub fn bits(column: &Column) -> Vec<u64> {
    match column {
        Column::F32(x) => x.iter().map(|x| u64::from(x.to_bits())).collect(),
        Column::F64(x) => x.iter().map(|x| x.to_bits()).collect(),
        Column::I32(x) => x.iter().map(|x| *x as u32 as u64).collect(),
    }
}

pub fn assert_same(got: &[Column], wanted: &[Column], what: &str) {
    assert_eq!(got.len(), wanted.len(), "{what}");
    for (k, (got, wanted)) in got.iter().zip(wanted).enumerate() {
        assert_eq!(std::mem::discriminant(got), std::mem::discriminant(wanted), "{what}: column {k}");
        let (got, wanted) = (bits(got), bits(wanted));
        assert_eq!(got.len(), wanted.len(), "{what}: column {k}");
        let differs = got.iter().zip(&wanted).position(|(a, b)| a != b);
        assert_eq!(differs, None, "{what}: column {k} differs there first");
    }
}

pub fn numbers(n: usize, seed: f32) -> Vec<f32> {
    (0..n).map(|i| ((i as f32 + seed) * 0.37).sin() * 3.0).collect()
}

pub fn ints(n: usize) -> Vec<i32> {
    (0..n as i32).map(|i| (i * 7919) % 1000 - 500).collect()
}

pub fn bools(n: usize) -> Vec<i32> {
    (0..n as i32).map(|i| i32::from(i % 3 == 0)).collect()
}
