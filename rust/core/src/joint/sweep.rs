//! Many joints in place of one: receptances, magnitudes or misfits of each, everything else evaluated once.
//!
//! Lines are in the lanes. The columns of `bilinear` on the lines are stored once, a few lines after the other, so that
//! they stay in the nearest cache for all joints of a group. The results of a joint depend neither on the other joints
//! nor on the number of threads.
//!
//! The data of the lines are stored in the order of the kernels: by tiles of some vectors of lines, then vectors, then
//! columns (see `bilinear`), then N and D, real and imaginary parts; the squared weights of a tile follow its columns.
//!
//! There are two passes over lines and joints: one sums over the lines, the other gives values line by line.
//! N and D are products of the columns of the lines and the factors of the joints, a few joints side by side on a
//! vector of lines; the results are computed from them immediately.

use crate::error::{Result, one_a_line, same_length};
use crate::joint::bilinear::{COLUMNS, FUNCTIONS, Functions, OnLines, column, factors, used};
use crate::joint::reduction::JointReduction;
use crate::model::request::singular_at;
use crate::model::spring::{SPRING_COLUMNS, Spring};
use crate::simd::elementary::ln_norm_sqr;
use crate::simd::lane::{C, MAX_LANES};
use crate::threads::on_threads;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Most joints of a task.
const GROUP: usize = 64;

/// Least number of tasks, where there are enough joints.
const TASKS: usize = 32;

/// Least time of a joint on a line [ns].
const A_LINE: f64 = 0.5;

/// Terms of the sum over the lines.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Misfit {
    /// The squared modulus of `weight` log(measured / H), as fits have it.
    Logarithm,
    /// The squared modulus of `weight` (measured - H).
    Difference,
}

/// Many candidates of a model on some lines. A candidate without a finite value on every line has results of NaN.
pub trait Sweep: Sync {
    /// Numbers of a candidate.
    fn columns(&self) -> usize;

    /// Number of lines.
    fn lines(&self) -> usize;

    /// Receptances, `(n_candidates, n_lines)`.
    ///
    /// # Errors
    /// Arrays of other lengths, or threads that could not be started.
    fn receptances(&self, candidates: &[f64], out: &mut [Complex64], threads: usize) -> Result<()>;

    /// Moduli of the receptances, likewise.
    ///
    /// # Errors
    /// As `receptances`.
    fn magnitudes(&self, candidates: &[f64], out: &mut [f64], threads: usize) -> Result<()>;

    /// The sum of squares over the lines of each candidate.
    ///
    /// # Errors
    /// As `receptances`.
    fn misfits(
        &self,
        candidates: &[f64],
        measured: &[Complex64],
        weights: &[f64],
        misfit: Misfit,
        threads: usize,
    ) -> Result<Vec<f64>>;
}

/// A model reduced to one joint, for many joints in its place: candidates are the columns of its spring.
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
}

impl Sweep for JointSweep<'_> {
    fn columns(&self) -> usize {
        SPRING_COLUMNS
    }

    fn lines(&self) -> usize {
        self.functions.frequencies.len()
    }

    fn receptances(&self, joints: &[f64], out: &mut [Complex64], threads: usize) -> Result<()> {
        self.each_line::<false>(joints, bytemuck::cast_slice_mut(out), threads)
    }

    fn magnitudes(&self, joints: &[f64], out: &mut [f64], threads: usize) -> Result<()> {
        self.each_line::<true>(joints, out, threads)
    }

    fn misfits(
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
}

impl JointSweep<'_> {
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

    /// Stores the data of the lines.
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

/// Real numbers of a column on a line: N and D, real and imaginary parts.
pub const PARTS: usize = 4;

/// Vectors of lines that are in the nearest cache together.
pub const TILE: usize = 8;

/// Measured receptance of each line, and its weight.
#[derive(Copy, Clone)]
pub struct Measured<'a> {
    /// Receptances.
    pub values: &'a [Complex64],
    /// Weights.
    pub weights: &'a [f64],
    /// Terms of the sum.
    pub misfit: Misfit,
}

