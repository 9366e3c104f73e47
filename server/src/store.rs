//! Programs in a directory, one file each, named by id; a file is there whole or not at all, also after a crash.
//! Knows bytes and names; knows nothing of compiling.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use crate::program::Source;

/// A file larger than this was not written by us.
const LARGEST: u64 = 64 << 20;

/// A temporary file older than this was left behind by a process that died.
const STALE: Duration = Duration::from_secs(3600);

/// A directory of programs. Several processes may use the same one.
#[derive(Debug)]
pub struct Store {
    directory: PathBuf,
    temporaries: AtomicU64,
}

/// Why a program cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// There is none of this id.
    #[error("there is no program `{0}`")]
    Unknown(String),
    /// Its file is not what was written.
    #[error("the file of program `{id}` is damaged: {why}")]
    Damaged {
        /// The program.
        id: String,
        /// What is wrong with it.
        why: String,
    },
    /// The directory or file cannot be read.
    #[error("the store cannot be read: {0}")]
    Io(#[from] io::Error),
}

/// The file's content.
#[derive(Serialize, Deserialize)]
struct Record {
    entry: String,
    files: BTreeMap<String, String>,
}

impl Store {
    /// Opens a store, creating its directory, and removes what dead processes left behind.
    ///
    /// # Errors
    /// If the directory cannot be made or written.
    pub fn open(root: &Path) -> io::Result<Self> {
        let directory = root.join("programs");
        fs::create_dir_all(&directory)?;
        sync_directory(root)?;
        let store = Self { directory, temporaries: AtomicU64::new(0) };
        store.sweep()?;
        store.probe()?;
        Ok(store)
    }

    /// Whether files can be written now.
    ///
    /// # Errors
    /// If not.
    pub fn probe(&self) -> io::Result<()> {
        let (path, mut file) = self.temporary()?;
        let written = file.write_all(b"probe");
        drop(file);
        fs::remove_file(path)?;
        written
    }

    /// The program of this id.
    ///
    /// # Errors
    /// If there is none, or it cannot be read, or its content does not have this id.
    pub fn load(&self, id: &str) -> Result<Source, LoadError> {
        let unknown = || LoadError::Unknown(id.chars().take(100).collect());
        let damaged = |why: String| LoadError::Damaged { id: id.to_owned(), why };
        let path = self.path(id).ok_or_else(unknown)?;
        let file = match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(unknown()),
            opened => opened?,
        };
        let mut bytes = Vec::new();
        file.take(LARGEST + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > LARGEST {
            return Err(damaged(format!("it is larger than {LARGEST} bytes")));
        }
        let record: Record = serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
        let source = Source { entry: record.entry, files: record.files };
        if source.id() != id || !source.files.contains_key(&source.entry) {
            return Err(damaged("its content has another id".to_owned()));
        }
        Ok(source)
    }

    /// Keeps a program; when this returns, it survives a crash of the process and of the machine.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, source: &Source) -> io::Result<()> {
        let id = source.id();
        let target = self.path(&id).ok_or_else(|| io::Error::other("a program has a malformed id"))?;
        let record = Record { entry: source.entry.clone(), files: source.files.clone() };
        let bytes = serde_json::to_vec(&record)?;
        let (path, mut file) = self.temporary()?;
        let written = file.write_all(&bytes).and_then(|()| file.sync_all()).and_then(|()| fs::rename(&path, &target));
        if let Err(error) = written {
            let _ = fs::remove_file(&path);
            return Err(error);
        }
        sync_directory(&self.directory)
    }

    /// Where a program is; `None` unless the id is 64 lower-case hexadecimal digits, so that no id is a path.
    fn path(&self, id: &str) -> Option<PathBuf> {
        let valid = id.len() == 64 && id.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        valid.then(|| self.directory.join(format!("{id}.json")))
    }

    fn temporary(&self) -> io::Result<(PathBuf, File)> {
        loop {
            let number = self.temporaries.fetch_add(1, Ordering::Relaxed);
            let path = self.directory.join(format!(".new-{}-{number}", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                opened => return Ok((path, opened?)),
            }
        }
    }

    fn sweep(&self) -> io::Result<()> {
        for entry in fs::read_dir(&self.directory)? {
            let entry = entry?;
            if !entry.file_name().to_string_lossy().starts_with(".new-") {
                continue;
            }
            let age = entry.metadata().and_then(|m| m.modified()).map(|at| SystemTime::now().duration_since(at));
            if matches!(age, Ok(Ok(age)) if age > STALE) {
                let _ = fs::remove_file(entry.path());
            }
        }
        Ok(())
    }
}

/// Makes a new name in a directory durable.
fn sync_directory(directory: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(directory)?.sync_all() } else { Ok(()) }
}
