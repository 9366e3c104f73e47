//! Diagnostics as text for a terminal and as data for programs. Shows what the diagnostic says and nothing else;
//! any span may be shown, also one that lies outside its file or inside a character.

mod github;
mod json;
mod sarif;
mod terminal;
mod window;

pub use github::github;
pub use json::json;
pub use sarif::sarif;
pub use terminal::terminal;

use crate::{Code, Files, Severity, Span};

/// A byte of a file and where a reader finds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Position {
    byte: usize,
    /// From 1.
    line: usize,
    /// From 1, in characters.
    column: usize,
}

/// A span as other tools want it: a named file, lines and columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place<'a> {
    file: Option<&'a str>,
    start: Position,
    /// One past the last character.
    end: Position,
}

impl<'a> Place<'a> {
    fn of(span: Span, files: &'a Files) -> Self {
        let file = files.get(span.file);
        let (start, end) = file.map_or((0, 0), |f| clamp(&f.text, span.start, span.end));
        let position = |byte: usize| {
            let (line, column) = files.position(span.file, u32::try_from(byte).unwrap_or(u32::MAX));
            Position { byte, line, column }
        };
        Self { file: file.map(|f| f.name.as_str()), start: position(start), end: position(end) }
    }
}

/// The word for how bad it is, the same in every format.
const fn level(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    }
}

/// The command that shows the page of a code.
fn explain(code: Code) -> String {
    format!("isograd explain {}", code.name())
}

/// `start..end` moved into `text`, to boundaries of characters, in order.
fn clamp(text: &str, start: u32, end: u32) -> (usize, usize) {
    let start = text.floor_char_boundary(start as usize);
    let end = text.ceil_char_boundary(end as usize);
    (start, end.max(start))
}
