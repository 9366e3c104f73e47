//! The step `emit`: a graph to the bytes of its target. Knows which crate writes which target; knows nothing of how a
//! graph came about.

use isograd_graph::{Origin, Precision, Scalar, Verified, Work};
use isograd_spirv::{Group, Signature};
use isograd_syntax::{Code, Diagnostic};
use isograd_wasm::Split;

use crate::seal::Places;
use crate::wanted::{Answer, Wanting};
use crate::{Abi, Argument, Bindings, Buffers, Form, FunctionAbi, Manifest, Memory, Request, Target};

/// A module that may lack its manifest.
pub struct Emitted {
    /// Where its numbers are.
    pub places: Places,
    /// What the work of a point is.
    pub work: Work,
    code: Written,
}

enum Written {
    Wasm(isograd_wasm::Written),
    Whole(Vec<u8>),
}

impl Emitted {
    /// The bytes. WebAssembly contains its manifest; the others are described by it.
    pub fn seal(self, manifest: &Manifest) -> Vec<u8> {
        match self.code {
            Written::Wasm(written) => written.seal(&serde_json::to_vec(manifest).unwrap_or_default()).bytes,
            Written::Whole(bytes) => bytes,
        }
    }
}

/// Refuses what no program could be compiled to, before it is worked on.
pub fn possible(request: &Request) -> Result<(), Diagnostic> {
    let target = request.target.name();
    match (request.target, request.form, request.precision) {
        (Target::Wasm, Form::Library, _) => Err(Diagnostic::global(
            Code::E1102,
            format!("the form `{}` is not made of the target `{target}`", Form::Library.name()),
        )
        .help("a WebAssembly module exports `eval` for many points and `point` for one; leave the form out")),
        (Target::Wgsl | Target::Glsl | Target::Hlsl | Target::Msl, _, Precision::F64) => {
            Err(unsupported(request, &isograd_spirv::Lack::Doubles, None, |code, _, message| {
                Diagnostic::global(code, message)
            }))
        }
        _ => Ok(()),
    }
}

/// Writes the module of a request. `placed` makes a diagnostic at the origin of a node.
pub fn emit(
    graph: &Verified,
    request: &Request,
    wanting: &Wanting,
    placed: impl Fn(Code, Origin, &str) -> Diagnostic,
) -> Result<Emitted, Diagnostic> {
    match request.target {
        Target::Wasm => wasm(graph, request.precision, wanting),
        _ => shader(graph, request, wanting, placed),
    }
}

fn wasm(graph: &Verified, precision: Precision, wanting: &Wanting) -> Result<Emitted, Diagnostic> {
    let options =
        isograd_wasm::Options { precision, varying: &wanting.varying, vectors: None, split: Split::default() };
    let written = isograd_wasm::Plan::new(graph, &options)
        .and_then(isograd_wasm::Plan::write)
        .map_err(|why| unemittable(&why.to_string()))?;
    let layout = &written.layout;
    let slots = |slots: &[isograd_wasm::Slot]| slots.iter().map(|slot| (slot.scalar, slot.offset)).collect();
    let memory = Memory { block: layout.block, pad: layout.pad, memory: layout.memory, scratch: layout.scratch };
    let places = Places { abi: Abi::Memory(memory), inputs: slots(&layout.inputs), outputs: slots(&layout.outputs) };
    Ok(Emitted { places, work: written.work, code: Written::Wasm(written) })
}

