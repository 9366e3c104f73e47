//! What the interval rules of the table are made of, and the rules of real arithmetic (LANGUAGE 15.4 to 15.6). They see
//! tidy operands only and know neither the precision nor the region that they are built in.

pub mod int;
pub mod truth;

use crate::{Builder, Enclosure, Node, NodeId, Op, Range, Scalar, Value};

/// An int from `lo` to `hi`.
#[derive(Clone, Copy)]
pub struct Ints {
    pub lo: NodeId,
    pub hi: NodeId,
}

/// Whether a truth value may be true and whether it may be false.
#[derive(Clone, Copy)]
pub struct Truth {
    pub yes: NodeId,
    pub no: NodeId,
}

impl From<Range> for Enclosure {
    fn from(x: Range) -> Self {
        Self::Real(x)
    }
}

impl From<Ints> for Enclosure {
    fn from(x: Ints) -> Self {
        Self::Int { lo: x.lo, hi: x.hi }
    }
}

impl From<Truth> for Enclosure {
    fn from(x: Truth) -> Self {
        Self::Bool { yes: x.yes, no: x.no }
    }
}

pub const fn real(x: Enclosure) -> Option<Range> {
    if let Enclosure::Real(x) = x { Some(x) } else { None }
}

pub const fn int(x: Enclosure) -> Option<Ints> {
    if let Enclosure::Int { lo, hi } = x { Some(Ints { lo, hi }) } else { None }
}

pub const fn truth(x: Enclosure) -> Option<Truth> {
    if let Enclosure::Bool { yes, no } = x { Some(Truth { yes, no }) } else { None }
}

/// Everything that a scalar can be, and NaN.
pub fn anything(b: &mut Builder<'_>, scalar: Scalar) -> Enclosure {
    let any = b.bool(true);
    match scalar {
        Scalar::Real => {
            let (lo, hi) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
            Enclosure::Real(Range { lo, hi, nan: any, tidy: true })
        }
        Scalar::Int => Enclosure::Int { lo: b.int(i32::MIN), hi: b.int(i32::MAX) },
        Scalar::Bool => Enclosure::Bool { yes: any, no: any },
    }
}

/// `enclosed!(|b, x: real, n: int| -> Real { … })`: the rule of an operation, whose body gives a `Range`, `Ints` or
/// `Truth`; `|b, facts; …|` reads the facts too. Operands that do not fit give everything.
macro_rules! enclosed {
    (|$b:ident, $($x:ident : $k:ident),+| -> $r:ident $body:block) => {
        $crate::ops::enclose::enclosed!(|$b, _facts; $($x: $k),+| -> $r $body)
    };
    (|$b:ident, $facts:ident; $($x:ident : $k:ident),+| -> $r:ident $body:block) => {
        |$b, operands, $facts| {
            if let [$($x),+] = *operands $( && let Some($x) = $crate::ops::enclose::$k($x) )+ {
                $crate::Enclosure::from($body)
            } else {
                $crate::ops::enclose::anything($b, $crate::Scalar::$r)
            }
        }
    };
}

pub(crate) use enclosed;

/// Whether an end is a constant that is finite in either precision, perhaps with its sign changed.
fn finite(b: &Builder<'_>, x: NodeId) -> bool {
    let x = match b.graph().get(x) {
        Some(Node::Apply(Op::Neg, x)) => x.as_slice().first().copied().unwrap_or(NodeId::NONE),
        _ => x,
    };
    matches!(b.literal(x), Some(x) if x.abs() <= f64::from(f32::MAX))
}

/// Whether a number, which is no NaN, is not below 0 whatever the operands: by the operations that made it.
pub fn nonnegative(b: &Builder<'_>, x: NodeId) -> bool {
    /// As far as this looks: sums of as many squares as vectors have components, and what choices make of them.
    const DEPTH: u32 = 5;
    fn look(b: &Builder<'_>, x: NodeId, depth: u32) -> bool {
        if b.literal(x).is_some_and(|x| x >= 0.0) {
            return true;
        }
        let (Some(Node::Apply(op, args)), Some(depth)) = (b.graph().get(x), depth.checked_sub(1)) else { return false };
        match (op, args.as_slice()) {
            (Op::Abs | Op::Sqrt | Op::SqrtDown | Op::SqrtUp | Op::Raised | Op::Lowered, _) => true,
            (Op::Max, &[x, y]) => look(b, x, depth) || look(b, y, depth),
            (Op::Mul | Op::MulDown | Op::MulUp, &[x, y]) if x == y => true,
            (Op::Add | Op::AddDown | Op::AddUp | Op::Mul | Op::MulDown | Op::MulUp | Op::Min, &[x, y])
            | (Op::Select, &[_, x, y]) => look(b, x, depth) && look(b, y, depth),
            _ => false,
        }
    }
    look(b, x, DEPTH)
}

