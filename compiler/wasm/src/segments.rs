//! Where a large graph is cut into several functions, and what they leave each other in memory. Knows the order and
//! who reads what; knows nothing of instructions, and never cuts a branch or a loop.
//!
//! One long loop over the points exceeds the instruction cache, so that every iteration fetches all of its code anew;
//! and Cranelift's time grows faster than the length of a function. Short loops, each over a few points, keep their
//! code in the cache; what one computes and another reads is kept in *columns* of a value for each of these points,
//! which stay in the data cache. A value that is the same at every point has a *slot* instead.
//!
//! ```text
//! eval(count):  once parts                      uniform values, into slots
//!               for each chunk of points:       as many as the columns have room for
//!                   part 1, part 2, …           each a loop over the points of the chunk
//! ```
//!
//! Inputs are read again where they are needed and outputs stored where they are computed.

use std::ops::Range;

use isograd_graph::{Graph, Node, NodeId, PerNode};
use rustc_hash::FxHashMap;

use crate::layout::Kept;
use crate::lives::{Item, Order, defines, reads, storage};
use crate::rates::Rates;

/// When and how to cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Split {
    /// Graphs of more operations are cut.
    pub above: usize,
    /// Operations of a part at most, unless a single branch or loop has more.
    pub most: usize,
    /// Points of a chunk at most, a power of two.
    pub points: u32,
}

/// Measured on models of 7,000 to 65,000 operations in f32, one vector at a time. Parts of 200 to 1,000 operations take
/// the same time to run, within 3 %, and the longer ones less to compile. Chunks of 32 to 128 points too; of 256, the
/// columns no longer fit in the cache, and 512 take 1.4 times as long. Already 1,072 operations gain: 0.93 of the time
/// to run and half of that to compile; 65,537 take 0.83 and 0.07.
impl Default for Split {
    fn default() -> Self {
        Self { above: 800, most: 600, points: 64 }
    }
}

impl Split {
    /// Everything in one function.
    pub const NEVER: Self = Self { above: usize::MAX, most: usize::MAX, points: 64 };

    /// Operations that a part has at least, if it can choose: below, too much is kept in memory.
    const fn least(&self) -> usize {
        self.most.div_ceil(2)
    }
}

/// Where in the memory between the functions a value is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// One vector.
    Slot(u32),
    /// A vector for each vector of points of the chunk.
    Column(u32),
}

/// What the functions of a module that is cut have to do with each other.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Segments {
    /// How many of them, the first ones, run once per call. Each other one is a loop over the points of a chunk.
    pub once: usize,
    /// Where each value is that a later part reads.
    pub places: FxHashMap<NodeId, Place>,
    /// How many slots there are.
    pub slots: u32,
    /// How many columns there are.
    pub columns: u32,
}

impl Segments {
    /// The memory that the parts need.
    pub const fn kept(&self, split: &Split) -> Kept {
        Kept { slots: self.slots, columns: self.columns, points: split.points }
    }
}

/// What must not be cut: an operation, or an outermost branch or loop with its results.
struct Unit {
    /// The nodes, as a range of the order.
    from: usize,
    to: usize,
    operations: usize,
}

/// A value that units compute and others read; places are numbers of units.
struct Value {
    id: NodeId,
    home: usize,
    last: usize,
}

/// Cuts a graph into functions, in the order in which they run; `None` if it is small.
pub fn cut(graph: &Graph, rates: &Rates, order: &Order, split: &Split) -> Option<(Segments, Vec<Order>)> {
    let node = |item: &Item| match item {
        Item::Node(id) if !matches!(graph[*id], Node::Input(_)) => Some(*id),
        _ => None,
    };
    let nodes: Vec<NodeId> = order.items.iter().filter_map(node).collect();
    let operations = nodes.iter().filter(|id| matches!(graph[**id], Node::Apply(..))).count();
    if operations <= split.above {
        return None;
    }
    let start = order.items.get(..order.start).unwrap_or(&[]).iter().filter_map(node).count();
    let mut units = units(graph, rates, &nodes, 0..start);
    let first_of_loop = units.len();
    units.extend(self::units(graph, rates, &nodes, start..nodes.len()));
    // Stores the outputs that no unit of the loop computes.
    units.push(Unit { from: nodes.len(), to: nodes.len(), operations: 0 });

    let cutter = Cutter { graph, rates, nodes: &nodes, units: &units, first_of_loop };
    let (values, outputs) = cutter.values();
    let cuts = cutter.cuts(&values, split);
    Some(cutter.segments(&values, &outputs, &cuts))
}

