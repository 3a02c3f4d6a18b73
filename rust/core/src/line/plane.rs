//! A part of the assembly as seen from one node: a plane of admissible (u, f).
//!
//! A linear structure seen from a node with D degrees of freedom allows displacements u and loads f that
//! span a D-dimensional plane in the 2D-dimensional space of (u, f). An impedance f = Z u is one chart of
//! that plane and a receptance u = H f another; both have poles, where all digits are lost. Here each
//! degree of freedom takes u or f as its independent variable, whichever is larger on that line, so that
//! no chart is ever near a pole (compare the pivoted Lagrangian bases of Mehrmann and Poloni, SIAM J.
//! Matrix Anal. Appl. 33, 2012, 780). Carrying the plane from the far end is a Riccati sweep in which
//! short and light segments change small numbers by small numbers and lose nothing.

use crate::simd::lane::{C, R};
use crate::simd::small::{self, Mat};
use pulp::Simd;

/// A plane of admissible (u, f): dependent = x independent.
#[derive(Copy, Clone)]
pub struct Plane<S: Simd, const D: usize> {
    /// Dependent variables over independent ones.
    pub x: Mat<S, D>,
    /// Lanes where f is independent (and u dependent), by degree of freedom.
    pub swapped: [S::m64s; D],
}

/// An addition to one degree of freedom.
#[derive(Copy, Clone)]
pub enum Added<S: Simd> {
    /// A load z u more.
    Impedance(C<S>),
    /// A displacement c f more.
    Compliance(C<S>),
}

impl<S: Simd, const D: usize> Plane<S, D> {
    /// The plane of nothing at all: f = 0 for every u.
    #[inline(always)]
    pub fn free(simd: S) -> Self {
        let never = R::splat(simd, 0.0).greater(R::splat(simd, 1.0));
        Self { x: small::zeros(simd), swapped: [never; D] }
    }

    /// The plane of a receptance: u = H f for every f.
    #[inline(always)]
    pub fn loads(simd: S, receptance: Mat<S, D>) -> Self {
        let always = R::splat(simd, 1.0).greater(R::splat(simd, 0.0));
        Self { x: receptance, swapped: [always; D] }
    }

    /// The plane of given minors (u0 u1, u0 f0, u0 f1, f0 u1, f0 f1) in its best chart.
    #[inline(always)]
    pub fn from_minors(minors: [C<S>; 5], weights: &[f64; D]) -> Self {
        let [uu, both, uf, fu, ff] = minors;
        let simd = uu.simd;
        let minus = -both;
        // The denominator, a minor, and the numerators in the order x00, x01, x10, x11.
        let charts = [
            (uu, [fu, both, both, uf], [false, false]),
            (fu, [uu, minus, both, ff], [true, false]),
            (uf, [ff, both, minus, uu], [false, true]),
            (ff, [uf, minus, minus, fu], [true, true]),
        ];
        let mut size = R::splat(simd, -1.0);
        let mut below = uu;
        let mut above = charts[0].1;
        let mut swapped = [simd.splat_false(); D];
        for (bottom, top, which) in charts {
            let mut weight = 1.0;
            for i in 0..D {
                if !which[i] {
                    weight *= weights[i];
                }
            }
            let now = bottom.norm_sqr() * R::splat(simd, weight * weight);
            let better = now.greater(size);
            size = size.max(now);
            below = C::select(better, bottom, below);
            for k in 0..4 {
                above[k] = C::select(better, top[k], above[k]);
            }
            for i in 0..D {
                let mask = if which[i] { simd.splat_true() } else { simd.splat_false() };
                swapped[i] = select_mask(simd, better, mask, swapped[i]);
            }
        }
        let inverse = below.recip();
        let mut out = Self { x: small::zeros(simd), swapped };
        for i in 0..D {
            for j in 0..D {
                out.x[i][j] = above[2 * i + j] * inverse;
            }
        }
        out
    }

