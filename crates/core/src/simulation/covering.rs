//! Memory in which the nodes below a contact are weighed.

use super::model::Model;
use crate::contact::{Patch, PatchScratch};

/// Sized once, for all bodies.
pub struct Covering {
    /// One a body.
    pub patches: Vec<PatchScratch>,
    /// The patch that was weighed last.
    pub candidate: Patch,
}

impl Covering {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        let patches = model.bodies.iter().map(|body| PatchScratch::new(&body.green.surface)).collect();
        Self { patches, candidate: Patch::default() }
    }
}
