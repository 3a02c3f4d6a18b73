//! The functions of the extension that evaluate many candidates in one call.

use crate::arrays::{Lines, c_contiguous, contiguous, response_and_excitation, table};
use crate::campaigns::{Ties, tied};
use crate::errors::{CoreError, detached};
use crate::fits::seven;
use num_complex::Complex64;
use numpy::{
    Element, IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use receptance_core::{JointSweep, Misfit, ModelSweep, Result};

/// Columns of a joint.
const COLUMNS: usize = 7;

/// Where receptances or their magnitudes go, (n_joints, n_freq).
#[derive(FromPyObject)]
pub enum Output<'py> {
    /// Receptances.
    Complex(PyReadwriteArray2<'py, Complex64>),
    /// Magnitudes.
    Real(PyReadwriteArray2<'py, f64>),
}

impl Output<'_> {
    /// Lets the core write receptances or magnitudes into an output of the shape it should have.
    fn fill(
        self,
        py: Python<'_>,
        shape: [usize; 2],
        receptances: impl FnOnce(&mut [Complex64]) -> Result<()> + Send,
        magnitudes: impl FnOnce(&mut [f64]) -> Result<()> + Send,
    ) -> PyResult<()> {
        match self {
            Self::Complex(mut out) => {
                let out = filled(&mut out, shape)?;
                detached(py, || receptances(out))?
            }
            Self::Real(mut out) => {
                let out = filled(&mut out, shape)?;
                detached(py, || magnitudes(out))?
            }
        }
        .map_err(CoreError::from)?;
        Ok(())
    }
}

/// Fills `out` (n_joints, n_freq) with the receptance of each joint in the place of the one that a model was reduced
/// to, or with magnitudes where it is real; rows of NaN where a joint is none.
#[pyfunction]
#[pyo3(signature = (reduction, angular_frequency, reference, joints, out, threads))]
pub fn sweep_joint<'py>(
    py: Python<'py>,
    reduction: PyReadonlyArray2<'py, f64>,
    angular_frequency: Lines<'py>,
    reference: PyReadonlyArray1<'py, f64>,
    joints: PyReadonlyArray2<'py, f64>,
    out: Output<'py>,
    threads: usize,
) -> PyResult<()> {
    let sweep = joint_sweep(&reduction, &angular_frequency, &reference)?;
    let joints = table("joints", &joints, COLUMNS)?;
    out.fill(
        py,
        [joints.len() / COLUMNS, sweep.lines()],
        |out| sweep.receptances(joints, out, threads),
        |out| sweep.magnitudes(joints, out, threads),
    )
}

/// The misfit (n_joints,) of each joint in the place of the one that a model was reduced to: the sum over the lines of
/// |weight log(measured / H)|^2, or of |weight (measured - H)|^2 where that is not `logarithmic`; NaN where it is none.
#[pyfunction]
#[pyo3(signature = (reduction, angular_frequency, reference, joints, measured, weights, logarithmic, threads))]
#[allow(clippy::too_many_arguments)]
pub fn sweep_joint_misfit<'py>(
    py: Python<'py>,
    reduction: PyReadonlyArray2<'py, f64>,
    angular_frequency: Lines<'py>,
    reference: PyReadonlyArray1<'py, f64>,
    joints: PyReadonlyArray2<'py, f64>,
    measured: PyReadonlyArray1<'py, Complex64>,
    weights: PyReadonlyArray1<'py, f64>,
    logarithmic: bool,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let sweep = joint_sweep(&reduction, &angular_frequency, &reference)?;
    let joints = table("joints", &joints, COLUMNS)?;
    let measured = contiguous("measured", measured.as_slice())?;
    let weights = contiguous("weights", weights.as_slice())?;
    let misfit = kind(logarithmic);
    let found = detached(py, || sweep.misfits(joints, measured, weights, misfit, threads))?
        .map_err(CoreError::from)?;
    Ok(found.into_pyarray(py))
}

