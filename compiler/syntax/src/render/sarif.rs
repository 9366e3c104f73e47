//! Diagnostics as SARIF 2.1.0, which editors and code hosts read. Knows the format's fields and what of a diagnostic
//! goes into each; knows nothing of uploads.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use super::{Place, explain, level};
use crate::{Code, Diagnostic, Files, Label};

/// The version of this workspace, of which the compiler is a part.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A log of one run over some programs, each its diagnostics and the files they are about.
#[must_use]
pub fn sarif(programs: &[(&[Diagnostic], &Files)]) -> Value {
    let codes: BTreeSet<Code> = programs.iter().flat_map(|(diagnostics, _)| *diagnostics).map(|d| d.code).collect();
    let codes: Vec<Code> = codes.into_iter().collect();
    let results: Vec<Value> =
        programs.iter().flat_map(|(diagnostics, files)| diagnostics.iter().map(|d| result(d, files, &codes))).collect();
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "isograd",
                "semanticVersion": VERSION,
                "rules": codes.iter().map(|code| rule(*code)).collect::<Vec<_>>(),
            } },
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    })
}

fn rule(code: Code) -> Value {
    json!({
        "id": code.name(),
        "shortDescription": { "text": code.title() },
        "help": { "text": format!("`{}` shows an example and how to mend it.", explain(code)) },
        "defaultConfiguration": { "level": level(code.severity()) },
    })
}

fn result(diagnostic: &Diagnostic, files: &Files, rules: &[Code]) -> Value {
    let mut result = Map::new();
    result.insert("ruleId".to_owned(), json!(diagnostic.code.name()));
    if let Ok(index) = rules.binary_search(&diagnostic.code) {
        result.insert("ruleIndex".to_owned(), json!(index));
    }
    result.insert("level".to_owned(), json!(level(diagnostic.code.severity())));
    result.insert("message".to_owned(), json!({ "text": message(diagnostic) }));
    if let Some((primary, others)) = diagnostic.labels.split_first() {
        result.insert("locations".to_owned(), json!([location(primary, files)]));
        // The format wants each of these once.
        let mut related: Vec<Value> = Vec::new();
        for label in others {
            let location = location(label, files);
            if !related.contains(&location) {
                related.push(location);
            }
        }
        if !related.is_empty() {
            result.insert("relatedLocations".to_owned(), Value::Array(related));
        }
    }
    Value::Object(result)
}

/// The message, notes and help: a result has one text.
fn message(diagnostic: &Diagnostic) -> String {
    let notes = diagnostic.notes.iter().map(|note| format!("\nnote: {note}"));
    let help = diagnostic.help.iter().map(|help| format!("\nhelp: {help}"));
    std::iter::once(diagnostic.message.clone()).chain(notes).chain(help).collect()
}

fn location(label: &Label, files: &Files) -> Value {
    let place = Place::of(label.span, files);
    let mut location = Map::new();
    if let Some(file) = place.file {
        let physical = json!({
            "artifactLocation": { "uri": uri(file) },
            "region": {
                "startLine": place.start.line,
                "startColumn": place.start.column,
                "endLine": place.end.line,
                "endColumn": place.end.column,
            },
        });
        location.insert("physicalLocation".to_owned(), physical);
    }
    if !label.text.is_empty() {
        location.insert("message".to_owned(), json!({ "text": label.text }));
    }
    Value::Object(location)
}

/// A path as a URI reference (RFC 3986): what may not stand in a path is `%` and two digits per byte.
fn uri(path: &str) -> String {
    let mut uri = String::new();
    if path.starts_with('/') {
        uri.push_str("file://");
    }
    for byte in path.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'.' | b'_' | b'~' => uri.push(char::from(byte)),
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}
