//! Sweeps over the graph for a block of frequency lines: planes upwards to the root, states back down.

use crate::branch::Branch;
use crate::kernel::{Choice, Kernel, Segment, oriented};
use crate::lane::C;
use crate::model::{Model, Spring, Step};
use crate::plane::{Added, Plane};
use crate::small::{self, Mat};
use num_complex::Complex64;
use pulp::Simd;

/// What the sweeps need of a model, prepared once for all lines.
pub struct Prepared<const D: usize> {
    /// Segments with their coefficients.
    pub segments: Vec<Segment<D>>,
    /// Springs of the joints.
    pub joints: Vec<Spring>,
    /// Inertia and springs of each node that has any.
    points: Vec<(Vec<[f64; 2]>, Vec<Spring>)>,
    /// Branches taken as a whole.
    pub branches: Vec<Branch<D>>,
    /// Segments that are taken one by one.
    pub active: Vec<bool>,
}

/// Everything of the model at a block of frequency lines.
pub struct Block<S: Simd, const D: usize> {
    /// i w.
    pub iw: C<S>,
    /// w^2.
    pub w2: C<S>,
    /// The largest |w|^2 of the lines.
    most: f64,
    /// Whether all lines are real.
    real: bool,
    /// The kernel of each segment.
    pub kernels: Vec<Kernel<S, D>>,
    /// The choice behind each kernel.
    pub choices: Vec<Choice>,
    /// Pivot weights of each segment.
    weights: Vec<[f64; D]>,
    /// Compliance of each joint.
    pub compliances: Vec<Mat<S, D>>,
    /// Where each joint's stiffness is diagonal (beyond the node, along x), and its compliances there; no
    /// place where it is diagonal at the node itself.
    centres: Vec<Option<(C<S>, Mat<S, D>)>>,
    /// Impedance of the point elements of each node, and whether it couples translation and rotation.
    points: Vec<Option<(Mat<S, D>, bool)>>,
}

/// The plane after a step, and the way back: the independent variables before it from those after it.
#[derive(Copy, Clone)]
pub struct Record<S: Simd, const D: usize> {
    /// The plane after the step.
    pub plane: Plane<S, D>,
    /// Independent variables of the plane before, from those of this plane.
    pub back: Mat<S, D>,
    /// The same for the other branch of a join.
    pub other: Mat<S, D>,
}

/// Displacements and internal forces at a cut (for rods one of each), the forces oriented along x.
#[derive(Copy, Clone)]
pub struct State<S: Simd, const D: usize> {
    /// Displacements.
    pub u: [C<S>; D],
    /// Internal forces.
    pub n: [C<S>; D],
}

/// The response of the whole assembly to one unit load.
pub struct Field<S: Simd, const D: usize> {
    /// Displacements of each node.
    pub nodes: Vec<[C<S>; D]>,
    /// Force from the first on the second node of each joint.
    pub joints: Vec<[C<S>; D]>,
    /// States at the ends of the pieces of each segment, from smaller to larger x; empty if not asked for.
    pub states: Vec<Vec<State<S, D>>>,
}

impl Spring {
    /// Whether translation and rotation are coupled.
    pub fn couples(&self) -> bool {
        self.k[2] != 0.0 || self.c[2] != 0.0
    }

    /// The dynamic stiffness (1 + i eta) k + i w c.
    #[inline(always)]
    pub fn stiffness<S: Simd, const D: usize>(&self, simd: S, iw: C<S>) -> Mat<S, D> {
        let mut out = small::zeros(simd);
        for i in 0..D {
            for j in 0..D {
                let entry = if i == j { i } else { 2 };
                let k = Complex64::new(self.k[entry], self.k[entry] * self.loss_factor);
                out[i][j] = C::real(simd, self.c[entry]).mul_add(iw, C::splat(simd, k));
            }
        }
        out
    }
}

