//! Complex logarithm over lanes.

use crate::simd::lane::{C, MAX_LANES, negated};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, LN_2, PI};
use pulp::Simd;

/// artanh(s)/s in s^2, the highest power first, interpolated in Chebyshev's points: 3e-17 for s^2 <= 0.0406.
const ARTANH: [f64; 8] = [
    0.077_103_009_943_951_29,
    0.076_214_776_934_782_04,
    0.090_933_759_105_433_33,
    0.111_110_637_978_141_36,
    0.142_857_147_769_849_2,
    0.199_999_999_974_997_68,
    0.333_333_333_333_381_7,
    1.0,
];

/// atan(t)/t in t^2, the highest power first, interpolated likewise: 4e-18 for t <= tan(pi/8).
const ATAN: [f64; 12] = [
    -0.017_805_397_205_404_437,
    0.037_965_257_453_852_395,
    -0.050_351_024_566_010_254,
    0.058_468_782_973_307_57,
    -0.066_629_518_136_291_74,
    0.076_920_453_309_022_24,
    -0.090_908_968_090_640_27,
    0.111_111_107_449_198_5,
    -0.142_857_142_792_502_45,
    0.199_999_999_999_408_93,
    -0.333_333_333_333_331_2,
    1.0,
];

/// tan(pi/8), above which the argument is reduced once more.
const REDUCE_ABOVE: f64 = 0.414_213_562_373_095_03;

/// Where the exponent of a number begins in its bits.
const EXPONENT: u32 = 52;

/// Polynomials of several numbers, their steps side by side: even and odd powers apart, so that no step waits for the
/// one before it.
#[inline(always)]
fn polynomials<S: Simd, const N: usize>(s: S, x: [S::f64s; N], coefficients: &[f64]) -> [S::f64s; N] {
    let mut square = x;
    for i in 0..N {
        square[i] = s.mul_f64s(x[i], x[i]);
    }
    let mut odd = [s.splat_f64s(coefficients[0]); N];
    let mut even = [s.splat_f64s(coefficients[1]); N];
    for pair in coefficients[2..].chunks_exact(2) {
        for i in 0..N {
            odd[i] = s.mul_add_e_f64s(odd[i], square[i], s.splat_f64s(pair[0]));
            even[i] = s.mul_add_e_f64s(even[i], square[i], s.splat_f64s(pair[1]));
        }
    }
    for i in 0..N {
        even[i] = s.mul_add_e_f64s(odd[i], x[i], even[i]);
    }
    even
}

/// The power of two nearest to a/b, about: it, and a over it. Within 2^-0.59 and 2^0.59 a is then b.
#[inline(always)]
fn near<S: Simd>(s: S, a: S::f64s, b: S::f64s) -> (S::f64s, S::f64s) {
    // The bits of a positive number, seen as an integer, are nearly its logarithm.
    let bits = s.transmute_u64s_f64s(a);
    let difference = s.sub_u64s(bits, s.transmute_u64s_f64s(b));
    let rounded = s.add_u64s(difference, s.splat_u64s(1 << (EXPONENT - 1)));
    let whole = s.and_u64s(rounded, s.splat_u64s(u64::MAX << EXPONENT));
    // Whole vectors go there and back, which the compiler sees through: it keeps them in registers.
    let mut power = [0.0; MAX_LANES];
    S::as_mut_simd_f64s(&mut power).0[0] = s.transmute_f64s_u64s(whole);
    for lane in &mut power[..S::F64_LANES] {
        *lane = (lane.to_bits().cast_signed() >> EXPONENT) as f64;
    }
    (S::as_simd_f64s(&power).0[0], s.transmute_f64s_u64s(s.sub_u64s(bits, whole)))
}

