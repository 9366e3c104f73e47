//! Where the checker's diagnostics come together. Knows nothing of what they are about.

use isograd_syntax::{Diagnostic, Limits};

/// Collects diagnostics. After ten times as many errors as are shown they are only counted, so that no source makes
/// the compiler use much memory.
#[derive(Debug)]
pub struct Report {
    diagnostics: Vec<Diagnostic>,
    errors: u64,
    muted: u64,
    omitted: u64,
    limit: u64,
}

impl Report {
    pub fn new(limits: &Limits) -> Self {
        Self { diagnostics: Vec::new(), errors: 0, muted: 0, omitted: 0, limit: limits.diagnostics }
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
        self.diagnostics.sort_by_key(|d| d.labels.first().map(|l| (l.span.file, l.span.start)));
        (self.diagnostics, self.omitted)
    }
}