/// Source of the stored data.
pub struct Source<'a> {
    /// The functions of the lines.
    pub functions: Functions<'a>,
    /// The highest angular frequency.
    pub highest: f64,
    /// The measurement, for misfits.
    pub measured: Option<Measured<'a>>,
    /// Whether the lanes have the order in which complex numbers are written.
    pub woven: bool,
    /// The columns that are needed.
    pub columns: &'a [usize],
}

/// Data of the lines for all joints.
pub struct Hoisted {
    values: Vec<f64>,
    skip: usize,
    /// Number of columns.
    pub columns: usize,
    /// Number of lines.
    pub lines: usize,
}

impl Hoisted {
    /// Lays out a source.
    ///
    /// # Errors
    /// The threads could not be started.
    pub fn new(source: &Source, threads: usize) -> Result<Self> {
        let (arch, columns, lines) = (Arch::new(), source.columns.len(), source.functions.frequencies.len());
        let lanes = arch.dispatch(Lanes);
        let a_tile = TILE * lanes * (columns * PARTS + 1);
        let tiles = lines.div_ceil(lanes * TILE);
        let mut values = bytemuck::zeroed_vec::<f64>(tiles * a_tile + MAX_LANES);
        // Vectors that cross a line of the cache would be loaded twice.
        let skip = values.as_ptr().align_offset(size_of::<[f64; MAX_LANES]>()).min(MAX_LANES);
        let parts = values[skip..skip + tiles * a_tile].chunks_mut(a_tile).enumerate().collect();
        on_threads(threads, parts, (TILE * lanes * columns) as f64, |(tile, into)| {
            arch.dispatch(Hoist { source, first: tile * TILE * lanes, into });
        })?;
        Ok(Self { values, skip, columns, lines })
    }

    /// Each tile's vectors, and the weights of its lines.
    #[inline(always)]
    pub fn tiles<S: Simd>(&self) -> impl Iterator<Item = (&[S::f64s], &[S::f64s])> {
        let vectors = S::as_simd_f64s(&self.values[self.skip..]).0;
        let a_vector = self.columns * PARTS;
        let count = self.lines.div_ceil(S::F64_LANES);
        vectors.chunks_exact(TILE * (a_vector + 1)).enumerate().map(move |(tile, part)| {
            let own = TILE.min(count - tile * TILE);
            let (values, weights) = part.split_at(TILE * a_vector);
            (&values[..own * a_vector], &weights[..own])
        })
    }
}

/// The lanes of a vector.
struct Lanes;

impl WithSimd for Lanes {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
    }
}

/// One tile, from a line on.
struct Hoist<'a> {
    source: &'a Source<'a>,
    first: usize,
    into: &'a mut [f64],
}

impl WithSimd for Hoist<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { source: &Source { functions: ref all, highest, measured, woven, columns }, first, into } =
            self;
        let (values, weights) = S::as_mut_simd_f64s(into).0.split_at_mut(TILE * columns.len() * PARTS);
        let (count, reference) = (all.frequencies.len(), factors(&all.reference, highest));
        for (vector, (into, weight)) in
            values.chunks_exact_mut(columns.len() * PARTS).zip(weights).enumerate()
        {
            let start = first + vector * S::F64_LANES;
            if start >= count {
                break;
            }
            let lines = start..count.min(start + S::F64_LANES);
            let (functions, iw) = all.at(simd, lines.clone());
            let size = size(&functions[1], columns, iw, &reference);
            let folded = match measured {
                Some(measured) => {
                    let mut room = [0.0; MAX_LANES];
                    for (lane, line) in lines.clone().enumerate() {
                        room[lane] = measured.weights[line] * measured.weights[line];
                    }
                    *weight = simd.partial_load_f64s(&room[..S::F64_LANES]);
                    fold(functions, C::load(simd, &measured.values[lines]), measured.misfit)
                }
                None => functions,
            };
            for (parts, &which) in into.chunks_exact_mut(PARTS).zip(columns) {
                for side in 0..2 {
                    let value = column(which, &folded[side], iw).mul_real(size);
                    let value = if woven { value.woven() } else { value };
                    (parts[2 * side], parts[2 * side + 1]) = (value.re, value.im);
                }
            }
        }
    }
}

