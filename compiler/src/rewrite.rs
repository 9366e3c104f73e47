//! A file's text in the form of the house, and in the current dialect if that is wanted: what `isograd fmt` and
//! `POST /v1/format` have in common. Knows no disk and no network; a file with errors gives no text.

use isograd_program::{Loader, ModulePath};
use isograd_syntax::{Diagnostic, Diagnostics, FileId, Files, format};

use crate::pipeline::reported;
use crate::{Options, Watch, check, migrate};

/// Why a file was not rewritten.
#[derive(Debug, Clone, PartialEq)]
pub struct Malformed {
    /// Its errors, and nothing else.
    pub diagnostics: Vec<Diagnostic>,
    /// What they point into.
    pub files: Files,
}

/// Formats a file; with a loader for what it imports, also migrates it from the 2024 dialect (LANGUAGE 20.2). To be
/// formatted a file needs to parse, and what it imports is not read; to be migrated it needs to be without errors,
/// because only then its types are known.
///
/// # Errors
/// What keeps it from that.
pub fn rewrite(
    name: &str,
    source: Vec<u8>,
    migrating: Option<&dyn Loader>,
    options: &Options,
    watch: &dyn Watch,
) -> Result<String, Malformed> {
    let Some(loader) = migrating else { return formatted(name, source, options) };
    let checked = check(name, source, loader, options, watch);
    migrate(&checked, loader).ok_or_else(|| {
        let errors = checked.diagnostics.into_iter().filter(Diagnostic::is_error);
        Malformed { diagnostics: errors.collect(), files: checked.files }
    })
}

fn formatted(name: &str, source: Vec<u8>, options: &Options) -> Result<String, Malformed> {
    let loaded = isograd_program::load(name, source, &Alone, &options.limits);
    let file = loaded.files.get(FileId(0)).map(|f| f.text.as_str());
    match (file, loaded.modules.first()) {
        (Some(text), Some(module)) if loaded.diagnostics.is_empty() => Ok(format(text, &module.tree)),
        _ => {
            let mut found = Diagnostics::default();
            found.extend(loaded.diagnostics);
            Err(Malformed { diagnostics: reported(found, &options.limits), files: loaded.files })
        }
    }
}

/// Where every file is empty, so that imports lead nowhere and none is missing.
struct Alone;

impl Loader for Alone {
    fn libraries(&self) -> Vec<String> {
        Vec::new()
    }

    fn read(&self, _at: &ModulePath) -> Result<Vec<u8>, String> {
        Ok(Vec::new())
    }
}
