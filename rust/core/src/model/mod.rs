//! Tables, lines and requests, checked.

pub mod assembly;
pub mod collocation;
pub mod cone;
pub mod damping;
pub mod frequencies;
pub mod overlap;
pub mod request;
pub mod section;
pub mod slip;
pub mod spring;
pub mod terminals;
