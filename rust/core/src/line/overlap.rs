//! The way through an overlap on a block of lines: a plane of four degrees of freedom.
//!
//! The structure behind, (u, s) of the state in `layer`, begins at the far end, where the near beam ends with g = 0; at
//! the near end the other beam ends with s = g, and the near one continues with the displacement u + d and the load g.
//! Each piece is crossed by its exponential; then elimination with complete pivoting makes four of the eight rows of
//! the basis those of the identity, one of each displacement and its load. The states under a load follow from the
//! coordinates at the near end, piece by piece in the opposite direction.

use crate::line::four::{Candidates, Change, Rows, by_line, eliminate};
use crate::line::layer::{
    DERIVATIVES, Eight, LAYER, LENGTH, PRODUCTS, Pair, Rule, SLOPE, Transfer, Two, mirrored,
};
use crate::line::plane::Plane;
use crate::line::signs::{Line, inverse, negative_at_end, negative_at_piece};
use crate::model::overlap::{Beside, Pieces};
use crate::simd::lane::{C, MAX_LANES, R};
use crate::simd::small::{self, Mat};
use num_complex::Complex64;
use pulp::{Simd, WithSimd};

/// Rows of a basis: four displacements, their loads, the independent variables of the structure behind.
const ROWS: usize = 10;

/// Four coordinates from the two of the near beam.
type Back<S> = [[C<S>; 2]; 4];

/// An overlap on a block of lines.
pub struct Lanes<S: Simd> {
    /// The coefficients, the outer beam lying behind.
    pair: Pair<S>,
    /// How it is cut.
    pieces: Pieces,
    /// Over a piece of each kind, with the inner and with the outer beam behind, where requested.
    ways: [Vec<Transfer<S>>; 2],
    /// Weights of the two ways.
    weights: [[f64; 4]; 2],
    /// Data for derivatives.
    inside: Inside<S>,
    /// The last way through.
    trace: Trace<S>,
}

/// Data of an overlap for derivatives.
struct Inside<S: Simd> {
    /// Whether any are requested.
    requested: bool,
    /// Over half a piece of each kind.
    halves: Vec<Transfer<S>>,
    /// Integrals over a piece of each kind, without points if no product is requested.
    rules: Vec<Rule<S>>,
    /// The products that are integrated.
    products: [bool; PRODUCTS],
}

/// A way through an overlap.
struct Trace<S: Simd> {
    /// Bases at the far end of each piece and at the near end of the last; without derivatives two that are used
    /// alternately.
    bases: Vec<Rows<S, ROWS>>,
    /// The coordinates at the far end of each piece from those at its near end; none without derivatives.
    changes: Vec<Rows<S, 4>>,
    /// The coordinates at the near end from those of the near beam.
    last: Back<S>,
}

/// States of one overlap under one load.
pub struct States<S: Simd> {
    /// In the middle of each piece, from large x to small.
    middles: Vec<Eight<S>>,
    /// Relative motions of the points, from large x to small.
    points: Vec<[C<S>; 2]>,
}

/// Result of a way through an overlap.
pub struct Passed<S: Simd> {
    /// Displacements of the near beam, one column a way to move.
    u: Two<S>,
    /// Its loads.
    f: Two<S>,
    /// The independent variables of the structure behind, in the same columns.
    behind: Two<S>,
    /// Negative pivots on each line, if requested.
    pub negatives: [usize; MAX_LANES],
    /// Logarithm of the factor on the determinant by the changes of coordinates on the way, if requested.
    pub log_determinant: [Complex64; MAX_LANES],
}

/// Output requested besides the plane.
#[derive(Copy, Clone, PartialEq, Eq)]
pub enum Wanted {
    /// Nothing.
    Plane,
    /// The count of negative pivots.
    Count,
    /// The factor of the determinant.
    Determinant,
}

impl<S: Simd> States<S> {
    /// Without states.
    pub fn empty() -> Self {
        Self { middles: Vec::new(), points: Vec::new() }
    }
}

/// Arguments of `Lanes::evaluate`.
struct Evaluated<'a, S: Simd> {
    into: &'a mut Lanes<S>,
    beside: &'a Beside,
    w: C<S>,
    most: f64,
    ways: [bool; 2],
    requested: [bool; DERIVATIVES],
}

