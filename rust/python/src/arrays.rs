//! Views of NumPy arrays, checked for shape and layout.

use numpy::ndarray::ShapeError;
use numpy::{Element, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2, PyUntypedArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use receptance_core::{Coordinate, Parameter, SPRING_COLUMNS, Table};

/// An internal error instead of a panic where a shape does not fit.
pub fn shaped<T>(result: Result<T, ShapeError>) -> PyResult<T> {
    result.map_err(|error| PyRuntimeError::new_err(format!("internal error: {error}")))
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
pub fn c_contiguous<'a, T: Element>(name: &str, array: &'a PyReadonlyArray2<'_, T>) -> PyResult<&'a [T]> {
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(format!("{name}: expected a C-contiguous array")));
    }
    contiguous(name, array.as_slice())
}

/// The slice of an array, or an error that names it.
pub fn contiguous<T, E>(name: &str, slice: Result<T, E>) -> PyResult<T> {
    slice.map_err(|_| PyValueError::new_err(format!("{name}: expected a C-contiguous array")))
}

/// The values of an array, none where there is none.
pub fn optional<T: Element + Copy>(name: &str, array: Option<&PyReadonlyArray1<'_, T>>) -> PyResult<Vec<T>> {
    array.map_or(Ok(Vec::new()), |array| Ok(contiguous(name, array.as_slice())?.to_vec()))
}

/// A whole number that is not negative.
pub fn index(name: &str, value: f64) -> PyResult<usize> {
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

/// The columns of a joint.
pub fn spring(name: &str, array: &PyReadonlyArray1<'_, f64>) -> PyResult<[f64; SPRING_COLUMNS]> {
    let values = contiguous(name, array.as_slice())?;
    <[f64; SPRING_COLUMNS]>::try_from(values).map_err(|_| {
        PyValueError::new_err(format!("{name}: {} values, expected {SPRING_COLUMNS}", values.len()))
    })
}

/// Rows of (table, row, column).
pub fn parameters(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Parameter>> {
    table("parameters", array, 3)?.chunks_exact(3).map(parameter).collect()
}

/// A row of (table, row, column).
pub fn parameter(row: &[f64]) -> PyResult<Parameter> {
    let name = "parameters";
    let table = Table::ALL
        .get(index(name, row[0])?)
        .copied()
        .ok_or_else(|| PyValueError::new_err(format!("parameters: table is {}, expected 0 to 7", row[0])))?;
    Ok(Parameter { table, row: index(name, row[1])?, column: index(name, row[2])? })
}

/// An output in C order of the shape it should have.
pub fn filled<'a, T: Element>(
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
