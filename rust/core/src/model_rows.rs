//! Residuals of whole models and their derivatives, row by row.

use crate::model_fit::Campaign;
use crate::observed::{Lines, Modelled, Seen};
use crate::ties::At;

/// Weighted residuals and their derivatives by some variables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Observation after observation, record after record: all real parts of the logarithm, then all imaginary
    /// parts, or calculated less measured frequencies.
    pub residual: Vec<f64>,
    /// `(residuals, free variables)`.
    pub jacobian: Vec<f64>,
}

impl Campaign<'_> {
    /// Residuals and their derivatives by the variables that are `free`; nothing where a model has no value. What is
    /// known beforehand is not among them.
    pub fn rows(&self, x: &[f64], free: &[bool], threads: usize) -> Option<Rows> {
        let moving: Vec<usize> = (0..x.len()).filter(|&i| free[i]).collect();
        let parts = self.each(x, free, threads, |one, at, threads| match one.seen {
            Seen::Receptance { .. } => one.rows_of_lines(at, &moving, x.len(), threads),
            Seen::Frequencies { .. } => one.rows_of_frequencies(at, &moving, x.len()),
        })?;
        let mut rows = Rows::default();
        for (part, _) in parts {
            rows.residual.extend(part.residual);
            rows.jacobian.extend(part.jacobian);
        }
        let finite = rows.residual.iter().chain(&rows.jacobian).all(|value| value.is_finite());
        finite.then_some(rows)
    }
}

impl Modelled<'_> {
    fn rows_of_lines(&self, at: &At, moving: &[usize], count: usize, threads: usize) -> Option<Rows> {
        let Seen::Receptance { w, ref records, .. } = self.seen else { return None };
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
                log.zip(record.weights).map(|(log, weight)| log * weight).collect::<Vec<_>>()
            });
            (range, change, own.collect::<Vec<_>>())
        })?;
        let mut rows = Rows {
            residual: vec![0.0; 2 * lines * records.len()],
            jacobian: vec![0.0; 2 * lines * records.len() * wide],
        };
        for (range, change, own) in parts {
            for (n, (record, residual)) in records.iter().zip(own).enumerate() {
                for (line, residual) in range.clone().zip(residual) {
                    let weight = record.weights[line];
                    let from = (line - range.start) * wide;
                    for (part, value) in [residual.re, residual.im].into_iter().enumerate() {
                        let row = (2 * n + part) * lines + line;
                        rows.residual[row] = value;
                        let into = rows.jacobian[row * wide..(row + 1) * wide].iter_mut();
                        for (into, change) in into.zip(&change[part][from..from + wide]) {
                            *into = change * weight;
                        }
                    }
                }
            }
        }
        Some(rows)
    }

    fn rows_of_frequencies(&self, at: &At, moving: &[usize], count: usize) -> Option<Rows> {
        let slopes = picked(at, moving, count);
        let mut rows = Rows::default();
        for row in self.frequencies(at)? {
            let (residual, entries) = row.split_last()?;
            rows.residual.push(*residual);
            let by = |k: usize| {
                let steps = entries.iter().enumerate();
                steps.map(|(i, entry)| entry * slopes[i * moving.len() + k]).sum::<f64>()
            };
            rows.jacobian.extend((0..moving.len()).map(by));
        }
        Some(rows)
    }
}

/// The derivatives of entries and factors by the moving variables, row by row.
fn picked(at: &At, moving: &[usize], count: usize) -> Vec<f64> {
    at.slopes.chunks(count.max(1)).flat_map(|row| moving.iter().map(|&i| row[i])).collect()
}
