//! Substructures that are known by their receptance at one plane: sums of modes, constants, and tables.
//!
//! With s = i w, phi = (y, theta) and chi = (y_imaginary, theta_imaginary) a mode adds
//!     (phi phi^T - chi chi^T + (phi chi^T + chi phi^T) (s + zeta w_r) / w_d) / (w_r^2 + 2 zeta w_r s + s^2)
//! to the receptance over (y, theta), w_d = w_r sqrt(1 - zeta^2): a pair of complex conjugate poles. Without chi, where
//! damping does not couple the modes, that is phi phi^T / (w_r^2 - w^2 + 2 i zeta w_r w).

use crate::error::{Error, Result};
use crate::model::frequencies::Frequencies;
use crate::simd::lane::{C, MAX_LANES};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Columns of the terminal table: node, then the constant parts of y over force, theta over moment, y over moment.
pub const TERMINAL_COLUMNS: usize = 4;

/// Columns of the table of modes: row of the terminal, then the six numbers of a mode.
pub const MODE_COLUMNS: usize = 7;

/// Entries of a terminal's receptance: y over force, theta over moment, y over moment.
pub const TERMINAL_ENTRIES: usize = 3;

/// Least 1 - zeta^2: the shape of a mode that does not oscillate is real.
const LEAST_ROOM: f64 = 1e-12;

/// A substructure that continues the assembly at a node.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Terminal {
    /// The node.
    pub node: usize,
    /// Constant part of each entry of its receptance.
    pub residual: [f64; TERMINAL_ENTRIES],
}

/// A mode of a terminal: angular natural frequency, damping ratio, phi and chi.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency in rad/s; zero for a rigid-body mode.
    pub angular: f64,
    /// Share of critical damping.
    pub damping_ratio: f64,
    /// Mass-normalised shape (y, theta) at the plane.
    pub shape: [f64; 2],
    /// Its part that lags by 90 degrees.
    pub lagging: [f64; 2],
}

impl Mode {
    /// Reads and checks the six numbers of a mode.
    ///
    /// # Errors
    /// A number that is not finite, a negative frequency or damping ratio, or a complex shape of a mode that does not
    /// oscillate.
    pub fn new(values: &[f64], row: usize) -> Result<Self> {
        const NAMES: [&str; MODE_COLUMNS - 1] =
            ["frequency", "damping_ratio", "y", "theta", "y_imaginary", "theta_imaginary"];
        let fail = |quantity, value, expected| {
            Err(Error::Quantity { element: "mode", row, quantity, value, expected })
        };
        for (index, (&quantity, &value)) in NAMES.iter().zip(values).enumerate() {
            if !value.is_finite() {
                return fail(quantity, value, "a finite number");
            }
            if index < 2 && value < 0.0 {
                return fail(quantity, value, "zero or a positive finite number");
            }
        }
        let [angular, damping_ratio, y, theta, y_imaginary, theta_imaginary] =
            core::array::from_fn(|i| values[i]);
        let lagging = [y_imaginary, theta_imaginary];
        if lagging != [0.0; 2] && (angular == 0.0 || damping_ratio >= 1.0) {
            return fail("damping_ratio", damping_ratio, "a real shape of a mode that does not oscillate");
        }
        Ok(Self { angular, damping_ratio, shape: [y, theta], lagging })
    }

    /// phi phi^T - chi chi^T and phi chi^T + chi phi^T.
    fn products(&self) -> [[f64; TERMINAL_ENTRIES]; 2] {
        let ([y, theta], [u, v]) = (self.shape, self.lagging);
        [
            [y * y - u * u, theta * theta - v * v, y * theta - u * v],
            [2.0 * y * u, 2.0 * theta * v, y * v + theta * u],
        ]
    }

    /// Derivatives of the products by a number of the shape.
    fn product_slopes(&self, column: usize) -> [[f64; TERMINAL_ENTRIES]; 2] {
        let ([y, theta], [u, v]) = (self.shape, self.lagging);
        match column {
            2 => [[2.0 * y, 0.0, theta], [2.0 * u, 0.0, v]],
            3 => [[0.0, 2.0 * theta, y], [0.0, 2.0 * v, u]],
            4 => [[-2.0 * u, 0.0, -v], [2.0 * y, 0.0, theta]],
            _ => [[0.0, -2.0 * v, -u], [0.0, 2.0 * theta, y]],
        }
    }

    /// w_d / w_r.
    fn room(&self) -> f64 {
        (1.0 - self.damping_ratio * self.damping_ratio).max(LEAST_ROOM).sqrt()
    }

    /// 1 / (w_r^2 + 2 zeta w_r s + s^2).
    #[inline(always)]
    fn inverse<S: Simd>(&self, iw: C<S>, w2: C<S>) -> C<S> {
        let square = C::real(iw.simd, self.angular * self.angular);
        (iw.scale(2.0 * self.damping_ratio * self.angular) + (square - w2)).recip()
    }

