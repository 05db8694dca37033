//! The sparse Cholesky factor that Green's functions and motion are computed with.

mod condition;
mod factor;
mod ordering;

pub use condition::{Condition, MOST_CONDITION, condition, require_regular};
pub use factor::{Factor, Symbolic};
