//! `isograd eval`: an export at points, as a table, JSON, CSV or bytes. Knows the order of the steps, none of their content.

use std::io::{BufWriter, Write, stdout};
use std::time::Duration;

use isograd_compiler::{Query, Request, Target, compile};
use isograd_runtime::Runtime;
use isograd_server::evaluate::{EvaluateError, load, run as evaluate, set_rates};
use isograd_server::values::Interface;
use isograd_server::{Stopwatch, select};

use crate::args::{Eval, Format};
use crate::{Failure, devices, files, inputs, report, table};

/// Runs the command.
pub fn run(args: &Eval) -> Result<(), Failure> {
    if args.device.is_some() && args.target != Target::Spirv {
        return Err(Failure::Usage("`--device` is for `--target spirv`, which runs on a Vulkan device".to_owned()));
    }
    let options = files::options(&args.reading.sources)?;
    let watch = Stopwatch::start(&options.limits);
    let checked = files::load_sound(&args.file, &args.reading, &options, &watch)?;
    let exports = checked.exports();
    let export = select::export(&exports, args.export.as_deref()).map_err(|e| Failure::Wrong(e.0))?;
    let queries = if args.queries.is_empty() { vec![Query::Value] } else { args.queries.clone() };
    select::known(export, &queries).map_err(|e| Failure::Wrong(e.0))?;
    let interface = Interface::of(export, &queries);
    let inputs = inputs::gather(args, &interface)?;

    let mut request = Request {
        export: export.name.clone(),
        queries,
        precision: args.precision.into(),
        target: args.target,
        mode: args.mode.into(),
        differentiability: args.smoothing.differentiability.into(),
        sensitivity: args.smoothing.sensitivity,
        within: args.specialising.boxes()?,
        ..Request::default()
    };
    set_rates(&mut request, &interface, &inputs);
    watch.renew(&options.limits);
    let artefact = compile(&checked, &request, &options, &watch).map_err(|diagnostics| {
        report::diagnostics(&diagnostics, &checked.files);
        Failure::Reported
    })?;
    report::diagnostics(&artefact.warnings, &checked.files);
    files::refuse_warnings(&args.reading, &artefact.warnings)?;

    let time = Duration::from_secs(args.deadline);
    let outputs = match args.target {
        Target::Spirv => devices::evaluate(&artefact, &inputs, args.device.as_deref(), time),
        _ => load(&Runtime::default(), &artefact).and_then(|kernel| evaluate(&kernel, &inputs, Some(time))),
    };
    let outputs = outputs.map_err(|error| Failure::Wrong(explain(&error, args.deadline)))?;

    let mut out = BufWriter::with_capacity(1 << 16, stdout().lock());
    match args.format {
        Format::Table => table::write_table(&mut out, &interface, inputs, outputs)?,
        Format::Csv => table::write_csv(&mut out, &outputs)?,
        Format::Raw => outputs.write_raw(&mut out)?,
        Format::Json => {
            outputs.write_json(&mut out)?;
            out.write_all(b"\n")?;
        }
    }
    Ok(out.flush()?)
}

fn explain(error: &EvaluateError, deadline: u64) -> String {
    match error {
        EvaluateError::Deadline => format!(
            "the evaluation took longer than {deadline} s; ask for fewer points, shorten the program's loops, or allow \
             more time with `--deadline`"
        ),
        EvaluateError::Refused { message, .. } => message.clone(),
        EvaluateError::Internal(why) => format!("the evaluation failed, which is a mistake of isograd: {why}"),
    }
}
