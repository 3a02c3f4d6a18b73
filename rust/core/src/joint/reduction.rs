//! An assembly reduced to one of its joints: everything else is evaluated once.
//!
//! Most often the receptance is a quotient of power series in w^2 and the joint's stiffness, see `joint_series`.
//! Otherwise, with the assembly known at a reference stiffness K_0, let H_0 be the observed receptance, F_e and
//! F_r the force in the joint under unit loads at the excited and at the measured coordinate, and Y the force per
//! gap imposed in the joint. Another stiffness adds the compliance D = K^-1 - K_0^-1, so that
//!     H = H_0 + F_r^T D (1 + Y D)^-1 F_e,
//! an exact low-rank update. Starting from the assembled structure it loses nothing where the parts alone
//! have huge rigid-body receptances that cancel in a plain coupling.

use crate::error::{Error, Result};
use crate::joint::change::REDUCTION_PLANES;
use crate::joint::series::joint_series;
use crate::line::response::{Job, first_of, with_branches};
use crate::model::assembly::Model;
use crate::model::frequencies::{EMPTY, Frequencies, LINES_PER_TASK, OwnedFrequencies, every};
use crate::model::request::{Coordinate, Request, check};
use crate::model::section::Motion;
use crate::model::spring::{SPRING_COLUMNS, Spring};
use crate::model::terminals::TERMINAL_ENTRIES;
use crate::simd::lane::{C, MAX_LANES};
use crate::simd::small::{self, Mat};
use crate::threads::on_threads;
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Columns of the whole assembly's answer: one response under each of two excitations.
const PAIRS: usize = 2;
/// Numbers a line of a 2 x 2 receptance, and of the forces under two excitations.
const SQUARE: usize = 4;

/// Numbers that tell everything of a model but one joint.
#[derive(Clone, Debug)]
pub(crate) enum Reduction {
    /// `REDUCTION_PLANES` rows with a column a line.
    Planes(Vec<f64>),
    /// `SERIES_ROWS` rows of coefficients of power series in w^2, for all lines.
    Series(Vec<f64>),
}

/// A model reduced to one joint, on some lines.
#[derive(Clone, Debug)]
pub struct JointReduction {
    pub(crate) reduction: Reduction,
    frequencies: OwnedFrequencies,
    /// The columns of the joint at which the model was reduced.
    pub(crate) reference: [f64; SPRING_COLUMNS],
}

impl JointReduction {
    /// The lines.
    pub fn frequencies(&self) -> Frequencies<'_> {
        self.frequencies.view()
    }

    /// Number of lines.
    pub fn lines(&self) -> usize {
        self.frequencies.view().len()
    }

    /// H_0, F_r (2), F_e (2) and Y (3), real and imaginary parts each, `(16, n_freq)`; nothing where the model was
    /// reduced to power series.
    pub fn planes(&self) -> Option<&[f64]> {
        match &self.reduction {
            Reduction::Planes(planes) => Some(planes),
            Reduction::Series(_) => None,
        }
    }

    /// The same on every so many of the lines.
    pub(crate) fn thinned(&self, stride: usize) -> Self {
        let reduction = match &self.reduction {
            Reduction::Planes(planes) => {
                let planes = planes.chunks(self.lines().max(1));
                Reduction::Planes(planes.flat_map(|plane| every(plane, stride)).collect())
            }
            Reduction::Series(rows) => Reduction::Series(rows.clone()),
        };
        let frequencies = self.frequencies.view().every(stride);
        Self { reduction, frequencies, reference: self.reference }
    }
}

/// How a model is reduced to one joint.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Form {
    /// Power series in w^2 where they serve, else line by line.
    Shortest,
    /// Line by line.
    Planes,
}

/// Reduces a model to one joint.
///
/// # Errors
/// As `receptance`, and where the model is not in bending or has no such joint, or without lines.
#[allow(clippy::too_many_arguments)]
pub fn reduce_joint(
    model: &Model,
    joint: usize,
    lines: &Frequencies,
    response: Coordinate,
    excitation: Coordinate,
    beyond: Vec<Complex64>,
    form: Form,
    threads: usize,
) -> Result<JointReduction> {
    if model.motion != Motion::Bending || joint >= model.joints.len() {
        let expected = format!("a joint below {} of a model in bending", model.joints.len());
        return Err(Error::Index { what: "joint", index: 0, value: joint as f64, expected });
    }
    if lines.is_empty() {
        let expected = "at least one".to_owned();
        return Err(Error::Index { what: "number of frequency lines", index: 0, value: 0.0, expected });
    }
    if !model.slips.is_empty() {
        let (what, value) = ("number of joints in micro-slip", model.slips.len() as f64);
        return Err(Error::Index { what, index: 0, value, expected: "none".to_owned() });
    }
    let request = Request {
        excitations: vec![excitation, response],
        responses: vec![response],
        joint: Some(joint),
        beyond,
        ..Request::default()
    };
    let highest = check(model, lines, &request)?;
    let in_series = form == Form::Shortest && lines.are_real() && model.terminals.is_empty();
    let series = if in_series { joint_series(model, joint, highest, response, excitation) } else { None };
    let reduction = match series {
        Some(series) => Reduction::Series(series),
        None => Reduction::Planes(planes(model, joint, lines, highest, &request, threads)?),
    };
    let reference = model.joints[joint].1.columns;
    Ok(JointReduction { reduction, frequencies: lines.every(1), reference })
}

