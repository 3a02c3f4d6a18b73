//! Models of which some parameters vary, evaluated for many candidates in one call.

use crate::arrays::{contiguous, filled, response_and_excitation, shaped, table};
use crate::errors::{CoreError, detached};
use crate::model::{ByLine, Lines};
use num_complex::Complex64;
use numpy::ndarray::Array2;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use receptance_core::{Coordinate, JointSweep, Misfit, OwnedFrequencies, Sweep, Tied};
use std::sync::Arc;

/// Receptances (complex) or their magnitudes (real), (n_candidates, n_freq).
#[derive(FromPyObject)]
pub enum Output<'py> {
    /// Receptances.
    Complex(PyReadwriteArray2<'py, Complex64>),
    /// Magnitudes.
    Real(PyReadwriteArray2<'py, f64>),
}

/// Rows of candidates of a sweep, and their name in messages.
struct Candidates<'a, 'py>(&'static str, &'a PyReadonlyArray2<'py, f64>);

impl Candidates<'_, '_> {
    /// Fills an output with their receptances or magnitudes.
    fn fill(&self, py: Python<'_>, sweep: &impl Sweep, out: Output<'_>, threads: usize) -> PyResult<()> {
        let values = table(self.0, self.1, sweep.columns())?;
        let shape = [self.1.shape()[0], sweep.lines()];
        match out {
            Output::Complex(mut out) => {
                let out = filled(&mut out, shape)?;
                detached(py, || sweep.receptances(values, out, threads))
            }
            Output::Real(mut out) => {
                let out = filled(&mut out, shape)?;
                detached(py, || sweep.magnitudes(values, out, threads))
            }
        }
    }

    /// Their misfits.
    fn misfit<'py>(
        &self,
        py: Python<'py>,
        sweep: &impl Sweep,
        measured: &PyReadonlyArray1<'_, Complex64>,
        weights: &PyReadonlyArray1<'_, f64>,
        logarithmic: bool,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = table(self.0, self.1, sweep.columns())?;
        let measured = contiguous("measured", measured.as_slice())?;
        let weights = contiguous("weights", weights.as_slice())?;
        let misfit = if logarithmic { Misfit::Logarithm } else { Misfit::Difference };
        Ok(detached(py, || sweep.misfits(values, measured, weights, misfit, threads))?.into_pyarray(py))
    }
}

/// A model on some lines of which one joint varies; everything else is evaluated once.
#[pyclass(frozen, module = "receptance._core")]
pub struct JointReduction {
    pub reduction: Arc<receptance_core::JointReduction>,
}

impl JointReduction {
    /// A handle of a reduction.
    pub fn new(reduction: receptance_core::JointReduction) -> Self {
        Self { reduction: Arc::new(reduction) }
    }
}

#[pymethods]
impl JointReduction {
    fn __len__(&self) -> usize {
        self.reduction.lines()
    }

    /// H_0, F_r (2), F_e (2) and Y (3) of (T7), real and imaginary parts, (16, n_freq); None where the model is kept as
    /// power series.
    fn planes<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(planes) = self.reduction.planes() else { return Ok(None) };
        let shape = (planes.len() / self.reduction.lines().max(1), self.reduction.lines());
        Ok(Some(shaped(Array2::from_shape_vec(shape, planes.to_vec()))?.into_pyarray(py)))
    }

    /// Fills `out` (n_joints, n_freq) with the receptance of each row of `joints` (n_joints, 7), or with magnitudes where
    /// it is real; rows of NaN where a joint is invalid.
    fn fill(
        &self,
        py: Python<'_>,
        joints: PyReadonlyArray2<'_, f64>,
        out: Output<'_>,
        threads: usize,
    ) -> PyResult<()> {
        let sweep = JointSweep::new(&self.reduction).map_err(CoreError::from)?;
        Candidates("joints", &joints).fill(py, &sweep, out, threads)
    }

    /// The misfit (n_joints,) of each row of `joints`: the sum over the lines of |weight log(measured / H)|^2, or of
    /// |weight (measured - H)|^2 if not `logarithmic`; NaN where a joint is invalid.
    fn misfit<'py>(
        &self,
        py: Python<'py>,
        joints: PyReadonlyArray2<'py, f64>,
        measured: PyReadonlyArray1<'py, Complex64>,
        weights: PyReadonlyArray1<'py, f64>,
        logarithmic: bool,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let sweep = JointSweep::new(&self.reduction).map_err(CoreError::from)?;
        Candidates("joints", &joints).misfit(py, &sweep, &measured, &weights, logarithmic, threads)
    }
}

/// A model as a function of unknowns, see `Model.tied`.
#[pyclass(frozen, module = "receptance._core")]
pub struct TiedModel {
    pub tied: Arc<Tied>,
}

impl TiedModel {
    /// A handle of a tied model.
    pub fn new(tied: Tied) -> Self {
        Self { tied: Arc::new(tied) }
    }
}

#[pymethods]
impl TiedModel {
    /// The model between two coordinates (response, excitation) on some lines, for many values of its unknowns.
    #[pyo3(signature = (lines, points, by_line=None))]
    fn sweep(
        &self,
        py: Python<'_>,
        lines: &Lines,
        points: PyReadonlyArray2<'_, f64>,
        by_line: Option<&ByLine>,
    ) -> PyResult<ModelSweep> {
        let [response, excitation] = response_and_excitation(&points)?;
        let beyond = ByLine::beyond(by_line)?;
        Ok(ModelSweep {
            tied: self.tied.clone(),
            frequencies: lines.copied(py)?,
            response,
            excitation,
            beyond,
        })
    }
}

/// A model between two coordinates on some lines, as a function of unknowns.
#[pyclass(frozen, module = "receptance._core")]
pub struct ModelSweep {
    tied: Arc<Tied>,
    frequencies: OwnedFrequencies,
    response: Coordinate,
    excitation: Coordinate,
    beyond: Vec<Complex64>,
}

impl ModelSweep {
    fn sweep(&self) -> receptance_core::ModelSweep<'_> {
        receptance_core::ModelSweep::new(
            &self.tied,
            self.frequencies.view(),
            self.response,
            self.excitation,
            self.beyond.clone(),
        )
    }
}

#[pymethods]
impl ModelSweep {
    fn __len__(&self) -> usize {
        self.frequencies.view().len()
    }

    /// As `JointReduction.fill`, for rows of `values` (n_candidates, n_unknowns).
    fn fill(
        &self,
        py: Python<'_>,
        values: PyReadonlyArray2<'_, f64>,
        out: Output<'_>,
        threads: usize,
    ) -> PyResult<()> {
        Candidates("values", &values).fill(py, &self.sweep(), out, threads)
    }

    /// As `JointReduction.misfit`, for rows of `values` (n_candidates, n_unknowns).
    fn misfit<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray2<'py, f64>,
        measured: PyReadonlyArray1<'py, Complex64>,
        weights: PyReadonlyArray1<'py, f64>,
        logarithmic: bool,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Candidates("values", &values).misfit(py, &self.sweep(), &measured, &weights, logarithmic, threads)
    }
}
