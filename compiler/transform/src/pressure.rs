//! How many values are alive at once: what decides the order of emission.

use isograd_graph::{Graph, Node, NodeId};

/// The largest number of values that are alive at once when a target computes the nodes in order. Constants do not
/// count: targets put them where they are used. What a loop reads from outside lives until the loop's end.
#[must_use]
pub fn max_live(graph: &Graph) -> usize {
    let last = last_uses(graph);
    let mut deaths = vec![0_usize; graph.len() + 1];
    let (mut alive, mut most) = (0_usize, 0_usize);
    for (id, node) in graph.iter() {
        let is_value = matches!(
            node,
            Node::Input(_)
                | Node::Apply(..)
                | Node::Join { .. }
                | Node::Final { .. }
                | Node::Carried { .. }
                | Node::Counter { .. }
                | Node::Recall { .. }
        );
        let dies = last.get(id.index()).copied().unwrap_or(NodeId(0));
        if is_value && dies > id {
            alive += 1;
            most = most.max(alive);
            if let Some(n) = deaths.get_mut(dies.index()) {
                *n += 1;
            }
        }
        alive -= deaths.get(id.index()).copied().unwrap_or(0);
    }
    most
}

/// The position after which each value is not read again; its own position if it never is. Outputs are read where
/// they are made: a target stores them at once.
fn last_uses(graph: &Graph) -> Vec<NodeId> {
    let mut last: Vec<NodeId> = graph.iter().map(|(id, _)| id).collect();
    let mut loops: Vec<(NodeId, NodeId)> = Vec::new();
    for (at, node) in graph.iter() {
        if let Node::Theta { end, .. } = node {
            loops.push((at, end));
        }
        while loops.last().is_some_and(|(_, end)| *end < at) {
            loops.pop();
        }
        node.each_operand(|x| {
            // The outermost loop around the use that the value lies outside of repeats the use.
            let until = loops.iter().find(|(begin, end)| x < *begin && at <= *end).map_or(at, |(_, end)| *end);
            if let Some(place) = last.get_mut(x.index()) {
                *place = (*place).max(until);
            }
        });
    }
    last
}
