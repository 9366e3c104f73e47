//! What a host asks for: one export, some queries, how to compile them. Every field is part of the artefact's id.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use isograd_graph::Precision;
use isograd_graph::ops::Family;
use serde::{Deserialize, Serialize};

use crate::{Differentiability, Number, Sensitivity};

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
    /// What a host calls.
    pub form: Form,
    /// Which way derivatives are computed.
    pub mode: DerivativeMode,
    /// What becomes of operations that have no derivative somewhere.
    pub differentiability: Differentiability,
    /// How smooth [`Differentiability::Smooth`] is, 1 if it is not given; nothing else takes one.
    pub sensitivity: Option<Sensitivity>,
    /// What the artefact is specialised to: by parameter, the ends that each of its scalars keeps between. Inside it
    /// computes the same bits as an artefact that is not specialised; outside, anything.
    pub within: BTreeMap<String, Vec<[Number; 2]>>,
}

/// Which way derivatives are computed. The results differ by rounding only (LANGUAGE 13.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DerivativeMode {
    /// Reverse if forward costs at least a tenth more by the op table, else forward.
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
    /// SPIR-V 1.3 for Vulkan 1.1.
    Spirv,
    /// WGSL for WebGPU. It cannot forbid that sums of products are fused.
    Wgsl,
    /// GLSL 4.50, translated from the WGSL; its compilers may round otherwise.
    Glsl,
    /// HLSL of shader model 6.0, translated likewise.
    Hlsl,
    /// The Metal Shading Language 2.4, translated likewise.
    Msl,
}

impl Target {
    /// All targets, the default first.
    pub const ALL: [Self; 6] = [Self::Wasm, Self::Spirv, Self::Wgsl, Self::Glsl, Self::Hlsl, Self::Msl];

    /// `wasm`, `spirv`, …
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Wasm => "wasm",
            Self::Spirv => "spirv",
            Self::Wgsl => "wgsl",
            Self::Glsl => "glsl",
            Self::Hlsl => "hlsl",
            Self::Msl => "msl",
        }
    }

    /// What names of files with such modules end in.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Wasm => "wasm",
            Self::Spirv => "spv",
            Self::Wgsl => "wgsl",
            Self::Glsl => "comp",
            Self::Hlsl => "hlsl",
            Self::Msl => "metal",
        }
    }

    /// Whether its modules are bytes; the others are text.
    #[must_use]
    pub const fn is_binary(self) -> bool {
        matches!(self, Self::Wasm | Self::Spirv)
    }

    /// The targets with which it shares its instructions.
    #[must_use]
    pub const fn family(self) -> Family {
        match self {
            Self::Wasm => Family::Lanes,
            Self::Spirv | Self::Wgsl | Self::Glsl | Self::Hlsl | Self::Msl => Family::Shader,
        }
    }
}

/// What a host calls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// A whole that computes all points of a call.
    #[default]
    Kernel,
    /// A function of one point, for programs that link or contain it. Shader targets only.
    Library,
}

impl Form {
    /// All forms, the default first.
    pub const ALL: [Self; 2] = [Self::Kernel, Self::Library];

    /// `kernel` or `library`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kernel => "kernel",
            Self::Library => "library",
        }
    }
}

/// What is wanted of an export, in one of the [`FORMS`].
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
    /// The derivative of its real results along a direction in the reals of a parameter, which is given beside it.
    Directional(Wrt),
    /// What encloses real results while the reals of a parameter range over boxes (LANGUAGE 15).
    Bound {
        /// Of what: the value, a gradient, Jacobian or Hessian.
        of: Box<Self>,
        /// What ranges over boxes.
        over: Wrt,
        /// Whether the enclosure is cut to the mean-value form.
        mean: bool,
    },
    /// The most that the norm of the gradient of a real result can be while the reals of a parameter range over boxes
    /// (LANGUAGE 15.7).
    Lipschitz(Wrt),
    /// How near the nearest kink is on the path that the derivatives of its real results by the reals of a parameter
    /// take, and on which side of it (LANGUAGE 13.6).
    Kinks {
        /// What derivatives are by.
        by: Wrt,
        /// How near is near.
        tolerance: Tolerance,
    },
}

