//! Emulated VerseGrips.

use glam::DQuat;
use palpate_devices::Buttons;

/// Kinds of grips, by the array in which they stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GripKind {
    /// By cable: one button.
    Wired,
    /// By radio: three buttons.
    Wireless,
    /// By radio, with data of an extension.
    Custom,
}

impl GripKind {
    /// Name of its array.
    pub fn array(self) -> &'static str {
        match self {
            GripKind::Wired => "verse_grip",
            GripKind::Wireless => "wireless_verse_grip",
            GripKind::Custom => "custom_verse_grip",
        }
    }

    /// How many buttons it has.
    pub fn buttons(self) -> u32 {
        if self == GripKind::Wired { 1 } else { 3 }
    }
}

/// A grip.
#[derive(Clone, Debug)]
pub struct Grip {
    /// Identity.
    pub id: String,
    /// What it is.
    pub kind: GripKind,
    /// Arm with which it is paired: it turns as that is held, and is refreshed with it.
    pub arm: String,
    /// Held buttons.
    pub buttons: Buttons,
    /// Latest orientation that something asked for.
    pub orientation: DQuat,
    /// Whether it is switched on.
    pub awake: bool,
}

impl Grip {
    /// Paired with an arm, at rest.
    pub fn new(id: &str, kind: GripKind, arm: &str) -> Self {
        let (buttons, orientation) = (Buttons::default(), DQuat::IDENTITY);
        Self { id: id.into(), kind, arm: arm.into(), buttons, orientation, awake: true }
    }

    /// Whether button `rank` is held.
    pub fn holds(&self, rank: u32) -> bool {
        self.buttons.0 & (1 << rank) != 0
    }
}
