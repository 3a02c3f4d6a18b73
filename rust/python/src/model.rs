//! Frequency lines, and models: receptances, natural frequencies, reductions to one joint.

use crate::arrays::{contiguous, coordinates, index, optional, parameter, parameters, shaped, spring, table};
use crate::errors::{CoreError, detached};
use crate::sweeps::{JointReduction, TiedModel};
use num_complex::Complex64;
use numpy::ndarray::{Array1, Array2, Array3, Array4};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArray4, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use receptance_core::{
    Factor, Form, Frequencies, Mode, Motion, OwnedFrequencies, Rate, Request, Sector, Spring, TABLES,
    TERMINAL_ENTRIES, Table, Tables, Tied, UNIFORM_COLUMNS,
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
    let width = Table::Modes.columns() - 1;
    let rows = table("modes", &modes, width)?.chunks_exact(width).enumerate();
    let modes: Vec<Mode> = rows
        .map(|(row, values)| Mode::new(values, row))
        .collect::<Result<_, _>>()
        .map_err(CoreError::from)?;
    let read = lines.read(py)?;
    let lines = lines.frequencies(&read)?;
    let found = detached(py, || receptance_core::modal_sum(&modes, &lines))?;
    Ok(shaped(Array2::from_shape_vec((lines.len(), TERMINAL_ENTRIES), found))?.into_pyarray(py))
}

/// The dynamic stiffness of a joint on some lines, (n_freq, 3): y over y, theta over theta, y over theta.
#[pyfunction]
pub fn joint_stiffness<'py>(
    py: Python<'py>,
    joint: PyReadonlyArray1<'py, f64>,
    lines: &Lines,
) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
    let joint = Spring::new(&spring("joint", &joint)?);
    let read = lines.read(py)?;
    let lines = lines.frequencies(&read)?;
    let found = lines.iter().flat_map(|line| joint.at(line)).collect();
    Ok(shaped(Array2::from_shape_vec((lines.len(), 3), found))?.into_pyarray(py))
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

    /// All lines in rad/s.
    pub fn angular(&self, py: Python<'_>) -> PyResult<Vec<Complex64>> {
        Ok(self.frequencies(&self.read(py)?)?.iter().collect())
    }

    /// A copy of the lines.
    pub fn copied(&self, py: Python<'_>) -> PyResult<OwnedFrequencies> {
        Ok(self.frequencies(&self.read(py)?)?.every(1))
    }
}

/// Properties of a model that differ from line to line.
///
/// `beyond`, flat of (n_freq, n_terminals, 3), is receptance of the terminals besides that of their modes and constants:
/// y over force, theta over moment and y over moment. `force` (n_freq,) is the amplitude in N of the force, which sets
/// the levels of joints in micro-slip; without it they are at their stated levels.
#[pyclass(frozen, module = "receptance._core")]
#[derive(Clone, Default)]
pub struct ByLine {
    beyond: Vec<Complex64>,
    force: Vec<f64>,
}

#[pymethods]
impl ByLine {
    #[new]
    #[pyo3(signature = (beyond=None, force=None))]
    fn new(
        beyond: Option<PyReadonlyArray1<'_, Complex64>>,
        force: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        Ok(Self { beyond: optional("beyond", beyond.as_ref())?, force: optional("force", force.as_ref())? })
    }
}

impl ByLine {
    /// Tables of terminals and forces.
    pub fn given(by_line: Option<&Self>) -> (Vec<Complex64>, Vec<f64>) {
        by_line.map(|by_line| (by_line.beyond.clone(), by_line.force.clone())).unwrap_or_default()
    }

    /// Tables of terminals, for calls that take no forces.
    pub fn beyond(by_line: Option<&Self>) -> PyResult<Vec<Complex64>> {
        let (beyond, force) = Self::given(by_line);
        if force.is_empty() {
            return Ok(beyond);
        }
        Err(PyValueError::new_err("by_line: forces are not possible here, only tables of terminals"))
    }
}

