//! Energy of a motion and what went in and out, in joules.
//!
//! Over a step, with means of both ends: `work += (F0 + F1)/2 . (u1 - u0)`, `dissipated += dt v B v` at `v = (v0 + v1)/2`.
//! For average acceleration (alpha 1/4, delta 1/2) kinetic + strain + dissipated = work + initial to round-off; for other
//! weights what is missing is the scheme's own damping.

use super::lanes::{Lanes, dot};
use super::{Model, State};

/// Energies, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energies {
    /// `v M v / 2`.
    pub kinetic: f64,
    /// `u K u / 2`.
    pub strain: f64,
    /// Taken out by the damping matrix since the start.
    pub dissipated: f64,
    /// Done by the forces since the start.
    pub work: f64,
}

/// Keeps account of work and dissipation of a modal motion, step by step.
#[derive(Clone, Debug)]
pub struct Account {
    before: State,
    work: f64,
    dissipated: f64,
}

impl Account {
    /// Opens an account at a state.
    pub fn new(state: &State) -> Self {
        Self { before: state.clone(), work: 0.0, dissipated: 0.0 }
    }

    /// Books the step that led to `state`.
    pub fn book(&mut self, model: &Model, state: &State) {
        let mut work = Lanes::default();
        let mut dissipated = Lanes::default();
        let before = &self.before;
        for g in 0..model.groups {
            for l in 0..super::LANES {
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

    /// Energies at a state.
    pub fn energies(&self, model: &Model, state: &State) -> Energies {
        let elastic: Vec<Lanes> = state.q.iter().zip(&model.stiffness).map(|(q, k)| q.times(k)).collect();
        Energies {
            kinetic: 0.5 * dot(&state.v, &state.v),
            strain: 0.5 * dot(&state.q, &elastic),
            dissipated: self.dissipated,
            work: self.work,
        }
    }
}
