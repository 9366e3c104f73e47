//! SPIR-V 1.3 of a plan: which form is written, and what holds of every module that leaves. Knows nothing of WGSL.
//!
//! `module` keeps the sections of a module, `values` and `regions` turn the nodes of the graph into instructions, `kernel`
//! and `library` put the doors around them, `lints` looks at the finished module.

mod kernel;
mod library;
mod lints;
mod module;
mod regions;
mod text;
mod values;

use rspirv::binary::Assemble;
use rspirv::dr;

use crate::{EmitError, Form, Language, Plan};

pub use lints::lint;
pub use text::disassemble;

/// How deep constructs may nest in a function (SPIR-V 2.17).
const NESTING: u32 = 1023;

impl Plan<'_> {
    /// The module, little-endian words.
    ///
    /// A kernel is one that Vulkan 1.1 takes as it is. A library exports the function under its name, for `spirv-link`
    /// and what else understands `Linkage`; drivers must never see it.
    ///
    /// # Errors
    /// If SPIR-V cannot do what the graph asks for.
    pub fn spirv(&self) -> Result<Vec<u8>, EmitError> {
        let module = match &self.form {
            Form::Kernel { .. } => {
                self.nests_within(Language::Spirv, NESTING - kernel::NESTS)?;
                kernel::kernel(self)?
            }
            Form::Library(signature) => {
                self.nests_within(Language::Spirv, NESTING)?;
                library::library(self, signature)?
            }
        };
        lints::check(&module)?;
        Ok(bytes(&module))
    }
}

fn bytes(module: &dr::Module) -> Vec<u8> {
    module.assemble().into_iter().flat_map(u32::to_le_bytes).collect()
}
