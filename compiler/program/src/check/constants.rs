//! Values of literals and of operators on literals, as far as warnings need them (W0403, W0801). Knows no names, and
//! only the types that the expressions themselves show.

use isograd_syntax::tree::{BinaryOp, ExprId, ExprKind, Tree, UnaryOp};

use super::tree;

/// The scalars of a constant, in order.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Constant {
    /// An int.
    Int(i32),
    /// A real, or the reals of a list.
    Reals(Vec<f64>),
}

/// The value of an int constant.
pub(super) fn int(tree: &Tree, id: ExprId) -> Option<i32> {
    match constant(tree, id)? {
        Constant::Int(value) => Some(value),
        Constant::Reals(_) => None,
    }
}

/// Warnings look into constants that a reader would compute; longer ones are nobody's mistake.
const LONGEST: usize = 64;

/// What is still to be done.
enum Work {
    Visit(ExprId),
    Negate,
    Binary(BinaryOp),
    /// A list of so many elements.
    List(usize),
    Repeat(usize),
}

/// The value of an expression of literals; `None` if it is something else, long, or larger than a matrix.
pub(super) fn constant(tree: &Tree, id: ExprId) -> Option<Constant> {
    let mut work = vec![Work::Visit(id)];
    let mut done: Vec<Constant> = Vec::new();
    let mut visited = 0;
    while let Some(step) = work.pop() {
        match step {
            Work::Visit(_) if visited >= LONGEST => return None,
            Work::Visit(id) => {
                visited += 1;
                match &tree::expr(tree, id).kind {
                    ExprKind::Int(value) => done.push(Constant::Int(*value)),
                    ExprKind::Real(value) => done.push(Constant::Reals(vec![*value])),
                    ExprKind::Unary { op: UnaryOp::Neg, operand } => work.extend([Work::Negate, Work::Visit(*operand)]),
                    ExprKind::Binary { op, left, right, .. } => {
                        work.extend([Work::Binary(*op), Work::Visit(*right), Work::Visit(*left)]);
                    }
                    ExprKind::List(elements) if elements.len() <= 4 => {
                        work.push(Work::List(elements.len()));
                        work.extend(elements.iter().rev().map(|e| Work::Visit(*e)));
                    }
                    ExprKind::Splat { element, count } if *count <= 4 => {
                        work.extend([Work::Repeat(usize::try_from(*count).ok()?), Work::Visit(*element)]);
                    }
                    _ => return None,
                }
            }
            Work::Negate => {
                let value = match done.pop()? {
                    Constant::Int(value) => Constant::Int(value.wrapping_neg()),
                    Constant::Reals(values) => Constant::Reals(values.into_iter().map(|x| -x).collect()),
                };
                done.push(value);
            }
            Work::Binary(op) => {
                let (right, left) = (done.pop()?, done.pop()?);
                done.push(binary(op, left, right)?);
            }
            Work::List(n) => {
                let mut all = Vec::new();
                for part in done.split_off(done.len().checked_sub(n)?) {
                    let Constant::Reals(values) = part else { return None };
                    all.extend(values);
                }
                done.push(Constant::Reals(all));
            }
            Work::Repeat(n) => {
                let Constant::Reals(values) = done.pop()? else { return None };
                done.push(Constant::Reals(values.repeat(n)));
            }
        }
        if matches!(done.last(), Some(Constant::Reals(values)) if values.len() > 16) {
            return None;
        }
    }
    done.pop()
}

/// Int operators by LANGUAGE 4.4; of reals only those of single ones.
fn binary(op: BinaryOp, left: Constant, right: Constant) -> Option<Constant> {
    match (left, right) {
        (Constant::Int(a), Constant::Int(b)) => Some(Constant::Int(match op {
            BinaryOp::Add => a.wrapping_add(b),
            BinaryOp::Sub => a.wrapping_sub(b),
            BinaryOp::Mul => a.wrapping_mul(b),
            BinaryOp::Div if b == 0 => 0,
            BinaryOp::Div => a.wrapping_div(b),
            BinaryOp::Rem if b == 0 => 0,
            BinaryOp::Rem => a.wrapping_sub(b.wrapping_mul(floored(a, b))),
            _ => return None,
        })),
        (Constant::Reals(a), Constant::Reals(b)) => {
            let ([a], [b]) = (a.as_slice(), b.as_slice()) else { return None };
            let value = match op {
                BinaryOp::Add => a + b,
                BinaryOp::Sub => a - b,
                BinaryOp::Mul => a * b,
                BinaryOp::Div => a / b,
                _ => return None,
            };
            Some(Constant::Reals(vec![value]))
        }
        _ => None,
    }
}

/// ⌊a / b⌋, b ≠ 0.
const fn floored(a: i32, b: i32) -> i32 {
    let quotient = a.wrapping_div(b);
    if a.wrapping_rem(b) != 0 && ((a < 0) != (b < 0)) { quotient.wrapping_sub(1) } else { quotient }
}
