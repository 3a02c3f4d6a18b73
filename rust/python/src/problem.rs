//! Least-squares problems: measured values beside models, with bounds and priors.

use crate::arrays::{
    c_contiguous, contiguous, index, indices, optional, response_and_excitation, shaped, spring, table,
};
use crate::errors::{CoreError, detached};
use crate::model::{ByLine, Lines};
use crate::sweeps::{JointReduction, TiedModel};
use num_complex::Complex64;
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use receptance_core::{
    Damping, End, Error, Measure, Modelled, Observation, OfJoint, Prior, Record, Residuals, Rows,
    SPRING_COLUMNS, Seen, Settings, Truncation, Variables,
};
use std::sync::{Arc, Mutex, PoisonError};

/// Everything that is fitted: observations as functions of variables, with bounds and priors.
///
/// Residuals are the weighted complex logarithm of measured over calculated receptance, calculated less measured
/// natural frequencies times their weights, given functions of the variables, and `scale` x - `offset` for each prior.
///
/// Parameters
/// ----------
/// logarithmic : (p,) bool
///     Whether a variable is the base-ten logarithm of its value.
/// bounds : (2, p)
///     Of the variables.
/// priors : (k, 3)
///     Variable, scale, offset.
/// threads : int
///     Most threads; 0 for all that the process may use.
/// smoothing : float, optional
///     Residuals well above it count by their absolute value, those below by their square; not for complex logarithms.
#[pyclass(module = "receptance._core")]
pub struct Problem {
    problem: receptance_core::Problem,
    threads: usize,
    raised: Raised,
}

/// The exception that a given function has raised.
type Raised = Arc<Mutex<Option<PyErr>>>;

/// Residuals from a Python function.
#[derive(Debug)]
struct Function {
    function: Py<PyAny>,
    raised: Raised,
}

/// Residuals (n,) and their derivatives by all variables (n, p).
type Returned<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>);

impl Function {
    /// The rows; nothing where there are none.
    fn call(&self, py: Python<'_>, x: &[f64]) -> PyResult<Option<Rows>> {
        let found = self.function.call1(py, (PyArray1::from_slice(py, x),))?;
        let Some((residual, jacobian)) = found.extract::<Option<Returned<'_>>>(py)? else { return Ok(None) };
        let residual = contiguous("residual", residual.as_slice())?.to_vec();
        if jacobian.shape() != [residual.len(), x.len()] {
            let (found, expected) = (jacobian.shape(), [residual.len(), x.len()]);
            return Err(PyValueError::new_err(format!(
                "jacobian: shape is {found:?}, expected {expected:?}"
            )));
        }
        Ok(Some(Rows { residual, jacobian: c_contiguous("jacobian", &jacobian)?.to_vec() }))
    }
}

impl Residuals for Function {
    fn rows(&self, x: &[f64]) -> receptance_core::Result<Rows> {
        let found = Python::attach(|py| self.call(py, x)).map_err(|error| {
            self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            Error::Interrupted
        })?;
        found.ok_or(Error::NoValue)
    }
}

/// Records of one receptance on the same lines.
///
/// Parameters
/// ----------
/// measured, weights : (n_records, n_freq)
///     Values, and one over the standard deviations of their logarithms.
/// percent : bool
///     Whether magnitudes are compared, in percent of the measured one, instead of logarithms.
/// end : float, optional
///     Time in s after the hit at which the records ended, where the structure still rang.
#[pyclass(frozen, module = "receptance._core")]
pub struct Records {
    records: Vec<Record>,
    measure: Measure,
    end: Option<f64>,
}

#[pymethods]
impl Records {
    #[new]
    #[pyo3(signature = (measured, weights, percent=false, end=None))]
    fn new(
        measured: PyReadonlyArray2<'_, Complex64>,
        weights: PyReadonlyArray2<'_, f64>,
        percent: bool,
        end: Option<f64>,
    ) -> PyResult<Self> {
        if measured.shape() != weights.shape() {
            let (found, expected) = (weights.shape(), measured.shape());
            return Err(PyValueError::new_err(format!("weights: shape is {found:?}, expected {expected:?}")));
        }
        let width = measured.shape()[1];
        if width == 0 {
            return Err(PyValueError::new_err("measured: there is no line, expected at least one"));
        }
        let measured = c_contiguous("measured", &measured)?.chunks(width);
        let weights = c_contiguous("weights", &weights)?.chunks(width);
        let record = |(measured, weights): (&[Complex64], &[f64])| Record {
            measured: measured.to_vec(),
            weights: weights.to_vec(),
        };
        let measure = if percent { Measure::Percent } else { Measure::Logarithm };
        Ok(Self { records: measured.zip(weights).map(record).collect(), measure, end })
    }

