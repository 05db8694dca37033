//! Strain responses of the contacts of a body, as the limit of strain keeps them.

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

impl StrainWatch {
    /// Whether a contact has been prepared for.
    pub(super) fn covers(watch: Option<&Self>, contact: &Contact) -> bool {
        watch.is_some_and(|watch| watch.serials.contains(&contact.serial))
    }
}
