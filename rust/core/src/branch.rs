//! A whole branch behind a free end as one power series in w^2, for many lines at once.
//!
//! The plane of a branch is given by the 2 x 2 minors of any basis of it. Along a segment the minors obey a
//! linear equation of their own (the second compound of the state's), whose coefficients are constant or
//! proportional to w^2, so every minor is an entire function of w^2 and the branch is one short series, however
//! many segments it has. With the rows (y, theta, V, M), V and M being loads, p_yV + p_thetaM = 0 holds by
//! reciprocity and five minors are left. Minors of a passive branch do not cancel, which is why no digits go
//! where a product of transfer matrices would lose them. Dashpots are not functions of w^2 and end a branch.

use crate::kernel::Segment;
use crate::lane::C;
use crate::model::{Model, Spring, Step};
use crate::plane::Plane;
use num_complex::Complex64;
use pulp::Simd;

/// Largest sum of |lambda| L over a branch: the terms outgrow the value by e^(0.41 span).
const MOST_SPAN: f64 = 12.0;

/// What a segment above its cut-off counts, both pairs of waves propagating and the value not growing at all.
const ABOVE_CUT_OFF: f64 = 3.0;

/// Lines from which on the series, which costs some microseconds a segment, is worth making.
const FEWEST_LINES: usize = 256;

/// Most terms of a series; MOST_SPAN needs about thirty.
const MOST_TERMS: usize = 64;

/// Positions of the five minors.
const YT: usize = 0;
const YV: usize = 1;
const YM: usize = 2;
const TV: usize = 3;
const VM: usize = 4;

/// Five minors as power series in (w / reference)^2.
pub struct Branch<const D: usize> {
    /// Coefficients, the highest power first.
    terms: Vec<[Complex64; 5]>,
    /// 1 / reference^2.
    scale: f64,
    /// The segment at the near end, whose impedances steer the choice of the chart.
    near: Segment<D>,
}

/// Series of the five minors, the lowest power first.
type Series = Vec<[Complex64; 5]>;

/// Replaces the beginning of each branch of a plan by its series where that serves.
///
/// `needed` holds for nodes, segments and joints whose states somebody wants to see.
pub fn shorten<const D: usize>(
    model: &Model,
    segments: &[Segment<D>],
    plan: Vec<Step>,
    highest: f64,
    lines: usize,
    needed: impl Fn(&Step) -> bool,
    branches: &mut Vec<Branch<D>>,
) -> Vec<Step> {
    if lines < FEWEST_LINES || D != 2 {
        return plan;
    }
    let mut out = Vec::with_capacity(plan.len());
    let mut at = 0;
    while at < plan.len() {
        let length = match plan[at] {
            Step::Leaf { .. } if !needed(&plan[at]) => reach(model, segments, &plan[at..], highest, &needed),
            _ => 1,
        };
        match Branch::new(model, segments, &plan[at..at + length], highest).filter(|_| length > 1) {
            Some(branch) => {
                out.push(Step::Branch { index: branches.len() });
                branches.push(branch);
            }
            None => out.extend_from_slice(&plan[at..at + length]),
        }
        at += length;
    }
    out
}

/// How many steps from a leaf on are functions of w^2, unobserved and short enough together.
fn reach<const D: usize>(
    model: &Model,
    segments: &[Segment<D>],
    plan: &[Step],
    highest: f64,
    needed: &impl Fn(&Step) -> bool,
) -> usize {
    let mut span = 0.0;
    let plain = |spring: &Spring| !spring.couples() && spring.c == [0.0; 3];
    for (count, step) in plan.iter().enumerate().skip(1) {
        let serves = match *step {
            Step::Segment { row, .. } => {
                let segment = &segments[row];
                let weight = if segment.cut_off_share(highest) > 0.5 { ABOVE_CUT_OFF } else { 1.0 };
                span += weight * segment.wave_number_square(highest * highest).sqrt() * segment.length;
                span <= MOST_SPAN
            }
            Step::Joint { row, .. } => plain(&model.joints[row].1),
            Step::Point { node } => {
                model.grounds.iter().all(|(ground, spring)| *ground != node || plain(spring))
            }
            Step::Leaf { .. } | Step::Overlap { .. } | Step::Join | Step::Branch { .. } => false,
        };
        if !serves || needed(step) {
            return count;
        }
    }
    plan.len()
}

impl<const D: usize> Branch<D> {
    /// The series of the steps from a leaf on, or nothing where it does not converge within bounds.
    fn new(model: &Model, segments: &[Segment<D>], plan: &[Step], highest: f64) -> Option<Self> {
        let mut minors: Series = vec![[Complex64::ZERO; 5]; 1];
        minors[0][YT] = Complex64::ONE;
        let square = highest * highest;
        let mut near = None;
        for step in plan {
            match *step {
                Step::Segment { row, forward, .. } => {
                    minors = through(&minors, &segments[row], forward, square)?;
                    near = Some(segments[row]);
                }
                Step::Joint { row, .. } => {
                    let spring = &model.joints[row].1;
                    let loss = Complex64::new(1.0, spring.loss_factor);
                    yielding(&mut minors, [(loss * spring.k[0]).inv(), (loss * spring.k[1]).inv()]);
                }
                Step::Point { node } => {
                    for (_, inertia) in model.masses.iter().filter(|mass| mass.0 == node) {
                        carried(
                            &mut minors,
                            inertia.map(|value| [Complex64::ZERO, (-value * square).into()]),
                        );
                    }
                    for (_, spring) in model.grounds.iter().filter(|ground| ground.0 == node) {
                        let loss = Complex64::new(1.0, spring.loss_factor);
                        let held = [spring.k[0], spring.k[1]].map(|k| [loss * k, Complex64::ZERO]);
                        carried(&mut minors, held);
                    }
                }
                _ => {}
            }
            trim(&mut minors);
        }
        minors.reverse();
        let finite = minors.iter().flatten().all(|value| value.is_finite());
        (finite && minors.len() <= MOST_TERMS).then_some(Self {
            terms: minors,
            scale: 1.0 / square,
            near: near?,
        })
    }

