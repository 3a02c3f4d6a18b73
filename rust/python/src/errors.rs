//! Errors of the core as Python exceptions.

use core::cell::RefCell;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::{PyErr, PyResult, Python, create_exception, pyclass, pymethods};
use receptance_core::{Error, Result, interruptible};

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

create_exception!(
    receptance._core,
    GrossSlipError,
    ReceptanceError,
    "A joint of which the whole interface slides under the given force: nothing describes what follows."
);

thread_local! {
    /// The exception that a signal handler has raised during a call.
    static RAISED: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Does the work without holding the interpreter; a signal whose handler raises an exception ends it.
///
/// # Errors
/// That exception, or an error of the core.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    let found = py.detach(|| interruptible(signalled, work));
    RAISED.take().map_or_else(|| Ok(found.map_err(CoreError)?), Err)
}

/// Whether the handler of a signal that has arrived raised an exception, which is kept.
fn signalled() -> bool {
    Python::attach(|py| py.check_signals().map_err(|error| RAISED.replace(Some(error))).is_err())
}

/// A flag that ends calls in the threads that have joined it. Signals reach the main thread alone, so that calls in other
/// threads would run to their end after a KeyboardInterrupt.
#[pyclass(frozen, module = "receptance._core")]
#[derive(Default)]
pub struct Halt(receptance_core::Halt);

#[pymethods]
impl Halt {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// From now on calls in this thread raise KeyboardInterrupt when the flag is set.
    fn join(&self) {
        self.0.join();
    }

    /// Set the flag.
    fn set(&self) {
        self.0.set();
    }
}

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
            Error::GrossSlip { .. } => GrossSlipError::new_err(text),
            Error::ComplexFrequency(_) => ReceptanceError::new_err(text),
            Error::Interrupted => PyKeyboardInterrupt::new_err(text),
            Error::Threads { .. } => PyRuntimeError::new_err(text),
            Error::NoValue
            | Error::Quantity { .. }
            | Error::Frequency { .. }
            | Error::Waves { .. }
            | Error::Layer { .. }
            | Error::Topology(_)
            | Error::Index { .. }
            | Error::NaturalFrequency(_) => PyValueError::new_err(text),
        }
    }
}
