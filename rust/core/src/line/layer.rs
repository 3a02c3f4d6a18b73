//! The way through an overlap on one frequency line: a plane of four degrees of freedom.
//!
//! The state is (d, u, g, s): the motion d of the near beam (which ends here and goes on at the other end) relative
//! to the one that lies behind, the motion u of the latter, the load g on the near beam and the load s on both. A
//! stiff layer then multiplies only the relative motion, and the small loads of the whole keep their
//! digits. What lies behind, (u, s), comes in at the far end, where the near beam ends with g = 0; at the near end
//! the other beam ends with s = g, and the near one goes on with the displacement u + d and the load g. Each piece is
//! crossed by the exponential of the eight equations, then the basis is made a graph over four of the eight rows
//! again, one of each displacement and its load, by elimination with complete pivoting. From the other side the
//! beams change their roles, and slopes and moments their signs.
//!
//! Derivatives by the coefficients of an overlap follow from its states under two loads.
//! As for a segment, dH = -int r^T J dA s dx; the states within a piece are the power series of the eight equations,
//! and their products are integrated by Gauss and Legendre's rule, which leaves out less than a rounding error over
//! the growth that a piece may have.

use crate::line::four::{Basis, Four, determinant, graph, inverse, negative_eigenvalues, restrict};
use crate::model::overlap::{Beside, Pieces};
use num_complex::Complex64;

const ZERO: Complex64 = Complex64::ZERO;
const ONE: Complex64 = Complex64::ONE;

/// A state (d_y, d_theta, y, theta, g_F, g_M, s_F, s_M).
pub type Eight = [Complex64; 8];
/// A 2 x 2 matrix.
pub type Two = [[Complex64; 2]; 2];

/// Coefficients of the equations on one line, the near beam first.
#[derive(Copy, Clone)]
pub struct Pair {
    /// Compliances per length.
    pub compliance: Two,
    /// w^2 times the inertias per length.
    pub inertia: Two,
    /// Stiffness of the layer per length.
    pub layer: [Complex64; 2],
    /// Stiffness of all points together.
    points: [Complex64; 2],
}

/// An overlap on one line, as seen when the outer or the inner beam lies behind.
pub struct Line {
    /// The coefficients.
    pub pair: Pair,
    /// The way across one piece.
    transfer: [Eight; 8],
    /// Shares of the points in the whole stiffness, in the order in which they are passed.
    shares: Vec<f64>,
}

/// Result of a way through an overlap.
pub struct Passed {
    /// Displacements of the near beam, one column a way to move.
    pub u: Two,
    /// Its loads.
    pub f: Two,
    /// The independent variables of what lies behind, in the same columns.
    pub behind: Two,
    /// Negative pivots, if requested.
    pub negatives: usize,
    /// Logarithm of the factor on the determinant by the changes of coordinates on the way, if requested.
    pub log_determinant: Complex64,
    /// States (rows) in the same columns, if requested: at the far end of each piece, or at the near
    /// one of each where the inner beam lies behind; from the far end on.
    pub states: Vec<[[Complex64; 2]; 8]>,
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
    /// The states at the pieces' ends of larger x, the outer beam (`true`) or the inner one lying behind.
    States(bool),
}

impl Pair {
    /// The coefficients at a line.
    pub fn new(beside: &Beside, w: Complex64, forward: bool) -> Self {
        let order = if forward { [0, 1] } else { [1, 0] };
        let beams = order.map(|i| &beside.beams[i].per_length);
        let total = beside.overlap.stiffness(w);
        let (length, points) = (beside.overlap.length(), beside.overlap.points);
        let zero = [ZERO; 2];
        let spread = total.map(|k| k / length);
        Self {
            compliance: beams.map(|beam| beam.compliance),
            inertia: beams.map(|beam| beam.kinetic.map(|m| m * (w * w))),
            layer: if points == 0 { spread } else { zero },
            points: if points == 0 { zero } else { total },
        }
    }

