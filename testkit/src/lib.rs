//! Oracles, laws and point sets: everything that can prove a number wrong (DESIGN 11).
//!
//! The oracles are independent of what they judge: `differences` knows values only, `dual` has an operation set of its
//! own, `models` are formulas by hand. None of them calls the derivative rules of the op table, `differentiate` or
//! the kernels. The `laws` are functions over what they quantify over; tests, fuzz targets and the gate call the same
//! ones.

pub mod corpus;
pub mod differences;
pub mod dual;
pub mod exact;
pub mod gpu;
pub mod hyperdual;
pub mod laws;
pub mod library;
pub mod models;
pub mod points;
pub mod programs;
pub mod random;
pub mod soundness;
#[cfg(feature = "run")]
pub mod wasm;
