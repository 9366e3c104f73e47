//! Operators and casts in operations of the table, in the order that LANGUAGE 4.1 and 3.4 fix. Knows nothing of
//! where operands come from; `None` means operands that the checker never lets through.

use isograd_graph::{NodeId, Op};
use isograd_program::Type;
use isograd_syntax::tree::BinaryOp;

use crate::domain::Domain;
use crate::nodes::Nodes;
use crate::value::Scalars;

/// Operators, on numbers as on enclosures.
pub(crate) trait Operators: Domain {
    fn add(&mut self, a: Self::Value, b: Self::Value) -> Self::Value {
        self.op(Op::Add, &[a, b])
    }

    fn sub(&mut self, a: Self::Value, b: Self::Value) -> Self::Value {
        self.op(Op::Sub, &[a, b])
    }

    fn mul(&mut self, a: Self::Value, b: Self::Value) -> Self::Value {
        self.op(Op::Mul, &[a, b])
    }

    fn div(&mut self, a: Self::Value, b: Self::Value) -> Self::Value {
        self.op(Op::Div, &[a, b])
    }

    /// Applies `f` to each scalar.
    fn each(&mut self, a: &[Self::Value], mut f: impl FnMut(&mut Self, Self::Value) -> Self::Value) -> Self::List {
        a.iter().map(|a| f(self, *a)).collect()
    }

    /// Applies `f` component by component.
    fn pairs(
        &mut self,
        a: &[Self::Value],
        b: &[Self::Value],
        mut f: impl FnMut(&mut Self, Self::Value, Self::Value) -> Self::Value,
    ) -> Option<Self::List> {
        (a.len() == b.len()).then(|| a.iter().zip(b).map(|(a, b)| f(self, *a, *b)).collect())
    }

    /// A list of one.
    fn one(x: Self::Value) -> Self::List {
        std::iter::once(x).collect()
    }

    /// `a op b` (LANGUAGE 4.1).
    fn binary(
        &mut self,
        op: BinaryOp,
        (left, a): (&Type, &[Self::Value]),
        (right, b): (&Type, &[Self::Value]),
    ) -> Option<Self::List> {
        let int = left.is_int();
        let (real_op, int_op) = match op {
            BinaryOp::Mul => return self.product((left, a), (right, b)),
            BinaryOp::Add => (Op::Add, Op::IntAdd),
            BinaryOp::Sub => (Op::Sub, Op::IntSub),
            BinaryOp::Div if *right == Type::Real => {
                let [s] = *b else { return None };
                return Some(self.each(a, |n, x| n.div(x, s)));
            }
            BinaryOp::Div => (Op::Div, Op::IntDiv),
            BinaryOp::Rem => (Op::Mod, Op::IntRem),
            BinaryOp::Lt => (Op::Lt, Op::IntLt),
            BinaryOp::Le => (Op::Le, Op::IntLe),
            // a > b is b < a, a ≥ b is b ≤ a.
            BinaryOp::Gt => return self.binary(BinaryOp::Lt, (right, b), (left, a)),
            BinaryOp::Ge => return self.binary(BinaryOp::Le, (right, b), (left, a)),
            BinaryOp::Eq => (Op::Eq, Op::IntEq),
            BinaryOp::Ne if int => {
                return self.pairs(a, b, |n, a, b| {
                    let equal = n.op(Op::IntEq, &[a, b]);
                    n.op(Op::Not, &[equal])
                });
            }
            BinaryOp::Ne => (Op::Ne, Op::Ne),
            BinaryOp::And => (Op::And, Op::And),
            BinaryOp::Or => (Op::Or, Op::Or),
        };
        let op = if int { int_op } else { real_op };
        self.pairs(a, b, |n, a, b| n.op(op, &[a, b]))
    }

    /// `a * b` for every pair of types that has a product.
    fn product(
        &mut self,
        (left, a): (&Type, &[Self::Value]),
        (right, b): (&Type, &[Self::Value]),
    ) -> Option<Self::List> {
        match (left, right) {
            (Type::Int, Type::Int) | (Type::IntVector(_), Type::IntVector(_)) => {
                self.pairs(a, b, |n, a, b| n.op(Op::IntMul, &[a, b]))
            }
            (Type::Real, Type::Real) | (Type::Vector(_), Type::Vector(_)) => self.pairs(a, b, Self::mul),
            (_, Type::Real) => {
                let [s] = *b else { return None };
                Some(self.each(a, |n, x| n.mul(x, s)))
            }
            (Type::Real, _) => {
                let [s] = *a else { return None };
                Some(self.each(b, |n, x| n.mul(s, x)))
            }
            (Type::Matrix { rows, .. }, Type::Vector(_)) => self.matrix_vector(a, *rows, b),
            (Type::Vector(_), Type::Matrix { rows, .. }) => {
                b.chunks_exact(usize::from(*rows)).map(|column| self.dot(a, column)).collect()
            }
            (Type::Matrix { rows, .. }, Type::Matrix { rows: inner, .. }) => {
                let mut product = Vec::new();
                for column in b.chunks_exact(usize::from(*inner)) {
                    product.extend_from_slice(&self.matrix_vector(a, *rows, column)?);
                }
                Some(product.into_iter().collect())
            }
            (Type::Quat, Type::Quat) => self.quat_product(a, b),
            _ => None,
        }
    }