fn joint_sweep<'a>(
    reduction: &'a PyReadonlyArray2<'_, f64>,
    angular_frequency: &'a Lines<'_>,
    reference: &'a PyReadonlyArray1<'_, f64>,
) -> PyResult<JointSweep<'a>> {
    let found = JointSweep::new(
        reduction.as_array().nrows(),
        c_contiguous("reduction", reduction)?,
        angular_frequency.frequencies(1.0)?,
        &seven("reference", contiguous("reference", reference.as_slice())?)?,
    );
    Ok(found.map_err(CoreError::from)?)
}

/// Fills `out` (n_candidates, n_freq) with the receptance of each row of `values` (n_candidates, n_addresses) of a model
/// tied to addresses, or with magnitudes where it is real; rows of NaN where there is no model or no finite value.
#[pyfunction]
#[pyo3(signature = (ties, points, angular_frequency, values, out, threads))]
pub fn sweep_models<'py>(
    py: Python<'py>,
    ties: Ties<'py>,
    points: PyReadonlyArray2<'py, f64>,
    angular_frequency: Lines<'py>,
    values: PyReadonlyArray2<'py, f64>,
    out: Output<'py>,
    threads: usize,
) -> PyResult<()> {
    let (rows, count) = (values.shape()[0], values.shape()[1]);
    let (tied, lines) = (tied(&ties, count)?, angular_frequency.frequencies(1.0)?);
    let [response, excitation] = response_and_excitation(&points)?;
    let sweep = ModelSweep::new(&tied, count, lines, response, excitation);
    let values = c_contiguous("values", &values)?;
    out.fill(
        py,
        [rows, lines.len()],
        |out| sweep.receptances(values, out, threads),
        |out| sweep.magnitudes(values, out, threads),
    )
}

/// The misfit (n_candidates,) of each row of `values`, see `sweep_models` and `sweep_joint_misfit`.
#[pyfunction]
#[pyo3(signature = (ties, points, angular_frequency, values, measured, weights, logarithmic, threads))]
#[allow(clippy::too_many_arguments)]
pub fn sweep_models_misfit<'py>(
    py: Python<'py>,
    ties: Ties<'py>,
    points: PyReadonlyArray2<'py, f64>,
    angular_frequency: Lines<'py>,
    values: PyReadonlyArray2<'py, f64>,
    measured: PyReadonlyArray1<'py, Complex64>,
    weights: PyReadonlyArray1<'py, f64>,
    logarithmic: bool,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let count = values.shape()[1];
    let (tied, lines) = (tied(&ties, count)?, angular_frequency.frequencies(1.0)?);
    let [response, excitation] = response_and_excitation(&points)?;
    let sweep = ModelSweep::new(&tied, count, lines, response, excitation);
    let values = c_contiguous("values", &values)?;
    let measured = contiguous("measured", measured.as_slice())?;
    let weights = contiguous("weights", weights.as_slice())?;
    let misfit = kind(logarithmic);
    let found = detached(py, || sweep.misfits(values, measured, weights, misfit, threads))?
        .map_err(CoreError::from)?;
    Ok(found.into_pyarray(py))
}

fn kind(logarithmic: bool) -> Misfit {
    if logarithmic { Misfit::Logarithm } else { Misfit::Difference }
}

/// An output in C order of the shape it should have.
fn filled<'a, T: Element>(
    out: &'a mut PyReadwriteArray2<'_, T>,
    [rows, lines]: [usize; 2],
) -> PyResult<&'a mut [T]> {
    let found = out.shape();
    if found != [rows, lines] {
        let message = format!("out: shape is {found:?}, expected ({rows}, {lines})");
        return Err(PyValueError::new_err(message));
    }
    if !out.is_c_contiguous() {
        return Err(PyValueError::new_err("out: expected a C-contiguous array"));
    }
    contiguous("out", out.as_slice_mut())
}
