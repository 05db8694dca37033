//! Contacts in slots. A contact knows its tool and its body; it is neither.

use glam::DVec3;

use super::law::{ASKED, LocalContact};
use super::tool::LawKind;
use super::{MAX_CONTACTS, MAX_FURTHER};
use crate::contact::TouchPatch;

/// What a contact does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The slot is empty.
    #[default]
    Free,
    /// Touching, unilateral: never pulls.
    Press,
    /// Holding on, bilateral.
    Grab,
}

/// A contact of one tool with one body; vectors are in the body's frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    // Written when it begins.
    /// What it does; [`Mode::Free`] is an empty slot.
    pub mode: Mode,
    /// How it touches: a tool that holds on does so by a patch.
    pub law: LawKind,
    /// Index of the tool.
    pub tool: usize,
    /// Index of the body.
    pub body: usize,
    /// Counts the contacts since the start, and in the lowest [`REVISIONS`] bits how often one has slid to another place.
    pub serial: u64,
    /// Contact point on the untouched surface, m.
    pub point: DVec3,
    /// Unit outward normal there.
    pub normal: DVec3,
    /// Tool position at which the contact carries no force, m.
    pub anchor: DVec3,
    /// How far the moving patch was from rest when it was met, m; zero on a body at rest.
    pub(super) met: DVec3,

    // Written every tick.
    /// Displacement of the tool from the anchor, as far as the limit of strain lets it, m.
    pub displacement: DVec3,
    /// The whole displacement of the tool from the anchor, m.
    pub wanted: DVec3,
    /// Whether the limit of strain keeps the tool from it.
    pub limited: bool,
    /// How far its anchor has slipped since it was followed last, m.
    pub(super) slipped: DVec3,
    /// Whether its force has been within its cone since it began.
    pub(super) settled: bool,
    /// Whether it has pressed since it began.
    pub(super) pressed: bool,
    /// Bound on its length while the limit is not known yet, m.
    pub(super) bound: f64,
    /// Force on the body, N.
    pub force: DVec3,
    /// Under the local law, what it remembers.
    pub local: LocalContact,
}

impl Contact {
    /// Whether it is a place beside another one that its tool is near and does not press.
    pub(super) fn waits(&self) -> bool {
        self.local.further && self.force == DVec3::ZERO
    }

    /// Place at which its strain was asked for under a serial, m.
    pub(super) fn asked_at(&self, serial: u64) -> DVec3 {
        self.local.asked[serial as usize % ASKED]
    }

    /// Has its strain asked for anew where it has slid on by more than `way`, m, since it was asked for last.
    pub(super) fn ask_anew(&mut self, way: f64) {
        if self.asked_at(self.serial).distance(self.point) > way {
            self.serial += 1;
            self.local.asked[self.serial as usize % ASKED] = self.point;
        }
    }
}

/// Slots for contacts. The patches stand apart, so that looking through the slots touches little memory.
#[derive(Clone, Debug)]
pub struct Contacts {
    pub(super) slots: [Contact; MAX_CONTACTS],
    pub(super) patches: Vec<TouchPatch>,
    /// A bit for each slot that is not empty.
    used: u32,
    pub(super) begun: u64,
}

const _: () = assert!(MAX_CONTACTS <= u32::BITS as usize);

impl Default for Contacts {
    fn default() -> Self {
        Self { slots: Default::default(), patches: vec![TouchPatch::default(); MAX_CONTACTS], used: 0, begun: 0 }
    }
}

/// Bits of a serial that count the places of one contact.
pub(super) const REVISIONS: u32 = 24;

impl Contacts {
    /// Serial of a contact that begins.
    pub(super) fn next_serial(&mut self) -> u64 {
        self.begun += 1;
        self.begun << REVISIONS
    }

    /// The contacts that touch, and their patches.
    pub fn iter(&self) -> impl Iterator<Item = (&Contact, &TouchPatch)> {
        self.used().map(|slot| (&self.slots[slot], &self.patches[slot])).filter(|(contact, _)| !contact.waits())
    }

    /// Slots that are not empty.
    fn used(&self) -> impl Iterator<Item = usize> + use<> {
        let mut left = self.used;
        std::iter::from_fn(move || {
            let slot = left.trailing_zeros() as usize;
            left &= left.wrapping_sub(1);
            (slot < MAX_CONTACTS).then_some(slot)
        })
    }

    /// Slots of the contacts of a body.
    pub(super) fn on(&self, body: usize) -> impl Iterator<Item = usize> + '_ {
        self.used().filter(move |&slot| self.slots[slot].body == body)
    }

    /// Slots of the contacts of a tool with a body.
    pub(super) fn of(&self, tool: usize, body: usize) -> impl Iterator<Item = usize> + '_ {
        self.on(body).filter(move |&slot| self.slots[slot].tool == tool)
    }

    /// An empty slot; the last ones are for further places, so that the first place of a tool finds one.
    pub(super) fn empty(&self, further: bool) -> Option<usize> {
        let first = if further { MAX_CONTACTS - MAX_FURTHER } else { 0 };
        (first..MAX_CONTACTS).find(|&slot| self.slots[slot].mode == Mode::Free)
    }

    /// Fills a slot.
    pub(super) fn put(&mut self, slot: usize, contact: Contact) {
        self.slots[slot] = contact;
        self.used |= 1 << slot;
    }

    /// Empties a slot.
    pub(super) fn clear(&mut self, slot: usize) {
        self.slots[slot] = Contact::default();
        self.used &= !(1 << slot);
    }

    /// Copies the contacts that there are; nothing is allocated.
    pub(super) fn copy_from(&mut self, other: &Contacts) {
        self.begun = other.begun;
        for slot in self.used().filter(|slot| other.used & 1 << slot == 0) {
            self.slots[slot] = Contact::default();
        }
        for slot in other.used() {
            self.slots[slot] = other.slots[slot];
            self.patches[slot].copy_from(&other.patches[slot]);
        }
        self.used = other.used;
    }
}
