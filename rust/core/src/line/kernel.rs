//! One segment over a block of frequency lines.
//!
//! The state is (u, f): displacements and the load that holds them, seen from the near end with the rest of
//! the structure behind the far end. Short segments are taken by their transfer matrix from a power series,
//! in a few equal pieces where they are longer than the series reaches; long ones by their waves
//! e^{-lambda x} and e^{-lambda (L - x)} with Re(lambda) >= 0, which neither overflow nor cancel. Close to the
//! cut-off one pair of waves degenerates; there the pieces serve, however many they are. A cone is passed in slices, whose
//! transfer matrices are polynomials in w^2.

use crate::line::exponential::{self, SumsWithDerivatives};
use crate::model::cone::Cone;
use crate::model::section::Segment;
use crate::simd::lane::{C, MAX_LANES};
use crate::simd::small::{self, Mat};
use num_complex::Complex64;
use pulp::Simd;

/// Pieces up to which the series is preferred to the waves, whose roots and exponentials cost more.
const FEW_PIECES: usize = 4;

/// Waves are used where |lambda_1| is at least this share of |lambda_2|: below it the pair is degenerate.
const LEAST_RATIO: f64 = 1e-3;

/// Waves are used where every |lambda L| is at least this: shorter segments lose digits in them.
const LEAST_PHASE: f64 = 1.5;

/// (u, f)_near = [[uu, uf], [fu, ff]] (u, f)_far, near being the end of smaller x.
#[derive(Copy, Clone)]
pub struct Transfer<S: Simd, const D: usize> {
    /// Displacement by displacement.
    pub uu: Mat<S, D>,
    /// Displacement by load.
    pub uf: Mat<S, D>,
    /// Load by displacement.
    pub fu: Mat<S, D>,
    /// Load by load.
    pub ff: Mat<S, D>,
}

/// Waves that run from x = 0 into the segment; those that run back mirror them.
#[derive(Copy, Clone)]
pub struct Wave<S: Simd, const D: usize> {
    /// Wave numbers, Re(lambda) >= 0.
    pub lambda: [C<S>; D],
    /// Displacements of each wave (columns).
    pub u: Mat<S, D>,
    /// Loads of each wave (columns), load meaning minus the internal force.
    pub f: Mat<S, D>,
    /// e^{-lambda L}.
    pub decay: [C<S>; D],
}

/// How a block of lines passes a segment.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Way {
    /// Equal pieces, each by the transfer matrix.
    Pieces {
        /// Number of pieces.
        count: usize,
        /// Terms of the series.
        terms: usize,
    },
    /// One step by waves.
    Waves,
    /// The slices of a cone, each by its own transfer matrix.
    Slices {
        /// Level of the division.
        level: usize,
    },
    /// Not computed: the segment lies in a branch that is taken as a whole.
    Skipped,
}

/// A segment on a block of lines.
// Not one enumeration: matrices in variants begin at different places, and the compiler then moves their vectors in
// parts that straddle each other. These moves took a third of the time of a sweep.
pub struct Kernel<S: Simd, const D: usize> {
    /// How the segment is passed.
    pub way: Way,
    /// Transfer matrix of a piece, if it is passed in pieces.
    pub transfer: Transfer<S, D>,
    /// The sums of its series and their derivatives, if it bends in pieces and is differentiated.
    pub sums: SumsWithDerivatives<S>,
    /// Its waves, if it is passed by waves.
    pub wave: Wave<S, D>,
    /// The matrices of the state over each slice of a cone, in the direction of x.
    pub slices: Vec<[Mat<S, D>; 4]>,
}

impl<S: Simd, const D: usize> Kernel<S, D> {
    /// A kernel to be evaluated.
    #[inline(always)]
    pub fn skipped(simd: S) -> Self {
        let (vector, matrix) = ([C::zero(simd); D], small::zeros(simd));
        Self {
            way: Way::Skipped,
            transfer: Transfer { uu: matrix, uf: matrix, fu: matrix, ff: matrix },
            sums: ([C::zero(simd); 4], [C::zero(simd); 6]),
            wave: Wave { lambda: vector, u: matrix, f: matrix, decay: vector },
            slices: Vec::new(),
        }
    }

