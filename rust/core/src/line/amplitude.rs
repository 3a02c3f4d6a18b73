//! Receptances of models with joints in micro-slip: at their stated levels, or on each line at the level that a force
//! brings about.
//!
//! Under a force of amplitude F the levels obey l = F |d(l)| / a_ref, d being the relative motions of the two sides of
//! the joints. They are found with the compliance G of the linear structure between these sides,
//! d = (1 + G K_added(l))^-1 d_0, and differentiated as an implicit function: dH = -d_r d_e dK.

use crate::error::{Error, Result};
use crate::line::response::linear;
use crate::model::assembly::{Model, Table};
use crate::model::frequencies::Frequencies;
use crate::model::request::{Coordinate, Parameter, Request, Response, check_parameters};
use crate::model::slip::Slip;
use crate::model::spring::Spring;
use crate::threads::on_threads;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

/// Share of the stiffness that may be lost where the search for a level begins.
const SMALL: f64 = 1e-3;

/// A step changes no level by more than this factor of e.
const LONGEST: f64 = 1.0;

/// Most steps of Newton's method, and most halves of one.
const MOST_STEPS: usize = 200;
const MOST_HALVES: usize = 20;

/// Difference of the logarithms of both sides at which a level is found, and beyond which there is none.
const CONVERGED: f64 = 1e-11;
const BALANCED: f64 = 1e-8;

/// Levels and motions below this are zero.
const LEAST: f64 = 1e-30;

/// Least time of the search on a line [ns].
const A_LINE: f64 = 2e3;

/// Column of c_y in the table of joints.
const DASHPOT: usize = 5;

/// Receptance and derivatives of a model at frequency lines.
///
/// # Errors
/// A line that is not a positive frequency, a coordinate or parameter that the model does not have, a singular
/// interface, a resonance without damping met exactly, or a joint that slides as a whole under the force.
pub fn receptance(model: &Model, lines: &Frequencies, request: &Request, threads: usize) -> Result<Response> {
    if request.force.is_empty() || model.slips.is_empty() {
        return linear(model, lines, request, threads);
    }
    check_force(lines, request)?;
    check_parameters(model, &unstated(&request.parameters))?;
    let slots = Slots::new(model);
    let rest = Model { slips: Vec::new(), ..model.clone() };
    let levels = slots.levels(&rest, lines, request, threads)?;
    let (asked, kinds) = slots.asked(&request.parameters);
    let responses = [&request.responses[..], &slots.sides].concat();
    let added = slots.on_joints(&levels, model.joints.len());
    let own = Request { responses, parameters: asked, added, force: Vec::new(), ..request.clone() };
    let found = linear(&rest, lines, &own, threads)?;
    let (count, sides) = (request.responses.len(), slots.sides.len());
    let mut out = Response { receptance: Vec::new(), derivative: Vec::new(), force: Vec::new() };
    for (line, h) in found.receptance.chunks(count + sides).enumerate() {
        out.receptance.extend_from_slice(&h[..count]);
        if kinds.is_empty() {
            continue;
        }
        let wide = own.parameters.len();
        let dh = &found.derivative[line * (count + sides) * wide..(line + 1) * (count + sides) * wide];
        let at = AtLine {
            line,
            slots: &slots,
            levels: &levels[line * slots.count()..(line + 1) * slots.count()],
            force: request.force[line],
            w: lines.angular(line),
            wide,
        };
        out.derivative.extend(at.derivatives(&kinds, h, dh, count)?);
    }
    Ok(out)
}

/// Parameters to check: under a force a level is not stated, so that its derivative is zero.
fn unstated(parameters: &[Parameter]) -> Vec<Parameter> {
    let column = |one: &Parameter| {
        if (one.table, one.column) == (Table::Slips, LEVEL) { LEVEL - 1 } else { one.column }
    };
    parameters.iter().map(|one| Parameter { column: column(one), ..*one }).collect()
}

