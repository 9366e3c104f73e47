//! A kernel that imports a function of a library module, calls it at each point and stores what it returns, as SPIR-V
//! assembly. It is written from the manifest alone, as a host would write it; it knows nothing of the library's text.

use std::fmt::Write as _;

use isograd_compiler::{Manifest, Port, Precision};
use isograd_graph::Scalar;
use isograd_spirv::{CALL, ENTRY, INPUTS, OUTPUTS, SET, Shape, WORKGROUP};

use super::columns::scalar;

/// The kernel for a library's function. Its buffers are those of an emitted kernel whose inputs all vary.
pub fn importer(manifest: &Manifest, function: &str) -> String {
    let precision = manifest.precision().unwrap_or_default();
    let mut types = Types { precision, text: String::new(), known: Vec::new() };
    let parameters: Vec<Shape> = manifest.inputs.iter().filter_map(shape).collect();
    let results: Vec<Shape> = manifest.outputs.iter().filter_map(shape).collect();
    let parameter_types: Vec<String> = parameters.iter().map(|s| types.of(s)).collect();
    let result_types: Vec<String> = results.iter().map(|s| types.of(s)).collect();
    let result_type = match result_types.as_slice() {
        [one] => one.clone(),
        several => types.declared("struct", &format!("OpTypeStruct {}", several.join(" "))),
    };
    let signature = format!("OpTypeFunction {result_type} {}", parameter_types.join(" "));
    let signature = types.declared("signature", &signature);
    let mut body = Body { precision, text: String::new(), next: 0 };

    let arguments = arguments(&mut types, &mut body, &parameters);
    let called = body.value(&format!("OpFunctionCall {result_type} %imported {}", arguments.join(" ")));
    let mut column = 0;
    for (i, shape) in results.iter().enumerate() {
        let ty = types.of(shape);
        let whole = match results.len() {
            1 => called.clone(),
            _ => body.value(&format!("OpCompositeExtract {ty} {called} {i}")),
        };
        for (k, scalar) in scalars(shape).into_iter().enumerate() {
            let one = match shape {
                Shape::Scalar(_) => whole.clone(),
                _ => body.value(&format!("OpCompositeExtract {} {whole} {k}", types.scalar(scalar))),
            };
            body.store(column, scalar, &one);
            column += 1;
        }
    }

    let declared_parameters = parameter_types.iter().enumerate().fold(String::new(), |mut text, (i, ty)| {
        let _ = writeln!(text, "%parameter{i} = OpFunctionParameter {ty}");
        text
    });
    let (head, element) = (head(precision, function), element(precision));
    let Types { text: types, .. } = types;
    let body = body.text;
    let text = format!(
        "{head}{FIXED_TYPES}{element}{BUFFERS}{types}
%imported = OpFunction {result_type} None {signature}
{declared_parameters}OpFunctionEnd
%main = OpFunction %void None %nothing
%start = OpLabel
%place = OpAccessChain %ptr_input_uint %id %u0
%invocation = OpLoad %uint %place
%count_at = OpAccessChain %ptr_call_uint %call %u0
%count = OpLoad %uint %count_at
%input_stride_at = OpAccessChain %ptr_call_uint %call %u1
%input_stride = OpLoad %uint %input_stride_at
%output_stride_at = OpAccessChain %ptr_call_uint %call %u2
%output_stride = OpLoad %uint %output_stride_at
%base_at = OpAccessChain %ptr_call_uint %call %u3
%base = OpLoad %uint %base_at
%point = OpIAdd %uint %base %invocation
%inside = OpULessThan %bool %point %count
OpSelectionMerge %done None
OpBranchConditional %inside %work %done
%work = OpLabel
{body}OpBranch %done
%done = OpLabel
OpReturn
OpFunctionEnd
"
    );
    // A type of numbers has one declaration only, so a word is called by its name.
    if precision == Precision::F32 {
        text.replace("%element ", "%uint ").replace("%element\n", "%uint\n")
    } else {
        text
    }
}

/// The shape of a port's value, if it has any.
fn shape(port: &Port) -> Option<Shape> {
    let scalars: Vec<Scalar> = port.columns.iter().map(|c| scalar(c.scalar)).collect();
    (!scalars.is_empty()).then(|| Shape::of(&scalars))
}

