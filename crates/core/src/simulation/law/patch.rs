//! A smooth patch of a physical radius: the force converges as the mesh is refined.

use super::Approach;
use super::stick::Footprint;
use crate::contact::{Refusal, SurfacePoint, patch_weights};
use crate::simulation::covering::Covering;
use crate::simulation::tool::LawKind;

/// Consistent weights over a disc of the contact radius.
pub struct Patch;

impl Footprint for Patch {
    fn kind(&self) -> LawKind {
        LawKind::Patch
    }

    fn cover(&self, approach: &Approach<'_>, centre: &SurfacePoint, covering: &mut Covering) -> Result<(), Refusal> {
        let Covering { patches, candidate, .. } = covering;
        let (body, patch_scratch) = (approach.body, &mut patches[approach.body_index]);
        patch_weights(&body.green.surface, &body.geometry, centre, approach.contact_radius, patch_scratch, candidate)
    }
}