// This and the parts below are functions of their own: in line they would be compiled once for each kind of sweep.
impl<S: Simd> WithSimd for Evaluated<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) {
        let Self { into, beside, w, most, ways, requested } = self;
        into.pieces = beside.pieces(most);
        into.pair = Pair::new(beside, w, true);
        into.weights = [beside.weights(most, false), beside.weights(most, true)];
        into.inside.request(&requested, beside.overlap.points > 0);
        let (kinds, growth) = (into.pieces.kinds(), beside.growth(most));
        let largest = into.pieces.size.iter().copied().fold(0.0, f64::max);
        for way in 0..2 {
            let forward = way == 1;
            let inside = forward && into.inside.requested;
            if !ways[way] && !inside {
                continue;
            }
            let powers = Pair::new(beside, w, forward).powers(growth, largest);
            // Only what is new is made: a transfer is large.
            into.ways[way].resize_with(kinds, || Transfer::empty(w.simd));
            if inside {
                into.inside.halves.resize_with(kinds, || Transfer::empty(w.simd));
                into.inside.rules.resize_with(kinds, Rule::empty);
            }
            for kind in 0..kinds {
                let (length, size) = (into.pieces.length[kind], into.pieces.size[kind]);
                if ways[way] {
                    powers.transfer(length, size, &mut into.ways[way][kind]);
                }
                if inside {
                    powers.transfer(0.5 * length, 0.5 * size, &mut into.inside.halves[kind]);
                    if into.inside.products.contains(&true) {
                        into.inside.rules[kind].fill(&powers, length, size);
                    }
                }
            }
        }
    }
}

impl<S: Simd> Inside<S> {
    /// Sets the products that the requested derivatives need.
    fn request(&mut self, requested: &[bool; DERIVATIVES], points: bool) {
        self.requested = requested.contains(&true);
        for i in 0..PRODUCTS {
            // Points have no integrals; the length of a layer changes its stiffness per length.
            self.products[i] =
                if i < LAYER { requested[i] } else { !points && (requested[i] || requested[LENGTH]) };
        }
    }
}

/// The way through an overlap from the plane of the structure behind.
struct Pass<'a, S: Simd, const D: usize> {
    overlap: &'a mut Lanes<S>,
    beside: &'a Beside,
    plane: &'a Plane<S, D>,
    forward: bool,
    wanted: Wanted,
}

impl<S: Simd, const D: usize> WithSimd for Pass<'_, S, D> {
    type Output = Passed<S>;

    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) -> Passed<S> {
        let Self { overlap, beside, plane, forward, wanted } = self;
        let way = usize::from(forward);
        let (pieces, weights) = (overlap.pieces, &overlap.weights[way]);
        let simd = overlap.pair.total[0].simd;
        let mut out = Passed {
            u: [[C::zero(simd); 2]; 2],
            f: [[C::zero(simd); 2]; 2],
            behind: [[C::zero(simd); 2]; 2],
            negatives: [0; MAX_LANES],
            log_determinant: [Complex64::ZERO; MAX_LANES],
        };
        let transfers = &overlap.ways[way];
        let Trace { bases, changes, last: back } = &mut overlap.trace;
        let traced = overlap.inside.requested;
        bases.resize_with(if traced { pieces.count + 1 } else { 2 }, || [[C::zero(simd); 4]; ROWS]);
        changes.clear();
        start(plane, forward, &mut bases[0]);
        let stiff = if wanted == Wanted::Count { stiffnesses(transfers) } else { Vec::new() };
        // Rows of the identity, and those that were last taken as pivots.
        let (mut identity, mut expected) = ([Some(0), Some(1), None, None], [None; 4]);
        let place = |piece: usize| if traced { piece } else { piece % 2 };
        for piece in 0..pieces.count {
            let kind = pieces.kind(piece);
            let Ok([far, near]) = bases.get_disjoint_mut([place(piece), place(piece + 1)]) else { continue };
            transfers[kind].across(far, &identity, near);
            if wanted == Wanted::Count {
                let (far, near) = (by_line(far), by_line(near));
                for lane in 0..S::F64_LANES {
                    out.negatives[lane] += negative_at_piece(&far[lane], &stiff[kind][lane], &near[lane]);
                }
            }
            let change = graph(near, weights, expected);
            if wanted == Wanted::Determinant {
                subtract_logarithms(&mut out.log_determinant, &change);
            }
            if traced {
                changes.push(change.matrix);
            }
            (identity, expected) = (change.taken, change.taken);
            if let Some(point) = pieces.point_after(piece + 1) {
                let side = if forward { 1.0 } else { -1.0 };
                let share = beside.overlap.share(side * pieces.place(point));
                for i in 0..2 {
                    let stiffness = overlap.pair.total[i].scale(share);
                    for column in 0..4 {
                        near[4 + i][column] = stiffness.mul_add(near[i][column], near[4 + i][column]);
                    }
                    identity[i] = identity[i].filter(|row| *row == i);
                }
            }
        }
        let basis = &bases[place(pieces.count)];
        if wanted == Wanted::Count {
            let (_, end) = restrict(basis, [[0, 2], [1, 3]], 1.0, weights);
            for (count, end) in out.negatives.iter_mut().zip(by_line(&end)).take(S::F64_LANES) {
                *count += negative_at_end(&end);
            }
        }
        let (last, end) = restrict(basis, [[6, 4], [7, 5]], -1.0, weights);
        if wanted == Wanted::Determinant {
            subtract_logarithms(&mut out.log_determinant, &last);
        }
        for j in 0..2 {
            for i in 0..2 {
                out.u[i][j] = end[i][2 + j] + end[2 + i][2 + j];
                out.f[i][j] = end[4 + i][2 + j];
                out.behind[i][j] = end[8 + i][2 + j];
            }
            for i in 0..4 {
                back[i][j] = last.matrix[i][2 + j];
            }
            if !forward {
                (out.u[1][j], out.f[1][j]) = (-out.u[1][j], -out.f[1][j]);
            }
        }
        out
    }
}

