//! What the enclosure of some values needs: a sweep from them back to what the box replaces. Decides nothing about how
//! a value is enclosed.

use std::collections::BTreeMap;

use isograd_graph::{Graph, Node, NodeId};
use rustc_hash::FxHashMap;

use super::depends::Depends;
use super::regions::Regions;
use crate::differentiate::carried_finals;

/// Why a `bound` cannot be expanded now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// A `diff` or `bound` must be expanded before.
    Later,
    /// This bound of a loop depends on what the box replaces (LANGUAGE 15.5).
    LoopBound(NodeId),
}

/// Its enclosure is needed.
const ENCLOSED: u8 = 1;
/// Its value in the run is needed, and it lies in a region that is closed at the place, so it is computed once more.
const AGAIN: u8 = 2;
/// It begins a structure some of whose results are needed.
const ENTERED: u8 = 4;

/// What to walk, and how.
pub struct Plan {
    flags: Vec<u8>,
    /// Joins and tapes to enclose, by the end of their branch or loop.
    results: FxHashMap<NodeId, Vec<NodeId>>,
    /// The open loops whose earlier iterations must be enclosed, each with the plan of its body.
    replays: BTreeMap<NodeId, Plan>,
    /// The level of dependences.
    pub level: usize,
    /// The first node of the walk, and the one after the last.
    pub range: (NodeId, NodeId),
}

impl Plan {
    fn flag(&self, id: NodeId, which: u8) -> bool {
        self.flags.get(id.index()).is_some_and(|f| f & which != 0)
    }

    pub fn encloses(&self, id: NodeId) -> bool {
        self.flag(id, ENCLOSED)
    }

    pub fn again(&self, id: NodeId) -> bool {
        self.flag(id, AGAIN)
    }

    pub fn enters(&self, begin: NodeId) -> bool {
        self.flag(begin, ENTERED)
    }

    pub fn results(&self, end: NodeId) -> &[NodeId] {
        self.results.get(&end).map_or(&[], Vec::as_slice)
    }

    pub fn replay(&self, theta: NodeId) -> Option<&Self> {
        self.replays.get(&theta)
    }
}

/// What plans are made from.
#[derive(Clone, Copy)]
pub struct Planner<'a, 'g> {
    pub graph: &'g Graph,
    pub regions: &'a Regions,
    pub depends: &'a Depends<'g>,
    /// The regions that are open at the place.
    pub open: &'a [NodeId],
}

impl Planner<'_, '_> {
    /// The plan to enclose these values at `place`.
    pub fn values(self, place: NodeId, values: impl Iterator<Item = NodeId>) -> Result<Plan, Refusal> {
        let mut sweep = Sweep::new(self, self.depends.whole(), None);
        values.for_each(|x| sweep.enclose(x));
        sweep.back(place, NodeId(0))?;
        Ok(sweep.plan((NodeId(0), place)))
    }

    /// The plan to enclose these carried variables of an open loop over earlier iterations.
    fn iterations(self, theta: NodeId, end: NodeId, carried: &[NodeId]) -> Result<Plan, Refusal> {
        let level = self.depends.seen_by(theta).unwrap_or(0);
        let mut sweep = Sweep::new(self, level, Some(theta));
        carried.iter().for_each(|x| sweep.enclose(*x));
        sweep.raise(theta, ENTERED);
        while sweep.loop_variables(theta, end)? {
            sweep.back(end, NodeId(theta.0 + 1))?;
        }
        Ok(sweep.plan((NodeId(theta.0 + 1), end)))
    }
}

struct Sweep<'a, 'g> {
    planner: Planner<'a, 'g>,
    level: usize,
    /// The open loop whose body is walked as if it were closed.
    inside: Option<NodeId>,
    flags: Vec<u8>,
    replays: BTreeMap<NodeId, Plan>,
}

impl<'a, 'g> Sweep<'a, 'g> {
    fn new(planner: Planner<'a, 'g>, level: usize, inside: Option<NodeId>) -> Self {
        Self { planner, level, inside, flags: vec![0; planner.graph.len()], replays: BTreeMap::new() }
    }

    fn plan(self, range: (NodeId, NodeId)) -> Plan {
        let Self { planner, level, flags, replays, .. } = self;
        let mut plan = Plan { flags, results: FxHashMap::default(), replays, level, range };
        for (id, node) in planner.graph.iter() {
            if let Node::Join { end, .. } | Node::Tape { end, .. } = node
                && plan.encloses(id)
                && planner.depends.active(level, id)
            {
                plan.results.entry(end).or_default().push(id);
            }
        }
        plan
    }

    fn flag(&self, id: NodeId) -> u8 {
        self.flags.get(id.index()).copied().unwrap_or(0)
    }

    /// Sets a flag; whether that was news.
    fn raise(&mut self, id: NodeId, which: u8) -> bool {
        let Some(place) = self.flags.get_mut(id.index()) else { return false };
        let news = *place & which != which;
        *place |= which;
        news
    }

