//! Expressions: constants, and the instructions of an operation as one expression. Knows the grammar of WGSL; knows
//! nothing of nodes and statements.

use std::fmt::Write;

use isograd_graph::{Op, Precision, Scalar};

use crate::EmitError;
use crate::program::{Step, program};

/// Operations of more instructions are functions.
const SHORT: usize = 3;

/// The type of a scalar.
pub const fn type_name(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::Real => "f32",
        Scalar::Int => "i32",
        Scalar::Bool => "bool",
    }
}

/// A finite real, in the fewest digits that give it to all readers: those that round once, those that read an f64 first,
/// and those that refuse an f64 beyond the largest f32.
#[expect(clippy::cast_possible_truncation, reason = "graphs of f32 hold f32")]
pub fn real(x: f64) -> String {
    let single = x as f32;
    let reads = |text: &str| {
        text.parse::<f64>()
            .is_ok_and(|read| read.abs() <= f64::from(f32::MAX) && (read as f32).to_bits() == single.to_bits())
            && text.parse::<f32>().is_ok_and(|read| read.to_bits() == single.to_bits())
    };
    let short = format!("{single:?}");
    if reads(&short) {
        return short;
    }
    // Then of each number of digits the nearest decimal and the next one towards 0: of the largest number that is it.
    let exact = format!("{x:.160e}");
    let digits = exact.split_once('e').into_iter().flat_map(|(digits, exponent)| {
        let whole = if x.is_sign_negative() { 3 } else { 2 };
        (1..17).flat_map(move |places| {
            let cut = digits.get(..whole + places).map(|digits| format!("{digits}e{exponent}"));
            std::iter::once(format!("{x:.places$e}")).chain(cut)
        })
    });
    digits.into_iter().find(|text| reads(text)).unwrap_or_else(|| format!("{x:?}"))
}

/// An expression, by what it needs around it.
#[derive(Debug, Clone)]
enum Term<'t> {
    /// A name, a call or a number without a sign.
    Tight(&'t str),
    Call(String),
    Number(String),
    /// Operands with an operator.
    Operator(String),
}

impl Term<'_> {
    fn text(&self) -> &str {
        match self {
            Self::Tight(text) => text,
            Self::Call(text) | Self::Number(text) | Self::Operator(text) => text,
        }
    }
}

fn steps(op: Op) -> Result<&'static [Step], EmitError> {
    program(op, Precision::F32).ok_or(EmitError::Program(op))
}

/// Whether an operation is a function of its own.
pub fn is_long(op: Op) -> Result<bool, EmitError> {
    let instructions = steps(op)?.iter().filter(|step| matches!(step, Step::Do(i) if i.wgsl != "{0}"));
    Ok(instructions.count() > SHORT)
}

/// An operation of names and constants.
pub fn expression(op: Op, operands: &[&str]) -> Result<String, EmitError> {
    let wrong = || EmitError::Program(op);
    let mut stack: Vec<Term<'_>> = Vec::new();
    for step in steps(op)? {
        let term = match step {
            Step::Operand(i) => {
                let text = *operands.get(*i).ok_or_else(wrong)?;
                if text.starts_with('-') { Term::Number(text.to_owned()) } else { Term::Tight(text) }
            }
            Step::Int(n) => Term::Number(n.to_string()),
            Step::Wide(n) => Term::Number(n.to_string()),
            Step::Real(x) => Term::Number(real(*x)),
            Step::Do(instruction) => {
                let first = stack.len().checked_sub(instruction.operands).ok_or_else(wrong)?;
                let terms = stack.split_off(first);
                match (instruction.wgsl, terms.as_slice()) {
                    ("{0}", [same]) => same.clone(),
                    (template, terms) => fill(template, terms).ok_or_else(wrong)?,
                }
            }
        };
        stack.push(term);
    }
    match stack.as_slice() {
        [result] => Ok(result.text().to_owned()),
        _ => Err(wrong()),
    }
}

