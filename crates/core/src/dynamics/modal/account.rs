//! Energy of a motion and what went in and out, in joules.
//!
//! Over a step, with means of both ends: `work += (F0 + F1)/2 . (u1 - u0)`, `dissipated += dt v B v` at `v = (v0 + v1)/2`.
//! For average acceleration (alpha 1/4, delta 1/2) kinetic + strain + dissipated = work + initial to round-off; for other
//! weights what is missing is the scheme's own damping.

use super::lanes::{Lanes, dot};
use super::model::{ModalModel, ModalState};
use crate::dynamics::energy::Energy;

/// Keeps account of work and dissipation of a modal motion, step by step.
#[derive(Clone, Debug)]
pub struct EnergyAccount {
    before: ModalState,
    work: f64,
    dissipated: f64,
}

impl EnergyAccount {
    /// Opens an account at a state.
    pub fn new(state: &ModalState) -> Self {
        Self { before: state.clone(), work: 0.0, dissipated: 0.0 }
    }

    /// Books the step that led to `state`.
    pub fn book(&mut self, model: &ModalModel, state: &ModalState) {
        let mut work = Lanes::default();
        let mut dissipated = Lanes::default();
        let before = &self.before;
        for g in 0..model.groups {
            for l in 0..super::lanes::LANES {
                let moved = state.q[g].0[l] - before.q[g].0[l];
                work.0[l] += 0.5 * (state.load[g].0[l] + before.load[g].0[l]) * moved;
                let v = 0.5 * (state.v[g].0[l] + before.v[g].0[l]);
                dissipated.0[l] += model.damping[g].0[l] * v * v;
            }
        }
        self.work += work.sum();
        self.dissipated += model.dt * dissipated.sum();
        self.before.q.copy_from_slice(&state.q);
        self.before.v.copy_from_slice(&state.v);
        self.before.load.copy_from_slice(&state.load);
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
