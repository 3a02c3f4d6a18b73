//! Algebra of the four columns that span the states of an overlap: elimination over lanes, signs of eigenvalues.

use crate::simd::lane::{C, MAX_LANES, R};
use num_complex::Complex64;
use pulp::{Scalar, Simd};

/// Rows of four columns.
pub type Rows<S, const N: usize> = [[C<S>; 4]; N];
/// Rows of four columns on one line.
pub type Line<const N: usize> = [[Complex64; 4]; N];

/// A pivot is taken for all lanes where its square is at least this share of the largest one of each lane.
const ALIKE: f64 = 0.01;

/// The same for a pivot that is tried first.
const EXPECTED: f64 = 0.1;

/// `a b`.
#[inline(always)]
pub fn product<S: Simd, const N: usize>(a: &Rows<S, N>, b: &Rows<S, 4>) -> Rows<S, N> {
    let mut out = *a;
    for (to, from) in out.iter_mut().zip(a) {
        for j in 0..4 {
            let mut sum = from[0] * b[0][j];
            for k in 1..4 {
                sum = from[k].mul_add(b[k][j], sum);
            }
            to[j] = sum;
        }
    }
    out
}

/// The identity.
#[inline(always)]
pub fn identity<S: Simd>(simd: S) -> Rows<S, 4> {
    let mut out = [[C::zero(simd); 4]; 4];
    for i in 0..4 {
        out[i][i] = C::real(simd, 1.0);
    }
    out
}

/// Rows that may become pivots: the first ones of a basis.
#[derive(Copy, Clone)]
pub struct Candidates<'a, S: Simd> {
    /// Factors on the squares that make the rows comparable.
    pub scale: &'a [f64],
    /// One of the rows i, i + `groups`, ... is taken for each i.
    pub groups: usize,
    /// One over the square of the largest entry of each column.
    pub columns: [R<S>; 4],
    /// The row of each group that is tried first, in the column of the group's number.
    pub expected: [Option<usize>; 4],
}

/// The change of columns by an elimination.
#[derive(Copy, Clone)]
pub struct Change<S: Simd> {
    /// Old coordinates from the new ones.
    pub matrix: Rows<S, 4>,
    /// Its determinant.
    pub determinant: C<S>,
    /// The row of each group that is one of the identity now; none where that differs from lane to lane.
    pub taken: [Option<usize>; 4],
}

/// The row and the column of each group so far.
type Taken = [Option<(usize, usize)>; 4];

/// Column operations that make one row of each group a row of the identity, the column being that of the group.
///
/// Pivots are complete. Lanes that have no pivot in common are taken one by one.
#[inline(always)]
pub fn eliminate<S: Simd, const N: usize>(rows: &mut Rows<S, N>, among: Candidates<'_, S>) -> Change<S> {
    let simd = rows[0][0].simd;
    let mut change = Change { matrix: identity(simd), determinant: C::real(simd, 1.0), taken: [None; 4] };
    let mut taken = [None; 4];
    for _ in 0..among.groups {
        let Some((row, column)) = pivot(rows, &among, &taken) else {
            apart(rows, &mut change, &among, taken);
            return change;
        };
        step(rows, &mut change, &taken, row, column);
        taken[row % among.groups] = Some((row, column));
    }
    arrange(rows, &mut change, &taken);
    for (to, from) in change.taken.iter_mut().zip(taken) {
        *to = from.map(|(row, _)| row);
    }
    change
}

/// Columns that are taken.
#[inline(always)]
fn used(taken: &Taken) -> [bool; 4] {
    let mut out = [false; 4];
    for (_, column) in taken.iter().flatten() {
        out[*column] = true;
    }
    out
}

/// A pivot that is expected and good, or else the one that is best in the lane where it is worst, if it is about as
/// good as the best one of each lane.
#[inline(always)]
fn pivot<S: Simd, const N: usize>(
    rows: &Rows<S, N>,
    among: &Candidates<'_, S>,
    taken: &Taken,
) -> Option<(usize, usize)> {
    let simd = rows[0][0].simd;
    let used = used(taken);
    let mut shares = [[R::splat(simd, 0.0); 4]; 8];
    let mut most = R::splat(simd, 0.0);
    for (i, scale) in among.scale.iter().enumerate() {
        if taken[i % among.groups].is_some() {
            continue;
        }
        for j in 0..4 {
            if !used[j] {
                shares[i][j] = (rows[i][j].norm_sqr() * among.columns[j]).scale(*scale);
                most = most.max(shares[i][j]);
            }
        }
    }
    let most = most.recip();
    for (group, expected) in among.expected.iter().enumerate() {
        if let (Some(row), None, false) = (expected, taken[group], used[group])
            && (shares[*row][group] * most).least() >= EXPECTED
        {
            return Some((*row, group));
        }
    }
    let (mut found, mut at) = (-1.0, None);
    for i in 0..among.scale.len() {
        for j in 0..4 {
            if taken[i % among.groups].is_none() && !used[j] {
                let least = (shares[i][j] * most).least();
                // What is not a number is taken where nothing else is there.
                if least > found || at.is_none() {
                    (found, at) = (least, Some((i, j)));
                }
            }
        }
    }
    at.filter(|_| found >= ALIKE || S::F64_LANES == 1)
}

