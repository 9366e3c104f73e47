//! The door of a kernel: the buffers that a host binds, the point of an invocation, and how values pass between elements
//! of buffers and the nodes of a graph. Knows the documented layout; knows nothing of what is computed.

use isograd_graph::{NodeId, Precision, Scalar};
use rspirv::dr::{self, Operand};
use rspirv::spirv::{BuiltIn, Decoration, Op, SelectionControl, StorageClass, Word};

use super::module::{Writer, ids};
use super::values::Body;
use crate::program::Kind;
use crate::{CALL, ENTRY, EmitError, INPUTS, Layout, OUTPUTS, Plan, SET, Slot, UNIFORMS, WORKGROUP};

/// How deep the door nests: the question whether there is a point.
pub const NESTS: u32 = 1;

/// Writes a kernel.
pub fn kernel(plan: &Plan<'_>) -> Result<dr::Module, EmitError> {
    let mut out = Writer::new(plan.layout().precision);
    let mut door = Door::open(&mut out, plan.layout());
    let mut inputs = Vec::with_capacity(plan.graph.inputs.len());
    for ((index, input), slot) in (0..).zip(&plan.graph.inputs).zip(&plan.layout().inputs) {
        let needed = plan.structure.needed[NodeId(index)];
        inputs.push(if needed { door.load(&mut out, *slot, &input.name) } else { 0 });
    }
    let mut body = Body::write(plan, &mut out, &inputs)?;
    let outputs: Vec<Word> = plan.graph.outputs.iter().map(|output| body.value(output.node)).collect();
    for (slot, value) in plan.layout().outputs.iter().zip(outputs) {
        door.store(&mut out, *slot, value);
    }
    door.close(&mut out);
    out.finish()
}

/// What an invocation has of its host.
pub struct Door {
    /// The type of elements, and of pointers to them.
    element: Word,
    pointer: Word,
    inputs: Option<Word>,
    outputs: Option<Word>,
    uniforms: Option<Word>,
    /// The point of this invocation, and from column to column.
    point: Word,
    input_stride: Word,
    output_stride: Word,
    /// What follows when the point is done.
    done: Word,
}

impl Door {
    /// Declares what the host binds and begins the function of the entry point, where there is a point.
    pub fn open(out: &mut Writer, layout: &Layout) -> Self {
        let bits = out.precision.bytes() * 8;
        let element = out.unsigned(bits);
        let elements = out.shared(Op::TypeRuntimeArray, None, ids(&[element]));
        out.decorate(elements, Decoration::ArrayStride, vec![Operand::LiteralBit32(bits / 8)]);
        let varying = layout.inputs.iter().any(|slot| slot.varying);
        let uniform = layout.inputs.iter().any(|slot| !slot.varying);
        let inputs = varying.then(|| buffer(out, elements, "inputs", INPUTS, true));
        let outputs = (!layout.outputs.is_empty()).then(|| buffer(out, elements, "outputs", OUTPUTS, false));
        let uniforms = uniform.then(|| buffer(out, elements, "uniforms", UNIFORMS, true));
        let call = call_block(out);
        let pointer = out.pointer(StorageClass::StorageBuffer, element);

        let uint = out.unsigned(32);
        let triple = out.shared(Op::TypeVector, None, vec![Operand::IdRef(uint), Operand::LiteralBit32(3)]);
        let input = out.pointer(StorageClass::Input, triple);
        let invocation = out.global(Op::Variable, Some(input), vec![StorageClass::Input.into()]);
        out.name(invocation, "invocation");
        out.decorate(invocation, Decoration::BuiltIn, vec![BuiltIn::GlobalInvocationId.into()]);

        let void = out.shared(Op::TypeVoid, None, vec![]);
        let (main, _) = out.begin_function(void, &[]);
        out.name(main, ENTRY);
        out.entry(main, ENTRY, &[invocation], WORKGROUP);
        let [first, inside, done] = [(); 3].map(|()| out.id());
        out.begin_block(first);
        let triple = out.push(Op::Load, triple, ids(&[invocation]));
        let x = out.push(Op::CompositeExtract, uint, vec![Operand::IdRef(triple), Operand::LiteralBit32(0)]);
        let [count, input_stride, output_stride, base] = CALL_MEMBERS.map(|(member, _)| member_of(out, call, member));
        // Not base + x < count, which could wrap around.
        let begun = out.compute(Op::ULessThan, Kind::Bool, &[base, count]);
        let rest = out.push(Op::ISub, uint, ids(&[count, base]));
        let within = out.compute(Op::ULessThan, Kind::Bool, &[x, rest]);
        let runs = out.compute(Op::LogicalAnd, Kind::Bool, &[begun, within]);
        out.effect(Op::SelectionMerge, vec![Operand::IdRef(done), SelectionControl::NONE.into()]);
        out.terminate(Op::BranchConditional, ids(&[runs, inside, done]));
        out.begin_block(inside);
        let point = out.push(Op::IAdd, uint, ids(&[base, x]));
        Self { element, pointer, inputs, outputs, uniforms, point, input_stride, output_stride, done }
    }

    /// Ends the function of the entry point.
    pub fn close(self, out: &mut Writer) {
        out.terminate(Op::Branch, ids(&[self.done]));
        out.begin_block(self.done);
        out.terminate(Op::Return, vec![]);
        out.end_function();
    }

