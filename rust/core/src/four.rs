//! A basis of a plane of four degrees of freedom, and the column operations that keep its digits.

use num_complex::Complex64;

const ZERO: Complex64 = Complex64::ZERO;
const ONE: Complex64 = Complex64::ONE;

/// Rows of a basis of four columns: four displacements, their loads, two more that are carried along.
pub type Basis = [[Complex64; 4]; 10];
/// A 4 x 4 matrix.
pub type Four = [[Complex64; 4]; 4];

/// Makes the basis a graph over one of each displacement and its load; the old coordinates from the new.
pub fn graph(basis: &mut Basis, weights: &[f64; 4]) -> Four {
    let mut change = identity();
    // Sizes are squared; rows are made comparable by the weights, columns by their largest entries.
    let mut scale = [0.0; 8];
    for i in 0..4 {
        (scale[i], scale[4 + i]) = (weights[i], 1.0 / weights[i]);
    }
    let mut size = [0.0_f64; 4];
    for i in 0..8 {
        for column in 0..4 {
            size[column] = size[column].max(basis[i][column].norm_sqr() * scale[i]);
        }
    }
    let (mut taken, mut used) = ([false; 4], [false; 4]);
    for _ in 0..4 {
        let (mut best, mut row, mut column) = (-1.0, 0, 0);
        for i in 0..8 {
            for j in 0..4 {
                if !taken[i % 4] && !used[j] {
                    let share = basis[i][j].norm_sqr() * scale[i] / size[j];
                    if share > best {
                        (best, row, column) = (share, i, j);
                    }
                }
            }
        }
        taken[row % 4] = true;
        used[column] = true;
        let pivot = basis[row][column].inv();
        let factors = basis[row];
        sweep_columns(basis, pivot, &factors, column);
        sweep_columns(&mut change, pivot, &factors, column);
        // What is one and zero in exact arithmetic is so here.
        basis[row] = [ZERO; 4];
        basis[row][column] = ONE;
    }
    change
}

/// The identity.
fn identity() -> Four {
    let mut out = [[ZERO; 4]; 4];
    for (i, row) in out.iter_mut().enumerate() {
        row[i] = ONE;
    }
    out
}

/// Column operations that leave nothing but the pivot in its row.
#[inline(always)]
fn sweep_columns<const N: usize>(
    rows: &mut [[Complex64; 4]; N],
    pivot: Complex64,
    factors: &[Complex64; 4],
    column: usize,
) {
    for row in rows {
        let scaled = row[column] * pivot;
        for j in 0..4 {
            if j != column {
                row[j] -= scaled * factors[j];
            }
        }
        row[column] = scaled;
    }
}

/// Restricts the basis to where two rows a + sign b are zero; the two columns that are left.
pub fn restrict(
    basis: &mut Basis,
    rows: &[[usize; 2]; 2],
    sign: f64,
    weights: &[f64; 4],
) -> ([usize; 2], Four) {
    let mut change = identity();
    let mut size = [0.0_f64; 4];
    for i in 0..4 {
        for column in 0..4 {
            let (u, f) = (basis[i][column].norm_sqr(), basis[4 + i][column].norm_sqr());
            size[column] = size[column].max(u * weights[i]).max(f / weights[i]);
        }
    }
    let mut used = [false; 4];
    let mut done = [false; 2];
    for _ in 0..2 {
        let (mut best, mut which, mut column, mut factors) = (-1.0, 0, 0, [ZERO; 4]);
        for (i, &[a, b]) in rows.iter().enumerate() {
            let mut sum = basis[a];
            for j in 0..4 {
                sum[j] += basis[b][j] * sign;
            }
            let scale = if a >= 4 { 1.0 / weights[a - 4] } else { weights[a] };
            for j in 0..4 {
                let share = sum[j].norm_sqr() * scale / size[j];
                if !done[i] && !used[j] && share > best {
                    (best, which, column, factors) = (share, i, j, sum);
                }
            }
        }
        done[which] = true;
        used[column] = true;
        for j in 0..4 {
            if used[j] && j != column {
                factors[j] = ZERO;
            }
        }
        let pivot = factors[column].inv();
        sweep_columns(basis, pivot, &factors, column);
        sweep_columns(&mut change, pivot, &factors, column);
    }
    let mut left = [0; 2];
    let mut count = 0;
    for j in 0..4 {
        if !used[j] && count < 2 {
            left[count] = j;
            count += 1;
        }
    }
    (left, change)
}