    /// Σ aᵢbᵢ, i ascending.
    fn dot(&mut self, a: &[Self::Value], b: &[Self::Value]) -> Option<Self::Value> {
        if a.len() != b.len() {
            return None;
        }
        let mut sum = None;
        for (a, b) in a.iter().zip(b) {
            let product = self.mul(*a, *b);
            sum = Some(match sum {
                None => product,
                Some(sum) => self.add(sum, product),
            });
        }
        sum
    }

    /// Σₖ a.k·bₖ, k ascending.
    fn matrix_vector(&mut self, a: &[Self::Value], rows: u8, b: &[Self::Value]) -> Option<Self::List> {
        let rows = usize::from(rows);
        let row = |r: usize| a.chunks_exact(rows).filter_map(|c| c.get(r).copied()).collect::<Vec<_>>();
        (0..rows).map(|r| self.dot(&row(r), b)).collect()
    }

    /// `[a.y*b.z - a.z*b.y, a.z*b.x - a.x*b.z, a.x*b.y - a.y*b.x]`
    fn cross(&mut self, a: [Self::Value; 3], b: [Self::Value; 3]) -> [Self::Value; 3] {
        let ([ax, ay, az], [bx, by, bz]) = (a, b);
        let mut minor = |p, q, r, s| {
            let (left, right) = (self.mul(p, q), self.mul(r, s));
            self.sub(left, right)
        };
        [minor(ay, bz, az, by), minor(az, bx, ax, bz), minor(ax, by, ay, bx)]
    }

    /// Hamilton's product: `w = p.w*q.w − dot(p.u,q.u)`, `u = q.u*p.w + p.u*q.w + cross(p.u,q.u)` (LANGUAGE 16.1).
    fn quat_product(&mut self, p: &[Self::Value], q: &[Self::Value]) -> Option<Self::List> {
        let ([px, py, pz, pw], [qx, qy, qz, qw]) =
            (<[Self::Value; 4]>::try_from(p).ok()?, <[Self::Value; 4]>::try_from(q).ok()?);
        let (pu, qu) = ([px, py, pz], [qx, qy, qz]);
        let cross = self.cross(pu, qu);
        let mut result = Vec::with_capacity(4);
        for ((p, q), c) in pu.into_iter().zip(qu).zip(cross) {
            let (left, right) = (self.mul(q, pw), self.mul(p, qw));
            let sum = self.add(left, right);
            result.push(self.add(sum, c));
        }
        let (ww, uu) = (self.mul(pw, qw), self.dot(&pu, &qu)?);
        result.push(self.sub(ww, uu));
        Some(result.into_iter().collect())
    }

    /// `-a`
    fn negative(&mut self, ty: &Type, a: &[Self::Value]) -> Self::List {
        let op = if ty.is_int() { Op::IntNeg } else { Op::Neg };
        self.each(a, |n, x| n.op(op, &[x]))
    }
}

impl<D: Domain> Operators for D {}

impl Nodes<'_> {
    /// `a` as another type (LANGUAGE 3.4).
    pub(crate) fn cast(&mut self, from: &Type, to: &Type, a: &[NodeId]) -> Option<Scalars> {
        match (from, to) {
            (Type::Vector(_), Type::IntVector(_)) => {
                return Some(Operators::each(self, a, |n, x| n.op(Op::RealToInt, &[x])));
            }
            (Type::IntVector(_), Type::Vector(_)) => {
                return Some(Operators::each(self, a, |n, x| n.op(Op::IntToReal, &[x])));
            }
            _ => {}
        }
        let [x] = *a else { return None };
        let y = match (from, to) {
            (Type::Real, Type::Int) => self.op(Op::RealToInt, &[x]),
            (Type::Int, Type::Real) => self.op(Op::IntToReal, &[x]),
            (Type::Bool, Type::Int) => {
                let (one, zero) = (self.int(1), self.int(0));
                self.op(Op::SelectInt, &[x, one, zero])
            }
            (Type::Bool, Type::Real) => {
                let (one, zero) = (self.real(1.0), self.real(0.0));
                self.op(Op::Select, &[x, one, zero])
            }
            (Type::Int, Type::Bool) => {
                let zero = self.int(0);
                let equal = self.op(Op::IntEq, &[x, zero]);
                self.op(Op::Not, &[equal])
            }
            _ => return None,
        };
        Some(Scalars::one(y))
    }
}
