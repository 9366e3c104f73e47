//! What happens where things go wrong: kernels without end, machines without drivers, a device used against the rules.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use std::process::Command;
use std::time::{Duration, Instant};

use isograd_compiler::{Abi, Precision, Target};
use isograd_runtime::Values;
use isograd_vulkan::{Choice, Device, Settings, VulkanError, devices};
use support::{BALL, compiled, device, numbers};

const LOOP: &str = "
export fn turns(x: real, n: int) -> real {
    let y = x;
    for i in 0..n { for j in 0..n { y = y * 0.5 + x; } }
    y
}";

/// In a process of its own, for it ends while the device is at work.
#[test]
fn a_kernel_that_does_not_end_is_given_up() {
    if device(Settings::default()).is_none() {
        return;
    }
    let (ok, text) = alone("given_up", &[]);
    assert!(ok && text.contains("given up"), "{text}");
}

#[test]
#[ignore = "run by another test, in a process of its own"]
fn given_up() {
    let settings = Settings { timeout: Duration::from_secs(1), ..Settings::default() };
    let device = Device::open_with(&Choice::default(), settings).expect("opens");
    let artefact = compiled(LOOP, &["value"], &["x"], Target::Spirv, Precision::F32);
    let shader = device.load(&artefact).expect("loads");
    // Mesa's program for the processor leaves a loop after 65,535 iterations: there it takes many points to be slow.
    let (few, many) = (numbers(64, 0.0), numbers(1 << 20, 0.0));
    shader.evaluate(&[Values::F32(&few), Values::I32(&[3])], few.len()).expect("a short one");
    let start = Instant::now();
    let endless = shader.evaluate(&[Values::F32(&many), Values::I32(&[i32::MAX])], many.len());
    let after = shader.evaluate(&[Values::F32(&few), Values::I32(&[3])], few.len());
    for outcome in [endless, after] {
        let Err(VulkanError::Failed(text)) = outcome else { panic!("it evaluates") };
        assert!(text.contains("longer than 1 s") && text.contains("open it again"), "{text}");
    }
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    drop(shader);
    drop(device);
    // What it works on is still there; another can be opened beside.
    let other = Device::open(&Choice::default()).expect("opens");
    let shader = other.load(&artefact).expect("loads");
    assert_eq!(shader.manifest(), &artefact.manifest);
    println!("given up");
}

#[test]
fn a_machine_without_drivers_is_told_what_to_install() {
    if device(Settings::default()).is_none() {
        return;
    }
    let (ok, text) = alone("no_driver", &[("VK_DRIVER_FILES", "/nowhere.json"), ("VK_ICD_FILENAMES", "/nowhere.json")]);
    assert!(ok && text.contains("mesa-vulkan-drivers"), "{text}");
}

#[test]
#[ignore = "run by another test, in a process of its own"]
fn no_driver() {
    for outcome in [devices().map(|_| ()), Device::open(&Choice::default()).map(|_| ())] {
        match outcome {
            Err(VulkanError::NoDevice(text)) => println!("{text}"),
            // A loader without drivers may say so only when it is asked for a device.
            Ok(()) => println!("no devices"),
            Err(other) => panic!("{other}"),
        }
    }
}

/// Bindings of another kind than the kernel's: no results are to be had, and the layer must be heard.
#[test]
fn the_validation_layer_is_heard() {
    let Some(device) = device(Settings::default()) else { return };
    let mut artefact = compiled(BALL, &["value"], &["at"], Target::Spirv, Precision::F32);
    let Abi::Buffers(buffers) = &mut artefact.manifest.abi else { panic!("no buffers") };
    std::mem::swap(&mut buffers.bindings.call, &mut buffers.bindings.outputs);
    drop(device.load(&artefact));
    let messages = device.messages();
    assert!(messages.iter().any(|m| m.starts_with("error: ") && m.contains("VUID")), "{messages:?}");
}

/// Runs an ignored test of this program in a process of its own; whether it went well, and what it printed.
fn alone(test: &str, environment: &[(&str, &str)]) -> (bool, String) {
    let program = std::env::current_exe().expect("a path");
    let output = Command::new(program)
        .args(["--exact", test, "--ignored", "--nocapture"])
        .envs(environment.iter().copied())
        .output()
        .expect("runs");
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8_lossy(&text).into_owned())
}
