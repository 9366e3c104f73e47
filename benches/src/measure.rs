//! Clocks: jobs raced in turn within one process, and the steps of a compilation timed from within. Knows nothing of
//! what the jobs do.

use std::cell::RefCell;
use std::time::{Duration, Instant};

use isograd_compiler::Watch;

/// How long to measure.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Turns of each job.
    pub rounds: usize,
    /// Least time of one turn. Short, so that few turns are interrupted where the machine has other work.
    pub turn: Duration,
}

/// Two jobs, by their median times of one call in seconds.
#[derive(Debug, Clone, Copy)]
pub struct Race {
    pub ours: f64,
    pub theirs: f64,
    /// The median of `ours / theirs` over the rounds. The clock speed of a machine drifts by tens of percent, but
    /// hardly within a round.
    pub ratio: f64,
}

/// Runs two jobs in turn: A B A B …
pub fn race(effort: Effort, mut ours: impl FnMut(), mut theirs: impl FnMut()) -> Race {
    let (a, b) = (calls_per_turn(effort, &mut ours), calls_per_turn(effort, &mut theirs));
    let rounds: Vec<_> = (0..effort.rounds).map(|_| (turn(a, &mut ours), turn(b, &mut theirs))).collect();
    Race {
        ours: median(rounds.iter().map(|r| r.0)),
        theirs: median(rounds.iter().map(|r| r.1)),
        ratio: median(rounds.iter().map(|r| r.0 / r.1)),
    }
}

/// The median time of one call of a job, in seconds, warm.
pub fn time(effort: Effort, mut job: impl FnMut()) -> f64 {
    let calls = calls_per_turn(effort, &mut job);
    median((0..effort.rounds).map(|_| turn(calls, &mut job)))
}

/// Warms a job up and counts how often it fits into a turn.
fn calls_per_turn(effort: Effort, job: &mut impl FnMut()) -> u32 {
    let mut calls = 1;
    loop {
        let spent = turn(calls, job) * f64::from(calls);
        if spent >= effort.turn.as_secs_f64() || calls >= 1 << 20 {
            return calls;
        }
        calls *= 2;
    }
}

fn turn(calls: u32, job: &mut impl FnMut()) -> f64 {
    let start = Instant::now();
    for _ in 0..calls {
        job();
    }
    start.elapsed().as_secs_f64() / f64::from(calls)
}

/// The middle one; NaN of nothing.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Notes when each step of a compilation begins.
#[derive(Default)]
pub struct Stopwatch(RefCell<Vec<(&'static str, Instant)>>);

impl Watch for Stopwatch {
    fn step(&self, name: &'static str) {
        self.0.borrow_mut().push((name, Instant::now()));
    }
}

impl Stopwatch {
    /// Ends the last step. Gives each step's seconds, in order.
    pub fn finish(self) -> Vec<(&'static str, f64)> {
        let end = Instant::now();
        let begun = self.0.into_inner();
        let ends = begun.iter().skip(1).map(|s| s.1).chain([end]);
        begun.iter().zip(ends).map(|((name, begin), end)| (*name, (end - *begin).as_secs_f64())).collect()
    }
}
