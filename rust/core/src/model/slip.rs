//! Joints in micro-slip: the change of their stiffness by slip at an amplitude.
//!
//! Each direction is an Iwan element of power-law distribution with the backbone f(u) = k u (1 - c u^p) and Masing's
//! rules. Its first harmonic at the level l = a / a_ref of the amplitude a is the complex stiffness
//!     k (1 + i eta) - k s l^p (1 - i beta),   beta = p / (2 (1 + p) I_p),   I_p = int_0^(pi/2) sin^(2 + 2 p),
//! s being the share that is lost at the level 1.

use crate::error::{Error, Result};
use num_complex::Complex64;

/// Columns of the table of slips: row of the joint, slip_y, slip_theta, exponent, level, reference_y, reference_theta.
pub const SLIP_COLUMNS: usize = 7;

/// Largest exponent.
const GREATEST_EXPONENT: f64 = 4.0;

/// Largest argument of the Gamma function up to which its recurrence is used.
const ASYMPTOTIC: f64 = 12.0;

/// A joint in micro-slip.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Slip {
    /// Row of the joint.
    pub joint: usize,
    /// Shares of k_y and k_theta that are lost at the level 1.
    pub slip: [f64; 2],
    /// p.
    pub exponent: f64,
    /// The stated level.
    pub level: f64,
    /// Amplitudes of the level 1 in m and rad.
    pub reference: [f64; 2],
    /// 1 - i beta and its derivative by p.
    ratio: [Complex64; 2],
}

impl Slip {
    /// Reads and checks a row; `k` are k_y, k_theta and k_ytheta of the joint.
    ///
    /// # Errors
    /// Negative numbers or numbers that are not finite, an exponent out of range, or a level at which the whole
    /// interface slides.
    pub fn new(values: &[f64], row: usize, joint: usize, k: [f64; 3]) -> Result<Self> {
        const NAMES: [&str; SLIP_COLUMNS - 1] =
            ["slip_y", "slip_theta", "exponent", "level", "reference_y", "reference_theta"];
        let fail = |quantity, value, expected| {
            Err(Error::Quantity { element: "slip", row, quantity, value, expected })
        };
        for (&quantity, &value) in NAMES.iter().zip(&values[1..]) {
            if !(value.is_finite() && value >= 0.0) {
                return fail(quantity, value, "zero or a positive finite number");
            }
        }
        let exponent = values[3];
        if !(exponent > 0.0 && exponent <= GREATEST_EXPONENT) {
            return fail("exponent", exponent, "more than 0 and at most 4");
        }
        let loss = loss_ratio(exponent);
        let ratio = [Complex64::new(1.0, -loss[0]), Complex64::new(0.0, -loss[1])];
        let reference = [values[5], values[6]];
        let found =
            Self { joint, slip: [values[1], values[2]], exponent, level: values[4], reference, ratio };
        let shares = found.shares([found.level; 2]);
        if shares.iter().any(|share| *share > largest_share(exponent)) {
            return fail("level", found.level, "a level at which some of the interface sticks");
        }
        let [k_y, k_theta, both] = k;
        if both * both > k_y * (1.0 - shares[0]) * k_theta * (1.0 - shares[1]) * (1.0 + 1e-12) {
            return fail(
                "level",
                found.level,
                "a level that leaves the joint's stiffness positive semidefinite",
            );
        }
        Ok(found)
    }

    /// The same without loss.
    pub fn lossless(self) -> Self {
        Self { ratio: [Complex64::ONE, Complex64::ZERO], ..self }
    }

