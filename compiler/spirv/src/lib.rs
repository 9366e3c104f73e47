//! Graphs to shaders: SPIR-V, WGSL, and by translation GLSL, HLSL and MSL (DESIGN 8). Takes a graph after `kernels` for
//! [`Family::Shader`](isograd_graph::ops::Family), as it stands: it reorders nothing and knows nothing of source text,
//! differentiation and hosts.
//!
//! `program` holds the instruction texts of the op table; `plan` says what a host binds and what a target allows;
//! `spirv` and `wgsl` write. Each operation of the graph is rounded on its own: no fused, relaxed or approximate
//! instruction is ever written, and SPIR-V forbids contraction of every arithmetic instruction.
//!
//! # What a host binds to a kernel
//!
//! All in descriptor set (WGSL: group) [`SET`]. Buffers are arrays of elements, one element as wide as a real; all is
//! little-endian. An int or bool (0 or 1; read: any other number is true) takes an element too; in an f64 kernel it is
//! sign-extended to 64 bits. Every NaN is stored with all bits set.
//!
//! | binding | what | content |
//! |---|---|---|
//! | [`INPUTS`] | storage buffer, read only | the varying inputs: input `k` of point `i` is element `k · input_stride + i` |
//! | [`OUTPUTS`] | storage buffer | the outputs: output `k` of point `i` is element `k · output_stride + i` |
//! | [`CALL`] | uniform buffer | four u32: `count`, `input_stride`, `output_stride`, `base` |
//! | [`UNIFORMS`] | storage buffer, read only | the uniform inputs, one element each |
//!
//! A binding is absent if there is nothing in it. Invocation `x` of the dispatch computes point `base + x` if that is less
//! than `count`; the entry point is [`ENTRY`], workgroups have [`WORKGROUP`] invocations. As devices need not take more
//! than 65,535 workgroups at once, larger calls are several dispatches with different `base`.
//!
//! # What a library in WGSL has
//!
//! One function, whose name, parameters and results are the [`identifier`]s of those of the signature: `gradient(at)` is
//! `gradient_at`, and a second one of the same letters gets `_2`. One result is returned as it is, several as the members of
//! the struct `NAME__result`. Two to four scalars of a kind are a vector, more an array; scalars of several kinds are the
//! struct `NAME__PARAMETER` or `NAME__RESULT`. All else of the module has such names with two underscores too, which
//! no identifier has, so that any number of libraries fits into one program.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod plan;
mod program;
mod spirv;
mod translate;
mod wgsl;

use std::fmt;

use isograd_graph::{NodeId, Unready};

pub use plan::{Group, Layout, Plan, Shape, Signature, Slot};
pub use spirv::{disassemble, lint};
pub use translate::Dialect;
pub use wgsl::identifier;

/// The descriptor set of all bindings.
pub const SET: u32 = 0;
/// The binding of the varying inputs.
pub const INPUTS: u32 = 0;
/// The binding of the outputs.
pub const OUTPUTS: u32 = 1;
/// The binding of what a call is about: count, strides, base.
pub const CALL: u32 = 2;
/// The binding of the uniform inputs.
pub const UNIFORMS: u32 = 3;
/// The entry point of a kernel.
pub const ENTRY: &str = "main";
/// Invocations of a workgroup.
pub const WORKGROUP: u32 = 64;
/// Bytes of tapes that an invocation may keep: what is larger leaves the registers of devices.
pub const TAPE_BYTES: u32 = 4096;

/// A language of shaders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// SPIR-V 1.3.
    Spirv,
    /// WGSL.
    Wgsl,
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Spirv => "SPIR-V",
            Self::Wgsl => "WGSL",
        })
    }
}

/// What a shader is for.
#[derive(Debug, Clone)]
pub enum Form<'a> {
    /// A compute kernel over points.
    Kernel {
        /// For each input of the graph whether it has a value for each point.
        varying: &'a [bool],
    },
    /// A function for others to call.
    Library(&'a Signature),
}

/// Why a graph was not emitted. All but [`EmitError::Unsupported`] are mistakes of the compiler, not of its user.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EmitError {
    /// The graph is not ready for emission.
    #[error(transparent)]
    Unready(#[from] Unready),
    /// A tape of a loop whose trip count is not constant.
    #[error("node %{} is a tape that has no fixed place", .0.0)]
    Tape(NodeId),
    /// The options do not fit the graph.
    #[error("{what}")]
    Options {
        /// In what way.
        what: &'static str,
    },
    /// A text of the op table is wrong.
    #[error("the shader program of {0} is malformed")]
    Program(isograd_graph::Op),
    /// The target cannot do what the graph asks for.
    #[error("{target} {lack}")]
    Unsupported {
        /// The target.
        target: Language,
        /// What it lacks.
        lack: Lack,
        /// The node that needs it, where it is one.
        node: Option<NodeId>,
    },
    /// The WGSL could not be translated.
    #[error("the WGSL cannot be translated: {0}")]
    Translation(String),
    /// The emitted module is not what this crate promises.
    #[error("the emitted module breaks a rule: {0}")]
    Lint(String),
}

/// What a target cannot do, said after its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Lack {
    /// There is no f64.
    #[error("has no f64")]
    Doubles,
    /// Tapes of loops that are differentiated in reverse.
    #[error("keeps at most {TAPE_BYTES} bytes of loop iterations per point for the reverse sweep; this needs {bytes}")]
    Tapes {
        /// What they take.
        bytes: u64,
    },
    /// Branches and loops inside each other.
    #[error("nests branches and loops at most {most} deep; these nest {depth} deep")]
    Nesting {
        /// How deep they nest.
        depth: u32,
        /// How deep they may.
        most: u32,
    },
    /// Parameters of a function.
    #[error("takes at most 255 parameters; this function has {count}")]
    Parameters {
        /// How many there are.
        count: usize,
    },
    /// Values that are put together into one array or struct.
    #[error("puts at most {most} values together; this needs {count}")]
    Members {
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// Variables of a function: results of branches, and what loops change.
    #[error("keeps at most {most} bytes of variables, for results of branches and loops; this needs more")]
    Variables {
        /// How many bytes there may be.
        most: u32,
    },
    /// Operations of a program that is translated, which takes time with their square.
    #[error("is translated from WGSL, of at most {most} operations; this program has {count}")]
    Translated {
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// Values in one module.
    #[error("numbers at most 4,194,303 values; this module has more")]
    Values,
}
