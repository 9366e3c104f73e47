//! What LANGUAGE Appendix A promises of every entry of the standard library: it stands alone, is documented, may be
//! overridden, and what its specimens compute obeys the laws of the classes they claim. Values at single points are in
//! `language/library.cases`.
//!
//! `stdlib/ENTRY.vola` holds the specimens of an entry: exports of one parameter `p: vec3` or `p: vec2`, each after
//! what is claimed of it:
//!
//! ```text
//! //# class E             E, U, L or N: LANGUAGE A.3
//! //# outside             the claim E or U holds only where the value is above 0; `inside`: below
//! //# lipschitz 1.4143    a Lipschitz constant, for N
//! //# within -2..2        each component of the sampled points; this is the default
//! //# critical 0,0,0; 1,0,0    points where something may divide by zero
//! //# map                 instead of a class: the result is a vec3 and no field
//! ```
//!
//! `ISOGRAD_BLESS=1 cargo test --release --test stdlib` writes what was measured to `docs/standard-library.md`.

mod support;

#[path = "stdlib/harness/controls.rs"]
mod controls;
#[path = "stdlib/harness/entries.rs"]
mod entries;
#[path = "stdlib/harness/kernels.rs"]
mod kernels;
#[path = "stdlib/harness/page.rs"]
mod page;
#[path = "stdlib/harness/specimens.rs"]
mod specimens;

use std::process::ExitCode;
use std::sync::{Arc, Mutex};

use isograd_testkit::library::{Claim, Class, Measured};
use libtest_mimic::{Arguments, Failed, Trial};

use entries::Entry;
use specimens::Specimen;

/// What was measured of one specimen.
struct Row {
    entry: String,
    export: String,
    claim: Claim,
    measured: Measured,
}

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let entries: Arc<Vec<Entry>> = Arc::new(entries::all());
    let specimens = Arc::new(specimens::all());
    let rows: Arc<Mutex<Vec<Row>>> = Arc::default();

    let mut trials = controls::trials();
    trials.push(trial("prelude", &entries, |entries| entries::prelude_imports(entries)));
    trials.push(trial("concepts", &entries, |_| entries::concepts_are_documented()));
    for index in 0..entries.len() {
        let name = &entries[index].stem;
        trials.push(trial(&format!("alone: {name}"), &entries, move |all| entries::stands_alone(&all[index])));
        trials.push(trial(&format!("override: {name}"), &entries, move |all| entries::yields(&all[index])));
        let specimens = Arc::clone(&specimens);
        trials.push(trial(&format!("documented: {name}"), &entries, move |all| documented(&all[index], &specimens)));
    }
    for index in 0..specimens.len() {
        let rows = Arc::clone(&rows);
        let name = format!("{}: {}", specimens[index].entry, specimens[index].export);
        trials.push(trial(&name, &specimens, move |all| {
            let specimen = &all[index];
            let measured = specimens::judge(specimen)?;
            let Specimen { entry, export, claim, .. } = specimen.clone();
            rows.lock().map_err(|e| e.to_string())?.push(Row { entry, export, claim, measured });
            Ok(())
        }));
    }

    let conclusion = libtest_mimic::run(&arguments, trials);
    if arguments.list || conclusion.has_failed() {
        return conclusion.exit_code();
    }
    let mut rows = rows.lock().expect("no trial panicked with the rows");
    let place = |row: &Row| specimens.iter().position(|s| s.entry == row.entry && s.export == row.export);
    rows.sort_by_key(place);
    let sum = |f: fn(&Measured) -> usize| rows.iter().map(|row| f(&row.measured)).sum::<usize>();
    println!(
        "{} entries, {} specimens: {} comparisons, {} more could not be judged",
        entries.len(),
        rows.len(),
        sum(|m| m.count.judged),
        sum(|m| m.count.unjudged),
    );
    // The page needs all measurements.
    if conclusion.num_filtered_out > 0 {
        return conclusion.exit_code();
    }
    match page::check(&page::written(&entries, &rows)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn trial<T: Send + Sync + 'static>(
    name: &str,
    of: &Arc<T>,
    run: impl FnOnce(&T) -> Result<(), String> + Send + 'static,
) -> Trial {
    let of = Arc::clone(of);
    Trial::test(name, move || run(&of).map_err(Failed::from))
}

/// The documentation says what LANGUAGE A.1 demands, and the specimens claim what it says.
fn documented(entry: &Entry, specimens: &[Specimen]) -> Result<(), String> {
    let Entry { stem, doc, .. } = entry;
    for part in ["Class", "Needs:", "Source:"] {
        if !doc.contains(part) {
            return Err(format!("the comment of `{}` has no `{part}`", entry.name));
        }
    }
    if entry.is_function() {
        return Ok(());
    }
    let claims: Vec<&Claim> = specimens.iter().filter(|s| s.entry == *stem).map(|s| &s.claim).collect();
    if claims.is_empty() {
        return Err(format!("`{}` has no specimen: write testkit/tests/stdlib/{stem}.vola", entry.name));
    }
    let said = entry.class();
    let words: Vec<&str> = said.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let class = match words.first() {
        Some(&"E") => Class::Exact,
        Some(&"U") => Class::Unit,
        Some(&"L") => Class::Lower,
        Some(&"N") => Class::Neither,
        Some(&"colour" | &"map") if claims.iter().all(|c| c.class.is_some()) => {
            return Err(format!("`{}` has no specimen that is a `map`", entry.name));
        }
        Some(&"keeps" | &"colour" | &"map") => return Ok(()),
        _ => return Err(format!("the comment of `{}` has an unknown class: `{said}`", entry.name)),
    };
    if !claims.iter().any(|c| c.class == Some(class)) {
        return Err(format!("the comment of `{}` says class {}, which no specimen claims", entry.name, letter(class)));
    }
    match claims.iter().filter_map(|c| c.class).find(|c| *c > class && !words.contains(&letter(*c))) {
        Some(more) => Err(format!("a specimen of `{}` claims {}: its comment does not", entry.name, letter(more))),
        None => Ok(()),
    }
}

/// The class as LANGUAGE A.3 writes it.
const fn letter(class: Class) -> &'static str {
    match class {
        Class::Exact => "E",
        Class::Unit => "U",
        Class::Lower => "L",
        Class::Neither => "N",
    }
}
