//! Contacts in slots. A contact has the indices of its tool and of its body.

mod local;

pub use local::LocalContact;

use std::ops::Deref;

use glam::DVec3;

use super::tool::LawKind;
use super::{MAX_ADDITIONAL, MAX_CONTACTS};
use crate::contact::TouchPatch;

/// Kind of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The slot is empty.
    #[default]
    Free,
    /// Touching, unilateral: never pulls.
    Press,
    /// Grabbing, bilateral: may pull.
    Grab,
}

/// Stored positions of strain requests: more than are pending at once.
pub(super) const STRAIN_REQUESTS: usize = 8;

/// A contact of one tool with one body; vectors are in the body's frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    // Written when it begins.
    /// Its kind; [`Mode::Free`] is an empty slot.
    pub mode: Mode,
    /// Its law; a tool that grabs has the law of a patch.
    pub law: LawKind,
    /// Whether its force is not linear in its displacement: its law finds the force. The linear contacts of a body are solved
    /// together.
    pub(super) nonlinear: bool,
    /// Whether it was added beside another contact of the same tool: it may be pending without a force.
    pub(super) additional: bool,
    /// Index of the tool.
    pub tool: usize,
    /// Index of the body.
    pub body: usize,
    /// Number of the contact since the start and, in the lowest [`REVISIONS`] bits, number of its strain requests.
    pub serial: u64,
    /// Contact point on the untouched surface, m.
    pub point: DVec3,
    /// Unit outward normal there.
    pub normal: DVec3,
    /// Tool position at which the contact carries no force, m.
    pub anchor: DVec3,
    /// Displacement of the moving patch when the contact began, m; zero on a body at rest.
    pub(super) start_displacement: DVec3,

    // Written every tick.
    /// Displacement of the tool from the anchor within the strain limit, m.
    pub displacement: DVec3,
    /// The whole displacement of the tool from the anchor, m.
    pub tool_displacement: DVec3,
    /// Whether the strain limit shortens it.
    pub limited: bool,
    /// Slip of its anchor in this tick, m.
    pub(super) slipped: DVec3,
    /// Whether its force has been within its cone of friction since it began.
    pub(super) was_in_cone: bool,
    /// Whether it has pressed since it began.
    pub(super) has_pressed: bool,
    /// Provisional bound of its displacement, until its strain response is prepared, m.
    pub(super) bound: f64,
    /// Force on the body, N.
    pub force: DVec3,
    /// Torque on the tool about its tip, N m.
    pub torque: DVec3,
    /// Share of force and torque within the strain limit, for a nonlinear contact.
    pub(super) share: f64,
    /// Contact points of its strain requests, m, by the remainder of the serial.
    pub(super) strain_requests: [DVec3; STRAIN_REQUESTS],

    // Written every tick by laws that compute them; zero otherwise.
    /// Contact radius, m.
    pub radius: f64,
    /// Approach of the tool and the surface at rest, m.
    pub depth: f64,
    /// Stiffness along the normal, body and contact in series, N/m.
    pub stiffness: f64,
    /// Whether it slips.
    pub slipping: bool,
    /// Estimated relative error of the force beyond small strain; zero for a linear material, of which nothing is known there.
    pub error: f64,
    /// Share of force and torque that counts: below one beyond the range of the law.
    pub(super) held: f64,
    /// Energy stored outside the body, J: of the indentation and of the springs of friction.
    pub(super) energy: f64,
    /// Energy that friction dissipated in the last tick, J.
    pub(super) dissipated: f64,
    /// State of the local law.
    pub(super) local: LocalContact,
}

impl Contact {
    /// A new pressing contact.
    pub(super) fn new(law: LawKind, (tool, body): (usize, usize)) -> Self {
        Self { mode: Mode::Press, law, tool, body, share: 1.0, held: 1.0, ..Self::default() }
    }

    /// Whether it is an additional contact that the tool is near to but does not press.
    pub(super) fn is_pending(&self) -> bool {
        self.additional && self.force == DVec3::ZERO
    }

    /// Contact point of the strain request with a serial, m.
    pub(super) fn strain_requested_at(&self, serial: u64) -> DVec3 {
        self.strain_requests[serial as usize % STRAIN_REQUESTS]
    }

    /// Requests its strain again if it has slid by more than `distance`, m, since the last request.
    pub(super) fn request_strain_after(&mut self, distance: f64) {
        if self.strain_requested_at(self.serial).distance(self.point) > distance {
            self.serial += 1;
            self.strain_requests[self.serial as usize % STRAIN_REQUESTS] = self.point;
        }
    }
}

