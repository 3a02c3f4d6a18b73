//! The joint-only roads against whole models.

use super::*;
use crate::joint_fit::Reduced;
use crate::joint_sweep::JointSweep;
use crate::model::{Table, Tables};
use crate::request::Parameter;
use crate::response::receptance;

const SEED: u64 = 20;

/// Even numbers between bounds, the same in every run (Knuth's linear congruence).
struct Draw(u64);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn power(&mut self, low: f64, high: f64) -> f64 {
        10.0_f64.powf(self.between(low, high))
    }

    /// A joint from soft to stiff.
    fn joint(&mut self, couples: bool) -> [f64; SPRING_COLUMNS] {
        let k = [self.power(5.0, 11.0), self.power(2.0, 8.0)];
        let c = [self.power(-1.0, 4.0), self.power(-4.0, 2.0)];
        let both = |draw: &mut Self, pair: [f64; 2]| draw.between(-0.9, 0.9) * (pair[0] * pair[1]).sqrt();
        let coupling = if couples { [both(self, k), both(self, c)] } else { [0.0; 2] };
        [k[0], k[1], coupling[0], c[0], c[1], coupling[1], self.between(0.0, 0.1)]
    }

    fn segment(&mut self, node: usize) -> Vec<f64> {
        let outer = self.between(0.008, 0.04);
        let bore = outer * [0.0, 0.5][usize::from(self.between(0.0, 1.0) > 0.5)];
        let node = node as f64;
        let mut row = vec![node, node + 1.0, self.between(0.003, 0.04), outer, bore];
        row.extend([self.power(10.8, 11.8), self.between(2700.0, 14e3), 0.3, self.between(0.0, 0.02)]);
        row.extend([0.0; 5]);
        row
    }

    /// Two segments, the joint, two segments, a plain joint and one more, with point elements.
    fn model(&mut self) -> Model {
        let segments: Vec<f64> = [0, 1, 3, 4, 6].into_iter().flat_map(|node| self.segment(node)).collect();
        let mut joints = vec![2.0, 3.0];
        joints.extend(self.joint(true));
        joints.extend([5.0, 6.0, self.power(7.0, 10.0), self.power(4.0, 7.0), 0.0, 0.0, 0.0, 0.0, 0.03]);
        let masses: Vec<f64> =
            [1.0, 4.0].into_iter().flat_map(|node| [node, self.power(-4.0, -1.0), 1e-6]).collect();
        let mut grounds = vec![7.0, self.power(4.0, 9.0), self.power(2.0, 5.0)];
        grounds.extend([0.0, 0.0, 0.0, 0.0, 0.01]);
        grounds.truncate(if self.between(0.0, 1.0) > 0.5 { 8 } else { 0 });
        let tables = Tables {
            segments: &segments,
            joints: &joints,
            masses: &masses,
            grounds: &grounds,
            overlaps: &[],
        };
        Model::new(Motion::Bending, tables).unwrap()
    }
}

fn lines() -> Vec<Complex64> {
    [1.0, 17.0, 130.0, 777.0, 1500.0, 2500.0, 4000.0, 6000.0, 8000.0]
        .map(|f: f64| Complex64::from(core::f64::consts::TAU * f))
        .to_vec()
}

/// The parts of [J | r]^T [J | r] at one line and column, for two residuals at right angles.
fn products(reduced: &[Reduced; 2], joint: &[f64; SPRING_COLUMNS], column: usize) -> [f64; 3] {
    let found = [0, 1].map(|i| reduced[i].normal_matrix(joint, &[(column, joint[column])], 1).unwrap());
    [found[0][0], found[0][1], found[1][1]]
}

