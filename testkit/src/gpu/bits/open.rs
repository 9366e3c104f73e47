//! What the suite needs of a machine, what to say where it is missing, and what it holds a device to. Variables of the
//! environment turn a missing part into a failure, and choose the latter.

use std::env;
use std::fmt;

use isograd_vulkan::{Choice, Device, DeviceKind, VulkanError};

use super::rules::HeldTo;
use super::tools::{PROGRAMS, installed};

/// Set to `1` where a Vulkan device must be there.
pub const REQUIRE_VULKAN: &str = "ISOGRAD_REQUIRE_VULKAN";
/// Set to `1` where the programs of SPIRV-Tools must be there.
pub const REQUIRE_TOOLS: &str = "ISOGRAD_REQUIRE_SPIRV_TOOLS";

/// Set to `1` to hold every device to bounds, to `0` to hold it to bits.
pub const BOUNDS: &str = "ISOGRAD_GPU_BOUNDS";

/// What a device is held to: one that computes on the CPU to bits, any other to bounds.
#[must_use]
pub fn held_to(device: &Device) -> HeldTo {
    match env::var(BOUNDS).as_deref() {
        Ok("1") => HeldTo::Bounds,
        Ok("0") => HeldTo::Bits,
        _ if device.info().kind == DeviceKind::Cpu => HeldTo::Bits,
        _ => HeldTo::Bounds,
    }
}

/// A part that is not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missing {
    /// What is missing, why it is needed, how to get it.
    pub what: String,
    /// Whether the environment demands it.
    pub demanded: bool,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, demanded } = self;
        write!(f, "{}: {what}", if *demanded { "MISSING, and demanded here" } else { "SKIPPED" })
    }
}

fn demanded(variable: &str) -> bool {
    env::var(variable).is_ok_and(|x| x == "1")
}

/// The best device of the machine, with the validation layer on. Where no device is demanded it may lack the layer.
///
/// # Errors
/// If there is none; or, where it is demanded, no validation layer.
pub fn device() -> Result<Device, Missing> {
    let demanded = demanded(REQUIRE_VULKAN);
    let open = |validation| Device::open(&Choice { validation, ..Choice::default() });
    let device = match open(true) {
        Err(VulkanError::Validation) if !demanded => open(false),
        other => other,
    };
    device.map_err(|e| {
        let what = format!("nothing is executed on a Vulkan device: {e}. With {REQUIRE_VULKAN}=1 this is a failure");
        Missing { what, demanded }
    })
}

/// What the validation layer said of all that devices did, for a report.
#[must_use]
pub fn validation(messages: usize) -> String {
    match Device::open(&Choice { validation: true, ..Choice::default() }) {
        Ok(_) => format!("messages of the validation layer: {messages}"),
        Err(e) => format!("SKIPPED: nothing is watched by the validation layer: {e}"),
    }
}

/// Whether the programs of SPIRV-Tools are there.
///
/// # Errors
/// If not all are.
pub fn tools() -> Result<(), Missing> {
    let lacking: Vec<&str> = PROGRAMS.iter().copied().filter(|program| !installed(program)).collect();
    if lacking.is_empty() {
        return Ok(());
    }
    let what = format!(
        "no module is validated and no library is linked without the programs {}. On Debian and Ubuntu: apt-get install \
         spirv-tools. With {REQUIRE_TOOLS}=1 this is a failure",
        lacking.join(", ")
    );
    Err(Missing { what, demanded: demanded(REQUIRE_TOOLS) })
}
