//! Contacts that lose their equilibrium.
//!
//! Positions over the surface at rest are minima of the energy `u^T C^-1 u / 2 + Phi(p - u)`. Where its second derivative
//! `C^-1 + J`, `J = df/dp'`, is no longer positive, as over an edge that gives way to the side, a minimum ends, and the tool snaps
//! to another one. Newton's method would go to and fro there. Instead `J` is raised until `C^-1 + J` is positive: such steps go down
//! in energy and follow the way that the tool takes. A tool goes a bounded way in a tick, so that its force does not jump.

use glam::DMat3;

use crate::contact::{raise_eigenvalues, smallest_eigenvalue};
use crate::simulation::state::State;

/// `1 + c j` below which a contact counts as unstable, and to which it is raised; `j` is the smallest eigenvalue of `J` and `c` the
/// largest of `C`.
const UNSTABLE: f64 = 0.1;
const RAISED: f64 = 0.5;
/// Most steps of a tick, and those after which they are shortened.
pub const MOST_SNAP_STEPS: usize = 64;
const USUAL_STEPS: usize = 50;
/// Longest way of a contact that snaps in a tick: a part of the tool's radius, and a multiple of the tool's own way.
const LONGEST_WAY: f64 = 0.02;
const BY_TRAVEL: f64 = 2.0;

/// `J` of a contact, raised where it is unstable, and whether it is.
pub fn stable_jacobian(jacobian: DMat3, compliance: &DMat3) -> (DMat3, bool) {
    let symmetric = (jacobian + jacobian.transpose()) * 0.5;
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

/// Snapping within a tick.
pub struct Snap {
    /// Whether contacts snap in this tick, from its start on.
    pub is_active: bool,
    /// The way that is left in this tick, m.
    left: f64,
    /// Whether the way has ended before an equilibrium.
    pub goes_on: bool,
}

impl Snap {
    /// At the start of a tick; a tool that snapped in the last one goes on.
    pub fn new(state: &State, slots: &[usize], radius: f64) -> Self {
        let contacts = slots.iter().map(|&slot| &state.contacts.slots[slot].local);
        let is_active = contacts.clone().any(|contact| contact.is_snapping);
        let travel = contacts.map(|contact| contact.travel).fold(0.0, f64::max);
        Self { is_active, left: LONGEST_WAY * radius + BY_TRAVEL * travel, goes_on: false }
    }

    /// Most steps, and those after which they are shortened, where these are usual for others.
    pub fn steps(&self, usual: [usize; 2]) -> [usize; 2] {
        if self.is_active { [MOST_SNAP_STEPS, USUAL_STEPS] } else { usual }
    }

    /// The part of steps, of which the longest is this long, m, that is left in this tick.
    pub fn part(&mut self, longest: f64) -> f64 {
        if !self.is_active || longest <= self.left {
            self.left -= if self.is_active { longest } else { 0.0 };
            return 1.0;
        }
        self.goes_on = true;
        self.left / longest
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn only_unstable_contacts_are_changed() {
        let compliance = DMat3::from_diagonal(DVec3::new(0.01, 0.02, 0.01));
        for diagonal in [DVec3::new(100.0, 0.0, 3.0), DVec3::new(100.0, -40.0, 0.0)] {
            let jacobian = DMat3::from_diagonal(diagonal);
            assert_eq!(stable_jacobian(jacobian, &compliance), (jacobian, false));
        }
        let (raised, unstable) = stable_jacobian(DMat3::from_diagonal(DVec3::new(100.0, -60.0, 0.0)), &compliance);
        assert!(unstable && (raised.y_axis.y + 25.0).abs() < 1e-9 && (raised.x_axis.x - 100.0).abs() < 1e-9);
    }

    #[test]
    fn a_snap_goes_a_bounded_way() {
        let mut snap = Snap { is_active: true, left: 3.0, goes_on: false };
        assert_eq!([snap.part(1.0), snap.part(4.0)], [1.0, 0.5]);
        assert!(snap.goes_on);
        let mut still = Snap { is_active: false, left: 3.0, goes_on: false };
        assert!(still.part(10.0) == 1.0 && !still.goes_on);
    }
}
