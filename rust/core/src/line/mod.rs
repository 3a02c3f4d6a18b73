//! Receptances and derivatives on blocks of frequency lines: sweeps over the tree.

pub mod amplitude;
pub mod block;
pub mod combine;
pub mod derivatives;
pub mod exponential;
pub mod four;
pub mod kernel;
pub mod layer;
pub mod overlap;
pub mod plane;
pub mod response;
pub mod signs;
pub mod sweep;
