//! Frequency lines as they were given, and checks of all of them together.

use crate::error::{Error, Result};
use crate::simd::lane::{C, MAX_LANES};
use core::ops::Range;
use num_complex::Complex64;
use pulp::Simd;

/// Lines that one task takes: a multiple of every block width, so that the blocks, and with them every
/// bit of the result, do not depend on the number of threads.
pub(crate) const LINES_PER_TASK: usize = 32 * MAX_LANES;

/// Frequency lines: numbers that, times a scale, are angular frequencies in rad/s.
///
/// They stay as they were given, in Hz say, and only the lines of one task are angular frequencies at a time: a
/// copy of all of them would be written by one thread.
#[derive(Copy, Clone, Debug)]
pub struct Frequencies<'a> {
    given: Given<'a>,
    scale: f64,
}

#[derive(Copy, Clone, Debug)]
enum Given<'a> {
    Real(&'a [f64]),
    Complex(&'a [Complex64]),
}

/// Frequency lines that are kept: as they were given, and the scale to rad/s.
#[derive(Clone, Debug)]
pub struct OwnedFrequencies {
    given: Owned,
    scale: f64,
}

#[derive(Clone, Debug)]
enum Owned {
    Real(Vec<f64>),
    Complex(Vec<Complex64>),
}

impl OwnedFrequencies {
    /// The lines.
    pub fn view(&self) -> Frequencies<'_> {
        match &self.given {
            Owned::Real(lines) => Frequencies::real(lines, self.scale),
            Owned::Complex(lines) => Frequencies::complex(lines, self.scale),
        }
    }
}

/// Room for the angular frequencies of one task.
pub(crate) const EMPTY: [Complex64; LINES_PER_TASK] = [Complex64::ZERO; LINES_PER_TASK];

/// Lines that are looked at together.
const LANES: usize = 16;

impl<'a> Frequencies<'a> {
    /// Real lines.
    pub fn real(lines: &'a [f64], scale: f64) -> Self {
        Self { given: Given::Real(lines), scale }
    }

    /// Complex lines, as an exponential window makes them.
    pub fn complex(lines: &'a [Complex64], scale: f64) -> Self {
        Self { given: Given::Complex(lines), scale }
    }

    /// Number of lines.
    pub fn len(&self) -> usize {
        match self.given {
            Given::Real(lines) => lines.len(),
            Given::Complex(lines) => lines.len(),
        }
    }

    /// Whether there are no lines.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A copy of every so many of the lines.
    pub fn every(&self, stride: usize) -> OwnedFrequencies {
        let given = match self.given {
            Given::Real(lines) => Owned::Real(every(lines, stride)),
            Given::Complex(lines) => Owned::Complex(every(lines, stride)),
        };
        OwnedFrequencies { given, scale: self.scale }
    }

    /// One angular frequency.
    pub(crate) fn angular(&self, line: usize) -> Complex64 {
        match self.given {
            Given::Real(lines) => (lines[line] * self.scale).into(),
            Given::Complex(lines) => scaled(lines[line], self.scale),
        }
    }

    /// All angular frequencies, one after the other.
    pub fn iter(&self) -> impl Iterator<Item = Complex64> + '_ {
        (0..self.len()).map(|line| self.angular(line))
    }

    /// Whether they were given as real numbers.
    pub(crate) fn given_real(&self) -> bool {
        matches!(self.given, Given::Real(_))
    }

    /// Whether no angular frequency has an imaginary part.
    pub(crate) fn are_real(&self) -> bool {
        match self.given {
            Given::Real(_) => true,
            Given::Complex(lines) => lines.iter().all(|line| line.im == 0.0),
        }
    }

    /// The angular frequencies of a range of lines.
    #[inline(always)]
    pub(crate) fn some<'b>(&self, range: Range<usize>, room: &'b mut [Complex64]) -> &'b [Complex64] {
        let out = &mut room[..range.len()];
        match self.given {
            Given::Real(lines) => {
                for (out, &line) in out.iter_mut().zip(&lines[range]) {
                    *out = (line * self.scale).into();
                }
            }
            Given::Complex(lines) => {
                for (out, &line) in out.iter_mut().zip(&lines[range]) {
                    *out = scaled(line, self.scale);
                }
            }
        }
        out
    }

    /// The largest modulus of an angular frequency, once all are known to have a positive real part.
    ///
    /// # Errors
    /// The first line that is not finite or has no positive real part.
    pub(crate) fn highest(&self) -> Result<f64> {
        let (most, usable) = match self.given {
            Given::Real(lines) => {
                let (most, usable) = summary(lines, |line| (line * self.scale, line * self.scale > 0.0));
                (most * most, usable)
            }
            Given::Complex(lines) => summary(lines, |line| {
                let w = scaled(line, self.scale);
                (w.norm_sqr(), w.re > 0.0 && w.re.is_finite() && w.im.is_finite())
            }),
        };
        if !(usable && most.is_finite()) {
            self.find_unusable()?;
        }
        Ok(most.sqrt())
    }

    /// Checks line by line.
    fn find_unusable(&self) -> Result<()> {
        let usable = |w: &Complex64| w.re.is_finite() && w.im.is_finite() && w.re > 0.0;
        match self.iter().enumerate().find(|(_, w)| !usable(w)) {
            Some((line, Complex64 { re, im })) => {
                let expected = "a finite value with a positive real part";
                Err(Error::Frequency { line, re, im, expected })
            }
            None => Ok(()),
        }
    }

    /// The ranges of the lines of each task.
    pub(crate) fn tasks(&self) -> Vec<Range<usize>> {
        let count = self.len();
        (0..count).step_by(LINES_PER_TASK).map(|start| start..count.min(start + LINES_PER_TASK)).collect()
    }

    /// The angular frequencies of a block of lines, as `C::load` does.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S, lines: Range<usize>) -> C<S> {
        if let Given::Real(given) = self.given
            && lines.len() == S::F64_LANES
        {
            let w = simd.mul_f64s(S::as_simd_f64s(&given[lines]).0[0], simd.splat_f64s(self.scale));
            return C { simd, re: w, im: simd.splat_f64s(0.0) };
        }
        let mut room = [Complex64::ZERO; MAX_LANES];
        C::load(simd, self.some(lines, &mut room))
    }
}

/// A complex line in rad/s; an imaginary part of minus zero is zero.
fn scaled(line: Complex64, scale: f64) -> Complex64 {
    Complex64::new(line.re * scale, line.im * scale + 0.0)
}

/// The largest of the sizes, and whether all lines are usable.
///
/// Several at a time: one maximum after the other would be a chain that no processor can overlap.
fn summary<T: Copy>(lines: &[T], look: impl Fn(T) -> (f64, bool)) -> (f64, bool) {
    let mut most = [0.0_f64; LANES];
    let mut usable = [true; LANES];
    let blocks = lines.chunks_exact(LANES);
    for (lane, &line) in blocks.remainder().iter().enumerate() {
        let (size, good) = look(line);
        most[lane] = most[lane].max(size);
        usable[lane] &= good;
    }
    for block in blocks {
        for lane in 0..LANES {
            let (size, good) = look(block[lane]);
            most[lane] = if size > most[lane] { size } else { most[lane] };
            usable[lane] &= good;
        }
    }
    (most.into_iter().fold(0.0, f64::max), usable.into_iter().all(|good| good))
}

/// Every so many of some values.
pub(crate) fn every<T: Copy>(values: &[T], stride: usize) -> Vec<T> {
    values.iter().step_by(stride).copied().collect()
}
