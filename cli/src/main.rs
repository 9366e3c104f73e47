//! The `isograd` command: reads arguments and files, calls the compiler, the runtime or the server, and writes what
//! they give. Computes nothing itself.

mod args;
mod check;
mod compile;
mod describe;
mod devices;
mod eval;
mod explain;
mod files;
mod fmt;
mod inputs;
mod limits;
mod report;
mod serve;
mod table;

use std::io;
use std::process::ExitCode;

use clap::Parser;

use crate::args::{Command, Isograd};

/// Why a command ends without success.
enum Failure {
    /// The program or the data is wrong, and that was reported: exit code 1.
    Reported,
    /// The program or the data is wrong: exit code 1.
    Wrong(String),
    /// The command was used in a way that makes no sense: exit code 2.
    Usage(String),
    /// What is written could not be; nobody to tell if the reader went away.
    Output(io::Error),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

fn main() -> ExitCode {
    let result = match Isograd::parse().command {
        Command::Check(args) => check::run(&args),
        Command::Describe(args) => describe::run(&args),
        Command::Compile(args) => compile::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Fmt(args) => fmt::run(&args),
        Command::Serve(args) => serve::run(args),
        Command::Explain(args) => explain::run(&args),
        Command::Limits(args) => limits::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

impl Failure {
    /// Tells it, unless that was done; the exit code it stands for.
    fn report(self) -> ExitCode {
        match self {
            Self::Reported => ExitCode::from(1),
            Self::Wrong(message) => {
                report::error(&message);
                ExitCode::from(1)
            }
            Self::Usage(message) => {
                report::error(&message);
                ExitCode::from(2)
            }
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
            Self::Output(error) => {
                report::error(&format!("cannot write the result: {error}"));
                ExitCode::from(1)
            }
        }
    }
}
