//! Algebra of the D x D blocks that belong to one frequency line (D = 1 for rods, 2 for bending).

use crate::simd::lane::C;
use pulp::Simd;

/// A D x D matrix, row by row.
pub type Mat<S, const D: usize> = [[C<S>; D]; D];

/// The zero matrix.
#[inline(always)]
pub fn zeros<S: Simd, const D: usize>(simd: S) -> Mat<S, D> {
    [[C::zero(simd); D]; D]
}

/// The identity.
#[inline(always)]
pub fn identity<S: Simd, const D: usize>(simd: S) -> Mat<S, D> {
    let mut out = zeros(simd);
    for i in 0..D {
        out[i][i] = C::real(simd, 1.0);
    }
    out
}

/// The leading entries of a 2 x 2 matrix.
#[inline(always)]
pub fn leading<S: Simd, const D: usize>(from: &Mat<S, 2>) -> Mat<S, D> {
    let mut out = zeros(from[0][0].simd);
    for i in 0..D {
        for j in 0..D {
            out[i][j] = from[i][j];
        }
    }
    out
}

/// `a b`.
#[inline(always)]
pub fn mul<S: Simd, const D: usize>(a: &Mat<S, D>, b: &Mat<S, D>) -> Mat<S, D> {
    let mut out = *a;
    for i in 0..D {
        for j in 0..D {
            let mut sum = a[i][0] * b[0][j];
            for k in 1..D {
                sum = a[i][k].mul_add(b[k][j], sum);
            }
            out[i][j] = sum;
        }
    }
    out
}

/// `c + a b`.
#[inline(always)]
pub fn mul_add<S: Simd, const D: usize>(a: &Mat<S, D>, b: &Mat<S, D>, c: &Mat<S, D>) -> Mat<S, D> {
    let mut out = *c;
    for i in 0..D {
        for j in 0..D {
            for k in 0..D {
                out[i][j] = a[i][k].mul_add(b[k][j], out[i][j]);
            }
        }
    }
    out
}

/// `a + b`.
#[inline(always)]
pub fn add<S: Simd, const D: usize>(a: &Mat<S, D>, b: &Mat<S, D>) -> Mat<S, D> {
    let mut out = *a;
    for i in 0..D {
        for j in 0..D {
            out[i][j] = a[i][j] + b[i][j];
        }
    }
    out
}

/// `a v`.
#[inline(always)]
pub fn apply<S: Simd, const D: usize>(a: &Mat<S, D>, v: &[C<S>; D]) -> [C<S>; D] {
    let mut out = *v;
    for i in 0..D {
        let mut sum = a[i][0] * v[0];
        for k in 1..D {
            sum = a[i][k].mul_add(v[k], sum);
        }
        out[i] = sum;
    }
    out
}

/// Determinant of a 1 x 1 or 2 x 2 matrix.
#[inline(always)]
pub fn det<S: Simd, const D: usize>(a: &Mat<S, D>) -> C<S> {
    const { assert!(D == 1 || D == 2, "one or two degrees of freedom a node") };
    if D == 1 { a[0][0] } else { a[0][1].neg_mul_add(a[1][0], a[0][0] * a[1][1]) }
}

/// Adjugate: the inverse times the determinant.
#[inline(always)]
pub fn adjugate<S: Simd, const D: usize>(a: &Mat<S, D>) -> Mat<S, D> {
    let mut out = identity(a[0][0].simd);
    if D == 2 {
        out[0][0] = a[1][1];
        out[0][1] = -a[0][1];
        out[1][0] = -a[1][0];
        out[1][1] = a[0][0];
    }
    out
}

/// `factor a`.
#[inline(always)]
pub fn scale<S: Simd, const D: usize>(a: &Mat<S, D>, factor: C<S>) -> Mat<S, D> {
    let mut out = *a;
    for row in &mut out {
        for entry in row {
            *entry = *entry * factor;
        }
    }
    out
}

/// Inverse by the adjugate.
#[inline(always)]
pub fn inverse<S: Simd, const D: usize>(a: &Mat<S, D>) -> Mat<S, D> {
    scale(&adjugate(a), det(a).recip())
}

/// A column of a matrix.
#[inline(always)]
pub fn column<S: Simd, const D: usize>(matrix: &Mat<S, D>, j: usize) -> [C<S>; D] {
    let mut out = matrix[0];
    for i in 0..D {
        out[i] = matrix[i][j];
    }
    out
}
