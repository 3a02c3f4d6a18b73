//! Complex numbers over SIMD lanes: one value per frequency line.
//!
//! Every kernel is written once over `C<S>`. With `S` a vector instruction set a value holds as many
//! frequency lines as the registers do; with `pulp::Scalar` it holds one.

use core::ops::{Add, Mul, Neg, Sub};
use num_complex::Complex64;
use pulp::Simd;

/// The widest block of lines of any instruction set that pulp dispatches to.
pub const MAX_LANES: usize = 8;

/// -x. That of pulp is a call of a function, instead of a part of the multiplication that follows.
#[inline(always)]
pub fn negated<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    simd.sub_f64s(simd.splat_f64s(-0.0), x)
}

/// Real numbers, one a lane.
#[derive(Copy, Clone)]
pub struct R<S: Simd> {
    /// The token that proves that the instructions exist here.
    pub simd: S,
    /// The lanes.
    pub v: S::f64s,
}

/// Complex numbers, one a lane, real and imaginary parts in registers of their own.
#[derive(Copy, Clone)]
pub struct C<S: Simd> {
    /// The token that proves that the instructions exist here.
    pub simd: S,
    /// Real parts.
    pub re: S::f64s,
    /// Imaginary parts.
    pub im: S::f64s,
}

impl<S: Simd> R<S> {
    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self { simd, v: simd.splat_f64s(value) }
    }

    /// Lanes where `self` is greater than `other`.
    #[inline(always)]
    pub fn greater(self, other: Self) -> S::m64s {
        self.simd.greater_than_f64s(self.v, other.v)
    }

    /// `self` where the mask holds, else `other`.
    #[inline(always)]
    pub fn select(mask: S::m64s, yes: Self, no: Self) -> Self {
        Self { simd: yes.simd, v: yes.simd.select_f64s(mask, yes.v, no.v) }
    }

    /// The larger of two, lane by lane.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self { simd: self.simd, v: self.simd.max_f64s(self.v, other.v) }
    }

    /// The smallest over the lanes.
    #[inline(always)]
    pub fn least(self) -> f64 {
        self.simd.reduce_min_f64s(self.v)
    }

    /// One over `self`.
    #[inline(always)]
    pub fn recip(self) -> Self {
        Self { simd: self.simd, v: self.simd.div_f64s(self.simd.splat_f64s(1.0), self.v) }
    }

    /// Times a real number that all lanes share.
    #[inline(always)]
    pub fn scale(self, factor: f64) -> Self {
        Self { simd: self.simd, v: self.simd.mul_f64s(self.v, self.simd.splat_f64s(factor)) }
    }

    /// Copies the lanes out.
    #[inline(always)]
    pub fn store(self, out: &mut [f64; MAX_LANES]) {
        S::as_mut_simd_f64s(out).0[0] = self.v;
    }
}

impl<S: Simd> Mul for R<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { simd: self.simd, v: self.simd.mul_f64s(self.v, other.v) }
    }
}