fn scalars(shape: &Shape) -> Vec<Scalar> {
    match shape {
        Shape::Scalar(scalar) => vec![*scalar],
        Shape::Vector(scalar, n) | Shape::Array(scalar, n) => vec![*scalar; *n as usize],
        Shape::Struct(scalars) => scalars.clone(),
    }
}

/// Reads the columns of all parameters and puts them together.
fn arguments(types: &mut Types, body: &mut Body, parameters: &[Shape]) -> Vec<String> {
    let mut column = 0;
    let mut all = Vec::new();
    for shape in parameters {
        let mut parts = Vec::new();
        for scalar in scalars(shape) {
            parts.push(body.load(column, scalar));
            column += 1;
        }
        all.push(match (shape, parts.as_slice()) {
            (Shape::Scalar(_), [one]) => one.clone(),
            _ => body.value(&format!("OpCompositeConstruct {} {}", types.of(shape), parts.join(" "))),
        });
    }
    all
}

/// Types that the function mentions, each declared once.
struct Types {
    precision: Precision,
    text: String,
    known: Vec<(String, String)>,
}

impl Types {
    fn declared(&mut self, name: &str, what: &str) -> String {
        if let Some((_, id)) = self.known.iter().find(|(known, _)| known == what) {
            return id.clone();
        }
        let id = format!("%{name}_{}", self.known.len());
        let _ = writeln!(self.text, "{id} = {what}");
        self.known.push((what.to_owned(), id.clone()));
        id
    }

    fn scalar(&mut self, scalar: Scalar) -> String {
        match (scalar, self.precision) {
            (Scalar::Real, Precision::F32) => "%float".to_owned(),
            (Scalar::Real, Precision::F64) => "%double".to_owned(),
            (Scalar::Int, _) => "%int".to_owned(),
            (Scalar::Bool, _) => "%bool".to_owned(),
        }
    }

    fn of(&mut self, shape: &Shape) -> String {
        match shape {
            Shape::Scalar(scalar) => self.scalar(*scalar),
            Shape::Vector(scalar, n) => {
                let of = self.scalar(*scalar);
                self.declared("vector", &format!("OpTypeVector {of} {n}"))
            }
            Shape::Array(scalar, n) => {
                let of = self.scalar(*scalar);
                let n = self.declared("length", &format!("OpConstant %uint {n}"));
                self.declared("array", &format!("OpTypeArray {of} {n}"))
            }
            Shape::Struct(scalars) => {
                let of: Vec<String> = scalars.iter().map(|s| self.scalar(*s)).collect();
                self.declared("struct", &format!("OpTypeStruct {}", of.join(" ")))
            }
        }
    }
}

/// Instructions of the kernel. Elements of buffers are words, or pairs of them: no float type is in the way of bits.
struct Body {
    precision: Precision,
    text: String,
    next: usize,
}

impl Body {
    fn value(&mut self, what: &str) -> String {
        let id = format!("%v{}", self.next);
        self.next += 1;
        let _ = writeln!(self.text, "{id} = {what}");
        id
    }

    /// The place of an element: `column · stride + point`.
    fn place(&mut self, buffer: &str, stride: &str, column: u32) -> String {
        // The constants are made of those at hand, so that none must be declared before.
        let mut number = "%u0".to_owned();
        for _ in 0..column {
            number = self.value(&format!("OpIAdd %uint {number} %u1"));
        }
        let from = self.value(&format!("OpIMul %uint {number} {stride}"));
        let at = self.value(&format!("OpIAdd %uint {from} %point"));
        self.value(&format!("OpAccessChain %ptr_element {buffer} %u0 {at}"))
    }

    fn load(&mut self, column: u32, scalar: Scalar) -> String {
        let place = self.place("%inputs", "%input_stride", column);
        let element = self.value(&format!("OpLoad %element {place}"));
        match (scalar, self.precision) {
            (Scalar::Real, Precision::F32) => self.value(&format!("OpBitcast %float {element}")),
            (Scalar::Real, Precision::F64) => self.value(&format!("OpBitcast %double {element}")),
            (scalar, precision) => {
                let word = match precision {
                    Precision::F32 => element,
                    Precision::F64 => self.value(&format!("OpCompositeExtract %uint {element} 0")),
                };
                match scalar {
                    Scalar::Bool => self.value(&format!("OpINotEqual %bool {word} %u0")),
                    _ => self.value(&format!("OpBitcast %int {word}")),
                }
            }
        }
    }

