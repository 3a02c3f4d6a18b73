//! Residuals of whole models with their derivatives, row by row, and their normal matrices.
//!
//! The derivatives of the lines stay where they are computed: the result of a task is A^T A, A = [J | r], over the
//! entries of the tables that move. How these follow from the fitted variables is applied to the sums.

use crate::error::Result;
use crate::observe::observed::{Lines, Measure, Modelled, RecordLines, Seen};
use crate::observe::ties::At;
use crate::simd::lane::{C, MAX_LANES, R};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Weighted residuals and their derivatives by some variables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Observation after observation, record after record: all real parts of the logarithm, then all imaginary
    /// parts, or percentages, or calculated less measured frequencies. Priors come last.
    pub residual: Vec<f64>,
    /// `(residuals, free variables)`.
    pub jacobian: Vec<f64>,
}

impl Modelled {
    pub(crate) fn rows_of_lines(
        &self,
        at: &At,
        moving: &[usize],
        count: usize,
        threads: usize,
    ) -> Result<Rows> {
        let Seen::Receptance { w, records, measure, .. } = &self.seen else { return Ok(Rows::default()) };
        let (lines, wide) = (w.len(), moving.len());
        let slopes = picked(at, moving, count);
        let parts = self.lines(at, threads, |Lines { range, h, dh, records }| {
            // Derivatives of the logarithm: real parts, then imaginary parts, a row a line.
            let mut change = [vec![0.0; h.len() * wide], vec![0.0; h.len() * wide]];
            let entries = dh.len() / h.len();
            for (line, h) in h.iter().enumerate() {
                for (dh, slopes) in dh[line * entries..].iter().zip(slopes.chunks(wide.max(1))).take(entries)
                {
                    let relative = dh / h;
                    for (k, slope) in slopes.iter().enumerate() {
                        change[0][line * wide + k] -= relative.re * slope;
                        change[1][line * wide + k] -= relative.im * slope;
                    }
                }
            }
            let own = records.iter().map(|record| {
                let log = record.measured.iter().zip(h).map(|(measured, h)| (measured / h).ln());
                log.collect::<Vec<_>>()
            });
            (range, change, own.collect::<Vec<_>>())
        })?;
        let numbers = match measure {
            Measure::Logarithm => 2,
            Measure::Percent => 1,
        };
        let count = numbers * lines * records.len();
        let mut rows = Rows { residual: vec![0.0; count], jacobian: vec![0.0; count * wide] };
        for (range, change, own) in parts {
            for (n, (record, logarithms)) in records.iter().zip(own).enumerate() {
                for (line, log) in range.clone().zip(logarithms) {
                    let from = (line - range.start) * wide;
                    // With q the ratio of the magnitudes, 100 (q - 1) changes by -100 q times the logarithm's change.
                    let percent = 100.0 * (-log.re).exp();
                    let (values, weight) = match measure {
                        Measure::Logarithm => ([log.re, log.im], record.weights[line]),
                        Measure::Percent => ([100.0 / percent - 1.0, 0.0], -percent * record.weights[line]),
                    };
                    for (part, value) in values.into_iter().take(numbers).enumerate() {
                        let row = (numbers * n + part) * lines + line;
                        rows.residual[row] = value * weight;
                        let into = rows.jacobian[row * wide..(row + 1) * wide].iter_mut();
                        for (into, change) in into.zip(&change[part][from..from + wide]) {
                            *into = change * weight;
                        }
                    }
                }
            }
        }
        Ok(rows)
    }

    pub(crate) fn rows_of_frequencies(&self, at: &At, moving: &[usize], count: usize) -> Result<Rows> {
        let slopes = picked(at, moving, count);
        let found = self.frequencies(at)?;
        let mut rows = Rows::default();
        for row in found {
            let Some((residual, entries)) = row.split_last() else { continue };
            rows.residual.push(*residual);
            let by = |k: usize| {
                let steps = entries.iter().enumerate();
                steps.map(|(i, entry)| entry * slopes[i * moving.len() + k]).sum::<f64>()
            };
            rows.jacobian.extend((0..moving.len()).map(by));
        }
        Ok(rows)
    }
}

/// The derivatives of entries and factors by the moving variables, row by row.
fn picked(at: &At, moving: &[usize], count: usize) -> Vec<f64> {
    at.slopes.chunks(count.max(1)).flat_map(|row| moving.iter().map(|&i| row[i])).collect()
}

impl Modelled {
    /// A^T A over the entries, factors and the residual, the upper triangle row by row.
    pub(crate) fn normal_of_lines(&self, at: &At, threads: usize) -> Result<Vec<f64>> {
        let arch = Arch::new();
        let parts =
            self.lines(at, threads, |Lines { h, dh, records, .. }| arch.dispatch(Sum { h, dh, records }))?;
        // Added in the order of the lines, whichever thread was first.
        let sum = parts.into_iter().reduce(|sum, part| sum.iter().zip(part).map(|(a, b)| a + b).collect());
        Ok(sum.unwrap_or_default())
    }
}

/// Adds B^T N B to a sum over the variables and the residual, B the derivatives of the entries by the variables.
pub(crate) fn spread(own: &[f64], slopes: &[f64], entries: usize, sum: &mut [f64], size: usize) {
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
    records: &'a [RecordLines<'a>],
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
            // Records of one model differ in the measured values alone: their derivatives are the same.
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
