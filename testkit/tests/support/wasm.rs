//! Runs a request as its users do: compiled to WebAssembly, evaluated by the runtime over columns.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use isograd_compiler::{
    Checked, ColumnType, DerivativeMode, Differentiability, Precision, Query, Rate, Request, Sensitivity,
};
use isograd_graph::{Unwatched, Value};
use isograd_program::typed::Function;
use isograd_runtime::{EvalOptions, Runtime, Values};

/// One for all tests of a binary: it caches what it compiled.
static RUNTIME: LazyLock<Runtime> = LazyLock::new(Runtime::default);

/// Which parameters vary from point to point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Varying {
    /// All of them.
    All,
    /// The first, as by default. The others are those of the first point.
    First,
}

/// The request for some queries.
pub fn request(
    function: &Function,
    queries: &[Query],
    precision: Precision,
    mode: DerivativeMode,
    varying: Varying,
) -> Request {
    let rates: BTreeMap<String, Rate> = match varying {
        Varying::All => function.params.iter().map(|p| (p.name.clone(), Rate::Varying)).collect(),
        Varying::First => BTreeMap::new(),
    };
    Request { export: function.name.clone(), queries: queries.to_vec(), precision, mode, rates, ..Request::default() }
}

/// The same in the mode `smooth`, if there is a sensitivity.
pub fn smooth(request: Request, sensitivity: Option<Sensitivity>) -> Request {
    match sensitivity {
        Some(_) => Request { differentiability: Differentiability::Smooth, sensitivity, ..request },
        None => request,
    }
}

/// The flattened outputs of all queries at points, each of which has the values of all inputs.
pub fn wasm(
    checked: &Checked,
    function: &Function,
    queries: &[Query],
    precision: Precision,
    mode: DerivativeMode,
    varying: Varying,
    points: &[Vec<Value>],
) -> Result<Vec<Vec<Value>>, String> {
    evaluated(checked, &request(function, queries, precision, mode, varying), points)
}

/// The flattened outputs of a request at points.
pub fn evaluated(checked: &Checked, request: &Request, points: &[Vec<Value>]) -> Result<Vec<Vec<Value>>, String> {
    let artefact = isograd_compiler::compile(checked, request, &super::options(), &Unwatched);
    let artefact = artefact.map_err(|e| super::listed(&e))?;
    let kernel = RUNTIME.load(&artefact).map_err(|e| e.to_string())?;

    let ports = kernel.manifest().inputs.iter();
    let kinds: Vec<_> = ports.flat_map(|port| port.columns.iter().map(|c| (c.scalar, port.rate))).collect();
    let column = |i: usize, rate: Rate| {
        let given = if rate == Rate::Varying { points } else { &points[..1] };
        given.iter().map(move |point| point[i])
    };
    let real = |i, rate| column(i, rate).map(super::number).collect::<Vec<f64>>();
    let int = |i, rate| column(i, rate).map(|x| super::number(x) as i32).collect::<Vec<i32>>();
    let reals: Vec<Vec<f64>> = kinds.iter().enumerate().map(|(i, (_, rate))| real(i, *rate)).collect();
    let ints: Vec<Vec<i32>> = kinds.iter().enumerate().map(|(i, (_, rate))| int(i, *rate)).collect();
    let inputs: Vec<Values<'_>> = kinds
        .iter()
        .zip(reals.iter().zip(&ints))
        .map(|((scalar, _), (reals, ints))| match scalar {
            ColumnType::Real => Values::F64(reals),
            ColumnType::Int | ColumnType::Bool => Values::I32(ints),
        })
        .collect();

    let columns = kernel.evaluate(&inputs, points.len(), &EvalOptions::default()).map_err(|e| e.to_string())?;
    let kinds: Vec<ColumnType> =
        kernel.manifest().outputs.iter().flat_map(|port| port.columns.iter().map(|c| c.scalar)).collect();
    let scalar = |kind: &ColumnType, x: f64| match kind {
        ColumnType::Real => Value::Real(x),
        ColumnType::Int => Value::Int(x as i32),
        ColumnType::Bool => Value::Bool(x != 0.0),
    };
    let row = |point: usize| {
        let all = kinds.iter().zip(&columns);
        all.map(move |(kind, column)| column.get(point).map(|x| scalar(kind, x)).ok_or("a short column".to_owned()))
    };
    (0..points.len()).map(|point| row(point).collect()).collect()
}
