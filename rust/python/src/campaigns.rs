//! The functions of the extension that fit parameters of whole models.

use crate::arrays::{c_contiguous, contiguous, index, indices, parameter, response_and_excitation, table};
use crate::errors::{CoreError, detached};
use crate::functions::shaped;
use num_complex::Complex64;
use numpy::ndarray::{Array1, Array2};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use receptance_core::{
    Campaign, Factor, GROUND_COLUMNS, JOINT_COLUMNS, Known, MASS_COLUMNS, Modelled, Rate, Record, Seen, Stop,
    Tables, Tied, Variables, overlap, section,
};

type Row<'py, T> = PyReadonlyArray1<'py, T>;
type Rows<'py> = PyReadonlyArray2<'py, f64>;

/// Tables, entries that move and how fast, addresses, factors (kind, address), entries through which frequency acts.
pub(crate) type Ties<'py> =
    ((Rows<'py>, Rows<'py>, Rows<'py>, Rows<'py>, Rows<'py>), Rows<'py>, Rows<'py>, Rows<'py>, Rows<'py>);

/// Lines, measured and weights (a row a record), coordinates (response, excitation), ties.
type Receptance<'py> =
    (Row<'py, Complex64>, PyReadonlyArray2<'py, Complex64>, Rows<'py>, Rows<'py>, Ties<'py>);

/// Modes, measured, weights, ties.
type Frequencies<'py> = (Row<'py, f64>, Row<'py, f64>, Row<'py, f64>, Ties<'py>);

/// Tables as functions of so many unknowns.
pub(crate) fn tied<'a>(ties: &'a Ties, count: usize) -> PyResult<Tied<'a>> {
    let ((segments, joints, masses, grounds, overlaps), rates, addresses, factors, powers) = ties;
    let tables = Tables {
        segments: table("segments", segments, section::column::COUNT)?,
        joints: table("joints", joints, JOINT_COLUMNS)?,
        masses: table("masses", masses, MASS_COLUMNS)?,
        grounds: table("grounds", grounds, GROUND_COLUMNS)?,
        overlaps: table("overlaps", overlaps, overlap::column::COUNT)?,
    };
    let mut found = Vec::new();
    for row in table("rates", rates, 5)?.chunks_exact(5) {
        let address = if row[3] >= 0.0 && row[3].fract() == 0.0 { row[3] as usize } else { usize::MAX };
        found.push(Rate { entry: parameter(&row[..3])?, address, rate: row[4] });
    }
    let width = 2 + 2 * count;
    let kinds =
        [Factor::LogGain, Factor::Delay, Factor::DecayRate(2), Factor::DecayRate(1), Factor::DecayRate(0)];
    let mut between = Vec::new();
    for row in table("factors", factors, 2)?.chunks_exact(2) {
        let [kind, address] = [index("factors", row[0])?, index("factors", row[1])?];
        let kind =
            kinds.get(kind).ok_or_else(|| PyValueError::new_err("factors: the kind is none of 0 to 4"))?;
        between.push((*kind, address));
    }
    let mut through = Vec::new();
    for row in table("powers", powers, 4)?.chunks_exact(4) {
        through.push((parameter(&row[..3])?, row[3]));
    }
    let tied = Tied::new(tables, &found, table("addresses", addresses, width)?, count);
    Ok(tied.and_then(|tied| tied.with_factors(between, through)).map_err(CoreError::from)?)
}

/// The rows of a table with a row a record.
fn records<'a, T: numpy::Element>(name: &str, array: &'a PyReadonlyArray2<'_, T>) -> PyResult<Vec<&'a [T]>> {
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(format!("{name}: expected a C-contiguous array")));
    }
    Ok(contiguous(name, array.as_slice())?.chunks(array.shape()[1].max(1)).collect())
}