impl<S: Simd> Passed<S> {
    /// The u rows of the near beam.
    #[inline(always)]
    pub fn near_u<const D: usize>(&self) -> Mat<S, D> {
        small::leading(&self.u)
    }
}

impl<S: Simd> Lanes<S> {
    /// An overlap that is still to be evaluated.
    pub fn empty(beside: &Beside, w: C<S>, most: f64) -> Self {
        let none =
            Inside { requested: false, halves: Vec::new(), rules: Vec::new(), products: [false; PRODUCTS] };
        Self {
            pair: Pair::new(beside, w, true),
            pieces: beside.pieces(most),
            ways: [Vec::new(), Vec::new()],
            weights: [[1.0; 4]; 2],
            inside: none,
            trace: Trace { bases: Vec::new(), changes: Vec::new(), last: [[w; 2]; 4] },
        }
    }

    /// Evaluates it at the lines `w`, the largest |w|^2 of which is `most`, for the `ways` through it (with the inner,
    /// and with the outer beam behind) and the `requested` derivatives.
    #[inline(always)]
    pub fn evaluate(
        &mut self,
        beside: &Beside,
        w: C<S>,
        most: f64,
        ways: [bool; 2],
        requested: [bool; DERIVATIVES],
    ) {
        w.simd.vectorize(Evaluated { into: self, beside, w, most, ways, requested });
    }

    /// The way through, from the plane of the structure behind: the plane of the near beam, and the way back to the
    /// independent variables behind it.
    #[inline(always)]
    pub fn pass<const D: usize>(
        &mut self,
        beside: &Beside,
        plane: &Plane<S, D>,
        forward: bool,
        wanted: Wanted,
    ) -> (Plane<S, D>, Mat<S, D>, Passed<S>) {
        let simd = self.pair.total[0].simd;
        let weights = self.weights_behind(!forward);
        let passed = simd.vectorize(Pass { overlap: self, beside, plane, forward, wanted });
        let (near, inverse) = Plane::pivot(&small::leading(&passed.u), &small::leading(&passed.f), &weights);
        let columns = self.trace.last;
        for i in 0..4 {
            for j in 0..D {
                let mut sum = columns[i][0] * inverse[0][j];
                for k in 1..D {
                    sum = columns[i][k].mul_add(inverse[k][j], sum);
                }
                self.trace.last[i][j] = sum;
            }
        }
        (near, small::mul(&small::leading(&passed.behind), &inverse), passed)
    }

    /// The states within on the last way through, from the independent variables after it.
    #[inline(always)]
    pub fn states<const D: usize>(&self, forward: bool, independent: &[C<S>; D], states: &mut States<S>) {
        let simd = self.pair.total[0].simd;
        let independent = [independent[0], independent[D - 1]];
        simd.vectorize(StatesWithin { overlap: self, forward, independent, states });
    }

    /// Derivatives of H by the coefficients of the overlap from its states under two loads.
    #[inline(always)]
    pub fn derivatives(
        &self,
        w2: C<S>,
        beside: &Beside,
        left: &States<S>,
        right: &States<S>,
    ) -> [C<S>; DERIVATIVES] {
        w2.simd.vectorize(Differentiated { overlap: self, w2, beside, left, right })
    }

