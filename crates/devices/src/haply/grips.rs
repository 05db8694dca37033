//! VerseGrips: orientation and buttons of the tool that the arm holds.
//!
//! The service's messages do not say which grip is paired with which arm: the order of both is taken, that of grips asleep
//! included, so that none changes its arm when another falls asleep. A single arm has the only grip that is awake. An unpaired
//! grip is not refreshed by the arm's commands.

use glam::{DQuat, DVec3};
use serde_json::Value;

use super::entries;
use super::fault::ReplyFault;
use super::numbers;
use crate::{Buttons, Pose};

/// Arrays of grips, those by radio first: an arm that has one uses it.
const ARRAYS: [&str; 3] = ["wireless_verse_grip", "verse_grip", "custom_verse_grip"];
/// Names of the buttons of all grips, in the order of our bits.
const BUTTONS: [(&str, u32); 7] = [("a", 0), ("b", 1), ("c", 2), ("up", 0), ("down", 1), ("left", 2), ("right", 3)];

/// Shortest time over which an angular velocity is taken, ns: below it is the noise of the sensor.
const SHORTEST_ANGLE_TIME_NS: u64 = 5_000_000;
/// After this time without a new orientation the grip is at rest, ns: wired grips have 50 to 60 a second.
const REST_NS: u64 = 100_000_000;

/// What a grip says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// World from grip.
    pub orientation: DQuat,
    /// Its buttons.
    pub buttons: Buttons,
}

/// Identities of the grips that are awake.
pub fn awake(message: &Value) -> Vec<String> {
    all(message).into_iter().filter_map(|(id, entry)| entry.map(|_| id)).collect()
}

/// All grips by identity, each with its entry if it is awake: one that is in two arrays counts once.
fn all(message: &Value) -> Vec<(String, Option<&Value>)> {
    let mut found: Vec<(String, Option<&Value>)> = Vec::new();
    for entry in ARRAYS.iter().filter_map(|array| message.get(array)?.as_array()).flatten() {
        let Some(id) = entries::id(entry) else { continue };
        let entry = Some(entry).filter(|entry| is_awake(entry));
        match found.iter_mut().find(|(known, _)| *known == id) {
            Some((_, known)) => *known = known.or(entry),
            None => found.push((id, entry)),
        }
    }
    found
}

fn is_awake(entry: &Value) -> bool {
    let asleep = ["connected", "awake", "ready"].iter().any(|name| entries::flag(entry, name) == Some(false));
    let error = entry.get("status").and_then(|status| status.get("error")?.as_i64());
    !asleep && error.unwrap_or(0) == 0
}

/// The grip of the arm of a rank among all arms.
///
/// # Errors
/// A number of its orientation that is none. Anything else that is wrong with a grip is as if it were not there: an arm works
/// without.
pub fn of_arm(message: &Value, rank: usize) -> Result<Option<Grip>, ReplyFault> {
    let grips = all(message);
    let own = grips.get(rank).and_then(|(_, entry)| *entry);
    let only = || {
        let mut awake = grips.iter().filter_map(|(_, entry)| *entry);
        awake.next().filter(|_| awake.next().is_none() && entries::inverses(message).is_ok_and(|arms| arms.len() == 1))
    };
    let Some(state) = own.or_else(only).and_then(|entry| entry.get("state")) else { return Ok(None) };
    match numbers::rotation(state.get("orientation")) {
        Ok(orientation) => Ok(Some(Grip { orientation, buttons: buttons(state) })),
        Err(ReplyFault::NotFinite) => Err(ReplyFault::NotFinite),
        Err(_) => Ok(None),
    }
}

fn buttons(state: &Value) -> Buttons {
    let single = u32::from(state.get("button").and_then(Value::as_bool) == Some(true));
    let held = |name: &str| state.get("buttons").and_then(|all| all.get(name)?.as_bool()) == Some(true);
    Buttons(BUTTONS.iter().fold(single, |bits, &(name, bit)| bits | u32::from(held(name)) << bit))
}

/// How the grip turns: the service does not say. Of an arm without grip, nothing turns.
#[derive(Clone, Copy, Debug)]
pub struct GripMotion {
    orientation: DQuat,
    velocity: DVec3,
    /// Latest orientation from which a velocity was taken, and when it came, ns.
    before: (DQuat, u64),
    /// When the orientation last changed, ns.
    changed_ns: u64,
}

impl Default for GripMotion {
    fn default() -> Self {
        Self { orientation: DQuat::IDENTITY, velocity: DVec3::ZERO, before: (DQuat::IDENTITY, 0), changed_ns: 0 }
    }
}

