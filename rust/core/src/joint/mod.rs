//! Models reduced to one joint, whose numbers alone change.

pub mod bilinear;
pub mod change;
pub mod reduction;
pub mod series;
pub mod sweep;
