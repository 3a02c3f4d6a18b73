//! All complex natural frequencies in a sector of the plane, with a count that detects missing ones.
//!
//! They are the zeros of the determinant, which is analytic there and known by its logarithm. Newton's method finds
//! zeros from starts; each zero that is known is divided out. The change of the argument of the quotient around the
//! sector is 2 pi times the number of zeros that are not known yet (argument principle). Where that is not zero the
//! sector is divided until each part holds one zero, which the first moment of the logarithm locates well enough for
//! Newton's method. The sector is a rectangle in z = ln w, and all work is done in z: steps and distances are relative.

use crate::error::{Error, Result};
use crate::model::assembly::Model;
use crate::modes::determinant::Determinant;
use core::f64::consts::{PI, TAU};
use num_complex::Complex64;

/// Most steps of Newton's method, and the length in z of the last one and of the longest one.
const MOST_STEPS: usize = 30;
const CLOSE: f64 = 1e-11;
const LONGEST: f64 = 0.3;

/// Angle from the real axis that Newton's method does not leave.
const STEEPEST: f64 = 0.49 * PI;

/// Distance in z of the points between which a slope is taken.
const STEP: f64 = 1e-6;

/// Distance in z within which zeros are one, and how many neighbours in size are compared.
const SAME: f64 = 1e-7;
const NEIGHBOURS: usize = 8;

/// Spacing in z of the first points on a contour, and that at which it is given up: it runs through a zero.
const FIRST: f64 = 0.1;
const FINEST: f64 = 1e-9;

/// Between neighbouring points the logarithm changes by at most the first, and is straight to the second.
const TURN: f64 = 0.8;
const BEND: f64 = 0.2;

/// Where a part is divided; the next one where a zero lies on the dividing line.
const SPLITS: [f64; 3] = [0.47, 0.38, 0.59];

/// Parts of this size in z are not divided: two zeros this close are one to the search.
const SMALLEST: f64 = 1e-5;

/// Factors that are multiplied before a logarithm is taken.
const AT_ONCE: usize = 16;

/// The part of the plane between two radii in rad/s and two angles from the real axis.
#[derive(Copy, Clone, Debug)]
pub struct Sector {
    /// The smaller radius.
    pub inner: f64,
    /// The larger radius.
    pub outer: f64,
    /// The smaller angle.
    pub below: f64,
    /// The larger angle.
    pub above: f64,
}

/// The complex natural frequencies in a sector.
#[derive(Clone, Debug, PartialEq)]
pub struct Poles {
    /// Angular frequencies in rad/s, ascending by their modulus.
    pub angular: Vec<Complex64>,
    /// How many were counted and not found.
    pub missed: usize,
}

/// The complex natural frequencies of a model in a sector. Starts may lie anywhere with a positive real part.
///
/// # Errors
/// A sector that is none or that leaves the half plane of positive real parts, unusable starts, terminals, waves that are
/// too short for the lengths of the segments, or a natural frequency on the edge of the sector.
pub fn poles(model: &Model, sector: Sector, starts: &[Complex64]) -> Result<Poles> {
    let Sector { inner, outer, below, above } = sector;
    let within = -0.5 * PI < below && below < above && above < 0.5 * PI;
    if !(inner > 0.0 && inner < outer && outer.is_finite() && within) {
        let text = format!("radii {inner} to {outer} and angles {below} to {above} are no sector");
        return Err(Error::ComplexFrequency(text));
    }
    let mut search = Search { determinant: Determinant::new(model)?, known: Vec::new() };
    search.newton(starts)?;
    let Some(missed) = search.complete(sector)? else {
        return Err(Error::ComplexFrequency("one lies on the edge of the range that is searched".into()));
    };
    let angular = search.known.into_iter().filter(|w| sector.holds(*w)).collect();
    Ok(Poles { angular, missed })
}

impl Sector {
    /// Two parts, divided across the longer side in z.
    fn divided(self, share: f64) -> [Self; 2] {
        let ratio = self.outer / self.inner;
        if ratio.ln() >= self.above - self.below {
            let radius = self.inner * ratio.powf(share);
            return [Self { outer: radius, ..self }, Self { inner: radius, ..self }];
        }
        let angle = self.below + share * (self.above - self.below);
        [Self { above: angle, ..self }, Self { below: angle, ..self }]
    }

