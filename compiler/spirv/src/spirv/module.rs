//! A module under construction: its sections, its numbers, its types and constants once each, and the blocks of the
//! function that is being written. Knows the rules of SPIR-V on what stands where; knows nothing of graphs.

use isograd_graph::{Precision, Scalar};
use rspirv::dr::{self, Instruction, Operand};
use rspirv::spirv::{self, AddressingModel, Capability, Decoration, MemoryModel, Op, StorageClass, Word};
use rustc_hash::FxHashMap;

use crate::program::Kind;
use crate::{EmitError, Lack, Language};

/// The largest number that a value may have (SPIR-V 2.17).
const LARGEST_ID: Word = 4_194_303;

/// A module under construction.
pub struct Writer {
    /// What reals are.
    pub precision: Precision,
    module: dr::Module,
    next: Word,
    /// Types and constants, by what they are.
    shared: FxHashMap<(Op, Option<Word>, Vec<Operand>), Word>,
    /// The types of the kinds.
    kinds: [Option<Word>; 4],
    /// The instruction set GLSL.std.450.
    glsl: Word,
    /// The function that is being written.
    function: dr::Function,
    /// Its variables, which stand before all else in its first block.
    variables: Vec<Instruction>,
    block: dr::Block,
}

impl From<Scalar> for Kind {
    fn from(scalar: Scalar) -> Self {
        match scalar {
            Scalar::Real => Self::Real,
            Scalar::Int => Self::Int,
            Scalar::Bool => Self::Bool,
        }
    }
}

/// Ids as operands.
pub fn ids(ids: &[Word]) -> Vec<Operand> {
    ids.iter().copied().map(Operand::IdRef).collect()
}

impl Writer {
    /// A module with nothing in it.
    pub fn new(precision: Precision) -> Self {
        let mut this = Self {
            precision,
            module: dr::Module::new(),
            next: 1,
            shared: FxHashMap::default(),
            kinds: [None; 4],
            glsl: 0,
            function: dr::Function::new(),
            variables: Vec::new(),
            block: dr::Block::new(),
        };
        this.capability(Capability::Shader);
        if precision == Precision::F64 {
            this.capability(Capability::Float64);
            this.capability(Capability::Int64);
        }
        this.glsl = this.id();
        let set = Operand::LiteralString("GLSL.std.450".to_owned());
        this.module.ext_inst_imports.push(Instruction::new(Op::ExtInstImport, None, Some(this.glsl), vec![set]));
        this.module.memory_model = Some(Instruction::new(
            Op::MemoryModel,
            None,
            None,
            vec![AddressingModel::Logical.into(), MemoryModel::GLSL450.into()],
        ));
        this
    }

    /// The module.
    ///
    /// # Errors
    /// If it has more values than SPIR-V can number.
    pub fn finish(mut self) -> Result<dr::Module, EmitError> {
        if self.next > LARGEST_ID {
            return Err(EmitError::Unsupported { target: Language::Spirv, lack: Lack::Values, node: None });
        }
        let mut header = dr::ModuleHeader::new(self.next);
        header.set_version(1, 3);
        self.module.header = Some(header);
        Ok(self.module)
    }

    /// A new number.
    pub const fn id(&mut self) -> Word {
        let id = self.next;
        self.next = id.saturating_add(1);
        id
    }

    /// Declares a capability.
    pub fn capability(&mut self, capability: Capability) {
        self.module.capabilities.push(Instruction::new(Op::Capability, None, None, vec![capability.into()]));
    }

    /// Declares a function as the entry point of a kernel.
    pub fn entry(&mut self, function: Word, name: &str, interface: &[Word], workgroup: u32) {
        let mut operands = vec![spirv::ExecutionModel::GLCompute.into(), Operand::IdRef(function), name.into()];
        operands.extend(ids(interface));
        self.module.entry_points.push(Instruction::new(Op::EntryPoint, None, None, operands));
        let mut operands = vec![Operand::IdRef(function), spirv::ExecutionMode::LocalSize.into()];
        operands.extend([workgroup, 1, 1].map(Operand::LiteralBit32));
        self.module.execution_modes.push(Instruction::new(Op::ExecutionMode, None, None, operands));
    }

    /// Names something.
    pub fn name(&mut self, id: Word, name: &str) {
        let operands = vec![Operand::IdRef(id), name.into()];
        self.module.debug_names.push(Instruction::new(Op::Name, None, None, operands));
    }

    /// Names a member of a struct.
    pub fn name_member(&mut self, id: Word, member: u32, name: &str) {
        let operands = vec![Operand::IdRef(id), Operand::LiteralBit32(member), name.into()];
        self.module.debug_names.push(Instruction::new(Op::MemberName, None, None, operands));
    }

