//! Requests to a model, and their checks.

use crate::error::{Error, Result};
use crate::model::assembly::{Model, Table};
use crate::model::cone::is_conical;
use crate::model::frequencies::Frequencies;
use crate::model::overlap::{self, Beside, Overlap};
use crate::model::section::{Segment, column};
use crate::model::spring::Spring;
use crate::model::terminals::TERMINAL_ENTRIES;
use core::ops::Range;
use num_complex::Complex64;

/// A coordinate: a node and the direction of motion or load there.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Coordinate {
    /// The node.
    pub node: usize,
    /// 0 for y and force, 1 for theta and moment (rods have direction 0 only).
    pub direction: usize,
}

/// A parameter: a column of an element's row.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Kind of element.
    pub table: Table,
    /// Its row.
    pub row: usize,
    /// The column, counted as in the tables.
    pub column: usize,
}

/// A request to a model.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Where loads act.
    pub excitations: Vec<Coordinate>,
    /// Where motion is observed.
    pub responses: Vec<Coordinate>,
    /// Parameters of the derivatives.
    pub parameters: Vec<Parameter>,
    /// A joint whose force is requested under each excitation.
    pub joint: Option<usize>,
    /// Complex stiffness that each joint has besides its columns, `(n_freq, n_joints, 2)` for y and theta, as that of
    /// an amplitude may differ from line to line; empty where none has any.
    pub added: Vec<Complex64>,
    /// Receptance of each terminal besides its modes and its constant, as a table gives it, `(n_freq, n_terminals, 3)`;
    /// empty where none has any.
    pub beyond: Vec<Complex64>,
    /// Amplitude of the force in N on each line, which sets the levels of joints in micro-slip; empty for stated levels.
    pub force: Vec<f64>,
}

/// Data that differ from line to line besides the columns of the elements, on some lines.
#[derive(Copy, Clone, Default)]
pub(crate) struct ByLine<'a> {
    /// As in a request.
    pub added: &'a [Complex64],
    /// As in a request.
    pub beyond: &'a [Complex64],
}

impl<'a> ByLine<'a> {
    /// The part of some of `count` lines.
    pub(crate) fn some(self, lines: &Range<usize>, count: usize) -> Self {
        let part = |values: &'a [Complex64]| {
            let a_line = values.len() / count.max(1);
            values.get(lines.start * a_line..lines.end * a_line).unwrap_or_default()
        };
        Self { added: part(self.added), beyond: part(self.beyond) }
    }
}

impl Request {
    /// Data that differ from line to line, on all lines.
    pub(crate) fn by_line(&self) -> ByLine<'_> {
        ByLine { added: &self.added, beyond: &self.beyond }
    }

    /// The directions of response and excitation of each pair, as the pairs of a line are ordered.
    pub(crate) fn directions(&self) -> impl Iterator<Item = [usize; 2]> {
        self.responses.iter().flat_map(|response| {
            self.excitations.iter().map(|excitation| [response.direction, excitation.direction])
        })
    }
}

/// Receptances and derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// `(n_freq, n_responses, n_excitations)`.
    pub receptance: Vec<Complex64>,
    /// `(n_freq, n_responses, n_excitations, n_parameters)`.
    pub derivative: Vec<Complex64>,
    /// `(n_freq, n_excitations, degrees of freedom)` in the requested joint, from its first on its second node.
    pub force: Vec<Complex64>,
}

/// Checks lines, coordinates, parameters and interfaces; the largest modulus of an angular frequency.
pub(crate) fn check(model: &Model, lines: &Frequencies, request: &Request) -> Result<f64> {
    let highest = lines.highest()?;
    check_request(model, request)?;
    check_added(model, lines, &request.added)?;
    let ends = lines.len() * model.terminals.len() * TERMINAL_ENTRIES;
    let receptance = ("number of receptances beyond terminals", "receptance beyond terminals");
    check_numbers(receptance, &request.beyond, ends)?;
    check_waves(model, highest)?;
    check_interfaces(model, lines)?;
    Ok(highest)
}

/// Checks the complex stiffness that joints have besides their columns.
pub(crate) fn check_added(model: &Model, lines: &Frequencies, added: &[Complex64]) -> Result<()> {
    let names = ("number of stiffnesses added to joints", "stiffness added to joints");
    check_numbers(names, added, lines.len() * model.joints.len() * 2)
}

/// Checks how many numbers are given for the lines, and that they are finite.
fn check_numbers(
    (number, what): (&'static str, &'static str),
    values: &[Complex64],
    count: usize,
) -> Result<()> {
    if values.len() != count && !values.is_empty() {
        let expected = format!("none or {count}");
        return Err(Error::Index { what: number, index: 0, value: values.len() as f64, expected });
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => {
            let value = values[index].re;
            Err(Error::Index { what, index, value, expected: "a finite number".into() })
        }
        None => Ok(()),
    }
}

/// Most wavelengths in one segment: next to its cut-off it is passed in pieces, which must stay countable.
const MOST_WAVES: f64 = 1.6e4;

