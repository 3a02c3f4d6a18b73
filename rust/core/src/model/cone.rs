//! Conical segments: the transfer matrices of their slices as power series in w^2.
//!
//! Along a beam of varying section the state s = (u, n) obeys s' = (A0 + w^2 A1) s, where A0 holds the compliances and
//! A1 the inertias. The transfer matrix T(x), T(0) = 1, is an entire function of w^2, T = sum_n T_n w^(2 n), and
//!     T_0' = A0 T_0,   T_n' = A0 T_n + A1 T_(n-1).
//! A0 only couples M to theta to y and V to M and y, so that each T_n consists of repeated integrals; they are taken by
//! collocation in Gauss points, which converges faster than any power of the number of points. A change of the
//! coefficients changes the series by
//!     dT_n' = A0 dT_n + dA0 T_n + A1 dT_(n-1) + dA1 T_(n-1).
//! The diameters are linear along the segment, the coefficients those of the section in each place. A cone is divided
//! where its section changes too much for the points, and where the waves are too short for the series. The series does
//! not depend on the frequency line, so that a line costs one polynomial an entry.

use crate::model::section::{self, Coefficients, Motion, Segment, column};
use num_complex::Complex64;
use std::sync::{LazyLock, OnceLock};

/// Largest |lambda| h of a slice: beyond it growth costs digits and terms.
const STEP: f64 = 2.0;

/// Terms that leave out less than a rounding error at `STEP`: |lambda h|^(2 n) / (2 n)! below 1e-17.
const TERMS: usize = 13;

/// Largest ratio of the diameters, of the bores and of the wall thicknesses at both ends of a slice. The coefficients have
/// poles where the section vanishes, three half lengths from the middle at this ratio: the error of N points is
/// (3 + sqrt 8)^-N.
const MOST_TAPER: f64 = 2.0;

/// Gauss points of a slice.
const POINTS: usize = 18;

/// Highest level of division: of each level the frequency is twice that of the one before.
const LEVELS: usize = 40;

/// Narrowest slice as a share of the length: a wall that vanishes is not divided for ever.
const LEAST_SHARE: f64 = 1e-4;

/// A matrix of the state: displacements and internal forces by displacements and internal forces (uu, un, nu, nn).
pub type Blocks<const D: usize> = [[[Complex64; D]; D]; 4];

