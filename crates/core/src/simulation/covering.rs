//! Memory in which the nodes below a contact are weighed.

use super::model::Model;
use crate::contact::smooth::Neighbourhood;
use crate::contact::{Patch, PatchScratch};

/// Sized once, for all bodies.
pub struct Covering {
    /// One a body.
    pub patches: Vec<PatchScratch>,
    /// The patch that was weighed last.
    pub candidate: Patch,
    /// Where a tool comes near.
    pub near: Neighbourhood,
}

impl Covering {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        let patches = model.bodies.iter().map(|body| PatchScratch::new(&body.green.surface)).collect();
        Self { patches, candidate: Patch::default(), near: neighbourhood(model) }
    }
}

/// Memory for the smooth surfaces of a model.
pub fn neighbourhood(model: &Model) -> Neighbourhood {
    Neighbourhood::new(model.bodies.iter().filter_map(|body| body.local.as_ref()).map(|local| &local.smooth))
}