    /// (s + zeta w_r) / w_d; one where nothing oscillates, whose shape is real.
    #[inline(always)]
    fn lag<S: Simd>(&self, iw: C<S>) -> C<S> {
        if self.angular == 0.0 {
            return C::real(iw.simd, 1.0);
        }
        (iw.scale(1.0 / self.angular) + C::real(iw.simd, self.damping_ratio)).scale(1.0 / self.room())
    }

    /// straight + lag turned, over the denominator.
    #[inline(always)]
    fn over<S: Simd>(
        [straight, turned]: [[f64; TERMINAL_ENTRIES]; 2],
        lag: C<S>,
        inverse: C<S>,
    ) -> [C<S>; TERMINAL_ENTRIES] {
        let mut out = [inverse; TERMINAL_ENTRIES];
        for entry in 0..TERMINAL_ENTRIES {
            let above = lag.scale(turned[entry]) + C::real(lag.simd, straight[entry]);
            out[entry] = above * inverse;
        }
        out
    }

    /// Contribution of the mode to the entries of the receptance.
    #[inline(always)]
    pub fn entries<S: Simd>(&self, iw: C<S>, w2: C<S>) -> [C<S>; TERMINAL_ENTRIES] {
        Self::over(self.products(), self.lag(iw), self.inverse(iw, w2))
    }

    /// Derivatives of the entries by one of the six numbers.
    #[inline(always)]
    pub fn slopes<S: Simd>(&self, column: usize, iw: C<S>, w2: C<S>) -> [C<S>; TERMINAL_ENTRIES] {
        let (lag, inverse) = (self.lag(iw), self.inverse(iw, w2));
        if column >= 2 {
            return Self::over(self.product_slopes(column), lag, inverse);
        }
        let simd = iw.simd;
        let (zeta, own) = (self.damping_ratio, self.angular);
        let steeper =
            if column == 0 { iw.scale(2.0 * zeta) + C::real(simd, 2.0 * own) } else { iw.scale(2.0 * own) };
        let relative = -(steeper * inverse);
        let mut out = self.entries(iw, w2);
        for entry in &mut out {
            *entry = *entry * relative;
        }
        if self.lagging == [0.0; 2] {
            return out;
        }
        let room = self.room();
        let steeper = if column == 0 {
            iw.scale(-1.0 / (own * own * room))
        } else {
            let turned = (iw.scale(1.0 / own) + C::real(simd, zeta)).scale(zeta / room.powi(3));
            turned + C::real(simd, 1.0 / room)
        };
        let [_, turned] = self.products();
        for entry in 0..TERMINAL_ENTRIES {
            out[entry] = steeper.scale(turned[entry]).mul_add(inverse, out[entry]);
        }
        out
    }
}

/// The sum of modes on each line, `(n_freq, 3)`: y over force, theta over moment, y over moment.
///
/// # Errors
/// A line that is not a positive frequency, or that meets a mode without damping exactly.
pub fn modal_sum(modes: &[Mode], lines: &Frequencies) -> Result<Vec<Complex64>> {
    lines.highest()?;
    let mut out = vec![Complex64::ZERO; lines.len() * TERMINAL_ENTRIES];
    Arch::new().dispatch(Sum { modes, lines, out: &mut out });
    match out.iter().position(|value| !value.is_finite()) {
        Some(index) => {
            let line = index / TERMINAL_ENTRIES;
            let frequency_hz = lines.angular(line).re / core::f64::consts::TAU;
            Err(Error::Resonance { line, frequency_hz })
        }
        None => Ok(out),
    }
}

struct Sum<'a> {
    modes: &'a [Mode],
    lines: &'a Frequencies<'a>,
    out: &'a mut [Complex64],
}

impl WithSimd for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { modes, lines, out } = self;
        let step = S::F64_LANES;
        for (block, out) in out.chunks_mut(TERMINAL_ENTRIES * step).enumerate() {
            let start = block * step;
            let w = lines.load(simd, start..(start + step).min(lines.len()));
            let (iw, w2) = (w.times_i(), w * w);
            let mut sums = [C::zero(simd); TERMINAL_ENTRIES];
            for mode in modes {
                let more = mode.entries(iw, w2);
                for entry in 0..TERMINAL_ENTRIES {
                    sums[entry] = sums[entry] + more[entry];
                }
            }
            let mut lanes = [[Complex64::ZERO; MAX_LANES]; TERMINAL_ENTRIES];
            for entry in 0..TERMINAL_ENTRIES {
                sums[entry].store(&mut lanes[entry]);
            }
            for (lane, out) in out.chunks_mut(TERMINAL_ENTRIES).enumerate() {
                for entry in 0..TERMINAL_ENTRIES {
                    out[entry] = lanes[entry][lane];
                }
            }
        }
    }
}