    /// Length of the longer side in z.
    fn size(self) -> f64 {
        (self.outer / self.inner).ln().max(self.above - self.below)
    }

    /// The corners in z, anticlockwise, the first one again at the end.
    fn corners(self) -> [Complex64; 5] {
        let (low, high) = (self.inner.ln(), self.outer.ln());
        let ends = [(low, self.below), (high, self.below), (high, self.above), (low, self.above)];
        [0, 1, 2, 3, 0].map(|i| Complex64::new(ends[i].0, ends[i].1))
    }

    fn holds(self, w: Complex64) -> bool {
        (self.inner..=self.outer).contains(&w.norm()) && (self.below..=self.above).contains(&w.arg())
    }
}

struct Search {
    determinant: Determinant,
    /// Zeros, ascending by their modulus.
    known: Vec<Complex64>,
}

impl Search {
    /// Adds the zeros that Newton's method finds from the starts; whether any was new.
    fn newton(&mut self, starts: &[Complex64]) -> Result<bool> {
        let mut open: Vec<Complex64> = starts.iter().map(|w| w.ln()).collect();
        let mut found = self.known.clone();
        for _ in 0..MOST_STEPS {
            if open.is_empty() {
                break;
            }
            let ends: Vec<Complex64> =
                open.iter().flat_map(|z| [(z - STEP).exp(), (z + STEP).exp()]).collect();
            let values = self.determinant.logarithm(&ends)?;
            let mut left = Vec::with_capacity(open.len());
            for (z, ends) in open.iter().zip(values.chunks(2)) {
                let w = z.exp();
                // (d+ - d-) / (d+ + d-) from the logarithms, which holds at the zero itself.
                let slope = (0.5 * (ends[1] - ends[0])).tanh() / STEP;
                let others: Complex64 = self.known.iter().map(|other| w / (w - other)).sum();
                let step = -(slope - others).inv();
                let next = z + step * (LONGEST / step.norm().max(f64::MIN_POSITIVE)).min(1.0);
                if step.norm() <= CLOSE {
                    found.push(next.exp());
                } else if next.is_finite() && next.im.abs() < STEEPEST {
                    left.push(next);
                }
            }
            open = left;
        }
        found.sort_by(|a, b| a.norm().total_cmp(&b.norm()).then(a.im.total_cmp(&b.im)));
        let before = self.known.len();
        self.known.clear();
        for w in found.into_iter().filter(|w| w.is_finite()) {
            let near = |other: &Complex64| (w - other).norm() <= SAME * w.norm();
            if !self.known.iter().rev().take(NEIGHBOURS).any(near) {
                self.known.push(w);
            }
        }
        Ok(self.known.len() > before)
    }

    /// Finds the zeros that are not known yet; how many of them were not found, or nothing where one lies on the edge.
    fn complete(&mut self, sector: Sector) -> Result<Option<usize>> {
        let Some(mut unknown) = self.unknown(sector)? else { return Ok(None) };
        if unknown.0 == 1 && self.newton(&[unknown.1])? {
            let Some(again) = self.unknown(sector)? else { return Ok(None) };
            unknown = again;
        }
        let (count, centre) = unknown;
        if count <= 0 {
            return Ok(Some(count.unsigned_abs()));
        }
        if sector.size() <= SMALLEST {
            self.newton(&[centre])?;
            return Ok(self.unknown(sector)?.map(|(count, _)| count.max(0).unsigned_abs()));
        }
        for share in SPLITS {
            let [first, second] = sector.divided(share);
            if let Some(first) = self.complete(first)?
                && let Some(second) = self.complete(second)?
            {
                return Ok(Some(first + second));
            }
        }
        Ok(Some(count.unsigned_abs()))
    }

    /// How many zeros are not known, and the mean of their places in z as a number w.
    fn unknown(&self, sector: Sector) -> Result<Option<(isize, Complex64)>> {
        let (mut turns, mut moment) = (Complex64::ZERO, Complex64::ZERO);
        for ends in sector.corners().windows(2) {
            let Some((z, values)) = self.edge(ends[0], ends[1])? else { return Ok(None) };
            for (z, values) in z.windows(2).zip(values.windows(2)) {
                let change = wrapped(values[1] - values[0]);
                turns += change;
                moment += 0.5 * (z[0] + z[1]) * change;
            }
        }
        let count = (turns.im / TAU).round();
        if count == 0.0 {
            return Ok(Some((0, Complex64::ONE)));
        }
        Ok(Some((count as isize, (moment / Complex64::new(0.0, TAU * count)).exp())))
    }

