//! The crate graph has the edges of DESIGN 2 and no others: data flows one way.

use std::collections::BTreeMap;
use std::process::Command;

/// Each crate of the workspace with those it may depend on.
const ALLOWED: &[(&str, &[&str])] = &[
    ("isograd-syntax", &[]),
    ("isograd-program", &["isograd-syntax"]),
    ("isograd-graph", &[]),
    ("isograd-elaborate", &["isograd-syntax", "isograd-program", "isograd-graph"]),
    ("isograd-transform", &["isograd-graph"]),
    ("isograd-wasm", &["isograd-graph"]),
    ("isograd-spirv", &["isograd-graph"]),
    (
        "isograd-compiler",
        &[
            "isograd-syntax",
            "isograd-program",
            "isograd-graph",
            "isograd-elaborate",
            "isograd-transform",
            "isograd-wasm",
            "isograd-spirv",
        ],
    ),
    ("isograd-runtime", &["isograd-compiler"]),
    ("isograd-vulkan", &["isograd-compiler", "isograd-runtime"]),
    ("isograd-server", &["isograd-compiler", "isograd-runtime"]),
    (
        "isograd-testkit",
        &[
            "isograd-compiler",
            "isograd-elaborate",
            "isograd-graph",
            "isograd-program",
            "isograd-runtime",
            "isograd-spirv",
            "isograd-syntax",
            "isograd-transform",
            "isograd-vulkan",
            "isograd-wasm",
        ],
    ),
    ("isograd-cli", &["isograd-compiler", "isograd-runtime", "isograd-server", "isograd-vulkan"]),
    ("isograd-benches", &["isograd-compiler", "isograd-graph", "isograd-runtime", "isograd-server", "isograd-vulkan"]),
];

#[test]
fn edges_are_the_listed_ones() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1", "--offline"])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("cargo prints JSON");
    let allowed: BTreeMap<_, _> = ALLOWED.iter().copied().collect();
    let mut seen = 0;
    for package in metadata["packages"].as_array().expect("packages") {
        let name = package["name"].as_str().expect("a name");
        let may = allowed.get(name).unwrap_or_else(|| panic!("the crate {name} is not listed in layers.rs"));
        seen += 1;
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let on = dependency["name"].as_str().expect("a name");
            // Tests may look upstream and sideways; the product may not.
            let test_only = dependency["kind"] == "dev";
            assert!(!on.starts_with("isograd-") || test_only || may.contains(&on), "{name} must not depend on {on}");
        }
    }
    assert_eq!(seen, ALLOWED.len(), "layers.rs lists a crate that does not exist");
}
