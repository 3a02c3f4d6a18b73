//! The functions of the extension.

use crate::arrays::{Lines, contiguous, coordinates, indices, model, parameters};
use crate::errors::{CoreError, detached};
use num_complex::Complex64;
use numpy::ndarray::{Array1, Array2, Array3, Array4, ShapeError};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArray4, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use receptance_core::{Request, Terminals, receptance as core_receptance};

/// An internal error instead of a panic where a shape does not fit.
pub(crate) fn shaped<T>(result: Result<T, ShapeError>) -> PyResult<T> {
    result.map_err(|error| PyRuntimeError::new_err(format!("internal error: {error}")))
}

/// The values of an array, none where there is none.
fn numbers(name: &str, array: Option<&PyReadonlyArray1<'_, Complex64>>) -> PyResult<Vec<Complex64>> {
    array.map_or(Ok(Vec::new()), |array| Ok(contiguous(name, array.as_slice())?.to_vec()))
}

/// Nodes of terminals, and what is beyond them.
fn terminals(
    nodes: Option<&PyReadonlyArray1<'_, f64>>,
    beyond: Option<&PyReadonlyArray1<'_, Complex64>>,
) -> PyResult<Terminals> {
    let nodes = nodes.map_or(Ok(Vec::new()), |nodes| indices("terminals", nodes))?;
    Ok(Terminals { nodes, beyond: numbers("beyond", beyond)? })
}

/// Receptance (n_freq, n_responses, n_excitations) and its derivative (..., n_parameters).
///
/// The lines times `scale` are angular frequencies in rad/s. `added`, flat of (n_freq, n_joints, 2), is complex
/// stiffness besides that of the columns; `beyond`, flat of (n_freq, n_terminals, 3), the receptance of what is beyond
/// the nodes in `terminals`.
#[pyfunction]
#[pyo3(signature = (angular_frequency, motion, segments, joints, masses, grounds, excitations, responses,
                    parameters, threads, overlaps=None, scale=1.0, added=None, terminals=None, beyond=None))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn receptance<'py>(
    py: Python<'py>,
    angular_frequency: Lines<'py>,
    motion: usize,
    segments: PyReadonlyArray2<'py, f64>,
    joints: PyReadonlyArray2<'py, f64>,
    masses: PyReadonlyArray2<'py, f64>,
    grounds: PyReadonlyArray2<'py, f64>,
    excitations: PyReadonlyArray2<'py, f64>,
    responses: PyReadonlyArray2<'py, f64>,
    parameters: PyReadonlyArray2<'py, f64>,
    threads: usize,
    overlaps: Option<PyReadonlyArray2<'py, f64>>,
    scale: f64,
    added: Option<PyReadonlyArray1<'py, Complex64>>,
    terminals: Option<PyReadonlyArray1<'py, f64>>,
    beyond: Option<PyReadonlyArray1<'py, Complex64>>,
) -> PyResult<(Bound<'py, PyArray3<Complex64>>, Bound<'py, PyArray4<Complex64>>)> {
    let lines = angular_frequency.frequencies(scale)?;
    let model = model(motion, &segments, &joints, &masses, &grounds, overlaps.as_ref())?;
    let request = Request {
        excitations: coordinates("excitations", &excitations)?,
        responses: coordinates("responses", &responses)?,
        parameters: self::parameters(&parameters)?,
        joint: None,
        added: numbers("added", added.as_ref())?,
        terminals: self::terminals(terminals.as_ref(), beyond.as_ref())?,
    };
    let result =
        detached(py, || core_receptance(&model, &lines, &request, threads))?.map_err(CoreError::from)?;
    let (n, p) = (lines.len(), request.parameters.len());
    let (rows, columns) = (request.responses.len(), request.excitations.len());
    let h = shaped(Array3::from_shape_vec((n, rows, columns), result.receptance))?;
    let dh = shaped(Array4::from_shape_vec((n, rows, columns, p), result.derivative))?;
    Ok((h.into_pyarray(py), dh.into_pyarray(py)))
}

