//! Forces of all contacts together: the capacitance matrix of at most `3 * MAX_TOOLS` dofs.

use glam::{DMat3, DVec3};

use super::{MAX_TOOLS, Mode, Model, State};
use crate::contact::{compliance_block, smallest_eigenvalue};

const MAX_DOFS: usize = 3 * MAX_TOOLS;

/// Fills row and column `tool` of the compliance between the tools in contact.
pub(super) fn update_compliance(model: &Model, state: &mut State, tool: usize) {
    for other in 0..MAX_TOOLS {
        if state.tools[other].mode == Mode::Free {
            continue;
        }
        let (a, b) = (&state.tools[tool].patch, &state.tools[other].patch);
        let block = compliance_block(&model.green, a, b).unwrap_or(DMat3::ZERO);
        if other == tool {
            state.compliance[tool][tool] = 0.5 * (block + block.transpose());
        } else {
            state.compliance[tool][other] = block;
            state.compliance[other][tool] = block.transpose();
        }
    }
}

/// `f = C^-1 d` for the tools in contact, `d` being each tool's way from its anchor. Near a support, where the body is
/// stiffer than any device can render, `C` is raised evenly so that no direction exceeds the model's maximum stiffness.
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
        let displacement = state.tools[a].position - state.tools[a].anchor;
        for (j, &b) in active[..count].iter().enumerate() {
            let mut block = state.compliance[a][b] * (1.0 / state.stiffness_scale);
            if a == b {
                let lift = (1.0 / model.max_stiffness - smallest_eigenvalue(&block)).max(0.0);
                block += DMat3::from_diagonal(DVec3::splat(lift));
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
