//! The modes of differentiability (LANGUAGE 14): what becomes of operations that have no derivative somewhere. Knows their
//! names and numbers, not how they are carried out.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::str::FromStr;

use isograd_syntax::{Code, Diagnostic};
use isograd_transform::Width;
use serde::{Deserialize, Serialize};

use crate::Request;

/// What becomes of operations that have no derivative somewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Differentiability {
    /// Values are exact; derivatives at kinks follow conventions.
    #[default]
    Exact,
    /// As `exact`, but a kink that a derivative may meet is an error.
    Strict,
    /// Kinks and jumps are smoothed, values included.
    Smooth,
}

impl Differentiability {
    /// All modes, the default first.
    pub const ALL: [Self; 3] = [Self::Exact, Self::Strict, Self::Smooth];

    /// `exact`, `strict` or `smooth`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Strict => "strict",
            Self::Smooth => "smooth",
        }
    }
}

/// How smooth `smooth` is: kinks have the width 10⁻³ times this, in the units of the operands. Positive and finite; equal
/// if it has the same bits.
#[derive(Debug, Clone, Copy)]
pub struct Sensitivity(f64);

impl Sensitivity {
    /// A positive finite number.
    ///
    /// # Errors
    /// If it is none.
    pub fn new(value: f64) -> Result<Self, InvalidSensitivity> {
        if value > 0.0 && value.is_finite() { Ok(Self(value)) } else { Err(InvalidSensitivity(value.to_string())) }
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

impl Default for Sensitivity {
    fn default() -> Self {
        Self(1.0)
    }
}

impl PartialEq for Sensitivity {
    fn eq(&self, other: &Self) -> bool {
        self.0.to_bits() == other.0.to_bits()
    }
}

impl Eq for Sensitivity {}

impl Hash for Sensitivity {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.to_bits().hash(state);
    }
}

impl fmt::Display for Sensitivity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for Sensitivity {
    type Err = InvalidSensitivity;

    fn from_str(text: &str) -> Result<Self, InvalidSensitivity> {
        let invalid = || InvalidSensitivity(text.to_owned());
        text.trim().parse().ok().and_then(|x| Self::new(x).ok()).ok_or_else(invalid)
    }
}

/// What cannot be a sensitivity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InvalidSensitivity(pub String);

impl fmt::Display for InvalidSensitivity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no sensitivity: expected a finite number above 0", self.0)
    }
}

impl std::error::Error for InvalidSensitivity {}

impl Request {
    /// The sensitivity that counts: that of the request, or 1; none outside of `smooth`.
    pub(crate) fn effective_sensitivity(&self) -> Option<Sensitivity> {
        (self.differentiability == Differentiability::Smooth).then(|| self.sensitivity.unwrap_or_default())
    }

    /// The width of kinks; none if they are left as they are.
    pub(crate) fn width(&self) -> Result<Option<Width>, Box<Diagnostic>> {
        match (self.differentiability, self.sensitivity, self.effective_sensitivity()) {
            (Differentiability::Smooth, _, Some(sensitivity)) => {
                Width::of(sensitivity.get(), self.precision).map(Some).map_err(|e| {
                    let message = format!("the sensitivity {sensitivity} is out of reach in {}", self.precision.name());
                    Box::new(Diagnostic::global(Code::E1102, message).help(e.to_string()))
                })
            }
            (mode, Some(_), _) => {
                let message = format!("a sensitivity is given, but the mode is `{}`", mode.name());
                Err(Box::new(
                    Diagnostic::global(Code::E1102, message).help("only `smooth` has a sensitivity: choose that mode"),
                ))
            }
            _ => Ok(None),
        }
    }
}
