//! Rows of values, one per point, to the columns of a runner and back. Knows manifests; knows no runner.

use isograd_compiler::{ColumnType, Manifest, Precision, Rate};
use isograd_graph::{Scalar, Value};
use isograd_runtime::{Column, Values};

/// The numbers of an input.
pub enum Held {
    Reals32(Vec<f32>),
    Reals64(Vec<f64>),
    Ints(Vec<i32>),
}

impl Held {
    pub fn values(&self) -> Values<'_> {
        match self {
            Self::Reals32(x) => Values::F32(x),
            Self::Reals64(x) => Values::F64(x),
            Self::Ints(x) => Values::I32(x),
        }
    }
}

/// The kinds of the scalars of ports, in order.
pub fn kinds(ports: &[isograd_compiler::Port]) -> Vec<(ColumnType, Rate)> {
    ports.iter().flat_map(|port| port.columns.iter().map(|c| (c.scalar, port.rate))).collect()
}

/// The columns of all inputs; a uniform one has the number of the first point.
pub fn held(manifest: &Manifest, rows: &[Vec<Value>]) -> Vec<Held> {
    let precision = manifest.precision().unwrap_or_default();
    let column = |(k, (kind, rate)): (usize, (ColumnType, Rate))| {
        let rows = if rate == Rate::Varying { rows } else { rows.get(..1).unwrap_or(&[]) };
        let all = rows.iter().filter_map(|row| row.get(k).copied());
        match (kind, precision) {
            #[expect(clippy::cast_possible_truncation, reason = "f32 values are held in f64")]
            (ColumnType::Real, Precision::F32) => Held::Reals32(all.map(|x| number(x) as f32).collect()),
            (ColumnType::Real, Precision::F64) => Held::Reals64(all.map(number).collect()),
            #[expect(clippy::cast_possible_truncation, reason = "ints and truth values")]
            (ColumnType::Int | ColumnType::Bool, _) => Held::Ints(all.map(|x| number(x) as i32).collect()),
        }
    };
    kinds(&manifest.inputs).into_iter().enumerate().map(column).collect()
}

/// The rows of outputs.
///
/// # Errors
/// If a column is short, or holds what is no value: a bool beside 0 and 1, or, where NaNs are canonical, another one.
pub fn rows(
    manifest: &Manifest,
    columns: &[Column],
    points: usize,
    canonical: bool,
) -> Result<Vec<Vec<Value>>, String> {
    let kinds = kinds(&manifest.outputs);
    if kinds.len() != columns.len() {
        return Err(format!("{} columns of outputs, {} expected", columns.len(), kinds.len()));
    }
    let value = |kind: ColumnType, column: &Column, point: usize| -> Result<Value, String> {
        let x = column.get(point).ok_or("a column is short")?;
        let odd = match column {
            Column::F32(x) => x.get(point).is_some_and(|x| x.is_nan() && x.to_bits() != u32::MAX),
            Column::F64(x) => x.get(point).is_some_and(|x| x.is_nan() && x.to_bits() != u64::MAX),
            Column::I32(_) => false,
        };
        if odd && canonical {
            return Err(format!("point {point}: a NaN is stored that has not all bits set"));
        }
        match (kind, column) {
            (ColumnType::Real, Column::F32(_) | Column::F64(_)) => Ok(Value::Real(x)),
            #[expect(clippy::cast_possible_truncation, reason = "it came from an i32")]
            (ColumnType::Int, Column::I32(_)) => Ok(Value::Int(x as i32)),
            (ColumnType::Bool, Column::I32(_)) if x == 0.0 || x == 1.0 => Ok(Value::Bool(x != 0.0)),
            (ColumnType::Bool, Column::I32(_)) => Err(format!("point {point}: a bool is stored as {x}")),
            _ => Err("a column of another kind than the manifest says".to_owned()),
        }
    };
    let row = |point: usize| kinds.iter().zip(columns).map(|((kind, _), column)| value(*kind, column, point)).collect();
    (0..points).map(row).collect()
}

/// A scalar as a number.
pub fn number(value: Value) -> f64 {
    match value {
        Value::Real(x) => x,
        Value::Int(x) => f64::from(x),
        Value::Bool(x) => f64::from(u8::from(x)),
    }
}

/// The kind of a column of a scalar.
pub const fn column_type(scalar: Scalar) -> ColumnType {
    match scalar {
        Scalar::Real => ColumnType::Real,
        Scalar::Int => ColumnType::Int,
        Scalar::Bool => ColumnType::Bool,
    }
}

/// The kind of the scalars of a column.
pub const fn scalar(column: ColumnType) -> Scalar {
    match column {
        ColumnType::Real => Scalar::Real,
        ColumnType::Int => Scalar::Int,
        ColumnType::Bool => Scalar::Bool,
    }
}
