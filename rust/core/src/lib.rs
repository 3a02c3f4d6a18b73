//! Receptances of assemblies of beams, joints and point elements, with derivatives.
//!
//! Pure numerics: tables of numbers in, arrays of numbers out. Each folder uses those above it in this drawing.
//!
//! ```text
//! simd       complex numbers and D x D blocks over lanes, one frequency line a lane
//! model      tables f64[rows, columns] -> Model (checked tree); Request, Frequencies -> checked against it
//!   |        segments with their coefficients per length
//! series     whole free branches -> one power series in w^2 (minors of the plane at the branch's end)
//!   |
//! line       Job: one plan per root; tasks of LINES_PER_TASK lines over threads; Block: the elements on some lanes
//!   |        sweep up: 2 x 2 plane of every subtree; sweep down: states under each load -> H; derivatives -> dH
//! modes      counts of pivots -> natural frequencies -> complex ones with the damping; all zeros of a determinant
//! joint      all but one joint evaluated once -> H of many joints, and their sweeps
//! observe    Tied: variables -> tables; record, factors and weights beside H, dH -> residuals, J^T J, J^T r
//! fit        Problem: observations and priors -> normal matrix -> trust-region steps within bounds -> End
//! ```

mod error;
mod fit;
mod interrupt;
mod joint;
mod line;
mod model;
mod modes;
mod observe;
mod series;
mod simd;
mod threads;

pub use error::{Error, Result};
pub use fit::least_squares::{End, Status, Stop};
pub use fit::problem::{Observation, Prior, Problem, Residuals, Settings, Variables};
pub use interrupt::{Halt, interruptible};
pub use joint::reduction::{Form, JointReduction, reduce_joint};
pub use joint::sweep::{JointSweep, Misfit, Sweep};
pub use line::amplitude::receptance;
pub use line::response::instruction_set;
pub use model::assembly::{Model, TABLES, Table, Tables};
pub use model::frequencies::{Frequencies, OwnedFrequencies};
pub use model::request::{Coordinate, Parameter, Request, Response};
pub use model::section::{Motion, column::UNIFORM as UNIFORM_COLUMNS};
pub use model::spring::{SPRING_COLUMNS, Spring};
pub use model::terminals::{Mode, TERMINAL_ENTRIES, modal_sum};
pub use modes::natural::{NaturalFrequencies, natural_frequencies};
pub use modes::poles::{ComplexFrequencies, complex_frequencies};
pub use modes::sector::{Poles, Sector, poles};
pub use observe::joint::OfJoint;
pub use observe::lines::Rows;
pub use observe::observed::{Damping, Measure, Modelled, Record, Seen};
pub use observe::sweep::ModelSweep;
pub use observe::ties::{Factor, Rate, Tied};
pub use observe::truncation::Truncation;
