//! Least squares within bounds on normal matrices: the trust-region reflective method.
//!
//! With A = [J | r] all that a step needs is A^T A, a handful of numbers however many residuals there are. Near a
//! bound towards which the cost falls the variables are scaled by the root of their distance to it (Coleman and Li
//! 1996), so that iterates stay inside and do not stick to a bound too early; of the step cut short at a bound, its
//! reflection there and the steepest descent the best is taken (Branch, Coleman and Li, SIAM J. Sci. Comput. 21,
//! 1999, 1). SciPy's least squares is the same method on whole residuals, and the reference of the tests.

use crate::error::Result;

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

/// How much of the way to a bound is gone at least.
const ALMOST: f64 = 0.995;

/// Steps may differ from the region's radius by this share.
const LOOSE: f64 = 0.01;

/// Least damping, for variables scaled to unit columns.
const LEAST_DAMPING: f64 = 1e-14;

/// Most trials of a damping.
const MOST_TRIALS: usize = 80;

/// A step in scaled variables.
pub struct Step {
    /// The step.
    pub scaled: Vec<f64>,
    /// The decrease of the cost that it promises.
    pub promised: f64,
    /// Whether neither the region nor a bound holds it back.
    pub free: bool,
}

/// The problem about one point, in variables scaled by their columns and by the distance to the bounds.
pub struct Local<'a> {
    bounds: [&'a [f64]; 2],
    /// From scaled to given variables.
    scale: Vec<f64>,
    /// Curvature in scaled variables, with what the bounds add.
    curvature: Vec<f64>,
    /// Slopes in scaled variables.
    slope: Vec<f64>,
    /// The largest cosine between a column and the residual, times the room to the bound that the slope leads to as
    /// a share of the range.
    pub steepest: f64,
}

