//! The web page of `docs/web` in headless Chromium, and its `evaluate.js` in Node: they evaluate modules that the
//! compiler emitted without any other code of it, and must print what the runtime computes, bit for bit. Knows the page's
//! address and table; knows nothing of how it calls a module.
//!
//! Where there is no Chromium this says so and passes; with `ISOGRAD_REQUIRE_CHROMIUM=1` it fails. `CHROMIUM` names one.

#![allow(clippy::pedantic, reason = "tests")]

#[path = "web/browser.rs"]
mod browser;
#[path = "web/cases.rs"]
mod cases;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::{Arc, Mutex};

use isograd_runtime::Column;
use libtest_mimic::{Arguments, Failed, Trial};
use tempfile::TempDir;

use browser::Browser;
use cases::{Case, Prepared};

/// What was compared: engine, program, points, numbers.
type Compared = Arc<Mutex<Vec<(&'static str, &'static str, usize, usize)>>>;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let compared = Compared::default();
    let required = std::env::var("ISOGRAD_REQUIRE_CHROMIUM").is_ok_and(|x| x == "1");
    let browser = Browser::find();
    if let Err(why) = &browser {
        println!("web: {why}; {}", if required { "ISOGRAD_REQUIRE_CHROMIUM=1 demands it" } else { "pages skipped" });
    }
    let node = Command::new("node").arg("--version").output().is_ok_and(|o| o.status.success());
    if !node {
        println!("web: there is no `node` on PATH; evaluate.js in Node skipped");
    }

    let mut trials = Vec::new();
    for case in cases::ALL {
        let (browser, counted) = (browser.clone(), compared.clone());
        let skipped = browser.is_err() && !required;
        let page = Trial::test(format!("chromium/{}", case.name), move || in_chromium(case, &browser?, &counted));
        trials.push(page.with_ignored_flag(skipped));
        let counted = compared.clone();
        let script = Trial::test(format!("node/{}", case.name), move || in_node(case, &counted));
        trials.push(script.with_ignored_flag(!node));
    }
    let skipped = browser.is_err() && !required;
    let found = browser.clone();
    trials.push(Trial::test("chromium/picture", move || picture(&found?)).with_ignored_flag(skipped));
    trials.push(Trial::test("chromium/errors", move || errors(&browser?)).with_ignored_flag(skipped));

    let conclusion = libtest_mimic::run(&arguments, trials);
    let mut rows = compared.lock().expect("no panic holds it").clone();
    rows.sort_unstable();
    for (engine, program, points, numbers) in rows {
        println!("{engine:>8}  {program:<12} {points:>6} points  {numbers:>7} numbers  bit-equal to the runtime");
    }
    conclusion.exit_code()
}

/// The page and a module in a new folder.
fn site(prepared: &Prepared) -> Result<TempDir, Failed> {
    let folder = tempfile::tempdir()?;
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/web");
    for name in ["index.html", "evaluate.js"] {
        fs::copy(web.join(name), folder.path().join(name)).map_err(|e| format!("docs/web/{name}: {e}"))?;
    }
    fs::write(folder.path().join("field.wasm"), &prepared.artefact.bytes)?;
    Ok(folder)
}

fn in_chromium(case: &'static Case, browser: &Browser, compared: &Compared) -> Result<(), Failed> {
    let prepared = Prepared::new(case);
    let folder = site(&prepared)?;
    let mut address = "index.html?".to_owned();
    let (listed, spelled): (Vec<_>, Vec<_>) = prepared.inputs.iter().partition(|(_, x)| case.file && x.len() > 1);
    if case.file {
        fs::write(folder.path().join("points.csv"), csv(&listed, prepared.points))?;
        address.push_str("points=points.csv&");
    }
    for (name, numbers) in spelled {
        let numbers: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
        let _ = write!(address, "{name}={}&", numbers.join(","));
    }
    let document = browser.document(folder.path(), &address)?;
    let rows = table(&document)?;
    let varying = prepared.varying();
    let (heads, rows) = rows.split_first().ok_or("the page has no table")?;
    if heads[varying..] != prepared.titles() {
        return Err(format!("columns {:?} instead of {:?}", &heads[varying..], prepared.titles()).into());
    }
    if rows.len() != prepared.points {
        return Err(format!("{} lines for {} points", rows.len(), prepared.points).into());
    }
    let mut numbers = 0;
    for (i, row) in rows.iter().enumerate() {
        for (k, (text, column)) in row[varying..].iter().zip(&prepared.outputs).enumerate() {
            if !is(text, column, i) {
                let title = &heads[varying + k];
                return Err(format!("{title} of point {i}: {text}; the runtime: {:?}", column.get(i)).into());
            }
            numbers += 1;
        }
    }
    compared.lock().expect("no panic holds it").push(("Chromium", case.name, prepared.points, numbers));
    Ok(())
}

