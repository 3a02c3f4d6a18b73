//! Complex natural frequencies and their derivatives, each followed from an undamped one.
//!
//! A receptance H has a pole at w = |w| (sqrt(1 - zeta^2) + i zeta) with exp(iwt). Newton's method on 1 / H finds it,
//! w <- w + H / (dH/dw), and from 1 / H = 0 follows dw/da = -(dH/da) / (dH/dw). H is the receptance at the first node,
//! a free end that moves in every mode. The damping grows from nothing to its value in one step where the derivative by
//! the damping confirms that both ends are the same mode, else in as many steps as that takes.

use crate::error::{Error, Result};
use crate::interrupt;
use crate::line::response::linear;
use crate::model::assembly::Model;
use crate::model::frequencies::Frequencies;
use crate::model::request::{Coordinate, Parameter, Request};
use num_complex::Complex64;

/// Most steps of Newton's method.
const MOST_STEPS: usize = 30;

/// Relative length of the last step; the derivative before it is as accurate.
const SETTLED: f64 = 1e-7;

/// Relative distance in one step of the damping beyond which there is another mode, or none.
const FARTHEST: f64 = 0.5;

/// How far a step of the damping may be from straight: as a share of its length, and of the frequency.
const BENT: f64 = 0.5;
const STILL: f64 = 1e-4;

/// The shortest step, as a share of the damping.
const SHORTEST: f64 = 1e-4;

/// Relative distance within which two frequencies are one.
const SAME: f64 = 1e-7;

/// Complex natural frequencies with derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct ComplexFrequencies {
    /// Angular frequencies in rad/s, in the order of the undamped ones.
    pub angular: Vec<Complex64>,
    /// `(n_modes, n_parameters)`.
    pub derivative: Vec<Complex64>,
}

/// The complex natural frequencies that undamped ones (rad/s) become under the damping of a model, with derivatives.
///
/// Joints in micro-slip are at their stated levels.
///
/// # Errors
/// A parameter that the model does not have, a mode that cannot be followed because it ceases to oscillate or meets
/// another one, and those of `receptance`.
pub fn complex_frequencies(
    model: &Model,
    undamped: &[f64],
    parameters: &[Parameter],
) -> Result<ComplexFrequencies> {
    let path = Path::new(model, parameters);
    let starts: Vec<Complex64> = undamped.iter().map(|w| Complex64::new(*w, 0.0)).collect();
    let whole = path.poles(&starts, 1.0)?;
    let mut found = ComplexFrequencies { angular: Vec::new(), derivative: Vec::new() };
    for (&start, whole) in starts.iter().zip(whole) {
        let pole = match whole.filter(|pole| path.leads_to(start, 1.0, pole)) {
            Some(pole) => pole,
            None => path.followed(start)?,
        };
        if found.angular.iter().any(|other| (pole.w - other).norm() <= SAME * pole.w.norm()) {
            let hz = hertz(start);
            return Err(Error::ComplexFrequency(format!(
                "damping moves the mode at {hz:.6} Hz onto another one"
            )));
        }
        found.angular.push(pole.w);
        found.derivative.extend_from_slice(&pole.slopes[..parameters.len()]);
    }
    Ok(found)
}

/// Complex natural frequencies of a model as functions of a share of its damping.
struct Path<'a> {
    model: &'a Model,
    /// The receptance at the first node, with its derivatives by the parameters and by the entries below.
    request: Request,
    /// Places among the parameters of the request, and their weights in the derivative by frequency at full damping.
    by_frequency: Vec<(usize, f64)>,
    /// Places of the dashpots and loss factors, and their values at full damping.
    damping: Vec<(usize, f64)>,
}

/// A complex natural frequency.
struct Pole {
    w: Complex64,
    /// Derivatives by the parameters of the request.
    slopes: Vec<Complex64>,
    /// Derivative by the share of the damping.
    by_share: Complex64,
}

impl<'a> Path<'a> {
    fn new(model: &'a Model, parameters: &[Parameter]) -> Self {
        let mut asked = parameters.to_vec();
        let mut placed = |entries: Vec<(Parameter, f64)>| -> Vec<(usize, f64)> {
            let place = |(entry, value)| {
                let known = asked.iter().position(|other| *other == entry);
                let place = known.unwrap_or_else(|| {
                    asked.push(entry);
                    asked.len() - 1
                });
                (place, value)
            };
            entries.into_iter().map(place).collect()
        };
        let (by_frequency, damping) = (placed(model.frequency_weights()), placed(model.damping()));
        let tip = vec![Coordinate { node: 0, direction: 0 }];
        let request =
            Request { excitations: tip.clone(), responses: tip, parameters: asked, ..Request::default() };
        Self { model, request, by_frequency, damping }
    }

