//! Kernels of the transcendental functions (LANGUAGE 17.4): fragments of exactly rounded operations, the same on
//! every target. They know their argument and the precision, and nothing of lanes, targets or the host's library.
//!
//! Each kernel reduces its argument to a small interval (Cody and Waite, *Software Manual for the Elementary
//! Functions*, 1980), evaluates a minimax polynomial there (coefficients by the second algorithm of Remez in 260-bit
//! arithmetic, weighted by the relative error of the result, then rounded one after the other) and undoes the
//! reduction. Where one rounding too many would show, sums and products carry their rounding errors along (Dekker,
//! *A floating-point technique for extending the available precision*, 1971). Everything is computed in the precision of
//! the graph and without branches: both sides of a choice are evaluated, so each side must be harmless on the
//! arguments of the other.

mod arc;
mod exp;
mod hyperbolic;
mod pow;
mod smooth;
mod trig;
mod write;

pub use arc::{acos, asin, atan, atan2};
pub use exp::{exp, exp2, log, log2};
pub use hyperbolic::{acosh, asinh, atanh, cosh, sinh, tanh};
pub use pow::pow;
pub use smooth::{sigmoid, softplus};
pub use trig::{cos, sin, tan};