fn shader(
    graph: &Verified,
    request: &Request,
    wanting: &Wanting,
    placed: impl Fn(Code, Origin, &str) -> Diagnostic,
) -> Result<Emitted, Diagnostic> {
    let signature;
    let form = match request.form {
        Form::Kernel => isograd_spirv::Form::Kernel { varying: &wanting.varying },
        Form::Library => {
            signature = Signature {
                name: request.export.clone(),
                parameters: wanting.arguments.iter().map(parameter).collect(),
                results: wanting.queries.iter().filter(|answer| !answer.columns.is_empty()).map(result).collect(),
            };
            isograd_spirv::Form::Library(&signature)
        }
    };
    let written = isograd_spirv::Plan::new(graph, form).and_then(|plan| {
        let bytes = match request.target {
            Target::Wasm | Target::Spirv => plan.spirv()?,
            Target::Wgsl => plan.wgsl()?.into_bytes(),
            Target::Glsl => plan.translated(isograd_spirv::Dialect::Glsl)?.into_bytes(),
            Target::Hlsl => plan.translated(isograd_spirv::Dialect::Hlsl)?.into_bytes(),
            Target::Msl => plan.translated(isograd_spirv::Dialect::Msl)?.into_bytes(),
        };
        Ok((bytes, plan.layout().clone(), plan.work()))
    });
    let (bytes, layout, work) = written.map_err(|why| match why {
        isograd_spirv::EmitError::Unsupported { lack, node, .. } => {
            let origin = node.map(|node| graph.origin(node));
            unsupported(request, &lack, origin, placed)
        }
        other => unemittable(&other.to_string()),
    })?;
    let slots = |slots: &[isograd_spirv::Slot]| -> Vec<(Scalar, u32)> {
        slots.iter().map(|slot| (slot.scalar, slot.column)).collect()
    };
    let abi = match request.form {
        Form::Library => {
            let function = match request.target {
                Target::Wasm | Target::Spirv => request.export.clone(),
                Target::Wgsl | Target::Glsl | Target::Hlsl | Target::Msl => isograd_spirv::identifier(&request.export),
            };
            Abi::Function(FunctionAbi { function, tapes: layout.tapes })
        }
        Form::Kernel => {
            let any = |varying| layout.inputs.iter().any(|slot| slot.varying == varying);
            let bindings = Bindings {
                set: isograd_spirv::SET,
                inputs: any(true).then_some(isograd_spirv::INPUTS),
                outputs: isograd_spirv::OUTPUTS,
                call: isograd_spirv::CALL,
                uniforms: any(false).then_some(isograd_spirv::UNIFORMS),
            };
            Abi::Buffers(Buffers {
                entry: isograd_spirv::ENTRY.to_owned(),
                workgroup: isograd_spirv::WORKGROUP,
                element: layout.precision.bytes(),
                bindings,
                tapes: layout.tapes,
            })
        }
    };
    let places = Places { abi, inputs: slots(&layout.inputs), outputs: slots(&layout.outputs) };
    Ok(Emitted { places, work, code: Written::Whole(bytes) })
}

fn parameter(argument: &Argument) -> Group {
    Group { name: argument.name.clone(), scalars: argument.columns.len() }
}

fn result(answer: &Answer) -> Group {
    Group { name: answer.name.clone(), scalars: answer.columns.len() }
}

/// E1101: what the target lacks, at the construct that needs it where there is one.
fn unsupported(
    request: &Request,
    lack: &isograd_spirv::Lack,
    origin: Option<Origin>,
    placed: impl Fn(Code, Origin, &str) -> Diagnostic,
) -> Diagnostic {
    use isograd_spirv::Lack;
    let message = format!("the target `{}` {lack}", request.target.name());
    let diagnostic = match origin {
        Some(origin) => placed(Code::E1101, origin, &message),
        None => Diagnostic::global(Code::E1101, message),
    };
    diagnostic.help(match lack {
        Lack::Doubles => "ask for the precision f32, or for the target `wasm` or `spirv`",
        Lack::Tapes { .. } => {
            "ask for the mode `forward`, which keeps nothing; or shorten the loop; or compile to the target `wasm`"
        }
        Lack::Nesting { .. } => "replace branches that are cheap by `select`, or move loops out of each other",
        Lack::Parameters { .. } => "put parameters together into vectors and tuples, or choose the form `kernel`",
        Lack::Members { .. } => "ask for the queries one by one, or choose the form `kernel`",
        Lack::Variables { .. } => {
            "replace branches that are cheap by `select`, or compile to the target `wasm` or `spirv`"
        }
        Lack::Translated { .. } => "compile to the target `wgsl` or `spirv`, or ask for fewer derivatives at once",
        Lack::Values => "ask for fewer derivatives at once",
    })
}

fn unemittable(why: &str) -> Diagnostic {
    Diagnostic::global(Code::E1103, format!("the module cannot be emitted: {why}"))
}
