//! Modules, names, concepts and types: syntax trees become a typed program. Knows nothing of graphs.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod builtins;
mod check;
mod load;
mod names;
mod print;
mod report;
mod sound;
mod suggest;
pub mod typed;
mod types;

pub use builtins::{Builtin, Group};
pub use check::{Checked, check};
pub use load::{Loaded, Loader, Module, ModulePath, load};
pub use print::print;
pub use typed::Program;
pub use types::{ScalarKind, Type};