/// Logarithms of the moduli of quotients, and the moduli of their angles: see `C::ln_over`.
///
/// Several at once, step by step: a logarithm is a long chain of steps each of which waits for the one before it, and
/// the processor does not look far enough ahead to find the next logarithm by itself.
// Loops, not array maps: a closure is a function of its own, compiled without the instruction set.
#[inline(always)]
fn logarithms<S: Simd, const N: usize>(s: S, quotients: [[C<S>; 2]; N]) -> Parts<S, N> {
    let zero = s.splat_f64s(0.0);
    let none = [zero; N];
    let (mut b, mut power, mut near_b, mut sum, mut x, mut y) = (none, none, none, none, none, none);
    for i in 0..N {
        let [above, below] = quotients[i];
        // With a/b = 2^k (1 + q)/(1 - q) the logarithm of the modulus is k ln(2)/2 + artanh(q).
        b[i] = below.norm_sqr().v;
        (power[i], near_b[i]) = near(s, above.norm_sqr().v, b[i]);
        sum[i] = s.add_f64s(near_b[i], b[i]);
        // The angle is that of (x, y), reduced to atan(t) with t <= tan(pi/8).
        x[i] = s.mul_add_e_f64s(above.re, below.re, s.mul_f64s(above.im, below.im));
        y[i] = s.mul_add_e_f64s(above.im, below.re, negated(s, s.mul_f64s(above.re, below.im)));
    }
    let (mut start, mut q, mut t) = (none, none, none);
    for i in 0..N {
        let (ax, ay) = (s.abs_f64s(x[i]), s.abs_f64s(y[i]));
        let (small, large) = (s.min_f64s(ax, ay), s.max_f64s(ax, ay));
        let reduce = s.greater_than_f64s(small, s.mul_f64s(large, s.splat_f64s(REDUCE_ABOVE)));
        let above = s.sub_f64s(small, s.select_f64s(reduce, large, zero));
        let below = s.add_f64s(large, s.select_f64s(reduce, small, zero));
        // One division for both.
        let inverse = s.div_f64s(s.splat_f64s(1.0), s.mul_f64s(sum[i], below));
        q[i] = s.mul_f64s(s.sub_f64s(near_b[i], b[i]), s.mul_f64s(inverse, below));
        t[i] = s.mul_f64s(above, s.mul_f64s(inverse, sum[i]));
        start[i] = s.select_f64s(reduce, s.splat_f64s(FRAC_PI_4), zero);
    }
    let (mut q_square, mut t_square) = (none, none);
    for i in 0..N {
        (q_square[i], t_square[i]) = (s.mul_f64s(q[i], q[i]), s.mul_f64s(t[i], t[i]));
    }
    let artanh = polynomials(s, q_square, &ARTANH);
    let atan = polynomials(s, t_square, &ATAN);
    let (mut modulus, mut angle) = (none, none);
    for i in 0..N {
        modulus[i] = s.mul_add_e_f64s(power[i], s.splat_f64s(0.5 * LN_2), s.mul_f64s(q[i], artanh[i]));
        let acute = s.mul_add_e_f64s(t[i], atan[i], start[i]);
        let steep = s.greater_than_f64s(s.abs_f64s(y[i]), s.abs_f64s(x[i]));
        let right = s.select_f64s(steep, s.sub_f64s(s.splat_f64s(FRAC_PI_2), acute), acute);
        angle[i] = s.select_f64s(s.less_than_f64s(x[i], zero), s.sub_f64s(s.splat_f64s(PI), right), right);
    }
    Parts { modulus, angle, y }
}

/// Results of `logarithms`; `y` has the signs of the angles.
struct Parts<S: Simd, const N: usize> {
    modulus: [S::f64s; N],
    angle: [S::f64s; N],
    y: [S::f64s; N],
}

/// Squared moduli of the principal logarithms of quotients, under the conditions of `C::ln_over`.
#[inline(always)]
pub fn ln_norm_sqr<S: Simd, const N: usize>(simd: S, quotients: [[C<S>; 2]; N]) -> [S::f64s; N] {
    let Parts { modulus, angle, mut y } = logarithms(simd, quotients);
    for i in 0..N {
        y[i] = C { simd, re: modulus[i], im: angle[i] }.norm_sqr().v;
    }
    y
}

impl<S: Simd> C<S> {
    /// Principal logarithm of a number whose squared modulus neither over- nor underflows.
    #[inline(always)]
    pub fn ln(self) -> Self {
        self.ln_over(Self::real(self.simd, 1.0))
    }

    /// Principal logarithm of `self` over another number, where no product of four of their moduli over- or
    /// underflows; one division in all.
    #[inline(always)]
    pub fn ln_over(self, other: Self) -> Self {
        let s = self.simd;
        let Parts { modulus: [re], angle: [angle], y: [y] } = logarithms(s, [[self, other]]);
        let down = s.less_than_f64s(y, s.splat_f64s(0.0));
        Self { simd: s, re, im: s.select_f64s(down, negated(s, angle), angle) }
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

    /// Quotients of neighbours.
    struct Quotients<'a>(&'a [Complex64]);

    impl WithSimd for Quotients<'_> {
        type Output = Vec<Complex64>;
        fn with_simd<S: Simd>(self, simd: S) -> Vec<Complex64> {
            let mut out = Vec::new();
            for pair in self.0.windows(2) {
                let mut lanes = [Complex64::ZERO; MAX_LANES];
                C::splat(simd, pair[0]).ln_over(C::splat(simd, pair[1])).store(&mut lanes);
                out.push(lanes[0]);
            }
            out
        }
    }

    #[test]
    fn logarithms_of_quotients_keep_their_digits_near_one() {
        let mut values = vec![Complex64::new(3.7e-9, -1.2e-9)];
        for step in 1..400 {
            let last = values[step - 1];
            let size = 10.0_f64.powf(f64::from(step as u32 % 37) / 3.0 - 12.0);
            values.push(last * (Complex64::ONE + Complex64::from_polar(size, step as f64)));
        }
        for (got, pair) in Arch::new().dispatch(Quotients(&values)).into_iter().zip(values.windows(2)) {
            // log(1 + x), with x the exact difference of both over the second.
            let x = (pair[0] - pair[1]) / pair[1];
            let modulus = 0.5 * (x.norm_sqr() + 2.0 * x.re).ln_1p();
            let expected = Complex64::new(modulus, x.im.atan2(1.0 + x.re));
            assert!((got - expected).norm() <= 1e-15 * expected.norm() + 4e-16, "{got} {expected}");
        }
    }
}
