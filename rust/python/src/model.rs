//! Frequency lines, and models: receptances, natural frequencies, reductions to one joint.

use crate::arrays::{contiguous, coordinates, index, numbers, parameter, parameters, shaped, table};
use crate::errors::{CoreError, detached};
use crate::sweeps::{JointReduction, TiedModel};
use num_complex::Complex64;
use numpy::ndarray::{Array1, Array2, Array3, Array4};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArray4, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use receptance_core::{
    Factor, Form, Frequencies, GROUND_COLUMNS, JOINT_COLUMNS, MASS_COLUMNS, MODE_COLUMNS, Mode, Motion,
    OwnedFrequencies, Rate, Request, TERMINAL_COLUMNS, TERMINAL_ENTRIES, Table, Tables, Tied, overlap,
    section,
};

/// Name of the instruction set that the kernels use on this machine.
#[pyfunction]
pub fn instruction_set() -> String {
    receptance_core::instruction_set()
}

/// The receptance of modes (n, 6) at one plane on some lines, (n_freq, 3): y over force, theta over moment, y over moment.
///
/// A mode is a row of `Model.with_terminals` without the terminal.
#[pyfunction]
pub fn modal_receptance<'py>(
    py: Python<'py>,
    lines: &Lines,
    modes: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
    let rows = table("modes", &modes, MODE_COLUMNS - 1)?.chunks_exact(MODE_COLUMNS - 1).enumerate();
    let modes: Vec<Mode> = rows
        .map(|(row, values)| Mode::new(values, row))
        .collect::<Result<_, _>>()
        .map_err(CoreError::from)?;
    let read = lines.read(py)?;
    let lines = lines.frequencies(&read)?;
    let found = detached(py, || receptance_core::modal_sum(&modes, &lines))?.map_err(CoreError::from)?;
    Ok(shaped(Array2::from_shape_vec((lines.len(), TERMINAL_ENTRIES), found))?.into_pyarray(py))
}

/// Frequency lines, real or complex; times `scale` they are angular frequencies in rad/s. The array is not copied.
#[pyclass(frozen, module = "receptance._core")]
pub struct Lines {
    given: Given,
    scale: f64,
}

#[derive(FromPyObject)]
enum Given {
    Real(Py<PyArray1<f64>>),
    Complex(Py<PyArray1<Complex64>>),
}

/// An array that no one writes to while it is read.
pub enum Read<'py> {
    Real(PyReadonlyArray1<'py, f64>),
    Complex(PyReadonlyArray1<'py, Complex64>),
}

#[pymethods]
impl Lines {
    #[new]
    #[pyo3(signature = (angular_frequency, scale=1.0))]
    fn new(angular_frequency: Given, scale: f64) -> Self {
        Self { given: angular_frequency, scale }
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.frequencies(&self.read(py)?)?.len())
    }
}

impl Lines {
    /// Holds the array for reading.
    pub fn read<'py>(&self, py: Python<'py>) -> PyResult<Read<'py>> {
        let taken = |_| PyValueError::new_err("angular_frequency: another call is writing to this array");
        Ok(match &self.given {
            Given::Real(lines) => Read::Real(lines.bind(py).try_readonly().map_err(taken)?),
            Given::Complex(lines) => Read::Complex(lines.bind(py).try_readonly().map_err(taken)?),
        })
    }

    /// The lines of an array that is held.
    pub fn frequencies<'a>(&self, read: &'a Read<'_>) -> PyResult<Frequencies<'a>> {
        Ok(match read {
            Read::Real(lines) => {
                Frequencies::real(contiguous("angular_frequency", lines.as_slice())?, self.scale)
            }
            Read::Complex(lines) => {
                Frequencies::complex(contiguous("angular_frequency", lines.as_slice())?, self.scale)
            }
        })
    }

    /// A copy of the lines.
    pub fn copied(&self, py: Python<'_>) -> PyResult<OwnedFrequencies> {
        Ok(self.frequencies(&self.read(py)?)?.every(1))
    }
}

/// Properties of a model that differ from line to line.
///
/// `added`, flat of (n_freq, n_joints, 2), is complex stiffness in y and theta besides that of the joints' columns.
/// `beyond`, flat of (n_freq, n_terminals, 3), is receptance of the terminals besides that of their modes and constants:
/// y over force, theta over moment and y over moment.
#[pyclass(frozen, module = "receptance._core")]
#[derive(Clone, Default)]
pub struct ByLine {
    added: Vec<Complex64>,
    beyond: Vec<Complex64>,
}

impl ByLine {
    /// Tables of terminals, for calls that take nothing else.
    pub fn beyond(by_line: Option<&Self>) -> PyResult<Vec<Complex64>> {
        match by_line {
            Some(by_line) if !by_line.added.is_empty() => Err(PyValueError::new_err(
                "by_line: added stiffness is not possible here, only tables of terminals",
            )),
            _ => Ok(by_line.map(|by_line| by_line.beyond.clone()).unwrap_or_default()),
        }
    }
}

