//! What a host asks for: one export, some queries, how to compile them. Every field is part of the artefact's id.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use isograd_graph::Precision;
use serde::{Deserialize, Serialize};

/// One request. Two requests with equal fields, of the same program and compiler version, have the same artefact.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Request {
    /// The export's name.
    pub export: String,
    /// What is wanted of it, in this order.
    pub queries: Vec<Query>,
    /// The precision of `real`.
    pub precision: Precision,
    /// Rates of parameters by name. By default the first parameter varies and the others are uniform
    /// (DESIGN 7).
    pub rates: BTreeMap<String, Rate>,
    /// The target.
    pub target: Target,
    /// Which way derivatives are computed.
    pub mode: DerivativeMode,
}

/// Which way derivatives are computed. The results differ by rounding only (LANGUAGE 13.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DerivativeMode {
    /// The cheaper of the two by the costs of the op table.
    #[default]
    Auto,
    /// Beside the values.
    Forward,
    /// Against the values, wherever fewer values are differentiated than they are differentiated by.
    Reverse,
}

impl DerivativeMode {
    /// All modes, the default first.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Forward, Self::Reverse];

    /// `auto`, `forward` or `reverse`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Forward => "forward",
            Self::Reverse => "reverse",
        }
    }
}

/// Whether a parameter has one value per call or one per point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rate {
    /// One value per call.
    Uniform,
    /// One value per point.
    Varying,
}

/// What is compiled to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Target {
    /// WebAssembly with 128-bit SIMD.
    #[default]
    Wasm,
}

/// What is wanted of an export. Written `value`, `gradient(at)`, `hessian(at)`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Query {
    /// Its result.
    Value,
    /// The first derivatives of its real results by the reals of a parameter.
    Gradient(String),
    /// The second derivatives of its real results by the reals of a parameter.
    Hessian(String),
}

impl fmt::Display for Query {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Value => f.write_str("value"),
            Self::Gradient(p) => write!(f, "gradient({p})"),
            Self::Hessian(p) => write!(f, "hessian({p})"),
        }
    }
}

/// A query that is none of the known forms.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownQuery(pub String);

impl fmt::Display for UnknownQuery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unknown query `{}`: expected `value`, `gradient(PARAMETER)` or `hessian(PARAMETER)`", self.0)
    }
}

impl std::error::Error for UnknownQuery {}

impl FromStr for Query {
    type Err = UnknownQuery;

    fn from_str(text: &str) -> Result<Self, UnknownQuery> {
        let unknown = || UnknownQuery(text.to_owned());
        let text = text.trim();
        if text == "value" {
            return Ok(Self::Value);
        }
        let (name, rest) = text.split_once('(').ok_or_else(unknown)?;
        let parameter = rest.strip_suffix(')').map(str::trim).filter(|p| !p.is_empty()).ok_or_else(unknown)?;
        match name.trim() {
            "gradient" => Ok(Self::Gradient(parameter.to_owned())),
            "hessian" => Ok(Self::Hessian(parameter.to_owned())),
            _ => Err(unknown()),
        }
    }
}
