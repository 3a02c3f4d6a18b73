//! Two beams side by side with a layer between them: the exponential of the eight equations, and integrals of states.
//!
//! The state is (d, u, g, s): the motion d of the near beam (which ends here and continues at the other end) relative
//! to the beam behind, the motion u of the beam behind, the load g on the near beam and the load s on both. A stiff
//! layer then multiplies only the relative motion, and the small loads on both keep their digits. In the opposite
//! direction the beams are exchanged, and slopes and moments change their signs.
//!
//! Derivatives of deflections and moments contain slopes and forces only, and conversely: over the two halves of the
//! state the equations are z' = [[0, P], [Q, 0]] z, so that with X = P Q
//!     exp(A l) = [[cosh(sqrt X l), S P], [Q S, cosh(sqrt(Q P) l)]],  S = sinh(sqrt X l) / sqrt X,
//! power series in 4 x 4 matrices. The second cosine is the transposed first one, and each of the odd parts is its own
//! transpose up to signs, since the equations are reciprocal.
//!
//! Derivatives by the coefficients follow from the states under two loads: as for a segment, dH = -int r^T J dA s dx.
//! From the middle of a piece the products of states are integrated by the Gauss-Legendre rule. Its points are in pairs
//! at which the even part of a state is the same and the odd part opposite, so one exponential is sufficient for both.

use crate::line::exponential::{INVERSE_FACTORIAL, first_serving, served};
use crate::line::four::{Rows, multiply};
use crate::model::overlap::{Beside, REACH};
use crate::simd::lane::{C, R};
use crate::simd::small;
use num_complex::Complex64;
use pulp::Simd;

/// A state (d_y, d_theta, y, theta, g_F, g_M, s_F, s_M).
pub type Eight<S> = [C<S>; 8];
/// A 2 x 2 matrix.
pub type Two<S> = [[C<S>; 2]; 2];

/// Places in the state of (d_y, y, g_M, s_M), and of (d_theta, theta, g_F, s_F).
const HALVES: [[usize; 4]; 2] = [[0, 2, 5, 7], [1, 3, 4, 6]];

/// The half of each entry of the state and its place there.
const PLACES: [(usize, usize); 8] = [(0, 0), (1, 0), (0, 1), (1, 1), (1, 2), (0, 2), (1, 3), (0, 3)];

/// Coefficients of the equations, the near beam first.
#[derive(Copy, Clone)]
pub struct Pair<S: Simd> {
    /// Compliances per length.
    compliance: Two<S>,
    /// w^2 times the inertias per length.
    inertia: Two<S>,
    /// Stiffness of the layer per length; none where points join the beams.
    layer: [C<S>; 2],
    /// Stiffness of the whole layer or of all points together.
    pub total: [C<S>; 2],
}

/// Matrices of the exponentials over any length, with Y = X / growth^2.
///
/// Every power of Y is a sum of I, Y, Y^2, Y^3 with coefficients from its characteristic polynomial, so that each
/// series in l is one of four numbers.
pub struct Powers<S: Simd> {
    /// I, Y, Y^2, Y^3.
    powers: [Rows<S, 4>; 4],
    /// The same times P.
    by_p: [Rows<S, 4>; 4],
    /// Q times the same.
    by_q: [Rows<S, 4>; 4],
    /// Coefficients of Y^4, Y^5, ... by I, Y, Y^2, Y^3.
    reduced: [[C<S>; 4]; MOST_TERMS - 4],
}

/// The way over some length, by halves of the state.
#[derive(Copy, Clone)]
pub struct Transfer<S: Simd> {
    /// Each half by itself.
    even: [Rows<S, 4>; 2],
    /// Each half by the other one: odd in the length.
    odd: [Rows<S, 4>; 2],
}