/// N and D such that with another joint N / D is H / measured, or their squares' quotient the squared difference.
#[inline(always)]
fn fold<S: Simd>([n, d]: OnLines<S>, measured: C<S>, misfit: Misfit) -> OnLines<S> {
    let (mut above, mut below) = (n, d);
    for k in 0..n.len() {
        match misfit {
            Misfit::Logarithm => below[k] = d[k] * measured,
            Misfit::Difference => above[k] = measured.mul_add(d[k], -n[k]),
        }
    }
    [above, below]
}

/// A power of two on each line that makes D about one for the joint of reference: squares then stay within range.
#[inline(always)]
fn size<S: Simd>(d: &[C<S>; FUNCTIONS], columns: &[usize], iw: C<S>, reference: &[f64; COLUMNS]) -> S::f64s {
    let simd = iw.simd;
    let mut most = simd.splat_f64s(0.0);
    for &which in columns {
        let value = column(which, d, iw).norm_sqr().v;
        most =
            simd.max_f64s(most, simd.mul_f64s(value, simd.splat_f64s(reference[which] * reference[which])));
    }
    let mut lanes = [1.0; MAX_LANES];
    simd.partial_store_f64s(&mut lanes[..S::F64_LANES], most);
    for lane in &mut lanes {
        let scale = (-(0.5 * lane.log2()).floor()).exp2();
        *lane = if scale.is_normal() { scale } else { 1.0 };
    }
    simd.partial_load_f64s(&lanes[..S::F64_LANES])
}

/// Joints that are computed side by side: the loaded data of the lines are used by all of them, and the steps of one
/// overlap with those of the others. Four are 15 % faster than two with the 32 registers of AVX-512, 4 % slower with
/// sixteen.
pub const SIDE: usize = 4;

/// The factors of some joints: by groups of `SIDE` joints, then columns, then the joints of a group.
pub struct Factors {
    /// The factors.
    pub values: Vec<f64>,
    /// Whether each joint is invalid.
    pub invalid: Vec<bool>,
}

/// N and D of joints side by side on a vector of lines.
#[inline(always)]
fn sums<S: Simd>(simd: S, lines: &[S::f64s], joints: &[f64]) -> [[S::f64s; PARTS]; SIDE] {
    let mut out = [[simd.splat_f64s(0.0); PARTS]; SIDE];
    for (lines, joints) in lines.chunks_exact(PARTS).zip(joints.chunks_exact(SIDE)) {
        for joint in 0..SIDE {
            let factor = simd.splat_f64s(joints[joint]);
            for part in 0..PARTS {
                out[joint][part] = simd.mul_add_e_f64s(factor, lines[part], out[joint][part]);
            }
        }
    }
    out
}

/// The misfits of a group of joints.
pub struct Sums<'a, const LOGARITHM: bool> {
    /// Data of the lines.
    pub hoisted: &'a Hoisted,
    /// Factors of the joints.
    pub joints: &'a Factors,
    /// The output.
    pub out: &'a mut [f64],
}

impl<const LOGARITHM: bool> WithSimd for Sums<'_, LOGARITHM> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { hoisted, joints, out } = self;
        let (a_vector, a_group) = (hoisted.columns * PARTS, hoisted.columns * SIDE);
        let mut totals = vec![[simd.splat_f64s(0.0); SIDE]; joints.values.len() / a_group];
        for (lines, weights) in hoisted.tiles::<S>() {
            for (group, total) in joints.values.chunks_exact(a_group).zip(&mut totals) {
                for (lines, &weight) in lines.chunks_exact(a_vector).zip(weights) {
                    let found = sums(simd, lines, group);
                    // D over N: both are sums of products; D contains the measured value.
                    let quotients = found.map(|[n_re, n_im, d_re, d_im]| {
                        [C { simd, re: d_re, im: d_im }, C { simd, re: n_re, im: n_im }]
                    });
                    let squares = if LOGARITHM {
                        ln_norm_sqr(simd, quotients)
                    } else {
                        quotients.map(|[d, n]| simd.div_f64s(n.norm_sqr().v, d.norm_sqr().v))
                    };
                    for joint in 0..SIDE {
                        total[joint] = simd.mul_add_e_f64s(squares[joint], weight, total[joint]);
                    }
                }
            }
        }
        let totals = totals.as_flattened();
        for ((out, &total), &invalid) in out.iter_mut().zip(totals).zip(&joints.invalid) {
            let total = simd.reduce_sum_f64s(total);
            *out = if invalid || !total.is_finite() { f64::NAN } else { total };
        }
    }
}

