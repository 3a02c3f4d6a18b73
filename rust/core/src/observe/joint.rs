//! The complex log residual of a receptance that is reduced to one joint, and its normal matrix.
//!
//! See `reduction` for how the receptance follows from the joint's stiffness.

use crate::error::{Error, Result, one_a_line};
use crate::joint::change::{Change, Planes, Update};
use crate::joint::reduction::{JointReduction, Reduction};
use crate::joint::series::AtJoint;
use crate::line::derivatives::spring_derivative;
use crate::model::frequencies::Frequencies;
use crate::model::spring::{SPRING_COLUMNS, Spring};
use crate::observe::lines::Rows;
use crate::simd::lane::{C, MAX_LANES, R};
use crate::threads::on_threads;
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Least time of a task [ns].
const A_TASK: f64 = 1e3;

/// Entries of the upper triangle over the columns and the residual.
const TRIANGLE: usize = (SPRING_COLUMNS + 1) * (SPRING_COLUMNS + 2) / 2;

/// A measured receptance beside the model reduced to one joint.
#[derive(Copy, Clone)]
pub struct Reduced<'a> {
    reduction: &'a Reduction,
    frequencies: Frequencies<'a>,
    measured: &'a [Complex64],
    weights: &'a [f64],
    /// The columns of the joint at which the model was reduced.
    reference: [f64; SPRING_COLUMNS],
}

impl<'a> Reduced<'a> {
    /// A reduced model, and for each of its lines the measured value and a weight.
    ///
    /// # Errors
    /// Arrays of different lengths.
    pub fn new(model: &'a JointReduction, measured: &'a [Complex64], weights: &'a [f64]) -> Result<Self> {
        let frequencies = model.frequencies();
        one_a_line(measured.len(), weights.len(), frequencies.len())?;
        Ok(Self { reduction: &model.reduction, frequencies, measured, weights, reference: model.reference })
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

    /// The weighted residual, the real parts of all lines and then the imaginary parts, and its derivatives by the
    /// columns, row by row.
    ///
    /// # Errors
    /// The threads could not be started.
    pub fn rows(
        &self,
        joint: &[f64; SPRING_COLUMNS],
        columns: &[(usize, f64)],
        threads: usize,
    ) -> Result<Rows> {
        let spring = Spring::new(joint);
        let parts = match self.reduction {
            Reduction::Planes(values) => self.parts(&self.planes(values, spring), &spring, columns, threads),
            Reduction::Series(rows) => self.parts(&AtJoint::new(rows, &spring), &spring, columns, threads),
        }?;
        let (lines, wide) = (self.lines(), columns.len());
        let mut rows = Rows { residual: vec![0.0; 2 * lines], jacobian: vec![0.0; 2 * lines * wide] };
        for (line, values) in parts.iter().flat_map(|part| part.chunks(wide + 1)).enumerate() {
            for (row, part) in [(line, [true, false]), (lines + line, [false, true])] {
                let of = |value: &Complex64| if part[0] { value.re } else { value.im };
                for (into, value) in rows.jacobian[row * wide..(row + 1) * wide].iter_mut().zip(values) {
                    *into = of(value);
                }
                rows.residual[row] = of(&values[wide]);
            }
        }
        Ok(rows)
    }

    /// The derivatives by the columns and the residual of each line, task by task.
    fn parts(
        &self,
        change: &impl Change,
        joint: &Spring,
        columns: &[(usize, f64)],
        threads: usize,
    ) -> Result<Vec<Vec<Complex64>>> {
        let arch = Arch::new();
        on_threads(threads, self.frequencies.tasks(), A_TASK, |range| {
            arch.dispatch(Each { reduced: *self, change, joint, columns, range })
        })
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
            let rows = block(simd, &self.reduced, self.change, self.joint, self.columns, start..end);
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

/// The derivatives by the columns and the residual of each line of one task.
struct Each<'a, T> {
    reduced: Reduced<'a>,
    change: &'a T,
    joint: &'a Spring,
    columns: &'a [(usize, f64)],
    range: Range<usize>,
}

impl<T: Change> WithSimd for Each<'_, T> {
    type Output = Vec<Complex64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Complex64> {
        let size = self.columns.len() + 1;
        let mut out = vec![Complex64::ZERO; self.range.len() * size];
        let mut start = self.range.start;
        while start < self.range.end {
            let end = self.range.end.min(start + S::F64_LANES);
            let rows = block(simd, &self.reduced, self.change, self.joint, self.columns, start..end);
            for (column, row) in rows[..size].iter().enumerate() {
                let (mut re, mut im) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
                R { simd, v: row.re }.store(&mut re);
                R { simd, v: row.im }.store(&mut im);
                for lane in 0..end - start {
                    out[(start - self.range.start + lane) * size + column] =
                        Complex64::new(re[lane], im[lane]);
                }
            }
            start = end;
        }
        out
    }
}

/// The weighted derivatives by the columns and, behind them, the weighted residual of a block of lines.
#[inline(always)]
fn block<S: Simd>(
    simd: S,
    reduced: &Reduced,
    change: &impl Change,
    joint: &Spring,
    columns: &[(usize, f64)],
    lines: Range<usize>,
) -> [C<S>; SPRING_COLUMNS + 1] {
    let mut rows = [C::zero(simd); SPRING_COLUMNS + 1];
    let Update { inverse, left, right, iw } = change.update(simd, &reduced.frequencies, lines.clone());
    let weight = simd.partial_load_f64s(&reduced.weights[lines.clone()]);
    for (row, (column, slope)) in rows.iter_mut().zip(columns) {
        let change = spring_derivative(joint, *column, iw, &left, &right);
        *row = change.scale(-slope);
    }
    rows[columns.len()] = (C::load(simd, &reduced.measured[lines]) * inverse).ln();
    for row in &mut rows[..=columns.len()] {
        row.re = simd.mul_f64s(row.re, weight);
        row.im = simd.mul_f64s(row.im, weight);
    }
    rows
}
