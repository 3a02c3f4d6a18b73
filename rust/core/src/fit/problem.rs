//! A least-squares problem: everything that was measured, as a function of the fitted variables.
//!
//! Observations are of whole models, of which any parameters may be unknown, of models that are reduced to one joint, or
//! residuals that the caller computes. The first two give the same numbers: the weighted complex logarithm of measured
//! over calculated receptance, or calculated less measured natural frequencies. Fits work on the normal matrix A^T A with
//! A = [J | r].

use crate::error::{Error, Result, if_any, one_a_line, same_length};
use crate::fit::least_squares::{End, Stop, minimise};
use crate::interrupt;
use crate::model::frequencies::every;
use crate::model::terminals::TERMINAL_ENTRIES;
use crate::observe::joint::OfJoint;
use crate::observe::lines::{Rows, spread};
use crate::observe::observed::{Damping, Measure, Modelled, Record, Seen};
use crate::threads::on_threads;
use core::fmt::Debug;
use num_complex::Complex64;
use std::sync::Arc;

/// Least time of one line of a whole model [ns].
const A_LINE: f64 = 300.0;

/// Lines of a reduced model that take as long as one of a whole model.
const REDUCED_LINES: usize = 15;

/// Least time of a fit [ns].
const A_FIT: f64 = 100e3;

/// The fitted variables.
#[derive(Clone, Debug, Default)]
pub struct Variables {
    /// Whether a variable is the base-ten logarithm of the value.
    pub logarithmic: Vec<bool>,
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds.
    pub upper: Vec<f64>,
}

/// A prior of a variable x, as a residual `scale` x - `offset`.
#[derive(Copy, Clone, Debug)]
pub struct Prior {
    /// The variable.
    pub variable: usize,
    /// One over its standard deviation.
    pub scale: f64,
    /// Its mean times that.
    pub offset: f64,
}

/// Residuals that the caller computes.
pub trait Residuals: Debug + Send + Sync {
    /// Residuals and their derivatives by all variables.
    ///
    /// # Errors
    /// `Error::NoValue` at a point that has none, and errors that end a fit.
    fn rows(&self, x: &[f64]) -> Result<Rows>;
}

/// A measurement, and the model that it is compared with.
#[derive(Clone, Debug)]
pub enum Observation {
    /// Of a whole model.
    Whole(Modelled),
    /// Of a model reduced to one joint.
    Joint(OfJoint),
    /// Residuals A (x - b) of the variables x.
    Linear {
        /// A, row by row.
        matrix: Vec<f64>,
        /// b.
        centre: Vec<f64>,
    },
    /// Computed by the caller.
    Given(Arc<dyn Residuals>),
}

/// End conditions of fits, and their kept results.
#[derive(Copy, Clone, Debug)]
pub struct Settings {
    /// See `Stop`.
    pub tolerance: f64,
    /// See `Stop`.
    pub least: f64,
    /// Whether the normal matrices of the ends have the rows and columns of variables that are held.
    pub of_all: bool,
}

/// Everything that is fitted.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    observed: Vec<Observation>,
    priors: Vec<Prior>,
    variables: Variables,
    /// Residuals well above this count by their absolute value, those below by their square.
    smoothing: Option<f64>,
}

/// The contribution of an observation to a normal matrix, over all variables and the residual.
enum Part {
    /// A^T A over some variables and the residual, its upper triangle row by row, and their places.
    Some(Vec<f64>, Vec<usize>),
    /// Rows of A.
    Rows(Rows),
}

impl Problem {
    /// A problem without observations.
    ///
    /// # Errors
    /// No variable, bounds that are not numbers or cross, a prior of a variable that does not exist, or a smoothing that is
    /// not positive.
    pub fn new(variables: Variables, priors: Vec<Prior>, smoothing: Option<f64>) -> Result<Self> {
        let count = variables.logarithmic.len();
        if count == 0 {
            return Err(wrong("number of variables", 0, 0.0, "at least one"));
        }
        for bounds in [&variables.lower, &variables.upper] {
            same_length("bounds of the variables", 0, bounds.len(), count)?;
        }
        for (index, (low, high)) in variables.lower.iter().zip(&variables.upper).enumerate() {
            if low.is_nan() || high.is_nan() || low > high {
                let expected = format!("a number that is at most the upper bound {high}");
                return Err(Error::Index { what: "lower bound", index, value: *low, expected });
            }
        }
        for (index, prior) in priors.iter().enumerate() {
            if prior.variable >= count {
                let (value, expected) = (prior.variable as f64, format!("a variable below {count}"));
                return Err(Error::Index { what: "prior", index, value, expected });
            }
        }
        if let Some(value) = smoothing.filter(|value| !(*value > 0.0 && value.is_finite())) {
            return Err(wrong("smoothing", 0, value, "a positive finite number"));
        }
        Ok(Self { observed: Vec::new(), priors, variables, smoothing })
    }