    fn store(&mut self, column: u32, scalar: Scalar, value: &str) {
        let place = self.place("%outputs", "%output_stride", column);
        let word = match scalar {
            Scalar::Real => self.value(&format!("OpBitcast %element {value}")),
            Scalar::Int => self.value(&format!("OpBitcast %uint {value}")),
            Scalar::Bool => self.value(&format!("OpSelect %uint {value} %u1 %u0")),
        };
        let element = match (scalar, self.precision) {
            (Scalar::Real, _) | (_, Precision::F32) => word,
            (_, Precision::F64) => {
                let sign = self.value(&format!("OpShiftRightArithmetic %uint {word} %u31"));
                self.value(&format!("OpCompositeConstruct %element {word} {sign}"))
            }
        };
        let _ = writeln!(self.text, "OpStore {place} {element}");
    }
}

fn head(precision: Precision, function: &str) -> String {
    let doubles = if precision == Precision::F64 { "OpCapability Float64\n" } else { "" };
    let stride = precision.bytes();
    format!(
        "OpCapability Shader
OpCapability Linkage
{doubles}OpMemoryModel Logical GLSL450
OpEntryPoint GLCompute %main \"{ENTRY}\" %id
OpExecutionMode %main LocalSize {WORKGROUP} 1 1
OpDecorate %imported LinkageAttributes \"{function}\" Import
OpDecorate %id BuiltIn GlobalInvocationId
OpDecorate %elements ArrayStride {stride}
OpMemberDecorate %buffer 0 Offset 0
OpDecorate %buffer Block
OpMemberDecorate %call_block 0 Offset 0
OpMemberDecorate %call_block 1 Offset 4
OpMemberDecorate %call_block 2 Offset 8
OpMemberDecorate %call_block 3 Offset 12
OpDecorate %call_block Block
OpDecorate %inputs DescriptorSet {SET}
OpDecorate %inputs Binding {INPUTS}
OpDecorate %inputs NonWritable
OpDecorate %outputs DescriptorSet {SET}
OpDecorate %outputs Binding {OUTPUTS}
OpDecorate %call DescriptorSet {SET}
OpDecorate %call Binding {CALL}
"
    )
}

const FIXED_TYPES: &str = "%void = OpTypeVoid
%nothing = OpTypeFunction %void
%bool = OpTypeBool
%int = OpTypeInt 32 1
%uint = OpTypeInt 32 0
%float = OpTypeFloat 32
%u0 = OpConstant %uint 0
%u1 = OpConstant %uint 1
%u2 = OpConstant %uint 2
%u3 = OpConstant %uint 3
%u31 = OpConstant %uint 31
%uvec3 = OpTypeVector %uint 3
%ptr_uvec3 = OpTypePointer Input %uvec3
%ptr_input_uint = OpTypePointer Input %uint
%id = OpVariable %ptr_uvec3 Input
%call_block = OpTypeStruct %uint %uint %uint %uint
%ptr_call = OpTypePointer Uniform %call_block
%ptr_call_uint = OpTypePointer Uniform %uint
%call = OpVariable %ptr_call Uniform
";

/// What a buffer is an array of; `%element` is a word or a pair of them.
const fn element(precision: Precision) -> &'static str {
    match precision {
        Precision::F32 => "",
        Precision::F64 => "%double = OpTypeFloat 64\n%element = OpTypeVector %uint 2\n",
    }
}

const BUFFERS: &str = "%elements = OpTypeRuntimeArray %element
%buffer = OpTypeStruct %elements
%ptr_buffer = OpTypePointer StorageBuffer %buffer
%ptr_element = OpTypePointer StorageBuffer %element
%inputs = OpVariable %ptr_buffer StorageBuffer
%outputs = OpVariable %ptr_buffer StorageBuffer
";