impl<'a> Local<'a> {
    /// From a normal matrix at `x`; `norms` are the largest that each column has had, and are brought up to date.
    pub fn new(x: &[f64], bounds: [&'a [f64]; 2], normal: &[f64], norms: &mut [f64]) -> Self {
        let n = x.len();
        let size = n + 1;
        let (mut scale, mut more, mut slope) = (vec![1.0; n], vec![0.0; n], vec![0.0; n]);
        let mut steepest = 0.0_f64;
        let size_of_residual = normal[size * size - 1].sqrt();
        for i in 0..n {
            norms[i] = norms[i].max(normal[i * size + i].sqrt());
            let column = if norms[i] > 0.0 { 1.0 / norms[i] } else { 1.0 };
            let g = normal[i * size + n];
            let distance = if g < 0.0 { bounds[1][i] - x[i] } else { x[i] - bounds[0][i] };
            // The cosine between column and residual, small where a bound is near that the slope leads to.
            let range = bounds[1][i] - bounds[0][i];
            let room = if range.is_finite() { distance / range } else { 1.0 };
            if size_of_residual > 0.0 {
                steepest = steepest.max((g * column).abs() / size_of_residual * room);
            }
            scale[i] = column;
            if g != 0.0 && distance.is_finite() {
                scale[i] = (distance / column).sqrt() * column;
                more[i] = g.abs() * column;
            }
            slope[i] = g * scale[i];
        }
        let mut curvature = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                curvature[i * n + j] = normal[i * size + j] * scale[i] * scale[j];
            }
            curvature[i * n + i] += more[i];
        }
        Self { bounds, scale, curvature, slope, steepest }
    }

    /// Radius of the first region: the size of the start.
    pub fn first_radius(&self, x: &[f64]) -> f64 {
        let radius = x.iter().zip(&self.scale).map(|(x, scale)| (x / scale).powi(2)).sum::<f64>().sqrt();
        if radius > 0.0 && radius.is_finite() { radius } else { 1.0 }
    }

    /// A step in the given variables.
    pub fn unscaled(&self, step: &[f64]) -> Vec<f64> {
        step.iter().zip(&self.scale).map(|(step, scale)| step * scale).collect()
    }

    /// The best scaled step within the region and the bounds.
    pub fn step(&self, x: &[f64], radius: f64) -> Option<Step> {
        let mut newton = self.within(radius)?;
        let (reach, hits) = self.reach(x, &newton);
        if reach >= 1.0 {
            let free = norm(&newton) < (1.0 - LOOSE) * radius;
            return Some(Step { promised: -self.change(&newton), scaled: newton, free });
        }
        let back = ALMOST.max(1.0 - self.steepest);
        let mut reflected = newton.clone();
        for (value, hit) in reflected.iter_mut().zip(hits) {
            if hit {
                *value = -*value;
            }
        }
        for value in &mut newton {
            *value *= reach;
        }
        let mut best = self.reflection(x, &newton, reflected, [radius, reach, back]);
        for value in &mut newton {
            *value *= back;
        }
        let descent: Vec<f64> = self.slope.iter().map(|slope| -slope).collect();
        let to_region = radius / norm(&descent);
        let (to_bound, _) = self.reach(x, &descent);
        let longest = if to_bound < to_region { back * to_bound } else { to_region };
        let descent = self.along(&vec![0.0; x.len()], &descent, 0.0, longest);
        for candidate in [newton, descent] {
            if best.as_ref().is_none_or(|best| self.change(&candidate) < self.change(best)) {
                best = Some(candidate);
            }
        }
        best.map(|best| Step { promised: -self.change(&best), scaled: best, free: false })
    }

    /// The step to the bound and on along its reflection.
    fn reflection(
        &self,
        x: &[f64],
        to_bound: &[f64],
        reflected: Vec<f64>,
        [radius, reach, back]: [f64; 3],
    ) -> Option<Vec<f64>> {
        let at_bound = sum(x, &self.unscaled(to_bound));
        let (free, _) = self.reach(&at_bound, &reflected);
        // |to_bound + t reflected| = radius.
        let (a, b) = (dot(&reflected, &reflected), dot(to_bound, &reflected));
        let c = dot(to_bound, to_bound) - radius * radius;
        let to_region = (-b + (b * b - a * c).max(0.0).sqrt()) / a;
        let longest = free.min(to_region);
        if longest.is_nan() || longest <= 0.0 {
            return None;
        }
        let (least, most) =
            ((1.0 - back) * reach / longest, if longest == free { back * free } else { to_region });
        (least <= most).then(|| self.along(to_bound, &reflected, least, most))
    }

    /// The best point of a part of a line.
    fn along(&self, from: &[f64], direction: &[f64], least: f64, most: f64) -> Vec<f64> {
        let bent = self.times(direction);
        let (curved, sloping) = (dot(direction, &bent), dot(&self.slope, direction) + dot(from, &bent));
        let point =
            |t: f64| -> Vec<f64> { from.iter().zip(direction).map(|(from, d)| from + t * d).collect() };
        let value = |t: f64| t * (sloping + 0.5 * t * curved);
        let mut best = if value(most) < value(least) { most } else { least };
        let flat = -sloping / curved;
        if flat > least && flat < most && value(flat) < value(best) {
            best = flat;
        }
        point(best)
    }

    /// How far the bounds allow to go along a scaled step, as a share of it, and which variables meet one there.
    fn reach(&self, x: &[f64], step: &[f64]) -> (f64, Vec<bool>) {
        let share = |i: usize| {
            let step = step[i] * self.scale[i];
            let bound = if step > 0.0 { self.bounds[1][i] } else { self.bounds[0][i] };
            if step == 0.0 { f64::INFINITY } else { ((bound - x[i]) / step).max(0.0) }
        };
        let shares: Vec<f64> = (0..x.len()).map(share).collect();
        let least = shares.iter().copied().fold(f64::INFINITY, f64::min);
        (least, shares.iter().map(|share| *share == least).collect())
    }

    /// The change of the cost by a scaled step if the residuals are linear.
    fn change(&self, step: &[f64]) -> f64 {
        dot(&self.slope, step) + 0.5 * dot(step, &self.times(step))
    }

    fn times(&self, step: &[f64]) -> Vec<f64> {
        self.curvature.chunks(step.len()).map(|row| dot(row, step)).collect()
    }

    /// The best scaled step within the region: the damping that makes it so long is found between bounds.
    fn within(&self, radius: f64) -> Option<Vec<f64>> {
        let mut damping = 0.0;
        let mut found = self.damped(damping);
        if found.is_none() {
            // Some direction has no effect; the least damping keeps the step out of it.
            damping = LEAST_DAMPING;
            found = self.damped(damping);
        }
        let (mut low, mut high) = (damping, f64::INFINITY);
        for _ in 0..MOST_TRIALS {
            let Some(length) = found.as_deref().map(norm) else {
                damping = (10.0 * damping).max(LEAST_DAMPING);
                found = self.damped(damping);
                continue;
            };
            // Without more damping than the system needs anyway, a step may be shorter than the region.
            let short_enough = length <= radius && damping == low;
            if short_enough || (length / radius - 1.0).abs() <= LOOSE {
                break;
            }
            if length > radius {
                low = damping;
            } else {
                high = damping;
            }
            damping = match (low > 0.0, high.is_finite()) {
                (true, true) => (low * high).sqrt(),
                (false, true) => 1e-3 * high,
                (_, false) => (10.0 * damping).max(LEAST_DAMPING.max(1e-6 * norm(&self.slope) / radius)),
            };
            found = self.damped(damping);
        }
        found
    }

    fn damped(&self, damping: f64) -> Option<Vec<f64>> {
        let n = self.slope.len();
        let mut matrix = self.curvature.clone();
        let mut right: Vec<f64> = self.slope.iter().map(|slope| -slope).collect();
        for i in 0..n {
            matrix[i * n + i] += damping;
        }
        solve(&mut matrix, &mut right)?;
        right.iter().all(|step| step.is_finite()).then_some(right)
    }
}

/// The sum of two vectors.
pub fn sum(x: &[f64], step: &[f64]) -> Vec<f64> {
    x.iter().zip(step).map(|(x, step)| x + step).collect()
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// The Euclidean length.
pub fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// Solves a symmetric positive definite system in place by Cholesky; nothing where it is not.
fn solve(matrix: &mut [f64], right: &mut [f64]) -> Option<()> {
    let n = right.len();
    for j in 0..n {
        for k in 0..j {
            for i in j..n {
                matrix[i * n + j] -= matrix[i * n + k] * matrix[j * n + k];
            }
        }
        let pivot = matrix[j * n + j];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        for i in j..n {
            matrix[i * n + j] /= root;
        }
    }
    for i in 0..n {
        for k in 0..i {
            right[i] -= matrix[i * n + k] * right[k];
        }
        right[i] /= matrix[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            right[i] -= matrix[k * n + i] * right[k];
        }
        right[i] /= matrix[i * n + i];
    }
    Some(())
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
