//! Which values depend on the values that a box replaces, as seen from the place of a `bound`. Knows nothing of
//! enclosures.
//!
//! A loop that is open at the place has iterated before, and there a value of its body is not the one that the box
//! replaces. So each open loop sees only those *sources* of the box that were computed before it: they form a prefix
//! of the sources in order, and each prefix that some loop sees is a *level* of dependences of its own.

use isograd_graph::{Graph, Node, NodeId};

use super::regions::Regions;
use crate::differentiate::carried_finals;

/// The values a box replaces, and what depends on them.
pub struct Depends<'g> {
    graph: &'g Graph,
    /// Ascending.
    sources: Vec<NodeId>,
    /// The loops that are open at the place, the outermost first, each with the number of sources before it.
    loops: Vec<(NodeId, usize)>,
    /// By ascending number of sources; the last has all.
    levels: Vec<Level>,
}

struct Level {
    sources: usize,
    active: Vec<bool>,
    /// Of the active ones, those whose path leads through a `diff` or `bound` not expanded yet.
    blocked: Vec<bool>,
}

impl<'g> Depends<'g> {
    /// The dependences on `sources`, which ascend, as seen from `place`.
    pub fn new(graph: &'g Graph, regions: &Regions, place: NodeId, sources: Vec<NodeId>) -> Self {
        let open = regions.open_at(place);
        let thetas = open.into_iter().filter(|m| matches!(graph.get(*m), Some(Node::Theta { .. })));
        let loops: Vec<_> = thetas.map(|m| (m, sources.partition_point(|s| *s < m))).collect();
        let mut counts: Vec<usize> = loops.iter().map(|(_, n)| *n).chain([sources.len()]).filter(|n| *n > 0).collect();
        counts.sort_unstable();
        counts.dedup();
        let mut this = Self { graph, sources, loops, levels: Vec::new() };
        for count in counts {
            let level = Sweep { depends: &this, sources: count, ..Sweep::empty(&this) }.run(place);
            this.levels.push(level);
        }
        this
    }

    /// The level of the whole box.
    pub fn whole(&self) -> usize {
        self.levels.len().saturating_sub(1)
    }

    /// The level that an open loop sees; none if it sees no source.
    pub fn seen_by(&self, theta: NodeId) -> Option<usize> {
        let (_, count) = self.loops.iter().find(|(l, _)| *l == theta)?;
        self.levels.iter().position(|l| l.sources == *count)
    }

    pub fn is_source(&self, level: usize, id: NodeId) -> bool {
        let count = self.levels.get(level).map_or(0, |l| l.sources);
        self.sources.binary_search(&id).is_ok_and(|at| at < count)
    }

    /// Whether a value depends on the box.
    pub fn active(&self, level: usize, id: NodeId) -> bool {
        self.levels.get(level).is_some_and(|l| is(&l.active, id))
    }

    /// Whether a value depends on the box through a `diff` or `bound`.
    pub fn blocked(&self, level: usize, id: NodeId) -> bool {
        self.levels.get(level).is_some_and(|l| is(&l.blocked, id))
    }
}

fn is(flags: &[bool], id: NodeId) -> bool {
    flags.get(id.index()).copied().unwrap_or(false)
}

/// The dependences on the first sources.
struct Sweep<'d, 'g> {
    depends: &'d Depends<'g>,
    sources: usize,
    active: Vec<bool>,
    blocked: Vec<bool>,
}

impl<'d, 'g> Sweep<'d, 'g> {
    fn empty(depends: &'d Depends<'g>) -> Self {
        let n = depends.graph.len();
        Self { depends, sources: 0, active: vec![false; n], blocked: vec![false; n] }
    }

    fn run(mut self, place: NodeId) -> Level {
        let graph = self.depends.graph;
        // A loop that sees the same sources is swept to its end: what an iteration gives reaches the next one.
        let whole = self.depends.loops.iter().find(|(_, n)| *n == self.sources);
        let stop = whole.and_then(|(theta, _)| end_of(graph, *theta)).map_or(place, |end| NodeId(end.0 + 1));
        let mut at = self.depends.sources.first().copied().unwrap_or(stop);
        while at < stop {
            let Some(node) = graph.get(at) else { break };
            let changed_loop = self.node(at, node);
            at = changed_loop.unwrap_or(NodeId(at.0 + 1));
        }
        Level { sources: self.sources, active: self.active, blocked: self.blocked }
    }