impl<const D: usize> Prepared<D> {
    /// Prepares a model.
    pub fn new(model: &Model) -> Self {
        let mut points = vec![(Vec::new(), Vec::new()); model.nodes];
        for (node, inertia) in &model.masses {
            points[*node].0.push(*inertia);
        }
        for (node, spring) in &model.grounds {
            points[*node].1.push(*spring);
        }
        Self {
            segments: model.segments.iter().map(|row| Segment::new(row, model.motion)).collect(),
            joints: model.joints.iter().map(|joint| joint.1).collect(),
            points,
            branches: Vec::new(),
            active: vec![true; model.segments.len()],
        }
    }

    /// Evaluates the elements at the lines `w`, at most one a lane. `pieces_only` keeps to the series.
    #[inline(always)]
    pub fn block<S: Simd>(&self, simd: S, w: &[Complex64], pieces_only: bool, into: &mut Block<S, D>) {
        let line = C::load(simd, w);
        into.most = w.iter().fold(0.0_f64, |most, w| most.max(w.norm_sqr()));
        into.real = w.iter().all(|w| w.im == 0.0);
        into.iw = line.times_i();
        into.w2 = line * line;
        for (row, segment) in self.segments.iter().enumerate() {
            if into.kernels.len() <= row {
                into.kernels.push(Kernel::Skipped);
                into.choices.push(Choice::Waves);
                into.weights.push(segment.weights(segment.wave_number_square(into.most)));
            }
            if self.active[row] {
                let (choice, weights) = segment.choose(w, into.most, pieces_only);
                into.choices[row] = choice;
                into.weights[row] = weights;
                into.kernels[row] = segment.kernel(simd, choice, w, into.w2);
            }
        }
        into.compliances.clear();
        into.centres.clear();
        for joint in &self.joints {
            let stiffness = joint.stiffness::<S, D>(simd, into.iw);
            into.compliances.push(small::inverse(&stiffness));
            into.centres.push((D == 2 && joint.couples()).then(|| centre(&stiffness)));
        }
        into.points.clear();
        for (masses, springs) in &self.points {
            if masses.is_empty() && springs.is_empty() {
                into.points.push(None);
                continue;
            }
            let mut impedance = small::zeros::<S, D>(simd);
            for spring in springs {
                let stiffness = spring.stiffness::<S, D>(simd, into.iw);
                for i in 0..D {
                    for j in 0..D {
                        impedance[i][j] = impedance[i][j] + stiffness[i][j];
                    }
                }
            }
            for inertia in masses {
                for i in 0..D {
                    impedance[i][i] = impedance[i][i] - into.w2.scale(inertia[i]);
                }
            }
            into.points.push(Some((impedance, springs.iter().any(Spring::couples))));
        }
    }
}

/// Sees each elimination of a node on the way up.
pub trait Observer<S: Simd, const D: usize> {
    /// A node was passed: its plane's basis (u rows), the near node's u rows, and the compliance `uf` of
    /// what lies between (near u per far load).
    fn passed(&mut self, far_u: &Mat<S, D>, near_u: &Mat<S, D>, compliance: &Mat<S, D>);
}

/// Looks at nothing.
pub struct Blind;

impl<S: Simd, const D: usize> Observer<S, D> for Blind {
    #[inline(always)]
    fn passed(&mut self, _: &Mat<S, D>, _: &Mat<S, D>, _: &Mat<S, D>) {}
}

impl<S: Simd, const D: usize> Block<S, D> {
    /// A block to be filled.
    pub fn empty(simd: S) -> Self {
        Self {
            iw: C::zero(simd),
            w2: C::zero(simd),
            most: 0.0,
            real: true,
            kernels: Vec::new(),
            choices: Vec::new(),
            weights: Vec::new(),
            compliances: Vec::new(),
            centres: Vec::new(),
            points: Vec::new(),
        }
    }

    /// Pivot weights of the first segment, which stand for the model where no segment is near.
    pub fn weights_of_first(&self) -> [f64; D] {
        self.weights.first().copied().unwrap_or([1.0; D])
    }