/// Some slots, in order: they are read while the contacts change.
pub(super) struct SlotList {
    slots: [usize; MAX_CONTACTS],
    count: usize,
}

impl SlotList {
    /// Gathers slots. The list is not to be moved: a copy right after its entries are written waits for them.
    #[inline(always)]
    pub(super) fn of(slots: impl Iterator<Item = usize>) -> Self {
        let mut list = Self { slots: [0; MAX_CONTACTS], count: 0 };
        for slot in slots {
            list.slots[list.count] = slot;
            list.count += 1;
        }
        list
    }
}

impl Deref for SlotList {
    type Target = [usize];

    fn deref(&self) -> &[usize] {
        &self.slots[..self.count]
    }
}

/// Slots for contacts. The patches are stored separately, so that a pass over the slots reads little memory.
#[derive(Clone, Debug)]
pub struct Contacts {
    pub(super) slots: [Contact; MAX_CONTACTS],
    pub(super) patches: Vec<TouchPatch>,
    /// Bit mask of the slots that are not empty.
    occupied: u32,
    pub(super) count_begun: u64,
}

const _: () = assert!(MAX_CONTACTS <= u32::BITS as usize);

impl Default for Contacts {
    fn default() -> Self {
        Self {
            slots: Default::default(),
            patches: vec![TouchPatch::default(); MAX_CONTACTS],
            occupied: 0,
            count_begun: 0,
        }
    }
}

/// Bits of a serial that count the strain requests of one contact.
pub(super) const REVISIONS: u32 = 24;

impl Contacts {
    /// Serial of a contact that begins.
    pub(super) fn next_serial(&mut self) -> u64 {
        self.count_begun += 1;
        self.count_begun << REVISIONS
    }

    /// The contacts that touch, and their patches.
    pub fn iter(&self) -> impl Iterator<Item = (&Contact, &TouchPatch)> {
        self.occupied()
            .map(|slot| (&self.slots[slot], &self.patches[slot]))
            .filter(|(contact, _)| !contact.is_pending())
    }

    /// Slots that are not empty.
    pub(super) fn occupied(&self) -> impl Iterator<Item = usize> + use<> {
        let mut left = self.occupied;
        std::iter::from_fn(move || {
            let slot = left.trailing_zeros() as usize;
            left &= left.wrapping_sub(1);
            (slot < MAX_CONTACTS).then_some(slot)
        })
    }

    /// Slots of the contacts of a body.
    pub(super) fn on(&self, body: usize) -> impl Iterator<Item = usize> + '_ {
        self.occupied().filter(move |&slot| self.slots[slot].body == body)
    }

    /// Slots of the linear contacts of a body.
    pub(super) fn linear_on(&self, body: usize) -> impl Iterator<Item = usize> + '_ {
        self.on(body).filter(|&slot| !self.slots[slot].nonlinear)
    }

    /// Slots of the contacts of a tool with a body.
    pub(super) fn of(&self, tool: usize, body: usize) -> impl Iterator<Item = usize> + '_ {
        self.on(body).filter(move |&slot| self.slots[slot].tool == tool)
    }

    /// An empty slot. Additional contacts use the last slots, so that the first contact of a tool always finds one.
    pub(super) fn empty(&self, additional: bool) -> Option<usize> {
        let first = if additional { MAX_CONTACTS - MAX_ADDITIONAL } else { 0 };
        (first..MAX_CONTACTS).find(|&slot| self.slots[slot].mode == Mode::Free)
    }

    /// Fills a slot.
    pub(super) fn put(&mut self, slot: usize, contact: Contact) {
        self.slots[slot] = contact;
        self.occupied |= 1 << slot;
    }

    /// Empties a slot.
    pub(super) fn clear(&mut self, slot: usize) {
        self.slots[slot] = Contact::default();
        self.occupied &= !(1 << slot);
    }

    /// Copies the occupied slots; nothing is allocated.
    pub(super) fn copy_from(&mut self, other: &Contacts) {
        self.count_begun = other.count_begun;
        for slot in self.occupied().filter(|slot| other.occupied & 1 << slot == 0) {
            self.slots[slot] = Contact::default();
        }
        for slot in other.occupied() {
            self.slots[slot] = other.slots[slot];
            self.patches[slot].copy_from(&other.patches[slot]);
        }
        self.occupied = other.occupied;
    }
}
