//! Diagnostics as JSON: the fields of the value itself, with lines and columns added to byte offsets.
//! Knows no server and no protocol.

use serde_json::{Value, json};

use super::{Place, Position, level};
use crate::{Diagnostic, Files, Label};

/// An array of `{code, severity, message, labels: [{file, start, end, text}], notes, help}`, where `start` and `end`
/// are `{line, column, byte}`: line and column from 1, columns in characters, bytes from 0.
#[must_use]
pub fn json(diagnostics: &[Diagnostic], files: &Files) -> Value {
    Value::Array(diagnostics.iter().map(|d| diagnostic(d, files)).collect())
}

fn diagnostic(diagnostic: &Diagnostic, files: &Files) -> Value {
    json!({
        "code": diagnostic.code.name(),
        "severity": level(diagnostic.code.severity()),
        "message": diagnostic.message,
        "labels": diagnostic.labels.iter().map(|l| label(l, files)).collect::<Vec<_>>(),
        "notes": diagnostic.notes,
        "help": diagnostic.help,
    })
}

fn label(label: &Label, files: &Files) -> Value {
    let place = Place::of(label.span, files);
    json!({ "file": place.file, "start": position(place.start), "end": position(place.end), "text": label.text })
}

fn position(at: Position) -> Value {
    json!({ "line": at.line, "column": at.column, "byte": at.byte })
}
