//! Sections of segments: from dimensions, shape and materials to the coefficients of the beam equations.

use crate::error::{Error, Result};
use crate::model::cone::{is_conical, section_at};
use core::f64::consts::PI;
use num_complex::Complex64;

/// Kind of motion: transverse displacement and slope, or one displacement along or about the axis.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Bending: y and theta at each node.
    Bending,
    /// Axial: x at each node.
    Axial,
    /// Torsion: the twist at each node.
    Torsion,
}

impl Motion {
    /// Degrees of freedom a node.
    pub fn degrees(self) -> usize {
        if self == Motion::Bending { 2 } else { 1 }
    }
}

/// Columns of the segment table; the two nodes come first, that of smaller x before the other.
pub mod column {
    /// Length in m.
    pub const LENGTH: usize = 2;
    /// Outer diameter in m.
    pub const OUTER_DIAMETER: usize = 3;
    /// Bore in m; 0 for a solid section.
    pub const INNER_DIAMETER: usize = 4;
    /// Young's modulus, density, Poisson's ratio and loss factor of the ring.
    pub const MATERIAL: usize = 5;
    /// The same four of the core that fills the bore; density 0 where there is none.
    pub const CORE_MATERIAL: usize = 9;
    /// Shear coefficient: 0 Cowper, 1 Hutchinson.
    pub const SHEAR_MODEL: usize = 13;
    /// Number of columns where all segments are circular cylinders: the next ones are zero then.
    pub const UNIFORM: usize = 14;
    /// Outer diameter in m at the end of larger x; 0 for a cylinder, whose next column is not read.
    pub const END_OUTER_DIAMETER: usize = 14;
    /// Bore in m at that end.
    pub const END_INNER_DIAMETER: usize = 15;
    /// Area over that of the circle of the outer diameter; 0 for a circle or ring, whose next columns are not read.
    pub const AREA: usize = 16;
    /// Second moment of area of the bending stiffness over that of the circle.
    pub const MOMENT: usize = 17;
    /// Second moment of area of the rotary inertia (in torsion half the polar one) over that of the circle.
    pub const INERTIA: usize = 18;
    /// Torsion constant over that of the circle.
    pub const TORSION: usize = 19;
    /// 1 / kappa = a + b s + c s^2 with s = nu / (1 + nu): a, b, c.
    pub const SHEAR_FLEXIBILITY: usize = 20;
    /// Number of columns.
    pub const COUNT: usize = 23;
}

/// The row of a circular cylinder: nodes, length, diameters and the ring's material.
#[cfg(test)]
pub fn cylinder(values: [f64; 9]) -> [f64; column::COUNT] {
    let mut row = [0.0; column::COUNT];
    row[..values.len()].copy_from_slice(&values);
    row
}

/// Coefficients of a uniform segment per length: u' and f' of the element equations.
///
/// In bending (D = 2) `kinetic` is (mass, rotary inertia) per length, `compliance` is (1/S, 1/B) with the
/// shear stiffness S = kappa G A and the bending stiffness B = E I. In a rod (D = 1) they are mass and
/// 1/(E A), or polar inertia and 1/(G I_p).
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Coefficients<const D: usize> {
    /// Inertia per length of each displacement.
    pub kinetic: [f64; D],
    /// Compliance per length of each internal force.
    pub compliance: [Complex64; D],
}

/// One homogeneous ring (or disc) of a section with the derivatives of its contributions.
struct Layer {
    outer: f64,
    inner: f64,
    material: [f64; 4],
    hutchinson: bool,
    shape: Shape,
}

/// Ratios of a section's properties to those of the circle of its outer diameter.
#[derive(Copy, Clone)]
struct Shape {
    area: f64,
    moment: f64,
    inertia: f64,
    torsion: f64,
    /// Coefficients of 1 / kappa; nothing for a circle or ring.
    flexibility: Option<[f64; 3]>,
}

impl Shape {
    const CIRCLE: Self = Self { area: 1.0, moment: 1.0, inertia: 1.0, torsion: 1.0, flexibility: None };

    fn of(row: &[f64]) -> Self {
        if row[column::AREA] == 0.0 {
            return Self::CIRCLE;
        }
        let first = column::SHEAR_FLEXIBILITY;
        Self {
            area: row[column::AREA],
            moment: row[column::MOMENT],
            inertia: row[column::INERTIA],
            torsion: row[column::TORSION],
            flexibility: Some([row[first], row[first + 1], row[first + 2]]),
        }
    }
}

