//! Which values depend on which seeds, and which of these dependences some `diff` asks for.

use isograd_graph::ops::{Derivative, Partial};
use isograd_graph::{Graph, Node, NodeId, Scalar};

use super::Diff;
use crate::bound::replaces;

/// Dependences of a graph's values on up to 64 seeds, a bit each.
pub struct Activity<'g> {
    graph: &'g Graph,
    /// The seeds, ascending.
    seeds: Vec<NodeId>,
    /// Seeds that a value depends on.
    active: Vec<u64>,
    /// Of these, the ones whose path leads through a `diff` not expanded yet.
    blocked: Vec<u64>,
    /// Whether all seeds share one bit.
    together: bool,
}

impl<'g> Activity<'g> {
    /// Finds the dependences on `seeds`, which ascend.
    pub fn of(graph: &'g Graph, seeds: &[NodeId]) -> Self {
        Self::find(graph, seeds, false)
    }

    /// Finds the dependences on any number of `seeds`, which ascend and lie in the outermost region, as a whole.
    pub fn together(graph: &'g Graph, seeds: &[NodeId]) -> Self {
        Self::find(graph, seeds, true)
    }

    fn find(graph: &'g Graph, seeds: &[NodeId], together: bool) -> Self {
        let (active, blocked) = (vec![0; graph.len()], vec![0; graph.len()]);
        let mut this = Self { graph, seeds: seeds.to_vec(), active, blocked, together };
        let mut at = seeds.first().copied().unwrap_or(NodeId(0));
        while let Some(node) = graph.get(at) {
            let changed_loop = this.node(at, node);
            at = changed_loop.unwrap_or(NodeId(at.0 + 1));
        }
        this
    }

    /// The bit of a seed.
    pub fn seed(&self, node: NodeId) -> Option<u64> {
        self.seeds.binary_search(&node).ok().map(|i| if self.together { 1 } else { 1 << i })
    }

    pub fn active(&self, id: NodeId) -> u64 {
        self.active.get(id.index()).copied().unwrap_or(0)
    }

    fn blocked(&self, id: NodeId) -> u64 {
        self.blocked.get(id.index()).copied().unwrap_or(0)
    }

    /// Whether a `diff` can be expanded: no other lies on the paths from its seed.
    pub fn ready(&self, diff: &Diff) -> bool {
        self.seed(diff.wrt).is_some_and(|bit| self.blocked(diff.value) & bit == 0)
    }

    /// Seeds made between two marks: values of one iteration or one side, which nothing outside depends on.
    fn made_between(&self, begin: NodeId, end: NodeId) -> u64 {
        if self.together {
            return 0;
        }
        let from = self.seeds.partition_point(|s| *s <= begin);
        let to = self.seeds.partition_point(|s| *s < end);
        (from..to).fold(0, |bits, i| bits | 1 << i)
    }

    /// Sets the bits of one node. Where a loop's end changes what its carried variables depend on, returns the
    /// node to go back to.
    fn node(&mut self, at: NodeId, node: Node) -> Option<NodeId> {
        let (mut active, mut blocked) = (0, 0);
        let mut from = |this: &Self, x: NodeId| {
            active |= this.active(x);
            blocked |= this.blocked(x);
        };
        match node {
            Node::Apply(op, args) => each_path(op.def(), args.as_slice(), |x| from(self, x)),
            Node::Fresh(x) => from(self, x),
            Node::Diff { value, .. } => {
                from(self, value);
                blocked = active;
            }
            // What it replaces does not matter at run time (LANGUAGE 15.3).
            Node::Within { lo, hi, next, .. } => [lo, hi, next].into_iter().for_each(|x| from(self, x)),
            Node::Bound { value, within, .. } => {
                active = self.active(value) & !self.replaced(within) | self.active(within);
                blocked = active;
            }
            Node::Carried { init, .. } => {
                from(self, init);
                // What earlier sweeps found through the loop's end.
                from(self, at);
            }
            Node::Tape { end, value, .. } => {
                from(self, value);
                let outside = !self.inside(end);
                (active, blocked) = (active & outside, blocked & outside);
            }
            Node::Recall { tape, .. } => from(self, tape),
            Node::Join { end, then, otherwise } => {
                from(self, then);
                from(self, otherwise);
                let outside = !self.inside(end);
                (active, blocked) = (active & outside, blocked & outside);
            }
            Node::Final { end, carried, .. } => {
                from(self, carried);
                let outside = !self.inside(end);
                (active, blocked) = (active & outside, blocked & outside);
            }
            Node::End { begin } => return self.close(at, begin),
            _ => {}
        }
        if self.graph.scalar(at) == Scalar::Real || matches!(node, Node::Within { .. }) {
            self.put(at, active | self.seed(at).unwrap_or(0), blocked);
        }
        None
    }

    /// The seeds that a box replaces.
    fn replaced(&self, within: NodeId) -> u64 {
        if self.together {
            return 0;
        }
        self.seeds.iter().enumerate().filter(|(_, s)| replaces(self.graph, within, **s)).fold(0, |b, (i, _)| b | 1 << i)
    }

