//! What must hold of a finished module and `spirv-val` does not ask for. Looks at the module alone; knows nothing of the
//! graph that it came from.

use rspirv::dr::{self, Instruction, Operand};
use rspirv::spirv::{BuiltIn, Capability, Decoration, ExecutionMode, GlslStd450Op, Op, Word};
use rustc_hash::{FxHashMap, FxHashSet};

use super::text::load;
use crate::{EmitError, WORKGROUP};

/// Checks what `spirv-val` does not: that no two buffers share a binding, that an entry point knows its invocation and
/// has the promised workgroup, that nothing is stored where it must not be, that no linkage is left in a kernel, and that
/// arithmetic is neither relaxed, contracted nor left to the device.
///
/// # Errors
/// The first rule that is broken.
pub fn lint(bytes: &[u8]) -> Result<(), EmitError> {
    check(&load(bytes)?)
}

/// Checks a module.
pub fn check(module: &dr::Module) -> Result<(), EmitError> {
    let decorated = Decorated::of(module)?;
    bindings(module, &decorated)?;
    linkage(module, &decorated)?;
    entry_points(module, &decorated)?;
    instructions(module, &decorated)?;
    stores(module, &decorated)
}

fn broken<T>(what: String) -> Result<T, EmitError> {
    Err(EmitError::Lint(what))
}

/// Where decorations are.
#[derive(Default)]
struct Decorated {
    exact: FxHashSet<Word>,
    /// Variables, and structs with such a member.
    read_only: FxHashSet<Word>,
    sets: FxHashMap<Word, u32>,
    bindings: FxHashMap<Word, u32>,
    invocations: FxHashSet<Word>,
    linked: bool,
}

impl Decorated {
    fn of(module: &dr::Module) -> Result<Self, EmitError> {
        let mut this = Self::default();
        for annotation in &module.annotations {
            let mut operands = annotation.operands.iter();
            let Some(Operand::IdRef(target)) = operands.next() else { continue };
            let mut operands = operands.skip(usize::from(annotation.class.opcode == Op::MemberDecorate));
            let Some(Operand::Decoration(decoration)) = operands.next() else { continue };
            match (decoration, operands.next()) {
                (Decoration::RelaxedPrecision, _) => {
                    return broken(format!("%{target} is decorated RelaxedPrecision"));
                }
                (Decoration::FPFastMathMode, _) => return broken(format!("%{target} is decorated FPFastMathMode")),
                (Decoration::NoContraction, _) => _ = this.exact.insert(*target),
                (Decoration::NonWritable, _) => _ = this.read_only.insert(*target),
                (Decoration::DescriptorSet, Some(Operand::LiteralBit32(set))) => _ = this.sets.insert(*target, *set),
                (Decoration::Binding, Some(Operand::LiteralBit32(at))) => _ = this.bindings.insert(*target, *at),
                (Decoration::BuiltIn, Some(Operand::BuiltIn(BuiltIn::GlobalInvocationId))) => {
                    this.invocations.insert(*target);
                }
                (Decoration::LinkageAttributes, _) => this.linked = true,
                _ => {}
            }
        }
        Ok(this)
    }
}

fn bindings(module: &dr::Module, decorated: &Decorated) -> Result<(), EmitError> {
    let mut taken = FxHashMap::default();
    for variable in module.types_global_values.iter().filter_map(|global| global.result_id) {
        let Some(binding) = decorated.bindings.get(&variable) else { continue };
        let Some(set) = decorated.sets.get(&variable) else {
            return broken(format!("%{variable} has a binding in no descriptor set"));
        };
        if let Some(other) = taken.insert((*set, *binding), variable) {
            return broken(format!("%{other} and %{variable} share binding {binding} of set {set}"));
        }
    }
    Ok(())
}

fn linkage(module: &dr::Module, decorated: &Decorated) -> Result<(), EmitError> {
    let declared = module.capabilities.iter().any(|c| c.operands.contains(&Operand::Capability(Capability::Linkage)));
    match module.entry_points.is_empty() {
        false if declared || decorated.linked => broken("a module with an entry point has Linkage".to_owned()),
        true if !declared || !decorated.linked => {
            broken("a module has neither an entry point nor a function to link".to_owned())
        }
        _ => Ok(()),
    }
}

