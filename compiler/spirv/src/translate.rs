//! Other shading languages, translated from the WGSL by naga: a convenience. Knows where each binding goes; knows nothing
//! of graphs.
//!
//! | | entry point | `inputs` | `outputs` | `call` | `uniforms` |
//! |---|---|---|---|---|---|
//! | GLSL 4.50 | `main` | binding 0 | binding 1 | binding 2 | binding 3 |
//! | HLSL, shader model 6.0 | `main` | `t0` | `u1` | `b2` | `t3` |
//! | MSL 2.4 | `main_` | buffer 0 | buffer 1 | buffer 2 | buffer 3 |
//!
//! Numbers are those of [`INPUTS`], [`OUTPUTS`], [`CALL`] and [`UNIFORMS`]; registers of HLSL are in space 0. A kernel in MSL
//! names one more buffer, [`SIZES`], that it does not read: nothing need be bound to it.

use std::fmt::{Display, Write};

use naga::back::{glsl, hlsl, msl};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Module, ResourceBinding, ShaderStage};

use crate::{CALL, ENTRY, EmitError, Form, INPUTS, Lack, Language, OUTPUTS, Plan, SET, UNIFORMS, WORKGROUP};

/// Operations of a program that is translated: naga takes half a second for so many, and four times that for twice as
/// many, and nothing can interrupt it.
const OPERATIONS: usize = 16_384;

/// The buffer of MSL that naga has for the lengths of the others.
const SIZES: u8 = 4;

/// A language that WGSL is translated to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dialect {
    /// GLSL 4.50.
    Glsl,
    /// HLSL, shader model 6.0.
    Hlsl,
    /// The Metal Shading Language 2.4.
    Msl,
}

impl Dialect {
    const fn title(self) -> &'static str {
        match self {
            Self::Glsl => "GLSL 4.50",
            Self::Hlsl => "HLSL of shader model 6.0",
            Self::Msl => "MSL 2.4",
        }
    }
}

impl Plan<'_> {
    /// The shader in another language.
    ///
    /// # Errors
    /// If WGSL or the language cannot do what the graph asks for.
    pub fn translated(&self, dialect: Dialect) -> Result<String, EmitError> {
        let count = self.work().operations;
        if count > OPERATIONS {
            let lack = Lack::Translated { count, most: OPERATIONS };
            return Err(EmitError::Unsupported { target: Language::Wgsl, lack, node: None });
        }
        let mut wgsl = self.wgsl()?;
        let library = matches!(self.form, Form::Library(_));
        if library && dialect == Dialect::Glsl {
            // naga writes GLSL of entry points only; this one is taken out of the text again.
            let _ = write!(wgsl, "\n@compute @workgroup_size(1)\nfn {ENTRY}() {{}}\n");
        }
        let module = naga::front::wgsl::parse_str(&wgsl).map_err(|error| failed(error.emit_to_string(&wgsl)))?;
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .map_err(|error| failed(error.emit_to_string(&wgsl)))?;
        let text = match dialect {
            Dialect::Glsl => glsl(&module, &info, library)?,
            Dialect::Hlsl => hlsl(&module, &info)?,
            Dialect::Msl => msl(&module, &info)?,
        };
        Ok(format!("{}\n{}\n", self.header(dialect), text.trim()))
    }

    fn header(&self, dialect: Dialect) -> String {
        let mut out = format!(
            "// {}, translated by naga from the WGSL that Isograd makes: a convenience. How operations are rounded, fused\n\
             // and reordered is up to compilers of this language, so results are not reproducible bit by bit. Names that\n\
             // end in a digit or mean something in this language have an underscore behind.\n",
            dialect.title()
        );
        if matches!(self.form, Form::Library(_)) {
            return out;
        }
        let layout = self.layout();
        let has = |varying| layout.inputs.iter().any(|slot| slot.varying == varying);
        let bindings = [
            ("inputs", INPUTS, 't', has(true)),
            ("outputs", OUTPUTS, 'u', !layout.outputs.is_empty()),
            ("call", CALL, 'b', true),
            ("uniforms", UNIFORMS, 't', has(false)),
        ];
        out.push_str("//\n");
        for (name, number, register, _) in bindings.iter().filter(|binding| binding.3) {
            let _ = match dialect {
                Dialect::Glsl => writeln!(out, "// {name}: binding {number}"),
                Dialect::Hlsl => writeln!(out, "// {name}: register {register}{number}"),
                Dialect::Msl => writeln!(out, "// {name}: buffer {number}"),
            };
        }
        let _ = match dialect {
            Dialect::Glsl | Dialect::Hlsl => {
                writeln!(out, "// entry point: {ENTRY}, {WORKGROUP} invocations to a group")
            }
            Dialect::Msl => writeln!(
                out,
                "// entry point: {ENTRY}_, to be dispatched with {WORKGROUP} threads to a group; buffer {SIZES} is not read"
            ),
        };
        out
    }
}

