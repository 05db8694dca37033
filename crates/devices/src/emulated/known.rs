//! Mechanics of devices that are sold and of hands, for emulation.
//!
//! What is data: the PHANTOMs' apparent mass, back-drive friction and resolution are those of SensAble's data sheets, as they are
//! commonly quoted; the Touch has the Omni's mechanics. The Falcon's resolution (400 dots per inch) is Novint's. Everything else is an
//! assumption: masses and frictions of the parallel devices by their size, resolutions of Force Dimension's and Haply's devices by
//! the order of magnitude that is advertised, and all dampings and delays, which nobody states. The damping is taken as what the
//! recommended stiffness of [`crate::known`] needs at 1 kHz with no delay, `b = K T/2`; so the delay beyond that, one frame of
//! USB, 1 ms, or a quarter where the vendor's loop runs at 4 kHz, must be made up for by friction and hand, as it is by the real
//! ones.

use super::hand::{Hand, HandTarget};
use super::tip::Mechanics;

const fn tip(mass: f64, damping: f64, dry_friction: f64, encoder_step: f64, delay: f64) -> Mechanics {
    Mechanics { mass, damping, dry_friction, encoder_step, delay }
}

/// All of [`crate::known::ALL`], by the same names.
pub const ALL: [(&str, Mechanics); 8] = [
    ("Touch", tip(0.045, 0.2, 0.26, 55e-6, 1e-3)),
    ("PHANTOM Omni", tip(0.045, 0.35, 0.26, 55e-6, 1e-3)),
    ("PHANTOM Desktop", tip(0.045, 0.5, 0.06, 23e-6, 1e-3)),
    ("Falcon", tip(0.25, 1.5, 0.3, 63.5e-6, 1e-3)),
    ("omega", tip(0.25, 2.5, 0.1, 10e-6, 0.25e-3)),
    ("sigma.7", tip(0.6, 2.0, 0.2, 10e-6, 0.25e-3)),
    ("lambda.7", tip(0.8, 4.0, 0.2, 10e-6, 0.25e-3)),
    ("Inverse3", tip(0.1, 0.4, 0.1, 10e-6, 1e-3)),
];

/// Mechanics of a device by its name in [`crate::known::ALL`].
pub fn mechanics(name: &str) -> Option<Mechanics> {
    ALL.iter().find(|(known, _)| *known == name).map(|(_, mechanics)| *mechanics)
}

impl Hand {
    /// A hand that holds a stylus loosely, with little damping: 0.1 kg, 2 N s/m, 100 N/m, wishing to be at a place.
    ///
    /// It and [`Hand::firm`] are of the order of what was measured: a hand with its arm at a haptic device, 0.55 kg, 6.5 N s/m and
    /// 135 N/m (van Beek et al., Scientific Reports 5:18004, 2015, figure 3; of that mass only a part moves as fast as an
    /// unstable contact); the tip of a finger that pushes with 2 to 20 N, 4 to 7.4 N s/m and 255 to 1255 N/m (Hajian and Howe,
    /// J. Biomechanical Engineering 119, 1997, as it is commonly quoted).
    pub fn loose(target: HandTarget) -> Self {
        Self { mass: 0.1, damping: 2.0, stiffness: 100.0, target }
    }

    /// A hand that grips: 0.3 kg, 10 N s/m, 800 N/m.
    pub fn firm(target: HandTarget) -> Self {
        Self { mass: 0.3, damping: 10.0, stiffness: 800.0, target }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known;

    #[test]
    fn every_known_device_has_mechanics_that_suit_its_stiffness() {
        assert_eq!(ALL.map(|(name, _)| name), known::ALL.map(|(name, _)| name));
        for (name, limits) in known::ALL {
            let tip = mechanics(name).expect("a known device");
            assert!((tip.damping - limits.max_stiffness * 0.5e-3).abs() < 1e-12, "{name}");
            // Abbott and Okamura: friction holds a step of the encoder.
            assert!(2.0 * tip.dry_friction / tip.encoder_step > limits.max_stiffness, "{name}");
        }
        assert_eq!(mechanics("none"), None);
    }
}