    /// Pivot weights of the beam that lies behind.
    pub fn weights_behind<const D: usize>(&self, forward: bool) -> [f64; D] {
        let [.., y, theta] = self.weights[usize::from(forward)];
        let mut out = [y; D];
        out[D - 1] = if D == 1 { y } else { theta };
        out
    }
}

/// The states within an overlap.
struct StatesWithin<'a, S: Simd> {
    overlap: &'a Lanes<S>,
    forward: bool,
    independent: [C<S>; 2],
    states: &'a mut States<S>,
}

impl<S: Simd> WithSimd for StatesWithin<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) {
        let Self { overlap, forward, independent, states } = self;
        states.middles.clear();
        states.points.clear();
        let Trace { bases, changes, last } = &overlap.trace;
        let mut coordinates = [independent[0]; 4];
        for i in 0..4 {
            coordinates[i] = last[i][1].mul_add(independent[1], last[i][0] * independent[0]);
        }
        for (piece, change) in changes.iter().enumerate().rev() {
            let basis = &bases[piece];
            let before = coordinates;
            for i in 0..4 {
                coordinates[i] = combined(&change[i], &before);
            }
            let mut far = [independent[0]; 8];
            for i in 0..8 {
                far[i] = combined(&basis[i], &coordinates);
            }
            if !forward {
                far = mirrored(&far);
            }
            if overlap.pieces.point_after(piece).is_some() {
                states.points.push([far[0], far[1]]);
            }
            let half = &overlap.inside.halves[overlap.pieces.kind(piece)];
            states.middles.push(half.carry(&far, forward));
        }
        if forward {
            states.middles.reverse();
            states.points.reverse();
        }
    }
}

/// Derivatives by the coefficients of an overlap.
struct Differentiated<'a, S: Simd> {
    overlap: &'a Lanes<S>,
    w2: C<S>,
    beside: &'a Beside,
    left: &'a States<S>,
    right: &'a States<S>,
}

impl<S: Simd> WithSimd for Differentiated<'_, S> {
    type Output = [C<S>; DERIVATIVES];

    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) -> [C<S>; DERIVATIVES] {
        let Self { overlap, w2, beside, left, right } = self;
        let zero = C::zero(w2.simd);
        let mut out = [zero; DERIVATIVES];
        let (inside, pieces) = (&overlap.inside, &overlap.pieces);
        let (length, points) = (beside.overlap.length(), beside.overlap.points);
        let mut sums = [zero; PRODUCTS];
        let same = core::ptr::eq(left, right);
        for (piece, (r, s)) in left.middles.iter().zip(&right.middles).enumerate() {
            if let Some(rule) = inside.rules.get(pieces.kind(piece)) {
                rule.integrate(r, if same { None } else { Some(s) }, &inside.products, &mut sums);
            }
        }
        for i in 0..4 {
            out[i] = sums[i] * w2;
            out[4 + i] = sums[4 + i];
        }
        for i in 0..2 {
            out[LAYER + i] = -sums[LAYER + i].scale(1.0 / length);
        }
        for (point, (r, s)) in left.points.iter().zip(&right.points).enumerate() {
            let place = pieces.place(point);
            for i in 0..2 {
                let work = r[i] * s[i];
                out[LAYER + i] = out[LAYER + i] - work.scale(beside.overlap.share(place));
                let by_share = overlap.pair.total[i] * work.scale(place / points as f64);
                out[SLOPE] = out[SLOPE] - by_share;
            }
        }
        out[LENGTH] = by_length(overlap, length, left, right);
        if points == 0 {
            // The totals are held: a longer layer is softer per length.
            for i in 0..2 {
                let per_length = overlap.pair.total[i].scale(1.0 / length);
                out[LENGTH] = per_length.neg_mul_add(out[LAYER + i], out[LENGTH]);
            }
        }
        out
    }
}

/// The derivative by the length, the stiffness per length of the layer being held.
///
/// Its density is constant between two points; it is taken where its terms are smallest and cancel least.
#[inline(always)]
fn by_length<S: Simd>(overlap: &Lanes<S>, length: f64, left: &States<S>, right: &States<S>) -> C<S> {
    let pieces = &overlap.pieces;
    let simd = overlap.pair.total[0].simd;
    let mut sum = C::zero(simd);
    let (mut least, mut best, mut stretch) = (R::splat(simd, f64::INFINITY), sum, 0.0);
    for (piece, (r, s)) in left.middles.iter().zip(&right.middles).enumerate() {
        let (size, value) = overlap.pair.density(r, s);
        best = C::select(least.greater(size), value, best);
        least = R::select(least.greater(size), size, least);
        stretch += pieces.length[pieces.kind(piece)] / length;
        if pieces.point_after(piece + 1).is_some() || piece + 1 == pieces.count {
            sum = sum + best.scale(stretch);
            (least, stretch) = (R::splat(simd, f64::INFINITY), 0.0);
        }
    }
    sum
}

