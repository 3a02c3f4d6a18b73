//! Derivatives of the receptance by the coefficients of an overlap, from its states under two loads.
//!
//! As for a segment, dH = -int r^T J dA s dx; the states within a piece are the power series of the eight equations,
//! and their products are integrated by Gauss and Legendre's rule, which leaves out less than a rounding error over
//! the growth that a piece may have.

use crate::layer::{Eight, Pair, terms};
use crate::overlap::{Beside, Pieces};
use num_complex::Complex64;

const ZERO: Complex64 = Complex64::ZERO;

/// Products of the states of two loads: y_a, theta_a, y_b, theta_b; V_a, M_a, V_b, M_b; d_y, d_theta.
pub const PRODUCTS: usize = 10;
/// Derivatives of H by the inertias of both beams (4), their compliances (4), the total stiffnesses of the layer (2),
/// and the length.
pub const DERIVATIVES: usize = PRODUCTS + 1;
/// Where the layer's two begin.
pub const LAYER: usize = 8;
/// Where the length is.
pub const LENGTH: usize = 10;

/// Points (from 0 to 1) and weights of the rule of eight points.
const GAUSS: [[f64; 2]; 8] = [
    [0.019_855_071_751_231_884, 0.050_614_268_145_188_13],
    [0.101_666_761_293_186_63, 0.111_190_517_226_687_24],
    [0.237_233_795_041_835_5, 0.156_853_322_938_943_64],
    [0.408_282_678_752_175_1, 0.181_341_891_689_181],
    [0.591_717_321_247_825, 0.181_341_891_689_181],
    [0.762_766_204_958_164_5, 0.156_853_322_938_943_64],
    [0.898_333_238_706_813_4, 0.111_190_517_226_687_24],
    [0.980_144_928_248_768_1, 0.050_614_268_145_188_13],
];

/// A state of a way from the other side in the coordinates of that from the tip.
pub fn mirrored(z: &Eight) -> Eight {
    [-z[0], z[1], z[2] + z[0], -(z[3] + z[1]), z[4] - z[6], z[7] - z[5], -z[6], z[7]]
}

/// The ten quantities of a state that the work is made of.
#[inline(always)]
fn quantities(z: &Eight) -> [Complex64; PRODUCTS] {
    [z[0] + z[2], z[1] + z[3], z[2], z[3], z[4], z[5], z[6] - z[4], z[7] - z[5], z[0], z[1]]
}

/// States at the points of the rule within a piece, from that at its end of larger x.
fn within(pair: &Pair, pieces: &Pieces, start: &Eight) -> [Eight; 8] {
    let mut out = [*start; 8];
    let mut powers = [1.0; 8];
    let mut term = *start;
    for order in 1..=terms(pieces.size) {
        term = pair.along(&term, pieces.length / order as f64);
        for (point, rule) in GAUSS.iter().enumerate() {
            powers[point] *= rule[0];
            for i in 0..8 {
                out[point][i] += term[i] * powers[point];
            }
        }
    }
    out
}

/// Derivatives of H on one line from the states at the pieces' ends of larger x, in the order of falling x.
pub fn derivatives(
    beside: &Beside,
    pieces: &Pieces,
    w: Complex64,
    left: &[Eight],
    right: &[Eight],
) -> [Complex64; DERIVATIVES] {
    let pair = Pair::new(beside, w, true);
    let mut sums = [ZERO; PRODUCTS];
    let same = core::ptr::eq(left, right);
    for (r, s) in left.iter().zip(right) {
        let moved = within(&pair, pieces, s);
        let seen = if same { moved } else { within(&pair, pieces, r) };
        for ((r, s), rule) in seen.iter().zip(&moved).zip(&GAUSS) {
            let (r, s) = (quantities(r), quantities(s));
            for i in 0..PRODUCTS {
                sums[i] += r[i] * s[i] * (rule[1] * pieces.length);
            }
        }
    }
    let mut out = [ZERO; DERIVATIVES];
    let (length, points) = (beside.overlap.length(), beside.overlap.points);
    for i in 0..4 {
        out[i] = sums[i] * (w * w);
        out[4 + i] = sums[4 + i];
    }
    for i in 0..2 {
        out[LAYER + i] = -sums[LAYER + i] / length;
    }
    if points > 0 {
        let (mut passed, mut at_points) = (0, [ZERO; 2]);
        for (r, s) in left.iter().zip(right) {
            // The point that was passed before this piece moves as the piece's end does.
            if pieces.point_after(passed) {
                for i in 0..2 {
                    at_points[i] -= r[i] * s[i] / points as f64;
                }
            }
            passed += 1;
        }
        out[LAYER] = at_points[0];
        out[LAYER + 1] = at_points[1];
    }
    out[LENGTH] = by_length(&pair, pieces, length, left, right);
    if points == 0 {
        // The totals are held: a longer layer is softer per length.
        let total = beside.overlap.stiffness(w);
        for i in 0..2 {
            out[LENGTH] -= total[i] / length * out[LAYER + i];
        }
    }
    out
}

/// The derivative by the length, the stiffness per length of the layer being held.
///
/// Its density is constant between two points; it is taken where its terms are smallest and cancel least.
fn by_length(pair: &Pair, pieces: &Pieces, length: f64, left: &[Eight], right: &[Eight]) -> Complex64 {
    let mut sum = ZERO;
    let mut best = (f64::INFINITY, ZERO);
    let mut stretch = 0;
    for (passed, (r, s)) in left.iter().zip(right).enumerate() {
        if pieces.point_after(passed) {
            sum += best.1 * (stretch as f64 * pieces.length / length);
            best.0 = f64::INFINITY;
            stretch = 0;
        }
        let now = density(pair, r, s);
        if now.0 < best.0 {
            best = now;
        }
        stretch += 1;
    }
    sum + best.1 * (stretch as f64 * pieces.length / length)
}

/// The largest term of -r^T J A s and its value.
fn density(pair: &Pair, r: &Eight, s: &Eight) -> (f64, Complex64) {
    let (a, b) = (quantities(r), quantities(s));
    let mut terms = [ZERO; 14];
    for beam in 0..2 {
        for i in 0..2 {
            let k = 2 * beam + i;
            terms[k] = pair.inertia[beam][i] * a[k] * b[k];
            terms[4 + k] = pair.compliance[beam][i] * a[4 + k] * b[4 + k];
        }
        // theta V of internal forces, which are minus the loads.
        let (theta, force) = (2 * beam + 1, 4 + 2 * beam);
        terms[10 + 2 * beam] = -a[theta] * b[force];
        terms[11 + 2 * beam] = -a[force] * b[theta];
    }
    for i in 0..2 {
        terms[8 + i] = -pair.layer[i] * a[8 + i] * b[8 + i];
    }
    let largest = terms.iter().fold(0.0_f64, |most, term| most.max(term.norm_sqr()));
    (largest, terms.iter().sum())
}
