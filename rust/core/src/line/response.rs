//! The observed receptance and its derivatives over all frequency lines.

use crate::error::{Error, Result};
use crate::line::block::{Block, Prepared};
use crate::line::derivatives::{self, Gradient, Sensitivities};
use crate::line::sweep::{Blind, Field, Record, Within};
use crate::model::assembly::{Model, Step};
use crate::model::frequencies::{EMPTY, Frequencies, LINES_PER_TASK};
use crate::model::request::{ByLine, Coordinate, Request, Response, check};
use crate::series::branch::{Parts, Tip, shorten};
use crate::simd::lane::MAX_LANES;
use crate::simd::small::column;
use crate::threads::on_threads;
use core::ops::Range;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Most that the squared frequencies of the lines of one block may differ by, as a ratio.
const MOST_APART: f64 = 16.0;

/// Least time of a step of a plan or a derivative for one line [ns].
const A_STEP: f64 = 5.0;

/// One load case: a unit load at the root of a plan.
struct Load {
    plan: usize,
    coordinate: Coordinate,
}

/// Everything that the lines share.
pub(crate) struct Job<'a, const D: usize> {
    prepared: Prepared<D>,
    plans: Vec<(usize, Vec<Step>)>,
    loads: Vec<Load>,
    excited: Vec<usize>,
    observed: Vec<usize>,
    gradients: Vec<Gradient<D>>,
    /// Segments with a parameter that is differentiated.
    differentiated: Vec<usize>,
    /// Those among them of which a parameter changes the coefficients or the length alike everywhere.
    uniform: Vec<usize>,
    /// Overlaps that are differentiated.
    overlaps: Vec<usize>,
    request: &'a Request,
    nodes: usize,
    /// Whether responses are taken at the root only, without the way back.
    only_root: bool,
    /// Responses at the root of a single branch.
    tip: Option<Tip>,
}

/// Receptance and derivatives of a model at frequency lines, joints in micro-slip at their stated levels.
///
/// # Errors
/// A line that is not a positive frequency, a coordinate or parameter that the model does not have, a
/// singular interface, or a resonance without damping met exactly.
pub fn linear(model: &Model, lines: &Frequencies, request: &Request, threads: usize) -> Result<Response> {
    let highest = check(model, lines, request)?;
    with_branches(highest, lines.len(), |whole| match model.motion.degrees() {
        1 => Job::<1>::new(model, request, whole).run(lines, threads),
        _ => Job::<2>::new(model, request, whole).run(lines, threads),
    })
}

/// Does the work on so many lines up to a frequency with whole branches as one series, see `Job::new`, or else without:
/// a free resonance without damping can make the one denominator of a branch zero to the last bit.
pub(crate) fn with_branches<T>(
    highest: f64,
    lines: usize,
    work: impl Fn(Option<(f64, usize)>) -> Result<T>,
) -> Result<T> {
    match work(Some((highest, lines))) {
        Err(Error::Resonance { .. }) => work(None),
        other => other,
    }
}

/// Name of the instruction set that the kernels run on here.
pub fn instruction_set() -> String {
    format!("{:?}", Arch::new()).split('(').next().unwrap_or_default().to_owned()
}

impl<'a, const D: usize> Job<'a, D> {
    /// Prepares the data that the lines share.
    ///
    /// `whole` has the largest modulus of an angular frequency and the number of lines, where branches may be taken
    /// as one series.
    pub(crate) fn new(model: &Model, request: &'a Request, whole: Option<(f64, usize)>) -> Self {
        let mut job = Self {
            prepared: Prepared::new(model),
            plans: Vec::new(),
            loads: Vec::new(),
            excited: Vec::new(),
            observed: Vec::new(),
            gradients: request.parameters.iter().map(|p| Gradient::new(model, p)).collect(),
            differentiated: Vec::new(),
            uniform: Vec::new(),
            overlaps: Vec::new(),
            request,
            nodes: model.nodes,
            only_root: false,
            tip: None,
        };
        job.prepared.highest = whole.map_or(0.0, |(highest, _)| highest);
        for gradient in &job.gradients {
            if let Some(row) = gradient.segment().filter(|row| !job.differentiated.contains(row)) {
                job.differentiated.push(row);
                job.prepared.differentiated[row] = true;
            }
            job.uniform.extend(gradient.uniform().filter(|row| !job.uniform.contains(row)));
            if let Some((row, requested)) = gradient.overlap() {
                job.prepared.request(row, &requested);
                if !job.overlaps.contains(&row) {
                    job.overlaps.push(row);
                }
            }
        }
        job.excited = request.excitations.iter().map(|point| job.load(model, *point)).collect();
        if !job.gradients.is_empty() {
            job.observed = request.responses.iter().map(|point| job.load(model, *point)).collect();
        }
        job.only_root = job.gradients.is_empty()
            && request.joint.is_none()
            && job.plans.len() == 1
            && request.responses.iter().all(|point| point.node == job.plans[0].0);
        if let Some((highest, lines)) = whole {
            job.shorten(model, highest, lines);
        }
        for (_, plan) in &job.plans {
            job.prepared.follow(plan);
        }
        job
    }