    /// Sweeps from the free ends to the root; the last record holds the root's plane.
    #[inline(always)]
    pub fn upwards(
        &self,
        simd: S,
        plan: &[Step],
        branches: &[Branch<D>],
        records: &mut Vec<Record<S, D>>,
        observer: &mut impl Observer<S, D>,
    ) {
        records.clear();
        // Results of finished branches; the current one is always the last record.
        let mut waiting = Vec::new();
        let mut weights = self.weights_of_first();
        let zero = small::zeros(simd);
        for step in plan {
            let current = records.last().map(|record| record.plane);
            let plane = current.unwrap_or(Plane::free(simd));
            match *step {
                Step::Leaf { .. } => {
                    if !records.is_empty() {
                        waiting.push(plane);
                    }
                    records.push(Record { plane: Plane::free(simd), back: zero, other: zero });
                }
                Step::Segment { row, forward, .. } => {
                    weights = self.weights[row];
                    self.through_segment(row, forward, plane, records, observer);
                }
                Step::Joint { row, .. } => {
                    let (u, f) = plane.basis();
                    let near_u = small::mul_add(&self.compliances[row], &f, &u);
                    observer.passed(&u, &near_u, &self.compliances[row]);
                    let (plane, back) = match &self.centres[row] {
                        Some((offset, compliance)) => add_beyond(&plane, *offset, compliance, &weights),
                        None => add_diagonal(&plane, &self.compliances[row], Added::Compliance, &weights),
                    };
                    records.push(Record { plane, back, other: zero });
                }
                Step::Point { node } => {
                    if let Some((impedance, coupled)) = &self.points[node] {
                        let (plane, back) = if *coupled {
                            let (u, f) = plane.basis();
                            let f = small::mul_add(impedance, &u, &f);
                            Plane::pivot(&u, &f, &weights)
                        } else {
                            add_diagonal(&plane, impedance, Added::Impedance, &weights)
                        };
                        records.push(Record { plane, back, other: zero });
                    }
                }
                Step::Branch { index } => {
                    if !records.is_empty() {
                        waiting.push(plane);
                    }
                    let (plane, near) = branches[index].plane(simd, self.w2, self.real, self.most);
                    weights = near;
                    records.push(Record { plane, back: zero, other: zero });
                }
                Step::Join => {
                    let first = waiting.pop().unwrap_or(plane);
                    records.push(join(&first, &plane, &weights));
                }
            }
        }
    }

    #[inline(always)]
    fn through_segment(
        &self,
        row: usize,
        forward: bool,
        mut plane: Plane<S, D>,
        records: &mut Vec<Record<S, D>>,
        observer: &mut impl Observer<S, D>,
    ) {
        let weights = &self.weights[row];
        match &self.kernels[row] {
            Kernel::Skipped => {}
            Kernel::Pieces { count, transfer } => {
                let (uu, uf) = (oriented(&transfer.uu, forward), oriented(&transfer.uf, forward));
                let (fu, ff) = (oriented(&transfer.fu, forward), oriented(&transfer.ff, forward));
                for _ in 0..*count {
                    let (u, f) = plane.basis();
                    let near_u = small::mul_add(&uf, &f, &small::mul(&uu, &u));
                    let near_f = small::mul_add(&ff, &f, &small::mul(&fu, &u));
                    observer.passed(&u, &near_u, &uf);
                    let (next, back) = Plane::pivot(&near_u, &near_f, weights);
                    records.push(Record { plane: next, back, other: back });
                    plane = next;
                }
            }
            Kernel::Waves(wave) => {
                let [(away_u, away_f), (back_u, back_f)] = wave.oriented(forward);
                // What lies behind may be far lighter or stiffer; in a chart that suits this segment its
                // small loads or motions are not differences of large waves.
                let (plane, rechart) = plane.weighted(weights);
                // At the far end the waves that arrive have decayed and those that return have amplitude
                // one: dependent - x independent = 0 gives the reflection.
                let (in_away, dep_away) = plane.split(&away_u, &away_f);
                let (in_back, dep_back) = plane.split(&back_u, &back_f);
                let minus_x = small::scale(&plane.x, C::real(self.iw.simd, -1.0));
                let arriving = small::mul_add(&minus_x, &in_away, &dep_away);
                let returning = small::mul_add(&minus_x, &in_back, &dep_back);
                let mut reflection = small::mul(&small::inverse(&returning), &arriving);
                let (mut echo, mut arrived) = (reflection, in_away);
                for i in 0..D {
                    for j in 0..D {
                        reflection[i][j] = -(reflection[i][j] * wave.decay[j]);
                        echo[i][j] = reflection[i][j] * wave.decay[i];
                        arrived[i][j] = in_away[i][j] * wave.decay[j];
                    }
                }
                let near_u = small::mul_add(&back_u, &echo, &away_u);
                let near_f = small::mul_add(&back_f, &echo, &away_f);
                let far = small::mul_add(&in_back, &reflection, &arrived);
                let (next, coordinates) = Plane::pivot(&near_u, &near_f, weights);
                let back = small::mul(&rechart, &small::mul(&far, &coordinates));
                records.push(Record { plane: next, back, other: back });
            }
        }
    }