    /// Points along an edge, close enough for the changes between them, and the quotient's logarithm; nothing where the
    /// edge runs through a zero.
    fn edge(&self, start: Complex64, end: Complex64) -> Result<Option<(Vec<Complex64>, Vec<Complex64>)>> {
        let count = 2 * ((end - start).norm() / FIRST).ceil() as usize;
        let mut z: Vec<Complex64> =
            (0..=count).map(|i| start + (end - start) * (i as f64 / count as f64)).collect();
        let mut values = self.quotient(&z)?;
        loop {
            let change: Vec<Complex64> = values.windows(2).map(|pair| wrapped(pair[1] - pair[0])).collect();
            // A point is judged by its neighbours; both intervals beside it are divided.
            let bent = |i: usize| i > 0 && i < change.len() && (change[i] - change[i - 1]).norm() > BEND;
            let rough =
                |i: usize| !change[i].is_finite() || change[i].norm() > TURN || bent(i) || bent(i + 1);
            let rough: Vec<usize> = (0..change.len()).filter(|&i| rough(i)).collect();
            if rough.is_empty() {
                return Ok(Some((z, values)));
            }
            if rough.iter().any(|&i| (z[i + 1] - z[i]).norm() < FINEST) {
                return Ok(None);
            }
            let middle: Vec<Complex64> = rough.iter().map(|&i| 0.5 * (z[i] + z[i + 1])).collect();
            let between = self.quotient(&middle)?;
            let (mut more, mut finer) =
                (rough.iter().zip(middle.into_iter().zip(between)).peekable(), Vec::new());
            for (i, point) in z.into_iter().zip(values).enumerate() {
                finer.push(point);
                if let Some((_, point)) = more.next_if(|(after, _)| **after == i) {
                    finer.push(point);
                }
            }
            (z, values) = finer.into_iter().unzip();
        }
    }

    /// The logarithm of the determinant without the known zeros.
    fn quotient(&self, z: &[Complex64]) -> Result<Vec<Complex64>> {
        let w: Vec<Complex64> = z.iter().map(|z| z.exp()).collect();
        let mut values = self.determinant.logarithm(&w)?;
        for ((value, z), w) in values.iter_mut().zip(z).zip(&w) {
            *value -= z * self.known.len() as f64;
            for some in self.known.chunks(AT_ONCE) {
                *value -= some.iter().map(|known| 1.0 - known / w).product::<Complex64>().ln();
            }
        }
        Ok(values)
    }
}

/// A difference of logarithms with an imaginary part from -pi to pi.
fn wrapped(change: Complex64) -> Complex64 {
    Complex64::new(change.re, (change.im + PI).rem_euclid(TAU) - PI)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::assembly::Tables;
    use crate::model::section::{Motion, cylinder};
    use crate::modes::natural::natural_frequencies;

    #[test]
    fn a_lossy_bar_without_starts() {
        let bar = cylinder([0.0, 1.0, 0.2, 0.02, 0.0, 2e11, 7850.0, 0.3, 0.02]);
        let model = Model::new(Motion::Bending, Tables { segments: &bar, ..Tables::default() }).unwrap();
        let undamped = natural_frequencies(&model, Some(2e5), 100, &[]).unwrap().angular;
        let sector = Sector { inner: 100.0, outer: 2e5, below: -0.5, above: 1.1 };
        let found = poles(&model, sector, &[]).unwrap();
        assert_eq!((found.angular.len(), found.missed), (undamped.len(), 0));
        for (w, undamped) in found.angular.iter().zip(undamped) {
            assert!((w - undamped * Complex64::new(1.0, 0.02).sqrt()).norm() < 1e-9 * undamped, "{w}");
        }
        let through = Sector { outer: found.angular[2].norm(), ..sector };
        assert!(matches!(poles(&model, through, &[]), Err(Error::ComplexFrequency(_))));
        assert!(poles(&model, Sector { below: 1.2, ..sector }, &[]).is_err());
    }
}
