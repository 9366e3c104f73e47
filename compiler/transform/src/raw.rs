//! Copying a raw graph node by node: nothing is shared that was not, nothing is dropped. The part that `derive` and
//! `differentiate` have in common.

use isograd_graph::{Builder, Graph, Node, NodeId};

pub struct RawCopy<'g> {
    graph: &'g Graph,
    map: Vec<NodeId>,
}

impl<'g> RawCopy<'g> {
    pub fn new(graph: &'g Graph) -> Self {
        Self { graph, map: vec![NodeId::NONE; graph.len()] }
    }

    /// The copy of a node.
    pub fn to(&self, id: NodeId) -> NodeId {
        self.map.get(id.index()).copied().unwrap_or(NodeId::NONE)
    }

    /// Says what stands for a node.
    pub fn set(&mut self, id: NodeId, to: NodeId) {
        if let Some(place) = self.map.get_mut(id.index()) {
            *place = to;
        }
    }

    /// Copies the next node.
    pub fn node(&mut self, b: &mut Builder<'_>, id: NodeId, node: Node) -> NodeId {
        b.set_origin(self.graph.origin(id));
        let scalar = self.graph.scalar(id);
        let to = match node {
            Node::Input(i) => b.input(self.graph.inputs.get(i as usize).map_or("?", |x| x.name.as_str()), scalar),
            Node::Real(bits) => b.real(f64::from_bits(bits)),
            Node::Int(x) => b.int(x),
            Node::Bool(x) => b.bool(x),
            Node::Apply(op, args) => b.append(Node::Apply(op, args.map(|x| self.to(x))), scalar),
            Node::Fresh(x) => b.fresh(self.to(x)),
            Node::Diff { value, wrt } => b.append(Node::Diff { value: self.to(value), wrt: self.to(wrt) }, scalar),
            Node::Within { wrt, lo, hi, nan, next } => {
                let (wrt, lo, hi, nan) = (self.to(wrt), self.to(lo), self.to(hi), self.to(nan));
                b.append(Node::Within { wrt, lo, hi, nan, next: self.to(next) }, scalar)
            }
            Node::Bound { value, within, part } => {
                b.append(Node::Bound { value: self.to(value), within: self.to(within), part }, scalar)
            }
            Node::Gamma { cond, .. } => b.gamma(self.to(cond)),
            Node::Else { .. } => {
                b.otherwise();
                NodeId::NONE
            }
            Node::Theta { lo, hi, .. } => b.theta(self.to(lo), self.to(hi)),
            Node::Counter { .. } => b.counter(),
            Node::Carried { init, .. } => b.carried(self.to(init)),
            Node::End { .. } => b.end(),
            Node::Join { end, then, otherwise } => b.join(self.to(end), self.to(then), self.to(otherwise)),
            Node::Final { end, carried, next } => b.carry_out(self.to(end), self.to(carried), self.to(next)),
            Node::Tape { end, value, every } => b.tape(self.to(end), self.to(value), every),
            Node::Recall { tape, at } => b.recall(self.to(tape), self.to(at)),
        };
        self.set(id, to);
        to
    }
}
