//! Contacts that lose their equilibrium.
//!
//! Positions over the surface at rest are minima of the energy `u^T C^-1 u / 2 + Phi(p - u)`. Where its second derivative
//! `C^-1 + J`, `J = df/dp'`, is no longer positive, as over an edge that gives way to the side, a minimum ends, and the tool snaps
//! to another one. Newton's method would go to and fro there. Instead `J` is raised until `C^-1 + J` is positive: such steps go down
//! in energy, to the next minimum. The tool goes there in the same tick: the force of a position on the way would follow from no energy,
//! and closed paths would give out work.

use glam::DMat3;

use crate::contact::{raise_eigenvalues, smallest_eigenvalue};

/// `1 + c j` below which a contact counts as unstable, and to which it is raised; `j` is the smallest eigenvalue of `J` and `c` the
/// largest of `C`.
const UNSTABLE: f64 = 0.1;
const RAISED: f64 = 0.5;
/// Most steps of a tick with an unstable contact, and those after which they are shortened.
pub const SNAP_STEPS: [usize; 2] = [64, 50];

/// `J` of a contact, raised where it is unstable, and whether it is.
pub fn stable_jacobian(jacobian: DMat3, compliance: &DMat3) -> (DMat3, bool) {
    let symmetric = (jacobian + jacobian.transpose()) * 0.5;
    // No eigenvalue of `C` is larger than its norm.
    let norm = compliance.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>().sqrt();
    if is_positive(&(symmetric + DMat3::IDENTITY * ((1.0 - UNSTABLE) / norm))) {
        return (jacobian, false);
    }
    let least = smallest_eigenvalue(&symmetric);
    if least >= 0.0 {
        return (jacobian, false);
    }
    let softest = -smallest_eigenvalue(&(*compliance * -1.0));
    if 1.0 + least * softest > UNSTABLE {
        return (jacobian, false);
    }
    (jacobian + raise_eigenvalues(&symmetric, (RAISED - 1.0) / softest) - symmetric, true)
}

/// Whether a symmetric matrix has positive eigenvalues only, by Sylvester's criterion: much cheaper than the eigenvalues.
fn is_positive(symmetric: &DMat3) -> bool {
    let [x, y] = [symmetric.x_axis, symmetric.y_axis];
    x.x > 0.0 && x.x * y.y > x.y * x.y && symmetric.determinant() > 0.0
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn only_unstable_contacts_are_changed() {
        let compliance = DMat3::from_diagonal(DVec3::new(0.01, 0.02, 0.01));
        for diagonal in [DVec3::new(100.0, 2.0, 3.0), DVec3::new(100.0, 0.0, 3.0), DVec3::new(100.0, -40.0, 0.0)] {
            let jacobian = DMat3::from_diagonal(diagonal);
            assert_eq!(stable_jacobian(jacobian, &compliance), (jacobian, false));
        }
        let (raised, unstable) = stable_jacobian(DMat3::from_diagonal(DVec3::new(100.0, -60.0, 0.0)), &compliance);
        assert!(unstable && (raised.y_axis.y + 25.0).abs() < 1e-9 && (raised.x_axis.x - 100.0).abs() < 1e-9);
    }
}
