//! Normal matrices of residuals of whole models: receptances and natural frequencies of several assemblies.
//!
//! The derivatives of the lines stay where they are computed: what leaves a task is A^T A, A = [J | r], over the
//! entries of the tables that move. How these follow from the fitted variables is applied to the sums.

use crate::error::{Error, Result};
use crate::joint_search::Variables;
use crate::lane::{C, MAX_LANES, R};
use crate::observed::{Lines, Modelled, Record, Seen};
use crate::threads::on_threads;
use crate::ties::{At, unknowns};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// What an observation takes at least [ns] a line.
const A_LINE: f64 = 300.0;

/// What is known of a variable x beforehand, as a residual `scale` x - `offset`.
#[derive(Copy, Clone, Debug)]
pub struct Known {
    /// The variable.
    pub variable: usize,
    /// One over its standard deviation.
    pub scale: f64,
    /// Its mean times that.
    pub offset: f64,
}

/// Everything that is fitted.
pub struct Campaign<'a> {
    /// What was measured.
    pub observed: Vec<Modelled<'a>>,
    /// What is known beforehand.
    pub known: Vec<Known>,
    /// The fitted variables.
    pub variables: Variables<'a>,
}

impl Campaign<'_> {
    /// Checks that arrays belong together.
    ///
    /// # Errors
    /// Arrays of different lengths, or a variable that does not exist.
    pub fn check(&self) -> Result<()> {
        let count = self.variables.logarithmic.len();
        let same = |what, index, value: usize, expected: usize| {
            let wanted = format!("{expected} values");
            let error = Error::Index { what, index, value: value as f64, expected: wanted };
            if value == expected { Ok(()) } else { Err(error) }
        };
        same("lower bounds", 0, self.variables.lower.len(), count)?;
        same("upper bounds", 0, self.variables.upper.len(), count)?;
        for (index, one) in self.observed.iter().enumerate() {
            match one.seen {
                Seen::Receptance { w, ref records, .. } => {
                    for Record { measured, weights } in records {
                        same("measured receptance", index, measured.len(), w.len())?;
                        same("weights", index, weights.len(), w.len())?;
                    }
                }
                Seen::Frequencies { modes, measured, weights } => {
                    same("measured frequencies", index, measured.len(), modes.len())?;
                    same("weights", index, weights.len(), modes.len())?;
                }
            }
        }
        match self.known.iter().find(|known| known.variable >= count) {
            Some(known) => {
                let (value, expected) = (known.variable as f64, format!("a variable below {count}"));
                Err(Error::Index { what: "prior", index: 0, value, expected })
            }
            None => Ok(()),
        }
    }

    /// A^T A over all variables and the residual, row by row; nothing where a model has no value. Rows and columns of
    /// variables that are not `free` are zero, but for what is known of them beforehand.
    pub fn normal_matrix(&self, x: &[f64], free: &[bool], threads: usize) -> Option<Vec<f64>> {
        let size = x.len() + 1;
        let mut sum = vec![0.0; size * size];
        let parts = self.each(x, free, threads, |one, at, threads| match one.seen {
            Seen::Receptance { .. } => one.normal_of_lines(at, threads).map(Part::Sum),
            Seen::Frequencies { .. } => one.frequencies(at).map(Part::Rows),
        })?;
        for (own, at) in &parts {
            match own {
                Part::Sum(own) => spread(own, &at.slopes, at.slopes.len() / x.len(), &mut sum, size),
                Part::Rows(rows) => rows.iter().for_each(|row| add(row, &at.slopes, &mut sum, size)),
            }
        }
        for known in &self.known {
            let (i, r) = (known.variable, known.scale * x[known.variable] - known.offset);
            sum[i * size + i] += known.scale * known.scale;
            sum[i * size + size - 1] += known.scale * r;
            sum[(size - 1) * size + i] += known.scale * r;
            sum[size * size - 1] += r * r;
        }
        sum.iter().all(|entry| entry.is_finite()).then_some(sum)
    }

    /// What some work makes of every observation, in their order, at a point where all models exist.
    pub(crate) fn each<T: Send>(
        &self,
        x: &[f64],
        free: &[bool],
        threads: usize,
        work: impl Fn(&Modelled, &At, usize) -> Option<T> + Sync,
    ) -> Option<Vec<(T, At)>> {
        let (values, mut slopes) = unknowns(&self.variables, x);
        for (slope, free) in slopes.iter_mut().zip(free) {
            *slope = if *free { *slope } else { 0.0 };
        }
        // Many observations share the threads, one has them for its lines.
        let inside = if self.observed.len() > 1 { 1 } else { threads };
        let lines: usize = self.observed.iter().map(|one| one.seen.lines()).sum();
        let a_task = A_LINE * lines as f64 / self.observed.len().max(1) as f64;
        let parts = on_threads(threads, self.observed.iter().collect(), a_task, |one| {
            let at = one.tied.at(&values, &slopes)?;
            Some((work(one, &at, inside)?, at))
        });
        parts.ok()?.into_iter().collect()
    }

    /// Whether every model exists at a point.
    pub fn allows(&self, x: &[f64]) -> bool {
        let (values, slopes) = unknowns(&self.variables, x);
        self.observed.iter().all(|one| one.tied.at(&values, &slopes).is_some())
    }
}

