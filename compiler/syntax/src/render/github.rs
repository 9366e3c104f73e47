//! Diagnostics as workflow commands, which GitHub Actions turns into annotations of a change.
//! Knows the form of a command and what must be escaped in it.

use std::fmt::Write;

use super::{Place, level};
use crate::{Diagnostic, Files};

/// One line per diagnostic: `::error file=…,line=…,col=…,endLine=…,endColumn=…,title=…::message`. The message has
/// what the format has no field for: the texts of labels, notes and help.
#[must_use]
pub fn github(diagnostics: &[Diagnostic], files: &Files) -> String {
    diagnostics.iter().map(|d| format!("{}\n", command(d, files))).collect()
}

fn command(diagnostic: &Diagnostic, files: &Files) -> String {
    let mut line = format!("::{} ", level(diagnostic.code.severity()));
    let primary = diagnostic.labels.first().map(|label| Place::of(label.span, files));
    if let Some(Place { file: Some(file), start, end }) = primary {
        let _ = write!(line, "file={},line={}", property(file), start.line);
        // Columns of an annotation are columns of one line.
        let _ = if start.line == end.line {
            write!(line, ",col={},endLine={},endColumn={},", start.column, end.line, end.column)
        } else {
            write!(line, ",endLine={},", end.line)
        };
    }
    let title = format!("{} {}", diagnostic.code.name(), diagnostic.code.title());
    let _ = write!(line, "title={}::{}", property(&title), data(&message(diagnostic, files)));
    line
}

fn message(diagnostic: &Diagnostic, files: &Files) -> String {
    let mut text = diagnostic.message.clone();
    for (i, label) in diagnostic.labels.iter().enumerate().filter(|(_, label)| !label.text.is_empty()) {
        let place = Place::of(label.span, files);
        let _ = match (i, place.file) {
            (0, _) | (_, None) => write!(text, "\n{}", label.text),
            (_, Some(file)) => write!(text, "\n{file}:{}:{}: {}", place.start.line, place.start.column, label.text),
        };
    }
    let notes = diagnostic.notes.iter().map(|note| format!("\nnote: {note}"));
    let help = diagnostic.help.iter().map(|help| format!("\nhelp: {help}"));
    text.extend(notes.chain(help));
    text
}

/// `%` escapes, so it goes first; a line's end would end the command.
fn data(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

/// `:` and `,` end a property.
fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}