impl GripMotion {
    /// Takes up an orientation that came at `now_ns`; gives the latest one and the angular velocity, rad/s. A grip that falls
    /// asleep stays as it is.
    pub fn follow(&mut self, orientation: Option<DQuat>, now_ns: u64) -> (DQuat, DVec3) {
        let new = orientation.filter(|&new| new != self.orientation);
        if let Some(new) = new {
            let (before, before_ns) = self.before;
            let elapsed_ns = now_ns.saturating_sub(before_ns);
            if elapsed_ns > REST_NS {
                // It was at rest, or has just been heard of: this may be a jump.
                (self.velocity, self.before) = (DVec3::ZERO, (new, now_ns));
            } else if elapsed_ns >= SHORTEST_ANGLE_TIME_NS {
                let angle = Pose { position: DVec3::ZERO, orientation: new }
                    .rotation_from(&Pose { position: DVec3::ZERO, orientation: before });
                (self.velocity, self.before) = (angle / (1e-9 * elapsed_ns as f64), (new, now_ns));
            }
            (self.orientation, self.changed_ns) = (new, now_ns);
        } else if now_ns.saturating_sub(self.changed_ns) > REST_NS {
            self.velocity = DVec3::ZERO;
        }
        (self.orientation, self.velocity)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    const UNIT: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

    fn quaternion([w, x, y, z]: [f64; 4]) -> Value {
        json!({"w": w, "x": x, "y": y, "z": z})
    }

    #[test]
    fn buttons_of_all_kinds_of_grips() {
        for (state, bits) in [
            (json!({"button": true}), 1),
            (json!({"button": false}), 0),
            (json!({"buttons": {"a": true, "b": false, "c": true}}), 5),
            (json!({"buttons": {"up": false, "down": true, "left": false, "right": true}}), 10),
            (json!({"button": 1, "buttons": {"a": "true"}}), 0),
            (json!({"buttons": [true]}), 0),
        ] {
            assert_eq!(buttons(&state), Buttons(bits), "{state}");
        }
    }

    #[test]
    fn an_arm_takes_the_grip_of_its_rank() {
        let wired = json!({"device_id": 7, "status": {"ready": true, "error": 0}, "state": {"button": true, "orientation": quaternion(UNIT)}});
        let asleep = json!({"device_id": "A", "status": {"awake": false}, "state": {"orientation": quaternion(UNIT)}});
        let twice = json!({"device_id": "B", "state": {"buttons": {"b": true}, "orientation": quaternion([0.0, 1.0, 0.0, 0.0])}});
        let message =
            json!({"verse_grip": [wired], "wireless_verse_grip": [asleep, twice], "custom_verse_grip": [twice]});
        let grip = |rank| of_arm(&message, rank).unwrap();
        // That of the first arm sleeps: it has none, and takes no other's.
        assert_eq!(grip(0), None);
        assert_eq!(grip(1), Some(Grip { orientation: DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0), buttons: Buttons(2) }));
        assert_eq!(grip(2), Some(Grip { orientation: DQuat::IDENTITY, buttons: Buttons(1) }));
        assert_eq!(grip(3), None);
        assert_eq!(awake(&message), ["B", "7"]);
        let single = |arms: Value| json!({"inverse3": arms, "wireless_verse_grip": [asleep], "verse_grip": [wired]});
        let grip_of_first = |arms| of_arm(&single(arms), 0).unwrap().map(|grip| grip.buttons);
        assert_eq!(grip_of_first(json!([{}])), Some(Buttons(1)));
        assert_eq!(grip_of_first(json!([{}, {}])), None);
        let broken =
            json!({"verse_grip": [{"device_id": 1, "state": {"orientation": {"w": null, "x": 0, "y": 0, "z": 0}}}]});
        assert_eq!(of_arm(&broken, 0), Err(ReplyFault::NotFinite));
    }

    /// A steady turn seen 50 times a second by exchanges of 2 kHz, then a stop.
    #[test]
    fn angular_velocity_of_a_slow_grip() {
        let mut grip_motion = GripMotion::default();
        let (rate, mut seen) = (3.0, DVec3::ZERO);
        for step in 0..1000_u64 {
            let now = step * 500_000 + 200_000_000;
            let angle = rate * 0.02 * (step / 40) as f64;
            (_, seen) = grip_motion.follow(Some(DQuat::from_rotation_y(angle)), now);
            if step > 100 {
                assert!((seen - DVec3::Y * rate).length() < 1e-9, "{step} {seen}");
            }
        }
        let rest = grip_motion.follow(None, 1_000_000_000);
        assert_eq!(rest.1, DVec3::ZERO);
        assert_ne!(seen, DVec3::ZERO);
    }
}
