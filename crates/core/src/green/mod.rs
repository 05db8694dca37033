//! Chapter 5 of docs/theory.md: the Green's function of the reference problem, and its store.
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

pub mod accuracy;
mod blocks;
mod checksums;
mod columns_file;
mod entries;
mod function;
#[cfg(feature = "offline")]
mod interior;
mod key;
mod node_order;
mod numbers;
mod packed;
mod precision;
#[cfg(feature = "offline")]
mod precompute;
mod store;
mod store_writer;

pub use function::GreensFunction;
#[cfg(feature = "offline")]
pub use interior::Interior;
pub use key::FORMAT_VERSION;
pub(crate) use key::add_sections;
pub use node_order::TouchNode;
pub use precision::Precision;
#[cfg(feature = "offline")]
pub(crate) use precompute::spatial_order;
#[cfg(feature = "offline")]
pub use precompute::{
    AssembledProblem, Claim, ColumnStore, Columns, Growth, Measurement, Phase, PhaseCallback, Plan, PreviousWork,
    Problem, Progress, RequestedPrecision, Target, TaskMemory, checksum, plan, precompute, precompute_to, products,
};

/// What extends displacements of a body's surface to all nodes.
#[cfg(feature = "strain")]
pub trait Extension: Send + Sync {
    /// Displacements of all dofs, m, for those of the surface dofs.
    ///
    /// # Errors
    /// A length that is not three a surface node.
    fn extend(&self, surface: &[f64]) -> crate::Result<Vec<f64>>;

    /// Changes of the displacements of all dofs for changes of those of the surface dofs, the reference loads staying as
    /// they are: several fields (3s each) one after the other, in a single solve.
    ///
    /// # Errors
    /// A length that is not a multiple of three a surface node.
    fn extend_responses(&self, fields: &[f64]) -> crate::Result<Vec<f64>>;

    /// Number of surface nodes.
    fn surface_count(&self) -> usize;

    /// Number of dofs of the whole mesh.
    fn dof_count(&self) -> usize;
}
