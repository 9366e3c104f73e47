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
    /// Reverse if that saves a fifth by the costs of the op table, else forward.
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

/// What is wanted of an export: `value`, `gradient(at)`, `jacobian(at)`, `hessian(at)`, `hessian(at, radius)`. For a
/// parameter stands `*` where all parameters are meant.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Query {
    /// Its result.
    Value,
    /// The first derivatives of its real results by the reals of a parameter.
    Gradient(Wrt),
    /// The same, by its name for several results.
    Jacobian(Wrt),
    /// The second derivatives of its real results, by the reals of one parameter and of another or the same.
    Hessian(Wrt, Wrt),
}

/// What an export is differentiated by.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Wrt {
    /// The reals of the parameter with this name.
    Parameter(String),
    /// The reals of all parameters in order. Written `*`.
    All,
}

impl Query {
    /// What it differentiates by, outer derivative last.
    #[must_use]
    pub fn wrt(&self) -> Vec<&Wrt> {
        match self {
            Self::Value => Vec::new(),
            Self::Gradient(p) | Self::Jacobian(p) => vec![p],
            Self::Hessian(p, q) => vec![p, q],
        }
    }
}

impl From<&str> for Wrt {
    fn from(name: &str) -> Self {
        if name == "*" { Self::All } else { Self::Parameter(name.to_owned()) }
    }
}

impl fmt::Display for Wrt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parameter(name) => f.write_str(name),
            Self::All => f.write_str("*"),
        }
    }
}

impl fmt::Display for Query {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Value => f.write_str("value"),
            Self::Gradient(p) => write!(f, "gradient({p})"),
            Self::Jacobian(p) => write!(f, "jacobian({p})"),
            Self::Hessian(p, q) if p == q => write!(f, "hessian({p})"),
            Self::Hessian(p, q) => write!(f, "hessian({p}, {q})"),
        }
    }
}

/// A query that is none of the known forms.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownQuery(pub String);

impl fmt::Display for UnknownQuery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "unknown query `{}`: expected `value`, `gradient(PARAMETER)`, `jacobian(PARAMETER)`, `hessian(PARAMETER)` or \
             `hessian(PARAMETER, PARAMETER)`, where `*` stands for all parameters",
            self.0
        )
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
        let inside = rest.strip_suffix(')').ok_or_else(unknown)?;
        let by: Vec<Wrt> = inside.split(',').map(|p| Wrt::from(p.trim())).collect();
        if by.contains(&Wrt::Parameter(String::new())) {
            return Err(unknown());
        }
        match (name.trim(), by.as_slice()) {
            ("gradient", [p]) => Ok(Self::Gradient(p.clone())),
            ("jacobian", [p]) => Ok(Self::Jacobian(p.clone())),
            ("hessian", [p]) => Ok(Self::Hessian(p.clone(), p.clone())),
            ("hessian", [p, q]) => Ok(Self::Hessian(p.clone(), q.clone())),
            _ => Err(unknown()),
        }
    }
}
