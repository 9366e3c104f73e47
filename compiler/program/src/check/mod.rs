//! The checker: all items of a loaded program become a typed [`Program`]. This file lists the steps; it knows nothing
//! of single constructs, which have a file each.

mod body;
mod branches;
mod builtins;
mod calls;
mod constants;
mod cycles;
mod expressions;
mod items;
mod lists;
mod liveness;
mod lookup;
mod messages;
mod metadata;
mod operators;
mod statements;
mod tree;
mod types;

use isograd_syntax::{Diagnostic, Files, Limits};

use crate::{
    load::{Loaded, Module},
    names::Names,
    report::Report,
    typed::{FunctionId, ImplId, Program},
};

/// The outcome of [`check`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Checked {
    /// The typed program. If a diagnostic is an error, only what [`Program::unsound`] leaves may be elaborated.
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
    let (recursive, order) = cycles::recursion(&world, &uses, &mut report);
    let self_building = cycles::self_building(&world, &uses, &mut report);
    let mut program = world.program;
    let number = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
    program.unsound.functions.extend(recursive.into_iter().map(|f| FunctionId(number(f))));
    program.unsound.impls.extend(self_building.into_iter().map(|i| ImplId(number(i))));
    liveness::mark(&mut program, &order, &mut report);
    let (diagnostics, omitted_errors) = report.finish();
    Checked { program, diagnostics, omitted_errors }
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
