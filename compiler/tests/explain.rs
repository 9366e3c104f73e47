//! Holds every page of `docs/diagnostics/` to what it claims: its failing example raises its code and no other
//! error, its mended one compiles. What a user sees of each failing example is a snapshot; bless with
//! `INSTA_UPDATE=always`. Knows nothing of how diagnostics come about.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use isograd_compiler::{
    Checked, Code, Diagnostic, Differentiability, Limits, Loader, MemoryLoader, ModulePath, Options, Precision, Query,
    Request, Target, Watch, check, compile, explain, render,
};

/// Codes that no program is known to raise, with the reason.
const WITHOUT_EXAMPLE: &[(Code, &str)] = &[(Code::E1103, "a program that raises it shows a bug, which is then mended")];

const PAGES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/diagnostics");
const SNAPSHOTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/snapshots");

/// A page, taken apart.
#[derive(Debug, Default)]
struct Page {
    title: String,
    text: String,
    /// Sections in order: heading, text outside of fences, examples.
    sections: Vec<(String, String, Vec<String>)>,
}

impl Page {
    fn of(code: Code) -> Self {
        let mut page = Self::default();
        let mut example: Option<String> = None;
        for line in explain(code).lines() {
            if let Some(source) = &mut example {
                if line == "```" {
                    let (.., examples) = page.sections.last_mut().unwrap_or_else(|| panic!("{code}: early example"));
                    examples.extend(example.take());
                } else {
                    source.push_str(line);
                    source.push('\n');
                }
            } else if line.starts_with("```") {
                assert_eq!(line, "```vola", "{code}: an example in another language");
                example = Some(String::new());
            } else if let Some(heading) = line.strip_prefix("## ") {
                page.sections.push((heading.to_owned(), String::new(), Vec::new()));
            } else if let Some(title) = line.strip_prefix("# ") {
                assert!(page.title.is_empty(), "{code}: two titles");
                page.title = title.to_owned();
            } else {
                let text = page.sections.last_mut().map_or(&mut page.text, |(_, text, _)| text);
                text.push_str(line);
                text.push('\n');
            }
        }
        assert!(example.is_none(), "{code}: an example that does not end");
        page
    }

    fn section(&self, heading: &str) -> Option<&(String, String, Vec<String>)> {
        self.sections.iter().find(|s| s.0 == heading)
    }

    fn example(&self, heading: &str) -> Example {
        let (_, _, examples) = self.section(heading).unwrap_or_else(|| panic!("{}: no `{heading}`", self.title));
        assert_eq!(examples.len(), 1, "{}: examples in `{heading}`", self.title);
        Example::parse(&examples[0])
    }

    /// What the page refers to: codes and their titles.
    fn see_also(&self) -> Vec<(String, String)> {
        let lines = self.section("See also").map_or("", |s| &s.1).lines().filter(|l| !l.is_empty());
        let entry = |line: &str| {
            let (code, title) = line.strip_prefix("* ")?.split_once(": ")?;
            Some((code.to_owned(), title.to_owned()))
        };
        lines.map(|l| entry(l).unwrap_or_else(|| panic!("{}: `{l}` is no `* CODE: title`", self.title))).collect()
    }
}

/// An example: its files and what surrounds them.
#[derive(Debug, Default)]
struct Example {
    files: BTreeMap<String, Vec<u8>>,
    libraries: Vec<String>,
    limits: Limits,
    queries: Vec<Query>,
    precision: Precision,
    differentiability: Differentiability,
    target: Target,
}

const ENTRY: &str = "main.vola";

impl Example {
    fn parse(text: &str) -> Self {
        let mut this = Self::default();
        let (mut name, mut last) = (ENTRY, Vec::new());
        for line in text.lines() {
            let Some(directive) = line.strip_prefix("//@ ") else {
                let file = this.files.entry(name.to_owned()).or_default();
                file.extend_from_slice(line.as_bytes());
                file.push(b'\n');
                continue;
            };
            let (verb, value) = directive.split_once(' ').unwrap_or_else(|| panic!("`{line}`"));
            match verb {
                "file" => name = value,
                "library" => this.libraries.push(value.to_owned()),
                "limit" => {
                    let (limit, value) = value.split_once('=').expect("NAME=VALUE");
                    let limit = Limits::ALL.iter().find(|l| l.name == limit).expect("a limit");
                    (limit.set)(&mut this.limits, value.parse().expect("a number"));
                }
                "query" => this.queries.push(value.parse().expect("a query")),
                "precision" => {
                    this.precision = match value {
                        "f32" => Precision::F32,
                        "f64" => Precision::F64,
                        _ => panic!("precision `{value}`"),
                    }
                }
                "differentiability" => {
                    let named = Differentiability::ALL.into_iter().find(|d| d.name() == value);
                    this.differentiability = named.unwrap_or_else(|| panic!("differentiability `{value}`"));
                }
                "target" => {
                    let named = Target::ALL.into_iter().find(|t| t.name() == value);
                    this.target = named.unwrap_or_else(|| panic!("target `{value}`"));
                }
                "byte" => {
                    let digits = value.strip_prefix("0x").expect("0xFF");
                    last.push(u8::from_str_radix(digits, 16).expect("a byte"));
                }
                _ => panic!("unknown directive `{line}`"),
            }
        }
        if let Some(main) = this.files.get_mut(ENTRY).filter(|_| !last.is_empty()) {
            main.pop();
            main.extend(last);
        }
        this
    }

