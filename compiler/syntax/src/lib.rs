//! Vola source text: files and spans, diagnostics and limits, lexer, parser and tree. Knows nothing of what names
//! and types mean.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod diagnostic;
mod format;
pub mod lexer;
mod limits;
mod parser;
mod print;
pub mod render;
mod sink;
mod span;
pub mod tree;

pub use diagnostic::{Code, Diagnostic, Label, Severity, UnknownCode};
pub use format::format;
pub use limits::{Limit, Limits};
pub use parser::{Parsed, parse};
pub use print::print;
pub use sink::{Diagnostics, Report};
pub use span::{FileId, Files, SourceFile, Span};
