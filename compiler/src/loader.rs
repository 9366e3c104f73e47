//! Where modules come from: the standard library is bundled, everything else is the host's.

use std::collections::BTreeMap;

use include_dir::{Dir, include_dir};
use isograd_program::{Loader, ModulePath};

static STDLIB: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/../stdlib");

/// Adds the bundled standard library, as `std` and `stdlib`, to a host's loader. A host that registers `std` itself
/// replaces it.
pub struct WithStd<'a>(pub &'a dyn Loader);

impl WithStd<'_> {
    fn bundled(&self, library: &str) -> bool {
        matches!(library, "std" | "stdlib") && !self.0.libraries().iter().any(|l| l == library)
    }
}

impl Loader for WithStd<'_> {
    fn libraries(&self) -> Vec<String> {
        let mut all = self.0.libraries();
        for name in ["std", "stdlib"] {
            if !all.iter().any(|l| l == name) {
                all.push(name.to_owned());
            }
        }
        all
    }

    fn canonical(&self, library: &str) -> String {
        if self.bundled(library) { "std".to_owned() } else { self.0.canonical(library) }
    }

    fn resolve(&self, at: ModulePath) -> ModulePath {
        self.0.resolve(at)
    }

    fn allows(&self, at: &ModulePath) -> bool {
        at.library.as_deref().is_some_and(|l| self.bundled(l)) || self.0.allows(at)
    }

    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String> {
        match &at.library {
            Some(library) if self.bundled(library) => {
                let path = format!("{}.vola", at.path.join("/"));
                let file = STDLIB.get_file(&path).filter(|_| at.ups == 0);
                file.map(|f| f.contents().to_vec()).ok_or_else(|| format!("no `{path}` in the standard library"))
            }
            _ => self.0.read(at),
        }
    }
}

/// Names and texts of the standard library's files, sorted.
#[must_use]
pub fn standard_library() -> Vec<(String, String)> {
    let mut files: Vec<_> = STDLIB
        .files()
        .filter(|f| f.path().extension().is_some_and(|e| e == "vola"))
        .filter_map(|f| Some((f.path().to_str()?.to_owned(), f.contents_utf8()?.to_owned())))
        .collect();
    files.sort();
    files
}

/// Files held in memory, by path relative to the entry file's directory: `shapes/ball.vola`. Confined: a path that
/// leaves the directory does not resolve.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MemoryLoader {
    /// The files.
    pub files: BTreeMap<String, Vec<u8>>,
    /// The directory of the entry file inside them, without slashes at its ends; empty for the root.
    pub base: String,
}

impl Loader for MemoryLoader {
    fn libraries(&self) -> Vec<String> {
        Vec::new()
    }

    fn canonical(&self, library: &str) -> String {
        library.to_owned()
    }

    /// From the base `a/b`, the path that goes up once and down to `b` goes nowhere.
    fn resolve(&self, mut at: ModulePath) -> ModulePath {
        let directory = self.directory();
        while at.ups > 0 && at.path.len() > 1 && at.library.is_none() {
            let down = directory.len().checked_sub(at.ups as usize).and_then(|i| directory.get(i));
            if down.is_none_or(|down| at.path.first().is_none_or(|first| first != down)) {
                break;
            }
            at.ups -= 1;
            at.path.remove(0);
        }
        at
    }

    fn allows(&self, at: &ModulePath) -> bool {
        at.ups as usize <= self.directory().len()
    }

    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String> {
        let mut directory = self.directory();
        directory.truncate(directory.len().saturating_sub(at.ups as usize));
        directory.extend(at.path.iter().map(String::as_str));
        let path = format!("{}.vola", directory.join("/"));
        self.files.get(&path).cloned().ok_or_else(|| format!("no file `{path}` in the program"))
    }
}

impl MemoryLoader {
    fn directory(&self) -> Vec<&str> {
        self.base.split('/').filter(|s| !s.is_empty()).collect()
    }
}
