//! The complex log residual of a receptance that is reduced to one joint, and its normal matrix.
//!
//! See `reduction` for how the receptance follows from the joint's stiffness.

use crate::error::{Error, Result};
use crate::frequencies::Frequencies;
use crate::gradient::spring_derivative;
use crate::joint_change::{Change, Planes, REDUCTION_PLANES, Update};
use crate::joint_series::{AtJoint, SERIES_ROWS};
use crate::lane::{C, MAX_LANES, R};
use crate::model::Spring;
use crate::response::LINES_PER_TASK;
use crate::threads::on_threads;
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Most columns of a spring.
pub(crate) const SPRING_COLUMNS: usize = 7;

/// What a task takes at least [ns].
const A_TASK: f64 = 1e3;

/// Entries of the upper triangle over the columns and the residual.
const TRIANGLE: usize = (SPRING_COLUMNS + 1) * (SPRING_COLUMNS + 2) / 2;

/// Everything of a model but one joint, see `reduce_joint`.
#[derive(Copy, Clone)]
pub(crate) enum Reduction<'a> {
    /// Planes by line, one after the other.
    Planes(&'a [f64]),
    /// A table of power series for all lines.
    Series(&'a [f64]),
}

impl<'a> Reduction<'a> {
    /// A table of so many rows, for so many lines.
    pub(crate) fn new(rows: usize, values: &'a [f64], lines: usize) -> Result<Self> {
        match rows {
            REDUCTION_PLANES if values.len() == rows * lines => Ok(Self::Planes(values)),
            SERIES_ROWS if !values.is_empty() && values.len().is_multiple_of(rows) => {
                Ok(Self::Series(values))
            }
            _ => {
                let expected = format!("{REDUCTION_PLANES} rows of {lines} lines, or {SERIES_ROWS}");
                Err(Error::Index { what: "reduction", index: 0, value: rows as f64, expected })
            }
        }
    }
}

/// A measured receptance beside the model reduced to one joint.
#[derive(Copy, Clone)]
pub struct Reduced<'a> {
    reduction: Reduction<'a>,
    frequencies: Frequencies<'a>,
    measured: &'a [Complex64],
    weights: &'a [f64],
    /// The seven columns of the joint at which the model was reduced.
    reference: [f64; SPRING_COLUMNS],
}

impl<'a> Reduced<'a> {
    /// What `reduce_joint` returned, of so many rows, and for each line what was measured and a weight.
    ///
    /// # Errors
    /// Arrays of different lengths.
    pub fn new(
        rows: usize,
        reduction: &'a [f64],
        frequencies: Frequencies<'a>,
        measured: &'a [Complex64],
        weights: &'a [f64],
        reference: [f64; SPRING_COLUMNS],
    ) -> Result<Self> {
        let lines = measured.len();
        for (index, length) in [frequencies.len(), weights.len()].into_iter().enumerate() {
            if length != lines {
                let expected = format!("{lines} lines");
                return Err(Error::Index { what: "reduction array", index, value: length as f64, expected });
            }
        }
        let reduction = Reduction::new(rows, reduction, lines)?;
        Ok(Self { reduction, frequencies, measured, weights, reference })
    }

    /// Every so many of the lines: the planes if there are any, w, measured receptance and weights.
    pub(crate) fn thinned(&self, stride: usize) -> Lines {
        let planes = match self.reduction {
            Reduction::Planes(planes) => {
                planes.chunks(self.lines()).flat_map(|plane| plane.iter().step_by(stride).copied()).collect()
            }
            Reduction::Series(_) => Vec::new(),
        };
        Lines {
            planes,
            w: self.frequencies.iter().step_by(stride).collect(),
            measured: self.measured.iter().step_by(stride).copied().collect(),
            weights: self.weights.iter().step_by(stride).copied().collect(),
        }
    }

