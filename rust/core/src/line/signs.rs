//! Counts of the negative pivots of an overlap on a single line.

use nalgebra::Matrix4;
use num_complex::Complex64;

/// Rows of four columns.
pub type Line<const N: usize> = [[Complex64; 4]; N];

/// The inverse by elimination with row pivoting, the rows divided by their largest entries; not a number where there is
/// none.
pub fn inverse(matrix: Line<4>) -> Line<4> {
    let scale = matrix.map(|row| row.iter().fold(0.0_f64, |most, value| most.max(value.norm())));
    let scaled = Matrix4::from_fn(|i, j| matrix[i][j] / scale[i]);
    let inverse = scaled.lu().try_inverse().unwrap_or(Matrix4::from_element(f64::NAN.into()));
    core::array::from_fn(|i| core::array::from_fn(|j| inverse[(i, j)] / scale[j]))
}

/// Negative eigenvalues of the pivot at a piece's far end, K U_near U_far^-1 with K the piece's stiffness.
///
/// They are those of U_far^T K U_near, without the inverse of a matrix that may be singular.
pub fn negative_at_piece<const N: usize>(far: &Line<N>, stiffness: &Line<4>, near: &Line<N>) -> usize {
    let mut right = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            right[i][j] = (0..4).map(|k| stiffness[i][k] * near[k][j]).sum::<Complex64>().re;
        }
    }
    let mut form = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            form[i][j] = (0..4).map(|k| far[k][i].re * right[k][j]).sum();
        }
    }
    negative_eigenvalues(form)
}

/// Negative eigenvalues of the pivot of the end of the beam that lies behind, the near one being held.
pub fn negative_at_end<const N: usize>(held: &Line<N>) -> usize {
    let mut form = [[0.0; 2]; 2];
    for i in 0..2 {
        for j in 0..2 {
            for k in 0..2 {
                let load = held[6 + k][2 + j] - held[4 + k][2 + j];
                form[i][j] += (held[2 + k][2 + i] * load).re;
            }
        }
    }
    negative_eigenvalues(form)
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
