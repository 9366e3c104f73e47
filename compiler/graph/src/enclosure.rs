//! Enclosures as graph nodes: what is known of a value while its operands range over intervals (LANGUAGE 15). The rule
//! of each operation stands in the op table; how regions are enclosed is the business of the transforms.

use crate::{Builder, Node, NodeId, Op, Scalar, Value};

/// The ends of an enclosure of a real and whether the value may be NaN: a real, a real, a bool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Range {
    /// The lower end.
    pub lo: NodeId,
    /// The upper end.
    pub hi: NodeId,
    /// Whether the value may be NaN (LANGUAGE 15.6).
    pub nan: NodeId,
    /// Whether the ends are known to be numbers of `real` in order. Rules get tidy operands only; only a rule whose
    /// operand can lie outside of the operation's domain gives a range that is not.
    pub tidy: bool,
}

/// What encloses a scalar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Enclosure {
    /// A real.
    Real(Range),
    /// An int from `lo` to `hi`, in order.
    Int {
        /// The least.
        lo: NodeId,
        /// The largest.
        hi: NodeId,
    },
    /// A truth value; one of the two bools is true.
    Bool {
        /// Whether it may be true.
        yes: NodeId,
        /// Whether it may be false.
        no: NodeId,
    },
}

/// What a rule may know of its operands beside their enclosures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Facts {
    /// Operands a and b are the same value.
    pub same: bool,
    /// Operand b is the length of a vector with component a.
    pub part: bool,
}

impl Range {
    /// With these ends in order; never NaN.
    #[must_use]
    pub fn of(b: &mut Builder<'_>, lo: NodeId, hi: NodeId) -> Self {
        Self { lo, hi, nan: b.bool(false), tidy: true }
    }

    /// As every operation reads it: with ends in order, and everything that may be NaN if an end is NaN
    /// (LANGUAGE 15.2). The ends are numbers of `real`.
    #[must_use]
    pub fn tidied(self, b: &mut Builder<'_>) -> Self {
        if self.tidy {
            return self;
        }
        let (least, most) = (b.real(f64::NEG_INFINITY), b.real(f64::INFINITY));
        if let Some((nothing, lo, hi)) = self.cut(b) {
            return Self {
                lo: b.select(nothing, least, lo),
                hi: b.select(nothing, most, hi),
                nan: self.nan,
                tidy: true,
            };
        }
        let (lo, hi) = (b.rounded_to_real(self.lo), b.rounded_to_real(self.hi));
        if b.literal(lo).is_some_and(|x| b.literal(hi).is_some_and(|y| x <= y)) {
            return Self { lo, hi, nan: self.nan, tidy: true };
        }
        if lo == hi {
            // −∞ and ∞ for NaN: `point` of the rules knows these ends.
            let unknown = b.ne(lo, lo);
            return Self { lo: b.max(least, lo), hi: b.min(most, hi), nan: b.or(self.nan, unknown), tidy: true };
        }
        let (low, high) = (b.min(lo, hi), b.max(lo, hi));
        let (number, number_too) = (b.eq(lo, lo), b.eq(hi, hi));
        let known = b.and(number, number_too);
        let unknown = b.not(known);
        let (lo, hi) = (b.select(known, low, least), b.select(known, high, most));
        Self { lo, hi, nan: b.or(self.nan, unknown), tidy: true }
    }

    /// The bool that tells that nothing of the operand was in the domain, and the ends, in order, if something was: for
    /// a range made by `ops::enclose::cut`. Nobody else can set a flag together with the ends that it flags.
    fn cut(self, b: &Builder<'_>) -> Option<(NodeId, NodeId, NodeId)> {
        let select = |x: NodeId| match b.graph().get(x)? {
            Node::Apply(Op::Select, args) => match args.as_slice() {
                &[nothing, none, x] if matches!(b.value(none), Some(Value::Real(none)) if none.is_nan()) => {
                    Some((nothing, x))
                }
                _ => None,
            },
            _ => None,
        };
        let ((nothing, lo), (nothing_too, hi)) = (select(self.lo)?, select(self.hi)?);
        let flags = match b.graph().get(self.nan)? {
            Node::Apply(Op::Or, args) => args.as_slice().contains(&nothing),
            _ => self.nan == nothing,
        };
        (nothing == nothing_too && flags).then_some((nothing, lo, hi))
    }
}

impl Enclosure {
    /// Of one value of a run.
    #[must_use]
    pub fn point(b: &mut Builder<'_>, x: NodeId) -> Self {
        match b.graph().scalar(x) {
            Scalar::Real => {
                let nan = b.bool(false);
                Self::Real(Range { lo: x, hi: x, nan, tidy: false }.tidied(b))
            }
            Scalar::Int => Self::Int { lo: x, hi: x },
            Scalar::Bool => Self::Bool { yes: x, no: b.not(x) },
        }
    }

    /// As every operation reads it.
    #[must_use]
    pub fn tidied(self, b: &mut Builder<'_>) -> Self {
        match self {
            Self::Real(range) => Self::Real(range.tidied(b)),
            other => other,
        }
    }

    /// The hull of both, which are of one kind.
    #[must_use]
    pub fn hull(self, other: Self, b: &mut Builder<'_>) -> Self {
        match (self, other) {
            (Self::Real(x), Self::Real(y)) => {
                let (x, y) = (x.tidied(b), y.tidied(b));
                Self::Real(Range { lo: b.min(x.lo, y.lo), hi: b.max(x.hi, y.hi), nan: b.or(x.nan, y.nan), tidy: true })
            }
            (Self::Int { lo, hi }, Self::Int { lo: lo2, hi: hi2 }) => {
                Self::Int { lo: b.op(Op::IntMin, &[lo, lo2]), hi: b.op(Op::IntMax, &[hi, hi2]) }
            }
            (Self::Bool { yes, no }, Self::Bool { yes: yes2, no: no2 }) => {
                Self::Bool { yes: b.or(yes, yes2), no: b.or(no, no2) }
            }
            _ => self,
        }
    }
}

impl Builder<'_> {
    /// The value of a constant, also of one that raw graphs keep apart or round; before the rounding.
    pub(crate) fn literal(&self, id: NodeId) -> Option<f64> {
        let mut at = id;
        loop {
            match self.graph().get(at)? {
                Node::Real(bits) => return Some(f64::from_bits(bits)),
                Node::Fresh(x) => at = x,
                Node::Apply(Op::Rounded, args) => at = args.as_slice().first().copied()?,
                _ => return None,
            }
        }
    }

    /// What encloses an operation on enclosed operands (LANGUAGE 15.4 to 15.6).
    pub fn enclose(&mut self, op: Op, operands: &[Enclosure], facts: Facts) -> Enclosure {
        let mut tidy = [Enclosure::Int { lo: NodeId::NONE, hi: NodeId::NONE }; 4];
        for (place, operand) in tidy.iter_mut().zip(operands) {
            *place = operand.tidied(self);
        }
        (op.def().enclosure)(self, tidy.get(..operands.len()).unwrap_or(&[]), facts)
    }
}
