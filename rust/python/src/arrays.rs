//! Views of NumPy arrays, checked for shape and layout.

use crate::errors::CoreError;
use num_complex::Complex64;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use receptance_core::{
    Coordinate, Frequencies, GROUND_COLUMNS, JOINT_COLUMNS, MASS_COLUMNS, Model, Motion, Parameter, Table,
    Tables, overlap, section,
};

/// Frequency lines as they come, real or complex.
#[derive(FromPyObject)]
pub enum Lines<'py> {
    /// Real.
    Real(PyReadonlyArray1<'py, f64>),
    /// Complex.
    Complex(PyReadonlyArray1<'py, Complex64>),
}

impl Lines<'_> {
    /// The lines, which times the scale are in rad/s.
    pub fn frequencies(&self, scale: f64) -> PyResult<Frequencies<'_>> {
        let name = "angular_frequency";
        Ok(match self {
            Self::Real(lines) => Frequencies::real(contiguous(name, lines.as_slice())?, scale),
            Self::Complex(lines) => Frequencies::complex(contiguous(name, lines.as_slice())?, scale),
        })
    }
}

/// The values of a C-contiguous table with a given number of columns.
pub fn table<'a>(name: &str, array: &'a PyReadonlyArray2<'_, f64>, columns: usize) -> PyResult<&'a [f64]> {
    let shape = array.shape();
    if shape[1] != columns {
        let message = format!("{name}: shape is ({}, {}), expected (n, {columns})", shape[0], shape[1]);
        return Err(PyValueError::new_err(message));
    }
    c_contiguous(name, array)
}

/// The values of a two-dimensional array in C order: one in Fortran order would be read transposed.
pub fn c_contiguous<'a>(name: &str, array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<&'a [f64]> {
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(format!("{name}: expected a C-contiguous array")));
    }
    contiguous(name, array.as_slice())
}

/// The slice of an array, or an error that names it.
pub fn contiguous<T, E>(name: &str, slice: Result<T, E>) -> PyResult<T> {
    slice.map_err(|_| PyValueError::new_err(format!("{name}: expected a C-contiguous array")))
}

/// A whole number that is not negative.
fn index(name: &str, value: f64) -> PyResult<usize> {
    if value >= 0.0 && value.fract() == 0.0 && value < 1e15 {
        return Ok(value as usize);
    }
    Err(PyValueError::new_err(format!("{name}: {value} is not a whole number from 0 on")))
}

/// Whole numbers of a one-dimensional array.
pub fn indices(name: &str, array: &PyReadonlyArray1<'_, f64>) -> PyResult<Vec<usize>> {
    contiguous(name, array.as_slice())?.iter().map(|&value| index(name, value)).collect()
}

/// Rows of (node, direction).
pub fn coordinates(name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Coordinate>> {
    let rows = table(name, array, 2)?.chunks_exact(2);
    rows.map(|row| Ok(Coordinate { node: index(name, row[0])?, direction: index(name, row[1])? })).collect()
}

/// Response and excitation, two rows of (node, direction).
pub fn response_and_excitation(array: &PyReadonlyArray2<'_, f64>) -> PyResult<[Coordinate; 2]> {
    <[Coordinate; 2]>::try_from(coordinates("points", array)?)
        .map_err(|_| PyValueError::new_err("points: expected two rows, response and excitation"))
}

/// Rows of (table, row, column).
pub fn parameters(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Parameter>> {
    table("parameters", array, 3)?.chunks_exact(3).map(parameter).collect()
}

/// A row of (table, row, column).
pub fn parameter(row: &[f64]) -> PyResult<Parameter> {
    const TABLES: [Table; 5] =
        [Table::Segments, Table::Joints, Table::Masses, Table::Grounds, Table::Overlaps];
    let name = "parameters";
    let table = TABLES
        .get(index(name, row[0])?)
        .copied()
        .ok_or_else(|| PyValueError::new_err(format!("parameters: table is {}, expected 0 to 4", row[0])))?;
    Ok(Parameter { table, row: index(name, row[1])?, column: index(name, row[2])? })
}

/// The model behind a motion and its tables, that of the overlaps being optional.
pub fn model(
    motion: usize,
    segments: &PyReadonlyArray2<'_, f64>,
    joints: &PyReadonlyArray2<'_, f64>,
    masses: &PyReadonlyArray2<'_, f64>,
    grounds: &PyReadonlyArray2<'_, f64>,
    overlaps: Option<&PyReadonlyArray2<'_, f64>>,
) -> PyResult<Model> {
    let motion = [Motion::Bending, Motion::Axial, Motion::Torsion].get(motion).copied().ok_or_else(|| {
        PyValueError::new_err(format!("motion: {motion} is not 0 (bending), 1 (axial) or 2 (torsion)"))
    })?;
    let tables = Tables {
        segments: table("segments", segments, section::column::COUNT)?,
        joints: table("joints", joints, JOINT_COLUMNS)?,
        masses: table("masses", masses, MASS_COLUMNS)?,
        grounds: table("grounds", grounds, GROUND_COLUMNS)?,
        overlaps: match overlaps {
            Some(overlaps) => table("overlaps", overlaps, overlap::column::COUNT)?,
            None => &[],
        },
    };
    Ok(Model::new(motion, tables).map_err(CoreError::from)?)
}
