//! A tool's shank inside a holder's bore: two beams side by side with a layer, or points, between them.

use crate::error::{Error, Result};
use crate::model::section;
use crate::model::section::{Motion, Segment};
use num_complex::Complex64;

/// Columns of the overlap table; first the node where the inner beam goes on, at the end of smaller x, and that where
/// the outer beam does, at the end of larger x.
pub mod column {
    /// Length in m.
    pub const LENGTH: usize = 2;
    /// Section of the inner beam: the columns of the segment table from the outer diameter on.
    pub const INNER: usize = 3;
    /// Section of the outer beam.
    pub const OUTER: usize = 14;
    /// Stiffness of the whole layer: k_y, k_theta.
    pub const K: usize = 25;
    /// Viscous damping of the whole layer: c_y, c_theta.
    pub const C: usize = 27;
    /// Loss factor of the layer.
    pub const LOSS_FACTOR: usize = 29;
    /// Slope of the shares of the points along x, from -1 to 1; 0 for equal shares.
    pub const SLOPE: usize = 30;
    /// 0 for a layer, else the number of points that share it.
    pub const POINTS: usize = 31;
    /// Number of columns.
    pub const COUNT: usize = 32;
}

/// Most points in a row.
const MOST_POINTS: f64 = 1e3;

/// Largest growth exponent of one piece: beyond it the exponential costs digits.
pub(crate) const REACH: f64 = 2.0;

/// Most pieces of one overlap.
pub(crate) const MOST_PIECES: f64 = 3e3;

/// An overlap, the inner beam first.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlap {
    /// Node of the inner beam at smaller x and of the outer beam at larger x.
    pub nodes: [usize; 2],
    /// Both beams as rows of the segment table.
    pub beams: [[f64; section::column::COUNT]; 2],
    /// Total stiffness k_y, k_theta.
    pub k: [f64; 2],
    /// Total viscous damping c_y, c_theta.
    pub c: [f64; 2],
    /// Loss factor of the stiffness.
    pub loss_factor: f64,
    /// Slope of the shares of the points along x: a point at x has the share (1 + slope (2 x / length - 1)) / points.
    pub slope: f64,
    /// 0 for a layer, else the number of points.
    pub points: usize,
}

impl Overlap {
    /// Reads and checks a row whose nodes were read before.
    pub(crate) fn new(values: &[f64], row: usize, nodes: [usize; 2]) -> Result<Self> {
        let mut beams = [[0.0; section::column::COUNT]; 2];
        let starts = [(column::INNER, "overlap (inner beam)"), (column::OUTER, "overlap (outer beam)")];
        for (beam, (start, element)) in beams.iter_mut().zip(starts) {
            (beam[0], beam[1]) = (nodes[0] as f64, nodes[1] as f64);
            beam[section::column::LENGTH] = values[column::LENGTH];
            // Both beams are uniform and circular.
            let columns = section::column::OUTER_DIAMETER..=section::column::SHEAR_MODEL;
            let width = columns.clone().count();
            beam[columns].copy_from_slice(&values[start..start + width]);
            section::check(beam, row, element)?;
        }
        let fail = |quantity, value, expected| {
            Err(Error::Quantity { element: "overlap", row, quantity, value, expected })
        };
        let names = ["k_y", "k_theta", "c_y", "c_theta", "loss_factor"];
        for (quantity, &value) in names.into_iter().zip(&values[column::K..column::SLOPE]) {
            if !(value.is_finite() && value >= 0.0) {
                return fail(quantity, value, "zero or a positive finite number");
            }
        }
        let points = values[column::POINTS];
        if !(points >= 0.0 && points.fract() == 0.0 && points <= MOST_POINTS) {
            return fail("points", points, "0 (a layer) or a whole number up to 1000");
        }
        let slope = values[column::SLOPE];
        if !(-1.0..=1.0).contains(&slope) {
            return fail("slope", slope, "a number from -1 to 1");
        }
        if slope != 0.0 && points == 0.0 {
            return fail("slope", slope, "0 for a layer, whose stiffness is uniform; give points");
        }
        Ok(Self {
            nodes,
            beams,
            k: [values[column::K], values[column::K + 1]],
            c: [values[column::C], values[column::C + 1]],
            loss_factor: values[column::LOSS_FACTOR],
            slope,
            points: points as usize,
        })
    }

    /// Length in m.
    pub fn length(&self) -> f64 {
        self.beams[0][section::column::LENGTH]
    }

    /// Dynamic stiffness k (1 + i loss) + i w c of the whole layer.
    pub(crate) fn stiffness(&self, w: Complex64) -> [Complex64; 2] {
        let iw = Complex64::I * w;
        [0, 1].map(|i| Complex64::new(self.k[i], self.k[i] * self.loss_factor) + iw * self.c[i])
    }

    /// Share of the whole stiffness that the point at a place has.
    pub(crate) fn share(&self, place: f64) -> f64 {
        (1.0 + self.slope * place) / self.points as f64
    }

