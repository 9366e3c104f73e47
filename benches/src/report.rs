//! The table: lines with what was measured, the goal and the verdict, aligned for people and as JSON for programs.
//! Knows nothing of what is measured.

use serde_json::{Value, json};

/// How a line stands to its goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Within,
    Misses,
}

/// One line of a section.
pub struct Line {
    pub name: String,
    /// Texts for the section's columns.
    pub cells: Vec<String>,
    /// What is compared with the goal.
    pub figure: f64,
    /// At most this.
    pub goal: Option<f64>,
}

impl Line {
    fn verdict(&self) -> Option<Verdict> {
        // A figure that is not a number misses any goal.
        self.goal.map(|goal| if self.figure <= goal { Verdict::Within } else { Verdict::Misses })
    }
}

/// Lines of one kind.
pub struct Section {
    pub title: String,
    /// Heads of the columns of cells.
    pub heads: Vec<&'static str>,
    /// What the figure is, with its unit.
    pub figure: &'static str,
    pub lines: Vec<Line>,
}

/// A number of three significant digits, but not more than four decimals.
pub fn digits(x: f64) -> String {
    let decimals = match x.abs() {
        100.0.. => 0,
        10.0.. => 1,
        0.1.. => 2,
        0.01.. => 3,
        _ => 4,
    };
    format!("{x:.decimals$}")
}

/// The sections as aligned text, each a table under its title.
pub fn text(sections: &[Section]) -> String {
    let mut out = String::new();
    for section in sections {
        let mut rows = vec![head(section)];
        rows.extend(section.lines.iter().map(row));
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |i: usize| rows.iter().filter_map(|r| r.get(i)).map(|c| c.chars().count()).max().unwrap_or(0);
        let widths: Vec<_> = (0..columns).map(width).collect();
        out.push_str(&format!("\n{}\n", section.title));
        for row in &rows {
            let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, w))| match i {
                // Names and verdicts are words and stand left, numbers right.
                0 => format!("{cell:<w$}"),
                _ if i + 1 == columns => cell.clone(),
                _ => format!("{cell:>w$}"),
            });
            let line = cells.collect::<Vec<String>>().join("  ");
            out.push_str("  ");
            out.push_str(line.trim_end());
            out.push('\n');
        }
    }
    out
}

fn head(section: &Section) -> Vec<String> {
    let mut cells = vec![String::new()];
    cells.extend(section.heads.iter().map(|h| (*h).to_owned()));
    cells.extend([section.figure, "goal", "verdict"].map(str::to_owned));
    cells
}

fn row(line: &Line) -> Vec<String> {
    let mut cells = vec![line.name.clone()];
    cells.extend(line.cells.iter().cloned());
    cells.push(digits(line.figure));
    cells.push(line.goal.map(|g| format!("≤ {}", digits(g))).unwrap_or_default());
    cells.push(
        match line.verdict() {
            Some(Verdict::Within) => "within goal",
            Some(Verdict::Misses) => "misses goal",
            None => "",
        }
        .to_owned(),
    );
    cells
}

/// The sections as JSON.
pub fn json(sections: &[Section]) -> Value {
    let sections: Vec<_> = sections
        .iter()
        .map(|s| {
            let lines: Vec<_> = s
                .lines
                .iter()
                .map(|l| {
                    let cells: serde_json::Map<_, _> = s
                        .heads
                        .iter()
                        .zip(&l.cells)
                        .map(|(h, c)| ((*h).to_owned(), c.parse::<f64>().map_or_else(|_| json!(c), |x| json!(x))))
                        .collect();
                    let within = l.verdict().map(|v| v == Verdict::Within);
                    json!({ "name": l.name, "cells": cells, "figure": l.figure, "goal": l.goal, "within": within })
                })
                .collect();
            json!({ "title": s.title, "figure": s.figure, "lines": lines })
        })
        .collect();
    json!({ "sections": sections })
}

/// How many lines have a goal, and how many of them are within it.
pub fn count(sections: &[Section]) -> (usize, usize) {
    let verdicts: Vec<_> = sections.iter().flat_map(|s| &s.lines).filter_map(Line::verdict).collect();
    (verdicts.len(), verdicts.iter().filter(|v| **v == Verdict::Within).count())
}
