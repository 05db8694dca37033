//! Memory in which the nodes below a contact are weighed.

use super::model::Model;
use crate::contact::footprint::FootprintScratch;
use crate::contact::smooth::{FanWeights, Neighbourhood};
use crate::contact::{Patch, PatchScratch};

/// Sized once, for all bodies.
pub struct Covering {
    /// One a body.
    pub patches: Vec<PatchScratch>,
    /// The patch that was weighed last.
    pub candidate: Patch,
    /// Where a tool comes near.
    pub near: Neighbourhood,
    /// Where a tool that is no sphere comes near, and the fans there.
    pub footprint: FootprintScratch,
    pub weights: FanWeights,
}

impl Covering {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        let patches = model.bodies.iter().map(|body| PatchScratch::new(&body.green.surface)).collect();
        let near = neighbourhood(model);
        let (footprint, weights) = (FootprintScratch::default(), FanWeights::new(near.clone()));
        Self { patches, candidate: Patch::default(), near, footprint, weights }
    }
}

/// Memory for the smooth surfaces of a model.
pub fn neighbourhood(model: &Model) -> Neighbourhood {
    Neighbourhood::new(model.bodies.iter().filter_map(|body| body.local.as_ref()).map(|local| &local.smooth))
}
