//! Higher orders of a body's displacement as far as they are known.

use std::sync::Arc;

use super::MAX_TOOLS;
use crate::contact::SeriesFields;

/// Higher orders of a body's displacement below spheres of one radius, as far as they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownSeries {
    /// Radius of the spheres, m.
    pub radius: f64,
    /// Coefficients at each fan of the smooth surface; zero where they are not known.
    pub fields: Vec<SeriesFields>,
    /// Which blocks of places they come from.
    pub blocks: Vec<bool>,
    /// How many of them are known.
    pub known_blocks: u32,
}

impl KnownSeries {
    /// Of these blocks.
    pub fn new(radius: f64, fields: Vec<SeriesFields>, blocks: Vec<bool>) -> Self {
        let known_blocks = blocks.iter().filter(|known| **known).count() as u32;
        Self { radius, fields, blocks, known_blocks }
    }
}

/// Those of a body by radius, in any order.
pub type SeriesOfBody = [Option<Arc<KnownSeries>>; MAX_TOOLS];