/// Contribution of a layer and its derivatives by (outer, inner, E, rho, nu, eta).
struct Contribution<const D: usize> {
    kinetic: [f64; D],
    stiffness: [Complex64; D],
    d_kinetic: [[f64; D]; 6],
    d_stiffness: [[Complex64; D]; 6],
}

/// Shear coefficient of a circular ring with its derivatives by nu and by q = (d/D)^2.
///
/// Cowper, J. Appl. Mech. 33 (1966) 335; Hutchinson, J. Appl. Mech. 68 (2001) 87.
fn shear_coefficient(hutchinson: bool, nu: f64, q: f64) -> (f64, f64, f64) {
    let ring = (1.0 + q) * (1.0 + q);
    let (top, top_nu, top_q, bottom, bottom_nu, bottom_q);
    if hutchinson {
        top = 6.0 * (1.0 + nu).powi(2) * ring;
        top_nu = 12.0 * (1.0 + nu) * ring;
        top_q = 12.0 * (1.0 + nu).powi(2) * (1.0 + q);
        let (p0, p1, p2) =
            (7.0 + 34.0 * q + 7.0 * q * q, 12.0 + 48.0 * q + 12.0 * q * q, 4.0 + 16.0 * q + 4.0 * q * q);
        bottom = p0 + nu * p1 + nu * nu * p2;
        bottom_nu = p1 + 2.0 * nu * p2;
        bottom_q = (34.0 + 14.0 * q) + nu * (48.0 + 24.0 * q) + nu * nu * (16.0 + 8.0 * q);
    } else {
        top = 6.0 * (1.0 + nu) * ring;
        top_nu = 6.0 * ring;
        top_q = 12.0 * (1.0 + nu) * (1.0 + q);
        bottom = (7.0 + 6.0 * nu) * ring + (20.0 + 12.0 * nu) * q;
        bottom_nu = 6.0 * ring + 12.0 * q;
        bottom_q = (7.0 + 6.0 * nu) * 2.0 * (1.0 + q) + 20.0 + 12.0 * nu;
    }
    let kappa = top / bottom;
    (kappa, (top_nu - kappa * bottom_nu) / bottom, (top_q - kappa * bottom_q) / bottom)
}

impl Layer {
    /// Area and second moment of area with derivatives by outer and inner diameter.
    fn geometry(&self) -> ([f64; 3], [f64; 3]) {
        let (o, i) = (self.outer, self.inner);
        // Factored: the differences of squares and fourth powers of a thin wall lose no digits.
        let area = PI / 4.0 * (o - i) * (o + i);
        let moment = area / 16.0 * (o * o + i * i);
        ([area, PI / 2.0 * o, -PI / 2.0 * i], [moment, PI / 16.0 * o.powi(3), -PI / 16.0 * i.powi(3)])
    }

    /// Contribution of the layer to inertia and stiffness, with derivatives.
    fn contribution<const D: usize>(&self, motion: Motion) -> Contribution<D> {
        let [e, rho, nu, eta] = self.material;
        let (area, moment) = self.geometry();
        let loss = Complex64::new(1.0, eta);
        let shear = e / (2.0 * (1.0 + nu));
        let q = (self.inner / self.outer).powi(2);
        let (kappa, kappa_nu, kappa_q) = match self.shape.flexibility {
            None => shear_coefficient(self.hutchinson, nu, q),
            Some([a, b, c]) => {
                let s = nu / (1.0 + nu);
                let kappa = 1.0 / (a + s * (b + s * c));
                (kappa, -kappa * kappa * (b + 2.0 * c * s) / (1.0 + nu).powi(2), 0.0)
            }
        };
        let q_by = [-2.0 * q / self.outer, 2.0 * self.inner / self.outer.powi(2)];
        let mut out = Contribution {
            kinetic: [0.0; D],
            stiffness: [Complex64::ZERO; D],
            d_kinetic: [[0.0; D]; 6],
            d_stiffness: [[Complex64::ZERO; D]; 6],
        };
        // Each direction: geometry g with derivatives, modulus, its derivative by nu, and the shear
        // coefficient where it enters.
        for i in 0..D {
            let shape = &self.shape;
            let times = |values: [f64; 3], factor: f64| values.map(|value| factor * value);
            let (inertia, stiff, modulus, modulus_nu, coefficient) = match (motion, i) {
                (Motion::Bending, 0) => {
                    let area = times(area, shape.area);
                    (area, area, shear, -shear / (1.0 + nu), true)
                }
                (Motion::Bending, _) => {
                    (times(moment, shape.inertia), times(moment, shape.moment), e, 0.0, false)
                }
                (Motion::Axial, _) => (times(area, shape.area), times(area, shape.area), e, 0.0, false),
                (Motion::Torsion, _) => {
                    let (inertia, torsion) = (2.0 * shape.inertia, 2.0 * shape.torsion);
                    (times(moment, inertia), times(moment, torsion), shear, -shear / (1.0 + nu), false)
                }
            };
            let (k, k_nu, k_q) = if coefficient { (kappa, kappa_nu, kappa_q) } else { (1.0, 0.0, 0.0) };
            out.kinetic[i] = rho * inertia[0];
            out.stiffness[i] = loss * (k * modulus * stiff[0]);
            for side in 0..2 {
                out.d_kinetic[side][i] = rho * inertia[1 + side];
                out.d_stiffness[side][i] =
                    loss * modulus * (k * stiff[1 + side] + k_q * q_by[side] * stiff[0]);
            }
            out.d_stiffness[2][i] = out.stiffness[i] / e;
            out.d_kinetic[3][i] = inertia[0];
            out.d_stiffness[4][i] = loss * stiff[0] * (k * modulus_nu + k_nu * modulus);
            out.d_stiffness[5][i] = Complex64::I * (k * modulus * stiff[0]);
        }
        out
    }
}

