//! One step of Newton's method for the positions of the tools.

use glam::{DMat3, DVec3};

use super::scratch::LocalScratch;
use super::snap::stable_jacobian;
use crate::simulation::system::System;

/// One step of Newton's method; returns the longest over the contacts, m, and whether one of them is unstable. Steps with pressure
/// cells are bounded by their residuals instead.
pub fn newton_step(local: &mut LocalScratch, system: &mut System, count: usize) -> (f64, bool) {
    let mut unstable = false;
    for a in 0..count {
        let mut jacobian = local.responses[a].jacobian;
        if !local.pace.cells {
            let (matrix, factor) = local.responses[a].stability_matrix();
            let (raised, is_unstable) = stable_jacobian(matrix, &local.between[a][a]);
            if is_unstable {
                jacobian += factor * (raised - matrix);
            }
            unstable |= is_unstable;
        }
        local.jacobians[a] = jacobian;
    }
    let mut longest = 0.0f64;
    if count == 1 {
        let residual = local.residual(0, count);
        let matrix = block(local, 0, 0) + local.pace.secant.correction(0, residual).unwrap_or(DMat3::ZERO);
        local.steps[0] = matrix.inverse() * -residual;
    } else {
        fill_system(local, system, count);
        system.solve_unsymmetric(3 * count);
        for (step, solved) in local.steps[..count].iter_mut().zip(system.right.chunks_exact(3)) {
            *step = DVec3::from_slice(solved);
        }
    }
    for step in &mut local.steps[..count] {
        *step = if step.is_finite() { *step } else { DVec3::ZERO };
        longest = longest.max(step.length());
    }
    (longest, unstable)
}

/// Derivative of the equation of contact `a` by the position of contact `b`.
fn block(local: &LocalScratch, a: usize, b: usize) -> DMat3 {
    let block = local.between[a][b] * local.jacobians[b];
    if a != b {
        return block;
    }
    let response = &local.responses[a];
    let moved = block + DMat3::IDENTITY + response.displacement_by_position();
    if response.has_higher_orders() { moved + response.higher.compliance * local.jacobians[a] } else { moved }
}

/// The equations of all contacts.
fn fill_system(local: &mut LocalScratch, system: &mut System, count: usize) {
    let mut fill = |(a, b): (usize, usize), block: DMat3| {
        for row in 0..3 {
            for column in 0..3 {
                system.matrix[3 * a + row][3 * b + column] = block.col(column)[row];
            }
        }
    };
    for a in 0..count {
        let residual = local.residual(a, count);
        let correction = local.pace.secant.correction(a, residual).unwrap_or(DMat3::ZERO);
        for b in 0..count {
            let block = block(local, a, b);
            fill((a, b), if a == b { block + correction } else { block });
        }
        system.right[3 * a..3 * a + 3].copy_from_slice(&(-residual).to_array());
    }
}
