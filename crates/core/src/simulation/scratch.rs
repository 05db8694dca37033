//! Memory a tick needs, sized once.

use super::covering::Covering;
use super::model::Model;
use super::solve::LocalScratch;
use super::system::System;

/// Reusable memory of [`super::step`]: nothing in it outlives a tick but copies of parts of the model.
pub struct Scratch {
    pub(super) covering: Covering,
    pub(super) system: Box<System>,
    pub(super) local: Box<LocalScratch>,
}

impl Scratch {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        Self { covering: Covering::new(model), system: Box::default(), local: Box::new(LocalScratch::new(model)) }
    }

    /// Steps of Newton's method that the last body with contacts under the local law took.
    pub fn newton_steps(&self) -> usize {
        self.local.taken
    }
}
