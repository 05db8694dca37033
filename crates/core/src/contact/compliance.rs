//! A single touch: the 3x3 compliance `C = W^T Psi W` of a patch, m/N, and the force for a given displacement.

use glam::{DMat3, DVec3};

use super::{MAX_PATCH_NODES, Patch, PatchGeometry, PatchScratch, Refusal, SurfaceQuery, TouchPatch, patch_weights};
use crate::green::GreensFunction;
use crate::green::accuracy::{Pressed, PressedError, largest, relative};
use crate::math::{acos, cos};
use crate::tensor::outer;
use crate::{Error, Result};

/// Sweeps of Jacobi's method; four give all digits.
const JACOBI_SWEEPS: usize = 6;

/// Smallest eigenvalue of a symmetric 3x3 matrix (closed form by the angle of the characteristic cubic; Smith, 1961).
pub fn smallest_eigenvalue(m: &DMat3) -> f64 {
    let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
    let deviator = *m - DMat3::from_diagonal(DVec3::splat(mean));
    let squared =
        deviator.x_axis.length_squared() + deviator.y_axis.length_squared() + deviator.z_axis.length_squared();
    let p = (squared / 6.0).sqrt();
    if p <= f64::EPSILON * mean.abs() {
        return mean;
    }
    let r = (deviator.determinant() / (2.0 * p * p * p)).clamp(-1.0, 1.0);
    mean + 2.0 * p * cos(acos(r) / 3.0 + 2.0 * std::f64::consts::FRAC_PI_3)
}

/// A symmetric 3x3 matrix whose eigenvalues below `least` are raised to it, each along its own direction, by cyclic rotations
/// (Jacobi). Raising all directions by what one of them lacks would soften the others.
pub fn raise_eigenvalues(matrix: &DMat3, least: f64) -> DMat3 {
    if smallest_eigenvalue(matrix) >= least {
        return *matrix;
    }
    let (mut diagonal, mut axes) = (*matrix, DMat3::IDENTITY);
    for (i, k) in [(0, 1), (0, 2), (1, 2)].into_iter().cycle().take(3 * JACOBI_SWEEPS) {
        let off = diagonal.col(i)[k];
        if off == 0.0 {
            continue;
        }
        let theta = (diagonal.col(k)[k] - diagonal.col(i)[i]) / (2.0 * off);
        let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
        let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
        let sine = tangent * cosine;
        let mut rotation = DMat3::IDENTITY;
        (rotation.col_mut(i)[i], rotation.col_mut(k)[k]) = (cosine, cosine);
        (rotation.col_mut(i)[k], rotation.col_mut(k)[i]) = (-sine, sine);
        diagonal = rotation.transpose() * diagonal * rotation;
        axes *= rotation;
    }
    let missing = [0, 1, 2].map(|k| outer(axes.col(k), axes.col(k)) * (least - diagonal.col(k)[k]).max(0.0));
    *matrix + missing[0] + missing[1] + missing[2]
}

/// Response to a pressed patch.
pub struct Touch {
    /// Force on the body, N.
    pub force: DVec3,
    /// Of all surface dofs (3s), those of the reference loads included, m.
    pub displacements: Vec<f64>,
    /// Estimated error: of the force relative to it, or of the displacements relative to the largest one, whichever is
    /// larger. A force that is small beside the one that would undo the reference loads' displacement is compared with
    /// that one.
    pub error: f64,
}

/// Moves a patch at `point` of the unloaded surface to the mean displacement `displacement` (m, from the unloaded shape;
/// `None` leaves a component free): `f = C^-1 (d - W^T u_free)`.
///
/// # Errors
/// A patch with a node outside the touch region, on the support only, or with too many nodes.
pub fn touch(green: &GreensFunction, point: DVec3, displacement: [Option<f64>; 3], radius: f64) -> Result<Touch> {
    let query = SurfaceQuery::new(&green.surface)?;
    let centre =
        query.closest(&green.surface, point).ok_or_else(|| Error::Invalid("the touch point must be finite".into()))?;
    let mut weighed = Patch::default();
    let (surface, mut scratch) = (&green.surface, PatchScratch::new(&green.surface));
    let mut patch = TouchPatch::default();
    patch_weights(surface, &PatchGeometry::new(surface), &centre, radius, &mut scratch, &mut weighed)
        .and_then(|()| patch.set_patch(green, &weighed))
        .map_err(|refusal| refused(green, radius, refusal))?;
    let compliance = patch.own_compliance(green);
    let mut displacements = green.free_displacements();
    let sag = patch_mean(patch.patch(), &displacements);
    let prescribed = displacement.map(|d| d.is_some());
    let stiffness = constrained_stiffness(&compliance, prescribed)
        .ok_or_else(|| Error::Invalid("the contact lies on the support, which does not give".into()))?;
    let masked = |v: DVec3| DVec3::from_array(std::array::from_fn(|k| if prescribed[k] { v[k] } else { 0.0 }));
    let target = DVec3::from(displacement.map(|d| d.unwrap_or(0.0)));
    let force = stiffness * masked(target - sag);
    patch.add_response(green, force, &mut displacements);
    let largest_force = force.length().max((stiffness * masked(sag)).length());
    let error = pressed(green, patch.patch(), stiffness, prescribed, force).error(green.accuracy, green.precision());
    let error = relative_error(green, error, largest_force, &displacements);
    Ok(Touch { force, displacements, error })
}

