//! What all requests share: the store, what was compiled before, the workers. Caches are weighed by bytes.
//! Knows how to get a program and a compiled request; knows nothing of routes.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use isograd_compiler::{Artefact, Code, Options, Request, compile};
use isograd_runtime::{Kernel, Runtime, Settings};
use moka::sync::Cache;
use tracing::error;

use crate::evaluate::{self, EvaluateError};
use crate::libraries::Libraries;
use crate::limits::ServerLimits;
use crate::pool::Pool;
use crate::problem::{Kind, Problem};
use crate::program::{Program, Source};
use crate::store::{LoadError, Store};
use crate::watch::Stopwatch;

/// Bytes that checked programs may weigh.
const PROGRAMS: u64 = 256 << 20;

/// Bytes that modules may weigh.
const MODULES: u64 = 64 << 20;

/// Bytes that native code may weigh.
const KERNELS: u64 = 512 << 20;

/// What a server has for its requests.
pub struct Service {
    /// Programs on disk.
    pub store: Store,
    /// External modules.
    pub libraries: Libraries,
    /// Limits of the service.
    pub limits: ServerLimits,
    /// Limits of the language.
    pub options: Options,
    /// Workers.
    pub pool: Pool,
    /// Set when the server is told to stop.
    pub stopping: AtomicBool,
    programs: Cache<String, Arc<Program>>,
    compiled: Cache<String, Arc<Artefact>>,
    runtime: Runtime,
}

impl Service {
    /// A service over a store.
    #[must_use]
    pub fn new(store: Store, libraries: Libraries, limits: ServerLimits, options: Options) -> Self {
        // A module of as many operations as a graph may have nodes can be compiled.
        let most = u32::try_from(options.limits.derived_nodes).unwrap_or(u32::MAX);
        let settings = Settings { max_operations: most, cache_bytes: KERNELS, ..Settings::default() };
        let weigh = |bytes: usize| u32::try_from(bytes).unwrap_or(u32::MAX);
        Self {
            store,
            libraries,
            limits,
            options,
            pool: Pool::new(limits),
            stopping: AtomicBool::new(false),
            // A tree takes about ten times its text, a typed program as much again.
            programs: Cache::builder()
                .max_capacity(PROGRAMS)
                .weigher(move |_, p: &Arc<Program>| weigh(p.source.bytes().saturating_mul(20).saturating_add(4096)))
                .build(),
            compiled: Cache::builder()
                .max_capacity(MODULES)
                .weigher(move |_, a: &Arc<Artefact>| weigh(a.bytes.len().saturating_add(4096)))
                .build(),
            runtime: Runtime::new(settings),
        }
    }

    /// The program of this id.
    ///
    /// # Errors
    /// If there is none or it cannot be read.
    pub fn program(&self, id: &str) -> Result<Arc<Program>, Problem> {
        if let Some(program) = self.programs.get(id) {
            return Ok(program);
        }
        let source = self.store.load(id).map_err(unloadable)?;
        Ok(self.check(source))
    }

    /// Checks a program, or finds that it was checked before.
    #[must_use]
    pub fn check(&self, source: Source) -> Arc<Program> {
        let id = source.id();
        let check = || Arc::new(Program::check(source, &self.libraries, &self.options));
        let program = self.programs.get_with(id.clone(), check);
        if program.diagnostics.iter().any(|d| d.code == Code::E1011) {
            // What took too long now may not the next time.
            self.programs.invalidate(&id);
        }
        program
    }

    /// Compiles a request, or finds that it was compiled before. Requests for the same wait for the first.
    ///
    /// # Errors
    /// What the compiler says.
    pub fn compiled(&self, program: &Program, request: &Request) -> Result<Arc<Artefact>, Problem> {
        let key = format!("{} {request:?}", program.checked.digest);
        let compiled = self.compiled.try_get_with(key, || {
            let watch = Stopwatch::start(&self.options.limits);
            let artefact = compile(&program.checked, request, &self.options, &watch)
                .map_err(|d| Problem::diagnostics(&d, &program.checked.files, &self.options.limits))?;
            Ok(Arc::new(artefact))
        });
        compiled.map_err(|problem: Arc<Problem>| Problem::clone(&problem))
    }

    /// The native code of a compiled request.
    ///
    /// # Errors
    /// If the runtime refuses the module.
    pub fn kernel(&self, artefact: &Artefact) -> Result<Arc<Kernel>, EvaluateError> {
        evaluate::load(&self.runtime, artefact)
    }
}

fn unloadable(error: LoadError) -> Problem {
    let message = error.to_string();
    match error {
        LoadError::Unknown(_) => {
            Problem::new(Kind::UnknownProgram, format!("{message}; post it to /v1/programs first"))
        }
        LoadError::Damaged { .. } => {
            error!("{message}");
            Problem::new(Kind::DamagedProgram, format!("{message}; post the program again to repair it"))
        }
        LoadError::Io(_) => {
            error!("{message}");
            Problem::new(Kind::Unavailable, message)
        }
    }
}
