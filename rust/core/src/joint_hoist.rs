//! What many joints need of the lines, laid out as the kernels pass it.
//!
//! By tiles of some vectors of lines, then vectors, then columns (see `bilinear`), then N and D, real and imaginary
//! parts; the squared weights of a tile behind the rest of it.

use crate::bilinear::{COLUMNS, FUNCTIONS, Functions, OnLines, column, factors};
use crate::error::Result;
use crate::joint_sweep::Misfit;
use crate::lane::{C, MAX_LANES};
use crate::threads::on_threads;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Real numbers of a column on a line: N and D, real and imaginary parts.
pub const PARTS: usize = 4;

/// Vectors of lines that are in the nearest cache together.
pub const TILE: usize = 8;

/// What was measured on each line, and its weight.
#[derive(Copy, Clone)]
pub struct Measured<'a> {
    /// Receptances.
    pub values: &'a [Complex64],
    /// Weights.
    pub weights: &'a [f64],
    /// What is summed.
    pub misfit: Misfit,
}

/// What is laid out.
pub struct Source<'a> {
    /// The functions of the lines.
    pub functions: Functions<'a>,
    /// The highest angular frequency.
    pub highest: f64,
    /// What was measured, for misfits.
    pub measured: Option<Measured<'a>>,
    /// Whether lanes stand in the order in which complex numbers are written.
    pub woven: bool,
    /// The columns that are needed.
    pub columns: &'a [usize],
}

/// What all joints need of the lines.
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
