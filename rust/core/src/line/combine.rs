//! Connections at a node: compliances in series, branches in parallel.

use crate::line::plane::{Added, Plane};
use crate::simd::lane::{C, R};
use crate::simd::small::{self, Mat};
use pulp::Simd;

/// Additions at a node: to the loads per displacement, or to the displacements per load.
#[derive(Copy, Clone, PartialEq, Eq)]
pub enum Kind {
    /// Impedances.
    Impedance,
    /// Compliances.
    Compliance,
}

/// Adds impedances or compliances, one degree of freedom after the other.
#[inline(always)]
pub fn add_diagonal<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    values: &[C<S>; D],
    kind: Kind,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let mut plane = *plane;
    let mut back = small::identity(values[0].simd);
    for i in 0..D {
        let added = match kind {
            Kind::Impedance => Added::Impedance(values[i]),
            Kind::Compliance => Added::Compliance(values[i]),
        };
        let (next, step) = plane.add(i, added, weights[i]);
        plane = next;
        back = if i == 0 { step } else { small::mul(&back, &step) };
    }
    (plane, back)
}

/// A full symmetric stiffness as a diagonal one beyond the node: K = T^T diag T with T = [[1, e], [0, 1]], or with
/// T = [[1, 0], [e, 1]] where the first would lie many wavelengths away.
#[derive(Copy, Clone)]
pub struct Centre<S: Simd, const D: usize> {
    /// The entry e of each row of T; one of the two is zero.
    pub offset: [C<S>; D],
    /// The diagonal stiffness there.
    pub stiffness: [C<S>; D],
    /// Its inverse.
    pub compliance: [C<S>; D],
}

impl<S: Simd, const D: usize> Centre<S, D> {
    /// The centre of a stiffness; without coupling it is at the node.
    ///
    /// Elimination starts with the entry that keeps T bounded in the units of the pivot weights: a rotation 1e20 times
    /// stiffer than the translation would have its centre beyond all digits of the positions around it.
    #[inline(always)]
    pub fn new(stiffness: &Mat<S, D>, couples: bool, weights: &[f64; D]) -> Self {
        let simd = stiffness[0][0].simd;
        let zero = C::zero(simd);
        let mut out = Self { offset: [zero; D], stiffness: [zero; D], compliance: [zero; D] };
        for i in 0..D {
            out.stiffness[i] = stiffness[i][i];
        }
        if D == 2 && couples {
            let (first, last, coupling) = (stiffness[0][0], stiffness[D - 1][D - 1], stiffness[0][D - 1]);
            let (along, across) = (coupling * first.recip(), coupling * last.recip());
            let far = along.norm_sqr().greater(R::splat(simd, weights[D - 1] / weights[0]));
            out.offset = [zero; D];
            out.offset[0] = C::select(far, zero, along);
            out.offset[D - 1] = C::select(far, across, zero);
            out.stiffness[0] = out.offset[D - 1].neg_mul_add(coupling, first);
            out.stiffness[D - 1] = out.offset[0].neg_mul_add(coupling, last);
        }
        for i in 0..D {
            out.compliance[i] = out.stiffness[i].recip();
        }
        out
    }

    /// The basis at the centre of the plane before a joint, and the joint's compliance there: diagonal, so that no entry is
    /// lost beside a larger one.
    #[inline(always)]
    pub fn before(&self, plane: &Plane<S, D>) -> (Mat<S, D>, Mat<S, D>, Mat<S, D>) {
        let (u, f) = shifted_basis(plane, &self.offset);
        let mut compliance = small::zeros(u[0][0].simd);
        for i in 0..D {
            compliance[i][i] = self.compliance[i];
        }
        (u, f, compliance)
    }

    /// The offsets of the way back to the node.
    #[inline(always)]
    fn reversed(&self) -> [C<S>; D] {
        let mut out = self.offset;
        for entry in &mut out {
            *entry = -*entry;
        }
        out
    }
}

