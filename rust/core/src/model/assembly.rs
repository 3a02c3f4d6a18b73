//! An assembly as a graph of nodes and elements, flattened to tables, and the order in which it is swept.

use crate::error::{Error, Result};
use crate::model::overlap::{self, Overlap};
use crate::model::section::{self, Motion};
use crate::model::slip::{SLIP_COLUMNS, Slip};
use crate::model::spring::{SPRING_COLUMNS, Spring};
use crate::model::terminals::{MODE_COLUMNS, Mode, TERMINAL_COLUMNS, TERMINAL_ENTRIES, Terminal};

/// Kinds of element, in the order of the tables.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Table {
    /// Beam segments.
    Segments,
    /// Joints between two nodes.
    Joints,
    /// Masses on a node.
    Masses,
    /// Springs and dashpots from a node to ground.
    Grounds,
    /// Beams side by side.
    Overlaps,
    /// Substructures that are known by their receptance at one plane.
    Terminals,
    /// Modes of terminals.
    Modes,
    /// Micro-slip of joints.
    Slips,
}

/// Number of tables.
pub const TABLES: usize = 8;

impl Table {
    /// All tables in their order.
    pub const ALL: [Self; TABLES] = [
        Self::Segments,
        Self::Joints,
        Self::Masses,
        Self::Grounds,
        Self::Overlaps,
        Self::Terminals,
        Self::Modes,
        Self::Slips,
    ];

    /// Number of columns.
    pub fn columns(self) -> usize {
        match self {
            Self::Segments => section::column::COUNT,
            Self::Joints => JOINT_COLUMNS,
            Self::Masses => MASS_COLUMNS,
            Self::Grounds => GROUND_COLUMNS,
            Self::Overlaps => overlap::column::COUNT,
            Self::Terminals => TERMINAL_COLUMNS,
            Self::Modes => MODE_COLUMNS,
            Self::Slips => SLIP_COLUMNS,
        }
    }
}

/// Columns of the joint table: nodes a, b, then those of the spring.
pub const JOINT_COLUMNS: usize = 2 + SPRING_COLUMNS;
/// Columns of the mass table: node, mass, inertia (for rods: node, inertia of the motion, unused).
pub const MASS_COLUMNS: usize = 3;
/// Columns of the ground table: node, then those of the spring.
pub const GROUND_COLUMNS: usize = 1 + SPRING_COLUMNS;

/// A step of a sweep towards its root; each works on the plane that the step before it left.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// A new free end at the node.
    Leaf {
        /// The node.
        node: usize,
    },
    /// Through a segment from `far` to `near`.
    Segment {
        /// Row of the segment.
        row: usize,
        /// Whether the near end is the one of smaller x.
        forward: bool,
        /// Node behind.
        far: usize,
    },
    /// Through a joint.
    Joint {
        /// Row of the joint.
        row: usize,
        /// Whether the near node is the joint's first.
        forward: bool,
        /// Node behind.
        far: usize,
    },
    /// Through an overlap.
    Overlap {
        /// Row of the overlap.
        row: usize,
        /// Whether the near end is the one of smaller x.
        forward: bool,
        /// Node behind.
        far: usize,
    },
    /// The point elements and the terminal of the node.
    Point {
        /// The node.
        node: usize,
    },
    /// Two branches meet at a node.
    Join,
    /// A branch from its free end on, by its series.
    Branch {
        /// Its number.
        index: usize,
    },
}

/// An assembly, checked.
#[derive(Clone, Debug)]
pub struct Model {
    /// Bending, axial or torsional motion.
    pub motion: Motion,
    /// Number of nodes.
    pub nodes: usize,
    /// Rows of the segment table.
    pub segments: Vec<[f64; section::column::COUNT]>,
    /// Nodes of each joint.
    pub joints: Vec<([usize; 2], Spring)>,
    /// Node, mass and inertia of each point mass.
    pub masses: Vec<(usize, [f64; 2])>,
    /// Node and spring to ground.
    pub grounds: Vec<(usize, Spring)>,
    /// Beams side by side.
    pub overlaps: Vec<Overlap>,
    /// Substructures that are known by their receptance at one plane.
    pub terminals: Vec<Terminal>,
    /// Modes of terminals, each with the row of its terminal.
    pub modes: Vec<(usize, Mode)>,
    /// Micro-slip of joints.
    pub slips: Vec<Slip>,
}

