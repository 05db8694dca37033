//! Computing a Green's function: offline, with all threads.
//!
//! A [`Problem`] is ordered and counted ([`plan`]), factorised ([`crate::solver`]), cut down to a tree of small operators,
//! and swept block of columns by block ([`Columns`]); the finished panels are then mirrored into the store
//! ([`ColumnStore`]). Both may run in one process, or the columns in several. The columns are solved in stages ([`Growth`]).

mod arrangement;
mod claim;
mod column_store;
mod columns;
mod factorization;
mod free_response;
mod growth;
mod inverse;
mod layout;
mod mirror;
mod number;
mod operators;
mod panels;
mod partial;
mod plan;
mod probe;
mod problem;
mod rate;
mod run;
mod scales;
mod solving;
mod spatial_order;
mod stages;
mod sweep;
mod system;
mod tasks;
mod tree;

pub use claim::Claim;
pub use column_store::{ColumnStore, PreviousWork, Target, checksum};
pub use columns::{AssembledProblem, Columns, Measurement, TaskMemory};
pub use factorization::RequestedPrecision;
pub use growth::Growth;
pub use plan::Plan;
pub use problem::Problem;
pub use rate::products;
pub use run::{plan, precompute, precompute_to};
pub(crate) use spatial_order::spatial_order;
pub use tasks::{Phase, PhaseCallback, Progress};
