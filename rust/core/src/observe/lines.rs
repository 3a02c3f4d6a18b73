//! Residuals of whole models with their derivatives, row by row, and their normal matrices.
//!
//! The derivatives of the lines stay where they are computed: the result of a task is A^T A, A = [J | r], over the
//! variables that move the model. Each of them moves few of the entries of the tables.

use crate::error::Result;
use crate::observe::observed::{Lines, Measure, Modelled, RecordLines, Seen};
use crate::observe::ties::{At, Column};
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
        let columns = at.columns(moving, count);
        let own = columns.len();
        let parts = self.lines(at, threads, |Lines { range, h, dh, records }| {
            // Derivatives of the logarithm, a row a line.
            let mut change = Vec::with_capacity(h.len() * own);
            let entries = dh.len() / h.len();
            for (h, dh) in h.iter().zip(dh.chunks(entries.max(1))) {
                change.extend(columns.iter().map(|column| -column.combine(dh) / h));
            }
            let logarithms = records.iter().map(|record| {
                let log = record.measured.iter().zip(h).map(|(measured, h)| (measured / h).ln());
                log.collect::<Vec<_>>()
            });
            (range, change, logarithms.collect::<Vec<_>>())
        })?;
        let numbers = match measure {
            Measure::Logarithm => 2,
            Measure::Percent => 1,
        };
        let count = numbers * lines * records.len();
        let mut rows = Rows { residual: vec![0.0; count], jacobian: vec![0.0; count * wide] };
        for (range, change, logarithms) in parts {
            for (n, (record, logarithms)) in records.iter().zip(logarithms).enumerate() {
                for (line, log) in range.clone().zip(logarithms) {
                    let change = &change[(line - range.start) * own..][..own];
                    // With q the ratio of the magnitudes, 100 (q - 1) changes by -100 q times the logarithm's change.
                    let percent = 100.0 * (-log.re).exp();
                    let (values, weight) = match measure {
                        Measure::Logarithm => ([log.re, log.im], record.weights[line]),
                        Measure::Percent => ([100.0 / percent - 1.0, 0.0], -percent * record.weights[line]),
                    };
                    for (part, value) in values.into_iter().take(numbers).enumerate() {
                        let row = (numbers * n + part) * lines + line;
                        rows.residual[row] = value * weight;
                        for (column, change) in columns.iter().zip(change) {
                            let change = if part == 0 { change.re } else { change.im };
                            rows.jacobian[row * wide + column.place] = change * weight;
                        }
                    }
                }
            }
        }
        Ok(rows)
    }

    pub(crate) fn rows_of_frequencies(&self, at: &At, moving: &[usize], count: usize) -> Result<Rows> {
        let columns = at.columns(moving, count);
        let found = self.frequencies(at)?;
        let wide = moving.len();
        let mut rows = Rows { residual: Vec::new(), jacobian: vec![0.0; found.len() * wide] };
        for (n, row) in found.iter().enumerate() {
            let Some((residual, entries)) = row.split_last() else { continue };
            rows.residual.push(*residual);
            for column in &columns {
                rows.jacobian[n * wide + column.place] = column.combine(entries);
            }
        }
        Ok(rows)
    }
}

impl Modelled {
    /// A^T A over some variables and the residual, the upper triangle row by row.
    pub(crate) fn normal_of_lines(&self, at: &At, columns: &[Column], threads: usize) -> Result<Vec<f64>> {
        let arch = Arch::new();
        let parts = self.lines(at, threads, |Lines { h, dh, records, .. }| {
            arch.dispatch(Sum { h, dh, records, columns })
        })?;
        // Added in the order of the lines, whichever thread was first.
        let sum = parts.into_iter().reduce(|sum, part| sum.iter().zip(part).map(|(a, b)| a + b).collect());
        Ok(sum.unwrap_or_default())
    }
}

/// Adds an upper triangle over some variables and the residual, which have these places, to a matrix over all.
pub(crate) fn spread(own: &[f64], places: &[usize], sum: &mut [f64], size: usize) {
    let mut entries = own.iter();
    for (i, &row) in places.iter().enumerate() {
        for (j, (&column, value)) in places[i..].iter().zip(&mut entries).enumerate() {
            sum[row * size + column] += value;
            if j > 0 {
                sum[column * size + row] += value;
            }
        }
    }
}

/// The upper triangle of A^T A of the lines of one task.
struct Sum<'a> {
    h: &'a [Complex64],
    dh: &'a [Complex64],
    records: &'a [RecordLines<'a>],
    columns: &'a [Column],
}

impl WithSimd for Sum<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f64> {
        let (entries, count) = (self.dh.len() / self.h.len().max(1), self.columns.len());
        let mut sums = vec![simd.splat_f64s(0.0); (count + 1) * (count + 2) / 2];
        let (mut changes, mut rows) = (vec![C::zero(simd); entries], vec![C::zero(simd); count]);
        let mut lanes = [Complex64::ZERO; MAX_LANES];
        let mut start = 0;
        while start < self.h.len() {
            let end = self.h.len().min(start + S::F64_LANES);
            let inverse = C::load(simd, &self.h[start..end]).recip();
            for k in 0..entries {
                for (lane, line) in (start..end).enumerate() {
                    // The residual falls as the model's receptance grows.
                    lanes[lane] = -self.dh[line * entries + k];
                }
                changes[k] = C::load(simd, &lanes[..end - start]);
            }
            for (row, column) in rows.iter_mut().zip(self.columns) {
                let mut sum = C::zero(simd);
                for (entry, slope) in &column.slopes {
                    sum = changes[*entry].mul_add_real(simd.splat_f64s(*slope), sum);
                }
                *row = sum * inverse;
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
