//! The mode `strict` (LANGUAGE 14.2): what is said of operations and branches that are not proved to be differentiable
//! over the ranges of the parameters. Knows parameters and messages; the proof is `isograd_transform::suspects`.

use isograd_graph::Precision;
use isograd_graph::ops::Kink;
use isograd_syntax::{Code, Diagnostic};
use isograd_transform::{Hull, Source, Suspect};

use crate::kinks::spelled;
use crate::{Argument, Parameter, ScalarKind};

/// The range of each column of the arguments: the parameter's, of a point and of the ends of a box; nothing is known of
/// a direction.
pub fn ranges(arguments: &[Argument], parameters: &[Parameter], names: &[String]) -> Vec<Hull> {
    let of = |argument: &Argument| -> Vec<Hull> {
        let parameter = names.get(argument.parameter).and_then(|n| parameters.iter().find(|p| p.name == *n));
        let range = parameter.and_then(|p| p.range.as_ref());
        let column = |c: &crate::ArgumentColumn| {
            let ends = range.and_then(|(lo, hi)| Some((*lo.get(c.scalar)?, *hi.get(c.scalar)?)));
            match ends.filter(|_| !matches!(c.source, Source::Direction(_))) {
                Some(ends) => hull(c.kind, ends),
                None => anything(c.kind),
            }
        };
        argument.columns.iter().map(column).collect()
    };
    arguments.iter().flat_map(of).collect()
}

/// Everything that a number may be whose range is not given: a number (LANGUAGE 9.3).
pub const fn anything(kind: ScalarKind) -> Hull {
    match kind {
        ScalarKind::Real => Hull::Real { lo: f64::NEG_INFINITY, hi: f64::INFINITY, nan: false },
        ScalarKind::Int => Hull::Int { lo: i32::MIN, hi: i32::MAX },
        ScalarKind::Bool => Hull::Bool { yes: true, no: true },
    }
}

/// A number between these ends.
#[expect(clippy::cast_possible_truncation, reason = "ends of ints are ints")]
pub fn hull(kind: ScalarKind, (lo, hi): (f64, f64)) -> Hull {
    match kind {
        ScalarKind::Real => Hull::Real { lo, hi, nan: false },
        ScalarKind::Int => Hull::Int { lo: lo as i32, hi: hi as i32 },
        ScalarKind::Bool => Hull::Bool { yes: hi != 0.0, no: lo == 0.0 },
    }
}

/// E0703 and E0704. `place` begins a diagnostic where an operation stands; `columns` are the names of the inputs.
pub fn diagnostics(
    suspects: &[Suspect],
    parameters: &[Parameter],
    columns: &[String],
    precision: Precision,
    place: impl Fn(Code, &Suspect, &str) -> Diagnostic,
) -> Vec<Diagnostic> {
    let describe = |suspect: &Suspect| {
        let (diagnostic, off) = match suspect.op {
            Some(op) => {
                let name = spelled(op);
                let (set, measure) = match op.def().kink {
                    Kink::Where { set, measure, .. } => (set, measure),
                    Kink::None => ("nowhere", ""),
                };
                let message = format!("`{name}` has a kink where {set}, which the ranges do not exclude");
                let operands: Vec<String> = ["a", "b", "c", "d"]
                    .iter()
                    .zip(&suspect.operands)
                    .map(|(name, hull)| format!("{name} in {}", shown(*hull, precision)))
                    .collect();
                let diagnostic = place(Code::E0703, suspect, &message)
                    .here("a derivative passes through this")
                    .note(format!("`{name}` computes {}; here {}", op.def().formula, operands.join(", ")));
                (diagnostic, format!("keep {measure} away from 0"))
            }
            None => {
                let message = "the condition of this branch depends on what is differentiated by";
                let diagnostic = place(Code::E0704, suspect, message)
                    .here("a derivative passes through this")
                    .note("where the condition changes, the derivative may not exist, and the ranges do not decide it");
                (diagnostic, "decide the condition".to_owned())
            }
        };
        let (named, open) = depends(suspect, parameters, columns);
        let diagnostic =
            if named.is_empty() { diagnostic } else { diagnostic.note(format!("depends on {}", named.join(", "))) };
        let help = match open.first() {
            Some(name) => format!("declare ranges that {off}, such as `{name}: … in [lo .. hi]`"),
            None => format!("choose ranges that {off}"),
        };
        diagnostic.help(format!("{help}, or compile in the mode `exact` or `smooth`"))
    };
    suspects.iter().map(describe).collect()
}

/// The parameters that something depends on, each with its range in words; and those of them that have none.
fn depends(suspect: &Suspect, parameters: &[Parameter], columns: &[String]) -> (Vec<String>, Vec<String>) {
    let (mut named, mut open) = (Vec::new(), Vec::new());
    for parameter in parameters {
        let own = |name: &String| {
            name.strip_prefix(&parameter.name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let is_meant = suspect.inputs.iter().any(|i| columns.get(*i as usize).is_some_and(own));
        if !is_meant {
            continue;
        }
        if parameter.range.is_some() {
            named.push(format!("`{}`", parameter.name));
        } else {
            named.push(format!("`{}`, which has no range", parameter.name));
            open.push(parameter.name.clone());
        }
    }
    (named, open)
}

#[expect(clippy::cast_possible_truncation, reason = "the ends are f32 numbers")]
fn shown(hull: Hull, precision: Precision) -> String {
    match hull {
        Hull::Real { lo, hi, .. } if precision == Precision::F32 => format!("[{} .. {}]", lo as f32, hi as f32),
        Hull::Real { lo, hi, .. } => format!("[{lo} .. {hi}]"),
        Hull::Int { lo, hi } => format!("[{lo} .. {hi}]"),
        Hull::Bool { .. } => "either truth value".to_owned(),
        Hull::Never => "nothing".to_owned(),
    }
}