fn variables<'a>(
    logarithmic: &'a PyReadonlyArray1<'_, bool>,
    bounds: &'a PyReadonlyArray2<'_, f64>,
) -> PyResult<Variables<'a>> {
    let logarithmic = contiguous("logarithmic", logarithmic.as_slice())?;
    let (count, bounds) = (logarithmic.len(), c_contiguous("bounds", bounds)?);
    if bounds.len() != 2 * count {
        return Err(PyValueError::new_err(format!("bounds: {} values, expected (2, {count})", bounds.len())));
    }
    for (index, value) in bounds.iter().enumerate() {
        if value.is_nan() || (index < count && *value > bounds[index + count]) {
            let message = format!("bounds: {value} is no bound, or below is above above");
            return Err(PyValueError::new_err(message));
        }
    }
    Ok(Variables { logarithmic, lower: &bounds[..count], upper: &bounds[count..] })
}

fn campaign<'a>(
    receptances: &'a [Receptance],
    frequencies: &'a [Frequencies],
    modes: &'a [Vec<usize>],
    priors: &'a Rows,
    variables: Variables<'a>,
) -> PyResult<Campaign<'a>> {
    let count = variables.logarithmic.len();
    let mut observed = Vec::new();
    for (w, measured, weights, points, ties) in receptances {
        let [response, excitation] = response_and_excitation(points)?;
        let (measured, weights) = (records("measured", measured)?, records("weights", weights)?);
        if measured.len() != weights.len() {
            let message = format!("weights: {} records, expected {}", weights.len(), measured.len());
            return Err(PyValueError::new_err(message));
        }
        let pairs = measured.into_iter().zip(weights);
        let records = pairs.map(|(measured, weights)| Record { measured, weights }).collect();
        let w = contiguous("angular_frequency", w.as_slice())?;
        let seen = Seen::Receptance { w, records, response, excitation };
        observed.push(Modelled { tied: tied(ties, count)?, seen });
    }
    for ((_, measured, weights, ties), modes) in frequencies.iter().zip(modes) {
        if modes.is_empty() || !modes.is_sorted() {
            return Err(PyValueError::new_err("modes: expected ascending numbers, at least one"));
        }
        let seen = Seen::Frequencies {
            modes,
            measured: contiguous("measured", measured.as_slice())?,
            weights: contiguous("weights", weights.as_slice())?,
        };
        observed.push(Modelled { tied: tied(ties, count)?, seen });
    }
    let mut known = Vec::new();
    for row in table("priors", priors, 3)?.chunks_exact(3) {
        let variable = if row[0] >= 0.0 && row[0].fract() == 0.0 { row[0] as usize } else { usize::MAX };
        known.push(Known { variable, scale: row[1], offset: row[2] });
    }
    let campaign = Campaign { observed, known, variables };
    campaign.check().map_err(CoreError::from)?;
    Ok(campaign)
}

fn modes_of(frequencies: &[Frequencies]) -> PyResult<Vec<Vec<usize>>> {
    frequencies.iter().map(|one| indices("modes", &one.0)).collect()
}

/// A^T A with A = [J | r] for the residuals of whole models, (n + 1, n + 1); NaN where a model has no value.
#[pyfunction]
#[pyo3(signature = (receptances, frequencies, priors, logarithmic, bounds, variables, threads))]
#[allow(clippy::too_many_arguments)]
pub fn models_normal_matrix<'py>(
    py: Python<'py>,
    receptances: Vec<Receptance<'py>>,
    frequencies: Vec<Frequencies<'py>>,
    priors: Rows<'py>,
    logarithmic: Row<'py, bool>,
    bounds: Rows<'py>,
    variables: Row<'py, f64>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let modes = modes_of(&frequencies)?;
    let space = self::variables(&logarithmic, &bounds)?;
    let count = space.logarithmic.len();
    let campaign = campaign(&receptances, &frequencies, &modes, &priors, space)?;
    let x = contiguous("variables", variables.as_slice())?;
    if x.len() != count {
        return Err(PyValueError::new_err(format!("variables: {} values, expected {count}", x.len())));
    }
    let size = count + 1;
    let found = detached(py, || campaign.normal_matrix(x, &vec![true; count], threads))?
        .unwrap_or(vec![f64::NAN; size * size]);
    Ok(shaped(Array2::from_shape_vec((size, size), found))?.into_pyarray(py))
}

