//! How the machine reports: errors with the chain of calls and evals that led to them. Knows the program's names;
//! knows nothing of what is being computed.

use isograd_graph::Exhausted;
use isograd_program::typed::{ConceptId, DefinitionId};
use isograd_syntax::{Code, Diagnostic, Span};

use crate::machine::{Activity, Body, Machine, Stop};

/// How many steps of a chain are shown.
const SHOWN: usize = 8;

/// E1007 or E1011.
pub(crate) fn too_large(why: Exhausted, span: Span) -> Diagnostic {
    match why {
        Exhausted::Nodes(limit) => {
            Diagnostic::new(Code::E1007, span, format!("the graph has more than {limit} operations"))
                .help("make the program smaller, or raise the limit `graph_nodes`")
        }
        Exhausted::Time => Diagnostic::new(Code::E1011, span, "the compilation took too long")
            .help("make the program smaller, or raise the limit `compile_time_ms`"),
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
            Diagnostic::new(Code::E1102, self.nodes.here(), message)
                .note("the checked program is malformed; this is a mistake in the compiler, please report it"),
        )
    }

    /// Intervals are checked, but their values are not computed yet.
    pub(crate) fn intervals(&mut self, span: Span) -> Stop {
        self.fail(
            Diagnostic::new(Code::E1101, span, "values of intervals are not yet supported")
                .note("they are part of the language and will be compiled by a later version"),
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