/// Columns as a file of points.
fn csv(columns: &[&(String, Vec<f64>)], points: usize) -> String {
    let mut text = columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(",");
    for i in 0..points {
        let row: Vec<String> = columns.iter().map(|(_, x)| format!("{:?}", x[i])).collect();
        text.push('\n');
        text.push_str(&row.join(","));
    }
    text
}

/// Whether a text reads as the number of a point, to the bit. All NaN of a module have all bits set.
fn is(text: &str, column: &Column, point: usize) -> bool {
    match column {
        Column::F32(x) => {
            let (x, read) = (x[point], text.parse::<f32>());
            read.is_ok_and(|r| r.to_bits() == x.to_bits() || (r.is_nan() && x.to_bits() == u32::MAX))
        }
        Column::F64(x) => {
            let (x, read) = (x[point], text.parse::<f64>());
            read.is_ok_and(|r| r.to_bits() == x.to_bits() || (r.is_nan() && x.to_bits() == u64::MAX))
        }
        Column::I32(x) => text.parse() == Ok(x[point]),
    }
}

/// The cells of the page's table, its head first.
fn table(document: &str) -> Result<Vec<Vec<String>>, Failed> {
    let between = |start: &str, end: &str| document.split_once(start)?.1.split_once(end).map(|(text, _)| text);
    match between("<p id=\"status\">", "</p>") {
        Some("done") => {}
        Some(other) => return Err(format!("the page says: {other}").into()),
        None => return Err(format!("this is not the page: {document:.400}").into()),
    }
    let rows = between("<table id=\"values\">", "</table>").ok_or("the page has no table")?;
    let cells = |row: &str| {
        row.split("</")
            .filter_map(|cell| cell.rsplit_once("<th>").or(cell.rsplit_once("<td>")))
            .map(|c| c.1.to_owned())
            .collect()
    };
    Ok(rows.split("</tr>").filter(|row| row.contains("<tr>")).map(cells).collect())
}

/// Prints the bytes of each output column in hexadecimal.
const SCRIPT: &str = r#"
import { readFileSync } from "node:fs";
import { load } from "./evaluate.js";

const { evaluate } = await load(readFileSync("field.wasm"));
const inputs = JSON.parse(readFileSync("inputs.json"));
for (const name in inputs) inputs[name] = inputs[name].map((text) => Number(text.replace("inf", "Infinity")));
for (const columns of Object.values(evaluate(inputs))) {
    for (const values of Object.values(columns)) console.log(Buffer.from(values.buffer).toString("hex"));
}
for (const name in inputs) {
    try {
        evaluate({ ...inputs, [name]: undefined });
        console.log("optional", name);
    } catch (error) {
        console.log("required", error.message);
    }
}
"#;

