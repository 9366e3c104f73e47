//! Three steps that rebuild a graph: constants (`fold`), transcendental functions (`kernels`), algebra (`optimise`).

use isograd_graph::ops::Family;
use isograd_graph::{Exhausted, Graph, Mode, Node, Precision, Watch};

use crate::copy::copy;
use crate::live::live;

/// Computes what is constant in f64 and rounds it where it meets a value that is not (LANGUAGE 17.3). This is
/// meaning, not optimisation: it always runs, once, after the derivatives are expanded.
///
/// # Errors
/// If the budget is spent.
pub fn fold(graph: &Graph, precision: Precision, max_nodes: usize, watch: &dyn Watch) -> Result<Graph, Exhausted> {
    copy(graph, Mode::Exact(precision), max_nodes, watch, |b, op, args| b.op(op, args))
}

/// Puts the fragments of operations that a family of targets has no instructions for in their place, until none is left.
///
/// # Errors
/// If the budget is spent.
pub fn kernels(
    graph: &Graph,
    precision: Precision,
    family: Family,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Graph, Exhausted> {
    let pass = |graph: &Graph| {
        copy(graph, Mode::Real(precision), max_nodes, watch, |b, op, args| match op.def().fragment(family) {
            // Constant operands fold to the same bits.
            Some(fragment) if args.iter().any(|x| b.value(*x).is_none()) => fragment(b, args, precision),
            _ => b.op(op, args),
        })
    };
    let mut graph = pass(graph)?;
    while graph.iter().any(|(_, n)| matches!(n, Node::Apply(op, _) if op.def().fragment(family).is_some())) {
        graph = pass(&graph)?;
    }
    Ok(graph)
}

/// Applies the rewrites that preserve bits and drops what no output needs, until rewrites leave nothing unneeded.
///
/// # Errors
/// If the budget is spent.
pub fn optimise(graph: &Graph, precision: Precision, max_nodes: usize, watch: &dyn Watch) -> Result<Graph, Exhausted> {
    let pass = |graph: &Graph| copy(graph, Mode::Real(precision), max_nodes, watch, |b, op, args| b.op(op, args));
    let mut graph = pass(graph)?;
    while has_dead_operations(&graph) {
        graph = pass(&graph)?;
    }
    Ok(graph)
}

fn has_dead_operations(graph: &Graph) -> bool {
    let live = live(graph);
    graph.iter().zip(live).any(|((_, node), live)| matches!(node, Node::Apply(..)) && !live)
}
