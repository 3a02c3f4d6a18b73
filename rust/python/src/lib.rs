//! The extension `receptance._core`: handles that are built and checked once, arrays in, arrays out, errors mapped.
//!
//! `Lines` are frequencies. `Model` is an assembly; it calculates receptances and natural frequencies. `JointReduction`
//! is a model of which one joint varies, `TiedModel` one of which any parameters do; both are swept. `Problem` is a
//! least-squares problem: measured values and reduced or tied models, with priors and bounds.

mod arrays;
mod errors;
mod model;
mod problem;
mod sweeps;

use pyo3::prelude::*;

/// Receptances of beam and joint assemblies: the compiled core.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::errors::{GrossSlipError, Halt, ReceptanceError, ResonanceError, SingularInterfaceError};
    #[pymodule_export]
    use super::model::{ByLine, Lines, Model, instruction_set, joint_stiffness, modal_receptance};
    #[pymodule_export]
    use super::problem::{Ends, Problem, Records};
    #[pymodule_export]
    use super::sweeps::{JointReduction, ModelSweep, TiedModel};
}
