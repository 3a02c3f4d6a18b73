//! Fits in which only one joint changes: everything else is evaluated once.
//!
//! With the assembly known at a reference stiffness K_0, let H_0 be the observed receptance, F_e and F_r the
//! force in the joint under unit loads at the excited and at the measured coordinate, and Y the force per gap
//! imposed in the joint. Another stiffness adds the compliance D = K^-1 - K_0^-1, so that
//!     H = H_0 + F_r^T D (1 + Y D)^-1 F_e,
//! an exact low-rank update. Starting from the assembled structure it loses nothing where the parts alone
//! have huge rigid-body receptances that cancel in a plain coupling.

use crate::error::{Error, Result};
use crate::gradient::spring_derivative;
use crate::lane::{C, MAX_LANES, R};
use crate::model::{Model, Motion, Spring};
use crate::request::{Coordinate, Request};
use crate::response::{LINES_PER_TASK, receptance};
use crate::small::{self, Mat};
use crate::threads::on_threads;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Real planes of a reduction: w, H_0, F_r (2), F_e (2), Y (3), real and imaginary parts each.
pub const REDUCTION_PLANES: usize = 18;

/// Most columns of a spring.
const SPRING_COLUMNS: usize = 7;

/// Entries of the upper triangle over the columns and the residual.
const TRIANGLE: usize = (SPRING_COLUMNS + 1) * (SPRING_COLUMNS + 2) / 2;

/// What is fitted, and at which stiffness of the joint it is to be evaluated.
pub struct Fitted<'a> {
    /// The seven columns of the reference joint.
    pub reference: [f64; SPRING_COLUMNS],
    /// The seven columns of the joint now.
    pub joint: [f64; SPRING_COLUMNS],
    /// Columns to differentiate by, and the derivative of each by the fitted variable.
    pub columns: &'a [(usize, f64)],
}

/// Reduces a model to one joint; the planes one after the other, each as long as `w`.
///
/// # Errors
/// As `receptance`, and where the model is not in bending or has no such joint.
pub fn reduce_joint(
    model: &Model,
    joint: usize,
    w: &[Complex64],
    response: Coordinate,
    excitation: Coordinate,
    threads: usize,
) -> Result<Vec<f64>> {
    if model.motion != Motion::Bending || joint >= model.joints.len() {
        let expected = format!("a joint below {} of a model in bending", model.joints.len());
        return Err(Error::Index { what: "joint", index: 0, value: joint as f64, expected });
    }
    let (nodes, spring) = model.joints[joint];
    let request = Request {
        excitations: vec![excitation, response],
        responses: vec![response],
        parameters: Vec::new(),
        joint: Some(joint),
    };
    let whole = receptance(model, w, &request, threads)?;
    let first = face(model, joint, nodes[0], w, threads)?;
    let second = face(model, joint, nodes[1], w, threads)?;
    let mut planes = vec![0.0; REDUCTION_PLANES * w.len()];
    for (line, &w_line) in w.iter().enumerate() {
        let stiffness = complex_stiffness(&spring, w_line);
        let at = |side: &[Complex64]| [side[4 * line], side[4 * line + 1], side[4 * line + 3]];
        let y = inverse(add(inverse(stiffness), add(at(&first), at(&second))));
        let force = &whole.force[4 * line..4 * line + 4];
        let mut values = [Complex64::ZERO; REDUCTION_PLANES / 2];
        values[0] = w_line;
        values[1] = whole.receptance[2 * line];
        values[2..4].copy_from_slice(&force[2..]);
        values[4..6].copy_from_slice(&force[..2]);
        values[6..9].copy_from_slice(&y);
        for (plane, value) in values.into_iter().enumerate() {
            planes[2 * plane * w.len() + line] = value.re;
            planes[(2 * plane + 1) * w.len() + line] = value.im;
        }
    }
    Ok(planes)
}

/// Receptance of one side at its face of the joint, (n, 2, 2).
fn face(model: &Model, joint: usize, node: usize, w: &[Complex64], threads: usize) -> Result<Vec<Complex64>> {
    let (side, number) = model.side(joint, node);
    let node = number[node].unwrap_or(0);
    let points = vec![Coordinate { node, direction: 0 }, Coordinate { node, direction: 1 }];
    let request = Request { excitations: points.clone(), responses: points, ..Request::default() };
    Ok(receptance(&side, w, &request, threads)?.receptance)
}

fn complex_stiffness(spring: &Spring, w: Complex64) -> [Complex64; 3] {
    let entry = |i: usize| {
        Complex64::new(spring.k[i], spring.k[i] * spring.loss_factor) + Complex64::I * w * spring.c[i]
    };
    [entry(0), entry(2), entry(1)]
}

