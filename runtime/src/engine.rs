//! Engines and the cache of compiled modules.

use std::sync::{Arc, OnceLock, Weak};
use std::time::Duration;

use isograd_compiler::Artefact;
use wasmtime::{Config, Engine, Module, OptLevel};

use crate::Kernel;
use crate::kernel::memory;

/// How often a deadline is looked at in modules with long loops.
pub(crate) const TICK: Duration = Duration::from_millis(5);

/// At most so many operations for Cranelift to optimise: it makes small code better (79 operations: 0.88 of the time),
/// and puts the schedule of large code in disorder.
const SMALL: u32 = 100;

/// Bytes of memory that a compiled module takes per byte of WebAssembly, about.
const EXPANSION: u64 = 6;

/// What a host sets for a [`Runtime`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Modules of more operations are refused: compiling takes about 5 µs for each and cannot be interrupted.
    pub max_operations: u32,
    /// Bytes of compiled modules to keep.
    pub cache_bytes: u64,
    /// Bytes of memory that an instance may have.
    pub max_memory: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { max_operations: 1_000_000, cache_bytes: 256 << 20, max_memory: 64 << 20 }
    }
}

/// Why an artefact cannot be loaded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LoadError {
    /// Too large to compile in reasonable time.
    #[error("the module has {operations} operations; the limit `max_operations` is {limit}")]
    Operations {
        /// How many it has.
        operations: u32,
        /// The limit.
        limit: u32,
    },
    /// Too much memory.
    #[error("the module needs {bytes} bytes of memory per instance; the limit `max_memory` is {limit}")]
    Memory {
        /// How much it needs.
        bytes: u32,
        /// The limit.
        limit: u32,
    },
    /// wasmtime refuses it.
    #[error("the module cannot be compiled: {0}")]
    Module(String),
}

/// Compiles artefacts and keeps what it compiled.
pub struct Runtime {
    settings: Settings,
    /// By whether Cranelift optimises, and whether deadlines interrupt loops.
    engines: [[OnceLock<Engine>; 2]; 2],
    /// By BLAKE3 of the bytes.
    kernels: moka::sync::Cache<[u8; 32], Arc<Kernel>>,
    /// Held by the runtime and its kernels; the ticker runs as long as one of them lives.
    alive: Arc<()>,
}

impl Default for Runtime {
    fn default() -> Self {
        Self::new(Settings::default())
    }
}

impl Runtime {
    /// A runtime with an empty cache.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let kernels = moka::sync::Cache::builder()
            .max_capacity(settings.cache_bytes)
            .weigher(|_, kernel: &Arc<Kernel>| u32::try_from(kernel.weight()).unwrap_or(u32::MAX))
            .build();
        Self { settings, engines: Default::default(), kernels, alive: Arc::new(()) }
    }

    /// The compiled module of an artefact, from the cache if it was loaded before.
    ///
    /// # Errors
    /// If the module exceeds a limit or is refused by wasmtime.
    pub fn load(&self, artefact: &Artefact) -> Result<Arc<Kernel>, LoadError> {
        let key = *blake3::hash(&artefact.bytes).as_bytes();
        // Threads that ask for the same artefact at once wait for one of them to compile it.
        self.kernels.try_get_with(key, || self.compile(artefact).map(Arc::new)).map_err(Arc::unwrap_or_clone)
    }

    fn compile(&self, artefact: &Artefact) -> Result<Kernel, LoadError> {
        let manifest = &artefact.manifest;
        if manifest.operations > self.settings.max_operations {
            let (operations, limit) = (manifest.operations, self.settings.max_operations);
            return Err(LoadError::Operations { operations, limit });
        }
        let bytes = memory(manifest)?.memory;
        if bytes > self.settings.max_memory {
            return Err(LoadError::Memory { bytes, limit: self.settings.max_memory });
        }
        let engine = self.engine(manifest.operations <= SMALL, manifest.unbounded)?;
        let module = Module::new(engine, &artefact.bytes).map_err(|e| LoadError::Module(format!("{e:#}")))?;
        let weight = artefact.bytes.len() as u64 * EXPANSION + 4096;
        Kernel::new(module, manifest.clone(), weight, Arc::clone(&self.alive))
    }

    fn engine(&self, small: bool, interruptible: bool) -> Result<&Engine, LoadError> {
        let [plain, optimising] = &self.engines;
        let [without, with] = if small { optimising } else { plain };
        let place = if interruptible { with } else { without };
        if let Some(engine) = place.get() {
            return Ok(engine);
        }
        let mut config = Config::new();
        config.cranelift_opt_level(if small { OptLevel::Speed } else { OptLevel::None });
        config.epoch_interruption(interruptible);
        config.wasm_relaxed_simd(false);
        let engine = Engine::new(&config).map_err(|e| LoadError::Module(format!("{e:#}")))?;
        if interruptible {
            tick(engine.clone(), Arc::downgrade(&self.alive));
        }
        Ok(place.get_or_init(|| engine))
    }
}

/// Advances an engine's epoch until the runtime is gone.
fn tick(engine: Engine, alive: Weak<()>) {
    // Without a thread there is no deadline inside a block, but results stay right.
    let _ = std::thread::Builder::new().name("isograd-epoch".to_owned()).spawn(move || {
        while alive.strong_count() > 0 {
            std::thread::sleep(TICK);
            engine.increment_epoch();
        }
    });
}
