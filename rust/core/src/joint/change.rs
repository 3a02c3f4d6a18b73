//! A reduced receptance with another joint, line by line.

use crate::model::frequencies::Frequencies;
use crate::model::spring::Spring;
use crate::simd::lane::{C, MAX_LANES};
use crate::simd::small::{self, Mat};
use core::ops::Range;
use num_complex::Complex64;
use pulp::Simd;

/// Real planes of a reduction: H_0, F_r (2), F_e (2), Y (3), real and imaginary parts each.
pub const REDUCTION_PLANES: usize = 16;

/// A block of lines with one joint.
pub struct Update<S: Simd> {
    /// 1/H.
    pub inverse: C<S>,
    /// The joint's relative motions under the load at the response, over H.
    pub left: [C<S>; 2],
    /// Those under the load at the excitation.
    pub right: [C<S>; 2],
    /// i w.
    pub iw: C<S>,
}

/// A reduced receptance with one joint.
pub trait Change: Sync {
    /// A block of the lines `w`; lanes without a line have finite values.
    fn update<S: Simd>(&self, simd: S, w: &Frequencies, lines: Range<usize>) -> Update<S>;
}

/// The planes of a reduction with another joint, see `reduction`.
pub struct Planes<'a> {
    /// The planes, one after the other.
    pub values: &'a [f64],
    /// The joint at which the model was reduced.
    pub reference: Spring,
    /// The joint that takes its place.
    pub joint: Spring,
}

impl Planes<'_> {
    /// The complex numbers of a pair of planes.
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, pair: usize, lines: Range<usize>) -> C<S> {
        let n = self.values.len() / REDUCTION_PLANES;
        let (re, im) = (2 * pair * n, (2 * pair + 1) * n);
        let re = &self.values[re + lines.start..re + lines.end];
        let im = &self.values[im + lines.start..im + lines.end];
        C { simd, re: simd.partial_load_f64s(re), im: simd.partial_load_f64s(im) }
    }
}

impl Change for Planes<'_> {
    #[inline(always)]
    fn update<S: Simd>(&self, simd: S, w: &Frequencies, lines: Range<usize>) -> Update<S> {
        let mut values = [C::zero(simd); REDUCTION_PLANES / 2];
        for (pair, value) in values.iter_mut().enumerate() {
            *value = self.load(simd, pair, lines.clone());
        }
        let iw = w.load(simd, lines.clone()).times_i();
        let compliance: Mat<S, 2> = small::inverse(&self.joint.stiffness(simd, iw));
        let before: Mat<S, 2> = small::inverse(&self.reference.stiffness(simd, iw));
        let mut more = compliance;
        for i in 0..2 {
            for j in 0..2 {
                more[i][j] = compliance[i][j] - before[i][j];
            }
        }
        let (left, right) = ([values[1], values[2]], [values[3], values[4]]);
        let y = [[values[5], values[6]], [values[6], values[7]]];
        let one = small::identity::<S, 2>(simd);
        let share = small::inverse(&small::mul_add(&y, &more, &one));
        let (force_left, force_right) = (small::apply(&share, &left), small::apply(&share, &right));
        let gap = small::apply(&more, &force_right);
        let h = left[1].mul_add(gap[1], left[0].mul_add(gap[0], values[0]));
        // Lanes without a line would divide by zero.
        let count = lines.end - lines.start;
        let h = if count < S::F64_LANES { fill(h, count) } else { h };
        let inverse = h.recip();
        let motion = small::apply(&compliance, &force_left);
        Update {
            inverse,
            left: [motion[0] * inverse, motion[1] * inverse],
            right: small::apply(&compliance, &force_right),
            iw,
        }
    }
}

/// Ones in the lanes from `count` on.
#[inline(always)]
fn fill<S: Simd>(value: C<S>, count: usize) -> C<S> {
    let mut lanes = [Complex64::ONE; MAX_LANES];
    value.store(&mut lanes);
    for lane in lanes.iter_mut().take(S::F64_LANES).skip(count) {
        *lane = Complex64::ONE;
    }
    C::load(value.simd, &lanes[..S::F64_LANES])
}
