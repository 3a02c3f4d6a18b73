//! Receptances of assemblies of beams, joints and point elements, with derivatives.
//!
//! Pure numerics: tables of numbers in, arrays of numbers out. See `receptance` and `natural_frequencies`.

mod block;
mod branch;
mod combine;
mod elementary;
mod error;
mod gradient;
mod joint_fit;
mod kernel;
mod lane;
mod model;
mod natural;
mod plane;
mod request;
mod response;
pub mod section;
mod sensitivity;
mod series;
mod small;
mod sweep;
mod threads;

pub use error::{Error, Result};
pub use joint_fit::{Fitted, REDUCTION_PLANES, joint_normal_matrix, reduce_joint};
pub use model::{GROUND_COLUMNS, JOINT_COLUMNS, MASS_COLUMNS, Model, Motion, Spring, Table, Tables};
pub use natural::{NaturalFrequencies, natural_frequencies};
pub use request::{Coordinate, Parameter, Request, Response};
pub use response::{instruction_set, receptance};
