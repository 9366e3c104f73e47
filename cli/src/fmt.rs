//! `isograd fmt`: files in the form of the house, in place. Knows where texts come from and go, not what is changed.

use std::io::{Write, stdin, stdout};
use std::path::Path;

use isograd_compiler::{Loader, Options, rewrite};
use isograd_server::{Stopwatch, read_text};

use crate::args::Fmt;
use crate::{Failure, files, report};

/// Runs the command. A file with errors does not keep the others from being formatted.
pub fn run(args: &Fmt) -> Result<(), Failure> {
    let options = files::options(&args.sources)?;
    let mut failed = false;
    for file in &args.files {
        match one(file, args, &options) {
            Ok(()) => {}
            Err(failure @ (Failure::Reported | Failure::Wrong(_))) => {
                failure.report();
                failed = true;
            }
            Err(failure) => return Err(failure),
        }
    }
    if failed { Err(Failure::Reported) } else { Ok(()) }
}

fn one(file: &Path, args: &Fmt, options: &Options) -> Result<(), Failure> {
    let piped = file == Path::new("-");
    let name = if piped { "<stdin>".to_owned() } else { files::shown(file) };
    let source = match piped {
        true => read_text(stdin().lock())
            .map_err(|error| Failure::Wrong(format!("cannot read the standard input: {error}")))?,
        false => files::read(file)?,
    };
    let loader = files::loader(file, &args.sources)?;
    let migrating = args.migrate.then_some(&loader as &dyn Loader);
    let watch = Stopwatch::start(&options.limits);
    let text = rewrite(&name, source.clone(), migrating, options, &watch).map_err(|malformed| {
        report::diagnostics(&malformed.diagnostics, &malformed.files);
        Failure::Reported
    })?;
    let changed = text.as_bytes() != source;
    if !args.check && !piped {
        return if changed { files::replace(file, text.as_bytes()) } else { Ok(()) };
    }
    let mut out = stdout().lock();
    match (args.check, changed) {
        (true, false) => Ok(()),
        (true, true) => {
            writeln!(out, "{name}")?;
            out.flush()?;
            Err(Failure::Reported)
        }
        (false, _) => {
            out.write_all(text.as_bytes())?;
            Ok(out.flush()?)
        }
    }
}
