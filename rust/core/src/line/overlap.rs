//! Sweeps through an overlap: between planes over lanes and the ways of single lines.

use crate::line::layer::{self, DERIVATIVES, Line, Passed, Two, Wanted, mirrored};
use crate::line::plane::Plane;
use crate::model::overlap::{Beside, Pieces};
use crate::simd::lane::{C, MAX_LANES};
use crate::simd::small::{self, Mat};
use num_complex::Complex64;
use pulp::Simd;

/// An overlap on a block of lines.
pub struct Lanes {
    /// How it is cut.
    pub pieces: Pieces,
    /// The lines.
    pub w: Vec<Complex64>,
    /// Their ways with the inner and with the outer beam lying behind, where asked for.
    ways: [Vec<Line>; 2],
    /// Weights of the two ways.
    weights: [[f64; 4]; 2],
}

/// States of one overlap under one load: by line, at the end of larger x of each piece from large x to small.
pub type States = Vec<Vec<[Complex64; 8]>>;

impl Lanes {
    /// Evaluates an overlap at the lines `w`, the largest |w|^2 of which is `most`, for the `ways` through it.
    pub fn new(beside: &Beside, w: &[Complex64], most: f64, ways: [bool; 2]) -> Self {
        let pieces = beside.pieces(most);
        let lines = |forward: bool| {
            let each = w.iter().map(|&w| Line::new(beside, &pieces, w, forward));
            if ways[usize::from(forward)] { each.collect() } else { Vec::new() }
        };
        Self {
            pieces,
            w: w.to_vec(),
            ways: [lines(false), lines(true)],
            weights: [beside.weights(most, false), beside.weights(most, true)],
        }
    }

    /// The way through of every line, from the plane of what lies behind.
    #[inline(always)]
    pub fn pass<S: Simd, const D: usize>(
        &self,
        plane: &Plane<S, D>,
        forward: bool,
        wanted: Wanted,
    ) -> Vec<Passed> {
        let (u, f) = plane.basis();
        let (u, f) = (lanes(&u, forward), lanes(&f, forward));
        let way = usize::from(forward);
        let lines = self.ways[way].iter().zip(u.into_iter().zip(f));
        lines.map(|(line, (u, f))| line.pass(&self.pieces, [u, f], &self.weights[way], wanted)).collect()
    }

    /// The states within from the plane behind and the independent variables after it.
    #[inline(always)]
    pub fn states<S: Simd, const D: usize>(
        &self,
        forward: bool,
        behind: &Plane<S, D>,
        independent: &[C<S>; D],
        states: &mut States,
    ) {
        let simd = independent[0].simd;
        let passed = self.pass(behind, forward, Wanted::States(forward));
        // The pivot of the way up once more: it gives the columns of the independent variables.
        let (_, inverse) = chart::<S, D>(simd, &passed, forward, &self.weights_behind(!forward));
        let columns = small::apply(&inverse, independent);
        let mut lanes = [[Complex64::ZERO; MAX_LANES]; 2];
        for j in 0..D {
            columns[j].store(&mut lanes[j]);
        }
        states.clear();
        for (lane, passed) in passed.iter().enumerate() {
            let mut found = Vec::with_capacity(passed.states.len());
            for state in &passed.states {
                let mut sum = [Complex64::ZERO; 8];
                for i in 0..8 {
                    sum[i] = state[i][0] * lanes[0][lane] + state[i][1] * lanes[1][lane];
                }
                found.push(if forward { sum } else { mirrored(&sum) });
            }
            if !forward {
                found.reverse();
            }
            states.push(found);
        }
    }

