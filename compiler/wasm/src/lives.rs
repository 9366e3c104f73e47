//! The order of emission and how long each value is needed in it. Knows the graph and its rates; knows nothing of
//! locals and instructions.

use isograd_graph::{Graph, Node, NodeId};

use crate::rates::{PerNode, Rates, is_constant, is_late, owner};

/// The order of emission, and from where to where in it each value lives.
pub struct Lives {
    /// The needed nodes that are no constants: first those computed once, then those of the loop over the points.
    pub items: Vec<NodeId>,
    /// Where in `items` the loop over the points begins.
    pub start: usize,
    /// Where each value is first written.
    first: PerNode<usize>,
    /// Where each value is last read; `items.len()` for what the outputs or later points read.
    last: PerNode<usize>,
    /// The values, ordered by their last read.
    deaths: Vec<NodeId>,
}

/// A final is another name for the content of its variable.
pub fn storage(graph: &Graph, id: NodeId) -> NodeId {
    match graph.get(id) {
        Some(Node::Final { carried, .. }) => carried,
        _ => id,
    }
}

/// Calls `f` with the values that are read where this node stands in the order. Joins and finals are computed where
/// their regions end, carried variables where their loop begins.
pub fn reads(graph: &Graph, rates: &Rates, id: NodeId, node: Node, mut f: impl FnMut(NodeId)) {
    match node {
        Node::Apply(..) | Node::Gamma { .. } => node.each_operand(f),
        Node::Else { gamma } => {
            let Some(Node::Gamma { end, .. }) = graph.get(gamma) else { return };
            for join in rates.joins.get(&end).into_iter().flatten() {
                if let Node::Join { then, .. } = graph[*join]
                    && !is_late(graph, end, then)
                {
                    f(then);
                }
            }
        }
        Node::Join { end, then, otherwise } => {
            let late = [then, otherwise].map(|x| is_late(graph, end, x).then_some(x));
            if let Some(Node::Gamma { cond, .. }) = graph.get(owner(graph, end))
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
                        && !is_late(graph, id, otherwise)
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
            }
            _ => {}
        },
        _ => {}
    }
}

/// The order, and where in it the loop over the points begins.
fn order(graph: &Graph, rates: &Rates) -> (Vec<NodeId>, usize) {
    let wanted = |(id, node): &(NodeId, Node)| rates.needed[*id] && !is_constant(*node);
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
    (items, start)
}

/// Puts a varying input in order if it is not yet.
fn load(graph: &Graph, rates: &Rates, x: NodeId, loaded: &mut PerNode<bool>, items: &mut Vec<NodeId>) {
    if matches!(graph[x], Node::Input(_)) && !rates.early[x] && !std::mem::replace(&mut loaded[x], true) {
        items.push(x);
    }
}

impl Lives {
    /// Computes order and lives.
    pub fn new(graph: &Graph, rates: &Rates) -> Self {
        let (items, start) = order(graph, rates);
        let mut positions = PerNode::new(graph, 0);
        for (at, id) in items.iter().enumerate() {
            positions[*id] = at;
        }
        let mut first = PerNode::new(graph, usize::MAX);
        let mut last = PerNode::new(graph, 0);
        // The open loops, each as where it begins and ends. What is made outside of a loop and read inside must last
        // to the loop's end. The loop over the points is one more.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for (at, id) in items.iter().enumerate() {
            if at == start {
                open.push((start, items.len()));
            }
            let node = graph[*id];
            reads(graph, rates, *id, node, |x| {
                if is_constant(graph[x]) {
                    return;
                }
                let x = storage(graph, x);
                let inside = open.partition_point(|(begin, _)| *begin <= first[x]);
                let until = open.get(inside).map_or(at, |(_, end)| *end);
                last[x] = last[x].max(until);
            });
            match node {
                Node::Input(_) | Node::Apply(..) | Node::Counter { .. } => first[*id] = at,
                Node::Theta { end, .. } => {
                    open.push((at, positions[end]));
                    rates.carried.get(id).into_iter().flatten().for_each(|carried| first[*carried] = at);
                }
                Node::Else { gamma } => {
                    if let Some(Node::Gamma { end, .. }) = graph.get(gamma) {
                        rates.joins.get(&end).into_iter().flatten().for_each(|join| first[*join] = at);
                    }
                }
                Node::End { begin } if matches!(graph[begin], Node::Theta { .. }) => {
                    open.pop();
                }
                _ => {}
            }
        }
        for output in &graph.outputs {
            last[storage(graph, output.node)] = items.len();
        }
        let mut deaths: Vec<NodeId> =
            graph.iter().map(|(id, _)| id).filter(|id| first[*id] != usize::MAX && last[*id] > first[*id]).collect();
        deaths.sort_by_key(|id| last[*id]);
        Self { items, start, first, last, deaths }
    }

    /// The values that are read for the last time at a place in the order.
    pub fn dying(&self, at: usize) -> &[NodeId] {
        let from = self.deaths.partition_point(|id| self.last[*id] < at);
        let to = self.deaths.partition_point(|id| self.last[*id] <= at);
        self.deaths.get(from..to).unwrap_or(&[])
    }

    /// The largest number of varying values that live at once in the loop over the points.
    pub fn pressure(&self, rates: &Rates) -> usize {
        let mut changes = vec![0_isize; self.items.len() + 1];
        for id in self.deaths.iter().filter(|id| !rates.uniform[**id]) {
            if let Some(change) = changes.get_mut(self.first[*id]) {
                *change += 1;
            }
            // What dies where another value is made leaves its register to it.
            if let Some(change) = changes.get_mut(self.last[*id]) {
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