    /// The lines in rad/s on which the structure is evaluated for records on some lines.
    fn evaluated<'py>(&self, py: Python<'py>, lines: &Lines) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        let w = lines.angular(py)?;
        let found = self.truncation(&w)?.map_or(w, |truncation| truncation.lines(0.0));
        Ok(Array1::from_vec(found).into_pyarray(py))
    }
}

impl Records {
    fn truncation(&self, w: &[Complex64]) -> PyResult<Option<Truncation>> {
        let truncation = self.end.map(|end| Truncation::new(w, end)).transpose();
        Ok(truncation.map_err(CoreError::from)?)
    }
}

/// Where fits ended.
///
/// Attributes
/// ----------
/// x : (n_starts, p)
///     The variables.
/// cost, first : (n_starts,)
///     Half the sum of squares at the ends and at the starts.
/// evaluations : (n_starts,)
///     Of the normal matrix.
/// status : (n_starts,)
///     As SciPy's `least_squares`; -1 where the model has no value at the start.
/// normal : (n_starts, p + 1, p + 1)
///     A^T A with A = [J | r] at the ends or a last step away; NaN where there is none.
#[pyclass(frozen, get_all, module = "receptance._core")]
pub struct Ends {
    x: Py<PyArray2<f64>>,
    cost: Py<PyArray1<f64>>,
    first: Py<PyArray1<f64>>,
    evaluations: Py<PyArray1<i64>>,
    status: Py<PyArray1<i64>>,
    normal: Py<PyArray3<f64>>,
}

#[pymethods]
impl Problem {
    #[new]
    #[pyo3(signature = (logarithmic, bounds, priors, threads, smoothing=None))]
    fn new(
        logarithmic: PyReadonlyArray1<'_, bool>,
        bounds: PyReadonlyArray2<'_, f64>,
        priors: PyReadonlyArray2<'_, f64>,
        threads: usize,
        smoothing: Option<f64>,
    ) -> PyResult<Self> {
        let logarithmic = contiguous("logarithmic", logarithmic.as_slice())?.to_vec();
        let (count, bounds) = (logarithmic.len(), c_contiguous("bounds", &bounds)?);
        if bounds.len() != 2 * count {
            return Err(PyValueError::new_err(format!(
                "bounds: {} values, expected (2, {count})",
                bounds.len()
            )));
        }
        let (lower, upper) = (bounds[..count].to_vec(), bounds[count..].to_vec());
        let mut known = Vec::new();
        for row in table("priors", &priors, 3)?.chunks_exact(3) {
            known.push(Prior { variable: index("priors", row[0])?, scale: row[1], offset: row[2] });
        }
        let variables = Variables { logarithmic, lower, upper };
        let problem = receptance_core::Problem::new(variables, known, smoothing).map_err(CoreError::from)?;
        Ok(Self { problem, threads, raised: Raised::default() })
    }

    /// Number of lines of all receptances.
    #[getter]
    fn lines(&self) -> usize {
        self.problem.lines()
    }

    /// Adds receptances between two coordinates (response, excitation) of a model; `by_line` has tables of terminals and
    /// forces on the lines.
    #[pyo3(signature = (model, lines, points, records, by_line=None))]
    fn add_receptance(
        &mut self,
        py: Python<'_>,
        model: &TiedModel,
        lines: &Lines,
        points: PyReadonlyArray2<'_, f64>,
        records: &Records,
        by_line: Option<&ByLine>,
    ) -> PyResult<()> {
        let [response, excitation] = response_and_excitation(&points)?;
        let w = lines.angular(py)?;
        let truncation = records.truncation(&w)?;
        let (beyond, force) = ByLine::given(by_line);
        let (measure, records) = (records.measure, records.records.clone());
        let seen = Seen::Receptance { measure, w, records, response, excitation, beyond, force, truncation };
        self.add(Observation::Whole(Modelled { tied: model.tied.clone(), seen }))
    }

