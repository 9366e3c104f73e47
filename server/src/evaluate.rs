//! The one place where values meet a compiled request: columns in, outputs out, for the command line and HTTP alike.
//! Knows the runtime's interface and that there may be others with the same columns; knows nothing of JSON, CSV or
//! tables.

use std::sync::Arc;
use std::time::{Duration, Instant};

use isograd_compiler::{Artefact, ColumnType, Manifest, Rate, Request};
use isograd_runtime::{Column, EvalError, EvalOptions, Kernel, LoadError, Runtime, Values};

use crate::limits::LimitValue;
use crate::outputs::{NumberedKink, Numbers, Output, OutputColumn, Outputs};
use crate::values::{Inputs, Interface};

/// Why an evaluation gave nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EvaluateError {
    /// It took too long.
    #[error("the evaluation took too long")]
    Deadline,
    /// The runtime will not run this: the module is too large, or there are too many results.
    #[error("{message}")]
    Refused {
        /// What is too much.
        message: String,
        /// The limit, if it has a name.
        limit: Option<LimitValue>,
    },
    /// A mistake of ours.
    #[error("{0}")]
    Internal(String),
}

impl From<EvalError> for EvaluateError {
    fn from(error: EvalError) -> Self {
        match error {
            EvalError::Deadline => Self::Deadline,
            EvalError::Memory { .. } | EvalError::Outside { .. } => {
                Self::Refused { message: error.to_string(), limit: None }
            }
            error => Self::Internal(error.to_string()),
        }
    }
}

/// Makes native code of a module, or finds it.
///
/// # Errors
/// If the runtime refuses it.
pub fn load(runtime: &Runtime, artefact: &Artefact) -> Result<Arc<Kernel>, EvaluateError> {
    runtime.load(artefact).map_err(|error| {
        let message = error.to_string();
        let limit = |name, limit: u32| Some(LimitValue { name, value: u64::from(limit) });
        match error {
            LoadError::Operations { limit: most, .. } => {
                EvaluateError::Refused { message, limit: limit("max_operations", most) }
            }
            LoadError::Memory { limit: most, .. } => {
                EvaluateError::Refused { message, limit: limit("max_memory", most) }
            }
            LoadError::Module(_) => EvaluateError::Internal(message),
        }
    })
}

/// Gives a request the rates that the inputs have. What is given for a parameter varies if any of it does.
pub fn set_rates(request: &mut Request, interface: &Interface<'_>, inputs: &Inputs) {
    let given = || interface.arguments.iter().zip(&inputs.values);
    let varies = |i| given().any(|(argument, values)| argument.parameter == i && values.rate == Rate::Varying);
    let rate = |i| if varies(i) { Rate::Varying } else { Rate::Uniform };
    let parameters = interface.export.parameters.iter().enumerate();
    request.rates = parameters.map(|(i, parameter)| (parameter.name.clone(), rate(i))).collect();
}

/// Evaluates in WebAssembly. The kernel must be of a request with the rates of the inputs.
///
/// # Errors
/// If it takes longer than `time`, or fails.
pub fn run(kernel: &Kernel, inputs: &Inputs, time: Option<Duration>) -> Result<Outputs, EvaluateError> {
    let options = EvalOptions { deadline: time.and_then(|t| Instant::now().checked_add(t)), ..EvalOptions::default() };
    run_with(kernel.manifest(), inputs, |values, points| Ok(kernel.evaluate(values, points, &options)?))
}

/// Evaluates by `call`, which is given one column per input scalar of the manifest and how many points there are, at
/// least one, and gives one column per output scalar. What is called must be of a request with the rates of the
/// inputs.
///
/// # Errors
/// Those of `call`.
pub fn run_with<E>(
    manifest: &Manifest,
    inputs: &Inputs,
    call: impl FnOnce(&[Values<'_>], usize) -> Result<Vec<Column>, E>,
) -> Result<Outputs, E> {
    let kinds = manifest.inputs.iter().flat_map(|port| &port.columns).map(|c| c.scalar);
    let given = inputs.values.iter().flat_map(|values| &values.columns);
    // Ints and truth values have to be made; reals are taken as they are.
    let ints: Vec<Vec<i32>> = given.clone().zip(kinds.clone()).map(|(column, kind)| integers(kind, column)).collect();
    let columns: Vec<Values<'_>> = given
        .zip(kinds)
        .zip(&ints)
        .map(|((column, kind), ints)| match kind {
            ColumnType::Real => Values::F64(column),
            ColumnType::Int | ColumnType::Bool => Values::I32(ints),
        })
        .collect();
    let computed = if inputs.points == 0 {
        manifest.outputs.iter().flat_map(|port| &port.columns).map(|_| Column::F32(Vec::new())).collect()
    } else {
        call(&columns, inputs.points)?
    };
    let mut computed = computed.into_iter();
    let outputs = manifest.outputs.iter().map(|port| {
        let columns = port.columns.iter().zip(computed.by_ref());
        let columns: Vec<OutputColumn> = columns
            .map(|(column, computed)| OutputColumn {
                name: column.name.clone(),
                numbers: match (computed, column.scalar) {
                    (Column::F32(x), _) => Numbers::F32(x),
                    (Column::F64(x), _) => Numbers::F64(x),
                    (Column::I32(x), ColumnType::Bool) => Numbers::Bool(x),
                    (Column::I32(x), _) => Numbers::Int(x),
                },
            })
            .collect();
        let kinks = NumberedKink::named_by(&columns, &port.kinks);
        Output { name: port.name.clone(), ty: port.ty.clone(), columns, kinks }
    });
    Ok(Outputs { export: manifest.export.clone(), points: inputs.points, outputs: outputs.collect() })
}

/// A column of ints or truth values; nothing for one of reals.
#[expect(clippy::cast_possible_truncation, reason = "what is no int was refused when the values were read")]
fn integers(kind: ColumnType, column: &[f64]) -> Vec<i32> {
    match kind {
        ColumnType::Real => Vec::new(),
        ColumnType::Int | ColumnType::Bool => column.iter().map(|x| *x as i32).collect(),
    }
}
