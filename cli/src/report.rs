//! What is told on the standard error: diagnostics, errors, timings. In colour on a terminal.
//! Nothing here may fail; if nobody reads, nothing is said.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write, stderr};
use std::time::Duration;

use isograd_compiler::{Diagnostic, Files, STEPS, render};

/// Whether the standard error shows colours.
fn color() -> bool {
    stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}

/// Shows text.
pub fn say(text: &str) {
    let mut out = stderr().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// Shows an error that is no diagnostic of the compiler.
pub fn error(message: &str) {
    let label = if color() { "\x1b[1;31merror\x1b[0m" } else { "error" };
    say(&format!("{label}: {message}\n"));
}

/// Shows a warning that is no diagnostic of the compiler.
pub fn warning(message: &str) {
    let label = if color() { "\x1b[1;33mwarning\x1b[0m" } else { "warning" };
    say(&format!("{label}: {message}\n"));
}

/// Shows diagnostics with their source.
pub fn diagnostics(diagnostics: &[Diagnostic], files: &Files) {
    if !diagnostics.is_empty() {
        say(&render::terminal(diagnostics, files, color()));
    }
}

/// Shows the time of each step, in the order of the pipeline.
pub fn timings(timings: &[(&'static str, Duration)]) {
    // The program could not be read.
    if timings.is_empty() {
        return;
    }
    let ms = |d: &Duration| d.as_secs_f64() * 1000.0;
    let total: f64 = timings.iter().map(|(_, d)| ms(d)).sum();
    let share = |x: f64| if total > 0.0 { 100.0 * x / total } else { 0.0 };
    let mut text = format!("{:<14} {:>10} {:>7}\n", "step", "ms", "share");
    let mut row = |name: &str, x: f64| {
        let _ = writeln!(text, "{name:<14} {x:>10.3} {:>6.1}%", share(x));
    };
    let known = STEPS.iter().filter_map(|step| timings.iter().find(|(name, _)| name == step));
    let other = timings.iter().filter(|(name, _)| !STEPS.contains(name));
    for (name, duration) in known.chain(other) {
        row(name, ms(duration));
    }
    row("total", total);
    say(&text);
}
