//! Undamped natural frequencies by Wittrick-Williams counting, so that none is missed.
//!
//! The number of natural frequencies below w is the number of negative pivots met when the dynamic
//! stiffness is eliminated node by node, plus the clamped-clamped ones of each piece (Wittrick and
//! Williams, Q. J. Mech. Appl. Math. 24, 1971, 263). Pieces are kept shorter than |lambda| L = 3, where
//! there are none of the latter: with lambda_2 L < pi both halves of the clamped problem have determinants
//! without a zero. A pivot is T^-1 U_near U_far^-1 with the piece's compliance T, which the sweep has in
//! hand with all its digits. The location of modes from these counts is in `locate`.

use crate::error::{Error, Result};
use crate::interrupt;
use crate::line::block::{Block, Prepared};
use crate::line::derivatives::{Gradient, Sensitivities};
use crate::line::layer::DERIVATIVES;
use crate::line::sweep::{Blind, Field, Observer, Within};
use crate::line::{derivatives, exponential, overlap};
use crate::model::assembly::{Model, Step};
use crate::model::request::{ByLine, Parameter, check_parameters, singular};
use crate::model::section::{Segment, column};
use crate::modes::locate::{Locating, Wanted, too_high};
use crate::simd::lane::{C, MAX_LANES, R};
use crate::simd::small::{self, Mat};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Most pieces that the segments may have at the upper limit: beyond, a count alone would take too long.
const MOST_PIECES: f64 = 3e3;

/// Most modes that may be requested by their number.
const MOST_MODES: usize = 100_000;

/// Least upper limit [rad/s], so that the squares of far lower frequencies do not underflow.
const LEAST: f64 = 1e-100;

/// Expected modes are counted up to this many times the highest one first.
const MARGIN: f64 = 1.05;

/// A mode this many times above where it is expected only shows that the point is far from the optimum.
const FARTHEST: f64 = 1e3;

/// Distance of the centres of two springs to ground, as a share of the size, within which they are one hinge.
const SAME_PLACE: f64 = 1e-12;

/// Natural frequencies with derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct NaturalFrequencies {
    /// Angular frequencies in rad/s, ascending, rigid-body modes left out.
    pub angular: Vec<f64>,
    /// `(n_modes, n_parameters)`.
    pub derivative: Vec<f64>,
}

/// The lowest natural frequencies, `most` of them or those up to `upper` (rad/s) if these are fewer, with derivatives.
///
/// Damping, loss factors and imaginary parts are left out.
///
/// # Errors
/// An upper limit that is no positive number, a parameter that the model does not have, a joint without static
/// stiffness in some direction, or modes above the frequencies up to which they can be counted.
pub fn natural_frequencies(
    model: &Model,
    upper: Option<f64>,
    most: usize,
    parameters: &[Parameter],
) -> Result<NaturalFrequencies> {
    let Some(upper) = upper else {
        if most > MOST_MODES {
            let text = format!("{most} modes are asked for, expected at most {MOST_MODES}");
            return Err(Error::NaturalFrequency(text));
        }
        let modes: Vec<usize> = (0..most).collect();
        let wanted = Wanted::These { modes: &modes, near: &[], farthest: f64::INFINITY };
        return find(model, first_limit(model, most), wanted, parameters);
    };
    if !(upper.is_finite() && upper >= LEAST) {
        return Err(Error::NaturalFrequency(format!(
            "the upper limit is {upper:e} rad/s, expected a finite number of at least {LEAST:e} rad/s"
        )));
    }
    find(model, upper, Wanted::UpTo(most), parameters)
}

/// A frequency below which a chain of beams has about so many modes: where its length is as many half waves.
fn first_limit(model: &Model, count: usize) -> f64 {
    let half_waves = |w: f64| -> f64 {
        let square = |row: &[f64; column::COUNT]| match model.motion.degrees() {
            1 => Segment::<1>::new(row, model.motion).wave_number_square(w * w),
            _ => Segment::<2>::new(row, model.motion).wave_number_square(w * w),
        };
        let beams = model.overlaps.iter().map(|overlap| &overlap.beams[1]);
        let spans = model.segments.iter().chain(beams).map(|row| square(row).sqrt() * row[column::LENGTH]);
        spans.sum::<f64>() / core::f64::consts::PI
    };
    let (mut low, mut high) = (1e-3, 1e12);
    for _ in 0..60 {
        let middle = f64::sqrt(low * high);
        if half_waves(middle) > count as f64 + 0.5 { high = middle } else { low = middle }
    }
    low
}