fn check_force(lines: &Frequencies, request: &Request) -> Result<()> {
    let wrong = |what, index, value, expected: &str| {
        Err(Error::Index { what, index, value, expected: expected.to_owned() })
    };
    if request.force.len() != lines.len() {
        let value = request.force.len() as f64;
        return wrong("number of forces", 0, value, &format!("{}, one a line", lines.len()));
    }
    if request.excitations.len() != 1 {
        return wrong(
            "number of excitations",
            0,
            request.excitations.len() as f64,
            "one, where the force acts",
        );
    }
    if let Some(index) = request.force.iter().position(|force| !(force.is_finite() && *force > 0.0)) {
        return wrong("force", index, request.force[index], "a positive finite number of newtons");
    }
    if !lines.are_real() {
        return wrong("line under a force", 0, lines.angular(0).im, "a real frequency");
    }
    Ok(())
}

/// Column of the stated level in the table of slips.
const LEVEL: usize = 4;

/// Contributions to a derivative.
enum Kind {
    /// A derivative of the linear model.
    Plain(usize),
    /// A column of the table of slips.
    Column { slip: usize, column: usize },
    /// The stiffness of a slot.
    Stiffness(usize),
}

/// Translation and rotation of all joints in micro-slip, one after the other.
struct Slots {
    slips: Vec<Slip>,
    /// The spring of each joint.
    joints: Vec<Spring>,
    /// First side y and theta, second side y and theta of each joint.
    sides: Vec<Coordinate>,
}

impl Slots {
    fn new(model: &Model) -> Self {
        let springs = model.slips.iter().map(|slip| model.joints[slip.joint]);
        let sides = springs.clone().flat_map(|(nodes, _)| {
            nodes.into_iter().flat_map(|node| [0, 1].map(|direction| Coordinate { node, direction }))
        });
        Self {
            slips: model.slips.clone(),
            joints: springs.clone().map(|(_, spring)| spring).collect(),
            sides: sides.collect(),
        }
    }

    fn count(&self) -> usize {
        2 * self.slips.len()
    }

    /// Some pair of numbers of each joint, slot by slot, at some levels.
    fn each<T: Copy>(&self, levels: &[f64], pair: impl Fn(&Slip, [f64; 3], [f64; 2]) -> [T; 2]) -> Vec<T> {
        let joints = self.slips.iter().zip(&self.joints).zip(levels.chunks(2));
        joints.flat_map(|((slip, spring), level)| pair(slip, spring.k, [level[0], level[1]])).collect()
    }

    fn added(&self, levels: &[f64]) -> Vec<Complex64> {
        self.each(levels, Slip::added)
    }

    fn slopes(&self, levels: &[f64]) -> Vec<Complex64> {
        self.each(levels, |slip, k, level| {
            let slope = slip.by_level(k, level.map(|level| level.max(LEAST)));
            [0, 1].map(|i| if level[i] > 0.0 { slope[i] } else { Complex64::ZERO })
        })
    }

    fn shares(&self, levels: &[f64]) -> Vec<f64> {
        self.each(levels, |slip, _, level| slip.shares(level))
    }

    /// Force over the reference amplitude; zero where there is none.
    fn factors(&self, force: f64) -> Vec<f64> {
        let each = self.slips.iter().flat_map(|slip| slip.reference);
        each.map(|reference| if reference > 0.0 { force / reference } else { 0.0 }).collect()
    }

    /// Change of all joints by slip, line by line.
    fn on_joints(&self, levels: &[f64], joints: usize) -> Vec<Complex64> {
        let mut out = vec![Complex64::ZERO; levels.len() / self.count() * joints * 2];
        for (levels, out) in levels.chunks(self.count()).zip(out.chunks_mut(2 * joints)) {
            for (slip, added) in self.slips.iter().zip(self.added(levels).chunks(2)) {
                out[2 * slip.joint..2 * slip.joint + 2].copy_from_slice(added);
            }
        }
        out
    }

