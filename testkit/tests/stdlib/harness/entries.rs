//! The entries of the library as their files declare and document them, and what holds of every file. Knows nothing of
//! what they compute.

use std::fmt::Write as _;

use isograd_compiler::{DerivativeMode, Precision, Query, standard_library};
use isograd_graph::Value;

use crate::support::{self, Varying};

/// Files that declare no entry.
const OTHERS: [&str; 2] = ["concepts", "prelude"];

/// One file's entity, operation or function.
pub struct Entry {
    /// The file's name.
    pub stem: String,
    pub name: String,
    /// `entity`, `operation` or `fn`.
    pub word: String,
    /// Without `;` or body.
    pub declaration: String,
    /// The comment's text in one line; paragraphs are joined by line ends.
    pub doc: String,
    text: String,
}

/// All entries, in the order of the prelude.
pub fn all() -> Vec<Entry> {
    let files = standard_library();
    let (_, prelude) = files.iter().find(|(name, _)| name == "prelude.vola").expect("the prelude");
    let place = |stem: &str| prelude.lines().position(|line| line == format!("module self::{stem};"));
    let mut entries: Vec<Entry> = files
        .iter()
        .map(|(file, text)| (file.trim_end_matches(".vola"), text))
        .filter(|(stem, _)| !OTHERS.contains(stem))
        .map(|(stem, text)| entry(stem, text))
        .collect();
    entries.sort_by_key(|entry| place(&entry.stem).unwrap_or(usize::MAX));
    entries
}

/// A file's entry is its first documented declaration.
fn entry(stem: &str, text: &str) -> Entry {
    let mut doc = String::new();
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("///") {
            match rest.trim() {
                "" => doc.push('\n'),
                rest if doc.is_empty() || doc.ends_with('\n') => doc += rest,
                rest => doc = doc + " " + rest,
            }
            continue;
        }
        let word = line.split(' ').next().unwrap_or_default();
        if !doc.is_empty() && ["entity", "operation", "fn"].contains(&word) {
            let declaration = line.trim_end_matches([';', '{', ' ']).to_owned();
            let name = declaration.split([' ', '(']).nth(1).unwrap_or_default().to_owned();
            let (stem, text) = (stem.to_owned(), text.to_owned());
            return Entry { stem, name, word: word.to_owned(), declaration, doc, text };
        }
        if !line.starts_with('#') {
            doc.clear();
        }
    }
    panic!("stdlib/{stem}.vola has no documented declaration");
}

impl Entry {
    pub fn is_function(&self) -> bool {
        self.word == "fn"
    }

    /// What the comment says after `Class`, up to the next sentence on something else.
    pub fn class(&self) -> &str {
        let after = self.doc.split_once("Class").map_or("", |(_, after)| after);
        until(after.trim_start_matches([':', ' ']), &["Needs:", "Source:", "Colour:", "Lipschitz:", "\n"])
    }

    /// What the comment says after a word and a colon.
    pub fn said(&self, word: &str) -> &str {
        let after = self.doc.split_once(&format!("{word}:")).map_or("", |(_, after)| after);
        until(after, &["Class", "Needs:", "Source:", "Colour:", "\n"])
    }

    /// Names and types of the parameters.
    fn parameters(&self) -> Vec<(&str, &str)> {
        let list = self.declaration.split_once('(').and_then(|(_, rest)| rest.split_once(')'));
        let list = list.map_or("", |(list, _)| list);
        list.split(", ")
            .filter_map(|p| p.split_once(": "))
            .map(|(n, t)| (n, t.split(' ').next().unwrap_or(t)))
            .collect()
    }

    /// The operands that the first impl names.
    fn operands(&self) -> usize {
        let start = format!("impl {}<", self.name);
        let list = self.text.split_once(&start).and_then(|(_, rest)| rest.split_once('>'));
        list.map_or(0, |(list, _)| list.split(',').count())
    }
}

fn until<'t>(text: &'t str, ends: &[&str]) -> &'t str {
    let end = ends.iter().filter_map(|end| text.find(end)).min().unwrap_or(text.len());
    text[..end].trim().trim_end_matches('.')
}