/// The planes of a reduction, from sweeps of the assembly and of both sides of the joint.
fn planes(
    model: &Model,
    joint: usize,
    lines: &Frequencies,
    highest: f64,
    request: &Request,
    threads: usize,
) -> Result<Vec<f64>> {
    let (nodes, spring) = model.joints[joint];
    let first = Face::new(model, joint, nodes[0], &request.beyond);
    let second = Face::new(model, joint, nodes[1], &request.beyond);
    with_branches(highest, lines.len(), |whole| {
        let jobs = [
            Job::new(model, request, whole),
            Job::new(&first.model, &first.request, whole),
            Job::new(&second.model, &second.request, whole),
        ];
        reduce(&jobs, &spring, lines, threads)
    })
}

/// One side of the joint alone, and its receptance at the joint.
struct Face {
    model: Model,
    request: Request,
}

impl Face {
    fn new(model: &Model, joint: usize, node: usize, beyond: &[Complex64]) -> Self {
        let (side, number) = model.side(joint, node);
        let beyond = beyond_of(model, beyond, &number);
        let node = number[node].unwrap_or(0);
        let points = vec![Coordinate { node, direction: 0 }, Coordinate { node, direction: 1 }];
        Self {
            model: side,
            request: Request { excitations: points.clone(), responses: points, beyond, ..Request::default() },
        }
    }
}

/// The receptances beyond those terminals whose nodes have a number on one side.
fn beyond_of(model: &Model, beyond: &[Complex64], number: &[Option<usize>]) -> Vec<Complex64> {
    let kept = |(_, row): &(&[Complex64], usize)| number[model.terminals[*row].node].is_some();
    let rows = beyond.chunks(TERMINAL_ENTRIES).zip((0..model.terminals.len()).cycle());
    rows.filter(kept).flat_map(|(entries, _)| entries.iter().copied()).collect()
}

fn reduce(jobs: &[Job<'_, 2>; 3], spring: &Spring, lines: &Frequencies, threads: usize) -> Result<Vec<f64>> {
    let mut planes = vec![0.0; REDUCTION_PLANES * lines.len()];
    let mut tasks: Vec<(Range<usize>, Vec<&mut [f64]>)> =
        lines.tasks().into_iter().map(|range| (range, Vec::with_capacity(REDUCTION_PLANES))).collect();
    for plane in planes.chunks_mut(lines.len()) {
        for (task, part) in tasks.iter_mut().zip(plane.chunks_mut(LINES_PER_TASK)) {
            task.1.push(part);
        }
    }
    let arch = Arch::new();
    let at_least = jobs.iter().map(Job::a_task_takes).sum();
    let broken = on_threads(threads, tasks, at_least, |(range, planes)| {
        let mut room = EMPTY;
        let by_line = |job: usize| jobs[job].by_line(&range, lines.len());
        let own = [by_line(0), by_line(1), by_line(2)];
        let w = lines.some(range.clone(), &mut room);
        let zeros = |a_line: usize| vec![Complex64::ZERO; w.len() * a_line];
        let (mut whole, mut force) = (zeros(PAIRS), zeros(SQUARE));
        let mut faces = [zeros(SQUARE), zeros(SQUARE)];
        let broken = [
            jobs[0].lines(&arch, w, own[0], &mut whole, &mut [], &mut force),
            jobs[1].lines(&arch, w, own[1], &mut faces[0], &mut [], &mut []),
            jobs[2].lines(&arch, w, own[2], &mut faces[1], &mut [], &mut []),
        ];
        arch.dispatch(Combine { spring, w, whole: &whole, force: &force, faces: &faces, planes });
        broken.into_iter().flatten().min()
    })?;
    first_of(&broken, lines)?;
    Ok(planes)
}

/// The planes of one task from the answers of the whole assembly and of its two sides.
struct Combine<'a, 'b> {
    spring: &'a Spring,
    w: &'a [Complex64],
    whole: &'a [Complex64],
    force: &'a [Complex64],
    faces: &'a [Vec<Complex64>; 2],
    planes: Vec<&'b mut [f64]>,
}

impl WithSimd for Combine<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { spring, w, whole, force, faces, mut planes } = self;
        let mut start = 0;
        while start < w.len() {
            let end = w.len().min(start + S::F64_LANES);
            let line = entry(simd, w, start, end, 1, 0);
            let stiffness: Mat<S, 2> = spring.stiffness(simd, line.times_i());
            let mut compliance = small::inverse(&stiffness);
            for i in 0..2 {
                for j in 0..2 {
                    let first = entry(simd, &faces[0], start, end, SQUARE, 2 * i + j);
                    let second = entry(simd, &faces[1], start, end, SQUARE, 2 * i + j);
                    compliance[i][j] = compliance[i][j] + (first + second);
                }
            }
            let y = small::inverse(&compliance);
            let values = [
                entry(simd, whole, start, end, PAIRS, 0),
                entry(simd, force, start, end, SQUARE, 2),
                entry(simd, force, start, end, SQUARE, 3),
                entry(simd, force, start, end, SQUARE, 0),
                entry(simd, force, start, end, SQUARE, 1),
                y[0][0],
                y[0][1],
                y[1][1],
            ];
            for (pair, value) in values.iter().enumerate() {
                simd.partial_store_f64s(&mut planes[2 * pair][start..end], value.re);
                simd.partial_store_f64s(&mut planes[2 * pair + 1][start..end], value.im);
            }
            start = end;
        }
    }
}

