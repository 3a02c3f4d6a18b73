//! The functions of the extension that fit a joint to reduced receptances.

use crate::arrays::{Lines, c_contiguous, contiguous, indices};
use crate::errors::{CoreError, detached};
use crate::functions::shaped;
use num_complex::Complex64;
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use receptance_core::{Observed, Reduced, Stop, Variables};

/// Columns of a spring.
const COLUMNS: usize = 7;

/// The columns of a joint.
pub(crate) fn seven(name: &str, values: &[f64]) -> PyResult<[f64; COLUMNS]> {
    <[f64; COLUMNS]>::try_from(values)
        .map_err(|_| PyValueError::new_err(format!("{name}: {} values, expected {COLUMNS}", values.len())))
}

/// A model reduced to one joint, with what was measured of it.
fn reduced<'a>(
    reduction: &'a PyReadonlyArray2<'_, f64>,
    angular_frequency: &'a Lines<'_>,
    measured: &'a PyReadonlyArray1<'_, Complex64>,
    weights: &'a PyReadonlyArray1<'_, f64>,
    reference: [f64; COLUMNS],
) -> PyResult<Reduced<'a>> {
    let found = Reduced::new(
        reduction.as_array().nrows(),
        c_contiguous("reduction", reduction)?,
        angular_frequency.frequencies(1.0)?,
        contiguous("measured", measured.as_slice())?,
        contiguous("weights", weights.as_slice())?,
        reference,
    );
    Ok(found.map_err(CoreError::from)?)
}

/// A^T A with A = [J | r] for the weighted complex log residual of a reduced model, (n + 1, n + 1).
#[pyfunction]
#[pyo3(signature = (reduction, angular_frequency, measured, weights, reference, joint, columns, slopes, threads))]
#[allow(clippy::too_many_arguments)]
pub fn joint_normal_matrix<'py>(
    py: Python<'py>,
    reduction: PyReadonlyArray2<'py, f64>,
    angular_frequency: Lines<'py>,
    measured: PyReadonlyArray1<'py, Complex64>,
    weights: PyReadonlyArray1<'py, f64>,
    reference: PyReadonlyArray1<'py, f64>,
    joint: PyReadonlyArray1<'py, f64>,
    columns: PyReadonlyArray1<'py, f64>,
    slopes: PyReadonlyArray1<'py, f64>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let columns = indices("columns", &columns)?;
    let slopes = contiguous("slopes", slopes.as_slice())?;
    if slopes.len() != columns.len() {
        let message = format!("slopes: {} values, expected {}", slopes.len(), columns.len());
        return Err(PyValueError::new_err(message));
    }
    let columns: Vec<(usize, f64)> = columns.into_iter().zip(slopes.iter().copied()).collect();
    let joint = seven("joint", contiguous("joint", joint.as_slice())?)?;
    let reference = seven("reference", contiguous("reference", reference.as_slice())?)?;
    let reduced = reduced(&reduction, &angular_frequency, &measured, &weights, reference)?;
    let matrix =
        detached(py, || reduced.normal_matrix(&joint, &columns, threads))?.map_err(CoreError::from)?;
    let size = columns.len() + 1;
    Ok(shaped(Array2::from_shape_vec((size, size), matrix))?.into_pyarray(py))
}

/// The weighted complex log residual of a reduced model, (2, n_freq): real and imaginary part.
#[pyfunction]
#[pyo3(signature = (reduction, angular_frequency, measured, weights, reference, joint, threads))]
#[allow(clippy::too_many_arguments)]
pub fn joint_residual<'py>(
    py: Python<'py>,
    reduction: PyReadonlyArray2<'py, f64>,
    angular_frequency: Lines<'py>,
    measured: PyReadonlyArray1<'py, Complex64>,
    weights: PyReadonlyArray1<'py, f64>,
    reference: PyReadonlyArray1<'py, f64>,
    joint: PyReadonlyArray1<'py, f64>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let joint = seven("joint", contiguous("joint", joint.as_slice())?)?;
    let reference = seven("reference", contiguous("reference", reference.as_slice())?)?;
    let reduced = reduced(&reduction, &angular_frequency, &measured, &weights, reference)?;
    let residual = detached(py, || reduced.residual(&joint, threads))?.map_err(CoreError::from)?;
    Ok(shaped(Array2::from_shape_vec((2, reduced.lines()), residual))?.into_pyarray(py))
}

