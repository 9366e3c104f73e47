//! Shaders from the command line: modules and manifests in files, and evaluation on a Vulkan device. Tests that need a
//! device say when they are skipped for want of one; with `ISOGRAD_REQUIRE_VULKAN=1` they fail instead.

mod common;

use std::io::Write;
use std::process::Stdio;

use common::{Dir, Ran};
use isograd_compiler::{Form, Manifest, STEPS, Target};
use serde_json::Value;

const BALL: &str = "export fn ball(at: vec3, radius: real = 1.0) -> real { length(at) - radius }\n";

fn manifest(dir: &Dir, name: &str) -> Manifest {
    serde_json::from_slice(&std::fs::read(dir.0.join(name)).unwrap()).unwrap()
}

fn names(dir: &Dir, under: &str) -> Vec<String> {
    let entries = std::fs::read_dir(dir.0.join(under)).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn every_target_is_written_to_files_of_its_own() {
    let dir = Dir::with(&format!("{BALL}export fn twice(x: real) -> real {{ x * 2.0 }}\n"));
    let mut expected = Vec::new();
    for target in Target::ALL {
        let ran = dir.run(&["compile", "main.vola", "--target", target.name(), "--out-dir", "out", "--timings"]);
        assert_eq!((ran.code, ran.out.as_str()), (Some(0), ""), "{ran:?}");
        assert!(STEPS.iter().all(|step| ran.err.contains(&format!("\n{step} "))), "{ran:?}");
        for export in ["ball", "twice"] {
            let file = format!("{export}.{}", target.extension());
            let bytes = std::fs::read(dir.0.join("out").join(&file)).unwrap();
            let begins: &[u8] = match target {
                Target::Wasm => b"\0asm",
                Target::Spirv => &[0x03, 0x02, 0x23, 0x07],
                _ => b"",
            };
            assert!(bytes.starts_with(begins) && (target.is_binary() || std::str::from_utf8(&bytes).is_ok()));
            assert!(ran.err.contains(&format!("out/{file}: ")), "{ran:?}");
            if target != Target::Wasm {
                let sidecar = format!("{file}.json");
                assert!(ran.err.contains(&format!("manifest: out/{sidecar}\n")), "{ran:?}");
                let manifest = manifest(&dir, &format!("out/{sidecar}"));
                assert_eq!((manifest.target, manifest.form, manifest.export.as_str()), (target, Form::Kernel, export));
                assert!(manifest.buffers().is_some());
                expected.push(sidecar);
            }
            expected.push(file);
        }
    }
    expected.sort();
    assert_eq!(names(&dir, "out"), expected, "nothing took the place of anything");
}

#[test]
fn the_standard_output_has_no_sidecar() {
    let dir = Dir::with(BALL);
    let compile = |target: &str, to: &str| {
        dir.command(&["compile", "main.vola", "--target", target, "-o", to]).stdin(Stdio::null()).output().unwrap()
    };
    for target in Target::ALL {
        let shown = compile(target.name(), "-");
        assert_eq!((shown.status.code(), shown.stderr.as_slice()), (Some(0), &b""[..]), "{shown:?}");
        let file = format!("x.{}", target.extension());
        assert_eq!(compile(target.name(), &file).status.code(), Some(0));
        assert!(!shown.stdout.is_empty() && std::fs::read(dir.0.join(file)).unwrap() == shown.stdout);
    }
    assert!(!names(&dir, ".").iter().any(|name| name.starts_with('-')), "{:?}", names(&dir, "."));
    assert!(!dir.0.join("x.wasm.json").exists(), "a WebAssembly module contains its manifest");
    if cfg!(unix) {
        let device = compile("wgsl", "/dev/null");
        assert_eq!(device.status.code(), Some(0), "{device:?}");
        assert!(!std::path::Path::new("/dev/null.json").exists());
    }
}

#[test]
fn the_program_is_never_written_over() {
    let dir = Dir::with(BALL);
    dir.write("ball.spv.json", BALL);
    for (command, file) in [
        (&["compile", "main.vola", "--target", "spirv", "-o", "main.vola"][..], "main.vola"),
        (&["compile", "main.vola", "-o", "./main.vola"], "main.vola"),
        (&["compile", "main.vola", "--emit", "tree", "-o", "main.vola"], "main.vola"),
        (&["compile", "ball.spv.json", "--target", "spirv", "-o", "ball.spv"], "ball.spv.json"),
    ] {
        dir.run(command).fails_with(2, &["would write over", file]);
        assert_eq!(std::fs::read_to_string(dir.0.join(file)).unwrap(), BALL);
    }
    assert!(!dir.0.join("ball.spv").exists());
}

#[test]
fn a_library_is_a_function_and_no_kernel() {
    let dir = Dir::with(BALL);
    let library = ["compile", "main.vola", "--target", "wgsl", "--form", "library", "-o"];
    let text = dir.run(&[&library[..], &["-"]].concat()).ok().to_owned();
    assert!(text.contains("fn ball(") && !text.contains("@compute"), "{text}");
    assert_eq!(dir.run(&[&library[..], &["ball.wgsl"]].concat()).code, Some(0));
    let manifest = manifest(&dir, "ball.wgsl.json");
    assert_eq!((manifest.form, manifest.buffers()), (Form::Library, None));
    let kernel = dir.run(&["compile", "main.vola", "--target", "wgsl", "-o", "-"]);
    assert!(kernel.ok().contains("@compute"), "{kernel:?}");
    let spirv = dir.run(&["compile", "main.vola", "--target", "spirv", "--form", "library", "--emit", "emit"]);
    assert!(spirv.ok().contains("OpDecorate") && spirv.out.contains("\"ball\" Export"), "{spirv:?}");
}

#[test]
fn what_a_target_cannot_do_is_a_diagnostic() {
    let dir = Dir::with(BALL);
    let run = |args: &[&str]| dir.run(&[&["compile", "main.vola", "-o", "x"], args].concat());
    for target in ["wgsl", "glsl", "hlsl", "msl"] {
        run(&["--target", target, "--precision", "f64"]).fails_with(1, &["error[E1101]", &format!("`{target}`")]);
    }
    run(&["--form", "library"]).fails_with(1, &["error[E1102]", "`library`", "`wasm`"]);
    run(&["--target", "metal"]).fails_with(2, &["metal", "wasm, spirv, wgsl, glsl, hlsl, msl"]);
    run(&["--form", "whole"]).fails_with(2, &["whole", "kernel, library"]);
    assert!(!dir.0.join("x").exists() && !dir.0.join("x.json").exists());
}

#[test]
fn modules_are_shown_as_text() {
    let dir = Dir::with(BALL);
    let emit = |target: &str, step: &str| dir.run(&["compile", "main.vola", "--target", target, "--emit", step]);
    let assembly = emit("spirv", "emit");
    assert!(assembly.ok().contains("OpEntryPoint GLCompute"), "{assembly:?}");
    for target in Target::ALL.into_iter().filter(|target| !target.is_binary()) {
        let name = target.name();
        let written = dir.run(&["compile", "main.vola", "--target", name, "-o", "-"]);
        assert_eq!(emit(name, "emit").ok().trim_end(), written.ok().trim_end(), "{name}");
    }
    emit("spirv", "wat").fails_with(2, &["`wat`", "`spirv`", "`emit`"]);
    assert!(emit("wasm", "wat").ok().contains("(module"));
    let graphs = [emit("wasm", "optimise"), emit("spirv", "optimise")];
    assert!(graphs.iter().all(|graph| !graph.ok().is_empty()));
}

#[test]
fn help_lists_every_target() {
    let dir = Dir::new();
    let help = |command: &str| dir.run(&[command, "--help"]).ok().to_owned();
    let (compile, eval) = (help("compile"), help("eval"));
    for target in Target::ALL {
        let listed = format!("- {}:", target.name());
        assert!(compile.contains(&listed), "{compile}");
        assert!(compile.contains(&format!("EXPORT.{}", target.extension())), "{compile}");
        assert_eq!(eval.contains(&listed), matches!(target, Target::Wasm | Target::Spirv), "{eval}");
    }
    assert!(eval.contains("little-endian") && eval.contains("- raw:"), "{eval}");
}

#[test]
fn raw_is_the_columns_as_bytes() {
    let program = "export fn f(n: int, up: bool, x: real) -> (int, bool, real) { (n / 2, up, x / 3.0) }";
    let dir = Dir::with(program);
    let points = ["--args", "-7,true,1", "--args", "7,0,-inf", "--args", "0,1,nan"];
    let queries = ["--query", "value", "--query", "gradient(x)", "--format", "raw"];
    let ints = |x: &[i32]| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let raw = |args: &[&str]| bytes(&dir, &[&["eval", "main.vola"], &points[..], &queries, args].concat());
    let nan32 = f32::from_bits(u32::MAX);
    let reals = |x: &[f32]| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let third = 1.0_f32 / 3.0;
    let expected =
        [ints(&[-3, 3, 0]), ints(&[1, 0, 1]), reals(&[third, f32::NEG_INFINITY, nan32]), reals(&[third, third, third])];
    assert_eq!(raw(&[]), expected.concat());
    let reals = |x: &[f64]| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let (nan, third) = (f64::from_bits(u64::MAX), 1.0_f64 / 3.0);
    let expected =
        [ints(&[-3, 3, 0]), ints(&[1, 0, 1]), reals(&[third, f64::NEG_INFINITY, nan]), reals(&[third, third, third])];
    assert_eq!(raw(&["--precision", "f64"]), expected.concat());
    dir.write("none.csv", "n,up,x\n");
    assert_eq!(bytes(&dir, &["eval", "main.vola", "--points", "none.csv", "--format", "raw"]), b"");
}

#[test]
fn only_wasm_and_spirv_are_evaluated() {
    let dir = Dir::with(BALL);
    let run = |args: &[&str]| dir.run(&[&["eval", "main.vola", "--args", "1,2,3"], args].concat());
    for target in ["wgsl", "glsl", "hlsl", "msl"] {
        run(&["--target", target]).fails_with(2, &[target, "wasm and spirv"]);
    }
    run(&["--target", "cuda"]).fails_with(2, &["wasm, spirv"]);
    run(&["--device", "cpu"]).fails_with(2, &["`--device`", "`--target spirv`"]);
}

#[test]
fn without_vulkan_it_is_said_what_to_install() {
    let dir = Dir::with(BALL);
    let eval = ["eval", "main.vola", "--args", "1,2,3", "--target", "spirv"];
    for command in [&eval[..], &["devices"], &["devices", "--json"]] {
        let mut command = dir.command(command);
        // Of these variables one is new and one is old; with an empty list there is no driver.
        for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            command.env(variable, dir.0.join("no-driver.json"));
        }
        let output = command.env("XDG_RUNTIME_DIR", &dir.0).stdin(Stdio::null()).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((output.status.code(), output.stdout.as_slice()), (Some(1), &b""[..]), "{said}");
        assert!(said.contains("Vulkan") && said.contains("apt-get install"), "{said}");
    }
}

