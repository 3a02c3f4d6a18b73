//! Properties of the core that hold for every assembly.

use num_complex::Complex64;
use proptest::prelude::*;

use crate::{
    Coordinate, Frequencies, Model, Motion, Request, Response, Tables, natural_frequencies, receptance,
};

const TAU: f64 = core::f64::consts::TAU;

fn segment(node: usize, length: f64, diameter: f64, loss_factor: f64) -> [f64; 14] {
    let (a, b) = (node as f64, node as f64 + 1.0);
    [a, b, length, diameter, 0.0, 210e9, 7850.0, 0.3, loss_factor, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn model(segments: &[[f64; 14]], joints: &[[f64; 9]]) -> Model {
    let tables =
        Tables { segments: segments.as_flattened(), joints: joints.as_flattened(), ..Tables::default() };
    Model::new(Motion::Bending, tables).unwrap()
}

fn both_ends(model: &Model, w: &[Complex64], far: usize, threads: usize) -> Response {
    let points = |node| [0, 1].map(|direction| Coordinate { node, direction });
    let all: Vec<Coordinate> = points(0).into_iter().chain(points(far)).collect();
    let request = Request { excitations: all.clone(), responses: all, ..Request::default() };
    receptance(model, &Frequencies::complex(w, 1.0), &request, threads).unwrap()
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
fn lines_in_hertz_are_lines_in_radians_a_second() {
    let model = model(&[segment(0, 0.06, 0.012, 1e-3), segment(1, 0.1, 0.04, 1e-3)], &[]);
    let hertz: Vec<f64> = (1..=700).map(|line| 7.3 * f64::from(line)).collect();
    let windowed: Vec<Complex64> = hertz.iter().map(|f| Complex64::new(*f, -0.3)).collect();
    let angular = |lines: &[Complex64]| -> Vec<Complex64> {
        lines.iter().map(|f| Complex64::new(f.re * TAU, f.im * TAU)).collect()
    };
    let as_complex: Vec<Complex64> = hertz.iter().map(|f| (*f).into()).collect();
    let tip = vec![Coordinate { node: 0, direction: 0 }];
    let request = Request { excitations: tip.clone(), responses: tip, ..Request::default() };
    let all = |lines: Frequencies| receptance(&model, &lines, &request, 1).unwrap().receptance;
    let expected = all(Frequencies::complex(&angular(&as_complex), 1.0));
    assert!(all(Frequencies::real(&hertz, TAU)) == expected);
    assert!(all(Frequencies::complex(&as_complex, TAU)) == expected);
    let expected = all(Frequencies::complex(&angular(&windowed), 1.0));
    assert!(all(Frequencies::complex(&windowed, TAU)) == expected);
}

#[test]
fn a_line_that_is_no_frequency_is_named() {
    let model = model(&[segment(0, 0.06, 0.012, 1e-3)], &[]);
    let request = Request::default();
    let mut hertz: Vec<f64> = (1..=100).map(f64::from).collect();
    for (line, value) in [(0, 0.0), (37, f64::NAN), (64, -1.0), (99, f64::INFINITY), (50, 1e308)] {
        let right = core::mem::replace(&mut hertz[line], value);
        let complex: Vec<Complex64> = hertz.iter().map(|f| (*f).into()).collect();
        for lines in [Frequencies::real(&hertz, TAU), Frequencies::complex(&complex, TAU)] {
            let error = receptance(&model, &lines, &request, 1).unwrap_err();
            assert!(error.to_string().starts_with(&format!("frequency line {line}:")), "{error}");
        }
        hertz[line] = right;
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
    let tip_of = |model: &Model, count| {
        let w = lines(count, 12e3);
        receptance(model, &Frequencies::complex(&w, 1.0), &request, 1).unwrap().receptance
    };
    // 600 lines are taken by the series of the branch, 100 segment by segment.
    let (many, few, stiff) = (tip_of(&whole, 600), tip_of(&whole, 100), tip_of(&joined, 600));
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
        let found = natural_frequencies(&model(&[row], &[]), Some(TAU * 39e3), usize::MAX, &[]).unwrap();
        for (w, expected) in found.angular.iter().zip(expected) {
            assert!((w / TAU - expected).abs() < 0.01, "{} against {expected}", w / TAU);
        }
        assert!(found.angular.len() >= 4);
    }
}