/// Groups nodes into units. A branch lasts until its last join that selects what is computed after the branch.
fn units(graph: &Graph, rates: &Rates, nodes: &[NodeId], range: Range<usize>) -> Vec<Unit> {
    let mut units: Vec<Unit> = Vec::new();
    let mut until = None;
    for (at, id) in nodes.iter().enumerate().take(range.end).skip(range.start) {
        if until.is_none_or(|until| *id > until) {
            units.push(Unit { from: at, to: at, operations: 0 });
        }
        let end = match graph[*id] {
            Node::Gamma { end, .. } => {
                let late = |join: &&NodeId| match graph[**join] {
                    Node::Join { then, otherwise, .. } => graph.is_late(end, then) || graph.is_late(end, otherwise),
                    _ => false,
                };
                rates.joins.get(&end).into_iter().flatten().filter(late).max().copied().unwrap_or(end)
            }
            Node::Theta { end, .. } => end,
            _ => *id,
        };
        until = until.max(Some(end));
        if let Some(unit) = units.last_mut() {
            unit.to = at + 1;
            unit.operations += usize::from(matches!(graph[*id], Node::Apply(..)));
        }
    }
    units
}

struct Cutter<'a> {
    graph: &'a Graph,
    rates: &'a Rates,
    nodes: &'a [NodeId],
    units: &'a [Unit],
    first_of_loop: usize,
}

