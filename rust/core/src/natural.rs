//! Undamped natural frequencies by Wittrick-Williams counting, so that none is missed.
//!
//! The number of natural frequencies below w is the number of negative pivots met when the dynamic
//! stiffness is eliminated node by node, plus the clamped-clamped ones of each piece (Wittrick and
//! Williams, Q. J. Mech. Appl. Math. 24, 1971, 263). Pieces are kept shorter than |lambda| L = 3, where
//! there are none of the latter: with lambda_2 L < pi both halves of the clamped problem have determinants
//! without a zero. A pivot is T^-1 U_near U_far^-1 with the piece's compliance T, which the sweep has in
//! hand with all its digits. Counts at eight frequencies at a time narrow each bracket ninefold.

use crate::block::{Block, Prepared};
use crate::error::{Error, Result};
use crate::gradient::Gradient;
use crate::lane::{C, MAX_LANES};
use crate::model::{Model, Step};
use crate::request::{ByLine, Parameter, check_parameters, singular};
use crate::rigid::rigid_modes;
use crate::sensitivity::{self, Sensitivity};
use crate::series;
use crate::small::{self, Mat};
use crate::sweep::{Blind, Field, Observer, Within};
use num_complex::Complex64;
use pulp::{Arch, Scalar, Simd, WithSimd};

/// Relative width at which a bracket is a number.
const WIDTH: f64 = 4e-15;

/// Lowest frequency looked at, as a share of the upper limit.
const LOWEST: f64 = 1e-12;

/// Most pieces that the segments may have at the upper limit: beyond, a count alone would take too long.
const MOST_PIECES: f64 = 3e3;

/// Most modes that are located in one call.
const MOST_MODES: usize = 1_000;

/// Natural frequencies with derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct NaturalFrequencies {
    /// Angular frequencies in rad/s, ascending, rigid-body modes left out.
    pub angular: Vec<f64>,
    /// `(n_modes, n_parameters)`.
    pub derivative: Vec<f64>,
}

/// All natural frequencies up to `upper` (rad/s), at most `most` of them, with derivatives.
///
/// Damping, loss factors and imaginary parts are left out.
///
/// # Errors
/// An upper limit that is no positive number, a parameter that the model does not have, or a joint without
/// static stiffness in some direction.
pub fn natural_frequencies(
    model: &Model,
    upper: f64,
    most: usize,
    parameters: &[Parameter],
) -> Result<NaturalFrequencies> {
    if !(upper.is_finite() && upper > 0.0) {
        return Err(Error::NaturalFrequency(format!(
            "the upper limit is {upper} rad/s, expected a positive finite number"
        )));
    }
    check_parameters(model, parameters, 0)?;
    let model = undamped(model);
    for (row, (_, spring)) in model.joints.iter().enumerate() {
        if !spring.statically_regular(model.motion.degrees()) {
            let [k_y, k_theta, k_ytheta] = spring.k;
            return Err(Error::SingularInterface {
                element: "joint",
                row,
                frequency_hz: 0.0,
                k_y,
                k_theta,
                k_ytheta,
            });
        }
    }
    for (row, overlap) in model.overlaps.iter().enumerate() {
        if overlap.loose(false).is_some() {
            return Err(singular(overlap, row, Complex64::ZERO));
        }
    }
    match model.motion.degrees() {
        1 => Search::<1>::new(&model).run(&model, upper, most, parameters),
        _ => Search::<2>::new(&model).run(&model, upper, most, parameters),
    }
}

/// The model without what loses energy.
fn undamped(model: &Model) -> Model {
    use crate::section::column::{CORE_MATERIAL, MATERIAL};
    let mut model = model.clone();
    for row in &mut model.segments {
        row[MATERIAL + 3] = 0.0;
        row[CORE_MATERIAL + 3] = 0.0;
    }
    for overlap in &mut model.overlaps {
        for row in &mut overlap.beams {
            row[MATERIAL + 3] = 0.0;
            row[CORE_MATERIAL + 3] = 0.0;
        }
        overlap.c = [0.0; 2];
        overlap.loss_factor = 0.0;
    }
    let springs = model.joints.iter_mut().map(|joint| &mut joint.1);
    for spring in springs.chain(model.grounds.iter_mut().map(|ground| &mut ground.1)) {
        spring.c = [0.0; 3];
        spring.loss_factor = 0.0;
    }
    model
}

struct Search<const D: usize> {
    prepared: Prepared<D>,
    plan: Vec<Step>,
    nodes: usize,
}

/// Counts of natural frequencies below each of some frequencies.
struct Count<'a, const D: usize> {
    search: &'a Search<D>,
    w: &'a [f64],
}

/// Negative pivots, by lane.
struct Negatives {
    count: [usize; MAX_LANES],
}

