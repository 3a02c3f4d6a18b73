//! Least-squares problems and their solution.

pub mod least_squares;
pub mod problem;
