//! `isograd compile`: modules to files, or the output of a step as text. Knows where to write, not what.

use std::fmt::Write as _;
use std::fs;
use std::io::{Write, stdout};
use std::path::{Path, PathBuf};

use isograd_compiler::{
    Checked, DerivativeMode, Derivatives, Export, Options, Port, Query, Request, Specialised, Target, compile,
    print_step,
};
use isograd_server::{Stopwatch, describe, select};

use crate::args::{Compile, step};
use crate::{Failure, files, report};

/// Runs the command.
pub fn run(args: &Compile) -> Result<(), Failure> {
    let options = files::options(&args.reading.sources)?;
    let watch = Stopwatch::start(&options.limits);
    let mut ways = Vec::new();
    let result = write(args, &options, &watch, &mut ways);
    if args.timings {
        report::timings(&watch.timings());
        for (export, way) in &ways {
            match ways.len() {
                1 => report::say(&format!("derivatives: {way}\n")),
                _ => report::say(&format!("derivatives of `{export}`: {way}\n")),
            }
        }
    }
    result
}

/// Names of exports, and which way their derivatives are computed.
type Ways = Vec<(String, String)>;

fn write(args: &Compile, options: &Options, watch: &Stopwatch, ways: &mut Ways) -> Result<(), Failure> {
    if args.emit.as_deref() == Some("wat") && args.target != Target::Wasm {
        let target = args.target.name();
        return Err(Failure::Usage(format!("`wat` is WebAssembly as text; for the target `{target}` ask for `emit`")));
    }
    refuse_sources(args)?;
    let emit = args.emit.as_deref().map(step);
    if emit == Some("parse") || emit == Some("load") {
        // A tree can be shown of a program with errors as well.
        let checked = files::load(&args.file, &args.reading.sources, options, watch)?;
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
        requests.push(Request {
            export: export.name.clone(),
            queries: queries.clone(),
            precision: args.precision.into(),
            target: args.target,
            form: args.form,
            mode: args.mode.into(),
            differentiability: args.smoothing.differentiability.into(),
            sensitivity: args.smoothing.sensitivity,
            within: args.specialising.boxes()?,
            ..Request::default()
        });
    }
    match emit {
        Some(step) => print(args, &checked, &requests, step, options, watch),
        None => modules(args, &checked, &requests, options, watch, ways),
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
    ways: &mut Ways,
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
        ways.push((request.export.clone(), way(request.mode, &artefact.manifest.derivatives)));
        report::diagnostics(&artefact.warnings, &checked.files);
        if let Err(refused) = files::refuse_warnings(&args.reading, &artefact.warnings) {
            refused.report();
            failed = true;
            continue;
        }
        let name = || directory.join(format!("{}.{}", request.export, request.target.extension()));
        let path = args.output.clone().unwrap_or_else(name);
        if path == Path::new("-") {
            let mut out = stdout().lock();
            out.write_all(&artefact.bytes)?;
            out.flush()?;
            continue;
        }
        put(&path, &artefact.bytes)?;
        let (bytes, operations) = (artefact.bytes.len(), artefact.manifest.operations);
        report::say(&format!("{}: {operations} operations, {bytes} bytes\n", path.display()));
        // What is written to a device or a pipe has nothing beside it.
        if request.target != Target::Wasm && path.is_file() {
            let beside = sidecar(&path);
            put(&beside, describe::manifest(&artefact.manifest).as_bytes())?;
            report::say(&format!("  manifest: {}\n", beside.display()));
        }
        if let Some(Specialised { from, to }) = artefact.manifest.specialised {
            report::say(&format!("  specialised: {to} of {from} operations, counted before kernels\n"));
        }
        for port in &artefact.manifest.outputs {
            report::say(&known(port));
        }
    }
    if failed { Err(Failure::Reported) } else { Ok(()) }
}

