//! The sparse Cholesky factor that Green's functions and motion are computed with.

pub mod block_columns;
mod buffers;
mod condition;
mod factor;
pub mod front;
pub mod multifrontal;
mod ordering;

pub use condition::{Condition, MOST_CONDITION, condition, require_regular};
pub use factor::{Factor, Symbolic};
