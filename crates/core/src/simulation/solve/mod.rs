//! Forces of all contacts of a body together, by its capacitance matrix.

mod cholesky;
mod compliance;
mod forces;

pub use cholesky::System;
pub use compliance::add_contact;
pub use forces::{contact_forces, gather, solve_with};
