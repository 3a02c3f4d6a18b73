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
use crate::minors::{MOST_TERMS, Minors, TV, VM, YM, YT, YV, carried, through, trim, yielding};
use crate::model::{Model, Spring, Step};
use crate::plane::Plane;
use num_complex::Complex64;
use pulp::Simd;

/// Largest sum of |lambda| L over a branch: the terms outgrow the value by e^(0.41 span).
pub const MOST_SPAN: f64 = 12.0;

/// What a segment above its cut-off counts, both pairs of waves propagating and the value not growing at all.
const ABOVE_CUT_OFF: f64 = 3.0;

/// Lines from which on the series, which costs some microseconds a segment, is worth making.
const FEWEST_LINES: usize = 256;

/// Five minors as power series in (w / reference)^2.
pub struct Branch<const D: usize> {
    /// Coefficients, the highest power first.
    terms: Vec<[Complex64; 5]>,
    /// 1 / reference^2.
    scale: f64,
    /// The segment at the near end, whose impedances steer the choice of the chart.
    near: Segment<D>,
}

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
    for (count, step) in plan.iter().enumerate().skip(1) {
        let serves = match *step {
            Step::Segment { row, .. } => {
                span += segments[row].span(highest);
                span <= MOST_SPAN
            }
            Step::Joint { row, .. } => model.joints[row].1.is_plain(),
            Step::Point { node } => model.has_plain_point(node),
            Step::Leaf { .. } | Step::Overlap { .. } | Step::Join | Step::Branch { .. } => false,
        };
        if !serves || needed(step) {
            return count;
        }
    }
    plan.len()
}

/// Carries series of minors past one step of a sweep towards its root; nothing where it does not converge.
pub fn past<const D: usize>(
    model: &Model,
    segments: &[Segment<D>],
    minors: &mut Minors,
    step: &Step,
    square: f64,
) -> Option<()> {
    match *step {
        Step::Segment { row, forward, .. } => {
            *minors = through(minors, &segments[row], forward, square)?;
        }
        Step::Joint { row, .. } => {
            yielding(minors, model.joints[row].1.plain_compliance());
        }
        Step::Point { node } => {
            for impedance in model.plain_impedances(node, square) {
                carried(minors, impedance);
            }
        }
        _ => {}
    }
    trim(minors);
    Some(())
}

impl Spring {
    /// Whether it is a function of w^2 and leaves translation and rotation apart.
    pub fn is_plain(&self) -> bool {
        !self.couples() && self.c == [0.0; 3]
    }

    /// The two stiffnesses of a plain spring.
    fn plain_stiffness(&self) -> [Complex64; 2] {
        let loss = Complex64::new(1.0, self.loss_factor);
        [loss * self.k[0], loss * self.k[1]]
    }

    /// The two compliances of a plain spring.
    pub fn plain_compliance(&self) -> [Complex64; 2] {
        self.plain_stiffness().map(|stiffness| stiffness.inv())
    }
}

impl<const D: usize> Segment<D> {
    /// What the segment counts in the span of a series up to |w| = `highest`.
    pub fn span(&self, highest: f64) -> f64 {
        let weight = if self.cut_off_share(highest) > 0.5 { ABOVE_CUT_OFF } else { 1.0 };
        weight * self.wave_number_square(highest * highest).sqrt() * self.length
    }
}

impl Model {
    /// Whether the point elements of a node are functions of w^2 that leave translation and rotation apart.
    pub fn has_plain_point(&self, node: usize) -> bool {
        self.grounds.iter().all(|(ground, spring)| *ground != node || spring.is_plain())
    }

    /// What each mass and plain spring of a node adds to f per u, `[constant, by (w / reference)^2]`.
    pub fn plain_impedances(&self, node: usize, square: f64) -> Vec<[[Complex64; 2]; 2]> {
        let masses = self.masses.iter().filter(|mass| mass.0 == node);
        let grounds = self.grounds.iter().filter(|ground| ground.0 == node);
        let inert =
            masses.map(|(_, inertia)| inertia.map(|value| [Complex64::ZERO, (-value * square).into()]));
        let held = grounds.map(|(_, spring)| spring.plain_stiffness().map(|k| [k, Complex64::ZERO]));
        inert.chain(held).collect()
    }
}

impl<const D: usize> Branch<D> {
    /// The series of the steps from a leaf on, or nothing where it does not converge within bounds.
    fn new(model: &Model, segments: &[Segment<D>], plan: &[Step], highest: f64) -> Option<Self> {
        let mut minors: Minors = vec![[Complex64::ZERO; 5]; 1];
        minors[0][YT] = Complex64::ONE;
        let square = highest * highest;
        let mut near = None;
        for step in plan {
            past(model, segments, &mut minors, step, square)?;
            if let Step::Segment { row, .. } = *step {
                near = Some(segments[row]);
            }
        }
        minors.reverse();
        let finite = minors.iter().flatten().all(|value| value.is_finite());
        (finite && minors.len() <= MOST_TERMS).then_some(Self {
            terms: minors,
            scale: 1.0 / square,
            near: near?,
        })
    }

    /// Coefficients, the highest power first.
    pub fn terms(&self) -> &[[Complex64; 5]] {
        &self.terms
    }

    /// 1 / reference^2.
    pub fn scale(&self) -> f64 {
        self.scale
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
