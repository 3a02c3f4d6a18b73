//! Sweeps over the graph for a block of frequency lines: planes upwards to the root, states back down.

use crate::line::block::{Block, Prepared};
use crate::line::combine::{JointState, Kind, add_beyond, add_diagonal, in_joint, join};
use crate::line::kernel::{Kernel, Way, oriented};
use crate::line::overlap::{Passed, States, Wanted};
use crate::line::plane::Plane;
use crate::model::assembly::Step;
use crate::simd::lane::C;
use crate::simd::small::{self, Mat};
use pulp::Simd;

/// Weights that differ by more than this factor need charts of their own.
const MOST_WEIGHTS_APART: f64 = 100.0;

/// The plane after a step, and the way back: the independent variables before it from those after it. A join has two
/// records of one plane: the way back to the branch that was swept first, then that to the other one.
#[derive(Copy, Clone)]
pub struct Record<S: Simd, const D: usize> {
    /// The plane after the step.
    pub plane: Plane<S, D>,
    /// Independent variables of the plane before, from those of this plane.
    pub back: Mat<S, D>,
    /// The weights by which the chart was chosen.
    pub weights: [f64; D],
}

impl<S: Simd, const D: usize> Record<S, D> {
    /// Two branches on one node, the second being the one that was swept last.
    #[inline(always)]
    fn join(first: &Plane<S, D>, second: &Plane<S, D>, weights: [f64; D]) -> [Self; 2] {
        let (plane, [other, back]) = join(first, second, &weights);
        [Self { plane, back: other, weights }, Self { plane, back, weights }]
    }
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
    /// Force and relative motion of each joint.
    pub joints: Vec<JointState<S, D>>,
    /// States at the ends of the pieces of each segment, from smaller to larger x; empty if not requested.
    pub states: Vec<Vec<State<S, D>>>,
    /// States within each overlap; empty if not requested.
    pub overlaps: Vec<States<S>>,
    /// Loads on the plane beyond each terminal.
    pub terminals: Vec<[C<S>; D]>,
}

/// States requested on the way back.
#[derive(Copy, Clone, PartialEq, Eq)]
pub struct Within {
    /// Those of the segments.
    pub segments: bool,
    /// Those of the overlaps.
    pub overlaps: bool,
}

/// Observer of each elimination of a node on the way up.
pub trait Observer<S: Simd, const D: usize> {
    /// A node was passed: its plane's basis (u and f rows), the near node's u rows, and what of the elements between gives
    /// these: `uu` (near u per far u) and the compliance `uf` (near u per far load).
    fn passed(&mut self, far: [&Mat<S, D>; 2], near_u: &Mat<S, D>, between: [&Mat<S, D>; 2]);

    /// Output of overlaps requested besides the plane.
    fn wanted(&self) -> Wanted {
        Wanted::Plane
    }

    /// An overlap was passed: the u rows of the structure behind and of the near beam, and the way.
    fn overlapped(&mut self, _: &Mat<S, D>, _: &Mat<S, D>, _: &Passed<S>) {}
}

/// Observes nothing.
pub struct Blind;

impl<S: Simd, const D: usize> Observer<S, D> for Blind {
    #[inline(always)]
    fn passed(&mut self, _: [&Mat<S, D>; 2], _: &Mat<S, D>, _: [&Mat<S, D>; 2]) {}
}

impl<S: Simd, const D: usize> Field<S, D> {
    /// A field to be filled.
    pub fn empty(simd: S, nodes: usize, prepared: &Prepared<D>) -> Self {
        let zero = [C::zero(simd); D];
        let (joints, segments) = (prepared.joints.len(), prepared.segments.len());
        let overlaps = prepared.overlaps.len();
        Self {
            nodes: vec![zero; nodes],
            joints: vec![JointState { force: zero, gap: zero }; joints],
            states: (0..segments).map(|_| Vec::new()).collect(),
            overlaps: (0..overlaps).map(|_| States::empty()).collect(),
            terminals: vec![zero; prepared.terminals.len()],
        }
    }
}

impl<S: Simd, const D: usize> Block<S, D> {
    /// Pivot weights of the first segment, which stand for the model where no segment is near.
    pub fn weights_of_first(&self) -> [f64; D] {
        self.weights.first().copied().unwrap_or([1.0; D])
    }

