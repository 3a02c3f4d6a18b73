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

use crate::line::exponential;
use crate::model::collocation::{COLLOCATION, POINTS};
use crate::model::section::{self, Coefficients, Motion, Segment, column};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};
use std::sync::OnceLock;

/// Largest |lambda| h of a slice, as of a piece of a cylinder: beyond it growth costs digits, and from 3.9 on (of short
/// slices in shear) there are natural frequencies with fixed ends, which the count of modes takes for none.
const STEP: f64 = exponential::REACH;

/// Largest ratio of the diameters, of the bores and of the wall thicknesses at both ends of a slice. The coefficients have
/// poles where the section vanishes, three half lengths from the middle at this ratio: the error of N points is
/// (3 + sqrt 8)^(-2 N) at the end of the slice.
const MOST_TAPER: f64 = 2.0;

/// Levels of division.
const LEVELS: usize = 64;

/// The level up to which slices are undivided; those below have shorter series.
const WHOLE: usize = 6;

/// Levels from there on that have one piece more each.
const ONE_MORE: usize = 16;

/// Narrowest slice as a share of the length: a wall that vanishes is not divided for ever.
const LEAST_SHARE: f64 = 1e-4;

/// A matrix of the state: displacements and internal forces by displacements and internal forces (uu, un, nu, nn).
pub type Blocks<const D: usize> = [[[Complex64; D]; D]; 4];

/// Coefficients of a slice in its points, times its length; `shear` is the length itself, the share of theta in y' and of
/// V in M'.
pub struct Sampled<const D: usize> {
    /// Inertia of each displacement.
    pub kinetic: [[f64; D]; POINTS],
    /// Compliance of each internal force.
    pub compliance: [[Complex64; D]; POINTS],
    /// The length.
    pub shear: f64,
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

/// Real and imaginary part of each column of T, in turns; rods leave the second half unused. All columns are integrated at
/// once, which fills the registers.
type Wide = [f64; 8];

/// Integrals that are summed at once.
const AT_ONCE: usize = 6;

const NOTHING: Wide = [0.0; 8];

/// Displacements and internal forces in the points of a slice and at its end.
type Motions<const D: usize> = [[[Wide; POINTS + 1]; D]; 2];

/// Their derivatives along the slice in the points.
type Rates<const D: usize> = [[[Wide; POINTS]; D]; 2];

#[inline(always)]
fn integral(rates: &[Wide; POINTS], start: Wide, out: &mut [Wide; POINTS + 1]) {
    // Some sums at once, which do not wait for each other.
    for (values, rows) in out.chunks_mut(AT_ONCE).zip(COLLOCATION.integrals.chunks(AT_ONCE)) {
        let mut sums = [start; AT_ONCE];
        for (i, rate) in rates.iter().enumerate() {
            for (sum, row) in sums.iter_mut().zip(rows) {
                add(sum, row[i], rate);
            }
        }
        values.copy_from_slice(&sums[..values.len()]);
    }
}

/// Adds a real multiple of a state to the rates of another one.
#[inline(always)]
fn add(to: &mut Wide, factor: f64, from: &Wide) {
    for lane in 0..8 {
        to[lane] = factor.mul_add(from[lane], to[lane]);
    }
}

/// Adds a complex multiple.
#[inline(always)]
fn add_complex(to: &mut Wide, factor: Complex64, from: &Wide) {
    for column in 0..4 {
        let (re, im) = (from[2 * column], from[2 * column + 1]);
        to[2 * column] += factor.re * re - factor.im * im;
        to[2 * column + 1] += factor.re * im + factor.im * re;
    }
}

/// Adds to the rates of n what the inertia of a slice makes of u, w^2 being `square`.
#[inline(always)]
fn add_inertia<const D: usize>(rates: &mut Rates<D>, slice: &Sampled<D>, motions: &Motions<D>, square: f64) {
    for d in 0..D {
        for i in 0..POINTS {
            add(&mut rates[1][d][i], -square * slice.kinetic[i][d], &motions[0][d][i]);
        }
    }
}

/// The integrals of n, of which V enters the rate of M, then of u, of which theta enters the rate of y. `rates` are those
/// from elsewhere, `start` the state at the near end.
#[inline(always)]
fn integrate<const D: usize>(
    slice: &Sampled<D>,
    rates: &mut Rates<D>,
    start: &[[Wide; D]; 2],
    out: &mut Motions<D>,
) {
    for d in 0..D {
        if d == 1 {
            for i in 0..POINTS {
                add(&mut rates[1][1][i], -slice.shear, &out[1][0][i]);
            }
        }
        integral(&rates[1][d], start[1][d], &mut out[1][d]);
    }
    for d in (0..D).rev() {
        for i in 0..POINTS {
            add_complex(&mut rates[0][d][i], slice.compliance[i][d], &out[1][d][i]);
            if d == 0 && D == 2 {
                add(&mut rates[0][0][i], slice.shear, &out[0][D - 1][i]);
            }
        }
        integral(&rates[0][d], start[0][d], &mut out[0][d]);
    }
}

/// The motions of the first terms of T, with w^2 in units of `square`.
#[inline(always)]
fn motions<const D: usize>(slice: &Sampled<D>, square: f64, count: usize) -> Vec<Motions<D>> {
    let mut start = [[NOTHING; D]; 2];
    for column in 0..2 * D {
        start[column / D][column % D][2 * column] = 1.0;
    }
    let mut terms = vec![[[[NOTHING; POINTS + 1]; D]; 2]; count];
    for n in 0..count {
        let mut rates = [[[NOTHING; POINTS]; D]; 2];
        if n > 0 {
            add_inertia(&mut rates, slice, &terms[n - 1], square);
        }
        integrate(slice, &mut rates, &start, &mut terms[n]);
        start = [[NOTHING; D]; 2];
    }
    terms
}

/// The change of these motions that a change of the coefficients causes.
#[inline(always)]
fn changes<const D: usize>(
    slice: &Sampled<D>,
    change: &Sampled<D>,
    square: f64,
    terms: &[Motions<D>],
) -> Vec<Motions<D>> {
    let mut out = vec![[[[NOTHING; POINTS + 1]; D]; 2]; terms.len()];
    for n in 0..terms.len() {
        let mut rates = [[[NOTHING; POINTS]; D]; 2];
        if n > 0 {
            add_inertia(&mut rates, slice, &out[n - 1], square);
            add_inertia(&mut rates, change, &terms[n - 1], square);
        }
        let [u, force] = &terms[n];
        for i in 0..POINTS {
            for d in 0..D {
                add_complex(&mut rates[0][d][i], change.compliance[i][d], &force[d][i]);
            }
            if D == 2 {
                add(&mut rates[0][0][i], change.shear, &u[D - 1][i]);
                add(&mut rates[1][D - 1][i], -change.shear, &force[0][i]);
            }
        }
        integrate(slice, &mut rates, &[[NOTHING; D]; 2], &mut out[n]);
    }
    out
}

/// The motions of a slice, or their change by another slice's coefficients, compiled for each set of instructions.
struct Integration<'a, const D: usize> {
    slice: &'a Sampled<D>,
    square: f64,
    terms: usize,
    change: Option<(&'a Sampled<D>, &'a [Motions<D>])>,
}

