//! Time integration of the modes: the scheme, and how forces vary within a step.

use super::exponential::{exact_step, held_step};
use super::scheme::{ModeStep, Newmark};

/// Step of all modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Integration {
    /// Newmark's scheme.
    Newmark(Newmark),
    /// Exact under forces linear in time within a step: for forces that are given.
    ///
    /// Not for the spring of a contact. Known at the ends of steps only, a linear force works against the motion between
    /// them: with a spring `k_c` on a free mass `m` the step is that of linear acceleration, unstable from `k_c dt^2 = 12 m`
    /// on; and a mode faster than half a step's frequency appears at the ends of steps as a slower one that turns the other
    /// way round, which a spring between the two excites.
    ExactLinear {
        /// Time step, s.
        dt: f64,
    },
    /// Exact under forces constant within a step, `(1 - weight) p0 + weight p1`: for contacts.
    ///
    /// The work on a mode is exactly the mean force times `q1 - q0`. With a spring of the extensions `e0`, `e1` the tool's
    /// work less what modes and spring take up is `(weight - 1/2) k_c (e1 - e0)^2`: no step is unstable for `weight >= 1/2`.
    ExactHeld {
        /// Time step, s.
        dt: f64,
        /// Weight of the new force.
        weight: f64,
    },
}

impl Integration {
    /// Time step, s.
    pub fn dt(&self) -> f64 {
        match *self {
            Self::Newmark(Newmark { dt, .. }) | Self::ExactLinear { dt } | Self::ExactHeld { dt, .. } => dt,
        }
    }

    /// Weight `w` of the new force in the mean one, `(1 - w) p0 + w p1`, that does the work of a step.
    ///
    /// By Newmark's scheme it is `delta`: without damping (Krenk, Comput. Methods Appl. Mech. Engrg. 195, 2006)
    ///
    /// ```text
    /// change of [v M v + u K u + (alpha - delta/2) dt^2 a M a] / 2
    ///     = du . ((1 - delta) F0 + delta F1) - (delta - 1/2) [du K du + (alpha - delta/2) dt^2 da M da]
    /// ```
    pub fn weight(&self) -> f64 {
        match *self {
            Self::Newmark(Newmark { delta, .. }) => delta,
            Self::ExactHeld { weight, .. } => weight,
            Self::ExactLinear { .. } => 0.5,
        }
    }

    /// The step of one mode with eigenvalue `k` and damping `c`.
    pub fn mode_step(&self, k: f64, c: f64) -> ModeStep {
        match self {
            Self::Newmark(scheme) => scheme.mode_step(k, c),
            Self::ExactLinear { dt } => exact_step(k, c, *dt),
            Self::ExactHeld { dt, weight } => held_step(k, c, *dt, *weight),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 1e-3;

    /// A tool at rest tied by a spring to undamped modes that start anyhow: the energies of modes and spring, step by step.
    fn tied(integration: Integration, eigenvalues: &[f64], spring: f64) -> Vec<f64> {
        let steps: Vec<ModeStep> = eigenvalues.iter().map(|&k| integration.mode_step(k, 0.0)).collect();
        let compliance: f64 = steps.iter().map(|step| step.q_load).sum();
        let mut modes: Vec<[f64; 2]> =
            (0..steps.len()).map(|i| [1e-3 * (1 + i) as f64, 0.1 - 0.07 * i as f64]).collect();
        let mut force = -spring * modes.iter().map(|[q, _]| q).sum::<f64>();
        let mut energies = Vec::new();
        for _ in 0..3000 {
            for ([q, v], m) in modes.iter_mut().zip(&steps) {
                (*q, *v) = (m.qq * *q + m.qv * *v + m.qp * force, m.vq * *q + m.vv * *v + m.vp * force);
            }
            let free: f64 = modes.iter().map(|[q, _]| q).sum();
            force = -spring * free / (1.0 + spring * compliance);
            for ([q, v], m) in modes.iter_mut().zip(&steps) {
                (*q, *v) = (*q + m.q_load * force, *v + m.v_load * force);
            }
            let held: f64 = modes.iter().zip(eigenvalues).map(|([q, v], k)| 0.5 * (v * v + k * q * q)).sum();
            energies.push(held + 0.5 * force * force / spring);
        }
        energies
    }

    fn held(weight: f64) -> Integration {
        Integration::ExactHeld { dt: DT, weight }
    }

    /// Slow modes and such as turn several times within a step.
    const MIXED: [f64; 5] = [0.0, 1e4, 2.3e6, 1.7e7, 9e7];

    #[test]
    fn held_forces_of_a_contact_keep_energy_or_lose_it_whatever_its_stiffness() {
        for spring in [1e4, 1e6, 1e8, 1e10] {
            for modes in [&MIXED[..], &MIXED[..1]] {
                let energies = tied(held(0.5), modes, spring);
                assert!(energies.iter().all(|energy| (energy / energies[0] - 1.0).abs() < 1e-8), "{spring:e}");
                let lost = tied(held(0.6), modes, spring);
                assert!(lost.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-12)), "{spring:e}");
                assert!(lost[2999] < 0.95 * lost[0], "{spring:e}");
            }
        }
    }

    #[test]
    fn linear_forces_of_a_contact_swing_up() {
        let linear = Integration::ExactLinear { dt: DT };
        // A free mass of 1: stable up to 12 m / dt^2.
        let last = |modes: &[f64], spring: f64| {
            let energies = tied(linear, modes, spring);
            energies[2999] / energies[0]
        };
        assert!(last(&[0.0], 11.9e6) < 10.0 && last(&[0.0], 12.1e6) > 1e10);
        // A slow mode and one that seems slow, at much less.
        let turning = (2.0 * std::f64::consts::PI / DT - 1050.0).powi(2);
        assert!(last(&[1e6, turning], 1.15e5) > 1e6);
    }

    #[test]
    fn the_weight_of_newmark_makes_its_work_what_the_modes_take_up() {
        for (alpha, delta) in [(0.25, 0.5), (0.3025, 0.6), (0.4, 0.8)] {
            let integration = Integration::Newmark(Newmark::new(DT, alpha, delta).expect("valid"));
            for k in [0.0, 3e4, 8e6] {
                let m = integration.mode_step(k, 0.0);
                let (q, v, p) = ([1e-3, 0.0], [0.4, 0.0], [300.0, -500.0]);
                let q = [q[0], m.qq * q[0] + m.qv * v[0] + m.qp * p[0] + m.q_load * p[1]];
                let v = [v[0], m.vq * q[0] + m.vv * v[0] + m.vp * p[0] + m.v_load * p[1]];
                let a = [0, 1].map(|i| p[i] - k * q[i]);
                let beyond = (alpha - 0.5 * delta) * DT * DT;
                let energy = [0, 1].map(|i| 0.5 * (v[i] * v[i] + k * q[i] * q[i] + beyond * a[i] * a[i]));
                let (dq, da) = (q[1] - q[0], a[1] - a[0]);
                let mean = p[0] + integration.weight() * (p[1] - p[0]);
                let taken = (delta - 0.5) * (k * dq * dq + beyond * da * da);
                let miss = energy[1] - energy[0] - (mean * dq - taken);
                assert!(miss.abs() < 1e-12, "{alpha} {delta} {k}: {miss}");
            }
        }
    }
}