/// The receptances of a group of joints, line by line, or their moduli.
pub struct EachLine<'a, const MAGNITUDE: bool> {
    /// Data of the lines.
    pub hoisted: &'a Hoisted,
    /// Factors of the joints.
    pub joints: &'a Factors,
    /// The output.
    pub out: &'a mut [f64],
}

impl<const MAGNITUDE: bool> WithSimd for EachLine<'_, MAGNITUDE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { hoisted, joints, out } = self;
        let a_line = if MAGNITUDE { 1 } else { 2 };
        let (a_vector, a_group) = (hoisted.columns * PARTS, hoisted.columns * SIDE);
        // A value that is not finite makes this one not a number.
        let mut zeros = vec![simd.splat_f64s(0.0); joints.values.len() / hoisted.columns];
        let zero = simd.splat_f64s(0.0);
        for (tile, (lines, _)) in hoisted.tiles::<S>().enumerate() {
            let start = tile * TILE * S::F64_LANES;
            for (group, factors) in joints.values.chunks_exact(a_group).enumerate() {
                for (vector, lines) in lines.chunks_exact(a_vector).enumerate() {
                    let found = sums(simd, lines, factors);
                    let first = start + vector * S::F64_LANES;
                    let range = a_line * first..a_line * hoisted.lines.min(first + S::F64_LANES);
                    for joint in (0..SIDE).take(joints.invalid.len() - group * SIDE) {
                        let row = group * SIDE + joint;
                        let into = &mut out[a_line * hoisted.lines * row..][range.clone()];
                        let value = if MAGNITUDE {
                            modulus(simd, found[joint], into)
                        } else {
                            quotient(simd, found[joint], into)
                        };
                        zeros[row] = simd.mul_add_e_f64s(value, zero, zeros[row]);
                    }
                }
            }
        }
        for (row, (zero, &invalid)) in zeros.into_iter().zip(&joints.invalid).enumerate() {
            if invalid || simd.reduce_sum_f64s(zero) != 0.0 {
                out[a_line * hoisted.lines * row..][..a_line * hoisted.lines].fill(f64::NAN);
            }
        }
    }
}

/// Writes N / D of some lines; something finite where that is.
#[inline(always)]
fn quotient<S: Simd>(simd: S, [n_re, n_im, d_re, d_im]: [S::f64s; PARTS], out: &mut [f64]) -> S::f64s {
    let h = C { simd, re: n_re, im: n_im } * C { simd, re: d_re, im: d_im }.recip();
    let woven = simd.interleave_shfl_f64s([h.re, h.im]);
    if out.len() == 2 * S::F64_LANES {
        S::as_mut_simd_f64s(out).0.copy_from_slice(&woven);
    } else {
        let mut room = [0.0; 2 * MAX_LANES];
        S::as_mut_simd_f64s(&mut room).0[..2].copy_from_slice(&woven);
        out.copy_from_slice(&room[..out.len()]);
    }
    simd.add_f64s(h.re, h.im)
}

/// Writes |N / D| of some lines; something finite where that is.
#[inline(always)]
fn modulus<S: Simd>(simd: S, [n_re, n_im, d_re, d_im]: [S::f64s; PARTS], out: &mut [f64]) -> S::f64s {
    let (n, d) = (C { simd, re: n_re, im: n_im }, C { simd, re: d_re, im: d_im });
    let square = simd.div_f64s(n.norm_sqr().v, d.norm_sqr().v);
    let value = simd.sqrt_f64s(square);
    simd.partial_store_f64s(out, value);
    value
}
