//! The force that inclines a contact: gradients of the body's compliance and motion by the tool's position.

use glam::{DMat3, DVec3};

use super::half_space::{Fields, LocalBody};
use crate::contact::regular::COMPLIANCE;

/// Effect of the other contacts of the body at a contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct OtherContacts {
    /// Derivative of `f^T sum_b C_ab f_b` by the position of the tool, N.
    pub slope: DVec3,
    /// On a body in motion: derivative by the position of the surface's displacement `u_k` less the static response to this
    /// contact, columns by `k`. The latter's part is `f^T (dC_reg/dp') f / 2`. Taken from the displacements of nodes it would
    /// differ by the patch's width and the modes left out, and slow closed paths near a rim would release 0.4 % of their peak
    /// energy.
    pub motion_slope: Option<DMat3>,
    /// The same by the tool's rotation, N m.
    pub turn: DVec3,
    pub motion_turn: Option<DMat3>,
}

impl OtherContacts {
    /// Becomes that of none. Without a copy of what has just been written, which would have to wait for it.
    pub fn reset(&mut self) {
        (self.slope, self.turn) = (DVec3::ZERO, DVec3::ZERO);
        (self.motion_slope, self.motion_turn) = (None, None);
    }
}

/// Force on the tool from the gradients of the body's compliance and of its motion, N. It is computed from the guessed force, which
/// agrees with the result when the steps have converged.
pub fn slope(body: LocalBody<'_>, force: DVec3, others: &OtherContacts, fields: &Fields) -> DVec3 {
    let [x, y, z] = force.to_array();
    let products = [x * x, 2.0 * x * y, 2.0 * x * z, y * y, 2.0 * y * z, z * z];
    let own: DVec3 = COMPLIANCE.zip(products).map(|(field, product)| fields.slope(field) * product).sum();
    let motion_slope = others.motion_slope.map_or(DVec3::ZERO, |motion_slope| motion_slope * force);
    own * (0.5 / body.scale) + motion_slope
}

/// Derivative of the linear part of [`slope`] by the force, columns by components of the force.
pub fn compliance_slope(body: LocalBody<'_>, force: DVec3, fields: &Fields) -> DMat3 {
    let [xx, xy, xz, yy, yz, zz] = std::array::from_fn(|k| fields.slope(COMPLIANCE.start + k));
    let column = |[x, y, z]: [DVec3; 3]| (x * force.x + y * force.y + z * force.z) * (1.0 / body.scale);
    DMat3::from_cols(column([xx, xy, xz]), column([xy, yy, yz]), column([xz, yz, zz]))
}
