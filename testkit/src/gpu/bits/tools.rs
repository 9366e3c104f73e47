//! The programs of SPIRV-Tools. Knows how they are called; knows nothing of what they are given.

use std::fs;
use std::io::Write as _;
use std::process::{Command, Stdio};

/// All that are needed.
pub const PROGRAMS: [&str; 3] = ["spirv-val", "spirv-as", "spirv-link"];

const ENVIRONMENT: [&str; 2] = ["--target-env", "vulkan1.1"];

/// Whether a program can be started.
pub fn installed(program: &str) -> bool {
    Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

/// Has a module validated; a library module if it is one.
///
/// # Errors
/// What `spirv-val` says.
pub fn validate(module: &[u8], library: bool) -> Result<(), String> {
    // Vulkan has no linkage, so a library is judged by the rules of SPIR-V alone.
    let environment = if library { ["--target-env", "spv1.3"] } else { ENVIRONMENT };
    filter("spirv-val", &environment, module).map(|_| ())
}

/// Assembles a text.
///
/// # Errors
/// What `spirv-as` says.
pub fn assemble(text: &str) -> Result<Vec<u8>, String> {
    filter("spirv-as", &["--target-env", "spv1.3", "--preserve-numeric-ids", "-o", "-"], text.as_bytes())
}

/// Links modules to one without linkage.
///
/// # Errors
/// What `spirv-link` says.
pub fn link(modules: &[&[u8]]) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let mut command = Command::new("spirv-link");
    command.args(ENVIRONMENT).arg("-o").arg(folder.path().join("linked.spv"));
    for (i, module) in modules.iter().enumerate() {
        let path = folder.path().join(format!("{i}.spv"));
        fs::write(&path, module).map_err(|e| e.to_string())?;
        command.arg(path);
    }
    let output = command.output().map_err(|e| format!("spirv-link: {e}"))?;
    if !output.status.success() {
        return Err(format!("spirv-link: {}", String::from_utf8_lossy(&output.stderr)));
    }
    fs::read(folder.path().join("linked.spv")).map_err(|e| e.to_string())
}

/// Runs a program over its standard input.
fn filter(program: &str, arguments: &[&str], input: &[u8]) -> Result<Vec<u8>, String> {
    let failed = |e: std::io::Error| format!("{program}: {e}");
    let mut child = Command::new(program)
        .args(arguments)
        .arg("-")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    // These programs read everything before they write anything. One that stops early says why itself.
    let _ = child.stdin.take().map(|mut stdin| stdin.write_all(input));
    let output = child.wait_with_output().map_err(failed)?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let said = [output.stdout, output.stderr].concat();
    Err(format!("{program}: {}", String::from_utf8_lossy(&said)))
}
