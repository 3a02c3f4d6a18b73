//! What was measured of models, and the lines and modes of a model that it is compared with.
//!
//! A measured receptance is H(w - i sigma) F with factors F = exp(g - i w tau) (1 + sigma / (i w))^q of the measurement:
//! a gain, a delay, an exponential window on what was recorded.

use crate::error::{Result, if_any};
use crate::line::response::Job;
use crate::model::frequencies::{Frequencies, LINES_PER_TASK};
use crate::model::request::{Coordinate, Parameter, Request, check};
use crate::modes::natural::expected_frequencies;
use crate::observe::ties::{At, Factor, Tied};
use crate::threads::on_threads;
use core::ops::Range;
use num_complex::Complex64;
use pulp::Arch;
use std::sync::Arc;

/// One record of a receptance.
#[derive(Clone, Debug)]
pub struct Record {
    /// Values.
    pub measured: Vec<Complex64>,
    /// One over the standard deviations of the logarithm.
    pub weights: Vec<f64>,
}

/// Some lines of a record.
#[derive(Copy, Clone)]
pub(crate) struct RecordLines<'a> {
    pub measured: &'a [Complex64],
    pub weights: &'a [f64],
}

/// The residual of a receptance on a line.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The weighted complex logarithm of measured over calculated receptance.
    Logarithm,
    /// By how many percent the calculated magnitude is larger than the measured one, weighted.
    Percent,
}

/// What was measured of a model.
#[derive(Clone, Debug)]
pub enum Seen {
    /// A receptance on lines w in rad/s, measured once or several times.
    Receptance {
        /// How calculated and measured values are compared.
        measure: Measure,
        /// Lines.
        w: Vec<Complex64>,
        /// What was measured on them.
        records: Vec<Record>,
        /// Where motion was seen.
        response: Coordinate,
        /// Where the load acted.
        excitation: Coordinate,
        /// Tables of terminals on these lines, as in a request.
        beyond: Vec<Complex64>,
    },
    /// Natural frequencies in rad/s.
    Frequencies {
        /// Which modes these are, counted from 0 on, ascending.
        modes: Vec<usize>,
        /// Values.
        measured: Vec<f64>,
        /// One over their standard deviations.
        weights: Vec<f64>,
    },
}

impl Seen {
    /// Lines, or what takes about as long.
    pub(crate) fn lines(&self) -> usize {
        match self {
            Self::Receptance { w, .. } => w.len(),
            Self::Frequencies { modes, .. } => 100 * modes.len(),
        }
    }
}

/// A model and what was measured of it.
#[derive(Clone, Debug)]
pub struct Modelled {
    /// The model as a function of the unknowns.
    pub tied: Arc<Tied>,
    /// What was measured.
    pub seen: Seen,
}

/// The lines of one task: calculated receptance with its factors, its derivatives by moving entries and then factors
/// row by row, and what was measured.
pub(crate) struct Lines<'a> {
    pub range: Range<usize>,
    pub h: &'a [Complex64],
    pub dh: &'a [Complex64],
    pub records: &'a [RecordLines<'a>],
}

impl Modelled {
    /// What some work makes of the lines of each task, in their order; nothing where the model has no value.
    pub(crate) fn lines<T: Send>(
        &self,
        at: &At,
        threads: usize,
        work: impl Fn(Lines) -> T + Sync,
    ) -> Result<Option<Vec<T>>> {
        let Seen::Receptance { w, records, response, excitation, beyond, .. } = &self.seen else {
            return Ok(None);
        };
        let factors = Factors::new(at);
        if factors.decay != 0.0 && !beyond.is_empty() {
            // A table belongs to the window under which it was measured.
            return Ok(None);
        }
        let request = Request {
            excitations: vec![*excitation],
            responses: vec![*response],
            parameters: factors.entries.clone(),
            beyond: beyond.clone(),
            ..Request::default()
        };
        let shifted: Vec<Complex64> = w.iter().map(|w| w - Complex64::I * factors.decay).collect();
        let Some(highest) = if_any(check(&at.model, &Frequencies::complex(&shifted, 1.0), &request))? else {
            return Ok(None);
        };
        // A free resonance without damping can make the one denominator of a branch zero to the last bit.
        for whole in [true, false] {
            let whole = whole.then_some((highest, w.len()));
            let (model, lines) = (&at.model, (w.as_slice(), shifted.as_slice()));
            let parts = match model.motion.degrees() {
                1 => parts(&Job::<1>::new(model, &request, whole), lines, records, &factors, threads, &work),
                _ => parts(&Job::<2>::new(model, &request, whole), lines, records, &factors, threads, &work),
            }?;
            if parts.is_some() {
                return Ok(parts);
            }
        }
        Ok(None)
    }