impl Negatives {
    /// Adds the negative eigenvalues of the symmetric `numerator / denominator`, whose determinant has the
    /// sign of `top / bottom`.
    #[inline(always)]
    fn add<S: Simd, const D: usize>(&mut self, numerator: C<S>, denominator: C<S>, top: C<S>) {
        let mut lanes = [[Complex64::ZERO; MAX_LANES]; 3];
        numerator.store(&mut lanes[0]);
        denominator.store(&mut lanes[1]);
        top.store(&mut lanes[2]);
        for lane in 0..S::F64_LANES {
            let bottom = lanes[1][lane].re;
            let first = (lanes[0][lane].re < 0.0) != (bottom < 0.0);
            let determinant = (lanes[2][lane].re < 0.0) != (bottom < 0.0);
            self.count[lane] += match (D, determinant, first) {
                (1, _, first) => usize::from(first),
                (_, true, _) => 1,
                (_, false, true) => 2,
                (_, false, false) => 0,
            };
        }
    }
}

impl<S: Simd, const D: usize> Observer<S, D> for Negatives {
    #[inline(always)]
    fn passed(&mut self, far_u: &Mat<S, D>, near_u: &Mat<S, D>, compliance: &Mat<S, D>) {
        // pivot = compliance^-1 near far^-1 = adj(compliance) near adj(far) / (det det).
        let left = small::mul(&small::adjugate(compliance), near_u);
        let entry = small::mul(&left, &small::adjugate(far_u))[0][0];
        let bottom = small::det(compliance) * small::det(far_u);
        self.add::<S, D>(entry, bottom, small::det(near_u));
    }

    #[inline(always)]
    fn counts(&self) -> bool {
        true
    }

    #[inline(always)]
    fn overlapped(&mut self, negatives: &[usize; MAX_LANES]) {
        for lane in 0..MAX_LANES {
            self.count[lane] += negatives[lane];
        }
    }
}

impl<const D: usize> WithSimd for Count<'_, D> {
    type Output = Vec<usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<usize> {
        let mut out = Vec::with_capacity(self.w.len());
        let mut block = Block::empty(simd);
        let mut records = Vec::new();
        for lines in self.w.chunks(S::F64_LANES) {
            let mut w = [Complex64::ONE; MAX_LANES];
            for (to, from) in w.iter_mut().zip(lines) {
                to.re = *from;
            }
            let mut negatives = Negatives { count: [0; MAX_LANES] };
            self.search.prepared.block(simd, &w[..lines.len()], true, ByLine::default(), &mut block);
            block.upwards(simd, &self.search.plan, &[], &mut records, &mut negatives);
            if let Some(top) = records.last() {
                let (u, f) = top.plane.basis();
                let entry = small::mul(&f, &small::adjugate(&u))[0][0];
                negatives.add::<S, D>(entry, small::det(&u), small::det(&f));
            }
            out.extend_from_slice(&negatives.count[..lines.len()]);
        }
        out
    }
}

impl<const D: usize> Search<D> {
    fn new(model: &Model) -> Self {
        let (mut prepared, plan) = (Prepared::new(model, &[]), model.plan(0, &[]));
        prepared.follow(&plan);
        Self { prepared, plan, nodes: model.nodes }
    }

    fn count(&self, w: &[f64]) -> Vec<usize> {
        Arch::new().dispatch(Count { search: self, w })
    }

    fn run(
        &self,
        model: &Model,
        upper: f64,
        most: usize,
        parameters: &[Parameter],
    ) -> Result<NaturalFrequencies> {
        let spans = self.prepared.segments.iter();
        let span: f64 = spans.map(|one| one.wave_number_square(upper * upper).sqrt() * one.length).sum();
        let beside = self.prepared.overlaps.iter();
        let span = span + beside.map(|one| one.growth(upper * upper) * one.overlap.length()).sum::<f64>();
        if span.is_nan() || span > MOST_PIECES * series::REACH {
            return Err(too_high(upper, "the waves there are too short for the lengths of the segments"));
        }
        let rigid = rigid_modes(model);
        let mut lowest = upper * 1e-3;
        while self.count(&[lowest])[0] > rigid {
            lowest *= 1e-3;
            if lowest < upper * LOWEST {
                return Err(Error::NaturalFrequency(format!(
                    "there are modes below {:e} Hz that are not rigid-body modes",
                    lowest / core::f64::consts::TAU
                )));
            }
        }
        let mut samples = vec![(lowest, rigid), (upper, self.count(&[upper])[0])];
        let last = samples[1].1.min(rigid.saturating_add(most));
        if last > MOST_MODES {
            return Err(too_high(upper, &format!("there are {last} modes below it")));
        }
        let angular: Vec<f64> = (rigid + 1..=last).map(|mode| self.locate(mode, &mut samples)).collect();
        let gradients: Vec<Gradient<D>> = parameters.iter().map(|p| Gradient::new(model, p)).collect();
        let mut derivative = Vec::with_capacity(angular.len() * gradients.len());
        if !gradients.is_empty() {
            for &w in &angular {
                derivative.extend(self.slopes(model, w, &gradients));
            }
        }
        if let Some(index) = derivative.iter().position(|value: &f64| !value.is_finite()) {
            let hz = angular[index / gradients.len()] / core::f64::consts::TAU;
            return Err(Error::NaturalFrequency(format!(
                "the derivative of the mode at {hz:e} Hz by parameter {} is not finite: some number is too \
                 large or too small for floating point",
                index % gradients.len()
            )));
        }
        Ok(NaturalFrequencies { angular, derivative })
    }

