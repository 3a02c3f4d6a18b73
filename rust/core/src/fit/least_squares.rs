//! Least squares within bounds on normal matrices: a trust-region method with an active set.
//!
//! With A = [J | r] all that a step needs is A^T A, a handful of numbers however many residuals there are. A step is the
//! least value of the Gauss-Newton parabola within the trust region and the bounds: a damping holds it in the region
//! (Moré, Lecture Notes in Mathematics 630, 1978), and an active-set method solves the damped problem within the bounds.
//! Variables are scaled to unit columns of J. SciPy's least squares is the reference of the tests.
//!
//! A step cut short where it first meets a bound, or its reflection there, as in the method of Branch, Coleman and Li
//! (1999), is no substitute for the least value within the bounds: with thirty variables some are always near a bound,
//! and most steps are cut to nothing.

use crate::error::Result;
use nalgebra::{Cholesky, DMatrix, DVector};

/// When a fit ends.
#[derive(Copy, Clone, Debug)]
pub struct Stop {
    /// Relative change of the cost and of the variables, and largest cosine between column and residual, at which it has converged.
    pub tolerance: f64,
    /// Decrease of the cost at which it has converged: the predicted decrease of the next step is no larger. If `SLOW`
    /// times this is at most `SETTLED`, it has converged as well where the last `PATIENCE` evaluations lowered the cost
    /// by less than that product: in a long curved valley the steps stay short, and the cost falls without an end.
    pub least: f64,
    /// Most evaluations.
    pub evaluations: usize,
}

/// Why a fit ended; the numbers are those of SciPy's least squares.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// The residuals have no value at the start.
    NoValue = -1,
    /// The evaluations were used up.
    Unfinished = 0,
    /// No slope is left that the bounds allow to follow.
    Gradient = 1,
    /// The cost changes no more.
    Cost = 2,
    /// The variables change no more.
    Step = 3,
}

/// Where a fit ended.
#[derive(Clone, Debug)]
pub struct End {
    /// The variables.
    pub x: Vec<f64>,
    /// Half the sum of squares.
    pub cost: f64,
    /// Half the sum of squares at the start; infinite where the residuals have no value there.
    pub first: f64,
    /// Evaluations of the normal matrix.
    pub evaluations: usize,
    /// Why it ended.
    pub status: Status,
    /// The normal matrix over all variables, at the end or a step away from it with a predicted decrease below the
    /// tolerance; empty where there was none.
    pub normal: Vec<f64>,
}

/// Share of the predicted decrease of the cost below which the region is made smaller.
const POOR: f64 = 0.25;

/// Share of the predicted decrease above which the next step may be taken without another evaluation.
const GOOD: f64 = 0.75;

/// Share of the radius from which on the region held a step back.
const FULL: f64 = 0.9;

/// Least and largest factor by which the region is made smaller.
const SMALLER: [f64; 2] = [0.1, 0.5];

/// Least inverse factor by which it is made larger.
const LARGER: f64 = 0.5;

/// Share of the range by which a start on a bound is moved inside.
const INSIDE: f64 = 1e-10;

/// Share of the distance to a bound that one step may go, so that a poor early step leaves no variable there.
const APPROACH: f64 = 0.3;

/// Share of the range; one step may reach a bound that is closer.
const CLOSE: f64 = 0.01;

/// Lengths of steps may differ from the region's radius by this share.
const LOOSE: f64 = 0.05;

/// Least damping, for variables scaled to unit columns: it keeps variables without effect where they are.
const LEAST_DAMPING: f64 = 1e-14;

/// Most trials of a damping.
const MOST_TRIALS: usize = 50;

/// Number of evaluations over which the decrease of the cost is compared.
const PATIENCE: usize = 10;

/// Multiple of the least decrease by one step: a fit has converged where `PATIENCE` evaluations lower the cost by less.
const SLOW: f64 = 250.0;

