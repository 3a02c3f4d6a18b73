//! Integration by collocation: integrals from one end of an interval to each of its Gauss points and to the other end.
//!
//! Equations whose integrals are taken so are solved by the Gauss method, the error of which at the other end falls with
//! the number of points twice as fast as that in the points.

use std::sync::LazyLock;

/// Gauss points of an interval.
pub const POINTS: usize = 11;

/// Gauss points from 0 to 1, and the integrals from 0 to each point and to 1 of the polynomial through values there.
pub struct Collocation {
    /// Points from 0 to 1.
    pub points: [f64; POINTS],
    /// The last row integrates to 1.
    pub integrals: [[f64; POINTS]; POINTS + 1],
}

/// P_k(x) for k from 0 to `POINTS` + 1.
fn legendre(x: f64) -> [f64; POINTS + 2] {
    let mut out = [1.0; POINTS + 2];
    out[1] = x;
    for k in 1..=POINTS {
        let order = k as f64;
        out[k + 1] = ((2.0 * order + 1.0) * x * out[k] - order * out[k - 1]) / (order + 1.0);
    }
    out
}

/// The one that is used.
pub static COLLOCATION: LazyLock<Collocation> = LazyLock::new(|| {
    let (mut nodes, mut weights) = ([0.0; POINTS], [0.0; POINTS]);
    for i in 0..POINTS {
        let mut x = -(core::f64::consts::PI * (i as f64 + 0.75) / (POINTS as f64 + 0.5)).cos();
        let slope = |x: f64, p: &[f64]| POINTS as f64 * (x * p[POINTS] - p[POINTS - 1]) / (x * x - 1.0);
        for _ in 0..12 {
            let p = legendre(x);
            x -= p[POINTS] / slope(x, &p);
        }
        let slope = slope(x, &legendre(x));
        nodes[i] = x;
        weights[i] = 2.0 / ((1.0 - x * x) * slope * slope);
    }
    // The polynomial through the values f_j is sum_k (2 k + 1) / 2 P_k(x) sum_j w_j P_k(x_j) f_j, and the integral of
    // (2 k + 1) P_k from -1 is P_(k+1) - P_(k-1).
    let at = nodes.map(legendre);
    let mut integrals = [[0.0; POINTS]; POINTS + 1];
    for (i, row) in integrals.iter_mut().enumerate() {
        let x = nodes.get(i).copied().unwrap_or(1.0);
        let p = legendre(x);
        for j in 0..POINTS {
            let mut sum = x + 1.0;
            for k in 1..POINTS {
                sum += at[j][k] * (p[k + 1] - p[k - 1]);
            }
            row[j] = 0.25 * weights[j] * sum;
        }
    }
    Collocation { points: nodes.map(|x| 0.5 * (x + 1.0)), integrals }
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_integrate_polynomials() {
        for power in 0..POINTS {
            let values = COLLOCATION.points.map(|x| x.powi(power as i32));
            for (row, x) in COLLOCATION.integrals.iter().zip(COLLOCATION.points.iter().chain([&1.0])) {
                let sum: f64 = row.iter().zip(&values).map(|(weight, value)| weight * value).sum();
                let exact = x.powi(power as i32 + 1) / (power as f64 + 1.0);
                let off = (sum - exact).abs();
                assert!(off < 3e-16 * (power + 10) as f64, "{power}: {sum} and {exact}");
            }
        }
    }
}