impl<const D: usize> WithSimd for Integration<'_, D> {
    type Output = Vec<Motions<D>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<Motions<D>> {
        match self.change {
            None => motions(self.slice, self.square, self.terms),
            Some((change, terms)) => changes(self.slice, change, self.square, terms),
        }
    }
}

/// The values at the far end as matrices, the lowest power first.
fn at_end<const D: usize>(terms: &[Motions<D>]) -> Vec<Blocks<D>> {
    let matrix = |motions: &Motions<D>| {
        let mut out = [[[Complex64::ZERO; D]; D]; 4];
        for (half, motion) in motions.iter().enumerate() {
            for column in 0..2 * D {
                for d in 0..D {
                    let value = motion[d][POINTS];
                    out[2 * half + column / D][d][column % D] =
                        Complex64::new(value[2 * column], value[2 * column + 1]);
                }
            }
        }
        out
    };
    terms.iter().map(matrix).collect()
}

/// Matrices of the slices of a division as power series.
pub struct Division<const D: usize> {
    /// Ends of the slices as shares of the length, from 0 to 1.
    ends: Vec<f64>,
    /// Unit of w^2 of the series.
    pub square: f64,
    /// Largest |lambda h|^2 of a slice at this w^2.
    growth: f64,
    /// For each slice the terms of its transfer matrix, the lowest power first.
    pub slices: Vec<Vec<Blocks<D>>>,
    /// For each slice its coefficients and the motions of these terms, from which changes are made.
    motions: Vec<(Sampled<D>, Vec<Motions<D>>)>,
    scaled: OnceLock<Vec<Scaled<D>>>,
}