    /// Evaluates the slices of a cone in a division of some level at the lines `w2`, of which the largest is `most`.
    #[inline(always)]
    pub fn evaluate_cone(&mut self, cone: &Cone<D>, level: usize, w2: C<S>, most: f64, real: bool) {
        let division = cone.division(level);
        self.way = Way::Slices { level };
        self.slices.clear();
        let (terms, z) = (division.terms(most), w2.scale(1.0 / division.square));
        for slice in &division.slices {
            self.slices.push(polynomial(&slice[..terms], z, real));
        }
    }

    /// Number of steps in which the segment is passed.
    #[inline(always)]
    pub fn steps(&self) -> usize {
        match self.way {
            Way::Pieces { count, .. } => count,
            Way::Slices { .. } => self.slices.len(),
            Way::Waves | Way::Skipped => 1,
        }
    }
}

/// sum_n terms[n] z^n; the z of `real` lines are real.
#[inline(always)]
pub fn polynomial<S: Simd, const D: usize, const B: usize>(
    terms: &[[[[Complex64; D]; D]; B]],
    z: C<S>,
    real: bool,
) -> [Mat<S, D>; B] {
    let mut out = [small::zeros(z.simd); B];
    // Row by row: all entries at once would not fit into the registers.
    for i in 0..D {
        for term in terms.iter().rev() {
            for block in 0..B {
                for j in 0..D {
                    let coefficient = C::splat(z.simd, term[block][i][j]);
                    let sum = out[block][i][j];
                    out[block][i][j] =
                        if real { sum.mul_add_real(z.re, coefficient) } else { sum.mul_add(z, coefficient) };
                }
            }
        }
    }
    out
}

impl<const D: usize> Segment<D> {
    /// Exact wave numbers (lambda_1 the one that vanishes at the cut-off) of one line, and the curvature
    /// lambda^2 + alpha mu that each wave has for a unit displacement.
    fn roots(&self, w: Complex64) -> ([Complex64; D], [Complex64; D]) {
        let mut out = [Complex64::ZERO; D];
        let mut curvature = out;
        let w2 = w * w;
        let a = self.per_length.compliance[0] * self.per_length.kinetic[0] * w2;
        if D == 1 {
            out[0] = (-a).sqrt();
            return (out, curvature);
        }
        let b = self.per_length.compliance[1] * self.per_length.kinetic[1] * w2;
        let bending = self.per_length.compliance[1] * self.per_length.kinetic[0] * w2;
        let half = 0.5 * (a - b);
        let root = (half * half + bending).sqrt();
        let q = root + 0.5 * (a + b);
        // p q = bending - a b, factored so that p keeps its digits up to the cut-off.
        let shear = self.per_length.compliance[0] * self.per_length.kinetic[1] * w2;
        let p = bending * (1.0 - shear) / q;
        out[0] = p.sqrt();
        out[1] = (-q).sqrt();
        // The two curvatures are half +- root and their product is -bending: far above the cut-off one of them
        // is a small difference, which the other gives without subtracting.
        let (sum, difference) = (half + root, half - root);
        let mut found = [sum, -bending / sum];
        if sum.norm_sqr() < difference.norm_sqr() {
            found = [-bending / difference, difference];
        }
        curvature[0] = found[0];
        curvature[1] = found[1];
        (out, curvature)
    }

    /// The way for all of the lines `w`, on which the squares of the wave numbers are at most `square`; `pieces_only`
    /// keeps to the series.
    fn way(&self, w: &[Complex64], square: f64, pieces_only: bool) -> Way {
        let square = square * self.length * self.length;
        let count = ((square.sqrt() / exponential::REACH).ceil() as usize).max(1);
        if !pieces_only && count > FEW_PIECES && self.waves_serve(w) {
            return Way::Waves;
        }
        Way::Pieces { count, terms: exponential::terms(square / (count * count) as f64) }
    }

    /// Whether the waves are well separated and long enough on every line.
    fn waves_serve(&self, w: &[Complex64]) -> bool {
        w.iter().all(|&w| {
            let roots = self.roots(w).0.map(|root| root.norm());
            let (least, most) = (roots[0].min(roots[D - 1]), roots[0].max(roots[D - 1]));
            least >= LEAST_RATIO * most && least * self.length >= LEAST_PHASE
        })
    }