    /// The frequency at which the count reaches `mode`.
    fn locate(&self, mode: usize, samples: &mut Vec<(f64, usize)>) -> f64 {
        loop {
            let above = samples.partition_point(|sample| sample.1 < mode).clamp(1, samples.len() - 1);
            let (low, high) = (samples[above - 1].0, samples[above].0);
            if high - low <= WIDTH * high {
                return 0.5 * (low + high);
            }
            let ratio = high / low;
            let points: [f64; MAX_LANES] = core::array::from_fn(|i| {
                let share = (i + 1) as f64 / (MAX_LANES + 1) as f64;
                if ratio > 2.0 { low * ratio.powf(share) } else { low + share * (high - low) }
            });
            let counts = self.count(&points);
            // Rounding at the root itself may disturb the order by one; clamping keeps the samples sorted.
            let (least, most) = (samples[above - 1].1, samples[above].1);
            let mut floor = least;
            let found = points.iter().zip(counts).map(|(&w, count)| {
                floor = count.clamp(floor, most);
                (w, floor)
            });
            let found: Vec<_> = found.filter(|sample| sample.0 > low && sample.0 < high).collect();
            if found.is_empty() {
                return 0.5 * (low + high);
            }
            samples.splice(above..above, found);
        }
    }

    /// d w / d p = -G_p / G_w, G being the work of a change in the mode of frequency w.
    fn slopes(&self, model: &Model, w: f64, gradients: &[Gradient<D>]) -> Vec<f64> {
        let simd = Scalar::new();
        let mut block = Block::empty(simd);
        let mut records = Vec::new();
        self.prepared.block(simd, &[Complex64::new(w, 0.0)], false, ByLine::default(), &mut block);
        block.upwards(simd, &self.plan, &[], &mut records, &mut Blind);
        let Some(top) = records.last() else {
            return Vec::new();
        };
        let (_, f) = top.plane.basis();
        let mode = null_vector(&f, &block.weights_of_first());
        let mut field = Field::empty(simd, self.nodes, &self.prepared);
        let within = Within { segments: true, overlaps: true };
        block.downwards(&self.plan, &records, mode, within, &mut field, 0);
        let mut by_w = 0.0;
        let mut sensitivities = Vec::new();
        for (row, segment) in self.prepared.segments.iter().enumerate() {
            let states = &field.states[row];
            let found: Sensitivity<Scalar, D> = sensitivity::segment(
                segment,
                &block.kernels[row],
                block.choices[row],
                block.w2,
                states,
                states,
            );
            for i in 0..D {
                by_w += 2.0 / w * segment.per_length.kinetic[i] * found.kinetic[i].re;
            }
            sensitivities.push(Some(found));
        }
        let mut beside = Vec::new();
        for (row, overlap) in self.prepared.overlaps.iter().enumerate() {
            let states = &field.overlaps[row];
            let found = block.overlap_derivatives(overlap, row, states, states);
            for i in 0..4 {
                by_w += 2.0 / w * overlap.beams[i / 2].per_length.kinetic[i % 2] * found[i].re;
            }
            beside.push(Some(found));
        }
        for (node, inertia) in &model.masses {
            for i in 0..D {
                let u = field.nodes[*node][i].re;
                by_w += 2.0 * w * inertia[i] * u * u;
            }
        }
        let slope = |gradient: &Gradient<D>| {
            -gradient.evaluate(&block, &field, &field, &sensitivities, &beside).re / by_w
        };
        gradients.iter().map(slope).collect()
    }
}

fn too_high(upper: f64, reason: &str) -> Error {
    let hz = upper / core::f64::consts::TAU;
    Error::NaturalFrequency(format!("the upper limit of {hz:.6e} Hz is too high: {reason}"))
}

/// The independent variables at which the root carries no load.
fn null_vector<const D: usize>(f: &Mat<Scalar, D>, weights: &[f64; D]) -> [C<Scalar>; D] {
    let one = C::real(f[0][0].simd, 1.0);
    if D == 1 {
        return [one; D];
    }
    // Near the mode the rows are parallel; the larger one has the digits.
    let size = |i: usize| -> f64 { (0..D).map(|j| f[i][j].re.powi(2) / (weights[i] * weights[j])).sum() };
    let row = if size(0) >= size(D - 1) { &f[0] } else { &f[D - 1] };
    let mut out = [row[D - 1]; D];
    out[D - 1] = -row[0];
    let length = out.iter().map(|value| value.re * value.re).sum::<f64>().sqrt();
    if length > 0.0 { out.map(|value| value.scale(1.0 / length)) } else { [one; D] }
}