/// Derivatives of the terms of a slice by a common factor of all its inertias or compliances.
pub struct Scaled<const D: usize> {
    /// By the inertias, which enter with w^2: n T_n.
    pub inertia: Vec<Blocks<D>>,
    /// By the compliances: forces by displacements, (n - 1) T_n; the other blocks follow from `inertia`.
    pub stiffness: Vec<[[[Complex64; D]; D]; 1]>,
}

impl<const D: usize> Division<D> {
    /// Terms that leave out less than a rounding error at |w^2|.
    pub fn terms(&self, w2: f64) -> usize {
        terms(self.growth * (w2 / self.square).sqrt()).min(self.slices[0].len())
    }

    /// Derivatives by common factors.
    pub fn scaled(&self) -> &[Scaled<D>] {
        let times =
            |block: &[[Complex64; D]; D], factor: f64| block.map(|row| row.map(|entry| entry * factor));
        let of_slice = |slice: &Vec<Blocks<D>>| {
            let terms = || slice.iter().enumerate().map(|(n, term)| (n as f64, term));
            Scaled {
                inertia: terms().map(|(n, term)| term.each_ref().map(|block| times(block, n))).collect(),
                stiffness: terms().map(|(n, term)| [times(&term[2], n - 1.0)]).collect(),
            }
        };
        self.scaled.get_or_init(|| self.slices.iter().map(of_slice).collect())
    }
}

/// Terms of a slice in which |lambda h|^2 is at most `square`: its sections differ, which takes two more than a uniform
/// slice of the largest wave number.
fn terms(square: f64) -> usize {
    exponential::terms(square) + 2
}

/// A conical segment, with its series for each level of division as they are needed.
pub struct Cone<const D: usize> {
    row: [f64; column::COUNT],
    motion: Motion,
    /// The slices that the section requires: both ends as shares of the length, and the sections at the ends and in the
    /// middle as segments of the slice's length.
    slices: Vec<([f64; 2], [Segment<D>; 3])>,
    /// On the heap: segments without a cone would be as large.
    levels: Vec<OnceLock<Division<D>>>,
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

/// Derivatives of the logarithms of all inertias and of all compliances of a cone by a column of its row; nothing where
/// the column changes them by different factors along the cone.
pub fn common_factors(row: &[f64; column::COUNT], by: usize) -> Option<(f64, Complex64)> {
    if row[column::CORE_MATERIAL + 1] != 0.0 {
        return None;
    }
    match by.checked_sub(column::MATERIAL)? {
        0 => Some((0.0, Complex64::from(-1.0 / row[by]))),
        1 => Some((1.0 / row[by], Complex64::ZERO)),
        3 => Some((0.0, -Complex64::I / Complex64::new(1.0, row[by]))),
        _ => None,
    }
}

impl<const D: usize> Cone<D> {
    /// The cone of a row; nothing for a cylinder.
    pub fn new(row: &[f64; column::COUNT], motion: Motion) -> Option<Self> {
        if !is_conical(row) {
            return None;
        }
        let mut ends = vec![0.0];
        divide(row, 0.0, 1.0, &mut ends);
        let slice = |ends: &[f64]| {
            let sections = [ends[0], 0.5 * (ends[0] + ends[1]), ends[1]].map(|share| {
                let mut section = section_at(row, share);
                section[column::LENGTH] *= ends[1] - ends[0];
                Segment::new(&section, motion)
            });
            ([ends[0], ends[1]], sections)
        };
        let slices = ends.windows(2).map(slice).collect();
        let levels = (0..LEVELS).map(|_| OnceLock::new()).collect();
        Some(Self { row: *row, motion, slices, levels })
    }

    /// |lambda| h of the slice of a number over `STEP`, at |w|.
    fn growth(&self, slice: usize, w: f64) -> f64 {
        let square = |section: &Segment<D>| section.wave_number_square(w * w);
        let (_, sections) = &self.slices[slice];
        sections.iter().map(square).fold(0.0, f64::max).sqrt() * sections[0].length / STEP
    }

    /// The largest of all slices.
    fn largest_growth(&self, w: f64) -> f64 {
        (0..self.slices.len()).map(|slice| self.growth(slice, w)).fold(0.0, f64::max)
    }

    /// The level of division for lines up to |w|.
    pub fn level(&self, w: f64) -> usize {
        let growth = self.largest_growth(w);
        (0..LEVELS - 1).find(|&level| largest(level) >= growth).unwrap_or(LEVELS - 1)
    }