    /// A pointer to the element of a column at this point.
    fn place(&self, out: &mut Writer, slot: Slot, buffer: Word, stride: Word) -> Word {
        let uint = out.unsigned(32);
        let index = match (slot.varying, slot.column) {
            (false, column) => out.uint(column),
            (true, 0) => self.point,
            (true, 1) => out.push(Op::IAdd, uint, ids(&[stride, self.point])),
            (true, column) => {
                let column = out.uint(column);
                let start = out.push(Op::IMul, uint, ids(&[column, stride]));
                out.push(Op::IAdd, uint, ids(&[start, self.point]))
            }
        };
        let elements = out.uint(0);
        out.push(Op::AccessChain, self.pointer, ids(&[buffer, elements, index]))
    }

    /// Reads an input.
    pub fn load(&mut self, out: &mut Writer, slot: Slot, name: &str) -> Word {
        let buffer = if slot.varying { self.inputs } else { self.uniforms };
        let place = self.place(out, slot, buffer.unwrap_or_default(), self.input_stride);
        let element = out.push(Op::Load, self.element, ids(&[place]));
        let value = match slot.scalar {
            Scalar::Real => out.compute(Op::Bitcast, Kind::Real, &[element]),
            Scalar::Int => {
                let wide = out.compute(Op::Bitcast, Kind::Wide, &[element]);
                if out.is_wide() { out.compute(Op::SConvert, Kind::Int, &[wide]) } else { wide }
            }
            Scalar::Bool => {
                let zero = out.bits(self.element, 0);
                out.compute(Op::INotEqual, Kind::Bool, &[element, zero])
            }
        };
        out.name(value, name);
        value
    }

    /// Writes an output: NaNs with all bits set, bools as 0 or 1.
    pub fn store(&mut self, out: &mut Writer, slot: Slot, value: Word) {
        let element = match slot.scalar {
            Scalar::Real => {
                // A NaN by its bits, as devices need not compare them as they should: larger than infinity, but for the
                // sign.
                let bits = out.push(Op::Bitcast, self.element, ids(&[value]));
                let (ones, infinity) = match out.precision {
                    Precision::F32 => (u64::from(u32::MAX), u64::from(f32::INFINITY.to_bits())),
                    Precision::F64 => (u64::MAX, f64::INFINITY.to_bits()),
                };
                let [magnitude, infinity, ones] = [ones >> 1, infinity, ones].map(|bits| out.bits(self.element, bits));
                let unsigned = out.push(Op::BitwiseAnd, self.element, ids(&[bits, magnitude]));
                let nan = out.compute(Op::UGreaterThan, Kind::Bool, &[unsigned, infinity]);
                out.push(Op::Select, self.element, ids(&[nan, ones, bits]))
            }
            Scalar::Int => {
                let wide = if out.is_wide() { out.compute(Op::SConvert, Kind::Wide, &[value]) } else { value };
                out.push(Op::Bitcast, self.element, ids(&[wide]))
            }
            Scalar::Bool => {
                let (one, zero) = (out.bits(self.element, 1), out.bits(self.element, 0));
                out.push(Op::Select, self.element, ids(&[value, one, zero]))
            }
        };
        let place = self.place(out, slot, self.outputs.unwrap_or_default(), self.output_stride);
        out.effect(Op::Store, ids(&[place, element]));
    }
}

/// Declares a storage buffer of elements.
fn buffer(out: &mut Writer, elements: Word, name: &str, binding: u32, read_only: bool) -> Word {
    // Each buffer has a struct type of its own, as only their decorations differ.
    let block = out.global(Op::TypeStruct, None, ids(&[elements]));
    out.name_member(block, 0, "elements");
    out.decorate(block, Decoration::Block, vec![]);
    out.decorate_member(block, 0, Decoration::Offset, vec![Operand::LiteralBit32(0)]);
    let variable = bound(out, StorageClass::StorageBuffer, block, name, binding);
    if read_only {
        // Tools differ in which of the two they look at.
        out.decorate_member(block, 0, Decoration::NonWritable, vec![]);
        out.decorate(variable, Decoration::NonWritable, vec![]);
    }
    variable
}

/// The members of the block of a call.
const CALL_MEMBERS: [(u32, &str); 4] = [(0, "count"), (1, "input_stride"), (2, "output_stride"), (3, "base")];

fn call_block(out: &mut Writer) -> Word {
    let uint = out.unsigned(32);
    let block = out.global(Op::TypeStruct, None, ids(&[uint; CALL_MEMBERS.len()]));
    out.decorate(block, Decoration::Block, vec![]);
    for (member, name) in CALL_MEMBERS {
        out.name_member(block, member, name);
        out.decorate_member(block, member, Decoration::Offset, vec![Operand::LiteralBit32(member * 4)]);
    }
    bound(out, StorageClass::Uniform, block, "call", CALL)
}

fn bound(out: &mut Writer, class: StorageClass, of: Word, name: &str, binding: u32) -> Word {
    let pointer = out.pointer(class, of);
    let variable = out.global(Op::Variable, Some(pointer), vec![class.into()]);
    out.name(variable, name);
    out.decorate(variable, Decoration::DescriptorSet, vec![Operand::LiteralBit32(SET)]);
    out.decorate(variable, Decoration::Binding, vec![Operand::LiteralBit32(binding)]);
    variable
}

fn member_of(out: &mut Writer, call: Word, member: u32) -> Word {
    let uint = out.unsigned(32);
    let pointer = out.pointer(StorageClass::Uniform, uint);
    let member = out.uint(member);
    let place = out.push(Op::AccessChain, pointer, ids(&[call, member]));
    out.push(Op::Load, uint, ids(&[place]))
}
