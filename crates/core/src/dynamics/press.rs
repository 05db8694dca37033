//! A patch driven through a spring, by the modes: what one haptic tick costs.
//!
//! With the free motion `d_free` of the patch and the compliance `C` of one step, the force of a spring of stiffness
//! `k_c` between the patch and a target `d` is `(C + I/k_c) f = d - d_free`. The spring is needed: the compliance of one
//! step is far below the static one, and a rigid hold would alternate from step to step.

use glam::{DMat3, DVec3};

use super::{Model, Projection, Scratch, State};

/// A patch and its spring.
#[derive(Clone, Debug)]
pub struct Press {
    projection: Projection,
    /// `(C + I/k_c)^-1`, N/m.
    stiffness: DMat3,
    /// Spring constant `k_c`, N/m.
    coupling: f64,
}

impl Press {
    /// Memory for a patch held by a spring of `coupling` N/m.
    pub fn new(model: &Model, coupling: f64) -> Self {
        Self { projection: Projection::new(model), stiffness: DMat3::ZERO, coupling }
    }

    /// Takes hold of a patch (see [`Projection::gather`]).
    pub fn hold(&mut self, model: &Model, nodes: &[(u32, f64)]) {
        self.projection.gather(model, nodes.iter().map(|&(first, weight)| (first as usize, weight)));
        let compliance = self.projection.step_compliance(model, &self.projection);
        self.stiffness = (compliance + DMat3::from_diagonal(DVec3::splat(1.0 / self.coupling))).inverse();
    }

    /// Advances the body by one step with the spring's far end at `target`, m; returns the force on the body, N.
    pub fn tick(&self, model: &Model, state: &mut State, scratch: &mut Scratch, target: DVec3) -> DVec3 {
        let force = self.stiffness * (target - self.projection.predict(model, state));
        scratch.load.fill(Default::default());
        self.projection.add_force(model, force, &mut scratch.load);
        model.correct(state, &scratch.load);
        force
    }
}
