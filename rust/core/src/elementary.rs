//! Complex logarithm over lanes.

use crate::lane::{C, MAX_LANES, R};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, LN_2, PI, SQRT_2};
use pulp::Simd;

/// 1/(2k + 1), the series of artanh(s)/s, to where s^2 < 0.0295 leaves nothing.
const ARTANH: [f64; 12] = {
    let mut table = [1.0; 12];
    let mut k = 0;
    while k < 12 {
        table[k] = 1.0 / (2 * k + 1) as f64;
        k += 1;
    }
    table
};

/// Rational approximation of (atan(x) - x)/x^3 in x^2 for |x| <= 0.66 (Moshier, Cephes, atan.c).
const ATAN_TOP: [f64; 5] = [
    -8.750_608_600_031_904e-1,
    -1.615_753_718_733_365e1,
    -7.500_855_792_314_705e1,
    -1.228_866_684_490_136_1e2,
    -6.485_021_904_942_025e1,
];
const ATAN_BOTTOM: [f64; 6] = [
    1.0,
    2.485_846_490_142_306_4e1,
    1.650_270_098_316_988_5e2,
    4.328_810_604_912_903e2,
    4.853_903_996_359_137e2,
    1.945_506_571_482_614e2,
];

/// tan(pi/8), above which the argument is reduced once more.
const REDUCE_ABOVE: f64 = 0.414_213_562_373_095_03;

#[inline(always)]
fn polynomial<S: Simd>(x: R<S>, coefficients: &[f64]) -> R<S> {
    let s = x.simd;
    let mut sum = s.splat_f64s(coefficients[0]);
    for &coefficient in &coefficients[1..] {
        sum = s.mul_add_e_f64s(sum, x.v, s.splat_f64s(coefficient));
    }
    R { simd: s, v: sum }
}

/// Natural logarithm of positive normal numbers.
#[inline(always)]
fn ln<S: Simd>(x: R<S>) -> R<S> {
    let s = x.simd;
    let (mut mantissa, mut exponent) = ([1.0; MAX_LANES], [0.0; MAX_LANES]);
    x.store(&mut mantissa);
    for lane in 0..S::F64_LANES {
        let bits = mantissa[lane].to_bits();
        let whole = f64::from_bits((bits & 0x000f_ffff_ffff_ffff) | 0x3ff0_0000_0000_0000);
        let above = whole > SQRT_2;
        mantissa[lane] = if above { 0.5 * whole } else { whole };
        let power = ((bits >> 52) & 0x7ff) as i32 - 1023;
        exponent[lane] = f64::from(power) + if above { 1.0 } else { 0.0 };
    }
    let m = s.partial_load_f64s(&mantissa[..S::F64_LANES]);
    let e = s.partial_load_f64s(&exponent[..S::F64_LANES]);
    let one = s.splat_f64s(1.0);
    let ratio = s.div_f64s(s.sub_f64s(m, one), s.add_f64s(m, one));
    let mut coefficients = ARTANH;
    coefficients.reverse();
    let sum = polynomial(R { simd: s, v: s.mul_f64s(ratio, ratio) }, &coefficients);
    let value = s.mul_f64s(s.add_f64s(ratio, ratio), sum.v);
    R { simd: s, v: s.mul_add_e_f64s(e, s.splat_f64s(LN_2), value) }
}

/// Angle of (x, y) from -pi to pi.
#[inline(always)]
fn angle<S: Simd>(x: R<S>, y: R<S>) -> R<S> {
    let s = x.simd;
    let (ax, ay) = (s.abs_f64s(x.v), s.abs_f64s(y.v));
    let steep = s.greater_than_f64s(ay, ax);
    let (small, large) = (s.min_f64s(ax, ay), s.max_f64s(ax, ay));
    let ratio = s.div_f64s(small, large);
    let reduce = s.greater_than_f64s(ratio, s.splat_f64s(REDUCE_ABOVE));
    let reduced = s.div_f64s(s.sub_f64s(small, large), s.add_f64s(small, large));
    let t = s.select_f64s(reduce, reduced, ratio);
    let start = s.select_f64s(reduce, s.splat_f64s(FRAC_PI_4), s.splat_f64s(0.0));
    let square = R { simd: s, v: s.mul_f64s(t, t) };
    let fraction = s.div_f64s(polynomial(square, &ATAN_TOP).v, polynomial(square, &ATAN_BOTTOM).v);
    let cube = s.mul_f64s(t, square.v);
    let value = s.add_f64s(start, s.mul_add_e_f64s(cube, fraction, t));
    let value = s.select_f64s(steep, s.sub_f64s(s.splat_f64s(FRAC_PI_2), value), value);
    let left = s.less_than_f64s(x.v, s.splat_f64s(0.0));
    let value = s.select_f64s(left, s.sub_f64s(s.splat_f64s(PI), value), value);
    let below = s.less_than_f64s(y.v, s.splat_f64s(0.0));
    R { simd: s, v: s.select_f64s(below, s.neg_f64s(value), value) }
}

impl<S: Simd> C<S> {
    /// Principal logarithm of a number whose squared modulus neither over- nor underflows.
    #[inline(always)]
    pub fn ln(self) -> Self {
        let modulus = ln(self.norm_sqr());
        let half = self.simd.mul_f64s(modulus.v, self.simd.splat_f64s(0.5));
        let angle = angle(R { simd: self.simd, v: self.re }, R { simd: self.simd, v: self.im });
        Self { simd: self.simd, re: half, im: angle.v }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;
    use pulp::{Arch, WithSimd};

    struct Logarithms<'a>(&'a [Complex64]);

    impl WithSimd for Logarithms<'_> {
        type Output = Vec<Complex64>;
        fn with_simd<S: Simd>(self, simd: S) -> Vec<Complex64> {
            let mut out = Vec::new();
            for values in self.0.chunks(S::F64_LANES) {
                let mut lanes = [Complex64::ZERO; MAX_LANES];
                C::load(simd, values).ln().store(&mut lanes);
                out.extend_from_slice(&lanes[..values.len()]);
            }
            out
        }
    }

    #[test]
    fn logarithms_agree_with_the_library() {
        let mut values = Vec::new();
        for i in 0..2000 {
            let angle = -PI + (f64::from(i) + 0.5) * PI / 1000.0;
            for modulus in [1e-80, 3.7e-9, 0.999, 1.0, 1.4143, 2.5e7, 1e60] {
                values.push(Complex64::from_polar(modulus, angle));
            }
        }
        values.extend([Complex64::ONE, Complex64::new(-1.0, 0.0), Complex64::I, -Complex64::I]);
        for (got, value) in Arch::new().dispatch(Logarithms(&values)).into_iter().zip(&values) {
            let expected = value.ln();
            assert!((got.re - expected.re).abs() <= 4e-16 * expected.re.abs().max(1.0), "{value}");
            assert!((got.im - expected.im).abs() <= 5e-16 * expected.im.abs().max(0.1), "{value}");
        }
    }
}
