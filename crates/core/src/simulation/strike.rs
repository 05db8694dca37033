//! A strike: an impulse on a patch of a body in motion, as half a wave of force.

use glam::DVec3;

use crate::contact::Patch;
use crate::dynamics::{Lanes, LoadedPatch, ModalModel, Projection};
use crate::math::{sin, tan};

/// A strike takes no more steps than this: a second at the usual time step.
const STEPS_MAX: f64 = 1000.0;

/// Most strikes of one body in progress at once; their forces add up.
pub(super) const STRIKES_AT_ONCE: usize = 4;

/// A strike of a body, over or in progress: forces `a sin(pi k / (n + 1))` at the ends of `n` steps, `dt` times their sum
/// being the impulse. With `n = 1` it rises to `impulse / dt` and falls in the step after.
#[derive(Clone, Debug)]
pub struct StrikeInProgress {
    patch: Projection,
    /// `a`, N.
    amplitude: DVec3,
    /// `n`, and the next `k`; zero when the last force has been given.
    steps: u32,
    next: u32,
    /// Force at the end of this step and of the one before, N.
    force: [DVec3; 2],
    /// Displacement of the patch at the start of this step, m.
    displacement: DVec3,
}

impl StrikeInProgress {
    /// None in progress.
    pub fn new(modes: &ModalModel) -> Self {
        let (zero, patch) = (DVec3::ZERO, Projection::new(modes));
        Self { patch, amplitude: zero, steps: 0, next: 0, force: [zero; 2], displacement: zero }
    }

    /// Ends it.
    pub fn end(&mut self) {
        (self.next, self.force) = (0, Default::default());
    }

    /// Whether another one may begin.
    pub fn is_over(&self) -> bool {
        self.next == 0 && self.force == [DVec3::ZERO; 2]
    }

    /// Starts a strike at the next step.
    pub fn begin(&mut self, modes: &ModalModel, q: &[Lanes], patch: &Patch, impulse: DVec3, duration: f64) {
        gather_rows(&mut self.patch, modes, patch);
        self.displacement = self.patch.read(modes, q);
        self.steps = (duration / modes.dt).round().clamp(1.0, STEPS_MAX) as u32;
        // The sum of sin(pi k / (n + 1)) over k = 1..n is the cotangent of pi / (2 (n + 1)).
        let sum = 1.0 / tan(std::f64::consts::FRAC_PI_2 / f64::from(self.steps + 1));
        self.amplitude = impulse / (modes.dt * sum);
        self.next = 1;
    }

    /// Advances to the force at the end of this step.
    pub fn advance(&mut self) {
        self.force[0] = DVec3::ZERO;
        if self.next == 0 {
            return;
        }
        let instant = self.next;
        self.next = if instant == self.steps { 0 } else { instant + 1 };
        let phase = std::f64::consts::PI * f64::from(instant) / f64::from(self.steps + 1);
        self.force[0] = self.amplitude * sin(phase);
    }

    /// Force at the end of this step, N.
    pub fn force(&self) -> DVec3 {
        self.force[0]
    }

    /// The patch under that force.
    pub fn loaded(&self) -> LoadedPatch<'_> {
        LoadedPatch::new(&self.patch, self.force[0])
    }

    /// Work within the step that has just been made, J, given the modal displacements at its end.
    pub fn work(&mut self, modes: &ModalModel, q: &[Lanes]) -> f64 {
        if self.force == [DVec3::ZERO; 2] {
            return 0.0;
        }
        let now = self.patch.read(modes, q);
        let mean = self.force[1] + (self.force[0] - self.force[1]) * modes.integration.weight();
        let work = mean.dot(now - self.displacement);
        (self.displacement, self.force[1]) = (now, self.force[0]);
        work
    }
}

/// Gathers the rows of the modes at a patch.
pub(super) fn gather_rows(projection: &mut Projection, modes: &ModalModel, patch: &Patch) {
    projection.gather(modes, patch.iter().map(|(node, weight)| (3 * node, weight)));
}