impl<S: Simd> Pair<S> {
    /// The coefficients at the lines.
    #[inline(always)]
    pub fn new(beside: &Beside, w: C<S>, forward: bool) -> Self {
        let simd = w.simd;
        let (w2, iw) = (w * w, w.times_i());
        let overlap = &beside.overlap;
        let zero = C::zero(simd);
        let mut out =
            Self { compliance: [[zero; 2]; 2], inertia: [[zero; 2]; 2], layer: [zero; 2], total: [zero; 2] };
        for i in 0..2 {
            for beam in 0..2 {
                let row = &beside.beams[if forward { beam } else { 1 - beam }].per_length;
                out.compliance[beam][i] = C::splat(simd, row.compliance[i]);
                out.inertia[beam][i] = w2.scale(row.kinetic[i]);
            }
            let k = Complex64::new(overlap.k[i], overlap.k[i] * overlap.loss_factor);
            out.total[i] = C::splat(simd, k) + iw.scale(overlap.c[i]);
            if overlap.points == 0 {
                out.layer[i] = out.total[i].scale(1.0 / overlap.length());
            }
        }
        out
    }

    /// Matrices of the exponentials at a growth exponent per length, for transfers up to a growth exponent.
    #[inline(always)]
    pub fn powers(&self, growth: f64, size: f64) -> Powers<S> {
        let simd = self.total[0].simd;
        let ([near, behind], [near_inertia, behind_inertia]) = (self.compliance, self.inertia);
        let zero = [[C::zero(simd); 4]; 4];
        let identity = small::identity(simd);
        let mut powers = [identity; 4];
        let (mut by_p, mut by_q) = ([zero; 4], [zero; 4]);
        // By the two forces or moments, and by the two displacements.
        let (mut by_load, mut by_motion) = ([[[zero[0][0]; 2]; 2]; 2], [[[zero[0][0]; 2]; 2]; 2]);
        for i in 0..2 {
            by_load[i] = [[near[i] + behind[i], -behind[i]], [-behind[i], behind[i]]];
            let m = -near_inertia[i];
            by_motion[i] = [[self.layer[i] + m, m], [m, m - behind_inertia[i]]];
        }
        // P = [[-I, shear], [turn, I]] and Q = [[0, bend], [shift, 0]] in blocks.
        let ([shear, bend], [shift, turn]) = (by_load, by_motion);
        let scale = 1.0 / (growth * growth);
        let x = &mut powers[1];
        for i in 0..2 {
            for j in 0..2 {
                x[i][j] = shear[i][1].mul_add(shift[1][j], shear[i][0] * shift[0][j]).scale(scale);
                x[i][2 + j] = -bend[i][j].scale(scale);
                x[2 + i][j] = shift[i][j].scale(scale);
                x[2 + i][2 + j] = turn[i][1].mul_add(bend[1][j], turn[i][0] * bend[0][j]).scale(scale);
            }
        }
        for n in 2..4 {
            powers[n] = powers[n - 1];
            let by = powers[1];
            multiply(&mut powers[n], &by);
        }
        for n in 0..4 {
            let power = &powers[n];
            for i in 0..4 {
                for j in 0..2 {
                    let turned = power[i][2].mul_add(turn[0][j], power[i][3] * turn[1][j]);
                    by_p[n][i][j] = turned - power[i][j];
                    let sheared = power[i][0].mul_add(shear[0][j], power[i][1] * shear[1][j]);
                    by_p[n][i][2 + j] = sheared + power[i][2 + j];
                    by_q[n][j][i] = bend[j][0].mul_add(power[2][i], bend[j][1] * power[3][i]);
                    by_q[n][2 + j][i] = shift[j][0].mul_add(power[0][i], shift[j][1] * power[1][i]);
                }
            }
        }
        let reduced = reduced(&powers, terms(size));
        Powers { powers, by_p, by_q, reduced }
    }

    /// The largest term of -r^T J A s, squared, and its value: the derivative by the length, the layer being held.
    #[inline(always)]
    pub fn density(&self, r: &Eight<S>, s: &Eight<S>) -> (R<S>, C<S>) {
        let simd = r[0].simd;
        let (a, b) = (quantities(r), quantities(s));
        let mut sum = C::zero(simd);
        let mut largest = R::splat(simd, 0.0);
        for beam in 0..2 {
            // theta V of internal forces, which are minus the loads.
            let (theta, force) = (2 * beam + 1, 4 + 2 * beam);
            let mut terms = [sum; 6];
            for i in 0..2 {
                let k = 2 * beam + i;
                terms[i] = self.inertia[beam][i] * (a[k] * b[k]);
                terms[2 + i] = self.compliance[beam][i] * (a[4 + k] * b[4 + k]);
            }
            terms[4] = -(a[theta] * b[force]);
            terms[5] = -(a[force] * b[theta]);
            for term in terms {
                sum = sum + term;
                largest = largest.max(term.norm_sqr());
            }
        }
        for i in 0..2 {
            let term = -(self.layer[i] * (a[8 + i] * b[8 + i]));
            sum = sum + term;
            largest = largest.max(term.norm_sqr());
        }
        (largest, sum)
    }
}