    /// What checking the program and compiling each of its exports says, in order, each thing once.
    fn run(&self) -> (Checked, Vec<Diagnostic>) {
        let options = Options { limits: self.limits, verify: true };
        let entry = self.files.get(ENTRY).cloned().unwrap_or_default();
        let checked = check(ENTRY, entry, self, &options, self);
        let mut found = checked.diagnostics.clone();
        for export in checked.exports() {
            let queries = if self.queries.is_empty() { vec![Query::Value] } else { self.queries.clone() };
            let request = Request {
                export: export.name,
                queries,
                precision: self.precision,
                differentiability: self.differentiability,
                target: self.target,
                ..Request::default()
            };
            let more = compile(&checked, &request, &options, self).map_or_else(|errors| errors, |a| a.warnings);
            found.extend(more);
        }
        let mut distinct: Vec<Diagnostic> = Vec::new();
        for diagnostic in found {
            if !distinct.contains(&diagnostic) {
                distinct.push(diagnostic);
            }
        }
        (checked, distinct)
    }
}

impl Watch for Example {
    fn expired(&self) -> bool {
        self.limits.compile_time_ms == 0
    }
}

impl Loader for Example {
    fn libraries(&self) -> Vec<String> {
        self.libraries.clone()
    }

    fn allows(&self, at: &ModulePath) -> bool {
        at.library.is_some() || at.ups == 0
    }

    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String> {
        let base = at.library.clone().unwrap_or_default();
        let files = self.files.clone();
        MemoryLoader { files, base }.read(&ModulePath { library: None, ..at.clone() })
    }
}

fn has_example(code: Code) -> bool {
    WITHOUT_EXAMPLE.iter().all(|(c, _)| *c != code)
}

/// Collects what is wrong with every page, so that one run shows all of it.
fn for_each_page(mut examine: impl FnMut(Code, &Page) -> Result<(), String>) {
    let wrong: Vec<String> =
        Code::ALL.iter().filter_map(|&c| examine(c, &Page::of(c)).err().map(|e| format!("{c}: {e}"))).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn every_page_has_its_parts() {
    for_each_page(|code, page| {
        let (wanted, title) = (format!("{code}: {}", code.title()), &page.title);
        if *title != wanted {
            return Err(format!("the title is `{title}`, not `{wanted}`"));
        }
        if page.text.trim().len() < 80 {
            return Err("the rule is not explained".to_owned());
        }
        let headings: Vec<&str> = page.sections.iter().map(|s| s.0.as_str()).collect();
        let (parts, rest) = headings.split_at(headings.len().min(if has_example(code) { 2 } else { 0 }));
        if has_example(code) && parts != ["Fails", "Mended"] || !matches!(rest, [] | ["See also"]) {
            return Err(format!("the sections are {headings:?}"));
        }
        for (other, title) in page.see_also() {
            let refers = other.parse::<Code>().map_err(|e| e.to_string())?;
            if title != refers.title() || refers == code {
                return Err(format!("`See also` says `{other}: {title}`"));
            }
        }
        Ok(())
    });
}

#[test]
fn failing_examples_raise_their_code_and_no_other_error() {
    for_each_page(|code, page| {
        if !has_example(code) {
            return Ok(());
        }
        let (checked, found) = page.example("Fails").run();
        let related: BTreeSet<String> = page.see_also().into_iter().map(|(c, _)| c).collect();
        let allowed = |d: &Diagnostic| d.code == code || related.contains(d.code.name());
        if found.iter().any(|d| d.code == code) && found.iter().all(allowed) {
            return Ok(());
        }
        Err(format!("the failing example says\n{}", render::terminal(&found, &checked.files, false)))
    });
}

#[test]
fn mended_examples_compile_without_a_word() {
    for_each_page(|code, page| {
        if !has_example(code) {
            return Ok(());
        }
        let (checked, found) = page.example("Mended").run();
        if found.is_empty() {
            return Ok(());
        }
        Err(format!("the mended example says\n{}", render::terminal(&found, &checked.files, false)))
    });
}

#[test]
fn what_a_user_sees_is_as_recorded() {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path(SNAPSHOTS);
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| {
        for &code in Code::ALL.iter().filter(|c| has_example(**c)) {
            let (checked, found) = Page::of(code).example("Fails").run();
            insta::assert_snapshot!(code.name(), render::terminal(&found, &checked.files, false));
        }
    });
}

/// The stems of a folder's files; snapshots that wait to be accepted do not count.
fn stems(folder: &str, extension: &str) -> BTreeSet<String> {
    let files = std::fs::read_dir(Path::new(folder)).expect("the folder");
    let names = files.map(|f| f.expect("a file").file_name().into_string().expect("a plain name"));
    let settled = names.filter(|n| !n.ends_with(".snap.new"));
    settled.map(|n| n.strip_suffix(extension).unwrap_or_else(|| panic!("{folder}/{n}")).to_owned()).collect()
}

#[test]
fn every_page_and_snapshot_has_its_code() {
    let codes = |wanted: fn(Code) -> bool| -> BTreeSet<String> {
        Code::ALL.iter().filter(|c| wanted(**c)).map(|c| c.name().to_owned()).collect()
    };
    let strays = |folder: &str, extension: &str, codes: BTreeSet<String>| -> Vec<String> {
        stems(folder, extension).symmetric_difference(&codes).cloned().collect()
    };
    assert_eq!(strays(PAGES, ".md", codes(|_| true)), [""; 0], "pages");
    assert_eq!(strays(SNAPSHOTS, ".snap", codes(has_example)), [""; 0], "snapshots");
}
