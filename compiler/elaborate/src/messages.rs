//! How the machine reports: errors with the chain of calls and evals that led to them. Knows the program's names;
//! knows nothing of what is being computed.

use std::collections::BTreeMap;

use isograd_graph::Exhausted;
use isograd_program::typed::{ConceptId, DefinitionId};
use isograd_syntax::{Code, Diagnostic, Limits, Span};

use crate::csg::CsgId;
use crate::machine::{Activity, Body, Machine, Stop};

/// How many steps of a chain are shown.
const SHOWN: usize = 8;

/// E1007 or E1011.
pub(crate) fn too_large(why: Exhausted, span: Span, limits: &Limits) -> Diagnostic {
    match why {
        Exhausted::Nodes(limit) => {
            Diagnostic::new(Code::E1007, span, format!("this export needs more than {limit} operations"))
                .note("all trees and calls are written out in place")
                .help("make the program smaller, or raise the limit `graph_nodes`")
        }
        Exhausted::Time => {
            let limit = limits.compile_time_ms;
            Diagnostic::new(Code::E1011, span, format!("compiling took longer than {limit} ms"))
                .here("reached here")
                .help("make the program smaller, or raise the limit `compile_time_ms`")
        }
    }
}

impl Machine<'_, '_> {
    /// Reports an error after which elaboration cannot go on.
    pub(crate) fn fail(&mut self, diagnostic: Diagnostic) -> Stop {
        let diagnostic = self.chained(diagnostic);
        self.diagnostics.push(diagnostic);
        Stop
    }

    /// Reports an error after which it can, once; stops if there are enough.
    pub(crate) fn report(&mut self, diagnostic: Diagnostic) -> Result<(), Stop> {
        let place = |d: &Diagnostic| d.labels.first().map(|l| l.span);
        let same = |d: &Diagnostic| {
            d.code == diagnostic.code && d.message == diagnostic.message && place(d) == place(&diagnostic)
        };
        if self.diagnostics.iter().any(same) {
            return Ok(());
        }
        let diagnostic = self.chained(diagnostic);
        self.diagnostics.push(diagnostic);
        if self.diagnostics.len() as u64 >= self.limits.diagnostics { Err(Stop) } else { Ok(()) }
    }

    /// Reports a warning, once per place.
    pub(crate) fn warn(&mut self, diagnostic: Diagnostic) {
        let place = |d: &Diagnostic| (d.code, d.labels.first().map(|l| l.span));
        if !self.warnings.iter().any(|d| place(d) == place(&diagnostic)) {
            self.warnings.push(diagnostic);
        }
    }

    /// Reports a program that the checker should not have made.
    pub(crate) fn bug(&mut self, what: &str) -> Stop {
        let message = format!("internal error: {what}");
        self.fail(
            Diagnostic::new(Code::E1103, self.nodes.here(), message)
                .note("the checked program is malformed")
                .help("this is a bug of Isograd: please report it with the program"),
        )
    }

    /// Adds the calls and evals that led here, the innermost first.
    fn chained(&self, mut diagnostic: Diagnostic) -> Diagnostic {
        let mut shown = Vec::new();
        let mut more = 0;
        for activity in self.activities.iter().rev() {
            let Activity::Frame(frame) = activity else { continue };
            let step = match frame.body {
                Body::Function(id) if frame.site != self.site_of(id) => {
                    let name = self.program.functions.get(id.0 as usize).map_or("?", |f| f.name.as_str());
                    (frame.site, format!("in `{name}`, called here"))
                }
                Body::Function(_) => continue,
                Body::Impl(id) => {
                    let Some(found) = self.program.impls.get(id.0 as usize) else { continue };
                    let (node, concept) = (self.definition(found.definition), self.concept(found.concept));
                    (frame.site, format!("in the impl of `{node}` for `{concept}`, evaluated here"))
                }
            };
            if shown.contains(&step) {
                continue;
            }
            if shown.len() < SHOWN {
                shown.push(step);
            } else {
                more += 1;
            }
        }
        for (span, text) in shown {
            diagnostic = diagnostic.label(span, text);
        }
        if more > 0 {
            diagnostic = diagnostic.note(format!("{more} more calls and evals led here"));
        }
        diagnostic
    }

    /// What is open: how many of each kind, and the most frequent impl.
    pub(crate) fn inside_each_other(&self) -> String {
        let (mut calls, mut impls, mut all) = (0_u64, BTreeMap::new(), 0);
        for activity in &self.activities {
            let Activity::Frame(frame) = activity else { continue };
            match frame.body {
                Body::Function(id) if frame.site == self.site_of(id) => {}
                Body::Function(_) => calls += 1,
                Body::Impl(id) => {
                    all += 1;
                    *impls.entry(id).or_insert(0_u64) += 1;
                }
            }
        }
        let others = self.nesting.saturating_sub(calls + all);
        let most = impls.iter().max_by_key(|(id, n)| (**n, std::cmp::Reverse(**id)));
        let most = most.and_then(|(id, n)| Some((self.program.impls.get(id.0 as usize)?, *n)));
        let parts = [(all, "impl"), (calls, "call"), (others, "branch or loop")].into_iter().filter(|(n, _)| *n > 0);
        let counted = |(n, what)| match (n, what) {
            (1, what) => format!("1 {what}"),
            (n, "branch or loop") => format!("{n} branches and loops"),
            (n, what) => format!("{n} {what}s"),
        };
        let parts: Vec<String> = parts.map(counted).collect();
        let counts = format!("inside each other are {}", parts.join(", "));
        match most {
            Some((found, n)) if n > 1 => {
                let (node, concept) = (self.definition(found.definition), self.concept(found.concept));
                format!("{counts}; {n} of them are the impl of `{node}` for `{concept}`")
            }
            _ => counts,
        }
    }

    /// The nodes of a tree's longest path, from its root.
    pub(crate) fn deepest_path(&self, tree: CsgId) -> String {
        let names: Vec<&str> = self.forest.deepest_path(tree).map(|id| self.definition(id)).collect();
        format!("the path is {}", Self::path(&names))
    }

    /// Where a function begins; the export itself is entered from there.
    fn site_of(&self, id: isograd_program::typed::FunctionId) -> Span {
        self.program.functions.get(id.0 as usize).map_or(self.nodes.here(), |f| f.span)
    }

    /// The name of an entity or operation.
    pub(crate) fn definition(&self, id: DefinitionId) -> &str {
        self.program.definitions.get(id.0 as usize).map_or("?", |d| d.name.as_str())
    }

    /// The name of a concept.
    pub(crate) fn concept(&self, id: ConceptId) -> &str {
        self.program.concepts.get(id.0 as usize).map_or("?", |c| c.name.as_str())
    }

    /// `A → B → C`, the middle left out if it is long.
    pub(crate) fn path(names: &[&str]) -> String {
        let (head, tail) = (SHOWN / 2, SHOWN / 2);
        if names.len() <= head + tail + 1 {
            return names.join(" → ");
        }
        let left_out = names.len() - head - tail;
        let start = names.get(..head).unwrap_or(&[]).join(" → ");
        let end = names.get(names.len() - tail..).unwrap_or(&[]).join(" → ");
        format!("{start} → … {left_out} more … → {end}")
    }
}
