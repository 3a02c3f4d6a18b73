//! Properties of the core that hold for every assembly.

#![allow(clippy::unwrap_used, missing_docs)]

use num_complex::Complex64;
use proptest::prelude::*;
use receptance_core::{
    Coordinate, Model, Motion, Request, Response, Tables, natural_frequencies, receptance,
};

const TAU: f64 = core::f64::consts::TAU;

fn segment(node: usize, length: f64, diameter: f64, loss_factor: f64) -> [f64; 14] {
    let (a, b) = (node as f64, node as f64 + 1.0);
    [a, b, length, diameter, 0.0, 210e9, 7850.0, 0.3, loss_factor, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn model(segments: &[[f64; 14]], joints: &[[f64; 9]]) -> Model {
    let tables = Tables {
        segments: segments.as_flattened(),
        joints: joints.as_flattened(),
        masses: &[],
        grounds: &[],
        overlaps: &[],
    };
    Model::new(Motion::Bending, tables).unwrap()
}

fn both_ends(model: &Model, w: &[Complex64], far: usize, threads: usize) -> Response {
    let points = |node| [0, 1].map(|direction| Coordinate { node, direction });
    let all: Vec<Coordinate> = points(0).into_iter().chain(points(far)).collect();
    let request = Request { excitations: all.clone(), responses: all, ..Request::default() };
    receptance(model, w, &request, threads).unwrap()
}

fn lines(count: usize, highest_hz: f64) -> Vec<Complex64> {
    (1..=count).map(|i| Complex64::new(TAU * highest_hz * i as f64 / count as f64, 0.0)).collect()
}

fn chain() -> impl Strategy<Value = Vec<[f64; 14]>> {
    prop::collection::vec((1e-3..0.2_f64, 5e-3..0.06_f64, 0.0..0.02_f64), 1..6).prop_map(|sections| {
        let rows = sections.into_iter().enumerate();
        rows.map(|(node, (length, diameter, loss))| segment(node, length, diameter, loss)).collect()
    })
}

/// |a - b| against the geometric mean of the drive points, which bounds a transfer away from poles.
fn close(a: Complex64, b: Complex64, size: f64, tolerance: f64) -> bool {
    (a - b).norm() <= tolerance * size
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn reciprocity_and_passivity(segments in chain(), highest in 50.0..40e3_f64) {
        let far = segments.len();
        let w = lines(17, highest);
        let h = both_ends(&model(&segments, &[]), &w, far, 1).receptance;
        for line in h.chunks(16) {
            for i in 0..4 {
                for j in 0..4 {
                    let size = (line[5 * i].norm() * line[5 * j].norm()).sqrt();
                    prop_assert!(close(line[4 * i + j], line[4 * j + i], size, 1e-9));
                }
                prop_assert!(line[5 * i].im <= 1e-12 * line[5 * i].norm());
            }
        }
    }

    #[test]
    fn splitting_a_segment_changes_nothing(
        segments in chain(),
        share in 0.01..0.99_f64,
        highest in 50.0..40e3_f64,
    ) {
        let far = segments.len();
        let w = lines(9, highest);
        let whole = both_ends(&model(&segments, &[]), &w, far, 1).receptance;
        let mut split = segments.clone();
        let last = split.pop().unwrap();
        let mut first = last;
        first[2] *= share;
        let mut second = last;
        second[2] -= first[2];
        (second[0], second[1]) = (last[0] + 1.0, last[1] + 1.0);
        split.extend([first, second]);
        let parts = both_ends(&model(&split, &[]), &w, far + 1, 1).receptance;
        for (a, b) in whole.chunks(16).zip(parts.chunks(16)) {
            for entry in 0..16 {
                let size = (a[5 * (entry / 4)].norm() * a[5 * (entry % 4)].norm()).sqrt();
                prop_assert!(close(a[entry], b[entry], size, 1e-7));
            }
        }
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let segments: Vec<_> =
        (0..5).map(|i| segment(i, 0.02 + 0.01 * i as f64, 0.01 + 0.004 * i as f64, 1e-3)).collect();
    let model = model(&segments, &[]);
    let w = lines(5000, 20e3);
    let one = both_ends(&model, &w, 5, 1);
    for threads in [2, 3, 7] {
        assert!(both_ends(&model, &w, 5, threads) == one, "{threads} threads");
    }
}

#[test]
fn a_stiff_joint_is_no_joint_and_a_branch_by_its_series_is_the_same_branch() {
    let whole = model(&[segment(0, 0.06, 0.012, 1e-3), segment(1, 0.1, 0.04, 1e-3)], &[]);
    let mut behind = segment(2, 0.1, 0.04, 1e-3);
    (behind[0], behind[1]) = (2.0, 3.0);
    let joint = [1.0, 2.0, 1e18, 1e15, 0.0, 0.0, 0.0, 0.0, 0.0];
    let joined = model(&[segment(0, 0.06, 0.012, 1e-3), behind], &[joint]);
    let tip = vec![Coordinate { node: 0, direction: 0 }];
    let request = Request { excitations: tip.clone(), responses: tip, ..Request::default() };
    // 600 lines are taken by the series of the branch, 100 segment by segment.
    let many = receptance(&whole, &lines(600, 12e3), &request, 1).unwrap().receptance;
    let few = receptance(&whole, &lines(100, 12e3), &request, 1).unwrap().receptance;
    let stiff = receptance(&joined, &lines(600, 12e3), &request, 1).unwrap().receptance;
    for line in 0..100 {
        assert!((many[6 * line + 5] - few[line]).norm() <= 1e-10 * few[line].norm());
    }
    for line in 0..600 {
        assert!((many[line] - stiff[line]).norm() <= 1e-5 * many[line].norm());
    }
}

#[test]
fn natural_frequencies_of_reference_beams() {
    // Free-free, Cowper's coefficient: exact wave solution and a 240-element model agree to 4e-5 Hz.
    let steel = [0.0, 1.0, 0.125, 0.01, 0.0, 200e9, 7800.0, 0.29, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let tube = [0.0, 1.0, 0.1, 0.05, 0.02, 210e9, 7850.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (row, expected) in
        [(steel, [2837.30, 7597.40, 14325.63, 22605.17]), (tube, [15830.80, 26338.44, 38263.16, 38945.42])]
    {
        let found = natural_frequencies(&model(&[row], &[]), TAU * 39e3, usize::MAX, &[]).unwrap();
        for (w, expected) in found.angular.iter().zip(expected) {
            assert!((w / TAU - expected).abs() < 0.01, "{} against {expected}", w / TAU);
        }
        assert!(found.angular.len() >= 4);
    }
}