/// The modes of some numbers, counted from 0 on and ascending, expected near some frequencies (rad/s).
///
/// # Errors
/// As `natural_frequencies`; modes that lie far above where they are expected.
pub(crate) fn expected_frequencies(
    model: &Model,
    modes: &[usize],
    near: &[f64],
    parameters: &[Parameter],
) -> Result<NaturalFrequencies> {
    let highest = near.iter().fold(0.0_f64, |most, w| most.max(*w));
    let wanted = Wanted::These { modes, near, farthest: FARTHEST * highest };
    let found = find(model, MARGIN * highest, wanted, parameters)?;
    if found.angular.len() < modes.len() {
        return Err(Error::NaturalFrequency(format!(
            "the highest mode lies more than {FARTHEST} times above where it is expected"
        )));
    }
    Ok(found)
}

fn find(model: &Model, upper: f64, wanted: Wanted, parameters: &[Parameter]) -> Result<NaturalFrequencies> {
    check_parameters(model, parameters)?;
    check_no_terminals(model)?;
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
    let at = Locating::new(wanted, upper, rigid_modes(&model));
    match model.motion.degrees() {
        1 => Search::<1>::new(&model).run(&model, at, parameters),
        _ => Search::<2>::new(&model).run(&model, at, parameters),
    }
}

/// Refuses models for which counts and determinants of the pivots are not defined.
pub(crate) fn check_no_terminals(model: &Model) -> Result<()> {
    if model.terminals.is_empty() {
        return Ok(());
    }
    let text =
        "they are counted for beams and joints, not for substructures that are known by their receptance";
    Err(Error::NaturalFrequency(text.into()))
}

/// The model without damping.
fn undamped(model: &Model) -> Model {
    let mut model = model.with_damping(0.0);
    for slip in &mut model.slips {
        *slip = slip.lossless();
    }
    model
}

struct Search<const D: usize> {
    prepared: Prepared<D>,
    plan: Vec<Step>,
}

/// The search for modes by counts below each of some frequencies.
struct Locate<'a, 'b, const D: usize> {
    search: &'a Search<D>,
    at: &'a mut Locating<'b>,
}

/// Derivatives of modes, mode by mode.
struct Slopes<'a, const D: usize> {
    search: &'a Search<D>,
    model: &'a Model,
    angular: &'a [f64],
    gradients: &'a [Gradient<D>],
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
    fn passed(&mut self, far: [&Mat<S, D>; 2], near_u: &Mat<S, D>, between: [&Mat<S, D>; 2]) {
        // pivot = uf^-1 near far_u^-1 = uf^-1 uu + far_f far_u^-1. Its determinant is that of the first form; the entry of
        // the second one keeps its digits where far_u holds a soft direction coupled to a very stiff one.
        let ([far_u, far_f], [uu, uf]) = (far, between);
        let (motion, compliance) = (small::det(far_u), small::det(uf));
        let stiffness = small::mul(&small::adjugate(uf), uu)[0][0];
        let impedance = small::mul(far_f, &small::adjugate(far_u))[0][0];
        let entry = stiffness.mul_add(motion, impedance * compliance);
        self.add::<S, D>(entry, compliance * motion, small::det(near_u));
    }

    #[inline(always)]
    fn wanted(&self) -> overlap::Wanted {
        overlap::Wanted::Count
    }

    #[inline(always)]
    fn overlapped(&mut self, _: &Mat<S, D>, _: &Mat<S, D>, passed: &overlap::Passed<S>) {
        for (count, negatives) in self.count.iter_mut().zip(passed.negatives) {
            *count += negatives;
        }
    }
}

impl<const D: usize> WithSimd for Locate<'_, '_, D> {
    type Output = Result<()>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<()> {
        let mut block = Block::empty(simd);
        let mut records = Vec::with_capacity(4 * self.search.plan.len());
        let mut seen = Vec::with_capacity(2 * MAX_LANES);
        while let Some(&highest) = self.at.points().last() {
            interrupt::check()?;
            within_reach(&self.search.prepared, highest)?;
            seen.clear();
            for lines in self.at.points().chunks(S::F64_LANES) {
                let mut negatives = Negatives { count: [0; MAX_LANES] };
                let mut determinants = [Complex64::ZERO; MAX_LANES];
                let w = angular(lines);
                self.search.prepared.block(simd, &w[..lines.len()], true, ByLine::default(), &mut block);
                block.upwards(simd, &self.search.plan, &self.search.prepared, &mut records, &mut negatives);
                if let Some(top) = records.last() {
                    let (u, f) = top.plane.basis();
                    let entry = small::mul(&f, &small::adjugate(&u))[0][0];
                    let (below, above) = (small::det(&u), small::det(&f));
                    negatives.add::<S, D>(entry, below, above);
                    (above * below.recip()).store(&mut determinants);
                }
                let both = negatives.count.iter().zip(&determinants).take(lines.len());
                seen.extend(both.map(|(count, determinant)| (*count, determinant.re)));
            }
            self.at.see(&seen)?;
        }
        Ok(())
    }
}

