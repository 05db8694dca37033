//! Contact by a smooth patch of a physical radius: the force converges as the mesh is refined.

use super::Approach;
use super::stick::Footprint;
use crate::contact::{Refusal, SurfacePoint, patch_weights};
use crate::simulation::tool::LawKind;
use crate::simulation::weight_scratch::WeightScratch;

impl LawKind {
    /// A smooth patch of a physical radius that sticks to the material it first touched.
    pub const PATCH: Self = Self { name: "patch", needs_moduli: false };
}

/// The law that needs nothing but the Green's function.
impl Default for LawKind {
    fn default() -> Self {
        Self::PATCH
    }
}

/// Consistent weights over a disc of the contact radius.
pub struct Patch;

impl Footprint for Patch {
    fn kind(&self) -> LawKind {
        LawKind::PATCH
    }

    fn weigh(
        &self,
        approach: &Approach<'_>,
        centre: &SurfacePoint,
        weight_scratch: &mut WeightScratch,
    ) -> Result<(), Refusal> {
        let WeightScratch { patches, candidate, .. } = weight_scratch;
        let (body, patch_scratch) = (approach.body, &mut patches[approach.body_index]);
        patch_weights(&body.green.surface, &body.geometry, centre, approach.contact_radius, patch_scratch, candidate)
    }
}
