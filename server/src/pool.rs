//! Work that takes long, kept away from the threads that serve connections: so many at a time, so many waiting.
//! Knows nothing of what the work is; what is too much is refused at once.

use std::sync::Arc;

use axum::body::Bytes;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tracing::error;

use crate::limits::{LimitValue, ServerLimits};
use crate::problem::{Kind, Problem};

/// Memory is counted in pieces of this many bytes.
const PIECE: u64 = 65_536;

/// Workers, the queue before them, and the memory for bodies.
#[derive(Debug)]
pub struct Pool {
    admitted: Arc<Semaphore>,
    workers: Arc<Semaphore>,
    memory: Arc<Semaphore>,
    limits: ServerLimits,
}

/// Bytes of a body, counted as long as they live.
#[derive(Debug)]
pub struct Held {
    /// The bytes.
    pub bytes: Bytes,
    _memory: OwnedSemaphorePermit,
}

/// A right to memory, to be had before the bytes.
#[derive(Debug)]
pub struct Memory(OwnedSemaphorePermit);

impl Memory {
    /// Puts bytes under this right.
    #[must_use]
    pub fn hold(self, bytes: Bytes) -> Held {
        Held { bytes, _memory: self.0 }
    }
}

impl Pool {
    /// As many workers as the machine has processors.
    #[must_use]
    pub fn new(limits: ServerLimits) -> Self {
        let workers = std::thread::available_parallelism().map_or(2, usize::from).max(2);
        let queue = usize::try_from(limits.queue).unwrap_or(usize::MAX).min(Semaphore::MAX_PERMITS / 2);
        let pieces = usize::try_from(limits.buffered_bytes / PIECE).unwrap_or(usize::MAX);
        Self {
            admitted: Arc::new(Semaphore::new(workers + queue)),
            workers: Arc::new(Semaphore::new(workers)),
            memory: Arc::new(Semaphore::new(pieces.min(Semaphore::MAX_PERMITS))),
            limits,
        }
    }

    /// Room for a body.
    ///
    /// # Errors
    /// If the bodies held now leave too little.
    pub fn memory(&self, bytes: u64) -> Result<Memory, Problem> {
        let pieces = u32::try_from(bytes.div_ceil(PIECE)).unwrap_or(u32::MAX);
        let permit = Arc::clone(&self.memory).try_acquire_many_owned(pieces);
        permit.map(Memory).map_err(|_| busy("the server holds as many bytes as it may", self.limits.buffered_bytes()))
    }

    /// Runs work on a worker. It goes on even if nobody waits for it any more, and counts until it ends.
    ///
    /// # Errors
    /// If the queue is full, or the work's own.
    pub async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let admitted = Arc::clone(&self.admitted).try_acquire_owned();
        let admitted = admitted.map_err(|_| busy("all workers are busy and the queue is full", self.limits.queue()))?;
        let worker = Arc::clone(&self.workers).acquire_owned().await;
        let worker = worker.map_err(|_| Problem::new(Kind::Unavailable, "the server is stopping"))?;
        let task = tokio::task::spawn_blocking(move || {
            let result = work();
            drop((admitted, worker));
            result
        });
        task.await.unwrap_or_else(|join| {
            error!("a worker ended without an answer: {join}");
            Err(Problem::new(Kind::Internal, "the work ended without an answer; this is a mistake of the server"))
        })
    }
}

fn busy(what: &str, limit: LimitValue) -> Problem {
    Problem::new(Kind::Busy, format!("{what} (`{}` is {}); try again", limit.name, limit.value)).limit(limit)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[tokio::test]
    async fn a_full_queue_is_refused_at_once_and_a_panic_is_answered() {
        let pool = Arc::new(Pool::new(ServerLimits { queue: 1, ..ServerLimits::default() }));
        let workers = pool.workers.available_permits();
        let mut running = Vec::new();
        let mut release = Vec::new();
        for _ in 0..=workers {
            let (send, receive) = mpsc::channel::<()>();
            release.push(send);
            let pool = Arc::clone(&pool);
            running.push(tokio::spawn(async move {
                pool.run(move || {
                    let _ = receive.recv();
                    Ok(1)
                })
                .await
            }));
        }
        while pool.admitted.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        let refused = pool.run(|| Ok(2)).await.unwrap_err();
        assert_eq!((refused.kind, refused.limit.map(|l| l.name)), (Kind::Busy, Some("queue")));
        drop(release);
        for task in running {
            assert_eq!(task.await.unwrap(), Ok(1));
        }
        let panicked = pool.run(|| -> Result<(), Problem> { panic!("on purpose") }).await.unwrap_err();
        assert_eq!(panicked.kind, Kind::Internal);
        assert_eq!(pool.run(|| Ok(3)).await, Ok(3));
    }

    #[test]
    fn bodies_share_a_budget() {
        let pool = Pool::new(ServerLimits { buffered_bytes: 4 * PIECE, ..ServerLimits::default() });
        let first = pool.memory(3 * PIECE).unwrap().hold(Bytes::new());
        let refused = pool.memory(2 * PIECE).unwrap_err();
        assert_eq!((refused.kind, refused.limit.map(|l| l.name)), (Kind::Busy, Some("buffered_bytes")));
        drop(first);
        assert!(pool.memory(2 * PIECE).is_ok());
    }
}
