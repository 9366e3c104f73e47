//! Broken modules, each in one way, and the lint that notices it.

use isograd_graph::{Precision, Scalar};
use isograd_spirv::lint;
use rspirv::binary::Assemble;
use rspirv::dr::{self, Instruction, Operand};
use rspirv::spirv::{Capability, Decoration, GlslStd450Op, LinkageType, Op};

use crate::garden::graph;
use crate::modules::kernel;

fn module() -> dr::Module {
    let graph = graph(Precision::F32, |b| {
        let (x, y) = (b.input("x", Scalar::Real), b.input("y", Scalar::Real));
        let (n, m) = (b.input("n", Scalar::Int), b.input("m", Scalar::Int));
        let sum = b.add(x, y);
        let root = b.sqrt(sum);
        let quotient = b.idiv(n, m);
        b.output("root", root);
        b.output("quotient", quotient);
    });
    dr::load_bytes(kernel(&graph, &[true, false, true, true])).expect("a module")
}

/// What is said of a module after a change.
fn said(change: impl FnOnce(&mut dr::Module)) -> String {
    let mut module = module();
    change(&mut module);
    let bytes: Vec<u8> = module.assemble().into_iter().flat_map(u32::to_le_bytes).collect();
    lint(&bytes).expect_err("broken").to_string()
}

fn named(module: &dr::Module, name: &str) -> u32 {
    let right = |i: &&Instruction| i.operands.get(1) == Some(&Operand::LiteralString(name.to_owned()));
    let Some(Operand::IdRef(id)) = module.debug_names.iter().find(right).map(|i| i.operands[0].clone()) else {
        panic!("nothing is named {name}")
    };
    id
}

fn instruction(module: &mut dr::Module, op: Op) -> &mut Instruction {
    module.all_inst_iter_mut().find(|i| i.class.opcode == op).expect("an instruction")
}

fn replace(module: &mut dr::Module, op: Op, by: Op) {
    let found = instruction(module, op);
    *found = Instruction::new(by, found.result_type, found.result_id, found.operands.clone());
}

fn decoration(module: &mut dr::Module, of: Decoration) -> &mut Instruction {
    let of = Operand::Decoration(of);
    module.annotations.iter_mut().find(|i| i.operands.contains(&of)).expect("a decoration")
}

#[test]
fn a_sound_module_passes() {
    let bytes: Vec<u8> = module().assemble().into_iter().flat_map(u32::to_le_bytes).collect();
    assert_eq!(lint(&bytes), Ok(()));
    assert!(lint(b"no module").is_err());
}

#[test]
fn two_buffers_on_one_binding() {
    let said = said(|m| {
        let uniforms = named(m, "uniforms");
        for a in &mut m.annotations {
            if a.operands[0] == Operand::IdRef(uniforms) && a.operands[1] == Operand::Decoration(Decoration::Binding) {
                a.operands[2] = Operand::LiteralBit32(1);
            }
        }
    });
    assert!(said.contains("share binding 1 of set 0"), "{said}");
}

#[test]
fn a_binding_in_no_set() {
    let said = said(|m| {
        let at = m.annotations.iter().position(|a| a.operands[1] == Operand::Decoration(Decoration::DescriptorSet));
        m.annotations.remove(at.unwrap());
    });
    assert!(said.contains("in no descriptor set"), "{said}");
}

#[test]
fn an_entry_point_that_does_not_know_its_invocation() {
    let said = said(|m| m.annotations.retain(|a| !a.operands.contains(&Operand::Decoration(Decoration::BuiltIn))));
    assert!(said.contains("GlobalInvocationId"), "{said}");
}

#[test]
fn an_entry_point_without_its_invocation_in_the_interface() {
    let said = said(|m| m.entry_points[0].operands.truncate(3));
    assert!(said.contains("GlobalInvocationId"), "{said}");
}

#[test]
fn a_store_to_what_is_read_only() {
    let into = |m: &mut dr::Module, buffer: &str| {
        let (inputs, outputs) = (named(m, buffer), named(m, "outputs"));
        for i in m.all_inst_iter_mut().filter(|i| i.class.opcode == Op::AccessChain) {
            if i.operands[0] == Operand::IdRef(outputs) {
                i.operands[0] = Operand::IdRef(inputs);
            }
        }
    };
    let (either, name) = (said(|m| into(m, "inputs")), said(|m| into(m, "uniforms")));
    assert!(either.contains("NonWritable") && name.contains("NonWritable"), "{either}");
    // Each of the two decorations is enough.
    for op in [Op::Decorate, Op::MemberDecorate] {
        let said = said(|m| {
            let read_only = Operand::Decoration(Decoration::NonWritable);
            m.annotations.retain(|a| a.class.opcode != op || !a.operands.contains(&read_only));
            into(m, "inputs");
        });
        assert!(said.contains("NonWritable"), "{said}");
    }
}

