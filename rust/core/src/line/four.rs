//! Elimination of the four columns that span the states of an overlap, over lanes.

use crate::line::signs::Line;
use crate::simd::lane::{C, MAX_LANES, R};
use crate::simd::small;
use num_complex::Complex64;
use pulp::{Scalar, Simd};

/// Rows of four columns.
pub type Rows<S, const N: usize> = [[C<S>; 4]; N];

/// A pivot is taken for all lanes where its square is at least this share of the largest one of each lane.
const ALIKE: f64 = 0.01;

/// The same for a pivot that is tried first.
const EXPECTED: f64 = 0.1;

/// Multiplies rows by a matrix from the right.
#[inline(always)]
pub fn multiply<S: Simd, const N: usize>(rows: &mut Rows<S, N>, by: &Rows<S, 4>) {
    for row in rows {
        let from = *row;
        for j in 0..4 {
            let mut sum = from[0] * by[0][j];
            for k in 1..4 {
                sum = from[k].mul_add(by[k][j], sum);
            }
            row[j] = sum;
        }
    }
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
    let mut change =
        Change { matrix: small::identity(simd), determinant: C::real(simd, 1.0), taken: [None; 4] };
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

/// An expected pivot if it is good, otherwise the pivot with the largest minimum over the lanes, if it is about as good
/// as the best one of each lane.
#[inline(always)]
fn pivot<S: Simd, const N: usize>(
    rows: &Rows<S, N>,
    among: &Candidates<'_, S>,
    taken: &Taken,
) -> Option<(usize, usize)> {
    let used = used(taken);
    // The shares are not kept: they are rarely needed again, and room for all of them would have to be cleared first.
    let mut most = R::splat(rows[0][0].simd, 0.0);
    for i in 0..among.scale.len() {
        if taken[i % among.groups].is_some() {
            continue;
        }
        for j in 0..4 {
            if !used[j] {
                most = most.max(share(rows, among, i, j));
            }
        }
    }
    let most = most.recip();
    for (group, expected) in among.expected.iter().enumerate() {
        if let (Some(row), None, false) = (expected, taken[group], used[group])
            && (share(rows, among, *row, group) * most).least() >= EXPECTED
        {
            return Some((*row, group));
        }
    }
    let (mut found, mut at) = (-1.0, None);
    for i in 0..among.scale.len() {
        for j in 0..4 {
            if taken[i % among.groups].is_none() && !used[j] {
                let least = (share(rows, among, i, j) * most).least();
                // A NaN is chosen only if there is nothing else.
                if least > found || at.is_none() {
                    (found, at) = (least, Some((i, j)));
                }
            }
        }
    }
    at.filter(|_| found >= ALIKE || S::F64_LANES == 1)
}

/// The square of an entry as a share of the largest one of its column, rows being made comparable.
#[inline(always)]
fn share<S: Simd, const N: usize>(rows: &Rows<S, N>, among: &Candidates<'_, S>, i: usize, j: usize) -> R<S> {
    (rows[i][j].norm_sqr() * among.columns[j]).scale(among.scale[i])
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
    // Rows of the identity do not change; in the change they are those of columns that are not used yet.
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
    // Exactly one and zero, without rounding.
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

/// The inverse of `by_line`.
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

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    /// Lanes of which each needs other pivots than its neighbours.
    struct Unlike;

    impl WithSimd for Unlike {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            let mut seed = 1_u64;
            let mut draw = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
            };
            let mut lines = [[[Complex64::ZERO; 4]; 10]; MAX_LANES];
            for (lane, line) in lines.iter_mut().enumerate() {
                for entry in line.as_flattened_mut() {
                    *entry = Complex64::new(draw(), draw()) * 1e-6;
                }
                for group in 0..4 {
                    line[group + 4 * ((lane >> (group % 3)) & 1)][(group + lane) % 4] += 1.0;
                }
            }
            let before = over_lanes(simd, &lines);
            for alike in [false, true] {
                let mut rows = if alike { over_lanes(simd, &[lines[5]; MAX_LANES]) } else { before };
                let old = by_line(&rows);
                let columns = [R::splat(simd, 1.0); 4];
                let among = Candidates { scale: &[1.0; 8], groups: 4, columns, expected: [None; 4] };
                let change = eliminate(&mut rows, among);
                let mut determinants = [Complex64::ZERO; MAX_LANES];
                change.determinant.store(&mut determinants);
                let (new, matrix) = (by_line(&rows), by_line(&change.matrix));
                for lane in 0..S::F64_LANES {
                    for group in 0..4 {
                        let unit = |row: usize| {
                            (0..4).all(|j| {
                                new[lane][row][j] == Complex64::from(f64::from(u8::from(j == group)))
                            })
                        };
                        assert!(unit(group) || unit(group + 4), "lane {lane}, group {group}");
                    }
                    for i in 0..10 {
                        for j in 0..4 {
                            let sum: Complex64 = (0..4).map(|k| old[lane][i][k] * matrix[lane][k][j]).sum();
                            assert!((sum - new[lane][i][j]).norm() < 1e-14, "lane {lane}, row {i}");
                        }
                    }
                    // A permutation but for small terms.
                    let size = determinants[lane].norm();
                    assert!((size - 1.0).abs() < 1e-4 && size > 0.0, "lane {lane}: {size}");
                }
            }
        }
    }

    #[test]
    fn lanes_with_pivots_of_their_own() {
        Arch::new().dispatch(Unlike);
    }
}
