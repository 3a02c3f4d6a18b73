//! Errors of the core as Python exceptions.

use pyo3::exceptions::{PyException, PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use receptance_core::Error;

create_exception!(
    receptance._core,
    ReceptanceError,
    PyException,
    "Physics that cannot be solved: the base of the library's own exceptions."
);
create_exception!(
    receptance._core,
    SingularInterfaceError,
    ReceptanceError,
    "An interface between two parts whose stiffness matrix cannot be inverted."
);
create_exception!(
    receptance._core,
    ResonanceError,
    ReceptanceError,
    "A receptance that is not finite: an undamped resonance met exactly."
);

/// Lets `?` turn the core's errors into Python's.
pub struct CoreError(Error);

impl From<Error> for CoreError {
    fn from(error: Error) -> Self {
        Self(error)
    }
}

impl From<CoreError> for PyErr {
    fn from(CoreError(error): CoreError) -> Self {
        let text = error.to_string();
        match error {
            Error::SingularInterface { .. } => SingularInterfaceError::new_err(text),
            Error::Resonance { .. } => ResonanceError::new_err(text),
            Error::Threads { .. } => PyRuntimeError::new_err(text),
            Error::Quantity { .. }
            | Error::Frequency { .. }
            | Error::Waves { .. }
            | Error::Layer { .. }
            | Error::Topology(_)
            | Error::Index { .. }
            | Error::NaturalFrequency(_) => PyValueError::new_err(text),
        }
    }
}
