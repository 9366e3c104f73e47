//! Points for a module, by what its manifest says of its inputs: in their ranges, near kinks, and extreme ones. Knows
//! nothing of what is computed there.

use isograd_compiler::{Column, ColumnType, Manifest, Number, Precision, Rate, Role};
use isograd_graph::Value;

use super::columns::{number, scalar};
use crate::points::Random;

/// Where a real lies whose parameter has no range.
const BOX: (f64, f64) = (-2.0, 2.0);
/// Where an int lies whose parameter has none: ints are often trip counts.
const INTS: (f64, f64) = (-3.0, 8.0);

/// How a row is made.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sort {
    /// Uniform in the ranges.
    Uniform,
    /// On a coarse grid with equal coordinates, or the next number beside it.
    NearKinks,
    /// A special number among uniform ones.
    Extreme,
}

/// `n` rows: of eight, six are uniform, one is near kinks, one extreme.
pub fn points(manifest: &Manifest, n: usize, seed: u64) -> Vec<Vec<Value>> {
    let precision = manifest.precision().unwrap_or_default();
    let mut random = Random::new(seed);
    let mut rows: Vec<Vec<Value>> = Vec::new();
    for i in 0..n {
        let sort = match i % 8 {
            6 => Sort::NearKinks,
            7 => Sort::Extreme,
            _ => Sort::Uniform,
        };
        rows.push(row(manifest, precision, sort, &mut random, rows.first()));
    }
    rows
}

fn row(
    manifest: &Manifest,
    precision: Precision,
    sort: Sort,
    random: &mut Random,
    first: Option<&Vec<Value>>,
) -> Vec<Value> {
    let mut row: Vec<Value> = Vec::new();
    for port in &manifest.inputs {
        for column in &port.columns {
            let uniform = if port.rate == Rate::Uniform { first.and_then(|first| first.get(row.len())) } else { None };
            let before = row.last().copied();
            row.push(match (uniform, port.role) {
                (Some(uniform), _) => *uniform,
                (None, Role::Box) if column.name.ends_with(".end") => end(before, precision, random),
                (None, Role::Direction) => Value::Real(precision.round(random.within((-1.0, 1.0)))),
                (None, _) => point(column, precision, sort, random, before),
            });
        }
    }
    row
}

fn point(column: &Column, precision: Precision, sort: Sort, random: &mut Random, before: Option<Value>) -> Value {
    let ends = |ends: Option<[Number; 2]>| ends.map(|[lo, hi]| (lo.0, hi.0));
    let usual = if column.scalar == ColumnType::Int { INTS } else { BOX };
    let (lo, hi) = ends(column.within).or(ends(column.range)).unwrap_or(usual);
    let value = random.value_within(scalar(column.scalar), (lo, hi));
    let Value::Real(x) = value else { return value };
    let inside = |x: f64| column.within.is_none() || (lo..=hi).contains(&x);
    let x = match sort {
        Sort::Uniform => x,
        Sort::NearKinks => {
            let grid = match before {
                Some(Value::Real(before)) if random.chance(30) => random.pick(&[1.0, -1.0]) * before,
                _ => (x * 4.0).round() / 4.0,
            };
            if random.chance(50) { grid } else { grid * (1.0 + random.pick(&[1.0, -1.0]) * step(precision)) }
        }
        Sort::Extreme if random.chance(40) => number(random.surprise(scalar(column.scalar), precision)),
        Sort::Extreme => x,
    };
    Value::Real(precision.round(if inside(x) { x } else { number(value) }))
}

/// The upper end of a box: no, little or much larger than the lower one.
fn end(start: Option<Value>, precision: Precision, random: &mut Random) -> Value {
    let start = start.map_or(0.0, number);
    let size = random.pick(&[0.0, 1e-3, 0.25, 1.0, 4.0]) * random.unit();
    Value::Real(precision.round(start + size))
}

/// A little more than an ulp.
const fn step(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1.2e-7,
        Precision::F64 => 2.3e-16,
    }
}
