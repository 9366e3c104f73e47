//! Operations on what is known of values. Knows which operations decide something, and by which choices a run goes on
//! where the decision is open.

use std::collections::BTreeMap;

use isograd_graph::{Graph, Node, NodeId, Op, Scalar, Value};

use super::Model;
use super::interval::{Interval, nearest, ulp};
use super::walk::{Machine, Operation, Stop};

/// What is known of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Known {
    /// One of these.
    Real(Interval),
    Int(i32),
    Bool(bool),
    /// Either truth value: what this step computed.
    Maybe(u64),
    /// Nothing, by this rule.
    Lost(&'static str),
}

/// Computes intervals.
pub struct Bounds<'g> {
    pub model: Model,
    pub graph: &'g Graph,
    /// For steps whose result is one of two, which: true is the true, the upper, the negative one.
    pub choices: BTreeMap<u64, bool>,
}

impl Machine for Bounds<'_> {
    type Value = Known;

    fn given(&mut self, value: Value) -> Known {
        match value {
            Value::Int(x) => Known::Int(x),
            Value::Bool(x) => Known::Bool(x),
            Value::Real(x) if x.is_infinite() => Known::Real(Interval::point(x)),
            Value::Real(x) => Interval::settled(x, x, &self.model).map_or_else(Known::Lost, Known::Real),
        }
    }

    fn apply(&mut self, o: &Operation<'_, Known>) -> Result<Known, Stop> {
        let args: Vec<Known> = o.args.iter().map(|id| o.value(*id)).collect();
        match (o.op, args.as_slice()) {
            (Op::Select | Op::SelectInt | Op::SelectBool, [cond, then, otherwise]) => {
                self.select(o.step, *cond, *then, *otherwise)
            }
            (Op::And | Op::Or | Op::Not, args) => Ok(self.logic(o.op, o.step, args)),
            (_, args) => {
                if let Some(Known::Lost(rule)) = args.iter().find(|x| matches!(x, Known::Lost(_))) {
                    return Ok(Known::Lost(rule));
                }
                let same = matches!(o.args, [a, b] if a == b);
                self.on_known(o, args, same)
            }
        }
    }

    fn truth(&mut self, value: Known) -> Result<bool, Stop> {
        match value {
            Known::Bool(x) => Ok(x),
            Known::Maybe(step) => Err(Stop::Fork(step)),
            Known::Lost(rule) => Err(Stop::Special(rule)),
            Known::Real(_) | Known::Int(_) => Err(Stop::Special("not a truth value")),
        }
    }

    fn int(&mut self, value: Known) -> Result<i32, Stop> {
        match value {
            Known::Int(x) => Ok(x),
            Known::Lost(rule) => Err(Stop::Special(rule)),
            _ => Err(Stop::Special("not an int")),
        }
    }
}

