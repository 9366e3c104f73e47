//! Where operations are not differentiable (LANGUAGE 13.6, 14.2): the form in which the table says it, and the
//! discriminants that several operations share. Knows nothing of how derivatives are made.

use super::Op;
use crate::{Builder, Mode, NodeId, Precision, Unwatched, Value};

/// Where an operation is not differentiable, or its derivative follows a convention (LANGUAGE 13.6).
#[derive(Debug, Clone)]
pub enum Kink {
    /// Nowhere inside its domain.
    None,
    /// Where the discriminant, a function of the operands, is 0.
    Where {
        /// In words.
        set: &'static str,
        /// The discriminant in words. Its sign tells the two sides apart.
        measure: &'static str,
        /// The derivative where the discriminant is negative; where it is 0, which is the convention; and where it is
        /// positive.
        slopes: [&'static str; 3],
        /// Whether the value jumps there. Piecewise constant operations pass on jumps of their operands, but no creases.
        jumps: bool,
        /// Continuous near the set and 0 exactly on it.
        discriminant: Discriminant,
    },
}

/// A discriminant in graph operations: the builder, the operands.
pub type Discriminant = fn(&mut Builder<'_>, &[NodeId]) -> NodeId;

/// How far operands are from the kink of an operation, in f64: +∞ if it has none.
#[must_use]
pub fn discriminant(op: Op, operands: &[f64]) -> f64 {
    let Kink::Where { discriminant: rule, .. } = op.def().kink else { return f64::INFINITY };
    if operands.len() != op.def().operands.len() {
        return f64::NAN;
    }
    let mut b = Builder::new(Mode::Real(Precision::F64), 100, &Unwatched);
    let nodes: Vec<NodeId> = operands.iter().map(|x| b.real(*x)).collect();
    let result = rule(&mut b, &nodes);
    match b.value(result) {
        Some(Value::Real(x)) => x,
        _ => f64::NAN,
    }
}

/// Piecewise constant operations.
pub(super) const FLAT: [&str; 3] = ["0"; 3];
/// Below the domain there is no derivative.
pub(super) const OUTSIDE: &str = "none, outside of the domain";
/// Of a discriminant that is never negative.
pub(super) const NEVER: &str = "never";

/// a
pub(super) fn first(_: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    args.first().copied().unwrap_or(NodeId::NONE)
}

/// b
pub(super) fn second(_: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    args.get(1).copied().unwrap_or(NodeId::NONE)
}

/// a − b
pub(super) fn difference(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    match *args {
        [x, y] => b.sub(x, y),
        _ => NodeId::NONE,
    }
}

/// a − round a, exactly: where `floor`, `ceil` and `fract` jump.
pub(super) fn past_integer(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let x = first(b, args);
    let nearest = b.op(Op::Round, &[x]);
    b.sub(x, nearest)
}

/// a − the nearest integer that is not 0: where `trunc` jumps.
pub(super) fn past_integer_not_zero(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let x = first(b, args);
    let one = b.real(1.0);
    let size = b.abs(x);
    let nearest = b.op(Op::Round, &[size]);
    let nearest = b.max(nearest, one);
    let nearest = b.copysign(nearest, x);
    b.sub(x, nearest)
}

/// |a| − ⌊|a|⌋ − ½, which is 0 in halves only: a − ⌊a⌋ would round to ½ just above −½.
pub(super) fn past_half(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let x = first(b, args);
    let half = b.real(0.5);
    let size = b.abs(x);
    let whole = b.floor(size);
    let rest = b.sub(size, whole);
    b.sub(rest, half)
}

/// b·(a/b − round(a/b)): where `mod` jumps, in the units of a.
pub(super) fn past_multiple(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let [x, y] = *args else { return NodeId::NONE };
    let ratio = b.div(x, y);
    let rest = past_integer(b, &[ratio]);
    b.mul(y, rest)
}

/// 1 − |a|: where the arc functions of the unit interval have a vertical tangent.
pub(super) fn inside_unit(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let x = first(b, args);
    let one = b.real(1.0);
    let size = b.abs(x);
    b.sub(one, size)
}

/// a − 1
pub(super) fn past_one(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let x = first(b, args);
    let one = b.real(1.0);
    b.sub(x, one)
}

/// The length of the vector of all operands, 0 where it computes 0.
pub(super) fn length(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    match args.len() {
        2 => b.op(Op::Length2, args),
        3 => b.op(Op::Length3, args),
        4 => b.op(Op::Length4, args),
        _ => NodeId::NONE,
    }
}

/// a where 0 ≤ b < 1; elsewhere the slope of aᵇ at 0 is finite or at a pole, and there is no kink.
pub(super) fn root(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let [x, y] = *args else { return NodeId::NONE };
    let (zero, one, far) = (b.real(0.0), b.real(1.0), b.real(f64::INFINITY));
    let (from, below) = (b.le(zero, y), b.lt(y, one));
    let steep = b.and(from, below);
    b.select(steep, x, far)
}

/// The distance of the point (b, a) to the half-line b ≤ 0, a = 0 with the sign of a.
pub(super) fn off_cut(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let [y, x] = *args else { return NodeId::NONE };
    let zero = b.real(0.0);
    let behind = b.le(x, zero);
    let far = b.op(Op::Length2, &[y, x]);
    let far = b.copysign(far, y);
    b.select(behind, y, far)
}

/// The operand that is nearer to 0.
pub(super) fn nearer_to_zero(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let [x, y] = *args else { return NodeId::NONE };
    let (own, other) = (b.abs(x), b.abs(y));
    let nearer = b.lt(other, own);
    b.select(nearer, y, x)
}