impl Cutter<'_> {
    fn nodes(&self, unit: &Unit) -> &[NodeId] {
        self.nodes.get(unit.from..unit.to).unwrap_or(&[])
    }

    /// The values that units compute, in order, with who reads them last; and the unit that stores each output.
    fn values(&self) -> (Vec<Value>, Vec<usize>) {
        let (graph, rates) = (self.graph, self.rates);
        let mut values: Vec<Value> = Vec::new();
        let mut place = PerNode::new(graph, usize::MAX);
        for (at, unit) in self.units.iter().enumerate() {
            for id in self.nodes(unit) {
                reads(graph, rates, *id, graph[*id], |x| {
                    if let Some(value) = values.get_mut(place[storage(graph, x)]) {
                        value.last = at;
                    }
                });
                defines(graph, rates, *id, graph[*id], |id| {
                    place[id] = values.len();
                    values.push(Value { id, home: at, last: at });
                });
            }
        }
        let end = self.units.len() - 1;
        let store = |output: &isograd_graph::Output| match values.get_mut(place[storage(graph, output.node)]) {
            Some(value) if value.home >= self.first_of_loop => value.home,
            Some(value) => {
                value.last = end;
                end
            }
            None => end,
        };
        let outputs = graph.outputs.iter().map(store).collect();
        (values, outputs)
    }

    /// The parts as ranges of units: each ends where the fewest columns are needed, between `least` and `most`
    /// operations after its beginning.
    fn cuts(&self, values: &[Value], split: &Split) -> Vec<Range<usize>> {
        let mut crossing = vec![0_isize; self.units.len() + 1];
        for value in values.iter().filter(|value| !self.rates.uniform[value.id]) {
            for (at, change) in [(value.home + 1, 1), (value.last + 1, -1)] {
                if let Some(place) = crossing.get_mut(at) {
                    *place += change;
                }
            }
        }
        let mut live = 0;
        for change in &mut crossing {
            live += *change;
            *change = live;
        }
        let mut parts = Vec::new();
        for section in [0..self.first_of_loop, self.first_of_loop..self.units.len()] {
            let mut from = section.start;
            while from < section.end {
                let to = self.end_of_part(from, section.end, &crossing, split);
                parts.push(from..to);
                from = to;
            }
        }
        parts
    }

    /// Where a part that begins at a unit ends; `crossing` has the number of columns for each end.
    fn end_of_part(&self, from: usize, end: usize, crossing: &[isize], split: &Split) -> usize {
        let mut operations = 0;
        let mut best = None;
        let rest = self.units.iter().zip(crossing).enumerate().take(end).skip(from);
        for (at, (unit, crossing)) in rest {
            if at > from {
                // Before `least` only the latest place counts.
                let columns = if operations < split.least() { isize::MAX } else { *crossing };
                if best.is_none_or(|(least, _)| columns <= least) {
                    best = Some((columns, at));
                }
            }
            operations += unit.operations;
            if operations > split.most {
                return best.map_or(from + 1, |(_, at)| at);
            }
        }
        end
    }

    /// Says what each part does, and gives what parts leave each other its place.
    fn segments(&self, values: &[Value], outputs: &[usize], parts: &[Range<usize>]) -> (Segments, Vec<Order>) {
        let once = parts.iter().filter(|units| units.end <= self.first_of_loop).count();
        let mut segments = Segments { once, ..Segments::default() };
        let mut orders = Vec::with_capacity(parts.len());
        let mut columns = Columns::default();
        let mut stores: Vec<(usize, usize)> = outputs.iter().enumerate().map(|(index, unit)| (*unit, index)).collect();
        stores.sort_unstable();
        let mut stores = stores.into_iter().peekable();
        let mut values = values.iter().peekable();
        // The last part that had a value in a local.
        let mut here = PerNode::new(self.graph, usize::MAX);
        for (number, range) in parts.iter().enumerate() {
            columns.free_before(range.start);
            let mut items = Vec::new();
            for (at, unit) in self.units.iter().enumerate().take(range.end).skip(range.start) {
                let mut keeps = Vec::new();
                while let Some(value) = values.next_if(|value| value.home == at) {
                    here[value.id] = number;
                    if value.last >= range.end {
                        let place = if self.rates.uniform[value.id] {
                            segments.slots += 1;
                            Place::Slot(segments.slots - 1)
                        } else {
                            Place::Column(columns.take(value.last))
                        };
                        segments.places.insert(value.id, place);
                        keeps.push(Item::Keep(value.id));
                    }
                }
                let mut read = |x: NodeId| {
                    let x = storage(self.graph, x);
                    let item = match self.graph[x] {
                        Node::Input(_) => Item::Node(x),
                        _ if segments.places.contains_key(&x) => Item::Restore(x),
                        _ => return,
                    };
                    if std::mem::replace(&mut here[x], number) != number {
                        items.push(item);
                    }
                };
                let nodes = self.nodes(unit);
                nodes.iter().for_each(|id| reads(self.graph, self.rates, *id, self.graph[*id], &mut read));
                let mut results = Vec::new();
                while let Some((_, index)) = stores.next_if(|(unit, _)| *unit == at) {
                    self.graph.outputs.get(index).into_iter().for_each(|output| read(output.node));
                    results.push(Item::Output(index));
                }
                items.extend(nodes.iter().copied().map(Item::Node));
                items.extend(keeps);
                items.extend(results);
            }
            orders.push(Order { items, start: 0 });
        }
        segments.columns = columns.count;
        (segments, orders)
    }
}

/// Hands out columns.
#[derive(Default)]
struct Columns {
    count: u32,
    free: Vec<u32>,
    /// The last unit that reads a column, and the column.
    taken: Vec<(usize, u32)>,
}

impl Columns {
    fn take(&mut self, last: usize) -> u32 {
        let column = self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        });
        self.taken.push((last, column));
        column
    }

    /// Takes back those that no unit from this one on reads. A part may write a column only if no other value is read
    /// from it there: the two would be in turn at each point.
    fn free_before(&mut self, unit: usize) {
        self.taken.retain(|(last, column)| {
            if *last < unit {
                self.free.push(*column);
            }
            *last >= unit
        });
    }
}
