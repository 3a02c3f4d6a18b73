//! Derivatives of the receptance by one parameter each, from the fields of two unit loads.
//!
//! With s and r the states of the structure under the loads at the excited and at the measured
//! coordinate, reciprocity gives for any change dA of the equations s' = A s
//!     dH = -int r^T J dA s dx = int (dm w^2 r_y s_y + ... + dalpha r_V s_V + ...) dx,
//! J the symplectic form. For a short piece the integral is -r(b)^T J dT s(a) with T = exp(A L) from the
//! series; for waves it is taken in closed form. The density of the length is constant along a segment.

use crate::line::block::{Block, Prepared};
use crate::line::exponential::{self, SumsWithDerivatives};
use crate::line::kernel::{Wave, Way, parity, polynomial};
use crate::line::layer::{DERIVATIVES, LAYER, LENGTH, SLOPE};
use crate::line::sweep::{Field, State};
use crate::model::assembly::{Model, Table};
use crate::model::cone::{Blocks, ConeChange, Division, common_factors, is_conical};
use crate::model::overlap::{Overlap, column as overlap_column};
use crate::model::request::Parameter;
use crate::model::section;
use crate::model::section::{Motion, Segment};
use crate::model::spring::{SPRING, Spring, Term};
use crate::model::terminals::{Mode, TERMINAL_ENTRIES};
use crate::simd::lane::{C, R};
use crate::simd::small::{self, Mat};
use num_complex::Complex64;
use pulp::Simd;

/// A derivative made ready for the kernels.
pub(crate) enum Gradient<const D: usize> {
    /// A column of a segment that changes its coefficients.
    Section { row: usize, kinetic: [f64; D], compliance: [Complex64; D] },
    /// The length of a segment.
    Length { row: usize },
    /// A column of a cone.
    Cone { row: usize, change: Box<ConeChange<D>> },
    /// A column of a joint's spring, and the share of it that slip removes.
    Joint { row: usize, column: usize, spring: Spring, lost: Complex64 },
    /// A column of a joint's slip, as the change of its stiffness.
    Slip { row: usize, change: [Complex64; 2] },
    /// A column of a point mass.
    Mass { node: usize, direction: usize },
    /// A column of a spring to ground.
    Ground { node: usize, column: usize, spring: Spring },
    /// A column of an overlap, as factors of the terms of its work, and of these times i w.
    Overlap { row: usize, factors: [Complex64; DERIVATIVES], rates: [f64; 2] },
    /// An entry of the receptance beyond a terminal.
    Terminal { row: usize, entry: usize },
    /// A number of a mode of a terminal.
    Mode { row: usize, column: usize, mode: Mode },
}

/// The factors of a column of an overlap.
fn overlap_factors(overlap: &Overlap, column: usize) -> ([Complex64; DERIVATIVES], [f64; 2]) {
    use crate::model::section::column::OUTER_DIAMETER;
    let mut factors = [Complex64::ZERO; DERIVATIVES];
    let mut rates = [0.0; 2];
    let beam = usize::from(column >= overlap_column::OUTER);
    let loss = Complex64::new(1.0, overlap.loss_factor);
    match column {
        overlap_column::LENGTH => factors[LENGTH] = Complex64::ONE,
        overlap_column::INNER..overlap_column::K => {
            let start = [overlap_column::INNER, overlap_column::OUTER][beam];
            let own = Some(column - start + OUTER_DIAMETER);
            let (_, change) = section::derivatives::<2>(&overlap.beams[beam], Motion::Bending, own);
            for i in 0..2 {
                factors[2 * beam + i] = change.kinetic[i].into();
                factors[4 + 2 * beam + i] = change.compliance[i];
            }
        }
        overlap_column::K..overlap_column::C => factors[LAYER + column - overlap_column::K] = loss,
        overlap_column::C..overlap_column::LOSS_FACTOR => rates[column - overlap_column::C] = 1.0,
        overlap_column::LOSS_FACTOR => {
            for i in 0..2 {
                factors[LAYER + i] = Complex64::I * overlap.k[i];
            }
        }
        _ => factors[SLOPE] = Complex64::ONE,
    }
    (factors, rates)
}