fn entry_points(module: &dr::Module, decorated: &Decorated) -> Result<(), EmitError> {
    for entry in &module.entry_points {
        let mut operands = entry.operands.iter().skip(1);
        let Some(Operand::IdRef(function)) = operands.next() else { continue };
        let knows = operands.any(|x| matches!(x, Operand::IdRef(x) if decorated.invocations.contains(x)));
        if !knows {
            return broken(format!("the entry point %{function} has no variable for GlobalInvocationId"));
        }
        let size = [WORKGROUP, 1, 1].map(Operand::LiteralBit32);
        let mut modes =
            module.execution_modes.iter().filter(|m| m.operands.first() == Some(&Operand::IdRef(*function)));
        let right = modes.any(|mode| {
            mode.operands.get(1) == Some(&Operand::ExecutionMode(ExecutionMode::LocalSize))
                && mode.operands.get(2..) == Some(&size)
        });
        if !right {
            return broken(format!("the entry point %{function} does not have workgroups of {WORKGROUP} invocations"));
        }
    }
    Ok(())
}

/// Instructions of GLSL.std.450 that all devices compute alike.
const EXTENDED: [GlslStd450Op; 8] = [
    GlslStd450Op::Sqrt,
    GlslStd450Op::FAbs,
    GlslStd450Op::Floor,
    GlslStd450Op::Ceil,
    GlslStd450Op::Trunc,
    GlslStd450Op::SMin,
    GlslStd450Op::SMax,
    GlslStd450Op::UMin,
];

fn instructions(module: &dr::Module, decorated: &Decorated) -> Result<(), EmitError> {
    for instruction in module.functions.iter().flat_map(dr::Function::all_inst_iter) {
        let code = instruction.class.opcode;
        match code {
            Op::FAdd | Op::FSub | Op::FMul | Op::FDiv | Op::FNegate => {
                let id = instruction.result_id.unwrap_or_default();
                if !decorated.exact.contains(&id) {
                    return broken(format!("%{id} (Op{code:?}) is not decorated NoContraction"));
                }
            }
            // Not computed alike everywhere, or undefined for some operands.
            Op::FMod
            | Op::FRem
            | Op::SRem
            | Op::SMod
            | Op::Dot
            | Op::VectorTimesScalar
            | Op::VectorTimesMatrix
            | Op::MatrixTimesScalar
            | Op::MatrixTimesVector
            | Op::MatrixTimesMatrix
            | Op::OuterProduct => return broken(format!("Op{code:?} is written")),
            Op::ExtInst => {
                let number = instruction.operands.get(1);
                if !EXTENDED.iter().any(|x| number == Some(&Operand::LiteralExtInstInteger(*x as u32))) {
                    return broken(format!("the extended instruction {} is written", name(number)));
                }
            }
            _ => {}
        }
    }
    Ok(())
}

fn name(number: Option<&Operand>) -> String {
    match number {
        Some(Operand::LiteralExtInstInteger(x)) => {
            GlslStd450Op::from_u32(*x).map_or_else(|| x.to_string(), |op| format!("{op:?}"))
        }
        _ => "?".to_owned(),
    }
}

fn stores(module: &dr::Module, decorated: &Decorated) -> Result<(), EmitError> {
    // What a variable points to, by its type.
    let mut pointees = FxHashMap::default();
    let mut read_only = FxHashSet::default();
    for global in &module.types_global_values {
        let Some(id) = global.result_id else { continue };
        match (global.class.opcode, operand_id(global, 1)) {
            (Op::TypePointer, Some(to)) => _ = pointees.insert(id, to),
            (Op::Variable, _) => {
                let of = global.result_type.and_then(|of| pointees.get(&of));
                if decorated.read_only.contains(&id) || of.is_some_and(|of| decorated.read_only.contains(of)) {
                    read_only.insert(id);
                }
            }
            _ => {}
        }
    }
    for instruction in module.functions.iter().flat_map(dr::Function::all_inst_iter) {
        let Some(pointer) = operand_id(instruction, 0) else { continue };
        match (instruction.class.opcode, instruction.result_id) {
            (Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject, Some(id)) if read_only.contains(&pointer) => {
                read_only.insert(id);
            }
            (Op::Store | Op::CopyMemory, _) if read_only.contains(&pointer) => {
                return broken(format!("a store to %{pointer}, which is NonWritable"));
            }
            _ => {}
        }
    }
    Ok(())
}

fn operand_id(instruction: &Instruction, place: usize) -> Option<Word> {
    match instruction.operands.get(place) {
        Some(Operand::IdRef(id)) => Some(*id),
        _ => None,
    }
}
