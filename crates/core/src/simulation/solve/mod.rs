//! Forces of all contacts of a body together, by its capacitance matrix.

mod compliance;
mod coupling;
mod forces;
mod handover;
mod local;
mod local_scratch;
mod surplus;

pub use compliance::add_contact;
pub use forces::{contact_forces, dent_at, gather, own_compliance, solve_with};
pub use handover::DEEPEST;
pub use local::{Memory, local_forces};
pub use local_scratch::LocalScratch;