impl Modelled<'_> {
    /// A^T A over the entries, factors and the residual, the upper triangle row by row.
    fn normal_of_lines(&self, at: &At, threads: usize) -> Option<Vec<f64>> {
        let arch = Arch::new();
        let parts =
            self.lines(at, threads, |Lines { h, dh, records, .. }| arch.dispatch(Sum { h, dh, records }))?;
        // Added in the order of the lines, whichever thread was first.
        parts.into_iter().reduce(|sum, part| sum.iter().zip(part).map(|(a, b)| a + b).collect())
    }
}

/// What an observation adds to a normal matrix.
enum Part {
    /// A^T A over the entries and the residual, the upper triangle row by row.
    Sum(Vec<f64>),
    /// Rows of A, the residual last: of few modes they are less work than their products.
    Rows(Vec<Vec<f64>>),
}

/// Adds a row of derivatives by the entries and of a residual to a sum over the variables and the residual.
fn add(row: &[f64], slopes: &[f64], sum: &mut [f64], size: usize) {
    let mut whole = vec![0.0; size];
    for (entry, slopes) in row.iter().zip(slopes.chunks((size - 1).max(1))) {
        for (into, slope) in whole.iter_mut().zip(slopes) {
            *into += entry * slope;
        }
    }
    whole[size - 1] = row[row.len() - 1];
    for (value, into) in whole.iter().zip(sum.chunks_mut(size)).filter(|(value, _)| **value != 0.0) {
        for (into, other) in into.iter_mut().zip(&whole) {
            *into += value * other;
        }
    }
}

/// Adds B^T N B to a sum over the variables and the residual, B the derivatives of the entries by the variables.
fn spread(own: &[f64], slopes: &[f64], entries: usize, sum: &mut [f64], size: usize) {
    let count = size - 1;
    let index = |i: usize, j: usize| {
        let (i, j) = (i.min(j), i.max(j));
        i * (2 * entries + 3 - i) / 2 + j - i
    };
    // A variable moves few entries.
    let mut moved: Vec<(usize, Vec<(usize, f64)>)> = Vec::new();
    for j in 0..count {
        let own = (0..entries).map(|k| (k, slopes[k * count + j])).filter(|(_, slope)| *slope != 0.0);
        let own: Vec<(usize, f64)> = own.collect();
        if !own.is_empty() {
            moved.push((j, own));
        }
    }
    let mut half = vec![0.0; entries + 1];
    for (j, by) in &moved {
        for (i, half) in half.iter_mut().enumerate() {
            *half = by.iter().map(|(k, slope)| own[index(i, *k)] * slope).sum();
        }
        for (i, by) in &moved {
            sum[i * size + j] += by.iter().map(|(k, slope)| slope * half[*k]).sum::<f64>();
        }
        sum[j * size + count] += half[entries];
        sum[count * size + j] += half[entries];
    }
    sum[size * size - 1] += own[index(entries, entries)];
}