/// Most terms of the series; the largest growth of a piece needs fewer.
const MOST_TERMS: usize = 16;

/// Largest squared growth exponent for which each number of terms leaves out less than a tenth of a rounding error.
///
/// The eigenvalues of Y being at most one, its n-th power has C(n, 3) Y^3 at most, and the other powers of Y, which begin
/// earlier in the series, less beside their own first terms (numbers of monomials in Schur functions of hooks). Entries
/// that are coupled through several equations begin with Y^3.
const SERVED: [f64; MOST_TERMS] = {
    let mut table = [0.0; MOST_TERMS];
    let mut n = 4;
    while n < MOST_TERMS {
        // The first term that is left out beside that of Y^3.
        let choices = (n * (n - 1) * (n - 2) / 6) as f64;
        let coefficient = choices * INVERSE_FACTORIAL[2 * n] / INVERSE_FACTORIAL[6];
        table[n] = served(coefficient, n - 3, 1e-17, 2.0 * REACH * REACH);
        n += 1;
    }
    table
};

/// Terms in X l^2 at a growth exponent, at least four.
fn terms(size: f64) -> usize {
    first_serving(&SERVED, 4, size * size)
}

/// Coefficients of the powers of Y from the fourth on, by I, Y, Y^2, Y^3.
#[inline(always)]
fn reduced<S: Simd>(powers: &[Rows<S, 4>; 4], terms: usize) -> [[C<S>; 4]; MOST_TERMS - 4] {
    let zero = C::zero(powers[0][0][0].simd);
    // Sums of the powers of the eigenvalues, and from them the coefficients of the polynomial (Newton's identities).
    let mut traces = [zero; 4];
    for i in 0..4 {
        for n in 0..3 {
            traces[n] = traces[n] + powers[1 + n][i][i];
        }
        for j in 0..4 {
            traces[3] = powers[2][i][j].mul_add(powers[2][j][i], traces[3]);
        }
    }
    let [t1, t2, t3, t4] = traces;
    let e1 = t1;
    let e2 = (e1 * t1 - t2).scale(0.5);
    let e3 = (e2 * t1 - e1 * t2 + t3).scale(1.0 / 3.0);
    let e4 = (e3 * t1 - e2 * t2 + e1 * t3 - t4).scale(0.25);
    let fourth = [-e4, e3, -e2, e1];
    let mut out = [fourth; MOST_TERMS - 4];
    for n in 1..terms.saturating_sub(4) {
        let before = out[n - 1];
        out[n][0] = before[3] * fourth[0];
        for j in 1..4 {
            out[n][j] = before[3].mul_add(fourth[j], before[j - 1]);
        }
    }
    out
}

impl<S: Simd> Powers<S> {
    /// The exponential over a length at a growth exponent.
    #[inline(always)]
    pub fn transfer(&self, length: f64, size: f64, out: &mut Transfer<S>) {
        let terms = terms(size);
        let (even, odd) = (self.series(terms, size, 0, 1.0), self.series(terms, size, 1, length));
        let Transfer { even: [cosine, transposed], odd: [by_p, by_q] } = out;
        for i in 0..4 {
            for j in 0..4 {
                let mut sum = even[1] * self.powers[1][i][j];
                for n in 2..4 {
                    sum = even[n].mul_add(self.powers[n][i][j], sum);
                }
                cosine[i][j] = if i == j { sum + even[0] } else { sum };
                // The partner by reciprocity.
                let (a, b) = ((j + 2) % 4, (i + 2) % 4);
                let alike = (i < 2) == (j < 2);
                transposed[a][b] = if alike { cosine[i][j] } else { -cosine[i][j] };
                if (i, j) > (a, b) {
                    continue;
                }
                for (to, from) in [(&mut *by_p, &self.by_p), (&mut *by_q, &self.by_q)] {
                    let mut sum = odd[0] * from[0][i][j];
                    for n in 1..4 {
                        sum = odd[n].mul_add(from[n][i][j], sum);
                    }
                    to[i][j] = sum;
                    if (i, j) != (a, b) {
                        to[a][b] = if alike { -sum } else { sum };
                    }
                }
            }
        }
    }