impl<const D: usize> Gradient<D> {
    /// Prepares a parameter of a checked model.
    pub(crate) fn new(model: &Model, parameter: &Parameter) -> Self {
        let Parameter { table, row, column } = *parameter;
        match table {
            Table::Segments if is_conical(&model.segments[row]) => {
                match common_factors(&model.segments[row], column) {
                    Some((inertia, compliance)) => Self::Section {
                        row,
                        kinetic: first(inertia, 0.0),
                        compliance: first(compliance, Complex64::ZERO),
                    },
                    None => Self::Cone { row, change: Box::new(ConeChange::new(column)) },
                }
            }
            Table::Segments if column == section::column::LENGTH => Self::Length { row },
            Table::Segments => {
                let (_, change) = section::derivatives::<D>(&model.segments[row], model.motion, Some(column));
                Self::Section { row, kinetic: change.kinetic, compliance: change.compliance }
            }
            Table::Joints => {
                let (column, spring) = (column - 2, model.joints[row].1);
                let lost = model.slip_of(row).map_or([Complex64::ZERO; 2], |slip| slip.lost([slip.level; 2]));
                let lost = lost.get(column).copied().unwrap_or_default();
                Self::Joint { row, column, spring, lost }
            }
            Table::Slips => {
                let slip = &model.slips[row];
                let k = model.joints[slip.joint].1.k;
                Self::Slip { row: slip.joint, change: slip.by_column(k, [slip.level; 2], column) }
            }
            Table::Masses => Self::Mass { node: model.masses[row].0, direction: column - 1 },
            Table::Grounds => {
                let (node, spring) = model.grounds[row];
                Self::Ground { node, column: column - 1, spring }
            }
            Table::Overlaps => {
                let (factors, rates) = overlap_factors(&model.overlaps[row], column);
                Self::Overlap { row, factors, rates }
            }
            Table::Terminals => Self::Terminal { row, entry: column - 1 },
            Table::Modes => {
                let (row, mode) = model.modes[row];
                Self::Mode { row, column: column - 1, mode }
            }
        }
    }

    /// The segment that the parameter belongs to.
    pub(crate) fn segment(&self) -> Option<usize> {
        match self {
            Self::Section { row, .. } | Self::Length { row } | Self::Cone { row, .. } => Some(*row),
            _ => None,
        }
    }

    /// The segment whose coefficients or length the parameter changes alike everywhere.
    pub(crate) fn uniform(&self) -> Option<usize> {
        if let Self::Cone { .. } = self { None } else { self.segment() }
    }

    /// The overlap that the parameter belongs to, and which of its derivatives the parameter needs.
    pub(crate) fn overlap(&self) -> Option<(usize, [bool; DERIVATIVES])> {
        let Self::Overlap { row, factors, rates } = self else { return None };
        let mut requested = factors.map(|factor| factor != Complex64::ZERO);
        for i in 0..2 {
            requested[LAYER + i] |= rates[i] != 0.0;
        }
        Some((*row, requested))
    }

    /// The joint that the parameter belongs to.
    pub(crate) fn joint(&self) -> Option<usize> {
        match self {
            Self::Joint { row, .. } | Self::Slip { row, .. } => Some(*row),
            _ => None,
        }
    }

    /// The node that the parameter's point element sits on.
    pub(crate) fn node(&self) -> Option<usize> {
        match self {
            Self::Mass { node, .. } | Self::Ground { node, .. } => Some(*node),
            _ => None,
        }
    }

