//! External libraries: directories of Vola files, registered by name on the command line.
//! Reads their files; knows nothing of the program's own.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use isograd_compiler::ModulePath;

/// Registered libraries: name to directory.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Libraries(pub BTreeMap<String, PathBuf>);

impl Libraries {
    /// Their names, sorted.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        self.0.keys().cloned().collect()
    }

    /// The bytes of a library's file. Path elements are identifiers, so no path leaves the directory.
    ///
    /// # Errors
    /// A sentence that says what was tried, if the library or the file is not there.
    pub fn read(&self, library: &str, at: &ModulePath) -> Result<Vec<u8>, String> {
        let root = self.0.get(library).ok_or_else(|| format!("no library `{library}` is registered"))?;
        if at.ups > 0 {
            return Err(format!("the path leaves the library `{library}`"));
        }
        let mut path = root.clone();
        path.extend(&at.path);
        path.set_extension("vola");
        read_source(&path).map_err(|error| format!("tried `{}`: {error}", path.display()))
    }
}

/// Bytes read of a file at most; far above every limit of the language, which the compiler reports better.
const LARGEST_FILE: u64 = 256 << 20;

/// The bytes of a source file; never endless, even if the file is.
///
/// # Errors
/// If it cannot be read, or is larger than any source may be.
pub fn read_source(path: &Path) -> io::Result<Vec<u8>> {
    read_text(std::fs::File::open(path)?)
}

/// As [`read_source`], from wherever the text comes.
///
/// # Errors
/// If it cannot be read, or is larger than any source may be.
pub fn read_text(from: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    from.take(LARGEST_FILE + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "the file is larger than 256 MiB"));
    }
    Ok(bytes)
}