fn check_waves(model: &Model, highest: f64) -> Result<()> {
    for (row, columns) in model.segments.iter().enumerate() {
        let square = match model.motion.degrees() {
            1 => Segment::<1>::new(columns, model.motion).wave_number_square(highest * highest),
            _ => Segment::<2>::new(columns, model.motion).wave_number_square(highest * highest),
        };
        let waves = square.sqrt() * columns[column::LENGTH] / core::f64::consts::TAU;
        // Not a number stands for coefficients beyond floating point.
        if waves.is_nan() || waves > MOST_WAVES {
            let frequency_hz = highest / core::f64::consts::TAU;
            return Err(Error::Waves { row, frequency_hz, waves, most: MOST_WAVES });
        }
    }
    for (row, overlap) in model.overlaps.iter().enumerate() {
        let exponent = Beside::new(overlap).growth(highest * highest) * overlap.length();
        let most = overlap::MOST_PIECES * overlap::REACH;
        if exponent.is_nan() || exponent > most {
            let frequency_hz = highest / core::f64::consts::TAU;
            return Err(Error::Layer { row, frequency_hz, exponent, most });
        }
    }
    Ok(())
}

fn check_request(model: &Model, request: &Request) -> Result<()> {
    let degrees = model.motion.degrees();
    for (what, list) in [("excitation", &request.excitations), ("response", &request.responses)] {
        for (index, coordinate) in list.iter().enumerate() {
            if coordinate.node >= model.nodes {
                let expected = format!("a node from 0 to {}", model.nodes - 1);
                return Err(Error::Index { what, index, value: coordinate.node as f64, expected });
            }
            if coordinate.direction >= degrees {
                let expected = format!("a direction below {degrees}");
                return Err(Error::Index { what, index, value: coordinate.direction as f64, expected });
            }
        }
    }
    check_parameters(model, &request.parameters)
}

/// The columns of a segment that can be differentiated: all before the choice of the shear coefficient, and of a cone the
/// diameters at its far end.
fn section_columns(model: &Model, row: usize) -> Range<usize> {
    let conical = model.segments.get(row).is_some_and(|row| is_conical(row));
    2..if conical { column::END_INNER_DIAMETER + 1 } else { column::SHEAR_MODEL }
}

/// Checks that the model has the parameters.
pub(crate) fn check_parameters(model: &Model, parameters: &[Parameter]) -> Result<()> {
    for (index, parameter) in parameters.iter().enumerate() {
        let count = parameter.table.columns();
        // Nodes and rows of other tables come first; the last column of beams is a choice.
        let (rows, columns) = match parameter.table {
            Table::Segments => (model.segments.len(), section_columns(model, parameter.row)),
            Table::Joints => (model.joints.len(), 2..count),
            Table::Masses => (model.masses.len(), 1..count),
            Table::Grounds => (model.grounds.len(), 1..count),
            Table::Overlaps => (model.overlaps.len(), 2..count - 1),
            Table::Terminals => (model.terminals.len(), 1..count),
            Table::Modes => (model.modes.len(), 1..count),
            Table::Slips => (model.slips.len(), 1..count),
        };
        if parameter.row >= rows {
            let expected = format!("a row below {rows}");
            return Err(Error::Index { what: "parameter row", index, value: parameter.row as f64, expected });
        }
        if parameter.table == Table::Slips
            && parameter.column == 4
            && model.slips[parameter.row].has_no_slope()
        {
            let (element, quantity) = ("slip", "level");
            let expected = "more than zero: with an exponent below 1 it has no derivative there";
            return Err(Error::Quantity { element, row: parameter.row, quantity, value: 0.0, expected });
        }
        // The shear models of an overlap's beams stand among its numbers.
        let choice = parameter.table == Table::Overlaps
            && [overlap::column::OUTER - 1, overlap::column::K - 1].contains(&parameter.column);
        if choice || !columns.contains(&parameter.column) {
            let expected = format!("a column from {} to {}", columns.start, columns.end - 1);
            let value = parameter.column as f64;
            return Err(Error::Index { what: "parameter column", index, value, expected });
        }
    }
    Ok(())
}

fn check_interfaces(model: &Model, lines: &Frequencies) -> Result<()> {
    let degrees = model.motion.degrees();
    for (row, (_, spring)) in model.joints.iter().enumerate() {
        if let Some((line, [k_y, k_theta, k_ytheta])) = singular_at(spring, degrees, lines) {
            let frequency_hz = line.re / core::f64::consts::TAU;
            let element = "joint";
            return Err(Error::SingularInterface { element, row, frequency_hz, k_y, k_theta, k_ytheta });
        }
    }
    for (row, overlap) in model.overlaps.iter().enumerate() {
        if overlap.loose(true).is_some() && !lines.is_empty() {
            return Err(singular(overlap, row, lines.angular(0)));
        }
    }
    Ok(())
}

/// The first line on which a joint leaves a motion free, and the real parts of its stiffness there.
pub(crate) fn singular_at(
    spring: &Spring,
    degrees: usize,
    lines: &Frequencies,
) -> Option<(Complex64, [f64; 3])> {
    if spring.statically_regular(degrees) {
        return None;
    }
    lines.iter().find_map(|line| {
        let [y, theta, both] = spring.at(line);
        let (size, determinant) =
            if degrees == 1 { (1.0, y) } else { ((y * theta).norm(), y * theta - both * both) };
        let singular = determinant.norm() <= 1e-14 * size || determinant.norm() == 0.0;
        singular.then_some((line, [y.re, theta.re, both.re]))
    })
}

/// An overlap that leaves a motion free.
pub(crate) fn singular(overlap: &Overlap, row: usize, line: Complex64) -> Error {
    let [k_y, k_theta] = overlap.stiffness(line).map(|k| k.re);
    let frequency_hz = line.re / core::f64::consts::TAU;
    Error::SingularInterface { element: "overlap", row, frequency_hz, k_y, k_theta, k_ytheta: 0.0 }
}
