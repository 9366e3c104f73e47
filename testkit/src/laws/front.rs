//! What holds for every input to the front end, byte by byte or program by program: it is read, checked and specialised
//! without a panic, diagnostics point into their files, graphs are well formed. Knows nothing of what programs mean.

use isograd_compiler::{Checked, Code, Diagnostic, Files, MemoryLoader, Options, Unwatched, render};
use isograd_elaborate::elaborate as specialise;
use isograd_graph::verify;

use super::{Count, Failure, Judgement};
use crate::programs::{Choices, program};

/// Diagnostics that a program grown by [`program`] may have: it may be too large, or nest derivatives in a loop.
const ALLOWED: &[Code] =
    &[Code::E0705, Code::E1005, Code::E1006, Code::E1007, Code::E1008, Code::E1009, Code::E1010, Code::E1011];

/// Any bytes are read as a file: the tree is complete for text without errors, and every diagnostic can be shown.
///
/// # Errors
/// A diagnostic that points outside its file, or a tree whose printed form is another tree.
pub fn parsed(bytes: &[u8]) -> Judgement {
    const LAW: &str = "any bytes are read";
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(Count::default()) };
    let limits = Options::default().limits;
    let mut files = Files::default();
    let file = files.add("main.vola", text);
    let parsed = isograd_syntax::parse(file, text, &limits);
    shown(LAW, text, &parsed.diagnostics, &files)?;
    Ok(Count { judged: 1, unjudged: 0 })
}

/// Any bytes are checked.
///
/// # Errors
/// A diagnostic that points outside its file, or an error of the compiler itself.
pub fn checked(bytes: &[u8]) -> Judgement {
    check("any bytes are checked", bytes).map(|_| Count { judged: 1, unjudged: 0 })
}

/// Any bytes that are a program without errors are specialised, export by export.
///
/// # Errors
/// As [`checked`], or a malformed graph.
pub fn elaborated(bytes: &[u8]) -> Judgement {
    elaborate("any program is specialised", bytes).map(|(count, _)| count)
}

/// A program that is well typed by construction has no errors.
///
/// # Errors
/// As [`elaborated`], or an error that the program does not have.
pub fn structured(choices: Choices<'_>) -> Judgement {
    const LAW: &str = "a well-typed program has no errors";
    let text = program(choices);
    let (count, diagnostics) = elaborate(LAW, text.as_bytes())?;
    match diagnostics.iter().find(|d| d.is_error() && !ALLOWED.contains(&d.code)) {
        Some(wrong) => Err(Failure::new(LAW, &text, format!("{}: {}", wrong.code.name(), wrong.message))),
        None => Ok(count),
    }
}

fn check(law: &'static str, bytes: &[u8]) -> Result<Checked, Failure> {
    let loader = MemoryLoader::default();
    let checked = isograd_compiler::check("main.vola", bytes.to_vec(), &loader, &Options::default(), &Unwatched);
    shown(law, &String::from_utf8_lossy(bytes), &checked.diagnostics, &checked.files)?;
    Ok(checked)
}

/// All exports of a program in graphs, and every diagnostic of the way there.
fn elaborate(law: &'static str, bytes: &[u8]) -> Result<(Count, Vec<Diagnostic>), Failure> {
    let checked = check(law, bytes)?;
    let text = String::from_utf8_lossy(bytes);
    let mut diagnostics = checked.diagnostics.clone();
    let mut count = Count::default();
    let Some(typed) = &checked.program else { return Ok((count, diagnostics)) };
    for export in &typed.exports {
        match specialise(typed, *export, &Options::default().limits, &Unwatched) {
            Ok(elaborated) => {
                verify(elaborated.graph).map_err(|e| Failure::new(law, &text, e))?;
                diagnostics.extend(elaborated.warnings);
                count.judged += 1;
            }
            Err(errors) => {
                diagnostics.extend(errors);
                count.unjudged += 1;
            }
        }
    }
    shown(law, &text, &diagnostics, &checked.files)?;
    Ok((count, diagnostics))
}

/// Diagnostics point into their files, at characters' boundaries, and can be rendered; none is about the compiler.
fn shown(law: &'static str, text: &str, diagnostics: &[Diagnostic], files: &Files) -> Result<(), Failure> {
    for diagnostic in diagnostics {
        let fail = |what: &str| Err(Failure::new(law, text, format!("{diagnostic:?} {what}")));
        if diagnostic.code == Code::E1103 {
            return fail("is an error of the compiler");
        }
        for label in &diagnostic.labels {
            let Some(file) = files.get(label.span.file) else { return fail("is in no file") };
            if file.text.get(label.span.start as usize..label.span.end as usize).is_none() {
                return fail("points outside its file");
            }
        }
    }
    let complete = render::terminal(diagnostics, files, false).is_empty() == diagnostics.is_empty()
        && render::json(diagnostics, files).as_array().map(Vec::len) == Some(diagnostics.len());
    if complete { Ok(()) } else { Err(Failure::new(law, text, "a renderer leaves diagnostics out")) }
}