    /// Columns that span the plane, as (u rows, f rows); the coordinates are the independent variables.
    #[inline(always)]
    pub fn basis(&self) -> (Mat<S, D>, Mat<S, D>) {
        let one = small::identity(self.x[0][0].simd);
        let (mut u, mut f) = (one, one);
        for i in 0..D {
            for j in 0..D {
                u[i][j] = C::select(self.swapped[i], self.x[i][j], one[i][j]);
                f[i][j] = C::select(self.swapped[i], one[i][j], self.x[i][j]);
            }
        }
        (u, f)
    }

    /// (u, f) at given independent variables.
    #[inline(always)]
    pub fn state(&self, independent: &[C<S>; D]) -> ([C<S>; D], [C<S>; D]) {
        let dependent = small::apply(&self.x, independent);
        let (mut u, mut f) = (dependent, dependent);
        for i in 0..D {
            u[i] = C::select(self.swapped[i], dependent[i], independent[i]);
            f[i] = C::select(self.swapped[i], independent[i], dependent[i]);
        }
        (u, f)
    }

    /// The independent and the dependent ones of the rows (u, f).
    #[inline(always)]
    pub fn split(&self, u: &Mat<S, D>, f: &Mat<S, D>) -> (Mat<S, D>, Mat<S, D>) {
        let (mut independent, mut dependent) = (*u, *f);
        for i in 0..D {
            for j in 0..D {
                independent[i][j] = C::select(self.swapped[i], f[i][j], u[i][j]);
                dependent[i][j] = C::select(self.swapped[i], u[i][j], f[i][j]);
            }
        }
        (independent, dependent)
    }

    /// Adds an impedance `z` (f + z u) or a compliance `c` (u + c f) to one degree of freedom, and takes
    /// the better chart of that degree; returns the way back as in `pivot`.
    ///
    /// Entry by entry, so that couplings far smaller than the addition keep all their digits.
    #[inline(always)]
    pub fn add(&self, i: usize, added: Added<S>, weight: f64) -> (Self, Mat<S, D>) {
        let simd = self.x[0][0].simd;
        let one = C::real(simd, 1.0);
        let swapped = self.swapped[i];
        let pivot = self.x[i][i];
        // u_i = a ind_i + sum p_k ind_k and f_i = b ind_i + sum r_k ind_k after the addition.
        let (mut a, mut b) = (C::select(swapped, pivot, one), C::select(swapped, one, pivot));
        let (mut p, mut r) = (self.x[i], self.x[i]);
        let zero = C::zero(simd);
        for k in 0..D {
            p[k] = C::select(swapped, self.x[i][k], zero);
            r[k] = C::select(swapped, zero, self.x[i][k]);
        }
        match added {
            Added::Impedance(z) => {
                b = z.mul_add(a, b);
                for k in 0..D {
                    r[k] = z.mul_add(p[k], r[k]);
                }
            }
            Added::Compliance(c) => {
                a = c.mul_add(b, a);
                for k in 0..D {
                    p[k] = c.mul_add(r[k], p[k]);
                }
            }
        }
        let after = b.norm_sqr().greater(a.norm_sqr() * R::splat(simd, weight * weight));
        self.exchange(i, [a, b], [&p, &r], after)
    }

    /// The chart with f_i independent where `after` holds, else u_i.
    #[inline(always)]
    fn exchange(
        &self,
        i: usize,
        [a, b]: [C<S>; 2],
        [p, r]: [&[C<S>; D]; 2],
        after: S::m64s,
    ) -> (Self, Mat<S, D>) {
        let simd = a.simd;
        let mut out = *self;
        let mut back = small::identity(simd);
        out.swapped[i] = after;
        let inverse = C::select(after, b, a).recip();
        // (p b - a r) / x_ik is +1 or -1 exactly; with it nothing has to be subtracted.
        let sign = C::select(self.swapped[i], C::real(simd, 1.0), C::real(simd, -1.0));
        let sign = C::select(after, sign, -sign);
        out.x[i][i] = C::select(after, a, b) * inverse;
        back[i][i] = inverse;
        for k in 0..D {
            if k == i {
                continue;
            }
            let carried = C::select(after, r[k], p[k]) * inverse;
            out.x[i][k] = sign * self.x[i][k] * inverse;
            back[i][k] = -carried;
            for j in 0..D {
                if j != i {
                    out.x[j][k] = self.x[j][i].neg_mul_add(carried, self.x[j][k]);
                }
            }
        }
        for j in 0..D {
            if j != i {
                out.x[j][i] = self.x[j][i] * inverse;
            }
        }
        (out, back)
    }