/// The tables, row by row.
#[derive(Copy, Clone, Debug, Default)]
pub struct Tables<'a> {
    /// Segments, `section::column::COUNT` columns.
    pub segments: &'a [f64],
    /// Joints, `JOINT_COLUMNS`.
    pub joints: &'a [f64],
    /// Masses, `MASS_COLUMNS`.
    pub masses: &'a [f64],
    /// Grounds, `GROUND_COLUMNS`.
    pub grounds: &'a [f64],
    /// Overlaps, `overlap::column::COUNT`.
    pub overlaps: &'a [f64],
    /// Terminals, `TERMINAL_COLUMNS`.
    pub terminals: &'a [f64],
    /// Modes, `MODE_COLUMNS`.
    pub modes: &'a [f64],
    /// Slips, `SLIP_COLUMNS`.
    pub slips: &'a [f64],
}

impl<'a> Tables<'a> {
    /// The tables in the order of `Table`.
    pub fn each(self) -> [&'a [f64]; TABLES] {
        let Self { segments, joints, masses, grounds, overlaps, terminals, modes, slips } = self;
        [segments, joints, masses, grounds, overlaps, terminals, modes, slips]
    }

    /// Tables in the order of `Table`.
    pub fn of(tables: &'a [Vec<f64>; TABLES]) -> Self {
        let [segments, joints, masses, grounds, overlaps, terminals, modes, slips] = tables;
        Self { segments, joints, masses, grounds, overlaps, terminals, modes, slips }
    }
}

fn node(value: f64, element: &'static str, row: usize) -> Result<usize> {
    // A node number above 2^24 is a mistake; that many nodes would be allocated.
    if value >= 0.0 && value.fract() == 0.0 && value < 16_777_216.0 {
        return Ok(value as usize);
    }
    let expected = "a node number: 0, 1, 2, ...";
    Err(Error::Quantity { element, row, quantity: "node", value, expected })
}

fn read_terminals(table: &[f64]) -> Result<Vec<Terminal>> {
    let mut terminals: Vec<Terminal> = Vec::new();
    for (row, values) in table.chunks_exact(TERMINAL_COLUMNS).enumerate() {
        const NAMES: [&str; TERMINAL_ENTRIES] = ["residual_y", "residual_theta", "residual_ytheta"];
        let (node, element) = (node(values[0], "terminal", row)?, "terminal");
        for (quantity, &value) in NAMES.into_iter().zip(&values[1..]) {
            if !value.is_finite() {
                return Err(Error::Quantity { element, row, quantity, value, expected: "a finite number" });
            }
        }
        if terminals.iter().any(|other| other.node == node) {
            return Err(Error::Topology(format!("two terminals on node {node}")));
        }
        terminals.push(Terminal { node, residual: [values[1], values[2], values[3]] });
    }
    Ok(terminals)
}

fn read_modes(table: &[f64], terminals: usize) -> Result<Vec<(usize, Mode)>> {
    let mut modes = Vec::new();
    for (row, values) in table.chunks_exact(MODE_COLUMNS).enumerate() {
        let terminal = values[0];
        if !(terminal >= 0.0 && terminal.fract() == 0.0 && terminal < terminals as f64) {
            let (quantity, expected) = ("terminal", "a row of the table of terminals");
            return Err(Error::Quantity { element: "mode", row, quantity, value: terminal, expected });
        }
        modes.push((terminal as usize, Mode::new(&values[1..], row)?));
    }
    Ok(modes)
}

fn read_slips(table: &[f64], joints: &[([usize; 2], Spring)]) -> Result<Vec<Slip>> {
    let mut slips: Vec<Slip> = Vec::new();
    for (row, values) in table.chunks_exact(SLIP_COLUMNS).enumerate() {
        let joint = values[0];
        let known = joint >= 0.0 && joint.fract() == 0.0 && joint < joints.len() as f64;
        if !known || slips.iter().any(|slip| slip.joint == joint as usize) {
            let (quantity, expected) = ("joint", "a row of the table of joints that no other slip has");
            return Err(Error::Quantity { element: "slip", row, quantity, value: joint, expected });
        }
        slips.push(Slip::new(values, row, joint as usize, joints[joint as usize].1.k)?);
    }
    Ok(slips)
}

