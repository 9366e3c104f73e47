//! Enclosures: expands every `bound` of a raw graph (LANGUAGE 15) by running the data flow of its value once more, with
//! an enclosure in the place of each value that depends on what the box replaces. Knows regions and loops; the rule of
//! each operation stands in the op table.
//!
//! The expansion stands where the `bound` stands, because its box may be computed after its value. All parts of all
//! values that stand in one region over one box make a *group* and share it. A branch on an enclosed condition becomes
//! two, of which each runs if the condition may be so. A loop runs as often as in the run and carries enclosures. In a
//! loop that is still open, what earlier iterations gave is found by running them once more, enclosed. So the graph does
//! not grow with the number of iterations.

mod depends;
mod evaluate;
mod facts;
mod plan;
mod regions;
mod walk;

use isograd_graph::{Builder, Enclosure, Graph, Mode, Node, NodeId, Part, Range, Watch};
use rustc_hash::{FxHashMap, FxHashSet};

use self::depends::{Depends, components};
use self::plan::{Plan, Planner, Refusal};
use self::regions::Regions;
use self::walk::Walk;
use crate::differentiate::{DifferentiateError, Orders, each_live};
use crate::raw::RawCopy;

pub use evaluate::{Hull, Loops, enclosures};

/// One `bound` of a graph.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bound {
    pub node: NodeId,
    pub value: NodeId,
    within: NodeId,
    part: Part,
}

/// Every `bound`, in order.
pub(crate) fn bounds(graph: &Graph) -> impl Iterator<Item = Bound> {
    graph.iter().filter_map(|(node, n)| match n {
        Node::Bound { value, within, part } => Some(Bound { node, value, within, part }),
        _ => None,
    })
}

/// Whether a box replaces this value.
pub(crate) fn replaces(graph: &Graph, within: NodeId, value: NodeId) -> bool {
    components(graph, within).any(|c| c.wrt == value)
}

/// Copies `graph` with those of `wanted` expanded on whose paths no `diff` and no other `bound` lies. Also returns how
/// many rounds of differentiation each value of the new graph has been through. `None` if there is none to expand.
pub(crate) fn expand(
    graph: &Graph,
    wanted: &[Bound],
    live: &[bool],
    orders: Orders<'_>,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Option<(Graph, Vec<u32>)>, DifferentiateError> {
    let regions = Regions::new(graph);
    let groups = groups(&regions, wanted);
    let loops = groups.keys().flat_map(|place| regions.open_at(*place)).collect();
    let mut expansion = Expansion {
        graph,
        regions,
        b: Builder::new(Mode::Raw, max_nodes, watch),
        copy: RawCopy::new(graph),
        loops,
        counters: FxHashMap::default(),
        results: FxHashMap::default(),
    };
    let mut orders = orders;
    let mut refused = None;
    each_live(graph, live, |at, node| {
        if let Some(group) = groups.get(&at).filter(|_| refused.is_none()) {
            refused = expansion.group(at, group).err();
        }
        let (copied, value) = match expansion.results.get(&at) {
            Some(result) => {
                expansion.copy.set(at, *result);
                (*result, node)
            }
            None => (expansion.copy.node(&mut expansion.b, at, node), node),
        };
        let mut order = orders.old(at);
        value.each_operand(|x| order = order.max(orders.of(expansion.copy.to(x))));
        orders.note(copied, order);
        if expansion.loops.contains(&at) && matches!(node, Node::Theta { .. }) {
            expansion.counters.insert(at, expansion.b.counter());
        }
        expansion.b.exhausted().map_or(Ok(()), Err)
    })?;
    if let Some(why) = refused {
        return Err(why);
    }
    if expansion.results.is_empty() {
        return Ok(None);
    }
    for output in &graph.outputs {
        expansion.b.output(output.name.clone(), expansion.copy.to(output.node));
    }
    Ok(Some((expansion.b.finish()?, orders.into_new())))
}

