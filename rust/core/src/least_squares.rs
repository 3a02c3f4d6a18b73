//! Least squares within bounds on normal matrices: the trust-region reflective method.
//!
//! With A = [J | r] all that a step needs is A^T A, a handful of numbers however many residuals there are. Near a
//! bound towards which the cost falls the variables are scaled by the root of their distance to it (Coleman and Li
//! 1996), so that iterates stay inside and do not stick to a bound too early; of the step cut short at a bound, its
//! reflection there and the steepest descent the best is taken (Branch, Coleman and Li, SIAM J. Sci. Comput. 21,
//! 1999, 1). SciPy's least squares is the same method on whole residuals, and the reference of the tests.

use crate::error::Result;
use crate::trust_region::{Local, Step, norm, sum};

/// When a fit ends.
#[derive(Copy, Clone, Debug)]
pub struct Stop {
    /// Relative change of the cost and of the variables, and largest cosine between column and residual, at which it has converged.
    pub tolerance: f64,
    /// Decrease of the cost at which it has converged, where the next step promises no more.
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
    /// The normal matrix over all variables, at the end or a step away from it that promises less than the tolerance;
    /// empty where there was none.
    pub normal: Vec<f64>,
}

/// Share of the predicted decrease below which the region is made smaller.
const POOR: f64 = 0.25;

/// The share above which it is made larger.
const GOOD: f64 = 0.75;

/// Share of the radius from which on a step was held back by it.
const FULL: f64 = 0.95;

/// Share of the range by which a start on a bound is moved inside.
const INSIDE: f64 = 1e-10;

/// Minimises half the sum of squares from a start within the bounds; variables that are not `free` are held there.
///
/// `normal` returns A^T A over all variables row by row, or nothing where the residuals have no value; a step is then
/// shortened.
/// Where the last step went as foreseen and the next one promises less than the tolerance, it is taken without
/// another evaluation, if it leads to what is `allowed`.
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
    let last = (start.len() + 1) * (start.len() + 1) - 1;
    let moving: Vec<usize> = (0..start.len()).filter(|&i| free[i]).collect();
    let pick = |values: &[f64]| -> Vec<f64> { moving.iter().map(|&i| values[i]).collect() };
    let whole = |values: Vec<f64>| {
        let mut whole = start.to_vec();
        for (&i, value) in moving.iter().zip(values) {
            whole[i] = value;
        }
        whole
    };
    // The matrix over the variables that move, and the residual.
    let picked = |matrix: &[f64]| -> Vec<f64> {
        let kept = || moving.iter().copied().chain([start.len()]);
        kept().flat_map(|i| kept().map(move |j| i * (start.len() + 1) + j)).map(|at| matrix[at]).collect()
    };
    let [lower, upper] = &bounds.map(pick);
    let mut x = inside(&pick(start), lower, upper, INSIDE);
    let Some(mut now) = normal(&whole(x.clone()))? else {
        let (cost, status) = (f64::INFINITY, Status::NoValue);
        return Ok(End { x: whole(x), cost, first: cost, evaluations: 1, status, normal: Vec::new() });
    };
    let first = 0.5 * now[last];
    let end = |x, cost, evaluations, status, normal| {
        Ok(End { x: whole(x), cost, first, evaluations, status, normal })
    };
    if moving.is_empty() {
        return end(x, first, 1, Status::Gradient, now);
    }
    let mut norms = vec![0.0; moving.len()];
    let (mut region, mut foreseen) = (None, false);
    let mut evaluations = 1;
    loop {
        let cost = 0.5 * now[last];
        let local = Local::new(&x, [lower, upper], &picked(&now), &mut norms);
        if local.steepest < stop.tolerance {
            return end(x, cost, evaluations, Status::Gradient, now);
        }
        let mut radius = region.unwrap_or_else(|| local.first_radius(&x));
        loop {
            if evaluations >= stop.evaluations {
                return end(x, cost, evaluations, Status::Unfinished, now);
            }
            let Some(Step { scaled: step, promised, free }) = local.step(&x, radius) else {
                return end(x, cost, evaluations, Status::Step, now);
            };
            if free && promised <= stop.least {
                return end(x, cost, evaluations, Status::Cost, now);
            }
            let next = inside(&sum(&x, &local.unscaled(&step)), lower, upper, 0.0);
            if foreseen && free && promised < stop.tolerance * cost && allowed(&whole(next.clone()))? {
                return end(next, cost - promised, evaluations, Status::Cost, now);
            }
            let found = normal(&whole(next.clone()))?;
            evaluations += 1;
            let length = norm(&step);
            let actual = found.as_ref().map_or(f64::NEG_INFINITY, |found| cost - 0.5 * found[last]);
            let ratio = if promised > 0.0 { actual / promised } else { 0.0 };
            let moved = norm(&local.unscaled(&step));
            let small = moved < stop.tolerance * (stop.tolerance + norm(&x));
            let flat = actual < stop.tolerance * cost && ratio > POOR;
            if ratio < POOR {
                radius = POOR * length;
            } else if ratio > GOOD && length > FULL * radius {
                radius *= 2.0;
            }
            let better = actual > 0.0;
            if let (Some(found), true) = (found, better) {
                (x, now) = (next, found);
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
fn inside(x: &[f64], lower: &[f64], upper: &[f64], share: f64) -> Vec<f64> {
    let point = |i: usize| {
        let range = upper[i] - lower[i];
        let room = if range.is_finite() { share * range } else { 0.0 };
        let (low, high) =
            ((lower[i] + room).max(lower[i].next_up()), (upper[i] - room).min(upper[i].next_down()));
        if low < high { x[i].clamp(low, high) } else { 0.5 * lower[i] + 0.5 * upper[i] }
    };
    (0..x.len()).map(point).collect()
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