    /// Derivatives of H by the coefficients of the overlap from its states under two loads.
    #[inline(always)]
    pub fn derivatives<S: Simd>(
        &self,
        simd: S,
        beside: &Beside,
        left: &States,
        right: &States,
    ) -> [C<S>; DERIVATIVES] {
        let mut values = [[Complex64::ZERO; MAX_LANES]; DERIVATIVES];
        for (lane, &w) in self.w.iter().enumerate().take(MAX_LANES) {
            let found = layer::derivatives(beside, &self.pieces, w, &left[lane], &right[lane]);
            for (to, from) in values.iter_mut().zip(found) {
                to[lane] = from;
            }
        }
        let mut out = [C::zero(simd); DERIVATIVES];
        for (to, from) in out.iter_mut().zip(&values) {
            *to = C::load(simd, &from[..self.w.len().min(MAX_LANES)]);
        }
        out
    }

    /// Pivot weights of the beam that lies behind.
    pub fn weights_behind<const D: usize>(&self, forward: bool) -> [f64; D] {
        let [.., y, theta] = self.weights[usize::from(forward)];
        let mut out = [y; D];
        out[D - 1] = if D == 1 { y } else { theta };
        out
    }
}

/// The lanes of a matrix, one by one, slopes and moments with the sign that the way turns them to.
#[inline(always)]
fn lanes<S: Simd, const D: usize>(matrix: &Mat<S, D>, forward: bool) -> [Two; MAX_LANES] {
    let mut out = [[[Complex64::ZERO; 2]; 2]; MAX_LANES];
    let mut lanes = [Complex64::ZERO; MAX_LANES];
    for i in 0..D {
        for j in 0..D {
            matrix[i][j].store(&mut lanes);
            for lane in 0..MAX_LANES {
                out[lane][i][j] = if i == 1 && !forward { -lanes[lane] } else { lanes[lane] };
            }
        }
    }
    out
}

/// A matrix from its lines; lanes without a line repeat the last one.
#[inline(always)]
fn gathered<S: Simd, const D: usize>(simd: S, lines: &[Two], turned: bool) -> Mat<S, D> {
    let mut out = small::zeros(simd);
    for i in 0..D {
        for j in 0..D {
            let mut values = [Complex64::ZERO; MAX_LANES];
            for (to, line) in values.iter_mut().zip(lines) {
                *to = if i == 1 && turned { -line[i][j] } else { line[i][j] };
            }
            out[i][j] = C::load(simd, &values[..lines.len().min(MAX_LANES)]);
        }
    }
    out
}

/// The u rows of the near beam.
#[inline(always)]
pub fn near_u<S: Simd, const D: usize>(simd: S, passed: &[Passed], forward: bool) -> Mat<S, D> {
    let mut near = [[[Complex64::ZERO; 2]; 2]; MAX_LANES];
    for (near, passed) in near.iter_mut().zip(passed) {
        *near = passed.u;
    }
    gathered(simd, &near[..passed.len()], !forward)
}

/// The plane of the near beam, and the way back to the independent variables behind it.
#[inline(always)]
pub fn near_plane<S: Simd, const D: usize>(
    simd: S,
    passed: &[Passed],
    forward: bool,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let mut behind = [[[Complex64::ZERO; 2]; 2]; MAX_LANES];
    for (behind, passed) in behind.iter_mut().zip(passed) {
        *behind = passed.behind;
    }
    let (plane, inverse) = chart(simd, passed, forward, weights);
    (plane, small::mul(&gathered(simd, &behind[..passed.len()], false), &inverse))
}

/// The plane of the near beam, and the columns from its independent variables.
#[inline(always)]
fn chart<S: Simd, const D: usize>(
    simd: S,
    passed: &[Passed],
    forward: bool,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let mut found = [[[[Complex64::ZERO; 2]; 2]; MAX_LANES]; 2];
    let count = passed.len().min(MAX_LANES);
    for (lane, passed) in passed.iter().enumerate().take(count) {
        found[0][lane] = passed.u;
        found[1][lane] = passed.f;
    }
    let u = gathered(simd, &found[0][..count], !forward);
    let f = gathered(simd, &found[1][..count], !forward);
    Plane::pivot(&u, &f, weights)
}
