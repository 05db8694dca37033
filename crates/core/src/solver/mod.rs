//! The sparse Cholesky factor that Green's functions and motion are computed with.

mod factor;
mod ordering;

pub use factor::{Factor, Symbolic};