    /// The plane of the branch on a block of lines, the largest |w|^2 of which is `most`, with the weights.
    #[inline(always)]
    pub fn plane<S: Simd>(&self, simd: S, w2: C<S>, real: bool, most: f64) -> (Plane<S, D>, [f64; D]) {
        let weights = self.near.weights(self.near.wave_number_square(most));
        let x = w2.scale(self.scale);
        let mut sums = [C::zero(simd); 5];
        for coefficients in &self.terms {
            for k in 0..5 {
                let coefficient = C::splat(simd, coefficients[k]);
                sums[k] = if real {
                    sums[k].mul_add_real(x.re, coefficient)
                } else {
                    sums[k].mul_add(x, coefficient)
                };
            }
        }
        let minus_tv = -sums[TV];
        let minors = [sums[YT], sums[YV], sums[YM], minus_tv, sums[VM]];
        (Plane::from_minors(minors, &weights), weights)
    }
}

/// Drops the last powers that add less than rounding to every minor.
fn trim(minors: &mut Series) {
    let mut size = [0.0_f64; 5];
    for term in minors.iter() {
        for k in 0..5 {
            size[k] = size[k].max(term[k].l1_norm());
        }
    }
    while let Some(last) = minors.last() {
        if minors.len() > 1 && (0..5).all(|k| last[k].l1_norm() <= 1e-19 * size[k]) {
            minors.pop();
        } else {
            break;
        }
    }
}

/// f + z u on both degrees of freedom, z = `[constant, by w^2]`.
fn carried(minors: &mut Series, z: [[Complex64; 2]; 2]) {
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
fn yielding(minors: &mut Series, [cy, ct]: [Complex64; 2]) {
    for term in minors.iter_mut() {
        term[YT] += ct * term[YM] - cy * term[TV] + cy * ct * term[VM];
        term[YM] += cy * term[VM];
        term[TV] -= ct * term[VM];
    }
}

/// Along a segment: a Taylor series in the length of the linear equation that the minors obey,
///     p_yt' = beta p_yM - alpha p_tV,   p_yV' = -d p_tV,   p_yM' = 2 d p_yV + alpha p_VM - nu p_yt,
///     p_tV' = mu p_yt - beta p_VM,      p_VM' = nu p_tV - mu p_yM,
/// with d = 1 towards smaller x and -1 towards larger, mu and nu proportional to w^2.
fn through<const D: usize>(
    start: &Series,
    segment: &Segment<D>,
    forward: bool,
    square: f64,
) -> Option<Series> {
    let length = segment.length;
    let (compliance, kinetic) = (segment.per_length.compliance, segment.per_length.kinetic);
    let (alpha, beta) = (compliance[0] * length, compliance[D - 1] * length);
    let (mu, nu) = (kinetic[0] * square * length, kinetic[D - 1] * square * length);
    let d = if forward { length } else { -length };
    let mut sum = start.clone();
    let mut term = start.clone();
    for order in 1..400 {
        let share = 1.0 / f64::from(order);
        let mut next = vec![[Complex64::ZERO; 5]; term.len() + 1];
        for (k, p) in term.iter().enumerate() {
            let same = &mut next[k];
            same[YT] += (beta * p[YM] - alpha * p[TV]) * share;
            same[YV] -= p[TV] * (d * share);
            same[YM] += (p[YV] * (2.0 * d) + alpha * p[VM]) * share;
            same[TV] -= beta * p[VM] * share;
            let above = &mut next[k + 1];
            above[YM] -= p[YT] * (nu * share);
            above[TV] += p[YT] * (mu * share);
            above[VM] += (p[TV] * nu - p[YM] * mu) * share;
        }
        // Powers beyond what any line can see are dropped at once, or their number would grow with the order.
        next.truncate(MOST_TERMS);
        if sum.len() < next.len() {
            sum.resize(next.len(), [Complex64::ZERO; 5]);
        }
        let mut settled = true;
        let mut size = [0.0_f64; 5];
        for total in &sum {
            for k in 0..5 {
                size[k] = size[k].max(total[k].l1_norm());
            }
        }
        for (total, term) in sum.iter_mut().zip(&next) {
            for k in 0..5 {
                settled &= term[k].l1_norm() <= 1e-18 * total[k].l1_norm().max(1e-4 * size[k]);
                total[k] += term[k];
            }
        }
        term = next;
        // Some minors start at zero and wake up only after a few orders.
        if settled && order > 4 {
            return Some(sum);
        }
        trim_against(&mut term, &size);
    }
    None
}

/// Drops the last powers of a Taylor term that cannot matter beside the sums' sizes.
fn trim_against(term: &mut Series, size: &[f64; 5]) {
    while let Some(last) = term.last() {
        if term.len() > 1 && (0..5).all(|k| last[k].l1_norm() <= 1e-22 * size[k]) {
            term.pop();
        } else {
            break;
        }
    }
}
