//! Normal matrices of residuals of whole models: receptances and natural frequencies of several assemblies.
//!
//! The derivatives of the lines stay where they are computed: what leaves a task is A^T A, A = [J | r], over the
//! entries of the tables that move. How these follow from the fitted variables is applied to the sums.

use crate::error::{Error, Result};
use crate::frequencies::Frequencies;
use crate::joint_search::Variables;
use crate::lane::{C, MAX_LANES, R};
use crate::natural::natural_frequencies;
use crate::request::{ByLine, Coordinate, Request, check};
use crate::response::{Job, LINES_PER_TASK};
use crate::threads::on_threads;
use crate::ties::{At, Tied, unknowns};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Modes are counted up to this many times the highest measured frequency first.
const MARGIN: f64 = 1.05;

/// By how much that limit grows when there are too few modes below it.
const GROWTH: f64 = 1.5;

/// A mode this many times above its measured frequency says nothing but that the point is far off.
const FARTHEST: f64 = 1e3;

/// What was measured of a model.
#[derive(Copy, Clone)]
pub enum Seen<'a> {
    /// A receptance on lines w in rad/s, with a weight each.
    Receptance {
        /// Lines.
        w: &'a [Complex64],
        /// Values.
        measured: &'a [Complex64],
        /// One over the standard deviations of the logarithm.
        weights: &'a [f64],
        /// Where motion was seen.
        response: Coordinate,
        /// Where the load acted.
        excitation: Coordinate,
    },
    /// Natural frequencies in rad/s.
    Frequencies {
        /// Which modes these are, counted from 0 on, ascending.
        modes: &'a [usize],
        /// Values.
        measured: &'a [f64],
        /// One over their standard deviations.
        weights: &'a [f64],
    },
}

/// A model and what was measured of it.
pub struct Modelled<'a> {
    /// The model as a function of the unknowns.
    pub tied: Tied<'a>,
    /// What was measured.
    pub seen: Seen<'a>,
}

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
                Seen::Receptance { w, measured, weights, .. } => {
                    same("measured receptance", index, measured.len(), w.len())?;
                    same("weights", index, weights.len(), w.len())?;
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

    /// A^T A over all variables and the residual, row by row; nothing where a model has no value.
    pub fn normal_matrix(&self, x: &[f64], threads: usize) -> Option<Vec<f64>> {
        let size = x.len() + 1;
        let (values, slopes) = unknowns(&self.variables, x);
        let mut sum = vec![0.0; size * size];
        for one in &self.observed {
            let at = one.tied.at(&values, &slopes)?;
            let own = match one.seen {
                Seen::Receptance { .. } => one.of_receptance(&at, threads),
                Seen::Frequencies { .. } => one.of_frequencies(&at),
            }?;
            spread(&own, &at.slopes, one.tied.entries.len(), &mut sum, size);
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

    /// Whether every model exists at a point.
    pub fn allows(&self, x: &[f64]) -> bool {
        let (values, slopes) = unknowns(&self.variables, x);
        self.observed.iter().all(|one| one.tied.at(&values, &slopes).is_some())
    }
}

impl Modelled<'_> {
    /// A^T A over the entries and the residual, the upper triangle row by row.
    fn of_receptance(&self, at: &At, threads: usize) -> Option<Vec<f64>> {
        let Seen::Receptance { w, measured, weights, response, excitation } = self.seen else { return None };
        let request = Request {
            excitations: vec![excitation],
            responses: vec![response],
            parameters: self.tied.entries.clone(),
            ..Request::default()
        };
        let highest = check(&at.model, &Frequencies::complex(w, 1.0), &request).ok()?;
        let arch = Arch::new();
        // A free resonance without damping can make the one denominator of a branch zero to the last bit.
        [true, false].into_iter().find_map(|whole| {
            let job = Job::<2>::new(&at.model, &request, whole.then_some((highest, w.len())));
            let tasks: Vec<usize> = (0..w.len()).step_by(LINES_PER_TASK).collect();
            let parts = on_threads(threads, tasks, job.a_task_takes(), |start| {
                let lines = start..w.len().min(start + LINES_PER_TASK);
                let mut h = vec![Complex64::ZERO; lines.len()];
                let mut dh = vec![Complex64::ZERO; lines.len() * request.parameters.len()];
                if job.lines(&arch, &w[lines.clone()], ByLine::default(), &mut h, &mut dh, &mut []).is_some()
                {
                    return None;
                }
                let (measured, weights) = (&measured[lines.clone()], &weights[lines]);
                Some(arch.dispatch(Sum { h: &h, dh: &dh, measured, weights }))
            });
            // Added in the order of the lines, whichever thread was first.
            parts.ok()?.into_iter().try_fold(Vec::new(), |sum: Vec<f64>, part| {
                let part = part?;
                Some(if sum.is_empty() { part } else { sum.iter().zip(part).map(|(a, b)| a + b).collect() })
            })
        })
    }

    fn of_frequencies(&self, at: &At) -> Option<Vec<f64>> {
        let Seen::Frequencies { modes, measured, weights } = self.seen else { return None };
        let (most, highest) = (modes.last()? + 1, *measured.last()?);
        let mut upper = MARGIN * highest;
        let found = loop {
            let found = natural_frequencies(&at.model, upper, most, &self.tied.entries).ok()?;
            if found.angular.len() >= most {
                break found;
            }
            if upper > FARTHEST * highest {
                return None;
            }
            upper *= GROWTH;
        };
        let count = self.tied.entries.len();
        let mut sum = vec![0.0; (count + 1) * (count + 2) / 2];
        for ((&mode, measured), weight) in modes.iter().zip(measured).zip(weights) {
            let mut row: Vec<f64> = found.derivative[mode * count..(mode + 1) * count]
                .iter()
                .map(|slope| slope * weight)
                .collect();
            row.push((found.angular[mode] - measured) * weight);
            let mut entry = 0;
            for i in 0..=count {
                for j in i..=count {
                    sum[entry] += row[i] * row[j];
                    entry += 1;
                }
            }
        }
        Some(sum)
    }
}

/// Adds B^T N B to a sum over the variables and the residual, B the derivatives of the entries by the variables.
fn spread(own: &[f64], slopes: &[f64], entries: usize, sum: &mut [f64], size: usize) {
    let count = size - 1;
    let index = |i: usize, j: usize| {
        let (i, j) = (i.min(j), i.max(j));
        i * (2 * entries + 3 - i) / 2 + j - i
    };
    let moved: Vec<usize> =
        (0..count).filter(|&j| (0..entries).any(|k| slopes[k * count + j] != 0.0)).collect();
    let mut half = vec![0.0; (entries + 1) * count];
    for i in 0..=entries {
        for &j in &moved {
            half[i * count + j] = (0..entries).map(|k| own[index(i, k)] * slopes[k * count + j]).sum();
        }
    }
    for &i in &moved {
        for &j in &moved {
            sum[i * size + j] +=
                (0..entries).map(|k| slopes[k * count + i] * half[k * count + j]).sum::<f64>();
        }
        let slope = half[entries * count + i];
        sum[i * size + count] += slope;
        sum[count * size + i] += slope;
    }
    sum[size * size - 1] += own[index(entries, entries)];
}

/// The upper triangle of A^T A of the lines of one task.
struct Sum<'a> {
    h: &'a [Complex64],
    dh: &'a [Complex64],
    measured: &'a [Complex64],
    weights: &'a [f64],
}