/// A finite number that is not negative, in the units of the operands that a kink compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Tolerance(u64);

impl Tolerance {
    /// The tolerance of this size.
    #[must_use]
    pub fn new(size: f64) -> Option<Self> {
        // Bits of such numbers are in their order; −0 is 0.
        (size.is_finite() && size >= 0.0).then(|| Self((size + 0.0).to_bits()))
    }

    /// Its size.
    #[must_use]
    pub const fn size(self) -> f64 {
        f64::from_bits(self.0)
    }
}

/// A form of queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueryForm {
    /// How it is written: `gradient(PARAMETER)`.
    pub form: &'static str,
    /// What it gives.
    pub gives: &'static str,
}

/// The forms of queries; for a PARAMETER stands `*` where all parameters are meant.
pub const FORMS: &[QueryForm] = &[
    QueryForm { form: "value", gives: "the result" },
    QueryForm { form: "gradient(PARAMETER)", gives: "first derivatives of the real results by the parameter's reals" },
    QueryForm { form: "jacobian(PARAMETER)", gives: "the same, by its name for several results" },
    QueryForm { form: "hessian(PARAMETER)", gives: "second derivatives" },
    QueryForm { form: "hessian(PARAMETER, PARAMETER)", gives: "mixed second derivatives" },
    QueryForm {
        form: "directional(PARAMETER)",
        gives: "the derivative along the direction that is given beside the parameter",
    },
    QueryForm {
        form: "bound(PARAMETER)",
        gives: "ends that enclose the real results while the parameter's reals range over boxes; `bound` is `bound(*)`",
    },
    QueryForm {
        form: "bound(PARAMETER, mean)",
        gives: "the same cut to the mean-value form, which encloses the exact results only",
    },
    QueryForm {
        form: "bound(DERIVATIVE, PARAMETER)",
        gives: "the same of a `gradient(…)`, `jacobian(…)` or `hessian(…)`; `mean` may follow",
    },
    QueryForm {
        form: "lipschitz(PARAMETER)",
        gives: "the most that the gradient's norm can be while the parameter's reals range over boxes",
    },
    QueryForm {
        form: "kinks(PARAMETER)",
        gives: "whether the point lies in a kink on the path of these derivatives, how far the nearest is, which, and on \
                which side of it; `kinks` is `kinks(*)`",
    },
    QueryForm { form: "kinks(PARAMETER, TOLERANCE)", gives: "the same; as near counts a distance up to the tolerance" },
];

/// What an export is differentiated by.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Wrt {
    /// The reals of the parameter with this name.
    Parameter(String),
    /// The reals of all parameters in order. Written `*`.
    All,
}

impl Query {
    /// The parameters it names: what it differentiates by, outer derivative last, then what ranges over boxes.
    #[must_use]
    pub fn wrt(&self) -> Vec<&Wrt> {
        match self {
            Self::Value => Vec::new(),
            Self::Gradient(p) | Self::Jacobian(p) | Self::Directional(p) | Self::Lipschitz(p) => vec![p],
            Self::Kinks { by, .. } => vec![by],
            Self::Hessian(p, q) => vec![p, q],
            Self::Bound { of, over, .. } => match &**of {
                Self::Hessian(p, q) => vec![p, q, over],
                Self::Gradient(p) | Self::Jacobian(p) => vec![p, over],
                _ => vec![over],
            },
        }
    }

    /// What ranges over boxes.
    #[must_use]
    pub const fn boxed(&self) -> Option<&Wrt> {
        match self {
            Self::Bound { over, .. } | Self::Lipschitz(over) => Some(over),
            _ => None,
        }
    }

    /// What is given a direction.
    #[must_use]
    pub const fn directed(&self) -> Option<&Wrt> {
        match self {
            Self::Directional(p) => Some(p),
            _ => None,
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
            Self::Directional(p) => write!(f, "directional({p})"),
            Self::Bound { of, over, mean } => {
                f.write_str("bound(")?;
                if **of != Self::Value {
                    write!(f, "{of}, ")?;
                }
                write!(f, "{over}{})", if *mean { ", mean" } else { "" })
            }
            Self::Lipschitz(p) => write!(f, "lipschitz({p})"),
            Self::Kinks { by, tolerance } if *tolerance == Tolerance::default() => write!(f, "kinks({by})"),
            Self::Kinks { by, tolerance } => write!(f, "kinks({by}, {})", tolerance.size()),
        }
    }
}

