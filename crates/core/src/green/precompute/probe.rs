//! Accuracy probe: the error of the columns, measured on a few of them before the others are computed.
//!
//! The three columns of some nodes are solved and corrected by their residuals until these are small; only the rounding of the
//! entries of `K` itself remains. The columns of the sweeps are compared with them. Typical contacts are solved with the patches
//! around those nodes, and their errors estimated as those of an answer ([`crate::green::accuracy`]). Columns of supports are
//! measured all at once, by random motions of theirs.

use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Mat, Side};
use glam::{DMat3, DVec3};

use super::inverse::Inverse;
use super::number::Number;
use super::problem::Problem;
use super::sweep::{Scratch, Source, Sweep, loaded};
use super::system::System;
use crate::fem::SymmetricCsc;
use crate::green::accuracy::{Accuracy, Pressed, ROUNDING_MARGIN, largest, rounding_noise, unknown_errors};
use crate::green::precision::Precision;
use crate::solver::Condition;

/// Probed patches, and nodes of each: some per cent of the columns of a body of 600 touchable nodes.
const PATCHES: usize = 3;
const NODES: usize = 8;
/// Columns of a patch.
pub const WIDTH: usize = 3 * NODES;
/// Columns that are solved by the whole of the factor.
pub const SOLVED: usize = 3 * PATCHES;
/// Random motions of the supports that are solved. The largest error is taken: one motion may be spared by chance.
const MOTIONS: usize = 6;
/// Rounding of the sums that the entries of `K` are, over all entries of a row. The root of the condition number raises it
/// to what it is in the energy norm: a stiff part on a soft one is turned by `e K_stiff / K_soft`.
const ENTRIES_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A few neighbouring touchable nodes, free along all axes; the first is the one they lie around.
pub struct Patch {
    /// Their dofs.
    dofs: Vec<u32>,
    /// Right rows of the first node's three columns.
    exact: Vec<[f64; 3]>,
}

/// References of the comparison.
pub struct Probe {
    patches: Vec<Patch>,
    /// Error of the factor's own columns in the energy norm, `|w_j| / s_j`: for sweeps in double precision before the
    /// corrections, for others after them, since the entries show the error of those sweeps.
    pub factor_error: f64,
    /// Error of the supports' columns ([`Accuracy::supports`]).
    pub supports_error: f64,
}

impl Probe {
    /// Chooses patches, the first where the body is softest beside its own stiffness, the others far from it, and solves;
    /// `None` where corrections do not help.
    pub fn new<C: Number>(
        problem: &Problem,
        stiffness: &SymmetricCsc,
        inverse: &Inverse<'_, C>,
        condition: &Condition,
    ) -> Option<Self> {
        let supports = &problem.supports;
        let rank = |dof: u32| supports.free_rank[dof as usize] as usize;
        let of_entries = ENTRIES_ROUNDING * condition.number.sqrt();
        let supports_error = supports_error(problem, stiffness, inverse)?.max(of_entries);
        let mut probe = Self { patches: Vec::new(), factor_error: 0.0, supports_error };
        let dofs_of =
            |nodes: Vec<u32>| nodes.into_iter().flat_map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
        let patches: Vec<Vec<u32>> = chosen_patches(problem, condition).into_iter().map(dofs_of).collect();
        let Some(first) = patches.first() else {
            // Only supports are touchable: the error by the condition number.
            probe.factor_error = condition.number * f64::EPSILON;
            return Some(probe);
        };
        let (count, each) = (supports.free.len(), first.len().min(3));
        let mut loads = vec![0.0; each * patches.len() * count];
        for (k, &dof) in patches.iter().flat_map(|dofs| &dofs[..each]).enumerate() {
            loads[k * count + rank(dof)] = 1.0;
        }
        let found = inverse.refined(&loads)?;
        let errors = if size_of::<C>() == size_of::<f64>() { &found.first } else { &found.last };
        probe.factor_error = errors.iter().fold(0.0, |most: f64, &error| most.max(error));
        for (dofs, columns) in patches.into_iter().zip(found.columns.chunks_exact(each * count)) {
            let exact = dofs.iter().map(|&dof| [0, 1, 2].map(|k| columns[k * count + rank(dof)])).collect();
            probe.patches.push(Patch { dofs, exact });
        }
        Some(probe)
    }

    /// Whether there is no patch: only supports are touchable.
    pub fn is_empty(&self) -> bool {
        self.patches.is_empty()
    }

