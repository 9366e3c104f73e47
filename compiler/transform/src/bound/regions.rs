//! Which region each node of a graph lies in, and which regions are open at a place. Knows nothing of values.

use isograd_graph::{Graph, Node, NodeId};

/// The regions of a graph. A region is named by the mark that opens it; `NONE` is the outermost.
pub struct Regions {
    of: Vec<NodeId>,
    /// The region around the structure that a mark belongs to.
    around: Vec<NodeId>,
}

impl Regions {
    pub fn new(graph: &Graph) -> Self {
        let mut this = Self { of: Vec::with_capacity(graph.len()), around: vec![NodeId::NONE; graph.len()] };
        let mut open = Vec::new();
        let mut here = NodeId::NONE;
        for (id, node) in graph.iter() {
            if let Node::Else { .. } | Node::End { .. } = node {
                here = open.pop().unwrap_or(NodeId::NONE);
            }
            this.of.push(here);
            if let Node::Gamma { .. } | Node::Theta { .. } | Node::Else { .. } = node {
                if let Some(place) = this.around.get_mut(id.index()) {
                    *place = here;
                }
                open.push(here);
                here = id;
            }
        }
        this
    }

    /// The region of a node; of a mark, the one around its structure.
    pub fn of(&self, id: NodeId) -> NodeId {
        self.of.get(id.index()).copied().unwrap_or(NodeId::NONE)
    }

    /// The regions that are open where this node stands, the outermost first.
    pub fn open_at(&self, place: NodeId) -> Vec<NodeId> {
        let mut open = vec![self.of(place)];
        while let Some(mark) = open.last().filter(|m| **m != NodeId::NONE) {
            open.push(self.around.get(mark.index()).copied().unwrap_or(NodeId::NONE));
        }
        open.reverse();
        open
    }
}
