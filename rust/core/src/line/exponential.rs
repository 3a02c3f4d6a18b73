//! Power series of the segment's matrix exponential for short segments, and their derivatives.
//!
//! With the four roots +-l1, +-l2 of the beam equation only the symmetric sums s = l1^2 + l2^2 and
//! p = l1^2 l2^2 enter: exp(A L) = c0 + c1 A + c2 A^2 + c3 A^3, where with z1 = s L^2, z2 = p L^4
//!     e_k = sum_n h_n / (2n + k)!,   h_0 = 1, h_1 = z1, h_(n+1) = z1 h_n - z2 h_(n-1),
//!     c0 = 1 - z2 e_4,  c1 = L (1 - z2 e_5),  c2 = L^2 e_2,  c3 = L^3 e_3.
//! No root is taken, so equal roots and a root at zero (the cut-off) are ordinary points. The sums obey
//! e_k = 1/k! + z1 e_(k+2) - z2 e_(k+4), which is evaluated downwards like Horner's rule.

use crate::simd::lane::C;
use pulp::Simd;

/// Largest |lambda L| that the series serves in one step: beyond it growth costs digits.
pub const REACH: f64 = 3.0;

/// Most terms that REACH needs.
const MOST_TERMS: usize = 18;

/// 1/k! for all k that occur.
pub(super) const INVERSE_FACTORIAL: [f64; 2 * MOST_TERMS + 8] = {
    let mut table = [1.0; 2 * MOST_TERMS + 8];
    let mut k = 1;
    while k < table.len() {
        table[k] = table[k - 1] / k as f64;
        k += 1;
    }
    table
};

/// Largest |lambda L|^2 for which each number of terms leaves out less than a rounding error.
const SERVED: [f64; MOST_TERMS] = {
    let mut table = [0.0; MOST_TERMS];
    let mut n = 1;
    while n < MOST_TERMS {
        table[n] = served((n + 1) as f64 * INVERSE_FACTORIAL[2 * n + 2], n, 2e-17, 2.0 * REACH * REACH);
        n += 1;
    }
    table
};

/// The largest x up to `most` with `coefficient` x^`power` below `limit`, by bisection.
pub(super) const fn served(coefficient: f64, power: usize, limit: f64, most: f64) -> f64 {
    let (mut low, mut high) = (0.0, most);
    let mut round = 0;
    while round < 60 {
        let middle = 0.5 * (low + high);
        let mut size = coefficient;
        let mut k = 0;
        while k < power {
            size *= middle;
            k += 1;
        }
        if size < limit {
            low = middle;
        } else {
            high = middle;
        }
        round += 1;
    }
    low
}

/// The first number of terms, from `least` on, whose entry of a table is not below `square`; the length of the table if
/// there is none.
pub(super) fn first_serving(table: &[f64], least: usize, square: f64) -> usize {
    (least..table.len()).find(|&n| table[n] >= square).unwrap_or(table.len())
}

/// Terms that leave out less than a rounding error where |lambda L|^2 <= `square`.
pub fn terms(square: f64) -> usize {
    first_serving(&SERVED, 1, square)
}

/// The sums e_2 to e_5 for `terms` terms.
#[inline(always)]
pub fn sums<S: Simd>(z1: C<S>, z2: C<S>, terms: usize) -> [C<S>; 4] {
    let simd = z1.simd;
    let top = 2 * terms + 2;
    // Two chains, even and odd k; (e_(k+4), e_(k+2)) of each.
    let mut even = [C::real(simd, INVERSE_FACTORIAL[top + 2]), C::real(simd, INVERSE_FACTORIAL[top])];
    let mut odd = [C::real(simd, INVERSE_FACTORIAL[top + 3]), C::real(simd, INVERSE_FACTORIAL[top + 1])];
    let mut k = top;
    while k > 2 {
        k -= 2;
        let start = C::real(simd, INVERSE_FACTORIAL[k]);
        even = [even[1], z2.neg_mul_add(even[0], z1.mul_add(even[1], start))];
        let start = C::real(simd, INVERSE_FACTORIAL[k + 1]);
        odd = [odd[1], z2.neg_mul_add(odd[0], z1.mul_add(odd[1], start))];
    }
    [even[1], odd[1], even[0], odd[0]]
}

/// The sums e_2 to e_5, and the derivatives of e_2 to e_7 by z1.
pub type SumsWithDerivatives<S> = ([C<S>; 4], [C<S>; 6]);

