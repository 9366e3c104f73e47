//! `isograd check`: diagnostics, nothing else. Knows how to show them, not how they come about.

use std::collections::HashSet;
use std::io::{Write, stdout};

use isograd_compiler::{Diagnostic, Files, render};
use isograd_server::{Stopwatch, diagnose};
use serde_json::Value;

use crate::args::{Check, ReportFormat};
use crate::{Failure, files, report};

/// Runs the command. Files that cannot be read do not keep the others from being checked.
pub fn run(args: &Check) -> Result<(), Failure> {
    let options = files::options(&args.reading.sources)?;
    let mut programs: Vec<(Vec<Diagnostic>, Files)> = Vec::new();
    // Programs may share files; what is wrong with one is said once.
    let mut said = HashSet::new();
    let mut failed = false;
    for file in &args.files {
        let checked = match files::load(file, &args.reading.sources, &options, &Stopwatch::start(&options.limits)) {
            Err(Failure::Wrong(message)) => {
                report::error(&message);
                failed = true;
                continue;
            }
            checked => checked?,
        };
        let mut diagnostics = diagnose(&checked, &options);
        failed |= diagnostics.iter().any(Diagnostic::is_error);
        diagnostics.retain(|d| said.insert(render::json(std::slice::from_ref(d), &checked.files).to_string()));
        if args.format == ReportFormat::Terminal {
            report::diagnostics(&diagnostics, &checked.files);
        }
        programs.push((diagnostics, checked.files));
    }
    write(args.format, &programs)?;
    if failed {
        return Err(Failure::Reported);
    }
    let all: Vec<Diagnostic> = programs.into_iter().flat_map(|(diagnostics, _)| diagnostics).collect();
    files::refuse_warnings(&args.reading, &all)
}

fn write(format: ReportFormat, programs: &[(Vec<Diagnostic>, Files)]) -> Result<(), Failure> {
    let borrowed: Vec<(&[Diagnostic], &Files)> = programs.iter().map(|(d, f)| (d.as_slice(), f)).collect();
    let text = match format {
        ReportFormat::Terminal => return Ok(()),
        ReportFormat::Github => borrowed.iter().map(|(d, f)| render::github(d, f)).collect(),
        ReportFormat::Sarif => pretty(&render::sarif(&borrowed)),
        ReportFormat::Json => {
            let arrays = borrowed.iter().map(|(d, f)| render::json(d, f));
            pretty(&arrays.flat_map(|array| array.as_array().cloned().unwrap_or_default()).collect())
        }
    };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// JSON for reading as well, one line's end at the end.
pub fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}
