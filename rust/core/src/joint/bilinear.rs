//! A receptance that is reduced to one joint as a quotient of two sums with real factors.
//!
//! With K the joint's stiffness and C = K^-1, H = N / D and
//!     N = det K n0 + k22 n1 + k11 n2 + k12 n3 + n4,
//! D likewise, n and d being functions of the line and of all that is not the joint: the series of `joint_series`, or
//! from the planes of `reduction`. There, with G = K_0^-1 and because adj(1 + A) = 1 + adj(A) for 2 x 2 matrices,
//!     D = 1 + tr(Y (C - G)) + det Y det(C - G),   N = H_0 D + F_r^T ((C - G) + det(C - G) adj(Y)) F_e
//! up to det K. The entries of K are k (1 + i loss) + i w c, so that N and D are sums over columns: a real factor that
//! only the joint has, times a complex number that only the line has. For many joints on many lines that is a product
//! of two real matrices.

use crate::joint::change::REDUCTION_PLANES;
use crate::joint::reduction::Reduction;
use crate::joint::series::SERIES_ROWS;
use crate::model::frequencies::Frequencies;
use crate::model::spring::{SPRING, SPRING_COLUMNS, Spring, Term};
use crate::simd::lane::{C, MAX_LANES};
use crate::simd::small::{self, Mat};
use core::ops::Range;
use num_complex::Complex64;
use pulp::Simd;

/// Functions of the line in each of N and D.
pub const FUNCTIONS: usize = 5;

/// Columns of the sums.
pub const COLUMNS: usize = 15;

/// Factor of a function of the line, besides the factor of the joint.
#[derive(Copy, Clone, PartialEq)]
enum By {
    One,
    I,
    Iw,
    IIw,
    IwIw,
}

/// The function of each column, and its factor; `factors` has the joint's part in the same order.
const OF_COLUMN: [(usize, By); COLUMNS] = [
    (0, By::One),
    (0, By::I),
    (0, By::Iw),
    (0, By::IIw),
    (0, By::IwIw),
    (1, By::One),
    (1, By::I),
    (1, By::Iw),
    (2, By::One),
    (2, By::I),
    (2, By::Iw),
    (3, By::One),
    (3, By::I),
    (3, By::Iw),
    (4, By::One),
];

/// A joint's factor of each column, all together made about one at the angular frequency `highest`.
pub fn factors(joint: &Spring, highest: f64) -> [f64; COLUMNS] {
    let ([ky, kt, kc], [cy, ct, cc]) = (joint.hysteretic(), joint.c);
    let size = |k: Complex64, c: f64| k.norm() + highest * c;
    // A power of two, so that no digit changes.
    let scale = (-(size(ky, cy) * size(kt, ct)).log2().floor()).exp2();
    let (stiff, mixed) = (ky * kt - kc * kc, ky * ct + kt * cy - 2.0 * kc * cc);
    let row = |k: Complex64, c: f64| [k.re, k.im, c];
    let mut out = [1.0; COLUMNS];
    out[..5].copy_from_slice(&[stiff.re, stiff.im, mixed.re, mixed.im, cy * ct - cc * cc]);
    out[5..8].copy_from_slice(&row(kt, ct));
    out[8..11].copy_from_slice(&row(ky, cy));
    out[11..14].copy_from_slice(&row(kc, cc));
    out.map(|value| value * scale)
}

/// The functions of the lines, n0 to n4 and d0 to d4.
#[derive(Copy, Clone)]
pub struct Functions<'a> {
    /// The reduced model.
    pub reduction: &'a Reduction,
    /// The lines.
    pub frequencies: Frequencies<'a>,
    /// The joint at which it was reduced.
    pub reference: Spring,
}

/// The functions of a block of lines.
pub type OnLines<S> = [[C<S>; FUNCTIONS]; 2];

impl Functions<'_> {
    /// The functions of a block of lines and i w; lanes without a line repeat the last one.
    #[inline(always)]
    pub fn at<S: Simd>(&self, simd: S, lines: Range<usize>) -> (OnLines<S>, C<S>) {
        let iw = self.frequencies.load(simd, lines.clone()).times_i();
        let functions = match self.reduction {
            Reduction::Series(rows) => of_series(simd, rows, iw),
            Reduction::Planes(planes) => {
                let count = self.frequencies.len();
                let mut values = [C::zero(simd); REDUCTION_PLANES / 2];
                for (pair, value) in values.iter_mut().enumerate() {
                    let mut lanes = [Complex64::ZERO; MAX_LANES];
                    for (lane, line) in lines.clone().enumerate() {
                        let at = 2 * pair * count + line;
                        lanes[lane] = Complex64::new(planes[at], planes[at + count]);
                    }
                    *value = C::load(simd, &lanes[..lines.len()]);
                }
                of_planes(&values, &small::inverse(&self.reference.stiffness(simd, iw)))
            }
        };
        (functions, iw)
    }
}