/// The upper triangle of A^T A of the lines of one task.
struct Sum<'a> {
    h: &'a [Complex64],
    dh: &'a [Complex64],
    records: &'a [Record<'a>],
}

impl WithSimd for Sum<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f64> {
        let count = self.dh.len() / self.h.len().max(1);
        let mut sums = vec![simd.splat_f64s(0.0); (count + 1) * (count + 2) / 2];
        let mut rows = vec![C::zero(simd); count];
        let mut lanes = [Complex64::ZERO; MAX_LANES];
        let mut start = 0;
        while start < self.h.len() {
            let end = self.h.len().min(start + S::F64_LANES);
            let inverse = C::load(simd, &self.h[start..end]).recip();
            for k in 0..count {
                for (lane, line) in (start..end).enumerate() {
                    // The residual falls as the model's receptance grows.
                    lanes[lane] = -self.dh[line * count + k];
                }
                rows[k] = C::load(simd, &lanes[..end - start]) * inverse;
            }
            // Records of one model differ in what was measured alone: their derivatives are the same.
            let (mut square, mut weight) = (simd.splat_f64s(0.0), simd.splat_f64s(0.0));
            let mut residual = C::zero(simd);
            for record in self.records {
                let own = simd.partial_load_f64s(&record.weights[start..end]);
                let own = simd.mul_f64s(own, own);
                let log = (C::load(simd, &record.measured[start..end]) * inverse).ln();
                weight = simd.add_f64s(weight, own);
                square = simd.mul_add_e_f64s(own, log.norm_sqr().v, square);
                residual = log.mul_add_real(own, residual);
            }
            let mut entry = 0;
            for i in 0..count {
                let (re, im) = (simd.mul_f64s(rows[i].re, weight), simd.mul_f64s(rows[i].im, weight));
                for row in &rows[i..] {
                    let sum = simd.mul_add_e_f64s(re, row.re, sums[entry]);
                    sums[entry] = simd.mul_add_e_f64s(im, row.im, sum);
                    entry += 1;
                }
                let sum = simd.mul_add_e_f64s(rows[i].re, residual.re, sums[entry]);
                sums[entry] = simd.mul_add_e_f64s(rows[i].im, residual.im, sum);
                entry += 1;
            }
            sums[entry] = simd.add_f64s(sums[entry], square);
            start = end;
        }
        let total = |sum| {
            let mut lanes = [0.0; MAX_LANES];
            R { simd, v: sum }.store(&mut lanes);
            lanes[..S::F64_LANES].iter().sum()
        };
        sums.into_iter().map(total).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frequencies::Frequencies;
    use crate::least_squares::Stop;
    use crate::model::{Table, Tables};
    use crate::model_search::fit_models;
    use crate::request::Parameter;
    use crate::request::{Coordinate, Request};
    use crate::response::receptance;
    use crate::ties::{Rate, Tied};

    const BAR: [f64; 14] = [0.0, 1.0, 0.2, 0.02, 0.0, 2e11, 7850.0, 0.3, 0.002, 0.0, 0.0, 0.0, 0.0, 0.0];
    // Ten times one unknown as modulus, and a length that is 0.2 exp(0.01 u).
    const ADDRESSES: [f64; 12] = [0.0, 10.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.2, 0.0, 0.01, 0.0, 0.0];
    const LOGARITHMIC: [bool; 2] = [true, false];
    const BOUNDS: [[f64; 2]; 2] = [[9.0, -8.0], [11.0, 8.0]];