impl<const D: usize> WithSimd for Slopes<'_, D> {
    type Output = Vec<f64>;

    /// d w / d p = -G_p / G_w, G being the work of a change in the mode of frequency w.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f64> {
        let prepared = &self.search.prepared;
        let count = self.gradients.len();
        let mut out = vec![0.0; self.angular.len() * count];
        let mut block = Block::empty(simd);
        let mut records = Vec::with_capacity(4 * self.search.plan.len());
        let mut field = Field::empty(simd, self.model.nodes, prepared);
        let mut sensitivities = Sensitivities::zeros(simd, prepared);
        for (lines, out) in self.angular.chunks(S::F64_LANES).zip(out.chunks_mut(S::F64_LANES * count)) {
            let w = angular(lines);
            prepared.block(simd, &w[..lines.len()], false, ByLine::default(), &mut block);
            block.upwards(simd, &self.search.plan, prepared, &mut records, &mut Blind);
            let Some(top) = records.last() else { continue };
            let (_, f) = top.plane.basis();
            let mode = null_vector(&f, &block.weights_of_first());
            let within = Within { segments: true, overlaps: true };
            block.downwards(&self.search.plan, &records, mode, within, &mut field, 0);
            // Work by w^2, which inertia alone has, times w^2.
            let mut by_square = C::zero(simd);
            for (row, segment) in prepared.segments.iter().enumerate() {
                let states = &field.states[row];
                let found = derivatives::segment(prepared, row, &block, states, states);
                let kinetic = match prepared.cones[row] {
                    Some(_) => derivatives::first(1.0, 0.0),
                    None => segment.per_length.kinetic,
                };
                for i in 0..D {
                    by_square = by_square + found.kinetic[i].scale(kinetic[i]);
                }
                sensitivities.segments[row] = found;
            }
            for (row, overlap) in prepared.overlaps.iter().enumerate() {
                let states = &field.overlaps[row];
                let found = block.overlaps[row].derivatives(block.w2, overlap, states, states);
                for i in 0..4 {
                    by_square = by_square + found[i].scale(overlap.beams[i / 2].per_length.kinetic[i % 2]);
                }
                sensitivities.overlaps[row] = found;
            }
            for (node, inertia) in &self.model.masses {
                for i in 0..D {
                    let u = field.nodes[*node][i];
                    by_square = (u * u * block.w2).scale(inertia[i]) + by_square;
                }
            }
            let mut lanes = [Complex64::ZERO; MAX_LANES];
            by_square.store(&mut lanes);
            let factors = lanes.map(|work| -0.5 / work.re);
            for (k, gradient) in self.gradients.iter().enumerate() {
                gradient.evaluate(prepared, &block, &field, &field, &sensitivities).store(&mut lanes);
                for (lane, w) in lines.iter().enumerate() {
                    out[lane * count + k] = w * factors[lane] * lanes[lane].re;
                }
            }
        }
        out
    }
}

/// Frequencies as the kernels take them, one a lane.
fn angular(lines: &[f64]) -> [Complex64; MAX_LANES] {
    let mut w = [Complex64::ONE; MAX_LANES];
    for (to, from) in w.iter_mut().zip(lines) {
        to.re = *from;
    }
    w
}

impl<const D: usize> Search<D> {
    fn new(model: &Model) -> Self {
        let (prepared, plan) = Prepared::to_first_node(model);
        Self { prepared, plan }
    }

