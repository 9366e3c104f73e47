//! What a rule may know of its operands beside their enclosures. Knows the graph only as far as it says which values
//! are the same.

use isograd_graph::{Facts, Graph, Node, NodeId, Op};

/// What is known of the operands of an operation; `is_source` says which values a box replaces.
pub fn facts(graph: &Graph, args: &[NodeId], is_source: impl Fn(NodeId) -> bool) -> Facts {
    let [a, b, ..] = args else { return Facts::default() };
    let (a, b) = (original(graph, *a, &is_source), original(graph, *b, &is_source));
    let part = !is_source(b)
        && match graph.get(b) {
            Some(Node::Apply(Op::Length2 | Op::Length3 | Op::Length4, vector)) => {
                vector.as_slice().iter().any(|x| original(graph, *x, &is_source) == a)
            }
            _ => false,
        };
    Facts { same: a == b, part }
}

/// The value that a value is a name of. One that a box replaces is a value of its own.
fn original(graph: &Graph, id: NodeId, is_source: impl Fn(NodeId) -> bool) -> NodeId {
    let mut at = id;
    while let Some(Node::Fresh(x)) = graph.get(at).filter(|_| !is_source(at)) {
        at = x;
    }
    at
}
