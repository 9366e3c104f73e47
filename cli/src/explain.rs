//! `isograd explain`: the pages of diagnostics. Knows where to write them; the pages are the compiler's.

use std::io::{Write, stdout};

use isograd_compiler::{Code, UnknownCode, explain};

use crate::Failure;
use crate::args::Explain;

/// Runs the command.
pub fn run(args: &Explain) -> Result<(), Failure> {
    let codes: Result<Vec<Code>, UnknownCode> = args.codes.iter().map(|text| text.parse()).collect();
    let codes = codes.map_err(|error| Failure::Usage(format!("{error}; `isograd explain` lists all")))?;
    let text: String = if codes.is_empty() {
        Code::ALL.iter().map(|code| format!("{code}  {}\n", code.title())).collect()
    } else {
        let pages: Vec<String> = codes.iter().map(|code| format!("{}\n", explain(*code).trim_end())).collect();
        pages.join("\n")
    };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}
