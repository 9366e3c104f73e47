//! Programs as the service knows them: files and an entry, their id, and what the compiler says of them.
//! Knows nothing of HTTP or of where programs are kept.

use std::collections::BTreeMap;

use isograd_compiler::{
    Checked, Code, Diagnostic, Loader, Malformed, MemoryLoader, ModulePath, Options, check, inspect, rewrite,
};
use serde_json::{Value, json};

use crate::libraries::Libraries;
use crate::watch::Stopwatch;
use crate::{describe, pages};

/// The files of a program, by normalised path, and which of them is the entry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The entry file's path.
    pub entry: String,
    /// All files.
    pub files: BTreeMap<String, String>,
}

impl Source {
    /// Normalises the paths and finds the entry, which may be left out if there is one file.
    ///
    /// # Errors
    /// If a path is no relative path of a `.vola` file, two are the same, or the entry is not there.
    pub fn new(given: BTreeMap<String, String>, entry: Option<&str>) -> Result<Self, Vec<Diagnostic>> {
        let mut files = BTreeMap::new();
        let mut errors = Vec::new();
        for (path, text) in given {
            match normalise(&path) {
                Err(diagnostic) => errors.push(diagnostic),
                Ok(normal) if files.contains_key(&normal) => errors.push(
                    Diagnostic::global(Code::E0308, format!("`{path}` is another spelling of the file `{normal}`"))
                        .help("give each file once"),
                ),
                Ok(normal) => {
                    files.insert(normal, text);
                }
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let names: Vec<String> = files.keys().map(|f| format!("`{f}`")).collect();
        let listed = if names.is_empty() { "no files".to_owned() } else { names.join(", ") };
        let entry = match (entry, files.keys().next()) {
            (Some(entry), _) => normalise(entry).map_err(|d| vec![d])?,
            (None, Some(only)) if files.len() == 1 => only.clone(),
            (None, _) => {
                return Err(vec![
                    Diagnostic::global(Code::E0307, "the program has no entry file")
                        .note(format!("the program has {listed}"))
                        .help("name the file to start from in `entry`"),
                ]);
            }
        };
        if !files.contains_key(&entry) {
            return Err(vec![
                Diagnostic::global(Code::E0307, format!("the entry file `{entry}` is not among the files"))
                    .note(format!("the program has {listed}")),
            ]);
        }
        Ok(Self { entry, files })
    }

    /// BLAKE3 of the canonical form, hexadecimal: the entry's path, then every file's path and text in the order of
    /// the paths, each preceded by its length as 8 little-endian bytes.
    #[must_use]
    pub fn id(&self) -> String {
        let mut hasher = blake3::Hasher::new_derive_key("isograd program v1");
        let mut add = |text: &str| {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        add(&self.entry);
        for (path, text) in &self.files {
            add(path);
            add(text);
        }
        hasher.finalize().to_hex().to_string()
    }

    /// Bytes of all texts.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.files.values().map(String::len).sum()
    }

    /// The text of the entry file.
    #[must_use]
    pub fn text(&self) -> &str {
        self.files.get(&self.entry).map_or("", String::as_str)
    }

    /// The entry file formatted and, if that is wanted, in the current dialect.
    ///
    /// # Errors
    /// Its errors.
    pub fn rewritten(&self, migrate: bool, libraries: &Libraries, options: &Options) -> Result<String, Malformed> {
        let loader = self.loader(libraries);
        let migrating = migrate.then_some(&loader as &dyn Loader);
        let watch = Stopwatch::start(&options.limits);
        rewrite(&self.entry, self.text().to_owned().into_bytes(), migrating, options, &watch)
    }

    /// What finds the files that the entry file imports.
    fn loader<'a>(&self, libraries: &'a Libraries) -> Confined<'a> {
        let files = self.files.iter().map(|(path, text)| (path.clone(), text.clone().into_bytes())).collect();
        let base = self.entry.rsplit_once('/').map_or("", |(directory, _)| directory).to_owned();
        Confined { program: MemoryLoader { files, base }, libraries }
    }
}

/// `./a//b.vola` is `a/b.vola`; what leaves the program's directory or is no Vola file is an error.
fn normalise(path: &str) -> Result<String, Diagnostic> {
    const LONGEST: usize = 1024;
    let shown: String = path.chars().take(200).collect();
    let error = |message: &str| {
        Diagnostic::global(Code::E0308, format!("`{shown}` {message}"))
            .help("paths are relative to the program, with `/` between directories: `shapes/ball.vola`")
    };
    if path.len() > LONGEST {
        return Err(error("is too long for a path"));
    }
    if path.starts_with('/') || path.contains('\\') || path.contains(':') {
        return Err(error("is no relative path"));
    }
    if path.chars().any(char::is_control) {
        return Err(error("has control characters"));
    }
    let parts: Vec<&str> = path.split('/').filter(|p| !p.is_empty() && *p != ".").collect();
    if parts.contains(&"..") {
        return Err(error("leaves the program's directory"));
    }
    match parts.last().and_then(|file| file.strip_suffix(".vola")) {
        Some(stem) if !stem.is_empty() => Ok(parts.join("/")),
        _ => Err(error("is no `.vola` file")),
    }
}

