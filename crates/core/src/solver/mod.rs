//! Chapter 4 of docs/theory.md: the sparse Cholesky factor of `K_NN`, for Green's functions and motion.
//!
//! `ordering` finds the order of elimination and `factor` the structure. `multifrontal` eliminates front by front (`front`,
//! stored in `block_columns`, with memory from `buffers`) and hands the finished columns to its caller; [`Factor`] is held as a
//! whole. `condition` estimates how far rounding spoils an answer.

pub mod block_columns;
mod buffers;
mod condition;
mod factor;
pub mod front;
pub mod multifrontal;
mod ordering;

pub use condition::{Condition, MOST_CONDITION, condition, require_regular};
pub use factor::{Factor, Symbolic};
