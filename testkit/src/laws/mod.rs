//! The laws: each is a function of what it quantifies over, and answers with how many points it could judge, or with
//! the first failure. Tests, fuzz targets and the gate call the same functions; the laws know no test framework.

#[cfg(feature = "run")]
mod batches;
#[cfg(feature = "run")]
mod bits;
mod derivative;
pub mod enclosed_graph;
pub mod enclosure;
mod front;
mod higher;
mod kink;
mod pipeline;
#[cfg(feature = "run")]
mod spirv;
mod transposed;

use std::fmt;
use std::ops::AddAssign;

use isograd_graph::{Graph, Value, Verified, parse, verify};

#[cfg(feature = "run")]
pub use batches::batches;
#[cfg(feature = "run")]
pub use bits::{finished, finished_equals_raw, kernels_of, neighbours, optimised_equals_plain, wasm_equals_reference};
pub use derivative::{derivative, kink_points};
pub use front::{checked, elaborated, parsed, structured};
pub use higher::higher_derivatives;
pub use kink::kink;
pub use pipeline::{at_kinks, derivative_by_values, expanded_derivatives, oracles_agree, pipeline_derivative};
#[cfg(feature = "run")]
pub use spirv::{wasm_equals_shader_graph, wasm_equals_spirv};
pub use transposed::transposed;

/// How many comparisons a law made, and how many it could not make.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Count {
    /// Compared.
    pub judged: usize,
    /// Too near a kink, too ill conditioned, or out of an oracle's range.
    pub unjudged: usize,
}

impl Count {
    /// Fails if less than `percent` of all comparisons could be made.
    ///
    /// # Errors
    /// That too many points could not be judged.
    pub fn at_least(self, percent: usize, law: &'static str, subject: impl fmt::Display) -> Result<Self, Failure> {
        if self.judged * 100 >= (self.judged + self.unjudged) * percent {
            return Ok(self);
        }
        let Self { judged, unjudged } = self;
        Err(Failure::new(law, subject, format!("only {judged} points could be judged, {unjudged} could not")))
    }
}

impl AddAssign for Count {
    fn add_assign(&mut self, other: Self) {
        self.judged += other.judged;
        self.unjudged += other.unjudged;
    }
}

/// A law that does not hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// The law.
    pub law: &'static str,
    /// What was judged: an operation, or a graph in its text form.
    pub subject: String,
    /// The point, the numbers and the tolerance.
    pub what: String,
}

impl Failure {
    fn new(law: &'static str, subject: impl fmt::Display, what: impl fmt::Display) -> Self {
        Self { law, subject: subject.to_string(), what: what.to_string() }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { law, subject, what } = self;
        write!(f, "the law `{law}` does not hold: {what}\n{subject}")
    }
}

impl std::error::Error for Failure {}

/// A law's answer.
pub type Judgement = Result<Count, Failure>;

/// The verifier accepts what a step made, and its text form reads back.
///
/// # Errors
/// If it does not.
pub fn verifier_accepts(step: &'static str, graph: Graph) -> Result<Verified, Failure> {
    let text = isograd_graph::print(&graph);
    let back = parse(&text).map(|g| isograd_graph::print(&g)).map_err(|e| e.to_string());
    if back.as_ref() != Ok(&text) {
        return Err(Failure::new("text_reads_back", text, format!("after `{step}`: {back:?}")));
    }
    verify(graph).map_err(|e| Failure::new("verifier_accepts", text, format!("after `{step}`: {e}")))
}

/// Numbers of an output for a message.
pub(crate) fn show(values: &[Value]) -> String {
    let texts: Vec<String> = values
        .iter()
        .map(|v| match v {
            Value::Real(x) => format!("{x:?}"),
            Value::Int(x) => x.to_string(),
            Value::Bool(x) => x.to_string(),
        })
        .collect();
    format!("[{}]", texts.join(", "))
}

/// The real in a value; NaN if it is none.
const fn real(value: Value) -> f64 {
    match value {
        Value::Real(x) => x,
        Value::Int(_) | Value::Bool(_) => f64::NAN,
    }
}
