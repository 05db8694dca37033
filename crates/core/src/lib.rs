//! Finite elements, Green's functions, capacitance and contact: the numerics and physics of Palpate.
//!
//! The folders are the eleven chapters of docs/theory.md, in order: `element`, `mesh`, `fem`, `solver`, `green`, `capacitance`,
//! `contact`, `strain`, `dynamics`, `simulation`, `series`. SI units everywhere, `f = K u` on all dofs, dof = 3 * node + axis.
//!
//! The feature `offline` brings what is computed before anyone touches: assembly, factorisation, precomputation, changes of
//! boundary conditions. Without it the crate reads stores and answers a tick, and depends on neither faer, METIS nor
//! rayon.
//!
//! Nothing here reads a clock, starts threads of its own (rayon in the offline part apart) or touches a file other than
//! the stores of Green's functions and modes and what is kept beside them.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod arrays_file;
#[cfg(feature = "offline")]
pub mod capacitance;
pub mod contact;
pub mod dynamics;
pub mod element;
mod error;
#[cfg(feature = "offline")]
pub mod fem;
pub mod files;
pub mod green;
mod header;
mod math;
pub mod memory;
pub mod mesh;
mod positioned;
#[cfg(feature = "offline")]
pub mod series;
pub mod simulation;
#[cfg(feature = "offline")]
pub mod solver;
pub mod strain;
mod tensor;

pub use error::{Error, Result};

// Bodies that tests of the crate share with those beside it.
#[cfg(test)]
extern crate self as palpate_core;
