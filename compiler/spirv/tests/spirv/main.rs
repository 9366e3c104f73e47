//! SPIR-V modules: what they look like, that the Khronos tools accept them, that limits and lints are noticed. What they
//! compute is run elsewhere, where there is a device.

#![allow(clippy::pedantic, reason = "tests")]

#[path = "../../../graph/tests/garden/mod.rs"]
mod garden;
mod library;
mod limits;
mod lints;
mod modules;
mod texts;
mod tools;
