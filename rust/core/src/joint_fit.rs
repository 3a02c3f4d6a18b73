//! The complex log residual of a receptance that is reduced to one joint, and its normal matrix.
//!
//! See `reduction` for how the receptance follows from the joint's stiffness.

use crate::error::{Error, Result};
use crate::gradient::spring_derivative;
use crate::lane::{C, MAX_LANES, R};
use crate::model::Spring;
use crate::reduction::REDUCTION_PLANES;
use crate::response::LINES_PER_TASK;
use crate::small::{self, Mat};
use crate::threads::on_threads;
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Most columns of a spring.
pub(crate) const SPRING_COLUMNS: usize = 7;

/// Entries of the upper triangle over the columns and the residual.
const TRIANGLE: usize = (SPRING_COLUMNS + 1) * (SPRING_COLUMNS + 2) / 2;

/// A measured receptance beside the model reduced to one joint.
#[derive(Copy, Clone)]
pub struct Reduced<'a> {
    /// The planes of `reduce_joint`, one after the other.
    planes: &'a [f64],
    measured: &'a [Complex64],
    weights: &'a [f64],
    /// The seven columns of the joint at which the model was reduced.
    reference: [f64; SPRING_COLUMNS],
}

impl<'a> Reduced<'a> {
    /// Planes, measured receptance and a weight for each line.
    ///
    /// # Errors
    /// Arrays of different lengths.
    pub fn new(
        planes: &'a [f64],
        measured: &'a [Complex64],
        weights: &'a [f64],
        reference: [f64; SPRING_COLUMNS],
    ) -> Result<Self> {
        let lines = measured.len();
        for (index, length) in [planes.len() / REDUCTION_PLANES, weights.len()].into_iter().enumerate() {
            if length != lines || !planes.len().is_multiple_of(REDUCTION_PLANES) {
                let expected = format!("{lines} lines");
                return Err(Error::Index { what: "reduction array", index, value: length as f64, expected });
            }
        }
        Ok(Self { planes, measured, weights, reference })
    }

    /// Planes, measured receptance and weights.
    pub(crate) fn parts(&self) -> (&'a [f64], &'a [Complex64], &'a [f64]) {
        (self.planes, self.measured, self.weights)
    }

    /// Other lines of the same receptance.
    pub(crate) fn of<'b>(
        &self,
        planes: &'b [f64],
        measured: &'b [Complex64],
        weights: &'b [f64],
    ) -> Reduced<'b> {
        Reduced { planes, measured, weights, reference: self.reference }
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
        let arch = Arch::new();
        let sums: Vec<[f64; TRIANGLE]> = on_threads(threads, tasks(self.lines()), |range| {
            arch.dispatch(Normal { reduced: *self, joint, columns, range })
        })?;
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
        let parts = re.chunks_mut(LINES_PER_TASK).zip(im.chunks_mut(LINES_PER_TASK));
        let tasks = tasks(self.lines()).into_iter().zip(parts).collect();
        let arch = Arch::new();
        on_threads(threads, tasks, |(range, (re, im))| {
            arch.dispatch(Logarithms { reduced: *self, joint, range, re, im });
        })?;
        Ok(out)
    }

    /// The complex numbers of a pair of planes.
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, pair: usize, lines: Range<usize>) -> C<S> {
        let n = self.lines();
        let (re, im) = (2 * pair * n, (2 * pair + 1) * n);
        let re = &self.planes[re + lines.start..re + lines.end];
        let im = &self.planes[im + lines.start..im + lines.end];
        C { simd, re: simd.partial_load_f64s(re), im: simd.partial_load_f64s(im) }
    }
}

/// The lines of each task.
fn tasks(lines: usize) -> Vec<Range<usize>> {
    let count = lines.div_ceil(LINES_PER_TASK);
    (0..count).map(|task| task * LINES_PER_TASK..lines.min((task + 1) * LINES_PER_TASK)).collect()
}

