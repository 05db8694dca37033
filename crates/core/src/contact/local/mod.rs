//! Local contact below the size of elements: indentation of an elastic half-space, and friction.
//!
//! Every law here gives a stored energy and its exact derivatives. Lengths in m, forces in N, moduli in Pa; the approach
//! `d` is how far the tool's tip would reach below the undeformed surface.

pub mod cells;
mod contact_plane;
mod finite_strain;
mod force_series;
mod friction;
mod modulus;
mod sphere;
mod sphere_pressure;
mod strain_law;
mod strain_table;
mod widening;

pub use contact_plane::{ContactPlane, ToolPose};
pub use finite_strain::{DEEPEST_FIT, StrainTerms, correct_sphere, terms_with_pad};
pub use force_series::{HigherOrders, SERIES_FIELDS, SeriesFields, blended_series, higher_orders};
pub use friction::{Friction, FrictionResponse};
pub use modulus::effective_modulus;
pub use sphere::{SphereContact, SphereOnSurface, indent_sphere};
pub use sphere_pressure::SpherePressure;
pub use strain_law::{STRAIN_RATIOS, StrainLaw, interpolate, strain_terms};
pub use widening::{WidenedContact, Widening};