    /// Weighted derivatives by the entries and weighted residual of each measured mode.
    pub(crate) fn frequencies(&self, at: &At) -> Result<Option<Vec<Vec<f64>>>> {
        let Seen::Frequencies { modes, measured, weights } = &self.seen else { return Ok(None) };
        let Some(found) = if_any(expected_frequencies(&at.model, modes, measured, &at.entries))? else {
            return Ok(None);
        };
        let count = at.entries.len();
        let row = |(mode, (measured, weight)): (usize, (&f64, &f64))| {
            let slopes = found.derivative[mode * count..(mode + 1) * count].iter();
            let residual = (found.angular[mode] - measured) * weight;
            slopes.map(|slope| slope * weight).chain([residual]).collect()
        };
        Ok(Some(measured.iter().zip(weights).enumerate().map(row).collect()))
    }
}

/// What some work makes of the lines (as stated, and as evaluated) of each task.
fn parts<const D: usize, T: Send>(
    job: &Job<D>,
    (w, shifted): (&[Complex64], &[Complex64]),
    records: &[Record],
    factors: &Factors,
    threads: usize,
    work: &(impl Fn(Lines) -> T + Sync),
) -> Result<Option<Vec<T>>> {
    let arch = Arch::new();
    let tasks: Vec<usize> = (0..w.len()).step_by(LINES_PER_TASK).collect();
    let parts = on_threads(threads, tasks, job.a_task_takes(), |start| {
        let range = start..w.len().min(start + LINES_PER_TASK);
        let mut h = vec![Complex64::ZERO; range.len()];
        let mut dh = vec![Complex64::ZERO; range.len() * factors.entries.len()];
        let by_line = job.by_line(&range, w.len());
        if job.lines(&arch, &shifted[range.clone()], by_line, &mut h, &mut dh, &mut []).is_some() {
            return None;
        }
        let dh = factors.apply(&w[range.clone()], &mut h, dh);
        let own: Vec<RecordLines> = records
            .iter()
            .map(|one| RecordLines {
                measured: &one.measured[range.clone()],
                weights: &one.weights[range.clone()],
            })
            .collect();
        Some(work(Lines { range, h: &h, dh: &dh, records: &own }))
    })?;
    Ok(parts.into_iter().collect())
}

/// What becomes of a receptance on the way to the record.
struct Factors<'a> {
    at: &'a At,
    /// Sum of the decay rates.
    decay: f64,
    /// The entries by which derivatives are wanted: those that move, then others through which frequency acts.
    entries: Vec<Parameter>,
    /// Places among these, and weights, which make w dH/dw.
    by_frequency: Vec<(usize, f64)>,
}

impl<'a> Factors<'a> {
    fn new(at: &'a At) -> Self {
        let rates = at.factors.iter().filter(|(factor, _)| matches!(factor, Factor::DecayRate(_)));
        let mut entries = at.entries.clone();
        let mut by_frequency = Vec::new();
        if rates.clone().next().is_some() {
            for (entry, weight) in &at.by_frequency {
                let known = entries.iter().position(|other| other == entry);
                let place = known.unwrap_or_else(|| {
                    entries.push(*entry);
                    entries.len() - 1
                });
                by_frequency.push((place, *weight));
            }
        }
        Self { at, decay: rates.map(|(_, rate)| rate).sum(), entries, by_frequency }
    }

    /// Puts the factors on receptance and derivatives, which are then those by moving entries and by factors.
    fn apply(&self, w: &[Complex64], h: &mut [Complex64], dh: Vec<Complex64>) -> Vec<Complex64> {
        if self.at.factors.is_empty() {
            return dh;
        }
        let (asked, own) = (self.entries.len(), self.at.entries.len());
        let mut whole = Vec::with_capacity(h.len() * (own + self.at.factors.len()));
        for (line, (h, &w)) in h.iter_mut().zip(w).enumerate() {
            let row = &dh[line * asked..(line + 1) * asked];
            let factor: Complex64 = self.at.factors.iter().map(|(kind, value)| kind.at(w, *value)).product();
            let change: Complex64 =
                self.by_frequency.iter().map(|&(place, weight)| row[place] * weight).sum();
            let change = change / *h;
            *h *= factor;
            whole.extend(row[..own].iter().map(|slope| slope * factor));
            whole.extend(self.at.factors.iter().map(|(kind, value)| kind.slope(w, *value, change) * *h));
        }
        whole
    }
}

impl Factor {
    /// What the receptance is multiplied by, besides being taken on other lines.
    fn at(self, w: Complex64, value: f64) -> Complex64 {
        match self {
            Self::LogGain => Complex64::new(value.exp(), 0.0),
            Self::Delay => Complex64::from_polar(1.0, -w.re * value),
            Self::DecayRate(power) => (1.0 + value / (Complex64::I * w)).powi(power),
        }
    }

    /// Derivative of the logarithm of the receptance; `change` is that by the logarithm of the frequency.
    fn slope(self, w: Complex64, value: f64, change: Complex64) -> Complex64 {
        match self {
            Self::LogGain => Complex64::ONE,
            Self::Delay => Complex64::new(0.0, -w.re),
            Self::DecayRate(power) => (change + f64::from(power)) / (Complex64::I * w + value),
        }
    }
}