/// By series in (w / reference)^2.
#[inline(always)]
fn of_series<S: Simd>(simd: S, rows: &[f64], iw: C<S>) -> OnLines<S> {
    let count = rows.len() / SERIES_ROWS;
    let scale = 1.0 / (rows[0] * rows[0]);
    let x = simd.mul_f64s(simd.mul_f64s(iw.im, iw.im), simd.splat_f64s(scale));
    let mut out = [[C::zero(simd); FUNCTIONS]; 2];
    for side in 0..2 {
        for function in 0..FUNCTIONS {
            let first = (1 + 2 * (FUNCTIONS * side + function)) * count;
            let mut sum = C::zero(simd);
            for power in (first..first + count).rev() {
                sum = sum.mul_add_real(x, C::splat(simd, Complex64::new(rows[power], rows[power + count])));
            }
            out[side][function] = sum;
        }
    }
    out
}

/// From H_0, F_r (2), F_e (2), Y (3) and the compliance G at which they hold.
#[inline(always)]
fn of_planes<S: Simd>(values: &[C<S>; REDUCTION_PLANES / 2], g: &Mat<S, 2>) -> OnLines<S> {
    let [h, l1, l2, r1, r2, y11, y12, y22] = *values;
    let (g11, g12, g22) = (g[0][0], g[0][1], g[1][1]);
    let det_y = y12.neg_mul_add(y12, y11 * y22);
    let det_g = g12.neg_mul_add(g12, g11 * g22);
    let through = l1 * (y22 * r1 - y12 * r2) + l2 * (y11 * r2 - y12 * r1);
    let (both, single) = (l1 * r2 + l2 * r1, [l1 * r1, l2 * r2]);
    let one = C::real(h.simd, 1.0);
    // By det K, k22 = c11 det K, k11 = c22 det K, k12 = -c12 det K and 1 = det C det K.
    let d = [
        one - y11 * g11 - (y12 * g12).scale(2.0) - y22 * g22 + det_y * det_g,
        y11 - det_y * g22,
        y22 - det_y * g11,
        (y12 + det_y * g12).scale(-2.0),
        det_y,
    ];
    let n = [
        h * d[0] - single[0] * g11 - both * g12 - single[1] * g22 + det_g * through,
        h * d[1] + single[0] - g22 * through,
        h * d[2] + single[1] - g11 * through,
        h * d[3] - both - (g12 * through).scale(2.0),
        h * d[4] + through,
    ];
    [n, d]
}

/// A column for a block of lines, without the factor of the joint.
#[inline(always)]
pub fn column<S: Simd>(column: usize, functions: &[C<S>; FUNCTIONS], iw: C<S>) -> C<S> {
    let (function, by) = OF_COLUMN[column];
    let value = functions[function];
    match by {
        By::One => value,
        By::I => value.times_i(),
        By::Iw => value * iw,
        By::IIw => (value * iw).times_i(),
        By::IwIw => value * iw * iw,
    }
}

/// The columns that a table of joints needs: those whose factor is not zero for all of them.
pub fn used(joints: &[f64]) -> Vec<usize> {
    let any = |effect: fn(&Term) -> bool| {
        joints.chunks_exact(SPRING_COLUMNS).any(|row| {
            let mut columns = row.iter().zip(SPRING);
            columns.any(|(value, (_, term))| effect(term) && *value != 0.0)
        })
    };
    let damped = any(|term| matches!(term, Term::Dashpot(_)));
    let couples = any(|term| matches!(term, Term::Stiffness(2) | Term::Dashpot(2)));
    let lossy = any(|term| matches!(term, Term::Loss(_)));
    let needed = |(function, by): (usize, By)| {
        (function != 3 || couples)
            && match by {
                By::One => true,
                By::I => lossy,
                By::Iw | By::IwIw => damped,
                By::IIw => damped && lossy,
            }
    };
    (0..COLUMNS).filter(|&column| needed(OF_COLUMN[column])).collect()
}
