//! Elaboration: a typed program and one of its exports become a raw graph in which csg trees, calls, tuples, vectors
//! and matrices have dissolved. Knows nothing of source text, of derivatives and of what the graph is for.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod branches;
mod builtins;
mod code;
mod csg;
mod domain;
mod eval;
mod intervals;
mod machine;
mod matrices;
mod messages;
mod metadata;
mod nodes;
mod operators;
mod value;

use std::collections::BTreeMap;

use isograd_graph::{Graph, NodeId, Origin, Watch};
use isograd_program::Program;
use isograd_program::typed::FunctionId;
use isograd_syntax::{Diagnostic, Limits, Span};

pub use metadata::{Metadata, metadata};

/// What [`elaborate`] makes.
#[derive(Debug, Clone, PartialEq)]
pub struct Elaborated {
    /// The raw graph: its inputs are the flattened parameters, named `at.x` and so on, its outputs the flattened
    /// result, named `value.x` and so on (LANGUAGE 9.2).
    pub graph: Graph,
    /// The place in the source of each [`isograd_graph::Origin`] of the graph.
    pub origins: Vec<Span>,
    /// The names of the variables that loops carry, by the origins of their nodes.
    pub carried: BTreeMap<Origin, String>,
    /// What is worth telling.
    pub warnings: Vec<Diagnostic>,
    /// Every `diff` that was elaborated: where it is written, and the derivatives it asks for.
    pub diffs: Vec<(Span, Vec<NodeId>)>,
}

/// Specialises one export (LANGUAGE 12, 18).
///
/// # Errors
/// What is wrong with the program for this export: nodes without impl, cycles, csg loops whose bounds are not
/// constant, exceeded limits.
pub fn elaborate(
    program: &Program,
    export: FunctionId,
    limits: &Limits,
    watch: &dyn Watch,
) -> Result<Elaborated, Vec<Diagnostic>> {
    machine::run(program, export, limits, watch)
}
