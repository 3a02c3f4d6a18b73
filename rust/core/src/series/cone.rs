//! Planes and states of a branch along a cone, as power series in (w / reference)^2.
//!
//! The equations are those of `minors`, with coefficients that differ along the cone: for each power
//!     p_n' = A0 p_n + A1 p_(n-1).
//! A0 only leads from VM to tV to yV to yM to yt, and for a state from V to M to theta to y, so that each power consists of
//! integrals one after another. They are taken in the Gauss points of slices, which converges faster than any power of the
//! number of points.

use crate::model::collocation::{COLLOCATION, POINTS};
use crate::model::cone::{Cone, Sampled};
use crate::series::minors::{MOST_TERMS, Minors, State, TV, Terms, VM, YM, YT, YV, trim};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};
use std::sync::LazyLock;

/// Points that are summed in one vector.
const LANES: usize = 8;

/// Vectors of the points and the end.
const VECTORS: usize = (POINTS + 1).div_ceil(LANES);

/// Room for the points and the end.
const ROOM: usize = VECTORS * LANES;

/// A real function in the points of a slice and at its end.
type Real = [f64; ROOM];

/// Real and imaginary part of a function.
type Values = [Real; 2];

const NOTHING: Values = [[0.0; ROOM]; 2];

/// For each point what its value adds to each integral.
static INTEGRALS: LazyLock<[[[f64; LANES]; VECTORS]; POINTS]> = LazyLock::new(|| {
    let mut out = [[[0.0; LANES]; VECTORS]; POINTS];
    for (i, row) in COLLOCATION.integrals.iter().enumerate() {
        for (j, weight) in row.iter().enumerate() {
            out[j][i / LANES][i % LANES] = *weight;
        }
    }
    out
});

/// Coefficients of a slice times its length.
struct Slice {
    alpha: Values,
    beta: Values,
    mu: Real,
    nu: Real,
    d: f64,
}

impl Slice {
    fn new<const D: usize>(sampled: &Sampled<D>, forward: bool, square: f64) -> Self {
        let d = if forward { sampled.shear } else { -sampled.shear };
        let mut out = Self { alpha: NOTHING, beta: NOTHING, mu: [0.0; ROOM], nu: [0.0; ROOM], d };
        for i in 0..POINTS {
            let (compliance, kinetic) = (sampled.compliance[i], sampled.kinetic[i]);
            (out.alpha[0][i], out.alpha[1][i]) = (compliance[0].re, compliance[0].im);
            (out.beta[0][i], out.beta[1][i]) = (compliance[D - 1].re, compliance[D - 1].im);
            (out.mu[i], out.nu[i]) = (kinetic[0] * square, kinetic[D - 1] * square);
        }
        out
    }
}

/// The integrals of a function from the near end, from a value there on.
#[inline(always)]
fn integral(rate: &Values, start: Complex64) -> Values {
    let mut sums = [[[start.re; LANES]; VECTORS], [[start.im; LANES]; VECTORS]];
    for (j, weights) in INTEGRALS.iter().enumerate() {
        for part in 0..2 {
            for vector in 0..VECTORS {
                for lane in 0..LANES {
                    let sum = &mut sums[part][vector][lane];
                    *sum = weights[vector][lane].mul_add(rate[part][j], *sum);
                }
            }
        }
    }
    let mut out = NOTHING;
    for part in 0..2 {
        out[part].copy_from_slice(sums[part].as_flattened());
    }
    out
}

/// Adds a multiple of a function.
#[inline(always)]
fn add(to: &mut Values, factor: f64, p: &Values) {
    for part in 0..2 {
        for i in 0..ROOM {
            to[part][i] = factor.mul_add(p[part][i], to[part][i]);
        }
    }
}

/// Adds a function times a real coefficient.
#[inline(always)]
fn add_real(to: &mut Values, factor: f64, coefficient: &Real, p: &Values) {
    for part in 0..2 {
        for i in 0..ROOM {
            to[part][i] = (factor * coefficient[i]).mul_add(p[part][i], to[part][i]);
        }
    }
}

/// Adds a function times a complex coefficient.
#[inline(always)]
fn add_complex(to: &mut Values, factor: f64, coefficient: &Values, p: &Values) {
    for i in 0..ROOM {
        let (re, im) = (factor * coefficient[0][i], factor * coefficient[1][i]);
        to[0][i] = im.mul_add(-p[1][i], re.mul_add(p[0][i], to[0][i]));
        to[1][i] = im.mul_add(p[0][i], re.mul_add(p[1][i], to[1][i]));
    }
}

/// The equations of some functions along a slice.
trait Equations<const M: usize> {
    /// The functions of a power from those of the power below and their values at the near end.
    fn power(&self, below: &[Values; M], start: &[Complex64; M]) -> [Values; M];
}