impl Model {
    /// Reads and checks the tables.
    ///
    /// # Errors
    /// A quantity without physical meaning, or elements that do not form one tree.
    pub fn new(motion: Motion, tables: Tables) -> Result<Self> {
        for (table, values) in Table::ALL.into_iter().zip(tables.each()) {
            debug_assert!(values.len().is_multiple_of(table.columns()), "{table:?}: not whole rows");
        }
        let mut segments = Vec::new();
        let mut edges = Vec::new();
        for (row, values) in tables.segments.chunks_exact(section::column::COUNT).enumerate() {
            section::check(values, row, "segment")?;
            edges.push([node(values[0], "segment", row)?, node(values[1], "segment", row)?]);
            let mut copy = [0.0; section::column::COUNT];
            copy.copy_from_slice(values);
            segments.push(copy);
        }
        let mut joints = Vec::new();
        for (row, values) in tables.joints.chunks_exact(JOINT_COLUMNS).enumerate() {
            let nodes = [node(values[0], "joint", row)?, node(values[1], "joint", row)?];
            let spring = Spring::new(&values[2..]);
            spring.check("joint", row)?;
            edges.push(nodes);
            joints.push((nodes, spring));
        }
        let mut masses = Vec::new();
        for (row, values) in tables.masses.chunks_exact(MASS_COLUMNS).enumerate() {
            for (quantity, value) in [("mass", values[1]), ("inertia", values[2])] {
                if !(value.is_finite() && value >= 0.0) {
                    let expected = "zero or a positive finite number";
                    return Err(Error::Quantity { element: "point mass", row, quantity, value, expected });
                }
            }
            masses.push((node(values[0], "point mass", row)?, [values[1], values[2]]));
        }
        let mut grounds = Vec::new();
        for (row, values) in tables.grounds.chunks_exact(GROUND_COLUMNS).enumerate() {
            let spring = Spring::new(&values[1..]);
            spring.check("ground spring", row)?;
            grounds.push((node(values[0], "ground spring", row)?, spring));
        }
        let mut overlaps = Vec::new();
        for (row, values) in tables.overlaps.chunks_exact(overlap::column::COUNT).enumerate() {
            let nodes = [node(values[0], "overlap", row)?, node(values[1], "overlap", row)?];
            overlaps.push(Overlap::new(values, row, nodes)?);
            edges.push(nodes);
        }
        if motion != Motion::Bending && !overlaps.is_empty() {
            return Err(Error::Topology("an overlap joins beams in bending, not rods".into()));
        }
        let terminals = read_terminals(tables.terminals)?;
        let modes = read_modes(tables.modes, terminals.len())?;
        let slips = read_slips(tables.slips, &joints)?;
        if edges.is_empty() {
            return Err(Error::Topology("there is no segment and no joint".into()));
        }
        let nodes = 1 + edges.iter().flatten().copied().max().unwrap_or(0);
        let model =
            Self { motion, nodes, segments, joints, masses, grounds, overlaps, terminals, modes, slips };
        model.check_tree(edges.len())?;
        Ok(model)
    }