/// The standard output of a run that succeeded and said nothing else.
#[track_caller]
fn bytes(dir: &Dir, args: &[&str]) -> Vec<u8> {
    let mut command = dir.command(args);
    // Drivers complain if there is none.
    command.env("XDG_RUNTIME_DIR", &dir.0);
    let output = command.stdin(Stdio::null()).output().unwrap();
    assert_eq!((output.status.code(), &*String::from_utf8_lossy(&output.stderr)), (Some(0), ""), "{args:?}");
    output.stdout
}

/// Whether there is a device to test with.
fn has_device(dir: &Dir) -> bool {
    let Ran { code, err, .. } = dir.run(&["devices"]);
    if code == Some(0) {
        return true;
    }
    assert!(std::env::var_os("ISOGRAD_REQUIRE_VULKAN").is_none_or(|v| v != "1"), "a Vulkan device is demanded: {err}");
    // Not `eprintln`, which is shown of tests that fail only.
    let _ = writeln!(std::io::stderr(), "skipped, for there is no Vulkan device: {}", err.trim_end());
    false
}

#[test]
fn devices_are_listed() {
    let dir = Dir::new();
    if !has_device(&dir) {
        return;
    }
    let listed: Value = serde_json::from_slice(&bytes(&dir, &["devices", "--json"])).unwrap();
    let text = String::from_utf8(bytes(&dir, &["devices"])).unwrap();
    for device in listed["devices"].as_array().unwrap() {
        for field in ["name", "kind", "driver", "api"] {
            assert!(text.contains(device[field].as_str().unwrap()), "{field}: {text}");
        }
        assert!(device["doubles"].is_boolean(), "{device}");
    }
}

