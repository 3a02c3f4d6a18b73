//! Measurements, and the lines and modes of a model that they are compared with.
//!
//! A measured receptance is H(w - i sigma) F with factors F = exp(g - i w tau) (1 + sigma / (i w))^q of the measurement:
//! a gain, a delay, an exponential window on the record. H of a truncated record is that of the
//! recorded part of the response, see `truncation`. Where the stated lines are too high by d, it is H(w - d), and the
//! q integrations of the record at w leave a factor ((w - d) / w)^q. Amplifiers change level and phase slowly with w.

use crate::error::{Error, Result};
use crate::line::amplitude::receptance;
use crate::line::response::{Job, first_of, with_branches};
use crate::model::frequencies::{Frequencies, LINES_PER_TASK};
use crate::model::request::{Coordinate, Parameter, Request, Response, check};
use crate::modes::natural::expected_frequencies;
use crate::modes::poles::complex_frequencies;
use crate::observe::ties::{At, Factor, Tied};
use crate::observe::truncation::{Recorded, Sums, Truncation};
use crate::threads::on_threads;
use core::f64::consts::TAU;
use core::ops::Range;
use num_complex::Complex64;
use pulp::Arch;
use std::sync::Arc;

/// Angular frequency at which an exponent of the level changes nothing [rad/s].
const LEVEL_AT: f64 = TAU * 1000.0;

/// Least time of one sample and response on one line of a truncated record [ns].
const A_TERM: f64 = 0.2;

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

/// Measurements of a model.
#[derive(Clone, Debug)]
pub enum Seen {
    /// A receptance on lines w in rad/s, measured once or several times.
    Receptance {
        /// How calculated and measured values are compared.
        measure: Measure,
        /// Lines.
        w: Vec<Complex64>,
        /// The measured values on them.
        records: Vec<Record>,
        /// Where motion was seen.
        response: Coordinate,
        /// Where the load acted.
        excitation: Coordinate,
        /// Tables of terminals on these lines, as in a request.
        beyond: Vec<Complex64>,
        /// Amplitude of the force in N on these lines, as in a request.
        force: Vec<f64>,
        /// The end of the record, where the structure still rang; without tables and forces.
        truncation: Option<Truncation>,
    },
    /// Natural frequencies in rad/s: undamped ones, or the moduli of complex ones where there are damping ratios.
    Frequencies {
        /// Which modes these are, counted from 0 on, ascending.
        modes: Vec<usize>,
        /// Values.
        measured: Vec<f64>,
        /// One over their standard deviations.
        weights: Vec<f64>,
        /// Damping ratios of some of the modes.
        damping: Vec<Damping>,
    },
}

/// A measured damping ratio.
#[derive(Copy, Clone, Debug)]
pub struct Damping {
    /// Place of the mode in the list of modes.
    pub place: usize,
    /// Value.
    pub ratio: f64,
    /// One over its standard deviation.
    pub weight: f64,
}

impl Seen {
    /// Lines, or other work of about the same duration.
    pub(crate) fn lines(&self) -> usize {
        match self {
            Self::Receptance { w, truncation, .. } => {
                w.len() + truncation.as_ref().map_or(0, |truncation| truncation.lines(0.0).len())
            }
            Self::Frequencies { modes, .. } => 100 * modes.len(),
        }
    }
}

/// A model and its measurements.
#[derive(Clone, Debug)]
pub struct Modelled {
    /// The model as a function of the unknowns.
    pub tied: Arc<Tied>,
    /// The measurements.
    pub seen: Seen,
}

/// The lines of one task: calculated receptance with its factors, its derivatives by moving entries and then factors
/// row by row, and the measured values.
pub(crate) struct Lines<'a> {
    pub range: Range<usize>,
    pub h: &'a [Complex64],
    pub dh: &'a [Complex64],
    pub records: &'a [RecordLines<'a>],
}

