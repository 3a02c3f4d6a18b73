//! The extension `receptance._core`: arrays in, arrays out, errors mapped; nothing else.

mod arrays;
mod campaigns;
mod errors;
mod fits;
mod functions;
mod sweeps;

use pyo3::prelude::*;

/// Receptances of beam and joint assemblies: the compiled core.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::campaigns::{fit_models, models_normal_matrix, models_rows};
    #[pymodule_export]
    use super::errors::{ReceptanceError, ResonanceError, SingularInterfaceError};
    #[pymodule_export]
    use super::fits::{fit_joint, joint_normal_matrix, joint_residual};
    #[pymodule_export]
    use super::functions::{instruction_set, log_determinant, natural_frequencies, receptance, reduce_joint};
    #[pymodule_export]
    use super::sweeps::{sweep_joint, sweep_joint_misfit, sweep_models, sweep_models_misfit};
}
