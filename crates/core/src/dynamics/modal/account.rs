//! Energy of a motion and what went in and out, in joules.
//!
//! By Newmark's scheme `work += ((1 - delta) F0 + delta F1) . (u1 - u0)` (`Integration::weight`) and `dissipated += dt v B v` at
//! `v = (v0 + v1)/2`. For average acceleration (alpha 1/4, delta 1/2) kinetic + strain + dissipated = work + initial to
//! round-off; for other weights what is missing is the scheme's own damping.
//!
//! Under a force linear in time each exact mode has, with the mean `q` of its displacement over the step,
//!
//! ```text
//! int p q' dt = [p q]_0^1 - (p1 - p0) q = p0 (q1 - q0) + (p1 - p0) (q1 - q)
//! ```
//!
//! and under a force that is held within a step that force times `q1 - q0`. What it does not hold of that is what damping took.

use super::lanes::{LANES, Lanes, dot};
use super::model::{ModalModel, ModalState};
use crate::dynamics::energy::Energy;
use crate::dynamics::exponential::MeanDisplacement;
use crate::dynamics::integration::Integration;

/// Keeps account of work and dissipation of a modal motion, step by step.
#[derive(Clone, Debug)]
pub struct EnergyAccount {
    before: ModalState,
    /// Of every mode, where they are exact under forces linear in time.
    means: Vec<MeanDisplacement>,
    work: f64,
    dissipated: f64,
}

/// What a step did to one mode.
struct ModeChange {
    q: [f64; 2],
    v: [f64; 2],
    p: [f64; 2],
}

impl EnergyAccount {
    /// Opens an account at a state.
    pub fn new(model: &ModalModel, state: &ModalState) -> Self {
        let mut means = Vec::new();
        if let Integration::ExactLinear { dt } = model.integration {
            let modes = model.stiffness.iter().zip(&model.damping).flat_map(|(k, c)| k.0.into_iter().zip(c.0));
            means.extend(modes.map(|(k, c)| MeanDisplacement::new(k, c, dt)));
        }
        Self { before: state.clone(), means, work: 0.0, dissipated: 0.0 }
    }

    /// Books the step that led to `state`.
    pub fn book(&mut self, model: &ModalModel, state: &ModalState) {
        let (mut work, mut dissipated) = (Lanes::default(), Lanes::default());
        let before = &self.before;
        for g in 0..model.groups {
            for l in 0..LANES {
                let ends = |x: &[Lanes], y: &[Lanes]| [x[g].0[l], y[g].0[l]];
                let (q, v) = (ends(&before.q, &state.q), ends(&before.v, &state.v));
                let moved = ModeChange { q, v, p: ends(&before.load, &state.load) };
                let done = self.work_on(model, &moved, LANES * g + l);
                work.0[l] += done;
                dissipated.0[l] += match model.integration {
                    Integration::Newmark(_) => moved.taken_at_mean_velocity(model.damping[g].0[l], model.dt),
                    _ if model.damping[g].0[l] == 0.0 => 0.0,
                    _ => done - moved.gained(model.stiffness[g].0[l]),
                };
            }
        }
        self.work += work.sum();
        self.dissipated += dissipated.sum();
        self.before.q.copy_from_slice(&state.q);
        self.before.v.copy_from_slice(&state.v);
        self.before.load.copy_from_slice(&state.load);
    }

    fn work_on(&self, model: &ModalModel, moved: &ModeChange, mode: usize) -> f64 {
        let ModeChange { q: [q0, q1], v: [v0, _], p: [p0, p1] } = *moved;
        match self.means.get(mode) {
            Some(mean) => p0 * (q1 - q0) + (p1 - p0) * (q1 - (mean.q * q0 + mean.v * v0 + mean.p0 * p0 + mean.p1 * p1)),
            None => (p0 + model.integration.weight() * (p1 - p0)) * (q1 - q0),
        }
    }

    /// Energy at a state.
    pub fn energies(&self, model: &ModalModel, state: &ModalState) -> Energy {
        let elastic: Vec<Lanes> = state.q.iter().zip(&model.stiffness).map(|(q, k)| q.times(k)).collect();
        Energy {
            kinetic: 0.5 * dot(&state.v, &state.v),
            strain: 0.5 * dot(&state.q, &elastic),
            coupling: 0.0,
            dissipated: self.dissipated,
            work: self.work,
        }
    }
}

impl ModeChange {
    /// Kinetic and strain energy gained, J.
    fn gained(&self, stiffness: f64) -> f64 {
        let Self { q: [q0, q1], v: [v0, v1], .. } = self;
        0.5 * ((v1 - v0) * (v1 + v0) + stiffness * (q1 - q0) * (q1 + q0))
    }

    /// What damping takes at the mean velocity, J.
    fn taken_at_mean_velocity(&self, damping: f64, dt: f64) -> f64 {
        let mean = 0.5 * (self.v[0] + self.v[1]);
        dt * damping * mean * mean
    }
}