/// Residuals of whole models and their derivatives by variables that are `free`; nothing where a model has no value.
#[pyfunction]
#[pyo3(signature = (receptances, frequencies, logarithmic, bounds, free, variables, threads))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn models_rows<'py>(
    py: Python<'py>,
    receptances: Vec<Receptance<'py>>,
    frequencies: Vec<Frequencies<'py>>,
    logarithmic: Row<'py, bool>,
    bounds: Rows<'py>,
    free: Row<'py, bool>,
    variables: Row<'py, f64>,
    threads: usize,
) -> PyResult<Option<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)>> {
    let modes = modes_of(&frequencies)?;
    let space = self::variables(&logarithmic, &bounds)?;
    let count = space.logarithmic.len();
    let priors = Array2::<f64>::zeros((0, 3)).into_pyarray(py).readonly();
    let campaign = campaign(&receptances, &frequencies, &modes, &priors, space)?;
    let (x, free) = (contiguous("variables", variables.as_slice())?, contiguous("free", free.as_slice())?);
    if x.len() != count || free.len() != count {
        return Err(PyValueError::new_err(format!("variables: {} values, expected {count}", x.len())));
    }
    let Some(found) = detached(py, || campaign.rows(x, free, threads))? else { return Ok(None) };
    let shape = (found.residual.len(), free.iter().filter(|free| **free).count());
    let jacobian = shaped(Array2::from_shape_vec(shape, found.jacobian))?;
    Ok(Some((Array1::from_vec(found.residual).into_pyarray(py), jacobian.into_pyarray(py))))
}

/// Fits of parameters of whole models from many starts, with variables that are not `free` held.
///
/// Returns the variables at the ends, their cost, the evaluations and why they ended.
#[pyfunction]
#[pyo3(signature = (receptances, frequencies, priors, logarithmic, bounds, free, starts, tolerance, evaluations,
                    threads))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn fit_models<'py>(
    py: Python<'py>,
    receptances: Vec<Receptance<'py>>,
    frequencies: Vec<Frequencies<'py>>,
    priors: Rows<'py>,
    logarithmic: Row<'py, bool>,
    bounds: Rows<'py>,
    free: Row<'py, bool>,
    starts: Rows<'py>,
    tolerance: f64,
    evaluations: usize,
    threads: usize,
) -> PyResult<(
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
)> {
    let modes = modes_of(&frequencies)?;
    let space = variables(&logarithmic, &bounds)?;
    let count = space.logarithmic.len();
    let campaign = campaign(&receptances, &frequencies, &modes, &priors, space)?;
    if starts.shape()[1] != count {
        return Err(PyValueError::new_err(format!("starts: expected {count} columns")));
    }
    let starts = c_contiguous("starts", &starts)?;
    let free = contiguous("free", free.as_slice())?;
    let stop = Stop { tolerance, evaluations };
    let ends = detached(py, || receptance_core::fit_models(&campaign, free, starts, stop, threads))?
        .map_err(CoreError::from)?;
    let x: Vec<f64> = ends.iter().flat_map(|end| end.x.iter().copied()).collect();
    let integers = |each: fn(&receptance_core::End) -> i64| -> Vec<i64> { ends.iter().map(each).collect() };
    Ok((
        shaped(Array2::from_shape_vec((ends.len(), count), x))?.into_pyarray(py),
        ends.iter().map(|end| end.cost).collect::<Array1<f64>>().into_pyarray(py),
        Array1::from_vec(integers(|end| end.evaluations as i64)).into_pyarray(py),
        Array1::from_vec(integers(|end| end.status as i64)).into_pyarray(py),
    ))
}