#[test]
fn a_device_computes_the_same_bits_as_webassembly() {
    let program = "export fn f(p: vec3, n: int, up: bool) -> (real, int, bool) {
        let y = length(p) - 1.0;
        for i in 0..5 { y = sin(y) * 0.5 + p.x / (2.0 + abs(p.y)) + n::<real>; }
        (y, n * 3, up)
    }\n";
    let dir = Dir::with(program);
    if !has_device(&dir) {
        return;
    }
    let mut points = "p.x,p.y,p.z,n,up\n".to_owned();
    for i in 0..1000 {
        let t = f64::from(i) * 0.1;
        points.push_str(&format!("{},{},{},{},{}\n", t.sin(), t.cos() * 2.0, t * 0.01 - 0.5, i % 7 - 1, i % 2));
    }
    dir.write("points.csv", &points);
    let queries = ["--query", "value", "--query", "gradient(p)", "--format", "raw"];
    for more in [&[][..], &["--precision", "f64"]] {
        let run = |target| {
            let base = ["eval", "main.vola", "--points", "points.csv", "--target", target];
            bytes(&dir, &[&base[..], &queries, more].concat())
        };
        let (wasm, spirv) = (run("wasm"), run("spirv"));
        assert!(!wasm.is_empty() && wasm == spirv, "{more:?}");
    }
    let of = |device| ["eval", "main.vola", "--args", "1,2,3,4,true", "--target", "spirv", "--device", device];
    dir.run(&of("no such device")).fails_with(1, &["`no such device`", "there is `"]);
    dir.write("none.csv", "p.x,p.y,p.z,n,up\n");
    let none = bytes(&dir, &["eval", "main.vola", "--points", "none.csv", "--target", "spirv", "--format", "csv"]);
    assert_eq!(none, b"value.0,value.1,value.2\n");
    let within = ["eval", "main.vola", "--args", "1,2,3,4,true", "--target", "spirv", "--within", "n=[0]:[3]"];
    let outside = dir.run(&within);
    assert!(outside.code == Some(1) && outside.err.contains("`n`") && !outside.err.contains("mistake"), "{outside:?}");
}

