//! Motion by modes: one recurrence of two numbers a mode.

mod account;
mod kernels;
mod lanes;
mod model;
mod predicted;
mod projection;

pub use account::EnergyAccount;
pub use lanes::{LANES, Lanes};
pub use model::{ModalModel, ModalState};
pub use predicted::{LoadedPatch, PredictedState, StepEnergy};
pub use projection::Projection;
