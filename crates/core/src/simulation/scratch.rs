//! Scratch memory of a tick, allocated once.

use super::law::{LocalScratch, TickMemory};
use super::model::Model;
use super::system::System;
use crate::contact::footprint::FootprintScratch;
use crate::contact::smooth::{FanWeights, Neighbourhood};
use crate::contact::{Patch, PatchScratch};

/// Reusable memory of [`super::step`]. Only copies of parts of the model outlive a tick in it.
pub struct Scratch {
    pub(super) weight_scratch: WeightScratch,
    pub(super) system: Box<System>,
    local: Box<LocalScratch>,
}

impl Scratch {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        Self {
            weight_scratch: WeightScratch::new(model),
            system: Box::default(),
            local: Box::new(LocalScratch::new(model)),
        }
    }

    /// The memory that laws use.
    pub(super) fn memory(&mut self) -> TickMemory<'_> {
        let Self { weight_scratch, system, local } = self;
        TickMemory { weight_scratch, system, local }
    }

    /// Steps of Newton's method that the last body with contacts under the local law took.
    pub fn newton_steps(&self) -> usize {
        self.local.newton_steps
    }
}

/// Memory for the weights of the nodes below a contact, of all bodies.
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