impl Bounds<'_> {
    fn maybe(&self, step: u64) -> Known {
        self.choices.get(&step).map_or(Known::Maybe(step), |choice| Known::Bool(*choice))
    }

    /// One of two values, by the choice for this step.
    fn either<T>(&self, step: u64, no: T, yes: T) -> Result<T, Stop> {
        match self.choices.get(&step) {
            None => Err(Stop::Fork(step)),
            Some(true) => Ok(yes),
            Some(false) => Ok(no),
        }
    }

    fn logic(&self, op: Op, step: u64, args: &[Known]) -> Known {
        match (op, args) {
            (Op::Not, [Known::Bool(a)]) => Known::Bool(!a),
            (Op::And, [Known::Bool(false), _] | [_, Known::Bool(false)]) => Known::Bool(false),
            (Op::Or, [Known::Bool(true), _] | [_, Known::Bool(true)]) => Known::Bool(true),
            (_, [Known::Bool(_), other] | [other, Known::Bool(_)]) => *other,
            (_, [Known::Lost(rule), ..] | [_, Known::Lost(rule)]) => Known::Lost(rule),
            _ => self.maybe(step),
        }
    }

    /// Where the condition is open, both results together if that says not much less than either, as where the smaller
    /// of two nearly equal numbers is taken; else it is to be decided.
    fn select(&self, step: u64, cond: Known, then: Known, otherwise: Known) -> Result<Known, Stop> {
        let origin = match cond {
            Known::Bool(true) => return Ok(then),
            Known::Bool(false) => return Ok(otherwise),
            Known::Lost(rule) => return Ok(Known::Lost(rule)),
            Known::Maybe(origin) => origin,
            Known::Real(_) | Known::Int(_) => return Ok(Known::Lost("not a truth value")),
        };
        match (then, otherwise) {
            (a, b) if a == b => Ok(a),
            (Known::Real(a), Known::Real(b)) if !a.is_infinite() && !b.is_infinite() => {
                let hull = a.hull(b);
                if hull.width() <= 2.0 * a.width().max(b.width()) {
                    Ok(Known::Real(hull))
                } else {
                    Err(Stop::Fork(origin))
                }
            }
            (Known::Bool(_) | Known::Maybe(_), Known::Bool(_) | Known::Maybe(_)) => Ok(self.maybe(step)),
            _ => Err(Stop::Fork(origin)),
        }
    }

    /// Operands are known, but for truth values; `same` if both are one node.
    fn on_known(&self, o: &Operation<'_, Known>, args: &[Known], same: bool) -> Result<Known, Stop> {
        use Known::{Bool, Int, Real};
        let (op, step, model) = (o.op, o.step, &self.model);
        let interval = |result: Result<Interval, &'static str>| Ok(result.map_or_else(Known::Lost, Real));
        match (op, args) {
            (Op::Add, [Real(a), Real(b)]) => match a.add(*b, model) {
                Ok(sum) if sum.width() == 1.0 && o.args.iter().any(|id| self.rounds_to_integers(*id)) => {
                    Ok(Real(Interval::point(self.either(step, sum.lo, sum.hi)?)))
                }
                sum => interval(sum),
            },
            // A fused operand need not be the number that the other one is.
            (Op::Sub, [Real(a), Real(_)]) if same && !model.contracts && !a.is_infinite() => {
                Ok(Real(Interval::point(0.0)))
            }
            (Op::Sub, [Real(a), Real(b)]) => match self.split(o) {
                Some(upper) if upper.is_point() => Ok(Real(upper)),
                // Neighbours on the grid of the upper halves.
                Some(upper) if upper.width() <= ulp(a.size().hi) => {
                    Ok(Real(Interval::point(self.either(step, upper.lo, upper.hi)?)))
                }
                _ => interval(a.add(b.neg(), model)),
            },
            (Op::Mul, [Real(a), Real(_)]) if same => interval(a.square(model)),
            (Op::Mul, [Real(a), Real(b)]) => interval(a.mul(*b, model)),
            (Op::Div, [Real(a), Real(b)]) => interval(a.div(*b, model)),
            (Op::Sqrt, [Real(a)]) => interval(a.sqrt(model)),
            (Op::Neg, [Real(a)]) => Ok(Real(a.neg())),
            (Op::Abs, [Real(a)]) => Ok(Real(a.size())),
            (Op::Min, [Real(a), Real(b)]) => Ok(Real(smaller(*a, *b))),
            (Op::Max, [Real(a), Real(b)]) => Ok(Real(smaller(a.neg(), b.neg()).neg())),
            (Op::Floor, [Real(a)]) => self.whole(step, *a, f64::floor),
            (Op::Ceil, [Real(a)]) => self.whole(step, *a, f64::ceil),
            (Op::Trunc, [Real(a)]) => self.whole(step, *a, f64::trunc),
            (Op::NextUp, [Real(a)]) if !a.is_infinite() => interval(a.monotone(next_up, model)),
            (Op::NextDown, [Real(a)]) if !a.is_infinite() => interval(a.monotone(next_down, model)),
            (Op::Above | Op::Raised, [Real(a), cond]) => interval(stepped(*a, *cond, next_up, model)),
            (Op::Below | Op::Lowered, [Real(a), cond]) => interval(stepped(*a, *cond, next_down, model)),
            (Op::Copysign, [Real(a), Real(b)]) => self.copysign(step, *a, *b),
            (Op::Exponent, [Real(a)]) => self.exponent(step, *a),
            (Op::Scale, [Real(a), Int(n)]) => {
                interval(a.mul(Interval::point(2_f64.powi((*n).clamp(-126, 127))), model))
            }
            (Op::Lt, [Real(a), Real(b)]) => Ok(self.decided(step, same, a.hi < b.lo, a.lo >= b.hi || same)),
            (Op::Le, [Real(a), Real(b)]) => Ok(self.decided(step, same, a.hi <= b.lo || same, a.lo > b.hi)),
            (Op::Eq, [Real(a), Real(b)]) => Ok(self.equal(step, same, *a, *b)),
            (Op::Ne, [Real(a), Real(b)]) => Ok(match self.equal(step, same, *a, *b) {
                // A choice is about the result.
                Bool(x) if !self.choices.contains_key(&step) => Bool(!x),
                other => other,
            }),
            (Op::IntToReal, [Int(n)]) => Ok(Real(Interval::of_int(*n, model))),
            (Op::RealToInt, [Real(a)]) => self.real_to_int(step, *a),
            (_, args) if args.iter().all(|x| matches!(x, Int(_))) && op.def().result != Scalar::Real => {
                let ints: Vec<Value> =
                    args.iter().map(|x| if let Int(x) = x { Value::Int(*x) } else { Value::Int(0) }).collect();
                match (op.def().eval.f32)(&ints) {
                    Value::Int(x) => Ok(Int(x)),
                    Value::Bool(x) => Ok(Bool(x)),
                    Value::Real(_) => Ok(Known::Lost("no rule")),
                }
            }
            (Op::NextUp | Op::NextDown, [Real(_)]) => Ok(Known::Lost("infinity")),
            _ => Ok(Known::Lost("no rule")),
        }
    }

    /// The upper half of the digits of an x, where this is Veltkamp's c·x − (c·x − x). Rounding to nearest it never
    /// decreases with x and has few values, while intervals forget that all three x are one: they make it 8,000 times as
    /// wide as x is.
    fn split(&self, o: &Operation<'_, Known>) -> Option<Interval> {
        const SPLITTER: f64 = 4097.0;
        let Model { nearest: true, contracts: false, .. } = self.model else { return None };
        let args = |id: NodeId, op: Op| match self.graph.get(id) {
            Some(Node::Apply(found, args)) if found == op => match args.as_slice() {
                [a, b] => Some((*a, *b)),
                _ => None,
            },
            _ => None,
        };
        let [product, rest] = o.args else { return None };
        let (again, x) = args(*rest, Op::Sub)?;
        let (a, b) = args(*product, Op::Mul)?;
        let factor = if a == x { b } else { a };
        if again != *product || (a != x && b != x) || self.graph.get(factor) != Some(Node::real(SPLITTER)) {
            return None;
        }
        let Known::Real(x) = o.value(x) else { return None };
        let upper = |x: f64| {
            let product = nearest(SPLITTER * x);
            nearest(product - nearest(product - x))
        };
        Some(Interval { lo: upper(x.lo), hi: upper(x.hi) }).filter(|upper| upper.lo.is_finite() && upper.hi.is_finite())
    }

    /// Whether adding this node rounds to an integer, either one where the direction is free: then which one is as much
    /// a decision as that of a floor.
    fn rounds_to_integers(&self, term: NodeId) -> bool {
        self.graph.get(term) == Some(Node::real(1.5 * 2_f64.powi(23)))
    }

    fn decided(&self, step: u64, same: bool, holds: bool, fails: bool) -> Known {
        debug_assert!(!(holds && fails) || same);
        match (holds, fails) {
            (_, true) => Known::Bool(false),
            (true, _) => Known::Bool(true),
            _ => self.maybe(step),
        }
    }

    fn equal(&self, step: u64, same: bool, a: Interval, b: Interval) -> Known {
        let points = a.is_point() && b.is_point() && a.lo == b.lo;
        self.decided(step, same, same || points, !same && (a.hi < b.lo || b.hi < a.lo))
    }

    /// A rounding to integers: where it may be two of them, either; where more, all.
    fn whole(&self, step: u64, a: Interval, f: fn(f64) -> f64) -> Result<Known, Stop> {
        if a.is_infinite() {
            return Ok(Known::Real(a));
        }
        let all = Interval { lo: f(a.lo), hi: f(a.hi) };
        if all.hi - all.lo == 1.0 {
            return Ok(Known::Real(Interval::point(self.either(step, all.lo, all.hi)?)));
        }
        Ok(Known::Real(all))
    }

    fn real_to_int(&self, step: u64, a: Interval) -> Result<Known, Stop> {
        #[expect(clippy::cast_possible_truncation, reason = "the conversion cuts and saturates")]
        let (lo, hi) = (a.lo as i32, a.hi as i32);
        self.one_of(step, lo, hi)
    }

    fn exponent(&self, step: u64, a: Interval) -> Result<Known, Stop> {
        let size = a.size();
        let of = |x: f64| match (Op::Exponent.def().eval.f32)(&[Value::Real(x)]) {
            Value::Int(n) => n,
            _ => 0,
        };
        self.one_of(step, of(size.lo), of(size.hi))
    }

    fn one_of(&self, step: u64, lo: i32, hi: i32) -> Result<Known, Stop> {
        match i64::from(hi) - i64::from(lo) {
            0 => Ok(Known::Int(lo)),
            1 => Ok(Known::Int(self.either(step, lo, hi)?)),
            _ => Ok(Known::Lost("an int that rounding decides")),
        }
    }

    fn copysign(&self, step: u64, a: Interval, sign: Interval) -> Result<Known, Stop> {
        let size = a.size();
        let zero_tells = !self.model.unsigned_zeros && sign.is_zero();
        let negative = if zero_tells {
            sign.lo.is_sign_negative()
        } else if sign.lo > 0.0 {
            false
        } else if sign.hi < 0.0 {
            true
        } else if size.is_zero() {
            false
        } else {
            self.either(step, false, true)?
        };
        Ok(Known::Real(if negative { size.neg() } else { size }))
    }
}

/// What b < a selects of both: the smaller one, and a where they are equal.
fn smaller(a: Interval, b: Interval) -> Interval {
    if a.is_point() && b.is_point() {
        return if b.lo < a.lo { b } else { a };
    }
    Interval { lo: a.lo.min(b.lo), hi: a.hi.min(b.hi) }
}

fn stepped(a: Interval, cond: Known, step: fn(f64) -> f64, model: &Model) -> Result<Interval, &'static str> {
    if a.is_infinite() {
        return Err("infinity");
    }
    let moved = a.monotone(step, model)?;
    match cond {
        Known::Bool(true) => Ok(moved),
        Known::Bool(false) => Ok(a),
        Known::Maybe(_) => Ok(a.hull(moved)),
        _ => Err("no rule"),
    }
}

#[expect(clippy::cast_possible_truncation, reason = "an f32 number")]
fn next_up(x: f64) -> f64 {
    f64::from((x as f32).next_up())
}

#[expect(clippy::cast_possible_truncation, reason = "an f32 number")]
fn next_down(x: f64) -> f64 {
    f64::from((x as f32).next_down())
}
