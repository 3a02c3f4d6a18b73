//! Algebra of the 4 x 4 blocks of an overlap: bases that keep their digits, an inverse, a determinant, signs of eigenvalues.

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

/// The inverse by elimination with row pivoting, the rows weighted by their largest entries.
pub fn inverse(mut matrix: [[Complex64; 4]; 4]) -> [[Complex64; 4]; 4] {
    let mut out = [[Complex64::ZERO; 4]; 4];
    for i in 0..4 {
        out[i][i] = Complex64::ONE;
    }
    let scale = matrix.map(|row| row.iter().fold(0.0_f64, |most, value| most.max(value.norm())));
    let mut order = [0, 1, 2, 3];
    for column in 0..4 {
        let mut best = column;
        for i in column..4 {
            let share = |i: usize| matrix[order[i]][column].norm() / scale[order[i]];
            if share(i) > share(best) {
                best = i;
            }
        }
        order.swap(column, best);
        let row = order[column];
        let pivot = matrix[row][column].inv();
        for j in 0..4 {
            matrix[row][j] *= pivot;
            out[row][j] *= pivot;
        }
        for i in 0..4 {
            if i != row {
                let factor = matrix[i][column];
                for j in 0..4 {
                    let (a, b) = (matrix[row][j], out[row][j]);
                    matrix[i][j] -= factor * a;
                    out[i][j] -= factor * b;
                }
            }
        }
    }
    order.map(|row| out[row])
}

/// The determinant by elimination with complete pivoting.
pub fn determinant(mut matrix: [[Complex64; 4]; 4]) -> Complex64 {
    let mut out = Complex64::ONE;
    for step in 0..4 {
        let (mut best, mut at) = (-1.0, (step, step));
        for i in step..4 {
            for j in step..4 {
                let size = matrix[i][j].norm_sqr();
                if size > best {
                    (best, at) = (size, (i, j));
                }
            }
        }
        if at.0 != step {
            matrix.swap(at.0, step);
            out = -out;
        }
        if at.1 != step {
            for row in &mut matrix {
                row.swap(at.1, step);
            }
            out = -out;
        }
        let pivot = matrix[step][step];
        out *= pivot;
        for i in step + 1..4 {
            let factor = matrix[i][step] / pivot;
            for j in step + 1..4 {
                let taken = factor * matrix[step][j];
                matrix[i][j] -= taken;
            }
        }
    }
    out
}

/// Negative eigenvalues of a real symmetric matrix, by the pivots of Bunch and Parlett (SIAM J. Numer. Anal. 8, 1971,
/// 639), of which those of two rows have one eigenvalue of either sign.
pub fn negative_eigenvalues<const N: usize>(mut a: [[f64; N]; N]) -> usize {
    /// (1 + sqrt 17)/8 bounds the growth.
    const SHARE: f64 = 0.640_388_203_202_208;
    // A congruence with a diagonal matrix changes no sign and makes units irrelevant.
    let mut scale = [1.0; N];
    for i in 0..N {
        let largest = (0..N).fold(0.0_f64, |most, j| most.max(a[i][j].abs().max(a[j][i].abs())));
        let own = a[i][i].abs().max(1e-30 * largest);
        scale[i] = if own > 0.0 { own.sqrt().recip() } else { 1.0 };
    }
    let whole = a;
    for i in 0..N {
        for j in 0..N {
            a[i][j] = 0.5 * (whole[i][j] + whole[j][i]) * (scale[i] * scale[j]);
        }
    }
    let mut left = [true; N];
    let (mut negatives, mut count) = (0, N);
    while count > 0 {
        let (mut diagonal, mut beside, mut p, mut pair) = (-1.0, 0.0, 0, [0, 0]);
        for i in 0..N {
            if left[i] && a[i][i].abs() > diagonal {
                (diagonal, p) = (a[i][i].abs(), i);
            }
            for j in 0..i {
                if left[i] && left[j] && a[i][j].abs() > beside {
                    (beside, pair) = (a[i][j].abs(), [i, j]);
                }
            }
        }
        if diagonal >= SHARE * beside {
            negatives += usize::from(a[p][p] < 0.0);
            left[p] = false;
            count -= 1;
            let row = a[p];
            for i in 0..N {
                for j in 0..N {
                    if left[i] && left[j] && row[p] != 0.0 {
                        a[i][j] -= row[i] * row[j] / row[p];
                    }
                }
            }
            continue;
        }
        let [r, s] = pair;
        negatives += 1;
        (left[r], left[s]) = (false, false);
        count -= 2;
        let (x, y) = (a[r], a[s]);
        let determinant = x[r] * y[s] - x[s] * x[s];
        for i in 0..N {
            for j in 0..N {
                if left[i] && left[j] {
                    let first = y[s] * x[i] - x[s] * y[i];
                    let second = x[r] * y[i] - x[s] * x[i];
                    a[i][j] -= (first * x[j] + second * y[j]) / determinant;
                }
            }
        }
    }
    negatives
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_survive_a_congruence() {
        let mut seed = 1_u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for round in 0..500 {
            let expected = round % 5;
            let mut basis = [[0.0; 4]; 4];
            for entry in basis.as_flattened_mut() {
                *entry = draw();
            }
            let mut a = [[0.0; 4]; 4];
            for k in 0..4 {
                let size = (1.0 + draw()) * if k < expected { -1.0 } else { 1.0 };
                for i in 0..4 {
                    for j in 0..4 {
                        let scale = 1e3_f64.powi(i as i32 + j as i32);
                        a[i][j] += size * basis[k][i] * basis[k][j] * scale;
                    }
                }
            }
            assert_eq!(negative_eigenvalues(a), expected, "round {round}");
        }
        assert_eq!(negative_eigenvalues([[0.0, 1.0], [1.0, 0.0]]), 1);
        assert_eq!(negative_eigenvalues([[0.0, 0.0], [0.0, -1.0]]), 1);
    }

    #[test]
    fn inverse_undoes_badly_scaled_rows() {
        let mut a = [[Complex64::ZERO; 4]; 4];
        for i in 0..4 {
            for j in 0..4 {
                let value = 1.0 / (1.0 + i as f64 + 2.0 * j as f64) + if i == j { 1.0 } else { 0.0 };
                a[i][j] = Complex64::new(value, 0.1 * j as f64) * 1e4_f64.powi(i as i32);
            }
        }
        let b = inverse(a);
        for i in 0..4 {
            for j in 0..4 {
                let sum: Complex64 = (0..4).map(|k| b[i][k] * a[k][j]).sum();
                let one = if i == j { 1.0 } else { 0.0 };
                assert!((sum - one).norm() < 1e-12);
            }
        }
    }
}
