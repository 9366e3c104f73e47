//! The diagnostics of the language as resources: their list, a page each, and the way from a diagnostic to its page.
//! Knows addresses; what the pages say is the compiler's.

use isograd_compiler::{Code, Diagnostic, Files, Severity, render};
use serde_json::{Value, json};

/// Where the list is; a page is below it.
pub const ADDRESS: &str = "/v1/diagnostics";

/// The address of a code's page.
#[must_use]
pub fn address(code: Code) -> String {
    format!("{ADDRESS}/{}", code.name())
}

/// Every diagnostic: `{code, severity, title, page}`.
#[must_use]
pub fn list() -> Value {
    let one = |code: &Code| {
        let severity = match code.severity() {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        json!({ "code": code.name(), "severity": severity, "title": code.title(), "page": address(*code) })
    };
    Code::ALL.iter().map(one).collect()
}

/// Diagnostics as JSON, each with the address of its page.
#[must_use]
pub fn json(diagnostics: &[Diagnostic], files: &Files) -> Value {
    let mut value = render::json(diagnostics, files);
    let objects = value.as_array_mut().into_iter().flatten().filter_map(Value::as_object_mut);
    for (object, diagnostic) in objects.zip(diagnostics) {
        object.insert("page".to_owned(), Value::String(address(diagnostic.code)));
    }
    value
}
