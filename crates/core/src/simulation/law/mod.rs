//! Contact laws: when a contact begins, how it follows its tool, what its force is, when it ends.
//!
//! A law is a file or folder here that implements [`Law`], and one line of [`LAWS`]. The tick calls laws through the trait only.
//! A law must not allocate, and must not release energy over a closed path of the tool.

mod approach;
#[cfg(test)]
#[path = "../../../tests/common/mod.rs"]
pub(super) mod bodies;
mod interface;
mod local;
mod node;
mod patch;
#[cfg(test)]
mod spring;
mod stick;

pub use approach::Approach;
pub use interface::Law;
pub use local::LocalScratch;

use super::contacts::Contact;
use super::model::Model;
use super::system::System;
use super::tool::LawKind;
use super::weight_scratch::WeightScratch;

/// All laws. The first, a sticking patch, replaces a law that is missing in this build.
pub const LAWS: &[&dyn Law] = &[
    &stick::Sticking(patch::Patch),
    &stick::Sticking(node::Node),
    &local::Local,
    #[cfg(test)]
    &spring::Spring,
];

/// The law of a kind.
pub fn law_of(kind: LawKind) -> &'static dyn Law {
    LAWS.iter().copied().find(|law| law.kind() == kind).unwrap_or(LAWS[0])
}

/// Last check of a contact before its wrench leaves the tick: whether it is finite and physically possible.
pub fn is_sound(model: &Model, contact: &Contact, stiffness_scale: f64) -> bool {
    let finite = contact.force.is_finite() && contact.torque.is_finite() && contact.point.is_finite();
    finite && law_of(contact.law).is_sound(model, contact, stiffness_scale)
}

impl LawKind {
    /// The law called `name`.
    pub fn parse(name: &str) -> Option<Self> {
        LAWS.iter().map(|law| law.kind()).find(|kind| kind.name() == name)
    }
}

/// Scratch memory of laws in a tick.
pub struct TickMemory<'a> {
    pub weight_scratch: &'a mut WeightScratch,
    pub system: &'a mut System,
    /// The local law's own.
    pub local: &'a mut LocalScratch,
}
