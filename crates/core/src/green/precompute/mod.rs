//! Computing a Green's function: offline, with all threads.
//!
//! A [`Problem`] is ordered and counted ([`plan`]), factorised ([`crate::solver`]), cut down to a tree of small operators,
//! and swept block of columns by block; the finished panels are then mirrored into the store.

mod block;
mod free_response;
mod layout;
mod made;
mod mirror;
mod number;
mod operators;
mod panels;
mod partial;
mod plan;
mod probe;
mod problem;
mod run;
mod scales;
mod spatial_order;
mod sweep;
mod system;
mod tasks;
mod tree;

pub use made::Wanted;
pub use plan::Plan;
pub use problem::Problem;
pub use run::{Found, Progress, Target, plan, precompute, precompute_to};