    /// Number of variables.
    pub fn count(&self) -> usize {
        self.variables.logarithmic.len()
    }

    /// Lines of all receptances, each record counted.
    pub fn lines(&self) -> usize {
        let lines = |one: &Observation| match one {
            Observation::Whole(Modelled { seen: Seen::Receptance { w, records, .. }, .. }) => {
                w.len() * records.len()
            }
            Observation::Joint(one) => one.record.measured.len(),
            Observation::Whole(_) | Observation::Linear { .. } | Observation::Given(_) => 0,
        };
        self.observed.iter().map(lines).sum()
    }

    /// Adds an observation.
    ///
    /// # Errors
    /// Arrays that are empty or of different lengths, a model with other unknowns, natural frequencies that are not
    /// positive finite numbers, a variable that does not exist, or a smoothing of complex logarithms.
    pub fn add(&mut self, one: Observation) -> Result<()> {
        let index = self.observed.len();
        if let Some(value) = self.smoothing.filter(|_| one.is_logarithmic()) {
            return Err(wrong("smoothing", index, value, "none, where residuals are complex logarithms"));
        }
        if let Observation::Whole(Modelled { tied, .. }) = &one {
            same_length("number of unknowns that the model is tied to", index, tied.count(), self.count())?;
        }
        match &one {
            Observation::Whole(Modelled {
                tied,
                seen: Seen::Receptance { w, records, beyond, force, truncation, .. },
            }) => {
                if truncation.is_some() && !(beyond.is_empty() && force.is_empty()) {
                    return Err(wrong(
                        "truncated record",
                        index,
                        1.0,
                        "one without tables of terminals and forces",
                    ));
                }
                if w.is_empty() || records.is_empty() {
                    return Err(wrong("number of lines or records", index, 0.0, "at least one"));
                }
                if !beyond.is_empty() {
                    let expected = tied.terminals() * TERMINAL_ENTRIES * w.len();
                    same_length("receptances beyond terminals", index, beyond.len(), expected)?;
                }
                if !force.is_empty() {
                    same_length("forces", index, force.len(), w.len())?;
                }
                for Record { measured, weights } in records {
                    one_a_line(measured.len(), weights.len(), w.len())?;
                }
            }
            Observation::Whole(Modelled {
                seen: Seen::Frequencies { modes, measured, weights, damping },
                ..
            }) => {
                if modes.is_empty() || !modes.is_sorted() {
                    return Err(wrong("modes", index, modes.len() as f64, "ascending modes, at least one"));
                }
                let usable = |value: &f64| value.is_finite() && *value > 0.0;
                if let Some(value) = measured.iter().find(|value| !usable(value)) {
                    return Err(wrong("measured frequency", index, *value, "a positive finite number"));
                }
                same_length("measured frequencies", index, measured.len(), modes.len())?;
                same_length("weights", index, weights.len(), modes.len())?;
                for Damping { place, ratio, weight } in damping {
                    if *place >= modes.len() {
                        let expected = format!("a mode below {}", modes.len());
                        let value = *place as f64;
                        return Err(Error::Index { what: "damping ratio's mode", index, value, expected });
                    }
                    if let Some(value) = [ratio, weight].into_iter().find(|value| !value.is_finite()) {
                        return Err(wrong("damping ratio or its weight", index, *value, "a finite number"));
                    }
                }
            }
            Observation::Joint(one) => {
                let count = self.count();
                if let Some(wrong) = one.variables.iter().flatten().find(|&&variable| variable >= count) {
                    let (value, expected) = (*wrong as f64, format!("a variable below {count}"));
                    return Err(Error::Index { what: "joint column", index, value, expected });
                }
                one_a_line(one.record.measured.len(), one.record.weights.len(), one.reduction.lines())?;
            }
            Observation::Linear { matrix, centre } => {
                let count = self.count();
                same_length("centre of linear residuals", index, centre.len(), count)?;
                if !matrix.len().is_multiple_of(count) {
                    let value = matrix.len() as f64;
                    return Err(wrong(
                        "matrix of linear residuals",
                        index,
                        value,
                        &format!("rows of {count}"),
                    ));
                }
            }
            Observation::Given(_) => {}
        }
        self.observed.push(one);
        Ok(())
    }

