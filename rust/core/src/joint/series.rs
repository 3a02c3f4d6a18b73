//! A receptance as a function of one joint's stiffness: fourteen power series in w^2 that no fit has to make again.
//!
//! The node of the load and of the response is the end of a chain, of which the part before the joint is called
//! the tool and that behind it the holder. Seen from the joint, let q be the minors of the holder's plane, p those
//! of the tool's with its end free, and r those with its end held in the direction of the response (see `minors`).
//! The joint adds its compliance C to the holder's displacements, which makes the minors of its plane
//!     q_yt + c22 q_yM - c11 q_tV + 2 c12 q_yV + det C q_VM,   q_yV - c12 q_VM,   q_yM + c11 q_VM,
//!     q_tV - c22 q_VM,   q_VM.
//! Both planes at once, loads in balance, have the determinant
//!     D = p_yt q_VM + p_VM q_yt - p_yM q_tV - p_tV q_yM - 2 p_yV q_yV,
//! N is the same with r in place of p, and H = N / D. Times det K, with C = K^-1, the parts with 1, c11, c22, c12
//! and det C make D = det K d0 + k22 d1 + k11 d2 + k12 d3 + d4, where d0 is D without the joint and
//!     d1 = -p_VM q_tV - p_tV q_VM,   d2 = p_VM q_yM + p_yM q_VM,   d3 = -2 (p_VM q_yV + p_yV q_VM),   d4 = p_VM q_VM.
//! The joint's relative motion under the unit load follows from Cramer's rule. With the state (y, theta, V, M) that
//! the free tool has at the joint when its end only moves in the other direction,
//!     x0 = q_VM theta - q_yV V - q_tV M,   x1 = q_VM M,   y0 = q_yV M - q_yM V - q_VM y,   y1 = -q_VM V,
//!     gap_y = (x1 + k22 x0 - k12 y0) / D,   gap_theta = (y1 + k11 y0 - k12 x0) / D,
//! up to one sign, and dH = -gap^T dK gap without the cancellation of the quotient's derivative.

use crate::joint::change::{Change, Update};
use crate::model::assembly::{Model, Step};
use crate::model::cone::Cone;
use crate::model::frequencies::Frequencies;
use crate::model::request::Coordinate;
use crate::model::section::Segment;
use crate::model::spring::Spring;
use crate::series::branch::{MOST_EXCESS, Parts, past};
use crate::series::cone;
use crate::series::minors::{
    MOST_TERMS, Minors, State, TV, Terms, VM, YM, YT, YV, state_carried, state_through, state_yielding, trim,
};
use crate::simd::lane::{C, negated};
use core::ops::Range;
use num_complex::Complex64;
use pulp::Simd;

/// Functions: n0 to n4, d0 to d4, x0, x1, y0, y1.
const FUNCTIONS: usize = 14;

/// Rows of a table of the series: the reference frequency, then real and imaginary parts of each function.
pub const SERIES_ROWS: usize = 1 + 2 * FUNCTIONS;

/// Series at one joint: constant part and part by i w of N, D and the two gaps, real and imaginary each.
const AT_JOINT: usize = 16;

/// The series of a model about one joint as a table of `SERIES_ROWS`, the lowest power first.
///
/// Nothing where a receptance is not such a function of real lines up to the highest: dashpots or couplings
/// elsewhere, branches, a load away from the response or from the chain's end, more waves than a series serves.
pub fn joint_series(
    model: &Model,
    joint: usize,
    highest: f64,
    response: Coordinate,
    excitation: Coordinate,
) -> Option<Vec<f64>> {
    if response != excitation {
        return None;
    }
    let plan = model.plan(response.node);
    let at = plan.iter().position(|step| matches!(step, Step::Joint { row, .. } if *row == joint))?;
    let segments: Vec<Segment<2>> =
        model.segments.iter().map(|row| Segment::new(row, model.motion)).collect();
    let cones: Vec<Option<Cone<2>>> = model.segments.iter().map(|row| Cone::new(row, model.motion)).collect();
    let parts = Parts { model, segments: &segments, cones: &cones };
    if !serves(&parts, &plan, joint, highest) {
        return None;
    }
    let square = highest * highest;
    let mut holder = one(YT, 1.0);
    for step in &plan[..at] {
        past(&parts, &mut holder, step, square)?;
    }
    let (mut held, mut state) =
        if response.direction == 0 { (one(TV, -1.0), one(1, 1.0)) } else { (one(YM, 1.0), one(0, 1.0)) };
    let mut free = one(YT, 1.0);
    for step in plan[at + 1..].iter().rev() {
        let step = turned(step);
        past(&parts, &mut free, &step, square)?;
        past(&parts, &mut held, &step, square)?;
        state_past(&parts, &mut state, &step, square)?;
    }
    let mut series = vec![[Complex64::ZERO; FUNCTIONS]; 1];
    determinants(&mut series, 0, &held, &holder);
    determinants(&mut series, 5, &free, &holder);
    gaps(&mut series, 10, &state, &holder);
    trim(&mut series);
    let finite = series.iter().flatten().all(|value| value.is_finite());
    (finite && series.len() <= MOST_TERMS).then(|| table(&series, highest))
}

