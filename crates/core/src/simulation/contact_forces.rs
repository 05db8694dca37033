//! Forces of all contacts together: the capacitance matrix of at most `3 * MAX_TOOLS` dofs.

use glam::{DMat3, DVec3};

use super::{MAX_TOOLS, Mode, Model, State};
use crate::contact::{compliance_block, smallest_eigenvalue};

const MAX_DOFS: usize = 3 * MAX_TOOLS;

/// Fills row and column `tool` of the compliance between the tools in contact, for one that has just begun.
pub(super) fn update_compliance(model: &Model, state: &mut State, tool: usize) {
    let State { tools, compliance, motion, .. } = state;
    if let (Some(motion), Some(dynamics)) = (motion.as_mut(), &model.dynamics) {
        motion.hold(model, &dynamics.modes, tools, tool);
        // The way of the tool counts from where the moving patch is met, and its free motion is taken off every step.
        tools[tool].anchor -= motion.free_displacement(tool) + motion.left_out(tools, tool);
    }
    for other in 0..MAX_TOOLS {
        if tools[other].mode == Mode::Free {
            continue;
        }
        let block = match (motion.as_ref(), &model.dynamics) {
            (Some(motion), Some(dynamics)) => motion.compliance(&dynamics.modes, tool, other),
            _ => compliance_block(&model.green, &tools[tool].patch, &tools[other].patch).unwrap_or(DMat3::ZERO),
        };
        if other == tool {
            compliance[tool][tool] = 0.5 * (block + block.transpose());
        } else {
            compliance[tool][other] = block;
            compliance[other][tool] = block.transpose();
        }
    }
}

/// What is added to a patch's own compliance. A body in motion is coupled by a spring. Near a support, where a body at rest
/// is stiffer than any device can render, its compliance is raised evenly so that no direction exceeds the model's maximum
/// stiffness.
fn softening(model: &Model, block: &DMat3) -> f64 {
    match &model.dynamics {
        Some(dynamics) => 1.0 / dynamics.coupling,
        None => (1.0 / model.max_stiffness - smallest_eigenvalue(block)).max(0.0),
    }
}

/// `f = C^-1 (d - d_free)` for the tools in contact, `d` being each tool's way from its anchor, `d_free` its patch's free
/// motion.
pub(super) fn solve_forces(model: &Model, state: &mut State) {
    let mut matrix = [[0.0; MAX_DOFS]; MAX_DOFS];
    let mut right = [0.0; MAX_DOFS];
    let mut active = [0; MAX_TOOLS];
    let mut count = 0;
    for (tool, contact) in state.tools.iter_mut().enumerate() {
        contact.force = DVec3::ZERO;
        if contact.mode != Mode::Free {
            active[count] = tool;
            count += 1;
        }
    }
    for (i, &a) in active[..count].iter().enumerate() {
        let free = state.motion.as_ref().map_or(DVec3::ZERO, |motion| motion.free_displacement(a));
        let displacement = state.tools[a].position - state.tools[a].anchor - free;
        for (j, &b) in active[..count].iter().enumerate() {
            let mut block = state.compliance[a][b] * (1.0 / state.stiffness_scale);
            if a == b {
                block += DMat3::from_diagonal(DVec3::splat(softening(model, &block)));
            }
            for row in 0..3 {
                for column in 0..3 {
                    matrix[3 * i + row][3 * j + column] = block.col(column)[row];
                }
            }
        }
        right[3 * i..3 * i + 3].copy_from_slice(&displacement.to_array());
    }
    cholesky_solve(&mut matrix, &mut right, 3 * count);
    for (i, &a) in active[..count].iter().enumerate() {
        state.tools[a].force = DVec3::from_slice(&right[3 * i..3 * i + 3]);
    }
}

/// Solves the leading `n` equations in place. A pivot that is not positive yields infinities or NaN, which the safety
/// stage turns into a latched fault; nothing here panics.
fn cholesky_solve(a: &mut [[f64; MAX_DOFS]; MAX_DOFS], x: &mut [f64; MAX_DOFS], n: usize) {
    for j in 0..n {
        for k in 0..j {
            for i in j..n {
                a[i][j] -= a[i][k] * a[j][k];
            }
        }
        let pivot = a[j][j].sqrt();
        for i in j..n {
            a[i][j] /= pivot;
        }
    }
    for i in 0..n {
        for k in 0..i {
            x[i] -= a[i][k] * x[k];
        }
        x[i] /= a[i][i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= a[k][i] * x[k];
        }
        x[i] /= a[i][i];
    }
}