    /// Evaluates the kernel for the lines `w` as in `way`, with data for derivatives if it is `differentiated`.
    #[inline(always)]
    pub fn evaluate<S: Simd>(
        &self,
        w: &[Complex64],
        w2: C<S>,
        square: f64,
        pieces_only: bool,
        differentiated: bool,
        into: &mut Kernel<S, D>,
    ) {
        into.way = self.way(w, square, pieces_only);
        match into.way {
            Way::Pieces { count, terms } => {
                let l = self.length / count as f64;
                let z = self.symmetric_sums(w2.simd, l, w2);
                if D == 1 {
                    into.transfer = self.transfer_of_rod(l, terms, w2, z[0]);
                    return;
                }
                into.transfer = if differentiated {
                    into.sums = exponential::sums_with_derivatives(z[0], z[1], terms);
                    self.transfer(l, w2, z[1], &into.sums.0)
                } else {
                    self.transfer(l, w2, z[1], &exponential::sums(z[0], z[1], terms))
                };
            }
            Way::Waves => into.wave = self.waves(w2.simd, w, w2),
            Way::Slices { .. } | Way::Skipped => {}
        }
    }

    /// Compliances and inertias w^2 m per length.
    // Loops, not array maps: a closure is a function of its own, compiled without the instruction set.
    #[inline(always)]
    pub fn coefficients<S: Simd>(&self, simd: S, w2: C<S>) -> ([C<S>; D], [C<S>; D]) {
        let mut compliance = [w2; D];
        let mut inertia = [w2; D];
        for i in 0..D {
            compliance[i] = C::splat(simd, self.per_length.compliance[i]);
            inertia[i] = w2.scale(self.per_length.kinetic[i]);
        }
        (compliance, inertia)
    }

    /// The symmetric sums z1, z2 of the squared roots times the length l.
    #[inline(always)]
    pub fn symmetric_sums<S: Simd>(&self, simd: S, l: f64, w2: C<S>) -> [C<S>; 2] {
        let (m, c) = (self.per_length.kinetic, self.per_length.compliance);
        if D == 1 {
            return [w2 * C::splat(simd, -c[0] * m[0] * l * l), C::zero(simd)];
        }
        let z1 = w2 * C::splat(simd, -(c[0] * m[0] + c[D - 1] * m[D - 1]) * (l * l));
        let bending = c[D - 1] * m[0] * l.powi(4);
        let inner = C::splat(simd, c[0] * m[D - 1]).mul_add(w2, C::real(simd, -1.0));
        [z1, w2 * C::splat(simd, bending) * inner]
    }

    /// Transfer matrix of a piece of a rod of length l.
    #[inline(always)]
    fn transfer_of_rod<S: Simd>(&self, l: f64, terms: usize, w2: C<S>, z: C<S>) -> Transfer<S, D> {
        let zero = small::zeros(w2.simd);
        let mut out = Transfer { uu: zero, uf: zero, fu: zero, ff: zero };
        let (compliance, inertia) = self.coefficients(w2.simd, w2);
        let [c, s] = exponential::rod(z, terms);
        out.uu[0][0] = c[0];
        out.uf[0][0] = compliance[0] * s[0].scale(l);
        out.fu[0][0] = -(inertia[0] * s[0].scale(l));
        out.ff[0][0] = c[0];
        out
    }

