//! The host program of the documentation, which uses Vulkan alone, prints what WebAssembly computes.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use std::process::Command;

use isograd_compiler::{Precision, Target};
use isograd_runtime::Values;
use isograd_vulkan::Settings;
use support::{BALL, compiled, device, wasm};

#[test]
fn the_host_of_the_documentation_runs() {
    if device(Settings::default()).is_none() {
        return;
    }
    // Cargo builds examples with tests, into the folder beside.
    let program = std::env::current_exe().expect("a path");
    let program = program.ancestors().nth(2).expect("a folder").join("examples/host");
    let queries = ["value", "gradient(at)"];
    let artefact = compiled(BALL, &queries, &["at"], Target::Spirv, Precision::F32);
    let folder = tempfile::tempdir().expect("a folder");
    let (module, manifest) = (folder.path().join("ball.spv"), folder.path().join("ball.json"));
    std::fs::write(&module, &artefact.bytes).expect("written");
    std::fs::write(&manifest, serde_json::to_vec(&artefact.manifest).expect("JSON")).expect("written");
    let output = Command::new(&program).args([&module, &manifest]).output();
    let output = output.unwrap_or_else(|e| panic!("{}: {e}; cargo test builds it", program.display()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let (x, y, z) = ([3.0, 0.0, -1.0], [0.0, 0.5, 2.0], [4.0, 0.0, -2.0]);
    let host = compiled(BALL, &queries, &["at"], Target::Wasm, Precision::F32);
    let columns = wasm(&host, &[Values::F32(&x), Values::F32(&y), Values::F32(&z), Values::F32(&[1.0])], 3);
    let names: Vec<&str> =
        artefact.manifest.outputs.iter().flat_map(|port| &port.columns).map(|c| c.name.as_str()).collect();
    let mut wanted = String::new();
    for i in 0..3 {
        wanted += &format!("at {:?}:", [x[i], y[i], z[i]]);
        for (name, column) in names.iter().zip(&columns) {
            wanted += &format!(" {name} = {}", column.get(i).expect("a number") as f32);
        }
        wanted.push('\n');
    }
    assert_eq!(String::from_utf8_lossy(&output.stdout), wanted);
}
