//! The body in motion under the same contacts: the compliance of one step in place of the static one, and a spring.
//!
//! A step moves a patch to `d_free + C f`, `d_free = G q` being the free motion at the step's end (`dynamics::modal`) and
//!
//! ```text
//! C = G diag(q_load) G^T + R,     R = W^T Psi W - G diag(1/k) G^T
//! ```
//!
//! `R` is the residual flexibility of the modes left out, which answer at once; with all modes it is zero. `C` is far
//! below the static compliance, so that a patch tied rigidly to a tool would alternate from tick to tick for ever: tool
//! and patch are coupled by a spring `k_c`, `(C + I/k_c) f = d - d_free`.

use glam::{DMat3, DVec3};

use super::{Input, MAX_TOOLS, Mode, Model, Scratch, State, ToolContact};
use crate::contact::{Patch, SurfacePoint, compliance_block, patch_weights};
use crate::dynamics::{Ahead, Held, Lanes, Model as Modes, Projection};
use crate::{Error, Result};

/// Shortest and longest time step, s: a tick makes at most ten of the one, and feels the other.
const TIME_STEPS: std::ops::RangeInclusive<f64> = 1e-4..=1e-2;

/// A blow takes no more steps than this: a second at the usual time step.
const BLOW_STEPS_MAX: f64 = 1000.0;

/// What sets a body in motion: its modes at the surface dofs, and the coupling to a tool.
pub struct Dynamics {
    pub(crate) modes: Modes,
    /// Spring between a patch and its tool, N/m.
    pub coupling: f64,
}

impl Dynamics {
    /// `modes` has a row for every surface dof.
    ///
    /// # Errors
    /// A time step that ticks cannot make, or a coupling that is not positive.
    pub fn new(modes: Modes, coupling: f64) -> Result<Self> {
        if !TIME_STEPS.contains(&modes.dt) {
            let (low, high) = (TIME_STEPS.start(), TIME_STEPS.end());
            return Err(Error::Invalid(format!("the time step must lie between {low} and {high} s, got {}", modes.dt)));
        }
        if !(coupling > 0.0 && coupling.is_finite()) {
            return Err(Error::Invalid(format!("the coupling must be positive, got {coupling} N/m")));
        }
        Ok(Self { modes, coupling })
    }
}

/// Energies of a body in motion and its couplings, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// `v M v / 2`.
    pub kinetic: f64,
    /// `u K u / 2`.
    pub strain: f64,
    /// `f^2 / 2 k_c` of the springs between tools and patches.
    pub coupling: f64,
    /// Taken out by Rayleigh damping since the start.
    pub dissipated: f64,
    /// Done by tools and strikes since the start.
    pub work: f64,
}

/// How the body moves.
#[derive(Clone, Debug)]
pub struct Motion {
    modal: Ahead,
    /// Mean displacement of each patch at the end of the next step if no force acts there, m.
    free: [DVec3; MAX_TOOLS],
    patches: [Projection; MAX_TOOLS],
    /// A patch that is struck: where, its force at the end of this step and of the last one, N, and its displacement at the
    /// start of this one, m.
    struck: Projection,
    blow: [DVec3; 2],
    /// The node that is watched.
    watched: Projection,
    /// What is left of the blow: its impulse over the sum of its shape, N, its length and the next instant, in steps.
    blow_shape: (DVec3, u32, u32),
    struck_at: DVec3,
    /// `R` between the patches.
    residual: [[DMat3; MAX_TOOLS]; MAX_TOOLS],
    /// Body time not yet stepped through, s.
    due: f64,
    /// Body time since the start, s.
    pub time: f64,
    /// Force on the body and tool position at the end of the last step, where in contact.
    last: [Option<(DVec3, DVec3)>; MAX_TOOLS],
    /// Where the energy is.
    pub energy: Energy,
}

/// An impulse for a patch of the surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct Strike {
    /// Where, m; the closest surface point is struck.
    pub point: DVec3,
    /// Impulse on the body, N s.
    pub impulse: DVec3,
    /// How long it takes, s of the body's time: the force is half a wave, and lasts one step at least.
    pub duration: f64,
}

impl Motion {
    /// At rest.
    pub(super) fn new(modes: &Modes) -> Self {
        Self {
            modal: modes.ahead(),
            free: Default::default(),
            patches: std::array::from_fn(|_| Projection::new(modes)),
            struck: Projection::new(modes),
            watched: Projection::new(modes),
            blow: Default::default(),
            blow_shape: Default::default(),
            struck_at: DVec3::ZERO,
            residual: Default::default(),
            due: 0.0,
            time: 0.0,
            last: Default::default(),
            energy: Energy::default(),
        }
    }

