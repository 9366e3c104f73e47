//! The checker: all items of a loaded program become a typed [`Program`]. This file lists the steps; it knows nothing
//! of single constructs, which have a file each.

mod body;
mod branches;
mod builtins;
mod calls;
mod cycles;
mod expressions;
mod items;
mod lists;
mod liveness;
mod lookup;
mod messages;
mod operators;
mod statements;
mod tree;
mod types;

use isograd_syntax::{Diagnostic, Files, Limits};

use crate::{
    load::{Loaded, Module},
    names::Names,
    typed::Program,
};

/// The outcome of [`check`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Checked {
    /// The typed program; meant for use only if no diagnostic is an error.
    pub program: Program,
    /// What is wrong, in source order.
    pub diagnostics: Vec<Diagnostic>,
    /// Errors that were found but not described, because there were far more than `limits.diagnostics`.
    pub omitted_errors: u64,
}

/// Checks names, types, control flow and csg values of all modules (LANGUAGE 3 to 8, 10.5, 11, 12.5, 13.1, 16), and
/// turns every body into stack code. Errors that need specialisation are left to elaboration.
#[must_use]
pub fn check(loaded: &Loaded, limits: &Limits) -> Checked {
    let mut report = Report::new(limits);
    let names = Names::collect(&loaded.modules, &mut report);
    let mut world =
        World { files: &loaded.files, modules: &loaded.modules, limits, names, program: Program::default() };
    items::signatures(&mut world, &mut report);
    let uses = items::bodies(&mut world, &mut report);
    cycles::recursion(&world, &uses, &mut report);
    cycles::self_building(&world, &uses, &mut report);
    report.finish(world.program)
}

/// What the checker of a body sees.
pub(crate) struct World<'a> {
    files: &'a Files,
    modules: &'a [Module],
    limits: &'a Limits,
    names: Names<'a>,
    /// Signatures are complete before the first body is checked.
    program: Program,
}

/// Collects diagnostics. After ten times as many errors as are shown they are only counted, so that no source makes
/// the compiler use much memory.
#[derive(Debug)]
pub(crate) struct Report {
    diagnostics: Vec<Diagnostic>,
    errors: u64,
    omitted: u64,
    limit: u64,
}

impl Report {
    fn new(limits: &Limits) -> Self {
        Self { diagnostics: Vec::new(), errors: 0, omitted: 0, limit: limits.diagnostics }
    }

    /// Adds one.
    pub(crate) fn push(&mut self, diagnostic: Diagnostic) {
        let error = diagnostic.is_error();
        self.errors += u64::from(error);
        if self.diagnostics.len() as u64 <= self.limit.saturating_mul(10) {
            self.diagnostics.push(diagnostic);
        } else {
            self.omitted += u64::from(error);
        }
    }

    /// Whether another error would be shown, so that a costly message is worth it.
    fn is_worth_it(&self) -> bool {
        self.errors <= self.limit
    }

    fn finish(self, program: Program) -> Checked {
        let mut diagnostics = self.diagnostics;
        diagnostics.sort_by_key(|d| d.labels.first().map(|l| (l.span.file, l.span.start)));
        Checked { program, diagnostics, omitted_errors: self.omitted }
    }
}