    /// Sweeps from the free ends to the root; the last record holds the root's plane.
    #[inline(always)]
    pub fn upwards(
        &mut self,
        simd: S,
        plan: &[Step],
        prepared: &Prepared<D>,
        records: &mut Vec<Record<S, D>>,
        observer: &mut impl Observer<S, D>,
    ) {
        records.clear();
        // Results of finished branches; the current one is always the last record.
        let mut waiting = Vec::new();
        let mut weights = self.weights_of_first();
        let zero = small::zeros(simd);
        for (index, step) in plan.iter().enumerate() {
            // The chart must suit the next segment: beside far stiffer elements before it, a nearly singular joint
            // keeps one row only.
            let next = plan[index..].iter().find_map(|step| match step {
                Step::Segment { row, .. } => Some(self.weights[*row]),
                Step::Overlap { row, forward, .. } => Some(self.overlaps[*row].weights_behind(*forward)),
                _ => None,
            });
            weights = next.unwrap_or(weights);
            let plane = match records.last() {
                Some(record) => record.plane,
                None => Plane::free(simd),
            };
            match *step {
                Step::Leaf { .. } => {
                    if !records.is_empty() {
                        waiting.push(plane);
                    }
                    records.push(Record { plane: Plane::free(simd), back: zero, weights });
                }
                Step::Segment { row, forward, .. } => {
                    self.through_segment(row, forward, plane, records, observer);
                }
                Step::Overlap { row, forward, .. } => {
                    self.through_overlap(row, forward, plane, prepared, records, observer);
                }
                Step::Joint { row, .. } => {
                    let (u, f, compliance) = self.centres[row].before(&plane);
                    let near_u = small::mul_add(&compliance, &f, &u);
                    observer.passed([&u, &f], &near_u, [&small::identity(simd), &compliance]);
                    let (plane, back) = if self.coupled[row] {
                        add_beyond(&plane, &self.centres[row], Kind::Compliance, &weights)
                    } else {
                        add_diagonal(&plane, &self.centres[row].compliance, Kind::Compliance, &weights)
                    };
                    records.push(Record { plane, back, weights });
                }
                Step::Point { node } => {
                    if let Some(points) = &self.points[node] {
                        // Matrices that are diagonal elsewhere come first: the load of a heavy mass, moved there and back, would
                        // take the digits of the small loads behind the node.
                        let (mut plane, mut back) = (plane, small::identity(simd));
                        for centre in &points.beyond {
                            let (next, step) = add_beyond(&plane, centre, Kind::Impedance, &weights);
                            plane = next;
                            back = small::mul(&back, &step);
                        }
                        let (next, step) = add_diagonal(&plane, &points.impedance, Kind::Impedance, &weights);
                        plane = next;
                        back = small::mul(&back, &step);
                        if let Some(coupling) = points.coupling {
                            let (next, step) = plane.coupled(coupling, &weights);
                            plane = next;
                            back = small::mul(&back, &step);
                        }
                        records.push(Record { plane, back, weights });
                    }
                    if let Some((_, beyond)) = self.terminals.iter().find(|one| one.0 == node) {
                        let plane = records.last().map_or(plane, |record| record.plane);
                        records.extend(Record::join(beyond, &plane, weights));
                    }
                }
                Step::Branch { index } => {
                    if !records.is_empty() {
                        waiting.push(plane);
                    }
                    let branch = &prepared.branches[index];
                    weights = branch.weights(self.most);
                    let minors = branch.minors(simd, self.w2, self.real);
                    let plane = Plane::from_minors(minors, &weights);
                    records.push(Record { plane, back: zero, weights });
                }
                Step::Join => {
                    let first = waiting.pop().unwrap_or(plane);
                    records.extend(Record::join(&first, &plane, weights));
                }
            }
        }
    }

