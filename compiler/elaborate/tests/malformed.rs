//! Programs that no checker makes: they are answered, never a panic. Knows nothing of source text.

use isograd_elaborate::elaborate;
use isograd_graph::Unwatched;
use isograd_program::typed::{Branch, Code, Function, FunctionId, Instruction, Local, Loop, Param, Slot};
use isograd_program::{Builtin, Program, Type};
use isograd_syntax::tree::BinaryOp;
use isograd_syntax::{Code as DiagnosticCode, FileId, Limits, Span};

const SPAN: Span = Span::new(FileId(0), 0, 1);

fn program(instructions: Vec<Instruction>) -> Program {
    let local = |name: &str, ty| Local { name: name.into(), ty };
    let code = Code {
        slots: vec![local("x", Type::Real), local("c", Type::Csg), local("i", Type::Int)],
        instructions: instructions.into_iter().map(|i| (i, SPAN)).collect(),
    };
    let function = Function {
        name: "f".into(),
        params: vec![Param::new("x".into(), Type::Real)],
        result: Type::Real,
        doc: None,
        code,
        span: SPAN,
    };
    Program { functions: vec![function], exports: vec![FunctionId(0)], ..Program::default() }
}

#[test]
fn malformed_programs_are_answered() {
    let branch = || Instruction::If(Branch { value: Some(Type::Real), writes: Vec::new(), restores: Vec::new() });
    let facts = |slot| Instruction::For(Loop { counter: Slot(2), writes: vec![Slot(slot)] });
    let (load, zero) = (Instruction::Load(Slot(0)), Instruction::Int(0));
    let cases = [
        vec![],
        vec![Instruction::Load(Slot(1))],
        vec![Instruction::Load(Slot(9))],
        vec![load.clone(), load.clone()],
        vec![zero.clone(), Instruction::Pick { offset: 3, length: u32::MAX }],
        vec![Instruction::Pack(u32::MAX)],
        vec![load.clone(), Instruction::Call(FunctionId(7))],
        vec![load.clone(), Instruction::Call(FunctionId(0))],
        vec![Instruction::Node { definition: isograd_program::typed::DefinitionId(0), subtrees: 1 }],
        vec![load.clone(), Instruction::Eval { concept: isograd_program::typed::ConceptId(0), live: true }],
        vec![load.clone(), branch(), load.clone(), Instruction::Else, load.clone(), Instruction::EndIf],
        vec![Instruction::Bool(true), branch(), load.clone()],
        vec![Instruction::Bool(true), branch(), Instruction::Else, Instruction::EndIf],
        vec![Instruction::EndIf],
        vec![Instruction::EndFor],
        vec![zero.clone(), zero.clone(), facts(0), load.clone()],
        vec![zero.clone(), Instruction::Int(3), facts(1), Instruction::EndFor, load.clone()],
        vec![Instruction::Block { restores: vec![Slot(1)] }, Instruction::EndBlock],
        vec![load.clone(), Instruction::Builtin { builtin: Builtin::Cross, args: vec![Type::Real; 2] }],
        vec![
            load.clone(),
            load.clone(),
            Instruction::Binary { op: BinaryOp::Mul, left: Type::Quat, right: Type::Quat },
        ],
        vec![load.clone(), Instruction::MayBeNan],
        vec![load.clone(), Instruction::End { ty: Type::Vector(4), upper: true }],
        vec![load.clone(), Instruction::PickInterval { ends: 1, offset: u32::MAX, length: u32::MAX }],
        vec![load.clone(), load.clone(), load.clone(), Instruction::Pack(2), Instruction::Interval(Type::Real)],
        vec![load.clone(), load.clone(), Instruction::Bound { value: Type::Real, by: Type::Real }],
        vec![load.clone(), Instruction::Builtin { builtin: Builtin::Cross, args: vec![Type::Real.interval(); 2] }],
        vec![load, Instruction::Cast { from: Type::Real, to: Type::Bool }],
    ];
    for case in cases {
        let program = program(case.clone());
        match elaborate(&program, FunctionId(0), &Limits::default(), &Unwatched) {
            Ok(_) => panic!("elaborated: {case:?}"),
            Err(diagnostics) => {
                let codes: Vec<_> = diagnostics.iter().map(|d| d.code).collect();
                let expected = [DiagnosticCode::E1103, DiagnosticCode::E1005];
                assert!(codes.len() == 1 && expected.contains(&codes[0]), "{case:?}: {diagnostics:?}");
            }
        }
    }
    let none = elaborate(&Program::default(), FunctionId(3), &Limits::default(), &Unwatched);
    assert!(none.is_err());
}
