//! Records that end while the structure still rings.
//!
//! The record of a hit that ends at the time e after it has the transform of the response over [0, e] alone,
//!     H_e(s) = s^-2 int_0^e a(t) exp(-s t) dt,
//! with the acceleration a(t) after a unit impulse. It follows from the response A(s) = s^2 H(s) on complex lines: with
//! a period P > e and a decay s0 the samples A(p_j), p_j = s0 + i v_j, v_j = (j + 1/2) 2 pi / P, are the Fourier
//! coefficients of a(t) exp(-s0 t), continued antiperiodically with an error of exp(-s0 P), so that
//!     s^2 H_e(s) = sum_j A(p_j) (exp((p_j - s) e) - exp(-(p_j - s) b)) / (P (p_j - s)).
//! The integral begins at -b, before the hit, for the immediate part of the response. Samples above the band of the
//! lines are faded out: they are smooth there, and so act at t = 0 alone. Samples of negative v are conjugates, and
//! with y = a_j + i b_j and u = s0 - s both together are
//!     y / (u + i v) + conj(y) / (u - i v) = 2 (u a_j + v b_j) / (u^2 + v^2).

use crate::error::{Error, Result};
use crate::simd::lane::{C, MAX_LANES};
use core::f64::consts::{PI, TAU};
use num_complex::Complex64;
use pulp::{Simd, WithSimd};

/// The latest end that a fit may look for, as a multiple of the stated one.
const LATEST: f64 = 1.2;

/// Period as a multiple of the latest end.
const PERIOD: f64 = 1.6;

/// Begin of the integral before the hit, as a share of the latest end.
const BEFORE: f64 = 0.1;

/// s0 P: the continuation is in error by exp(-9).
const DECAY: f64 = 9.0;

/// Multiples of the highest line up to which samples count fully, and at all.
const WHOLE: f64 = 1.05;
const TOP: f64 = 1.35;

/// Most samples: a record and a band that need more are not in the same units.
const MOST_SAMPLES: f64 = 1e6;

/// The end of a record, and the samples from which its transform follows.
#[derive(Clone, Debug)]
pub struct Truncation {
    /// Time in s after the hit at which the record is stated to end.
    pub end: f64,
    period: f64,
    decay: f64,
    before: f64,
    /// v_j and the weight of the sample.
    samples: Vec<(f64, f64)>,
}

/// Some responses in a record: terms of the sums over samples, response after response.
pub(crate) struct Sums<'a> {
    truncation: &'a Truncation,
    end: f64,
    rate: f64,
    /// For each response a_j and v_j b_j at the end and before the hit, `(responses, samples)`.
    terms: Vec<Vec<[f64; 4]>>,
    /// a(e) of the first response.
    last: f64,
}

impl Truncation {
    /// The end of a record that has lines w in rad/s.
    ///
    /// # Errors
    /// An end that is not positive, or a record too long for its lines.
    pub fn new(w: &[Complex64], end: f64) -> Result<Self> {
        let top = w.iter().fold(0.0_f64, |top, w| top.max(w.re));
        let period = PERIOD * LATEST * end;
        let step = TAU / period;
        let count = TOP * top / step;
        if !(end > 0.0 && count < MOST_SAMPLES) {
            let expected =
                format!("a positive time in s of at most {MOST_SAMPLES:e} periods of the highest line");
            return Err(Error::Index { what: "end of record", index: 0, value: end, expected });
        }
        let sample = |j: usize| {
            let v = step * (j as f64 + 0.5);
            let share = ((v / top - WHOLE) / (TOP - WHOLE)).clamp(0.0, 1.0);
            (v, 0.5 + 0.5 * (PI * share).cos())
        };
        let samples = (0..count as usize).map(sample).collect();
        Ok(Self { end, period, decay: DECAY / period, before: BEFORE * LATEST * end, samples })
    }

    /// The lines in rad/s on which the structure is evaluated; `rate` is that of one more exponential window.
    pub fn lines(&self, rate: f64) -> Vec<Complex64> {
        self.samples.iter().map(|(v, _)| Complex64::new(*v, -self.decay - rate)).collect()
    }

