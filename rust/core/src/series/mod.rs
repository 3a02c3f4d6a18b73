//! Whole branches as power series in w^2.

pub mod branch;
pub mod cone;
pub mod minors;
