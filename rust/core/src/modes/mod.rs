//! Natural frequencies: counted and located without damping, and the determinant that is zero at the damped ones.

pub mod determinant;
pub mod locate;
pub mod natural;