fn in_node(case: &'static Case, compared: &Compared) -> Result<(), Failed> {
    let prepared = Prepared::new(case);
    let folder = site(&prepared)?;
    let texts = |x: &[f64]| -> Vec<String> { x.iter().map(|x| format!("{x:?}")).collect() };
    let inputs: serde_json::Map<_, _> =
        prepared.inputs.iter().map(|(name, x)| (name.clone(), texts(x).into())).collect();
    fs::write(folder.path().join("inputs.json"), serde_json::to_vec(&inputs)?)?;
    fs::write(folder.path().join("package.json"), r#"{"type": "module"}"#)?;
    fs::write(folder.path().join("main.js"), SCRIPT)?;
    let output = Command::new("node").arg("main.js").current_dir(folder.path()).output()?;
    if !output.status.success() {
        return Err(format!("node: {}\n{}", output.status, String::from_utf8_lossy(&output.stderr)).into());
    }
    let printed = String::from_utf8(output.stdout)?;
    let (columns, inputs) = printed.lines().partition::<Vec<_>, _>(|line| !line.contains(' '));
    let wanted: Vec<String> = prepared.outputs.iter().map(hexadecimal).collect();
    for (k, title) in prepared.titles().iter().enumerate() {
        if columns.get(k).copied() != Some(&wanted[k]) {
            return Err(format!("the bytes of {title} are not those of the runtime").into());
        }
    }
    for ((name, _), said) in prepared.inputs.iter().zip(inputs) {
        let wanted = match prepared.has_default(name) {
            true => format!("optional {name}"),
            false => format!("required the input `{name}` is not given"),
        };
        if said != wanted {
            return Err(format!("without {name}: {said}").into());
        }
    }
    let numbers = prepared.outputs.iter().map(Column::len).sum();
    compared.lock().expect("no panic holds it").push(("Node", case.name, prepared.points, numbers));
    Ok(())
}

fn hexadecimal(column: &Column) -> String {
    let bytes: Vec<u8> = match column {
        Column::F32(x) => x.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Column::F64(x) => x.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Column::I32(x) => x.iter().flat_map(|x| x.to_le_bytes()).collect(),
    };
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// A disc of radius 1 fills π ∕ 16 of the square from −2 to 2, and outside of it the left is brighter than the right.
fn picture(browser: &Browser) -> Result<(), Failed> {
    let prepared = Prepared::new(&cases::ALL[0]);
    let folder = site(&prepared)?;
    let shot: PathBuf = folder.path().join("shot.png");
    browser.screenshot(folder.path(), "index.html?at.x=0&at.y=0&at.z=0&radius=1&slice=2", &shot)?;
    let image = image::open(&shot)?.to_rgb8();
    let coloured: Vec<(u32, [u8; 3])> = image
        .enumerate_pixels()
        .map(|(x, _, pixel)| (x, pixel.0))
        .filter(|(_, [r, g, b])| r.max(g).max(b) - r.min(g).min(b) > 40)
        .collect();
    let inside = coloured.iter().filter(|(_, [r, _, b])| b > r).count();
    let share = inside as f64 / coloured.len() as f64;
    let exact = std::f64::consts::PI / 16.0;
    if coloured.len() < 100_000 || (share - exact).abs() > 0.005 {
        return Err(format!("{} coloured pixels, {share} of them inside; {exact} is right", coloured.len()).into());
    }
    let ends = coloured.iter().map(|(x, _)| *x);
    let middle = (ends.clone().min().unwrap_or(0) + ends.max().unwrap_or(0)) / 2;
    let red = |left: bool| -> u64 {
        let outside = coloured.iter().filter(|(x, [r, _, b])| r > b && (*x < middle) == left);
        outside.map(|(_, [r, ..])| u64::from(*r)).sum()
    };
    if red(true) <= red(false) * 6 / 5 {
        return Err(format!("no shading: {} on the left, {} on the right", red(true), red(false)).into());
    }
    Ok(())
}

/// The page says what is wrong with an address.
fn errors(browser: &Browser) -> Result<(), Failed> {
    let folder = site(&Prepared::new(&cases::ALL[0]))?;
    for (address, wanted) in [
        ("index.html?at.x=0&at.y=0", "the input `at.z` is not given"),
        ("index.html?at.x=0&at.y=0&at.z=0&radius=1,2", "the input `radius` has 2 numbers; it must have 1"),
        ("index.html?at.x=0&at.y=0,1&at.z=0,1,2&radius=1", "the input `at.y` has 2 numbers; it must have 1 or 3"),
        ("index.html?module=none.wasm", "none.wasm: 404 Not Found"),
    ] {
        let document = browser.document(folder.path(), address)?;
        if !document.contains(&format!("<p id=\"status\">{wanted}</p>")) {
            return Err(format!("{address}: not `{wanted}` but {:?}", table(&document)).into());
        }
    }
    Ok(())
}