impl Modelled {
    /// Results of some work on the lines of each task, in their order.
    ///
    /// # Errors
    /// A model that has no value on the lines.
    pub(crate) fn lines<T: Send>(
        &self,
        at: &At,
        threads: usize,
        work: impl Fn(Lines) -> T + Sync,
    ) -> Result<Vec<T>> {
        let Seen::Receptance { w, records, response, excitation, beyond, force, truncation, .. } = &self.seen
        else {
            return Ok(Vec::new());
        };
        let chain = Chain::new(at);
        if chain.rate != 0.0 && !beyond.is_empty() {
            let (what, value) = ("decay rate", chain.rate);
            let expected = "zero: a table belongs to the window under which it was measured".to_owned();
            return Err(Error::Index { what, index: 0, value, expected });
        }
        if chain.offset != 0.0 && !(beyond.is_empty() && truncation.is_none() && force.is_empty()) {
            let (what, value) = ("frequency offset", chain.offset);
            let expected =
                "zero: with a table, an early end or a stepped sine lines have no offset".to_owned();
            return Err(Error::Index { what, index: 0, value, expected });
        }
        let request = Request {
            excitations: vec![*excitation],
            responses: vec![*response],
            parameters: chain.entries.clone(),
            beyond: beyond.clone(),
            force: force.clone(),
            ..Request::default()
        };
        let evaluated: Vec<Complex64> = match truncation {
            Some(truncation) => truncation.lines(chain.rate),
            None => w.iter().map(|w| w - chain.offset - Complex64::I * chain.rate).collect(),
        };
        let lines = Frequencies::complex(&evaluated, 1.0);
        if let Some(truncation) = truncation {
            let found = receptance(&at.model, &lines, &request, threads)?;
            let sums = chain.sums(truncation, &evaluated, &found);
            let arch = Arch::new();
            let at_least = (LINES_PER_TASK * found.derivative.len().max(evaluated.len())) as f64 * A_TERM;
            let tasks = Frequencies::complex(w, 1.0).tasks();
            return on_threads(threads, tasks, at_least, |range| {
                let rows = arch.dispatch(Recorded { sums: &sums, w: &w[range.clone()] });
                let (h, dh) = chain.truncated(&w[range.clone()], &rows, &sums);
                work(Lines { h: &h, dh: &dh, records: &some(records, &range), range })
            });
        }
        if !force.is_empty() && !at.model.slips.is_empty() {
            let found = receptance(&at.model, &lines, &request, threads)?;
            let wide = chain.entries.len();
            let each = lines.tasks().into_iter().map(|range| {
                let mut h = found.receptance[range.clone()].to_vec();
                let dh = found.derivative[range.start * wide..range.end * wide].to_vec();
                let dh = chain.apply(&w[range.clone()], &mut h, dh, |_, _| Changes::default());
                work(Lines { h: &h, dh: &dh, records: &some(records, &range), range })
            });
            return Ok(each.collect());
        }
        let highest = check(&at.model, &lines, &request)?;
        with_branches(highest, w.len(), |whole| {
            let (model, lines) = (&at.model, (w.as_slice(), evaluated.as_slice()));
            match model.motion.degrees() {
                1 => parts(&Job::<1>::new(model, &request, whole), lines, records, &chain, threads, &work),
                _ => parts(&Job::<2>::new(model, &request, whole), lines, records, &chain, threads, &work),
            }
        })
    }

    /// Weighted derivatives by the entries and weighted residual of each measured frequency and damping ratio.
    pub(crate) fn frequencies(&self, at: &At) -> Result<Vec<Vec<f64>>> {
        let Seen::Frequencies { modes, measured, weights, damping } = &self.seen else {
            return Ok(Vec::new());
        };
        let (own, count) = (&at.entries[..], at.entries.len());
        let entries = if damping.is_empty() { own } else { &[] };
        let found = expected_frequencies(&at.model, modes, measured, entries)?;
        let (mut frequencies, mut slopes) = (found.angular, found.derivative);
        let mut ratios: Vec<Vec<f64>> = Vec::new();
        if !damping.is_empty() {
            let found = complex_frequencies(&at.model, &frequencies, own)?;
            // With ln w = ln |w| + i arcsin(zeta), a relative change of w is that of |w| and the change of arcsin(zeta).
            frequencies = found.angular.iter().map(|w| w.norm()).collect();
            let relative = |i: usize| found.derivative[i] / found.angular[i / count];
            slopes = (0..found.derivative.len()).map(|i| relative(i).re * frequencies[i / count]).collect();
            ratios = damping
                .iter()
                .map(|&Damping { place, ratio, weight }| {
                    let unit = found.angular[place] / frequencies[place];
                    let slopes = (0..count).map(|k| relative(place * count + k).im * unit.re * weight);
                    slopes.chain([(unit.im - ratio) * weight]).collect()
                })
                .collect();
        }
        let row = |(mode, (measured, weight)): (usize, (&f64, &f64))| -> Vec<f64> {
            let slopes = slopes[mode * count..(mode + 1) * count].iter();
            let residual = (frequencies[mode] - measured) * weight;
            slopes.map(|slope| slope * weight).chain([residual]).collect()
        };
        Ok(measured.iter().zip(weights).enumerate().map(row).chain(ratios).collect())
    }
}