/// The ends, where one that ∞ − ∞ or ∞ / ∞ left undefined is as far out as it can be.
fn defined(b: &mut Builder<'_>, lo: NodeId, hi: NodeId) -> (NodeId, NodeId) {
    let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
    (b.max(least, lo), b.min(most, hi))
}

/// Whether a value may be infinite.
fn infinite(b: &mut Builder<'_>, a: Range) -> NodeId {
    let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
    let (below, above) = (b.eq(a.lo, least), b.eq(a.hi, most));
    b.or(below, above)
}

/// Whether a value may be 0.
fn zero_in(b: &mut Builder<'_>, a: Range) -> NodeId {
    let zero = b.real(0.0);
    let (below, above) = (b.le(a.lo, zero), b.le(zero, a.hi));
    b.and(below, above)
}

/// The smallest and the largest of |a|.
pub fn magnitudes(b: &mut Builder<'_>, a: Range) -> (NodeId, NodeId) {
    if nonnegative(b, a.lo) {
        return (a.lo, a.hi);
    }
    let zero = b.real(0.0);
    let (below, above) = (b.neg(a.lo), b.neg(a.hi));
    let right = b.max(zero, a.lo);
    (b.max(right, above), b.max(below, a.hi))
}

/// From `lo` to `hi` and perhaps NaN, but NaN at both ends if `nothing` of the operand lies in the domain
/// (LANGUAGE 15.6). Reading such a range again costs two selections: see [`Range::tidied`].
pub fn cut(b: &mut Builder<'_>, nothing: NodeId, lo: NodeId, hi: NodeId, nan: NodeId) -> Range {
    let none = b.real(f64::NAN);
    let tidy = b.value(nothing) == Some(Value::Bool(false));
    let nan = b.or(nan, nothing);
    Range { lo: b.select(nothing, none, lo), hi: b.select(nothing, none, hi), nan, tidy }
}

/// A rule of an operation that never falls: both ends.
pub fn ends(b: &mut Builder<'_>, op: Op, a: Range) -> Range {
    Range { lo: b.op(op, &[a.lo]), hi: b.op(op, &[a.hi]), nan: a.nan, tidy: true }
}

pub fn neg(b: &mut Builder<'_>, a: Range) -> Range {
    Range { lo: b.neg(a.hi), hi: b.neg(a.lo), nan: a.nan, tidy: true }
}

/// [a+c .. b+d]; ∞ − ∞ if a + d or b + c is.
pub fn add(b: &mut Builder<'_>, a: Range, c: Range) -> Range {
    let (lo, hi) = (b.add_down(a.lo, c.lo), b.add_up(a.hi, c.hi));
    let nan = b.or(a.nan, c.nan);
    if [a, c].iter().any(|x| finite(b, x.lo) && finite(b, x.hi)) {
        return Range { lo, hi, nan, tidy: true };
    }
    if nonnegative(b, a.lo) && nonnegative(b, c.lo) {
        return Range { lo, hi, nan, tidy: true };
    }
    let (lo, hi) = defined(b, lo, hi);
    let (one, other) = (b.add(a.lo, c.hi), b.add(a.hi, c.lo));
    let (one, other) = (b.ne(one, one), b.ne(other, other));
    let undefined = b.or(one, other);
    Range { lo, hi, nan: b.or(nan, undefined), tidy: true }
}

pub fn sub(b: &mut Builder<'_>, a: Range, c: Range) -> Range {
    let c = neg(b, c);
    add(b, a, c)
}

