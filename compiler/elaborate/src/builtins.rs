//! The built-in functions in operations of the table: the formulas of LANGUAGE 5 and 16 in the order written there.
//! Knows nothing of where arguments come from; `None` means arguments that the checker never lets through.

use isograd_graph::Op;
use isograd_program::{Builtin, Type};

use crate::matrices::Matrix;
use crate::operators::Operators;

/// Built-in functions, of numbers as of enclosures.
pub(crate) trait Builtins: Operators {
    /// The value of a built-in.
    fn builtin(&mut self, builtin: Builtin, types: &[Type], args: &[Self::List]) -> Option<Self::List> {
        let int = types.first().is_some_and(Type::is_int);
        let of = |real: Op, integer: Op| if int { integer } else { real };
        match builtin {
            Builtin::Dot => self.dot(args.first()?, args.get(1)?).map(Self::one),
            Builtin::Cross => {
                let [a, b] = args else { return None };
                Some(self.cross(triple(a)?, triple(b)?).into_iter().collect())
            }
            Builtin::Length => self.length(args.first()?).map(Self::one),
            Builtin::Sqrt => self.unary(Op::Sqrt, args),
            Builtin::Exp => self.unary(Op::Exp, args),
            Builtin::Pow => self.two(args, |n, a, b| n.op(Op::Pow, &[a, b])),
            Builtin::Min => self.two(args, |n, a, b| n.op(of(Op::Min, Op::IntMin), &[a, b])),
            Builtin::Max => self.two(args, |n, a, b| n.op(of(Op::Max, Op::IntMax), &[a, b])),
            Builtin::Clamp => self.three(args, |n, x, lo, hi| {
                let x = n.op(of(Op::Max, Op::IntMax), &[x, lo]);
                n.op(of(Op::Min, Op::IntMin), &[x, hi])
            }),
            Builtin::Mix | Builtin::Lerp => self.three(args, Self::mix),
            Builtin::Mod => self.two(args, |n, a, b| n.op(of(Op::Mod, Op::IntRem), &[a, b])),
            Builtin::Fract => self.unary(Op::Fract, args),
            Builtin::Abs => self.unary(of(Op::Abs, Op::IntAbs), args),
            Builtin::Floor => self.unary(Op::Floor, args),
            Builtin::Ceil => self.unary(Op::Ceil, args),
            Builtin::Round => self.unary(Op::Round, args),
            Builtin::Sin => self.unary(Op::Sin, args),
            Builtin::Cos => self.unary(Op::Cos, args),
            Builtin::Tan => self.unary(Op::Tan, args),
            Builtin::Asin => self.unary(Op::Asin, args),
            Builtin::Acos => self.unary(Op::Acos, args),
            Builtin::Atan => self.unary(Op::Atan, args),
            Builtin::Sinh => self.unary(Op::Sinh, args),
            Builtin::Cosh => self.unary(Op::Cosh, args),
            Builtin::Tanh => self.unary(Op::Tanh, args),
            Builtin::Asinh => self.unary(Op::Asinh, args),
            Builtin::Acosh => self.unary(Op::Acosh, args),
            Builtin::Atanh => self.unary(Op::Atanh, args),
            Builtin::Inverse | Builtin::Invert => match types {
                [Type::Quat] => self.quat_inverse(args.first()?),
                [ty] => Matrix::of(ty, args.first()?)?.inverse(self),
                _ => None,
            },
            Builtin::Determinant => {
                let [ty] = types else { return None };
                Matrix::of(ty, args.first()?)?.determinant(self).map(Self::one)
            }
            Builtin::Transpose => {
                let [ty] = types else { return None };
                Matrix::of(ty, args.first()?)?.transposed()
            }
            Builtin::Atan2 => self.two(args, |n, y, x| n.op(Op::Atan2, &[y, x])),
            Builtin::Normalize => self.normalize(args.first()?),
            Builtin::Distance => {
                let difference = self.two(args, Self::sub)?;
                self.length(&difference).map(Self::one)
            }
            Builtin::Reflect => {
                let [i, n] = args else { return None };
                let dot = self.dot(n, i)?;
                let two = self.real(2.0);
                let twice = self.mul(two, dot);
                self.pairs(i, n, |b, i, n| {
                    let along = b.mul(n, twice);
                    b.sub(i, along)
                })
            }
            Builtin::Sign => self.unary(of(Op::Sign, Op::IntSign), args),
            Builtin::Step => self.two(args, |n, edge, x| {
                let below = n.op(Op::Lt, &[x, edge]);
                let (zero, one) = (n.real(0.0), n.real(1.0));
                n.op(Op::Select, &[below, zero, one])
            }),
            Builtin::Smoothstep => self.three(args, Self::smoothstep),
            Builtin::Saturate => self.component_wise(args, Self::saturate),
            Builtin::Trunc => self.unary(Op::Trunc, args),
            Builtin::Log => self.unary(Op::Log, args),
            Builtin::Log2 => self.unary(Op::Log2, args),
            Builtin::Exp2 => self.unary(Op::Exp2, args),
            Builtin::InverseSqrt => self.unary(Op::InverseSqrt, args),
            Builtin::Quat => self.quat(args),
            Builtin::Conjugate => self.conjugate(args.first()?),
            Builtin::Rotate => {
                let [q, v] = args else { return None };
                self.rotate(quadruple(q)?, triple(v)?)
            }
            Builtin::ToMat3 => {
                let q = quadruple(args.first()?)?;
                let (zero, one) = (self.real(0.0), self.real(1.0));
                let mut columns = Vec::with_capacity(9);
                for axis in [[one, zero, zero], [zero, one, zero], [zero, zero, one]] {
                    columns.extend_from_slice(&self.rotate(q, axis)?);
                }
                Some(columns.into_iter().collect())
            }
        }
    }

