//! Evaluates WebAssembly artefacts over columns of points, on wasmtime. Knows the artefact's manifest and nothing of
//! how it was made.
//!
//! A [`Runtime`] compiles artefacts to [`Kernel`]s and keeps them in memory. [`Kernel::evaluate`] runs one over any
//! number of points on all cores: points are cut into blocks that stay in cache, each worker takes an instance of its
//! own, and results are in the order of the inputs. A point's bits depend on its inputs alone: not on the batch, the
//! neighbours or the threads. [`Instance`] is the same without copies, for those who fill the columns in place.

mod columns;
mod engine;
mod instance;
mod kernel;
mod upper_halves;

pub use columns::{Column, Values};
pub use engine::{LoadError, Runtime, Settings};
pub use instance::Instance;
pub use kernel::{EvalError, EvalOptions, Kernel, fits};
