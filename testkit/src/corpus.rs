//! The programs that the repository holds: the standard library and its specimens, the examples, the cases of the
//! language tests. Knows where they lie and how a file of cases is divided; knows nothing of what is expected of them.

use std::fs;
use std::path::{Path, PathBuf};

/// A program of a file of cases: `//# NAME` begins one, what stands before the first is put in front of each, and
/// `//+ FILE` includes a file there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Case {
    /// The file's name without extension, then the case's.
    pub name: String,
    /// What stands before all cases of the file.
    pub before: String,
    /// Its own lines, directives included, which are comments of the language.
    pub text: String,
}

impl Case {
    /// The whole program.
    #[must_use]
    pub fn program(&self) -> String {
        format!("{}{}", self.before, self.text)
    }
}

/// The cases of a file.
///
/// # Panics
/// If the file, or one that it includes, cannot be read.
#[must_use]
pub fn cases(file: &Path) -> Vec<Case> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let mut before = String::new();
    let mut cases: Vec<Case> = Vec::new();
    for line in read(file).lines() {
        match (line.split_at_checked(3), cases.last_mut()) {
            (Some(("//#", name)), _) => {
                let name = format!("{stem}: {}", name.trim());
                cases.push(Case { name, before: before.clone(), text: String::new() });
            }
            (Some(("//+", included)), None) => before += &read(&file.with_file_name(included.trim())),
            (_, Some(case)) => case.text += &format!("{line}\n"),
            (_, None) => before += &format!("{line}\n"),
        }
    }
    cases
}

/// All cases of the language tests, file by file.
///
/// # Panics
/// If a file cannot be read.
#[must_use]
pub fn language() -> Vec<Case> {
    files(&root().join("testkit/tests/language"), "cases").iter().flat_map(|file| cases(file)).collect()
}

/// The programs of a folder of the repository and of the folders in it, with their paths.
///
/// # Panics
/// If a file cannot be read.
#[must_use]
pub fn folder(path: &str) -> Vec<(PathBuf, String)> {
    files(&root().join(path), "vola").into_iter().map(|file| (file.clone(), read(&file))).collect()
}

/// Everything: every program that some test is about, with a name that can be a file's.
///
/// # Panics
/// If a file cannot be read.
#[must_use]
pub fn all() -> Vec<(String, String)> {
    let named = |name: String, text| (name.replace(|c: char| !c.is_alphanumeric(), "-"), text);
    let name = |path: &Path| path.strip_prefix(root()).unwrap_or(path).to_string_lossy().into_owned();
    let folders = ["stdlib", "examples", "testkit/tests/stdlib"].into_iter().flat_map(folder);
    let files = folders.map(|(path, text)| named(name(&path), text));
    let cases = language().into_iter().enumerate().map(|(i, case)| named(format!("{i} {}", case.name), case.program()));
    files.chain(cases).collect()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())).flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}
