//! What a server is started with, and the file it may be written in. Flags of the command line are put over it by
//! whoever has them; knows no command line.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::PathBuf;

use isograd_compiler::{Limits, Options};
use serde::Deserialize;

use crate::libraries::Libraries;
use crate::limits::{self, ServerLimits};

/// What a server is started with.
#[derive(Debug, Clone)]
pub struct Config {
    /// Where it listens; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Where programs are kept.
    pub store: PathBuf,
    /// External modules.
    pub libraries: Libraries,
    /// Limits of the service.
    pub limits: ServerLimits,
    /// Limits of the language.
    pub options: Options,
}

impl Default for Config {
    /// Port 8787 of this machine only, and `store` in the working directory.
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8787)),
            store: PathBuf::from("store"),
            libraries: Libraries::default(),
            limits: ServerLimits::default(),
            options: server_options(),
        }
    }
}

/// The limits of the language on a server. Native code takes about 5 µs an operation and cannot be interrupted, so
/// that 200,000 operations are the most that fit a request.
#[must_use]
pub fn server_options() -> Options {
    Options { limits: Limits { derived_nodes: 200_000, ..Limits::default() }, verify: false }
}

/// The file, in TOML. Paths are relative to the working directory, as on the command line.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    listen: Option<SocketAddr>,
    store: Option<PathBuf>,
    #[serde(default)]
    libraries: BTreeMap<String, PathBuf>,
    #[serde(default)]
    limits: BTreeMap<String, u64>,
}

impl Config {
    /// Reads a configuration; what it does not say has its default.
    ///
    /// # Errors
    /// What is wrong and where, if it is no TOML, has an unknown key or a value that does not fit.
    pub fn parse(text: &str) -> Result<Self, String> {
        let written: Written = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
        let mut config = Self::default();
        config.listen = written.listen.unwrap_or(config.listen);
        config.store = written.store.unwrap_or(config.store);
        config.libraries = Libraries(written.libraries);
        for (name, value) in &written.limits {
            config.limit(name, *value).map_err(|error| format!("[limits]: {error}"))?;
        }
        Ok(config)
    }

    /// Changes a limit of the language or of the service.
    ///
    /// # Errors
    /// If there is none of this name, or the value is more than it may be given.
    pub fn limit(&mut self, name: &str, value: u64) -> Result<(), limits::LimitError> {
        limits::set(name, value, &mut self.options.limits, Some(&mut self.limits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_replaces_the_default() {
        let config = Config::parse(
            "listen = \"0.0.0.0:80\"\n[libraries]\next = \"lib\"\n[limits]\npoints = 5\ndiff_order = 2\n",
        )
        .unwrap();
        assert_eq!((config.listen.to_string(), config.store), ("0.0.0.0:80".to_owned(), PathBuf::from("store")));
        assert_eq!(config.libraries.names(), ["ext"]);
        assert_eq!(config.limits, ServerLimits { points: 5, ..ServerLimits::default() });
        assert_eq!(config.options.limits, Limits { diff_order: 2, ..server_options().limits });
    }

    #[test]
    fn what_is_wrong_is_named_with_what_is_right() {
        let error = |text| Config::parse(text).unwrap_err();
        let limit = error("[limits]\npoint = 5\n");
        assert!(limit.starts_with("[limits]: there is no limit `point`; the limits are source_bytes,"), "{limit}");
        let key = error("listen = \"127.0.0.1:1\"\nport = 5\n");
        assert!(key.contains("line 2") && key.contains("`port`") && key.contains("`listen`, `store`"), "{key}");
        let value = error("[limits]\npoints = \"many\"\n");
        assert!(value.contains("line 2") && value.contains("\"many\""), "{value}");
        assert!(error("[limits]\npoints = -1\n").contains("-1"));
        assert!(error("listen = \"nowhere\"\n").contains("line 1"));
        assert!(error("listen = \n").contains("line 1"));
    }
}
