//! Derivatives of the receptance by one parameter each, from the fields of two unit loads.

use crate::block::Block;
use crate::lane::C;
use crate::layer_energy::{DERIVATIVES, LAYER, LENGTH};
use crate::model::{Model, Motion, Spring, Table};
use crate::overlap::{Overlap, column as overlap_column};
use crate::request::Parameter;
use crate::section;
use crate::sensitivity;
use crate::sweep::Field;
use num_complex::Complex64;
use pulp::Simd;

/// A derivative made ready for the kernels.
pub(crate) enum Gradient<const D: usize> {
    /// A column of a segment that changes its coefficients.
    Section { row: usize, kinetic: [f64; D], compliance: [Complex64; D] },
    /// The length of a segment.
    Length { row: usize },
    /// A column of a joint's spring.
    Joint { row: usize, column: usize, spring: Spring },
    /// A column of a point mass.
    Mass { node: usize, direction: usize },
    /// A column of a spring to ground.
    Ground { node: usize, column: usize, spring: Spring },
    /// A column of an overlap, as factors of what its work is made of, and of that times i w.
    Overlap { row: usize, factors: [Complex64; DERIVATIVES], rates: [f64; 2] },
    /// An entry of the receptance beyond a terminal.
    Terminal { row: usize, entry: usize },
}

/// The factors of a column of an overlap.
fn overlap_factors(overlap: &Overlap, column: usize) -> ([Complex64; DERIVATIVES], [f64; 2]) {
    use crate::section::column::OUTER_DIAMETER;
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
        _ => {
            for i in 0..2 {
                factors[LAYER + i] = Complex64::I * overlap.k[i];
            }
        }
    }
    (factors, rates)
}

impl<const D: usize> Gradient<D> {
    /// Prepares a parameter of a checked model.
    pub(crate) fn new(model: &Model, parameter: &Parameter) -> Self {
        let Parameter { table, row, column } = *parameter;
        match table {
            Table::Segments if column == section::column::LENGTH => Self::Length { row },
            Table::Segments => {
                let (_, change) = section::derivatives::<D>(&model.segments[row], model.motion, Some(column));
                Self::Section { row, kinetic: change.kinetic, compliance: change.compliance }
            }
            Table::Joints => Self::Joint { row, column: column - 2, spring: model.joints[row].1 },
            Table::Masses => Self::Mass { node: model.masses[row].0, direction: column - 1 },
            Table::Grounds => {
                let (node, spring) = model.grounds[row];
                Self::Ground { node, column: column - 1, spring }
            }
            Table::Overlaps => {
                let (factors, rates) = overlap_factors(&model.overlaps[row], column);
                Self::Overlap { row, factors, rates }
            }
            Table::Terminals => Self::Terminal { row, entry: column },
        }
    }

    /// The segment that the parameter belongs to.
    pub(crate) fn segment(&self) -> Option<usize> {
        match self {
            Self::Section { row, .. } | Self::Length { row } => Some(*row),
            _ => None,
        }
    }

    /// The overlap that the parameter belongs to.
    pub(crate) fn overlap(&self) -> Option<usize> {
        if let Self::Overlap { row, .. } = self { Some(*row) } else { None }
    }

    /// The joint that the parameter belongs to.
    pub(crate) fn joint(&self) -> Option<usize> {
        if let Self::Joint { row, .. } = self { Some(*row) } else { None }
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
        block: &Block<S, D>,
        left: &Field<S, D>,
        right: &Field<S, D>,
        sensitivities: &[Option<sensitivity::Sensitivity<S, D>>],
        overlaps: &[Option<[C<S>; DERIVATIVES]>],
    ) -> C<S> {
        let zero = C::zero(block.iw.simd);
        match self {
            Self::Section { row, kinetic, compliance } => match &sensitivities[*row] {
                Some(found) => sensitivity::by_column(found, kinetic, compliance),
                None => zero,
            },
            Self::Length { row } => sensitivities[*row].as_ref().map_or(zero, |found| found.length),
            Self::Joint { row, column, spring } => {
                let (left, right) = (&left.joints[*row].gap, &right.joints[*row].gap);
                spring_derivative(spring, *column, block.iw, left, right)
            }
            Self::Overlap { row, factors, rates } => {
                let Some(found) = &overlaps[*row] else { return zero };
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
    match column {
        0..3 => C::splat(simd, Complex64::new(1.0, spring.loss_factor)) * spring_term(column, left, right),
        3..6 => iw * spring_term(column - 3, left, right),
        _ => {
            let mut sum = C::zero(simd);
            for entry in 0..3 {
                sum = sum + spring_term(entry, left, right).scale(spring.k[entry]);
            }
            sum.times_i()
        }
    }
}