/// Fits of one joint to several reduced receptances from many starts.
///
/// Lists have an entry a receptance. `references` and `joints` are (n, 7), `variables` too: the number of the
/// variable that a column of the joint is, or -1. `bounds` is (2, n_variables), `starts` (n_starts,
/// n_variables). Returns the variables at the ends, their cost, the evaluations, why they ended,
/// and the normal matrices over all variables and the residual, NaN where there is none.
#[pyfunction]
#[pyo3(signature = (reductions, angular_frequency, measured, weights, references, joints, variables, logarithmic, bounds, starts,
                    tolerance, evaluations, threads))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn fit_joint<'py>(
    py: Python<'py>,
    reductions: Vec<PyReadonlyArray2<'py, f64>>,
    angular_frequency: Vec<Lines<'py>>,
    measured: Vec<PyReadonlyArray1<'py, Complex64>>,
    weights: Vec<PyReadonlyArray1<'py, f64>>,
    references: PyReadonlyArray2<'py, f64>,
    joints: PyReadonlyArray2<'py, f64>,
    variables: PyReadonlyArray2<'py, f64>,
    logarithmic: PyReadonlyArray1<'py, bool>,
    bounds: PyReadonlyArray2<'py, f64>,
    starts: PyReadonlyArray2<'py, f64>,
    tolerance: f64,
    evaluations: usize,
    threads: usize,
) -> PyResult<(
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray3<f64>>,
)> {
    let rows = |name: &'static str, array: &'_ PyReadonlyArray2<'py, f64>| -> PyResult<Vec<[f64; COLUMNS]>> {
        let values = c_contiguous(name, array)?;
        if values.len() != COLUMNS * reductions.len() {
            let message = format!("{name}: {} values, expected {COLUMNS} a receptance", values.len());
            return Err(PyValueError::new_err(message));
        }
        values.chunks(COLUMNS).map(|row| seven(name, row)).collect()
    };
    let (references, joints) = (rows("references", &references)?, rows("joints", &joints)?);
    let numbers = rows("variables", &variables)?;
    let count = reductions.len();
    if [angular_frequency.len(), measured.len(), weights.len()] != [count; 3] {
        let message = "reductions, angular_frequency, measured and weights: expected lists of one length";
        return Err(PyValueError::new_err(message));
    }
    let mut observed = Vec::with_capacity(count);
    for i in 0..count {
        let reduced =
            reduced(&reductions[i], &angular_frequency[i], &measured[i], &weights[i], references[i])?;
        let variables = numbers[i].map(|number| (number >= 0.0).then_some(number as usize));
        observed.push(Observed { reduced, joint: joints[i], variables });
    }
    let logarithmic = contiguous("logarithmic", logarithmic.as_slice())?;
    let count = logarithmic.len();
    let bounds = c_contiguous("bounds", &bounds)?;
    if bounds.len() != 2 * count || starts.as_array().ncols() != count {
        let message = format!("bounds and starts: expected (2, {count}) and (n, {count})");
        return Err(PyValueError::new_err(message));
    }
    for (index, value) in bounds.iter().enumerate() {
        if value.is_nan() || (index < count && *value > bounds[index + count]) {
            return Err(PyValueError::new_err(format!(
                "bounds: {value} is no bound, or below is above above"
            )));
        }
    }
    let variables = Variables { logarithmic, lower: &bounds[..count], upper: &bounds[count..] };
    let starts = c_contiguous("starts", &starts)?;
    let stop = Stop { tolerance, evaluations };
    let ends = detached(py, || receptance_core::fit_joint(&observed, variables, starts, stop, threads))?
        .map_err(CoreError::from)?;
    let x: Vec<f64> = ends.iter().flat_map(|end| end.x.iter().copied()).collect();
    let mut normal = vec![f64::NAN; ends.len() * (count + 1) * (count + 1)];
    for (into, end) in normal.chunks_mut((count + 1) * (count + 1)).zip(&ends) {
        if end.normal.len() == into.len() {
            into.copy_from_slice(&end.normal);
        }
    }
    let integers = |each: fn(&receptance_core::End) -> i64| -> Vec<i64> { ends.iter().map(each).collect() };
    Ok((
        shaped(Array2::from_shape_vec((ends.len(), count), x))?.into_pyarray(py),
        ends.iter().map(|end| end.cost).collect::<Array1<f64>>().into_pyarray(py),
        Array1::from_vec(integers(|end| end.evaluations as i64)).into_pyarray(py),
        Array1::from_vec(integers(|end| end.status as i64)).into_pyarray(py),
        shaped(Array3::from_shape_vec((ends.len(), count + 1, count + 1), normal))?.into_pyarray(py),
    ))
}
