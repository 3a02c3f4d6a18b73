//! One step of the trust-region reflective method, see `least_squares`.

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