    /// Brings the body to rest, with a step due so that contacts hear of it.
    fn rest(&mut self, modes: &Modes) {
        let Ahead { q, v, free_q, free_v } = &mut self.modal;
        for x in [q, v, free_q, free_v] {
            x.fill(Lanes::default());
        }
        (self.free, self.blow, self.blow_shape, self.last) = Default::default();
        self.due = modes.dt;
        self.energy = Energy::default();
    }

    /// Modal displacements now.
    pub(super) fn modal_displacements(&self) -> &[Lanes] {
        &self.modal.q
    }

    /// Displacement of a surface node by the modes, less what tools do to it at rest, m: `q - p / k` at its rows.
    pub(super) fn beyond_static(&mut self, modes: &Modes, tools: &[ToolContact; MAX_TOOLS], node: usize) -> DVec3 {
        self.watched.gather(modes, std::iter::once((3 * node, 1.0)));
        let mut moved = self.watched.read(modes, &self.modal.q);
        for (contact, patch) in tools.iter().zip(&self.patches) {
            if contact.mode != Mode::Free {
                moved -= self.watched.static_compliance(modes, patch) * contact.force;
            }
        }
        moved
    }

    /// Displacement of a surface point in the free motion, m; the residual flexibility of other contacts is left out.
    pub(super) fn displacement_at(&self, model: &Model, modes: &Modes, at: &SurfacePoint) -> DVec3 {
        let triangle = model.loaded.triangles[at.triangle as usize];
        let mut sum = DVec3::ZERO;
        for (node, share) in triangle.into_iter().zip(at.barycentric) {
            let mut corner = [0.0; 3];
            modes.read(&self.modal.free_q, 3 * node as usize.., &mut corner);
            sum += share * DVec3::from(corner);
        }
        sum
    }

    /// Takes hold of a patch for a tool: its compliance within a step with every other one, m/N.
    pub(super) fn hold(&mut self, model: &Model, modes: &Modes, tools: &[ToolContact; MAX_TOOLS], tool: usize) {
        gather(&mut self.patches[tool], modes, &tools[tool].patch);
        self.free[tool] = self.patches[tool].read(modes, &self.modal.free_q);
        for other in 0..MAX_TOOLS {
            if tools[other].mode == Mode::Free {
                continue;
            }
            let (a, b) = (&self.patches[tool], &self.patches[other]);
            let whole = compliance_block(&model.green, &tools[tool].patch, &tools[other].patch).unwrap_or(DMat3::ZERO);
            let residual = whole - a.static_compliance(modes, b);
            self.residual[tool][other] = residual;
            self.residual[other][tool] = residual.transpose();
        }
        self.last[tool] = None;
    }

    /// Compliance of one step between two patches, m/N.
    pub(super) fn compliance(&self, modes: &Modes, a: usize, b: usize) -> DMat3 {
        self.patches[a].step_compliance(modes, &self.patches[b]) + self.residual[a][b]
    }

    /// Mean displacement of a tool's patch in the free motion, m.
    pub(super) fn free_displacement(&self, tool: usize) -> DVec3 {
        self.free[tool]
    }

    /// How far the forces that other tools already exert move a patch beyond its modes, m.
    pub(super) fn left_out(&self, tools: &[ToolContact; MAX_TOOLS], tool: usize) -> DVec3 {
        let others = (0..MAX_TOOLS).filter(|&other| other != tool && tools[other].mode != Mode::Free);
        others.map(|other| self.residual[tool][other] * tools[other].force).sum()
    }

    /// Readies a strike from the next step on: forces `a sin(pi k / (n + 1))` at the ends of `n` steps, `dt` times their sum
    /// being the impulse. With `n = 1` it rises to `impulse / dt` and falls in the step after. A second one before that is
    /// over is not heard.
    pub(super) fn strike(&mut self, modes: &Modes, patch: &Patch, impulse: DVec3, duration: f64) {
        if self.blow == [DVec3::ZERO; 2] && self.blow_shape.2 == 0 {
            gather(&mut self.struck, modes, patch);
            self.struck_at = self.struck.read(modes, &self.modal.q);
            let steps = (duration / modes.dt).round().clamp(1.0, BLOW_STEPS_MAX) as u32;
            // The sum of sin(pi k / (n + 1)) over k = 1..n is the cotangent of pi / (2 (n + 1)).
            let sum = 1.0 / (std::f64::consts::FRAC_PI_2 / f64::from(steps + 1)).tan();
            self.blow_shape = (impulse / (modes.dt * sum), steps, 1);
        }
    }

    /// Force of the blow at the end of this step, N.
    fn next_of_blow(&mut self) -> DVec3 {
        let (size, steps, instant) = self.blow_shape;
        if instant == 0 {
            return DVec3::ZERO;
        }
        self.blow_shape.2 = if instant == steps { 0 } else { instant + 1 };
        size * (std::f64::consts::PI * f64::from(instant) / f64::from(steps + 1)).sin()
    }

