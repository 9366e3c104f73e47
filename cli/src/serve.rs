//! `isograd serve`: starts the HTTP API and its log. Knows nothing of routes.

use std::fs;
use std::io::{IsTerminal, Write, stderr, stdout};

use isograd_server::{Config, Server, interrupted};
use tracing_subscriber::EnvFilter;

use crate::Failure;
use crate::args::{Serve, usable};

/// Runs the command until the process is told to stop.
pub fn run(args: Serve) -> Result<(), Failure> {
    let filter = EnvFilter::try_from_env("ISOGRAD_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(stderr().is_terminal())
        .with_writer(stderr)
        .with_ansi(stderr().is_terminal())
        .try_init();
    let config = configure(args)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let served = runtime.block_on(async {
        let server = Server::bind(config).await?;
        let address = server.address()?;
        // The log says it as well; nobody needs to read this.
        let _ = writeln!(stdout(), "listening on http://{address}").and_then(|()| stdout().flush());
        server.run(interrupted()).await
    });
    // Work that outlived its grace ends with the process.
    runtime.shutdown_background();
    served.map_err(|error| Failure::Wrong(error.to_string()))
}

/// The configuration in the file, with the flags over it.
fn configure(args: Serve) -> Result<Config, Failure> {
    let mut config = Config::default();
    if let Some(path) = &args.config {
        let shown = path.display();
        let text =
            fs::read_to_string(path).map_err(|error| Failure::Wrong(format!("cannot read `{shown}`: {error}")))?;
        config = Config::parse(&text).map_err(|error| Failure::Wrong(format!("{shown}: {error}")))?;
        for (name, directory) in &config.libraries.0 {
            usable(name, directory).map_err(|error| Failure::Wrong(format!("{shown}: [libraries]: {error}")))?;
        }
    }
    config.listen = args.listen.unwrap_or(config.listen);
    config.store = args.store.unwrap_or(config.store);
    config.libraries.0.extend(args.external.libraries);
    for (name, value) in &args.limits {
        config.limit(name, *value).map_err(|error| Failure::Usage(format!("`--limit {name}={value}`: {error}")))?;
    }
    Ok(config)
}