    /// The coefficients of I, Y, Y^2, Y^3 in `factor` times sum_n Y^n size^(2 n) / (2 n + odd)!.
    #[inline(always)]
    fn series(&self, terms: usize, size: f64, odd: usize, factor: f64) -> [C<S>; 4] {
        let simd = self.powers[0][0][0].simd;
        let (mut factors, mut power) = ([0.0; MOST_TERMS], factor);
        for n in 0..terms {
            factors[n] = power * INVERSE_FACTORIAL[2 * n + odd];
            power *= size * size;
        }
        let mut out = [C::zero(simd); 4];
        for n in (4..terms).rev() {
            let factor = simd.splat_f64s(factors[n]);
            for j in 0..4 {
                out[j] = self.reduced[n - 4][j].mul_add_real(factor, out[j]);
            }
        }
        for j in 0..4 {
            out[j] = out[j] + C::real(simd, factors[j]);
        }
        out
    }
}

impl<S: Simd> Transfer<S> {
    /// A transfer that is not computed yet.
    #[inline(always)]
    pub fn empty(simd: S) -> Self {
        let zero = [[C::zero(simd); 4]; 4];
        Self { even: [zero; 2], odd: [zero; 2] }
    }

    /// Entry of the exponential: place `i` of a half by the entry `by` of the state.
    #[inline(always)]
    fn entry(&self, half: usize, i: usize, by: usize) -> C<S> {
        let (of, j) = PLACES[by];
        if of == half { self.even[half][i][j] } else { self.odd[half][i][j] }
    }

    /// Displacements by loads.
    #[inline(always)]
    pub fn compliance(&self) -> Rows<S, 4> {
        let mut out = self.even[0];
        for i in 0..4 {
            let (half, place) = PLACES[i];
            for j in 0..4 {
                out[i][j] = self.entry(half, place, 4 + j);
            }
        }
        out
    }

    /// The basis at the near end of a piece, from that at its far end, of which some rows are those of the identity.
    #[inline(always)]
    pub fn across<const N: usize>(
        &self,
        basis: &Rows<S, N>,
        identity: &[Option<usize>; 4],
        near: &mut Rows<S, N>,
    ) {
        let zero = C::zero(basis[0][0].simd);
        let mut dense = [true; 8];
        for row in identity.iter().flatten() {
            dense[*row] = false;
        }
        for half in 0..2 {
            for i in 0..4 {
                let mut sum = [zero; 4];
                for column in 0..4 {
                    if let Some(row) = identity[column] {
                        sum[column] = self.entry(half, i, row);
                    }
                }
                for (matrix, of) in [(&self.even, half), (&self.odd, 1 - half)] {
                    for j in 0..4 {
                        let row = HALVES[of][j];
                        if dense[row] {
                            for column in 0..4 {
                                sum[column] = matrix[half][i][j].mul_add(basis[row][column], sum[column]);
                            }
                        }
                    }
                }
                near[HALVES[half][i]] = sum;
            }
        }
        near[8..].copy_from_slice(&basis[8..]);
    }

    /// The even and the odd part of a state over the length, in the requested rows.
    #[inline(always)]
    fn parts(&self, z: &Eight<S>, rows: &[bool; 8]) -> [Eight<S>; 2] {
        let zero = C::zero(z[0].simd);
        let mut out = [[zero; 8]; 2];
        for half in 0..2 {
            for i in 0..4 {
                let row = HALVES[half][i];
                if rows[row] {
                    for (part, matrix, of) in [(0, &self.even, half), (1, &self.odd, 1 - half)] {
                        let mut sum = matrix[half][i][0] * z[HALVES[of][0]];
                        for k in 1..4 {
                            sum = matrix[half][i][k].mul_add(z[HALVES[of][k]], sum);
                        }
                        out[part][row] = sum;
                    }
                }
            }
        }
        out
    }

