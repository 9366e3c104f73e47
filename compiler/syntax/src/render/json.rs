//! Diagnostics as JSON: the fields of the value itself, with lines and columns added to byte offsets.
//! Knows no server and no protocol.

use serde_json::{Value, json};

use super::clamp;
use crate::{Diagnostic, Files, Label, Severity};

/// An array of `{code, severity, message, labels: [{file, start, end, text}], notes, help}`, where `start` and `end`
/// are `{line, column, byte}`: line and column from 1, columns in characters, bytes from 0.
#[must_use]
pub fn json(diagnostics: &[Diagnostic], files: &Files) -> Value {
    Value::Array(diagnostics.iter().map(|d| diagnostic(d, files)).collect())
}

fn diagnostic(diagnostic: &Diagnostic, files: &Files) -> Value {
    json!({
        "code": diagnostic.code.name(),
        "severity": match diagnostic.code.severity() {
            Severity::Error => "error",
            Severity::Warning => "warning",
        },
        "message": diagnostic.message,
        "labels": diagnostic.labels.iter().map(|l| label(l, files)).collect::<Vec<_>>(),
        "notes": diagnostic.notes,
        "help": diagnostic.help,
    })
}

fn label(label: &Label, files: &Files) -> Value {
    let file = files.get(label.span.file);
    let (start, end) = file.map_or((0, 0), |f| clamp(&f.text, label.span.start, label.span.end));
    let position = |byte: usize| {
        let (line, column) = files.position(label.span.file, u32::try_from(byte).unwrap_or(u32::MAX));
        json!({ "line": line, "column": column, "byte": byte })
    };
    json!({
        "file": file.map(|f| f.name.as_str()),
        "start": position(start),
        "end": position(end),
        "text": label.text,
    })
}