    /// Other lines of the same receptance.
    pub(crate) fn of<'b>(&self, lines: &'b Lines) -> Reduced<'b>
    where
        'a: 'b,
    {
        let reduction = match self.reduction {
            Reduction::Planes(_) => Reduction::Planes(&lines.planes),
            Reduction::Series(_) => self.reduction,
        };
        let Lines { w, measured, weights, .. } = lines;
        let frequencies = Frequencies::complex(w, 1.0);
        Reduced { reduction, frequencies, measured, weights, reference: self.reference }
    }

    /// Number of lines.
    pub fn lines(&self) -> usize {
        self.measured.len()
    }

    /// Normal matrix of the weighted complex log residual log(measured/H) and its derivatives.
    ///
    /// Over the columns (each with the derivative of it by the fitted variable) and, last, the residual:
    /// A^T A with A = [J | r], rows the real and imaginary parts of all lines times `weights`. Returned as a
    /// full symmetric matrix, row by row.
    ///
    /// # Errors
    /// A column that a spring does not have.
    pub fn normal_matrix(
        &self,
        joint: &[f64; SPRING_COLUMNS],
        columns: &[(usize, f64)],
        threads: usize,
    ) -> Result<Vec<f64>> {
        for (index, column) in columns.iter().enumerate() {
            if column.0 >= SPRING_COLUMNS || index >= SPRING_COLUMNS {
                let expected = format!("at most {SPRING_COLUMNS} columns below {SPRING_COLUMNS}");
                return Err(Error::Index { what: "joint column", index, value: column.0 as f64, expected });
            }
        }
        let spring = Spring::new(joint);
        let sums = match self.reduction {
            Reduction::Planes(values) => self.sums(&self.planes(values, spring), &spring, columns, threads),
            Reduction::Series(rows) => self.sums(&AtJoint::new(rows, &spring), &spring, columns, threads),
        }?;
        let size = columns.len() + 1;
        let mut matrix = vec![0.0; size * size];
        // Summed in the order of the lines, whichever thread was first.
        for sum in sums {
            let mut entry = 0;
            for i in 0..size {
                for j in i..size {
                    matrix[i * size + j] += sum[entry];
                    entry += 1;
                }
            }
        }
        for i in 0..size {
            for j in 0..i {
                matrix[i * size + j] = matrix[j * size + i];
            }
        }
        Ok(matrix)
    }

    /// The weighted residual: the real parts of all lines, then the imaginary parts.
    ///
    /// # Errors
    /// The threads could not be started.
    pub fn residual(&self, joint: &[f64; SPRING_COLUMNS], threads: usize) -> Result<Vec<f64>> {
        let mut out = vec![0.0; 2 * self.lines()];
        let (re, im) = out.split_at_mut(self.lines());
        let spring = Spring::new(joint);
        match self.reduction {
            Reduction::Planes(values) => self.logarithms(&self.planes(values, spring), threads, re, im),
            Reduction::Series(rows) => self.logarithms(&AtJoint::new(rows, &spring), threads, re, im),
        }?;
        Ok(out)
    }

    fn planes(&self, values: &'a [f64], joint: Spring) -> Planes<'a> {
        Planes { values, reference: Spring::new(&self.reference), joint }
    }

    /// The upper triangle of each task.
    fn sums(
        &self,
        change: &impl Change,
        joint: &Spring,
        columns: &[(usize, f64)],
        threads: usize,
    ) -> Result<Vec<[f64; TRIANGLE]>> {
        let arch = Arch::new();
        on_threads(threads, self.frequencies.tasks(), A_TASK, |range| {
            arch.dispatch(Normal { reduced: *self, change, joint, columns, range })
        })
    }

    fn logarithms(&self, change: &impl Change, threads: usize, re: &mut [f64], im: &mut [f64]) -> Result<()> {
        let parts = re.chunks_mut(LINES_PER_TASK).zip(im.chunks_mut(LINES_PER_TASK));
        let tasks = self.frequencies.tasks().into_iter().zip(parts).collect();
        let arch = Arch::new();
        on_threads(threads, tasks, A_TASK, |(range, (re, im))| {
            arch.dispatch(Logarithms { reduced: *self, change, range, re, im });
        })?;
        Ok(())
    }
}

/// Some of the lines of a receptance.
pub(crate) struct Lines {
    planes: Vec<f64>,
    w: Vec<Complex64>,
    measured: Vec<Complex64>,
    weights: Vec<f64>,
}

/// The normal matrix of the lines of one task.
struct Normal<'a, T> {
    reduced: Reduced<'a>,
    change: &'a T,
    joint: &'a Spring,
    columns: &'a [(usize, f64)],
    range: Range<usize>,
}

impl<T: Change> WithSimd for Normal<'_, T> {
    type Output = [f64; TRIANGLE];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f64; TRIANGLE] {
        let size = self.columns.len() + 1;
        let mut sums = [simd.splat_f64s(0.0); TRIANGLE];
        let mut start = self.range.start;
        while start < self.range.end {
            let end = self.range.end.min(start + S::F64_LANES);
            let lines = start..end;
            let mut rows = [C::zero(simd); SPRING_COLUMNS + 1];
            let Update { inverse, left, right, iw } =
                self.change.update(simd, &self.reduced.frequencies, lines.clone());
            let weight = simd.partial_load_f64s(&self.reduced.weights[lines.clone()]);
            for (row, (column, slope)) in rows.iter_mut().zip(self.columns) {
                let change = spring_derivative(self.joint, *column, iw, &left, &right);
                *row = change.scale(-slope);
            }
            rows[size - 1] = (C::load(simd, &self.reduced.measured[lines]) * inverse).ln();
            for row in &mut rows[..size] {
                row.re = simd.mul_f64s(row.re, weight);
                row.im = simd.mul_f64s(row.im, weight);
            }
            let mut entry = 0;
            for i in 0..size {
                for j in i..size {
                    let sum = simd.mul_add_e_f64s(rows[i].re, rows[j].re, sums[entry]);
                    sums[entry] = simd.mul_add_e_f64s(rows[i].im, rows[j].im, sum);
                    entry += 1;
                }
            }
            start = end;
        }
        let mut out = [0.0; TRIANGLE];
        for (out, sum) in out.iter_mut().zip(sums) {
            let mut lanes = [0.0; MAX_LANES];
            R { simd, v: sum }.store(&mut lanes);
            *out = lanes[..S::F64_LANES].iter().sum();
        }
        out
    }
}

/// The residuals of the lines of one task.
struct Logarithms<'a, T> {
    reduced: Reduced<'a>,
    change: &'a T,
    range: Range<usize>,
    re: &'a mut [f64],
    im: &'a mut [f64],
}

impl<T: Change> WithSimd for Logarithms<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let first = self.range.start;
        let mut start = first;
        while start < self.range.end {
            let end = self.range.end.min(start + S::F64_LANES);
            let Update { inverse, .. } = self.change.update(simd, &self.reduced.frequencies, start..end);
            let weight = simd.partial_load_f64s(&self.reduced.weights[start..end]);
            let found = (C::load(simd, &self.reduced.measured[start..end]) * inverse).ln();
            simd.partial_store_f64s(
                &mut self.re[start - first..end - first],
                simd.mul_f64s(found.re, weight),
            );
            simd.partial_store_f64s(
                &mut self.im[start - first..end - first],
                simd.mul_f64s(found.im, weight),
            );
            start = end;
        }
    }
}