/// The layers of a section: the ring, and the core where its density is not zero.
fn layers(row: &[f64]) -> (Layer, Option<Layer>) {
    let hutchinson = row[column::SHEAR_MODEL] == 1.0;
    let four = |start: usize| [row[start], row[start + 1], row[start + 2], row[start + 3]];
    let (outer, inner) = (row[column::OUTER_DIAMETER], row[column::INNER_DIAMETER]);
    let shape = Shape::of(row);
    let ring = Layer { outer, inner, material: four(column::MATERIAL), hutchinson, shape };
    let core = (row[column::CORE_MATERIAL + 1] != 0.0).then(|| Layer {
        outer: inner,
        inner: 0.0,
        material: four(column::CORE_MATERIAL),
        hutchinson,
        shape: Shape::CIRCLE,
    });
    (ring, core)
}

/// Coefficients of the section of a row.
pub fn coefficients<const D: usize>(row: &[f64], motion: Motion) -> Coefficients<D> {
    derivatives(row, motion, None).0
}

/// Coefficients and their derivative by one column of the segment table (the length changes none).
pub fn derivatives<const D: usize>(
    row: &[f64],
    motion: Motion,
    by: Option<usize>,
) -> (Coefficients<D>, Coefficients<D>) {
    let (ring, core) = layers(row);
    let ring = ring.contribution::<D>(motion);
    let core = core.map(|layer| layer.contribution::<D>(motion));
    let mut value = Coefficients { kinetic: ring.kinetic, compliance: ring.stiffness };
    let mut change = Coefficients { kinetic: [0.0; D], compliance: [Complex64::ZERO; D] };
    let ring_index = by.and_then(|by| {
        (column::OUTER_DIAMETER..column::CORE_MATERIAL).contains(&by).then(|| by - column::OUTER_DIAMETER)
    });
    // The core's outer diameter is the bore; its materials come four columns later.
    let core_index = by.and_then(|by| match by {
        column::INNER_DIAMETER => Some(0),
        column::CORE_MATERIAL..column::SHEAR_MODEL => Some(by - 7),
        _ => None,
    });
    for i in 0..D {
        if let Some(index) = ring_index {
            change.kinetic[i] += ring.d_kinetic[index][i];
            change.compliance[i] += ring.d_stiffness[index][i];
        }
        if let Some(core) = &core {
            value.kinetic[i] += core.kinetic[i];
            value.compliance[i] += core.stiffness[i];
            if let Some(index) = core_index {
                change.kinetic[i] += core.d_kinetic[index][i];
                change.compliance[i] += core.d_stiffness[index][i];
            }
        }
        let compliance = value.compliance[i].inv();
        change.compliance[i] *= -compliance * compliance;
        value.compliance[i] = compliance;
    }
    (value, change)
}

