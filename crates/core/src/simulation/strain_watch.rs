//! What the limit of strain remembers: strain responses, and where a body in motion left a limited tool.

use glam::DVec3;

use super::contacts::Contact;
use crate::strain::{MAX_CONTACTS_WATCHED, StrainResponse};

/// Strain per newton on some contacts of a body.
#[derive(Clone, Debug)]
pub struct StrainWatch {
    /// The places that matter.
    pub response: StrainResponse,
    /// Serials of the contacts, in the order of the response; zero for none.
    pub serials: [u64; MAX_CONTACTS_WATCHED],
}

/// Where a limited tool was when a body in motion left it: until the body is back, or the tool out, it counts as being no
/// farther, or it would be hit all the harder.
#[derive(Clone, Copy, Debug)]
pub struct Rebound {
    anchor: DVec3,
    normal: DVec3,
    share: f64,
}

impl Rebound {
    /// Of a contact that ends; `None` if it was not limited.
    pub(super) fn of(contact: &Contact) -> Option<Self> {
        let Contact { anchor, normal, share, .. } = *contact;
        (share < 1.0).then_some(Self { anchor, normal, share })
    }

    /// Where a tool counts as being; `None` once it has come out.
    pub(super) fn position(&self, position: DVec3) -> Option<DVec3> {
        let displacement = position - self.anchor;
        (displacement.dot(self.normal) < 0.0).then(|| self.anchor + self.share * displacement)
    }
}

impl StrainWatch {
    /// Whether a contact has been prepared for.
    pub(super) fn covers(watch: Option<&Self>, contact: &Contact) -> bool {
        watch.is_some_and(|watch| watch.serials.contains(&contact.serial))
    }
}
