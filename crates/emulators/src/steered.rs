//! A tip that a simulated hand holds, until a test puts it somewhere.

use std::env;

use glam::{DQuat, DVec3};
use palpate_devices::emulated::{Hand, Mechanics, Tip as FreeTip, Wanted, Waypoint};

use crate::conformance::Tip;

/// Environment variable that leads the hand: `time x y z; ...` in s and mm, right, away and up from the middle of the workspace.
/// At the end it begins anew. A single place is held loosely.
pub const HAND_VARIABLE: &str = "PALPATE_EMULATED_HAND";

/// What the hand does when nobody leads it: it comes down, presses, slides to the right and goes up again.
const PRESS_AND_SLIDE: &str = "0 0 0 20; 1 0 0 20; 2 0 0 -10; 3 20 0 -10; 4 20 0 20; 5 0 0 20";

/// How long the hand goes on, s: a day would be waypoints without end.
const ENOUGH: f64 = 3600.0;

/// A tip whose time goes on by [`SteeredTip::advance`].
pub struct SteeredTip {
    free: FreeTip,
    /// Where a test has put it, and when.
    put: Option<(Tip, f64)>,
}

impl SteeredTip {
    /// Held by a hand.
    pub fn new(mechanics: Mechanics, hand: Hand) -> Self {
        let start = hand.wanted.at(0.0);
        Self { free: FreeTip::new(mechanics, start, Some(hand)), put: None }
    }

    /// Puts it somewhere, from where it goes on evenly; no force moves it any more.
    pub fn put(&mut self, tip: Tip) {
        self.put = Some((tip, self.free.time()));
    }

    /// Whether a test has put it somewhere.
    pub fn is_put(&self) -> bool {
        self.put.is_some()
    }

    /// Force of the motors, N.
    pub fn write(&mut self, force: DVec3) {
        if self.put.is_none() {
            self.free.write(force);
        }
    }

    /// Moves on by a time, s.
    pub fn advance(&mut self, seconds: f64) {
        self.free.advance(seconds);
    }

    /// What its device measures now; to be asked once a tick.
    pub fn measure(&mut self) -> Tip {
        match self.put {
            Some((tip, since)) => {
                let time = self.free.time() - since;
                let turned = DQuat::from_scaled_axis(tip.angular_velocity * time);
                Tip {
                    position: tip.position + tip.velocity * time,
                    orientation: (turned * tip.orientation).normalize(),
                    ..tip
                }
            }
            None => {
                let measured = self.free.measure();
                Tip { velocity: measured.velocity, ..Tip::at(measured.position) }
            }
        }
    }
}

/// The hand that [`HAND_VARIABLE`] leads, or the usual one. What cannot be read is said on the error stream, once.
pub fn hand_from_environment() -> Hand {
    let asked = env::var(HAND_VARIABLE).unwrap_or_else(|_| PRESS_AND_SLIDE.to_owned());
    let waypoints = parse(&asked).unwrap_or_else(|wrong| {
        eprintln!(
            "{HAND_VARIABLE}: {wrong:?} is not \"time x y z\" in s and mm with times that grow: the usual hand is used"
        );
        parse(PRESS_AND_SLIDE).unwrap_or_default()
    });
    match waypoints[..] {
        // One that goes nowhere lets itself be moved, as for a check of the device.
        [only] => Hand::loose(Wanted::At(only.position)),
        _ => Hand::firm(Wanted::Along(repeated(&waypoints))),
    }
}

/// Waypoints, or the part that is none.
fn parse(text: &str) -> Result<Vec<Waypoint>, String> {
    let mut waypoints: Vec<Waypoint> = Vec::new();
    for part in text.split(';').map(str::trim).filter(|part| !part.is_empty()) {
        let numbers: Vec<f64> = part.split_whitespace().filter_map(|number| number.parse().ok()).collect();
        let last = waypoints.last().map_or(-1.0, |waypoint| waypoint.time);
        match numbers[..] {
            [time, x, y, z] if time > last && time.is_finite() => {
                waypoints.push(Waypoint { time, position: 1e-3 * DVec3::new(x, y, z) });
            }
            _ => return Err(part.to_owned()),
        }
    }
    if waypoints.is_empty() { Err(text.to_owned()) } else { Ok(waypoints) }
}

/// Over and over again.
fn repeated(waypoints: &[Waypoint]) -> Vec<Waypoint> {
    let length = waypoints.last().map_or(0.0, |last| last.time);
    if length == 0.0 {
        return waypoints.to_vec();
    }
    let mut all = waypoints.to_vec();
    for round in 1..=(ENOUGH / length) as usize {
        let begins = round as f64 * length;
        let later = waypoints.iter().map(|waypoint| Waypoint { time: begins + waypoint.time, ..*waypoint });
        // The end of a round is the beginning of the next.
        all.extend(later.filter(|waypoint| waypoint.time > begins));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const MECHANICS: Mechanics =
        Mechanics { mass: 0.1, damping: 0.5, dry_friction: 0.0, encoder_step: 0.0, delay: 0.0 };

    #[test]
    fn the_hand_goes_where_the_text_leads_it_again_and_again() {
        let hand = Hand::firm(Wanted::Along(repeated(&parse("0 0 0 20; 1 0 5 20; 3 0 0 20").expect("waypoints"))));
        for (time, y) in [(1.0, 5e-3), (3.0, 0.0), (4.0, 5e-3), (301.0, 5e-3)] {
            assert!((hand.wanted.at(time) - DVec3::new(0.0, y, 0.02)).length() < 1e-9, "{time}");
        }
        let mut tip = SteeredTip::new(MECHANICS, hand);
        tip.advance(1.0);
        assert!((tip.measure().position.z - 0.02).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_waypoint_is_named() {
        for (text, wrong) in [("0 1 2", "0 1 2"), ("0 0 0 0; 0 1 1 1", "0 1 1 1"), ("0 a 0 0", "0 a 0 0"), ("", "")] {
            assert_eq!(parse(text), Err(wrong.to_owned()));
        }
    }

    #[test]
    fn a_tip_that_is_put_stays_or_goes_on_evenly() {
        let mut tip = SteeredTip::new(MECHANICS, Hand::firm(Wanted::At(DVec3::ZERO)));
        tip.put(Tip { velocity: DVec3::X, angular_velocity: DVec3::Z, ..Tip::at(DVec3::Y) });
        tip.write(1e3 * DVec3::Z);
        tip.advance(0.5);
        let measured = tip.measure();
        assert!((measured.position - DVec3::new(0.5, 1.0, 0.0)).length() < 1e-12);
        assert!(measured.orientation.angle_between(DQuat::from_rotation_z(0.5)) < 1e-6);
    }
}
