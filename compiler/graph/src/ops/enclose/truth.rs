//! Interval rules of comparisons, three-valued logic and selection (LANGUAGE 15.5). They know nothing of branches: how
//! those are enclosed is the business of the transforms.

use super::{Ints, Truth};
use crate::{Builder, NodeId, Op, Range};

/// May be true if it is so for the best pair of ends, false if not for the worst; NaN makes it false (LANGUAGE 15.6).
pub fn lt(b: &mut Builder<'_>, a: Range, c: Range, same: bool) -> Truth {
    if same {
        return Truth { yes: b.bool(false), no: b.bool(true) };
    }
    let (yes, no, nan) = (b.lt(a.lo, c.hi), b.le(c.lo, a.hi), b.or(a.nan, c.nan));
    Truth { yes, no: b.or(no, nan) }
}

pub fn le(b: &mut Builder<'_>, a: Range, c: Range, same: bool) -> Truth {
    if same {
        return Truth { yes: b.bool(true), no: a.nan };
    }
    let (yes, no, nan) = (b.le(a.lo, c.hi), b.lt(c.lo, a.hi), b.or(a.nan, c.nan));
    Truth { yes, no: b.or(no, nan) }
}

/// May be true if A and C meet, false unless both are one point.
pub fn eq(b: &mut Builder<'_>, a: Range, c: Range, same: bool) -> Truth {
    if same {
        return Truth { yes: b.bool(true), no: a.nan };
    }
    let (left, right) = (b.le(a.lo, c.hi), b.le(c.lo, a.hi));
    let (apart, apart_too, nan) = (b.ne(a.lo, c.hi), b.ne(a.hi, c.lo), b.or(a.nan, c.nan));
    let apart = b.or(apart, apart_too);
    Truth { yes: b.and(left, right), no: b.or(apart, nan) }
}

pub const fn not(p: Truth) -> Truth {
    Truth { yes: p.no, no: p.yes }
}

pub fn and(b: &mut Builder<'_>, p: Truth, q: Truth) -> Truth {
    Truth { yes: b.and(p.yes, q.yes), no: b.or(p.no, q.no) }
}

pub fn or(b: &mut Builder<'_>, p: Truth, q: Truth) -> Truth {
    Truth { yes: b.or(p.yes, q.yes), no: b.and(p.no, q.no) }
}

/// `x` or `y` if the condition is decided, else what `op` makes of both.
fn decided(b: &mut Builder<'_>, c: Truth, choose: Op, x: NodeId, y: NodeId, op: Op) -> NodeId {
    let both = b.op(op, &[x, y]);
    let otherwise = b.op(choose, &[c.no, both, x]);
    b.op(choose, &[c.yes, otherwise, y])
}

pub fn select(b: &mut Builder<'_>, c: Truth, x: Range, y: Range) -> Range {
    Range {
        lo: decided(b, c, Op::Select, x.lo, y.lo, Op::Min),
        hi: decided(b, c, Op::Select, x.hi, y.hi, Op::Max),
        nan: decided(b, c, Op::SelectBool, x.nan, y.nan, Op::Or),
        tidy: true,
    }
}

pub fn select_int(b: &mut Builder<'_>, c: Truth, x: Ints, y: Ints) -> Ints {
    Ints {
        lo: decided(b, c, Op::SelectInt, x.lo, y.lo, Op::IntMin),
        hi: decided(b, c, Op::SelectInt, x.hi, y.hi, Op::IntMax),
    }
}

pub fn select_bool(b: &mut Builder<'_>, c: Truth, x: Truth, y: Truth) -> Truth {
    Truth {
        yes: decided(b, c, Op::SelectBool, x.yes, y.yes, Op::Or),
        no: decided(b, c, Op::SelectBool, x.no, y.no, Op::Or),
    }
}
