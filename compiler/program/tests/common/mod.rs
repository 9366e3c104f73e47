//! What the tests share: an in-memory loader and the prelude of LANGUAGE 21. Knows no expectations.
#![allow(dead_code, reason = "each test file uses its part")]

use std::collections::BTreeMap;

use isograd_program::{Checked, Loaded, Loader, ModulePath, check, load};
use isograd_syntax::{Diagnostic, Limits};

/// The items in front of the acceptance examples (LANGUAGE 21).
pub const PRELUDE: &str = "
concept D: real -> real;
concept V: real -> vec2;
concept Tone: real -> real;

entity Line();
entity Square();
entity Five();
entity Shift(k: real);
entity Plus(k: real);
operation Add();
operation Inc();
operation Tag(t: real);
operation Along(pos: real, time: real);

impl Line for D(x) { x }
impl Square for D(x) { x * x }
impl Five for D(x) { 5.0 }
impl Shift for D(x) { x - k }
impl Plus for D(x) { x + k }
impl Add<a, b> for D(x) { eval a.D(x) + eval b.D(x) }
impl Inc<sub> for D(x) { 1.0 + eval sub.D(x) }
impl Tag<sub> for Tone(x) { t }
impl Along<sub> for V(x) {
    let v = diff(pos, time);
    let a = diff(v, time);
    [v - 4.0, a]
}
fn sq(a: real) -> real { a * a }
fn sign(x: real) -> real { 7.0 }
fn dprod(a: real, b: real) -> real { diff(a * b, a) }
fn twice(c: csg) -> csg { Add(){ c }{ c } }
";

/// Files by the name that is shown for them.
#[derive(Default)]
pub struct Memory {
    pub files: BTreeMap<String, Vec<u8>>,
    pub libraries: Vec<String>,
    pub confined: bool,
}

impl Memory {
    pub fn new(files: &[(&str, &str)], libraries: &[&str]) -> Self {
        Self {
            files: files.iter().map(|(n, t)| ((*n).to_owned(), t.as_bytes().to_vec())).collect(),
            libraries: libraries.iter().map(|l| (*l).to_owned()).collect(),
            confined: false,
        }
    }
}

impl Loader for Memory {
    fn libraries(&self) -> Vec<String> {
        self.libraries.clone()
    }

    fn canonical(&self, library: &str) -> String {
        if library == "stdlib" { "std".to_owned() } else { library.to_owned() }
    }

    fn allows(&self, at: &ModulePath) -> bool {
        !self.confined || at.ups == 0
    }

    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String> {
        let mut name = at.library.as_ref().map_or(String::new(), |l| format!("{l}/"));
        name.push_str(&"../".repeat(at.ups as usize));
        name.push_str(&at.path.join("/"));
        self.files.get(&name).cloned().ok_or_else(|| format!("tried {name}"))
    }
}

/// Loads and checks a program of one file.
pub fn check_text(text: &str) -> (Loaded, Checked) {
    check_files(text, &Memory::default())
}

/// Loads and checks a program whose imports the loader answers.
pub fn check_files(text: &str, loader: &Memory) -> (Loaded, Checked) {
    let limits = Limits::default();
    let loaded = load("main.vola", text.as_bytes().to_vec(), loader, &limits);
    let checked = check(&loaded, &limits);
    (loaded, checked)
}

/// The codes of all diagnostics, those of loading first.
pub fn codes(loaded: &Loaded, checked: &Checked) -> String {
    let names: Vec<&str> = loaded.diagnostics.iter().chain(&checked.diagnostics).map(|d| d.code.name()).collect();
    names.join(" ")
}

/// Everything a diagnostic says, for searching.
pub fn said(diagnostic: &Diagnostic) -> String {
    let labels: Vec<&str> = diagnostic.labels.iter().map(|l| l.text.as_str()).collect();
    format!(
        "{} {} | {} | {} | {}",
        diagnostic.code.name(),
        diagnostic.message,
        labels.join("; "),
        diagnostic.notes.join("; "),
        diagnostic.help.as_deref().unwrap_or("")
    )
}
