//! Chapter 9 of docs/theory.md: motion by Newmark's scheme (Jun, Choi and Cho, section 4, equation 4.4 corrected).
//!
//! ```text
//! M a + B v + K u = F,   B = rayleigh.mass M + rayleigh.stiffness K
//! v1 = v0 + dt [ (1 - delta) a0 + delta a1 ]
//! u1 = u0 + dt v0 + dt^2 [ (1/2 - alpha) a0 + alpha a1 ]
//! ```
//!
//! `direct` solves this on all dofs. `K`, `M` and `B` share eigenvectors, so `modal` carries the same motion by one
//! recurrence of two numbers a mode: the same answer with all modes, and the cost of the modes kept with fewer. There each
//! mode may take its exact step instead (`exponential`).

#[cfg(feature = "offline")]
mod direct;
mod energy;
mod exponential;
mod integration;
mod modal;
mod scheme;
mod store;

#[cfg(feature = "offline")]
pub use direct::{Direct, DirectScratch, DirectState, Solver, partition};
pub use energy::Energy;
pub use integration::Integration;
pub use modal::{
    EnergyAccount, LANES, Lanes, LoadedPatch, ModalModel, ModalState, PredictedState, Projection, StepEnergy,
};
pub use scheme::{ModeStep, Newmark, Rayleigh};
pub use store::{BASIS_VERSION, Basis, basis_key};
