//! Many joints in the place of one: receptances, magnitudes or misfits of each, everything else evaluated once.
//!
//! Lines lie in the lanes. What `bilinear` has of the lines is laid out once, a few lines after the other, so that it
//! stays in the nearest cache while all joints of a group pass. What comes out for a joint does not depend on which
//! others are asked for, nor on the number of threads.

use crate::bilinear::{Functions, factors, used};
use crate::error::{Result, one_a_line, same_length};
use crate::joint_fit::SPRING_COLUMNS;
use crate::joint_hoist::{Hoisted, Measured, Source};
use crate::joint_kernel::{EachLine, Factors, SIDE, Sums};
use crate::model::Spring;
use crate::reduction::JointReduction;
use crate::request::singular_at;
use crate::threads::on_threads;
use num_complex::Complex64;
use pulp::Arch;

/// Joints of a task, at most.
const GROUP: usize = 64;

/// Tasks there should at least be.
const TASKS: usize = 32;

/// What a joint takes on a line at least [ns].
const A_LINE: f64 = 0.5;

/// What is summed over the lines.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Misfit {
    /// The squared modulus of `weight` log(measured / H), as fits have it.
    Logarithm,
    /// The squared modulus of `weight` (measured - H).
    Difference,
}

/// A model reduced to one joint, for many joints in its place.
#[derive(Copy, Clone)]
pub struct JointSweep<'a> {
    functions: Functions<'a>,
    highest: f64,
}

impl<'a> JointSweep<'a> {
    /// Many joints in the place of the one that a model was reduced to.
    ///
    /// # Errors
    /// A line that is no frequency.
    pub fn new(model: &'a JointReduction) -> Result<Self> {
        let frequencies = model.frequencies();
        let highest = frequencies.highest()?;
        let reference = Spring::new(&model.reference);
        let functions = Functions { reduction: &model.reduction, frequencies, reference };
        Ok(Self { functions, highest })
    }

    /// Number of lines.
    pub fn lines(&self) -> usize {
        self.functions.frequencies.len()
    }

    /// Receptances, `(n_joints, n_lines)`; a row of NaN where a joint is none or the receptance is not finite.
    ///
    /// # Errors
    /// An output of another length, or threads that could not be started.
    pub fn receptances(&self, joints: &[f64], out: &mut [Complex64], threads: usize) -> Result<()> {
        self.each_line::<false>(joints, bytemuck::cast_slice_mut(out), threads)
    }

    /// Moduli of the receptances, likewise.
    ///
    /// # Errors
    /// As `receptances`.
    pub fn magnitudes(&self, joints: &[f64], out: &mut [f64], threads: usize) -> Result<()> {
        self.each_line::<true>(joints, out, threads)
    }

    /// The sum of squares over the lines of each joint; NaN where a joint is none or the receptance is not finite.
    ///
    /// # Errors
    /// Arrays of other lengths, or threads that could not be started.
    pub fn misfits(
        &self,
        joints: &[f64],
        values: &[Complex64],
        weights: &[f64],
        misfit: Misfit,
        threads: usize,
    ) -> Result<Vec<f64>> {
        one_a_line(values.len(), weights.len(), self.lines())?;
        let (columns, measured) = (used(joints), Measured { values, weights, misfit });
        let hoisted = self.hoisted(&columns, Some(measured), false, threads)?;
        let mut out = vec![0.0; joints.len() / SPRING_COLUMNS];
        let arch = Arch::new();
        self.groups(joints, &columns, &mut out, 1, threads, |joints, out| match misfit {
            Misfit::Logarithm => arch.dispatch(Sums::<true> { hoisted: &hoisted, joints, out }),
            Misfit::Difference => arch.dispatch(Sums::<false> { hoisted: &hoisted, joints, out }),
        })?;
        Ok(out)
    }

    fn each_line<const MAGNITUDE: bool>(
        &self,
        joints: &[f64],
        out: &mut [f64],
        threads: usize,
    ) -> Result<()> {
        let a_joint = self.lines() * if MAGNITUDE { 1 } else { 2 };
        same_length("output", 0, out.len(), joints.len() / SPRING_COLUMNS * a_joint)?;
        // Receptances go out in the order in which their parts are woven together.
        let columns = used(joints);
        let hoisted = self.hoisted(&columns, None, !MAGNITUDE, threads)?;
        let arch = Arch::new();
        self.groups(joints, &columns, out, a_joint, threads, |joints, out| {
            arch.dispatch(EachLine::<MAGNITUDE> { hoisted: &hoisted, joints, out });
        })
    }

    /// Works on groups of joints and their parts of the output.
    fn groups(
        &self,
        joints: &[f64],
        columns: &[usize],
        out: &mut [f64],
        a_joint: usize,
        threads: usize,
        work: impl Fn(&Factors, &mut [f64]) + Sync,
    ) -> Result<()> {
        let count = joints.len() / SPRING_COLUMNS;
        same_length("joints", 0, joints.len(), count * SPRING_COLUMNS)?;
        if count == 0 || a_joint == 0 {
            return Ok(());
        }
        let group = (count / TASKS).next_multiple_of(SIDE).clamp(SIDE, GROUP);
        let tasks = joints.chunks(group * SPRING_COLUMNS).zip(out.chunks_mut(group * a_joint)).collect();
        on_threads(threads, tasks, (group * self.lines()) as f64 * A_LINE, |(joints, out)| {
            work(&self.factors(joints, columns), out);
        })?;
        Ok(())
    }

    /// The factors of a group of joints.
    fn factors(&self, joints: &[f64], columns: &[usize]) -> Factors {
        let rows = joints.chunks_exact(SPRING_COLUMNS);
        let count = rows.len().next_multiple_of(SIDE);
        let mut out =
            Factors { values: vec![0.0; count * columns.len()], invalid: Vec::with_capacity(rows.len()) };
        for (row, joint) in rows.enumerate() {
            let spring = Spring::new(joint);
            let lines = &self.functions.frequencies;
            let invalid = spring.check("joint", row).is_err() || singular_at(&spring, 2, lines).is_some();
            out.invalid.push(invalid);
            if invalid {
                continue;
            }
            let own = factors(&spring, self.highest);
            let first = (row / SIDE) * SIDE * columns.len() + row % SIDE;
            for (place, &column) in columns.iter().enumerate() {
                out.values[first + place * SIDE] = own[column];
            }
        }
        out
    }

    /// Lays out what the lines have.
    fn hoisted(
        &self,
        columns: &[usize],
        measured: Option<Measured>,
        woven: bool,
        threads: usize,
    ) -> Result<Hoisted> {
        Hoisted::new(
            &Source { functions: self.functions, highest: self.highest, measured, woven, columns },
            threads,
        )
    }
}
