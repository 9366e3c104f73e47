//! Which truth values have a weight: those that a comparison of reals has a part in. Knows the flow of truth values, not
//! what a weight is.

use isograd_graph::{Graph, Node, NodeId, Op, Scalar};

/// Facts about the truth values of a graph.
pub struct Softness {
    /// Those with a weight between 0 and 1.
    soft: Vec<bool>,
    /// Those without, that others with one are made of: their weight is 0 or 1.
    weighed: Vec<bool>,
}

impl Softness {
    /// Follows the comparisons of reals through the graph, around loops too.
    pub fn of(graph: &Graph) -> Self {
        let mut flow: Vec<(NodeId, NodeId)> = Vec::new();
        let mut open: Vec<NodeId> = Vec::new();
        for (at, node) in graph.iter() {
            let mut from = |x: NodeId, to: NodeId| {
                if graph.scalar(to) == Scalar::Bool {
                    flow.push((x, to));
                }
            };
            match node {
                Node::Apply(Op::Lt | Op::Le, _) => open.push(at),
                Node::Apply(Op::And | Op::Or | Op::Not, args) => args.as_slice().iter().for_each(|x| from(*x, at)),
                Node::Apply(Op::SelectBool, args) => args.as_slice().iter().skip(1).for_each(|x| from(*x, at)),
                Node::Fresh(x) => from(x, at),
                Node::Join { then, otherwise, .. } => {
                    from(then, at);
                    from(otherwise, at);
                }
                Node::Carried { init, .. } => from(init, at),
                Node::Final { carried, next, .. } => {
                    from(next, carried);
                    from(carried, at);
                    from(next, at);
                }
                _ => {}
            }
        }
        flow.sort_unstable();
        let mut this = Self { soft: vec![false; graph.len()], weighed: vec![false; graph.len()] };
        while let Some(at) = open.pop() {
            let Some(place) = this.soft.get_mut(at.index()).filter(|soft| !**soft) else { continue };
            *place = true;
            let first = flow.partition_point(|(x, _)| *x < at);
            open.extend(flow.iter().skip(first).take_while(|(x, _)| *x == at).map(|(_, to)| *to));
        }
        for (x, to) in flow {
            if this.is_soft(to)
                && !this.is_soft(x)
                && let Some(place) = this.weighed.get_mut(x.index())
            {
                *place = true;
            }
        }
        this
    }

    /// Whether a truth value has a weight between 0 and 1.
    pub fn is_soft(&self, id: NodeId) -> bool {
        self.soft.get(id.index()).copied().unwrap_or(false)
    }

    /// Whether the weight of a truth value without one is asked for.
    pub fn is_weighed(&self, id: NodeId) -> bool {
        self.weighed.get(id.index()).copied().unwrap_or(false)
    }
}
