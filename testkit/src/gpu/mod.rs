//! What shaders compute: bit for bit where the target promises that, within propagated bounds of error elsewhere. Knows
//! artefacts and graphs; knows nothing of how a shader is written.

#[cfg(feature = "run")]
pub mod bits;
pub mod bounds;