fn failed(why: impl Display) -> EmitError {
    EmitError::Translation(why.to_string())
}

/// The bindings of a kernel.
fn bindings() -> [(ResourceBinding, u8); 4] {
    [INPUTS, OUTPUTS, CALL, UNIFORMS]
        .map(|binding| (ResourceBinding { group: SET, binding }, u8::try_from(binding).unwrap_or(u8::MAX)))
}

/// In HLSL and MSL tapes are read within their bounds only; buffers are as large as the layout says.
const POLICIES: BoundsCheckPolicies = BoundsCheckPolicies {
    index: BoundsCheckPolicy::Restrict,
    buffer: BoundsCheckPolicy::Unchecked,
    image_load: BoundsCheckPolicy::Unchecked,
    binding_array: BoundsCheckPolicy::Unchecked,
};

fn glsl(module: &Module, info: &ModuleInfo, library: bool) -> Result<String, EmitError> {
    let options = glsl::Options {
        version: glsl::Version::Desktop(450),
        writer_flags: glsl::WriterFlags::empty(),
        binding_map: bindings().into_iter().collect(),
        zero_initialize_workgroup_memory: false,
    };
    let pipeline =
        glsl::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point: ENTRY.to_owned(), multiview: None };
    let mut text = String::new();
    glsl::Writer::new(&mut text, module, info, &options, &pipeline, POLICIES)
        .and_then(|mut writer| writer.write())
        .map_err(failed)?;
    if library {
        let functions = text.rsplit_once("void main()").map_or(text.as_str(), |(before, _)| before);
        let own = |line: &&str| !line.starts_with('#') && !line.starts_with("layout(local_size");
        text = functions.lines().filter(own).flat_map(|line| [line, "\n"]).collect();
    }
    Ok(text)
}

fn hlsl(module: &Module, info: &ModuleInfo) -> Result<String, EmitError> {
    let target = |(binding, register): (ResourceBinding, u8)| {
        (binding, hlsl::BindTarget { register: u32::from(register), ..hlsl::BindTarget::default() })
    };
    let options = hlsl::Options {
        shader_model: hlsl::ShaderModel::V6_0,
        binding_map: bindings().into_iter().map(target).collect(),
        fake_missing_bindings: false,
        force_loop_bounding: false,
        ..hlsl::Options::default()
    };
    let mut text = String::new();
    hlsl::Writer::new(&mut text, &options, &hlsl::PipelineOptions::default())
        .write(module, info, None)
        .map_err(failed)?;
    Ok(text)
}

fn msl(module: &Module, info: &ModuleInfo) -> Result<String, EmitError> {
    let target = |(binding, slot): (ResourceBinding, u8)| {
        let mutable = binding.binding == OUTPUTS;
        (binding, msl::BindTarget { buffer: Some(slot), mutable, ..msl::BindTarget::default() })
    };
    let resources = msl::EntryPointResources {
        resources: bindings().into_iter().map(target).collect(),
        immediates_buffer: None,
        sizes_buffer: Some(SIZES),
    };
    let options = msl::Options {
        lang_version: (2, 4),
        per_entry_point_map: [(ENTRY.to_owned(), resources)].into_iter().collect(),
        fake_missing_bindings: false,
        bounds_check_policies: POLICIES,
        zero_initialize_workgroup_memory: false,
        force_loop_bounding: false,
        emit_int_div_checks: false,
        ..msl::Options::default()
    };
    let mut writer = msl::Writer::new(String::new());
    writer.write(module, info, &options, &msl::PipelineOptions::default()).map_err(failed)?;
    Ok(writer.finish())
}