    fn put(&mut self, at: NodeId, active: u64, blocked: u64) -> bool {
        let (Some(a), Some(b)) = (self.active.get_mut(at.index()), self.blocked.get_mut(at.index())) else {
            return false;
        };
        let changed = (*a | active, *b | blocked) != (*a, *b);
        *a |= active;
        *b |= blocked;
        changed
    }

    fn inside(&self, end: NodeId) -> u64 {
        match self.graph.get(end) {
            Some(Node::End { begin }) => self.made_between(begin, end),
            _ => 0,
        }
    }

    /// At the end of a loop, what an iteration gives its variables reaches the next one.
    fn close(&mut self, end: NodeId, begin: NodeId) -> Option<NodeId> {
        if !matches!(self.graph.get(begin), Some(Node::Theta { .. })) {
            return None;
        }
        let outside = !self.made_between(begin, end);
        let mut changed = false;
        for (_, carried, next) in carried_finals(self.graph, end) {
            if self.graph.scalar(carried) == Scalar::Real {
                let (active, blocked) = (self.active(next) & outside, self.blocked(next) & outside);
                changed |= self.put(carried, active, blocked);
            }
        }
        changed.then_some(NodeId(begin.0 + 1))
    }

    /// Bits of the tangents to make per node so that the tangents of `wanted` exist.
    pub fn needed(&self, wanted: &[Diff]) -> Vec<u64> {
        let mut needed = vec![0; self.graph.len()];
        for diff in wanted {
            if let (Some(bit), Some(place)) = (self.seed(diff.wrt), needed.get_mut(diff.value.index())) {
                *place |= bit;
            }
        }
        let mut index = self.graph.len();
        while index > 0 {
            index -= 1;
            let id = NodeId(u32::try_from(index).unwrap_or(u32::MAX));
            let Some(node) = self.graph.get(id) else { continue };
            if let Node::Theta { end, .. } = node {
                if self.repeat(&mut needed, id, end) {
                    index = end.index() + 1;
                }
                continue;
            }
            let bits = needed.get(index).copied().unwrap_or(0) & self.active(id) & !self.seed(id).unwrap_or(0);
            if bits == 0 {
                continue;
            }
            let mut need = |x: NodeId| {
                if let Some(place) = needed.get_mut(x.index()) {
                    *place |= bits & self.active(x);
                }
            };
            match node {
                Node::Apply(op, args) => each_path(op.def(), args.as_slice(), need),
                Node::Fresh(x) => need(x),
                Node::Carried { init, .. } => need(init),
                Node::Tape { value, .. } => need(value),
                Node::Recall { tape, .. } => need(tape),
                Node::Join { then, otherwise, .. } => {
                    need(then);
                    need(otherwise);
                }
                Node::Final { carried, next, .. } => {
                    need(carried);
                    need(next);
                }
                _ => {}
            }
        }
        needed
    }

    /// At the beginning of a loop: a tangent that an iteration needs must be what the iteration before gave.
    /// Whether that was news, so that the body must be swept again.
    fn repeat(&self, needed: &mut [u64], begin: NodeId, end: NodeId) -> bool {
        let outside = !self.made_between(begin, end);
        let mut news = false;
        for (final_of, carried, next) in carried_finals(self.graph, end) {
            let own = needed.get(carried.index()).copied().unwrap_or(0);
            let bits = own & self.active(carried) & !self.seed(carried).unwrap_or(0) & outside;
            // Every carried tangent has its final, whether the loop's result is asked for or not.
            if let Some(place) = needed.get_mut(final_of.index()) {
                *place |= bits;
            }
            let bits = bits & self.active(next);
            if let Some(place) = needed.get_mut(next.index())
                && *place & bits != bits
            {
                *place |= bits;
                news |= next > begin;
            }
        }
        news
    }
}

/// Calls `f` with the operands that a result's tangent can come from.
fn each_path(def: &isograd_graph::OpDef, args: &[NodeId], mut f: impl FnMut(NodeId)) {
    match &def.derivative {
        Derivative::Zero => {}
        Derivative::Partials(partials) => {
            args.iter().zip(partials.iter()).filter(|(_, p)| !matches!(p, Partial::Zero)).for_each(|(x, _)| f(*x))
        }
        Derivative::Choice { then, otherwise, .. } => {
            [*then, *otherwise].iter().filter_map(|i| args.get(*i)).for_each(|x| f(*x));
        }
    }
}

/// The finals of the loop with this end, each with its variable and what an iteration gives it. They follow the end
/// directly; constants may stand between.
pub fn carried_finals(graph: &Graph, end: NodeId) -> impl Iterator<Item = (NodeId, NodeId, NodeId)> + '_ {
    let after = (end.0 + 1..).map(NodeId).map_while(move |id| Some((id, graph.get(id)?)));
    after
        .map_while(move |(id, node)| match node {
            Node::Final { end: of, carried, next } if of == end => Some(Some((id, carried, next))),
            Node::Real(_) | Node::Int(_) | Node::Bool(_) => Some(None),
            _ => None,
        })
        .flatten()
}
