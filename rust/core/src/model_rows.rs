//! Residuals of whole models and their derivatives, row by row.

use crate::error::Result;
use crate::observed::{Lines, Modelled, Seen};
use crate::problem::Rows;
use crate::ties::At;

impl Modelled {
    pub(crate) fn rows_of_lines(
        &self,
        at: &At,
        moving: &[usize],
        count: usize,
        threads: usize,
    ) -> Result<Option<Rows>> {
        let Seen::Receptance { w, records, .. } = &self.seen else { return Ok(None) };
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
        let Some(parts) = parts else { return Ok(None) };
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
        Ok(Some(rows))
    }

    pub(crate) fn rows_of_frequencies(
        &self,
        at: &At,
        moving: &[usize],
        count: usize,
    ) -> Result<Option<Rows>> {
        let slopes = picked(at, moving, count);
        let Some(found) = self.frequencies(at)? else { return Ok(None) };
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
        Ok(Some(rows))
    }
}

/// The derivatives of entries and factors by the moving variables, row by row.
fn picked(at: &At, moving: &[usize], count: usize) -> Vec<f64> {
    at.slopes.chunks(count.max(1)).flat_map(|row| moving.iter().map(|&i| row[i])).collect()
}
