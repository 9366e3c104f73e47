//! What a request compiles to: bytes and a manifest that says how to call them.

use isograd_graph::Precision;
use isograd_syntax::Diagnostic;
use serde::{Deserialize, Serialize};

use crate::{DerivativeMode, Differentiability, Form, Kink, Rate, Role, Target};

/// A compiled request.
#[derive(Debug, Clone, PartialEq)]
pub struct Artefact {
    /// The module: of WebAssembly with the manifest in its custom section `isograd.manifest`, of text in UTF-8.
    pub bytes: Vec<u8>,
    /// How to call it.
    pub manifest: Manifest,
    /// What elaboration warns of.
    pub warnings: Vec<Diagnostic>,
}

/// How to call a module. What its [`Abi`] is says how; in all of them NaN outputs have all bits set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// The version of the compiler.
    pub compiler: String,
    /// BLAKE3 of the canonical request, hexadecimal.
    pub id: String,
    /// The export.
    pub export: String,
    /// `f32` or `f64`.
    pub precision: String,
    /// What it is compiled to.
    #[serde(default)]
    pub target: Target,
    /// What a host calls.
    #[serde(default)]
    pub form: Form,
    /// Inputs in the order of the export's parameters.
    pub inputs: Vec<Port>,
    /// Outputs in the order of the queries.
    pub outputs: Vec<Port>,
    /// How numbers are handed over.
    #[serde(flatten)]
    pub abi: Abi,
    /// Operations of the graph, a measure of cost.
    pub operations: u32,
    /// Whether a loop of the module may run longer than 10,000 iterations per point: a host should bound its time.
    pub unbounded: bool,
    /// How its derivatives are computed.
    pub derivatives: Derivatives,
    /// What is left of it, if it is specialised to a box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specialised: Option<Specialised>,
    /// What becomes of operations that have no derivative somewhere (LANGUAGE 14).
    #[serde(default)]
    pub differentiability: Differentiability,
    /// Where that is `smooth`: how smooth. Kinks have the width 10⁻³ times this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensitivity: Option<Number>,
}

/// How a host hands numbers over.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Abi {
    /// Of a WebAssembly module: through its memory.
    Memory(Memory),
    /// Of a compute shader: through buffers.
    Buffers(Buffers),
    /// Of a function of a shader library: by value.
    Function(FunctionAbi),
}

/// A WebAssembly module exports `memory` and `eval(count: i32)`; a host writes each input's columns at their offsets, in
/// bytes, calls `eval` with 1 to `block` points, and reads the outputs' columns. A column of a varying input or an output
/// has one element per point; a uniform input has one element. Reals are little-endian f32 or f64 by `precision`; ints
/// and bools are i32, bools 0 or 1. The host fills a varying column up to the next multiple of `pad` points with copies
/// of the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Memory {
    /// Most points per call.
    pub block: u32,
    /// Points per iteration.
    pub pad: u32,
    /// Bytes of the module's memory.
    pub memory: u32,
    /// Bytes of it that are neither input nor output: what the module keeps during a call, for the functions of a large
    /// module and for loops that are differentiated in reverse.
    #[serde(default)]
    pub scratch: u32,
}

/// A compute shader takes its columns from storage buffers, arrays of elements of `element` bytes. Element `i` of a column
/// of a varying input or an output is at `offset · stride + i` of its buffer, with the stride of the call; a uniform
/// input is at `offset`. Reals are little-endian f32 or f64 by `precision`; ints and bools (0 or 1) are sign-extended
/// to the same size.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Buffers {
    /// The name of the entry point.
    pub entry: String,
    /// Invocations of a workgroup; each computes a point.
    pub workgroup: u32,
    /// Bytes of an element.
    pub element: u32,
    /// Where buffers are bound.
    pub bindings: Bindings,
    /// Bytes of loop iterations that an invocation keeps for the reverse sweep.
    pub tapes: u32,
}

/// Where the buffers of a compute shader are bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bindings {
    /// The descriptor set; in WGSL the group.
    pub set: u32,
    /// Varying inputs, a storage buffer that is only read; absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<u32>,
    /// Outputs, a storage buffer.
    pub outputs: u32,
    /// What a call is about, a uniform buffer of four u32: `count`, `input_stride`, `output_stride`, `base`. Invocation
    /// `x` computes point `base + x` if that is less than `count`.
    pub call: u32,
    /// Uniform inputs, a storage buffer that is only read; absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uniforms: Option<u32>,
}

/// A function takes a value for each input port and returns one for its output port, or a struct of them if there are
/// several. A value is a scalar for one column; a vector for two to four columns of one kind, an array for more; a struct
/// for columns of several kinds. A port without columns is left out. Columns are numbered through by their offsets.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FunctionAbi {
    /// Its name, that of the export.
    pub function: String,
    /// Bytes of loop iterations that a call keeps for the reverse sweep.
    pub tapes: u32,
}

/// What specialisation left of a graph, in operations before transcendental functions are expanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Specialised {
    /// Operations that compute the queries anywhere.
    pub from: u32,
    /// Operations that compute them inside of the box, which the inputs' `within` says.
    pub to: u32,
}