    /// Ends the step by the forces of contacts and strike, predicts the next, and keeps account of the energy.
    pub(super) fn advance(&mut self, dynamics: &Dynamics, tools: &[ToolContact; MAX_TOOLS]) {
        self.blow[0] = self.next_of_blow();
        let mut held = [Held::new(&self.struck, self.blow[0]); MAX_TOOLS + 1];
        let mut holders = [0; MAX_TOOLS];
        let mut count = 0;
        for (tool, contact) in tools.iter().enumerate().filter(|(_, contact)| contact.mode != Mode::Free) {
            held[count] = Held::new(&self.patches[tool], contact.force);
            holders[count] = tool;
            count += 1;
        }
        // The strike comes behind the contacts: the array was filled with it.
        let with_strike = count + usize::from(self.blow[0] != DVec3::ZERO);
        let step = dynamics.modes.advance(&mut self.modal, &mut held[..with_strike]);
        for (&tool, held) in holders[..count].iter().zip(&held) {
            self.free[tool] = held.free;
        }
        let energy = &mut self.energy;
        (energy.kinetic, energy.strain) = (step.kinetic, step.strain);
        energy.dissipated += step.dissipated;
        self.account_for_contacts(dynamics, tools);
        self.account_for_work(&dynamics.modes, tools);
    }

    /// What springs and the modes left out hold.
    fn account_for_contacts(&mut self, dynamics: &Dynamics, tools: &[ToolContact; MAX_TOOLS]) {
        let energy = &mut self.energy;
        energy.coupling = 0.0;
        let touching = || (0..MAX_TOOLS).filter(|&tool| tools[tool].mode != Mode::Free);
        for a in touching() {
            let force = tools[a].force;
            energy.coupling += 0.5 * force.length_squared() / dynamics.coupling;
            let left_out: DVec3 = touching().map(|b| self.residual[a][b] * tools[b].force).sum();
            energy.strain += 0.5 * force.dot(left_out);
        }
    }

    /// Forces change linearly within a step: their mean times the way of tool or struck patch.
    fn account_for_work(&mut self, modes: &Modes, tools: &[ToolContact; MAX_TOOLS]) {
        for (tool, contact) in tools.iter().enumerate() {
            if let Some((force, position)) = self.last[tool] {
                self.energy.work += 0.5 * (force + contact.force).dot(contact.position - position);
            }
            self.last[tool] = (contact.mode != Mode::Free).then_some((contact.force, contact.position));
        }
        if self.blow != [DVec3::ZERO; 2] {
            let now = self.struck.read(modes, &self.modal.q);
            self.energy.work += 0.5 * (self.blow[0] + self.blow[1]).dot(now - self.struck_at);
            self.struck_at = now;
            self.blow[1] = self.blow[0];
        }
    }
}

fn gather(projection: &mut Projection, modes: &Modes, patch: &Patch) {
    projection.gather(modes, patch.iter().map(|(node, weight)| (3 * node, weight)));
}

/// Begins a strike where the input asks for one.
pub(super) fn strike(model: &Model, state: &mut State, scratch: &mut Scratch, input: &Input) {
    let (Some(dynamics), Some(motion), Some(strike)) = (&model.dynamics, &mut state.motion, &input.strike) else {
        return;
    };
    if !(strike.point.is_finite() && strike.impulse.is_finite()) {
        return;
    }
    let Some(closest) = model.closest(strike.point) else { return };
    let centre = model.material_point(&closest);
    let radius = input.contact_radius;
    let patch = &mut scratch.candidate;
    let covered = patch_weights(&model.green.surface, &centre, radius, &mut scratch.patch, patch);
    if covered == patch.count {
        motion.strike(&dynamics.modes, patch, strike.impulse, strike.duration);
    }
}

/// Lets body time pass; a reset brings the body to rest.
pub(super) fn pass_time(model: &Model, state: &mut State, input: &Input) {
    if let (Some(dynamics), Some(motion)) = (&model.dynamics, &mut state.motion) {
        motion.due += if input.advance > 0.0 { input.advance.min(*TIME_STEPS.end()) } else { 0.0 };
        if input.reset {
            motion.rest(&dynamics.modes);
        }
    }
}

/// Whether a step of a body in motion has come due, and begins; true for one that does not move.
pub(super) fn begin_step(model: &Model, state: &mut State) -> bool {
    let (Some(dynamics), Some(motion)) = (&model.dynamics, &mut state.motion) else { return true };
    // A thousandth of a step forgives the rounding of many small advances.
    let due = motion.due > 0.999 * dynamics.modes.dt;
    if due {
        motion.due -= dynamics.modes.dt;
        motion.time += dynamics.modes.dt;
    }
    due
}

/// Ends a step of a body in motion. False for one that does not move: a single answer is all there is.
pub(super) fn end_step(model: &Model, state: &mut State) -> bool {
    let (Some(dynamics), Some(motion)) = (&model.dynamics, &mut state.motion) else { return false };
    motion.advance(dynamics, &state.tools);
    true
}