/// Relative error of the force or of the displacements, whichever is larger.
fn relative_error(green: &GreensFunction, error: PressedError, largest_force: f64, displacements: &[f64]) -> f64 {
    let free = (0..displacements.len()).filter(|&row| !green.row_is_fixed[row]);
    let magnitude = free.map(|row| green.magnitude(row)).fold(0.0, f64::max);
    let moved = largest(displacements.iter().copied());
    relative(error.force, largest_force).max(relative(magnitude * error.elsewhere, moved))
}

/// Data of a patch for the error estimate; supported dofs are left out.
fn pressed(green: &GreensFunction, patch: &Patch, stiffness: DMat3, prescribed: [bool; 3], force: DVec3) -> Pressed {
    let (mut independent, mut coherent) = (DVec3::ZERO, DVec3::ZERO);
    for (node, weight) in patch.iter() {
        for axis in (0..3).filter(|axis| !green.row_is_fixed[3 * node + axis]) {
            let magnitude = weight * green.magnitude(3 * node + axis);
            independent[axis] += magnitude * magnitude;
            coherent[axis] += magnitude.abs();
        }
    }
    Pressed { stiffness, prescribed, independent: independent.map(f64::sqrt), coherent, force }
}

/// `W^T u`: the weighted mean displacement of a patch, m.
fn patch_mean(patch: &Patch, displacements: &[f64]) -> DVec3 {
    patch.iter().map(|(node, weight)| weight * DVec3::from_slice(&displacements[3 * node..])).sum()
}

fn refused(green: &GreensFunction, radius: f64, refusal: Refusal) -> Error {
    Error::Invalid(match refusal {
        Refusal::TooManyNodes => {
            format!("a contact radius of {radius} m covers more than {MAX_PATCH_NODES} nodes; choose a smaller one")
        }
        Refusal::NotTouchable(node) => {
            format!("node {} under the contact is not touchable", green.surface_nodes[node as usize])
        }
    })
}

/// Inverse of `C_aa` for the prescribed components; free ones are replaced by the identity. `None` if the compliance is
/// zero there.
fn constrained_stiffness(compliance: &DMat3, prescribed: [bool; 3]) -> Option<DMat3> {
    let mut matrix = *compliance;
    let scale = (0..3).map(|k| compliance.col(k)[k]).fold(0.0, f64::max);
    for k in (0..3).filter(|&k| !prescribed[k]) {
        for j in 0..3 {
            matrix.col_mut(j)[k] = 0.0;
            matrix.col_mut(k)[j] = 0.0;
        }
        matrix.col_mut(k)[k] = scale;
    }
    let stiffness = matrix.inverse();
    (scale > 0.0 && stiffness.is_finite()).then_some(stiffness)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_are_raised_along_their_own_directions() {
        let (first, second) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 1.0, 0.0));
        let third = first.cross(second);
        let of = |values: [f64; 3]| {
            outer(first, first) * values[0] + outer(second, second) * values[1] + outer(third, third) * values[2]
        };
        let found = raise_eigenvalues(&of([-2.0, 0.3, -1.5]), -1.0);
        assert!(found.abs_diff_eq(of([-1.0, 0.3, -1.0]), 1e-14), "{found}");
        // Those above the bound stay, to the bit.
        assert_eq!(raise_eigenvalues(&of([-0.5, 0.3, 0.2]), -1.0), of([-0.5, 0.3, 0.2]));
        assert!(raise_eigenvalues(&of([-3.0; 3]), -1.0).abs_diff_eq(DMat3::IDENTITY * -1.0, 1e-14));
    }
}
