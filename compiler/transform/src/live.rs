//! Liveness: which nodes the outputs need. A right-to-left sweep; a loop body is swept again until nothing changes.

use isograd_graph::{Graph, Node, NodeId};

/// Whether each node is needed for an output, by index.
#[must_use]
pub fn live(graph: &Graph) -> Vec<bool> {
    let mut sweep = Sweep { live: vec![false; graph.len()], final_of: finals(graph) };
    for output in &graph.outputs {
        sweep.mark(output.node);
    }
    let mut index = graph.len();
    while index > 0 {
        index -= 1;
        let id = NodeId(u32::try_from(index).unwrap_or(u32::MAX));
        let Some(node) = graph.get(id) else { continue };
        if let Some(end) = sweep.node(graph, id, node) {
            index = end.index() + 1;
        }
    }
    sweep.live
}

/// The `final` of each `carried`, by the index of the carried; `NONE` elsewhere.
#[must_use]
pub fn finals(graph: &Graph) -> Vec<NodeId> {
    let mut finals = vec![NodeId::NONE; graph.len()];
    for (id, node) in graph.iter() {
        if let Node::Final { carried, .. } = node
            && let Some(place) = finals.get_mut(carried.index())
        {
            *place = id;
        }
    }
    finals
}

struct Sweep {
    live: Vec<bool>,
    final_of: Vec<NodeId>,
}

impl Sweep {
    /// Marks a node; whether it was not marked before.
    fn mark(&mut self, id: NodeId) -> bool {
        match self.live.get_mut(id.index()) {
            Some(place) => !std::mem::replace(place, true),
            None => false,
        }
    }

    fn is(&self, id: NodeId) -> bool {
        self.live.get(id.index()).copied().unwrap_or(false)
    }

    /// Marks what a node needs. Returns the end of a loop whose body must be swept again.
    fn node(&mut self, graph: &Graph, id: NodeId, node: Node) -> Option<NodeId> {
        if !self.is(id) {
            return None;
        }
        node.each_operand(|x| {
            self.mark(x);
        });
        match node {
            Node::Join { end, .. } | Node::Final { end, .. } | Node::Tape { end, .. } => {
                self.mark(end);
            }
            Node::End { begin } => {
                self.mark(begin);
                if let Some(Node::Gamma { otherwise, .. }) = graph.get(begin) {
                    self.mark(otherwise);
                }
            }
            Node::Counter { theta } => {
                self.mark(theta);
            }
            Node::Theta { end, .. } => return self.again(graph, id, end).then_some(end),
            _ => {}
        }
        None
    }

    /// A carried variable found live in the body needs what an iteration gives it. Whether that was news.
    fn again(&mut self, graph: &Graph, theta: NodeId, end: NodeId) -> bool {
        let mut news = false;
        for index in theta.0..end.0 {
            let id = NodeId(index);
            if !self.is(id) || !matches!(graph.get(id), Some(Node::Carried { theta: of, .. }) if of == theta) {
                continue;
            }
            let final_of = self.final_of.get(id.index()).copied().unwrap_or(NodeId::NONE);
            if let Some(Node::Final { next, .. }) = graph.get(final_of) {
                self.mark(final_of);
                news |= self.mark(next) && next > theta;
            }
        }
        news
    }
}