/// Some lines of records.
fn some<'a>(records: &'a [Record], range: &Range<usize>) -> Vec<RecordLines<'a>> {
    let part = |one: &'a Record| RecordLines {
        measured: &one.measured[range.clone()],
        weights: &one.weights[range.clone()],
    };
    records.iter().map(part).collect()
}

/// Results of some work on the lines (as stated, and as evaluated) of each task.
fn parts<const D: usize, T: Send>(
    job: &Job<D>,
    (w, evaluated): (&[Complex64], &[Complex64]),
    records: &[Record],
    chain: &Chain,
    threads: usize,
    work: &(impl Fn(Lines) -> T + Sync),
) -> Result<Vec<T>> {
    let arch = Arch::new();
    let lines = Frequencies::complex(evaluated, 1.0);
    let parts = on_threads(threads, lines.tasks(), job.a_task_takes(), |range| {
        let mut h = vec![Complex64::ZERO; range.len()];
        let mut dh = vec![Complex64::ZERO; range.len() * chain.entries.len()];
        let by_line = job.by_line(&range, w.len());
        if let Some(line) = job.lines(&arch, &evaluated[range.clone()], by_line, &mut h, &mut dh, &mut []) {
            return Err(line);
        }
        let own = &evaluated[range.clone()];
        let changes = |line: usize, dh: &[Complex64]| Changes {
            by_rate: chain.by_frequency(dh) / (Complex64::I * own[line]),
            ..Changes::default()
        };
        let dh = chain.apply(&w[range.clone()], &mut h, dh, changes);
        let own = some(records, &range);
        Ok(work(Lines { range, h: &h, dh: &dh, records: &own }))
    })?;
    let broken: Vec<Option<usize>> = parts.iter().map(|part| part.as_ref().err().copied()).collect();
    first_of(&broken, &lines)?;
    Ok(parts.into_iter().flatten().collect())
}

/// Changes of a receptance on the way to the record.
struct Chain<'a> {
    at: &'a At,
    /// Sum of the decay rates.
    rate: f64,
    /// By how many rad/s the stated lines are too high.
    offset: f64,
    /// The entries to differentiate by: those that move, then others through which frequency acts.
    entries: Vec<Parameter>,
    /// Places among these, and weights, which make w dH/dw; none without decay rates.
    frequency: Vec<(usize, f64)>,
}

/// Derivatives of a receptance, before its factors, by the rate of all windows, which is -i times that by the angular
/// frequency, and by the end of the record.
#[derive(Copy, Clone, Default)]
struct Changes {
    by_rate: Complex64,
    by_end: Complex64,
}

impl<'a> Chain<'a> {
    fn new(at: &'a At) -> Self {
        let sum = |of: fn(&Factor) -> bool| -> f64 {
            at.factors.iter().filter(|(factor, _)| of(factor)).map(|(_, value)| value).sum()
        };
        let mut entries = at.entries.clone();
        let mut frequency = Vec::new();
        if at.factors.iter().any(|(factor, _)| matches!(factor, Factor::DecayRate(_) | Factor::Offset(_))) {
            for (entry, weight) in at.model.frequency_weights() {
                let known = entries.iter().position(|other| *other == entry);
                let place = known.unwrap_or_else(|| {
                    entries.push(entry);
                    entries.len() - 1
                });
                frequency.push((place, weight));
            }
        }
        let rate = sum(|factor| matches!(factor, Factor::DecayRate(_)));
        let offset = TAU * sum(|factor| matches!(factor, Factor::Offset(_)));
        Self { at, rate, offset, entries, frequency }
    }

    /// w dH/dw from the derivatives by the entries.
    fn by_frequency(&self, dh: &[Complex64]) -> Complex64 {
        self.frequency.iter().map(|&(place, weight)| dh[place] * weight).sum()
    }

    /// Puts the factors on receptance and derivatives, which are then those by moving entries and by factors.
    fn apply(
        &self,
        w: &[Complex64],
        h: &mut [Complex64],
        dh: Vec<Complex64>,
        changes: impl Fn(usize, &[Complex64]) -> Changes,
    ) -> Vec<Complex64> {
        if self.at.factors.is_empty() {
            return dh;
        }
        let (asked, own) = (dh.len() / h.len(), self.at.entries.len());
        let mut whole = Vec::with_capacity(h.len() * (own + self.at.factors.len()));
        for (line, (h, &w)) in h.iter_mut().zip(w).enumerate() {
            let row = &dh[line * asked..(line + 1) * asked];
            let factor: Complex64 = self.at.factors.iter().map(|(kind, value)| kind.at(w, *value)).product();
            let Changes { by_rate, by_end } = changes(line, row);
            let relative = Changes { by_rate: by_rate / *h, by_end: by_end / *h };
            *h *= factor;
            whole.extend(row[..own].iter().map(|slope| slope * factor));
            whole.extend(self.at.factors.iter().map(|(kind, value)| kind.slope(w, *value, relative) * *h));
        }
        whole
    }