    /// The same on every so many of the lines, so that about `lines` are left of each receptance.
    pub fn thinned(&self, lines: usize) -> Self {
        let fewer = |one: &Observation| match one {
            Observation::Whole(Modelled {
                tied,
                seen:
                    Seen::Receptance { measure, w, records, response, excitation, beyond, force, truncation },
            }) => {
                let stride = stride(w.len(), lines);
                let records = records.iter().map(|record| record.thinned(stride)).collect();
                let seen = Seen::Receptance {
                    measure: *measure,
                    w: every(w, stride),
                    records,
                    response: *response,
                    excitation: *excitation,
                    beyond: thinned_rows(beyond, beyond.len() / w.len(), stride),
                    force: every(force, stride),
                    truncation: truncation.clone(),
                };
                Observation::Whole(Modelled { tied: tied.clone(), seen })
            }
            Observation::Whole(_) | Observation::Linear { .. } | Observation::Given(_) => one.clone(),
            Observation::Joint(one) => {
                let stride = stride(one.record.measured.len(), lines);
                let reduction = Arc::new(one.reduction.thinned(stride));
                Observation::Joint(OfJoint { reduction, record: one.record.thinned(stride), ..*one })
            }
        };
        let observed = self.observed.iter().map(fewer).collect();
        Self { observed, ..self.clone() }
    }

    /// A^T A over all variables and the residual, row by row; nothing where a model has no value. Rows and columns of
    /// variables that are not `free` are zero, but for their priors.
    ///
    /// # Errors
    /// No threads, an interruption, or an error of given residuals.
    pub fn normal_matrix(&self, x: &[f64], free: &[bool], threads: usize) -> Result<Option<Vec<f64>>> {
        let size = x.len() + 1;
        let every: Vec<usize> = (0..x.len()).collect();
        let (values, slopes) = self.unknowns(x, free);
        let parts = self.each(threads, |one, threads| match one {
            Observation::Whole(
                one @ Modelled { seen: Seen::Receptance { measure: Measure::Logarithm, .. }, .. },
            ) => {
                let at = one.tied.at(&values, &slopes)?;
                let columns = at.columns(&every, x.len());
                let places = columns.iter().map(|column| column.place).chain([x.len()]).collect();
                Ok(Part::Some(one.normal_of_lines(&at, &columns, threads)?, places))
            }
            Observation::Joint(one) => {
                let (joint, mut places) = one.fitted(&values, &slopes)?;
                let own = one.normal_matrix(&joint, threads)?;
                places.push(x.len());
                let rows = own.chunks(places.len()).enumerate();
                Ok(Part::Some(rows.flat_map(|(i, row)| &row[i..]).copied().collect(), places))
            }
            _ => Ok(Part::Rows(self.rows_of(one, (x, &values, &slopes), &every, threads)?)),
        });
        let Some(parts) = if_any(parts)? else { return Ok(None) };
        let mut sum = vec![0.0; size * size];
        for part in parts {
            match part {
                Part::Some(own, places) => spread(&own, &places, &mut sum, size),
                Part::Rows(rows) => {
                    for (residual, slopes) in rows.residual.iter().zip(rows.jacobian.chunks(x.len())) {
                        let free =
                            slopes.iter().zip(free).map(|(slope, free)| if *free { *slope } else { 0.0 });
                        self.add_row(&free.chain([*residual]).collect::<Vec<f64>>(), &mut sum);
                    }
                }
            }
        }
        for prior in &self.priors {
            let (i, r) = (prior.variable, prior.scale * x[prior.variable] - prior.offset);
            sum[i * size + i] += prior.scale * prior.scale;
            sum[i * size + size - 1] += prior.scale * r;
            sum[(size - 1) * size + i] += prior.scale * r;
            sum[size * size - 1] += r * r;
        }
        Ok(sum.iter().all(|entry| entry.is_finite()).then_some(sum))
    }