/// The [`FORMS`] as a sentence has them: `value`, `gradient(PARAMETER)`, … or the last.
#[must_use]
pub fn query_forms() -> String {
    let forms: Vec<String> = FORMS.iter().map(|f| format!("`{}`", f.form)).collect();
    let (last, others) = forms.split_last().map_or(("", &[][..]), |(last, others)| (last.as_str(), others));
    format!("{} or {last}", others.join(", "))
}

/// A query that is none of the known forms.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownQuery(pub String);

impl fmt::Display for UnknownQuery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unknown query `{}`: expected {}, where `*` stands for all parameters", self.0, query_forms())
    }
}

impl std::error::Error for UnknownQuery {}

impl FromStr for Query {
    type Err = UnknownQuery;

    fn from_str(text: &str) -> Result<Self, UnknownQuery> {
        let unknown = || UnknownQuery(text.to_owned());
        let (name, arguments) = split(text).ok_or_else(unknown)?;
        let by = |text: &&str| match *text {
            "" => Err(unknown()),
            text if text.contains(['(', ')']) => Err(unknown()),
            text => Ok(Wrt::from(text)),
        };
        let bound = |of: Self, over: Wrt, mean: bool| Self::Bound { of: Box::new(of), over, mean };
        match (name, arguments.as_slice()) {
            ("value", []) => Ok(Self::Value),
            ("gradient", [p]) => Ok(Self::Gradient(by(p)?)),
            ("jacobian", [p]) => Ok(Self::Jacobian(by(p)?)),
            ("hessian", [p]) => Ok(Self::Hessian(by(p)?, by(p)?)),
            ("hessian", [p, q]) => Ok(Self::Hessian(by(p)?, by(q)?)),
            ("directional", [p]) => Ok(Self::Directional(by(p)?)),
            ("lipschitz", [p]) => Ok(Self::Lipschitz(by(p)?)),
            ("kinks", []) => Ok(Self::Kinks { by: Wrt::All, tolerance: Tolerance::default() }),
            ("kinks", [p]) => Ok(Self::Kinks { by: by(p)?, tolerance: Tolerance::default() }),
            ("kinks", [p, size]) => {
                let tolerance = size.parse().ok().and_then(Tolerance::new).ok_or_else(unknown)?;
                Ok(Self::Kinks { by: by(p)?, tolerance })
            }
            ("bound", []) => Ok(bound(Self::Value, Wrt::All, false)),
            ("bound", [p]) => Ok(bound(Self::Value, by(p)?, false)),
            ("bound", [p, "mean"]) if !p.contains('(') => Ok(bound(Self::Value, by(p)?, true)),
            ("bound", [of, p]) => Ok(bound(derivative(of).ok_or_else(unknown)?, by(p)?, false)),
            ("bound", [of, p, "mean"]) => Ok(bound(derivative(of).ok_or_else(unknown)?, by(p)?, true)),
            _ => Err(unknown()),
        }
    }
}

/// A derivative that has an enclosure: it names no other query, so this does not recurse further.
fn derivative(text: &str) -> Option<Query> {
    let (name, _) = split(text)?;
    matches!(name, "gradient" | "jacobian" | "hessian").then(|| text.parse().ok()).flatten()
}

/// `name(a, b(c, d))` is `name` with `a` and `b(c, d)`; `name` alone has no arguments.
fn split(text: &str) -> Option<(&str, Vec<&str>)> {
    let text = text.trim();
    let Some((name, rest)) = text.split_once('(') else { return Some((text, Vec::new())) };
    let inside = rest.strip_suffix(')')?;
    let mut depth = 0_i32;
    let arguments = inside.split(|c: char| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        c == ',' && depth == 0
    });
    Some((name.trim(), arguments.map(str::trim).collect()))
}