    /// Adds natural frequencies in rad/s of a model; `modes` are ascending numbers, counted from 0.
    ///
    /// With `damping_ratio` (n_modes,), NaN where it is not known, frequencies are compared with the moduli of complex
    /// ones instead of undamped ones, and the residuals of the damping ratios follow those of the frequencies.
    #[pyo3(signature = (model, modes, measured, weights, damping_ratio=None, damping_weights=None))]
    #[allow(clippy::too_many_arguments)]
    fn add_frequencies(
        &mut self,
        model: &TiedModel,
        modes: PyReadonlyArray1<'_, f64>,
        measured: PyReadonlyArray1<'_, f64>,
        weights: PyReadonlyArray1<'_, f64>,
        damping_ratio: Option<PyReadonlyArray1<'_, f64>>,
        damping_weights: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<()> {
        let ratios = optional("damping_ratio", damping_ratio.as_ref())?;
        let of_ratios = optional("damping_weights", damping_weights.as_ref())?;
        let expected = if ratios.is_empty() { 0 } else { modes.len() };
        for (name, found) in [("damping_ratio", ratios.len()), ("damping_weights", of_ratios.len())] {
            if found != expected {
                return Err(PyValueError::new_err(format!("{name}: {found} values, expected {expected}")));
            }
        }
        let both = ratios.into_iter().zip(of_ratios).enumerate();
        let damping = both.map(|(place, (ratio, weight))| Damping { place, ratio, weight });
        let seen = Seen::Frequencies {
            modes: indices("modes", &modes)?,
            measured: contiguous("measured", measured.as_slice())?.to_vec(),
            weights: contiguous("weights", weights.as_slice())?.to_vec(),
            damping: damping.filter(|one| !one.ratio.is_nan()).collect(),
        };
        self.add(Observation::Whole(Modelled { tied: model.tied.clone(), seen }))
    }

    /// Adds a receptance of a model that is reduced to one joint.
    ///
    /// `joint` (7,) are the columns of the joint, `variables` (7,) the number of the variable that each one is, or -1.
    fn add_joint_receptance(
        &mut self,
        model: &JointReduction,
        joint: PyReadonlyArray1<'_, f64>,
        variables: PyReadonlyArray1<'_, f64>,
        measured: PyReadonlyArray1<'_, Complex64>,
        weights: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<()> {
        let mut numbers = [None; SPRING_COLUMNS];
        for (number, value) in numbers.iter_mut().zip(spring("variables", &variables)?) {
            *number = if value == -1.0 { None } else { Some(index("variables", value)?) };
        }
        let record = Record {
            measured: contiguous("measured", measured.as_slice())?.to_vec(),
            weights: contiguous("weights", weights.as_slice())?.to_vec(),
        };
        let (reduction, joint) = (model.reduction.clone(), spring("joint", &joint)?);
        self.add(Observation::Joint(OfJoint { reduction, record, joint, variables: numbers }))
    }

    /// Adds residuals `matrix` (x - `centre`) of the variables x (p,), with a matrix (n, p).
    fn add_linear(
        &mut self,
        matrix: PyReadonlyArray2<'_, f64>,
        centre: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<()> {
        let matrix = table("matrix", &matrix, self.problem.count())?.to_vec();
        let centre = self.right("centre", contiguous("centre", centre.as_slice())?)?.to_vec();
        self.add(Observation::Linear { matrix, centre })
    }

    /// Adds residuals that a function of the variables (p,) returns: residuals (n,) and their derivatives (n, p), or None
    /// where there are none.
    fn add_function(&mut self, function: Py<PyAny>) -> PyResult<()> {
        self.add(Observation::Given(Arc::new(Function { function, raised: self.raised.clone() })))
    }

    /// Number of the first observation that has no value at a point, as they were added, and the reason; None if all have.
    fn reason(&self, py: Python<'_>, x: PyReadonlyArray1<'_, f64>) -> PyResult<Option<(usize, String)>> {
        let x = self.point(&x)?;
        let found = self.detached(py, || self.problem.reason(x, self.threads))?;
        Ok(found.map(|(index, error)| (index, error.to_string())))
    }

    /// The same problem with about so many lines of each receptance.
    fn thinned(&self, lines: usize) -> Self {
        Self { problem: self.problem.thinned(lines), threads: self.threads, raised: self.raised.clone() }
    }

    /// A^T A with A = [J | r], (p + 1, p + 1); NaN where a model has no value.
    fn normal_matrix<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let x = self.point(&x)?;
        let size = x.len() + 1;
        let found = self
            .detached(py, || self.problem.normal_matrix(x, &vec![true; x.len()], self.threads))?
            .unwrap_or(vec![f64::NAN; size * size]);
        Ok(shaped(Array2::from_shape_vec((size, size), found))?.into_pyarray(py))
    }

    /// Residuals, those of priors last, and their derivatives by the variables that are `free`; None where a model has no
    /// value.
    #[allow(clippy::type_complexity)]
    fn rows<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'py, f64>,
        free: PyReadonlyArray1<'py, bool>,
    ) -> PyResult<Option<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)>> {
        let (x, free) = (self.point(&x)?, self.free(&free)?);
        let Some(found) = self.detached(py, || self.problem.rows(x, free, self.threads))? else {
            return Ok(None);
        };
        let shape = (found.residual.len(), free.iter().filter(|free| **free).count());
        let jacobian = shaped(Array2::from_shape_vec(shape, found.jacobian))?;
        Ok(Some((Array1::from_vec(found.residual).into_pyarray(py), jacobian.into_pyarray(py))))
    }