    /// The change of a state per length towards the near end, times `h`.
    #[inline(always)]
    pub fn along(&self, z: &Eight, h: f64) -> Eight {
        let [near, behind] = self.compliance;
        let [near_inertia, behind_inertia] = self.inertia;
        let rest = [z[6] - z[4], z[7] - z[5]];
        let moved = [z[0] + z[2], z[1] + z[3]];
        let near_load = [near_inertia[0] * moved[0], near_inertia[1] * moved[1]];
        let turned = behind[1] * rest[1];
        let sheared = behind[0] * rest[0];
        [
            (near[0] * z[4] - sheared - z[1]) * h,
            (near[1] * z[5] - turned) * h,
            (sheared - z[3]) * h,
            turned * h,
            (self.layer[0] * z[0] - near_load[0]) * h,
            (self.layer[1] * z[1] - near_load[1] + z[4]) * h,
            -(behind_inertia[0] * z[2] + near_load[0]) * h,
            (z[6] - behind_inertia[1] * z[3] - near_load[1]) * h,
        ]
    }
}

/// Terms of the exponential series that leave out less than a rounding error at the growth exponent `size`.
pub fn terms(size: f64) -> usize {
    let (mut order, mut term) = (1.0, size);
    while term > 1e-19 && order < 60.0 {
        order += 1.0;
        term *= size / order;
    }
    order as usize + 4
}

impl Line {
    /// The way across one piece at a line.
    pub fn new(beside: &Beside, pieces: &Pieces, w: Complex64, forward: bool) -> Self {
        let pair = Pair::new(beside, w, forward);
        let mut transfer = [[ZERO; 8]; 8];
        let terms = terms(pieces.size);
        for column in 0..8 {
            let mut term = [ZERO; 8];
            term[column] = ONE;
            let mut sum = term;
            for order in 1..=terms {
                term = pair.along(&term, pieces.length / order as f64);
                for i in 0..8 {
                    sum[i] += term[i];
                }
            }
            for i in 0..8 {
                transfer[i][column] = sum[i];
            }
        }
        let places = (1..=pieces.count).filter(|&passed| pieces.point_after(passed));
        let side = if forward { 1.0 } else { -1.0 };
        let shares = places.map(|passed| beside.overlap.share(side * pieces.place(passed))).collect();
        Self { pair, transfer, shares }
    }

    /// From the plane of what lies behind, (u, f) rows over its independent variables, to that of the near beam.
    pub fn pass(&self, pieces: &Pieces, behind: [Two; 2], weights: &[f64; 4], wanted: Wanted) -> Passed {
        let mut basis = start(&behind);
        let (mut negatives, mut log_determinant) = (0, ZERO);
        let mut trace: Vec<(Basis, Four)> = Vec::new();
        let mut shares = self.shares.iter();
        let stiff = if wanted == Wanted::Count { self.stiffness() } else { [[ZERO; 4]; 4] };
        for piece in 1..=pieces.count {
            let mut near = self.across(&basis);
            if wanted == Wanted::Count {
                negatives += negative_at_piece(&basis, &stiff, &near);
            }
            let change = graph(&mut near, weights);
            match wanted {
                Wanted::Determinant => log_determinant -= determinant(change).ln(),
                Wanted::States(true) => trace.push((basis, change)),
                Wanted::States(false) => trace.push((near, change)),
                _ => {}
            }
            if pieces.point_after(piece) {
                let share = shares.next().copied().unwrap_or_default();
                for i in 0..2 {
                    for column in 0..4 {
                        let load = self.pair.points[i] * share * near[i][column];
                        near[4 + i][column] += load;
                    }
                }
            }
            basis = near;
        }
        if wanted == Wanted::Count {
            negatives += negative_at_end(basis, weights);
        }
        let mut end = basis;
        let ([first, second], last) = restrict(&mut end, &[[6, 4], [7, 5]], -1.0, weights);
        if wanted == Wanted::Determinant {
            log_determinant += (restricted(&end, [first, second]) / determinant(last)).ln();
        }
        let mut out = Passed {
            u: [[ZERO; 2]; 2],
            f: [[ZERO; 2]; 2],
            behind: [[ZERO; 2]; 2],
            negatives,
            log_determinant,
            states: Vec::new(),
        };
        for i in 0..2 {
            for (to, from) in [first, second].into_iter().enumerate() {
                out.u[i][to] = end[i][from] + end[2 + i][from];
                out.f[i][to] = end[4 + i][from];
                out.behind[i][to] = end[8 + i][from];
            }
        }
        if matches!(wanted, Wanted::States(_)) {
            out.states = states(&last, [first, second], &trace, wanted == Wanted::States(true));
        }
        out
    }