/// What is expanded together, by its first member: the parts of values that stand in one region, over one box, each of
/// a value that is computed before the first.
fn groups(regions: &Regions, wanted: &[Bound]) -> FxHashMap<NodeId, Vec<Bound>> {
    let mut groups: FxHashMap<NodeId, Vec<Bound>> = FxHashMap::default();
    let mut latest: FxHashMap<(NodeId, NodeId), NodeId> = FxHashMap::default();
    for bound in wanted {
        let place = latest.entry((bound.within, regions.of(bound.node))).or_insert(bound.node);
        if bound.value > *place {
            *place = bound.node;
        }
        groups.entry(*place).or_default().push(*bound);
    }
    groups
}

struct Expansion<'g, 'w> {
    graph: &'g Graph,
    regions: Regions,
    b: Builder<'w>,
    copy: RawCopy<'g>,
    /// The loops around the groups, among other marks.
    loops: FxHashSet<NodeId>,
    /// The new counters of these loops.
    counters: FxHashMap<NodeId, NodeId>,
    /// What stands for the `bound`s that are expanded.
    results: FxHashMap<NodeId, NodeId>,
}

impl<'g> Expansion<'g, '_> {
    /// Expands those members of a group that can be.
    fn group(&mut self, place: NodeId, group: &[Bound]) -> Result<(), DifferentiateError> {
        let Some(first) = group.first() else { return Ok(()) };
        let graph = self.graph;
        let mut sources: Vec<NodeId> = components(graph, first.within).map(|c| c.wrt).collect();
        // An unnamed constant is no variable (LANGUAGE 13.3).
        sources.retain(|s| !matches!(graph.get(*s), Some(Node::Real(_))));
        sources.sort_unstable();
        sources.dedup();
        let depends = Depends::new(graph, &self.regions, place, sources);
        let ready: Vec<Bound> = group.iter().copied().filter(|g| !depends.blocked(depends.whole(), g.value)).collect();
        if ready.is_empty() {
            return Ok(());
        }
        let open = self.regions.open_at(place);
        let planner = Planner { graph, regions: &self.regions, depends: &depends, open: &open };
        let plan = match planner.values(place, ready.iter().map(|r| r.value)) {
            Ok(plan) => plan,
            Err(Refusal::Later) => return Ok(()),
            Err(Refusal::LoopBound(bound)) => {
                let (call, bound) = (graph.origin(first.node), graph.origin(bound));
                return Err(DifferentiateError::LoopBound { call, bound });
            }
        };
        self.enclose(&depends, &plan, first.within, &ready);
        Ok(())
    }

    fn enclose(&mut self, depends: &Depends<'g>, plan: &Plan, within: NodeId, ready: &[Bound]) {
        let graph = self.graph;
        if let Some(first) = ready.first() {
            self.b.set_origin(graph.origin(first.node));
        }
        self.b.set_apart(true);
        let mut walk = Walk::new(graph, depends, &mut self.b, &mut self.copy, &self.counters);
        for component in components(graph, within) {
            let [lo, hi, nan] = [component.lo, component.hi, component.nan].map(|x| walk.copy.to(x));
            let range = Range { lo, hi, nan, tidy: false };
            let tidy = Enclosure::Real(range.tidied(walk.b));
            walk.sources.entry(component.wrt).or_insert(tidy);
        }
        walk.run(plan);
        let ranges: Vec<Option<Range>> = ready.iter().map(|r| walk.range(r.value)).collect();
        walk.restore();
        self.b.set_apart(false);
        for (bound, range) in ready.iter().zip(ranges) {
            let Some(range) = range else { continue };
            self.b.set_origin(graph.origin(bound.node));
            let part = match bound.part {
                Part::Lower => range.lo,
                Part::Upper => range.hi,
                Part::MayBeNan => range.nan,
            };
            let result = self.b.fresh(part);
            self.results.insert(bound.node, result);
        }
    }
}