/// The value whose enclosure this is, if it is a point; NaN if that is.
fn point(b: &Builder<'_>, a: Range) -> Option<NodeId> {
    if a.lo == a.hi {
        return Some(a.lo);
    }
    // The two ends that `Enclosure::point` makes.
    match (b.graph().get(a.lo)?, b.graph().get(a.hi)?) {
        (Node::Apply(Op::Max, lo), Node::Apply(Op::Min, hi)) => match (lo.as_slice(), hi.as_slice()) {
            (&[least, x], &[most, y]) => {
                let open = b.value(least) == Some(Value::Real(f64::NEG_INFINITY))
                    && b.value(most) == Some(Value::Real(f64::INFINITY));
                (open && x == y).then_some(x)
            }
            _ => None,
        },
        _ => None,
    }
}

/// [0 or min² .. max²]
fn square(b: &mut Builder<'_>, a: Range) -> Range {
    let (least, most) = magnitudes(b, a);
    Range { lo: b.mul_down(least, least), hi: b.mul_up(most, most), nan: a.nan, tidy: true }
}

/// The hull of the four products with 0·∞ = 0. For each end y of C one end of A alone gives the least x·y, and the
/// other the largest: which, says the sign of y. If C is never negative, the sign of an end of A says the end of C.
pub fn mul(b: &mut Builder<'_>, a: Range, c: Range, same: bool) -> Range {
    if same {
        return square(b, a);
    }
    let last = |x: Range| (point(b, x).is_some(), nonnegative(b, x.lo));
    let (a, c) = if last(a) > last(c) { (c, a) } else { (a, c) };
    let zero = b.real(0.0);
    let products = |b: &mut Builder<'_>, y: NodeId, rises: NodeId| {
        let (x_lo, x_hi) = (b.select(rises, a.lo, a.hi), b.select(rises, a.hi, a.lo));
        (b.mul_down(x_lo, y), b.mul_up(x_hi, y))
    };
    let (lo, hi) = if let Some(y) = point(b, c) {
        let rises = b.le(zero, y);
        let (lo, hi) = products(b, y, rises);
        // What a NaN gives is not specified.
        let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
        if c.lo == c.hi { (lo, hi) } else { (b.select(c.nan, least, lo), b.select(c.nan, most, hi)) }
    } else if nonnegative(b, c.lo) {
        let (above_lo, above_hi) = if nonnegative(b, a.lo) {
            let always = b.bool(true);
            (always, always)
        } else {
            (b.le(zero, a.lo), b.le(zero, a.hi))
        };
        let (y_lo, y_hi) = (b.select(above_lo, c.lo, c.hi), b.select(above_hi, c.hi, c.lo));
        (b.mul_down(a.lo, y_lo), b.mul_up(a.hi, y_hi))
    } else {
        let (rises, rises_too) = (b.le(zero, c.lo), b.le(zero, c.hi));
        let ((lo, hi), (lo_too, hi_too)) = (products(b, c.lo, rises), products(b, c.hi, rises_too));
        (b.min(lo, lo_too), b.max(hi, hi_too))
    };
    let nan = b.or(a.nan, c.nan);
    let (zero_a, zero_c) = (zero_in(b, a), zero_in(b, c));
    let (endless_a, endless_c) = (infinite(b, a), infinite(b, c));
    let (one, other) = (b.and(zero_a, endless_c), b.and(zero_c, endless_a));
    let undefined = b.or(one, other);
    Range { lo, hi, nan: b.or(nan, undefined), tidy: true }
}