    /// `Psi` between the dofs of every patch as the sweeps compute it.
    pub fn squares<C: Number>(&self, system: &System<'_>, sweep: &Sweep<C>) -> Squares {
        let mut scratch = Scratch::new(&sweep.tree, WIDTH);
        let of = |patch: &Patch| swept(system, sweep, &mut scratch, &patch.dofs);
        Squares(self.patches.iter().map(of).collect())
    }

    /// Largest error of the sweeps' entries, over `s_i s_j`.
    pub fn computed_error(&self, squares: &Squares) -> f64 {
        let mut largest = self.factor_error;
        for (patch, square) in self.patches.iter().zip(&squares.0) {
            for (i, exact) in patch.exact.iter().enumerate() {
                for (j, exact) in exact.iter().enumerate() {
                    let bound = (square[(i, i)] * square[(j, j)]).sqrt();
                    largest = largest.max((square[(i, j)] - exact).abs() / bound);
                }
            }
        }
        // NaN counts as the largest error.
        if largest.is_finite() { largest } else { 1.0 }
    }
}

/// `Psi` between the dofs of each patch.
pub struct Squares(Vec<Mat<f64>>);

impl Squares {
    /// Adds to `measured` the errors of typical contacts with these entries: of the force of pressed nodes and patches, and
    /// of nodal forces under stamps.
    pub fn typical(&self, measured: Accuracy, precision: Precision) -> Accuracy {
        // Contacts may be of any depth, loads may not: the error of the loads is estimated with the answers.
        let entries = Accuracy { computed: measured.computed, ..Accuracy::default() };
        let mut typical = measured;
        for square in &self.0 {
            for count in [1, square.nrows() / 3] {
                typical.touch = typical.touch.max(pressed_error(square, count, entries, precision));
            }
            typical.stamp = typical.stamp.max(stamp_error(square, entries, precision));
        }
        typical
    }
}

/// Error of the columns of the touchable supports in the energy norm, each moved by `1 / s_j`, with random signs; `None`
/// where corrections do not help.
fn supports_error<C: Number>(problem: &Problem, stiffness: &SymmetricCsc, inverse: &Inverse<'_, C>) -> Option<f64> {
    let supports = &problem.supports;
    let count = supports.free.len();
    let mut loads = vec![0.0; MOTIONS * count];
    let nodes = problem.touch.iter().map(|&t| problem.surface_nodes[t as usize]);
    // A generator whose highest bit is even enough (Steele and Vigna 2021).
    let mut random: u64 = 1;
    for dof in nodes.flat_map(|node| 3 * node..3 * node + 3).filter(|&dof| supports.is_fixed(dof)) {
        let moved = stiffness.diagonal(dof).sqrt().recip();
        for load in loads.chunks_exact_mut(count) {
            random = random.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(1);
            let signed = if random >> 63 == 0 { moved } else { -moved };
            for (other, entry) in stiffness.column(dof as usize) {
                if let Some(load) = load.get_mut(supports.free_rank[other as usize] as usize) {
                    *load -= entry * signed;
                }
            }
        }
    }
    if loads.iter().all(|&load| load == 0.0) {
        return Some(0.0);
    }
    let found = inverse.refined(&loads)?;
    Some(found.first.iter().zip(&found.size).fold(0.0, |most: f64, (error, size)| most.max(error * size)))
}

/// Nodes of every patch.
fn chosen_patches(problem: &Problem, condition: &Condition) -> Vec<Vec<u32>> {
    let supports = &problem.supports;
    let free = |&node: &u32| (3 * node..3 * node + 3).all(|dof| !supports.is_fixed(dof));
    let nodes: Vec<u32> = problem.touch.iter().map(|&t| problem.surface_nodes[t as usize]).filter(free).collect();
    let amplitude = |node: u32| -> f64 {
        (3 * node..3 * node + 3).map(|dof| condition.direction[supports.free_rank[dof as usize] as usize].powi(2)).sum()
    };
    let position = |node: u32| problem.mesh.nodes[node as usize];
    let mut centres: Vec<u32> = Vec::new();
    for _ in 0..PATCHES.min(nodes.len()) {
        let distance = |node: u32| -> f64 {
            let distances = centres.iter().map(|&c| position(c).distance_squared(position(node)));
            distances.fold(f64::INFINITY, f64::min)
        };
        let rank = |node: u32| if centres.is_empty() { amplitude(node) } else { distance(node) };
        let farthest = nodes.iter().copied().max_by(|&a, &b| rank(a).total_cmp(&rank(b)));
        centres.extend(farthest);
    }
    let around = |centre: u32| {
        let mut near = nodes.clone();
        near.sort_by(|&a, &b| {
            let distance = |node: u32| position(centre).distance_squared(position(node));
            distance(a).total_cmp(&distance(b)).then(a.cmp(&b))
        });
        near.truncate(NODES);
        near
    };
    centres.into_iter().map(around).collect()
}

