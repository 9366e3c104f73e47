//! Defaults and ranges of an export's parameters as numbers (LANGUAGE 9.3), and whether they fit each other. Knows
//! nothing of what a host does with them.

use isograd_graph::{Value, Watch};
use isograd_program::typed::{Constant, FunctionId, Param};
use isograd_program::{Program, ScalarKind};
use isograd_syntax::{Code, Diagnostic, Limits};

use crate::machine;

/// What a parameter says about its values, scalar by scalar in the order of LANGUAGE 9.2; a bool is 0 or 1.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Metadata {
    /// Its default.
    pub default: Option<Vec<f64>>,
    /// The lower and the upper ends of its range.
    pub range: Option<(Vec<f64>, Vec<f64>)>,
}

/// The metadata of the parameters of an export, computed in f64 (LANGUAGE 17.3), and what is wrong with it (E0903).
#[must_use]
pub fn metadata(
    program: &Program,
    export: FunctionId,
    limits: &Limits,
    watch: &dyn Watch,
) -> (Vec<Metadata>, Vec<Diagnostic>) {
    let params = program.functions.get(export.0 as usize).map_or(&[][..], |f| f.params.as_slice());
    let mut wrong = Vec::new();
    let mut all = Vec::with_capacity(params.len());
    for param in params {
        let mut numbers = |constant: &Constant| {
            let values = machine::constant(program, export, constant, limits, watch);
            match values {
                Ok(values) => Some(spread(values.into_iter().map(number).collect(), param)),
                Err(diagnostics) => {
                    wrong.extend(diagnostics);
                    None
                }
            }
        };
        let default = param.default.as_ref().and_then(&mut numbers);
        let range = param.range.as_ref().and_then(|(lo, hi)| numbers(lo).zip(numbers(hi)));
        let metadata = Metadata { default, range };
        wrong.extend(misfit(param, &metadata));
        all.push(metadata);
    }
    (all, wrong)
}

fn number(value: Value) -> f64 {
    match value {
        Value::Real(x) => x,
        Value::Int(x) => f64::from(x),
        Value::Bool(x) => f64::from(u8::from(x)),
    }
}

/// The end of a range may be one number that holds for every component.
fn spread(values: Vec<f64>, param: &Param) -> Vec<f64> {
    match *values {
        [one] => vec![one; param.ty.len() as usize],
        _ => values,
    }
}

/// E0903: the first scalar whose range is reversed, or whose default lies outside; a NaN lies nowhere.
fn misfit(param: &Param, metadata: &Metadata) -> Option<Diagnostic> {
    let kinds = param.ty.scalars();
    for (i, column) in param.ty.columns(&param.name).iter().enumerate() {
        let int = kinds.get(i) == Some(&ScalarKind::Int);
        let shown = |x: f64| if int { format!("{x}") } else { format!("{x:?}") };
        let (lo, hi) = match &metadata.range {
            Some((lo, hi)) => (*lo.get(i)?, *hi.get(i)?),
            None => (f64::NEG_INFINITY, f64::INFINITY),
        };
        let span = param.range.as_ref().map(|(lo, hi)| lo.span.to(hi.span));
        let in_order = lo <= hi;
        if let (false, Some(span)) = (in_order, span) {
            let message = format!("the range of `{column}` is reversed: {} .. {}", shown(lo), shown(hi));
            let (message, help) = if lo.is_nan() || hi.is_nan() {
                (message.replace("is reversed", "has an end that is no number"), "give both ends a value")
            } else {
                (message, "exchange its ends")
            };
            return Some(Diagnostic::new(Code::E0903, span, message).help(help));
        }
        let Some(default) = metadata.default.as_ref().and_then(|d| d.get(i)) else { continue };
        if lo <= *default && *default <= hi {
            continue;
        }
        let place = param.default.as_ref().map(|d| d.span)?;
        let mut diagnostic = match span {
            Some(span) => Diagnostic::new(
                Code::E0903,
                place,
                format!(
                    "the default of `{column}` is {}, outside of its range {} .. {}",
                    shown(*default),
                    shown(lo),
                    shown(hi)
                ),
            )
            .label(span, "the range"),
            None => Diagnostic::new(Code::E0903, place, format!("the default of `{column}` is no number")),
        };
        diagnostic = diagnostic.help(if span.is_some() {
            "choose another default, or widen the range"
        } else {
            "choose another default"
        });
        return Some(diagnostic);
    }
    None
}
