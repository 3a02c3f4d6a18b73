//! Receptances at the end of one branch, straight from the power series of its minors.
//!
//! With u the displacements and f the loads of the plane, H = u f^-1 is a quotient of minors,
//!     H_yy = p_yM / p_VM,   H_ytheta = -p_yV / p_VM,   H_thetatheta = -p_tV / p_VM,
//! so that where nothing but H is asked for no chart is chosen and only the minors in question are summed.

use crate::branch::Branch;
use crate::frequencies::Frequencies;
use crate::lane::{C, MAX_LANES};
use crate::minors::{TV, VM, YM, YV};
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Blocks that are summed side by side: one sum alone waits for each of its products.
const BLOCKS: usize = 2;

/// Different entries of a receptance, by the sum of their directions.
const ENTRIES: usize = 3;

/// Entries of a receptance as quotients of power series in (w / reference)^2.
pub struct Tip {
    /// Coefficients, the highest power first: numerators as they were asked for, then the denominator.
    terms: Terms,
    /// 1 / reference^2.
    scale: f64,
    /// The numerator of each pair that was asked for.
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
