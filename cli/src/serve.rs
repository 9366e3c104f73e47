//! `isograd serve`: starts the HTTP API and its log. Knows nothing of routes.

use std::io::{IsTerminal, Write, stderr, stdout};

use isograd_server::{Config, Libraries, Server, interrupted};
use tracing_subscriber::EnvFilter;

use crate::Failure;
use crate::args::Serve;

/// Runs the command until the process is told to stop.
pub fn run(args: Serve) -> Result<(), Failure> {
    let filter = EnvFilter::try_from_env("ISOGRAD_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(stderr().is_terminal())
        .with_writer(stderr)
        .with_ansi(stderr().is_terminal())
        .try_init();
    let mut config = Config::new(args.store);
    config.listen = args.listen;
    config.libraries = Libraries(args.external.libraries.into_iter().collect());
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