    /// The basis at the near end of a piece.
    #[inline(always)]
    fn across(&self, basis: &Basis) -> Basis {
        let mut near = *basis;
        for i in 0..8 {
            let mut sum = [ZERO; 4];
            for k in 0..8 {
                let factor = self.transfer[i][k];
                for column in 0..4 {
                    sum[column] += factor * basis[k][column];
                }
            }
            near[i] = sum;
        }
        near
    }

    /// Loads at the far end per displacement at the near one, of a piece alone.
    fn stiffness(&self) -> Four {
        let mut compliance = [[ZERO; 4]; 4];
        for i in 0..4 {
            compliance[i].copy_from_slice(&self.transfer[i][4..]);
        }
        inverse(compliance)
    }
}

/// The basis at the far end: the near beam's end moves freely, what lies behind by its plane.
fn start([u, f]: &[Two; 2]) -> Basis {
    let mut basis = [[ZERO; 4]; 10];
    for i in 0..2 {
        basis[i][i] = ONE;
        basis[8 + i][2 + i] = ONE;
        for j in 0..2 {
            basis[2 + i][2 + j] = u[i][j];
            basis[6 + i][2 + j] = f[i][j];
        }
    }
    basis
}

/// The minor of the rows s - g in the columns that a restriction has taken away, with its sign in an expansion by these
/// rows.
fn restricted(end: &Basis, left: [usize; 2]) -> Complex64 {
    let mut taken = [0; 2];
    let mut count = 0;
    for column in 0..4 {
        if !left.contains(&column) && count < 2 {
            taken[count] = column;
            count += 1;
        }
    }
    let [a, b] = [0, 1].map(|i| taken.map(|column| end[6 + i][column] - end[4 + i][column]));
    let sign = if (taken[0] + taken[1]) % 2 == 1 { 1.0 } else { -1.0 };
    (a[0] * b[1] - a[1] * b[0]) * sign
}

/// The states that were traced, over the two columns of the near end.
fn states(
    last: &Four,
    columns: [usize; 2],
    trace: &[(Basis, Four)],
    at_start: bool,
) -> Vec<[[Complex64; 2]; 8]> {
    let mut map = [[ZERO; 2]; 4];
    for j in 0..4 {
        for (to, from) in columns.into_iter().enumerate() {
            map[j][to] = last[j][from];
        }
    }
    let mut out = Vec::with_capacity(trace.len());
    for (basis, change) in trace.iter().rev() {
        if !at_start {
            out.push(combine(basis, &map));
        }
        map = combine(change, &map);
        if at_start {
            out.push(combine(basis, &map));
        }
    }
    out.reverse();
    out
}

/// `rows` times the map of coordinates, the first N rows.
fn combine<const M: usize, const N: usize>(
    rows: &[[Complex64; 4]; M],
    map: &[[Complex64; 2]; 4],
) -> [[Complex64; 2]; N] {
    let mut out = [[ZERO; 2]; N];
    for i in 0..N {
        for k in 0..4 {
            for j in 0..2 {
                out[i][j] += rows[i][k] * map[k][j];
            }
        }
    }
    out
}