    /// Shares of the stiffness that are lost.
    pub fn shares(&self, level: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| self.slip[i] * level[i].powf(self.exponent))
    }

    /// Shares with their loss, by which a unit of k is reduced.
    pub fn lost(&self, level: [f64; 2]) -> [Complex64; 2] {
        self.shares(level).map(|share| self.ratio[0] * share)
    }

    /// Change of the stiffness k_y and k_theta by slip.
    pub fn added(&self, k: [f64; 3], level: [f64; 2]) -> [Complex64; 2] {
        let lost = self.lost(level);
        [-lost[0] * k[0], -lost[1] * k[1]]
    }

    /// Derivative of this change by the level; at the level 0 that from above.
    pub fn by_level(&self, k: [f64; 3], level: [f64; 2]) -> [Complex64; 2] {
        [0, 1].map(|i| {
            if self.slip[i] == 0.0 {
                return Complex64::ZERO;
            }
            -self.ratio[0] * (k[i] * self.slip[i] * self.exponent * level[i].powf(self.exponent - 1.0))
        })
    }

    /// Derivative of this change by a column of the table, at given levels.
    pub fn by_column(&self, k: [f64; 3], level: [f64; 2], column: usize) -> [Complex64; 2] {
        let mut out = [Complex64::ZERO; 2];
        match column {
            1 | 2 => {
                let i = column - 1;
                out[i] = -self.ratio[0] * (k[i] * level[i].powf(self.exponent));
            }
            3 => {
                let shares = self.shares(level);
                for i in 0..2 {
                    let logarithm = if level[i] > 0.0 { level[i].ln() } else { 0.0 };
                    out[i] = -(self.ratio[0] * logarithm + self.ratio[1]) * (k[i] * shares[i]);
                }
            }
            4 => out = self.by_level(k, level),
            _ => {}
        }
        out
    }

    /// Whether the stated level is zero, where a smaller exponent than 1 leaves no derivative by it.
    pub fn has_no_slope(&self) -> bool {
        self.level == 0.0 && self.exponent < 1.0 && self.slip != [0.0; 2]
    }

    /// The largest share that may be lost: beyond it the whole interface slides.
    pub fn largest_share(&self) -> f64 {
        largest_share(self.exponent)
    }
}

/// The share of the stiffness that is lost when the last of the interface begins to slide.
///
/// There the slope of the backbone is zero at the amplitude: c (1 + p) a^p = 1.
fn largest_share(p: f64) -> f64 {
    8.0 / core::f64::consts::PI * sine_integral(p) / (2.0 + p)
}

/// beta and its derivative by p.
fn loss_ratio(p: f64) -> [f64; 2] {
    let beta = p / (2.0 * (1.0 + p) * sine_integral(p));
    [beta, beta * (1.0 / p - 1.0 / (1.0 + p) - (digamma(p + 1.5) - digamma(p + 2.0)))]
}

/// I_p = sqrt(pi) / 2 Gamma(p + 3/2) / Gamma(p + 2).
fn sine_integral(p: f64) -> f64 {
    let (a, b) = (p + 1.5, p + 2.0);
    let steps = (ASYMPTOTIC - p).max(0.0).ceil();
    let mut ratio = 1.0;
    let mut k = 0.0;
    while k < steps {
        ratio *= (b + k) / (a + k);
        k += 1.0;
    }
    0.5 * core::f64::consts::PI.sqrt() * ratio * (stirling(a + steps) - stirling(b + steps)).exp()
}

/// ln Gamma(x) for large x.
fn stirling(x: f64) -> f64 {
    let square = 1.0 / (x * x);
    let series = 1.0 / 12.0
        - square * (1.0 / 360.0 - square * (1.0 / 1260.0 - square * (1.0 / 1680.0 - square / 1188.0)));
    (x - 0.5) * x.ln() - x + 0.5 * core::f64::consts::TAU.ln() + series / x
}

/// The logarithmic derivative of the Gamma function.
fn digamma(mut x: f64) -> f64 {
    let mut sum = 0.0;
    while x < ASYMPTOTIC {
        sum -= 1.0 / x;
        x += 1.0;
    }
    let square = 1.0 / (x * x);
    let series = 1.0 / 12.0
        - square * (1.0 / 120.0 - square * (1.0 / 252.0 - square * (1.0 / 240.0 - square / 132.0)));
    sum + x.ln() - 0.5 / x - square * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_known_exponents() {
        // I_1 = 3 pi / 16 and I_2 = 5 pi / 32.
        let pi = core::f64::consts::PI;
        assert!((sine_integral(1.0) - 3.0 * pi / 16.0).abs() < 1e-15);
        assert!((sine_integral(2.0) - 5.0 * pi / 32.0).abs() < 1e-15);
        assert!((loss_ratio(1.0)[0] - 4.0 / (3.0 * pi)).abs() < 1e-15);
        assert!((largest_share(1.0) - 0.5).abs() < 1e-15);
        for p in [0.1, 0.7, 1.0, 2.3, 4.0] {
            let step = 1e-5;
            let slope = (loss_ratio(p + step)[0] - loss_ratio(p - step)[0]) / (2.0 * step);
            assert!((loss_ratio(p)[1] - slope).abs() < 1e-9 * slope.abs().max(1.0), "{p}");
        }
    }
}
