//! The order of emission and how long each value is needed in it. Knows the graph and its rates; knows nothing of
//! locals and instructions.

use isograd_graph::{Graph, Node, NodeId, PerNode};

use crate::rates::Rates;

/// One thing that a function does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Item {
    /// Computes a node.
    Node(NodeId),
    /// Reads back a value that an earlier function has kept.
    Restore(NodeId),
    /// Keeps a value in memory for later functions.
    Keep(NodeId),
    /// Stores an output of the graph, by its index.
    Output(usize),
}

/// What a function does, in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Order {
    /// First what is done once, then what is done in the loop over the points.
    pub items: Vec<Item>,
    /// Where in `items` the loop over the points begins.
    pub start: usize,
}

/// From where to where in an order each value lives.
#[derive(Default)]
pub struct Lives {
    /// Ordered by their ends. A value that is read back twice has two lives.
    lives: Vec<Life>,
    /// How many things the order has.
    length: usize,
}

struct Life {
    id: NodeId,
    /// Where it is first written.
    first: usize,
    /// Where it is last read; the end of the loop for what later iterations read.
    last: usize,
}

/// What several orders of one graph can use in turn to find their lives: it need not be cleared in between, as every
/// order writes a value before it reads it.
pub struct Tables {
    /// The place of a value's life.
    current: PerNode<usize>,
    /// Where a node stands.
    position: PerNode<usize>,
}

impl Tables {
    /// For the orders of a graph.
    pub fn new(graph: &Graph) -> Self {
        Self { current: PerNode::new(graph, usize::MAX), position: PerNode::new(graph, 0) }
    }
}

/// A final is another name for the content of its variable.
pub fn storage(graph: &Graph, id: NodeId) -> NodeId {
    match graph.get(id) {
        Some(Node::Final { carried, .. }) => carried,
        _ => id,
    }
}

/// Calls `f` with the values that are read where this node stands in the order. Joins and finals are computed and tapes
/// written where their regions end, carried variables where their loop begins.
pub fn reads(graph: &Graph, rates: &Rates, id: NodeId, node: Node, mut f: impl FnMut(NodeId)) {
    match node {
        Node::Apply(..) | Node::Gamma { .. } => node.each_operand(f),
        // The tape itself is in memory.
        Node::Recall { at, .. } => f(at),
        Node::Else { gamma } => {
            let Some(Node::Gamma { end, .. }) = graph.get(gamma) else { return };
            for join in rates.joins.get(&end).into_iter().flatten() {
                if let Node::Join { then, .. } = graph[*join]
                    && !graph.is_late(end, then)
                {
                    f(then);
                }
            }
        }
        Node::Join { end, then, otherwise } => {
            let late = [then, otherwise].map(|x| graph.is_late(end, x).then_some(x));
            if let Some(Node::Gamma { cond, .. }) = graph.get(graph.owner(end))
                && late.iter().any(Option::is_some)
            {
                f(cond);
                late.into_iter().flatten().for_each(f);
            }
        }
        Node::Theta { lo, hi, .. } => {
            f(lo);
            f(hi);
            for carried in rates.carried.get(&id).into_iter().flatten() {
                if let Node::Carried { init, .. } = graph[*carried] {
                    f(init);
                }
            }
        }
        Node::End { begin } => match graph[begin] {
            Node::Gamma { cond, .. } => {
                f(cond);
                for join in rates.joins.get(&id).into_iter().flatten() {
                    if let Node::Join { otherwise, .. } = graph[*join]
                        && !graph.is_late(id, otherwise)
                    {
                        f(otherwise);
                    }
                }
            }
            Node::Theta { lo, hi, .. } => {
                if !(rates.uniform[lo] && rates.uniform[hi]) {
                    f(hi);
                }
                for carried in rates.carried.get(&begin).into_iter().flatten() {
                    f(*carried);
                    f(rates.next[*carried]);
                }
                for tape in rates.tapes.get(&begin).into_iter().flatten() {
                    graph[*tape].each_operand(&mut f);
                }
            }
            _ => {}
        },
        _ => {}
    }
}

/// Calls `f` with the values that are first written where this node stands in the order.
pub fn defines(graph: &Graph, rates: &Rates, id: NodeId, node: Node, mut f: impl FnMut(NodeId)) {
    match node {
        Node::Input(_) | Node::Apply(..) | Node::Counter { .. } | Node::Recall { .. } => f(id),
        Node::Theta { .. } => rates.carried.get(&id).into_iter().flatten().for_each(|carried| f(*carried)),
        Node::Else { gamma } => {
            if let Some(Node::Gamma { end, .. }) = graph.get(gamma) {
                rates.joins.get(&end).into_iter().flatten().for_each(|join| f(*join));
            }
        }
        _ => {}
    }
}