/// The patch's rows of its columns, as the sweeps compute them; the mean of both halves.
fn swept<C: Number>(system: &System<'_>, sweep: &Sweep<C>, scratch: &mut Scratch<C>, dofs: &[u32]) -> Mat<f64> {
    let (tree, width) = (&sweep.tree, dofs.len());
    let rows: Vec<u32> = dofs.iter().filter_map(|&dof| system.layout.tree_row(tree, system.supports, dof)).collect();
    let source = |(column, &row): (usize, &u32)| Source { row, column: column as u32, value: 1.0 };
    let sources: Vec<Source> = rows.iter().enumerate().map(source).collect();
    sweep.solve(scratch, &sources, &loaded(tree, width, &sources), &vec![width; tree.nodes.len()]);
    let value = |i: usize, j: usize| scratch.row(rows[i], width)[j].to_f64();
    Mat::from_fn(width, width, |i, j| 0.5 * (value(i, j) + value(j, i)))
}

/// Largest relative error of the force on the first `count` nodes of a patch, pressed as one along each axis.
fn pressed_error(square: &Mat<f64>, count: usize, accuracy: Accuracy, precision: Precision) -> f64 {
    let weight = 1.0 / count as f64;
    let (mut compliance, mut independent, mut coherent) = (DMat3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for i in 0..3 * count {
        for j in 0..3 * count {
            compliance.col_mut(j % 3)[i % 3] += weight * weight * square[(i, j)];
        }
        independent[i % 3] += weight * weight * square[(i, i)];
        coherent[i % 3] += weight * square[(i, i)].sqrt();
    }
    let (stiffness, prescribed) = (compliance.inverse(), [true; 3]);
    let independent = independent.map(f64::sqrt);
    let of_axis = |axis: usize| {
        let force = stiffness.col(axis);
        let pressed = Pressed { stiffness, prescribed, independent, coherent, force };
        pressed.error(accuracy, precision).force / force.length()
    };
    (0..3).map(of_axis).map(finite).fold(0.0, f64::max)
}

/// Largest relative error of the nodal forces under a patch whose nodes are all moved along one axis.
fn stamp_error(square: &Mat<f64>, accuracy: Accuracy, precision: Precision) -> f64 {
    let n = square.nrows();
    let magnitude: Vec<f64> = (0..n).map(|i| square[(i, i)].sqrt()).collect();
    let scaled = Mat::from_fn(n, n, |i, j| square[(i, j)] / (magnitude[i] * magnitude[j]));
    let Ok(factor) = scaled.llt(Side::Lower) else { return 1.0 };
    let inverse = factor.inverse();
    let of_axis = |axis: usize| {
        let moved = Mat::from_fn(n, 1, |i, _| if i % 3 == axis { 1.0 / magnitude[i] } else { 0.0 });
        let scaled_force = factor.solve(&moved);
        let size = scaled_force.norm_l2();
        let noise: Vec<f64> = (0..n)
            .map(|i| match precision {
                Precision::F16 => rounding_noise(precision, 1.0, size),
                _ => {
                    let squares: f64 = (0..n).map(|j| (scaled[(i, j)] * scaled_force[(j, 0)]).powi(2)).sum();
                    ROUNDING_MARGIN * precision.unit_roundoff() * squares.sqrt()
                }
            })
            .collect();
        let errors = unknown_errors(inverse.as_ref(), &noise, accuracy.residual(size));
        let error = largest(errors.iter().zip(&magnitude).map(|(e, s)| e / s));
        error / largest(magnitude.iter().enumerate().map(|(i, s)| scaled_force[(i, 0)] / s))
    };
    (0..3).map(of_axis).map(finite).fold(0.0, f64::max)
}

/// NaN as an error of one.
fn finite(error: f64) -> f64 {
    if error.is_finite() { error } else { 1.0 }
}