/// Largest such decrease, half of that by one standard error. Starts and trials, whose least decrease is larger, are not
/// ended by it, because they would end in worse optima.
const SETTLED: f64 = 0.25;

/// Share of the largest slope above which a slope moves a variable away from a bound.
const LEAVING: f64 = 1e-10;

/// Minimises half the sum of squares from a start within the bounds; variables that are not `free` are held there.
///
/// `normal` returns A^T A over all variables row by row, or nothing where the residuals have no value; a step is then
/// shortened. Where the last step lowered the cost as predicted and the predicted decrease of the next one is below
/// the tolerance, it is taken without another evaluation if it leads to a point that is `allowed`.
///
/// # Errors
/// Those of `normal` and `allowed`.
pub fn minimise(
    start: &[f64],
    bounds: [&[f64]; 2],
    free: &[bool],
    stop: Stop,
    mut normal: impl FnMut(&[f64]) -> Result<Option<Vec<f64>>>,
    allowed: impl Fn(&[f64]) -> Result<bool>,
) -> Result<End> {
    let size = start.len() + 1;
    let last = size * size - 1;
    let moving: Vec<usize> = (0..start.len()).filter(|&i| free[i]).collect();
    let pick = |values: &[f64]| DVector::from_iterator(moving.len(), moving.iter().map(|&i| values[i]));
    let all = |values: &DVector<f64>| {
        let mut all = start.to_vec();
        for (&i, value) in moving.iter().zip(values) {
            all[i] = *value;
        }
        all
    };
    let [lower, upper] = &bounds.map(pick);
    let mut x = inside(&pick(start), lower, upper, INSIDE);
    let Some(mut now) = normal(&all(&x))? else {
        let (cost, status) = (f64::INFINITY, Status::NoValue);
        return Ok(End { x: all(&x), cost, first: cost, evaluations: 1, status, normal: Vec::new() });
    };
    let first = 0.5 * now[last];
    let end = |x, cost, evaluations, status, normal| {
        Ok(End { x: all(&x), cost, first, evaluations, status, normal })
    };
    if moving.is_empty() {
        return end(x, first, 1, Status::Gradient, now);
    }
    let (mut region, mut foreseen) = (None, false);
    let mut evaluations = 1;
    // The cost after each evaluation since the first that lowered it.
    let mut costs: Vec<f64> = Vec::new();
    loop {
        let cost = 0.5 * now[last];
        let kept: Vec<usize> = moving.iter().copied().chain([start.len()]).collect();
        let own = DMatrix::from_fn(kept.len(), kept.len(), |i, j| now[kept[i] * size + kept[j]]);
        let local = Local::new(&x, [lower, upper], &own);
        if local.steepest < stop.tolerance {
            return end(x, cost, evaluations, Status::Gradient, now);
        }
        let mut radius = region.unwrap_or_else(|| local.first_radius(&x));
        loop {
            if evaluations >= stop.evaluations {
                return end(x, cost, evaluations, Status::Unfinished, now);
            }
            let Some(Step { scaled: step, predicted, whole, cut }) = local.step(radius) else {
                return end(x, cost, evaluations, Status::Step, now);
            };
            if whole && predicted <= stop.least {
                return end(x, cost, evaluations, Status::Cost, now);
            }
            let next = inside(&(&x + step.component_mul(&local.scale)), lower, upper, 0.0);
            if foreseen && whole && predicted < stop.tolerance * cost && allowed(&all(&next))? {
                return end(next, cost - predicted, evaluations, Status::Cost, now);
            }
            let found = normal(&all(&next))?;
            evaluations += 1;
            let (length, moved) = (step.norm(), (&next - &x).norm());
            let actual = found.as_ref().map_or(f64::NEG_INFINITY, |found| cost - 0.5 * found[last]);
            let ratio = if predicted > 0.0 { actual / predicted } else { 0.0 };
            let small = moved < stop.tolerance * (stop.tolerance + x.norm());
            let flat = actual < stop.tolerance * cost && ratio > POOR && !cut;
            if ratio < POOR {
                // To the least value of the parabola through both costs with the slope at the first.
                let slope = local.slope.dot(&step);
                let share = if actual.is_finite() { 0.5 * slope / (slope + actual) } else { POOR };
                radius = share.clamp(SMALLER[0], SMALLER[1]) * length;
            } else if length > FULL * radius {
                // The factor rises from 1 where half of the predicted decrease is reached (Nielsen, IMM-REP-1999-05).
                radius /= (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(LARGER, 1.0);
            }
            let better = actual > 0.0;
            if let (Some(found), true) = (found, better) {
                (x, now) = (next, found);
            }
            if better || !costs.is_empty() {
                costs.push(0.5 * now[last]);
            }
            let slow = SLOW * stop.least;
            if slow <= SETTLED
                && costs.len() > PATIENCE
                && costs[costs.len() - 1 - PATIENCE] - 0.5 * now[last] < slow
            {
                return end(x, 0.5 * now[last], evaluations, Status::Cost, now);
            }
            if small || (flat && actual.is_finite()) {
                let status = if flat { Status::Cost } else { Status::Step };
                return end(x, 0.5 * now[last], evaluations, status, now);
            }
            if better {
                (region, foreseen) = (Some(radius), ratio > GOOD);
                break;
            }
        }
    }
}

/// A point strictly within the bounds, by a share of their distance or by the next number.
fn inside(x: &DVector<f64>, lower: &DVector<f64>, upper: &DVector<f64>, share: f64) -> DVector<f64> {
    x.zip_zip_map(lower, upper, |x, lower, upper| {
        let range = upper - lower;
        let room = if range.is_finite() { share * range } else { 0.0 };
        let (low, high) = ((lower + room).max(lower.next_up()), (upper - room).min(upper.next_down()));
        if low < high { x.clamp(low, high) } else { 0.5 * lower + 0.5 * upper }
    })
}

/// A step in scaled variables.
struct Step {
    scaled: DVector<f64>,
    /// The decrease of the cost if the residuals are linear.
    predicted: f64,
    /// Whether it leads to the least value within the bounds: neither the region nor a limit before a bound holds it back.
    whole: bool,
    /// Whether a limit before a bound holds it back.
    cut: bool,
}

/// The limit at which a variable is held.
#[derive(Copy, Clone, PartialEq, Eq)]
enum Held {
    Free,
    Lower,
    Upper,
}

/// The problem about one point, in variables scaled to unit columns.
struct Local {
    /// From scaled to given variables.
    scale: DVector<f64>,
    curvature: DMatrix<f64>,
    slope: DVector<f64>,
    /// How far a step may go: to the bounds, or a share of the way.
    limits: [DVector<f64>; 2],
    /// Whether a limit is a bound.
    at_bound: [Vec<bool>; 2],
    /// The largest cosine between a column and the residual, times the room to the bound that the slope leads to as
    /// a share of the range.
    steepest: f64,
}

impl Local {
    /// From a normal matrix at `x`.
    fn new(x: &DVector<f64>, bounds: [&DVector<f64>; 2], normal: &DMatrix<f64>) -> Self {
        let n = x.len();
        let scale = DVector::from_fn(n, |i, _| {
            let size = normal[(i, i)].sqrt();
            if size > 0.0 { size.recip() } else { 1.0 }
        });
        let curvature = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j]);
        let slope = DVector::from_fn(n, |i, _| normal[(i, n)] * scale[i]);
        let range = bounds[1] - bounds[0];
        let residual = normal[(n, n)].sqrt();
        let mut steepest = 0.0_f64;
        for i in 0..n {
            // Small where a bound is near that the slope leads to.
            let distance = if slope[i] < 0.0 { bounds[1][i] - x[i] } else { x[i] - bounds[0][i] };
            let room = if range[i].is_finite() { distance / range[i] } else { 1.0 };
            if residual > 0.0 {
                steepest = steepest.max(slope[i].abs() / residual * room);
            }
        }
        let distances = bounds.map(|bound| bound - x);
        let reached = |i: usize, distance: f64| !range[i].is_finite() || distance.abs() <= CLOSE * range[i];
        let at_bound = distances.each_ref().map(|to| (0..n).map(|i| reached(i, to[i])).collect::<Vec<_>>());
        let limits = [0, 1].map(|side| {
            let share = |i: usize| if at_bound[side][i] { 1.0 } else { APPROACH };
            DVector::from_fn(n, |i, _| share(i) * distances[side][i] / scale[i])
        });
        Self { scale, curvature, slope, limits, at_bound, steepest }
    }

    /// Radius of the first region: the size of the start.
    fn first_radius(&self, x: &DVector<f64>) -> f64 {
        let radius = x.component_div(&self.scale).norm();
        if radius > 0.0 && radius.is_finite() { radius } else { 1.0 }
    }

    /// The best step within the region and the limits; nothing where no damping makes the problem convex.
    fn step(&self, radius: f64) -> Option<Step> {
        let mut held = vec![Held::Free; self.slope.len()];
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut damping = LEAST_DAMPING;
        // Whether no smaller damping makes the problem convex.
        let mut least = true;
        let mut best = None;
        for _ in 0..MOST_TRIALS {
            let Some((step, rate)) = self.damped(damping, &mut held) else {
                low = damping;
                damping *= 10.0;
                continue;
            };
            let length = step.norm();
            let off = length / radius - 1.0;
            let within = off <= LOOSE && least;
            best = Some((step, within, held.clone()));
            if within || off.abs() <= LOOSE {
                break;
            }
            least = false;
            if off > 0.0 {
                low = damping;
            } else {
                high = damping;
            }
            // Newton's method on one over the length.
            let newton = damping + off * length * length / rate;
            damping = if newton > low && newton < high {
                newton
            } else if high.is_finite() {
                (low.max(1e-3 * high) * high).sqrt()
            } else {
                10.0 * damping
            };
        }
        best.map(|(scaled, within, held)| {
            let cut = held.iter().enumerate().any(|(i, held)| match held {
                Held::Free => false,
                Held::Lower => !self.at_bound[0][i],
                Held::Upper => !self.at_bound[1][i],
            });
            let predicted = -scaled.dot(&(0.5 * (&self.curvature * &scaled) + &self.slope));
            Step { scaled, predicted, whole: within && !cut, cut }
        })
    }

    /// The least value of the damped parabola within the limits, and half the rate at which the square of the step's
    /// length falls with the damping; nothing where the parabola is not convex.
    ///
    /// An active-set method that begins with the variables that are `held`. Every step lowers the value, so that no set
    /// comes twice.
    fn damped(&self, damping: f64, held: &mut [Held]) -> Option<(DVector<f64>, f64)> {
        let n = self.slope.len();
        let [lower, upper] = &self.limits;
        let mut matrix = self.curvature.clone();
        for i in 0..n {
            matrix[(i, i)] += damping;
        }
        let value = |step: &DVector<f64>| step.dot(&(0.5 * (&matrix * step) + &self.slope));
        let limit = |i: usize, held: Held| match held {
            Held::Free => 0.0,
            Held::Lower => lower[i],
            Held::Upper => upper[i],
        };
        let mut step = DVector::from_fn(n, |i, _| limit(i, held[i]));
        let is_free = |held: &[Held]| held.iter().all(|held| *held == Held::Free);
        if !is_free(held) && value(&step) > 0.0 {
            held.fill(Held::Free);
            step.fill(0.0);
        }
        let mut rate = 0.0;
        for _ in 0..10 * (n + 1) {
            let free: Vec<usize> = (0..n).filter(|&i| held[i] == Held::Free).collect();
            let mut target = step.clone();
            if !free.is_empty() {
                let own = if free.len() < n {
                    matrix.select_rows(&free).select_columns(&free)
                } else {
                    matrix.clone()
                };
                let factor = Cholesky::new(own)?;
                let change = factor.solve(&(&self.slope + &matrix * &step).select_rows(&free));
                for (&i, change) in free.iter().zip(&change) {
                    target[i] -= change;
                }
                let own = factor.l_dirty().solve_lower_triangular(&target.select_rows(&free))?;
                rate = own.norm_squared();
            }
            let beyond = |i: usize| match target[i] {
                target if target < lower[i] => Held::Lower,
                target if target > upper[i] => Held::Upper,
                _ => Held::Free,
            };
            let passed: Vec<usize> = free.into_iter().filter(|&i| beyond(i) != Held::Free).collect();
            if passed.is_empty() {
                step = target;
                if is_free(held) {
                    break;
                }
                let slope = &self.slope + &matrix * &step;
                let least = LEAVING * self.slope.amax();
                let leaves = |i: usize| match held[i] {
                    Held::Free => false,
                    Held::Lower => slope[i] < -least,
                    Held::Upper => slope[i] > least,
                };
                let leaving: Vec<usize> = (0..n).filter(|&i| leaves(i)).collect();
                if leaving.is_empty() {
                    break;
                }
                for i in leaving {
                    held[i] = Held::Free;
                }
                continue;
            }
            // All limits at once where that is better, otherwise up to the first.
            let mut next =
                target.zip_zip_map(lower, upper, |target, lower, upper| target.max(lower).min(upper));
            let mut met = passed.clone();
            if value(&next) >= value(&step) {
                let share = |i: usize| (limit(i, beyond(i)) - step[i]) / (target[i] - step[i]);
                let least = passed.iter().map(|&i| share(i)).fold(f64::INFINITY, f64::min);
                met.retain(|&i| share(i) <= least);
                next = &step + least * (&target - &step);
            }
            for i in met {
                held[i] = beyond(i);
                next[i] = limit(i, held[i]);
            }
            step = next;
        }
        Some((step, rate))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Normal matrix of Rosenbrock's residuals 10 (y - x^2) and 1 - x.
    fn rosenbrock(x: &[f64]) -> Result<Option<Vec<f64>>> {
        let rows = [[-20.0 * x[0], 10.0, 10.0 * (x[1] - x[0] * x[0])], [-1.0, 0.0, 1.0 - x[0]]];
        let entry = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
        Ok(Some((0..9).map(|k| entry(k / 3, k % 3)).collect()))
    }

    fn fitted(
        start: &[f64],
        bounds: [&[f64]; 2],
        stop: Stop,
        normal: impl FnMut(&[f64]) -> Result<Option<Vec<f64>>>,
    ) -> End {
        minimise(start, bounds, &vec![true; start.len()], stop, normal, |_| Ok(true)).unwrap()
    }

    const STOP: Stop = Stop { tolerance: 1e-12, least: 0.0, evaluations: 200 };

    #[test]
    fn finds_a_minimum_inside() {
        let found = fitted(&[-1.2, 1.0], [&[-5.0, -5.0], &[5.0, 5.0]], STOP, rosenbrock);
        assert!(found.cost < 1e-20 && (found.x[0] - 1.0).abs() < 1e-9, "{found:?}");
        assert!(found.status as i32 > 0);
        // A region that does not grow when it should takes three times as many.
        assert!(found.evaluations < 30, "{}", found.evaluations);
    }

    #[test]
    fn finds_a_minimum_on_a_bound() {
        // With x <= 0.5 the best y is x^2, which leaves (1 - x)^2 / 2.
        let found = fitted(&[-1.2, 1.0], [&[-5.0, -5.0], &[0.5, 5.0]], STOP, rosenbrock);
        assert!((found.x[0] - 0.5).abs() < 1e-12 && (found.x[1] - 0.25).abs() < 1e-9, "{found:?}");
        assert!((found.cost - 0.125).abs() < 1e-12);
    }

    #[test]
    fn stays_where_there_is_a_value() {
        let walled = |x: &[f64]| if x[0] > 0.9 { Ok(None) } else { rosenbrock(x) };
        let found = fitted(&[-1.2, 1.0], [&[-5.0, -5.0], &[5.0, 5.0]], STOP, walled);
        assert!(found.x[0] > 0.89 && found.x[0] <= 0.9, "{found:?}");
        let nowhere = fitted(&[0.0, 0.0], [&[-1.0, -1.0], &[1.0, 1.0]], STOP, |_| Ok(None));
        assert_eq!(nowhere.status, Status::NoValue);
    }

    #[test]
    fn says_when_it_has_not_finished() {
        let stop = Stop { evaluations: 3, ..STOP };
        let found = fitted(&[-1.2, 1.0], [&[-5.0, -5.0], &[5.0, 5.0]], stop, rosenbrock);
        assert_eq!((found.status, found.evaluations), (Status::Unfinished, 3));
    }

    #[test]
    fn ends_where_the_next_step_promises_too_little() {
        let bounds = [&[-5.0, -5.0][..], &[5.0, 5.0]];
        let exact = fitted(&[-1.2, 1.0], bounds, STOP, rosenbrock);
        let rough = fitted(&[-1.2, 1.0], bounds, Stop { least: 1e-6, ..STOP }, rosenbrock);
        assert!(rough.evaluations <= exact.evaluations && rough.cost < 1e-5, "{rough:?}");
        let again = fitted(&rough.x, bounds, Stop { least: 1e-6, ..STOP }, rosenbrock);
        assert_eq!((again.evaluations, again.status, again.cost), (1, Status::Cost, again.first));
    }

    /// Normal matrix of a valley along y = x^2, in which every step is short and the last ones gain little.
    fn valley(x: &[f64]) -> Result<Option<Vec<f64>>> {
        let rows = [[-2e4 * x[0], 1e4, 1e4 * (x[1] - x[0] * x[0])], [0.1, 0.0, 0.1 * x[0] - 3.0]];
        let entry = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
        Ok(Some((0..9).map(|k| entry(k / 3, k % 3)).collect()))
    }

    #[test]
    fn ends_where_a_valley_is_long() {
        let bounds = [&[-50.0, -50.0][..], &[50.0, 2500.0]];
        let stop = Stop { evaluations: 5000, ..STOP };
        let exact = fitted(&[0.1, 0.0], bounds, stop, valley);
        let slow = fitted(&[0.1, 0.0], bounds, Stop { least: 1e-3, ..stop }, valley);
        assert!(slow.status == Status::Cost && 2 * slow.evaluations < exact.evaluations, "{slow:?}");
        // A trial ends only where the next step promises little.
        let trial = fitted(&[0.1, 0.0], bounds, Stop { least: 2e-3, ..stop }, valley);
        assert!(trial.evaluations > slow.evaluations && trial.cost < slow.cost, "{trial:?} {slow:?}");
    }

    #[test]
    fn bounds_may_be_open_on_one_side() {
        let bounds = [&[-5.0, f64::NEG_INFINITY][..], &[f64::INFINITY, 0.25]];
        let found = fitted(&[-1.2, 0.2], bounds, STOP, rosenbrock);
        assert!(found.status as i32 > 0, "{found:?}");
        assert!((found.x[1] - 0.25).abs() < 1e-9 && found.cost < 0.13, "{found:?}");
    }

    #[test]
    fn leaves_a_variable_without_effect_alone() {
        let flat = |x: &[f64]| {
            let off = x[1] - 2.0;
            Ok(Some(vec![0.0, 0.0, 0.0, 0.0, 1.0, off, 0.0, off, off * off]))
        };
        let found = fitted(&[0.3, 0.0], [&[0.0, 0.0], &[1.0, 3.0]], STOP, flat);
        assert!((found.x[1] - 2.0).abs() < 1e-9 && found.x[0] == 0.3, "{found:?}");
    }
}
