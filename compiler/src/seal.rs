//! The last step: the artefact's id and manifest.

use isograd_graph::Scalar;
use isograd_syntax::Files;
use isograd_wasm::{Facts, Layout};
use serde::Serialize;

use crate::wanted::Wanting;
use crate::{
    Column, ColumnType, DerivativeMode, Derivatives, Manifest, Number, Parameter, Port, Rate, Request, Target,
};

/// The canonical form of a request: everything that can change a byte of the artefact. Its id is the BLAKE3 of its
/// JSON, whose fields stand in the order declared here.
#[derive(Debug, Clone, Serialize)]
pub struct Identity {
    compiler: &'static str,
    program: String,
    export: String,
    queries: Vec<String>,
    precision: &'static str,
    rates: Vec<(String, Rate)>,
    target: Target,
    mode: DerivativeMode,
}

impl Identity {
    /// The identity of a request for the program with this digest.
    pub fn of(program: &str, request: &Request, wanting: &Wanting) -> Self {
        Self {
            compiler: env!("CARGO_PKG_VERSION"),
            program: program.to_owned(),
            export: request.export.clone(),
            queries: request.queries.iter().map(ToString::to_string).collect(),
            precision: request.precision.name(),
            // As resolved: a default that is spelled out changes nothing.
            rates: wanting.parameters.iter().map(|(name, _, rate)| (name.clone(), *rate)).collect(),
            target: request.target,
            mode: request.mode,
        }
    }

    /// The id.
    pub fn id(&self) -> String {
        blake3::hash(&serde_json::to_vec(self).unwrap_or_default()).to_hex().to_string()
    }
}

/// BLAKE3 of all files of a program, library files included, with their names.
pub fn digest(files: &Files) -> String {
    let mut hasher = blake3::Hasher::new();
    for (_, file) in files.iter() {
        for part in [&file.name, &file.text] {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
    }
    hasher.finalize().to_hex().to_string()
}

/// The manifest of a module.
pub fn manifest(
    identity: &Identity,
    request: &Request,
    wanting: &Wanting,
    parameters: &[Parameter],
    layout: &Layout,
    facts: Facts,
    derivatives: Derivatives,
) -> Manifest {
    let mut slots = layout.inputs.iter();
    let inputs = wanting
        .parameters
        .iter()
        .map(|(name, ty, rate)| {
            let mut columns: Vec<Column> = ty.columns(name).into_iter().zip(slots.by_ref()).map(column).collect();
            if let Some(parameter) = parameters.iter().find(|p| p.name == *name) {
                describe(&mut columns, parameter);
            }
            Port { name: name.clone(), ty: ty.to_string(), rate: *rate, columns }
        })
        .collect();
    let mut slots = layout.outputs.iter();
    let outputs = wanting
        .queries
        .iter()
        .map(|query| Port {
            name: query.name.clone(),
            ty: query.ty.clone(),
            rate: Rate::Varying,
            columns: query.columns.iter().cloned().zip(slots.by_ref()).map(column).collect(),
        })
        .collect();
    Manifest {
        compiler: identity.compiler.to_owned(),
        id: identity.id(),
        export: request.export.clone(),
        precision: request.precision.name().to_owned(),
        inputs,
        outputs,
        block: layout.block,
        pad: layout.pad,
        memory: layout.memory,
        operations: u32::try_from(facts.operations).unwrap_or(u32::MAX),
        unbounded: facts.long_loop,
        derivatives,
    }
}

/// Gives the columns of a parameter its metadata.
fn describe(columns: &mut [Column], parameter: &Parameter) {
    for (i, column) in columns.iter_mut().enumerate() {
        let at = |numbers: &Vec<f64>| numbers.get(i).copied().map(Number);
        column.default = parameter.default.as_ref().and_then(at);
        column.range = parameter.range.as_ref().and_then(|(lo, hi)| Some([at(lo)?, at(hi)?]));
    }
}

fn column((name, slot): (String, &isograd_wasm::Slot)) -> Column {
    let scalar = match slot.scalar {
        Scalar::Real => ColumnType::Real,
        Scalar::Int => ColumnType::Int,
        Scalar::Bool => ColumnType::Bool,
    };
    Column { name, scalar, offset: slot.offset, default: None, range: None }
}