/// How derivatives are computed, and what each way costs per point, in units of an addition before transcendental
/// functions are expanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Derivatives {
    /// The way taken: never [`DerivativeMode::Auto`].
    pub mode: DerivativeMode,
    /// The cost of the forward sweep, if it was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forward: Option<u64>,
    /// The cost of the reverse sweep, if it was made and differs from the forward one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reverse: Option<u64>,
}

impl Manifest {
    /// What reals are; `None` if the manifest names none of the precisions.
    #[must_use]
    pub fn precision(&self) -> Option<Precision> {
        [Precision::F32, Precision::F64].into_iter().find(|p| p.name() == self.precision)
    }

    /// How to call it, if it is a WebAssembly module.
    #[must_use]
    pub const fn memory(&self) -> Option<&Memory> {
        match &self.abi {
            Abi::Memory(memory) => Some(memory),
            Abi::Buffers(_) | Abi::Function(_) => None,
        }
    }

    /// How to call it, if it is a compute shader.
    #[must_use]
    pub const fn buffers(&self) -> Option<&Buffers> {
        match &self.abi {
            Abi::Buffers(buffers) => Some(buffers),
            Abi::Memory(_) | Abi::Function(_) => None,
        }
    }

    /// Bytes of an element of a column.
    #[must_use]
    pub fn element(&self, scalar: ColumnType) -> usize {
        match scalar {
            ColumnType::Real if self.precision == "f64" => 8,
            ColumnType::Real | ColumnType::Int | ColumnType::Bool => 4,
        }
    }
}

impl ColumnType {
    /// What it holds, in words.
    #[must_use]
    pub const fn describe(self) -> &'static str {
        match self {
            Self::Real => "reals",
            Self::Int => "ints",
            Self::Bool => "truth values",
        }
    }
}

/// An input or output of several columns.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Port {
    /// A parameter's name (of a box beside the value `at.box`, of a direction `at.direction`), or a query as written:
    /// `gradient(at)`.
    pub name: String,
    /// Its type: `vec3`.
    #[serde(rename = "type")]
    pub ty: String,
    /// For inputs: how often it changes; outputs vary.
    pub rate: Rate,
    /// For inputs: whether the numbers are the parameter's value, the ends of a box, or a direction. A parameter that
    /// ranges over a box in every query has no value.
    #[serde(default, skip_serializing_if = "is_default")]
    pub role: Role,
    /// Of `bound(…, mean)`: the results whose enclosure is the natural one, because they are not known to be
    /// continuous in what ranges over boxes. Of `lipschitz(…)`: the results that may jump, which no bound of a gradient
    /// shows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub jumps: Vec<String>,
    /// Of `kinks(…)`: the kinks that its column `kink` numbers, from 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kinks: Vec<Kink>,
    /// Its scalars in order (LANGUAGE 9.2); of a box, the start and the end of each real.
    pub columns: Vec<Column>,
}

/// One scalar of a port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its name: `at.x`; of a gradient the parameter scalar, of a Hessian two of them, `at.x/at.y`; before them the
    /// result scalar, `value.x/at.y`, if the result has several. Of a box `at.x.start` and `at.x.end`, of a direction
    /// `at.x.direction`. Of an enclosure `start`, `end`, `may_be_nan`, after what is enclosed if that is several.
    pub name: String,
    /// What it holds.
    pub scalar: ColumnType,
    /// Where it begins, as its [`Abi`] counts; in WebAssembly a multiple of 16.
    pub offset: u32,
    /// Of an input: the value that the parameter has by default (LANGUAGE 9.3).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub default: Option<Number>,
    /// Of an input: the ends of the box that the module is specialised to. Outside of it results mean nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<[Number; 2]>,
    /// Of an input: the range the parameter is meant for. The module computes outside of it as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[Number; 2]>,
    /// Of a derivative: whether it is 0 at all points because no path leads from what it is differentiated by to the
    /// result, or only constants lie on it. The module does no work for it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub zero: bool,
}

fn is_default<T: Default + PartialEq>(x: &T) -> bool {
    *x == T::default()
}

/// A number of a manifest. In JSON, which has no infinities, they are `"inf"` and `"-inf"`.
#[derive(Debug, Clone, Copy)]
pub struct Number(pub f64);

impl PartialEq for Number {
    fn eq(&self, other: &Self) -> bool {
        self.0.to_bits() == other.0.to_bits()
    }
}

impl Eq for Number {}

impl Serialize for Number {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() { serializer.serialize_f64(self.0) } else { serializer.collect_str(&self.0) }
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Written<'a> {
            Number(f64),
            Text(std::borrow::Cow<'a, str>),
        }
        match Written::deserialize(deserializer)? {
            Written::Number(x) => Ok(Self(x)),
            Written::Text(text) => text.parse().map(Self).map_err(serde::de::Error::custom),
        }
    }
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColumnType {
    /// Reals of the module's precision.
    Real,
    /// i32
    Int,
    /// i32, 0 or 1
    Bool,
}