/// Adds diagonal entries a distance beyond the node; returns also the way back as `Plane::pivot` does.
///
/// A nearly singular joint (a hinge beyond the node, say) has one huge compliance; added at the node as a
/// full matrix it would drown the digits of the other direction.
#[inline(always)]
pub fn add_beyond<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    centre: &Centre<S, D>,
    kind: Kind,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let (added, to_there) = beyond(plane, centre, kind, weights);
    let (here, to_here) = shifted(&added, &centre.reversed(), weights);
    (here, small::mul(&to_there, &to_here))
}

/// The plane at the centre after the addition, and the way back from it.
#[inline(always)]
fn beyond<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    centre: &Centre<S, D>,
    kind: Kind,
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let (there, to_there) = shifted(plane, &centre.offset, weights);
    let values = if kind == Kind::Impedance { &centre.stiffness } else { &centre.compliance };
    let (added, step) = add_diagonal(&there, values, kind, weights);
    (added, small::mul(&to_there, &step))
}

/// Force and relative motion of a joint whose far side has the plane `before`, from the independent variables
/// after it.
///
/// Both are taken at the centre: a full compliance times the force at the node would be a difference of
/// large numbers where the joint is nearly singular.
#[inline(always)]
pub fn in_joint<S: Simd, const D: usize>(
    before: &Plane<S, D>,
    centre: &Centre<S, D>,
    couples: bool,
    after: &Plane<S, D>,
    independent: &[C<S>; D],
    weights: &[f64; D],
) -> JointState<S, D> {
    let mut force = after.state(independent).1;
    let mut gap = force;
    if D == 1 || !couples {
        for i in 0..D {
            gap[i] = centre.compliance[i] * force[i];
        }
        return JointState { force, gap };
    }
    let (added, _) = beyond(before, centre, Kind::Compliance, weights);
    let (_, to_here) = shifted(&added, &centre.reversed(), weights);
    let there = added.state(&small::apply(&to_here, independent)).1;
    let mut own = there;
    for i in 0..D {
        own[i] = centre.compliance[i] * there[i];
    }
    for i in 0..D {
        let other = D - 1 - i;
        gap[i] = centre.offset[i].neg_mul_add(own[other], own[i]);
        force[i] = centre.offset[other].mul_add(there[other], there[i]);
    }
    JointState { force, gap }
}

/// Force from the first on the second node of a joint, and motion of the first relative to the second.
#[derive(Copy, Clone)]
pub struct JointState<S: Simd, const D: usize> {
    /// The force and the moment.
    pub force: [C<S>; D],
    /// The relative displacement and rotation.
    pub gap: [C<S>; D],
}

/// The plane in the coordinates of a centre.
#[inline(always)]
fn shifted<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    offset: &[C<S>; D],
    weights: &[f64; D],
) -> (Plane<S, D>, Mat<S, D>) {
    let (u, f) = shifted_basis(plane, offset);
    Plane::pivot(&u, &f, weights)
}

/// The basis of a plane in the coordinates of a centre: T u and T^-T f.
#[inline(always)]
fn shifted_basis<S: Simd, const D: usize>(plane: &Plane<S, D>, offset: &[C<S>; D]) -> (Mat<S, D>, Mat<S, D>) {
    let (before_u, before_f) = plane.basis();
    let (mut u, mut f) = (before_u, before_f);
    for i in 0..D {
        let other = D - 1 - i;
        for j in 0..D {
            u[i][j] = offset[i].mul_add(before_u[other][j], before_u[i][j]);
            f[i][j] = offset[other].neg_mul_add(before_f[other][j], before_f[i][j]);
        }
    }
    (u, f)
}

/// Two branches on one node: one displacement, loads add.
///
/// In weighted sums s = u - i f a passive branch has u = t s and f = r s with t and r bounded, which holds
/// for no other description; with s that of both together, s = s_1 + s_2 - u and u = t_1 s_1 = t_2 s_2.
/// Returns also the ways back to the independent variables of the first and of the second plane.
#[inline(always)]
pub fn join<S: Simd, const D: usize>(
    first: &Plane<S, D>,
    second: &Plane<S, D>,
    weights: &[f64; D],
) -> (Plane<S, D>, [Mat<S, D>; 2]) {
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
    (plane, [other, back])
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