/// Where the manifest of a module stands that does not contain it.
fn sidecar(module: &Path) -> PathBuf {
    let mut name = module.as_os_str().to_owned();
    name.push(".json");
    PathBuf::from(name)
}

/// Refuses to write over the program.
fn refuse_sources(args: &Compile) -> Result<(), Failure> {
    let Some(output) = args.output.as_deref() else { return Ok(()) };
    let is_source = |path: &Path| {
        let same = || Some(path.canonicalize().ok()? == args.file.canonicalize().ok()?);
        path.extension().is_some_and(|e| e == "vola") && path.exists() || same() == Some(true)
    };
    match [output.to_path_buf(), sidecar(output)].into_iter().find(|path| is_source(path)) {
        Some(path) => Err(Failure::Usage(format!("`-o` would write over the source file `{}`", path.display()))),
        None => Ok(()),
    }
}

fn put(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    fs::write(path, bytes).map_err(|error| Failure::Wrong(format!("cannot write `{}`: {error}", path.display())))
}

/// What is known of a query without computing it: which derivatives are 0 everywhere, what may jump. A line each.
fn known(port: &Port) -> String {
    let zeros: Vec<&str> = port.columns.iter().filter(|c| c.zero).map(|c| c.name.as_str()).collect();
    let mut text = String::new();
    if !zeros.is_empty() {
        let (n, of) = (zeros.len(), port.columns.len());
        let _ = writeln!(text, "  {}: {n} of {of} are always 0: {}", port.name, some(&zeros));
    }
    if !port.jumps.is_empty() {
        let jumps: Vec<&str> = port.jumps.iter().map(String::as_str).collect();
        let so = if port.name.starts_with("bound") { "the natural enclosure" } else { "between jumps only" };
        let _ = writeln!(text, "  {}: may jump, {so}: {}", port.name, some(&jumps));
    }
    text
}

/// The first names of a list.
fn some(names: &[&str]) -> String {
    const SHOWN: usize = 12;
    let more = if names.len() > SHOWN { ", …" } else { "" };
    format!("{}{more}", names.get(..SHOWN).unwrap_or(names).join(", "))
}

/// Which way derivatives are computed and why: `reverse (cost 412; forward 1,536)`.
fn way(asked: DerivativeMode, derivatives: &Derivatives) -> String {
    let (forward, reverse) = (derivatives.forward.map(grouped), derivatives.reverse.map(grouped));
    let why = match (asked, derivatives.mode, forward, reverse) {
        (DerivativeMode::Forward | DerivativeMode::Reverse, ..) => "asked for".to_owned(),
        (_, DerivativeMode::Reverse, Some(forward), Some(reverse)) => format!("cost {reverse}; forward {forward}"),
        (_, DerivativeMode::Reverse, ..) => "the forward sweep exceeds a limit".to_owned(),
        (_, _, Some(forward), Some(reverse)) => format!("cost {forward}; reverse {reverse}"),
        _ => "too few values to differentiate by for a reverse sweep to pay".to_owned(),
    };
    format!("{} ({why})", derivatives.mode.name())
}

/// A number with a comma before each three digits.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_of_derivatives_has_a_reason() {
        use DerivativeMode::{Auto, Forward, Reverse};
        let made = |mode, forward, reverse| Derivatives { mode, forward, reverse };
        assert_eq!(way(Auto, &made(Reverse, Some(1536), Some(412))), "reverse (cost 412; forward 1,536)");
        assert_eq!(way(Auto, &made(Forward, Some(999), Some(1_234_567))), "forward (cost 999; reverse 1,234,567)");
        assert_eq!(
            way(Auto, &made(Forward, Some(7), None)),
            "forward (too few values to differentiate by for a reverse sweep to pay)"
        );
        assert_eq!(way(Auto, &made(Reverse, None, Some(7))), "reverse (the forward sweep exceeds a limit)");
        assert_eq!(way(Reverse, &made(Reverse, None, Some(412))), "reverse (asked for)");
    }
}