/// Undamped natural angular frequencies up to a limit, and their derivatives (n_modes, n_parameters).
#[pyfunction]
#[pyo3(signature = (upper, most, motion, segments, joints, masses, grounds, parameters, overlaps=None))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn natural_frequencies<'py>(
    py: Python<'py>,
    upper: f64,
    most: usize,
    motion: usize,
    segments: PyReadonlyArray2<'py, f64>,
    joints: PyReadonlyArray2<'py, f64>,
    masses: PyReadonlyArray2<'py, f64>,
    grounds: PyReadonlyArray2<'py, f64>,
    parameters: PyReadonlyArray2<'py, f64>,
    overlaps: Option<PyReadonlyArray2<'py, f64>>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)> {
    let model = model(motion, &segments, &joints, &masses, &grounds, overlaps.as_ref())?;
    let parameters = self::parameters(&parameters)?;
    let found = detached(py, || receptance_core::natural_frequencies(&model, upper, most, &parameters))?
        .map_err(CoreError::from)?;
    let shape = (found.angular.len(), parameters.len());
    let derivative = shaped(Array2::from_shape_vec(shape, found.derivative))?;
    Ok((Array1::from_vec(found.angular).into_pyarray(py), derivative.into_pyarray(py)))
}

/// Logarithm of the determinant whose zeros are the complex natural angular frequencies, up to a constant and
/// multiples of 2 pi i; NaN where it is zero. `added` as in `receptance`.
#[pyfunction]
#[pyo3(signature = (angular_frequency, motion, segments, joints, masses, grounds, overlaps=None, added=None))]
#[allow(clippy::too_many_arguments)]
pub fn log_determinant<'py>(
    py: Python<'py>,
    angular_frequency: Lines<'py>,
    motion: usize,
    segments: PyReadonlyArray2<'py, f64>,
    joints: PyReadonlyArray2<'py, f64>,
    masses: PyReadonlyArray2<'py, f64>,
    grounds: PyReadonlyArray2<'py, f64>,
    overlaps: Option<PyReadonlyArray2<'py, f64>>,
    added: Option<PyReadonlyArray1<'py, Complex64>>,
) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
    let lines = angular_frequency.frequencies(1.0)?;
    let model = model(motion, &segments, &joints, &masses, &grounds, overlaps.as_ref())?;
    let added = numbers("added", added.as_ref())?;
    let found = detached(py, || receptance_core::log_determinant(&model, &lines, &added))?
        .map_err(CoreError::from)?;
    Ok(Array1::from_vec(found).into_pyarray(py))
}

/// Name of the instruction set that the kernels run on here.
#[pyfunction]
pub fn instruction_set() -> String {
    receptance_core::instruction_set()
}

/// Reduction of a model to one joint, for `joint_normal_matrix`: real planes (16, n_freq), or where they serve
/// power series in w^2, (29, n_terms). `scale`, `terminals` and `beyond` as in `receptance`.
#[pyfunction]
#[pyo3(signature = (angular_frequency, segments, joints, masses, grounds, joint, response, excitation, threads,
                    overlaps=None, scale=1.0, terminals=None, beyond=None))]
#[allow(clippy::too_many_arguments)]
pub fn reduce_joint<'py>(
    py: Python<'py>,
    angular_frequency: Lines<'py>,
    segments: PyReadonlyArray2<'py, f64>,
    joints: PyReadonlyArray2<'py, f64>,
    masses: PyReadonlyArray2<'py, f64>,
    grounds: PyReadonlyArray2<'py, f64>,
    joint: usize,
    response: PyReadonlyArray2<'py, f64>,
    excitation: PyReadonlyArray2<'py, f64>,
    threads: usize,
    overlaps: Option<PyReadonlyArray2<'py, f64>>,
    scale: f64,
    terminals: Option<PyReadonlyArray1<'py, f64>>,
    beyond: Option<PyReadonlyArray1<'py, Complex64>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let lines = angular_frequency.frequencies(scale)?;
    let model = model(0, &segments, &joints, &masses, &grounds, overlaps.as_ref())?;
    let one = |name: &str, array: &PyReadonlyArray2<'py, f64>| {
        let points = coordinates(name, array)?;
        match points[..] {
            [point] => Ok(point),
            _ => Err(PyValueError::new_err(format!("{name}: {} rows, expected one", points.len()))),
        }
    };
    let (response, excitation) = (one("response", &response)?, one("excitation", &excitation)?);
    let ends = self::terminals(terminals.as_ref(), beyond.as_ref())?;
    let found = detached(py, || {
        receptance_core::reduce_joint(&model, joint, &lines, response, excitation, ends, threads)
    })?
    .map_err(CoreError::from)?;
    let shape = (found.rows, found.values.len() / found.rows);
    Ok(shaped(Array2::from_shape_vec(shape, found.values))?.into_pyarray(py))
}