/// Moduli of the products of coefficients in the bound of the wave number.
fn bound_of<const D: usize>(per_length: &Coefficients<D>) -> [f64; 3] {
    let size = per_length.compliance.map(|compliance| compliance.norm());
    let a = size[0] * per_length.kinetic[0];
    if D == 1 {
        return [a, 0.0, 0.0];
    }
    let b = size[D - 1] * per_length.kinetic[D - 1];
    [a + b, a * b, size[D - 1] * per_length.kinetic[0]]
}

/// A segment: coefficients and length.
#[derive(Copy, Clone, Debug)]
pub struct Segment<const D: usize> {
    /// Coefficients per length; of a cone those in its middle.
    pub per_length: Coefficients<D>,
    /// Length in m.
    pub length: f64,
    /// Moduli of the products of coefficients in the bound of the wave number: its sum, its product and
    /// the bending term.
    bound: [f64; 3],
    /// Modulus of the last stiffness (bending, or that of the rod).
    stiffness: f64,
}

impl<const D: usize> Segment<D> {
    /// The segment of a row of the segment table.
    pub fn new(row: &[f64; column::COUNT], motion: Motion) -> Self {
        let middle = coefficients::<D>(&section_at(row, 0.5), motion);
        let mut bound = bound_of(&middle);
        if is_conical(row) {
            for end in [0.0, 1.0] {
                let at_end = bound_of(&coefficients::<D>(&section_at(row, end), motion));
                for (most, value) in bound.iter_mut().zip(at_end) {
                    *most = most.max(value);
                }
            }
        }
        let stiffness = 1.0 / middle.compliance[D - 1].norm();
        Self { per_length: middle, length: row[column::LENGTH], bound, stiffness }
    }

    /// Sum and product of the squares of both wave numbers of a beam at |w|^2 = `w2` but for the bending term, and that term.
    pub fn bound(&self, w2: f64) -> [f64; 3] {
        [self.bound[0] * w2, self.bound[1] * w2 * w2, self.bound[2] * w2]
    }

    /// An upper bound of |lambda|^2 at |w|^2 = `w2`, close to it away from the cut-off.
    pub fn wave_number_square(&self, w2: f64) -> f64 {
        let [sum, product, bending] = self.bound(w2);
        if D == 1 {
            return sum;
        }
        0.5 * (sum + (sum * sum + 4.0 * (product + bending)).sqrt())
    }

    /// Impedances that make displacements comparable with loads where |lambda|^2 is `square`.
    pub fn weights(&self, square: f64) -> [f64; D] {
        let mut out = [self.stiffness * square.sqrt(); D];
        if D == 2 {
            out[0] *= square;
        }
        out
    }
}

/// Checks that a row of the segment table is a beam; `element` is its name in errors.
pub fn check(row: &[f64], index: usize, element: &'static str) -> Result<()> {
    let fail =
        |quantity, value, expected| Err(Error::Quantity { element, row: index, quantity, value, expected });
    let positive = |value: f64| value.is_finite() && value > 0.0;
    if !positive(row[column::LENGTH]) {
        return fail("length", row[column::LENGTH], "a positive finite number of metres");
    }
    let (outer, inner) = (row[column::OUTER_DIAMETER], row[column::INNER_DIAMETER]);
    if !positive(outer) {
        return fail("outer_diameter", outer, "a positive finite number of metres");
    }
    if !(inner.is_finite() && inner >= 0.0 && inner < outer) {
        return fail("inner_diameter", inner, "zero or more, and less than the outer diameter");
    }
    if let Err((quantity, value, expected)) = check_end(row) {
        return fail(quantity, value, expected);
    }
    let core_density = row[column::CORE_MATERIAL + 1];
    if core_density != 0.0 && inner == 0.0 {
        return fail("inner_diameter", inner, "a bore that the core can fill");
    }
    let cores: &[usize] =
        if core_density == 0.0 { &[column::MATERIAL] } else { &[column::MATERIAL, column::CORE_MATERIAL] };
    for &start in cores {
        check_material(&row[start..start + 4], index, element)?;
    }
    if row[column::SHEAR_MODEL] != 0.0 && row[column::SHEAR_MODEL] != 1.0 {
        return fail("shear_model", row[column::SHEAR_MODEL], "0 (Cowper) or 1 (Hutchinson)");
    }
    Ok(())
}

