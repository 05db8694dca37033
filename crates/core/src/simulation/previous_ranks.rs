//! Take-over of contacts and motions when the bodies or tools of a running simulation change.

use std::sync::Arc;

use super::contacts::Mode;
use super::known_series::KnownSeries;
use super::model::Model;
use super::state::State;
use super::{MAX_BODIES, MAX_CONTACTS, MAX_TOOLS};

/// Ranks in the previous model of the bodies and tools of a new model; none for those that are new.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PreviousRanks {
    /// By body of the new model.
    pub bodies: [Option<usize>; MAX_BODIES],
    /// By tool of the new model.
    pub tools: [Option<usize>; MAX_TOOLS],
}

impl PreviousRanks {
    fn new_rank(ranks: &[Option<usize>], before: usize) -> Option<usize> {
        ranks.iter().position(|&rank| rank == Some(before))
    }
}

impl State {
    /// Takes over from the state of the previous model: motion and strain of the bodies that stay, the state of the tools that
    /// stay, and the contacts between them. Contacts keep their slots, so that arrays by slot stay valid. Data are exchanged:
    /// nothing is allocated or freed.
    ///
    /// A body that stays may have another store of the same surface in `model`, the model of this state. Contacts whose nodes are
    /// touchable there continue.
    pub fn take_over(&mut self, before: &mut State, previous_ranks: &PreviousRanks, model: &Model) {
        for (body, old) in self.bodies.iter_mut().zip(&previous_ranks.bodies) {
            if let Some(old) = old.and_then(|old| before.bodies.get_mut(old)) {
                std::mem::swap(body, old);
            }
        }
        self.add_series(before, previous_ranks, model);
        for (tool, old) in self.tools.iter_mut().zip(&previous_ranks.tools) {
            let Some(old) = old.and_then(|old| before.tools.get(old)) else { continue };
            (tool.previous_pose, tool.released_energy) = (old.previous_pose, old.released_energy);
            for (body, old_body) in previous_ranks.bodies.iter().enumerate() {
                let Some(old_body) = *old_body else { continue };
                (tool.entry[body], tool.refused[body]) = (old.entry[old_body], old.refused[old_body]);
            }
        }
        self.contacts.count_begun = before.contacts.count_begun;
        for slot in 0..MAX_CONTACTS {
            let mut contact = before.contacts.slots[slot];
            let tool = PreviousRanks::new_rank(&previous_ranks.tools, contact.tool);
            let body = PreviousRanks::new_rank(&previous_ranks.bodies, contact.body);
            if let (Some(tool), Some(body), true) = (tool, body, contact.mode != Mode::Free) {
                (contact.tool, contact.body) = (tool, body);
                let patch = &mut before.contacts.patches[slot];
                if !patch.find_columns(&model.bodies[body].green) {
                    continue;
                }
                self.contacts.put(slot, contact);
                std::mem::swap(&mut self.contacts.patches[slot], patch);
            }
        }
        std::mem::swap(&mut self.compliance, &mut before.compliance);
        // Pressures are allocated if some tool needs cells: where such a tool stays, both states have them.
        if self.pressures.len() == before.pressures.len() {
            std::mem::swap(&mut self.pressures, &mut before.pressures);
        }
    }

    /// Adds series of the bodies of a new model to those that are taken over: of radii that come with it. Bodies have been exchanged
    /// already: `before` has those of the new model. Nothing is allocated or freed.
    fn add_series(&mut self, before: &mut State, previous_ranks: &PreviousRanks, model: &Model) {
        for (state, old) in self.bodies.iter_mut().zip(&previous_ranks.bodies) {
            let Some(given) = old.and_then(|old| before.bodies.get_mut(old)) else { continue };
            for new in given.series.iter_mut().filter(|new| new.is_some()) {
                let radius = new.as_ref().map_or(0.0, |new| new.radius);
                if state.series(radius).is_some() {
                    continue;
                }
                let is_unused = |series: &&mut Option<Arc<KnownSeries>>| {
                    let of_tool = |radius: f64| model.tools.iter().any(|tool| tool.radius == radius);
                    !series.as_ref().is_some_and(|series| of_tool(series.radius))
                };
                if let Some(place) = state.series.iter_mut().find(is_unused) {
                    std::mem::swap(place, new);
                }
            }
        }
    }
}