    fn with_campaign<T>(lines: usize, work: impl FnOnce(&Campaign) -> T) -> T {
        let w: Vec<Complex64> = (0..lines).map(|i| Complex64::new(500.0 + 20.0 * i as f64, 0.0)).collect();
        let measured = receptance(&model(&BAR), &Frequencies::complex(&w, 1.0), &request(&[]), 1)
            .map(|found| found.receptance)
            .unwrap_or_default();
        let weights = vec![100.0; lines];
        let mut fixed = BAR;
        (fixed[5], fixed[2]) = (0.0, 0.0);
        let tables = Tables { segments: &fixed, ..Tables::default() };
        let rates =
            [(5, 0), (2, 1)].map(|(column, address)| Rate { entry: entry(column), address, rate: 1.0 });
        let point = Coordinate { node: 0, direction: 0 };
        let records = vec![Record { measured: &measured, weights: &weights }];
        let seen = Seen::Receptance { w: &w, records, response: point, excitation: point };
        let tied = Tied::new(tables, &rates, &ADDRESSES, 2);
        let variables = Variables { logarithmic: &LOGARITHMIC, lower: &BOUNDS[0], upper: &BOUNDS[1] };
        let known = vec![Known { variable: 1, scale: 1.0, offset: 0.0 }];
        let observed = tied.map(|tied| Modelled { tied, seen }).into_iter().collect();
        work(&Campaign { observed, known, variables })
    }

    fn entry(column: usize) -> Parameter {
        Parameter { table: Table::Segments, row: 0, column }
    }

    fn model(bar: &[f64]) -> crate::model::Model {
        let tables = Tables { segments: bar, ..Tables::default() };
        match crate::model::Model::new(crate::model::Motion::Bending, tables) {
            Ok(model) => model,
            Err(error) => unreachable!("{error}"),
        }
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
    fn normal_matrices_are_sums_over_lines() {
        with_campaign(300, |campaign| {
            let x = [10.2, 0.7];
            let mut bar = BAR;
            (bar[5], bar[2]) = (10.0_f64.powf(x[0] + 1.0), 0.2 * (0.01 * x[1]).exp());
            let Seen::Receptance { w, records, .. } = &campaign.observed[0].seen else { return };
            let Record { measured, weights } = records[0];
            let lines = Frequencies::complex(w, 1.0);
            let found = receptance(&model(&bar), &lines, &request(&[entry(5), entry(2)]), 1);
            let Ok(found) = found else { unreachable!() };
            let by = [bar[5] * core::f64::consts::LN_10, 0.01 * bar[2]];
            let mut sum = [[0.0; 3]; 3];
            for line in 0..w.len() {
                let h = found.receptance[line];
                let slope = |k: usize| -found.derivative[2 * line + k] / h * by[k] * weights[line];
                let row = [slope(0), slope(1), (measured[line] / h).ln() * weights[line]];
                for i in 0..3 {
                    for j in 0..3 {
                        sum[i][j] += (row[i].conj() * row[j]).re;
                    }
                }
            }
            for (i, j, prior) in [(1, 1, 1.0), (1, 2, x[1]), (2, 1, x[1]), (2, 2, x[1] * x[1])] {
                sum[i][j] += prior;
            }
            for threads in [1, 2] {
                let own = campaign.normal_matrix(&x, &[true; 2], threads).unwrap_or_default();
                for (own, expected) in own.iter().zip(sum.as_flattened()) {
                    assert!((own - expected).abs() <= 1e-10 * expected.abs(), "{own} {expected}");
                }
            }
        });
    }

    #[test]
    fn fits_find_the_truth_and_hold_what_is_not_free() {
        with_campaign(300, |campaign| {
            let stop = Stop { tolerance: 1e-10, evaluations: 100 };
            let starts = [10.25, 0.5, 10.35, -1.0];
            let free = fit_models(campaign, &[true, true], &starts, stop, 2).unwrap_or_default();
            assert_eq!(free.len(), 2);
            for end in &free {
                assert!((end.x[0] - 2e10_f64.log10()).abs() < 1e-7 && end.x[1].abs() < 1e-4, "{end:?}");
            }
            let held = fit_models(campaign, &[true, false], &starts[..2], stop, 1).unwrap_or_default();
            assert!(held[0].x[1] == 0.5 && held[0].cost > free[0].cost + 0.1, "{held:?}");
            assert!(fit_models(campaign, &[true], &starts, stop, 1).is_err());
        });
    }
}