#[pymethods]
impl ByLine {
    #[new]
    #[pyo3(signature = (added=None, beyond=None))]
    fn new(
        added: Option<PyReadonlyArray1<'_, Complex64>>,
        beyond: Option<PyReadonlyArray1<'_, Complex64>>,
    ) -> PyResult<Self> {
        Ok(Self { added: numbers("added", added.as_ref())?, beyond: numbers("beyond", beyond.as_ref())? })
    }
}

/// An assembly: a motion (0 bending, 1 axial, 2 torsion) and the tables of its elements, checked.
#[pyclass(frozen, module = "receptance._core")]
pub struct Model {
    model: receptance_core::Model,
    tables: [Vec<f64>; 7],
}

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (motion, segments, joints, masses, grounds, overlaps=None))]
    fn new(
        motion: usize,
        segments: PyReadonlyArray2<'_, f64>,
        joints: PyReadonlyArray2<'_, f64>,
        masses: PyReadonlyArray2<'_, f64>,
        grounds: PyReadonlyArray2<'_, f64>,
        overlaps: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<Self> {
        const MOTIONS: [Motion; 3] = [Motion::Bending, Motion::Axial, Motion::Torsion];
        let motion = MOTIONS.get(motion).copied().ok_or_else(|| {
            PyValueError::new_err(format!("motion: {motion} is not 0 (bending), 1 (axial) or 2 (torsion)"))
        })?;
        let overlaps = match &overlaps {
            Some(overlaps) => table("overlaps", overlaps, overlap::column::COUNT)?,
            None => &[],
        };
        let tables = Tables {
            segments: table("segments", &segments, section::column::COUNT)?,
            joints: table("joints", &joints, JOINT_COLUMNS)?,
            masses: table("masses", &masses, MASS_COLUMNS)?,
            grounds: table("grounds", &grounds, GROUND_COLUMNS)?,
            overlaps,
            ..Tables::default()
        };
        Self::of(motion, tables.each().map(<[f64]>::to_vec))
    }

    /// The same model, continued by substructures that are known by their receptance at one plane.
    ///
    /// Parameters
    /// ----------
    /// terminals : (n, 4)
    ///     Node, and the constant part of y over force, theta over moment and y over moment.
    /// modes : (m, 7)
    ///     Row of the terminal, angular natural frequency in rad/s, damping ratio, mass-normalised y and theta, and the
    ///     parts of y and theta that lag by 90 degrees.
    fn with_terminals(
        &self,
        terminals: PyReadonlyArray2<'_, f64>,
        modes: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let mut tables = self.tables.clone();
        tables[Table::Terminals as usize] = table("terminals", &terminals, TERMINAL_COLUMNS)?.to_vec();
        tables[Table::Modes as usize] = table("modes", &modes, MODE_COLUMNS)?.to_vec();
        Self::of(self.model.motion, tables)
    }

    /// Receptance (n_freq, n_responses, n_excitations) and its derivatives by parameters (..., n_parameters).
    #[pyo3(signature = (lines, excitations, responses, parameters, threads, by_line=None))]
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn receptance<'py>(
        &self,
        py: Python<'py>,
        lines: &Lines,
        excitations: PyReadonlyArray2<'py, f64>,
        responses: PyReadonlyArray2<'py, f64>,
        parameters: PyReadonlyArray2<'py, f64>,
        threads: usize,
        by_line: Option<&ByLine>,
    ) -> PyResult<(Bound<'py, PyArray3<Complex64>>, Bound<'py, PyArray4<Complex64>>)> {
        let read = lines.read(py)?;
        let lines = lines.frequencies(&read)?;
        let ByLine { added, beyond } = by_line.cloned().unwrap_or_default();
        let request = Request {
            excitations: coordinates("excitations", &excitations)?,
            responses: coordinates("responses", &responses)?,
            parameters: self::parameters(&parameters)?,
            joint: None,
            added,
            beyond,
        };
        let result = detached(py, || receptance_core::receptance(&self.model, &lines, &request, threads))?
            .map_err(CoreError::from)?;
        let (n, p) = (lines.len(), request.parameters.len());
        let (rows, columns) = (request.responses.len(), request.excitations.len());
        let h = shaped(Array3::from_shape_vec((n, rows, columns), result.receptance))?;
        let dh = shaped(Array4::from_shape_vec((n, rows, columns, p), result.derivative))?;
        Ok((h.into_pyarray(py), dh.into_pyarray(py)))
    }

    /// The lowest undamped natural angular frequencies, `most` of them or those up to a limit in rad/s if these are fewer,
    /// and their derivatives by parameters (n_modes, n_parameters).
    #[allow(clippy::type_complexity)]
    fn natural_frequencies<'py>(
        &self,
        py: Python<'py>,
        upper: Option<f64>,
        most: usize,
        parameters: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)> {
        let parameters = self::parameters(&parameters)?;
        let found =
            detached(py, || receptance_core::natural_frequencies(&self.model, upper, most, &parameters))?
                .map_err(CoreError::from)?;
        let shape = (found.angular.len(), parameters.len());
        let derivative = shaped(Array2::from_shape_vec(shape, found.derivative))?;
        Ok((Array1::from_vec(found.angular).into_pyarray(py), derivative.into_pyarray(py)))
    }

    /// Logarithm of the determinant whose zeros are the complex natural angular frequencies, up to a constant and
    /// multiples of 2 pi i; NaN where it is zero.
    #[pyo3(signature = (lines, by_line=None))]
    fn log_determinant<'py>(
        &self,
        py: Python<'py>,
        lines: &Lines,
        by_line: Option<&ByLine>,
    ) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        let read = lines.read(py)?;
        let lines = lines.frequencies(&read)?;
        let added = by_line.map_or(&[][..], |by_line| &by_line.added);
        let found = detached(py, || receptance_core::log_determinant(&self.model, &lines, added))?
            .map_err(CoreError::from)?;
        Ok(Array1::from_vec(found).into_pyarray(py))
    }

    /// The model on some lines as a function of one joint alone, between two coordinates (response, excitation).
    ///
    /// `planes` keeps a value a line where power series would be shorter.
    #[pyo3(signature = (joint, lines, points, threads, by_line=None, planes=false))]
    #[allow(clippy::too_many_arguments)]
    fn reduced_to_joint(
        &self,
        py: Python<'_>,
        joint: usize,
        lines: &Lines,
        points: PyReadonlyArray2<'_, f64>,
        threads: usize,
        by_line: Option<&ByLine>,
        planes: bool,
    ) -> PyResult<JointReduction> {
        let read = lines.read(py)?;
        let lines = lines.frequencies(&read)?;
        let [response, excitation] = crate::arrays::response_and_excitation(&points)?;
        let beyond = ByLine::beyond(by_line)?;
        let form = if planes { Form::Planes } else { Form::Shortest };
        let found = detached(py, || {
            receptance_core::reduce_joint(
                &self.model,
                joint,
                &lines,
                response,
                excitation,
                beyond,
                form,
                threads,
            )
        })?
        .map_err(CoreError::from)?;
        Ok(JointReduction::new(found))
    }

    /// The model as a function of unknowns.
    ///
    /// Parameters
    /// ----------
    /// rates : (k, 5)
    ///     Table, row, column, number of the address, and the rate at which the entry grows with the address.
    /// present : (m,)
    ///     The value of each address that is in the tables now.
    /// addresses : (m, 2 + 2 p)
    ///     For each address its unknown i (or -1), a, E and S: v = a u_i exp(E u) + S u, or v = a exp(E u) + S u.
    /// factors : (n, 2), optional
    ///     Factors of the measurement: kind (0 logarithm of a gain, 1 delay, 2 to 4 decay rate of a record integrated
    ///     twice, once, not at all) and address.
    /// powers : (n, 4), optional
    ///     Table, row, column of entries through which frequency acts, and its power.
    #[pyo3(signature = (rates, present, addresses, factors=None, powers=None))]
    fn tied(
        &self,
        rates: PyReadonlyArray2<'_, f64>,
        present: PyReadonlyArray1<'_, f64>,
        addresses: PyReadonlyArray2<'_, f64>,
        factors: Option<PyReadonlyArray2<'_, f64>>,
        powers: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<TiedModel> {
        const KINDS: [Factor; 5] = [
            Factor::LogGain,
            Factor::Delay,
            Factor::DecayRate(2),
            Factor::DecayRate(1),
            Factor::DecayRate(0),
        ];
        let width = addresses.as_array().ncols();
        if width < 2 || width % 2 == 1 {
            return Err(PyValueError::new_err(format!("addresses: {width} columns, expected 2 + 2 p")));
        }
        let count = width / 2 - 1;
        let mut found = Vec::new();
        for row in table("rates", &rates, 5)?.chunks_exact(5) {
            let address = index("rates", row[3])?;
            found.push(Rate { entry: parameter(&row[..3])?, address, rate: row[4] });
        }
        let mut between = Vec::new();
        if let Some(factors) = &factors {
            for row in table("factors", factors, 2)?.chunks_exact(2) {
                let kind = KINDS
                    .get(index("factors", row[0])?)
                    .ok_or_else(|| PyValueError::new_err("factors: the kind is none of 0 to 4"))?;
                between.push((*kind, index("factors", row[1])?));
            }
        }
        let mut through = Vec::new();
        if let Some(powers) = &powers {
            for row in table("powers", powers, 4)?.chunks_exact(4) {
                through.push((parameter(&row[..3])?, row[3]));
            }
        }
        let present = contiguous("present", present.as_slice())?;
        let addresses = table("addresses", &addresses, width)?.to_vec();
        let tied = Tied::new(self.model.motion, Tables::of(&self.tables), &found, present, addresses, count)
            .and_then(|tied| tied.with_factors(between, through));
        Ok(TiedModel::new(tied.map_err(CoreError::from)?))
    }
}

impl Model {
    fn of(motion: Motion, tables: [Vec<f64>; 7]) -> PyResult<Self> {
        let model = receptance_core::Model::new(motion, Tables::of(&tables)).map_err(CoreError::from)?;
        Ok(Self { model, tables })
    }
}
