//! Motions of the whole that strain nothing.

use crate::model::Model;

/// Rigid-body modes: displacements of the whole that no spring to ground resists.
pub(crate) fn rigid_modes(model: &Model) -> usize {
    let degrees = model.motion.degrees();
    if degrees == 1 {
        return usize::from(!model.grounds.iter().any(|(_, spring)| spring.k[0] > 0.0));
    }
    // Positions of the nodes along the axis, joints having no length.
    let mut position = vec![f64::NAN; model.nodes];
    position[0] = 0.0;
    for _ in 0..model.nodes {
        for row in &model.segments {
            let (a, b) = (row[0] as usize, row[1] as usize);
            if position[b].is_nan() {
                position[b] = position[a] + row[crate::section::column::LENGTH];
            }
            if position[a].is_nan() {
                position[a] = position[b] - row[crate::section::column::LENGTH];
            }
        }
        for overlap in &model.overlaps {
            let [a, b] = overlap.nodes;
            if position[b].is_nan() {
                position[b] = position[a] + overlap.length();
            }
            if position[a].is_nan() {
                position[a] = position[b] - overlap.length();
            }
        }
        for (nodes, _) in &model.joints {
            for (to, from) in [(nodes[0], nodes[1]), (nodes[1], nodes[0])] {
                if position[to].is_nan() {
                    position[to] = position[from];
                }
            }
        }
        if position.iter().all(|x| !x.is_nan()) {
            break;
        }
    }
    let span = position.iter().fold(0.0_f64, |most, x| most.max(x.abs())).max(f64::MIN_POSITIVE);
    // Stiffness against a shift and a turn about node 0, the turn measured at the span.
    let (mut shift, mut turn, mut both) = (0.0, 0.0, 0.0);
    for (node, spring) in &model.grounds {
        let [y, theta, mixed] = spring.k;
        let x = position[*node] / span;
        shift += y;
        both += y * x + mixed / span;
        turn += y * x * x + 2.0 * mixed * x / span + theta / (span * span);
    }
    let (sum, product) = (shift + turn, shift * turn - both * both);
    if sum == 0.0 {
        2
    } else if product <= 1e-13 * sum * sum {
        1
    } else {
        0
    }
}
