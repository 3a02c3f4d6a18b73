//! A measured receptance beside a model that is reduced to one joint: the complex log residual and its normal matrix.
//!
//! See `reduction` for how the receptance follows from the joint's stiffness.

use crate::error::Result;
use crate::joint::change::{Change, Planes, Update};
use crate::joint::reduction::{JointReduction, Reduction};
use crate::joint::series::AtJoint;
use crate::line::derivatives::spring_derivative;
use crate::model::frequencies::Frequencies;
use crate::model::spring::{SPRING_COLUMNS, Spring};
use crate::observe::lines::Rows;
use crate::observe::observed::Record;
use crate::simd::lane::{C, MAX_LANES, R};
use crate::threads::on_threads;
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};
use std::sync::Arc;

/// Least time of a task [ns].
const A_TASK: f64 = 1e3;

/// Entries of the upper triangle over the columns and the residual.
const TRIANGLE: usize = (SPRING_COLUMNS + 1) * (SPRING_COLUMNS + 2) / 2;

/// A receptance of a model that is reduced to one joint.
#[derive(Clone, Debug)]
pub struct OfJoint {
    /// The model.
    pub reduction: Arc<JointReduction>,
    /// The measurement on its lines.
    pub record: Record,
    /// The columns of the joint, where they are not fitted.
    pub joint: [f64; SPRING_COLUMNS],
    /// The variable of each column, if it is fitted.
    pub variables: [Option<usize>; SPRING_COLUMNS],
}

/// A joint with the columns that are fitted, each with the derivative of it by the fitted variable.
pub(crate) struct Fitted {
    pub spring: Spring,
    pub columns: Vec<(usize, f64)>,
}

impl OfJoint {
    /// The joint at given values of the variables.
    ///
    /// # Errors
    /// Values that make no joint.
    pub(crate) fn joint(&self, values: &[f64]) -> Result<Spring> {
        let mut joint = self.joint;
        for (column, variable) in joint.iter_mut().zip(&self.variables) {
            if let Some(variable) = *variable {
                *column = values[variable];
            }
        }
        let spring = Spring::new(&joint);
        spring.check("joint", 0)?;
        Ok(spring)
    }

    /// The joint, and the variables of the columns that move with them.
    ///
    /// # Errors
    /// Values that make no joint.
    pub(crate) fn fitted(&self, values: &[f64], slopes: &[f64]) -> Result<(Fitted, Vec<usize>)> {
        let each = self.variables.iter().enumerate();
        let moving = each.filter_map(|(column, variable)| variable.map(|variable| (column, variable)));
        let moving = moving.filter(|(_, variable)| slopes[*variable] != 0.0);
        let (columns, variables) =
            moving.map(|(column, variable)| ((column, slopes[variable]), variable)).unzip();
        Ok((Fitted { spring: self.joint(values)?, columns }, variables))
    }

    /// Normal matrix of the weighted complex log residual log(measured/H) and its derivatives.
    ///
    /// Over the columns and, last, the residual: A^T A with A = [J | r], rows the real and imaginary parts of all lines
    /// times the weights. Returned as a full symmetric matrix, row by row.
    ///
    /// # Errors
    /// The threads could not be started.
    pub(crate) fn normal_matrix(&self, joint: &Fitted, threads: usize) -> Result<Vec<f64>> {
        let sums = match &self.reduction.reduction {
            Reduction::Planes(values) => self.sums(&self.planes(values, joint), joint, threads),
            Reduction::Series(rows) => self.sums(&AtJoint::new(rows, &joint.spring), joint, threads),
        }?;
        let size = joint.columns.len() + 1;
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
    pub(crate) fn rows(&self, joint: &Fitted, threads: usize) -> Result<Rows> {
        let parts = match &self.reduction.reduction {
            Reduction::Planes(values) => self.parts(&self.planes(values, joint), joint, threads),
            Reduction::Series(rows) => self.parts(&AtJoint::new(rows, &joint.spring), joint, threads),
        }?;
        let (lines, wide) = (self.reduction.lines(), joint.columns.len());
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

    fn planes<'a>(&self, values: &'a [f64], joint: &Fitted) -> Planes<'a> {
        Planes { values, reference: Spring::new(&self.reduction.reference), joint: joint.spring }
    }