fn add(a: [Complex64; 3], b: [Complex64; 3]) -> [Complex64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn inverse(a: [Complex64; 3]) -> [Complex64; 3] {
    let inverse = (a[0] * a[2] - a[1] * a[1]).inv();
    [a[2] * inverse, -a[1] * inverse, a[0] * inverse]
}

/// Normal matrix of the weighted complex log residual log(measured/H) and its derivatives.
///
/// Over the columns and, last, the residual: A^T A with A = [J | r], rows the real and imaginary parts of all
/// lines times `weights`. Returned as a full symmetric matrix, row by row.
///
/// # Errors
/// Planes, logarithms and weights of different lengths, or a column that a spring does not have.
pub fn joint_normal_matrix(
    planes: &[f64],
    log_measured: &[Complex64],
    weights: &[f64],
    fitted: &Fitted,
    threads: usize,
) -> Result<Vec<f64>> {
    let lines = log_measured.len();
    for (index, length) in [planes.len() / REDUCTION_PLANES, weights.len()].into_iter().enumerate() {
        if length != lines || !planes.len().is_multiple_of(REDUCTION_PLANES) {
            let expected = format!("{lines} lines");
            return Err(Error::Index { what: "reduction array", index, value: length as f64, expected });
        }
    }
    for (index, column) in fitted.columns.iter().enumerate() {
        if column.0 >= SPRING_COLUMNS || index >= SPRING_COLUMNS {
            let expected = format!("at most {SPRING_COLUMNS} columns below {SPRING_COLUMNS}");
            return Err(Error::Index { what: "joint column", index, value: column.0 as f64, expected });
        }
    }
    let tasks = (0..lines.div_ceil(LINES_PER_TASK)).collect();
    let arch = Arch::new();
    let sums: Vec<[f64; TRIANGLE]> = on_threads(threads, tasks, |task| {
        let range = task * LINES_PER_TASK..lines.min((task + 1) * LINES_PER_TASK);
        arch.dispatch(Normal { planes, log_measured, weights, fitted, range })
    })?;
    let size = fitted.columns.len() + 1;
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

/// The lines of one task.
struct Normal<'a> {
    planes: &'a [f64],
    log_measured: &'a [Complex64],
    weights: &'a [f64],
    fitted: &'a Fitted<'a>,
    range: core::ops::Range<usize>,
}

impl Normal<'_> {
    /// The complex numbers of a pair of planes.
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, pair: usize, lines: core::ops::Range<usize>) -> C<S> {
        let n = self.log_measured.len();
        let (re, im) = (2 * pair * n, (2 * pair + 1) * n);
        let re = &self.planes[re + lines.start..re + lines.end];
        let im = &self.planes[im + lines.start..im + lines.end];
        C { simd, re: simd.partial_load_f64s(re), im: simd.partial_load_f64s(im) }
    }
}

impl WithSimd for Normal<'_> {
    type Output = [f64; TRIANGLE];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f64; TRIANGLE] {
        let (joint, reference) = (Spring::new(&self.fitted.joint), Spring::new(&self.fitted.reference));
        let size = self.fitted.columns.len() + 1;
        let mut sums = [simd.splat_f64s(0.0); TRIANGLE];
        let mut start = self.range.start;
        while start < self.range.end {
            let end = self.range.end.min(start + S::F64_LANES);
            let missing = end - start < S::F64_LANES;
            let lines = start..end;
            let mut rows = [C::zero(simd); SPRING_COLUMNS + 1];
            let (h, left, right, iw) = self.update(simd, &joint, &reference, lines.clone());
            // Lanes without a line would take the logarithm of zero.
            let h = if missing { fill(h, end - start) } else { h };
            let weight = simd.partial_load_f64s(&self.weights[lines.clone()]);
            let inverse = h.recip();
            for (row, (column, slope)) in rows.iter_mut().zip(self.fitted.columns) {
                let change = spring_derivative(&joint, *column, iw, &left, &right);
                *row = (change * inverse).scale(-slope);
            }
            let measured = C::load(simd, &self.log_measured[lines]);
            rows[size - 1] = wrapped(measured - h.ln());
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

impl Normal<'_> {
    /// H and the joint's relative motions under both loads, and i w.
    #[inline(always)]
    #[allow(clippy::type_complexity)]
    fn update<S: Simd>(
        &self,
        simd: S,
        joint: &Spring,
        reference: &Spring,
        lines: core::ops::Range<usize>,
    ) -> (C<S>, [C<S>; 2], [C<S>; 2], C<S>) {
        let mut values = [C::zero(simd); REDUCTION_PLANES / 2];
        for (pair, value) in values.iter_mut().enumerate() {
            *value = self.load(simd, pair, lines.clone());
        }
        let short = lines.end - lines.start < S::F64_LANES;
        let w = if short { fill(values[0], lines.end - lines.start) } else { values[0] };
        let iw = w.times_i();
        let compliance: Mat<S, 2> = small::inverse(&joint.stiffness(simd, iw));
        let before: Mat<S, 2> = small::inverse(&reference.stiffness(simd, iw));
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
        (h, small::apply(&compliance, &force_left), small::apply(&compliance, &force_right), iw)
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

/// A difference of two principal logarithms brought back to the principal branch.
#[inline(always)]
fn wrapped<S: Simd>(value: C<S>) -> C<S> {
    let s = value.simd;
    let (pi, turn) = (s.splat_f64s(core::f64::consts::PI), s.splat_f64s(core::f64::consts::TAU));
    let above = s.greater_than_f64s(value.im, pi);
    let below = s.less_than_f64s(value.im, s.neg_f64s(pi));
    let im = s.select_f64s(above, s.sub_f64s(value.im, turn), value.im);
    let im = s.select_f64s(below, s.add_f64s(value.im, turn), im);
    C { simd: s, re: value.re, im }
}