impl<S: Simd> C<S> {
    /// The same complex number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: Complex64) -> Self {
        Self { simd, re: simd.splat_f64s(value.re), im: simd.splat_f64s(value.im) }
    }

    /// The same real number in every lane.
    #[inline(always)]
    pub fn real(simd: S, value: f64) -> Self {
        Self { simd, re: simd.splat_f64s(value), im: simd.splat_f64s(0.0) }
    }

    /// Zero in every lane.
    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        Self::real(simd, 0.0)
    }

    /// Loads one number a lane; a short slice repeats its last line, so that no lane divides by zero.
    #[inline(always)]
    pub fn load(simd: S, values: &[Complex64]) -> Self {
        let mut re = [0.0; MAX_LANES];
        let mut im = [0.0; MAX_LANES];
        if let Some(last) = values.last() {
            for lane in 0..S::F64_LANES {
                let value = values.get(lane).unwrap_or(last);
                re[lane] = value.re;
                im[lane] = value.im;
            }
        }
        Self { simd, re: S::as_simd_f64s(&re).0[0], im: S::as_simd_f64s(&im).0[0] }
    }

    /// Copies the lanes out.
    #[inline(always)]
    pub fn store(self, out: &mut [Complex64; MAX_LANES]) {
        let mut re = [0.0; MAX_LANES];
        let mut im = [0.0; MAX_LANES];
        S::as_mut_simd_f64s(&mut re).0[0] = self.re;
        S::as_mut_simd_f64s(&mut im).0[0] = self.im;
        for lane in 0..S::F64_LANES {
            out[lane] = Complex64::new(re[lane], im[lane]);
        }
    }

    /// `self * b + c`.
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        let s = self.simd;
        let re = s.mul_add_e_f64s(self.re, b.re, c.re);
        let im = s.mul_add_e_f64s(self.re, b.im, c.im);
        Self {
            simd: s,
            re: s.mul_add_e_f64s(negated(s, self.im), b.im, re),
            im: s.mul_add_e_f64s(self.im, b.re, im),
        }
    }

    /// `self * b + c` with real b.
    #[inline(always)]
    pub fn mul_add_real(self, b: S::f64s, c: Self) -> Self {
        let s = self.simd;
        Self { simd: s, re: s.mul_add_e_f64s(self.re, b, c.re), im: s.mul_add_e_f64s(self.im, b, c.im) }
    }

    /// Times a real number a lane.
    #[inline(always)]
    pub fn mul_real(self, b: S::f64s) -> Self {
        Self { simd: self.simd, re: self.simd.mul_f64s(self.re, b), im: self.simd.mul_f64s(self.im, b) }
    }

    /// The lanes in the order from which `interleave_shfl` makes real and imaginary parts in turns.
    #[inline(always)]
    pub fn woven(self) -> Self {
        let mut lanes = [Complex64::ZERO; MAX_LANES];
        self.store(&mut lanes);
        let parts: &[f64] = bytemuck::cast_slice(&lanes);
        let parts = S::as_simd_f64s(parts).0;
        let [re, im] = self.simd.deinterleave_shfl_f64s([parts[0], parts[1]]);
        Self { simd: self.simd, re, im }
    }

    /// `c - self * b`.
    #[inline(always)]
    pub fn neg_mul_add(self, b: Self, c: Self) -> Self {
        (-self).mul_add(b, c)
    }

    /// Times a real number that all lanes share.
    #[inline(always)]
    pub fn scale(self, factor: f64) -> Self {
        let s = self.simd;
        let factor = s.splat_f64s(factor);
        Self { simd: s, re: s.mul_f64s(self.re, factor), im: s.mul_f64s(self.im, factor) }
    }

    /// Times the imaginary unit.
    #[inline(always)]
    pub fn times_i(self) -> Self {
        Self { simd: self.simd, re: negated(self.simd, self.im), im: self.re }
    }

    /// Squared modulus.
    #[inline(always)]
    pub fn norm_sqr(self) -> R<S> {
        let s = self.simd;
        let v = s.mul_add_e_f64s(self.re, self.re, s.mul_f64s(self.im, self.im));
        R { simd: s, v }
    }

    /// One over `self`.
    #[inline(always)]
    pub fn recip(self) -> Self {
        let s = self.simd;
        let inverse = s.div_f64s(s.splat_f64s(1.0), self.norm_sqr().v);
        Self { simd: s, re: s.mul_f64s(self.re, inverse), im: negated(s, s.mul_f64s(self.im, inverse)) }
    }

    /// `yes` where the mask holds, else `no`.
    #[inline(always)]
    pub fn select(mask: S::m64s, yes: Self, no: Self) -> Self {
        let s = yes.simd;
        Self { simd: s, re: s.select_f64s(mask, yes.re, no.re), im: s.select_f64s(mask, yes.im, no.im) }
    }
}

impl<S: Simd> Add for C<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let s = self.simd;
        Self { simd: s, re: s.add_f64s(self.re, other.re), im: s.add_f64s(self.im, other.im) }
    }
}

impl<S: Simd> Sub for C<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let s = self.simd;
        Self { simd: s, re: s.sub_f64s(self.re, other.re), im: s.sub_f64s(self.im, other.im) }
    }
}

impl<S: Simd> Mul for C<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let s = self.simd;
        let re = s.mul_f64s(self.im, other.im);
        let im = s.mul_f64s(self.im, other.re);
        Self {
            simd: s,
            re: s.mul_add_e_f64s(self.re, other.re, negated(s, re)),
            im: s.mul_add_e_f64s(self.re, other.im, im),
        }
    }
}

impl<S: Simd> Neg for C<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let s = self.simd;
        Self { simd: s, re: negated(s, self.re), im: negated(s, self.im) }
    }
}
