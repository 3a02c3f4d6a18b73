//! The elements of a model on a block of frequency lines.

use crate::line::combine::Centre;
use crate::line::kernel::Kernel;
use crate::line::layer::DERIVATIVES;
use crate::line::overlap::Lanes;
use crate::line::plane::Plane;
use crate::model::assembly::{Model, Step};
use crate::model::cone::Cone;
use crate::model::overlap::Beside;
use crate::model::request::ByLine;
use crate::model::section::Segment;
use crate::model::spring::Spring;
use crate::model::terminals::{Mode, TERMINAL_ENTRIES, Terminal};
use crate::series::branch::Branch;
use crate::simd::lane::{C, MAX_LANES};
use crate::simd::small::{self, Mat};
use num_complex::Complex64;
use pulp::Simd;

/// Data of a model for the sweeps, prepared once for all lines.
pub struct Prepared<const D: usize> {
    /// Segments with their coefficients.
    pub segments: Vec<Segment<D>>,
    /// The series of each segment that is a cone.
    pub cones: Vec<Option<Cone<D>>>,
    /// Largest |w| of the lines to come, where it is known: cones have one division for all of them.
    pub highest: f64,
    /// Springs of the joints.
    pub joints: Vec<Spring>,
    /// Change of the stiffness of each joint by slip at its stated level.
    added: Vec<[Complex64; 2]>,
    /// Inertia and springs of each node that has any.
    points: Vec<(Vec<[f64; 2]>, Vec<Spring>)>,
    /// Branches taken as a whole.
    pub branches: Vec<Branch<D>>,
    /// Segments that are taken one by one.
    pub active: Vec<bool>,
    /// Segments whose coefficients or length are differentiated.
    pub differentiated: Vec<bool>,
    /// Overlaps.
    pub overlaps: Vec<Beside>,
    /// Terminals.
    pub terminals: Vec<Terminal>,
    /// Their modes, each with the row of its terminal.
    modes: Vec<(usize, Mode)>,
    /// Whether each overlap is passed with its inner, and with its outer beam lying behind.
    ways: Vec<[bool; 2]>,
    /// Requested derivatives by the coefficients of each overlap.
    requested: Vec<[bool; DERIVATIVES]>,
}

/// Everything of the model at a block of frequency lines.
pub struct Block<S: Simd, const D: usize> {
    /// i w.
    pub iw: C<S>,
    /// w^2.
    pub w2: C<S>,
    /// The largest |w|^2 of the lines.
    pub most: f64,
    /// Whether all lines are real.
    pub real: bool,
    /// The kernel of each segment.
    pub kernels: Vec<Kernel<S, D>>,
    /// Pivot weights of each segment.
    pub weights: Vec<[f64; D]>,
    /// Where each joint's stiffness is diagonal.
    pub centres: Vec<Centre<S, D>>,
    /// Joints that couple translation and rotation.
    pub coupled: Vec<bool>,
    /// The point elements of each node: impedances at the node, and springs that are diagonal beyond it.
    pub points: Vec<Option<Points<S, D>>>,
    /// Overlaps.
    pub overlaps: Vec<Lanes<S>>,
    /// Nodes of the terminals, and the plane beyond each.
    pub terminals: Vec<(usize, Plane<S, D>)>,
}

/// Point elements of a node.
pub struct Points<S: Simd, const D: usize> {
    /// Impedances at the node.
    pub impedance: [C<S>; D],
    /// Couplings of springs that are far from singular.
    pub coupling: Option<C<S>>,
    /// Springs close to singular, which are added where they are diagonal.
    pub beyond: Vec<Centre<S, D>>,
}

impl Spring {
    /// Whether translation and rotation are coupled.
    pub fn couples(&self) -> bool {
        self.k[2] != 0.0 || self.c[2] != 0.0
    }

    /// Whether coupling takes away most of the stiffness or of the damping in some direction.
    fn nearly_singular(&self) -> bool {
        [self.k, self.c].iter().any(|[y, theta, both]| *both != 0.0 && both * both > 0.5 * y * theta)
    }

