//! A whole branch behind a free end as one power series in w^2, for many lines at once.
//!
//! The plane of a branch is given by the 2 x 2 minors of any basis of it. Along a segment the minors obey a
//! linear equation of their own (the second compound of the state's), whose coefficients are constant or
//! proportional to w^2, so every minor is an entire function of w^2 and the branch is one short series, however
//! many segments it has. With the rows (y, theta, V, M), V and M being loads, p_yV + p_thetaM = 0 holds by
//! reciprocity and five minors are left. Minors of a passive branch do not cancel, which is why no digits go
//! where a product of transfer matrices would lose them. Dashpots are not functions of w^2 and end a branch.
//!
//! With u the displacements and f the loads of the plane, H = u f^-1 is a quotient of minors,
//!     H_yy = p_yM / p_VM,   H_ytheta = -p_yV / p_VM,   H_thetatheta = -p_tV / p_VM,
//! so that for H alone no chart is chosen and only the required minors are summed.

use crate::model::assembly::{Model, Step};
use crate::model::cone::Cone;
use crate::model::frequencies::Frequencies;
use crate::model::section::Segment;
use crate::model::spring::Spring;
use crate::series::cone;
use crate::series::minors::{MOST_TERMS, Minors, TV, VM, YM, YT, YV, carried, through, trim, yielding};
use crate::simd::lane::{C, MAX_LANES};
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Largest sum of `Segment::excess` over a branch: terms outgrow the value by its exponential, which costs three digits.
pub const MOST_EXCESS: f64 = 7.7;

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

/// A model whose elements may become series.
pub struct Parts<'a, const D: usize> {
    /// The model.
    pub model: &'a Model,
    /// Its segments.
    pub segments: &'a [Segment<D>],
    /// The cones among them.
    pub cones: &'a [Option<Cone<D>>],
}

impl<const D: usize> Parts<'_, D> {
    /// `Segment::excess` of a segment or cone.
    pub fn excess(&self, row: usize, highest: f64) -> f64 {
        self.cones[row]
            .as_ref()
            .map_or_else(|| self.segments[row].excess(highest), |cone| cone.excess(highest))
    }
}

/// Replaces the beginning of each branch of a plan by its series where that applies.
///
/// `needed` holds for nodes, segments and joints whose states are requested.
pub fn shorten<const D: usize>(
    parts: &Parts<D>,
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
            Step::Leaf { .. } if !needed(&plan[at]) => reach(parts, &plan[at..], highest, &needed),
            _ => 1,
        };
        let whole = || Branch::new(parts, &plan[at..at + length], highest);
        match (length > 1).then(whole).flatten() {
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
    parts: &Parts<D>,
    plan: &[Step],
    highest: f64,
    needed: &impl Fn(&Step) -> bool,
) -> usize {
    let (mut excess, model) = (0.0, parts.model);
    for (count, step) in plan.iter().enumerate().skip(1) {
        let serves = match *step {
            Step::Segment { row, .. } => {
                excess += parts.excess(row, highest);
                excess <= MOST_EXCESS
            }
            Step::Joint { row, .. } => model.joints[row].1.is_plain() && model.slip_of(row).is_none(),
            Step::Point { node } => model.has_plain_point(node) && !model.has_terminal(node),
            Step::Leaf { .. } | Step::Overlap { .. } | Step::Join | Step::Branch { .. } => false,
        };
        if !serves || needed(step) {
            return count;
        }
    }
    plan.len()
}