    /// Takes branches in which nothing is observed or differentiated as a whole.
    fn shorten(&mut self, model: &Model, highest: f64, lines: usize) {
        let observed = |node: usize| {
            self.request.responses.iter().any(|point| point.node == node)
                || self.gradients.iter().any(|gradient| gradient.node() == Some(node))
                || model.has_terminal(node)
        };
        let joint = |row: usize| {
            self.request.joint == Some(row)
                || !self.request.added.is_empty()
                || self.gradients.iter().any(|gradient| gradient.joint() == Some(row))
        };
        let parts = Parts { model, segments: &self.prepared.segments, cones: &self.prepared.cones };
        let mut branches = Vec::new();
        for (_, plan) in &mut self.plans {
            // An observed node ends a branch at the step that would leave it behind.
            let needed = |step: &Step| match *step {
                Step::Leaf { node } | Step::Point { node } => observed(node),
                Step::Segment { row, far, .. } => observed(far) || self.differentiated.contains(&row),
                Step::Joint { row, far, .. } => observed(far) || joint(row),
                Step::Overlap { .. } | Step::Join | Step::Branch { .. } => true,
            };
            let whole = core::mem::take(plan);
            *plan = shorten(&parts, whole, highest, lines, needed, &mut branches);
        }
        let mut active = vec![false; model.segments.len()];
        for step in self.plans.iter().flat_map(|plan| &plan.1) {
            if let Step::Segment { row, .. } = step {
                active[*row] = true;
            }
        }
        if let (true, [(_, plan)]) = (self.only_root, &self.plans[..])
            && let [Step::Branch { .. }] = plan[..]
        {
            self.tip = branches.first().and_then(|branch| Tip::new(branch, self.request.directions()));
        }
        self.prepared.active = active;
        self.prepared.branches = branches;
    }

    /// The number of the load case at a coordinate, made if it is new.
    fn load(&mut self, model: &Model, coordinate: Coordinate) -> usize {
        if let Some(found) = self.loads.iter().position(|load| load.coordinate == coordinate) {
            return found;
        }
        let plan = match self.plans.iter().position(|plan| plan.0 == coordinate.node) {
            Some(plan) => plan,
            None => {
                self.plans.push((coordinate.node, model.plan(coordinate.node)));
                self.plans.len() - 1
            }
        };
        self.loads.push(Load { plan, coordinate });
        self.loads.len() - 1
    }

    /// Evaluates all lines.
    ///
    /// # Errors
    /// A line on which something is not finite.
    pub(crate) fn run(&self, lines: &Frequencies, threads: usize) -> Result<Response> {
        let [pairs, wide, forces] = self.a_line();
        let count = lines.len();
        // In new memory these zeros are not yet written: the threads that fill it share that work too.
        let zeros = |a_line: usize| bytemuck::zeroed_vec::<Complex64>(count * a_line);
        let (mut receptance, mut derivative, mut force) = (zeros(pairs), zeros(wide), zeros(forces));
        let arch = Arch::new();
        let tasks = lines
            .tasks()
            .into_iter()
            .zip(chunks(&mut receptance, pairs, count))
            .zip(chunks(&mut derivative, wide, count))
            .zip(chunks(&mut force, forces, count))
            .collect();
        let broken = on_threads(threads, tasks, self.a_task_takes(), |(((range, h), dh), force)| {
            if let Some(tip) = &self.tip {
                let finite = tip.fill(&arch, lines, range, h);
                return if finite { None } else { first_broken([(h, pairs), (dh, wide), (force, forces)]) };
            }
            let mut room = EMPTY;
            let by_line = self.by_line(&range, count);
            self.lines(&arch, lines.some(range, &mut room), by_line, h, dh, force)
        })?;
        first_of(&broken, lines)?;
        Ok(Response { receptance, derivative, force })
    }
}