    /// The independent variables under a unit load, from the receptance.
    #[inline(always)]
    pub fn loaded(&self, receptance: &Mat<S, D>, direction: usize) -> [C<S>; D] {
        let simd = receptance[0][0].simd;
        let mut out = receptance[0];
        for i in 0..D {
            let load = C::real(simd, if i == direction { 1.0 } else { 0.0 });
            out[i] = C::select(self.swapped[i], load, receptance[i][direction]);
        }
        out
    }

    /// The receptance u = H f.
    #[inline(always)]
    pub fn receptance(&self) -> Mat<S, D> {
        self.in_chart([self.x[0][0].simd.splat_true(); D]).0.x
    }

    /// The same plane in the chart that suits other weights, with the way back.
    #[inline(always)]
    pub fn weighted(&self, weights: &[f64; D]) -> (Self, Mat<S, D>) {
        let (u, f) = self.basis();
        self.in_chart(choose(&u, &f, weights).0)
    }

    /// The plane after a coupling impedance z was added: z theta more force and z y more moment.
    #[inline(always)]
    pub fn coupled(&self, z: C<S>, weights: &[f64; D]) -> (Self, Mat<S, D>) {
        let (u, mut f) = self.basis();
        for j in 0..D {
            f[0][j] = z.mul_add(u[D - 1][j], f[0][j]);
            f[D - 1][j] = z.mul_add(u[0][j], f[D - 1][j]);
        }
        Self::pivot(&u, &f, weights)
    }

    /// The same plane in another chart, with the way back.
    ///
    /// Entry by entry like `add`; where both degrees change, at once, because one at a time might divide by
    /// a small pivot.
    #[inline(always)]
    fn in_chart(&self, target: [S::m64s; D]) -> (Self, Mat<S, D>) {
        let simd = self.x[0][0].simd;
        let one = C::real(simd, 1.0);
        let zero = C::zero(simd);
        let mut out = Self { x: self.x, swapped: target };
        let mut back = small::identity(simd);
        let whole = small::inverse(&self.x);
        let mut changed = target;
        for i in 0..D {
            let (now, then) = (self.swapped[i], target[i]);
            let lost = simd.and_m64s(now, simd.not_m64s(then));
            changed[i] = simd.or_m64s(lost, simd.and_m64s(then, simd.not_m64s(now)));
        }
        for i in 0..D {
            let swapped = self.swapped[i];
            let pivot = self.x[i][i];
            let ab = [C::select(swapped, pivot, one), C::select(swapped, one, pivot)];
            let (mut p, mut r) = ([zero; D], [zero; D]);
            for k in 0..D {
                p[k] = C::select(swapped, self.x[i][k], zero);
                r[k] = C::select(swapped, zero, self.x[i][k]);
            }
            let (single, step) = self.exchange(i, ab, [&p, &r], simd.not_m64s(swapped));
            let other = changed[D - 1 - i];
            let only = if D == 1 { changed[0] } else { simd.and_m64s(changed[i], simd.not_m64s(other)) };
            let both = if D == 1 { simd.splat_false() } else { simd.and_m64s(changed[i], other) };
            for row in 0..D {
                for column in 0..D {
                    let entry = C::select(only, single.x[row][column], out.x[row][column]);
                    out.x[row][column] = C::select(both, whole[row][column], entry);
                    let entry = C::select(only, step[row][column], back[row][column]);
                    back[row][column] = C::select(both, whole[row][column], entry);
                }
            }
        }
        (out, back)
    }