/// The hull of the four quotients, [−∞..∞] if 0 ∈ C. Otherwise C has one sign, which says the end of A that gives the
/// least quotient; the sign of that end says the end of C.
pub fn div(b: &mut Builder<'_>, a: Range, c: Range) -> Range {
    let (zero, least, most) = (b.real(0.0), b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
    let rises = b.lt(zero, c.lo);
    let (x_lo, x_hi) = (b.select(rises, a.lo, a.hi), b.select(rises, a.hi, a.lo));
    let (above_lo, above_hi) = (b.le(zero, x_lo), b.le(zero, x_hi));
    let (y_lo, y_hi) = (b.select(above_lo, c.hi, c.lo), b.select(above_hi, c.lo, c.hi));
    let (lo, hi) = (b.div_down(x_lo, y_lo), b.div_up(x_hi, y_hi));
    let (endless_a, endless_c) = (infinite(b, a), infinite(b, c));
    let (zero_a, pole) = (zero_in(b, a), zero_in(b, c));
    let endless = b.and(endless_a, endless_c);
    let (lo, hi) = if b.value(endless) == Some(Value::Bool(false)) { (lo, hi) } else { defined(b, lo, hi) };
    let nothing = b.and(zero_a, pole);
    let undefined = b.or(endless, nothing);
    let nan = b.or(a.nan, c.nan);
    Range { lo: b.select(pole, least, lo), hi: b.select(pole, most, hi), nan: b.or(nan, undefined), tidy: true }
}

pub fn sqrt(b: &mut Builder<'_>, a: Range) -> Range {
    if nonnegative(b, a.lo) {
        return Range { lo: b.sqrt_down(a.lo), hi: b.sqrt_up(a.hi), ..a };
    }
    let zero = b.real(0.0);
    let (outside, nothing) = (b.lt(a.lo, zero), b.lt(a.hi, zero));
    let least = b.max(zero, a.lo);
    let (lo, hi) = (b.sqrt_down(least), b.sqrt_up(a.hi));
    let nan = b.or(a.nan, outside);
    cut(b, nothing, lo, hi, nan)
}

/// [1/√b .. 1/√a]
pub fn inverse_sqrt(b: &mut Builder<'_>, a: Range) -> Range {
    let (zero, one) = (b.real(0.0), b.real(1.0));
    let (outside, nothing) = (b.lt(a.lo, zero), b.lt(a.hi, zero));
    let (least, most) = (b.max(zero, a.lo), b.max(zero, a.hi));
    let (short, long) = (b.sqrt_down(least), b.sqrt_up(most));
    let (lo, hi) = (b.div_down(one, long), b.div_up(one, short));
    let nan = b.or(a.nan, outside);
    cut(b, nothing, lo, hi, nan)
}

pub fn abs(b: &mut Builder<'_>, a: Range) -> Range {
    let (lo, hi) = magnitudes(b, a);
    Range { lo, hi, nan: a.nan, tidy: true }
}

/// Ends pairwise. Where C is NaN the result is A, and where A is NaN it is NaN (LANGUAGE 15.6).
pub fn min(b: &mut Builder<'_>, a: Range, c: Range) -> Range {
    let (lo, hi) = (b.min(a.lo, c.lo), b.min(a.hi, c.hi));
    Range { lo, hi: b.select(c.nan, a.hi, hi), nan: a.nan, tidy: true }
}

pub fn max(b: &mut Builder<'_>, a: Range, c: Range) -> Range {
    let (lo, hi) = (b.max(a.lo, c.lo), b.max(a.hi, c.hi));
    Range { lo: b.select(c.nan, a.lo, lo), hi, nan: a.nan, tidy: true }
}

/// A − k if ⌊a⌋ = ⌊b⌋ = k, else [0..1]; ∞ − ∞ if an end is infinite.
pub fn fract(b: &mut Builder<'_>, a: Range) -> Range {
    let (zero, one) = (b.real(0.0), b.real(1.0));
    let (first, last) = (b.floor(a.lo), b.floor(a.hi));
    // ∞ − ∞ is no 0.
    let steps = b.sub(last, first);
    let smooth = b.eq(steps, zero);
    let back = b.neg(first);
    let (lo, hi) = (b.add_down(a.lo, back), b.add_up(a.hi, back));
    let undefined = infinite(b, a);
    let (lo, hi) = (b.select(smooth, lo, zero), b.select(smooth, hi, one));
    Range { lo, hi, nan: b.or(a.nan, undefined), tidy: true }
}

/// A − C·⌊A/C⌋, cut to the hull of 0 and C. The computed remainder leaves that hull by at most 2 ulp of a: one for the
/// error of a/c, which is as much of a, and one for that of c·⌊a/c⌋, half a unit of a number of at most 2|a|.
pub fn modulo(b: &mut Builder<'_>, a: Range, c: Range) -> Range {
    let (zero, most) = (b.real(0.0), b.real(f64::INFINITY));
    let quotient = div(b, a, c);
    let whole = ends(b, Op::Floor, quotient);
    let less = mul(b, c, whole, false);
    let rest = sub(b, a, less);

    let (_, size) = magnitudes(b, a);
    let next = b.next_up(size);
    let ulp = b.sub(next, size);
    let ulp = b.min(most, ulp); // ∞ − ∞ cuts nothing
    let slack = b.add(ulp, ulp);
    let down = b.neg(slack);
    let (below, above) = (b.min(zero, c.lo), b.max(zero, c.hi));
    let (below, above) = (b.add_down(below, down), b.add_up(above, slack));

    let (lo, hi) = (b.max(rest.lo, below), b.min(rest.hi, above));
    let (endless_a, endless_c, pole) = (infinite(b, a), infinite(b, c), zero_in(b, c));
    let endless = b.or(endless_a, endless_c);
    let undefined = b.or(endless, pole);
    // Nothing in common: every value is NaN.
    let common = b.le(lo, hi);
    let regular = b.not(pole);
    let known = b.and(regular, common);
    let nan = b.or(a.nan, c.nan);
    Range { lo: b.select(known, lo, below), hi: b.select(known, hi, above), nan: b.or(nan, undefined), tidy: true }
}

/// [√Σmᵢ² .. √ΣMᵢ²] with mᵢ, Mᵢ the smallest and the largest |aᵢ|.
pub fn length(b: &mut Builder<'_>, v: &[Range]) -> Range {
    let mut sum: Option<Range> = None;
    for a in v {
        let square = square(b, *a);
        sum = Some(match sum {
            None => square,
            Some(sum) => Range {
                lo: b.add_down(sum.lo, square.lo),
                hi: b.add_up(sum.hi, square.hi),
                nan: b.or(sum.nan, square.nan),
                tidy: true,
            },
        });
    }
    let zero = b.real(0.0);
    let Some(sum) = sum else { return Range::of(b, zero, zero) };
    Range { lo: b.sqrt_down(sum.lo), hi: b.sqrt_up(sum.hi), ..sum }
}

/// |A| with the signs that B may have. Which sign a 0 or a NaN has is not known.
pub fn copysign(b: &mut Builder<'_>, a: Range, s: Range) -> Range {
    let zero = b.real(0.0);
    let (least, most) = magnitudes(b, a);
    let (below, above) = (b.le(s.lo, zero), b.le(zero, s.hi));
    let (below, above) = (b.or(below, s.nan), b.or(above, s.nan));
    let (low, high) = (b.neg(most), b.neg(least));
    Range { lo: b.select(below, low, least), hi: b.select(above, most, high), nan: a.nan, tidy: true }
}

/// The quotients by the positive part of L, and 0 if 0 ∈ L; everything if L has a negative part, which lengths and
/// roots have not. Of a part of a vector of that length it is cut to [−1..1].
pub fn unit(b: &mut Builder<'_>, a: Range, l: Range, part: bool) -> Range {
    let (zero, one, less) = (b.real(0.0), b.real(1.0), b.real(-1.0));
    let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
    let near = b.max(zero, l.lo);
    let (touches, some, odd) = (b.le(l.lo, zero), b.lt(zero, l.hi), b.lt(l.lo, zero));

    // a/l over l > 0, or its limit as l goes to 0.
    let (right, left) = (b.le(zero, a.lo), b.le(a.hi, zero));
    let (by_lo, by_hi) = (b.select(right, l.hi, near), b.select(left, l.hi, near));
    let (lo, hi) = (b.div_down(a.lo, by_lo), b.div_up(a.hi, by_hi));
    let (lo, hi) = defined(b, lo, hi);
    let (open_lo, open_hi) = (b.not(right), b.not(left));
    let (open_lo, open_hi) = (b.and(open_lo, touches), b.and(open_hi, touches));
    let (lo, hi) = (b.select(open_lo, least, lo), b.select(open_hi, most, hi));

    let (lo_too, hi_too) = (b.min(lo, zero), b.max(hi, zero));
    let (lo, hi) = (b.select(touches, lo_too, lo), b.select(touches, hi_too, hi));
    let (lo, hi) = (b.select(some, lo, zero), b.select(some, hi, zero));
    let (lo, hi) = (b.select(odd, least, lo), b.select(odd, most, hi));

    let (endless_a, endless_l) = (infinite(b, a), infinite(b, l));
    let undefined = b.and(endless_a, endless_l);
    let nan = b.or(a.nan, l.nan);
    let nan = b.or(nan, undefined);
    if !part {
        return Range { lo, hi, nan, tidy: true };
    }
    let (lo, hi) = (b.max(less, lo), b.min(one, hi));
    // A squared component that underflows leaves a part longer than the whole: the ends stay in order.
    Range { lo: b.min(one, lo), hi: b.max(less, hi), nan, tidy: true }
}
