//! Forces of all contacts of a body together, by its capacitance matrix.

mod compliance;
mod forces;
mod handover;
mod local;

pub use compliance::add_contact;
pub use forces::{contact_forces, dent_at, gather, own_compliance, solve_with};
pub use handover::DEEPEST;
pub use local::{LocalScratch, Memory, local_forces};
