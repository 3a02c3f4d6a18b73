//! Times of the small dense factorisations of the core by nalgebra, by faer and by the core's own code.
//!
//! `cargo run --release --manifest-path benches/linear_algebra/Cargo.toml` prints the table of docs/theory.md, "Dense
//! algebra", on one thread. The real matrices are normal matrices J^T J + I, as in the trust region; the complex ones
//! are the 4 x 4 blocks of overlapping beams, whose rows of displacements and rotations differ by orders of magnitude.

use std::hint::black_box;
use std::time::Instant;

use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Mat, Side};
use nalgebra::{Cholesky, DMatrix, DVector, SMatrix};
use num_complex::Complex64;

/// The core's counts of negative pivots, which depend on complex numbers and nalgebra only.
#[path = "../../../rust/core/src/line/signs.rs"]
#[allow(dead_code)]
mod signs;

/// Rounds of each measurement; the best one is printed, because a shared machine only adds to a time.
const ROUNDS: usize = 15;
/// Seconds of one round.
const SECONDS: f64 = 0.02;

/// Numbers between -1 and 1 of a congruential generator (Knuth's MMIX): reproducible without a dependency.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// The least time of one call in nanoseconds.
fn nanoseconds<T>(mut call: impl FnMut() -> T) -> f64 {
    let mut calls = 1_usize;
    let mut best = f64::INFINITY;
    let mut round = 0;
    while round < ROUNDS {
        let began = Instant::now();
        for _ in 0..calls {
            black_box(call());
        }
        let taken = began.elapsed().as_secs_f64();
        if taken < SECONDS {
            calls *= 2; // too short for the clock
            continue;
        }
        best = best.min(1e9 * taken / calls as f64);
        round += 1;
    }
    best
}

fn row(what: &str, nalgebra: Option<f64>, faer: Option<f64>, core: Option<f64>) {
    let text = |time: Option<f64>| time.map_or("-".to_owned(), |t| format!("{t:.0} ns"));
    println!("| {what} | {} | {} | {} |", text(nalgebra), text(faer), text(core));
}

/// Cholesky factor of a normal matrix of n variables and the solution for one right-hand side; LU of the same size.
fn real(n: usize, random: &mut Random) {
    let slopes = DMatrix::from_fn(3 * n, n, |_, _| random.next());
    let normal = slopes.transpose() * &slopes + DMatrix::identity(n, n);
    let right = DVector::from_fn(n, |_, _| random.next());
    let matrix = Mat::from_fn(n, n, |i, j| normal[(i, j)]);
    let side = Mat::from_fn(n, 1, |i, _| right[i]);

    let first = Cholesky::new(normal.clone()).map(|factor| factor.solve(&right));
    let second = matrix.llt(Side::Lower).ok().map(|factor| factor.solve(&side));
    let (Some(first), Some(second)) = (first, second) else {
        println!("a normal matrix of {n} variables was not positive definite");
        return;
    };
    assert!((0..n).all(|i| (first[i] - second[(i, 0)]).abs() < 1e-10), "solutions differ");

    row(
        &format!("Cholesky factor and solution, {n} x {n}"),
        Some(nanoseconds(|| Cholesky::new(black_box(&normal).clone()).map(|factor| factor.solve(&right)))),
        Some(nanoseconds(|| black_box(&matrix).llt(Side::Lower).ok().map(|factor| factor.solve(&side)))),
        None,
    );
    row(
        &format!("LU factor and solution, {n} x {n}"),
        Some(nanoseconds(|| black_box(&normal).clone().lu().solve(&right))),
        Some(nanoseconds(|| black_box(&matrix).partial_piv_lu().solve(&side))),
        None,
    );
}

/// Inverse and number of negative eigenvalues of the 4 x 4 blocks of overlapping beams.
fn blocks(random: &mut Random) {
    let scales = [1.0, 1e-3, 1.0, 1e-3];
    let mut block: signs::Line<4> = [[Complex64::ZERO; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            block[i][j] = Complex64::new(random.next(), 0.1 * random.next()) * scales[i] * scales[j];
        }
    }
    let matrix = SMatrix::<Complex64, 4, 4>::from_fn(|i, j| block[i][j]);
    let dense = Mat::from_fn(4, 4, |i, j| block[i][j]);
    row(
        "complex inverse, 4 x 4",
        Some(nanoseconds(|| black_box(&matrix).try_inverse())),
        Some(nanoseconds(|| black_box(&dense).partial_piv_lu().inverse())),
        Some(nanoseconds(|| signs::inverse(black_box(block)))),
    );
    let mut symmetric = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            symmetric[i][j] = block[i][j].re + block[j][i].re;
        }
    }
    let own = SMatrix::<f64, 4, 4>::from_fn(|i, j| symmetric[i][j]);
    let other = Mat::from_fn(4, 4, |i, j| symmetric[i][j]);
    let negative = own.symmetric_eigenvalues().iter().filter(|&&value| value < 0.0).count();
    assert_eq!(negative, signs::negative_eigenvalues(symmetric), "numbers of negative eigenvalues differ");
    row(
        "negative eigenvalues, 4 x 4",
        Some(nanoseconds(|| black_box(&own).symmetric_eigenvalues())),
        Some(nanoseconds(|| black_box(&other).self_adjoint_eigenvalues(Side::Lower))),
        Some(nanoseconds(|| signs::negative_eigenvalues(black_box(symmetric)))),
    );
}

fn main() {
    faer::set_global_parallelism(faer::Par::Seq);
    let mut random = Random(20_261_123);
    println!("one thread, best of {ROUNDS} rounds");
    println!("| | nalgebra | faer | core |\n| --- | --- | --- | --- |");
    for n in [4, 16, 40] {
        real(n, &mut random);
    }
    blocks(&mut random);
}
