//! Programs on disk: the entry file, the files it imports, libraries. Reads files; decides nothing about them.

use std::path::{Component, Path, PathBuf};

use isograd_compiler::{Checked, Diagnostic, Loader, ModulePath, Options, Watch, check};
use isograd_server::{Libraries, diagnose, limits, read_source};

use crate::args::Reading;
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
        let name = |c: Component<'_>| match c {
            Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
            _ => None,
        };
        let canonical = directory.canonicalize().map(|d| d.components().filter_map(name).collect()).unwrap_or_default();
        Self { directory, canonical, libraries }
    }
}

impl Loader for FsLoader {
    fn libraries(&self) -> Vec<String> {
        self.libraries.names()
    }

    /// From `/a/b`, the path that goes up once and down to `b` goes nowhere.
    fn resolve(&self, mut at: ModulePath) -> ModulePath {
        while at.ups > 0 && at.path.len() > 1 && at.library.is_none() {
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
        let mut path = self.directory.clone();
        path.extend(std::iter::repeat_n("..", at.ups as usize));
        path.extend(&at.path);
        path.set_extension("vola");
        read_source(&path).map_err(|error| format!("tried `{}`: {error}", path.display()))
    }
}

/// The options that the arguments ask for.
///
/// # Errors
/// If one names a limit that is none.
pub fn options(reading: &Reading) -> Result<Options, Failure> {
    let mut options = Options::default();
    for (name, value) in &reading.limits {
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
pub fn load(file: &Path, reading: &Reading, options: &Options, watch: &dyn Watch) -> Result<Checked, Failure> {
    let entry =
        read_source(file).map_err(|error| Failure::Wrong(format!("cannot read `{}`: {error}", file.display())))?;
    let mut libraries = Libraries::default();
    for (name, directory) in &reading.external.libraries {
        if libraries.0.insert(name.clone(), directory.clone()).is_some() {
            return Err(Failure::Usage(format!("the library `{name}` is registered twice")));
        }
    }
    let loader = FsLoader::new(file, libraries);
    let name = file.to_string_lossy().replace('\\', "/");
    Ok(check(&name, entry, &loader, options, watch))
}

/// Reads and checks a program for use; reports its errors and warnings.
///
/// # Errors
/// If it has errors, or warnings that are not wanted.
pub fn load_sound(file: &Path, reading: &Reading, options: &Options, watch: &dyn Watch) -> Result<Checked, Failure> {
    let checked = load(file, reading, options, watch)?;
    if !checked.is_ok() {
        // Nothing will be compiled that could find the rest.
        report::diagnostics(&diagnose(&checked, options), &checked.files);
        return Err(Failure::Reported);
    }
    report::diagnostics(&checked.diagnostics, &checked.files);
    refuse_warnings(reading, &checked.diagnostics)?;
    Ok(checked)
}
