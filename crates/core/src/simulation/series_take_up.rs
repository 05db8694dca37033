//! Higher orders of a body's displacement that become known while a simulation runs.
//!
//! They are computed beside the running loop, place by place, and handed over as a whole. Where they are not known, a contact follows
//! the half-space of the material. A contact under a tool has the same coefficients as long as it lasts: an array that would change
//! those at its fans waits, for otherwise the force would jump.

use std::sync::Arc;

use super::contacts::{Contact, Mode};
use super::known_series::KnownSeries;
use super::model::Model;
use super::state::State;
use super::tool::LawKind;

impl State {
    /// Whether a series may be exchanged for the present one of its radius without changing the force of a contact: no fan that may
    /// have weight there has other coefficients.
    pub fn may_take_series(&self, model: &Model, body: usize, new: &KnownSeries) -> bool {
        let (Some(fixed), Some(state)) = (model.bodies.get(body), self.bodies.get(body)) else { return false };
        let (Some(local), Some(old)) = (&fixed.local, state.series(new.radius)) else { return false };
        let is_pressed = |contact: &Contact| {
            let tool = model.tools.get(contact.tool);
            contact.body == body
                && contact.law == LawKind::LOCAL
                && contact.mode != Mode::Free
                && tool.is_some_and(|tool| tool.radius == new.radius)
        };
        let is_same = |&fan: &u32| old.fields.get(fan as usize) == new.fields.get(fan as usize);
        new.fields.len() == fixed.fan_count()
            && self
                .contacts
                .iter()
                .filter(|(contact, _)| is_pressed(contact))
                .all(|(contact, _)| local.smooth.fans_reaching(contact.local.foot.triangle).iter().all(is_same))
    }

    /// Exchanges the series of a radius, and returns the previous one, whose memory must not be freed in a tick; the new one itself where
    /// there is none of its radius.
    pub fn take_series(&mut self, body: usize, new: Arc<KnownSeries>) -> Arc<KnownSeries> {
        let mut present = self.bodies.get_mut(body).into_iter().flat_map(|state| state.series.iter_mut().flatten());
        match present.find(|series| series.radius == new.radius) {
            Some(series) => std::mem::replace(series, new),
            None => new,
        }
    }

    /// Exchanges the series of all bodies with those of a state of the same model.
    pub fn swap_series(&mut self, other: &mut Self) {
        for (body, other) in self.bodies.iter_mut().zip(&mut other.bodies) {
            std::mem::swap(&mut body.series, &mut other.series);
        }
    }
}
