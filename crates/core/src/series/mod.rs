//! Chapter 11 of docs/theory.md: Taylor series of a hyperelastic body's displacement by the force on it.
//!
//! A patch of weights `W` carries the force `F` along the inward normal `-n`. With `u = F u_1 + F^2 u_2 + ..` the parts of order `k`
//! of the internal forces are in balance:
//!
//! ```text
//! K u_1 = -W n        K u_k = -r_k(u_1 .. u_{k-1})
//! ```
//!
//! where `r_k` has all of order `k` that does not contain `u_k`. Every order has the stiffness `K` at rest, so that one factor
//! solves them all (Damil and Potier-Ferry, 1990: the asymptotic numerical method). `q_k = W^T u_k` are gradients of the
//! complementary energy `U(f) = U_2 + U_3 + U_4 + ..` by the force; `q_1` is what Green's function has. By the theorem of `2 n + 1`
//! the fields `u_1`, `u_2` alone determine `U_5 = -(r_4 . u_1 + 2 r_3 . u_2) / 5`, with the `r_k` of `F u_1 + F^2 u_2`: the measure
//! of what the series leaves out.

mod body;
mod coefficients;
mod half_space;
mod half_space_table;
mod internal;
mod known;
mod places;
mod store;
mod stress;
mod truncated;

pub use body::{HyperelasticBody, PatchLoad, SeriesAt};
pub use half_space::half_space_terms;
pub use known::{Layout, Series, Side};
pub use places::SeriesPlan;
pub use store::SeriesFile;