    /// Whether the value of the run that the place sees is the one meant.
    fn visible(&self, id: NodeId) -> bool {
        self.planner.open.contains(&self.planner.regions.of(id)) && self.inside.is_none_or(|theta| id < theta)
    }

    fn active(&self, id: NodeId) -> bool {
        self.planner.depends.active(self.level, id)
    }

    fn enclose(&mut self, id: NodeId) {
        self.raise(id, ENCLOSED);
        if !self.active(id) {
            self.compute(id);
        }
    }

    fn compute(&mut self, id: NodeId) {
        if !self.visible(id) {
            self.raise(id, AGAIN);
        }
    }

    /// Sweeps from before one node back to another.
    fn back(&mut self, from: NodeId, to: NodeId) -> Result<(), Refusal> {
        let mut index = from.0;
        while index > to.0 {
            index -= 1;
            let id = NodeId(index);
            if self.flag(id) == 0 && !matches!(self.planner.graph.get(id), Some(Node::Theta { .. })) {
                continue;
            }
            let Some(node) = self.planner.graph.get(id) else { continue };
            if let Node::Theta { end, .. } = node {
                if self.inside.is_none() && self.planner.open.contains(&id) {
                    self.earlier_iterations(id, end)?;
                } else if self.flag(id) & ENTERED != 0 && self.loop_variables(id, end)? {
                    index = end.0;
                }
                continue;
            }
            self.node(id, node)?;
        }
        Ok(())
    }

    fn node(&mut self, id: NodeId, node: Node) -> Result<(), Refusal> {
        let enclosed = self.flag(id) & ENCLOSED != 0 && self.active(id);
        if enclosed && !self.planner.depends.is_source(self.level, id) {
            if let Node::Recall { at, .. } = node
                && self.active(at)
            {
                return Err(Refusal::LoopBound(at));
            }
            self.operands(node, Self::enclose);
        }
        if self.flag(id) & AGAIN != 0 {
            if matches!(node, Node::Diff { .. } | Node::Bound { .. } | Node::Within { .. }) {
                return Err(Refusal::Later);
            }
            self.operands(node, Self::compute);
        }
        Ok(())
    }

    fn operands(&mut self, node: Node, mut need: impl FnMut(&mut Self, NodeId)) {
        match node {
            Node::Join { end, .. } | Node::Final { end, .. } | Node::Tape { end, .. } => {
                if let Some(Node::End { begin }) = self.planner.graph.get(end) {
                    self.raise(begin, ENTERED);
                    match self.planner.graph.get(begin) {
                        Some(Node::Gamma { cond, .. }) if self.active(cond) => self.enclose(cond),
                        Some(Node::Gamma { cond, .. }) => self.compute(cond),
                        _ => {}
                    }
                }
            }
            // Both are seen to where their loop begins.
            Node::Carried { .. } | Node::Counter { .. } => return,
            _ => {}
        }
        match node {
            Node::Final { carried, .. } => return need(self, carried),
            Node::Recall { tape, at } => {
                self.compute(at);
                return need(self, tape);
            }
            _ => {}
        }
        node.each_operand(|x| need(self, x));
    }

    /// Where a loop begins: what its variables need. Whether that was news for the body.
    fn loop_variables(&mut self, theta: NodeId, end: NodeId) -> Result<bool, Refusal> {
        let mut news = false;
        for (_, carried, next) in carried_finals(self.planner.graph, end) {
            let Some(Node::Carried { init, .. }) = self.planner.graph.get(carried) else { continue };
            let (before, flags) = (self.flag(next), self.flag(carried));
            if flags & ENCLOSED != 0 && self.active(carried) {
                self.enclose(init);
                self.enclose(next);
            }
            if flags & AGAIN != 0 {
                self.compute(init);
                self.compute(next);
            }
            news |= next > theta && self.flag(next) != before;
        }
        if let Some(Node::Theta { lo, hi, .. }) = self.planner.graph.get(theta) {
            for bound in [lo, hi] {
                if self.active(bound) {
                    return Err(Refusal::LoopBound(bound));
                }
                self.compute(bound);
            }
        }
        Ok(news)
    }

    /// Where a loop begins that is open at the place: its variables hold what earlier iterations gave.
    fn earlier_iterations(&mut self, theta: NodeId, end: NodeId) -> Result<(), Refusal> {
        let graph = self.planner.graph;
        let wanted = |id: &NodeId| self.flag(*id) & ENCLOSED != 0 && self.active(*id);
        let carried: Vec<NodeId> = carried_finals(graph, end).map(|(_, carried, _)| carried).filter(wanted).collect();
        if carried.is_empty() {
            return Ok(());
        }
        let plan = self.planner.iterations(theta, end, &carried)?;
        for (outside, flags) in plan.flags.iter().take(theta.index()).enumerate() {
            if flags & ENCLOSED != 0 {
                self.enclose(NodeId(u32::try_from(outside).unwrap_or(u32::MAX)));
            }
        }
        self.replays.insert(theta, plan);
        Ok(())
    }
}
