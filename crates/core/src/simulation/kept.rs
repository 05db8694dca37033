//! What goes on when bodies and tools come into a running simulation or go out of it.

use super::contacts::Mode;
use super::model::Model;
use super::state::State;
use super::{MAX_BODIES, MAX_CONTACTS, MAX_TOOLS};

/// Which bodies and tools of a new model were in the one before: their ranks there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// One a body of the new model.
    pub bodies: [Option<usize>; MAX_BODIES],
    /// One a tool of the new model.
    pub tools: [Option<usize>; MAX_TOOLS],
}

impl Kept {
    fn new_rank(ranks: &[Option<usize>], before: usize) -> Option<usize> {
        ranks.iter().position(|&kept| kept == Some(before))
    }
}

impl State {
    /// Takes over what goes on from the state of the model before: motions and strain of bodies that stay, what tools that stay
    /// remember, and the contacts between these. Contacts keep their slots, so that all that is kept by slot stays right. By
    /// exchanges alone: nothing is allocated or freed.
    ///
    /// A body that stays may have another store of the same surface in `model`, this state's own: contacts whose nodes may be
    /// touched there go on.
    pub fn take_over(&mut self, before: &mut State, kept: &Kept, model: &Model) {
        for (body, old) in self.bodies.iter_mut().zip(&kept.bodies) {
            if let Some(old) = old.and_then(|old| before.bodies.get_mut(old)) {
                std::mem::swap(body, old);
            }
        }
        for (tool, old) in self.tools.iter_mut().zip(&kept.tools) {
            let Some(old) = old.and_then(|old| before.tools.get(old)) else { continue };
            (tool.before, tool.freed) = (old.before, old.freed);
            for (body, old_body) in kept.bodies.iter().enumerate() {
                let Some(old_body) = *old_body else { continue };
                (tool.entry[body], tool.refused[body]) = (old.entry[old_body], old.refused[old_body]);
            }
        }
        self.contacts.begun = before.contacts.begun;
        for slot in 0..MAX_CONTACTS {
            let mut contact = before.contacts.slots[slot];
            let tool = Kept::new_rank(&kept.tools, contact.tool);
            let body = Kept::new_rank(&kept.bodies, contact.body);
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
        // Sized where some tool takes cells: where one of them stays, both are.
        if self.pressures.len() == before.pressures.len() {
            std::mem::swap(&mut self.pressures, &mut before.pressures);
        }
    }
}