    /// From the root's independent variables (one column a load) back to every node and cut.
    #[inline(always)]
    pub fn downwards(
        &self,
        plan: &[Step],
        records: &[Record<S, D>],
        root: [C<S>; D],
        with_states: bool,
        field: &mut Field<S, D>,
        root_node: usize,
    ) {
        let mut stack = Vec::new();
        let mut independent = root;
        let mut at = records.len() - 1;
        field.nodes[root_node] = records[at].plane.state(&root).0;
        for step in plan.iter().rev() {
            match *step {
                Step::Leaf { .. } | Step::Branch { .. } => {
                    // The sibling branch, whose last record comes just before this leaf's.
                    if let Some(next) = stack.pop() {
                        independent = next;
                        at = at.wrapping_sub(1);
                    }
                }
                Step::Segment { row, forward, far } => {
                    let pieces = match &self.kernels[row] {
                        Kernel::Pieces { count, .. } => *count,
                        Kernel::Waves(_) | Kernel::Skipped => 1,
                    };
                    if with_states {
                        field.states[row].clear();
                        field.states[row].push(cut(&records[at].plane, &independent, forward));
                    }
                    for _ in 0..pieces {
                        independent = small::apply(&records[at].back, &independent);
                        at -= 1;
                        if with_states {
                            field.states[row].push(cut(&records[at].plane, &independent, forward));
                        }
                    }
                    if with_states && !forward {
                        field.states[row].reverse();
                    }
                    field.nodes[far] = records[at].plane.state(&independent).0;
                }
                Step::Joint { row, forward, far } => {
                    let sign = if forward { 1.0 } else { -1.0 };
                    field.joints[row] = records[at].plane.state(&independent).1.map(|f| f.scale(sign));
                    independent = small::apply(&records[at].back, &independent);
                    at -= 1;
                    field.nodes[far] = records[at].plane.state(&independent).0;
                }
                Step::Point { node } => {
                    if self.points[node].is_some() {
                        independent = small::apply(&records[at].back, &independent);
                        at -= 1;
                    }
                }
                Step::Join => {
                    stack.push(small::apply(&records[at].other, &independent));
                    independent = small::apply(&records[at].back, &independent);
                    at -= 1;
                }
            }
        }
    }
}

/// The state at a cut, its internal forces oriented along x.
#[inline(always)]
fn cut<S: Simd, const D: usize>(plane: &Plane<S, D>, independent: &[C<S>; D], forward: bool) -> State<S, D> {
    let (u, f) = plane.state(independent);
    // The load on what lies behind the cut is minus the internal force where that is at larger x.
    let sign = if forward { -1.0 } else { 1.0 };
    State { u, n: f.map(|f| f.scale(sign)) }
}

/// Adds a diagonal impedance or compliance, one degree of freedom after the other.
#[inline(always)]
fn add_diagonal<S: Simd, const D: usize>(
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
fn centre<S: Simd, const D: usize>(stiffness: &Mat<S, D>) -> (C<S>, Mat<S, D>) {
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
fn add_beyond<S: Simd, const D: usize>(
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
fn join<S: Simd, const D: usize>(
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