/// Carries series of minors past one step of a sweep towards its root; nothing where it does not converge.
pub fn past<const D: usize>(parts: &Parts<D>, minors: &mut Minors, step: &Step, square: f64) -> Option<()> {
    match *step {
        Step::Segment { row, forward, .. } => {
            *minors = match &parts.cones[row] {
                Some(cone) => cone::through(minors, cone, forward, square)?,
                None => through(minors, &parts.segments[row], forward, square)?,
            };
        }
        Step::Joint { row, .. } => {
            yielding(minors, parts.model.joints[row].1.plain_compliance());
        }
        Step::Point { node } => {
            for impedance in parts.model.plain_impedances(node, square) {
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
        let [y, theta, _] = self.hysteretic();
        [y, theta]
    }

    /// The two compliances of a plain spring.
    pub fn plain_compliance(&self) -> [Complex64; 2] {
        self.plain_stiffness().map(|stiffness| stiffness.inv())
    }
}

impl<const D: usize> Segment<D> {
    /// By how much the logarithm of the sum of a series' moduli grows faster along the segment than that of its value, up
    /// to |w| = `highest`: at the negative square of w both waves grow, at w one, or none above the cut-off.
    pub fn excess(&self, highest: f64) -> f64 {
        let [sum, product, bending] = self.bound(highest * highest);
        let terms = (sum + 2.0 * (bending + product).sqrt()).sqrt();
        let value = 0.5 * ((sum * sum + 4.0 * (bending - product)).max(0.0).sqrt() - sum);
        (terms - value.max(0.0).sqrt()) * self.length
    }
}

impl Model {
    /// Whether the point elements of a node are functions of w^2 that leave translation and rotation apart.
    pub fn has_plain_point(&self, node: usize) -> bool {
        self.grounds.iter().all(|(ground, spring)| *ground != node || spring.is_plain())
    }

    /// Contribution of each mass and plain spring of a node to f per u, `[constant, by (w / reference)^2]`.
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
    fn new(parts: &Parts<D>, plan: &[Step], highest: f64) -> Option<Self> {
        let mut minors: Minors = vec![[Complex64::ZERO; 5]; 1];
        minors[0][YT] = Complex64::ONE;
        let square = highest * highest;
        let mut near = None;
        for step in plan {
            past(parts, &mut minors, step, square)?;
            if let Step::Segment { row, .. } = *step {
                near = Some(parts.segments[row]);
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

    /// Impedances that steer the choice of the chart of the branch's plane, `most` being the largest |w|^2.
    pub fn weights(&self, most: f64) -> [f64; D] {
        self.near.weights(self.near.wave_number_square(most))
    }

    /// The minors (u0 u1, u0 f0, u0 f1, f0 u1, f0 f1) of the branch's plane on a block of lines.
    #[inline(always)]
    pub fn minors<S: Simd>(&self, simd: S, w2: C<S>, real: bool) -> [C<S>; 5] {
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
        [sums[YT], sums[YV], sums[YM], minus_tv, sums[VM]]
    }
}

/// Blocks that are summed side by side: one sum alone waits for each of its products.
const BLOCKS: usize = 2;

/// Different entries of a receptance, by the sum of their directions.
const ENTRIES: usize = 3;

/// Entries of a receptance as quotients of power series in (w / reference)^2.
pub struct Tip {
    /// Coefficients, the highest power first: the requested numerators, then the denominator.
    terms: Terms,
    /// 1 / reference^2.
    scale: f64,
    /// The numerator of each requested pair.
    pairs: Vec<usize>,
}

/// One numerator, or all.
enum Terms {
    One(Vec<[Complex64; 2]>),
    All(Vec<[Complex64; ENTRIES + 1]>),
}

impl Tip {
    /// For pairs of directions of response and excitation, if there are any.
    pub fn new<const D: usize>(
        branch: &Branch<D>,
        directions: impl Iterator<Item = [usize; 2]>,
    ) -> Option<Self> {
        let entries: Vec<usize> = directions.map(|[response, excitation]| response + excitation).collect();
        // A power of two, so that no digit changes, and the square of the denominator stays within range.
        let size = branch.terms().iter().fold(0.0_f64, |most, term| most.max(term[VM].l1_norm()));
        let factor = if size > 0.0 { (-size.log2().floor()).exp2() } else { 1.0 };
        let numerators = |term: &[Complex64; 5]| [term[YM] * factor, -term[YV] * factor, -term[TV] * factor];
        let terms = branch.terms();
        let first = *entries.first()?;
        let (terms, pairs) = if entries.iter().all(|&entry| entry == first) {
            let one = |term: &[Complex64; 5]| [numerators(term)[first], term[VM] * factor];
            (Terms::One(terms.iter().map(one).collect()), vec![0; entries.len()])
        } else {
            let all = |term: &[Complex64; 5]| {
                let [yy, both, rotations] = numerators(term);
                [yy, both, rotations, term[VM] * factor]
            };
            (Terms::All(terms.iter().map(all).collect()), entries)
        };
        Some(Self { terms, scale: branch.scale(), pairs })
    }

    /// The entries at some lines, those of a line together; whether all are finite.
    pub fn fill(&self, arch: &Arch, lines: &Frequencies, range: Range<usize>, h: &mut [Complex64]) -> bool {
        match &self.terms {
            Terms::One(terms) => arch.dispatch(Fill { tip: self, terms, lines, range, h }),
            Terms::All(terms) => arch.dispatch(Fill { tip: self, terms, lines, range, h }),
        }
    }
}

struct Fill<'a, const N: usize> {
    tip: &'a Tip,
    terms: &'a [[Complex64; N]],
    lines: &'a Frequencies<'a>,
    range: Range<usize>,
    h: &'a mut [Complex64],
}

impl<const N: usize> WithSimd for Fill<'_, N> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { tip, terms, lines, range, h } = self;
        let real = lines.given_real();
        // A value that is not finite makes this one not a number.
        let mut zero = C::zero(simd);
        for from in range.clone().step_by(BLOCKS * S::F64_LANES) {
            let mut blocks = [const { 0..0 }; BLOCKS];
            let mut x = [C::zero(simd); BLOCKS];
            for block in 0..BLOCKS {
                let start = (from + block * S::F64_LANES).min(range.end);
                blocks[block] = start..(start + S::F64_LANES).min(range.end);
                // A block without lines repeats the last one, so that nothing is divided by zero.
                let w = if start < range.end { blocks[block].clone() } else { range.end - 1..range.end };
                let w = lines.load(simd, w);
                x[block] = (w * w).scale(tip.scale);
            }
            let sums = if real { sums::<S, N, true>(x, terms) } else { sums::<S, N, false>(x, terms) };
            for (lines, sums) in blocks.into_iter().zip(sums) {
                let inverse = sums[N - 1].recip();
                let mut entries = [[Complex64::ZERO; MAX_LANES]; N];
                for entry in 0..N - 1 {
                    let value = sums[entry] * inverse;
                    zero = value.mul_add_real(simd.splat_f64s(0.0), zero);
                    value.store(&mut entries[entry]);
                }
                let start = lines.start - range.start;
                if let (1, [_]) = (N - 1, &tip.pairs[..]) {
                    h[start..start + lines.len()].copy_from_slice(&entries[0][..lines.len()]);
                    continue;
                }
                let into = h[start * tip.pairs.len()..].chunks_exact_mut(tip.pairs.len());
                for (lane, into) in into.take(lines.len()).enumerate() {
                    for (into, &entry) in into.iter_mut().zip(&tip.pairs) {
                        *into = entries[entry][lane];
                    }
                }
            }
        }
        let sum = simd.add_f64s(zero.re, zero.im);
        simd.reduce_sum_f64s(sum) == 0.0
    }
}

/// The functions at the squares of some blocks.
#[inline(always)]
fn sums<S: Simd, const N: usize, const REAL: bool>(
    x: [C<S>; BLOCKS],
    terms: &[[Complex64; N]],
) -> [[C<S>; N]; BLOCKS] {
    let simd = x[0].simd;
    let mut sums = [[C::zero(simd); N]; BLOCKS];
    for term in terms {
        for k in 0..N {
            let coefficient = C::splat(simd, term[k]);
            for block in 0..BLOCKS {
                let sum = sums[block][k];
                sums[block][k] = if REAL {
                    sum.mul_add_real(x[block].re, coefficient)
                } else {
                    sum.mul_add(x[block], coefficient)
                };
            }
        }
    }
    sums
}
