//! The instruction texts of the op table as bytes. Knows the names of WebAssembly's lane instructions; knows nothing
//! of nodes, locals and control flow.

use std::sync::LazyLock;

use isograd_graph::ops::Lowering;
use isograd_graph::{Op, Precision};
use wasm_encoder::{Encode, Instruction};

/// A part of a lane program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Pushes the operand with this index.
    Operand(usize),
    /// Encoded instructions.
    Bytes(Vec<u8>),
}

/// A parsed [`Lowering::Instructions`] text: a stack program that leaves one v128.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Program {
    /// Its parts in order.
    pub steps: Vec<Step>,
    /// Instructions other than operand pushes: what it costs in code.
    pub instructions: u32,
}

/// The program of an operation; `None` if it has no lane lowering or its text is wrong.
pub fn program(op: Op, precision: Precision) -> Option<&'static Program> {
    static F32: LazyLock<Vec<Option<Program>>> = LazyLock::new(|| all(Precision::F32));
    static F64: LazyLock<Vec<Option<Program>>> = LazyLock::new(|| all(Precision::F64));
    let table = match precision {
        Precision::F32 => &F32,
        Precision::F64 => &F64,
    };
    table.get(op as usize)?.as_ref()
}

fn all(precision: Precision) -> Vec<Option<Program>> {
    Op::ALL.iter().map(|op| text(*op, precision).and_then(parse)).collect()
}

fn text(op: Op, precision: Precision) -> Option<&'static str> {
    match (&op.def().lowering, precision) {
        (Lowering::Instructions { f32x4, .. }, Precision::F32) => Some(f32x4),
        (Lowering::Instructions { f64x2, .. }, Precision::F64) => Some(f64x2),
        (Lowering::Fragment(_), _) => None,
    }
}

/// Parses a text as documented on [`Lowering::Instructions`].
pub fn parse(text: &str) -> Option<Program> {
    let mut program = Program::default();
    for token in text.split_ascii_whitespace() {
        let operand = match token {
            "a" => Some(0),
            "b" => Some(1),
            "c" => Some(2),
            "d" => Some(3),
            _ => None,
        };
        if let Some(index) = operand {
            program.steps.push(Step::Operand(index));
            continue;
        }
        if !matches!(program.steps.last(), Some(Step::Bytes(_))) {
            program.steps.push(Step::Bytes(Vec::new()));
        }
        if let Some(Step::Bytes(bytes)) = program.steps.last_mut() {
            instruction(token, bytes)?;
            program.instructions += 1;
        }
    }
    Some(program)
}

/// Encodes one token that is no operand.
fn instruction(token: &str, bytes: &mut Vec<u8>) -> Option<()> {
    let Some((name, immediate)) = token.split_once(':') else {
        match token {
            "low32" => low32(bytes),
            // The upper two 32-bit lanes; the second operand of the shuffle is not read.
            "high64" => {
                zero(bytes);
                Instruction::I8x16Shuffle(dwords([2, 3, 2, 3])).encode(bytes);
            }
            // The low halves of the 64-bit lanes of two vectors.
            "even32" => Instruction::I8x16Shuffle(dwords([0, 2, 4, 6])).encode(bytes),
            "pair64" => Instruction::I8x16Shuffle(dwords([0, 1, 4, 5])).encode(bytes),
            _ => named(token)?.encode(bytes),
        }
        return Some(());
    };
    match name {
        "i32" => splat32(immediate.parse::<i32>().ok()?.cast_unsigned(), bytes),
        "i64" => splat64(immediate.parse::<i64>().ok()?.cast_unsigned(), bytes),
        // Shifts take their distance, a scalar, from the stack.
        _ => {
            Instruction::I32Const(immediate.parse().ok()?).encode(bytes);
            named(name)?.encode(bytes);
        }
    }
    Some(())
}

/// Packs the low halves of the 64-bit lanes into the low two 32-bit lanes.
pub fn low32(bytes: &mut Vec<u8>) {
    zero(bytes);
    Instruction::I8x16Shuffle(dwords([0, 2, 0, 2])).encode(bytes);
}

fn zero(bytes: &mut Vec<u8>) {
    Instruction::V128Const(0).encode(bytes);
}

/// A constant in each of four 32-bit lanes.
pub fn splat32(bits: u32, bytes: &mut Vec<u8>) {
    let wide = u128::from(bits);
    let all = wide | wide << 32 | wide << 64 | wide << 96;
    Instruction::V128Const(all.cast_signed()).encode(bytes);
}

/// A constant in each of two 64-bit lanes.
pub fn splat64(bits: u64, bytes: &mut Vec<u8>) {
    let wide = u128::from(bits);
    Instruction::V128Const((wide | wide << 64).cast_signed()).encode(bytes);
}

/// Byte indices of a shuffle of 32-bit lanes.
fn dwords(lanes: [u8; 4]) -> [u8; 16] {
    let mut bytes = [0; 16];
    for (four, lane) in bytes.chunks_exact_mut(4).zip(lanes) {
        for (byte, within) in four.iter_mut().zip(0_u8..) {
            *byte = lane * 4 + within;
        }
    }
    bytes
}

/// Declares the lane instructions by their names in the WebAssembly specification.
macro_rules! names {
    ($( $name:literal $instruction:ident )+) => {
        fn named(name: &str) -> Option<Instruction<'static>> {
            match name {
                $( $name => Some(Instruction::$instruction), )+
                _ => None,
            }
        }
    };
}

