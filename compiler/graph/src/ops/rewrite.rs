//! Rewrites of a folding builder, one per line with its formula. Each gives the bits of the operation it replaces
//! for every operand (NaNs are one value), which the tests check on a grid of special and random operands.

use crate::{Builder, Node, NodeId, Op, Value};

/// What the operation simplifies to, if a rewrite applies.
pub fn rewrite(b: &mut Builder<'_>, op: Op, args: &[NodeId]) -> Option<NodeId> {
    match (op, args) {
        (Op::Add, &[x, y]) => add(b, x, y),
        (Op::Sub, &[x, y]) => sub(b, x, y),
        (Op::Mul, &[x, y]) => mul(b, x, y),
        (Op::Div, &[x, y]) => div(b, x, y),
        (Op::Neg, &[x]) => negated(b, x), // −(−x) = x
        (Op::Abs, &[x]) => match unary(b, x) {
            Some((Op::Neg, y)) => Some(b.abs(y)), // |−y| = |y|
            Some((Op::Abs | Op::Sqrt | Op::Length2 | Op::Length3 | Op::Length4, _)) if !sqrt_of_zero(b, x) => Some(x), // ‖x‖ = |x|
            _ => None,
        },
        (Op::Min | Op::Max | Op::IntMin | Op::IntMax | Op::And | Op::Or, &[x, y]) if x == y => Some(x), // x ∘ x = x
        (Op::Not, &[x]) => match unary(b, x) {
            Some((Op::Not, y)) => Some(y), // ¬¬y = y
            _ => None,
        },
        (Op::And, &[x, y]) => truth(b, x, y, false), // x ∧ 1 = x, x ∧ 0 = 0
        (Op::Or, &[x, y]) => truth(b, x, y, true),   // x ∨ 0 = x, x ∨ 1 = 1
        (Op::Select | Op::SelectInt | Op::SelectBool, &[c, x, y]) => select(b, op, c, x, y),
        (Op::IntAdd | Op::IntSub, &[x, y]) if b.value(y) == Some(Value::Int(0)) => Some(x), // x ± 0 = x
        (Op::IntAdd, &[x, y]) if b.value(x) == Some(Value::Int(0)) => Some(y),              // 0 + y = y
        (Op::IntMul, &[x, y]) if b.value(y) == Some(Value::Int(1)) => Some(x),              // x·1 = x
        (Op::IntMul, &[x, y]) if b.value(x) == Some(Value::Int(1)) => Some(y),              // 1·y = y
        _ => None,
    }
}

/// The real constant, if it is one.
fn real(b: &Builder<'_>, x: NodeId) -> Option<f64> {
    match b.value(x) {
        Some(Value::Real(x)) => Some(x),
        _ => None,
    }
}

fn is(b: &Builder<'_>, x: NodeId, constant: f64) -> bool {
    real(b, x).is_some_and(|x| x.to_bits() == constant.to_bits())
}

fn unary(b: &Builder<'_>, x: NodeId) -> Option<(Op, NodeId)> {
    match b.graph().get(x)? {
        Node::Apply(op, args) => Some((op, args.as_slice().first().copied()?)),
        _ => None,
    }
}

/// √(−0) is −0, whose magnitude is another number.
fn sqrt_of_zero(b: &Builder<'_>, x: NodeId) -> bool {
    matches!(unary(b, x), Some((Op::Sqrt, _)))
}

fn negated(b: &Builder<'_>, x: NodeId) -> Option<NodeId> {
    match unary(b, x) {
        Some((Op::Neg, y)) => Some(y),
        _ => None,
    }
}

fn add(b: &mut Builder<'_>, x: NodeId, y: NodeId) -> Option<NodeId> {
    if is(b, y, -0.0) {
        return Some(x); // x + (−0) = x
    }
    if is(b, x, -0.0) {
        return Some(y); // (−0) + y = y
    }
    if let Some(z) = negated(b, y) {
        return Some(b.sub(x, z)); // x + (−z) = x − z
    }
    if let Some(z) = negated(b, x) {
        return Some(b.sub(y, z)); // (−z) + y = y − z
    }
    None
}

fn sub(b: &mut Builder<'_>, x: NodeId, y: NodeId) -> Option<NodeId> {
    if is(b, y, 0.0) {
        return Some(x); // x − 0 = x
    }
    if is(b, x, -0.0) {
        return Some(b.neg(y)); // (−0) − y = −y
    }
    if let Some(z) = negated(b, y) {
        return Some(b.add(x, z)); // x − (−z) = x + z
    }
    None
}

fn mul(b: &mut Builder<'_>, x: NodeId, y: NodeId) -> Option<NodeId> {
    for (x, y) in [(x, y), (y, x)] {
        if is(b, y, 1.0) {
            return Some(x); // x·1 = x
        }
        if is(b, y, -1.0) {
            return Some(b.neg(x)); // x·(−1) = −x
        }
        if is(b, y, 2.0) {
            return Some(b.add(x, x)); // x·2 = x + x
        }
        if let Some(z) = negated(b, x)
            && let Some(c) = real(b, y)
        {
            let c = b.real(-c);
            return Some(b.mul(z, c)); // (−z)·c = z·(−c)
        }
    }
    match (negated(b, x), negated(b, y)) {
        (Some(x), Some(y)) => Some(b.mul(x, y)), // (−x)·(−y) = x·y
        _ => None,
    }
}

fn div(b: &mut Builder<'_>, x: NodeId, y: NodeId) -> Option<NodeId> {
    if is(b, y, 1.0) {
        return Some(x); // x / 1 = x
    }
    if is(b, y, -1.0) {
        return Some(b.neg(x)); // x / (−1) = −x
    }
    let c = real(b, y)?;
    let inverse = 1.0 / c;
    // x / 2ᵏ = x·2⁻ᵏ: exact as long as 2ᵏ and 2⁻ᵏ are normal in either precision.
    if c.to_bits() << 12 == 0 && (1e-37..1e37).contains(&c.abs()) {
        let inverse = b.real(inverse);
        return Some(b.mul(x, inverse));
    }
    None
}

fn truth(b: &Builder<'_>, x: NodeId, y: NodeId, absorbing: bool) -> Option<NodeId> {
    for (x, y) in [(x, y), (y, x)] {
        if let Some(Value::Bool(c)) = b.value(y) {
            return Some(if c == absorbing { y } else { x });
        }
    }
    None
}

fn select(b: &mut Builder<'_>, op: Op, cond: NodeId, x: NodeId, y: NodeId) -> Option<NodeId> {
    if let Some(Value::Bool(c)) = b.value(cond) {
        return Some(if c { x } else { y });
    }
    if x == y {
        return Some(x); // c ? x : x = x
    }
    if let Some((Op::Not, cond)) = unary(b, cond) {
        return Some(b.op(op, &[cond, y, x])); // ¬c ? x : y = c ? y : x
    }
    None
}
