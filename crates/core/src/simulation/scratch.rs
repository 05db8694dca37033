//! Scratch memory of a tick, allocated once.

use super::law::{LocalScratch, TickMemory};
use super::model::Model;
use super::system::System;
use super::weight_scratch::WeightScratch;

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