/// Puts terms into a template of the table of instructions.
fn fill(template: &str, terms: &[Term<'_>]) -> Option<Term<'static>> {
    let prefix = template.starts_with(['-', '!']);
    let operator = prefix || template.starts_with('{');
    let mut text = String::with_capacity(template.len() + 16);
    let mut rest = template;
    while let Some((before, after)) = rest.split_once('{') {
        let (index, after) = after.split_once('}')?;
        let term = terms.get(index.parse::<usize>().ok()?)?;
        rest = after;
        match (term, before.strip_suffix("u32(")) {
            // The literal of the type instead of its conversion.
            (Term::Number(number), Some(before)) if !number.starts_with('-') => {
                write!(text, "{before}{number}u").ok()?;
                rest = after.strip_prefix(')')?;
                continue;
            }
            _ => text.push_str(before),
        }
        let bracketed = match term {
            Term::Operator(_) => operator,
            Term::Number(number) => prefix && number.starts_with('-'),
            Term::Tight(_) | Term::Call(_) => false,
        };
        if bracketed {
            write!(text, "({})", term.text()).ok()?;
        } else {
            text.push_str(term.text());
        }
    }
    text.push_str(rest);
    Some(if operator { Term::Operator(text) } else { Term::Call(text) })
}

/// The function that rounds its operand. What compilers know of numbers ends at an operation on their bits; a conversion
/// there and back alone many of them would drop. The one bit pattern that this one changes is of a NaN, and stays one.
pub fn barrier(name: &str) -> String {
    format!(
        "// x itself, rounded: implementations merge sums with sums and products with products, but not across bits.\n\
         fn {name}(x: f32) -> f32 {{\n    return bitcast<f32>(min(bitcast<u32>(x), 0xfffffffeu));\n}}\n"
    )
}

/// The function of an operation.
pub fn function(op: Op, name: &str) -> Result<String, EmitError> {
    let def = op.def();
    let names = ["a", "b", "c", "d"];
    let parameters: Vec<String> =
        names.iter().zip(def.operands).map(|(name, scalar)| format!("{name}: {}", type_name(*scalar))).collect();
    Ok(format!(
        "// {}\nfn {name}({}) -> {} {{\n    return {};\n}}\n",
        def.formula,
        parameters.join(", "),
        type_name(def.result),
        expression(op, &names)?,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_have_the_brackets_they_need() {
        for (op, operands, want) in [
            (Op::Sub, vec!["a", "-1.5"], "a - -1.5"),
            (Op::Neg, vec!["-1.5"], "-(-1.5)"),
            (Op::Min, vec!["a", "b"], "select(a, b, b < a)"),
            (
                Op::Copysign,
                vec!["a", "b"],
                "bitcast<f32>((bitcast<i32>(a) & 2147483647) | (bitcast<i32>(b) & -2147483648))",
            ),
            (Op::Exponent, vec!["a"], "bitcast<i32>(bitcast<u32>(bitcast<i32>(a) & 2147483647) >> 23u) - 127"),
            (Op::Not, vec!["a"], "!a"),
        ] {
            assert_eq!(expression(op, &operands).unwrap(), want);
        }
    }

    fn is_read_by_all(x: f32, text: &str) -> bool {
        let read = text.parse::<f64>().unwrap();
        text.parse::<f32>().unwrap().to_bits() == x.to_bits()
            && (read as f32).to_bits() == x.to_bits()
            && read.abs() <= f64::from(f32::MAX)
    }

    /// Per exponent mantissas at both ends, near powers of two, and others.
    #[test]
    fn every_reader_gets_the_number() {
        let mut bits = 1_u32;
        let mut mantissas: Vec<u32> = (0..23).flat_map(|k| [1 << k, (1 << k) - 1, (1 << k) + 1]).collect();
        mantissas.extend((0..4).flat_map(|k| [k, 0x7f_ffff - k, 0x40_0000 + k]));
        for exponent in 0..255_u32 {
            for k in 0..400 {
                bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223) ^ k;
                let mantissa = mantissas.get(k as usize).copied().unwrap_or(bits >> 9);
                for sign in [0, 1 << 31] {
                    let x = f32::from_bits(sign | exponent << 23 | mantissa);
                    let text = real(f64::from(x));
                    assert!(is_read_by_all(x, &text), "{x:e}: {text}");
                    assert!(text.contains(['.', 'e']), "{text}");
                }
            }
        }
    }

    /// One digit less and no decimal is it, be it rounded up or down.
    #[test]
    fn numbers_have_the_fewest_digits() {
        for (x, want) in [
            (f32::MAX, "3.4028234e38"),
            (f32::MIN, "-3.4028234e38"),
            (f32::MIN_POSITIVE, "1.1754944e-38"),
            (f32::from_bits(1), "1e-45"),
            (f32::from_bits(0x7f_ffff), "1.1754942e-38"),
            (16_777_216.0, "16777216.0"),
            (16_777_218.0, "16777218.0"),
            (f32::MAX.next_down(), "3.4028233e38"),
            (0.1, "0.1"),
            (-0.0, "-0.0"),
        ] {
            let text = real(f64::from(x));
            assert_eq!(text, want);
            let digits = text.split('e').next().unwrap().bytes().filter(u8::is_ascii_digit).count();
            if x == 0.0 || x.abs() < 1e-44 || text.ends_with(".0") || x == 0.1 {
                continue;
            }
            let unit = 10_f64.powi(f64::from(x.abs()).log10().floor() as i32 - digits as i32 + 2);
            for shorter in [f64::floor, f64::ceil].map(|round| round(f64::from(x) / unit)) {
                let text = format!("{shorter}e{}", unit.log10().round());
                assert!(!is_read_by_all(x, &text), "{text} for {x:e}");
            }
        }
    }
}