/// Those of the minors.
struct OfMinors(Slice);

impl Equations<5> for OfMinors {
    #[inline(always)]
    fn power(&self, below: &[Values; 5], start: &[Complex64; 5]) -> [Values; 5] {
        let Slice { alpha, beta, mu, nu, d } = &self.0;
        let mut p = [NOTHING; 5];
        let mut rate = NOTHING;
        add_real(&mut rate, 1.0, nu, &below[TV]);
        add_real(&mut rate, -1.0, mu, &below[YM]);
        p[VM] = integral(&rate, start[VM]);
        rate = NOTHING;
        add_real(&mut rate, 1.0, mu, &below[YT]);
        add_complex(&mut rate, -1.0, beta, &p[VM]);
        p[TV] = integral(&rate, start[TV]);
        rate = NOTHING;
        add(&mut rate, -d, &p[TV]);
        p[YV] = integral(&rate, start[YV]);
        rate = NOTHING;
        add(&mut rate, 2.0 * d, &p[YV]);
        add_complex(&mut rate, 1.0, alpha, &p[VM]);
        add_real(&mut rate, -1.0, nu, &below[YT]);
        p[YM] = integral(&rate, start[YM]);
        rate = NOTHING;
        add_complex(&mut rate, 1.0, beta, &p[YM]);
        add_complex(&mut rate, -1.0, alpha, &p[TV]);
        p[YT] = integral(&rate, start[YT]);
        p
    }
}

/// Those of a state y, theta, V, M.
struct OfState(Slice);

impl Equations<4> for OfState {
    #[inline(always)]
    fn power(&self, below: &[Values; 4], start: &[Complex64; 4]) -> [Values; 4] {
        let Slice { alpha, beta, mu, nu, d } = &self.0;
        let mut p = [NOTHING; 4];
        let mut rate = NOTHING;
        add_real(&mut rate, -1.0, mu, &below[0]);
        p[2] = integral(&rate, start[2]);
        rate = NOTHING;
        add(&mut rate, *d, &p[2]);
        add_real(&mut rate, -1.0, nu, &below[1]);
        p[3] = integral(&rate, start[3]);
        rate = NOTHING;
        add_complex(&mut rate, 1.0, beta, &p[3]);
        p[1] = integral(&rate, start[1]);
        rate = NOTHING;
        add(&mut rate, -d, &p[1]);
        add_complex(&mut rate, 1.0, alpha, &p[2]);
        p[0] = integral(&rate, start[0]);
        p
    }
}

/// Series at the far end of a slice from those at its near end; nothing where they do not converge.
struct Along<'a, E, const M: usize> {
    start: &'a Terms<M>,
    equations: E,
}

impl<E: Equations<M>, const M: usize> WithSimd for Along<'_, E, M> {
    type Output = Option<Terms<M>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let (mut below, mut sizes) = ([NOTHING; M], [0.0_f64; M]);
        let mut out = Terms::with_capacity(MOST_TERMS);
        for power in 0..MOST_TERMS {
            let start = self.start.get(power).copied().unwrap_or([Complex64::ZERO; M]);
            below = self.equations.power(&below, &start);
            let term = below.each_ref().map(|p| Complex64::new(p[0][POINTS], p[1][POINTS]));
            out.push(term);
            let mut settled = true;
            for i in 0..M {
                let size = term[i].l1_norm();
                sizes[i] = sizes[i].max(size);
                settled &= size <= 1e-19 * sizes[i];
            }
            // Some functions start at zero and wake up one power later.
            if settled && power > self.start.len() {
                return Some(out);
            }
        }
        None
    }
}

/// Series along a cone.
fn solution<E: Equations<M>, const M: usize, const D: usize>(
    equations: impl Fn(Slice) -> E,
    start: &Terms<M>,
    cone: &Cone<D>,
    forward: bool,
    square: f64,
) -> Option<Terms<M>> {
    let mut terms = start.clone();
    let (mut ends, _) = cone.ends(square.sqrt());
    if forward {
        ends.reverse();
    }
    for ends in ends.windows(2) {
        let slice = Slice::new(&cone.sampled([ends[0], ends[1]]), forward, square);
        terms = Arch::new().dispatch(Along { start: &terms, equations: equations(slice) })?;
        trim(&mut terms);
    }
    Some(terms)
}

/// Minors along a cone.
pub fn through<const D: usize>(start: &Minors, cone: &Cone<D>, forward: bool, square: f64) -> Option<Minors> {
    solution(OfMinors, start, cone, forward, square)
}

/// A state along a cone.
pub fn state_through<const D: usize>(
    start: &State,
    cone: &Cone<D>,
    forward: bool,
    square: f64,
) -> Option<State> {
    solution(OfState, start, cone, forward, square)
}
