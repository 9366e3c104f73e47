//! Graph to graph: each transform is a function that rebuilds the graph through a builder. Knows nothing of source
//! text and of targets.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod bound;
mod continuity;
mod copy;
mod cost;
mod derive;
mod differentiate;
mod fold;
mod kinks;
mod live;
mod order;
mod pressure;
mod raw;
mod schedule;
mod smooth;
mod specialise;
mod strict;

pub use bound::{Hull, Loops, enclosures};
pub use cost::cost;
pub use derive::{Answering, Asked, Form, Source, Wanted, answer, derive};
pub use differentiate::{DifferentiateError, Sweep, active_diffs, differentiate, reverse_is_plausible};
pub use fold::{fold, kernels, optimise};
pub use kinks::{KinkPlace, KinkReport, kinks};
pub use live::live;
pub use schedule::schedule;
pub use smooth::{Jump, Smoothed, Width, WidthError, kept_jumps, smooth};
pub use specialise::specialise;
pub use strict::{Suspect, suspects};
