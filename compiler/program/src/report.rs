//! Where the checker's diagnostics come together. Knows nothing of what they are about.

use std::collections::BTreeMap;

use isograd_syntax::{Diagnostic, Limits, Span};

use crate::names::Kind;

/// Collects diagnostics. After ten times as many errors as are shown they are only counted, so that no source makes
/// the compiler use much memory.
#[derive(Debug)]
pub struct Report {
    diagnostics: Vec<Diagnostic>,
    errors: u64,
    muted: u64,
    omitted: u64,
    limit: u64,
    /// Global names that mean nothing, by name space and kind.
    unknown: BTreeMap<(usize, Kind, String), Unknown>,
}

/// A global name that means nothing: its diagnostic, and all its uses.
#[derive(Debug)]
struct Unknown {
    index: Option<usize>,
    first: Span,
    uses: u64,
}

impl Report {
    pub fn new(limits: &Limits) -> Self {
        Self {
            diagnostics: Vec::new(),
            errors: 0,
            muted: 0,
            omitted: 0,
            limit: limits.diagnostics,
            unknown: BTreeMap::new(),
        }
    }

    /// Adds one.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        let error = diagnostic.is_error();
        self.errors += u64::from(error);
        if self.diagnostics.len() as u64 <= self.limit.saturating_mul(10) {
            self.diagnostics.push(diagnostic);
        } else {
            self.omitted += u64::from(error);
        }
    }

    /// Adds one about a global name, unless the name space has had it. It will stand where the name is used first,
    /// and count the other uses. `about` is told whether it would be shown.
    pub fn push_unknown(
        &mut self,
        (space, kind, name): (usize, Kind, &str),
        span: Span,
        about: impl FnOnce(bool) -> Diagnostic,
    ) {
        let key = (space, kind, name.to_owned());
        if let Some(known) = self.unknown.get_mut(&key) {
            known.uses += 1;
            known.first = std::cmp::min_by_key(known.first, span, |s| (s.file, s.start));
            self.muted += 1;
            return;
        }
        let index = self.diagnostics.len();
        self.push(about(self.is_worth_it()));
        let index = (index < self.diagnostics.len()).then_some(index);
        self.unknown.insert(key, Unknown { index, first: span, uses: 1 });
    }

    /// Notes something wrong that follows from what was reported, or may follow from it, and is not said again.
    pub fn mute(&mut self) {
        self.muted += 1;
    }

    /// Grows with everything that is wrong, whether it is said or not.
    pub const fn trouble(&self) -> u64 {
        self.errors + self.muted
    }

    /// Whether another error would be shown, so that a costly message is worth it.
    pub fn is_worth_it(&self) -> bool {
        self.errors <= self.limit
    }

    /// The diagnostics in source order, and how many errors are not among them.
    pub fn finish(mut self) -> (Vec<Diagnostic>, u64) {
        for Unknown { index, first, uses } in self.unknown.into_values() {
            let Some(diagnostic) = index.and_then(|i| self.diagnostics.get_mut(i)) else { continue };
            if let Some(label) = diagnostic.labels.first_mut() {
                label.span = first;
            }
            match uses {
                1 => {}
                2 => diagnostic.notes.push("it is used in 1 more place".to_owned()),
                n => diagnostic.notes.push(format!("it is used in {} more places", n - 1)),
            }
        }
        self.diagnostics.sort_by_key(|d| d.labels.first().map(|l| (l.span.file, l.span.start)));
        (self.diagnostics, self.omitted)
    }
}