impl WithSimd for Sum<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f64> {
        let count = self.dh.len() / self.h.len().max(1);
        let mut sums = vec![simd.splat_f64s(0.0); (count + 1) * (count + 2) / 2];
        let mut rows = vec![C::zero(simd); count + 1];
        let mut lanes = [Complex64::ZERO; MAX_LANES];
        let mut start = 0;
        while start < self.h.len() {
            let end = self.h.len().min(start + S::F64_LANES);
            let weight = simd.partial_load_f64s(&self.weights[start..end]);
            let inverse = C::load(simd, &self.h[start..end]).recip();
            for k in 0..count {
                for (lane, line) in (start..end).enumerate() {
                    // The residual falls as the model's receptance grows.
                    lanes[lane] = -self.dh[line * count + k];
                }
                rows[k] = C::load(simd, &lanes[..end - start]) * inverse;
            }
            rows[count] = (C::load(simd, &self.measured[start..end]) * inverse).ln();
            for row in &mut rows {
                row.re = simd.mul_f64s(row.re, weight);
                row.im = simd.mul_f64s(row.im, weight);
            }
            let mut entry = 0;
            for i in 0..=count {
                for j in i..=count {
                    let sum = simd.mul_add_e_f64s(rows[i].re, rows[j].re, sums[entry]);
                    sums[entry] = simd.mul_add_e_f64s(rows[i].im, rows[j].im, sum);
                    entry += 1;
                }
            }
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
    use crate::least_squares::Stop;
    use crate::model::{Table, Tables};
    use crate::model_search::fit_models;
    use crate::request::Parameter;
    use crate::response::receptance;
    use crate::ties::Rate;

    const BAR: [f64; 14] = [0.0, 1.0, 0.2, 0.02, 0.0, 2e11, 7850.0, 0.3, 0.002, 0.0, 0.0, 0.0, 0.0, 0.0];
    // One unknown modulus, and a length that is 0.2 exp(0.01 u).
    const ADDRESSES: [f64; 12] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.2, 0.0, 0.01, 0.0, 0.0];
    const LOGARITHMIC: [bool; 2] = [true, false];
    const BOUNDS: [[f64; 2]; 2] = [[10.0, -8.0], [12.0, 8.0]];

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
        let seen = Seen::Receptance {
            w: &w,
            measured: &measured,
            weights: &weights,
            response: point,
            excitation: point,
        };
        let tied = Tied::new(tables, &rates, &ADDRESSES, 2);
        let variables = Variables { logarithmic: &LOGARITHMIC, lower: &BOUNDS[0], upper: &BOUNDS[1] };
        let known = vec![Known { variable: 1, scale: 1.0, offset: 0.0 }];
        let observed = tied.into_iter().map(|tied| Modelled { tied, seen }).collect();
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
            let x = [11.2, 0.7];
            let mut bar = BAR;
            (bar[5], bar[2]) = (10.0_f64.powf(x[0]), 0.2 * (0.01 * x[1]).exp());
            let Seen::Receptance { w, measured, weights, .. } = campaign.observed[0].seen else { return };
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
                let own = campaign.normal_matrix(&x, threads).unwrap_or_default();
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
            let starts = [11.25, 0.5, 11.35, -1.0];
            let free = fit_models(campaign, &[true, true], &starts, stop, 2).unwrap_or_default();
            assert_eq!(free.len(), 2);
            for end in &free {
                assert!((end.x[0] - 2e11_f64.log10()).abs() < 1e-7 && end.x[1].abs() < 1e-4, "{end:?}");
            }
            let held = fit_models(campaign, &[true, false], &starts[..2], stop, 1).unwrap_or_default();
            assert!(held[0].x[1] == 0.5 && held[0].cost > free[0].cost + 0.1, "{held:?}");
            assert!(fit_models(campaign, &[true], &starts, stop, 1).is_err());
        });
    }
}
