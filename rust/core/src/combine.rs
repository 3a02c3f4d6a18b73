//! What meets at a node: compliances in series, branches in parallel.

use crate::lane::C;
use crate::plane::{Added, Plane};
use crate::small::{self, Mat};
use crate::sweep::Record;
use pulp::Simd;

/// Adds a diagonal impedance or compliance, one degree of freedom after the other.
#[inline(always)]
pub fn add_diagonal<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    matrix: &Mat<S, D>,
    kind: impl Fn(C<S>) -> Added<S>,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let (mut plane, mut back) = plane.add(0, kind(matrix[0][0]), weights[0]);
    for i in 1..D {
        let (next, step) = plane.add(i, kind(matrix[i][i]), weights[i]);
        plane = next;
        back = small::mul(&back, &step);
    }
    (plane, back)
}

/// The offset e and the compliances at which a full stiffness is diagonal: K = T^T diag T, T = [[1, e], [0, 1]].
#[inline(always)]
pub fn centre<S: Simd, const D: usize>(stiffness: &Mat<S, D>) -> (C<S>, Mat<S, D>) {
    let offset = stiffness[0][D - 1] * stiffness[0][0].recip();
    let mut compliance = small::zeros(offset.simd);
    compliance[0][0] = stiffness[0][0].recip();
    compliance[D - 1][D - 1] = offset.neg_mul_add(stiffness[0][D - 1], stiffness[D - 1][D - 1]).recip();
    (offset, compliance)
}

/// Adds a compliance that is diagonal a distance beyond the node.
///
/// A nearly singular joint (a hinge beyond the node, say) has one huge compliance; added at the node as a
/// full matrix it would drown the digits of the other direction.
#[inline(always)]
pub fn add_beyond<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    offset: C<S>,
    compliance: &Mat<S, D>,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let (there, to_there) = shifted(plane, offset, weights);
    let (added, step) = add_diagonal(&there, compliance, Added::Compliance, weights);
    let (here, to_here) = shifted(&added, -offset, weights);
    (here, small::mul(&small::mul(&to_there, &step), &to_here))
}

/// The plane seen from a rigid offset along x.
#[inline(always)]
fn shifted<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    offset: C<S>,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let (mut u, mut f) = plane.basis();
    for j in 0..D {
        u[0][j] = offset.mul_add(u[D - 1][j], u[0][j]);
        f[D - 1][j] = offset.neg_mul_add(f[0][j], f[D - 1][j]);
    }
    Plane::pivot(&u, &f, weights)
}

/// Two branches on one node: one displacement, loads add.
///
/// In weighted sums s = u - i f a passive branch has u = t s and f = r s with t and r bounded, which holds
/// for no other description; with s that of both together, s = s_1 + s_2 - u and u = t_1 s_1 = t_2 s_2.
#[inline(always)]
pub fn join<S: Simd, const D: usize>(
    first: &Plane<S, D>,
    second: &Plane<S, D>,
    weights: &[f64; D],
) -> Record<S, D> {
    let [one, two] = [Turned::new(first, weights), Turned::new(second, weights)];
    let sum = small::add(&one.u, &two.u);
    let minus_one = small::scale(&one.u, C::real(sum[0][0].simd, -1.0));
    let minus_two = small::scale(&two.u, C::real(sum[0][0].simd, -1.0));
    let s1 = small::mul(&small::inverse(&small::mul_add(&minus_two, &one.u, &sum)), &two.u);
    let s2 = small::mul(&small::inverse(&small::mul_add(&minus_one, &two.u, &sum)), &one.u);
    let mut u = small::mul(&one.u, &s1);
    let mut f = small::mul_add(&one.f, &s1, &small::mul(&two.f, &s2));
    for i in 0..D {
        let root = weights[i].sqrt();
        for j in 0..D {
            u[i][j] = u[i][j].scale(1.0 / root);
            f[i][j] = f[i][j].scale(root);
        }
    }
    let (plane, inverse) = Plane::pivot(&u, &f, weights);
    let back = small::mul(&small::mul(&two.independent, &s2), &inverse);
    let other = small::mul(&small::mul(&one.independent, &s1), &inverse);
    Record { plane, back, other }
}

/// A plane in weighted sums s = u - i f.
struct Turned<S: Simd, const D: usize> {
    u: Mat<S, D>,
    f: Mat<S, D>,
    independent: Mat<S, D>,
}

impl<S: Simd, const D: usize> Turned<S, D> {
    #[inline(always)]
    fn new(plane: &Plane<S, D>, weights: &[f64; D]) -> Self {
        let (mut u, mut f) = plane.basis();
        let mut sum = u;
        for i in 0..D {
            let root = weights[i].sqrt();
            for j in 0..D {
                f[i][j] = f[i][j].scale(1.0 / root);
                u[i][j] = u[i][j].scale(root);
                sum[i][j] = u[i][j] - f[i][j].times_i();
            }
        }
        let independent = small::inverse(&sum);
        Self { u: small::mul(&u, &independent), f: small::mul(&f, &independent), independent }
    }
}