/// The order of a module of one function.
pub fn order(graph: &Graph, rates: &Rates) -> Order {
    let wanted = |(id, node): &(NodeId, Node)| rates.needed[*id] && !node.is_constant();
    let mut items: Vec<NodeId> = graph.iter().filter(wanted).map(|(id, _)| id).filter(|id| rates.early[*id]).collect();
    let start = items.len();

    // A column is read before its first use, not at the top, so that it occupies a register no longer than it must;
    // but before the whole outermost branch or loop, which may not run.
    let mut loaded = PerNode::new(graph, false);
    let mut group = Vec::new();
    let mut outermost_end = None;
    for (id, node) in graph.iter().filter(wanted).filter(|(id, _)| !rates.early[*id]) {
        if matches!(node, Node::Input(_)) {
            continue;
        }
        reads(graph, rates, id, node, |x| load(graph, rates, x, &mut loaded, &mut items));
        group.push(id);
        if outermost_end.is_none()
            && let Node::Gamma { end, .. } | Node::Theta { end, .. } = node
        {
            outermost_end = Some(end);
        }
        if outermost_end.is_none_or(|end| end == id) {
            outermost_end = None;
            items.append(&mut group);
        }
    }
    for output in &graph.outputs {
        load(graph, rates, output.node, &mut loaded, &mut items);
    }
    let outputs = (0..graph.outputs.len()).map(Item::Output);
    Order { items: items.into_iter().map(Item::Node).chain(outputs).collect(), start }
}

/// Puts a varying input in order if it is not yet.
fn load(graph: &Graph, rates: &Rates, x: NodeId, loaded: &mut PerNode<bool>, items: &mut Vec<NodeId>) {
    if matches!(graph[x], Node::Input(_)) && !rates.early[x] && !std::mem::replace(&mut loaded[x], true) {
        items.push(x);
    }
}

impl Lives {
    /// Finds the lives of the values of an order.
    pub fn new(graph: &Graph, rates: &Rates, order: &Order, tables: &mut Tables) -> Self {
        let Tables { current, position } = tables;
        for (at, item) in order.items.iter().enumerate() {
            if let Item::Node(id) = item {
                position[*id] = at;
            }
        }
        let length = order.items.len();
        let mut lives: Vec<Life> = Vec::with_capacity(length);
        // The open loops, each as where it begins and ends. What is made outside of a loop and read inside must last
        // to the loop's end. The loop over the points is one more.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for (at, item) in order.items.iter().enumerate() {
            if at == order.start {
                open.push((order.start, length));
            }
            let mut read = |x: NodeId| {
                if graph[x].is_constant() {
                    return;
                }
                let Some(life) = lives.get_mut(current[storage(graph, x)]) else { return };
                let inside = open.partition_point(|(begin, _)| *begin <= life.first);
                let until = open.get(inside).map_or(at, |(_, end)| *end);
                life.last = life.last.max(until);
            };
            match *item {
                Item::Node(id) => reads(graph, rates, id, graph[id], read),
                Item::Keep(id) => read(id),
                Item::Output(index) => graph.outputs.get(index).into_iter().for_each(|output| read(output.node)),
                Item::Restore(_) => {}
            }
            let mut write = |id: NodeId| {
                current[id] = lives.len();
                lives.push(Life { id, first: at, last: 0 });
            };
            match *item {
                Item::Node(id) => defines(graph, rates, id, graph[id], write),
                Item::Restore(id) => write(id),
                Item::Keep(_) | Item::Output(_) => {}
            }
            if let Item::Node(id) = *item {
                match graph[id] {
                    Node::Theta { end, .. } => open.push((at, position[end])),
                    Node::End { begin } if matches!(graph[begin], Node::Theta { .. }) => _ = open.pop(),
                    _ => {}
                }
            }
        }
        lives.retain(|life| life.last > life.first);
        lives.sort_by_key(|life| (life.last, life.id));
        Self { lives, length }
    }

    /// The values that are read for the last time at a place in the order.
    pub fn dying(&self, at: usize) -> impl Iterator<Item = NodeId> {
        let from = self.lives.partition_point(|life| life.last < at);
        self.lives.get(from..).unwrap_or(&[]).iter().take_while(move |life| life.last == at).map(|life| life.id)
    }

    /// The largest number of varying values that live at once in the loop over the points.
    pub fn pressure(&self, rates: &Rates) -> usize {
        let mut changes = vec![0_isize; self.length + 1];
        for life in self.lives.iter().filter(|life| !rates.uniform[life.id]) {
            if let Some(change) = changes.get_mut(life.first) {
                *change += 1;
            }
            // What dies where another value is made leaves its register to it.
            if let Some(change) = changes.get_mut(life.last) {
                *change -= 1;
            }
        }
        let mut live = 0_isize;
        let most = changes.iter().map(|change| {
            live += *change;
            live
        });
        most.max().unwrap_or(0).unsigned_abs()
    }
}