/// A device that leaves a loop early gives wrong numbers, which is not to go unsaid.
#[test]
fn of_a_device_that_ends_loops_it_is_said() {
    let dir = Dir::with("export fn f(x: real, n: int) -> int { let y = 0; for i in 0..n { y = y + 1; } y }\n");
    if !has_device(&dir) {
        return;
    }
    let listed: Value = serde_json::from_slice(&bytes(&dir, &["devices", "--json"])).unwrap();
    let driver = listed["devices"][0]["driver"].as_str().unwrap();
    let run = |n| dir.run(&["eval", "main.vola", "--args", n, "--target", "spirv", "--format", "csv"]);
    let (few, many) = (run("0,9"), run("0,100000"));
    assert_eq!((few.code, few.out.as_str()), (Some(0), "value\n9\n"));
    assert!(many.out == "value\n100000\n" || many.err.contains("65,535 iterations"), "{driver}: {many:?}");
    let dir = Dir::with(BALL);
    dir.run(&["eval", "main.vola", "--args", "1,2,3", "--target", "spirv"]).ok();
}

#[test]
fn a_million_points_are_the_same_bits_on_a_device() {
    let dir = Dir::with(BALL);
    if !has_device(&dir) {
        return;
    }
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        format!("{}.{:06}", (state >> 60) & 3, (state >> 33) % 1_000_000)
    };
    let mut points = String::from("at.x,at.y,at.z\n");
    for _ in 0..1_000_000 {
        points.push_str(&[next(), next(), next()].join(","));
        points.push('\n');
    }
    dir.write("points.csv", &points);
    let queries = ["--query", "value", "--query", "gradient(at)", "--format", "raw"];
    let run = |target| {
        bytes(&dir, &[&["eval", "main.vola", "--points", "points.csv", "--target", target][..], &queries].concat())
    };
    let (wasm, spirv) = (run("wasm"), run("spirv"));
    assert_eq!(wasm.len(), 16_000_000);
    assert!(wasm == spirv, "{:?} differ first", wasm.iter().zip(&spirv).position(|(x, y)| x != y));
}