/// Whether a plan is one chain of functions of w^2, but for the joint, and short enough.
fn serves(parts: &Parts<2>, plan: &[Step], joint: usize, highest: f64) -> bool {
    let (mut excess, model) = (0.0, parts.model);
    for step in plan {
        let plain = match *step {
            Step::Segment { row, .. } => {
                excess += parts.excess(row, highest);
                true
            }
            Step::Joint { row, .. } => row == joint || model.joints[row].1.is_plain(),
            Step::Point { node } => model.has_plain_point(node),
            Step::Leaf { .. } => true,
            Step::Overlap { .. } | Step::Join | Step::Branch { .. } => false,
        };
        if !plain {
            return false;
        }
    }
    highest > 0.0 && excess <= MOST_EXCESS
}

/// One function that is constant, the others zero.
fn one<const M: usize>(which: usize, value: f64) -> Terms<M> {
    let mut term = [Complex64::ZERO; M];
    term[which] = value.into();
    vec![term]
}

/// The same step the other way.
fn turned(step: &Step) -> Step {
    match *step {
        Step::Segment { row, forward, far } => Step::Segment { row, forward: !forward, far },
        other => other,
    }
}

/// As `branch::past`, for a state.
fn state_past(parts: &Parts<2>, state: &mut State, step: &Step, square: f64) -> Option<()> {
    match *step {
        Step::Segment { row, forward, .. } => {
            *state = match &parts.cones[row] {
                Some(cone) => cone::state_through(state, cone, forward, square)?,
                None => state_through(state, &parts.segments[row], forward, square)?,
            };
        }
        Step::Joint { row, .. } => state_yielding(state, parts.model.joints[row].1.plain_compliance()),
        Step::Point { node } => {
            for impedance in parts.model.plain_impedances(node, square) {
                state_carried(state, impedance);
            }
        }
        _ => {}
    }
    trim(state);
    Some(())
}

/// Adds `factor` a_i b_j to a function.
fn add_product<const M: usize>(
    series: &mut Terms<FUNCTIONS>,
    function: usize,
    factor: f64,
    (a, i): (&Terms<M>, usize),
    (b, j): (&Minors, usize),
) {
    let length = a.len() + b.len() - 1;
    if series.len() < length {
        series.resize(length, [Complex64::ZERO; FUNCTIONS]);
    }
    for (k, x) in a.iter().enumerate() {
        let x = x[i] * factor;
        for (l, y) in b.iter().enumerate() {
            series[k + l][function] += x * y[j];
        }
    }
}

/// The five functions of a determinant of the tool's minors p and the holder's q, from `first` on.
fn determinants(series: &mut Terms<FUNCTIONS>, first: usize, p: &Minors, q: &Minors) {
    const PRODUCTS: [(usize, f64, usize, usize); 12] = [
        (0, 1.0, YT, VM),
        (0, 1.0, VM, YT),
        (0, -1.0, YM, TV),
        (0, -1.0, TV, YM),
        (0, -2.0, YV, YV),
        (1, -1.0, VM, TV),
        (1, -1.0, TV, VM),
        (2, 1.0, VM, YM),
        (2, 1.0, YM, VM),
        (3, -2.0, VM, YV),
        (3, -2.0, YV, VM),
        (4, 1.0, VM, VM),
    ];
    for (function, factor, i, j) in PRODUCTS {
        add_product(series, first + function, factor, (p, i), (q, j));
    }
}

/// The four functions of the gaps, from `first` on.
fn gaps(series: &mut Terms<FUNCTIONS>, first: usize, state: &State, q: &Minors) {
    const PRODUCTS: [(usize, f64, usize, usize); 8] = [
        (0, 1.0, 1, VM),
        (0, -1.0, 2, YV),
        (0, -1.0, 3, TV),
        (1, 1.0, 3, VM),
        (2, 1.0, 3, YV),
        (2, -1.0, 2, YM),
        (2, -1.0, 0, VM),
        (3, -1.0, 2, VM),
    ];
    for (function, factor, i, j) in PRODUCTS {
        add_product(series, first + function, factor, (state, i), (q, j));
    }
}