/// An assembly: a motion (0 bending, 1 axial, 2 torsion) and the tables of its elements, checked.
#[pyclass(frozen, module = "receptance._core")]
pub struct Model {
    model: receptance_core::Model,
    tables: [Vec<f64>; TABLES],
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
        let mut tables = <[Vec<f64>; TABLES]>::default();
        let given = [
            ("segments", Table::Segments, Some(segments)),
            ("joints", Table::Joints, Some(joints)),
            ("masses", Table::Masses, Some(masses)),
            ("grounds", Table::Grounds, Some(grounds)),
            ("overlaps", Table::Overlaps, overlaps),
        ];
        for (name, kind, rows) in given {
            if let Some(rows) = rows {
                let columns = if kind == Table::Segments && rows.shape()[1] == UNIFORM_COLUMNS {
                    UNIFORM_COLUMNS
                } else {
                    kind.columns()
                };
                let mut values = Vec::with_capacity(rows.shape()[0] * kind.columns());
                for row in table(name, &rows, columns)?.chunks_exact(columns) {
                    values.extend_from_slice(row);
                    values.resize(values.len() + kind.columns() - columns, 0.0);
                }
                tables[kind as usize] = values;
            }
        }
        Self::of(motion, tables)
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
        tables[Table::Terminals as usize] =
            table("terminals", &terminals, Table::Terminals.columns())?.to_vec();
        tables[Table::Modes as usize] = table("modes", &modes, Table::Modes.columns())?.to_vec();
        Self::of(self.model.motion, tables)
    }

    /// The same model with joints in micro-slip.
    ///
    /// Parameters
    /// ----------
    /// slips : (n, 7)
    ///     Row of the joint, shares of k_y and k_theta that are lost at the level 1, exponent, stated level, and the
    ///     amplitudes of the level 1 in m and rad.
    fn with_slips(&self, slips: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let mut tables = self.tables.clone();
        tables[Table::Slips as usize] = table("slips", &slips, Table::Slips.columns())?.to_vec();
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
        let (beyond, force) = ByLine::given(by_line);
        let request = Request {
            excitations: coordinates("excitations", &excitations)?,
            responses: coordinates("responses", &responses)?,
            parameters: self::parameters(&parameters)?,
            beyond,
            force,
            ..Request::default()
        };
        let result = detached(py, || receptance_core::receptance(&self.model, &lines, &request, threads))?;
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
            detached(py, || receptance_core::natural_frequencies(&self.model, upper, most, &parameters))?;
        let shape = (found.angular.len(), parameters.len());
        let derivative = shaped(Array2::from_shape_vec(shape, found.derivative))?;
        Ok((Array1::from_vec(found.angular).into_pyarray(py), derivative.into_pyarray(py)))
    }

    /// The complex natural angular frequencies that undamped ones in rad/s become under the damping, and their derivatives
    /// by parameters (n_modes, n_parameters).
    #[allow(clippy::type_complexity)]
    fn complex_frequencies<'py>(
        &self,
        py: Python<'py>,
        undamped: PyReadonlyArray1<'py, f64>,
        parameters: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray1<Complex64>>, Bound<'py, PyArray2<Complex64>>)> {
        let parameters = self::parameters(&parameters)?;
        let undamped = contiguous("undamped", undamped.as_slice())?;
        let found =
            detached(py, || receptance_core::complex_frequencies(&self.model, undamped, &parameters))?;
        let shape = (found.angular.len(), parameters.len());
        let derivative = shaped(Array2::from_shape_vec(shape, found.derivative))?;
        Ok((Array1::from_vec(found.angular).into_pyarray(py), derivative.into_pyarray(py)))
    }

    /// The complex natural angular frequencies between two radii in rad/s and two angles from the real axis, ascending by
    /// their modulus, and how many were counted and not found. `starts` lie near some of them.
    #[allow(clippy::type_complexity)]
    fn poles<'py>(
        &self,
        py: Python<'py>,
        starts: PyReadonlyArray1<'py, Complex64>,
        radii: (f64, f64),
        angles: (f64, f64),
    ) -> PyResult<(Bound<'py, PyArray1<Complex64>>, usize)> {
        let starts = contiguous("starts", starts.as_slice())?;
        let ((inner, outer), (below, above)) = (radii, angles);
        let sector = Sector { inner, outer, below, above };
        let found = detached(py, || receptance_core::poles(&self.model, sector, starts))?;
        Ok((Array1::from_vec(found.angular).into_pyarray(py), found.missed))
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
        })?;
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
    /// addresses : (m, 4 + 2 p)
    ///     For each address its unknown i, a, a second unknown j, b, E and S: v = (a u_i + b u_j) exp(E u) + S u. An
    ///     unknown of -1 is none; without the first one a is a number.
    /// factors : (n, 2), optional
    ///     Factors of the measurement: kind (0 logarithm of a gain, 1 delay, 2 to 4 decay rate of a record integrated
    ///     twice, once, not at all, 5 end of a truncated record, 6 to 8 offset of the frequencies of a record integrated
    ///     twice, once, not at all, 9 exponent of the level, 10 slope of the level, 11 phase, 12 low pass, 13 high pass)
    ///     and address.
    #[pyo3(signature = (rates, present, addresses, factors=None))]
    fn tied(
        &self,
        rates: PyReadonlyArray2<'_, f64>,
        present: PyReadonlyArray1<'_, f64>,
        addresses: PyReadonlyArray2<'_, f64>,
        factors: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<TiedModel> {
        const KINDS: [Factor; 14] = [
            Factor::LogGain,
            Factor::Delay,
            Factor::DecayRate(2),
            Factor::DecayRate(1),
            Factor::DecayRate(0),
            Factor::End,
            Factor::Offset(2),
            Factor::Offset(1),
            Factor::Offset(0),
            Factor::LevelExponent,
            Factor::LevelSlope,
            Factor::Phase,
            Factor::LowPass,
            Factor::HighPass,
        ];
        let width = addresses.as_array().ncols();
        if width < 4 || width % 2 == 1 {
            return Err(PyValueError::new_err(format!("addresses: {width} columns, expected 4 + 2 p")));
        }
        let count = width / 2 - 2;
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
                    .ok_or_else(|| PyValueError::new_err("factors: the kind is none of 0 to 13"))?;
                between.push((*kind, index("factors", row[1])?));
            }
        }
        let present = contiguous("present", present.as_slice())?;
        let addresses = table("addresses", &addresses, width)?.to_vec();
        let tied = Tied::new(self.model.motion, Tables::of(&self.tables), &found, present, addresses, count)
            .and_then(|tied| tied.with_factors(between));
        Ok(TiedModel::new(tied.map_err(CoreError::from)?))
    }
}

impl Model {
    fn of(motion: Motion, tables: [Vec<f64>; TABLES]) -> PyResult<Self> {
        let model = receptance_core::Model::new(motion, Tables::of(&tables)).map_err(CoreError::from)?;
        Ok(Self { model, tables })
    }
}
