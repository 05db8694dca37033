//! Forces of all linear contacts of a body together, by its capacitance matrix.

mod compliance;
mod forces;

pub use compliance::add_contact;
pub use forces::{contact_displacement, contact_displacement_at, contact_forces, own_compliance, solve_with};
