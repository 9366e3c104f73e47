//! Where the diagnostics of a compilation come together: without duplicates, in source order, at most so many.
//! Knows nothing of how they are shown.

use std::collections::HashSet;

use crate::{Diagnostic, FileId, Limits};

/// Collects diagnostics.
#[derive(Debug, Clone, Default)]
pub struct Diagnostics {
    list: Vec<Diagnostic>,
    omitted_errors: u64,
}

/// What there is to show at the end.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Report {
    /// In source order: files as they were loaded, then by byte; those about no place last.
    pub diagnostics: Vec<Diagnostic>,
    /// Errors beyond `limits.diagnostics`.
    pub omitted_errors: u64,
    /// Warnings beyond `limits.diagnostics`.
    pub omitted_warnings: u64,
}

impl Diagnostics {
    /// Adds one.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        self.list.push(diagnostic);
    }

    /// Counts errors that whoever found them did not describe.
    pub fn omit_errors(&mut self, count: u64) {
        self.omitted_errors += count;
    }

    /// Whether there is an error, which stops the compilation at the end of the phase.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        self.omitted_errors > 0 || self.list.iter().any(Diagnostic::is_error)
    }

    /// How many were added.
    #[must_use]
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether none was added.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty() && self.omitted_errors == 0
    }

    /// Sorts, removes exact duplicates and keeps `limits.diagnostics` of the rest: the first errors, then as many of
    /// the first warnings as there is room for.
    #[must_use]
    pub fn finish(self, limits: &Limits) -> Report {
        let mut list = self.list;
        let mut seen = HashSet::new();
        list.retain(|d| seen.insert(d.clone()));
        list.sort_by_key(place);
        let cap = usize::try_from(limits.diagnostics).unwrap_or(usize::MAX);
        let (errors, warnings): (Vec<_>, Vec<_>) = list.into_iter().partition(Diagnostic::is_error);
        let room = cap.saturating_sub(errors.len());
        let report = Report {
            omitted_errors: self.omitted_errors + errors.len().saturating_sub(cap) as u64,
            omitted_warnings: warnings.len().saturating_sub(room) as u64,
            diagnostics: Vec::new(),
        };
        let mut diagnostics: Vec<_> = errors.into_iter().take(cap).chain(warnings.into_iter().take(room)).collect();
        diagnostics.sort_by_key(place);
        Report { diagnostics, ..report }
    }
}

impl Extend<Diagnostic> for Diagnostics {
    fn extend<I: IntoIterator<Item = Diagnostic>>(&mut self, diagnostics: I) {
        self.list.extend(diagnostics);
    }
}

/// The key of source order.
fn place(diagnostic: &Diagnostic) -> (bool, Option<(FileId, u32, u32)>) {
    let place = diagnostic.labels.first().map(|l| (l.span.file, l.span.start, l.span.end));
    (place.is_none(), place)
}
