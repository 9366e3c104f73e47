//! Graph to graph: each transform is a function that rebuilds the graph through a builder. Knows nothing of source
//! text and of targets.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod copy;
mod cost;
mod derive;
mod differentiate;
mod fold;
mod live;
mod order;
mod pressure;
mod raw;
mod schedule;

pub use cost::cost;
pub use derive::{Wanted, derive};
pub use differentiate::{DifferentiateError, Sweep, active_diffs, differentiate, reverse_is_plausible};
pub use fold::{fold, kernels, optimise};
pub use live::live;
pub use schedule::schedule;