    /// The parameters for the linear model, last the dashpots of the joints, and the contributions to each derivative.
    fn asked(&self, parameters: &[Parameter]) -> (Vec<Parameter>, Vec<Kind>) {
        let mut asked = Vec::new();
        let mut kinds = Vec::new();
        for parameter in parameters {
            let slip = self.slips.iter().position(|slip| slip.joint == parameter.row);
            kinds.push(match (parameter.table, slip) {
                (Table::Slips, _) => Kind::Column { slip: parameter.row, column: parameter.column },
                (Table::Joints, Some(slip)) if parameter.column < 4 => {
                    Kind::Stiffness(2 * slip + parameter.column - 2)
                }
                _ => {
                    asked.push(*parameter);
                    Kind::Plain(asked.len() - 1)
                }
            });
        }
        if !kinds.is_empty() {
            for slip in &self.slips {
                let dashpot = |i| Parameter { table: Table::Joints, row: slip.joint, column: DASHPOT + i };
                asked.extend([dashpot(0), dashpot(1)]);
            }
        }
        (asked, kinds)
    }

    /// The levels under the force, line by line.
    fn levels(
        &self,
        rest: &Model,
        lines: &Frequencies,
        request: &Request,
        threads: usize,
    ) -> Result<Vec<f64>> {
        let own = Request {
            excitations: [&request.excitations[..], &self.sides].concat(),
            responses: self.sides.clone(),
            parameters: Vec::new(),
            force: Vec::new(),
            ..request.clone()
        };
        let found = linear(rest, lines, &own, threads)?.receptance;
        let a_line = self.sides.len() * (1 + self.sides.len());
        let tasks = lines.tasks();
        let at_least = A_LINE * tasks.first().map_or(0, |range| range.len()) as f64;
        let parts = on_threads(threads, tasks, at_least, |range| {
            let each = range.map(|line| {
                let h = &found[line * a_line..(line + 1) * a_line];
                self.level(h, request.force[line]).map_err(|reason| (line, reason))
            });
            each.collect::<core::result::Result<Vec<_>, _>>()
        })?;
        let mut levels = Vec::new();
        for part in parts {
            let part = part.map_err(|(line, (slot, most))| Error::GrossSlip {
                row: self.slips[slot / 2].joint,
                direction: ["y", "theta"][slot % 2],
                frequency_hz: lines.angular(line).re / core::f64::consts::TAU,
                force: request.force[line],
                most,
            })?;
            levels.extend(part.into_iter().flatten());
        }
        Ok(levels)
    }

    /// The levels on a line from the receptance of the sides under the force and under unit loads on the sides; else
    /// the slot of the largest share, and the most that may be lost there if that is exceeded.
    fn level(&self, h: &[Complex64], force: f64) -> core::result::Result<Vec<f64>, (usize, Option<f64>)> {
        let (count, wide) = (self.count(), 1 + self.sides.len());
        let row = |slot: usize, column: usize| {
            let first = 4 * (slot / 2) + slot % 2;
            h[first * wide + column] - h[(first + 2) * wide + column]
        };
        let start = DVector::from_fn(count, |slot, _| row(slot, 0));
        let compliance = DMatrix::from_fn(count, count, |slot, other| {
            let first = 1 + 4 * (other / 2) + other % 2;
            row(slot, first) - row(slot, first + 2)
        });
        let line = Line { slots: self, start, compliance, factors: self.factors(force) };
        let (levels, off) = line.solved();
        let shares = self.shares(&levels);
        let most = |slot: usize| self.slips[slot / 2].largest_share();
        let worst = (0..count).fold(0, |worst, slot| {
            if shares[slot] / most(slot) > shares[worst] / most(worst) { slot } else { worst }
        });
        if shares[worst] > most(worst) {
            return Err((worst, Some(most(worst))));
        }
        // Not a number is no balance.
        if off <= BALANCED { Ok(levels) } else { Err((worst, None)) }
    }
}