    /// dH from the fields of the loads at the measured (`left`) and the excited coordinate (`right`).
    #[inline(always)]
    pub(crate) fn evaluate<S: Simd>(
        &self,
        prepared: &Prepared<D>,
        block: &Block<S, D>,
        left: &Field<S, D>,
        right: &Field<S, D>,
        sensitivities: &Sensitivities<S, D>,
    ) -> C<S> {
        let zero = C::zero(block.iw.simd);
        match self {
            Self::Section { row, kinetic, compliance } => {
                by_column(&sensitivities.segments[*row], kinetic, compliance)
            }
            Self::Length { row } => sensitivities.segments[*row].length,
            Self::Cone { row, change } => {
                let (Some(cone), Way::Slices { level }) = (&prepared.cones[*row], block.kernels[*row].way)
                else {
                    return zero;
                };
                let (left, right) = (&left.states[*row], &right.states[*row]);
                cone_change(cone.division(level), change.of(cone, level), block, left, right)
            }
            Self::Joint { row, column, spring, lost } => {
                let (left, right) = (&left.joints[*row].gap, &right.joints[*row].gap);
                let whole = spring_derivative(spring, *column, block.iw, left, right);
                if *lost == Complex64::ZERO {
                    return whole;
                }
                C::splat(zero.simd, *lost).neg_mul_add(spring_term(*column, left, right), whole)
            }
            Self::Slip { row, change } => {
                let (left, right) = (&left.joints[*row].gap, &right.joints[*row].gap);
                let mut sum = zero;
                for i in 0..D {
                    sum = C::splat(zero.simd, change[i]).mul_add(spring_term(i, left, right), sum);
                }
                sum
            }
            Self::Overlap { row, factors, rates } => {
                let found = &sensitivities.overlaps[*row];
                let mut sum = zero;
                for (value, factor) in found.iter().zip(factors) {
                    sum = C::splat(zero.simd, *factor).mul_add(*value, sum);
                }
                for i in 0..2 {
                    sum = found[LAYER + i].scale(rates[i]).mul_add(block.iw, sum);
                }
                sum
            }
            Self::Mass { node, direction } => {
                if *direction >= D {
                    return zero;
                }
                block.w2 * (left.nodes[*node][*direction] * right.nodes[*node][*direction])
            }
            Self::Ground { node, column, spring } => {
                spring_derivative(spring, *column, block.iw, &left.nodes[*node], &right.nodes[*node])
            }
            Self::Terminal { row, entry } => {
                -spring_term(*entry, &left.terminals[*row], &right.terminals[*row])
            }
            Self::Mode { row, column, mode } => {
                let slopes = mode.slopes(*column, block.iw, block.w2);
                let mut sum = zero;
                for entry in 0..TERMINAL_ENTRIES {
                    let change = spring_term(entry, &left.terminals[*row], &right.terminals[*row]);
                    sum = slopes[entry].neg_mul_add(change, sum);
                }
                sum
            }
        }
    }
}

/// -d_left^T (dK/dk) d_right for one of the three entries of a spring's matrix.
#[inline(always)]
fn spring_term<S: Simd, const D: usize>(entry: usize, left: &[C<S>; D], right: &[C<S>; D]) -> C<S> {
    match (entry, D) {
        (0, _) => -(left[0] * right[0]),
        (_, 1) => C::zero(left[0].simd),
        (1, _) => -(left[D - 1] * right[D - 1]),
        _ => -left[0].mul_add(right[D - 1], left[D - 1] * right[0]),
    }
}

/// -d_left^T (dK/dp) d_right for a column of a spring.
#[inline(always)]
pub(crate) fn spring_derivative<S: Simd, const D: usize>(
    spring: &Spring,
    column: usize,
    iw: C<S>,
    left: &[C<S>; D],
    right: &[C<S>; D],
) -> C<S> {
    let simd = iw.simd;
    match &SPRING[column].1 {
        Term::Stiffness(entry) => {
            C::splat(simd, Complex64::new(1.0, spring.loss[*entry])) * spring_term(*entry, left, right)
        }
        Term::Dashpot(entry) => iw * spring_term(*entry, left, right),
        Term::Loss(shares) => {
            let mut sum = C::zero(simd);
            for entry in 0..3 {
                sum = sum + spring_term(entry, left, right).scale(shares[entry] * spring.k[entry]);
            }
            sum.times_i()
        }
    }
}

/// Derivatives of H by the coefficients of a segment.
pub struct Sensitivity<S: Simd, const D: usize> {
    /// By the inertia per length of each displacement.
    pub kinetic: [C<S>; D],
    /// By the compliance per length of each internal force.
    pub compliance: [C<S>; D],
    /// By the length.
    pub length: C<S>,
}

/// Derivatives of H by the coefficients of all segments and overlaps, zero where they are not requested.
pub struct Sensitivities<S: Simd, const D: usize> {
    /// Those of the segments.
    pub segments: Vec<Sensitivity<S, D>>,
    /// Those of the overlaps.
    pub overlaps: Vec<[C<S>; DERIVATIVES]>,
}

