//! `isograd compile`: modules to files, or the output of a step as text. Knows where to write, not what.

use std::fs;
use std::io::{Write, stdout};
use std::path::{Path, PathBuf};

use isograd_compiler::{Checked, Export, Options, Query, Request, Target, compile, print_step};
use isograd_server::{Stopwatch, select};

use crate::args::{Compile, TargetName, step};
use crate::{Failure, files, report};

/// Runs the command.
pub fn run(args: &Compile) -> Result<(), Failure> {
    let options = files::options(&args.reading)?;
    let watch = Stopwatch::start(&options.limits);
    let result = write(args, &options, &watch);
    if args.timings {
        report::timings(&watch.timings());
    }
    result
}

fn write(args: &Compile, options: &Options, watch: &Stopwatch) -> Result<(), Failure> {
    let emit = args.emit.as_deref().map(step);
    if emit == Some("parse") || emit == Some("load") {
        // A tree can be shown of a program with errors as well.
        let checked = files::load(&args.file, &args.reading, options, watch)?;
        report::diagnostics(&checked.diagnostics, &checked.files);
        return print(args, &checked, &[Request::default()], "parse", options, watch);
    }
    let checked = files::load_sound(&args.file, &args.reading, options, watch)?;
    let exports = checked.exports();
    if emit == Some("check") {
        return print(args, &checked, &[Request::default()], "check", options, watch);
    }
    let chosen: Vec<&Export> = match &args.export {
        Some(name) => vec![select::export(&exports, Some(name)).map_err(|e| Failure::Wrong(e.0))?],
        None if exports.is_empty() => {
            return Err(Failure::Wrong("the program has no export; mark a function with `export fn`".to_owned()));
        }
        None => exports.iter().collect(),
    };
    let queries = if args.queries.is_empty() { vec![Query::Value] } else { args.queries.clone() };
    let mut requests = Vec::new();
    for export in chosen {
        select::known(export, &queries).map_err(|e| Failure::Wrong(e.0))?;
        let target = match args.target {
            TargetName::Wasm => Target::Wasm,
        };
        requests.push(Request {
            export: export.name.clone(),
            queries: queries.clone(),
            precision: args.precision.into(),
            target,
            ..Request::default()
        });
    }
    match emit {
        Some(step) => print(args, &checked, &requests, step, options, watch),
        None => modules(args, &checked, &requests, options, watch),
    }
}

fn print(
    args: &Compile,
    checked: &Checked,
    requests: &[Request],
    step: &str,
    options: &Options,
    watch: &Stopwatch,
) -> Result<(), Failure> {
    let mut text = String::new();
    for (i, request) in requests.iter().enumerate() {
        if i > 0 {
            text.push('\n');
        }
        watch.renew(&options.limits);
        let printed = print_step(checked, request, step, options, watch);
        let printed = printed.map_err(|diagnostics| {
            report::diagnostics(&diagnostics, &checked.files);
            Failure::Reported
        })?;
        text.push_str(&printed);
        if !text.ends_with('\n') {
            text.push('\n');
        }
    }
    match args.output.as_deref().filter(|p| *p != Path::new("-")) {
        Some(path) => put(path, text.as_bytes()),
        None => {
            let mut out = stdout().lock();
            out.write_all(text.as_bytes())?;
            Ok(out.flush()?)
        }
    }
}

fn modules(
    args: &Compile,
    checked: &Checked,
    requests: &[Request],
    options: &Options,
    watch: &Stopwatch,
) -> Result<(), Failure> {
    if args.output.is_some() && requests.len() > 1 {
        let names: Vec<String> = requests.iter().map(|r| format!("`{}`", r.export)).collect();
        let names = names.join(", ");
        return Err(Failure::Usage(format!(
            "`-o` takes one module and the program exports {names}; choose one with `--export`, or use `--out-dir`"
        )));
    }
    let directory = args.out_dir.clone().unwrap_or_else(|| PathBuf::from("."));
    if args.output.is_none() {
        fs::create_dir_all(&directory)
            .map_err(|error| Failure::Wrong(format!("cannot make the directory `{}`: {error}", directory.display())))?;
    }
    let mut failed = false;
    for request in requests {
        watch.renew(&options.limits);
        let artefact = match compile(checked, request, options, watch) {
            Ok(artefact) => artefact,
            Err(diagnostics) => {
                report::diagnostics(&diagnostics, &checked.files);
                failed = true;
                continue;
            }
        };
        report::diagnostics(&artefact.warnings, &checked.files);
        if let Err(refused) = files::refuse_warnings(&args.reading, &artefact.warnings) {
            refused.report();
            failed = true;
            continue;
        }
        let path = args.output.clone().unwrap_or_else(|| directory.join(format!("{}.wasm", request.export)));
        if path == Path::new("-") {
            let mut out = stdout().lock();
            out.write_all(&artefact.bytes)?;
            out.flush()?;
            continue;
        }
        put(&path, &artefact.bytes)?;
        let (bytes, operations) = (artefact.bytes.len(), artefact.manifest.operations);
        report::say(&format!("{}: {operations} operations, {bytes} bytes\n", path.display()));
    }
    if failed { Err(Failure::Reported) } else { Ok(()) }
}

fn put(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    fs::write(path, bytes).map_err(|error| Failure::Wrong(format!("cannot write `{}`: {error}", path.display())))
}
