//! The reading in a reply.

use super::fault::ReplyFault;
use super::grips::GripMotion;
use super::{entries, grips};
use crate::{Pose, Reading, Twist};

/// The reading of the arm with an identity and a rank among all arms, in a reply that came at `now_ns`. The turning of the grip
/// is followed from reply to reply.
///
/// # Errors
/// Why there is none.
pub fn parse_reading(
    reply: &str,
    (id, rank): (&str, usize),
    grip_motion: &mut GripMotion,
    now_ns: u64,
) -> Result<Reading, ReplyFault> {
    let message = entries::parse(reply)?;
    let entry = entries::of_device(&message, id)?;
    entries::check_motors(entry)?;
    let (position, linear) = entries::tip(entry)?;
    let grip = grips::of_arm(&message, rank)?;
    let (orientation, angular) = grip_motion.follow(grip.map(|grip| grip.orientation), now_ns);
    Ok(Reading {
        pose: Pose { position, orientation },
        twist: Twist { linear, angular },
        buttons: grip.map(|grip| grip.buttons).unwrap_or_default(),
        active: true,
        timestamp_ns: now_ns,
    })
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};
    use proptest::prelude::*;
    use serde_json::{Value, json};

    use super::super::safety_events;
    use super::super::snapshot::Snapshot;
    use super::*;
    use crate::Buttons;

    /// A full state with two arms, as 3.5 has it, in the keys that the driver looks at and some that it does not.
    fn state() -> Value {
        let vector = |x: f64| json!({"z": -x, "x": x, "y": 0});
        let arm = |id: &str, x: f64| {
            json!({
                "status": {"calibrated": true, "in_use": false, "power_supply": true, "ready": true, "started": true},
                "config": {"type": "inverse3", "preset": "defaults", "device_info": {"device_type": 4, "major_version": 7}},
                "state": {"cursor_velocity": vector(-x), "cursor_position": vector(x), "transform": {}},
                "device_id": id,
            })
        };
        json!({
            "wireless_verse_grip": [{"device_id": "61575", "status": {"awake": false}}, {
                "device_id": "61576",
                "state": {"orientation": {"x": 1, "w": 0, "y": 0, "z": 0}, "buttons": {"a": true, "b": false, "c": true}},
                "status": {"awake": true, "connected": true, "ready": true},
            }],
            "verse_grip": [],
            "inverse3": [arm("049D", 0.01), arm("0A01", 0.02)],
            "session": {"config": {"basis": {"permutation": "XYZ"}}},
            "session_id": 3,
        })
    }

    fn read(text: &str) -> Result<Reading, ReplyFault> {
        parse_reading(text, ("0A01", 1), &mut GripMotion::default(), 5)
    }

    #[test]
    fn a_state_as_it_should_be() {
        let reading = read(&state().to_string()).unwrap();
        assert_eq!(reading.pose.position, DVec3::new(0.02, 0.0, -0.02));
        assert_eq!(reading.twist.linear, DVec3::new(-0.02, 0.0, 0.02));
        assert_eq!(reading.pose.orientation, DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0));
        assert_eq!((reading.buttons, reading.timestamp_ns, reading.active), (Buttons(5), 5, true));
    }

    /// Paths of all values.
    fn paths(value: &Value, at: String, found: &mut Vec<String>) {
        match value {
            Value::Object(object) => object.iter().for_each(|(key, value)| paths(value, format!("{at}/{key}"), found)),
            Value::Array(array) => {
                array.iter().enumerate().for_each(|(k, value)| paths(value, format!("{at}/{k}"), found))
            }
            _ => {}
        }
        found.push(at);
    }

    fn any_value() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            (-1.0..1.0).prop_map(Value::from),
            ".{0,8}".prop_map(Value::from),
            prop_oneof![Just("0A01"), Just("NaN"), Just("inf"), Just("-1e999")].prop_map(Value::from),
        ];
        leaf.prop_recursive(3, 16, 4, |inner| {
            let key = prop_oneof![Just("x"), Just("w"), Just("state"), Just("device_id"), Just("orientation")];
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
                prop::collection::vec((key.prop_map(String::from), inner), 0..4)
                    .prop_map(|pairs| Value::Object(pairs.into_iter().collect())),
            ]
        })
    }

    /// Nothing panics, and what is read is a place where an arm can be.
    fn nothing_breaks(text: &str) {
        if let Ok(reading) = read(text) {
            assert!(reading.pose.position.abs().max_element() <= 10.0);
            assert!(reading.twist.linear.is_finite() && reading.twist.angular.is_finite());
            assert!((reading.pose.orientation.length() - 1.0).abs() < 1e-12);
        }
        if let Ok(snapshot) = Snapshot::parse(text) {
            assert!(snapshot.arms.iter().all(|arm| !arm.model.is_empty()));
        }
        let _ = safety_events::parse(text, "0A01");
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn bytes(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            nothing_breaks(&String::from_utf8_lossy(&bytes));
        }

        #[test]
        fn values(value in any_value()) {
            nothing_breaks(&value.to_string());
        }

        #[test]
        fn states_with_other_values(changes in prop::collection::vec((any::<prop::sample::Index>(), any_value()), 1..5)) {
            let mut state = state();
            for (index, value) in changes {
                let mut all = Vec::new();
                paths(&state, String::new(), &mut all);
                let path: &String = index.get(&all);
                *state.pointer_mut(path).unwrap() = value;
            }
            nothing_breaks(&state.to_string());
        }

        #[test]
        fn states_with_wrong_bytes(
            edits in prop::collection::vec((any::<prop::sample::Index>(), 0..12_usize, "[-+0-9eE.,:\"{}\\[\\]a-z\\\\]{0,6}"), 1..6)
        ) {
            let mut text: Vec<char> = state().to_string().chars().collect();
            for (index, removed, inserted) in edits {
                let begin = index.index(text.len().max(1)).min(text.len());
                let end = (begin + removed).min(text.len());
                text.splice(begin..end, inserted.chars());
            }
            nothing_breaks(&text.into_iter().collect::<String>());
        }
    }

    #[test]
    fn depth_and_size_do_no_harm() {
        nothing_breaks(&"[".repeat(250_000));
        nothing_breaks(&format!("{}1{}", r#"{"inverse3":"#.repeat(100), "}".repeat(100)));
        nothing_breaks(&format!("[{}]", "{},".repeat(80_000)));
        nothing_breaks(&state().to_string().replace("0.02", &"9".repeat(5_000)));
    }
}
