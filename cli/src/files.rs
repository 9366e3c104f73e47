//! Programs on disk: the entry file, the files it imports, libraries. Reads files; decides nothing about them.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};

use isograd_compiler::{Checked, Diagnostic, Loader, ModulePath, Options, Watch, check};
use isograd_server::{Libraries, diagnose, limits, read_source};

use crate::args::{Reading, Sources};
use crate::{Failure, report};

/// Files in and around the directory of the entry file, and registered libraries.
struct FsLoader {
    /// The directory as the user wrote it.
    directory: PathBuf,
    /// Its names from the root, without links, if they can be found.
    canonical: Vec<String>,
    libraries: Libraries,
}

impl FsLoader {
    fn new(entry: &Path, libraries: Libraries) -> Self {
        let directory = match entry.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let canonical = directory.canonicalize().map(|d| names(&d)).unwrap_or_default();
        Self { directory, canonical, libraries }
    }

    /// The file of the program that a module path leads to.
    fn file(&self, at: &ModulePath) -> PathBuf {
        let mut path = self.directory.clone();
        path.extend(std::iter::repeat_n("..", at.ups as usize));
        path.extend(&at.path);
        path.set_extension("vola");
        path
    }

    /// Where a file really lies, if there is one: links lead to one file by several paths.
    fn real(&self, at: &ModulePath) -> Option<ModulePath> {
        let file = self.file(at).canonicalize().ok().filter(|f| f.extension().is_some_and(|e| e == "vola"))?;
        let names = names(&file.with_extension(""));
        let common = names.iter().zip(&self.canonical).take_while(|(a, b)| a == b).count();
        let ups = u32::try_from(self.canonical.len() - common).ok()?;
        Some(ModulePath { library: None, ups, path: names.into_iter().skip(common).collect() })
    }
}

/// The names on a path from the root.
fn names(path: &Path) -> Vec<String> {
    let name = |c: Component<'_>| match c {
        Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
        _ => None,
    };
    path.components().filter_map(name).collect()
}

impl Loader for FsLoader {
    fn libraries(&self) -> Vec<String> {
        self.libraries.names()
    }

    /// The file behind all links. Of a file that is not there: from `/a/b`, the path that goes up once and down to `b`
    /// goes nowhere.
    fn resolve(&self, mut at: ModulePath) -> ModulePath {
        if at.library.is_some() {
            return at;
        }
        if let Some(real) = self.real(&at) {
            return real;
        }
        while at.ups > 0 && at.path.len() > 1 {
            let down = self.canonical.len().checked_sub(at.ups as usize).and_then(|i| self.canonical.get(i));
            if down.is_none() || down != at.path.first() {
                break;
            }
            at.ups -= 1;
            at.path.remove(0);
        }
        at
    }

    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String> {
        if let Some(library) = &at.library {
            return self.libraries.read(library, at);
        }
        let path = self.file(at);
        read_source(&path).map_err(|error| format!("tried `{}`: {error}", path.display()))
    }
}

/// The options that the arguments ask for.
///
/// # Errors
/// If one names a limit that is none, or gives it more than it may have.
pub fn options(sources: &Sources) -> Result<Options, Failure> {
    let mut options = Options::default();
    for (name, value) in &sources.limits {
        limits::set(name, *value, &mut options.limits, None)
            .map_err(|error| Failure::Usage(format!("`--limit {name}={value}`: {error}")))?;
    }
    Ok(options)
}

/// Fails if there are warnings and the arguments deny them; they have been reported.
///
/// # Errors
/// How many there are.
pub fn refuse_warnings(reading: &Reading, diagnostics: &[Diagnostic]) -> Result<(), Failure> {
    let count = diagnostics.iter().filter(|d| !d.is_error()).count();
    let found = match count {
        1 => "1 warning".to_owned(),
        _ => format!("{count} warnings"),
    };
    match count {
        0 => Ok(()),
        _ if !reading.deny_warnings => Ok(()),
        _ => Err(Failure::Wrong(format!("{found}, and `--deny-warnings` is given"))),
    }
}

/// Reads and checks a program, without reporting anything.
///
/// # Errors
/// If the entry file cannot be read.
pub fn load(file: &Path, sources: &Sources, options: &Options, watch: &dyn Watch) -> Result<Checked, Failure> {
    let entry = read(file)?;
    Ok(check(&shown(file), entry, &loader(file, sources)?, options, watch))
}

/// The bytes of a file that was named on the command line.
///
/// # Errors
/// If it cannot be read.
pub fn read(file: &Path) -> Result<Vec<u8>, Failure> {
    read_source(file).map_err(|error| Failure::Wrong(format!("cannot read `{}`: {error}", file.display())))
}

/// A file's name in diagnostics.
pub fn shown(file: &Path) -> String {
    file.to_string_lossy().replace('\\', "/")
}

/// What finds the files that an entry file imports.
///
/// # Errors
/// If a library is registered twice.
pub fn loader(entry: &Path, sources: &Sources) -> Result<impl Loader, Failure> {
    let mut libraries = Libraries::default();
    for (name, directory) in &sources.external.libraries {
        if libraries.0.insert(name.clone(), directory.clone()).is_some() {
            return Err(Failure::Usage(format!("the library `{name}` is registered twice")));
        }
    }
    Ok(FsLoader::new(entry, libraries))
}

/// Gives a file other bytes, all of them or none: they are written beside it and take its place and permissions. A
/// link stays a link to the file.
///
/// # Errors
/// If the file, or its directory, cannot be written.
pub fn replace(file: &Path, bytes: &[u8]) -> Result<(), Failure> {
    try_replace(file, bytes)
        .map_err(|error| Failure::Wrong(format!("cannot write `{}`: {error}; it is as it was", file.display())))
}

fn try_replace(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = file.canonicalize()?;
    let permissions = fs::metadata(&file)?.permissions();
    if permissions.readonly() {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only"));
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let beside = file.with_file_name(format!(".{name}.{}", std::process::id()));
    let mut new = OpenOptions::new().write(true).create_new(true).open(&beside)?;
    let written = new
        .write_all(bytes)
        .and_then(|()| new.set_permissions(permissions))
        .and_then(|()| new.sync_all())
        .and_then(|()| fs::rename(&beside, &file));
    if written.is_err() {
        let _ = fs::remove_file(&beside);
    }
    written
}

/// Reads and checks a program for use; reports its errors and warnings.
///
/// # Errors
/// If it has errors, or warnings that are not wanted.
pub fn load_sound(file: &Path, reading: &Reading, options: &Options, watch: &dyn Watch) -> Result<Checked, Failure> {
    let checked = load(file, &reading.sources, options, watch)?;
    if !checked.is_ok() {
        // Nothing will be compiled that could find the rest.
        report::diagnostics(&diagnose(&checked, options), &checked.files);
        return Err(Failure::Reported);
    }
    report::diagnostics(&checked.diagnostics, &checked.files);
    refuse_warnings(reading, &checked.diagnostics)?;
    Ok(checked)
}
