//! Results of an evaluation, and how their numbers are written: as JSON, as bytes, and one by one for CSV and tables.
//! Knows columns; knows nothing of where they were computed.

use std::collections::BTreeSet;
use std::io::{self, Write};

use isograd_compiler::Kink;
use serde::Serialize;

/// The numbers of a column, one per point.
#[derive(Debug, Clone, PartialEq)]
pub enum Numbers {
    /// Reals in single precision.
    F32(Vec<f32>),
    /// Reals in double precision.
    F64(Vec<f64>),
    /// Ints.
    Int(Vec<i32>),
    /// Truth values, 0 or 1.
    Bool(Vec<i32>),
}

/// A column of an output.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputColumn {
    /// Its name: `at.x`.
    pub name: String,
    /// What it holds.
    pub numbers: Numbers,
}

/// What one query gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// The query as written: `gradient(at)`.
    pub name: String,
    /// Its type: `vec3`.
    pub ty: String,
    /// Its columns.
    pub columns: Vec<OutputColumn>,
    /// Of a report of kinks: those that its column `kink` names, ascending.
    pub kinks: Vec<NumberedKink>,
}

/// A kink and its number in the column `kink`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NumberedKink {
    /// The number.
    pub kink: usize,
    /// What it is.
    #[serde(flatten)]
    pub of: Kink,
}

impl NumberedKink {
    /// Of all kinks of a report those that occur in its columns.
    #[must_use]
    pub fn named_by(columns: &[OutputColumn], all: &[Kink]) -> Vec<Self> {
        let numbers = columns.iter().find(|column| column.name == "kink").map(|column| &column.numbers);
        let Some(Numbers::Int(numbers)) = numbers else { return Vec::new() };
        let named: BTreeSet<usize> = numbers.iter().filter_map(|kink| usize::try_from(*kink).ok()).collect();
        named.into_iter().filter_map(|kink| Some(Self { kink, of: all.get(kink)?.clone() })).collect()
    }
}

/// What an evaluation gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// The export.
    pub export: String,
    /// The number of points, which is the length of every column.
    pub points: usize,
    /// One per query.
    pub outputs: Vec<Output>,
}

impl Numbers {
    /// Writes the number of a point: the shortest decimal that reads back as the same number, `nan`, `inf`, `-inf`,
    /// `true` or `false`. Nothing if there is no such point.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write(&self, w: &mut impl Write, point: usize) -> io::Result<()> {
        match self {
            Self::F32(x) => x.get(point).map_or(Ok(()), |x| match special(f64::from(*x)) {
                Some(name) => w.write_all(name.as_bytes()),
                None => serde_json::to_writer(&mut *w, x).map_err(io::Error::from),
            }),
            Self::F64(x) => x.get(point).map_or(Ok(()), |x| match special(*x) {
                Some(name) => w.write_all(name.as_bytes()),
                None => serde_json::to_writer(&mut *w, x).map_err(io::Error::from),
            }),
            Self::Int(x) => x.get(point).map_or(Ok(()), |x| write!(w, "{x}")),
            Self::Bool(x) => x.get(point).map_or(Ok(()), |x| write!(w, "{}", *x != 0)),
        }
    }

    /// The same as a JSON value: what is no number of JSON is quoted.
    fn write_json(&self, w: &mut impl Write, point: usize) -> io::Result<()> {
        let quoted = match self {
            Self::F32(x) => x.get(point).is_some_and(|x| !x.is_finite()),
            Self::F64(x) => x.get(point).is_some_and(|x| !x.is_finite()),
            Self::Int(_) | Self::Bool(_) => false,
        };
        if quoted {
            w.write_all(b"\"")?;
        }
        self.write(w, point)?;
        if quoted { w.write_all(b"\"") } else { Ok(()) }
    }

    /// Writes all numbers as bytes, little-endian: reals as f32 or f64, ints and truth values (0 or 1) as i32.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write_raw(&self, w: &mut impl Write) -> io::Result<()> {
        match self {
            Self::F32(x) => x.iter().try_for_each(|x| w.write_all(&x.to_le_bytes())),
            Self::F64(x) => x.iter().try_for_each(|x| w.write_all(&x.to_le_bytes())),
            Self::Int(x) | Self::Bool(x) => x.iter().try_for_each(|x| w.write_all(&x.to_le_bytes())),
        }
    }
}

