//! Determinants, inverses and transposes of matrices in operations of the table, in the order that LANGUAGE 5 fixes.
//! Knows nothing of where matrices come from; `None` means matrices that the checker never lets through.

use isograd_graph::Op;
use isograd_program::Type;

use crate::operators::Operators;

/// The columns of a matrix, from left to right.
pub(crate) struct Matrix<T>(Vec<Vec<T>>);

impl<T: Copy> Matrix<T> {
    /// The matrix with these scalars.
    pub(crate) fn of(ty: &Type, scalars: &[T]) -> Option<Self> {
        let Type::Matrix { columns, rows } = ty else { return None };
        let matrix: Vec<Vec<T>> = scalars.chunks_exact(usize::from(*rows)).map(<[T]>::to_vec).collect();
        (matrix.len() == usize::from(*columns)).then_some(Self(matrix))
    }

    /// Columns become rows.
    pub(crate) fn transposed<L: FromIterator<T>>(&self) -> Option<L> {
        let rows = self.0.first()?.len();
        let row = |r: usize| self.0.iter().map(move |column| column.get(r).copied());
        (0..rows).flat_map(row).collect()
    }

    /// Without one column and one row.
    fn minor(&self, column: usize, row: usize) -> Self {
        let without = |c: &Vec<T>| c.iter().enumerate().filter(|(r, _)| *r != row).map(|(_, x)| *x).collect();
        Self(self.0.iter().enumerate().filter(|(c, _)| *c != column).map(|(_, x)| without(x)).collect())
    }

    /// Expansion along row 0: Σ_c (−1)^c · m.c.x · det(m without column c and row 0), c ascending. The extent is at
    /// most 4, and so is the depth of the recursion.
    pub(crate) fn determinant<D: Operators<Value = T>>(&self, domain: &mut D) -> Option<T> {
        if let [column] = &*self.0 {
            let [entry] = **column else { return None };
            return Some(entry);
        }
        let mut sum = None;
        for (c, column) in self.0.iter().enumerate() {
            let minor = self.minor(c, 0).determinant(domain)?;
            let term = domain.mul(*column.first()?, minor);
            sum = Some(match sum {
                None => term,
                // x + (−1)·y is x − y to the bit.
                Some(sum) if c % 2 == 1 => domain.sub(sum, term),
                Some(sum) => domain.add(sum, term),
            });
        }
        sum
    }

    /// Entry (column c, row r) = (−1)^(c+r) · det(m without column r and row c) / det(m).
    pub(crate) fn inverse<D: Operators<Value = T>>(&self, domain: &mut D) -> Option<D::List> {
        let extent = self.0.len();
        let determinant = self.determinant(domain)?;
        let mut entries = Vec::with_capacity(extent * extent);
        for c in 0..extent {
            for r in 0..extent {
                let minor = self.minor(r, c).determinant(domain)?;
                let cofactor = if (c + r) % 2 == 1 { domain.op(Op::Neg, &[minor]) } else { minor };
                entries.push(domain.div(cofactor, determinant));
            }
        }
        Some(entries.into_iter().collect())
    }
}
