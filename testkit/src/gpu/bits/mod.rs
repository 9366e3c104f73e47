//! Emitted SPIR-V on a Vulkan device against WebAssembly, bit for bit. Knows artefacts, graphs and how both are run;
//! knows nothing of how a shader is written.
//!
//! # The rules
//!
//! A number that the device computes must have the bits that WebAssembly gives it, all NaNs being one. Vulkan lets a
//! device flush subnormal numbers, and drop NaN, infinities and the sign of zero, even in intermediate results. So a
//! difference is excused by one of these rules, and by nothing else. The reference evaluator runs the shader's own graph
//! at that point, as it is emitted, and looks at every real that a needed node gets, in every iteration of a loop:
//!
//! 1. [`Rule::Nan`]: one of them is NaN;
//! 2. [`Rule::Infinity`]: else one of them is infinite;
//! 3. [`Rule::Subnormal`]: else one of them is subnormal;
//! 4. [`Rule::Long`]: else the loops of the graph run for more than [`MOST_ITERATIONS`] together, after which lavapipe
//!    leaves them;
//! 5. [`Rule::Zero`]: else the two numbers that differ are +0 and −0. What the sign of a zero on the way does to a number
//!    that is not 0 is not excused. (Mesa's lavapipe makes `x × 0` +0, `−0 + 0` −0 and `select(c, 0, −1)` −0.)
//!
//! Numbers with equal bits count as equal whatever was met on the way. Excused numbers are counted for each rule, and a
//! corpus of which more than [`MOST_EXCUSED`] percent had to be excused fails: nothing hides behind the rules.
//!
//! A device that is no [`Cpu`](isograd_vulkan::DeviceKind::Cpu) need not divide and take roots as IEEE 754 says. It is
//! held to [bounds](super::bounds) in f32: what has other bits and is not excused must lie within them, and is counted; in
//! f64 it is held to the bits. `ISOGRAD_GPU_BOUNDS=1` holds every device to bounds, `ISOGRAD_GPU_BOUNDS=0` to bits.
//!
//! That the comparison sees mistakes is shown by those of [`planted`].
//!
//! The reference run of the shader's graph must itself have the bits of WebAssembly, without any excuse. That needs no
//! device, and says whether a difference is the graph's or the device's.

mod columns;
pub mod corpora;
mod importer;
mod locate;
mod open;
pub mod planted;
mod points;
mod prepared;
mod rules;
mod tools;

pub use open::{Missing, REQUIRE_TOOLS, REQUIRE_VULKAN, device, held_to, tools, validation};
pub use prepared::{At, MOST_OPERATIONS, Made, Prepared, Subject, of_graph, of_library, of_request, runtime};
pub use rules::{Difference, HeldTo, Judged, MOST_EXCUSED, MOST_ITERATIONS, Reference, Rule, Tally, Verdict, compare};

/// Has a kernel judged by `spirv-val`.
///
/// # Errors
/// What it says.
pub fn validate(kernel: &[u8]) -> Result<(), String> {
    tools::validate(kernel, false)
}
