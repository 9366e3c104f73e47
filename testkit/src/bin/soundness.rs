//! Runs the soundness of enclosures and prints the table: `cargo run --release --bin soundness -- --samples 100000000`.
//! Exits with 1 if anything escapes. Knows the command line only.

use std::process::ExitCode;
use std::time::Instant;

use isograd_testkit::soundness::{Plan, run};

const USAGE: &str = "usage: soundness [--samples N] [--seed N] [--threads N]";

fn plan() -> Result<Plan, String> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut plan = Plan { samples: 1_000_000, seed: 2026, threads };
    let mut args = std::env::args().skip(1);
    while let Some(name) = args.next() {
        let text = args.next().ok_or_else(|| format!("`{name}` needs a number\n{USAGE}"))?;
        let number: u64 = text.replace('_', "").parse().map_err(|e| format!("`{name} {text}`: {e}\n{USAGE}"))?;
        match name.as_str() {
            "--samples" => plan.samples = number,
            "--seed" => plan.seed = number,
            "--threads" => plan.threads = usize::try_from(number).unwrap_or(threads),
            _ => return Err(format!("`{name}` is no option\n{USAGE}")),
        }
    }
    Ok(plan)
}

fn main() -> ExitCode {
    let begin = Instant::now();
    match plan().and_then(|plan| run(plan).map(|report| (plan, report))) {
        Ok((plan, report)) => {
            print!("{report}");
            let [operations, shapes] = report.totals();
            let samples = operations.samples + shapes.samples;
            let seconds = begin.elapsed().as_secs_f64();
            println!("{samples} samples with seed {} in {seconds:.1} s on {} threads", plan.seed, plan.threads);
            if report.is_sound() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::from(2)
        }
    }
}
