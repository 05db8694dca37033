//! The simulated hand that holds an emulated device when no test steers it.

use std::env;

use glam::DVec3;
use palpate_devices::emulated::{Hand, HandTarget, Waypoint};

/// Environment variable with the path of the hand: `time x y z; ...` in s and mm, right, away and up from the middle of the workspace.
/// At the end it begins anew. A single place is held loosely.
const HAND_VARIABLE: &str = "PALPATE_EMULATED_HAND";

/// Path of the hand where the variable is not set: it comes down, presses, slides to the right and goes up again.
const PRESS_AND_SLIDE: &str = "0 0 0 20; 1 0 0 20; 2 0 0 -10; 3 20 0 -10; 4 20 0 20; 5 0 0 20";

/// Time for which the waypoints of the hand are laid out, s.
const DURATION: f64 = 3600.0;

/// The hand on the path of `HAND_VARIABLE`, or on the usual one. Text that is not a path is reported on the error stream.
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
        [only] => Hand::loose(HandTarget::At(only.position)),
        _ => Hand::firm(HandTarget::Along(repeated(&waypoints))),
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
    for round in 1..=(DURATION / length) as usize {
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

    #[test]
    fn the_hand_goes_where_the_text_leads_it_again_and_again() {
        let target = HandTarget::Along(repeated(&parse("0 0 0 20; 1 0 5 20; 3 0 0 20").expect("waypoints")));
        for (time, y) in [(1.0, 5e-3), (3.0, 0.0), (4.0, 5e-3), (301.0, 5e-3)] {
            assert!((target.at(time) - DVec3::new(0.0, y, 0.02)).length() < 1e-9, "{time}");
        }
    }

    #[test]
    fn what_is_no_waypoint_is_named() {
        for (text, wrong) in [("0 1 2", "0 1 2"), ("0 0 0 0; 0 1 1 1", "0 1 1 1"), ("0 a 0 0", "0 a 0 0"), ("", "")] {
            assert_eq!(parse(text), Err(wrong.to_owned()));
        }
    }
}
