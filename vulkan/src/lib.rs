//! Evaluates SPIR-V artefacts over columns of points, on any device with Vulkan 1.1. Knows the artefact's manifest and
//! nothing of how it was made; what its words and the API's rules are is its business, what results mean is not.
//!
//! A [`Device`] is opened once and makes [`Shader`]s of artefacts; [`Shader::evaluate`] runs one over any number of
//! points. Points are cut into chunks whose buffers fit the device, chunks into dispatches that it takes at once; the
//! results are in the order of the inputs. Numbers travel as words: no bit of a NaN or a subnormal is touched on the way.
//! Shaders and devices may be used from several threads; a device evaluates one call after the other.
//!
//! | file | what is in it |
//! |---|---|
//! | `instance` | the loader, what devices there are, what the validation layer says |
//! | `device` | an opened device, and the owner of everything made of it |
//! | `buffer` | memory that the host or the device reads and writes |
//! | `module`, `plan` | what an artefact demands, and how its points are cut up: no call of Vulkan |
//! | `shader` | an artefact as a pipeline, and its evaluation |
//! | `dispatch` | the commands of one chunk |
//! | `words` | columns to and from words |

// Vulkan is an interface of C. Its calls are in `instance`, `device`, `buffer`, `shader` and `dispatch` alone.
#![allow(unsafe_code, reason = "every call of Vulkan is unsafe: the API's rules of use are the caller's to keep")]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]
#![deny(clippy::undocumented_unsafe_blocks)]

mod buffer;
mod device;
mod dispatch;
mod instance;
mod module;
mod plan;
mod shader;
mod words;

use std::time::Duration;

use isograd_runtime::EvalError;

pub use device::Device;
pub use instance::devices;
pub use shader::Shader;

/// Which device to open, and how.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Choice {
    /// A part of the device's name in any case, or `discrete`, `integrated`, `virtual` or `cpu`. By default the first
    /// device of the kind that comes first in [`DeviceKind`].
    pub device: Option<String>,
    /// Whether the validation layer watches all calls; see [`Device::messages`].
    pub validation: bool,
}

/// What a device may take for a call.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Bytes of the buffers of a chunk of points, about: more points are several chunks. A chunk has at least one
    /// workgroup.
    pub memory: u64,
    /// How long a chunk may take. A device that takes longer cannot be used any more, for it cannot be stopped: what it
    /// works on is left to it.
    pub timeout: Duration,
    /// Workgroups of a dispatch, at most; the device's own limit counts as well.
    pub groups: u32,
    /// Whether columns are copied to memory of the device's own. By default they are for [`DeviceKind::Discrete`],
    /// which reads the host's memory slowly.
    pub staged: Option<bool>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { memory: 64 << 20, timeout: Duration::from_secs(60), groups: u32::MAX, staged: None }
    }
}

/// The kinds of devices, in the order of preference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DeviceKind {
    /// A graphics card with memory of its own.
    Discrete,
    /// A graphics unit that shares the host's memory.
    Integrated,
    /// A unit that a virtual machine is lent.
    Virtual,
    /// A program on the processor, as Mesa's lavapipe.
    Cpu,
    /// Anything else.
    Other,
}

impl DeviceKind {
    /// All kinds, in the order of preference.
    pub const ALL: [Self; 5] = [Self::Discrete, Self::Integrated, Self::Virtual, Self::Cpu, Self::Other];

    /// `discrete`, `integrated`, …
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Cpu => "cpu",
            Self::Other => "other",
        }
    }
}

/// A device of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Its name, as its driver says it.
    pub name: String,
    /// Its kind.
    pub kind: DeviceKind,
    /// The driver and its version.
    pub driver: String,
    /// The version of Vulkan: `1.3.230`.
    pub api: String,
    /// Whether it computes with f64, and with the i64 that f64 kernels need: `shaderFloat64` and `shaderInt64`.
    pub doubles: bool,
    /// Bytes that a kernel can be given in one buffer.
    pub max_buffer: u64,
    /// Workgroups of one dispatch.
    pub max_groups: u32,
}

/// Why a device was not opened or an artefact not evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VulkanError {
    /// There is no Vulkan on this machine.
    #[error(
        "Vulkan cannot be loaded: {0}; install libvulkan1 and a driver (on Debian and Ubuntu: apt-get install libvulkan1 mesa-vulkan-drivers)"
    )]
    NoLoader(String),
    /// There is no such device.
    #[error("{0}")]
    NoDevice(String),
    /// The validation layer was asked for and is not installed.
    #[error(
        "the validation layer of Vulkan is not installed; install it (on Debian and Ubuntu: apt-get install vulkan-validationlayers) or do without validation"
    )]
    Validation,
    /// The device cannot run the artefact.
    #[error("{0}")]
    Unsupported(String),
    /// The inputs do not fit the artefact.
    #[error(transparent)]
    Inputs(#[from] EvalError),
    /// The buffers do not fit into memory.
    #[error("{bytes} bytes of numbers do not fit into memory; evaluate fewer points at once")]
    Memory {
        /// Bytes wanted.
        bytes: u64,
    },
    /// The device or its driver failed.
    #[error("{0}")]
    Failed(String),
}

impl VulkanError {
    /// A call of Vulkan failed: while doing what, and how.
    pub(crate) fn call(doing: &'static str) -> impl Fn(ash::vk::Result) -> Self {
        move |result| {
            Self::Failed(format!("Vulkan failed while {doing}: {result}; try another device, or a newer driver"))
        }
    }
}
