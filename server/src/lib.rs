//! Isograd over HTTP: programs in, values and gradients out. Also what the command line shares with it: how values
//! are put to a compiled program and what comes back ([`evaluate`], [`values`], [`outputs`]).

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod choice;
mod config;
pub mod describe;
pub mod evaluate;
mod json_values;
mod libraries;
pub mod limits;
pub mod outputs;
pub mod pages;
mod pool;
mod problem;
mod program;
mod routes;
pub mod select;
mod state;
mod store;
pub mod values;
mod watch;

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tracing::{info, warn};

pub use config::{Config, server_options};
pub use libraries::{Libraries, read_source, read_text};
pub use limits::{LimitValue, ServerLimits};
pub use problem::{Kind, Problem};
pub use program::{Program, Source, diagnose};
pub use routes::router;
pub use state::Service;
pub use store::{LoadError, Store};
pub use watch::Stopwatch;

/// A server that listens but does not answer yet.
pub struct Server {
    listener: TcpListener,
    service: Arc<Service>,
}

impl Server {
    /// Opens the store and the port.
    ///
    /// # Errors
    /// If either cannot be had; the message says which.
    pub async fn bind(config: Config) -> io::Result<Self> {
        let store = Store::open(&config.store).map_err(|error| {
            io::Error::new(error.kind(), format!("cannot use `{}` as store: {error}", config.store.display()))
        })?;
        let listener = TcpListener::bind(config.listen)
            .await
            .map_err(|error| io::Error::new(error.kind(), format!("cannot listen on {}: {error}", config.listen)))?;
        let service = Arc::new(Service::new(store, config.libraries, config.limits, config.options));
        Ok(Self { listener, service })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// If the system does not say.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Answers until `stop` is done, then lets running requests finish, but not for ever.
    ///
    /// # Errors
    /// If connections cannot be accepted.
    pub async fn run(self, stop: impl Future<Output = ()> + Send + 'static) -> io::Result<()> {
        let Self { listener, service } = self;
        let grace = Duration::from_millis(service.limits.shutdown_ms);
        let (told, stopped) = oneshot::channel::<()>();
        let shared = Arc::clone(&service);
        let stopping = async move {
            stop.await;
            info!("stopping: no new connections, running requests may finish");
            shared.stopping.store(true, Ordering::Relaxed);
            let _ = told.send(());
        };
        let late = async move {
            match stopped.await {
                Ok(()) => tokio::time::sleep(grace).await,
                Err(_) => std::future::pending().await,
            }
        };
        let served = axum::serve(listener, router(service)).with_graceful_shutdown(stopping);
        tokio::select! {
            result = served => result,
            () = late => {
                warn!("some requests did not finish in time and are dropped");
                Ok(())
            }
        }
    }
}

/// Runs a server until the process gets SIGTERM or SIGINT.
///
/// # Errors
/// If the store or the port cannot be had.
pub async fn serve(config: Config) -> io::Result<()> {
    let server = Server::bind(config).await?;
    info!("listening on http://{}", server.address()?);
    server.run(interrupted()).await
}

/// Done when the process is told to stop, by SIGTERM or SIGINT.
pub async fn interrupted() {
    let interrupt = async {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    #[cfg(unix)]
    let terminate = async {
        match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
            Ok(mut signal) => {
                signal.recv().await;
            }
            Err(_) => std::future::pending::<()>().await,
        }
    };
    #[cfg(not(unix))]
    let terminate = std::future::pending::<()>();
    tokio::select! {
        () = interrupt => {}
        () = terminate => {}
    }
}
