//! The programs of SPIRV-Tools, where they are installed. `ISOGRAD_REQUIRE_SPIRV_TOOLS` makes a missing one a failure.

use std::io::Write;
use std::process::{Command, Stdio};

/// Whether a program is there; says so if not.
pub fn have(program: &str) -> bool {
    let there = Command::new(program).arg("--version").stdout(Stdio::null()).status().is_ok();
    if !there {
        assert!(
            std::env::var_os("ISOGRAD_REQUIRE_SPIRV_TOOLS").is_none(),
            "{program} is missing: install the package spirv-tools"
        );
        eprintln!("SKIPPED: {program} is missing; install the package spirv-tools");
    }
    there
}

/// What `spirv-val` says to a module.
pub fn validate(bytes: &[u8], environment: &str) -> Result<(), String> {
    let mut child = Command::new("spirv-val")
        .args(["--target-env", environment, "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| error.to_string())?;
    child.stdin.take().unwrap().write_all(bytes).map_err(|error| error.to_string())?;
    let output = child.wait_with_output().map_err(|error| error.to_string())?;
    if output.status.success() && output.stderr.is_empty() && output.stdout.is_empty() {
        return Ok(());
    }
    Err(format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr)))
}

/// Panics if `spirv-val` does not accept a kernel.
pub fn assert_valid(bytes: &[u8], what: &str) {
    if let Err(error) = validate(bytes, "vulkan1.1") {
        panic!("{what}: {error}\n{}", isograd_spirv::disassemble(bytes).unwrap());
    }
}