/// The sums e_2 to e_5, and the derivatives of e_2 to e_7 by z1.
///
/// Those by z2 are among them: with H(t) = 1 / (1 - z1 t + z2 t^2), which generates h_n, dH/dz1 = t H^2 and
/// dH/dz2 = -t^2 H^2, so that de_k/dz2 = -de_(k+2)/dz1.
#[inline(always)]
pub fn sums_with_derivatives<S: Simd>(z1: C<S>, z2: C<S>, terms: usize) -> SumsWithDerivatives<S> {
    let simd = z1.simd;
    let top = 2 * (terms + 1) + 2;
    let mut sums = [C::zero(simd); 4];
    let mut slopes = [C::zero(simd); 6];
    for k in 0..4 {
        sums[k] = C::real(simd, INVERSE_FACTORIAL[top + k]);
    }
    let mut k = top;
    while k > 2 {
        k -= 2;
        for odd in 0..2 {
            let start = C::real(simd, INVERSE_FACTORIAL[k + odd]);
            let (near, far) = (sums[odd], sums[2 + odd]);
            let value = z2.neg_mul_add(far, z1.mul_add(near, start));
            let slope = z2.neg_mul_add(slopes[2 + odd], z1.mul_add(slopes[odd], near));
            (sums[odd], sums[2 + odd]) = (value, near);
            (slopes[odd], slopes[2 + odd], slopes[4 + odd]) = (slope, slopes[odd], slopes[2 + odd]);
        }
    }
    (sums, slopes)
}

/// cosh(sqrt z) and sinh(sqrt z)/sqrt z of a rod, with their derivatives by z: `[value, by z]` each.
#[inline(always)]
pub fn rod<S: Simd>(z: C<S>, terms: usize) -> [[C<S>; 2]; 2] {
    let simd = z.simd;
    let mut out = [[C::zero(simd); 2]; 2];
    for (odd, pair) in out.iter_mut().enumerate() {
        let mut k = 2 * (terms + 3) + odd;
        let mut value = C::real(simd, INVERSE_FACTORIAL[k]);
        let mut slope = C::zero(simd);
        while k > odd {
            k -= 2;
            slope = z.mul_add(slope, value);
            value = z.mul_add(value, C::real(simd, INVERSE_FACTORIAL[k]));
        }
        *pair = [value, slope];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;
    use pulp::Scalar;

    fn one(value: Complex64) -> C<Scalar> {
        C::splat(Scalar::new(), value)
    }

    fn number(value: C<Scalar>) -> Complex64 {
        Complex64::new(value.re, value.im)
    }

    #[test]
    fn sums_agree_with_hyperbolic_functions() {
        for (l1, l2) in [
            (Complex64::new(1.7, 0.1), Complex64::new(0.05, 2.1)),
            (Complex64::new(2.9, 0.0), Complex64::new(0.0, 2.95)),
            (Complex64::new(0.4, 0.3), Complex64::new(0.0, 2.0)),
        ] {
            let (a, b) = (l1 * l1, l2 * l2);
            let n = terms(9.0);
            let got = sums(one(a + b), one(a * b), n);
            let e2 = (l1.cosh() - l2.cosh()) / (a - b);
            let e3 = (l1.sinh() / l1 - l2.sinh() / l2) / (a - b);
            assert!((number(got[0]) - e2).norm() < 1e-14 * e2.norm().max(1.0));
            assert!((number(got[1]) - e3).norm() < 1e-14 * e3.norm().max(1.0));
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let (z1, z2) = (Complex64::new(-3.0, 0.2), Complex64::new(-20.0, 0.5));
        let n = terms(9.0);
        let (values, slopes) = sums_with_derivatives(one(z1), one(z2), n);
        let plain = sums(one(z1), one(z2), n);
        let h = 1e-5;
        let (up, down) = (sums(one(z1 + h), one(z2), n), sums(one(z1 - h), one(z2), n));
        let (up2, down2) = (sums(one(z1), one(z2 + h), n), sums(one(z1), one(z2 - h), n));
        for k in 0..4 {
            assert!((number(values[k]) - number(plain[k])).norm() < 1e-15);
            let slope = (number(up[k]) - number(down[k])) / (2.0 * h);
            assert!((number(slopes[k]) - slope).norm() < 1e-9);
            let slope = (number(up2[k]) - number(down2[k])) / (2.0 * h);
            assert!((-number(slopes[k + 2]) - slope).norm() < 1e-9);
        }
    }

    #[test]
    fn rod_functions_agree_with_hyperbolic_functions() {
        let l = Complex64::new(0.3, 2.5);
        let [c, s] = rod(one(l * l), terms(9.0));
        assert!((number(c[0]) - l.cosh()).norm() < 1e-14);
        assert!((number(s[0]) - l.sinh() / l).norm() < 1e-14);
        assert!((number(c[1]) - l.sinh() / l / 2.0).norm() < 1e-14);
    }
}