    /// The loop's own level, if it sees fewer sources than this sweep.
    fn sees_less(&self, theta: NodeId) -> Option<Option<&'d Level>> {
        let (_, count) = self.depends.loops.iter().find(|(l, n)| *l == theta && *n < self.sources)?;
        Some(self.depends.levels.iter().find(|l| l.sources == *count))
    }

    fn is_source(&self, id: NodeId) -> bool {
        self.depends.sources.binary_search(&id).is_ok_and(|at| at < self.sources)
    }

    fn node(&mut self, at: NodeId, node: Node) -> Option<NodeId> {
        if self.is_source(at) {
            self.put(at, true, false);
            return None;
        }
        let (mut active, mut blocked) = (false, false);
        let mut from = |this: &Self, x: NodeId| {
            active |= is(&this.active, x);
            blocked |= is(&this.blocked, x);
        };
        match node {
            Node::Apply(_, args) => args.as_slice().iter().for_each(|x| from(self, *x)),
            Node::Fresh(x) => from(self, x),
            Node::Diff { value, wrt } => {
                from(self, value);
                from(self, wrt);
                blocked = active;
            }
            // What it replaces does not matter at run time (LANGUAGE 15.3).
            Node::Within { lo, hi, nan, next, .. } => [lo, hi, nan, next].into_iter().for_each(|x| from(self, x)),
            Node::Bound { value, within, .. } => {
                if !self.replaced(within) {
                    from(self, value);
                }
                from(self, within);
                blocked = active;
            }
            Node::Theta { lo, hi, .. } => {
                from(self, lo);
                from(self, hi);
            }
            Node::Counter { theta } => from(self, theta),
            Node::Carried { theta, init } => match self.sees_less(theta) {
                Some(level) => {
                    active = level.is_some_and(|l| is(&l.active, at));
                    blocked = level.is_some_and(|l| is(&l.blocked, at));
                }
                None => {
                    from(self, init);
                    from(self, theta);
                    // What earlier sweeps found through the loop's end.
                    from(self, at);
                }
            },
            Node::Join { end, then, otherwise } => {
                from(self, then);
                from(self, otherwise);
                if let Some(Node::End { begin }) = self.depends.graph.get(end)
                    && let Some(Node::Gamma { cond, .. }) = self.depends.graph.get(begin)
                {
                    from(self, cond);
                }
            }
            Node::Final { carried, .. } => from(self, carried),
            Node::Tape { value, .. } => from(self, value),
            Node::Recall { tape, at: number } => {
                from(self, tape);
                from(self, number);
            }
            Node::End { begin } => return self.close(at, begin),
            _ => {}
        }
        self.put(at, active, blocked);
        None
    }

    /// Whether a box replaces all the sources itself, so that a value enclosed in it depends on none.
    fn replaced(&self, within: NodeId) -> bool {
        let wrts: Vec<NodeId> = components(self.depends.graph, within).map(|c| c.wrt).collect();
        self.depends.sources.iter().take(self.sources).all(|s| wrts.contains(s))
    }

    fn put(&mut self, at: NodeId, active: bool, blocked: bool) -> bool {
        let (Some(a), Some(b)) = (self.active.get_mut(at.index()), self.blocked.get_mut(at.index())) else {
            return false;
        };
        let changed = (*a | active, *b | blocked) != (*a, *b);
        *a |= active;
        *b |= blocked;
        changed
    }

    /// At the end of a loop, what an iteration gives its variables reaches the next one.
    fn close(&mut self, end: NodeId, begin: NodeId) -> Option<NodeId> {
        let graph = self.depends.graph;
        if !matches!(graph.get(begin), Some(Node::Theta { .. })) || self.sees_less(begin).is_some() {
            return None;
        }
        let mut changed = false;
        for (_, carried, next) in carried_finals(graph, end) {
            let (active, blocked) = (is(&self.active, next), is(&self.blocked, next));
            changed |= self.put(carried, active, blocked);
        }
        changed.then_some(NodeId(begin.0 + 1))
    }
}

/// The end of a structure.
pub fn end_of(graph: &Graph, begin: NodeId) -> Option<NodeId> {
    match graph.get(begin)? {
        Node::Gamma { end, .. } | Node::Theta { end, .. } => Some(end),
        _ => None,
    }
}

/// One component of a box, as it stands in the graph.
#[derive(Debug, Clone, Copy)]
pub struct Component {
    pub wrt: NodeId,
    pub lo: NodeId,
    pub hi: NodeId,
    pub nan: NodeId,
}

/// The components of a box.
pub fn components(graph: &Graph, within: NodeId) -> impl Iterator<Item = Component> + '_ {
    let mut at = within;
    std::iter::from_fn(move || match graph.get(at) {
        Some(Node::Within { wrt, lo, hi, nan, next }) => {
            at = next;
            Some(Component { wrt, lo, hi, nan })
        }
        _ => None,
    })
}