    /// The first of translation and rotation that nothing holds, with dashpots counting or not; one row of
    /// two points on holds the rotation by its translation.
    pub(crate) fn loose(&self, with_dashpots: bool) -> Option<&'static str> {
        let held = |i: usize| self.k[i] > 0.0 || (with_dashpots && self.c[i] > 0.0);
        match (held(0), held(1)) {
            (false, _) => Some("k_y"),
            (true, false) if self.points == 1 => Some("k_theta"),
            _ => None,
        }
    }
}

/// Data of an overlap for the sweeps, prepared once for all lines.
pub struct Beside {
    /// The row.
    pub overlap: Overlap,
    /// Both beams, the inner one first.
    pub beams: [Segment<2>; 2],
}

/// Pieces of an overlap, counted from either end: all of one length before the first and beyond the last point, all of
/// another length between points; a layer is one stretch.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Pieces {
    /// Number of pieces.
    pub count: usize,
    /// Length of a piece in m, at the ends and between points.
    pub length: [f64; 2],
    /// Largest growth exponent of each.
    pub size: [f64; 2],
    /// Pieces of a stretch, at the ends and between points.
    stretch: [usize; 2],
    /// Number of points.
    points: usize,
}

impl Pieces {
    /// Number of kinds of pieces: those at the ends, and those between points.
    pub fn kinds(&self) -> usize {
        if self.points > 1 { 2 } else { 1 }
    }

    /// Whether a piece lies between points (1) or at an end (0), counted from either end.
    pub fn kind(&self, piece: usize) -> usize {
        let end = self.stretch[0];
        usize::from(self.points > 0 && piece >= end && piece + end < self.count)
    }

    /// The number of the point that follows when so many pieces have been passed, from either end.
    pub fn point_after(&self, passed: usize) -> Option<usize> {
        let between = passed.checked_sub(self.stretch[0])?;
        let number = between / self.stretch[1];
        (between % self.stretch[1] == 0 && number < self.points).then_some(number)
    }

    /// Place of a point, counted from the end of larger x, from -1 at the start of the overlap to 1 at its end.
    pub fn place(&self, point: usize) -> f64 {
        1.0 - (2 * point + 1) as f64 / self.points as f64
    }
}

impl Beside {
    /// Prepares a row.
    pub fn new(overlap: &Overlap) -> Self {
        let beams = [0, 1].map(|i| Segment::new(&overlap.beams[i], Motion::Bending));
        Self { overlap: overlap.clone(), beams }
    }

    /// A bound of the growth exponents per length at |w|^2 = `w2`: the larger one of both beams where points join
    /// them, else the root of the equations with absolute values, both beams having the larger coefficients of either,
    /// and twice the layer for the relative motion.
    pub fn growth(&self, w2: f64) -> f64 {
        let [inner, outer] = &self.beams;
        if self.overlap.points > 0 {
            return inner.wave_number_square(w2).max(outer.wave_number_square(w2)).sqrt();
        }
        let w = Complex64::new(w2.sqrt(), 0.0);
        let length = self.overlap.length();
        let layer = self.overlap.stiffness(w).map(|k| k.norm() / length);
        let largest = |value: &dyn Fn(&Segment<2>, usize) -> f64, i| value(inner, i).max(value(outer, i));
        let compliance = |beam: &Segment<2>, i: usize| beam.per_length.compliance[i].norm();
        let inertia = |beam: &Segment<2>, i: usize| beam.per_length.kinetic[i] * w2;
        let [alpha, beta] = [0, 1].map(|i| largest(&compliance, i));
        let [mu, nu] = [0, 1].map(|i| largest(&inertia, i) + 2.0 * layer[i]);
        let (a, b) = (alpha * mu, beta * nu);
        (0.5 * (a + b + ((a - b).powi(2) + 4.0 * beta * mu).sqrt())).sqrt()
    }

    /// Pieces at |w|^2 up to `most`.
    pub fn pieces(&self, most: f64) -> Pieces {
        let growth = self.growth(most);
        let (length, points) = (self.overlap.length(), self.overlap.points);
        let between = length / points.max(1) as f64;
        let ends = if points > 0 { 0.5 * between } else { length };
        // A checked model needs few pieces; the bound limits the number for any other.
        let cut = |stretch: f64| (growth * stretch / REACH).ceil().clamp(1.0, MOST_PIECES) as usize;
        let stretch = [cut(ends), cut(between)];
        let count = if points > 0 { 2 * stretch[0] + (points - 1) * stretch[1] } else { stretch[0] };
        let length = [ends / stretch[0] as f64, between / stretch[1] as f64];
        Pieces { count, length, size: length.map(|length| growth * length), stretch, points }
    }

    /// Impedances that make the displacements (d_y, d_theta, y, theta) comparable with their loads, the outer beam
    /// (`forward`) or the inner one lying behind.
    pub fn weights(&self, most: f64, forward: bool) -> [f64; 4] {
        let (near, behind) = (&self.beams[usize::from(!forward)], &self.beams[usize::from(forward)]);
        let own = behind.weights(behind.wave_number_square(most));
        let relative = near.weights(self.growth(most).powi(2));
        [relative[0], relative[1], own[0], own[1]]
    }
}