    /// Adds a row of A to A^T A. Where large residuals count by their absolute value, row and residual are scaled so that
    /// slope and curvature are those of the smoothed sum (Triggs et al. 2000), and its value stands in the last entry.
    fn add_row(&self, row: &[f64], sum: &mut [f64]) {
        let Some(smoothing) = self.smoothing else { return outer(row, sum) };
        let Some((&residual, slopes)) = row.split_last() else { return };
        let t = 1.0 + (residual / smoothing).powi(2);
        let (scale, last) = (t.powf(-0.75), residual * t.powf(0.25));
        outer(&slopes.iter().map(|slope| slope * scale).chain([last]).collect::<Vec<f64>>(), sum);
        if let Some(value) = sum.last_mut() {
            *value += 2.0 * smoothing * smoothing * (t.sqrt() - 1.0) - last * last;
        }
    }

    /// Residuals and their derivatives by the variables that are `free`; nothing where a model has no value.
    ///
    /// # Errors
    /// As `normal_matrix`.
    pub fn rows(&self, x: &[f64], free: &[bool], threads: usize) -> Result<Option<Rows>> {
        let moving: Vec<usize> = (0..x.len()).filter(|&i| free[i]).collect();
        let (values, slopes) = self.unknowns(x, free);
        let own =
            |one: &Observation, threads: usize| self.rows_of(one, (x, &values, &slopes), &moving, threads);
        let Some(parts) = if_any(self.each(threads, own))? else { return Ok(None) };
        let mut rows = Rows::default();
        for part in parts {
            rows.residual.extend(part.residual);
            rows.jacobian.extend(part.jacobian);
        }
        for prior in &self.priors {
            rows.residual.push(prior.scale * x[prior.variable] - prior.offset);
            rows.jacobian.extend(moving.iter().map(|&i| if i == prior.variable { prior.scale } else { 0.0 }));
        }
        let finite = rows.residual.iter().chain(&rows.jacobian).all(|value| value.is_finite());
        Ok(finite.then_some(rows))
    }

    /// Residuals of an observation at a point (variables, values of the unknowns, derivatives of these by the variables),
    /// and their derivatives by the moving variables.
    fn rows_of(
        &self,
        one: &Observation,
        (x, values, slopes): (&[f64], &[f64], &[f64]),
        moving: &[usize],
        threads: usize,
    ) -> Result<Rows> {
        let whole = match one {
            Observation::Whole(one) => {
                let at = one.tied.at(values, slopes)?;
                return match one.seen {
                    Seen::Receptance { .. } => one.rows_of_lines(&at, moving, x.len(), threads),
                    Seen::Frequencies { .. } => one.rows_of_frequencies(&at, moving, x.len()),
                };
            }
            Observation::Joint(one) => {
                let (joint, place) = one.fitted(values, slopes)?;
                let found = one.rows(&joint, threads)?;
                let mut jacobian = vec![0.0; found.residual.len() * moving.len()];
                for (own, into) in
                    found.jacobian.chunks(place.len().max(1)).zip(jacobian.chunks_mut(moving.len().max(1)))
                {
                    for (value, variable) in own.iter().zip(&place) {
                        if let Ok(column) = moving.binary_search(variable) {
                            into[column] += value;
                        }
                    }
                }
                return Ok(Rows { residual: found.residual, jacobian });
            }
            Observation::Linear { matrix, centre } => linear(matrix, centre, x),
            Observation::Given(one) => rows_given(one.as_ref(), x)?,
        };
        if moving.len() == x.len() {
            return Ok(whole);
        }
        let rows = whole.jacobian.chunks(x.len());
        let jacobian = rows.flat_map(|row| moving.iter().map(|&i| row[i])).collect();
        Ok(Rows { residual: whole.residual, jacobian })
    }

