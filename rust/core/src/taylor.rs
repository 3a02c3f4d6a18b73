//! Taylor series in the length of linear equations between power series in (w / reference)^2.
//!
//! Powers lie side by side, real and imaginary parts apart, so that several are taken at a time.

use crate::minors::{MOST_TERMS, Terms};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Most orders of the Taylor series.
const MOST_ORDERS: u32 = 400;

/// Powers that are taken together whatever the instruction set; those beyond the last are zero.
const STEP: usize = 8;

/// Room for the powers, for one that is dropped at once, and for those beyond the last.
const ROOM: usize = MOST_TERMS + STEP;

/// One part of a function's powers.
pub type Row = [f64; ROOM];

/// Power series of several functions.
#[derive(Clone)]
pub struct Powers<const M: usize> {
    /// Real parts.
    pub re: [Row; M],
    /// Imaginary parts.
    pub im: [Row; M],
    /// Number of powers.
    length: usize,
}

/// A linear equation.
pub trait Equation<const M: usize> {
    /// Adds a share of the derivative of p to `same`, the part in the same power, and to `above`, that in the next.
    ///
    /// At one power: (re, im) of each function.
    fn derivative(&self, p: &[Complex64; M], share: f64) -> [[Complex64; M]; 2];
}

impl<const M: usize> Powers<M> {
    fn new(terms: &Terms<M>) -> Option<Self> {
        let mut out = Self::zeros(terms.len());
        if terms.len() > MOST_TERMS {
            return None;
        }
        for (k, term) in terms.iter().enumerate() {
            for i in 0..M {
                (out.re[i][k], out.im[i][k]) = (term[i].re, term[i].im);
            }
        }
        Some(out)
    }

    fn zeros(length: usize) -> Self {
        Self { re: [[0.0; ROOM]; M], im: [[0.0; ROOM]; M], length }
    }

    fn terms(&self) -> Terms<M> {
        (0..self.length).map(|k| core::array::from_fn(|i| self.at(i, k))).collect()
    }

    #[inline(always)]
    fn at(&self, i: usize, k: usize) -> Complex64 {
        Complex64::new(self.re[i][k], self.im[i][k])
    }

    /// Powers to go through: all, and zeros up to the next full step.
    #[inline(always)]
    fn reach(&self) -> usize {
        self.length.next_multiple_of(STEP).min(MOST_TERMS)
    }

    /// The largest coefficient of each function.
    #[inline(always)]
    fn sizes(&self) -> [f64; M] {
        let mut sizes = [0.0; M];
        for i in 0..M {
            let mut lanes = [0.0_f64; STEP];
            for from in (0..self.reach()).step_by(STEP) {
                for lane in 0..STEP {
                    let size = self.re[i][from + lane].abs() + self.im[i][from + lane].abs();
                    lanes[lane] = larger(size, lanes[lane]);
                }
            }
            sizes[i] = lanes.into_iter().fold(0.0, larger);
        }
        sizes
    }

    /// A share of the derivative.
    #[inline(always)]
    fn derivative(&self, equation: &impl Equation<M>, share: f64) -> Self {
        let mut out = Self::zeros((self.length + 1).min(MOST_TERMS));
        let mut above = Self::zeros(0);
        for k in 0..self.reach() {
            let [same, next] = equation.derivative(&core::array::from_fn(|i| self.at(i, k)), share);
            for i in 0..M {
                (out.re[i][k], out.im[i][k]) = (same[i].re, same[i].im);
                (above.re[i][k], above.im[i][k]) = (next[i].re, next[i].im);
            }
        }
        for i in 0..M {
            for k in 0..self.reach() {
                out.re[i][k + 1] += above.re[i][k];
                out.im[i][k + 1] += above.im[i][k];
            }
            // Powers beyond what any line can see are dropped at once, or their number would grow with the order.
            (out.re[i][MOST_TERMS], out.im[i][MOST_TERMS]) = (0.0, 0.0);
        }
        out
    }

    /// Adds; whether everything added is less than rounding.
    #[inline(always)]
    fn add(&mut self, other: &Self, sizes: &[f64; M]) -> bool {
        self.length = self.length.max(other.length);
        let mut settled = true;
        for i in 0..M {
            let least = 1e-4 * sizes[i];
            for k in 0..other.reach() {
                let added = other.re[i][k].abs() + other.im[i][k].abs();
                let size = self.re[i][k].abs() + self.im[i][k].abs();
                settled &= added <= 1e-18 * larger(size, least);
                self.re[i][k] += other.re[i][k];
                self.im[i][k] += other.im[i][k];
            }
        }
        settled
    }

    /// Drops the last powers that are below a share of the sizes.
    #[inline(always)]
    fn drop_below(&mut self, sizes: &[f64; M], share: f64) {
        while self.length > 1 {
            let last = self.length - 1;
            if !(0..M).all(|i| self.at(i, last).l1_norm() <= share * sizes[i]) {
                break;
            }
            for i in 0..M {
                (self.re[i][last], self.im[i][last]) = (0.0, 0.0);
            }
            self.length = last;
        }
    }
}

/// The larger of two; the second where one is not a number.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The solution at the length one from that at zero; nothing where it does not converge.
pub fn solution<const M: usize>(start: &Terms<M>, equation: &impl Equation<M>) -> Option<Terms<M>> {
    let start = Powers::new(start)?;
    Some(Arch::new().dispatch(Solve { start, equation })?.terms())
}

struct Solve<'a, E, const M: usize> {
    start: Powers<M>,
    equation: &'a E,
}

impl<E: Equation<M>, const M: usize> WithSimd for Solve<'_, E, M> {
    type Output = Option<Powers<M>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let mut sum = self.start.clone();
        let mut term = self.start;
        for order in 1..MOST_ORDERS {
            let sizes = sum.sizes();
            term = term.derivative(self.equation, 1.0 / f64::from(order));
            let settled = sum.add(&term, &sizes);
            // Some functions start at zero and wake up only after a few orders.
            if settled && order > 4 {
                return Some(sum);
            }
            term.drop_below(&sizes, 1e-22);
        }
        None
    }
}
