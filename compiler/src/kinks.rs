//! What a manifest says of the kinks that a report numbers: operation, place in the source, and what the derivative is
//! on which side. Knows source files; knows nothing of how kinks are found.

use std::collections::BTreeMap;

use isograd_graph::{Op, ops};
use isograd_syntax::{Files, Span};
use isograd_transform::KinkPlace;
use serde::{Deserialize, Serialize};

/// The columns of `kinks(…)`.
pub const COLUMNS: [&str; 4] = ["near", "distance", "kink", "side"];

/// A kink that the column `kink` of a report numbers, counted from 0: an operation on the way from what is
/// differentiated by to the results, which has no derivative at some operands a, b, … (LANGUAGE 13.6).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Kink {
    /// The operation's name: `min`.
    pub operation: String,
    /// What it computes: `b if b < a, else a`.
    pub formula: String,
    /// Where it stands: `shape.vola:12:5`.
    pub place: String,
    /// Where its kink is: `a = b`.
    pub set: String,
    /// What is 0 there and tells the sides apart, `a − b`. The column `distance` is its size, `side` its sign.
    pub discriminant: String,
    /// The derivative that is given on side −1, in the kink (side 0), and on side 1.
    pub derivatives: [String; 3],
}

/// An operation as programs spell it: the table has one for each number of components.
pub const fn spelled(op: Op) -> &'static str {
    match op {
        Op::Length2 | Op::Length3 | Op::Length4 => "length",
        Op::Unit => "normalize",
        Op::RealToInt => "::<int>",
        Op::Lt => "<",
        Op::Le => "<=",
        Op::Eq => "==",
        Op::Ne => "!=",
        _ => op.def().name,
    }
}

/// Describes the kinks of each report.
pub fn described(reports: &[Vec<KinkPlace>], origins: &[Span], files: &Files) -> Vec<Vec<Kink>> {
    let span = |place: &KinkPlace| origins.get(place.origin.0 as usize).copied();
    let mut places: BTreeMap<Span, String> =
        reports.iter().flatten().filter_map(span).map(|span| (span, String::new())).collect();
    written(&mut places, files);
    let describe = |place: &KinkPlace| {
        let def = place.op.def();
        let ops::Kink::Where { set, measure, slopes, .. } = def.kink else { return None };
        Some(Kink {
            operation: spelled(place.op).to_owned(),
            formula: def.formula.to_owned(),
            place: span(place).and_then(|span| places.get(&span).cloned()).unwrap_or_default(),
            set: set.to_owned(),
            discriminant: measure.to_owned(),
            derivatives: slopes.map(str::to_owned),
        })
    };
    reports.iter().map(|report| report.iter().filter_map(describe).collect()).collect()
}

/// Writes `file:line:column` for each span, going once through each file.
fn written(places: &mut BTreeMap<Span, String>, files: &Files) {
    let mut file = None;
    let (mut byte, mut line, mut column) = (0, 1, 1);
    for (span, text) in places.iter_mut() {
        if file != Some(span.file) {
            (file, byte, line, column) = (Some(span.file), 0, 1, 1);
        }
        let Some(source) = files.get(span.file) else { continue };
        let start = span.start as usize;
        for c in source.text.get(byte..start).unwrap_or("").chars() {
            (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        byte = start;
        *text = format!("{}:{line}:{column}", source.name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_those_of_diagnostics() {
        let mut files = Files::default();
        let ids = [files.add("a.vola", "é = 1;\n  y\n\nlast"), files.add("b.vola", "one line")];
        let mut places = BTreeMap::new();
        for (file, starts) in [(ids[0], vec![0, 3, 8, 10, 15]), (ids[1], vec![0, 4])] {
            places.extend(starts.into_iter().map(|start| (Span::new(file, start, start + 1), String::new())));
        }
        written(&mut places, &files);
        for (span, text) in &places {
            let (line, column) = files.position(span.file, span.start);
            assert_eq!(*text, format!("{}:{line}:{column}", files.get(span.file).unwrap().name), "{span:?}");
        }
    }
}
