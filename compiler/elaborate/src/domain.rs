//! What the formulas of operators and built-ins compute with: numbers, or what encloses them (LANGUAGE 15.8). Knows
//! nothing of the formulas.

use std::ops::Deref;

use isograd_graph::{NodeId, Op};

use crate::intervals::{Component, Enclosures};
use crate::nodes::Nodes;
use crate::value::Scalars;

/// Something that the operations of the table apply to.
pub(crate) trait Domain: Sized {
    /// One scalar of it.
    type Value: Copy;
    /// Several.
    type List: FromIterator<Self::Value> + Deref<Target = [Self::Value]>;

    /// Applies an operation of the table.
    fn op(&mut self, op: Op, args: &[Self::Value]) -> Self::Value;

    /// A constant of a formula; it is a number of `real` in every precision.
    fn real(&mut self, x: f64) -> Self::Value;
}

impl Domain for Nodes<'_> {
    type Value = NodeId;
    type List = Scalars;

    fn op(&mut self, op: Op, args: &[NodeId]) -> NodeId {
        self.op(op, args)
    }

    fn real(&mut self, x: f64) -> NodeId {
        self.real(x)
    }
}

impl Domain for Enclosures<'_, '_> {
    type Value = Component;
    type List = Vec<Component>;

    fn op(&mut self, op: Op, args: &[Component]) -> Component {
        self.op(op, args)
    }

    fn real(&mut self, x: f64) -> Component {
        self.real(x)
    }
}