/// Some argument of a type.
fn argument(ty: &str) -> Result<&'static str, String> {
    Ok(match ty {
        "real" => "0.5",
        "int" => "1",
        "vec2" => "[0.5, 0.25]",
        "vec3" => "[0.5, 0.25, 0.75]",
        "quat" => "quat([0.0, 0.0, 1.0], 0.5)",
        _ => return Err(format!("no argument of type {ty} is known here")),
    })
}

/// The file, imported alone, brings all it needs, under both names of the library.
pub fn stands_alone(entry: &Entry) -> Result<(), String> {
    for library in ["std", "stdlib"] {
        let source = format!("module {library}::{};\nexport fn f(p: vec3) -> real {{ p.x }}", entry.stem);
        let checked = support::check(&source);
        if !checked.diagnostics.is_empty() {
            return Err(support::listed(&checked.diagnostics));
        }
        support::compile(&checked, "f").map_err(|e| support::listed(&e))?;
    }
    Ok(())
}

/// The prelude imports each file once, and nothing else.
pub fn prelude_imports(entries: &[Entry]) -> Result<(), String> {
    let files = standard_library();
    let (_, prelude) = files.iter().find(|(name, _)| name == "prelude.vola").ok_or("no prelude")?;
    let mut imports: Vec<&str> = prelude.lines().filter(|line| line.starts_with("module ")).collect();
    let stems = entries.iter().map(|entry| entry.stem.as_str()).chain(["concepts"]);
    let mut wanted: Vec<String> = stems.map(|stem| format!("module self::{stem};")).collect();
    imports.sort_unstable();
    wanted.sort_unstable();
    let missing: Vec<&String> = wanted.iter().filter(|line| !imports.contains(&line.as_str())).collect();
    if imports == wanted { Ok(()) } else { Err(format!("the prelude lacks {missing:?} or has too many lines")) }
}

/// Each concept says what it is and where it is from.
pub fn concepts_are_documented() -> Result<(), String> {
    let files = standard_library();
    let (_, text) = files.iter().find(|(name, _)| name == "concepts.vola").ok_or("no concepts")?;
    let mut doc = String::new();
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("///") {
            doc += rest;
        } else if line.starts_with("concept ") {
            if !doc.contains("Source:") {
                return Err(format!("no source: {line}"));
            }
            doc.clear();
        }
    }
    Ok(())
}

/// A program's own declaration of the same name wins, with a warning (LANGUAGE 10.5).
pub fn yields(entry: &Entry) -> Result<(), String> {
    let Entry { name, word, declaration, .. } = entry;
    let arguments = entry.parameters().iter().map(|(_, ty)| argument(ty)).collect::<Result<Vec<_>, _>>()?.join(", ");
    let mut source = String::from("module std::prelude;\n");
    let built = if entry.is_function() {
        let head = declaration.split_once(" ->").map_or(declaration.as_str(), |(head, _)| head);
        let _ = writeln!(source, "{head} -> real {{ 42.0 }}");
        format!("p.x + {name}({arguments})")
    } else {
        let names: Vec<String> = (0..entry.operands()).map(|k| format!("o{k}")).collect();
        let operands = if names.is_empty() { String::new() } else { format!("<{}>", names.join(", ")) };
        let blocks = "{ Own() }".repeat(names.len());
        let _ = writeln!(source, "{declaration};\nentity Own();");
        let _ = writeln!(source, "impl {name}{operands} for Sdf3d(place) {{ place.x + 42.0 }}");
        format!("csg tree = {name}({arguments}){blocks};\n    eval tree.Sdf3d(p)")
    };
    let _ = writeln!(source, "export fn f(p: vec3) -> real {{\n    {built}\n}}");
    let checked = support::check(&source);
    let hides =
        checked.diagnostics.iter().any(|d| d.code.name() == "W0301" && d.message.contains(&format!("`{name}`")));
    if !checked.is_ok() || !hides {
        return Err(format!("no W0301 for this {word}, or more: {}\n{source}", support::listed(&checked.diagnostics)));
    }
    let point = [0.5, 2.0, 3.0].map(Value::Real).to_vec();
    let f = support::export(&checked, "f");
    let results =
        support::wasm(&checked, f, &[Query::Value], Precision::F64, DerivativeMode::Auto, Varying::First, &[point])?;
    let result = results.first().and_then(|row| row.first()).copied().map(support::number);
    if result == Some(42.5) { Ok(()) } else { Err(format!("the library's was used: {result:?}\n{source}")) }
}
