//! Modules, names, concepts and types: syntax trees become a typed program. Knows nothing of graphs.

mod builtins;
pub mod typed;
mod types;

pub use builtins::{Builtin, Group, LATER};
pub use typed::Program;
pub use types::{ScalarKind, Type};