    /// Fits from each row of `starts` (n_starts, p), with at most so many `evaluations` (n_starts,) from each; variables
    /// that are not `free` are held where they start.
    ///
    /// A fit ends where cost or variables change by less than `tolerance`, relatively, or where the predicted decrease
    /// of the next step is at most `least`. `of_all` keeps the rows and columns of held variables in normal matrices.
    #[pyo3(signature = (starts, free, evaluations, tolerance, least=0.0, of_all=false))]
    #[allow(clippy::too_many_arguments)]
    fn fit(
        &self,
        py: Python<'_>,
        starts: PyReadonlyArray2<'_, f64>,
        free: PyReadonlyArray1<'_, bool>,
        evaluations: PyReadonlyArray1<'_, i64>,
        tolerance: f64,
        least: f64,
        of_all: bool,
    ) -> PyResult<Ends> {
        let count = self.problem.count();
        if starts.shape()[1] != count {
            return Err(PyValueError::new_err(format!("starts: expected {count} columns")));
        }
        let (starts, free) = (c_contiguous("starts", &starts)?, self.free(&free)?);
        let most = contiguous("evaluations", evaluations.as_slice())?;
        let most: Vec<usize> = most.iter().map(|&most| usize::try_from(most).unwrap_or(0)).collect();
        let settings = Settings { tolerance, least, of_all };
        let ends = self.detached(py, || self.problem.fit(starts, free, &most, settings, self.threads))?;
        let x: Vec<f64> = ends.iter().flat_map(|end| end.x.iter().copied()).collect();
        let size = (count + 1) * (count + 1);
        let mut normal = vec![f64::NAN; ends.len() * size];
        for (into, end) in normal.chunks_mut(size).zip(&ends) {
            if end.normal.len() == size {
                into.copy_from_slice(&end.normal);
            }
        }
        let integers = |each: fn(&End) -> i64| -> Vec<i64> { ends.iter().map(each).collect() };
        let normal = shaped(Array3::from_shape_vec((ends.len(), count + 1, count + 1), normal))?;
        Ok(Ends {
            x: shaped(Array2::from_shape_vec((ends.len(), count), x))?.into_pyarray(py).unbind(),
            cost: ends.iter().map(|end| end.cost).collect::<Array1<f64>>().into_pyarray(py).unbind(),
            first: ends.iter().map(|end| end.first).collect::<Array1<f64>>().into_pyarray(py).unbind(),
            evaluations: Array1::from_vec(integers(|end| end.evaluations as i64)).into_pyarray(py).unbind(),
            status: Array1::from_vec(integers(|end| end.status as i64)).into_pyarray(py).unbind(),
            normal: normal.into_pyarray(py).unbind(),
        })
    }
}

impl Problem {
    fn add(&mut self, one: Observation) -> PyResult<()> {
        Ok(self.problem.add(one).map_err(CoreError::from)?)
    }

    /// Does the work without holding the interpreter; raises what a given function has raised.
    fn detached<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce() -> receptance_core::Result<T> + Send,
    ) -> PyResult<T> {
        let found = detached(py, work);
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(found, Err)
    }

    fn point<'a>(&self, x: &'a PyReadonlyArray1<'_, f64>) -> PyResult<&'a [f64]> {
        self.right("x", contiguous("x", x.as_slice())?)
    }

    fn free<'a>(&self, free: &'a PyReadonlyArray1<'_, bool>) -> PyResult<&'a [bool]> {
        self.right("free", contiguous("free", free.as_slice())?)
    }

    fn right<'a, T>(&self, name: &str, values: &'a [T]) -> PyResult<&'a [T]> {
        let (found, expected) = (values.len(), self.problem.count());
        if found == expected {
            return Ok(values);
        }
        Err(PyValueError::new_err(format!("{name}: {found} values, expected {expected}")))
    }
}
