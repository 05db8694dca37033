//! Strain responses of the contacts of a body, as the limit of strain keeps them.

use super::contacts::{Contact, REVISIONS};
use crate::strain::{MAX_CONTACTS_WATCHED, StrainResponse};

/// Strain per newton on some contacts of a body.
#[derive(Clone, Debug)]
pub struct StrainWatch {
    /// The places that matter.
    pub response: StrainResponse,
    /// Serials of the contacts, in the order of the response; zero for none.
    pub serials: [u64; MAX_CONTACTS_WATCHED],
}

impl StrainWatch {
    /// Whether a contact has been prepared for, here or where it was before it slid on.
    pub(super) fn covers(watch: Option<&Self>, contact: &Contact) -> bool {
        watch.is_some_and(|watch| watch.place_of(contact).is_some())
    }

    /// Place of a contact in the response.
    pub(super) fn place_of(&self, contact: &Contact) -> Option<usize> {
        self.serials.iter().position(|&known| known != 0 && known >> REVISIONS == contact.serial >> REVISIONS)
    }
}
