//! Chapter 8 of docs/theory.md: the strain of a pose, and the share of a contact's force that is within a limit.
//!
//! Linear elasticity is accurate up to about 10 % strain. While a contact sticks, the displacements are affine in the forces on
//! the patches, `u = u_free + sum_c Psi W_c f_c`, and so is the displacement gradient at any place of the body: a place is
//! [`GradientOperator`] rows applied to `u_free` (its base) and to the columns of `Psi W_c` (its slopes per newton). Two
//! measures follow from a gradient ([`StrainKind`]): the infinitesimal strain where the elements are known, and the Green
//! strain in the plane of the surface where they are not.
//!
//! Evaluating all places takes milliseconds: [`StrainMeasure::prepare`] does it once a contact, outside the tick, and
//! keeps the few places that are strained most under some force. [`StrainResponse`] holds them; the tick asks it which
//! share of its forces is within the limit. Until it is prepared, [`provisional_displacement`] bounds the motion of the
//! patch instead.
//!
//! The tick's side ([`StrainResponse`], [`StrainKind`], [`provisional_displacement`]) needs nothing but vectors; the rest
//! needs the interior solution and rayon.

#[cfg(feature = "strain")]
mod gradient;
#[cfg(feature = "strain")]
mod loading;
#[cfg(feature = "strain")]
mod measure;
mod provisional;
mod response;
mod tensor;
#[cfg(feature = "strain")]
mod watched_points;

#[cfg(feature = "strain")]
pub use gradient::GradientOperator;
#[cfg(feature = "strain")]
pub use measure::{StrainMeasure, StrainOperator};
pub use provisional::provisional_displacement;
pub use response::{MAX_CONTACTS_WATCHED, MAX_STRAIN_PLACES, StrainResponse};
pub use tensor::StrainKind;
