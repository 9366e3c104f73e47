//! Writes the library's page: what the entries' comments say, beside what was measured. Knows nothing of how.

use std::fmt::Write as _;
use std::path::Path;

use isograd_testkit::library::{Claim, Class, Measured, Side};

use crate::entries::Entry;
use crate::{Row, letter};

const INTRODUCTION: &str = "\
# The standard library

Generated from the comments in `stdlib/` and from measurements; do not edit. Written anew by

```
ISOGRAD_BLESS=1 cargo test --release --test stdlib
```

`module std::prelude;` imports everything, `module std::ENTRY;` one entry with what it needs. A program's own
declaration of the same name wins, with a warning. Lengths have the unit of the point, angles are radians, and axial
shapes have the z axis.

## Classes

| class | meaning |
|---|---|
| **E** exact | the value is the signed Euclidean distance to the zero set |
| **U** unit gradient | continuous, right zero set and sign, ‖∇F‖ = 1 wherever there is a gradient; not always a distance |
| **L** lower bound | right zero set and sign, abs(F) is at most the distance (Lipschitz constant 1) |
| **N** neither | right zero set and sign only; a Lipschitz constant is given where there is one |

Each implies the next. For an operation it is the class of the result for the weakest class of its operands; *keeps*
means that of the operand.

## What was measured

Each row sums up the specimens in `testkit/tests/stdlib/` for which the entry claims the class, compiled to WebAssembly
like any program, at seeded points. The worst of each is shown, rounded up:

* *gradient*: how far the length of ∇F is from 1;
* *distance*: how far abs(F) is from the distance to the nearest point of the zero set, which is found by search in the
  values: about 10⁻⁷ is what the search resolves;
* *foot*: abs(F) at p − F∇F;
* *slope*: abs(F(p) − F(q)) / ‖p − q‖ over near and far pairs, and ‖∇F‖;
* *derivative*: how far the gradient is from differences of the value in f64, which resolve about 10⁻⁹;
* *points*: comparisons made, and those that could not be made, most of them too near a kink or, for a distance, too
  far from the sampled part of the zero set. Value, gradient and Hessian are also free of NaN, in f32 and in f64, at
  every point tried up to a size of 10⁹.

| entry | class | gradient | distance | foot | slope | derivative | points | not judged |
|---|---|---|---|---|---|---|---|---|
";

/// The page.
pub fn written(entries: &[Entry], rows: &[Row]) -> String {
    let mut page = INTRODUCTION.to_owned();
    for entry in entries {
        let mut groups: Vec<(String, Measured)> = Vec::new();
        for row in rows.iter().filter(|row| row.entry == entry.stem) {
            let label = label(&row.claim);
            match groups.iter_mut().find(|(other, _)| *other == label) {
                Some((_, measured)) => measured.join(&row.measured),
                None => groups.push((label, row.measured)),
            }
        }
        for (label, m) in groups {
            let _ = writeln!(
                page,
                "| [`{}`](#{}) | {label} | {} | {} | {} | {} | {} | {} | {} |",
                entry.name,
                entry.name.to_lowercase(),
                small(m.unit),
                small(m.distance),
                small(m.foot),
                quotient(m.lipschitz),
                small(m.slope),
                m.count.judged,
                m.count.unjudged,
            );
        }
    }
    page += "\n## Entries\n";
    for entry in entries {
        let first = entry.doc.lines().next().unwrap_or_default();
        let _ = writeln!(page, "\n### {}\n", entry.name);
        let _ = writeln!(page, "`{}` in `std::{}`\n\n{first}\n", entry.declaration, entry.stem);
        for (what, said) in [("Class", entry.class()), ("Needs", entry.said("Needs")), ("Source", entry.said("Source"))]
        {
            let _ = writeln!(page, "* {what}: {said}.");
        }
    }
    page
}

/// Compares the page with the one in the repository, or writes it.
pub fn check(page: &str) -> Result<(), String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/standard-library.md");
    if std::env::var_os("ISOGRAD_BLESS").is_some() {
        return std::fs::write(&path, page).map_err(|e| e.to_string());
    }
    let old = std::fs::read_to_string(&path).unwrap_or_default();
    if old == page {
        return Ok(());
    }
    let differs = old.lines().zip(page.lines()).find(|(a, b)| a != b);
    let (was, is) = differs.unwrap_or(("its end", "another end"));
    Err(format!(
        "docs/standard-library.md is not current:\n  it has    {was}\n  should be {is}\n\
         write it anew with `ISOGRAD_BLESS=1 cargo test --release --test stdlib`"
    ))
}

fn label(claim: &Claim) -> String {
    let side = match claim.side {
        None => "",
        Some(Side::Outside) => " outside",
        Some(Side::Inside) => " inside",
    };
    match (claim.class, claim.lipschitz) {
        (None, _) => "map".to_owned(),
        (Some(Class::Neither), Some(constant)) => format!("N, slope ≤ {constant}"),
        (Some(class), _) => format!("{}{side}", letter(class)),
    }
}

/// A deviation, rounded up to a power of ten.
fn small(x: Option<f64>) -> String {
    let Some(x) = x else { return String::new() };
    if x == 0.0 {
        return "0".to_owned();
    }
    (-18..=18).find(|e| x <= 10_f64.powi(*e)).map_or_else(|| format!("{x}"), |e| format!("1e{e}"))
}

/// A slope, rounded up to three digits after the point; the laws allow for 10⁻⁹ of rounding.
fn quotient(x: Option<f64>) -> String {
    x.map_or_else(String::new, |x| format!("{:.3}", (x * (1.0 - 2e-9) * 1000.0).ceil() / 1000.0))
}