/// The balance of levels on one line.
struct Line<'a> {
    slots: &'a Slots,
    /// Relative motions of the linear structure under a unit load, and its compliance between the sides.
    start: DVector<Complex64>,
    compliance: DMatrix<Complex64>,
    factors: Vec<f64>,
}

impl Line<'_> {
    /// The levels, and how far off they are.
    ///
    /// Newton's method on ln l - ln |d(l)| = ln (F / a_ref), from a level at which the structure is still linear, with
    /// steps cut until they help: with one mode and one direction the left side only grows with l.
    fn solved(&self) -> (Vec<f64>, f64) {
        let count = self.factors.len();
        let linear: Vec<f64> =
            (0..count).map(|slot| (self.factors[slot] * self.start[slot].norm()).max(LEAST)).collect();
        let shares = self.slots.shares(&linear);
        let share = (0..count).filter(|&slot| self.factors[slot] > 0.0).map(|slot| shares[slot]);
        let share = share.fold(0.0_f64, f64::max);
        let first =
            self.slots.slips.iter().map(|slip| (SMALL / share.max(LEAST)).min(1.0).powf(1.0 / slip.exponent));
        let first = first.fold(1.0_f64, f64::min);
        let mut x = DVector::from_fn(count, |slot, _| (first * linear[slot]).ln());
        let (mut value, mut slope) = self.balance(&x);
        let mut off = largest(&value);
        for _ in 0..MOST_STEPS {
            if off <= CONVERGED {
                break;
            }
            let Some(step) = slope.lu().solve(&-&value) else { break };
            let step = &step * (LONGEST / step.amax().max(LEAST)).min(1.0);
            let size = value.norm();
            let mut share = 1.0;
            let mut next = &x + &step;
            let mut found = self.balance(&next);
            for _ in 0..MOST_HALVES {
                if found.0.norm() <= (1.0 - 1e-4 * share) * size {
                    break;
                }
                share *= 0.5;
                next = &x + &step * share;
                found = self.balance(&next);
            }
            x = next;
            (value, slope) = found;
            off = largest(&value);
        }
        let level = |slot: usize| if self.factors[slot] > 0.0 { x[slot].exp() } else { 0.0 };
        ((0..count).map(level).collect(), off)
    }

    /// ln l - ln |d(l)| - ln (F / a_ref) at x = ln l, and its derivative.
    fn balance(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let count = self.factors.len();
        let levels: Vec<f64> = x.iter().map(|x| x.exp()).collect();
        let added = self.slots.added(&levels);
        let rates = self.slots.slopes(&levels);
        let matrix = DMatrix::from_fn(count, count, |i, j| {
            self.compliance[(i, j)] * added[j] + if i == j { 1.0 } else { 0.0 }
        });
        let lu = matrix.lu();
        let none = || DVector::from_element(count, Complex64::new(f64::NAN, f64::NAN));
        let mut motion = lu.solve(&self.start).unwrap_or_else(none);
        for motion in motion.iter_mut() {
            if motion.norm() <= LEAST {
                *motion = LEAST.into();
            }
        }
        let moved = lu.solve(&self.compliance).unwrap_or_else(|| self.compliance.clone());
        let value = DVector::from_fn(count, |slot, _| match self.factors[slot] {
            factor if factor > 0.0 => x[slot] - (motion[slot].norm() * factor).ln(),
            _ => 0.0,
        });
        let slope = DMatrix::from_fn(count, count, |i, j| {
            let unit = if i == j { 1.0 } else { 0.0 };
            if self.factors[i] <= 0.0 {
                return unit;
            }
            let change = -moved[(i, j)] * motion[j] * rates[j] * levels[j];
            unit - (change / motion[i]).re
        });
        (value, slope)
    }
}

/// The largest modulus; not a number where one is none.
fn largest(values: &DVector<f64>) -> f64 {
    values.iter().fold(0.0, |most, value| if value.abs() <= most { most } else { value.abs() })
}