/// One entry of each line of a block; lanes without a line repeat the last one.
#[inline(always)]
fn entry<S: Simd>(
    simd: S,
    values: &[Complex64],
    start: usize,
    end: usize,
    a_line: usize,
    which: usize,
) -> C<S> {
    let mut lanes = [Complex64::ONE; MAX_LANES];
    for lane in 0..S::F64_LANES {
        lanes[lane] = values[(start + lane).min(end - 1) * a_line + which];
    }
    C::load(simd, &lanes[..S::F64_LANES])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::joint::sweep::{JointSweep, Sweep};
    use crate::line::amplitude::receptance;
    use crate::model::assembly::{Table, Tables};
    use crate::model::request::Parameter;
    use crate::model::section::column::COUNT;
    use crate::observe::joint::{Fitted, OfJoint};
    use crate::observe::observed::Record;
    use std::sync::Arc;

    const SEED: u64 = 20;

    /// Even numbers between bounds, the same in every run (Knuth's linear congruence).
    struct Draw(u64);

    impl Draw {
        fn between(&mut self, low: f64, high: f64) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn power(&mut self, low: f64, high: f64) -> f64 {
            10.0_f64.powf(self.between(low, high))
        }

        /// A joint from soft to stiff.
        fn joint(&mut self, couples: bool) -> [f64; SPRING_COLUMNS] {
            let k = [self.power(5.0, 11.0), self.power(2.0, 8.0)];
            let c = [self.power(-1.0, 4.0), self.power(-4.0, 2.0)];
            let both = |draw: &mut Self, pair: [f64; 2]| draw.between(-0.9, 0.9) * (pair[0] * pair[1]).sqrt();
            let coupling = if couples { [both(self, k), both(self, c)] } else { [0.0; 2] };
            [k[0], k[1], coupling[0], c[0], c[1], coupling[1], self.between(0.0, 0.1)]
        }

        fn segment(&mut self, node: usize) -> Vec<f64> {
            let outer = self.between(0.008, 0.04);
            let bore = outer * [0.0, 0.5][usize::from(self.between(0.0, 1.0) > 0.5)];
            let node = node as f64;
            let mut row = vec![node, node + 1.0, self.between(0.003, 0.04), outer, bore];
            row.extend([self.power(10.8, 11.8), self.between(2700.0, 14e3), 0.3, self.between(0.0, 0.02)]);
            row.resize(COUNT, 0.0);
            row
        }

        /// Two segments, the joint, two segments, a plain joint and one more, with point elements.
        fn model(&mut self) -> Model {
            let segments: Vec<f64> =
                [0, 1, 3, 4, 6].into_iter().flat_map(|node| self.segment(node)).collect();
            let mut joints = vec![2.0, 3.0];
            joints.extend(self.joint(true));
            joints.extend([5.0, 6.0, self.power(7.0, 10.0), self.power(4.0, 7.0), 0.0, 0.0, 0.0, 0.0, 0.03]);
            let masses: Vec<f64> =
                [1.0, 4.0].into_iter().flat_map(|node| [node, self.power(-4.0, -1.0), 1e-6]).collect();
            let mut grounds = vec![7.0, self.power(4.0, 9.0), self.power(2.0, 5.0)];
            grounds.extend([0.0, 0.0, 0.0, 0.0, 0.01]);
            grounds.truncate(if self.between(0.0, 1.0) > 0.5 { 8 } else { 0 });
            let tables = Tables {
                segments: &segments,
                joints: &joints,
                masses: &masses,
                grounds: &grounds,
                ..Tables::default()
            };
            Model::new(Motion::Bending, tables).unwrap()
        }
    }

    fn lines() -> Vec<Complex64> {
        [1.0, 17.0, 130.0, 777.0, 1500.0, 2500.0, 4000.0, 6000.0, 8000.0]
            .map(|f: f64| Complex64::from(core::f64::consts::TAU * f))
            .to_vec()
    }

    /// The parts of [J | r]^T [J | r] at one line and column, for two residuals at right angles.
    fn products(observed: &[OfJoint; 2], joint: &[f64; SPRING_COLUMNS], column: usize) -> [f64; 3] {
        let joint = Fitted { spring: Spring::new(joint), columns: vec![(column, joint[column])] };
        let found = [0, 1].map(|i| observed[i].normal_matrix(&joint, 1).unwrap());
        [found[0][0], found[0][1], found[1][1]]
    }

    #[test]
    fn both_roads_are_the_whole_model() {
        println!("seed {SEED}");
        let mut draw = Draw(SEED);
        let w = lines();
        let all = Frequencies::complex(&w, 1.0);
        for case in 0..40 {
            let model = draw.model();
            let node = if case % 2 == 0 { 0 } else { 7 };
            let tip = Coordinate { node, direction: case / 2 % 2 };
            let reference = model.joints[0].1.columns;
            let joint = draw.joint(case % 3 > 0);
            let (mut other, request) = (model.clone(), derivatives(tip));
            other.joints[0].1 = Spring::new(&joint);
            let whole = receptance(&other, &all, &request, 1).unwrap();
            for line in 0..w.len() {
                let h = whole.receptance[line];
                let one = Frequencies::complex(&w[line..=line], 1.0);
                for form in [Form::Shortest, Form::Planes] {
                    let model = reduce_joint(&model, 0, &one, tip, tip, Vec::new(), form, 1).unwrap();
                    assert_eq!(model.planes().is_some(), form == Form::Planes);
                    // log(measured/H) is 1 for the first and i for the second, so that the products are J.
                    let measured = [h * 1.0_f64.exp(), h * Complex64::I.exp()];
                    let observed = [0, 1].map(|i| OfJoint {
                        reduction: Arc::new(model.clone()),
                        record: Record { measured: vec![measured[i]], weights: vec![1.0] },
                        joint,
                        variables: [None; SPRING_COLUMNS],
                    });
                    let at = format!("case {case}, line {line}, {form:?}");
                    let many = JointSweep::new(&model).unwrap();
                    let mut swept = [Complex64::ZERO; 3];
                    many.receptances(&[reference, joint, joint].concat(), &mut swept, 2).unwrap();
                    assert!((swept[1] / h - 1.0).norm() < 1e-9 && swept[1] == swept[2], "{at}");
                    let known = Fitted { spring: Spring::new(&joint), columns: Vec::new() };
                    for (i, one) in observed.iter().enumerate() {
                        let residual = one.rows(&known, 1).unwrap().residual;
                        assert!((residual[i] - 1.0).abs() < 1e-9 && residual[1 - i].abs() < 1e-9, "{at}");
                    }
                    for column in 0..SPRING_COLUMNS {
                        let slope = -whole.derivative[line * SPRING_COLUMNS + column] / h * joint[column];
                        let [square, re, im] = products(&observed, &joint, column);
                        let size = slope.norm();
                        assert!((square - size * size).abs() <= 1e-9 * size * size, "{at}, column {column}");
                        assert!((re - slope.re).abs() <= 1e-9 * size, "{at}, column {column}");
                        assert!((im - slope.im).abs() <= 1e-9 * size, "{at}, column {column}");
                    }
                }
            }
        }
    }

    /// A receptance and its derivatives by all columns of the first joint.
    fn derivatives(tip: Coordinate) -> Request {
        let parameter = |column| Parameter { table: Table::Joints, row: 0, column: column + 2 };
        Request {
            excitations: vec![tip],
            responses: vec![tip],
            parameters: (0..SPRING_COLUMNS).map(parameter).collect(),
            ..Request::default()
        }
    }
}
