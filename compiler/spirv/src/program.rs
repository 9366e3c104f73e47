//! The shader texts of the op table as instructions. Declares each instruction once, with its SPIR-V and its WGSL; knows
//! nothing of nodes, values and control flow.

use std::sync::LazyLock;

use isograd_graph::ops::{Lowering, Shader};
use isograd_graph::{Op, Precision};
use rspirv::spirv;

/// A part of a shader program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// Pushes the operand with this index.
    Operand(usize),
    /// Pushes an int.
    Int(i32),
    /// Pushes an int as wide as a real.
    Wide(i64),
    /// Pushes a real.
    Real(f64),
    /// Takes its operands from the stack, the last one first, and pushes its result.
    Do(&'static Instruction),
}

/// What the stack holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A real.
    Real,
    /// A 32-bit int.
    Int,
    /// An int as wide as a real: in f32 modules an int.
    Wide,
    /// A truth value.
    Bool,
}

/// The kind of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gives {
    /// This.
    Is(Kind),
    /// That of the first operand.
    First,
    /// That of the last operand.
    Last,
}

/// What SPIR-V writes for an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spirv {
    /// The instruction with this code.
    Op(spirv::Op),
    /// The instruction of the set GLSL.std.450 with this code.
    Ext(spirv::GlslStd450Op),
    /// Nothing where source and result have one width, else the conversion with this code.
    Resize(spirv::Op),
}

/// An instruction on scalars.
#[derive(Debug, PartialEq, Eq)]
pub struct Instruction {
    /// Its name in the op table.
    pub name: &'static str,
    /// How many operands it takes.
    pub operands: usize,
    /// What it leaves.
    pub result: Gives,
    /// Whether it is arithmetic of reals, which must not be contracted.
    pub exact: bool,
    /// In SPIR-V.
    pub spirv: Spirv,
    /// In WGSL, with `{0}` for the first operand. Operands are names, constants or bracketed.
    pub wgsl: &'static str,
}

macro_rules! instructions {
    ($( $name:literal $operands:literal $result:expr, $spirv:expr, $wgsl:literal; )+) => {
        const ALL: &[Instruction] = &[ $( Instruction {
            name: $name,
            operands: $operands,
            result: $result,
            exact: matches!(
                $spirv,
                Spirv::Op(
                    spirv::Op::FAdd | spirv::Op::FSub | spirv::Op::FMul | spirv::Op::FDiv | spirv::Op::FNegate
                )
            ),
            spirv: $spirv,
            wgsl: $wgsl,
        }, )+ ];
    };
}

use Gives::{First, Is, Last};
use Kind::{Bool, Int, Real, Wide};
use Spirv::{Ext, Op as Code, Resize};
use spirv::{GlslStd450Op as G, Op as O};

instructions! {
    "fadd" 2 Is(Real), Code(O::FAdd), "{0} + {1}";
    "fsub" 2 Is(Real), Code(O::FSub), "{0} - {1}";
    "fmul" 2 Is(Real), Code(O::FMul), "{0} * {1}";
    "fdiv" 2 Is(Real), Code(O::FDiv), "{0} / {1}";
    "fneg" 1 Is(Real), Code(O::FNegate), "-{0}";
    "fsqrt" 1 Is(Real), Ext(G::Sqrt), "sqrt({0})";
    "fabs" 1 Is(Real), Ext(G::FAbs), "abs({0})";
    "ffloor" 1 Is(Real), Ext(G::Floor), "floor({0})";
    "fceil" 1 Is(Real), Ext(G::Ceil), "ceil({0})";
    "ftrunc" 1 Is(Real), Ext(G::Trunc), "trunc({0})";
    "flt" 2 Is(Bool), Code(O::FOrdLessThan), "{0} < {1}";
    "fle" 2 Is(Bool), Code(O::FOrdLessThanEqual), "{0} <= {1}";
    "feq" 2 Is(Bool), Code(O::FOrdEqual), "{0} == {1}";
    "fne" 2 Is(Bool), Code(O::FUnordNotEqual), "{0} != {1}";
    "bits" 1 Is(Wide), Code(O::Bitcast), "bitcast<i32>({0})";
    "real" 1 Is(Real), Code(O::Bitcast), "bitcast<f32>({0})";
    "narrow" 1 Is(Int), Resize(O::SConvert), "{0}";
    "widen" 1 Is(Wide), Resize(O::SConvert), "{0}";
    "itof" 1 Is(Real), Code(O::ConvertSToF), "f32({0})";
    "ftoi" 1 Is(Int), Code(O::ConvertFToS), "i32({0})";
    "iadd" 2 First, Code(O::IAdd), "{0} + {1}";
    "isub" 2 First, Code(O::ISub), "{0} - {1}";
    "imul" 2 First, Code(O::IMul), "{0} * {1}";
    "idiv" 2 First, Code(O::SDiv), "{0} / {1}";
    "ineg" 1 First, Code(O::SNegate), "-{0}";
    "imin" 2 First, Ext(G::SMin), "min({0}, {1})";
    "imax" 2 First, Ext(G::SMax), "max({0}, {1})";
    "iand" 2 First, Code(O::BitwiseAnd), "{0} & {1}";
    "ior" 2 First, Code(O::BitwiseOr), "{0} | {1}";
    "ishl" 2 First, Code(O::ShiftLeftLogical), "{0} << u32({1})";
    "ishr" 2 First, Code(O::ShiftRightArithmetic), "{0} >> u32({1})";
    "ushr" 2 First, Code(O::ShiftRightLogical), "bitcast<i32>(bitcast<u32>({0}) >> u32({1}))";
    "ieq" 2 Is(Bool), Code(O::IEqual), "{0} == {1}";
    "ilt" 2 Is(Bool), Code(O::SLessThan), "{0} < {1}";
    "ile" 2 Is(Bool), Code(O::SLessThanEqual), "{0} <= {1}";
    "and" 2 Is(Bool), Code(O::LogicalAnd), "{0} && {1}";
    "or" 2 Is(Bool), Code(O::LogicalOr), "{0} || {1}";
    "not" 1 Is(Bool), Code(O::LogicalNot), "!{0}";
    "select" 3 Last, Code(O::Select), "select({2}, {1}, {0})";
}