/// The basis at the far end: the end of the near beam is free, the structure behind moves according to its plane.
#[inline(always)]
fn start<S: Simd, const D: usize>(plane: &Plane<S, D>, forward: bool, basis: &mut Rows<S, ROWS>) {
    let (u, f) = plane.basis();
    let simd = u[0][0].simd;
    *basis = [[C::zero(simd); 4]; ROWS];
    for i in 0..D {
        basis[i][i] = C::real(simd, 1.0);
        basis[8 + i][2 + i] = C::real(simd, 1.0);
        for j in 0..D {
            // Slopes and moments turn their signs with the way.
            let turned = i == 1 && !forward;
            basis[2 + i][2 + j] = if turned { -u[i][j] } else { u[i][j] };
            basis[6 + i][2 + j] = if turned { -f[i][j] } else { f[i][j] };
        }
    }
}

/// One over the square of the largest entry of each column, rows being made comparable by the weights.
#[inline(always)]
fn columns<S: Simd>(basis: &Rows<S, ROWS>, scale: &[f64; 8]) -> [R<S>; 4] {
    let mut out = [R::splat(basis[0][0].simd, 0.0); 4];
    for j in 0..4 {
        for i in 0..8 {
            out[j] = out[j].max(basis[i][j].norm_sqr().scale(scale[i]));
        }
        out[j] = out[j].recip();
    }
    out
}

/// Factors on the squares of displacements and loads that make them comparable.
#[inline(always)]
fn scales(weights: &[f64; 4]) -> [f64; 8] {
    let [a, b, c, d] = *weights;
    [a, b, c, d, 1.0 / a, 1.0 / b, 1.0 / c, 1.0 / d]
}

/// Makes the basis a graph over one of each displacement and its load.
#[inline(always)]
fn graph<S: Simd>(basis: &mut Rows<S, ROWS>, weights: &[f64; 4], expected: [Option<usize>; 4]) -> Change<S> {
    let scale = scales(weights);
    let among = Candidates { scale: &scale, groups: 4, columns: columns(basis, &scale), expected };
    eliminate(basis, among)
}

/// Restricts a basis to where two sums of rows a + sign b are zero: its last two columns.
#[inline(always)]
fn restrict<S: Simd>(
    basis: &Rows<S, ROWS>,
    sums: [[usize; 2]; 2],
    sign: f64,
    weights: &[f64; 4],
) -> (Change<S>, Rows<S, ROWS>) {
    let scale = scales(weights);
    let mut rows = [basis[0]; ROWS + 2];
    rows[2..].copy_from_slice(basis);
    for (i, [a, b]) in sums.into_iter().enumerate() {
        for j in 0..4 {
            rows[i][j] = basis[a][j] + basis[b][j].scale(sign);
        }
    }
    let own = [scale[sums[0][0]], scale[sums[1][0]]];
    let among = Candidates { scale: &own, groups: 2, columns: columns(basis, &scale), expected: [None; 4] };
    let change = eliminate(&mut rows, among);
    let mut out = *basis;
    out.copy_from_slice(&rows[2..]);
    (change, out)
}

/// A row times coordinates.
#[inline(always)]
fn combined<S: Simd>(row: &[C<S>; 4], coordinates: &[C<S>; 4]) -> C<S> {
    let mut sum = row[0] * coordinates[0];
    for k in 1..4 {
        sum = row[k].mul_add(coordinates[k], sum);
    }
    sum
}

/// Subtracts the logarithms of the determinants of a change of coordinates.
#[inline(always)]
fn subtract_logarithms<S: Simd>(sums: &mut [Complex64; MAX_LANES], change: &Change<S>) {
    let mut lanes = [Complex64::ONE; MAX_LANES];
    change.determinant.store(&mut lanes);
    for (sum, determinant) in sums.iter_mut().zip(lanes) {
        *sum -= determinant.ln();
    }
}

/// Loads at the far end per displacement at the near one, of a piece of each kind alone.
fn stiffnesses<S: Simd>(transfers: &[Transfer<S>]) -> Vec<[Line<4>; MAX_LANES]> {
    let mut out = Vec::with_capacity(transfers.len());
    for transfer in transfers {
        let mut lines = by_line(&transfer.compliance());
        for line in &mut lines[..S::F64_LANES] {
            *line = inverse(*line);
        }
        out.push(lines);
    }
    out
}
