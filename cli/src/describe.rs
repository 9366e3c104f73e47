//! `isograd describe`: what a program exports. Lays out what the HTTP API says as JSON; knows no export itself.

use std::fmt::Write as _;
use std::io::{Write, stdout};

use isograd_compiler::FORMS;
use isograd_server::{Stopwatch, describe};
use serde_json::{Value, json};

use crate::args::Describe;
use crate::check::pretty;
use crate::{Failure, files};

/// Runs the command.
pub fn run(args: &Describe) -> Result<(), Failure> {
    let options = files::options(&args.reading.sources)?;
    let checked = files::load_sound(&args.file, &args.reading, &options, &Stopwatch::start(&options.limits))?;
    let exports: Vec<Value> = checked.exports().iter().map(describe::export).collect();
    let text = if args.json {
        pretty(&json!({ "exports": exports, "queries": describe::queries() }))
    } else {
        let exports: Vec<String> = exports.iter().map(written).collect();
        if exports.is_empty() { String::new() } else { format!("{}\n{}", exports.join("\n"), queries()) }
    };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// A line with name and type of the result, the documentation, and a line for each parameter.
fn written(export: &Value) -> String {
    let mut text = format!("{} -> {}\n", word(&export["name"]), word(&export["result"]["type"]));
    for line in word(&export["doc"]).lines() {
        let _ = writeln!(text, "{}", format!("  {line}").trim_end());
    }
    let cells = |parameter: &Value| {
        let default = match &parameter["default"] {
            Value::Null => String::new(),
            default => format!("= {}", number(default)),
        };
        let range = match &parameter["range"] {
            Value::Null => String::new(),
            range => format!("in [{} .. {}]", number(&range["lower"]), number(&range["upper"])),
        };
        [word(&parameter["name"]).to_owned(), word(&parameter["type"]).to_owned(), default, range]
    };
    let rows: Vec<[String; 4]> = export["parameters"].as_array().into_iter().flatten().map(cells).collect();
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
    let widths = [0, 1, 2, 3].map(width);
    for row in &rows {
        let mut line = "  ".to_owned();
        for (cell, width) in row.iter().zip(widths).filter(|(_, width)| *width > 0) {
            let _ = write!(line, "  {cell:<width$}");
        }
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

/// What can be asked of any export.
fn queries() -> String {
    let width = FORMS.iter().map(|q| q.form.chars().count()).max().unwrap_or(0);
    let mut text = "queries, `*` in the place of a PARAMETER for all\n".to_owned();
    for query in FORMS {
        let _ = writeln!(text, "    {:width$}  {}", query.form, query.gives);
    }
    text
}

fn word(value: &Value) -> &str {
    value.as_str().unwrap_or("")
}

/// `[0.1, 2.0]`
fn number(value: &Value) -> String {
    match value {
        Value::Array(values) => format!("[{}]", values.iter().map(number).collect::<Vec<_>>().join(", ")),
        Value::String(infinite) => infinite.clone(),
        number => number.to_string(),
    }
}