impl<S: Simd, const D: usize> Sensitivities<S, D> {
    /// Zeros for each segment and overlap of a model.
    pub fn zeros(simd: S, prepared: &Prepared<D>) -> Self {
        let zero = C::zero(simd);
        let none = || Sensitivity { kinetic: [zero; D], compliance: [zero; D], length: zero };
        Self {
            segments: prepared.segments.iter().map(|_| none()).collect(),
            overlaps: vec![[zero; DERIVATIVES]; prepared.overlaps.len()],
        }
    }
}

/// Derivatives by the coefficients of one segment from the states of the two loads.
#[inline(always)]
pub fn segment<S: Simd, const D: usize>(
    prepared: &Prepared<D>,
    row: usize,
    block: &Block<S, D>,
    left: &[State<S, D>],
    right: &[State<S, D>],
) -> Sensitivity<S, D> {
    let (segment, kernel, w2) = (&prepared.segments[row], &block.kernels[row], block.w2);
    let zero = C::zero(w2.simd);
    let mut out = Sensitivity { kinetic: [zero; D], compliance: [zero; D], length: zero };
    match kernel.way {
        Way::Waves => waves(segment, &kernel.wave, left, right, &mut out),
        Way::Pieces { count, terms } => {
            let l = segment.length / count as f64;
            if D == 1 {
                for piece in 0..count {
                    rod_piece(segment, l, terms, w2, &left[piece + 1], &right[piece], &mut out);
                }
            } else if let (Some(left), Some(right)) = (left.get(1..=count), right.get(..count)) {
                bending(segment, l, w2, &kernel.sums, left, right, &mut out);
            }
        }
        Way::Slices { level } => {
            let Some(of) = &prepared.cones[row] else { return out };
            return cone(of.division(level), &kernel.slices, block, left, right);
        }
        Way::Skipped => return out,
    }
    for i in 0..D {
        out.kinetic[i] = out.kinetic[i] * w2;
    }
    if let (Some(left), Some(right)) = (ends(left), ends(right)) {
        // The density is the same at both ends; where both fields have decayed it is no small difference.
        let near = length_density(segment, w2, &left[0], &right[0]);
        let far = length_density(segment, w2, &left[1], &right[1]);
        out.length = C::select(near.1.greater(far.1), far.0, near.0);
    }
    out
}

/// -r^T J dT s, summed over the slices of a cone with the changes of their matrices as power series.
#[inline(always)]
fn cone_change<S: Simd, const D: usize>(
    division: &Division<D>,
    changes: &[Vec<Blocks<D>>],
    block: &Block<S, D>,
    left: &[State<S, D>],
    right: &[State<S, D>],
) -> C<S> {
    let (terms, z) = (division.terms(block.most), block.w2.scale(1.0 / division.square));
    let mut sum = C::zero(z.simd);
    for (slice, change) in changes.iter().enumerate() {
        let (Some(r), Some(s)) = (left.get(slice + 1), right.get(slice)) else { continue };
        let change = polynomial(&change[..terms], z, block.real);
        sum = sum - worked(&change, r, s);
    }
    sum
}

/// Derivatives by common factors of all inertias and of all compliances of a cone, which stand for the first of each.
///
/// T_n is a sum of products of n inertias, and with forces by displacements n - 1, displacements by forces n + 1, otherwise
/// n compliances.
#[inline(always)]
fn cone<S: Simd, const D: usize>(
    division: &Division<D>,
    slices: &[[Mat<S, D>; 4]],
    block: &Block<S, D>,
    left: &[State<S, D>],
    right: &[State<S, D>],
) -> Sensitivity<S, D> {
    let (terms, z) = (division.terms(block.most), block.w2.scale(1.0 / division.square));
    let zero = C::zero(z.simd);
    let (mut inertia, mut compliance) = (zero, zero);
    for (index, (slice, scaled)) in slices.iter().zip(division.scaled()).enumerate() {
        let (Some(r), Some(s)) = (left.get(index + 1), right.get(index)) else { continue };
        let mut change = polynomial(&scaled.inertia[..terms], z, block.real);
        inertia = inertia - worked(&change, r, s);
        change[1] = small::add(&change[1], &slice[1]);
        [change[2]] = polynomial(&scaled.stiffness[..terms], z, block.real);
        compliance = compliance - worked(&change, r, s);
    }
    Sensitivity { kinetic: first(inertia, zero), compliance: first(compliance, zero), length: zero }
}