    /// Decorates something.
    pub fn decorate(&mut self, id: Word, decoration: Decoration, extra: Vec<Operand>) {
        let mut operands = vec![Operand::IdRef(id), decoration.into()];
        operands.extend(extra);
        self.module.annotations.push(Instruction::new(Op::Decorate, None, None, operands));
    }

    /// Decorates a member of a struct.
    pub fn decorate_member(&mut self, id: Word, member: u32, decoration: Decoration, extra: Vec<Operand>) {
        let mut operands = vec![Operand::IdRef(id), Operand::LiteralBit32(member), decoration.into()];
        operands.extend(extra);
        self.module.annotations.push(Instruction::new(Op::MemberDecorate, None, None, operands));
    }

    /// A type, constant or variable of its own, even if there is one like it.
    pub fn global(&mut self, op: Op, result_type: Option<Word>, operands: Vec<Operand>) -> Word {
        let id = self.id();
        self.module.types_global_values.push(Instruction::new(op, result_type, Some(id), operands));
        id
    }

    /// The type or constant that is this.
    pub fn shared(&mut self, op: Op, result_type: Option<Word>, operands: Vec<Operand>) -> Word {
        let key = (op, result_type, operands);
        if let Some(id) = self.shared.get(&key) {
            return *id;
        }
        let id = self.global(op, result_type, key.2.clone());
        self.shared.insert(key, id);
        id
    }

    /// The type of a kind.
    pub fn kind(&mut self, kind: Kind) -> Word {
        let place = match kind {
            Kind::Real => 0,
            Kind::Int => 1,
            Kind::Wide => 2,
            Kind::Bool => 3,
        };
        if let Some(id) = self.kinds.get(place).copied().flatten() {
            return id;
        }
        let bits = Operand::LiteralBit32(self.precision.bytes() * 8);
        let signed = Operand::LiteralBit32(1);
        let id = match kind {
            Kind::Real => self.shared(Op::TypeFloat, None, vec![bits]),
            Kind::Int => self.shared(Op::TypeInt, None, vec![Operand::LiteralBit32(32), signed]),
            Kind::Wide => self.shared(Op::TypeInt, None, vec![bits, signed]),
            Kind::Bool => self.shared(Op::TypeBool, None, vec![]),
        };
        if let Some(entry) = self.kinds.get_mut(place) {
            *entry = Some(id);
        }
        id
    }

    /// The type of unsigned ints of so many bits.
    pub fn unsigned(&mut self, bits: u32) -> Word {
        self.shared(Op::TypeInt, None, vec![Operand::LiteralBit32(bits), Operand::LiteralBit32(0)])
    }

    /// The type of pointers.
    pub fn pointer(&mut self, class: StorageClass, to: Word) -> Word {
        self.shared(Op::TypePointer, None, vec![class.into(), Operand::IdRef(to)])
    }

    /// The type of functions.
    pub fn function_type(&mut self, result: Word, parameters: &[Word]) -> Word {
        let mut operands = ids(&[result]);
        operands.extend(ids(parameters));
        self.shared(Op::TypeFunction, None, operands)
    }

    /// An int.
    pub fn int(&mut self, x: i32) -> Word {
        let kind = self.kind(Kind::Int);
        self.shared(Op::Constant, Some(kind), vec![Operand::LiteralBit32(x.cast_unsigned())])
    }

    /// An unsigned int of 32 bits.
    pub fn uint(&mut self, x: u32) -> Word {
        let kind = self.unsigned(32);
        self.shared(Op::Constant, Some(kind), vec![Operand::LiteralBit32(x)])
    }

    /// A constant as wide as a real, by its bits.
    #[expect(clippy::cast_possible_truncation, reason = "constants of f32 modules have 32 bits")]
    pub fn bits(&mut self, kind: Word, bits: u64) -> Word {
        let operand = match self.precision {
            Precision::F32 => Operand::LiteralBit32(bits as u32),
            Precision::F64 => Operand::LiteralBit64(bits),
        };
        self.shared(Op::Constant, Some(kind), vec![operand])
    }

    /// An int as wide as a real.
    pub fn wide(&mut self, x: i64) -> Word {
        let kind = self.kind(Kind::Wide);
        self.bits(kind, x.cast_unsigned())
    }

    /// A real.
    #[expect(clippy::cast_possible_truncation, reason = "constants of an f32 graph are f32 numbers")]
    pub fn real(&mut self, x: f64) -> Word {
        let kind = self.kind(Kind::Real);
        let bits = match self.precision {
            Precision::F32 => u64::from((x as f32).to_bits()),
            Precision::F64 => x.to_bits(),
        };
        self.bits(kind, bits)
    }

    /// A truth value.
    pub fn truth(&mut self, x: bool) -> Word {
        let kind = self.kind(Kind::Bool);
        self.shared(if x { Op::ConstantTrue } else { Op::ConstantFalse }, Some(kind), vec![])
    }