impl<const D: usize> Job<'_, D> {
    /// Least time of a task [ns].
    pub(crate) fn a_task_takes(&self) -> f64 {
        let steps: usize = self.plans.iter().map(|(_, plan)| plan.len()).sum();
        let pairs = self.request.responses.len() * self.request.excitations.len();
        (LINES_PER_TASK * (steps + pairs * self.gradients.len())) as f64 * A_STEP
    }

    /// Numbers a line: receptances, derivatives, forces in the joint.
    fn a_line(&self) -> [usize; 3] {
        let pairs = self.request.responses.len() * self.request.excitations.len();
        let forces = if self.request.joint.is_some() { self.excited.len() * D } else { 0 };
        [pairs, pairs * self.gradients.len(), forces]
    }

    /// Data that differ from line to line on the lines of a task, of `count` lines.
    pub(crate) fn by_line(&self, lines: &Range<usize>, count: usize) -> ByLine<'_> {
        self.request.by_line().some(lines, count)
    }

    /// Evaluates the lines of one task; the first line that has no finite value, if there is one.
    pub(crate) fn lines(
        &self,
        arch: &Arch,
        w: &[Complex64],
        by_line: ByLine,
        h: &mut [Complex64],
        dh: &mut [Complex64],
        force: &mut [Complex64],
    ) -> Option<usize> {
        arch.dispatch(Lines { job: self, w, by_line, h: &mut *h, dh: &mut *dh, force: &mut *force });
        let [pairs, wide, forces] = self.a_line();
        first_broken([(h, pairs), (dh, wide), (force, forces)])
    }
}

/// The lines of one task.
struct Lines<'a, const D: usize> {
    job: &'a Job<'a, D>,
    w: &'a [Complex64],
    by_line: ByLine<'a>,
    h: &'a mut [Complex64],
    dh: &'a mut [Complex64],
    force: &'a mut [Complex64],
}

impl<const D: usize> WithSimd for Lines<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Lines { job, w, by_line, h, dh, force } = self;
        let mut block = Block::empty(simd);
        let mut records: Vec<Record<S, D>> = Vec::new();
        let mut fields: Vec<Field<S, D>> =
            job.loads.iter().map(|_| Field::empty(simd, job.nodes, &job.prepared)).collect();
        let mut sensitivities = Sensitivities::zeros(simd, &job.prepared);
        let within = Within { segments: !job.differentiated.is_empty(), overlaps: !job.overlaps.is_empty() };
        let mut next = 0;
        while next < w.len() {
            let start = next;
            let lines = together(&w[start..w.len().min(start + S::F64_LANES)]);
            next += lines.len();
            let own = by_line.some(&(start..next), w.len());
            job.prepared.block(simd, lines, false, own, &mut block);
            for (index, (root, plan)) in job.plans.iter().enumerate() {
                block.upwards(simd, plan, &job.prepared, &mut records, &mut Blind);
                let Some(top) = records.last() else { continue };
                let receptance = top.plane.receptance();
                for (load, field) in job.loads.iter().zip(&mut fields) {
                    if load.plan != index {
                        continue;
                    }
                    let direction = load.coordinate.direction;
                    let independent = top.plane.loaded(&receptance, direction.min(D - 1));
                    if job.only_root {
                        field.nodes[*root] = column(&receptance, direction.min(D - 1));
                    } else {
                        block.downwards(plan, &records, independent, within, field, *root);
                        field.nodes[*root] = column(&receptance, direction.min(D - 1));
                    }
                }
            }
            job.collect(&block, &fields, &mut sensitivities, lines.len(), start, h, dh);
            if let Some(row) = job.request.joint {
                job.collect_force(row, &fields, lines.len(), start, force);
            }
        }
    }
}

