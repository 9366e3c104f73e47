//! The one small graph that everything meets in: a regionalised value state dependence graph (Reissmann et al.,
//! *RVSDG: An Intermediate Representation for Optimizing Compilers*, 2020) over scalars, and the table of its
//! operations. Knows nothing of source text, and of targets only the instruction names in the table.
//!
//! A [`Graph`] is one flat list of nodes. Operands precede users, so index order is a topological order and every
//! analysis is a loop from left to right or back. Two structures own regions, which are marked in the list:
//!
//! ```text
//! %4 = gamma %3            branch on the bool %3
//!   …                      the side for true
//! %7 = else
//!   …                      the side for false
//! %9 = end
//! %10 = join %9 %5 %8      %5 if the condition held, else %8
//!
//! %4 = theta %2 %3         counted loop: from the int %2 up to, not including, %3
//! %5 = counter %4
//! %6 = carried %4 %1       %1 at first, then what its `final` names
//!   …
//! %9 = end
//! %10 = final %9 %6 %8     the content of %6 after the last iteration; %8 is what an iteration gives it
//! %11 = tape %9 %6 10      the content of %6 in every tenth iteration; the trip count must be constant
//! %12 = recall %11 %0      if %0 is 0 its content in the first iteration, if 1 in the eleventh, …
//! ```
//!
//! A node may use any earlier node of its own region and of the regions around it; `join`, `final` and `tape` alone
//! look into the regions that their `end` has closed. Every operation is total and has no effect, so running a side or
//! an iteration too much is never wrong, only slow.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod builder;
mod enclosure;
mod graph;
mod kernels;
mod numbers;
pub mod ops;
mod reference;
mod structure;
mod text;
mod verify;

pub use builder::{Builder, Exhausted, Mode};
pub use enclosure::{Enclosure, Facts, Range};
pub use graph::{Args, Graph, Input, Node, NodeId, Origin, Output, Part};
pub use numbers::{Precision, Scalar, Value};
pub use ops::{Op, OpDef};
pub use reference::{Evaluator, evaluate};
pub use structure::{PerNode, Structure, Unready, Work};
pub use text::{ParseError, parse, print};
pub use verify::{Verified, VerifyError, verify};

/// Watches a compilation for its caller. The compiler has no clock of its own.
pub trait Watch {
    /// Called when a step of the pipeline begins.
    fn step(&self, name: &'static str) {
        let _ = name;
    }

    /// Whether the compilation should stop; asked at least every 4,096 nodes.
    fn expired(&self) -> bool {
        false
    }
}

/// A watch that never stops anything.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwatched;

impl Watch for Unwatched {}
