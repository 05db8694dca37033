//! The compliance `C = W^T Psi W` that a patch feels: three by three, m/N.

use glam::{DMat3, DVec3};

use super::{MAX_PATCH_NODES, Patch, PatchScratch, SurfaceQuery, patch_weights};
use crate::green::{GreensFunction, TouchNode};
use crate::{Error, Result};

/// `W_a^T Psi W_b` between two patches: mean displacement of `a` per unit force spread over `b`. Supported dofs do not
/// move. `None` if a node of `b` may not be touched.
pub fn compliance_block(green: &GreensFunction, a: &Patch, b: &Patch) -> Option<DMat3> {
    let mut columns = [TouchNode::default(); MAX_PATCH_NODES];
    for (column, (node, _)) in columns.iter_mut().zip(b.iter()) {
        *column = green.touchable(node)?;
    }
    let (nodes, weights) = (&a.nodes[..a.count], &a.weights[..a.count]);
    Some(green.weighted_block(nodes, weights, &columns[..b.count], &b.weights[..b.count]))
}

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
    mean + 2.0 * p * (r.acos() / 3.0 + 2.0 * std::f64::consts::FRAC_PI_3).cos()
}

/// Moves a patch at `point` of the unloaded surface to the mean displacement `displacement` (m, from the unloaded shape;
/// `None` leaves a component free): `f = C^-1 (d - W^T u_free)`. Returns the force on the body (N) and the displacements
/// of all surface dofs (m, 3s), those of the reference loads included.
///
/// # Errors
/// A patch with a node outside the touch region, on the support only, or with too many nodes.
pub fn touch(
    green: &GreensFunction,
    point: DVec3,
    displacement: [Option<f64>; 3],
    radius: f64,
) -> Result<(DVec3, Vec<f64>)> {
    green.require_intact()?;
    let query = SurfaceQuery::new(&green.surface)?;
    let centre =
        query.closest(&green.surface, point).ok_or_else(|| Error::Invalid("the touch point must be finite".into()))?;
    let mut patch = Patch::default();
    let covered = patch_weights(&green.surface, &centre, radius, &mut PatchScratch::new(&green.surface), &mut patch);
    if covered > patch.count {
        return Err(Error::Invalid(format!(
            "a contact radius of {radius} m covers {covered} nodes; choose a smaller one"
        )));
    }
    if let Some((node, _)) = patch.iter().find(|&(n, _)| green.touchable(n).is_none()) {
        let node = green.surface_nodes[node];
        return Err(Error::Invalid(format!("node {node} under the contact is not touchable")));
    }
    let compliance = compliance_block(green, &patch, &patch).unwrap_or(DMat3::ZERO);
    let mut displacements = green.free_displacements();
    let sag = patch_mean(&patch, &displacements);
    let wanted = std::array::from_fn(|k| displacement[k].map(|d| d - sag[k]));
    let force = constrained_force(&compliance, wanted)
        .ok_or_else(|| Error::Invalid("the contact lies on the support, which does not give".into()))?;
    add_patch_response(green, &patch, force, &mut displacements);
    Ok((force, displacements))
}

/// `W^T u`: the weighted mean displacement of a patch, m.
fn patch_mean(patch: &Patch, displacements: &[f64]) -> DVec3 {
    patch.iter().map(|(node, weight)| weight * DVec3::from_slice(&displacements[3 * node..])).sum()
}

/// Adds `Psi W f` to the surface displacements (3s).
pub(crate) fn add_patch_response(green: &GreensFunction, patch: &Patch, force: DVec3, displacements: &mut [f64]) {
    let forces: Vec<(TouchNode, DVec3)> =
        patch.iter().filter_map(|(node, weight)| Some((green.touchable(node)?, weight * force))).collect();
    green.add_forces(&forces, displacements);
}

/// `C_aa f_a = d_a` for the prescribed components, zero force on the free ones: free components are replaced by the
/// identity. `None` if the compliance is zero there.
fn constrained_force(compliance: &DMat3, displacement: [Option<f64>; 3]) -> Option<DVec3> {
    let mut matrix = *compliance;
    let mut right = DVec3::ZERO;
    let scale = (0..3).map(|k| compliance.col(k)[k]).fold(0.0, f64::max);
    for (k, component) in displacement.into_iter().enumerate() {
        match component {
            Some(d) => right[k] = d,
            None => {
                for j in 0..3 {
                    matrix.col_mut(j)[k] = 0.0;
                    matrix.col_mut(k)[j] = 0.0;
                }
                matrix.col_mut(k)[k] = scale;
            }
        }
    }
    let force = matrix.inverse() * right;
    (scale > 0.0 && force.is_finite()).then_some(force)
}