    /// The sums that make a truncated record of the receptance, of its derivatives by the moving entries and, where
    /// there are decay rates, of (2 H + w dH/dw) / (i w): the derivative of w^2 H by the rate, over w^2.
    fn sums<'b>(&self, truncation: &'b Truncation, lines: &[Complex64], found: &Response) -> Sums<'b> {
        let (own, asked) = (self.at.entries.len(), self.entries.len());
        let mut values = Vec::with_capacity(lines.len() * (2 + own));
        for (line, (h, w)) in found.receptance.iter().zip(lines).enumerate() {
            let dh = &found.derivative[line * asked..(line + 1) * asked];
            values.push(*h);
            values.extend_from_slice(&dh[..own]);
            if !self.frequency.is_empty() {
                values.push((2.0 * h + self.by_frequency(dh)) / (Complex64::I * w));
            }
        }
        let end = self.at.factors.iter().find(|(factor, _)| *factor == Factor::End);
        let end = end.map_or(truncation.end, |(_, end)| *end);
        truncation.sums(&values, values.len() / lines.len().max(1), end, self.rate)
    }

    /// Receptance and derivatives with the factors on some lines of a truncated record, from the rows that it has there.
    fn truncated(
        &self,
        w: &[Complex64],
        rows: &[Complex64],
        sums: &Sums,
    ) -> (Vec<Complex64>, Vec<Complex64>) {
        let wide = rows.len() / w.len().max(1);
        let own = self.at.entries.len();
        let mut h: Vec<Complex64> = rows.iter().step_by(wide).copied().collect();
        let dh = rows.chunks(wide).flat_map(|row| &row[1..=own]).copied().collect();
        let changes = |line: usize, _: &[Complex64]| {
            let row = &rows[line * wide..(line + 1) * wide];
            let more = row.get(1 + own).copied().unwrap_or_default();
            let by_rate = more - 2.0 * row[0] / (Complex64::I * w[line] + self.rate);
            Changes { by_rate, by_end: sums.by_end(w[line]) }
        };
        let dh = self.apply(w, &mut h, dh, changes);
        (h, dh)
    }
}

impl Factor {
    /// Factor of the receptance, besides the evaluation on other lines.
    fn at(self, w: Complex64, value: f64) -> Complex64 {
        match self {
            Self::LogGain => Complex64::new(value.exp(), 0.0),
            Self::Delay => Complex64::from_polar(1.0, -w.re * value),
            Self::DecayRate(power) => (1.0 + value / (Complex64::I * w)).powi(power),
            Self::End => Complex64::ONE,
            Self::Offset(power) => (1.0 - TAU * value / w).powi(power),
            Self::LevelExponent => Complex64::new((w.re / LEVEL_AT).powf(value), 0.0),
            Self::LevelSlope => Complex64::new((w.re * value).exp(), 0.0),
            Self::Phase => Complex64::from_polar(1.0, value),
            Self::LowPass => (1.0 + Complex64::I * w * value.abs()).powf(-value.signum()),
            Self::HighPass => (1.0 + value.abs() / (Complex64::I * w)).powf(-value.signum()),
        }
    }

    /// Derivative of the logarithm of the receptance; `relative` are those of the logarithm before the factors.
    fn slope(self, w: Complex64, value: f64, relative: Changes) -> Complex64 {
        match self {
            Self::LogGain => Complex64::ONE,
            Self::Delay => Complex64::new(0.0, -w.re),
            Self::DecayRate(power) => relative.by_rate + f64::from(power) / (Complex64::I * w + value),
            Self::End => relative.by_end,
            Self::Offset(power) => {
                TAU * (-Complex64::I * relative.by_rate - f64::from(power) / (w - TAU * value))
            }
            Self::LevelExponent => Complex64::new((w.re / LEVEL_AT).ln(), 0.0),
            Self::LevelSlope => Complex64::new(w.re, 0.0),
            Self::Phase => Complex64::I,
            Self::LowPass => -Complex64::I * w / (1.0 + Complex64::I * w * value.abs()),
            Self::HighPass => -1.0 / (Complex64::I * w + value.abs()),
        }
    }
}
