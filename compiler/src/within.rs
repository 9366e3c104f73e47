//! The box that an artefact is specialised to: parameters with the ends of their scalars, checked against an export.
//! Knows parameters; knows nothing of what specialisation drops.

use std::fmt;
use std::str::FromStr;

use isograd_syntax::{Code, Diagnostic};
use isograd_transform::{Hull, Source};

use crate::strict::{anything, hull};
use crate::wanted::Wanting;
use crate::{Number, Request};

/// A parameter and the ends that each of its scalars keeps between, written `at=[-1, -1, 0]:[1, 1, 2]` or `r=0.5:2`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Within {
    /// The parameter.
    pub parameter: String,
    /// Its scalars in order (LANGUAGE 9.2), each with its lower and upper end.
    pub ends: Vec<[Number; 2]>,
}

/// What is no [`Within`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InvalidWithin(pub String);

impl fmt::Display for InvalidWithin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no box: expected `PARAMETER=[LO, …]:[HI, …]` with an end for each scalar", self.0)
    }
}

impl std::error::Error for InvalidWithin {}

impl FromStr for Within {
    type Err = InvalidWithin;

    fn from_str(text: &str) -> Result<Self, InvalidWithin> {
        let numbers = |text: &str| -> Option<Vec<f64>> {
            let text = text.trim();
            let inside = text.strip_prefix('[').map_or(Some(text), |rest| rest.strip_suffix(']'))?;
            inside.split(',').map(|x| x.trim().parse().ok()).collect()
        };
        let parts = || {
            let (name, ends) = text.split_once('=')?;
            let (lo, hi) = ends.split_once(':')?;
            let (lo, hi) = (numbers(lo)?, numbers(hi)?);
            let fits = lo.len() == hi.len() && !name.trim().is_empty();
            fits.then(|| Self {
                parameter: name.trim().to_owned(),
                ends: lo.into_iter().zip(hi).map(|(lo, hi)| [Number(lo), Number(hi)]).collect(),
            })
        };
        parts().ok_or_else(|| InvalidWithin(text.to_owned()))
    }
}

/// What each input of the graph may be; `None` if the request names no box.
///
/// # Errors
/// If a parameter does not exist, or its ends are too few, too many, reversed or NaN.
pub fn boxes(request: &Request, wanting: &Wanting) -> Result<Option<Vec<Hull>>, Box<Diagnostic>> {
    if request.within.is_empty() {
        return Ok(None);
    }
    for (name, ends) in &request.within {
        let wrong = |message: String| Box::new(Diagnostic::global(Code::E1102, message));
        let Some((_, ty, _)) = wanting.parameters.iter().find(|(p, ..)| p == name) else {
            let names: Vec<_> = wanting.parameters.iter().map(|(p, ..)| format!("`{p}`")).collect();
            let message = format!("the box: `{}` has no parameter `{name}`", request.export);
            return Err(Box::new(
                Diagnostic::global(Code::E1102, message).help(format!("its parameters are {}", names.join(", "))),
            ));
        };
        let wanted = ty.len() as usize;
        if ends.len() != wanted {
            let given = ends.len();
            return Err(wrong(format!("the box: `{name}` is {ty} and has {wanted} scalars, not {given}")));
        }
        if let Some([lo, hi]) = ends.iter().find(|[lo, hi]| lo.0.is_nan() || hi.0.is_nan() || hi.0 < lo.0) {
            return Err(wrong(format!("the box: `{name}` cannot lie between {} and {}", lo.0, hi.0)));
        }
    }
    let mut hulls = Vec::new();
    for argument in &wanting.arguments {
        let ends = wanting.parameters.get(argument.parameter).and_then(|(name, ..)| request.within.get(name));
        hulls.extend(argument.columns.iter().map(|column| {
            let ends = ends.filter(|_| !matches!(column.source, Source::Direction(_)));
            match ends.and_then(|ends| ends.get(column.scalar)) {
                Some([lo, hi]) => hull(column.kind, (lo.0, hi.0)),
                None => anything(column.kind),
            }
        }));
    }
    Ok(Some(hulls))
}

/// The box of one column of a manifest.
pub fn of_column(request: &Request, parameter: &str, scalar: usize) -> Option<[Number; 2]> {
    request.within.get(parameter)?.get(scalar).copied()
}
