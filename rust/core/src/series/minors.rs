//! Planes and states of a branch as power series in (w / reference)^2.
//!
//! With d = 1 where a sweep goes towards smaller x and -1 towards larger, alpha and beta the compliances and mu and
//! nu the inertias (proportional to w^2) of a segment, the state (y, theta, V, M) obeys along the sweep
//!     y' = -d theta + alpha V,   theta' = beta M,   V' = -mu y,   M' = d V - nu theta,
//! V and M being loads. The 2 x 2 minors of a plane of such states obey the second compound of that equation,
//!     p_yt' = beta p_yM - alpha p_tV,   p_yV' = -d p_tV,   p_yM' = 2 d p_yV + alpha p_VM - nu p_yt,
//!     p_tV' = mu p_yt - beta p_VM,      p_VM' = nu p_tV - mu p_yM,
//! where p_yV + p_tM = 0 (reciprocity) leaves five of the six.
//!
//! The equations are solved by Taylor series in the length between power series. Powers lie side
//! by side, real and imaginary parts apart, so that several are taken at a time. No product is fused with a sum, so that
//! the series do not depend on the instruction set.

use crate::model::section::Segment;
use crate::simd::lane::{C, R};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Most terms of a series; MOST_EXCESS needs about thirty.
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

/// Most orders of the Taylor series.
const MOST_ORDERS: u32 = 400;

/// Powers are taken up to a multiple of this, the widest vector; those beyond the last are zero.
const STEP: usize = crate::simd::lane::MAX_LANES;

/// A linear equation.
pub trait Equation<const M: usize> {
    /// A share of the derivative at functions of some powers: the part in these powers, and that in the next ones.
    fn derivative<S: Simd>(&self, p: &[C<S>; M], share: f64) -> [[C<S>; M]; 2];
}

/// A complex constant times p.
#[inline(always)]
pub fn times<S: Simd>(constant: Complex64, p: C<S>) -> C<S> {
    let (by_re, by_im) = (p.scale(constant.re), p.scale(constant.im));
    C { simd: p.simd, re: p.simd.sub_f64s(by_re.re, by_im.im), im: p.simd.add_f64s(by_re.im, by_im.re) }
}

/// Power series of several functions.
struct Powers<const M: usize> {
    /// Real and imaginary parts of each.
    parts: [[[f64; MOST_TERMS]; 2]; M],
    /// Number of powers.
    length: usize,
}

impl<const M: usize> Powers<M> {
    #[inline(always)]
    fn new(terms: &Terms<M>) -> Self {
        let mut out = Self::zeros(terms.len());
        for (k, term) in terms.iter().enumerate() {
            for i in 0..M {
                (out.parts[i][0][k], out.parts[i][1][k]) = (term[i].re, term[i].im);
            }
        }
        out
    }

    #[inline(always)]
    fn zeros(length: usize) -> Self {
        Self { parts: [[[0.0; MOST_TERMS]; 2]; M], length }
    }

    fn terms(&self) -> Terms<M> {
        (0..self.length).map(|k| core::array::from_fn(|i| self.term(i, k))).collect()
    }

    #[inline(always)]
    fn term(&self, i: usize, k: usize) -> Complex64 {
        Complex64::new(self.parts[i][0][k], self.parts[i][1][k])
    }

    /// Powers to go through: all, and zeros up to the next full step.
    #[inline(always)]
    fn reach(&self) -> usize {
        const { assert!(MOST_TERMS.is_multiple_of(STEP), "powers come in full steps") };
        self.length.next_multiple_of(STEP).min(MOST_TERMS)
    }

    /// Vectors to go through.
    #[inline(always)]
    fn blocks<S: Simd>(&self) -> usize {
        self.reach() / S::F64_LANES
    }

    /// Some powers of a function.
    #[inline(always)]
    fn block<S: Simd>(&self, simd: S, i: usize, block: usize) -> C<S> {
        let [re, im] = &self.parts[i];
        C { simd, re: S::as_simd_f64s(re).0[block], im: S::as_simd_f64s(im).0[block] }
    }

    /// Sets some powers of a function.
    #[inline(always)]
    fn set<S: Simd>(&mut self, i: usize, block: usize, value: C<S>) {
        let [re, im] = &mut self.parts[i];
        S::as_mut_simd_f64s(re).0[block] = value.re;
        S::as_mut_simd_f64s(im).0[block] = value.im;
    }

    /// The largest coefficient of each function.
    #[inline(always)]
    fn sizes<S: Simd>(&self, simd: S) -> [f64; M] {
        let mut sizes = [0.0; M];
        for i in 0..M {
            let mut most = R::splat(simd, 0.0);
            for block in 0..self.blocks::<S>() {
                most = most.max(size(self.block(simd, i, block)));
            }
            sizes[i] = simd.reduce_max_f64s(most.v);
        }
        sizes
    }