#[test]
fn linkage_in_a_kernel() {
    let capability = Instruction::new(Op::Capability, None, None, vec![Capability::Linkage.into()]);
    let first = said(|m| m.capabilities.push(capability));
    assert!(first.contains("has Linkage"), "{first}");
    let second = said(|m| {
        let main = named(m, "main");
        let operands =
            vec![Operand::IdRef(main), Decoration::LinkageAttributes.into(), "main".into(), LinkageType::Export.into()];
        m.annotations.push(Instruction::new(Op::Decorate, None, None, operands));
    });
    assert!(second.contains("has Linkage"), "{second}");
}

#[test]
fn neither_an_entry_point_nor_a_function_to_link() {
    let said = said(|m| {
        m.entry_points.clear();
        m.execution_modes.clear();
    });
    assert!(said.contains("neither an entry point nor"), "{said}");
}

#[test]
fn relaxed_or_fast_arithmetic() {
    let relaxed = said(|m| decoration(m, Decoration::NoContraction).operands[1] = Decoration::RelaxedPrecision.into());
    assert!(relaxed.contains("RelaxedPrecision"), "{relaxed}");
    let member = said(|m| {
        let operands = vec![Operand::IdRef(1), Operand::LiteralBit32(0), Decoration::RelaxedPrecision.into()];
        m.annotations.push(Instruction::new(Op::MemberDecorate, None, None, operands));
    });
    assert!(member.contains("RelaxedPrecision"), "{member}");
    let fast = said(|m| {
        let sum = instruction(m, Op::FAdd).result_id.unwrap();
        let mode = Operand::FPFastMathMode(rspirv::spirv::FPFastMathMode::FAST);
        let operands = vec![Operand::IdRef(sum), Decoration::FPFastMathMode.into(), mode];
        m.annotations.push(Instruction::new(Op::Decorate, None, None, operands));
    });
    assert!(fast.contains("FPFastMathMode"), "{fast}");
}

#[test]
fn arithmetic_that_may_be_contracted() {
    let bare = |m: &mut dr::Module| {
        m.annotations.retain(|a| !a.operands.contains(&Operand::Decoration(Decoration::NoContraction)));
    };
    let said_bare = said(bare);
    assert!(said_bare.contains("OpFAdd) is not decorated NoContraction"), "{said_bare}");
    for op in [Op::FSub, Op::FMul, Op::FDiv] {
        let said = said(|m| {
            replace(m, Op::FAdd, op);
            bare(m);
        });
        assert!(said.contains(&format!("Op{op:?}) is not decorated")), "{said}");
    }
    let negated = said(|m| {
        replace(m, Op::FAdd, Op::FNegate);
        instruction(m, Op::FNegate).operands.truncate(1);
        bare(m);
    });
    assert!(negated.contains("OpFNegate) is not decorated"), "{negated}");
}

#[test]
fn instructions_that_devices_do_not_agree_on() {
    for (op, by) in
        [(Op::FAdd, Op::FMod), (Op::FAdd, Op::FRem), (Op::SDiv, Op::SRem), (Op::SDiv, Op::SMod), (Op::FAdd, Op::Dot)]
    {
        let said = said(|m| replace(m, op, by));
        assert!(said.contains(&format!("Op{by:?} is written")), "{said}");
    }
    for by in [GlslStd450Op::Fma, GlslStd450Op::Pow, GlslStd450Op::Sin, GlslStd450Op::FMin, GlslStd450Op::InverseSqrt] {
        let said = said(|m| instruction(m, Op::ExtInst).operands[1] = Operand::LiteralExtInstInteger(by as u32));
        assert!(said.contains(&format!("{by:?} is written")), "{said}");
    }
}

#[test]
fn other_workgroups_than_promised() {
    for sizes in [[128, 1, 1], [32, 2, 1], [64, 1, 2]] {
        let said = said(|m| {
            for (operand, size) in m.execution_modes[0].operands[2..].iter_mut().zip(sizes) {
                *operand = Operand::LiteralBit32(size);
            }
        });
        assert!(said.contains("workgroups of 64"), "{said}");
    }
    let none = said(|m| m.execution_modes.clear());
    assert!(none.contains("workgroups of 64"), "{none}");
}
