//! Isograd's compiler: Vola source text and a request in, an artefact out. The steps are in [`pipeline`], which is
//! what to read first. Pure: no I/O, no threads, no clock; files come through a [`Loader`], time through a [`Watch`].

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod artefact;
mod differentiability;
mod emit;
mod explain;
mod inspect;
mod interface;
mod kinks;
mod loader;
mod migrate;
pub mod pipeline;
mod request;
mod rewrite;
mod seal;
mod strict;
mod wanted;
mod within;

pub use artefact::{
    Abi, Artefact, Bindings, Buffers, Column, ColumnType, Derivatives, FunctionAbi, Manifest, Memory, Number, Port,
    Specialised,
};
pub use differentiability::{Differentiability, InvalidSensitivity, Sensitivity};
pub use explain::explain;
pub use inspect::inspect;
pub use interface::{Argument, ArgumentColumn, Role, arguments};
pub use isograd_graph::ops::Family;
pub use isograd_graph::{Precision, Unwatched, Watch};
pub use isograd_program::{Loader, ModulePath, ScalarKind, Type};
pub use isograd_syntax::{Code, Diagnostic, Files, Limit, Limits, Severity, UnknownCode, render};
pub use kinks::Kink;
pub use loader::{MemoryLoader, WithStd, standard_library};
pub use migrate::migrate;
pub use pipeline::{Checked, Export, Options, Parameter, STEPS, check, compile, print_step};
pub use request::{
    DerivativeMode, FORMS, Form, Query, QueryForm, Rate, Request, Target, Tolerance, UnknownQuery, Wrt, query_forms,
};
pub use rewrite::{Malformed, rewrite};
pub use within::{InvalidWithin, Within};
