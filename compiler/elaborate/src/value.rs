//! What the machine computes with: lists of scalar nodes and csg trees. Knows nothing of the code that moves them.

use std::ops::Deref;
use std::rc::Rc;

use isograd_graph::NodeId;

use crate::csg::CsgId;

/// The scalars of a value, flattened (LANGUAGE 9.2). Up to four lie in place.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Scalars {
    /// At most four; unused places hold [`NodeId::NONE`].
    Few(u8, [NodeId; 4]),
    /// More than four.
    Many(Rc<[NodeId]>),
}

impl Scalars {
    /// One scalar.
    pub(crate) const fn one(node: NodeId) -> Self {
        Self::Few(1, [node, NodeId::NONE, NodeId::NONE, NodeId::NONE])
    }
}

impl Deref for Scalars {
    type Target = [NodeId];

    fn deref(&self) -> &[NodeId] {
        match self {
            Self::Few(n, nodes) => nodes.get(..usize::from(*n)).unwrap_or(&[]),
            Self::Many(nodes) => nodes,
        }
    }
}

impl FromIterator<NodeId> for Scalars {
    fn from_iter<I: IntoIterator<Item = NodeId>>(nodes: I) -> Self {
        let mut nodes = nodes.into_iter();
        let mut few = [NodeId::NONE; 4];
        let mut n = 0;
        for (place, node) in few.iter_mut().zip(&mut nodes) {
            *place = node;
            n += 1;
        }
        match nodes.next() {
            Some(fifth) if n == 4 => Self::Many(few.into_iter().chain([fifth]).chain(nodes).collect()),
            _ => Self::Few(n, few),
        }
    }
}

/// A value on the machine's stack or in a slot.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Value {
    /// A slot that nothing was bound to yet.
    Unset,
    /// Everything but csg.
    Scalars(Scalars),
    /// A csg tree.
    Csg(CsgId),
}
