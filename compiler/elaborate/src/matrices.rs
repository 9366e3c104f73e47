//! Determinants, inverses and transposes of matrices in operations of the graph, in the order that LANGUAGE 5 fixes.
//! Knows nothing of where matrices come from; `None` means matrices that the checker never lets through.

use isograd_graph::{NodeId, Op};
use isograd_program::Type;

use crate::nodes::Nodes;
use crate::value::Scalars;

/// The columns of a matrix, from left to right.
pub(crate) struct Matrix(Vec<Vec<NodeId>>);

impl Matrix {
    /// The matrix with these scalars.
    pub(crate) fn of(ty: &Type, scalars: &[NodeId]) -> Option<Self> {
        let Type::Matrix { columns, rows } = ty else { return None };
        let matrix: Vec<Vec<NodeId>> = scalars.chunks_exact(usize::from(*rows)).map(<[NodeId]>::to_vec).collect();
        (matrix.len() == usize::from(*columns)).then_some(Self(matrix))
    }

    /// Columns become rows.
    pub(crate) fn transposed(&self) -> Option<Scalars> {
        let rows = self.0.first()?.len();
        let row = |r: usize| self.0.iter().map(move |column| column.get(r).copied());
        (0..rows).flat_map(row).collect()
    }

    /// Without one column and one row.
    fn minor(&self, column: usize, row: usize) -> Self {
        let without = |c: &Vec<NodeId>| c.iter().enumerate().filter(|(r, _)| *r != row).map(|(_, x)| *x).collect();
        Self(self.0.iter().enumerate().filter(|(c, _)| *c != column).map(|(_, x)| without(x)).collect())
    }

    /// Expansion along row 0: Σ_c (−1)^c · m.c.x · det(m without column c and row 0), c ascending. The extent is at
    /// most 4, and so is the depth of the recursion.
    pub(crate) fn determinant(&self, nodes: &mut Nodes<'_>) -> Option<NodeId> {
        if let [column] = &*self.0 {
            let [entry] = **column else { return None };
            return Some(entry);
        }
        let mut sum = None;
        for (c, column) in self.0.iter().enumerate() {
            let minor = self.minor(c, 0).determinant(nodes)?;
            let term = nodes.mul(*column.first()?, minor);
            sum = Some(match sum {
                None => term,
                // x + (−1)·y is x − y to the bit.
                Some(sum) if c % 2 == 1 => nodes.sub(sum, term),
                Some(sum) => nodes.add(sum, term),
            });
        }
        sum
    }

    /// Entry (column c, row r) = (−1)^(c+r) · det(m without column r and row c) / det(m).
    pub(crate) fn inverse(&self, nodes: &mut Nodes<'_>) -> Option<Scalars> {
        let extent = self.0.len();
        let determinant = self.determinant(nodes)?;
        let mut entries = Vec::with_capacity(extent * extent);
        for c in 0..extent {
            for r in 0..extent {
                let minor = self.minor(r, c).determinant(nodes)?;
                let cofactor = if (c + r) % 2 == 1 { nodes.op(Op::Neg, &[minor]) } else { minor };
                entries.push(nodes.div(cofactor, determinant));
            }
        }
        Some(entries.into_iter().collect())
    }
}