/// The value in the first place, others in the next.
#[inline(always)]
pub fn first<T: Copy, const D: usize>(value: T, others: T) -> [T; D] {
    core::array::from_fn(|place| if place == 0 { value } else { others })
}

/// r^T J dT s.
#[inline(always)]
fn worked<S: Simd, const D: usize>(
    [uu, un, nu, nn]: &[Mat<S, D>; 4],
    r: &State<S, D>,
    s: &State<S, D>,
) -> C<S> {
    let mut sum = C::zero(r.u[0].simd);
    for i in 0..D {
        let (mut du, mut dn) = (C::zero(sum.simd), C::zero(sum.simd));
        for j in 0..D {
            du = un[i][j].mul_add(s.n[j], uu[i][j].mul_add(s.u[j], du));
            dn = nn[i][j].mul_add(s.n[j], nu[i][j].mul_add(s.u[j], dn));
        }
        sum = r.n[i].neg_mul_add(du, r.u[i].mul_add(dn, sum));
    }
    sum
}

/// -r^T J A s, the derivative by the length, and the square of its largest term.
#[inline(always)]
fn length_density<S: Simd, const D: usize>(
    segment: &Segment<D>,
    w2: C<S>,
    left: &State<S, D>,
    right: &State<S, D>,
) -> (C<S>, R<S>) {
    let simd = w2.simd;
    let mut sum = C::zero(simd);
    let mut size = R::splat(simd, 0.0);
    for i in 0..D {
        let moved = w2.scale(segment.per_length.kinetic[i]) * (left.u[i] * right.u[i]);
        let compliance = C::splat(simd, segment.per_length.compliance[i]);
        let strained = compliance * (left.n[i] * right.n[i]);
        sum = sum + moved + strained;
        size = size.max(moved.norm_sqr()).max(strained.norm_sqr());
    }
    if D == 2 {
        let turned = [left.u[1] * right.n[0], left.n[0] * right.u[1]];
        sum = sum + turned[0] + turned[1];
        size = size.max(turned[0].norm_sqr()).max(turned[1].norm_sqr());
    }
    (sum, size)
}

/// One piece of a rod: T = [[C, a l S], [-mu l S, C]] with C, S functions of z = -a mu l^2.
#[inline(always)]
fn rod_piece<S: Simd, const D: usize>(
    segment: &Segment<D>,
    l: f64,
    terms: usize,
    w2: C<S>,
    left: &State<S, D>,
    right: &State<S, D>,
    out: &mut Sensitivity<S, D>,
) {
    let simd = w2.simd;
    let [z, _] = segment.symmetric_sums(simd, l, w2);
    let [c, s] = exponential::rod(z, terms);
    let a = C::splat(simd, segment.per_length.compliance[0]);
    let mu = w2.scale(segment.per_length.kinetic[0]);
    let z_a = mu.scale(-l * l);
    let cross = s[1] * z_a;
    let by_a = paired(
        [c[1] * z_a, a.mul_add(cross, s[0]).scale(l), -(mu * cross).scale(l), c[1] * z_a],
        left,
        right,
    );
    let z_mu = a.scale(-l * l);
    let cross = s[1] * z_mu;
    let by_mu = paired(
        [c[1] * z_mu, (a * cross).scale(l), -mu.mul_add(cross, s[0]).scale(l), c[1] * z_mu],
        left,
        right,
    );
    out.compliance[0] = out.compliance[0] - by_a;
    out.kinetic[0] = out.kinetic[0] - by_mu;
}

/// r^T J dT s with dT = [[uu, un], [nu, nn]] and J = [[0, 1], [-1, 0]] over (u, n).
#[inline(always)]
fn paired<S: Simd, const D: usize>(
    [uu, un, nu, nn]: [C<S>; 4],
    left: &State<S, D>,
    right: &State<S, D>,
) -> C<S> {
    let du = uu.mul_add(right.u[0], un * right.n[0]);
    let dn = nu.mul_add(right.u[0], nn * right.n[0]);
    left.u[0].mul_add(dn, -(left.n[0] * du))
}

/// A vector (y, theta, V, M).
type Four<S> = [C<S>; 4];

/// A v for s' = A s.
#[inline(always)]
fn along<S: Simd>(v: &Four<S>, coefficients: &[C<S>; 4]) -> Four<S> {
    let [alpha, beta, mu, nu] = *coefficients;
    [alpha.mul_add(v[2], v[1]), beta * v[3], -(mu * v[0]), -nu.mul_add(v[1], v[2])]
}