/// One pivot: its row becomes one of the identity.
#[inline(always)]
fn step<S: Simd, const N: usize>(
    rows: &mut Rows<S, N>,
    change: &mut Change<S>,
    taken: &Taken,
    row: usize,
    column: usize,
) {
    let inverse = rows[row][column].recip();
    let factors = rows[row];
    // Rows of the identity stay what they are; in the change they are those of columns that were not used yet.
    let (mut still, mut used) = ([false; N], used(taken));
    for (row, _) in taken.iter().flatten() {
        still[*row] = true;
    }
    used[column] = true;
    for (row, still) in rows.iter_mut().zip(still) {
        if !still {
            sweep_columns(row, inverse, &factors, column);
        }
    }
    for (row, used) in change.matrix.iter_mut().zip(used) {
        if used {
            sweep_columns(row, inverse, &factors, column);
        }
    }
    change.determinant = change.determinant * inverse;
    // What is one and zero in exact arithmetic is so here.
    rows[row] = [C::zero(inverse.simd); 4];
    rows[row][column] = C::real(inverse.simd, 1.0);
}

/// Column operations on a row that leave nothing but the pivot in its own.
#[inline(always)]
fn sweep_columns<S: Simd>(row: &mut [C<S>; 4], inverse: C<S>, factors: &[C<S>; 4], column: usize) {
    let scaled = row[column] * inverse;
    for j in 0..4 {
        row[j] = scaled.neg_mul_add(factors[j], row[j]);
    }
    row[column] = scaled;
}

/// Puts the column of each group in the group's place, and the others behind in their order.
#[inline(always)]
fn arrange<S: Simd, const N: usize>(rows: &mut Rows<S, N>, change: &mut Change<S>, taken: &Taken) {
    let mut order = [0, 1, 2, 3];
    let used = used(taken);
    let mut rest = (0..4).filter(|column| !used[*column]);
    for (to, taken) in order.iter_mut().zip(taken) {
        *to = taken.map(|(_, column)| column).or_else(|| rest.next()).unwrap_or(*to);
    }
    if order == [0, 1, 2, 3] {
        return;
    }
    for row in rows.iter_mut().chain(&mut change.matrix) {
        let before = *row;
        for (to, column) in row.iter_mut().zip(order) {
            *to = before[column];
        }
    }
    let inversions = (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|(i, j)| order[*j] > order[*i]);
    if inversions.count() % 2 == 1 {
        change.determinant = -change.determinant;
    }
}

/// The rest of an elimination lane by lane.
#[inline(never)]
fn apart<S: Simd, const N: usize>(
    rows: &mut Rows<S, N>,
    change: &mut Change<S>,
    among: &Candidates<'_, S>,
    taken: Taken,
) {
    let simd = change.determinant.simd;
    let scalar = Scalar::new();
    let (mut lines, mut changes) = (by_line(rows), by_line(&change.matrix));
    let mut determinants = [Complex64::ONE; MAX_LANES];
    change.determinant.store(&mut determinants);
    let mut columns = [[0.0; MAX_LANES]; 4];
    for (to, from) in columns.iter_mut().zip(among.columns) {
        from.store(to);
    }
    for lane in 0..S::F64_LANES {
        let splat = |value: Complex64| C::splat(scalar, value);
        let mut rows = lines[lane].map(|row| row.map(splat));
        let (matrix, determinant) = (changes[lane].map(|row| row.map(splat)), splat(determinants[lane]));
        let mut change = Change { matrix, determinant, taken: [None; 4] };
        let columns = columns.map(|column| R::splat(scalar, column[lane]));
        let among = Candidates { scale: among.scale, groups: among.groups, columns, expected: [None; 4] };
        let mut taken = taken;
        while let Some((row, column)) = pivot(&rows, &among, &taken) {
            step(&mut rows, &mut change, &taken, row, column);
            taken[row % among.groups] = Some((row, column));
        }
        arrange(&mut rows, &mut change, &taken);
        let number = |value: C<Scalar>| Complex64::new(value.re, value.im);
        lines[lane] = rows.map(|row| row.map(number));
        changes[lane] = change.matrix.map(|row| row.map(number));
        determinants[lane] = number(change.determinant);
    }
    *rows = over_lanes(simd, &lines);
    change.matrix = over_lanes(simd, &changes);
    change.determinant = C::load(simd, &determinants);
}

/// The lanes of some rows, one by one.
#[inline(always)]
pub fn by_line<S: Simd, const N: usize>(rows: &Rows<S, N>) -> [Line<N>; MAX_LANES] {
    let mut out = [[[Complex64::ZERO; 4]; N]; MAX_LANES];
    let mut lanes = [Complex64::ZERO; MAX_LANES];
    for (i, row) in rows.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            entry.store(&mut lanes);
            for (line, value) in out.iter_mut().zip(lanes) {
                line[i][j] = value;
            }
        }
    }
    out
}

/// The way back from `by_line`.
#[inline(always)]
fn over_lanes<S: Simd, const N: usize>(simd: S, lines: &[Line<N>; MAX_LANES]) -> Rows<S, N> {
    let mut out = [[C::zero(simd); 4]; N];
    for i in 0..N {
        for j in 0..4 {
            let lanes = lines.map(|line| line[i][j]);
            out[i][j] = C::load(simd, &lanes);
        }
    }
    out
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
