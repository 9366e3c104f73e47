//! `isograd limits`: every limit there is, for reading and as JSON. Knows the two lists and no limit by name.

use std::fmt::Write as _;
use std::io::{Write, stdout};

use isograd_compiler::Limits as Language;
use isograd_server::limits::{language_json, service_json};
use isograd_server::{ServerLimits, server_options};
use serde_json::json;

use crate::Failure;
use crate::args::Limits;
use crate::check::pretty;

/// Runs the command.
pub fn run(args: &Limits) -> Result<(), Failure> {
    let text = if args.json {
        let language = language_json(&Language::default(), &Language::default());
        pretty(&json!({ "language": language, "service": service_json(&ServerLimits::default()) }))
    } else {
        table()
    };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

fn table() -> String {
    let mut text = "Limits of the language (`--limit NAME=VALUE`):\n\n".to_owned();
    row(&mut text, "name", "default", "code", "counts");
    for limit in Language::ALL {
        row(&mut text, limit.name, &limit.default.to_string(), limit.code.name(), limit.about);
    }
    text.push_str(
        "\nLimits of `isograd serve` (`--limit NAME=VALUE` or `[limits]` in its configuration), which also sets\n",
    );
    let served = server_options().limits;
    let other = Language::ALL.iter().filter(|l| (l.get)(&served) != l.default);
    let other: Vec<String> = other.map(|l| format!("{} = {}", l.name, (l.get)(&served))).collect();
    let _ = write!(text, "{}:\n\n", other.join(", "));
    row(&mut text, "name", "default", "", "counts");
    for limit in ServerLimits::ALL {
        row(&mut text, limit.name, &limit.default.to_string(), "", limit.about);
    }
    text
}

/// One line. Names have at most 19 characters, defaults at most 9 digits; longer ones only shift the line.
fn row(text: &mut String, name: &str, default: &str, code: &str, about: &str) {
    let _ = writeln!(text, "{name:<19}  {default:>9}  {code:<5}  {}", about.trim());
}