/// The name of what is not finite.
fn special(x: f64) -> Option<&'static str> {
    match x {
        _ if x.is_nan() => Some("nan"),
        f64::INFINITY => Some("inf"),
        f64::NEG_INFINITY => Some("-inf"),
        _ => None,
    }
}

impl Outputs {
    /// Writes `{"export": …, "outputs": [{"name", "type", "columns": […], "rows": [[…], …]}]}`; a report of kinks has
    /// `"kinks": [{"kink", "operation", …}, …]` as well.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write_json(&self, w: &mut impl Write) -> io::Result<()> {
        w.write_all(b"{\"export\":")?;
        serde_json::to_writer(&mut *w, &self.export)?;
        w.write_all(b",\"outputs\":[")?;
        for (i, output) in self.outputs.iter().enumerate() {
            w.write_all(if i == 0 { b"{" } else { b",{" })?;
            output.write_json(w, self.points)?;
            w.write_all(b"}")?;
        }
        w.write_all(b"]}")
    }

    /// Writes the numbers alone, as [`Numbers::write_raw`] does: the columns of all outputs one after the other, each
    /// with the numbers of all points. `w` should be buffered.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write_raw(&self, w: &mut impl Write) -> io::Result<()> {
        self.outputs.iter().flat_map(|o| &o.columns).try_for_each(|column| column.numbers.write_raw(w))
    }
}

impl Output {
    fn write_json(&self, w: &mut impl Write, points: usize) -> io::Result<()> {
        let columns: Vec<&str> = self.columns.iter().map(|c| c.name.as_str()).collect();
        w.write_all(b"\"name\":")?;
        serde_json::to_writer(&mut *w, &self.name)?;
        w.write_all(b",\"type\":")?;
        serde_json::to_writer(&mut *w, &self.ty)?;
        w.write_all(b",\"columns\":")?;
        serde_json::to_writer(&mut *w, &columns)?;
        w.write_all(b",\"rows\":[")?;
        for point in 0..points {
            w.write_all(if point == 0 { b"[" } else { b",[" })?;
            for (i, column) in self.columns.iter().enumerate() {
                if i > 0 {
                    w.write_all(b",")?;
                }
                column.numbers.write_json(w, point)?;
            }
            w.write_all(b"]")?;
        }
        w.write_all(b"]")?;
        if !self.kinks.is_empty() {
            w.write_all(b",\"kinks\":")?;
            serde_json::to_writer(&mut *w, &self.kinks)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two points of several kinds.
    fn outputs() -> Outputs {
        let column = |name: &str, numbers| OutputColumn { name: name.to_owned(), numbers };
        Outputs {
            export: "f".to_owned(),
            points: 2,
            outputs: vec![
                Output {
                    name: "value".to_owned(),
                    ty: "(real, int, bool)".to_owned(),
                    columns: vec![
                        column("value.0", Numbers::F32(vec![0.1, f32::NAN])),
                        column("value.1", Numbers::Int(vec![-3, 4])),
                        column("value.2", Numbers::Bool(vec![1, 0])),
                    ],
                    kinks: Vec::new(),
                },
                Output {
                    name: "gradient(at)".to_owned(),
                    ty: "real".to_owned(),
                    columns: vec![column("at", Numbers::F64(vec![f64::NEG_INFINITY, 1e-300]))],
                    kinks: Vec::new(),
                },
            ],
        }
    }

    #[test]
    fn json_has_one_row_per_point_and_names_what_is_not_finite() {
        let mut text = Vec::new();
        outputs().write_json(&mut text).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            r#"{"export":"f","outputs":[{"name":"value","type":"(real, int, bool)","columns":["value.0","value.1","value.2"],"rows":[[0.1,-3,true],["nan",4,false]]},{"name":"gradient(at)","type":"real","columns":["at"],"rows":[["-inf"],[1e-300]]}]}"#
        );
    }

    #[test]
    fn raw_is_the_columns_one_after_the_other() {
        let mut found = Vec::new();
        outputs().write_raw(&mut found).unwrap();
        let mut expected = Vec::new();
        expected.extend([0.1_f32, f32::NAN].iter().flat_map(|x| x.to_le_bytes()));
        expected.extend([-3_i32, 4, 1, 0].iter().flat_map(|x| x.to_le_bytes()));
        expected.extend([f64::NEG_INFINITY, 1e-300].iter().flat_map(|x| x.to_le_bytes()));
        assert_eq!(found, expected);
    }
}