    /// The upper triangle of each task.
    fn sums(&self, change: &impl Change, joint: &Fitted, threads: usize) -> Result<Vec<[f64; TRIANGLE]>> {
        let (arch, tasks) = (Arch::new(), self.reduction.frequencies().tasks());
        on_threads(threads, tasks, A_TASK, |range| {
            arch.dispatch(Normal(Lines { observed: self, change, joint, range }))
        })
    }

    /// The derivatives by the columns and the residual of each line, task by task.
    fn parts(&self, change: &impl Change, joint: &Fitted, threads: usize) -> Result<Vec<Vec<Complex64>>> {
        let (arch, tasks) = (Arch::new(), self.reduction.frequencies().tasks());
        on_threads(threads, tasks, A_TASK, |range| {
            arch.dispatch(Each(Lines { observed: self, change, joint, range }))
        })
    }
}

/// The lines of one task.
struct Lines<'a, T> {
    observed: &'a OfJoint,
    change: &'a T,
    joint: &'a Fitted,
    range: Range<usize>,
}

impl<T: Change> Lines<'_, T> {
    /// The ranges of the lines that fill so many lanes.
    #[inline(always)]
    fn blocks(&self, lanes: usize) -> impl Iterator<Item = Range<usize>> + use<T> {
        let end = self.range.end;
        self.range.clone().step_by(lanes).map(move |start| start..end.min(start + lanes))
    }

    /// The weighted derivatives by the columns and, behind them, the weighted residual of a block of lines.
    #[inline(always)]
    fn block<S: Simd>(
        &self,
        simd: S,
        frequencies: &Frequencies,
        lines: Range<usize>,
    ) -> [C<S>; SPRING_COLUMNS + 1] {
        let Self { observed: OfJoint { record, .. }, change, joint, .. } = self;
        let wide = joint.columns.len();
        let mut rows = [C::zero(simd); SPRING_COLUMNS + 1];
        let Update { inverse, left, right, iw } = change.update(simd, frequencies, lines.clone());
        let weight = simd.partial_load_f64s(&record.weights[lines.clone()]);
        for (row, (column, slope)) in rows.iter_mut().zip(&joint.columns) {
            let change = spring_derivative(&joint.spring, *column, iw, &left, &right);
            *row = change.scale(-slope);
        }
        rows[wide] = (C::load(simd, &record.measured[lines]) * inverse).ln();
        for row in &mut rows[..=wide] {
            *row = row.mul_real(weight);
        }
        rows
    }
}

/// The normal matrix of the lines of one task.
struct Normal<'a, T>(Lines<'a, T>);

impl<T: Change> WithSimd for Normal<'_, T> {
    type Output = [f64; TRIANGLE];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f64; TRIANGLE] {
        let size = self.0.joint.columns.len() + 1;
        let frequencies = self.0.observed.reduction.frequencies();
        let mut sums = [simd.splat_f64s(0.0); TRIANGLE];
        for lines in self.0.blocks(S::F64_LANES) {
            let rows = self.0.block(simd, &frequencies, lines);
            let mut entry = 0;
            for i in 0..size {
                for j in i..size {
                    let sum = simd.mul_add_e_f64s(rows[i].re, rows[j].re, sums[entry]);
                    sums[entry] = simd.mul_add_e_f64s(rows[i].im, rows[j].im, sum);
                    entry += 1;
                }
            }
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
struct Each<'a, T>(Lines<'a, T>);

impl<T: Change> WithSimd for Each<'_, T> {
    type Output = Vec<Complex64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Complex64> {
        let size = self.0.joint.columns.len() + 1;
        let frequencies = self.0.observed.reduction.frequencies();
        let mut out = vec![Complex64::ZERO; self.0.range.len() * size];
        let mut lanes = [Complex64::ZERO; MAX_LANES];
        for lines in self.0.blocks(S::F64_LANES) {
            let (start, count) = (lines.start - self.0.range.start, lines.len());
            let rows = self.0.block(simd, &frequencies, lines);
            for (column, row) in rows[..size].iter().enumerate() {
                row.store(&mut lanes);
                for lane in 0..count {
                    out[(start + lane) * size + column] = lanes[lane];
                }
            }
        }
        out
    }
}
