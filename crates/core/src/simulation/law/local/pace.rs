//! How many steps Newton's method takes, and how long they are.

use glam::DVec3;

use super::response::LocalResponse;
use super::secant::Secant;
use super::snap::SNAP_STEPS;

/// Most steps; three or four are usual. From the second number on steps are shortened, each more than the last: in a concavity
/// about as narrow as the tool the force turns so fast with the position that whole steps oscillate.
const USUAL_STEPS: [usize; 2] = [16, 10];
/// Most steps with pressure cells; two or three are usual. Each costs a hundred times a closed form.
pub const MOST_CELL_STEPS: usize = 8;
/// The same numbers with secant corrections. What goes to and fro in spite of them does so over an element's edge, where the slope
/// jumps and the energy has its minimum: each step is half of the one before, so that they end there.
const SECANT_STEPS: [usize; 2] = [40, 24];
/// Longest step, over the tool's radius, and with secant corrections.
const LONGEST_STEP: f64 = 0.5;
const LONGEST_SECANT_STEP: f64 = 0.02;
/// Length of the last whole step, over the tool's radius, beyond which the method has diverged, and on an element's edge.
const DIVERGED_STEP: f64 = 2e-3;
const EDGE_STEP: f64 = 2e-2;

/// The pace of one solution.
#[derive(Default)]
pub struct Pace {
    /// Whether there are pressure cells, whose steps are bounded by their residuals instead.
    pub cells: bool,
    /// Radius of the tool, or thickness of one with pressure cells, m.
    pub radius: f64,
    pub secant: Secant,
    snaps: bool,
}

impl Pace {
    /// Begins a solution for so many contacts.
    pub fn begin(&mut self, cells: bool, radius: f64, contacts: usize) {
        (self.cells, self.radius, self.snaps) = (cells, radius, false);
        self.secant.begin(contacts);
    }

    /// Most steps, and those after which they are shortened.
    fn steps(&self) -> [usize; 2] {
        match (self.snaps, self.secant.is_on, self.cells) {
            (true, _, _) => SNAP_STEPS,
            (_, true, _) => SECANT_STEPS,
            (.., true) => [MOST_CELL_STEPS, USUAL_STEPS[1]],
            _ => USUAL_STEPS,
        }
    }

    /// Whether another step follows; `longest` is the longest of the last whole steps, m. Beside an edge a method that has diverged takes
    /// the steps of a snap too: where the body's compliance changes fast, a contact loses its equilibrium before its stiffness shows it.
    pub fn goes_on(&mut self, step: usize, longest: f64, may_slip: impl FnOnce() -> bool) -> bool {
        if step + 1 >= self.steps()[0] && !self.snaps && self.has_diverged(longest) {
            self.snaps = may_slip();
        }
        step + 1 < self.steps()[0]
    }

    /// Takes whole steps, and whether a contact is unstable.
    ///
    /// With higher orders of the body's displacement nothing is learned from residuals: their slope follows the force too slowly, so
    /// that the residual at a position depends on the steps before.
    pub fn observe(&mut self, step: usize, whole: &[DVec3], unstable: bool, responses: &[LocalResponse]) {
        self.snaps |= unstable;
        if !self.cells && !responses.iter().any(LocalResponse::has_higher_orders) {
            self.secant.compare(step, whole);
        }
    }

    /// Share of the whole steps that is taken. The longest of them, m, becomes no longer than `bound`, m.
    pub fn share(&self, step: usize, longest: f64, bound: f64) -> f64 {
        let (narrows, usual) = (self.secant.is_on && !self.snaps, self.steps()[1]);
        let bound = bound.min(if narrows { LONGEST_SECANT_STEP } else { LONGEST_STEP } * self.radius);
        let shortened = match step < usual {
            true => 1.0,
            false if narrows => 0.5f64.powi((step + 1 - usual) as i32),
            false => 0.5,
        };
        if longest > bound { (bound / longest).min(shortened) } else { shortened }
    }

    /// Whether the method has diverged, by the longest of its last whole steps, m.
    pub fn has_diverged(&self, longest: f64) -> bool {
        let allowed = if self.secant.is_on { EDGE_STEP } else { DIVERGED_STEP };
        !self.cells && longest > allowed * self.radius
    }
}
