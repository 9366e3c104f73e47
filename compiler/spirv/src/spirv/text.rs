//! Modules read back: from bytes, and as assembly text. Knows nothing of how they were written.

use rspirv::binary::Disassemble;
use rspirv::dr;
use rspirv::spirv::Op;
use rustc_hash::FxHashSet;

use crate::EmitError;

/// A module from its bytes.
pub fn load(bytes: &[u8]) -> Result<dr::Module, EmitError> {
    let module = dr::load_bytes(bytes).map_err(|error| EmitError::Lint(format!("it is no SPIR-V module: {error}")))?;
    if module.header.is_none() {
        return Err(EmitError::Lint("it is no SPIR-V module: it has no header".to_owned()));
    }
    Ok(module)
}

/// A module as assembly text: one instruction a line.
///
/// # Errors
/// If it is no SPIR-V module.
pub fn disassemble(bytes: &[u8]) -> Result<String, EmitError> {
    let module = load(bytes)?;
    // rspirv writes a constant as its type says and panics where that is no number.
    let mut numbers = FxHashSet::default();
    for global in &module.types_global_values {
        match (global.class.opcode, global.result_type) {
            (Op::TypeInt | Op::TypeFloat, _) => _ = numbers.insert(global.result_id),
            (Op::Constant, of) if !numbers.contains(&of) => {
                return Err(EmitError::Lint("it has a constant that is no number".to_owned()));
            }
            _ => {}
        }
    }
    let mut text = module.disassemble();
    text.push('\n');
    Ok(text)
}