names! {
    "v128.not" V128Not  "v128.and" V128And  "v128.andnot" V128AndNot  "v128.or" V128Or  "v128.xor" V128Xor
    "v128.bitselect" V128Bitselect
    "i32x4.eq" I32x4Eq  "i32x4.ne" I32x4Ne  "i32x4.lt_s" I32x4LtS  "i32x4.lt_u" I32x4LtU  "i32x4.gt_s" I32x4GtS
    "i32x4.gt_u" I32x4GtU  "i32x4.le_s" I32x4LeS  "i32x4.le_u" I32x4LeU  "i32x4.ge_s" I32x4GeS
    "i32x4.ge_u" I32x4GeU  "i32x4.abs" I32x4Abs  "i32x4.neg" I32x4Neg  "i32x4.shl" I32x4Shl
    "i32x4.shr_s" I32x4ShrS  "i32x4.shr_u" I32x4ShrU  "i32x4.add" I32x4Add  "i32x4.sub" I32x4Sub
    "i32x4.mul" I32x4Mul  "i32x4.min_s" I32x4MinS  "i32x4.min_u" I32x4MinU  "i32x4.max_s" I32x4MaxS
    "i32x4.max_u" I32x4MaxU
    "i64x2.eq" I64x2Eq  "i64x2.ne" I64x2Ne  "i64x2.lt_s" I64x2LtS  "i64x2.gt_s" I64x2GtS  "i64x2.le_s" I64x2LeS
    "i64x2.ge_s" I64x2GeS  "i64x2.abs" I64x2Abs  "i64x2.neg" I64x2Neg  "i64x2.shl" I64x2Shl
    "i64x2.shr_s" I64x2ShrS  "i64x2.shr_u" I64x2ShrU  "i64x2.add" I64x2Add  "i64x2.sub" I64x2Sub
    "i64x2.mul" I64x2Mul  "i64x2.extend_low_i32x4_s" I64x2ExtendLowI32x4S
    "i64x2.extend_high_i32x4_s" I64x2ExtendHighI32x4S  "i64x2.extend_low_i32x4_u" I64x2ExtendLowI32x4U
    "i64x2.extend_high_i32x4_u" I64x2ExtendHighI32x4U
    "f32x4.eq" F32x4Eq  "f32x4.ne" F32x4Ne  "f32x4.lt" F32x4Lt  "f32x4.gt" F32x4Gt  "f32x4.le" F32x4Le
    "f32x4.ge" F32x4Ge  "f32x4.ceil" F32x4Ceil  "f32x4.floor" F32x4Floor  "f32x4.trunc" F32x4Trunc
    "f32x4.nearest" F32x4Nearest  "f32x4.abs" F32x4Abs  "f32x4.neg" F32x4Neg  "f32x4.sqrt" F32x4Sqrt
    "f32x4.add" F32x4Add  "f32x4.sub" F32x4Sub  "f32x4.mul" F32x4Mul  "f32x4.div" F32x4Div  "f32x4.pmin" F32x4PMin
    "f32x4.pmax" F32x4PMax
    "f64x2.eq" F64x2Eq  "f64x2.ne" F64x2Ne  "f64x2.lt" F64x2Lt  "f64x2.gt" F64x2Gt  "f64x2.le" F64x2Le
    "f64x2.ge" F64x2Ge  "f64x2.ceil" F64x2Ceil  "f64x2.floor" F64x2Floor  "f64x2.trunc" F64x2Trunc
    "f64x2.nearest" F64x2Nearest  "f64x2.abs" F64x2Abs  "f64x2.neg" F64x2Neg  "f64x2.sqrt" F64x2Sqrt
    "f64x2.add" F64x2Add  "f64x2.sub" F64x2Sub  "f64x2.mul" F64x2Mul  "f64x2.div" F64x2Div  "f64x2.pmin" F64x2PMin
    "f64x2.pmax" F64x2PMax
    "i32x4.trunc_sat_f32x4_s" I32x4TruncSatF32x4S  "i32x4.trunc_sat_f64x2_s_zero" I32x4TruncSatF64x2SZero
    "f32x4.convert_i32x4_s" F32x4ConvertI32x4S  "f32x4.convert_i32x4_u" F32x4ConvertI32x4U
    "f64x2.convert_low_i32x4_s" F64x2ConvertLowI32x4S  "f64x2.convert_low_i32x4_u" F64x2ConvertLowI32x4U
    "f32x4.demote_f64x2_zero" F32x4DemoteF64x2Zero  "f64x2.promote_low_f32x4" F64x2PromoteLowF32x4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_text_of_the_table_parses() {
        for precision in [Precision::F32, Precision::F64] {
            for op in Op::ALL {
                let lanes = matches!(op.def().lowering, Lowering::Instructions { .. });
                assert_eq!(program(*op, precision).is_some(), lanes, "{op} in {}", precision.name());
            }
        }
    }

    #[test]
    fn operands_split_runs_of_bytes() {
        let program = parse("a b f32x4.add i32:1 v128.and").expect("parses");
        let mut bytes = Vec::new();
        Instruction::F32x4Add.encode(&mut bytes);
        splat32(1, &mut bytes);
        Instruction::V128And.encode(&mut bytes);
        assert_eq!(program.steps, [Step::Operand(0), Step::Operand(1), Step::Bytes(bytes)]);
        assert_eq!(program.instructions, 3);
    }

    #[test]
    fn unknown_names_are_refused() {
        for text in ["f32x4.fma", "a i32x4.shl:x", "i32:3000000000", "e", "f32x4.relaxed_madd"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