    /// The best chart of the plane spanned by the columns of (u, f), and the matrix that gives the
    /// columns' coordinates from the chart's independent variables.
    ///
    /// `weights` are impedances that make u comparable with f; they only steer the choice.
    #[inline(always)]
    pub fn pivot(u: &Mat<S, D>, f: &Mat<S, D>, weights: &[f64; D]) -> (Self, Mat<S, D>) {
        let (swapped, determinant) = choose(u, f, weights);
        let mut best = Self { x: *u, swapped };
        let (independent, dependent) = best.split(u, f);
        let inverse = small::scale(&small::adjugate(&independent), determinant.recip());
        best.x = small::mul(&dependent, &inverse);
        if D == 2 {
            best.reconcile(&dependent, &inverse);
        }
        (best, inverse)
    }

    /// The two couplings of a reciprocal structure are equal (opposite where only one degree of freedom has
    /// f independent); the one that is the smaller difference of products has the digits.
    #[inline(always)]
    fn reconcile(&mut self, dependent: &Mat<S, D>, inverse: &Mat<S, D>) {
        let simd = self.x[0][0].simd;
        let last = D - 1;
        let mut sizes = [R::splat(simd, 0.0); 2];
        for (row, size) in sizes.iter_mut().enumerate() {
            for k in 0..D {
                let product = dependent[row * last][k] * inverse[k][last - row * last];
                *size = size.max(product.norm_sqr());
            }
        }
        let one = C::real(simd, 1.0);
        let mut sign = one;
        for i in 0..D {
            sign = C::select(self.swapped[i], -sign, sign);
        }
        let upper = sizes[1].greater(sizes[0]);
        let (first, second) = (self.x[0][last], self.x[last][0]);
        self.x[0][last] = C::select(upper, first, sign * second);
        self.x[last][0] = C::select(upper, sign * first, second);
    }
}

/// Which degrees of freedom to take f as independent of: the largest minor of (u, f), and that minor.
#[inline(always)]
fn choose<S: Simd, const D: usize>(u: &Mat<S, D>, f: &Mat<S, D>, weights: &[f64; D]) -> ([S::m64s; D], C<S>) {
    let simd = u[0][0].simd;
    let mut swapped = [simd.splat_false(); D];
    let mut determinant = small::det(u);
    let weight: f64 = weights.iter().product();
    let mut size = determinant.norm_sqr() * R::splat(simd, weight * weight);
    for choice in 1..(1usize << D) {
        let mut rows = *u;
        let mut weight = 1.0;
        for i in 0..D {
            if choice >> i & 1 == 1 {
                rows[i] = f[i];
            } else {
                weight *= weights[i];
            }
        }
        let other = small::det(&rows);
        let other_size = other.norm_sqr() * R::splat(simd, weight * weight);
        let better = other_size.greater(size);
        size = size.max(other_size);
        determinant = C::select(better, other, determinant);
        for i in 0..D {
            let now = if choice >> i & 1 == 1 { simd.splat_true() } else { simd.splat_false() };
            swapped[i] = select_mask(simd, better, now, swapped[i]);
        }
    }
    (swapped, determinant)
}

/// Masks that hold or fail in every lane, which pulp does not offer by name.
trait SplatMask: Simd {
    #[inline(always)]
    fn splat_true(self) -> Self::m64s {
        self.greater_than_f64s(self.splat_f64s(1.0), self.splat_f64s(0.0))
    }
    #[inline(always)]
    fn splat_false(self) -> Self::m64s {
        self.greater_than_f64s(self.splat_f64s(0.0), self.splat_f64s(1.0))
    }
}
impl<S: Simd> SplatMask for S {}

/// `yes` where the mask holds, else `no`, for masks.
#[inline(always)]
fn select_mask<S: Simd>(simd: S, mask: S::m64s, yes: S::m64s, no: S::m64s) -> S::m64s {
    simd.or_m64s(simd.and_m64s(mask, yes), simd.and_m64s(simd.not_m64s(mask), no))
}