#[test]
fn both_roads_are_the_whole_model() {
    println!("seed {SEED}");
    let mut draw = Draw(SEED);
    let w = lines();
    let all = Frequencies::complex(&w, 1.0);
    for case in 0..40 {
        let model = draw.model();
        let node = if case % 2 == 0 { 0 } else { 7 };
        let tip = Coordinate { node, direction: case / 2 % 2 };
        let reference = model.joints[0].1.columns();
        let joint = draw.joint(case % 3 > 0);
        let (mut other, request) = (model.clone(), derivatives(tip));
        other.joints[0].1 = Spring::new(&joint);
        let whole = receptance(&other, &all, &request, 1).unwrap();
        for line in 0..w.len() {
            let h = whole.receptance[line];
            let one = Frequencies::complex(&w[line..=line], 1.0);
            for form in [Form::Shortest, Form::Planes] {
                let model = reduce_joint(&model, 0, &one, tip, tip, Terminals::default(), form, 1).unwrap();
                assert_eq!(model.planes().is_some(), form == Form::Planes);
                // log(measured/H) is 1 for the first and i for the second, so that the products are J.
                let measured = [h * 1.0_f64.exp(), h * Complex64::I.exp()];
                let reduced = [0, 1].map(|i| Reduced::new(&model, &measured[i..=i], &[1.0]).unwrap());
                let at = format!("case {case}, line {line}, {form:?}");
                let many = JointSweep::new(&model).unwrap();
                let mut swept = [Complex64::ZERO; 3];
                many.receptances(&[reference, joint, joint].concat(), &mut swept, 2).unwrap();
                assert!((swept[1] / h - 1.0).norm() < 1e-9 && swept[1] == swept[2], "{at}");
                for (i, one) in reduced.iter().enumerate() {
                    let residual = one.rows(&joint, &[], 1).unwrap().residual;
                    assert!((residual[i] - 1.0).abs() < 1e-9 && residual[1 - i].abs() < 1e-9, "{at}");
                }
                for column in 0..SPRING_COLUMNS {
                    let slope = -whole.derivative[line * SPRING_COLUMNS + column] / h * joint[column];
                    let [square, re, im] = products(&reduced, &joint, column);
                    let size = slope.norm();
                    assert!((square - size * size).abs() <= 1e-9 * size * size, "{at}, column {column}");
                    assert!((re - slope.re).abs() <= 1e-9 * size, "{at}, column {column}");
                    assert!((im - slope.im).abs() <= 1e-9 * size, "{at}, column {column}");
                }
            }
        }
    }
}

/// A receptance and its derivatives by all columns of the first joint.
fn derivatives(tip: Coordinate) -> Request {
    let parameter = |column| Parameter { table: Table::Joints, row: 0, column: column + 2 };
    Request {
        excitations: vec![tip],
        responses: vec![tip],
        parameters: (0..SPRING_COLUMNS).map(parameter).collect(),
        ..Request::default()
    }
}

#[test]
fn models_that_are_no_function_of_the_square_are_swept() {
    let mut draw = Draw(SEED);
    let (model, w) = (draw.model(), lines());
    let tip = Coordinate { node: 0, direction: 0 };
    let in_series = |model: &Model, w: &[Complex64], response, excitation| {
        let (lines, ends) = (Frequencies::complex(w, 1.0), Terminals::default());
        let found = reduce_joint(model, 0, &lines, response, excitation, ends, Form::Shortest, 1);
        found.unwrap().planes().is_none()
    };
    assert!(in_series(&model, &w, tip, tip));
    let slope = Coordinate { node: 0, direction: 1 };
    let inside = Coordinate { node: 1, direction: 0 };
    assert!(!in_series(&model, &w, tip, slope));
    assert!(!in_series(&model, &w, inside, inside));
    let windowed: Vec<Complex64> = w.iter().map(|w| w - 20.0 * Complex64::I).collect();
    assert!(!in_series(&model, &windowed, tip, tip));
    let high: Vec<Complex64> = w.iter().map(|w| 40.0 * w).collect();
    assert!(!in_series(&model, &high, tip, tip));
    let (mut damped, mut coupled, mut grounded) = (model.clone(), model.clone(), model);
    damped.joints[1].1.c[1] = 0.1;
    coupled.joints[1].1.k[2] = 1e3;
    grounded.grounds.push((4, Spring::new(&[1e5, 1e3, 0.0, 3.0, 0.0, 0.0, 0.0])));
    for other in [damped, coupled, grounded] {
        assert!(!in_series(&other, &w, tip, tip));
    }
}