/// A checked program.
#[derive(Debug)]
pub struct Program {
    /// Its id.
    pub id: String,
    /// Its files.
    pub source: Source,
    /// What the compiler made of them.
    pub checked: Checked,
    /// Errors and warnings, those of compiling each export included.
    pub diagnostics: Vec<Diagnostic>,
}

impl Program {
    /// Checks a program.
    #[must_use]
    pub fn check(source: Source, libraries: &Libraries, options: &Options) -> Self {
        let loader = source.loader(libraries);
        let entry = source.text().to_owned().into_bytes();
        let watch = Stopwatch::start(&options.limits);
        let checked = check(&source.entry, entry, &loader, options, &watch);
        let diagnostics = diagnose(&checked, options);
        Self { id: source.id(), source, checked, diagnostics }
    }

    /// Whether any diagnostic is an error.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        !self.checked.is_ok() || self.diagnostics.iter().any(Diagnostic::is_error)
    }

    /// What clients are told about it.
    #[must_use]
    pub fn json(&self) -> Value {
        let exports: Vec<Value> = self.checked.exports().iter().map(describe::export).collect();
        json!({
            "id": self.id,
            "entry": self.source.entry,
            "files": self.source.files.keys().collect::<Vec<_>>(),
            "exports": exports,
            "queries": describe::queries(),
            "diagnostics": pages::json(&self.diagnostics, &self.checked.files),
        })
    }
}

/// All diagnostics of a program, those of specialising its exports included, each export with a deadline of its own.
#[must_use]
pub fn diagnose(checked: &Checked, options: &Options) -> Vec<Diagnostic> {
    inspect(checked, options, || Stopwatch::start(&options.limits))
}

/// The files of a posted program beside the libraries of the server. Nothing else can be read.
struct Confined<'a> {
    program: MemoryLoader,
    libraries: &'a Libraries,
}

impl Loader for Confined<'_> {
    fn libraries(&self) -> Vec<String> {
        self.libraries.names()
    }

    fn resolve(&self, at: ModulePath) -> ModulePath {
        self.program.resolve(at)
    }

    fn allows(&self, at: &ModulePath) -> bool {
        at.library.is_some() || self.program.allows(at)
    }

    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String> {
        match &at.library {
            Some(library) => self.libraries.read(library, at),
            None => self.program.read(at),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(paths: &[&str]) -> BTreeMap<String, String> {
        paths.iter().map(|p| ((*p).to_owned(), "// text".to_owned())).collect()
    }

    fn codes(result: Result<Source, Vec<Diagnostic>>) -> Vec<&'static str> {
        result.unwrap_err().iter().map(|d| d.code.name()).collect()
    }

    #[test]
    fn paths_are_normalised() {
        let source = Source::new(files(&["./a//b.vola", "main.vola"]), Some("./main.vola")).unwrap();
        assert_eq!(source.entry, "main.vola");
        assert_eq!(source.files.keys().collect::<Vec<_>>(), ["a/b.vola", "main.vola"]);
        assert_eq!(Source::new(files(&["x.vola"]), None).unwrap().entry, "x.vola");
    }

    #[test]
    fn bad_paths_are_diagnostics() {
        for path in ["/etc/passwd.vola", "../a.vola", "a/../../b.vola", "a\\b.vola", "a.txt", "", ".vola", "a\0.vola"] {
            assert_eq!(codes(Source::new(files(&[path]), None)), ["E0308"], "{path:?}");
        }
        assert_eq!(codes(Source::new(files(&["a.vola", "./a.vola"]), Some("a.vola"))), ["E0308"]);
        assert_eq!(codes(Source::new(files(&["a.vola", "b.vola"]), None)), ["E0307"]);
        assert_eq!(codes(Source::new(files(&["a.vola"]), Some("b.vola"))), ["E0307"]);
        assert_eq!(codes(Source::new(files(&[]), None)), ["E0307"]);
    }

    #[test]
    fn the_id_depends_on_every_part_and_on_nothing_else() {
        let id = |paths: &[&str], entry| Source::new(files(paths), Some(entry)).unwrap().id();
        let same = id(&["a.vola", "b.vola"], "a.vola");
        assert_eq!(same, id(&["b.vola", "./a.vola"], "./a.vola"));
        assert_ne!(same, id(&["a.vola", "b.vola"], "b.vola"));
        assert_ne!(same, id(&["a.vola"], "a.vola"));
        assert_eq!(same.len(), 64);
        let mut changed = files(&["a.vola", "b.vola"]);
        changed.insert("b.vola".to_owned(), "// c".to_owned());
        assert_ne!(same, Source::new(changed, Some("a.vola")).unwrap().id());
    }
}
