//! Memory a tick needs, sized once.

use super::model::Model;
use super::solve::LocalScratch;
use super::system::System;
use crate::contact::{Patch, PatchScratch};

/// Reusable memory of [`super::step`]: nothing in it outlives a tick.
pub struct Scratch {
    /// One a body.
    pub(super) patches: Vec<PatchScratch>,
    pub(super) candidate: Patch,
    pub(super) system: Box<System>,
    pub(super) local: Box<LocalScratch>,
}

impl Scratch {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        let patches = model.bodies.iter().map(|body| PatchScratch::new(&body.green.surface)).collect();
        Self { patches, candidate: Patch::default(), system: Box::default(), local: Box::default() }
    }
}