    /// Begins a function: its number, and those of its parameters. One without a block is a declaration.
    pub fn begin_function(&mut self, result: Word, parameters: &[Word]) -> (Word, Vec<Word>) {
        let function_type = self.function_type(result, parameters);
        let id = self.id();
        let operands = vec![spirv::FunctionControl::NONE.into(), Operand::IdRef(function_type)];
        self.function.def = Some(Instruction::new(Op::Function, Some(result), Some(id), operands));
        let mut names = Vec::with_capacity(parameters.len());
        for parameter in parameters {
            let id = self.id();
            names.push(id);
            self.function.parameters.push(Instruction::new(Op::FunctionParameter, Some(*parameter), Some(id), vec![]));
        }
        (id, names)
    }

    /// Ends the function.
    pub fn end_function(&mut self) {
        let mut function = std::mem::take(&mut self.function);
        function.end = Some(Instruction::new(Op::FunctionEnd, None, None, vec![]));
        if let Some(first) = function.blocks.first_mut() {
            first.instructions.splice(..0, self.variables.drain(..));
        }
        self.module.functions.push(function);
    }

    /// A variable of the function.
    pub fn variable(&mut self, of: Word) -> Word {
        let pointer = self.pointer(StorageClass::Function, of);
        let id = self.id();
        let class = StorageClass::Function.into();
        self.variables.push(Instruction::new(Op::Variable, Some(pointer), Some(id), vec![class]));
        id
    }

    /// Begins a block.
    pub fn begin_block(&mut self, label: Word) {
        self.block.label = Some(Instruction::new(Op::Label, None, Some(label), vec![]));
    }

    /// The label of the open block.
    pub fn label(&self) -> Word {
        self.block.label_id().unwrap_or_default()
    }

    /// Ends the open block.
    pub fn terminate(&mut self, op: Op, operands: Vec<Operand>) {
        self.effect(op, operands);
        self.function.blocks.push(std::mem::take(&mut self.block));
    }

    /// An instruction without a result.
    pub fn effect(&mut self, op: Op, operands: Vec<Operand>) {
        self.block.instructions.push(Instruction::new(op, None, None, operands));
    }

    /// An instruction with a result.
    pub fn push(&mut self, op: Op, result_type: Word, operands: Vec<Operand>) -> Word {
        let id = self.id();
        self.block.instructions.push(Instruction::new(op, Some(result_type), Some(id), operands));
        id
    }

    /// An instruction on values.
    pub fn compute(&mut self, op: Op, result: Kind, operands: &[Word]) -> Word {
        let result = self.kind(result);
        self.push(op, result, ids(operands))
    }

    /// An instruction of GLSL.std.450.
    pub fn extended(&mut self, op: spirv::GlslStd450Op, result_type: Word, operands: &[Word]) -> Word {
        let mut all = vec![Operand::IdRef(self.glsl), Operand::LiteralExtInstInteger(op as u32)];
        all.extend(ids(operands));
        self.push(Op::ExtInst, result_type, all)
    }

    /// Adds to a phi, at this place of an ended block, what it is after another block.
    pub fn extend_phi(&mut self, block: usize, place: usize, value: Word, from: Word) {
        let block = self.function.blocks.get_mut(block);
        if let Some(phi) = block.and_then(|block| block.instructions.get_mut(place)) {
            phi.operands.extend(ids(&[value, from]));
        }
    }

    /// How many blocks of the function are ended.
    pub const fn blocks(&self) -> usize {
        self.function.blocks.len()
    }

    /// Whether an element of a buffer is as wide as two ints.
    pub fn is_wide(&self) -> bool {
        self.precision == Precision::F64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_number_four_million_values() {
        for (bound, fits) in [(LARGEST_ID, true), (LARGEST_ID + 1, false)] {
            let mut out = Writer::new(Precision::F32);
            out.next = bound - 1;
            out.id();
            let lack = EmitError::Unsupported { target: Language::Spirv, lack: Lack::Values, node: None };
            let finished = out.finish().map(|module| module.header.map(|header| header.bound));
            assert_eq!(finished, if fits { Ok(Some(bound)) } else { Err(lack) });
        }
    }

    /// ±0 and NaNs of other bits are other numbers; what is the same number is one constant.
    #[test]
    fn constants_are_shared_by_their_bits() {
        for precision in [Precision::F32, Precision::F64] {
            let mut out = Writer::new(precision);
            let reals = [0.0, -0.0, 1.0, f64::INFINITY, f64::NAN, -f64::NAN];
            let once = reals.map(|x| out.real(x));
            assert_eq!(reals.map(|x| out.real(x)), once);
            let distinct: std::collections::BTreeSet<Word> = once.into_iter().collect();
            assert_eq!(distinct.len(), reals.len());
            assert_ne!(out.int(0), out.uint(0));
            assert_eq!(out.wide(-3) == out.int(-3), precision == Precision::F32);
        }
    }
}