    /// Transfer matrix of a piece of a beam of length l from the sums e_2 to e_5.
    #[inline(always)]
    fn transfer<S: Simd>(&self, l: f64, w2: C<S>, z2: C<S>, e: &[C<S>; 4]) -> Transfer<S, D> {
        let simd = w2.simd;
        let zero = small::zeros(simd);
        let mut out = Transfer { uu: zero, uf: zero, fu: zero, ff: zero };
        let (compliance, inertia) = self.coefficients(simd, w2);
        let one = C::real(simd, 1.0);
        let c0 = z2.neg_mul_add(e[2], one);
        let c1 = z2.neg_mul_add(e[3], one).scale(l);
        let c2 = e[0].scale(l * l);
        let c3 = e[1].scale(l * l * l);
        let (alpha, beta) = (compliance[0], compliance[D - 1]);
        let (mu, nu) = (inertia[0], inertia[D - 1]);
        let (a, b) = (alpha * mu, beta * nu);
        let diagonal = [a.neg_mul_add(c2, c0), b.neg_mul_add(c2, c0)];
        let slope = (a + b).neg_mul_add(c3, c1);
        let (mu_c2, beta_c2) = (mu * c2, beta * c2);
        let beta_mu_c3 = beta * (mu * c3);
        out.uu = small::leading(&[[diagonal[0], -slope], [-beta_mu_c3, diagonal[1]]]);
        out.ff = small::leading(&[[diagonal[0], beta_mu_c3], [slope, diagonal[1]]]);
        let short = a.neg_mul_add(c3, c1);
        let shear = beta.neg_mul_add(c3, alpha * short);
        let bend = beta * b.neg_mul_add(c3, c1);
        out.uf = small::leading(&[[shear, -beta_c2], [beta_c2, bend]]);
        let rotary = nu.neg_mul_add(c1, nu.mul_add(b, mu) * c3);
        out.fu = small::leading(&[[-(mu * short), mu_c2], [-mu_c2, rotary]]);
        out
    }

    /// The waves of a block of lines; roots and exponentials are taken line by line.
    #[inline(always)]
    fn waves<S: Simd>(&self, simd: S, w: &[Complex64], w2: C<S>) -> Wave<S, D> {
        let mut roots = [[Complex64::ZERO; MAX_LANES]; D];
        let mut decays = roots;
        let mut curvatures = roots;
        for lane in 0..S::F64_LANES {
            let line = w[lane.min(w.len() - 1)];
            let (values, bent) = self.roots(line);
            for j in 0..D {
                roots[j][lane] = values[j];
                curvatures[j][lane] = bent[j];
                decays[j][lane] = (-values[j] * self.length).exp();
            }
        }
        let zero = small::zeros(simd);
        let mut out = Wave { lambda: [C::zero(simd); D], u: zero, f: zero, decay: [C::zero(simd); D] };
        let (compliance, _) = self.coefficients(simd, w2);
        for j in 0..D {
            let lambda = C::load(simd, &roots[j][..S::F64_LANES]);
            out.lambda[j] = lambda;
            out.decay[j] = C::load(simd, &decays[j][..S::F64_LANES]);
            out.u[0][j] = C::real(simd, 1.0);
            if D == 1 {
                out.f[0][j] = lambda * compliance[0].recip();
                continue;
            }
            let mu = w2.scale(self.per_length.kinetic[0]);
            let inverse = lambda.recip();
            let curvature = C::load(simd, &curvatures[j][..S::F64_LANES]);
            out.u[1][j] = -(curvature * inverse);
            out.f[0][j] = -(mu * inverse);
            out.f[1][j] = -(curvature * compliance[1].recip());
        }
        out
    }
}

/// Sign of a displacement under x -> -x; its load has the same, its internal force the opposite one.
#[inline(always)]
pub fn parity(i: usize) -> f64 {
    if i == 0 { 1.0 } else { -1.0 }
}

/// A matrix between vectors of equal parity, as seen along x (`forward`) or against it.
#[inline(always)]
pub fn oriented<S: Simd, const D: usize>(matrix: &Mat<S, D>, forward: bool) -> Mat<S, D> {
    let mut out = *matrix;
    if !forward {
        for i in 0..D {
            for j in 0..D {
                if i != j {
                    out[i][j] = -out[i][j];
                }
            }
        }
    }
    out
}

impl<S: Simd, const D: usize> Wave<S, D> {
    /// (u, f) rows of the waves that run away from the near end and of those that run towards it, as
    /// seen along x (`forward`) or against it.
    #[inline(always)]
    pub fn oriented(&self, forward: bool) -> [(Mat<S, D>, Mat<S, D>); 2] {
        let (mut u, mut f) = (self.u, self.f);
        if !forward {
            for i in 0..D {
                for j in 0..D {
                    u[i][j] = u[i][j].scale(parity(i));
                    f[i][j] = f[i][j].scale(parity(i));
                }
            }
        }
        let (mut back_u, mut back_f) = (u, f);
        for i in 0..D {
            for j in 0..D {
                back_u[i][j] = u[i][j].scale(parity(i));
                back_f[i][j] = f[i][j].scale(-parity(i));
            }
        }
        [(u, f), (back_u, back_f)]
    }
}
