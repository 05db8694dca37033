//! Last check of a contact before its wrench leaves the tick.

use super::contacts::Contact;
use super::law::law_of;
use super::model::Model;

/// Whether the wrench of a contact is finite and physically possible.
pub fn is_sound(model: &Model, contact: &Contact, stiffness_scale: f64) -> bool {
    let finite = contact.force.is_finite() && contact.torque.is_finite() && contact.point.is_finite();
    finite && law_of(contact.law).is_sound(model, contact, stiffness_scale)
}