/// The rows of the table.
fn table(series: &Terms<FUNCTIONS>, reference: f64) -> Vec<f64> {
    let mut rows = vec![reference; series.len()];
    for function in 0..FUNCTIONS {
        rows.extend(series.iter().map(|term| term[function].re));
        rows.extend(series.iter().map(|term| term[function].im));
    }
    rows
}

/// The series at one joint.
pub struct AtJoint {
    /// Coefficients, the highest power first.
    terms: Vec<[f64; AT_JOINT]>,
    /// 1 / reference^2.
    scale: f64,
}

impl AtJoint {
    /// From a table of `SERIES_ROWS`.
    pub fn new(rows: &[f64], joint: &Spring) -> Self {
        let count = rows.len() / SERIES_ROWS;
        let reference = rows.first().copied().unwrap_or(1.0);
        let at = |function: usize, power: usize| {
            let row = (1 + 2 * function) * count + power;
            Complex64::new(rows[row], rows[row + count])
        };
        let (k, c) = (joint.hysteretic(), joint.c);
        // Sizes near one, or the product N D might overflow.
        let size = |i: usize| 1.0 / (k[i].norm() + reference * c[i]);
        let size = size(0) * size(1);
        let determinant = [
            (k[0] * k[1] - k[2] * k[2]) * size,
            (k[0] * c[1] + k[1] * c[0] - 2.0 * k[2] * c[2]) * size,
            Complex64::from((c[2] * c[2] - c[0] * c[1]) * reference * reference * size),
        ];
        let (k, c) = (k.map(|k| k * size), c.map(|c| c * size));
        let mut terms = vec![[Complex64::ZERO; AT_JOINT / 2]; count + 1];
        for power in 0..count {
            let f = |function: usize| at(function, power);
            for (place, first) in [(0, 0), (2, 5)] {
                let one = f(first);
                let by = [f(first + 2), f(first + 1), f(first + 3)];
                terms[power][place] += determinant[0] * one + f(first + 4) * size;
                terms[power][place + 1] += determinant[1] * one;
                terms[power + 1][place] += determinant[2] * one;
                for i in 0..3 {
                    terms[power][place] += k[i] * by[i];
                    terms[power][place + 1] += c[i] * by[i];
                }
            }
            terms[power][4] = f(11) * size + k[1] * f(10) - k[2] * f(12);
            terms[power][5] = c[1] * f(10) - c[2] * f(12);
            terms[power][6] = f(13) * size + k[0] * f(12) - k[2] * f(10);
            terms[power][7] = c[0] * f(12) - c[2] * f(10);
        }
        trim(&mut terms);
        let flat = |term: &[Complex64; AT_JOINT / 2]| {
            let mut out = [0.0; AT_JOINT];
            for (pair, value) in term.iter().enumerate() {
                (out[2 * pair], out[2 * pair + 1]) = (value.re, value.im);
            }
            out
        };
        Self { terms: terms.iter().rev().map(flat).collect(), scale: 1.0 / (reference * reference) }
    }
}

impl Change for AtJoint {
    #[inline(always)]
    fn update<S: Simd>(&self, simd: S, w: &Frequencies, lines: Range<usize>) -> Update<S> {
        let w = w.load(simd, lines).re;
        let x = simd.mul_f64s(simd.mul_f64s(w, w), simd.splat_f64s(self.scale));
        let mut sums = [simd.splat_f64s(0.0); AT_JOINT];
        for coefficients in &self.terms {
            for k in 0..AT_JOINT {
                sums[k] = simd.mul_add_e_f64s(sums[k], x, simd.splat_f64s(coefficients[k]));
            }
        }
        let mut values = [C::zero(simd); AT_JOINT / 4];
        for k in 0..AT_JOINT / 4 {
            let minus = negated(simd, sums[4 * k + 3]);
            values[k].re = simd.mul_add_e_f64s(w, minus, sums[4 * k]);
            values[k].im = simd.mul_add_e_f64s(w, sums[4 * k + 2], sums[4 * k + 1]);
        }
        let [above, below, first, second] = values;
        let over = (above * below).recip();
        Update {
            inverse: below * below * over,
            left: [first * over, second * over],
            right: [first, second],
            iw: C { simd, re: simd.splat_f64s(0.0), im: w },
        }
    }
}
