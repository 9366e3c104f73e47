//! What several tests need of the steps.

use isograd_graph::ops::Family;
use isograd_graph::{Exhausted, Graph, Precision, Watch};

/// The step `kernels` as WebAssembly wants it, with the parameters of the steps beside it.
pub fn lane_kernels(graph: &Graph, p: Precision, most: usize, watch: &dyn Watch) -> Result<Graph, Exhausted> {
    isograd_transform::kernels(graph, p, Family::Lanes, most, watch)
}
