//! All diagnostics of a program at once: those of reading and checking it, and those of specialising and
//! differentiating each export that is sound. Knows which steps find mistakes of the program; makes no code.

use std::collections::BTreeMap;

use isograd_elaborate::elaborate;
use isograd_graph::{Graph, NodeId, Precision, Watch};
use isograd_program::Program;
use isograd_program::typed::FunctionId;
use isograd_syntax::{Code, Diagnostic, Diagnostics, Span};
use isograd_transform::{Sweep, active_diffs, answer, differentiate};

use crate::pipeline::{Checked, Options, Steps, reported};
use crate::wanted::Wanting;
use crate::{Query, Request};

/// Every error and warning of a program, in source order, without those that follow from others. An export from
/// which an error can be reached is not specialised; the others are. `watch` gives each export its own time.
#[must_use]
pub fn inspect<W: Watch>(checked: &Checked, options: &Options, watch: impl Fn() -> W) -> Vec<Diagnostic> {
    let full = checked.diagnostics.iter().any(|d| d.code == Code::E1012);
    let Some(program) = checked.any_program().filter(|_| !full) else { return checked.diagnostics.clone() };
    let mut list = checked.diagnostics.clone();
    let mut diffs = Influences::default();
    for export in &program.exports {
        if program.is_sound_from(*export) {
            list.extend(of_export(program, *export, options, &watch(), &mut diffs));
        }
    }
    let inert = diffs.warnings(checked, &list);
    list.extend(inert);
    let mut found = Diagnostics::default();
    let mut seen = std::collections::BTreeSet::new();
    // Several exports may lead to one mistake in several ways; one of them is shown.
    found.extend(list.into_iter().filter(|d| {
        let place = d.labels.first().map(|l| l.span);
        seen.insert((place, d.code, d.message.clone()))
    }));
    reported(found, &options.limits)
}

fn of_export(
    program: &Program,
    export: FunctionId,
    options: &Options,
    watch: &dyn Watch,
    diffs: &mut Influences,
) -> Vec<Diagnostic> {
    let Some(function) = program.functions.get(export.0 as usize) else { return Vec::new() };
    let request = Request { export: function.name.clone(), queries: vec![Query::Value], ..Request::default() };
    let wanting = match Wanting::of(program, &request, &options.limits) {
        Ok(wanting) => wanting,
        Err(diagnostic) => return vec![*diagnostic],
    };
    watch.step("elaborate");
    let elaborated = match elaborate(program, export, &options.limits, watch) {
        Ok(elaborated) => elaborated,
        Err(diagnostics) => return diagnostics,
    };
    diffs.add(&elaborated.graph, &elaborated.diffs, watch);
    let mut found = elaborated.warnings;
    let steps = Steps { options, origins: &elaborated.origins, carried: &elaborated.carried, export: &function.name };
    let limits = &options.limits;
    let nodes = usize::try_from(limits.derived_nodes).unwrap_or(usize::MAX);
    watch.step("differentiate");
    let derived =
        answer(&elaborated.graph, &wanting.inputs(), &wanting.asked, nodes, watch).map_err(|e| steps.exhausted(e));
    let result = derived.and_then(|derived| {
        differentiate(derived.graph, Sweep::Forward, Precision::F32, limits.diff_order, nodes, watch)
            .map_err(|e| steps.underivable(e))
    });
    found.extend(result.err().into_iter().flatten());
    found
}

/// For each `diff` that is written in the program, whether anything it asks for can be other than 0.
#[derive(Debug, Default)]
pub struct Influences(BTreeMap<Span, bool>);

impl Influences {
    /// Adds the `diff`s of one export's graph.
    pub fn add(&mut self, graph: &Graph, diffs: &[(Span, Vec<NodeId>)], watch: &dyn Watch) {
        if diffs.is_empty() {
            return;
        }
        let active = active_diffs(graph, watch);
        for (span, nodes) in diffs {
            *self.0.entry(*span).or_default() |= nodes.iter().any(|n| active.contains(n));
        }
    }

    /// W0701 for those that are always 0, but for those in libraries and those that were `told` already.
    pub fn warnings(&self, checked: &Checked, told: &[Diagnostic]) -> Vec<Diagnostic> {
        let is_told = |span: &Span| {
            told.iter().any(|d| d.code == Code::W0701 && d.labels.first().is_some_and(|l| l.span == *span))
        };
        let inert = self.0.iter().filter(|(span, active)| !**active && checked.is_own(span.file) && !is_told(span));
        inert
            .map(|(span, _)| {
                Diagnostic::new(Code::W0701, *span, "this derivative is always 0")
                    .note("the expression does not depend on the value that it is differentiated by")
                    .help(
                        "differentiate by a value that the expression is computed from; after an assignment a name \
                         means a new value, so use `let` with a new name for the changed one",
                    )
            })
            .collect()
    }
}
