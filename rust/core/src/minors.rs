//! Planes and states of a branch as power series in (w / reference)^2.
//!
//! With d = 1 where a sweep goes towards smaller x and -1 towards larger, alpha and beta the compliances and mu and
//! nu the inertias (proportional to w^2) of a segment, the state (y, theta, V, M) obeys along the sweep
//!     y' = -d theta + alpha V,   theta' = beta M,   V' = -mu y,   M' = d V - nu theta,
//! V and M being loads. The 2 x 2 minors of a plane of such states obey the second compound of that equation,
//!     p_yt' = beta p_yM - alpha p_tV,   p_yV' = -d p_tV,   p_yM' = 2 d p_yV + alpha p_VM - nu p_yt,
//!     p_tV' = mu p_yt - beta p_VM,      p_VM' = nu p_tV - mu p_yM,
//! where p_yV + p_tM = 0 (reciprocity) leaves five of the six.

use crate::kernel::Segment;
use crate::lane::C;
use crate::taylor::{Equation, solution, times};
use num_complex::Complex64;
use pulp::Simd;

/// Most terms of a series; MOST_SPAN needs about thirty.
pub const MOST_TERMS: usize = 64;

/// Positions of the five minors.
pub const YT: usize = 0;
/// y and V.
pub const YV: usize = 1;
/// y and M.
pub const YM: usize = 2;
/// theta and V.
pub const TV: usize = 3;
/// V and M.
pub const VM: usize = 4;

/// Power series of several functions, the lowest power first.
pub type Terms<const M: usize> = Vec<[Complex64; M]>;

/// Series of the five minors.
pub type Minors = Terms<5>;

/// Series of one state y, theta, V, M.
pub type State = Terms<4>;

/// A segment's coefficients times its length.
#[derive(Copy, Clone)]
struct Whole {
    alpha: Complex64,
    beta: Complex64,
    mu: f64,
    nu: f64,
    d: f64,
}

impl Whole {
    fn new<const D: usize>(segment: &Segment<D>, forward: bool, square: f64) -> Self {
        let length = segment.length;
        let (compliance, kinetic) = (segment.per_length.compliance, segment.per_length.kinetic);
        Self {
            alpha: compliance[0] * length,
            beta: compliance[D - 1] * length,
            mu: kinetic[0] * square * length,
            nu: kinetic[D - 1] * square * length,
            d: if forward { length } else { -length },
        }
    }
}

/// Drops the last powers that add less than rounding to every function.
pub fn trim<const M: usize>(series: &mut Terms<M>) {
    let mut size = [0.0_f64; M];
    for term in series.iter() {
        for k in 0..M {
            size[k] = size[k].max(term[k].l1_norm());
        }
    }
    while let Some(last) = series.last() {
        if series.len() > 1 && (0..M).all(|k| last[k].l1_norm() <= 1e-19 * size[k]) {
            series.pop();
        } else {
            break;
        }
    }
}

/// f + z u on both degrees of freedom, z = `[constant, by w^2]`.
pub fn carried(minors: &mut Minors, z: [[Complex64; 2]; 2]) {
    let before = minors.clone();
    let [zy, zt] = z;
    minors.resize(before.len() + 2, [Complex64::ZERO; 5]);
    for (k, term) in before.iter().enumerate() {
        for power in 0..2 {
            let into = &mut minors[k + power];
            into[YM] += zt[power] * term[YT];
            into[TV] -= zy[power] * term[YT];
            into[VM] += zy[power] * term[YM] - zt[power] * term[TV];
            for other in 0..2 {
                minors[k + power + other][VM] += zy[power] * zt[other] * term[YT];
            }
        }
    }
}

/// u + c f on both degrees of freedom.
pub fn yielding(minors: &mut Minors, [cy, ct]: [Complex64; 2]) {
    for term in minors.iter_mut() {
        term[YT] += ct * term[YM] - cy * term[TV] + cy * ct * term[VM];
        term[YM] += cy * term[VM];
        term[TV] -= ct * term[VM];
    }
}

/// f + z u of a state.
pub fn state_carried(state: &mut State, z: [[Complex64; 2]; 2]) {
    let before = state.clone();
    state.resize(before.len() + 1, [Complex64::ZERO; 4]);
    for (k, term) in before.iter().enumerate() {
        for power in 0..2 {
            state[k + power][2] += z[0][power] * term[0];
            state[k + power][3] += z[1][power] * term[1];
        }
    }
}

/// u + c f of a state.
pub fn state_yielding(state: &mut State, [cy, ct]: [Complex64; 2]) {
    for term in state.iter_mut() {
        term[0] += cy * term[2];
        term[1] += ct * term[3];
    }
}

/// Minors along a segment.
pub fn through<const D: usize>(
    start: &Minors,
    segment: &Segment<D>,
    forward: bool,
    square: f64,
) -> Option<Minors> {
    solution(start, &OfMinors(Whole::new(segment, forward, square)))
}

/// A state along a segment.
pub fn state_through<const D: usize>(
    start: &State,
    segment: &Segment<D>,
    forward: bool,
    square: f64,
) -> Option<State> {
    solution(start, &OfState(Whole::new(segment, forward, square)))
}

/// The equation of the minors.
struct OfMinors(Whole);

impl Equation<5> for OfMinors {
    #[inline(always)]
    fn derivative<S: Simd>(&self, p: &[C<S>; 5], share: f64) -> [[C<S>; 5]; 2] {
        let Whole { alpha, beta, mu, nu, d } = self.0;
        let [mut same, mut above] = [[C::zero(p[0].simd); 5]; 2];
        same[YT] = (times(beta, p[YM]) - times(alpha, p[TV])).scale(share);
        same[YV] = p[TV].scale(-d * share);
        same[YM] = (p[YV].scale(2.0 * d) + times(alpha, p[VM])).scale(share);
        same[TV] = times(-beta, p[VM]).scale(share);
        above[YM] = p[YT].scale(-nu * share);
        above[TV] = p[YT].scale(mu * share);
        above[VM] = (p[TV].scale(nu) - p[YM].scale(mu)).scale(share);
        [same, above]
    }
}

/// The equation of a state.
struct OfState(Whole);

impl Equation<4> for OfState {
    #[inline(always)]
    fn derivative<S: Simd>(&self, p: &[C<S>; 4], share: f64) -> [[C<S>; 4]; 2] {
        let Whole { alpha, beta, mu, nu, d } = self.0;
        let [mut same, mut above] = [[C::zero(p[0].simd); 4]; 2];
        same[0] = (times(alpha, p[2]) - p[1].scale(d)).scale(share);
        same[1] = times(beta, p[3]).scale(share);
        same[3] = p[2].scale(d * share);
        above[2] = p[0].scale(-mu * share);
        above[3] = p[1].scale(-nu * share);
        [same, above]
    }
}
