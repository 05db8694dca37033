//! Which step the modes take, and how forces act between its ends.

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
