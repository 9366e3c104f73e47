//! The clock of a compilation: a deadline and the time of each step.
//! Knows no step by name but by what the pipeline tells it.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use isograd_compiler::{Limits, Watch};

/// Watches one compilation. `Sync`, so that a caller may hold it beside others.
#[derive(Debug)]
pub struct Stopwatch {
    deadline: Mutex<Option<Instant>>,
    steps: Mutex<Vec<(&'static str, Instant)>>,
}

impl Stopwatch {
    /// Starts now; expires after `compile_time_ms` of the limits.
    #[must_use]
    pub fn start(limits: &Limits) -> Self {
        let this = Self { deadline: Mutex::new(None), steps: Mutex::new(Vec::new()) };
        this.renew(limits);
        this
    }

    /// Gives the next compilation as much time as the first had. The times of steps go on.
    pub fn renew(&self, limits: &Limits) {
        if let Ok(mut deadline) = self.deadline.lock() {
            *deadline = Instant::now().checked_add(Duration::from_millis(limits.compile_time_ms));
        }
    }

    /// What each step took, in the order of their first beginning; the last one ends now.
    #[must_use]
    pub fn timings(&self) -> Vec<(&'static str, Duration)> {
        let steps = self.steps.lock().map(|s| s.clone()).unwrap_or_default();
        let ends = steps.iter().skip(1).map(|(_, at)| *at).chain([Instant::now()]);
        let mut timings: Vec<(&'static str, Duration)> = Vec::new();
        for ((name, from), to) in steps.iter().zip(ends) {
            let took = to.saturating_duration_since(*from);
            match timings.iter_mut().find(|(n, _)| n == name) {
                Some((_, sum)) => *sum += took,
                None => timings.push((name, took)),
            }
        }
        timings
    }
}

impl Watch for Stopwatch {
    fn step(&self, name: &'static str) {
        if let Ok(mut steps) = self.steps.lock() {
            steps.push((name, Instant::now()));
        }
    }

    fn expired(&self) -> bool {
        self.deadline.lock().is_ok_and(|d| d.is_some_and(|d| Instant::now() >= d))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_one_name_are_summed_in_the_order_they_began() {
        let watch = Stopwatch::start(&Limits::default());
        for name in ["load", "check", "load"] {
            watch.step(name);
            std::thread::sleep(Duration::from_millis(2));
        }
        let timings = watch.timings();
        let names: Vec<_> = timings.iter().map(|(n, _)| *n).collect();
        assert_eq!(names, ["load", "check"]);
        assert!(timings[0].1 >= Duration::from_millis(4) && timings[1].1 >= Duration::from_millis(2));
    }

    #[test]
    fn it_expires() {
        let limits = Limits { compile_time_ms: 5, ..Limits::default() };
        let watch = Stopwatch::start(&limits);
        assert!(!watch.expired());
        std::thread::sleep(Duration::from_millis(8));
        assert!(watch.expired());
    }
}
