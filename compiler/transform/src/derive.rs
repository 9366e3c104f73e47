//! Host queries become `diff` nodes at the end of the graph, so that they mean exactly what `diff` would give inside
//! the program (LANGUAGE 9.5).

use isograd_graph::{Builder, Exhausted, Graph, Mode, Node, NodeId, Scalar, Watch};

use crate::raw::RawCopy;

/// One wanted scalar: an output of the graph, differentiated by inputs, the first of `by` first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// The name of the new output, unique.
    pub name: String,
    /// The output's index.
    pub output: usize,
    /// Indices of inputs.
    pub by: Vec<usize>,
}

/// Replaces the outputs of a raw graph by the wanted ones.
///
/// # Errors
/// If the budget is spent.
pub fn derive(graph: &Graph, wanted: &[Wanted], max_nodes: usize, watch: &dyn Watch) -> Result<Graph, Exhausted> {
    let mut builder = Builder::new(Mode::Raw, max_nodes, watch);
    let mut copy = RawCopy::new(graph);
    for (id, node) in graph.iter() {
        copy.node(&mut builder, id, node);
    }
    let inputs: Vec<NodeId> =
        graph.iter().filter(|(_, n)| matches!(n, Node::Input(_))).map(|(id, _)| copy.to(id)).collect();
    for want in wanted {
        let Some(output) = graph.outputs.get(want.output) else { continue };
        let mut node = copy.to(output.node);
        for by in &want.by {
            let Some(wrt) = inputs.get(*by) else { continue };
            // Only reals vary continuously (LANGUAGE 9.5).
            if builder.graph().scalar(node) == Scalar::Real && builder.graph().scalar(*wrt) == Scalar::Real {
                node = builder.diff(node, *wrt);
            }
        }
        builder.output(want.name.clone(), node);
    }
    builder.finish()
}