    /// The dynamic stiffness k (1 + i loss) + i w c.
    #[inline(always)]
    pub fn stiffness<S: Simd, const D: usize>(&self, simd: S, iw: C<S>) -> Mat<S, D> {
        let (k, mut out) = (self.hysteretic(), small::zeros(simd));
        for i in 0..D {
            for j in 0..D {
                let entry = if i == j { i } else { 2 };
                out[i][j] = C::real(simd, self.c[entry]).mul_add(iw, C::splat(simd, k[entry]));
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
        let mut added = vec![[Complex64::ZERO; 2]; model.joints.len()];
        for slip in &model.slips {
            added[slip.joint] = slip.added(model.joints[slip.joint].1.k, [slip.level; 2]);
        }
        Self {
            segments: model.segments.iter().map(|row| Segment::new(row, model.motion)).collect(),
            cones: model.segments.iter().map(|row| Cone::new(row, model.motion)).collect(),
            highest: 0.0,
            joints: model.joints.iter().map(|joint| joint.1).collect(),
            added,
            points,
            branches: Vec::new(),
            active: vec![true; model.segments.len()],
            differentiated: vec![false; model.segments.len()],
            overlaps: model.overlaps.iter().map(Beside::new).collect(),
            terminals: model.terminals.clone(),
            modes: model.modes.clone(),
            ways: vec![[false; 2]; model.overlaps.len()],
            requested: vec![[false; DERIVATIVES]; model.overlaps.len()],
        }
    }

    /// Prepares a model for sweeps to its first node, and their plan.
    pub fn to_first_node(model: &Model) -> (Self, Vec<Step>) {
        let (mut prepared, plan) = (Self::new(model), model.plan(0));
        prepared.follow(&plan);
        (prepared, plan)
    }

    /// Makes ready for the steps of a plan.
    pub fn follow(&mut self, plan: &[Step]) {
        for step in plan {
            if let Step::Overlap { row, forward, .. } = *step {
                self.ways[row][usize::from(forward)] = true;
            }
        }
    }

    /// Adds derivatives by the coefficients of an overlap to those that are requested.
    pub fn request(&mut self, row: usize, derivatives: &[bool; DERIVATIVES]) {
        for (to, from) in self.requested[row].iter_mut().zip(derivatives) {
            *to |= from;
        }
    }

    /// Evaluates the elements at the lines `w`, at most one a lane. `pieces_only` keeps to the series. `by_line`
    /// are the data that differ from line to line.
    #[inline(always)]
    pub fn block<S: Simd>(
        &self,
        simd: S,
        w: &[Complex64],
        pieces_only: bool,
        by_line: ByLine,
        into: &mut Block<S, D>,
    ) {
        let line = C::load(simd, w);
        into.most = w.iter().fold(0.0_f64, |most, w| most.max(w.norm_sqr()));
        into.real = w.iter().all(|w| w.im == 0.0);
        into.iw = line.times_i();
        into.w2 = line * line;
        if into.kernels.is_empty() {
            into.reserve(self);
        }
        for (row, segment) in self.segments.iter().enumerate() {
            if into.kernels.len() <= row {
                into.kernels.push(Kernel::skipped(simd));
                into.weights.push(segment.weights(segment.wave_number_square(into.most)));
            }
            if self.active[row] {
                let square = segment.wave_number_square(into.most);
                into.weights[row] = segment.weights(square);
                if let Some(cone) = &self.cones[row] {
                    let level = cone.level(into.most.sqrt().max(self.highest));
                    into.kernels[row].evaluate_cone(cone, level, into.w2, into.most, into.real);
                    continue;
                }
                let differentiated = self.differentiated[row];
                segment.evaluate(w, into.w2, square, pieces_only, differentiated, &mut into.kernels[row]);
            }
        }
        let weights = into.weights_of_first();
        into.centres.clear();
        into.coupled.clear();
        for (row, joint) in self.joints.iter().enumerate() {
            let mut stiffness = joint.stiffness::<S, D>(simd, into.iw);
            if self.added[row] != [Complex64::ZERO; 2] {
                for i in 0..D {
                    stiffness[i][i] = stiffness[i][i] + C::splat(simd, self.added[row][i]);
                }
            }
            if !by_line.added.is_empty() {
                for i in 0..D {
                    let more = lanes(simd, by_line.added, 2 * row + i, 2 * self.joints.len());
                    stiffness[i][i] = stiffness[i][i] + more;
                }
            }
            into.centres.push(Centre::new(&stiffness, joint.couples(), &weights));
            into.coupled.push(D == 2 && joint.couples());
        }
        into.points.clear();
        for (masses, springs) in &self.points {
            if masses.is_empty() && springs.is_empty() {
                into.points.push(None);
                continue;
            }
            let mut impedance = [C::zero(simd); D];
            let mut beyond = Vec::new();
            let mut coupling = None;
            for spring in springs {
                let stiffness = spring.stiffness::<S, D>(simd, into.iw);
                if D == 2 && spring.nearly_singular() {
                    beyond.push(Centre::new(&stiffness, true, &weights));
                    continue;
                }
                if D == 2 && spring.couples() {
                    let before = coupling.unwrap_or(C::zero(simd));
                    coupling = Some(before + stiffness[0][D - 1]);
                }
                for i in 0..D {
                    impedance[i] = impedance[i] + stiffness[i][i];
                }
            }
            for inertia in masses {
                for i in 0..D {
                    impedance[i] = impedance[i] - into.w2.scale(inertia[i]);
                }
            }
            into.points.push(Some(Points { impedance, coupling, beyond }));
        }
        for (row, beside) in self.overlaps.iter().enumerate() {
            if into.overlaps.len() <= row {
                into.overlaps.push(Lanes::empty(beside, line, into.most));
            }
            into.overlaps[row].evaluate(beside, line, into.most, self.ways[row], self.requested[row]);
        }
        into.terminals.clear();
        for (row, terminal) in self.terminals.iter().enumerate() {
            let mut entries = [C::zero(simd); TERMINAL_ENTRIES];
            for entry in 0..TERMINAL_ENTRIES {
                entries[entry] = C::real(simd, terminal.residual[entry]);
            }
            if !by_line.beyond.is_empty() {
                let a_line = TERMINAL_ENTRIES * self.terminals.len();
                for entry in 0..TERMINAL_ENTRIES {
                    let more = lanes(simd, by_line.beyond, TERMINAL_ENTRIES * row + entry, a_line);
                    entries[entry] = entries[entry] + more;
                }
            }
            for (_, mode) in self.modes.iter().filter(|(own, _)| *own == row) {
                let more = mode.entries(into.iw, into.w2);
                for entry in 0..TERMINAL_ENTRIES {
                    entries[entry] = entries[entry] + more[entry];
                }
            }
            let mut receptance = small::zeros(simd);
            for i in 0..D {
                for j in 0..D {
                    receptance[i][j] = entries[if i == j { i } else { 2 }];
                }
            }
            into.terminals.push((terminal.node, Plane::loads(simd, receptance)));
        }
    }
}

/// One number of each line of a block, of `a_line` numbers that each has.
#[inline(always)]
fn lanes<S: Simd>(simd: S, values: &[Complex64], which: usize, a_line: usize) -> C<S> {
    let mut lanes = [Complex64::ZERO; MAX_LANES];
    let mut count = 0;
    for value in values.get(which..).unwrap_or_default().iter().step_by(a_line).take(MAX_LANES) {
        lanes[count] = *value;
        count += 1;
    }
    C::load(simd, &lanes[..count])
}

impl<S: Simd, const D: usize> Block<S, D> {
    /// Makes room for a model at once: kernels are large, and moving them costs more than a count of modes.
    fn reserve(&mut self, prepared: &Prepared<D>) {
        let (segments, joints) = (prepared.segments.len(), prepared.joints.len());
        self.kernels.reserve_exact(segments);
        self.weights.reserve_exact(segments);
        self.centres.reserve_exact(joints);
        self.coupled.reserve_exact(joints);
        self.points.reserve_exact(prepared.points.len());
    }

    /// A block to be filled.
    pub fn empty(simd: S) -> Self {
        Self {
            iw: C::zero(simd),
            w2: C::zero(simd),
            most: 0.0,
            real: true,
            kernels: Vec::new(),
            weights: Vec::new(),
            centres: Vec::new(),
            coupled: Vec::new(),
            points: Vec::new(),
            overlaps: Vec::new(),
            terminals: Vec::new(),
        }
    }
}
