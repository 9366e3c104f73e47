//! Arithmetic in arbitrary precision, by an independent crate: what lies outside of an end does so without any doubt.
//! Knows the operations that real arithmetic is made of, and no rule of the op table.

use std::cmp::Ordering;

use dashu_float::ops::SquareRoot;
use dashu_float::{FBig, round::mode::Zero};
use isograd_graph::{Graph, Node, Op, Value};

/// A number of unlimited precision.
type Big = FBig<Zero, 2>;

/// Digits of compositions, whose roots and quotients have no last one.
const DIGITS: usize = 900;

fn big(x: f64) -> Option<Big> {
    Big::try_from(x).ok().filter(|_| x.is_finite()).map(|x| x.with_precision(0).value())
}

/// How the exact result of an operation on finite numbers compares with a finite number; `None` if that is not known.
#[must_use]
pub fn compare(op: Op, operands: &[f64], end: f64) -> Option<Ordering> {
    if !end.is_finite() || operands.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let exactly = big(end)?;
    let square = |x: &Big| x * x;
    Some(match (op, operands) {
        (Op::Add, [x, y]) => (big(*x)? + big(*y)?).cmp(&exactly),
        (Op::Sub, [x, y]) => (big(*x)? - big(*y)?).cmp(&exactly),
        (Op::Mul, [x, y]) => (big(*x)? * big(*y)?).cmp(&exactly),
        (Op::Div, [_, y]) if *y == 0.0 => return None,
        (Op::Div, [x, y]) => {
            let order = big(*x)?.cmp(&(exactly * big(*y)?));
            if *y < 0.0 { order.reverse() } else { order }
        }
        (Op::Sqrt, [x]) if *x < 0.0 => return None,
        (Op::Sqrt | Op::Length2 | Op::Length3 | Op::Length4, _) if end < 0.0 => Ordering::Greater,
        (Op::Sqrt, [x]) => big(*x)?.cmp(&square(&exactly)),
        (Op::Length2 | Op::Length3 | Op::Length4, v) => {
            let mut sum = Big::ZERO;
            for x in v {
                sum += square(&big(*x)?);
            }
            sum.cmp(&square(&exactly))
        }
        (Op::Fract, [x]) => (big(*x)? - big(x.floor())?).cmp(&exactly),
        _ => return None,
    })
}

/// Whether the exact result of an operation at a point lies outside of an enclosure.
#[must_use]
pub fn outside(op: Op, point: &[Value], enclosure: &[Value]) -> bool {
    let mut reals = [0.0; 4];
    for (place, value) in reals.iter_mut().zip(point) {
        let Value::Real(x) = value else { return false };
        *place = *x;
    }
    let [Value::Real(lo), Value::Real(hi), ..] = enclosure else { return false };
    let reals = &reals[..point.len().min(4)];
    compare(op, reals, *lo) == Some(Ordering::Less) || compare(op, reals, *hi) == Some(Ordering::Greater)
}

/// The value of every node of a graph of `+ − × ÷ √` without regions, to many more digits than any enclosure has; `None`
/// for what is undefined or uses something else.
#[must_use]
pub fn values(graph: &Graph, inputs: &[f64]) -> Vec<Option<Big>> {
    let mut values: Vec<Option<Big>> = Vec::with_capacity(graph.len());
    for (_, node) in graph.iter() {
        let value = match node {
            Node::Input(i) => inputs.get(i as usize).and_then(|x| big(*x)),
            Node::Real(bits) => big(f64::from_bits(bits)),
            Node::Fresh(x) => values.get(x.index()).cloned().flatten(),
            Node::Apply(op, args) => {
                let args: Option<Vec<Big>> =
                    args.as_slice().iter().map(|x| values.get(x.index()).cloned().flatten()).collect();
                args.and_then(|args| apply(op, &args))
            }
            _ => None,
        };
        values.push(value.map(|x| x.with_precision(DIGITS).value()));
    }
    values
}

fn apply(op: Op, args: &[Big]) -> Option<Big> {
    let zero = Big::ZERO;
    Some(match (op, args) {
        (Op::Add, [x, y]) => x + y,
        (Op::Sub, [x, y]) => x - y,
        (Op::Mul, [x, y]) => x * y,
        (Op::Div, [_, y]) if *y == zero => return None,
        (Op::Div, [x, y]) => x / y,
        (Op::Neg, [x]) => -x,
        (Op::Sqrt, [x]) if *x < zero => return None,
        (Op::Sqrt, [x]) if *x == zero => zero,
        (Op::Sqrt, [x]) => x.sqrt(),
        _ => return None,
    })
}

/// Whether a number lies in an enclosure; what its last digits may be wrong by counts as inside.
#[must_use]
pub fn inside(x: &Big, lo: f64, hi: f64) -> bool {
    let error = (if *x < Big::ZERO { -x } else { x.clone() }) >> 700;
    let above = lo == f64::NEG_INFINITY || big(lo).is_some_and(|lo| lo <= x + &error);
    let below = hi == f64::INFINITY || big(hi).is_some_and(|hi| x - &error <= hi);
    above && below
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_between_two_numbers_are_told_from_both() {
        let third = 1.0 / 3.0_f64;
        assert_eq!(compare(Op::Div, &[1.0, 3.0], third), Some(Ordering::Greater));
        assert_eq!(compare(Op::Div, &[1.0, 3.0], third.next_up()), Some(Ordering::Less));
        assert_eq!(compare(Op::Add, &[1.0, 1e-300], 1.0), Some(Ordering::Greater));
        assert_eq!(compare(Op::Sqrt, &[2.25], 1.5), Some(Ordering::Equal));
        assert_eq!(compare(Op::Mul, &[f64::MIN_POSITIVE, f64::MIN_POSITIVE], 0.0), Some(Ordering::Greater));
        let one_third = big(1.0).unwrap().with_precision(DIGITS).value() / big(3.0).unwrap();
        assert!(inside(&one_third, third, third.next_up()) && !inside(&one_third, third.next_up(), 1.0));
        assert!(!inside(&one_third, 0.0, third) && inside(&one_third, 0.0, f64::INFINITY));
    }
}
