//! The determinant whose zeros are the complex natural frequencies, by its logarithm.
//!
//! With states that are transferred without change of coordinates from the free ends, the determinant of the loads at
//! the root is an entire function of w: transfer matrices of segments and overlaps have no poles, those of joints have
//! theirs where the joint's stiffness is zero, which is never at Re w > 0. Its zeros at Re w > 0 are therefore the
//! poles of all receptances, and the change of its argument along a closed curve counts them. The sweep changes
//! coordinates at every element to keep its digits: each change multiplies the determinant by that of the displacements
//! before over that after it.

use crate::error::Result;
use crate::interrupt;
use crate::line::block::{Block, Prepared};
use crate::line::overlap::{Passed, Wanted};
use crate::line::sweep::Observer;
use crate::model::assembly::{Model, Step};
use crate::model::frequencies::{EMPTY, Frequencies};
use crate::model::request::ByLine;
use crate::modes::natural::{check_no_terminals, within_reach};
use crate::simd::lane::{C, MAX_LANES};
use crate::simd::small::{self, Mat};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// The determinant of a model. Joints in micro-slip are at their stated levels.
pub(crate) enum Determinant {
    /// Of rods.
    Rods(Job<1>),
    /// Of beams.
    Beams(Job<2>),
}

impl Determinant {
    /// Prepares the data that all lines share.
    ///
    /// # Errors
    /// Terminals.
    pub fn new(model: &Model) -> Result<Self> {
        check_no_terminals(model)?;
        Ok(match model.motion.degrees() {
            1 => Self::Rods(Job::new(model)),
            _ => Self::Beams(Job::new(model)),
        })
    }

    /// Its logarithm on each line w in rad/s, up to a constant and multiples of 2 pi i; NaN where it is zero.
    ///
    /// # Errors
    /// Unusable lines, or waves that are too short for the lengths of the segments.
    pub fn logarithm(&self, w: &[Complex64]) -> Result<Vec<Complex64>> {
        let lines = Frequencies::complex(w, 1.0);
        let highest = lines.highest()?;
        match self {
            Self::Rods(job) => job.run(&lines, highest),
            Self::Beams(job) => job.run(&lines, highest),
        }
    }
}

pub(crate) struct Job<const D: usize> {
    prepared: Prepared<D>,
    plan: Vec<Step>,
}

struct Lines<'a, const D: usize> {
    job: &'a Job<D>,
    w: &'a [Complex64],
    out: &'a mut [Complex64],
}

/// The sum of the logarithms so far, by lane.
struct Logarithms {
    sum: [Complex64; MAX_LANES],
}

impl Logarithms {
    #[inline(always)]
    fn add<S: Simd>(&mut self, value: C<S>, sign: f64) {
        let mut lanes = [Complex64::ONE; MAX_LANES];
        value.store(&mut lanes);
        for lane in 0..S::F64_LANES {
            self.sum[lane] += lanes[lane].ln() * sign;
        }
    }
}

impl<S: Simd, const D: usize> Observer<S, D> for Logarithms {
    #[inline(always)]
    fn passed(&mut self, far: [&Mat<S, D>; 2], near_u: &Mat<S, D>, _: [&Mat<S, D>; 2]) {
        self.add(small::det(near_u), 1.0);
        self.add(small::det(far[0]), -1.0);
    }

    #[inline(always)]
    fn wanted(&self) -> Wanted {
        Wanted::Determinant
    }

    #[inline(always)]
    fn overlapped(&mut self, far_u: &Mat<S, D>, near_u: &Mat<S, D>, passed: &Passed<S>) {
        self.add(small::det(near_u), 1.0);
        self.add(small::det(far_u), -1.0);
        for (sum, logarithm) in self.sum.iter_mut().zip(passed.log_determinant) {
            *sum += logarithm;
        }
    }
}

impl<const D: usize> WithSimd for Lines<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Lines { job, w, out } = self;
        let mut block = Block::empty(simd);
        let mut records = Vec::with_capacity(4 * job.plan.len());
        for (w, out) in w.chunks(S::F64_LANES).zip(out.chunks_mut(S::F64_LANES)) {
            job.prepared.block(simd, w, true, ByLine::default(), &mut block);
            let mut logarithms = Logarithms { sum: [Complex64::ZERO; MAX_LANES] };
            block.upwards(simd, &job.plan, &job.prepared, &mut records, &mut logarithms);
            if let Some(top) = records.last() {
                let (u, f) = top.plane.basis();
                logarithms.add(small::det(&f), 1.0);
                logarithms.add(small::det(&u), -1.0);
            }
            for (to, from) in out.iter_mut().zip(&logarithms.sum) {
                *to = if from.is_finite() { *from } else { Complex64::new(f64::NAN, f64::NAN) };
            }
        }
    }
}

impl<const D: usize> Job<D> {
    fn new(model: &Model) -> Self {
        let (prepared, plan) = Prepared::to_first_node(model);
        Self { prepared, plan }
    }

    fn run(&self, lines: &Frequencies, highest: f64) -> Result<Vec<Complex64>> {
        within_reach(&self.prepared, highest)?;
        let arch = Arch::new();
        let mut out = vec![Complex64::ZERO; lines.len()];
        let mut room = EMPTY;
        for range in lines.tasks() {
            interrupt::check()?;
            let w = lines.some(range.clone(), &mut room);
            arch.dispatch(Lines { job: self, w, out: &mut out[range] });
        }
        Ok(out)
    }
}
