//! Chapter 4: the Green's function of the reference problem, and its store.
//!
//! With `D` the supported dofs and `N` the free ones, `f = K u` is solved for the unknowns `v` (`u` on `N`, `f` on `D`)
//! given the knowns `vb` (`f` on `N`, `u` on `D`): `v = Psi vb` with
//!
//! ```text
//! Psi_NN = K_NN^-1         Psi_ND = -K_NN^-1 K_ND
//! Psi_DN = K_DN K_NN^-1    Psi_DD = K_DD - K_DN K_NN^-1 K_ND
//! ```
//!
//! (Jun, Choi and Cho, equations 3.1-3.3, corrected.) Only the columns of touchable surface dofs and the rows of surface
//! and supported dofs are kept.

mod columns;
mod factor;
mod free_response;
mod interior;
mod key;
mod mirror;
mod number;
mod operator;
mod operators;
mod ordering;
mod panels;
mod partial;
mod plan;
mod precompute;
mod scaled;
mod store;
mod sweep;
mod system;
mod touch;
mod tree;

pub use columns::Problem;
pub use factor::{Factor, Symbolic};
pub use interior::Interior;
pub use key::FORMAT_VERSION;
pub use operator::{GreensFunction, Precision, Values};
pub use plan::Plan;
pub use touch::TouchNode;
pub use precompute::{Found, Progress, Target, plan, precompute, precompute_to};