    fn run(
        mut self,
        model: &Model,
        mut at: Locating,
        parameters: &[Parameter],
    ) -> Result<NaturalFrequencies> {
        Arch::new().dispatch(Locate { search: &self, at: &mut at })?;
        let angular = at.found();
        let gradients: Vec<Gradient<D>> = parameters.iter().map(|p| Gradient::new(model, p)).collect();
        let mut derivative = Vec::new();
        if !gradients.is_empty() {
            // The work by w^2 needs the inertia of every beam.
            self.prepared.differentiated.fill(true);
            let mut inertia = [false; DERIVATIVES];
            inertia[..4].fill(true);
            for row in 0..model.overlaps.len() {
                self.prepared.request(row, &inertia);
            }
            for (row, requested) in gradients.iter().filter_map(Gradient::overlap) {
                self.prepared.request(row, &requested);
            }
            let work = Slopes { search: &self, model, angular: &angular, gradients: &gradients };
            derivative = Arch::new().dispatch(work);
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
}

/// Whether a sweep in pieces at a frequency ends within reasonable time.
pub(crate) fn within_reach<const D: usize>(prepared: &Prepared<D>, w: f64) -> Result<()> {
    let spans = prepared.segments.iter();
    let span: f64 = spans.map(|one| one.wave_number_square(w * w).sqrt() * one.length).sum();
    let beside = prepared.overlaps.iter();
    let span = span + beside.map(|one| one.growth(w * w) * one.overlap.length()).sum::<f64>();
    if span.is_nan() || span > MOST_PIECES * exponential::REACH {
        return Err(too_high(w, "the waves there are too short for the lengths of the segments"));
    }
    Ok(())
}

/// The independent variables at which the root carries no load.
#[inline(always)]
fn null_vector<S: Simd, const D: usize>(f: &Mat<S, D>, weights: &[f64; D]) -> [C<S>; D] {
    let simd = f[0][0].simd;
    let one = C::real(simd, 1.0);
    if D == 1 {
        return [one; D];
    }
    // Near the mode the rows are parallel; the larger one has the digits.
    let size = |i: usize| {
        let mut sum = simd.splat_f64s(0.0);
        for j in 0..D {
            let share = simd.splat_f64s(1.0 / (weights[i] * weights[j]));
            sum = simd.mul_add_e_f64s(f[i][j].norm_sqr().v, share, sum);
        }
        R { simd, v: sum }
    };
    let last = size(D - 1).greater(size(0));
    let mut out = [-C::select(last, f[D - 1][0], f[0][0]); D];
    out[0] = C::select(last, f[D - 1][D - 1], f[0][D - 1]);
    let mut square = R::splat(simd, 0.0);
    for value in &out {
        square = R { simd, v: simd.add_f64s(square.v, value.norm_sqr().v) };
    }
    let some = square.greater(R::splat(simd, 0.0));
    let inverse = simd.div_f64s(simd.splat_f64s(1.0), simd.sqrt_f64s(square.v));
    out.map(|value| C::select(some, value.mul_real(inverse), one))
}

/// Rigid-body modes: displacements of the whole that no spring to ground resists.
pub(crate) fn rigid_modes(model: &Model) -> usize {
    let degrees = model.motion.degrees();
    if degrees == 1 {
        return usize::from(!model.grounds.iter().any(|(_, spring)| spring.k[0] > 0.0));
    }
    // Positions of the nodes along the axis, joints having no length.
    let mut position = vec![f64::NAN; model.nodes];
    position[0] = 0.0;
    for _ in 0..model.nodes {
        for row in &model.segments {
            let (a, b) = (row[0] as usize, row[1] as usize);
            if position[b].is_nan() {
                position[b] = position[a] + row[crate::model::section::column::LENGTH];
            }
            if position[a].is_nan() {
                position[a] = position[b] - row[crate::model::section::column::LENGTH];
            }
        }
        for overlap in &model.overlaps {
            let [a, b] = overlap.nodes;
            if position[b].is_nan() {
                position[b] = position[a] + overlap.length();
            }
            if position[a].is_nan() {
                position[a] = position[b] - overlap.length();
            }
        }
        for (nodes, _) in &model.joints {
            for (to, from) in [(nodes[0], nodes[1]), (nodes[1], nodes[0])] {
                if position[to].is_nan() {
                    position[to] = position[from];
                }
            }
        }
        if position.iter().all(|x| !x.is_nan()) {
            break;
        }
    }
    let span = position.iter().fold(0.0_f64, |most, x| most.max(x.abs())).max(f64::MIN_POSITIVE);
    // A spring holds its centre, and resists rotation about it unless it is a hinge. How stiff it is makes no difference: a
    // sum would lose the softer one of two stiffnesses.
    let mut first = None;
    let mut against_rotation = false;
    for (node, spring) in &model.grounds {
        let [y, theta, mixed] = spring.k;
        if y > 0.0 {
            let centre = position[*node] + mixed / y;
            against_rotation |=
                (centre - *first.get_or_insert(centre)).abs() > SAME_PLACE * span.max(centre.abs());
            against_rotation |= spring.statically_regular(degrees);
        } else {
            against_rotation |= theta > 0.0;
        }
    }
    2 - usize::from(first.is_some()) - usize::from(against_rotation)
}