/// x^T J y.
#[inline(always)]
fn symplectic<S: Simd>(x: &Four<S>, y: &Four<S>) -> C<S> {
    let sum = x[1].mul_add(y[3], x[0] * y[2]);
    x[3].neg_mul_add(y[1], x[2].neg_mul_add(y[0], sum))
}

/// Equal pieces of a beam in bending. What the states of the pieces contribute is linear in products of these, so that
/// the products are added and the coefficients, which are the same for all pieces, applied to the sums.
#[inline(always)]
fn bending<S: Simd, const D: usize>(
    segment: &Segment<D>,
    l: f64,
    w2: C<S>,
    sums: &SumsWithDerivatives<S>,
    left: &[State<S, D>],
    right: &[State<S, D>],
    out: &mut Sensitivity<S, D>,
) {
    let simd = w2.simd;
    let alpha = C::splat(simd, segment.per_length.compliance[0]);
    let beta = C::splat(simd, segment.per_length.compliance[D - 1]);
    let mu = w2.scale(segment.per_length.kinetic[0]);
    let nu = w2.scale(segment.per_length.kinetic[D - 1]);
    let coefficients = [alpha, beta, mu, nu];
    // r^T J A^i s, and for each entry of the state the products of first to third order in the length.
    let zero = C::zero(simd);
    let mut powers = [zero; 4];
    let mut products = [[zero; 4]; 3];
    for (left, right) in left.iter().zip(right) {
        let s0 = [right.u[0], right.u[D - 1], right.n[0], right.n[D - 1]];
        let s1 = along(&s0, &coefficients);
        let s2 = along(&s1, &coefficients);
        let r0 = [left.u[0], left.u[D - 1], left.n[0], left.n[D - 1]];
        let r1 = along(&r0, &coefficients);
        let r2 = along(&r1, &coefficients);
        // The powers are shared between both sides: J A is symmetric.
        powers[0] = powers[0] + symplectic(&r0, &s0);
        powers[1] = powers[1] + symplectic(&r0, &s1);
        powers[2] = powers[2] + symplectic(&r0, &s2);
        powers[3] = powers[3] - symplectic(&r1, &s2);
        for i in 0..4 {
            products[0][i] = r0[i].mul_add(s0[i], products[0][i]);
            products[1][i] = r1[i].neg_mul_add(s0[i], r0[i].mul_add(s1[i], products[1][i]));
            let sum = r1[i].neg_mul_add(s1[i], r0[i].mul_add(s2[i], products[2][i]));
            products[2][i] = r2[i].mul_add(s0[i], sum);
        }
    }
    let [_, z2] = segment.symmetric_sums(simd, l, w2);
    let ([e2, e3, e4, e5], [d2, d3, d4, d5, d6, d7]) = *sums;
    // Derivatives of c_0 .. c_3 by s = z1/l^2 and p = z2/l^4, those of the sums by z2 being -d_(k+2).
    let (l2, l4) = (l * l, l.powi(4));
    let by_s = [-(z2 * d4).scale(l2), -(z2 * d5).scale(l * l2), d2.scale(l4), d3.scale(l * l4)];
    let by_p = [
        z2.mul_add(d6, -e4).scale(l4),
        z2.mul_add(d7, -e5).scale(l * l4),
        -d4.scale(l2 * l4),
        -d5.scale(l * l2 * l4),
    ];
    let (mut through_s, mut through_p) = (zero, zero);
    for i in 0..4 {
        through_s = by_s[i].mul_add(powers[i], through_s);
        through_p = by_p[i].mul_add(powers[i], through_p);
    }
    let one = C::real(simd, 1.0);
    let c1 = z2.neg_mul_add(e5, one).scale(l);
    let (c2, c3) = (e2.scale(l2), e3.scale(l * l2));
    let (a, b) = (alpha * mu, beta * nu);
    // s = -(alpha mu + beta nu), p = beta mu (alpha nu - 1).
    let shear = alpha.mul_add(nu, -one);
    let s_by = [-mu, -nu, -alpha, -beta];
    let p_by = [b * mu, mu * shear, beta * shear, a * beta];
    // Order of the state's entries that each coefficient multiplies: alpha V, beta M, mu y, nu theta.
    let entry = [2, 3, 0, 1];
    for k in 0..4 {
        let i = entry[k];
        let direct = c3.mul_add(products[2][i], c2.mul_add(products[1][i], c1 * products[0][i]));
        let change = direct - s_by[k].mul_add(through_s, p_by[k] * through_p);
        if k < 2 {
            out.compliance[k.min(D - 1)] = out.compliance[k.min(D - 1)] + change;
        } else {
            out.kinetic[(k - 2).min(D - 1)] = out.kinetic[(k - 2).min(D - 1)] + change;
        }
    }
}