    /// A state carried over the length towards smaller x (`forward`) or larger x.
    #[inline(always)]
    pub fn carry(&self, z: &Eight<S>, forward: bool) -> Eight<S> {
        let [mut out, odd] = self.parts(z, &[true; 8]);
        for i in 0..8 {
            out[i] = if forward { out[i] + odd[i] } else { out[i] - odd[i] };
        }
        out
    }
}

/// Products of the states of two loads: y_a, theta_a, y_b, theta_b; V_a, M_a, V_b, M_b; d_y, d_theta.
pub const PRODUCTS: usize = 10;
/// Derivatives of H by the inertias of both beams (4), their compliances (4), the total stiffnesses of the layer (2),
/// the length, and the slope of the points' shares.
pub const DERIVATIVES: usize = PRODUCTS + 2;
/// Where the layer's two begin.
pub const LAYER: usize = 8;
/// Where the length is.
pub const LENGTH: usize = 10;
/// Where the slope is.
pub const SLOPE: usize = 11;

/// Growth exponents of a piece up to which rules of 4, 6, 8, 10 points leave out less than a rounding error, and their
/// points beyond the middle (from 0 to 1, half the length) with their weights.
const RULES: [(f64, &[[f64; 2]]); 4] = [
    (
        0.08,
        &[
            [0.339_981_043_584_856_3, 0.652_145_154_862_546_1],
            [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
        ],
    ),
    (
        0.5,
        &[
            [0.238_619_186_083_196_9, 0.467_913_934_572_691_04],
            [0.661_209_386_466_264_5, 0.360_761_573_048_138_6],
            [0.932_469_514_203_152, 0.171_324_492_379_170_36],
        ],
    ),
    (
        1.4,
        &[
            [0.183_434_642_495_649_8, 0.362_683_783_378_361_96],
            [0.525_532_409_916_329, 0.313_706_645_877_887_27],
            [0.796_666_477_413_626_7, 0.222_381_034_453_374_48],
            [0.960_289_856_497_536_3, 0.101_228_536_290_376_26],
        ],
    ),
    (
        f64::INFINITY,
        &[
            [0.148_874_338_981_631_22, 0.295_524_224_714_752_87],
            [0.433_395_394_129_247_2, 0.269_266_719_309_996_35],
            [0.679_409_568_299_024_4, 0.219_086_362_515_982_04],
            [0.865_063_366_688_984_5, 0.149_451_349_150_580_6],
            [0.973_906_528_517_171_7, 0.066_671_344_308_688_14],
        ],
    ),
];

/// A rule for pieces of one length.
pub struct Rule<S: Simd> {
    /// From the middle to each pair of points, and their weight in m.
    points: Vec<(Transfer<S>, f64)>,
}

impl<S: Simd> Rule<S> {
    /// A rule that is not computed yet.
    pub fn empty() -> Self {
        Self { points: Vec::new() }
    }

    /// Computes the rule for pieces of a length and a growth exponent.
    #[inline(always)]
    pub fn fill(&mut self, powers: &Powers<S>, length: f64, size: f64) {
        let rule = RULES.iter().find(|(most, _)| size <= *most).map_or(&[][..], |(_, rule)| *rule);
        let simd = powers.powers[0][0][0].simd;
        self.points.resize_with(rule.len(), || (Transfer::empty(simd), 0.0));
        for ((transfer, to), [place, weight]) in self.points.iter_mut().zip(rule) {
            // Both points of a pair, of half the length each.
            powers.transfer(0.5 * place * length, 0.5 * place * size, transfer);
            *to = weight * length;
        }
    }

    /// Adds the integrals of the requested products over a piece, from the states in its middle.
    #[inline(always)]
    pub fn integrate(
        &self,
        left: &Eight<S>,
        right: Option<&Eight<S>>,
        requested: &[bool; PRODUCTS],
        sums: &mut [C<S>; PRODUCTS],
    ) {
        let rows = entries(requested);
        for (transfer, weight) in &self.points {
            let a = transfer.parts(left, &rows);
            let b = match right {
                Some(right) => transfer.parts(right, &rows),
                None => a,
            };
            for part in 0..2 {
                let (a, b) = (quantities(&a[part]), quantities(&b[part]));
                for i in 0..PRODUCTS {
                    if requested[i] {
                        sums[i] = a[i].scale(*weight).mul_add(b[i], sums[i]);
                    }
                }
            }
        }
    }
}

/// The entries of the states that some products need.
fn entries(requested: &[bool; PRODUCTS]) -> [bool; 8] {
    let [y_a, theta_a, y_b, theta_b, v_a, m_a, v_b, m_b, d_y, d_theta] = *requested;
    [y_a || d_y, theta_a || d_theta, y_a || y_b, theta_a || theta_b, v_a || v_b, m_a || m_b, v_b, m_b]
}

/// A state of the opposite direction in the coordinates of the direction from the tip.
#[inline(always)]
pub fn mirrored<S: Simd>(z: &Eight<S>) -> Eight<S> {
    [-z[0], z[1], z[2] + z[0], -(z[3] + z[1]), z[4] - z[6], z[7] - z[5], -z[6], z[7]]
}

/// The ten quantities of a state in the work.
#[inline(always)]
fn quantities<S: Simd>(z: &Eight<S>) -> [C<S>; PRODUCTS] {
    [z[0] + z[2], z[1] + z[3], z[2], z[3], z[4], z[5], z[6] - z[4], z[7] - z[5], z[0], z[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Scalar;

    /// Coefficients of a size like those of tools, in other units.
    fn pair() -> Pair<Scalar> {
        let number = |re: f64, im: f64| C::splat(Scalar::new(), Complex64::new(re, im));
        Pair {
            compliance: [
                [number(0.03, -0.001), number(0.9, -0.02)],
                [number(0.01, 0.0), number(0.2, -0.003)],
            ],
            inertia: [[number(1.1, 0.1), number(0.02, 0.0)], [number(2.3, 0.2), number(0.1, 0.01)]],
            layer: [number(3.0, 0.4), number(0.7, 0.1)],
            total: [number(3.0, 0.4), number(0.7, 0.1)],
        }
    }

    /// A state times the matrix A of the equations of the theory.
    fn along(pair: &Pair<Scalar>, z: &Eight<Scalar>) -> Eight<Scalar> {
        let [near, behind] = pair.compliance;
        let [m, n] = pair.inertia;
        let rest = [z[6] - z[4], z[7] - z[5]];
        let loads = [m[0] * (z[0] + z[2]), m[1] * (z[1] + z[3])];
        [
            near[0] * z[4] - behind[0] * rest[0] - z[1],
            near[1] * z[5] - behind[1] * rest[1],
            behind[0] * rest[0] - z[3],
            behind[1] * rest[1],
            pair.layer[0] * z[0] - loads[0],
            pair.layer[1] * z[1] - loads[1] + z[4],
            -(n[0] * z[2] + loads[0]),
            z[6] - n[1] * z[3] - loads[1],
        ]
    }

    #[test]
    fn exponential_of_the_equations() {
        for share in [0.01, 0.1, 0.5, 1.0] {
            exponential_over(0.8 * share, 1.9 * share);
        }
    }

    fn exponential_over(length: f64, size: f64) {
        let pair = pair();
        let mut transfer = Transfer::empty(Scalar::new());
        pair.powers(size / length, size).transfer(length, size, &mut transfer);
        for column in 0..8 {
            let mut term = [C::zero(Scalar::new()); 8];
            term[column] = C::real(Scalar::new(), 1.0);
            let mut sum = term;
            for order in 1..40 {
                term = along(&pair, &term).map(|entry| entry.scale(length / f64::from(order)));
                for i in 0..8 {
                    sum[i] = sum[i] + term[i];
                }
            }
            for i in 0..8 {
                let (half, place) = PLACES[i];
                let off = transfer.entry(half, place, column) - sum[i];
                let size = sum[i].norm_sqr().v.sqrt();
                assert!(off.norm_sqr().v.sqrt() < 1e-14 * size, "{i}, {column}: {length}");
            }
        }
    }

    #[test]
    fn rules_serve_up_to_their_growth() {
        for (most, rule) in RULES {
            let size = if most.is_finite() { most } else { crate::model::overlap::REACH };
            // The product of two states that grow by the exponent each.
            let exact = size.sinh() / size;
            let sum: f64 = rule.iter().map(|[place, weight]| weight * (place * size).cosh()).sum();
            assert!((sum - exact).abs() < 2e-15 * exact, "{most}: {sum} and {exact}");
        }
    }
}
