//! The last step: the artefact's id and manifest.

use std::collections::BTreeMap;

use isograd_graph::{Scalar, Work};
use isograd_syntax::Files;
use serde::Serialize;

use crate::wanted::{Answer, Wanting};
use crate::{
    Abi, Argument, Column, ColumnType, DerivativeMode, Derivatives, Differentiability, Form, Kink, Manifest, Number,
    Parameter, Port, Rate, Request, Role, Specialised, Target, within,
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
    form: Form,
    mode: DerivativeMode,
    differentiability: Differentiability,
    sensitivity: Option<Number>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    within: BTreeMap<String, Vec<[Number; 2]>>,
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
            form: request.form,
            mode: request.mode,
            differentiability: request.differentiability,
            sensitivity: sensitivity(request),
            within: request.within.clone(),
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

/// Where the numbers of a module are.
#[derive(Debug, Clone)]
pub struct Places {
    /// How they are handed over.
    pub abi: Abi,
    /// Per input of the graph: what it is, and its column's offset.
    pub inputs: Vec<(Scalar, u32)>,
    /// Per output.
    pub outputs: Vec<(Scalar, u32)>,
}

/// What the transforms found of the outputs.
#[derive(Debug, Clone, Copy)]
pub struct Found<'a> {
    /// How derivatives are computed.
    pub derivatives: Derivatives,
    /// Per output: whether it is structurally 0.
    pub zeros: &'a [bool],
    /// Per thing that is asked for: whether it may jump where that matters.
    pub jumps: &'a [bool],
    /// Per report of kinks: what it numbers.
    pub kinks: &'a [Vec<Kink>],
    /// What specialisation left.
    pub specialised: Option<Specialised>,
}

/// The manifest of a module.
pub fn manifest(
    identity: &Identity,
    request: &Request,
    wanting: &Wanting,
    parameters: &[Parameter],
    places: &Places,
    work: Work,
    found: Found<'_>,
) -> Manifest {
    let mut slots = places.inputs.iter();
    let input = |argument: &Argument| {
        let names = argument.columns.iter().map(|c| c.name.clone());
        let mut columns: Vec<Column> = names.zip(slots.by_ref()).map(column).collect();
        let (parameter, _, rate) = wanting.parameters.get(argument.parameter)?;
        if let Some(parameter) = parameters.iter().find(|p| p.name == *parameter) {
            describe(&mut columns, argument, parameter, request);
        }
        let (name, ty) = (argument.name.clone(), argument.ty.to_string());
        Some(Port { name, ty, rate: *rate, role: argument.role, jumps: Vec::new(), kinks: Vec::new(), columns })
    };
    let inputs = wanting.arguments.iter().filter_map(input).collect();
    let mut slots = places.outputs.iter();
    let mut zeros = found.zeros.iter();
    let mut jumps = found.jumps.iter();
    let output = |query: &Answer| {
        let mut columns: Vec<Column> = query.columns.iter().cloned().zip(slots.by_ref()).map(column).collect();
        columns.iter_mut().zip(zeros.by_ref()).for_each(|(column, zero)| column.zero = *zero && query.sparse);
        let jumping = query.about.iter().zip(jumps.by_ref()).filter(|(_, jumps)| **jumps);
        Port {
            name: query.name.clone(),
            ty: query.ty.clone(),
            rate: Rate::Varying,
            role: Role::Point,
            jumps: jumping.map(|(about, _)| about.clone()).collect(),
            kinks: query.report.and_then(|report| found.kinks.get(report)).cloned().unwrap_or_default(),
            columns,
        }
    };
    let outputs = wanting.queries.iter().map(output).collect();
    Manifest {
        compiler: identity.compiler.to_owned(),
        id: identity.id(),
        export: request.export.clone(),
        precision: request.precision.name().to_owned(),
        inputs,
        outputs,
        target: request.target,
        form: request.form,
        abi: places.abi.clone(),
        operations: u32::try_from(work.operations).unwrap_or(u32::MAX),
        unbounded: work.long_loop,
        derivatives: found.derivatives,
        specialised: found.specialised,
        differentiability: request.differentiability,
        sensitivity: sensitivity(request),
    }
}

/// What counts of a request's sensitivity: a default that is spelled out changes nothing.
fn sensitivity(request: &Request) -> Option<Number> {
    request.effective_sensitivity().map(|s| Number(s.get()))
}

/// Gives the columns of a parameter its metadata; a direction has none.
fn describe(columns: &mut [Column], argument: &Argument, parameter: &Parameter, request: &Request) {
    if argument.role == Role::Direction {
        return;
    }
    for (column, of) in columns.iter_mut().zip(&argument.columns) {
        let at = |numbers: &Vec<f64>| numbers.get(of.scalar).copied().map(Number);
        column.within = within::of_column(request, &parameter.name, of.scalar);
        column.default = parameter.default.as_ref().and_then(at);
        column.range = parameter.range.as_ref().and_then(|(lo, hi)| Some([at(lo)?, at(hi)?]));
    }
}

fn column((name, (scalar, offset)): (String, &(Scalar, u32))) -> Column {
    let scalar = match scalar {
        Scalar::Real => ColumnType::Real,
        Scalar::Int => ColumnType::Int,
        Scalar::Bool => ColumnType::Bool,
    };
    Column { name, scalar, offset: *offset, default: None, within: None, range: None, zero: false }
}