    /// The sums of responses that are given on these lines, `responses` values a line.
    pub(crate) fn sums(&self, values: &[Complex64], responses: usize, end: f64, rate: f64) -> Sums<'_> {
        let mut terms = vec![Vec::with_capacity(self.samples.len()); responses];
        let mut last = 0.0;
        for (&(v, weight), values) in self.samples.iter().zip(values.chunks(responses.max(1))) {
            let p = Complex64::new(self.decay, v);
            let acceleration = (p + rate) * (p + rate) * weight;
            let (at_end, at_begin) =
                ((p * end).exp() * acceleration, (-p * self.before).exp() * acceleration);
            last += 2.0 * (at_end * values[0]).re / self.period;
            for (terms, value) in terms.iter_mut().zip(values) {
                let (late, early) = (at_end * value, at_begin * value);
                terms.push([late.re, v * late.im, early.re, v * early.im]);
            }
        }
        Sums { truncation: self, end, rate, terms, last }
    }
}

impl Sums<'_> {
    /// Derivative by the end of the first response in the record at a line w.
    pub fn by_end(&self, w: Complex64) -> Complex64 {
        let s = Complex64::I * w;
        (-s * self.end).exp() * self.last / ((s + self.rate) * (s + self.rate))
    }
}

/// The responses in the record at some lines, all of the first line and so on.
pub(crate) struct Recorded<'a> {
    pub sums: &'a Sums<'a>,
    pub w: &'a [Complex64],
}

impl WithSimd for Recorded<'_> {
    type Output = Vec<Complex64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<Complex64> {
        let Self { sums: Sums { truncation, end, rate, terms, .. }, w } = self;
        let mut out = vec![Complex64::ZERO; w.len() * terms.len()];
        let mut inverses = Vec::with_capacity(truncation.samples.len());
        let decay = C::real(simd, truncation.decay);
        for start in (0..w.len()).step_by(S::F64_LANES) {
            let lines = &w[start..w.len().min(start + S::F64_LANES)];
            let s = C::load(simd, lines).times_i();
            let u = decay - s;
            let square = u * u;
            inverses.clear();
            inverses.extend(truncation.samples.iter().map(|(v, _)| (square + C::real(simd, v * v)).recip()));
            // Before the sums: 2 / P, and the factors that do not depend on the sample.
            let mut outside = [[Complex64::ZERO; 2]; MAX_LANES];
            for (outside, w) in outside.iter_mut().zip(lines) {
                let s = Complex64::I * w;
                let common = 2.0 / (truncation.period * (s + rate) * (s + rate));
                *outside = [common * (-s * end).exp(), common * (s * truncation.before).exp()];
            }
            for (response, terms) in terms.iter().enumerate() {
                let mut sums = [C::zero(simd); 4];
                for (inverse, term) in inverses.iter().zip(terms) {
                    for (sum, term) in sums.iter_mut().zip(term) {
                        *sum = inverse.mul_add_real(simd.splat_f64s(*term), *sum);
                    }
                }
                let mut lanes = [[Complex64::ZERO; MAX_LANES]; 2];
                u.mul_add(sums[0], sums[1]).store(&mut lanes[0]);
                u.mul_add(sums[2], sums[3]).store(&mut lanes[1]);
                for (lane, outside) in outside.iter().enumerate().take(lines.len()) {
                    let value = outside[0] * lanes[0][lane] - outside[1] * lanes[1][lane];
                    out[(start + lane) * self.sums.terms.len() + response] = value;
                }
            }
        }
        out
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use pulp::Arch;

    /// The acceleration t^2 exp(-a t) / 2, whose transform is (s + a)^-3, cut off at e.
    #[test]
    fn a_signal_in_closed_form() {
        let (a, end, rate) = (30.0, 0.08, 4.0);
        let w: Vec<Complex64> = (10..60).map(|i| Complex64::new(TAU * 12.5 * f64::from(i), -3.0)).collect();
        let truncation = Truncation::new(&w, 0.075).unwrap();
        let response = |s: Complex64| (s + a).powi(-3) / (s * s);
        let lines = truncation.lines(rate);
        let values: Vec<Complex64> = lines.iter().map(|w| response(Complex64::I * w)).collect();
        let sums = truncation.sums(&values, 1, end, rate);
        let found = Arch::new().dispatch(Recorded { sums: &sums, w: &w });
        for (w, found) in w.iter().zip(found) {
            let s = Complex64::I * w + rate;
            let z = s + a;
            let rest = (-z * end).exp() * (1.0 / z + end + z * end * end / 2.0) / (z * z);
            let exact = (z.powi(-3) - rest) / (s * s);
            assert!((found - exact).norm() < 1e-4 * exact.norm(), "{found} {exact}");
            let by_end = 0.5 * end * end * (-a * end).exp() * (-s * end).exp() / (s * s);
            assert!((sums.by_end(*w) - by_end).norm() < 1e-3 * by_end.norm(), "{w}");
        }
        assert!(Truncation::new(&w, 0.0).is_err() && Truncation::new(&w, 1e6).is_err());
    }
}