/// The normal matrix of the lines of one task.
struct Normal<'a> {
    reduced: Reduced<'a>,
    joint: &'a [f64; SPRING_COLUMNS],
    columns: &'a [(usize, f64)],
    range: Range<usize>,
}

impl WithSimd for Normal<'_> {
    type Output = [f64; TRIANGLE];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f64; TRIANGLE] {
        let joint = Spring::new(self.joint);
        let size = self.columns.len() + 1;
        let mut sums = [simd.splat_f64s(0.0); TRIANGLE];
        let mut start = self.range.start;
        while start < self.range.end {
            let end = self.range.end.min(start + S::F64_LANES);
            let lines = start..end;
            let mut rows = [C::zero(simd); SPRING_COLUMNS + 1];
            let (inverse, left, right, iw) = self.reduced.update(simd, &joint, lines.clone());
            let weight = simd.partial_load_f64s(&self.reduced.weights[lines.clone()]);
            for (row, (column, slope)) in rows.iter_mut().zip(self.columns) {
                let change = spring_derivative(&joint, *column, iw, &left, &right);
                *row = (change * inverse).scale(-slope);
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
struct Logarithms<'a> {
    reduced: Reduced<'a>,
    joint: &'a [f64; SPRING_COLUMNS],
    range: Range<usize>,
    re: &'a mut [f64],
    im: &'a mut [f64],
}

impl WithSimd for Logarithms<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let joint = Spring::new(self.joint);
        let first = self.range.start;
        let mut start = first;
        while start < self.range.end {
            let end = self.range.end.min(start + S::F64_LANES);
            let (inverse, ..) = self.reduced.update(simd, &joint, start..end);
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

impl Reduced<'_> {
    /// 1/H and the joint's relative motions under both loads, and i w.
    #[inline(always)]
    #[allow(clippy::type_complexity)]
    fn update<S: Simd>(
        &self,
        simd: S,
        joint: &Spring,
        lines: Range<usize>,
    ) -> (C<S>, [C<S>; 2], [C<S>; 2], C<S>) {
        let mut values = [C::zero(simd); REDUCTION_PLANES / 2];
        for (pair, value) in values.iter_mut().enumerate() {
            *value = self.load(simd, pair, lines.clone());
        }
        let short = lines.end - lines.start < S::F64_LANES;
        let w = if short { fill(values[0], lines.end - lines.start) } else { values[0] };
        let iw = w.times_i();
        let compliance: Mat<S, 2> = small::inverse(&joint.stiffness(simd, iw));
        let before: Mat<S, 2> = small::inverse(&Spring::new(&self.reference).stiffness(simd, iw));
        let mut more = compliance;
        for i in 0..2 {
            for j in 0..2 {
                more[i][j] = compliance[i][j] - before[i][j];
            }
        }
        let (left, right) = ([values[2], values[3]], [values[4], values[5]]);
        let y = [[values[6], values[7]], [values[7], values[8]]];
        let one = small::identity::<S, 2>(simd);
        let share = small::inverse(&small::mul_add(&y, &more, &one));
        let (force_left, force_right) = (small::apply(&share, &left), small::apply(&share, &right));
        let gap = small::apply(&more, &force_right);
        let h = left[1].mul_add(gap[1], left[0].mul_add(gap[0], values[1]));
        // Lanes without a line would divide by zero.
        let h = if short { fill(h, lines.end - lines.start) } else { h };
        (h.recip(), small::apply(&compliance, &force_left), small::apply(&compliance, &force_right), iw)
    }
}

/// Ones in the lanes from `count` on.
#[inline(always)]
fn fill<S: Simd>(value: C<S>, count: usize) -> C<S> {
    let mut lanes = [Complex64::ONE; MAX_LANES];
    value.store(&mut lanes);
    for lane in lanes.iter_mut().take(S::F64_LANES).skip(count) {
        *lane = Complex64::ONE;
    }
    C::load(value.simd, &lanes[..S::F64_LANES])
}