    fn check_tree(&self, edges: usize) -> Result<()> {
        if edges + 1 != self.nodes {
            let found = format!("{edges} two-node elements on {} nodes, expected one fewer", self.nodes);
            return Err(Error::Topology(found));
        }
        let points = self.masses.iter().map(|m| m.0).chain(self.grounds.iter().map(|g| g.0));
        for point in points.chain(self.terminals.iter().map(|terminal| terminal.node)) {
            if point >= self.nodes {
                return Err(Error::Topology(format!(
                    "a point element on node {point}, which no element has"
                )));
            }
        }
        let (mut seen, mut count) = (vec![false; self.nodes], 0);
        let neighbours = self.neighbours();
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            if !seen[node] {
                seen[node] = true;
                count += 1;
                stack.extend(neighbours[node].iter().map(|edge| edge.other));
            }
        }
        if count != self.nodes {
            let lost = seen.iter().position(|seen| !seen).unwrap_or(0);
            return Err(Error::Topology(format!("node {lost} is not connected to node 0")));
        }
        Ok(())
    }

    fn neighbours(&self) -> Vec<Vec<Edge>> {
        let mut out = vec![Vec::new(); self.nodes];
        for (row, segment) in self.segments.iter().enumerate() {
            let (a, b) = (segment[0] as usize, segment[1] as usize);
            out[a].push(Edge { other: b, step: Step::Segment { row, forward: true, far: b } });
            out[b].push(Edge { other: a, step: Step::Segment { row, forward: false, far: a } });
        }
        for (row, (nodes, _)) in self.joints.iter().enumerate() {
            out[nodes[0]]
                .push(Edge { other: nodes[1], step: Step::Joint { row, forward: true, far: nodes[1] } });
            out[nodes[1]]
                .push(Edge { other: nodes[0], step: Step::Joint { row, forward: false, far: nodes[0] } });
        }
        for (row, overlap) in self.overlaps.iter().enumerate() {
            let [a, b] = overlap.nodes;
            out[a].push(Edge { other: b, step: Step::Overlap { row, forward: true, far: b } });
            out[b].push(Edge { other: a, step: Step::Overlap { row, forward: false, far: a } });
        }
        out
    }

    /// The part of the model that is connected to one node of a joint without the joint, and the new number of each
    /// node in it; without micro-slip.
    pub fn side(&self, joint: usize, node: usize) -> (Self, Vec<Option<usize>>) {
        let mut number = vec![None; self.nodes];
        let (mut count, mut stack) = (0, vec![node]);
        let neighbours = self.neighbours();
        while let Some(node) = stack.pop() {
            if number[node].is_some() {
                continue;
            }
            number[node] = Some(count);
            count += 1;
            for edge in &neighbours[node] {
                if !matches!(edge.step, Step::Joint { row, .. } if row == joint) {
                    stack.push(edge.other);
                }
            }
        }
        let mut segments = Vec::new();
        for row in &self.segments {
            if let (Some(a), Some(b)) = (number[row[0] as usize], number[row[1] as usize]) {
                let mut row = *row;
                (row[0], row[1]) = (a as f64, b as f64);
                segments.push(row);
            }
        }
        let mut joints = Vec::new();
        for (row, (nodes, spring)) in self.joints.iter().enumerate() {
            if let (true, Some(a), Some(b)) = (row != joint, number[nodes[0]], number[nodes[1]]) {
                joints.push(([a, b], *spring));
            }
        }
        let mut overlaps = Vec::new();
        for overlap in &self.overlaps {
            if let [Some(a), Some(b)] = overlap.nodes.map(|node| number[node]) {
                overlaps.push(Overlap { nodes: [a, b], ..overlap.clone() });
            }
        }
        let masses = self.masses.iter().filter_map(|(at, mass)| Some((number[*at]?, *mass))).collect();
        let grounds = self.grounds.iter().filter_map(|(at, spring)| Some((number[*at]?, *spring))).collect();
        let (mut terminals, mut rows) = (Vec::new(), vec![None; self.terminals.len()]);
        for (row, terminal) in self.terminals.iter().enumerate() {
            if let Some(node) = number[terminal.node] {
                rows[row] = Some(terminals.len());
                terminals.push(Terminal { node, ..*terminal });
            }
        }
        let modes = self.modes.iter().filter_map(|(row, mode)| Some((rows[*row]?, *mode))).collect();
        let side = Self {
            motion: self.motion,
            nodes: count,
            segments,
            joints,
            masses,
            grounds,
            overlaps,
            terminals,
            modes,
            slips: Vec::new(),
        };
        (side, number)
    }

    /// The micro-slip of a joint.
    pub fn slip_of(&self, joint: usize) -> Option<&Slip> {
        self.slips.iter().find(|slip| slip.joint == joint)
    }

    /// Whether a node carries a terminal.
    pub fn has_terminal(&self, node: usize) -> bool {
        self.terminals.iter().any(|terminal| terminal.node == node)
    }

    /// Whether a node carries point elements or a terminal.
    fn has_point(&self, node: usize) -> bool {
        self.masses.iter().any(|mass| mass.0 == node)
            || self.grounds.iter().any(|ground| ground.0 == node)
            || self.has_terminal(node)
    }

    /// The steps of a sweep from all free ends to `root`, each branch before the node where it joins.
    pub fn plan(&self, root: usize) -> Vec<Step> {
        let neighbours = self.neighbours();
        let points: Vec<bool> = (0..self.nodes).map(|node| self.has_point(node)).collect();
        let mut steps = Vec::new();
        // (node, node it was reached from, next neighbour, branches taken, step back to the parent)
        let mut stack = vec![(root, usize::MAX, 0, 0, None)];
        while let Some((node, parent, next, taken, back)) = stack.pop() {
            if let Some(edge) = neighbours[node].get(next) {
                let more = usize::from(edge.other != parent);
                stack.push((node, parent, next + 1, taken + more, back));
                if more == 1 {
                    stack.push((edge.other, node, 0, 0, Some((edge.step, taken > 0))));
                }
                continue;
            }
            if taken == 0 {
                steps.push(Step::Leaf { node });
            }
            if points[node] {
                steps.push(Step::Point { node });
            }
            if let Some((step, join)) = back {
                steps.push(step);
                if join {
                    steps.push(Step::Join);
                }
            }
        }
        steps
    }
}

#[derive(Copy, Clone)]
struct Edge {
    other: usize,
    step: Step,
}