    /// The natural frequency that an undamped one becomes.
    fn followed(&self, undamped: Complex64) -> Result<Pole> {
        let (mut place, mut share, mut step) = (undamped, 0.0, 0.5);
        // Slip changes the stiffness as well, so that modes without damping are not the undamped ones.
        while step >= SHORTEST && self.model.slips.is_empty() {
            interrupt::check()?;
            let target = f64::min(1.0, share + step);
            let found = self.poles(&[place], target)?.pop().flatten();
            match found.filter(|pole| self.leads_to(place, target - share, pole)) {
                Some(pole) if target >= 1.0 => return Ok(pole),
                Some(pole) => (place, share, step) = (pole.w, target, 2.0 * step),
                None => step *= 0.5,
            }
        }
        let hz = hertz(undamped);
        let text = format!("damping moves the mode at {hz:.6} Hz further than it can be followed");
        Err(Error::ComplexFrequency(text))
    }

    /// Whether a pole is the mode that was at `start` with so much less of the damping: its slope leads back there.
    fn leads_to(&self, start: Complex64, share: f64, pole: &Pole) -> bool {
        let off = (pole.w - pole.by_share * share - start).norm();
        let straight = off <= BENT * (pole.w - start).norm() + STILL * pole.w.norm();
        straight || !self.model.slips.is_empty()
    }

    /// The poles near some lines with a share of the damping; nothing where Newton's method leads far away.
    fn poles(&self, starts: &[Complex64], share: f64) -> Result<Vec<Option<Pole>>> {
        let model = self.model.with_damping(share);
        let lossy = |place: usize| self.damping.iter().any(|(other, _)| *other == place);
        let weight =
            |&(place, weight): &(usize, f64)| (place, if lossy(place) { share * weight } else { weight });
        let by_frequency: Vec<(usize, f64)> = self.by_frequency.iter().map(weight).collect();
        let count = self.request.parameters.len();
        let mut lines = starts.to_vec();
        let mut open: Vec<usize> = (0..lines.len()).collect();
        let mut found: Vec<Option<Pole>> = starts.iter().map(|_| None).collect();
        for _ in 0..MOST_STEPS {
            if open.is_empty() {
                break;
            }
            let w: Vec<Complex64> = open.iter().map(|&index| lines[index]).collect();
            let at = linear(&model, &Frequencies::complex(&w, 1.0), &self.request, 1)?;
            let mut left = Vec::with_capacity(open.len());
            for ((&index, h), dh) in open.iter().zip(&at.receptance).zip(at.derivative.chunks(count)) {
                let sum = |weights: &[(usize, f64)], of: &[Complex64]| -> Complex64 {
                    weights.iter().map(|&(place, weight)| of[place] * weight).sum()
                };
                let by_line = sum(&by_frequency, dh) / lines[index];
                let step = h / by_line;
                lines[index] += step;
                let line = lines[index];
                let far = (line - starts[index]).norm() > FARTHEST * starts[index].norm();
                if !line.is_finite() || far || line.re <= 0.0 {
                    continue;
                }
                if step.norm() > SETTLED * line.norm() {
                    left.push(index);
                    continue;
                }
                let slopes: Vec<Complex64> = dh.iter().map(|slope| -slope / by_line).collect();
                let by_share = sum(&self.damping, &slopes);
                found[index] = Some(Pole { w: line, slopes, by_share });
            }
            open = left;
        }
        Ok(found)
    }
}

fn hertz(w: Complex64) -> f64 {
    w.re / core::f64::consts::TAU
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::assembly::{Table, Tables};
    use crate::model::section::Motion;

    const MASS: f64 = 2.0;
    const K: f64 = 8e6;

    /// A mass on two equal springs with dashpots in series, one a joint and one to ground: half of each of them.
    fn oscillator(c: f64) -> Model {
        let tables = Tables {
            joints: &[0.0, 1.0, 2.0 * K, 0.0, 0.0, 2.0 * c, 0.0, 0.0, 0.0],
            masses: &[0.0, MASS, 0.0],
            grounds: &[1.0, 2.0 * K, 0.0, 0.0, 2.0 * c, 0.0, 0.0, 0.0],
            ..Tables::default()
        };
        Model::new(Motion::Axial, tables).unwrap()
    }

    #[test]
    fn a_mass_on_springs_and_dashpots() {
        // m w^2 - i c w - k = 0, and the derivative of its root by m.
        let undamped = f64::sqrt(K / MASS);
        let of_mass = [Parameter { table: Table::Masses, row: 0, column: 1 }];
        for zeta in [0.0, 0.01, 0.3, 0.8] {
            let c = 2.0 * zeta * f64::sqrt(K * MASS);
            let found = complex_frequencies(&oscillator(c), &[undamped * (1.0 + 1e-9)], &of_mass).unwrap();
            let exact = undamped * Complex64::new(f64::sqrt(1.0 - zeta * zeta), zeta);
            assert!((found.angular[0] - exact).norm() < 1e-12 * undamped, "{zeta}");
            let slope = -exact * exact / (2.0 * MASS * exact - Complex64::I * c);
            assert!((found.derivative[0] - slope).norm() < 1e-6 * slope.norm(), "{zeta}");
        }
    }

    #[test]
    fn a_mode_that_ceases_to_oscillate() {
        let model = oscillator(2.5 * f64::sqrt(K * MASS));
        let found = complex_frequencies(&model, &[f64::sqrt(K / MASS)], &[]);
        assert!(matches!(found, Err(Error::ComplexFrequency(_))), "{found:?}");
    }
}