impl<const D: usize> Job<'_, D> {
    /// Writes the force in a joint under each excitation.
    #[inline(always)]
    fn collect_force<S: Simd>(
        &self,
        row: usize,
        fields: &[Field<S, D>],
        lines: usize,
        start: usize,
        force: &mut [Complex64],
    ) {
        let mut lanes = [Complex64::ZERO; MAX_LANES];
        for (load, &excited) in self.excited.iter().enumerate() {
            for i in 0..D {
                fields[excited].joints[row].force[i].store(&mut lanes);
                for lane in 0..lines {
                    force[((start + lane) * self.excited.len() + load) * D + i] = lanes[lane];
                }
            }
        }
    }

    /// Writes the entries of one block of lines.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn collect<S: Simd>(
        &self,
        block: &Block<S, D>,
        fields: &[Field<S, D>],
        sensitivities: &mut Sensitivities<S, D>,
        lines: usize,
        start: usize,
        h: &mut [Complex64],
        dh: &mut [Complex64],
    ) {
        let (rows, columns) = (self.request.responses.len(), self.request.excitations.len());
        let parameters = self.gradients.len();
        let mut lanes = [Complex64::ZERO; MAX_LANES];
        for (i, response) in self.request.responses.iter().enumerate() {
            for (j, &excited) in self.excited.iter().enumerate() {
                let right = &fields[excited];
                let pair = i * columns + j;
                right.nodes[response.node][response.direction.min(D - 1)].store(&mut lanes);
                for lane in 0..lines {
                    h[(start + lane) * rows * columns + pair] = lanes[lane];
                }
                if parameters == 0 {
                    continue;
                }
                let left = &fields[self.observed[i]];
                for &row in &self.uniform {
                    let (left, right) = (&left.states[row], &right.states[row]);
                    sensitivities.segments[row] =
                        derivatives::segment(&self.prepared, row, block, left, right);
                }
                for &row in &self.overlaps {
                    let (left, right) = (&left.overlaps[row], &right.overlaps[row]);
                    let overlap = &self.prepared.overlaps[row];
                    sensitivities.overlaps[row] =
                        block.overlaps[row].derivatives(block.w2, overlap, left, right);
                }
                for (k, gradient) in self.gradients.iter().enumerate() {
                    gradient.evaluate(&self.prepared, block, left, right, sensitivities).store(&mut lanes);
                    for lane in 0..lines {
                        let line = (start + lane) * rows * columns + pair;
                        dh[line * parameters + k] = lanes[lane];
                    }
                }
            }
        }
    }
}

/// Lines of like frequency from the first on: those far apart need kernels and charts of their own.
fn together(lines: &[Complex64]) -> &[Complex64] {
    let like = |line: &&Complex64| {
        let ratio = line.norm_sqr() / lines[0].norm_sqr();
        (1.0 / MOST_APART..=MOST_APART).contains(&ratio)
    };
    &lines[..lines.iter().take_while(like).count().max(1)]
}

/// An error for the first line without a value, given that line of each task that has one.
pub(crate) fn first_of(broken: &[Option<usize>], lines: &Frequencies) -> Result<()> {
    let found =
        broken.iter().enumerate().find_map(|(task, line)| line.map(|line| task * LINES_PER_TASK + line));
    match found {
        Some(line) => {
            let frequency_hz = lines.angular(line).re / core::f64::consts::TAU;
            Err(Error::Resonance { line, frequency_hz })
        }
        None => Ok(()),
    }
}

/// The first line of a task with a value that is not finite, the values of a line standing together.
pub(crate) fn first_broken(outputs: [(&mut [Complex64], usize); 3]) -> Option<usize> {
    let lines = outputs.into_iter().filter_map(|(values, a_line)| {
        // All of them without a branch, as nearly always all are finite.
        if values.iter().fold(true, |finite, value| finite & value.re.is_finite() & value.im.is_finite()) {
            return None;
        }
        values.iter().position(|value| !value.is_finite()).map(|index| index / a_line)
    });
    lines.min()
}

/// The parts of an output that belong to each task, empty ones where there is nothing a line.
pub(crate) fn chunks(values: &mut [Complex64], a_line: usize, lines: usize) -> Vec<&mut [Complex64]> {
    if a_line == 0 {
        return (0..lines.div_ceil(LINES_PER_TASK)).map(|_| Default::default()).collect();
    }
    values.chunks_mut(LINES_PER_TASK * a_line).collect()
}
