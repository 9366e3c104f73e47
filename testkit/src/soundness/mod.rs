//! The soundness run: enclosures of all operations of the table and of all shapes of the standard library over random
//! boxes, against samples (LANGUAGE 15.4). Decides how many samples fall to whom, and what is reported; what an escape is
//! is the business of the laws.

pub mod boxes;
mod shapes;
pub mod tally;

use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use isograd_graph::{Op, Precision};

use crate::laws::Failure;
use crate::laws::enclosed_graph::Enclosed;
use crate::laws::enclosure::{Form, Rule};
use crate::points::Random;
use shapes::Shape;
use tally::Tally;

/// Points of one box.
const SAMPLES: u64 = 64;

/// What to run.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// About so many points in all.
    pub samples: u64,
    /// Of the boxes and points.
    pub seed: u64,
    /// At once.
    pub threads: usize,
}

/// What was found.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Operations and entries of the library, in order, with what was counted.
    pub rows: Vec<Row>,
    /// One escape of each subject that has any, or what else went wrong.
    pub failures: Vec<String>,
}

/// Counts of one operation or entry of the library.
#[derive(Debug, Clone)]
pub struct Row {
    /// Whether it is an entry of the library.
    pub is_shape: bool,
    /// Its name.
    pub name: String,
    /// The counts.
    pub tally: Tally,
}

enum Job<'s> {
    Operation(Op, Precision),
    Shape(&'s Shape, Precision),
}

impl Job<'_> {
    fn name(&self) -> String {
        match self {
            Self::Operation(op, _) => op.to_string(),
            Self::Shape(shape, _) => shape.entry.clone(),
        }
    }
}

/// Runs it.
///
/// # Errors
/// If a specimen is no valid program.
pub fn run(plan: Plan) -> Result<Report, String> {
    let shapes = shapes::standard()?;
    let precisions = [Precision::F32, Precision::F64];
    let mut jobs: Vec<Job<'_>> = Vec::new();
    for op in Op::ALL {
        jobs.extend(precisions.map(|p| Job::Operation(*op, p)));
    }
    let operations = jobs.len() as u64;
    for shape in &shapes {
        jobs.extend(precisions.map(|p| Job::Shape(shape, p)));
    }
    // Shapes are many and each sample of one goes through many operations.
    let of_shapes = (plan.samples / 4).div_ceil((jobs.len() as u64 - operations).max(1));
    let of_operations = (plan.samples - plan.samples / 4).div_ceil(operations);
    let done = Mutex::new(Vec::new());
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..plan.threads.max(1) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(job) = jobs.get(index) else { return };
                    let seed = plan.seed.wrapping_add(index as u64 * 0x9e37_79b9);
                    let result = match job {
                        Job::Operation(op, p) => operation(*op, *p, of_operations, seed),
                        Job::Shape(s, p) => shape(s, *p, of_shapes, seed),
                    };
                    done.lock().unwrap_or_else(PoisonError::into_inner).push((index, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(index, _)| *index);
    let mut report = Report::default();
    for (index, (tally, failure)) in done {
        let job = &jobs[index];
        let name = job.name();
        match report.rows.last_mut().filter(|row| row.name == name) {
            Some(row) => row.tally.add(&tally),
            None => report.rows.push(Row { is_shape: matches!(job, Job::Shape(..)), name, tally }),
        }
        report.failures.extend(failure.map(|f| f.to_string()));
    }
    Ok(report)
}

/// All forms of an operation; most of the samples fall to boxes.
fn operation(op: Op, precision: Precision, samples: u64, seed: u64) -> (Tally, Option<Failure>) {
    let (mut tally, mut first) = (Tally::default(), None);
    let mut random = Random::new(seed);
    let forms = Form::of(op);
    for form in &forms {
        let share =
            if *form == Form::Boxes { samples.div_ceil(2) } else { (samples / 2).div_ceil(forms.len() as u64 - 1) };
        let rule = match Rule::new(op, op.def(), precision, *form) {
            Ok(rule) => rule,
            Err(failure) => return (tally, Some(failure)),
        };
        let mut judge = rule.judge();
        for _ in 0..share.div_ceil(SAMPLES) {
            let sides = rule.random_box(&mut random);
            if let Err(failure) = judge.judge(&sides, SAMPLES as usize, &mut random, &mut tally) {
                tally.escapes += 1;
                first.get_or_insert(failure);
            }
        }
    }
    (tally, first)
}

fn shape(shape: &Shape, precision: Precision, samples: u64, seed: u64) -> (Tally, Option<Failure>) {
    let (mut tally, mut first) = (Tally::default(), None);
    let name = format!("{}: {}", shape.entry, shape.export);
    let enclosed = match Enclosed::new(&name, &shape.graph, precision, true) {
        Ok(Some(enclosed)) => enclosed,
        Ok(None) => {
            let what = "a number of iterations depends on the point".to_owned();
            return (tally, Some(Failure { law: "soundness", subject: name, what }));
        }
        Err(failure) => return (tally, Some(failure)),
    };
    let (mut judge, mut random) = (enclosed.judge(), Random::new(seed));
    // Infinite ends are no points.
    while tally.samples < samples {
        let sides = enclosed.random_box(&mut random);
        if let Err(failure) = judge.judge(&sides, SAMPLES as usize, &mut random, &mut tally) {
            tally.escapes += 1;
            first.get_or_insert(failure);
        }
    }
    (tally, first)
}

impl Report {
    /// The counts of all operations, and of all shapes.
    #[must_use]
    pub fn totals(&self) -> [Tally; 2] {
        [false, true].map(|is_shape| {
            let mut total = Tally::default();
            self.rows.iter().filter(|row| row.is_shape == is_shape).for_each(|row| total.add(&row.tally));
            total
        })
    }

    /// Whether nothing escaped, nothing else went wrong, and no shape was NaN at a point that is at most 10⁹ in size.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let [operations, shapes] = self.totals();
        self.failures.is_empty() && operations.escapes + shapes.escapes + shapes.nan == 0
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["boxes", "samples", "escapes", "NaN", "flagged", "finite", "open", "width"];
        let [boxes, samples, escapes, nan, flagged, finite, open, width] = head;
        writeln!(
            f,
            "{:<22}{boxes:>10}{samples:>12}{escapes:>9}{nan:>6}{flagged:>10}{finite:>9}{open:>9}{width:>9}",
            ""
        )?;
        let line = |f: &mut fmt::Formatter<'_>, name: &str, t: &Tally| {
            let width =
                t.tightness().map_or(String::new(), |x| if x < 1e4 { format!("{x:.3}") } else { format!("{x:.1e}") });
            writeln!(
                f,
                "{name:<22}{:>10}{:>12}{:>9}{:>6}{:>10}{:>9}{:>9}{width:>9}",
                t.boxes, t.samples, t.escapes, t.nan, t.flagged, t.flagged_finite, t.open
            )
        };
        for row in &self.rows {
            line(f, &row.name, &row.tally)?;
        }
        let [operations, shapes] = self.totals();
        line(f, "all operations", &operations)?;
        line(f, "all shapes", &shapes)?;
        writeln!(
            f,
            "flagged: enclosures that may be NaN, finite: those over boxes within 1e9; open: not enclosed after overflow or \
             underflow;\nwidth: of the enclosure over that of the hull of the samples, geometric mean"
        )?;
        self.failures.iter().try_for_each(|failure| writeln!(f, "\n{failure}"))
    }
}
