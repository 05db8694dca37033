//! Scratch memory for the weights of the nodes below a contact.

use super::model::Model;
use crate::contact::footprint::FootprintScratch;
use crate::contact::smooth::{FanWeights, Neighbourhood};
use crate::contact::{Patch, PatchScratch};

/// Allocated once, for all bodies.
pub struct WeightScratch {
    /// By body.
    pub patches: Vec<PatchScratch>,
    /// The latest patch.
    pub candidate: Patch,
    /// Fans near a sphere.
    pub near: Neighbourhood,
    /// Pieces near a tool that is not a sphere, and the weights of its fans.
    pub footprint: FootprintScratch,
    pub weights: FanWeights,
}

impl WeightScratch {
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