/// A segment crossed by waves: products of exponentials integrate in closed form.
#[inline(always)]
fn waves<S: Simd, const D: usize>(
    segment: &Segment<D>,
    wave: &Wave<S, D>,
    left: &[State<S, D>],
    right: &[State<S, D>],
    out: &mut Sensitivity<S, D>,
) {
    let (Some(left), Some(right)) = (ends(left), ends(right)) else {
        return;
    };
    let simd = wave.lambda[0].simd;
    let left = amplitudes(wave, &left);
    let right = amplitudes(wave, &right);
    let one = C::real(simd, 1.0);
    for j in 0..D {
        for k in 0..D {
            let decays = wave.decay[j].neg_mul_add(wave.decay[k], one);
            let same = decays * (wave.lambda[j] + wave.lambda[k]).recip();
            let opposite = if j == k {
                wave.decay[j].scale(segment.length)
            } else {
                (wave.decay[k] - wave.decay[j]) * (wave.lambda[j] - wave.lambda[k]).recip()
            };
            let along = left[1][j].mul_add(right[1][k], left[0][j] * right[0][k]) * same;
            let across = left[1][j].mul_add(right[0][k], left[0][j] * right[1][k]) * opposite;
            for i in 0..D {
                let shape = wave.u[i][j] * wave.u[i][k];
                out.kinetic[i] = shape.mul_add(along + across.scale(parity(i)), out.kinetic[i]);
                let shape = wave.f[i][j] * wave.f[i][k];
                out.compliance[i] = shape.mul_add(along - across.scale(parity(i)), out.compliance[i]);
            }
        }
    }
}

/// States at both ends.
#[inline(always)]
fn ends<S: Simd, const D: usize>(states: &[State<S, D>]) -> Option<[State<S, D>; 2]> {
    Some([*states.first()?, *states.last()?])
}

/// Amplitudes of the waves from the left end (at that end) and from the right end (at that one).
#[inline(always)]
fn amplitudes<S: Simd, const D: usize>(wave: &Wave<S, D>, ends: &[State<S, D>; 2]) -> [[C<S>; D]; 2] {
    let zero = C::zero(wave.lambda[0].simd);
    let mut out = [[zero; D]; 2];
    for j in 0..D {
        // phi_back^T J phi_away, the only pairing of waves that does not vanish.
        let mut norm = zero;
        let (mut from_left, mut from_right) = (zero, zero);
        for i in 0..D {
            // Internal force of the wave that runs along x, and of its mirror image.
            let n = -wave.f[i][j];
            let (mirror_u, mirror_n) = (wave.u[i][j].scale(parity(i)), n.scale(-parity(i)));
            norm = norm + mirror_u * n - mirror_n * wave.u[i][j];
            from_left = from_left + mirror_u * ends[0].n[i] - mirror_n * ends[0].u[i];
            from_right = from_right + wave.u[i][j] * ends[1].n[i] - n * ends[1].u[i];
        }
        let inverse = norm.recip();
        out[0][j] = from_left * inverse;
        out[1][j] = -(from_right * inverse);
    }
    out
}

/// Chain rule: the derivative by a column from the change of the coefficients that it causes.
#[inline(always)]
pub fn by_column<S: Simd, const D: usize>(
    sensitivity: &Sensitivity<S, D>,
    kinetic: &[f64; D],
    compliance: &[Complex64; D],
) -> C<S> {
    let simd = sensitivity.length.simd;
    let mut sum = C::zero(simd);
    for i in 0..D {
        sum = sum + sensitivity.kinetic[i].scale(kinetic[i]);
        sum = C::splat(simd, compliance[i]).mul_add(sensitivity.compliance[i], sum);
    }
    sum
}
