//! Vulkan devices: `isograd devices` lists them, `isograd eval --target spirv` evaluates on one. Knows which was asked
//! for; knows nothing of Vulkan.

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::time::{Duration, Instant};

use isograd_compiler::Artefact;
use isograd_server::evaluate::{EvaluateError, run_with};
use isograd_server::outputs::Outputs;
use isograd_server::values::Inputs;
use isograd_vulkan::{Choice, Device, DeviceInfo, Settings, VulkanError, devices};
use serde_json::{Value, json};

use crate::args::Devices;
use crate::check::pretty;
use crate::{Failure, report};

/// Runs the command.
pub fn run(args: &Devices) -> Result<(), Failure> {
    let found = devices().map_err(|error| Failure::Wrong(error.to_string()))?;
    if found.is_empty() {
        // Says what to install.
        let error = Device::open(&Choice::default()).err();
        return Err(Failure::Wrong(error.map_or_else(|| "there is no Vulkan device".to_owned(), |e| e.to_string())));
    }
    let text = if args.json {
        pretty(&json!({ "devices": found.iter().map(described).collect::<Vec<_>>() }))
    } else {
        found.iter().map(written).collect()
    };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

fn described(device: &DeviceInfo) -> Value {
    json!({
        "name": device.name,
        "kind": device.kind.name(),
        "driver": device.driver,
        "api": device.api,
        "doubles": device.doubles,
        "max_buffer": device.max_buffer,
        "max_groups": device.max_groups,
    })
}

/// The name, and a line for each thing that matters.
fn written(device: &DeviceInfo) -> String {
    let mut text = format!("{}\n", device.name);
    let precisions = if device.doubles { "f32, f64" } else { "f32" };
    for (what, value) in
        [("kind", device.kind.name()), ("driver", &device.driver), ("vulkan", &device.api), ("precisions", precisions)]
    {
        let _ = writeln!(text, "    {what:<10}  {value}");
    }
    text
}

/// Evaluates on the device that is meant. The artefact must be of a request with the rates of the inputs.
///
/// # Errors
/// If there is no such device, it cannot evaluate this, or takes longer than `time`.
pub fn evaluate(
    artefact: &Artefact,
    inputs: &Inputs,
    device: Option<&str>,
    time: Duration,
) -> Result<Outputs, EvaluateError> {
    let began = Instant::now();
    let choice = Choice { device: device.map(str::to_owned), validation: false };
    let device = Device::open_with(&choice, Settings { timeout: time, ..Settings::default() }).map_err(refused)?;
    let shader = device.load(artefact).map_err(refused)?;
    if began.elapsed() >= time {
        return Err(EvaluateError::Deadline);
    }
    if artefact.manifest.unbounded && device.info().driver.starts_with("llvmpipe") {
        report::warning(
            "Mesa's llvmpipe leaves all loops of a point after 65,535 iterations in total and does not say so; loops of \
             this program may run longer, and then the results are wrong: compare with `--target wasm`",
        );
    }
    run_with(&artefact.manifest, inputs, |values, points| shader.evaluate(values, points)).map_err(refused)
}

/// What is wrong with the inputs is said as it is of WebAssembly; the rest is no mistake of ours.
fn refused(error: VulkanError) -> EvaluateError {
    match error {
        VulkanError::Inputs(error) => error.into(),
        error => EvaluateError::Refused { message: error.to_string(), limit: None },
    }
}