/// Negative eigenvalues of the pivot at a piece's far end, K U_near U_far^-1 with K the piece's stiffness.
///
/// They are those of U_far^T K U_near, which needs no inverse of what may be singular.
fn negative_at_piece(far: &Basis, stiffness: &Four, near: &Basis) -> usize {
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
fn negative_at_end(mut basis: Basis, weights: &[f64; 4]) -> usize {
    let (columns, _) = restrict(&mut basis, &[[0, 2], [1, 3]], 1.0, weights);
    let mut form = [[0.0; 2]; 2];
    for i in 0..2 {
        for j in 0..2 {
            for k in 0..2 {
                let load = basis[6 + k][columns[j]] - basis[4 + k][columns[j]];
                form[i][j] += (basis[2 + k][columns[i]] * load).re;
            }
        }
    }
    negative_eigenvalues(form)
}

/// Products of the states of two loads: y_a, theta_a, y_b, theta_b; V_a, M_a, V_b, M_b; d_y, d_theta.
pub const PRODUCTS: usize = 10;
/// Derivatives of H by the inertias of both beams (4), their compliances (4), the total stiffnesses of the layer (2),
/// the length, and the slope of the points' shares.
pub const DERIVATIVES: usize = PRODUCTS + 2;
/// Where the layer's two begin.
pub const LAYER: usize = 8;
/// Where the length is.
pub const LENGTH: usize = 10;
/// Where the slope is.
pub const SLOPE: usize = 11;

/// Points (from 0 to 1) and weights of the rule of eight points.
const GAUSS: [[f64; 2]; 8] = [
    [0.019_855_071_751_231_884, 0.050_614_268_145_188_13],
    [0.101_666_761_293_186_63, 0.111_190_517_226_687_24],
    [0.237_233_795_041_835_5, 0.156_853_322_938_943_64],
    [0.408_282_678_752_175_1, 0.181_341_891_689_181],
    [0.591_717_321_247_825, 0.181_341_891_689_181],
    [0.762_766_204_958_164_5, 0.156_853_322_938_943_64],
    [0.898_333_238_706_813_4, 0.111_190_517_226_687_24],
    [0.980_144_928_248_768_1, 0.050_614_268_145_188_13],
];

/// A state of a way from the other side in the coordinates of that from the tip.
pub fn mirrored(z: &Eight) -> Eight {
    [-z[0], z[1], z[2] + z[0], -(z[3] + z[1]), z[4] - z[6], z[7] - z[5], -z[6], z[7]]
}

/// The ten quantities of a state that the work is made of.
#[inline(always)]
fn quantities(z: &Eight) -> [Complex64; PRODUCTS] {
    [z[0] + z[2], z[1] + z[3], z[2], z[3], z[4], z[5], z[6] - z[4], z[7] - z[5], z[0], z[1]]
}

/// States at the points of the rule within a piece, from that at its end of larger x.
fn within(pair: &Pair, pieces: &Pieces, start: &Eight) -> [Eight; 8] {
    let mut out = [*start; 8];
    let mut powers = [1.0; 8];
    let mut term = *start;
    for order in 1..=terms(pieces.size) {
        term = pair.along(&term, pieces.length / order as f64);
        for (point, rule) in GAUSS.iter().enumerate() {
            powers[point] *= rule[0];
            for i in 0..8 {
                out[point][i] += term[i] * powers[point];
            }
        }
    }
    out
}

/// Derivatives of H on one line from the states at the pieces' ends of larger x, in the order of falling x.
pub fn derivatives(
    beside: &Beside,
    pieces: &Pieces,
    w: Complex64,
    left: &[Eight],
    right: &[Eight],
) -> [Complex64; DERIVATIVES] {
    let pair = Pair::new(beside, w, true);
    let mut sums = [ZERO; PRODUCTS];
    let same = core::ptr::eq(left, right);
    for (r, s) in left.iter().zip(right) {
        let moved = within(&pair, pieces, s);
        let seen = if same { moved } else { within(&pair, pieces, r) };
        for ((r, s), rule) in seen.iter().zip(&moved).zip(&GAUSS) {
            let (r, s) = (quantities(r), quantities(s));
            for i in 0..PRODUCTS {
                sums[i] += r[i] * s[i] * (rule[1] * pieces.length);
            }
        }
    }
    let mut out = [ZERO; DERIVATIVES];
    let (length, points) = (beside.overlap.length(), beside.overlap.points);
    for i in 0..4 {
        out[i] = sums[i] * (w * w);
        out[4 + i] = sums[4 + i];
    }
    for i in 0..2 {
        out[LAYER + i] = -sums[LAYER + i] / length;
    }
    if points > 0 {
        let total = beside.overlap.stiffness(w);
        let (mut by_stiffness, mut by_slope) = ([ZERO; 2], ZERO);
        for (passed, (r, s)) in left.iter().zip(right).enumerate() {
            // The point that was passed before this piece moves as the piece's end does.
            if pieces.point_after(passed) {
                let place = pieces.place(passed);
                for i in 0..2 {
                    by_stiffness[i] -= r[i] * s[i] * beside.overlap.share(place);
                    by_slope -= r[i] * s[i] * total[i] * (place / points as f64);
                }
            }
        }
        out[LAYER..LAYER + 2].copy_from_slice(&by_stiffness);
        out[SLOPE] = by_slope;
    }
    out[LENGTH] = by_length(&pair, pieces, length, left, right);
    if points == 0 {
        // The totals are held: a longer layer is softer per length.
        let total = beside.overlap.stiffness(w);
        for i in 0..2 {
            out[LENGTH] -= total[i] / length * out[LAYER + i];
        }
    }
    out
}

/// The derivative by the length, the stiffness per length of the layer being held.
///
/// Its density is constant between two points; it is taken where its terms are smallest and cancel least.
fn by_length(pair: &Pair, pieces: &Pieces, length: f64, left: &[Eight], right: &[Eight]) -> Complex64 {
    let mut sum = ZERO;
    let mut best = (f64::INFINITY, ZERO);
    let mut stretch = 0;
    for (passed, (r, s)) in left.iter().zip(right).enumerate() {
        if pieces.point_after(passed) {
            sum += best.1 * (stretch as f64 * pieces.length / length);
            best.0 = f64::INFINITY;
            stretch = 0;
        }
        let now = density(pair, r, s);
        if now.0 < best.0 {
            best = now;
        }
        stretch += 1;
    }
    sum + best.1 * (stretch as f64 * pieces.length / length)
}

/// The largest term of -r^T J A s and its value.
fn density(pair: &Pair, r: &Eight, s: &Eight) -> (f64, Complex64) {
    let (a, b) = (quantities(r), quantities(s));
    let mut terms = [ZERO; 14];
    for beam in 0..2 {
        for i in 0..2 {
            let k = 2 * beam + i;
            terms[k] = pair.inertia[beam][i] * a[k] * b[k];
            terms[4 + k] = pair.compliance[beam][i] * a[4 + k] * b[4 + k];
        }
        // theta V of internal forces, which are minus the loads.
        let (theta, force) = (2 * beam + 1, 4 + 2 * beam);
        terms[10 + 2 * beam] = -a[theta] * b[force];
        terms[11 + 2 * beam] = -a[force] * b[theta];
    }
    for i in 0..2 {
        terms[8 + i] = -pair.layer[i] * a[8 + i] * b[8 + i];
    }
    let largest = terms.iter().fold(0.0_f64, |most, term| most.max(term.norm_sqr()));
    (largest, terms.iter().sum())
}
