//! `isograd check`: diagnostics, nothing else. Knows how to show them, not how they come about.

use std::io::{Write, stdout};

use isograd_compiler::{Diagnostic, Options, render};
use isograd_server::Stopwatch;

use crate::args::Check;
use crate::{Failure, files, report};

/// Runs the command.
pub fn run(args: &Check) -> Result<(), Failure> {
    let options = Options::default();
    let checked = files::load(&args.file, &args.external, &options, &Stopwatch::start(&options.limits))?;
    let diagnostics = files::all_diagnostics(&checked, &options);
    if args.json {
        let text = serde_json::to_string_pretty(&render::json(&diagnostics, &checked.files));
        writeln!(stdout(), "{}", text.unwrap_or_default())?;
    } else {
        report::diagnostics(&diagnostics, &checked.files);
    }
    if diagnostics.iter().any(Diagnostic::is_error) { Err(Failure::Reported) } else { Ok(()) }
}
