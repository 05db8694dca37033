//! State common to the devices of all libraries: a tip, buttons, a cable, and a program that may have opened them.

use glam::{DMat3, DQuat, DVec3};
use palpate_devices::emulated::Mechanics;

use crate::conformance::Disturbance;
use crate::tip::SteeredTip;

/// The part of a device that does not depend on its library.
pub struct Hardware {
    /// Its tip.
    pub tip: SteeredTip,
    /// Buttons that are held, a bit each.
    pub buttons: u32,
    /// What goes wrong with it.
    pub disturbance: Option<Disturbance>,
    is_open: bool,
    /// It was unplugged while it was open: until it is opened again nothing reaches it.
    is_broken: bool,
}

impl Hardware {
    /// Plugged in, in the hand that the environment names.
    pub fn new(mechanics: Mechanics) -> Self {
        let tip = SteeredTip::in_hand(mechanics);
        Self { tip, buttons: 0, disturbance: None, is_open: false, is_broken: false }
    }

    /// Whether this goes wrong with it.
    pub fn has(&self, disturbance: Disturbance) -> bool {
        self.disturbance == Some(disturbance)
    }

    /// Whether its cable is in.
    pub fn is_plugged(&self) -> bool {
        !self.has(Disturbance::Unplugged)
    }

    /// Whether a program has opened it.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Whether calls of the program that has opened it reach it.
    pub fn is_connected(&self) -> bool {
        self.is_plugged() && !self.is_broken
    }

    /// Opens it, or closes it.
    pub fn set_open(&mut self, open: bool) {
        (self.is_open, self.is_broken) = (open, false);
    }

    /// Changes what goes wrong with it.
    pub fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.disturbance = disturbance;
        self.is_broken |= self.is_open && !self.is_plugged();
    }
}

/// Matrix of an orientation in a vendor's axes, by how these map to the person's and back.
pub fn rotation(orientation: DQuat, to_vendor: fn(DVec3) -> DVec3, from_vendor: fn(DVec3) -> DVec3) -> DMat3 {
    let column = |axis: DVec3| to_vendor(orientation * from_vendor(axis));
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}