    /// The first observation that has no value at a point, and why.
    ///
    /// # Errors
    /// As `normal_matrix`.
    pub fn reason(&self, x: &[f64], threads: usize) -> Result<Option<(usize, Error)>> {
        let (values, slopes) = self.unknowns(x, &vec![false; x.len()]);
        for (index, one) in self.observed.iter().enumerate() {
            match self.rows_of(one, (x, &values, &slopes), &[], threads) {
                Ok(_) => {}
                Err(error @ (Error::Threads { .. } | Error::Interrupted)) => return Err(error),
                Err(error) => return Ok(Some((index, error))),
            }
        }
        Ok(None)
    }

    /// Fits from each start, `starts` one after the other, with variables that are not `free` held where they start.
    /// `evaluations` are the most from each start.
    ///
    /// # Errors
    /// Arrays of other lengths than there are variables or starts, a tolerance that is not positive, and those of
    /// `normal_matrix`.
    pub fn fit(
        &self,
        starts: &[f64],
        free: &[bool],
        evaluations: &[usize],
        Settings { tolerance, least, of_all }: Settings,
        threads: usize,
    ) -> Result<Vec<End>> {
        let count = self.count();
        if starts.len() != evaluations.len() * count || free.len() != count {
            let expected = format!("rows of {count} variables, one for each of {} starts", evaluations.len());
            return Err(Error::Index { what: "starts", index: 0, value: starts.len() as f64, expected });
        }
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(wrong("tolerance", 0, tolerance, "a positive finite number"));
        }
        let by = if of_all { &vec![true; count] } else { free };
        let bounds = [&self.variables.lower[..], &self.variables.upper[..]];
        let rows: Vec<(&[f64], usize)> = starts.chunks(count).zip(evaluations.iter().copied()).collect();
        // Many starts share the threads, one start has them for its lines.
        let inside = if rows.len() > 1 { 1 } else { threads };
        let ends = on_threads(threads, rows, A_FIT, |(start, evaluations)| {
            let normal = |x: &[f64]| self.normal_matrix(x, by, inside);
            let stop = Stop { tolerance, least, evaluations };
            minimise(start, bounds, free, stop, normal, |x| self.allows(x))
        })?;
        ends.into_iter().collect()
    }

    /// Whether every model exists at a point.
    fn allows(&self, x: &[f64]) -> Result<bool> {
        let (values, slopes) = unknowns(&self.variables, x);
        for one in &self.observed {
            let exists = match one {
                Observation::Whole(one) => one.tied.at(&values, &slopes).is_ok(),
                Observation::Joint(one) => one.joint(&values).is_ok(),
                Observation::Linear { .. } => true,
                Observation::Given(one) => if_any(rows_given(one.as_ref(), x))?.is_some(),
            };
            if !exists {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Values of the unknowns and their derivatives by the variables, zero where these are not free.
    fn unknowns(&self, x: &[f64], free: &[bool]) -> (Vec<f64>, Vec<f64>) {
        let (values, mut slopes) = unknowns(&self.variables, x);
        for (slope, free) in slopes.iter_mut().zip(free) {
            *slope = if *free { *slope } else { 0.0 };
        }
        (values, slopes)
    }

    /// Some work on every observation, in their order.
    fn each<T: Send>(
        &self,
        threads: usize,
        work: impl Fn(&Observation, usize) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        // Many observations share the threads, one has them for its lines.
        let inside = if self.observed.len() > 1 { 1 } else { threads };
        let lines = |one: &Observation| match one {
            Observation::Whole(one) => one.seen.lines(),
            Observation::Joint(one) => one.record.measured.len() / REDUCED_LINES,
            Observation::Linear { .. } | Observation::Given(_) => 0,
        };
        let lines: usize = self.observed.iter().map(lines).sum();
        let a_task = A_LINE * lines as f64 / self.observed.len().max(1) as f64;
        let parts = on_threads(threads, self.observed.iter().collect(), a_task, |one| work(one, inside))?;
        parts.into_iter().collect()
    }
}

impl Observation {
    /// Whether its residuals are complex logarithms.
    fn is_logarithmic(&self) -> bool {
        match self {
            Self::Whole(one) => matches!(one.seen, Seen::Receptance { measure: Measure::Logarithm, .. }),
            Self::Joint(_) => true,
            Self::Linear { .. } | Self::Given(_) => false,
        }
    }
}

impl Record {
    fn thinned(&self, stride: usize) -> Self {
        Self { measured: every(&self.measured, stride), weights: every(&self.weights, stride) }
    }
}

/// Every so many of some rows.
fn thinned_rows(values: &[Complex64], columns: usize, stride: usize) -> Vec<Complex64> {
    values.chunks(columns.max(1)).step_by(stride).flatten().copied().collect()
}

/// Given residuals with their derivatives. Where they end the call, the fits from other starts end with it.
fn rows_given(residuals: &dyn Residuals, x: &[f64]) -> Result<Rows> {
    let rows = residuals.rows(x);
    if matches!(rows, Err(Error::Interrupted)) {
        interrupt::end();
    }
    rows
}

/// Residuals A (x - b) with their derivatives.
fn linear(matrix: &[f64], centre: &[f64], x: &[f64]) -> Rows {
    let off: Vec<f64> = x.iter().zip(centre).map(|(x, b)| x - b).collect();
    let each = matrix.chunks(x.len()).map(|row| row.iter().zip(&off).map(|(a, off)| a * off).sum());
    Rows { residual: each.collect(), jacobian: matrix.to_vec() }
}

/// How many lines to go on by, so that about `wanted` of them are left.
fn stride(lines: usize, wanted: usize) -> usize {
    (lines / wanted.max(1)).max(1)
}

/// Values of the unknowns, and their derivatives by the variables.
fn unknowns(variables: &Variables, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let value = |(x, logarithmic): (&f64, &bool)| if *logarithmic { 10.0_f64.powf(*x) } else { *x };
    let values: Vec<f64> = x.iter().zip(&variables.logarithmic).map(value).collect();
    let slope = |(value, logarithmic): (&f64, &bool)| {
        if *logarithmic { value * core::f64::consts::LN_10 } else { 1.0 }
    };
    let slopes = values.iter().zip(&variables.logarithmic).map(slope).collect();
    (values, slopes)
}

fn wrong(what: &'static str, index: usize, value: f64, expected: &str) -> Error {
    Error::Index { what, index, value, expected: expected.to_owned() }
}

/// Adds the outer product of a row to a matrix.
fn outer(row: &[f64], sum: &mut [f64]) {
    for (value, into) in row.iter().zip(sum.chunks_mut(row.len())).filter(|(value, _)| **value != 0.0) {
        for (into, other) in into.iter_mut().zip(row) {
            *into += value * other;
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::line::amplitude::receptance;
    use crate::model::assembly::{Model, Table, Tables};
    use crate::model::frequencies::Frequencies;
    use crate::model::request::Parameter;
    use crate::model::request::{Coordinate, Request};
    use crate::model::section::{Motion, cylinder};
    use crate::observe::ties::{Rate, Tied};
    use core::sync::atomic::{AtomicUsize, Ordering};

    const BAR: [f64; 9] = [0.0, 1.0, 0.2, 0.02, 0.0, 2e11, 7850.0, 0.3, 0.002];
    // Seven and three times one unknown as modulus, and a length that is 0.2 exp(0.01 u).
    const ADDRESSES: [f64; 16] =
        [0.0, 7.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.2, -1.0, 0.0, 0.0, 0.01, 0.0, 0.0];
    const SETTINGS: Settings = Settings { tolerance: 1e-10, least: 0.0, of_all: false };
    const LOGARITHMIC: [bool; 2] = [true, false];
    const BOUNDS: [[f64; 2]; 2] = [[9.0, -8.0], [11.0, 8.0]];

    fn variables() -> Variables {
        Variables { logarithmic: LOGARITHMIC.to_vec(), lower: BOUNDS[0].to_vec(), upper: BOUNDS[1].to_vec() }
    }

    fn lines(count: usize) -> Vec<Complex64> {
        (0..count).map(|i| Complex64::new(500.0 + 20.0 * i as f64, 0.0)).collect()
    }

    /// A bar with unknown modulus and length, and its record.
    fn problem(count: usize) -> (Problem, Record) {
        let w = lines(count);
        let found = receptance(&model(), &Frequencies::complex(&w, 1.0), &request(&[]), 1);
        let measured = found.map(|found| found.receptance).unwrap_or_default();
        let record = Record { measured, weights: vec![100.0; count] };
        let bar = cylinder(BAR);
        let tables = Tables { segments: &bar, ..Tables::default() };
        let rates =
            [(5, 0), (2, 1)].map(|(column, address)| Rate { entry: entry(column), address, rate: 1.0 });
        let response = Coordinate { node: 0, direction: 0 };
        let seen = Seen::Receptance {
            measure: Measure::Logarithm,
            w,
            records: vec![record.clone()],
            response,
            excitation: response,
            beyond: Vec::new(),
            force: Vec::new(),
            truncation: None,
        };
        let tied = Tied::new(Motion::Bending, tables, &rates, &[BAR[5], BAR[2]], ADDRESSES.to_vec(), 2);
        let priors = vec![Prior { variable: 1, scale: 1.0, offset: 0.0 }];
        let mut problem = Problem::new(variables(), priors, None).unwrap();
        problem.add(Observation::Whole(Modelled { tied: Arc::new(tied.unwrap()), seen })).unwrap();
        (problem, record)
    }

    fn entry(column: usize) -> Parameter {
        Parameter { table: Table::Segments, row: 0, column }
    }

    fn model() -> Model {
        Model::new(Motion::Bending, Tables { segments: &cylinder(BAR), ..Tables::default() }).unwrap()
    }

    fn request(parameters: &[Parameter]) -> Request {
        let point = vec![Coordinate { node: 0, direction: 0 }];
        Request {
            excitations: point.clone(),
            responses: point,
            parameters: parameters.to_vec(),
            ..Request::default()
        }
    }

    #[test]
    fn fits_find_the_truth_and_hold_variables_that_are_not_free() {
        let (problem, _) = problem(300);
        let starts = [10.25, 0.5, 10.35, -1.0];
        let free = problem.fit(&starts, &[true, true], &[100; 2], SETTINGS, 2).unwrap();
        assert_eq!(free.len(), 2);
        for end in &free {
            assert!((end.x[0] - 2e10_f64.log10()).abs() < 1e-7 && end.x[1].abs() < 1e-4, "{end:?}");
        }
        let held = problem.fit(&starts[..2], &[true, false], &[100], SETTINGS, 1).unwrap();
        assert!(held[0].x[1] == 0.5 && held[0].cost > free[0].cost + 0.1, "{held:?}");
        assert!(held[0].normal[4] == 1.0 && held[0].normal[1] == 0.0, "the prior alone: {held:?}");
        let all = Settings { of_all: true, ..SETTINGS };
        let whole = problem.fit(&starts[..2], &[true, false], &[100], all, 1).unwrap();
        assert_eq!(whole[0].x, held[0].x);
        assert!(whole[0].normal[4] > 1.0 && whole[0].normal[1] != 0.0, "{whole:?}");
        assert!(problem.fit(&starts, &[true], &[100; 2], SETTINGS, 1).is_err());
        let fewer = problem.thinned(30).fit(&starts, &[true, true], &[100; 2], SETTINGS, 1).unwrap();
        assert!((fewer[0].x[0] - 2e10_f64.log10()).abs() < 1e-7, "{fewer:?}");
    }

    /// Residuals whose evaluation ends the call, as an exception does that a caller's function raises.
    #[derive(Debug, Default)]
    struct Ending(AtomicUsize);

    impl Residuals for Ending {
        fn rows(&self, _: &[f64]) -> Result<Rows> {
            self.0.fetch_add(1, Ordering::Relaxed);
            Err(Error::Interrupted)
        }
    }

    #[test]
    fn residuals_that_end_the_call_are_not_evaluated_from_other_starts() {
        for threads in [1, 2] {
            let ending = Arc::new(Ending::default());
            let mut problem = Problem::new(variables(), Vec::new(), None).unwrap();
            problem.add(Observation::Given(ending.clone())).unwrap();
            let starts = [10.0, 0.0].repeat(50);
            let fit = || problem.fit(&starts, &[true, true], &[100; 50], SETTINGS, threads);
            assert!(matches!(interrupt::interruptible(|| false, fit), Err(Error::Interrupted)));
            assert!(ending.0.load(Ordering::Relaxed) <= threads);
        }
    }
}