    /// The plane before an overlap becomes the one after it.
    #[inline(always)]
    fn through_overlap(
        &mut self,
        row: usize,
        forward: bool,
        plane: Plane<S, D>,
        prepared: &Prepared<D>,
        records: &mut Vec<Record<S, D>>,
        observer: &mut impl Observer<S, D>,
    ) {
        let (overlap, wanted) = (&mut self.overlaps[row], observer.wanted());
        let weights: [f64; D] = overlap.weights_behind(!forward);
        let (near, back, passed) = overlap.pass(&prepared.overlaps[row], &plane, forward, wanted);
        if wanted != Wanted::Plane {
            observer.overlapped(&plane.basis().0, &passed.near_u(), &passed);
        }
        records.push(Record { plane: near, back, weights });
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
        let Kernel { way, transfer, wave, slices, .. } = &self.kernels[row];
        match way {
            Way::Skipped => {}
            Way::Pieces { .. } | Way::Slices { .. } => {
                // As for the waves below: elements behind a far lighter segment are in a chart of their own scale.
                let before = records.last().map(|record| record.weights).unwrap_or(*weights);
                let (far, first) = (far_apart(&before, weights), records.len());
                let mut rechart = small::identity(self.iw.simd);
                if far {
                    (plane, rechart) = plane.weighted(weights);
                }
                if let Way::Pieces { count, .. } = way {
                    let (uu, uf) = (oriented(&transfer.uu, forward), oriented(&transfer.uf, forward));
                    let (fu, ff) = (oriented(&transfer.fu, forward), oriented(&transfer.ff, forward));
                    for _ in 0..*count {
                        plane = through_piece(&plane, [&uu, &uf, &fu, &ff], weights, records, observer);
                    }
                } else {
                    for index in 0..slices.len() {
                        let slice = &slices[if forward { slices.len() - 1 - index } else { index }];
                        let [uu, uf, fu, ff] = along_slice(slice, forward);
                        plane = through_piece(&plane, [&uu, &uf, &fu, &ff], weights, records, observer);
                    }
                }
                if far {
                    records[first].back = small::mul(&rechart, &records[first].back);
                }
            }
            Way::Waves => {
                let [(away_u, away_f), (back_u, back_f)] = wave.oriented(forward);
                // Elements behind may be far lighter or stiffer; in a chart that suits this segment its
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
                records.push(Record { plane: next, back, weights: *weights });
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
        within: Within,
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
                    let pieces = self.kernels[row].steps();
                    if within.segments {
                        field.states[row].clear();
                        field.states[row].push(cut(&records[at].plane, &independent, forward));
                    }
                    for _ in 0..pieces {
                        independent = small::apply(&records[at].back, &independent);
                        at -= 1;
                        if within.segments {
                            field.states[row].push(cut(&records[at].plane, &independent, forward));
                        }
                    }
                    if within.segments && !forward {
                        field.states[row].reverse();
                    }
                    field.nodes[far] = records[at].plane.state(&independent).0;
                }
                Step::Overlap { row, forward, far } => {
                    let behind = &records[at - 1].plane;
                    if within.overlaps {
                        self.overlaps[row].states(forward, &independent, &mut field.overlaps[row]);
                    }
                    independent = small::apply(&records[at].back, &independent);
                    at -= 1;
                    field.nodes[far] = behind.state(&independent).0;
                }
                Step::Joint { row, forward, far } => {
                    let weights = records[at].weights;
                    let (before, after) = (&records[at - 1].plane, &records[at].plane);
                    let found = in_joint(
                        before,
                        &self.centres[row],
                        self.coupled[row],
                        after,
                        &independent,
                        &weights,
                    );
                    let sign = if forward { 1.0 } else { -1.0 };
                    field.joints[row] =
                        JointState { force: scaled(found.force, sign), gap: scaled(found.gap, sign) };
                    independent = small::apply(&records[at].back, &independent);
                    at -= 1;
                    field.nodes[far] = records[at].plane.state(&independent).0;
                }
                Step::Point { node } => {
                    if let Some(row) = self.terminals.iter().position(|one| one.0 == node) {
                        field.terminals[row] = small::apply(&records[at - 1].back, &independent);
                        independent = small::apply(&records[at].back, &independent);
                        at -= 2;
                    }
                    if self.points[node].is_some() {
                        independent = small::apply(&records[at].back, &independent);
                        at -= 1;
                    }
                }
                Step::Join => {
                    stack.push(small::apply(&records[at - 1].back, &independent));
                    independent = small::apply(&records[at].back, &independent);
                    at -= 2;
                }
            }
        }
    }
}

/// The plane before a piece becomes the one after it.
#[inline(always)]
fn through_piece<S: Simd, const D: usize>(
    plane: &Plane<S, D>,
    [uu, uf, fu, ff]: [&Mat<S, D>; 4],
    weights: &[f64; D],
    records: &mut Vec<Record<S, D>>,
    observer: &mut impl Observer<S, D>,
) -> Plane<S, D> {
    let (u, f) = plane.basis();
    let near_u = small::mul_add(uf, &f, &small::mul(uu, &u));
    let near_f = small::mul_add(ff, &f, &small::mul(fu, &u));
    observer.passed([&u, &f], &near_u, [uu, uf]);
    let (next, back) = Plane::pivot(&near_u, &near_f, weights);
    records.push(Record { plane: next, back, weights: *weights });
    next
}

/// (u, f) at the near end of a slice from that at its far end, out of the matrices T of its state along x.
///
/// Against x they are T, the load on what is behind the cut being the internal force. Along x it is minus the internal
/// force, and T is inverted as a symplectic matrix: the blocks are transposed.
#[inline(always)]
fn along_slice<S: Simd, const D: usize>(slice: &[Mat<S, D>; 4], forward: bool) -> [Mat<S, D>; 4] {
    if !forward {
        return *slice;
    }
    let mut out = *slice;
    for (block, from) in [3, 1, 2, 0].into_iter().enumerate() {
        for i in 0..D {
            for j in 0..D {
                out[block][i][j] = slice[from][j][i];
            }
        }
    }
    out
}

/// Whether charts that suit the one weights may cost digits under the others.
#[inline(always)]
fn far_apart<const D: usize>(before: &[f64; D], after: &[f64; D]) -> bool {
    let mut far = false;
    for i in 0..D {
        let ratio = before[i] / after[i];
        far |= !(1.0 / MOST_WEIGHTS_APART..=MOST_WEIGHTS_APART).contains(&ratio);
    }
    far
}

/// The state at a cut, its internal forces oriented along x.
#[inline(always)]
fn cut<S: Simd, const D: usize>(plane: &Plane<S, D>, independent: &[C<S>; D], forward: bool) -> State<S, D> {
    let (u, f) = plane.state(independent);
    // The load on the elements behind the cut is minus the internal force where that is at larger x.
    let sign = if forward { -1.0 } else { 1.0 };
    State { u, n: scaled(f, sign) }
}

/// A vector times a real number.
#[inline(always)]
fn scaled<S: Simd, const D: usize>(mut vector: [C<S>; D], factor: f64) -> [C<S>; D] {
    for entry in &mut vector {
        *entry = entry.scale(factor);
    }
    vector
}