/// One line at its levels.
struct AtLine<'a> {
    line: usize,
    slots: &'a Slots,
    levels: &'a [f64],
    force: f64,
    w: Complex64,
    /// Derivatives of the linear model at each response.
    wide: usize,
}

impl AtLine<'_> {
    /// Derivatives at `count` responses, from receptance and derivatives there and at the sides.
    fn derivatives(
        &self,
        kinds: &[Kind],
        h: &[Complex64],
        dh: &[Complex64],
        count: usize,
    ) -> Result<Vec<Complex64>> {
        let slots = self.slots.count();
        let rows: Vec<&[Complex64]> = dh.chunks(self.wide).collect();
        let between = |slot: usize| {
            let first = count + 4 * (slot / 2) + slot % 2;
            rows[first].iter().zip(rows[first + 2]).map(|(a, b)| a - b).collect::<Vec<_>>()
        };
        let motion = |slot: usize| {
            let first = count + 4 * (slot / 2) + slot % 2;
            h[first] - h[first + 2]
        };
        let factors = self.slots.factors(self.force);
        let stiffness = self.slots.slopes(self.levels);
        // (1 - dg/dl) dl = dg with g = F |d| / a_ref.
        let mut system = DMatrix::<f64>::identity(slots, slots);
        let mut direct = DMatrix::<f64>::zeros(slots, kinds.len());
        for slot in 0..slots {
            let (row, motion) = (between(slot), motion(slot));
            let size = if motion.norm() > 0.0 { motion.norm() } else { 1.0 };
            let towards = motion.conj() * (factors[slot] / size);
            for (column, kind) in kinds.iter().enumerate() {
                direct[(slot, column)] = (towards * self.partial(kind, &row)).re;
                if let Kind::Column { slip, column: which @ (5 | 6) } = *kind
                    && 2 * slip + which - 5 == slot
                    && self.slots.slips[slip].reference[which - 5] > 0.0
                {
                    direct[(slot, column)] -= self.levels[slot] / self.slots.slips[slip].reference[which - 5];
                }
            }
            for other in 0..slots {
                system[(slot, other)] -= (towards * self.through(&row, other) * stiffness[other]).re;
            }
        }
        let Some(slopes) = system.lu().solve(&direct) else {
            let frequency_hz = self.w.re / core::f64::consts::TAU;
            return Err(Error::Resonance { line: self.line, frequency_hz });
        };
        let mut out = Vec::with_capacity(count * kinds.len());
        for row in &rows[..count] {
            for (column, kind) in kinds.iter().enumerate() {
                let by_levels: Complex64 = (0..slots)
                    .map(|slot| self.through(row, slot) * stiffness[slot] * slopes[(slot, column)])
                    .sum();
                out.push(self.partial(kind, row) + by_levels);
            }
        }
        Ok(out)
    }

    /// The derivative by the stiffness of a slot: that by the dashpot without the factor i w.
    fn through(&self, row: &[Complex64], slot: usize) -> Complex64 {
        row[self.wide - self.slots.count() + slot] / (Complex64::I * self.w)
    }

    /// The derivative by a parameter while the levels stay.
    fn partial(&self, kind: &Kind, row: &[Complex64]) -> Complex64 {
        let level = |slip: usize| [self.levels[2 * slip], self.levels[2 * slip + 1]];
        match *kind {
            Kind::Plain(index) => row[index],
            // Levels are not stated here.
            Kind::Column { column: LEVEL, .. } => Complex64::ZERO,
            Kind::Column { slip, column } => {
                let rates = self.slots.slips[slip].by_column(self.slots.joints[slip].k, level(slip), column);
                (0..2).map(|i| self.through(row, 2 * slip + i) * rates[i]).sum()
            }
            Kind::Stiffness(slot) => {
                let lost = self.slots.slips[slot / 2].lost(level(slot / 2))[slot % 2];
                let loss = Complex64::new(1.0, self.slots.joints[slot / 2].loss[slot % 2]);
                self.through(row, slot) * (loss - lost)
            }
        }
    }
}