/// The program of an operation; `None` if it has none in shaders or its text is wrong.
pub fn program(op: Op, precision: Precision) -> Option<&'static [Step]> {
    static F32: LazyLock<Vec<Option<Vec<Step>>>> = LazyLock::new(|| all(Precision::F32));
    static F64: LazyLock<Vec<Option<Vec<Step>>>> = LazyLock::new(|| all(Precision::F64));
    let table = match precision {
        Precision::F32 => &F32,
        Precision::F64 => &F64,
    };
    table.get(op as usize)?.as_deref()
}

fn all(precision: Precision) -> Vec<Option<Vec<Step>>> {
    Op::ALL.iter().map(|op| text(*op, precision).and_then(parse)).collect()
}

fn text(op: Op, precision: Precision) -> Option<&'static str> {
    match (&op.def().lowering, precision) {
        (Lowering::Instructions { shader: Shader::Scalar { f32, .. }, .. }, Precision::F32) => Some(f32),
        (Lowering::Instructions { shader: Shader::Scalar { f64, .. }, .. }, Precision::F64) => Some(f64),
        _ => None,
    }
}

/// Parses a text as documented on [`Shader::Scalar`].
fn parse(text: &str) -> Option<Vec<Step>> {
    let step = |token: &str| match (token, token.split_once(':')) {
        ("a", _) => Some(Step::Operand(0)),
        ("b", _) => Some(Step::Operand(1)),
        ("c", _) => Some(Step::Operand(2)),
        ("d", _) => Some(Step::Operand(3)),
        (_, Some(("i", number))) => number.parse().ok().map(Step::Int),
        (_, Some(("w", number))) => number.parse().ok().map(Step::Wide),
        (_, Some(("r", number))) => number.parse().ok().map(Step::Real),
        (_, Some(_)) => None,
        (name, None) => ALL.iter().find(|i| i.name == name).map(Step::Do),
    };
    text.split_ascii_whitespace().map(step).collect()
}

#[cfg(test)]
mod tests {
    use isograd_graph::Scalar;
    use isograd_graph::ops::Family;

    use super::*;

    const fn kind(scalar: Scalar) -> Kind {
        match scalar {
            Scalar::Real => Real,
            Scalar::Int => Int,
            Scalar::Bool => Bool,
        }
    }

    /// The kinds that the instructions take, as their SPIR-V wants them.
    fn fits(instruction: &Instruction, operands: &[Kind], precision: Precision) -> bool {
        let same = |a: Kind, b: Kind| a == b || (precision == Precision::F32 && [a, b].iter().all(|k| is_int(*k)));
        match (instruction.name, operands) {
            ("select", [c, x, y]) => *c == Bool && same(*x, *y),
            ("and" | "or", [a, b]) => *a == Bool && *b == Bool,
            ("not", [a]) => *a == Bool,
            ("ishl" | "ishr" | "ushr", [a, b]) => is_int(*a) && *b == Int,
            ("real" | "narrow", [a]) => same(*a, Wide),
            ("itof" | "widen", [a]) => *a == Int,
            ("bits" | "ftoi", [a]) => *a == Real,
            (name, operands) if name.starts_with('f') => operands.iter().all(|k| *k == Real),
            (_, [a]) => is_int(*a),
            (_, [a, b]) => is_int(*a) && same(*a, *b),
            _ => false,
        }
    }

    const fn is_int(kind: Kind) -> bool {
        matches!(kind, Int | Wide)
    }

    #[test]
    fn every_text_of_the_table_has_the_types_of_its_operation() {
        for precision in [Precision::F32, Precision::F64] {
            for op in Op::ALL.iter().filter(|op| op.def().fragment(Family::Shader).is_none()) {
                let place = format!("{op} in {}", precision.name());
                let steps = program(*op, precision).unwrap_or_else(|| panic!("{place} has no program"));
                let mut stack = Vec::new();
                for step in steps {
                    let pushed = match step {
                        Step::Operand(i) => kind(op.def().operands[*i]),
                        Step::Int(_) => Int,
                        Step::Wide(_) => Wide,
                        Step::Real(_) => Real,
                        Step::Do(instruction) => {
                            let operands = stack.split_off(stack.len() - instruction.operands);
                            assert!(
                                fits(instruction, &operands, precision),
                                "{place}: {} {operands:?}",
                                instruction.name
                            );
                            match instruction.result {
                                Is(kind) => kind,
                                First => operands[0],
                                Last => *operands.last().unwrap(),
                            }
                        }
                    };
                    stack.push(pushed);
                }
                let result = kind(op.def().result);
                let right = stack == [result] || (precision == Precision::F32 && stack == [Wide] && result == Int);
                assert!(right, "{place} leaves {stack:?}");
            }
        }
    }

    #[test]
    fn unknown_tokens_are_refused() {
        for text in ["a fma", "w:x", "i:3000000000", "e", "a ishl:3"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