/// Gauss points from 0 to 1, and the integrals from 0 to each point and to 1 of the polynomial through values there.
struct Collocation {
    points: [f64; POINTS],
    /// The last row integrates to 1.
    integrals: [[f64; POINTS]; POINTS + 1],
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

static COLLOCATION: LazyLock<Collocation> = LazyLock::new(|| {
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

/// Coefficients of a slice in its points, times its length; `shear` is the length itself, the share of theta in y' and of
/// V in M'.
struct Sampled<const D: usize> {
    kinetic: [[f64; D]; POINTS],
    compliance: [[Complex64; D]; POINTS],
    shear: f64,
}

impl<const D: usize> Sampled<D> {
    fn new(at: impl Fn(f64) -> Coefficients<D>, ends: [f64; 2], length: f64, shear: f64) -> Self {
        let mut out = Self { kinetic: [[0.0; D]; POINTS], compliance: [[Complex64::ZERO; D]; POINTS], shear };
        for (i, point) in COLLOCATION.points.iter().enumerate() {
            let value = at(ends[0] + point * (ends[1] - ends[0]));
            out.kinetic[i] = value.kinetic.map(|kinetic| length * kinetic);
            out.compliance[i] = value.compliance.map(|compliance| length * compliance);
        }
        out
    }
}

/// A state in the points of a slice and at its end.
type Course<const D: usize> = [[Complex64; POINTS + 1]; D];

/// Displacements and internal forces in the points and at the end.
type Motions<const D: usize> = [Course<D>; 2];

fn integral(rates: &[Complex64; POINTS], start: Complex64) -> [Complex64; POINTS + 1] {
    let mut out = [start; POINTS + 1];
    for (value, row) in out.iter_mut().zip(&COLLOCATION.integrals) {
        let (mut re, mut im) = (0.0, 0.0);
        for (rate, weight) in rates.iter().zip(row) {
            re += weight * rate.re;
            im += weight * rate.im;
        }
        *value += Complex64::new(re, im);
    }
    out
}

/// Adds what the coefficients make of a state to the rates of the next integrals: first of n by u, then of u by n.
fn add_inertia<const D: usize>(
    rates: &mut [[Complex64; POINTS]; D],
    slice: &Sampled<D>,
    u: &Course<D>,
    square: f64,
) {
    for d in 0..D {
        for i in 0..POINTS {
            rates[d][i] -= square * slice.kinetic[i][d] * u[d][i];
        }
    }
}

/// The integrals of n, of which V enters the rate of M, then of u, of which theta enters the rate of y. `rates` are those
/// from elsewhere, `start` the state at the near end.
fn integrated<const D: usize>(
    slice: &Sampled<D>,
    mut rates: [[[Complex64; POINTS]; D]; 2],
    start: [[Complex64; D]; 2],
) -> Motions<D> {
    let zero = [[Complex64::ZERO; POINTS + 1]; D];
    let mut out = [zero; 2];
    for d in 0..D {
        if d == 1 {
            for i in 0..POINTS {
                rates[1][1][i] -= slice.shear * out[1][0][i];
            }
        }
        out[1][d] = integral(&rates[1][d], start[1][d]);
    }
    for d in (0..D).rev() {
        for i in 0..POINTS {
            rates[0][d][i] += slice.compliance[i][d] * out[1][d][i];
            if d == 0 && D == 2 {
                rates[0][0][i] += slice.shear * out[0][D - 1][i];
            }
        }
        out[0][d] = integral(&rates[0][d], start[0][d]);
    }
    out
}

/// The courses of all terms of the columns of T, with w^2 in units of `square`.
fn courses<const D: usize>(slice: &Sampled<D>, square: f64) -> Vec<Vec<Motions<D>>> {
    let none = [[[Complex64::ZERO; POINTS]; D]; 2];
    let mut columns = Vec::with_capacity(2 * D);
    for column in 0..2 * D {
        let mut start = [[Complex64::ZERO; D]; 2];
        start[column / D][column % D] = Complex64::ONE;
        let mut terms = vec![integrated(slice, none, start)];
        for n in 1..TERMS {
            let mut rates = none;
            add_inertia(&mut rates[1], slice, &terms[n - 1][0], square);
            terms.push(integrated(slice, rates, [[Complex64::ZERO; D]; 2]));
        }
        columns.push(terms);
    }
    columns
}

/// The change of these courses that a change of the coefficients causes.
fn changes<const D: usize>(
    slice: &Sampled<D>,
    change: &Sampled<D>,
    square: f64,
    columns: &[Vec<Motions<D>>],
) -> Vec<Vec<Motions<D>>> {
    let nowhere = [[Complex64::ZERO; D]; 2];
    let of_column = |terms: &Vec<Motions<D>>| {
        let mut out: Vec<Motions<D>> = Vec::with_capacity(TERMS);
        for n in 0..TERMS {
            let mut rates = [[[Complex64::ZERO; POINTS]; D]; 2];
            if n > 0 {
                add_inertia(&mut rates[1], slice, &out[n - 1][0], square);
                add_inertia(&mut rates[1], change, &terms[n - 1][0], square);
            }
            let [u, force] = &terms[n];
            for i in 0..POINTS {
                for d in 0..D {
                    rates[0][d][i] += change.compliance[i][d] * force[d][i];
                }
                if D == 2 {
                    rates[0][0][i] += change.shear * u[D - 1][i];
                    rates[1][D - 1][i] -= change.shear * force[0][i];
                }
            }
            out.push(integrated(slice, rates, nowhere));
        }
        out
    };
    columns.iter().map(of_column).collect()
}

/// The values at the far end as matrices, the lowest power first.
fn at_end<const D: usize>(columns: &[Vec<Motions<D>>]) -> Vec<Blocks<D>> {
    let matrix = |n: usize| {
        let mut out = [[[Complex64::ZERO; D]; D]; 4];
        for (j, terms) in columns.iter().enumerate() {
            for (half, motion) in terms[n].iter().enumerate() {
                for d in 0..D {
                    out[2 * half + j / D][d][j % D] = motion[d][POINTS];
                }
            }
        }
        out
    };
    (0..TERMS).map(matrix).collect()
}

/// Matrices of the slices of a division as power series.
pub struct Division<const D: usize> {
    /// Ends of the slices as shares of the length, from 0 to 1.
    ends: Vec<f64>,
    /// Unit of w^2 of the series.
    pub square: f64,
    /// Largest |lambda| h of a slice at that w^2, squared.
    growth: f64,
    /// For each slice the terms of its transfer matrix, the lowest power first.
    pub slices: Vec<Vec<Blocks<D>>>,
}

impl<const D: usize> Division<D> {
    /// Terms that leave out less than a rounding error at |w^2|.
    pub fn terms(&self, w2: f64) -> usize {
        // The sections within a slice differ: two terms more than a uniform slice of its largest wave number needs.
        (crate::line::exponential::terms(self.growth * w2 / self.square) + 2).min(TERMS)
    }
}

/// A conical segment, with its series for each level of frequencies as they are needed.
pub struct Cone<const D: usize> {
    row: [f64; column::COUNT],
    motion: Motion,
    /// Ends of the slices that the section requires, as shares of the length.
    ends: Vec<f64>,
    /// |w| up to which these slices serve.
    first: f64,
    levels: [OnceLock<Division<D>>; LEVELS],
}

/// Whether a row of the segment table ends in another section than it begins.
pub fn is_conical(row: &[f64]) -> bool {
    row[column::END_OUTER_DIAMETER] != 0.0
}

/// The uniform section of a row at a share of its length, as a row.
pub fn section_at(row: &[f64; column::COUNT], share: f64) -> [f64; column::COUNT] {
    let mut out = *row;
    if is_conical(row) {
        let between = |near: usize, far: usize| row[near] + share * (row[far] - row[near]);
        out[column::OUTER_DIAMETER] = between(column::OUTER_DIAMETER, column::END_OUTER_DIAMETER);
        out[column::INNER_DIAMETER] = between(column::INNER_DIAMETER, column::END_INNER_DIAMETER);
        (out[column::END_OUTER_DIAMETER], out[column::END_INNER_DIAMETER]) = (0.0, 0.0);
    }
    out
}

impl<const D: usize> Cone<D> {
    /// The cone of a row; nothing for a cylinder.
    pub fn new(row: &[f64; column::COUNT], motion: Motion) -> Option<Self> {
        if !is_conical(row) {
            return None;
        }
        let mut ends = vec![0.0];
        divide(&|from, to| tapers(row, from, to), 0.0, 1.0, &mut ends);
        let mut cone =
            Self { row: *row, motion, ends, first: 0.0, levels: [const { OnceLock::new() }; LEVELS] };
        // The largest |w| at which the waves suit these slices.
        let (mut low, mut high): (f64, f64) = (1e-3, 1e15);
        for _ in 0..60 {
            let middle = (low * high).sqrt();
            let longest = cone.ends.windows(2).map(|ends| cone.growth(ends[0], ends[1], middle));
            if longest.fold(0.0, f64::max) > STEP * STEP { high = middle } else { low = middle }
        }
        cone.first = low;
        Some(cone)
    }

    /// (|lambda| h)^2 of the slice between two shares of the length.
    fn growth(&self, from: f64, to: f64, w: f64) -> f64 {
        let square = |share: f64| {
            Segment::<D>::new(&section_at(&self.row, share), self.motion).wave_number_square(w * w)
        };
        let most = [from, 0.5 * (from + to), to].map(square).into_iter().fold(0.0, f64::max);
        most * ((to - from) * self.row[column::LENGTH]).powi(2)
    }

    /// The number of the division for lines up to |w|.
    pub fn level(&self, w: f64) -> usize {
        ((w / self.first).log2().ceil().max(0.0) as usize).min(LEVELS - 1)
    }

    /// The division of a level.
    pub fn division(&self, level: usize) -> &Division<D> {
        self.levels[level].get_or_init(|| {
            let w = self.first * 2.0_f64.powi(level as i32);
            let mut ends = vec![0.0];
            for slice in self.ends.windows(2) {
                divide(&|from, to| self.growth(from, to, w) > STEP * STEP, slice[0], slice[1], &mut ends);
            }
            let growth = ends.windows(2).map(|ends| self.growth(ends[0], ends[1], w)).fold(0.0, f64::max);
            let square = w * w;
            let matrices = |ends: &[f64]| at_end(&courses(&self.sampled(ends), square));
            let slices = ends.windows(2).map(matrices).collect();
            Division { ends, square, growth, slices }
        })
    }

    fn sampled(&self, ends: &[f64]) -> Sampled<D> {
        let at = |share: f64| section::coefficients::<D>(&section_at(&self.row, share), self.motion);
        let length = (ends[1] - ends[0]) * self.row[column::LENGTH];
        Sampled::new(at, [ends[0], ends[1]], length, length)
    }

    /// The change of the coefficients of a slice by a column of the segment table.
    fn sampled_change(&self, ends: &[f64], by: usize) -> Sampled<D> {
        let share = ends[1] - ends[0];
        if by == column::LENGTH {
            let at = |share: f64| section::coefficients::<D>(&section_at(&self.row, share), self.motion);
            return Sampled::new(at, [ends[0], ends[1]], share, share);
        }
        // The diameters at both ends have shares in that of each section.
        let (of, far) = match by {
            column::END_OUTER_DIAMETER => (column::OUTER_DIAMETER, Some(true)),
            column::END_INNER_DIAMETER => (column::INNER_DIAMETER, Some(true)),
            column::OUTER_DIAMETER | column::INNER_DIAMETER => (by, Some(false)),
            other => (other, None),
        };
        let at = |share: f64| {
            let (_, mut change) =
                section::derivatives::<D>(&section_at(&self.row, share), self.motion, Some(of));
            let weight = far.map_or(1.0, |far| if far { share } else { 1.0 - share });
            change.kinetic = change.kinetic.map(|value| weight * value);
            change.compliance = change.compliance.map(|value| weight * value);
            change
        };
        Sampled::new(at, [ends[0], ends[1]], share * self.row[column::LENGTH], 0.0)
    }

    /// Derivatives of the matrices of a division by a column of the segment table.
    pub fn change(&self, level: usize, by: usize) -> Vec<Vec<Blocks<D>>> {
        let division = self.division(level);
        let matrices = |ends: &[f64]| {
            let (slice, change) = (self.sampled(ends), self.sampled_change(ends, by));
            at_end(&changes(&slice, &change, division.square, &courses(&slice, division.square)))
        };
        division.ends.windows(2).map(matrices).collect()
    }
}

/// Derivatives of the matrices of a cone by a column, for each level as they are needed.
pub struct ConeChange<const D: usize> {
    column: usize,
    levels: [OnceLock<Vec<Vec<Blocks<D>>>>; LEVELS],
}

impl<const D: usize> ConeChange<D> {
    /// The change by a column of the segment table.
    pub fn new(column: usize) -> Self {
        Self { column, levels: [const { OnceLock::new() }; LEVELS] }
    }

    /// The matrices of a level.
    pub fn of(&self, cone: &Cone<D>, level: usize) -> &[Vec<Blocks<D>>] {
        self.levels[level].get_or_init(|| cone.change(level, self.column))
    }
}

/// Halves a part of the length until no half is too large, and adds the ends.
fn divide(too_large: &impl Fn(f64, f64) -> bool, from: f64, to: f64, ends: &mut Vec<f64>) {
    if to - from > LEAST_SHARE && too_large(from, to) {
        let middle = 0.5 * (from + to);
        divide(too_large, from, middle, ends);
        divide(too_large, middle, to, ends);
    } else {
        ends.push(to);
    }
}

/// Whether the section changes too much between two shares of the length.
fn tapers(row: &[f64; column::COUNT], from: f64, to: f64) -> bool {
    let (near, far) = (section_at(row, from), section_at(row, to));
    let ratio = |a: f64, b: f64| a.max(b) > MOST_TAPER * a.min(b);
    let wall = |row: &[f64; column::COUNT]| row[column::OUTER_DIAMETER] - row[column::INNER_DIAMETER];
    // A bore without a core may vanish: nothing has a pole there.
    let core = row[column::CORE_MATERIAL + 1] != 0.0;
    ratio(near[column::OUTER_DIAMETER], far[column::OUTER_DIAMETER])
        || ratio(wall(&near), wall(&far))
        || (core && ratio(near[column::INNER_DIAMETER], far[column::INNER_DIAMETER]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(end: f64) -> [f64; column::COUNT] {
        let mut row = [0.0; column::COUNT];
        row[..column::SHEAR_MODEL].copy_from_slice(&[
            0.0, 1.0, 0.05, 0.04, 0.012, 2.1e11, 7850.0, 0.3, 0.01, 5.8e11, 14500.0, 0.22, 0.002,
        ]);
        (row[column::END_OUTER_DIAMETER], row[column::END_INNER_DIAMETER]) = (end, 0.010);
        row
    }

    #[test]
    fn points_integrate_polynomials() {
        for power in 0..POINTS {
            let mut values = [Complex64::ZERO; POINTS];
            for (value, x) in values.iter_mut().zip(COLLOCATION.points) {
                *value = x.powi(power as i32).into();
            }
            let sums = integral(&values, Complex64::ZERO);
            for (sum, x) in sums.iter().zip(COLLOCATION.points.iter().chain([&1.0])) {
                let exact = x.powi(power as i32 + 1) / (power as f64 + 1.0);
                assert!((sum.re - exact).abs() < 3e-16 * (power + 10) as f64, "{power}: {sum} and {exact}");
            }
        }
    }

    #[test]
    fn changes_of_the_matrices_agree_with_differences() {
        let (motion, level, w2) = (Motion::Bending, 0, 1.0);
        let columns = (column::LENGTH..column::SHEAR_MODEL)
            .chain([column::END_OUTER_DIAMETER, column::END_INNER_DIAMETER]);
        let Some(cone) = Cone::<2>::new(&row(0.06), motion) else { panic!() };
        for by in columns {
            let change = cone.change(level, by);
            let at = |step: f64| {
                let mut moved = cone.row;
                moved[by] += step;
                let fixed = Cone {
                    row: moved,
                    motion,
                    ends: cone.ends.clone(),
                    first: cone.first,
                    levels: [const { OnceLock::new() }; LEVELS],
                };
                let slices: Vec<_> = fixed.ends.windows(2).map(|ends| fixed.sampled(ends)).collect();
                let square = cone.division(level).square;
                slices.iter().map(|slice| at_end(&courses(slice, square))).collect::<Vec<_>>()
            };
            let step = 1e-5 * cone.row[by];
            let (up, down) = (at(step), at(-step));
            for (slice, terms) in change.iter().enumerate() {
                for block in 0..4 {
                    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        let sum = |terms: &[Blocks<2>]| -> Complex64 {
                            terms.iter().map(|term| term[block][i][j] * w2).sum()
                        };
                        let difference = (sum(&up[slice]) - sum(&down[slice])) / (2.0 * step);
                        let off = (difference - sum(terms)).norm();
                        let size = difference.norm() + sum(&up[slice]).norm() / cone.row[by];
                        assert!(off < 1e-7 * size, "column {by}, block {block}: {off:e} of {size:e}");
                    }
                }
            }
        }
    }
}
