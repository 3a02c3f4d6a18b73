//! The two passes over lines and joints: sums over the lines, and values line by line.
//!
//! N and D are products of the columns of the lines and the factors of the joints, a few joints side by side on a vector
//! of lines; what is made of them follows at once.

use crate::elementary::ln_norm_sqr;
use crate::joint_hoist::{Hoisted, PARTS, TILE};
use crate::lane::{C, MAX_LANES};
use pulp::{Simd, WithSimd};

/// Joints that are taken side by side: what is loaded of the lines serves all of them, and while one waits for its last
/// step the others go on. Four are 15 % faster than two with the 32 registers of AVX-512, 4 % slower with sixteen.
pub const SIDE: usize = 4;

/// The factors of some joints: by groups of `SIDE` joints, then columns, then the joints of a group.
pub struct Factors {
    /// The factors.
    pub values: Vec<f64>,
    /// Joints that are none.
    pub invalid: Vec<bool>,
}

/// N and D of joints side by side on a vector of lines.
#[inline(always)]
fn sums<S: Simd>(simd: S, lines: &[S::f64s], joints: &[f64]) -> [[S::f64s; PARTS]; SIDE] {
    let mut out = [[simd.splat_f64s(0.0); PARTS]; SIDE];
    for (lines, joints) in lines.chunks_exact(PARTS).zip(joints.chunks_exact(SIDE)) {
        for joint in 0..SIDE {
            let factor = simd.splat_f64s(joints[joint]);
            for part in 0..PARTS {
                out[joint][part] = simd.mul_add_e_f64s(factor, lines[part], out[joint][part]);
            }
        }
    }
    out
}

/// The misfits of a group of joints.
pub struct Sums<'a, const LOGARITHM: bool> {
    /// What the lines have.
    pub hoisted: &'a Hoisted,
    /// What the joints have.
    pub joints: &'a Factors,
    /// The output.
    pub out: &'a mut [f64],
}

impl<const LOGARITHM: bool> WithSimd for Sums<'_, LOGARITHM> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { hoisted, joints, out } = self;
        let (a_vector, a_group) = (hoisted.columns * PARTS, hoisted.columns * SIDE);
        let mut totals = vec![[simd.splat_f64s(0.0); SIDE]; joints.values.len() / a_group];
        for (lines, weights) in hoisted.tiles::<S>() {
            for (group, total) in joints.values.chunks_exact(a_group).zip(&mut totals) {
                for (lines, &weight) in lines.chunks_exact(a_vector).zip(weights) {
                    let found = sums(simd, lines, group);
                    // D over N: both are sums of products, what was measured is in D already.
                    let quotients = found.map(|[n_re, n_im, d_re, d_im]| {
                        [C { simd, re: d_re, im: d_im }, C { simd, re: n_re, im: n_im }]
                    });
                    let squares = if LOGARITHM {
                        ln_norm_sqr(simd, quotients)
                    } else {
                        quotients.map(|[d, n]| simd.div_f64s(n.norm_sqr().v, d.norm_sqr().v))
                    };
                    for joint in 0..SIDE {
                        total[joint] = simd.mul_add_e_f64s(squares[joint], weight, total[joint]);
                    }
                }
            }
        }
        let totals = totals.as_flattened();
        for ((out, &total), &invalid) in out.iter_mut().zip(totals).zip(&joints.invalid) {
            let total = simd.reduce_sum_f64s(total);
            *out = if invalid || !total.is_finite() { f64::NAN } else { total };
        }
    }
}

/// The receptances of a group of joints, line by line, or their moduli.
pub struct EachLine<'a, const MAGNITUDE: bool> {
    /// What the lines have.
    pub hoisted: &'a Hoisted,
    /// What the joints have.
    pub joints: &'a Factors,
    /// The output.
    pub out: &'a mut [f64],
}

impl<const MAGNITUDE: bool> WithSimd for EachLine<'_, MAGNITUDE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { hoisted, joints, out } = self;
        let a_line = if MAGNITUDE { 1 } else { 2 };
        let (a_vector, a_group) = (hoisted.columns * PARTS, hoisted.columns * SIDE);
        // A value that is not finite makes this one not a number.
        let mut zeros = vec![simd.splat_f64s(0.0); joints.values.len() / hoisted.columns];
        let zero = simd.splat_f64s(0.0);
        for (tile, (lines, _)) in hoisted.tiles::<S>().enumerate() {
            let start = tile * TILE * S::F64_LANES;
            for (group, factors) in joints.values.chunks_exact(a_group).enumerate() {
                for (vector, lines) in lines.chunks_exact(a_vector).enumerate() {
                    let found = sums(simd, lines, factors);
                    let first = start + vector * S::F64_LANES;
                    let range = a_line * first..a_line * hoisted.lines.min(first + S::F64_LANES);
                    for joint in (0..SIDE).take(joints.invalid.len() - group * SIDE) {
                        let row = group * SIDE + joint;
                        let into = &mut out[a_line * hoisted.lines * row..][range.clone()];
                        let value = if MAGNITUDE {
                            modulus(simd, found[joint], into)
                        } else {
                            quotient(simd, found[joint], into)
                        };
                        zeros[row] = simd.mul_add_e_f64s(value, zero, zeros[row]);
                    }
                }
            }
        }
        for (row, (zero, &invalid)) in zeros.into_iter().zip(&joints.invalid).enumerate() {
            if invalid || simd.reduce_sum_f64s(zero) != 0.0 {
                out[a_line * hoisted.lines * row..][..a_line * hoisted.lines].fill(f64::NAN);
            }
        }
    }
}

/// Writes N / D of some lines; something finite where that is.
#[inline(always)]
fn quotient<S: Simd>(simd: S, [n_re, n_im, d_re, d_im]: [S::f64s; PARTS], out: &mut [f64]) -> S::f64s {
    let h = C { simd, re: n_re, im: n_im } * C { simd, re: d_re, im: d_im }.recip();
    let woven = simd.interleave_shfl_f64s([h.re, h.im]);
    if out.len() == 2 * S::F64_LANES {
        S::as_mut_simd_f64s(out).0.copy_from_slice(&woven);
    } else {
        let mut room = [0.0; 2 * MAX_LANES];
        S::as_mut_simd_f64s(&mut room).0[..2].copy_from_slice(&woven);
        out.copy_from_slice(&room[..out.len()]);
    }
    simd.add_f64s(h.re, h.im)
}

/// Writes |N / D| of some lines; something finite where that is.
#[inline(always)]
fn modulus<S: Simd>(simd: S, [n_re, n_im, d_re, d_im]: [S::f64s; PARTS], out: &mut [f64]) -> S::f64s {
    let (n, d) = (C { simd, re: n_re, im: n_im }, C { simd, re: d_re, im: d_im });
    let square = simd.div_f64s(n.norm_sqr().v, d.norm_sqr().v);
    let value = simd.sqrt_f64s(square);
    simd.partial_store_f64s(out, value);
    value
}
