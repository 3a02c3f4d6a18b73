//! Many candidates of any parameters of a model: receptances, magnitudes or misfits of each, threads over candidates.

use crate::error::{Error, Result, one_a_line, same_length};
use crate::joint::sweep::{Misfit, Sweep};
use crate::line::response::linear;
use crate::model::frequencies::Frequencies;
use crate::model::request::{Coordinate, Request};
use crate::observe::ties::Tied;
use crate::simd::lane::{C, MAX_LANES};
use crate::threads::on_threads;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Least time of a candidate, besides its lines [ns].
const A_MODEL: f64 = 10e3;

/// Least time of a candidate on a line [ns].
const A_LINE: f64 = 5.0;

/// A model as a function of some parameters, observed on some lines.
pub struct ModelSweep<'a> {
    tied: &'a Tied,
    frequencies: Frequencies<'a>,
    request: Request,
}

impl<'a> ModelSweep<'a> {
    /// A tied model between two coordinates on some lines; `beyond` as in a request.
    pub fn new(
        tied: &'a Tied,
        frequencies: Frequencies<'a>,
        response: Coordinate,
        excitation: Coordinate,
        beyond: Vec<Complex64>,
    ) -> Self {
        let request = Request {
            excitations: vec![excitation],
            responses: vec![response],
            beyond,
            ..Request::default()
        };
        Self { tied, frequencies, request }
    }
}

impl Sweep for ModelSweep<'_> {
    fn columns(&self) -> usize {
        self.tied.count()
    }

    fn lines(&self) -> usize {
        self.frequencies.len()
    }

    fn receptances(&self, candidates: &[f64], out: &mut [Complex64], threads: usize) -> Result<()> {
        self.each(candidates, out, self.frequencies.len(), threads, |found, out| {
            out.copy_from_slice(found);
        })
    }

    fn magnitudes(&self, candidates: &[f64], out: &mut [f64], threads: usize) -> Result<()> {
        self.each(candidates, out, self.frequencies.len(), threads, |found, out| {
            for (out, value) in out.iter_mut().zip(found) {
                *out = value.norm();
            }
        })
    }

    fn misfits(
        &self,
        candidates: &[f64],
        measured: &[Complex64],
        weights: &[f64],
        misfit: Misfit,
        threads: usize,
    ) -> Result<Vec<f64>> {
        one_a_line(measured.len(), weights.len(), self.frequencies.len())?;
        let mut out = vec![0.0; self.rows(candidates)?];
        let arch = Arch::new();
        self.each(candidates, &mut out, 1, threads, |found, out| {
            out[0] = arch.dispatch(Sum { found, measured, weights, misfit });
        })?;
        Ok(out)
    }
}

impl ModelSweep<'_> {
    /// Number of candidates.
    fn rows(&self, candidates: &[f64]) -> Result<usize> {
        let count = self.columns();
        if count == 0 || !candidates.len().is_multiple_of(count) {
            let (what, value) = ("candidates", candidates.len() as f64);
            return Err(Error::Index { what, index: 0, value, expected: format!("rows of {count}") });
        }
        Ok(candidates.len() / count)
    }

    /// Works on the receptance of each candidate and its part of the output.
    fn each<T: Number>(
        &self,
        candidates: &[f64],
        out: &mut [T],
        a_row: usize,
        threads: usize,
        work: impl Fn(&[Complex64], &mut [T]) + Sync,
    ) -> Result<()> {
        same_length("output", 0, out.len(), self.rows(candidates)? * a_row)?;
        if out.is_empty() {
            return Ok(());
        }
        let tasks = candidates.chunks(self.columns()).zip(out.chunks_mut(a_row)).collect();
        let at_least = A_MODEL + self.frequencies.len() as f64 * A_LINE;
        on_threads(threads, tasks, at_least, |(values, out)| match self.receptance(values) {
            Some(found) => work(&found, out),
            None => out.fill(T::NAN),
        })?;
        Ok(())
    }

    /// The receptance of a candidate; nothing where it is no model or has no finite value.
    fn receptance(&self, values: &[f64]) -> Option<Vec<Complex64>> {
        let model = self.tied.at(values, &vec![1.0; values.len()]).ok()?.model;
        Some(linear(&model, &self.frequencies, &self.request, 1).ok()?.receptance)
    }
}

/// A number that may be none.
trait Number: Copy + Send {
    const NAN: Self;
}

impl Number for f64 {
    const NAN: Self = f64::NAN;
}

impl Number for Complex64 {
    const NAN: Self = Self { re: f64::NAN, im: f64::NAN };
}

/// The sum of squares of one receptance.
struct Sum<'a> {
    found: &'a [Complex64],
    measured: &'a [Complex64],
    weights: &'a [f64],
    misfit: Misfit,
}

impl WithSimd for Sum<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { found, measured, weights, misfit } = self;
        let mut sum = simd.splat_f64s(0.0);
        for start in (0..found.len()).step_by(S::F64_LANES) {
            let end = found.len().min(start + S::F64_LANES);
            let (h, m) = (C::load(simd, &found[start..end]), C::load(simd, &measured[start..end]));
            let square = match misfit {
                Misfit::Logarithm => m.ln_over(h).norm_sqr().v,
                Misfit::Difference => (m - h).norm_sqr().v,
            };
            let mut room = [0.0; MAX_LANES];
            room[..end - start].copy_from_slice(&weights[start..end]);
            let weight = simd.partial_load_f64s(&room[..S::F64_LANES]);
            sum = simd.mul_add_e_f64s(square, simd.mul_f64s(weight, weight), sum);
        }
        simd.reduce_sum_f64s(sum)
    }
}