    fn component_wise(
        &mut self,
        args: &[Self::List],
        f: impl FnMut(&mut Self, Self::Value) -> Self::Value,
    ) -> Option<Self::List> {
        let [a] = args else { return None };
        Some(self.each(a, f))
    }

    fn unary(&mut self, op: Op, args: &[Self::List]) -> Option<Self::List> {
        self.component_wise(args, |n, a| n.op(op, &[a]))
    }

    fn two(
        &mut self,
        args: &[Self::List],
        f: impl FnMut(&mut Self, Self::Value, Self::Value) -> Self::Value,
    ) -> Option<Self::List> {
        let [a, b] = args else { return None };
        self.pairs(a, b, f)
    }

    fn three(
        &mut self,
        args: &[Self::List],
        mut f: impl FnMut(&mut Self, Self::Value, Self::Value, Self::Value) -> Self::Value,
    ) -> Option<Self::List> {
        let [a, b, c] = args else { return None };
        let fits = a.len() == b.len() && b.len() == c.len();
        fits.then(|| a.iter().zip(b.iter()).zip(c.iter()).map(|((a, b), c)| f(self, *a, *b, *c)).collect())
    }

    /// `a*(1-t) + b*t`
    fn mix(&mut self, a: Self::Value, b: Self::Value, t: Self::Value) -> Self::Value {
        let one = self.real(1.0);
        let rest = self.sub(one, t);
        let (left, right) = (self.mul(a, rest), self.mul(b, t));
        self.add(left, right)
    }

    /// `min(max(a, 0), 1)`
    fn saturate(&mut self, a: Self::Value) -> Self::Value {
        let (zero, one) = (self.real(0.0), self.real(1.0));
        let a = self.op(Op::Max, &[a, zero]);
        self.op(Op::Min, &[a, one])
    }

    /// `t = saturate((x-e0)/(e1-e0)); t*t*(3.0-2.0*t)`
    fn smoothstep(&mut self, e0: Self::Value, e1: Self::Value, x: Self::Value) -> Self::Value {
        let (above, width) = (self.sub(x, e0), self.sub(e1, e0));
        let ratio = self.div(above, width);
        let t = self.saturate(ratio);
        let (two, three) = (self.real(2.0), self.real(3.0));
        let square = self.mul(t, t);
        let twice = self.mul(two, t);
        let rest = self.sub(three, twice);
        self.mul(square, rest)
    }

    /// ‖v‖
    fn length(&mut self, v: &[Self::Value]) -> Option<Self::Value> {
        let op = match v.len() {
            2 => Op::Length2,
            3 => Op::Length3,
            4 => Op::Length4,
            _ => return None,
        };
        Some(self.op(op, v))
    }

    /// `v / ‖v‖`, 0 where ‖v‖ computes 0
    fn normalize(&mut self, v: &[Self::Value]) -> Option<Self::List> {
        let length = self.length(v)?;
        Some(self.each(v, |n, x| n.op(Op::Unit, &[x, length])))
    }

    /// The components, or `u = normalize(axis)*sin(angle*0.5)`, `w = cos(angle*0.5)` (LANGUAGE 16.1).
    fn quat(&mut self, args: &[Self::List]) -> Option<Self::List> {
        let [axis, angle] = args else {
            return (args.len() == 4).then(|| args.iter().flat_map(|a| a.iter().copied()).collect());
        };
        let [angle] = **angle else { return None };
        let half = self.real(0.5);
        let half = self.mul(angle, half);
        let (sin, cos) = (self.op(Op::Sin, &[half]), self.op(Op::Cos, &[half]));
        let axis = self.normalize(axis)?;
        let u = self.each(&axis, |n, x| n.mul(x, sin));
        Some(u.iter().copied().chain([cos]).collect())
    }

    /// `(−u, w)`
    fn conjugate(&mut self, q: &[Self::Value]) -> Option<Self::List> {
        let [x, y, z, w] = quadruple(q)?;
        let negative = self.each(&[x, y, z], |n, a| n.op(Op::Neg, &[a]));
        Some(negative.iter().copied().chain([w]).collect())
    }

    /// `conjugate(q)/dot(q,q)` (LANGUAGE 16.1)
    fn quat_inverse(&mut self, q: &[Self::Value]) -> Option<Self::List> {
        let (conjugate, square) = (self.conjugate(q)?, self.dot(q, q)?);
        Some(self.each(&conjugate, |n, x| n.div(x, square)))
    }

    /// `v + cross(u, cross(u, v) + v*w)*2.0`
    fn rotate(&mut self, [x, y, z, w]: [Self::Value; 4], v: [Self::Value; 3]) -> Option<Self::List> {
        let u = [x, y, z];
        let inner = self.cross(u, v);
        let inner = self.pairs(&inner, &v, |n, c, v| {
            let scaled = n.mul(v, w);
            n.add(c, scaled)
        })?;
        let outer = self.cross(u, triple(&inner)?);
        let two = self.real(2.0);
        self.pairs(&v, &outer, |n, v, c| {
            let twice = n.mul(c, two);
            n.add(v, twice)
        })
    }
}

impl<D: Operators> Builtins for D {}

fn triple<T: Copy>(v: &[T]) -> Option<[T; 3]> {
    v.try_into().ok()
}

fn quadruple<T: Copy>(v: &[T]) -> Option<[T; 4]> {
    v.try_into().ok()
}