/// Checks the far end and the shape of a row: the quantity that is wrong, its value and what was expected.
fn check_end(row: &[f64]) -> core::result::Result<(), (&'static str, f64, &'static str)> {
    let (outer, inner) = (row[column::END_OUTER_DIAMETER], row[column::END_INNER_DIAMETER]);
    if !(outer.is_finite() && outer >= 0.0) {
        return Err(("end_outer_diameter", outer, "a positive finite number of metres, or 0 for a cylinder"));
    }
    if outer > 0.0 && !(inner.is_finite() && inner >= 0.0 && inner < outer) {
        return Err(("end_inner_diameter", inner, "zero or more, and less than the outer diameter there"));
    }
    let area = row[column::AREA];
    if area == 0.0 {
        return Ok(());
    }
    let ratios = [
        ("area", column::AREA),
        ("moment", column::MOMENT),
        ("inertia", column::INERTIA),
        ("torsion", column::TORSION),
    ];
    for (quantity, column) in ratios {
        if !(row[column].is_finite() && row[column] > 0.0) {
            return Err((quantity, row[column], "a positive finite ratio to that of the circle"));
        }
    }
    let nu = row[column::MATERIAL + 2];
    let (first, s) = (column::SHEAR_FLEXIBILITY, nu / (1.0 + nu));
    let flexibility = row[first] + s * (row[first + 1] + s * row[first + 2]);
    if !(flexibility.is_finite() && flexibility > 0.0) {
        return Err(("shear flexibility", flexibility, "a positive finite number at Poisson's ratio"));
    }
    if row[column::INNER_DIAMETER] != 0.0 || inner != 0.0 {
        return Err((
            "inner_diameter",
            row[column::INNER_DIAMETER],
            "0 for a section with a shape of its own",
        ));
    }
    Ok(())
}

fn check_material(material: &[f64], index: usize, element: &'static str) -> Result<()> {
    let fail =
        |quantity, value, expected| Err(Error::Quantity { element, row: index, quantity, value, expected });
    let [e, rho, nu, eta] = [material[0], material[1], material[2], material[3]];
    if !(e.is_finite() && e > 0.0) {
        return fail("youngs_modulus", e, "a positive finite number of pascals");
    }
    if !(rho.is_finite() && rho > 0.0) {
        return fail("density", rho, "a positive finite number of kg/m3");
    }
    if !(nu > -1.0 && nu <= 0.5) {
        return fail("poisson_ratio", nu, "more than -1 and at most 0.5");
    }
    if !(eta.is_finite() && eta >= 0.0) {
        return fail("loss_factor", eta, "zero or a positive finite number");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shear_coefficients_have_the_published_solid_values() {
        let nu: f64 = 0.3;
        let (cowper, ..) = shear_coefficient(false, nu, 0.0);
        assert!((cowper - 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu)).abs() < 1e-15);
        let (hutchinson, ..) = shear_coefficient(true, nu, 0.0);
        let expected = 6.0 * (1.0 + nu).powi(2) / (7.0 + 12.0 * nu + 4.0 * nu * nu);
        assert!((hutchinson - expected).abs() < 1e-15);
    }

    #[test]
    fn derivatives_of_the_coefficients_agree_with_differences() {
        let mut row = [0.0; column::COUNT];
        row[..column::SHEAR_MODEL].copy_from_slice(&[
            0.0, 1.0, 0.1, 0.03, 0.012, 2.1e11, 7850.0, 0.3, 0.01, 5.8e11, 14500.0, 0.22, 0.002,
        ]);
        for shear in [0.0, 1.0] {
            for by in column::OUTER_DIAMETER..column::SHEAR_MODEL {
                let mut row = row;
                row[column::SHEAR_MODEL] = shear;
                let (_, change) = derivatives::<2>(&row, Motion::Bending, Some(by));
                let step = 1e-5 * row[by];
                let (mut up, mut down) = (row, row);
                up[by] += step;
                down[by] -= step;
                let (up, down) =
                    (coefficients::<2>(&up, Motion::Bending), coefficients::<2>(&down, Motion::Bending));
                for i in 0..2 {
                    let kinetic = (up.kinetic[i] - down.kinetic[i]) / (2.0 * step);
                    assert!((kinetic - change.kinetic[i]).abs() <= 1e-7 * (kinetic.abs() + 1e-12));
                    let compliance = (up.compliance[i] - down.compliance[i]) / (2.0 * step);
                    let size = compliance.norm() + 1e-9 * up.compliance[i].norm() / row[by];
                    assert!((compliance - change.compliance[i]).norm() <= 1e-7 * size, "column {by}");
                }
            }
        }
    }
}
