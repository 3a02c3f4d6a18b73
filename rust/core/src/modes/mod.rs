//! Natural frequencies: counted and located without damping, followed from there to complex ones, or searched for as
//! zeros of a determinant.

pub mod determinant;
pub mod locate;
pub mod natural;
pub mod poles;
pub mod sector;