    /// Ends of the slices for lines up to |w| as shares of the length, and the largest |lambda| h over `STEP` there.
    pub fn ends(&self, w: f64) -> (Vec<f64>, f64) {
        let (mut ends, mut most) = (vec![0.0], 0.0_f64);
        for (number, ([from, to], _)) in self.slices.iter().enumerate() {
            let growth = self.growth(number, w);
            let count = growth.ceil().max(1.0);
            most = most.max(growth / count);
            for piece in 1..=count as usize {
                ends.push(from + (to - from) * piece as f64 / count);
            }
        }
        (ends, most)
    }

    /// The division of a level.
    pub fn division(&self, level: usize) -> &Division<D> {
        self.levels[level].get_or_init(|| {
            let largest = largest(level);
            // The frequency up to which the level serves.
            let (mut low, mut high): (f64, f64) = (1e-3, 1e15);
            for _ in 0..50 {
                let middle = (low * high).sqrt();
                if self.largest_growth(middle) > largest { high = middle } else { low = middle }
            }
            let (ends, most) = self.ends(low);
            let (square, growth) = (low * low, (STEP * most).powi(2));
            let of_slice = |ends: &[f64]| {
                let slice = self.sampled([ends[0], ends[1]]);
                let work = Integration { slice: &slice, square, terms: terms(growth), change: None };
                let motions = Arch::new().dispatch(work);
                (slice, motions)
            };
            let motions: Vec<_> = ends.windows(2).map(of_slice).collect();
            let slices = motions.iter().map(|(_, terms)| at_end(terms)).collect();
            Division { ends, square, growth, slices, motions, scaled: OnceLock::new() }
        })
    }

    /// The sum of `Segment::excess` over the cone.
    pub fn excess(&self, w: f64) -> f64 {
        let simpson = |sections: &[Segment<D>; 3]| {
            let [near, middle, far] = sections.map(|section| section.excess(w));
            (near + 4.0 * middle + far) / 6.0
        };
        self.slices.iter().map(|(_, sections)| simpson(sections)).sum()
    }

    /// The coefficients between two shares of the length, from the first to the second.
    pub fn sampled(&self, ends: [f64; 2]) -> Sampled<D> {
        let at = |share: f64| section::coefficients::<D>(&section_at(&self.row, share), self.motion);
        let length = (ends[1] - ends[0]).abs() * self.row[column::LENGTH];
        Sampled::new(at, ends, length, length)
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
        let matrices = |(ends, (slice, terms)): (&[f64], &(Sampled<D>, Vec<Motions<D>>))| {
            let change = self.sampled_change(ends, by);
            let change = Some((&change, &terms[..]));
            let (square, terms) = (division.square, terms.len());
            at_end(&Arch::new().dispatch(Integration { slice, square, terms, change }))
        };
        division.ends.windows(2).zip(&division.motions).map(matrices).collect()
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

/// The largest |lambda| h over `STEP` of the slices of a section that a level serves.
fn largest(level: usize) -> f64 {
    if level <= WHOLE {
        return (0.5 * (level as f64 - WHOLE as f64)).exp2();
    }
    let pieces = (level - WHOLE).min(ONE_MORE) as f64 + 1.0;
    pieces * (0.25 * (level - WHOLE).saturating_sub(ONE_MORE) as f64).exp2()
}

/// Halves a part of the length until no half tapers too much, and adds the ends.
fn divide(row: &[f64; column::COUNT], from: f64, to: f64, ends: &mut Vec<f64>) {
    if to - from > LEAST_SHARE && tapers(row, from, to) {
        let middle = 0.5 * (from + to);
        divide(row, from, middle, ends);
        divide(row, middle, to, ends);
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
#[allow(clippy::unwrap_used)]
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
    fn changes_of_the_matrices_agree_with_differences() {
        let (motion, level, w2) = (Motion::Bending, WHOLE, 1.0);
        let columns = (column::LENGTH..column::SHEAR_MODEL)
            .chain([column::END_OUTER_DIAMETER, column::END_INNER_DIAMETER]);
        let cone = Cone::<2>::new(&row(0.06), motion).unwrap();
        for by in columns {
            let change = cone.change(level, by);
            let at = |step: f64| {
                let mut moved = cone.row;
                moved[by] += step;
                let moved = Cone::<2>::new(&moved, motion).unwrap();
                let division = cone.division(level);
                let slices = division.ends.windows(2).map(|ends| moved.sampled([ends[0], ends[1]]));
                let terms = division.slices[0].len();
                slices.map(|slice| at_end(&motions(&slice, division.square, terms))).collect::<Vec<_>>()
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