    /// Becomes a share of the derivative of other functions.
    #[inline(always)]
    fn derive<S: Simd>(&mut self, simd: S, p: &Self, equation: &impl Equation<M>, share: f64) {
        let (reach, before) = (p.reach(), self.reach());
        // The contribution of each power to the next one, a step further on.
        let mut up = [[[0.0; MOST_TERMS + STEP]; 2]; M];
        for block in 0..p.blocks::<S>() {
            let [same, above] =
                equation.derivative(&core::array::from_fn(|i| p.block(simd, i, block)), share);
            for i in 0..M {
                let [re, im] = &mut up[i];
                S::as_mut_simd_f64s(&mut re[STEP..]).0[block] = above[i].re;
                S::as_mut_simd_f64s(&mut im[STEP..]).0[block] = above[i].im;
                self.set(i, block, same[i]);
            }
        }
        for i in 0..M {
            let [re, im] = &up[i];
            let (re, im) = (S::as_simd_f64s(&re[STEP - 1..]).0, S::as_simd_f64s(&im[STEP - 1..]).0);
            for block in 0..p.blocks::<S>() {
                let below = C { simd, re: re[block], im: im[block] };
                let same = self.block(simd, i, block);
                self.set(i, block, same + below);
            }
            for part in 0..2 {
                for k in reach..before {
                    self.parts[i][part][k] = 0.0;
                }
                if reach < MOST_TERMS {
                    self.parts[i][part][reach] = up[i][part][STEP + reach - 1];
                }
            }
        }
        // Powers without an effect on any line are dropped at once; otherwise their number would grow with the order.
        self.length = (p.length + 1).min(MOST_TERMS);
    }

    /// Adds; whether everything added is less than rounding.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, other: &Self, sizes: &[f64; M]) -> bool {
        self.length = self.length.max(other.length);
        let (yes, no) = (R::splat(simd, 0.0), R::splat(simd, 1.0));
        let mut unsettled = yes;
        for i in 0..M {
            let least = R::splat(simd, 1e-4 * sizes[i]);
            for block in 0..other.blocks::<S>() {
                let (value, more) = (self.block(simd, i, block), other.block(simd, i, block));
                let rounding = size(value).max(least) * R::splat(simd, 1e-18);
                let small = simd.less_than_or_equal_f64s(size(more).v, rounding.v);
                unsettled = unsettled.max(R::select(small, yes, no));
                self.set(i, block, value + more);
            }
        }
        simd.reduce_max_f64s(unsettled.v) == 0.0
    }

    /// Drops the last powers that are below a share of the sizes.
    #[inline(always)]
    fn drop_below(&mut self, sizes: &[f64; M], share: f64) {
        while self.length > 1 {
            let last = self.length - 1;
            if !(0..M).all(|i| self.term(i, last).l1_norm() <= share * sizes[i]) {
                break;
            }
            for [re, im] in &mut self.parts {
                (re[last], im[last]) = (0.0, 0.0);
            }
            self.length = last;
        }
    }
}

/// Sum of the moduli of both parts.
#[inline(always)]
fn size<S: Simd>(value: C<S>) -> R<S> {
    let simd = value.simd;
    R { simd, v: simd.add_f64s(simd.abs_f64s(value.re), simd.abs_f64s(value.im)) }
}

/// The solution at the length one from that at zero; nothing where it does not converge.
pub fn solution<const M: usize>(start: &Terms<M>, equation: &impl Equation<M>) -> Option<Terms<M>> {
    if start.len() > MOST_TERMS {
        return None;
    }
    Arch::new().dispatch(Solve { start, equation })
}

struct Solve<'a, E, const M: usize> {
    start: &'a Terms<M>,
    equation: &'a E,
}

impl<E: Equation<M>, const M: usize> WithSimd for Solve<'_, E, M> {
    type Output = Option<Terms<M>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let mut sum = Powers::new(self.start);
        let mut rooms = [Powers::new(self.start), Powers::zeros(0)];
        let [mut term, mut next] = rooms.each_mut();
        for order in 1..MOST_ORDERS {
            let sizes = sum.sizes(simd);
            next.derive(simd, term, self.equation, 1.0 / f64::from(order));
            (term, next) = (next, term);
            let settled = sum.add(simd, term, &sizes);
            // Some functions start at zero and wake up only after a few orders.
            if settled && order > 4 {
                return Some(sum.terms());
            }
            term.drop_below(&sizes, 1e-22);
        }
        None
    }
}
