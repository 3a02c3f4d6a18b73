//! Measurements compared with the model: residuals and their normal matrices.

pub mod joint;
pub mod lines;
pub mod observed;
pub mod sweep;
pub mod ties;
pub mod truncation;
