//! The entries through which damping and frequency act on a model.
//!
//! Frequency stands beside inertia as w^2 m, beside dashpots as w c, and in modes of terminals as phi / w and w / w_r.
//! Derivatives by frequency and by a share of all damping follow from those by these entries.

use crate::model::assembly::{Model, Table};
use crate::model::overlap;
use crate::model::request::Parameter;
use crate::model::section::column::{CORE_MATERIAL, MATERIAL, OUTER_DIAMETER};
use crate::model::spring::{Spring, Term};

/// Place of the density and of the loss factor among the numbers of a material.
const DENSITY: usize = 1;
const LOSS_FACTOR: usize = 3;

/// First columns of a spring in the tables of joints and of grounds.
const IN_JOINTS: usize = 2;
const IN_GROUNDS: usize = 1;

impl Model {
    /// Entries a that are not zero with numbers n a, so that w dH/dw = sum n a dH/da.
    pub(crate) fn frequency_weights(&self) -> Vec<(Parameter, f64)> {
        let mut out = Vec::new();
        self.materials(DENSITY, &mut out);
        for (row, (_, inertia)) in self.masses.iter().enumerate() {
            for (i, value) in inertia.iter().enumerate() {
                out.push((entry(Table::Masses, row, 1 + i), *value));
            }
        }
        for (_, weight) in &mut out {
            *weight *= 2.0;
        }
        self.dashpots(&mut out);
        for (row, (_, mode)) in self.modes.iter().enumerate() {
            let ([y, theta], [y_lagging, theta_lagging]) = (mode.shape, mode.lagging);
            let values = [(1, mode.angular), (3, y), (4, theta), (5, y_lagging), (6, theta_lagging)];
            out.extend(values.map(|(column, value)| (entry(Table::Modes, row, column), -value)));
        }
        out.retain(|(_, weight)| *weight != 0.0);
        out
    }

    /// The dashpots and loss factors that are not zero, with their values. Slip and modes of terminals are left out.
    pub(crate) fn damping(&self) -> Vec<(Parameter, f64)> {
        let mut out = Vec::new();
        self.materials(LOSS_FACTOR, &mut out);
        self.dashpots(&mut out);
        for (table, start, row, spring) in self.springs() {
            let losses = spring.columns_with(|term| matches!(term, Term::Loss(_)));
            out.extend(losses.map(|(column, value)| (entry(table, row, start + column), value)));
        }
        for (row, overlap) in self.overlaps.iter().enumerate() {
            out.push((entry(Table::Overlaps, row, overlap::column::LOSS_FACTOR), overlap.loss_factor));
        }
        out.retain(|(_, value)| *value != 0.0);
        out
    }

    /// The same model with a share of its dashpots and loss factors.
    pub(crate) fn with_damping(&self, share: f64) -> Self {
        let mut model = self.clone();
        let beams = model.overlaps.iter_mut().flat_map(|overlap| &mut overlap.beams);
        for row in model.segments.iter_mut().chain(beams) {
            row[MATERIAL + LOSS_FACTOR] *= share;
            row[CORE_MATERIAL + LOSS_FACTOR] *= share;
        }
        for overlap in &mut model.overlaps {
            overlap.c = overlap.c.map(|c| share * c);
            overlap.loss_factor *= share;
        }
        let joints = model.joints.iter_mut().map(|joint| &mut joint.1);
        for spring in joints.chain(model.grounds.iter_mut().map(|ground| &mut ground.1)) {
            *spring = spring.with_damping(share);
        }
        model
    }

    /// Springs with their tables, first columns and rows.
    fn springs(&self) -> impl Iterator<Item = (Table, usize, usize, &Spring)> {
        let joints = self.joints.iter().enumerate();
        let joints = joints.map(|(row, (_, spring))| (Table::Joints, IN_JOINTS, row, spring));
        let grounds = self.grounds.iter().enumerate();
        joints.chain(grounds.map(|(row, (_, spring))| (Table::Grounds, IN_GROUNDS, row, spring)))
    }

    fn dashpots(&self, out: &mut Vec<(Parameter, f64)>) {
        for (table, start, row, spring) in self.springs() {
            let dashpots = spring.columns_with(|term| matches!(term, Term::Dashpot(_)));
            out.extend(dashpots.map(|(column, value)| (entry(table, row, start + column), value)));
        }
        for (row, overlap) in self.overlaps.iter().enumerate() {
            for (i, c) in overlap.c.iter().enumerate() {
                out.push((entry(Table::Overlaps, row, overlap::column::C + i), *c));
            }
        }
    }

    /// A number of the materials of all rings and cores.
    fn materials(&self, place: usize, out: &mut Vec<(Parameter, f64)>) {
        for material in [MATERIAL, CORE_MATERIAL] {
            for (row, values) in self.segments.iter().enumerate() {
                let column = material + place;
                out.push((entry(Table::Segments, row, column), values[column]));
            }
            for (row, overlap) in self.overlaps.iter().enumerate() {
                for (beam, start) in
                    overlap.beams.iter().zip([overlap::column::INNER, overlap::column::OUTER])
                {
                    let column = start + material + place - OUTER_DIAMETER;
                    out.push((entry(Table::Overlaps, row, column), beam[material + place]));
                }
            }
        }
    }
}

fn entry(table: Table, row: usize, column: usize) -> Parameter {
    Parameter { table, row, column }
}
