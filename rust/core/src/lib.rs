//! Receptances of assemblies of beams, joints and point elements, with derivatives.
//!
//! Pure numerics: tables of numbers in, arrays of numbers out. See `receptance` and `natural_frequencies`.

mod beside;
mod bilinear;
mod block;
mod branch;
mod combine;
mod determinant;
mod elementary;
mod error;
mod four;
mod frequencies;
mod gradient;
mod inertia;
mod interrupt;
mod joint_change;
mod joint_fit;
mod joint_hoist;
mod joint_kernel;
mod joint_series;
mod joint_sweep;
mod kernel;
mod lane;
mod layer;
mod layer_energy;
mod least_squares;
mod locate;
mod minors;
mod model;
mod model_normal;
mod model_rows;
mod model_sweep;
mod natural;
mod observed;
mod outputs;
pub mod overlap;
mod plane;
mod problem;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod properties;
mod reduction;
mod request;
mod response;
mod rigid;
pub mod section;
mod sensitivity;
mod series;
mod small;
mod sweep;
mod taylor;
mod threads;
mod ties;
mod tip;
mod trust_region;

pub use determinant::log_determinant;
pub use error::{Error, Result};
pub use frequencies::{Frequencies, OwnedFrequencies};
pub use interrupt::interruptible;
pub use joint_fit::SPRING_COLUMNS;
pub use joint_sweep::{JointSweep, Misfit};
pub use least_squares::{End, Status, Stop};
pub use model::{GROUND_COLUMNS, JOINT_COLUMNS, MASS_COLUMNS, Model, Motion, Spring, Table, Tables};
pub use model_sweep::ModelSweep;
pub use natural::{NaturalFrequencies, natural_frequencies};
pub use observed::{Factor, Modelled, Record, Seen};
pub use problem::{Observation, OfJoint, Prior, Problem, Residuals, Rows, Settings, Variables};
pub use reduction::{Form, JointReduction, reduce_joint};
pub use request::{Coordinate, Parameter, Request, Response, Terminals};
pub use response::{instruction_set, receptance};
pub use ties::{Rate, Tied};
