//! Entries of one Inverse3 in the messages of the service. Every field may be missing, and keys come in any order.

use glam::DVec3;
use serde_json::Value;

use super::fault::ReplyFault;
use super::numbers;

/// A message.
///
/// # Errors
/// No JSON.
pub fn parse(text: &str) -> Result<Value, ReplyFault> {
    serde_json::from_str(text).map_err(|_| ReplyFault::Malformed)
}

/// Entries of the message's devices.
///
/// # Errors
/// None at all, or as a map: a service before 3.1.
pub fn inverses(message: &Value) -> Result<&[Value], ReplyFault> {
    match message.get("inverse3") {
        Some(Value::Array(entries)) => Ok(entries),
        Some(Value::Object(_)) => Err(ReplyFault::Dialect),
        _ => Err(ReplyFault::Incomplete),
    }
}

/// Identity of an entry's device, as text: `"049D"`, `61576`.
pub fn id(entry: &Value) -> Option<String> {
    match entry.get("device_id")? {
        Value::String(id) => Some(id.clone()),
        Value::Number(id) => Some(id.to_string()),
        _ => None,
    }
}

/// The entry of a device.
///
/// # Errors
/// A message without entries, or without the device's.
pub fn of_device<'a>(message: &'a Value, wanted: &str) -> Result<&'a Value, ReplyFault> {
    let is_wanted = |entry: &&Value| match entry.get("device_id") {
        Some(Value::String(id)) => id == wanted,
        _ => id(entry).is_some_and(|id| id == wanted),
    };
    inverses(message)?.iter().find(is_wanted).ok_or(ReplyFault::Absent)
}

/// Where the tip is and how it moves, m and m/s.
///
/// # Errors
/// What is wrong with either.
pub fn tip(entry: &Value) -> Result<(DVec3, DVec3), ReplyFault> {
    let state = entry.get("state").ok_or(ReplyFault::Incomplete)?;
    Ok((numbers::position(state.get("cursor_position"))?, numbers::velocity(state.get("cursor_velocity"))?))
}

/// A flag of the status; `None` where it is not given as one.
pub fn flag(entry: &Value, name: &str) -> Option<bool> {
    entry.get("status")?.get(name)?.as_bool()
}

/// Whether the device puts out forces, as far as it says.
///
/// # Errors
/// It does not.
pub fn check_motors(entry: &Value) -> Result<(), ReplyFault> {
    let off = ["power_supply", "calibrated", "ready"].iter().any(|name| flag(entry, name) == Some(false));
    if off { Err(ReplyFault::Unready) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_entry_of_a_device_whatever_its_place_and_the_type_of_its_id() {
        let message = json!({"inverse3": [7, {"device_id": 61576}, {"device_id": "049D", "n": 1}]});
        assert_eq!(of_device(&message, "049D").unwrap()["n"], 1);
        assert!(of_device(&message, "61576").is_ok());
        assert_eq!(of_device(&message, "0A01"), Err(ReplyFault::Absent));
        assert_eq!(of_device(&json!({}), "0A01"), Err(ReplyFault::Incomplete));
        assert_eq!(of_device(&json!({"inverse3": {"049D": {}}}), "049D"), Err(ReplyFault::Dialect));
        assert_eq!(parse("{\"inverse3\": [").unwrap_err(), ReplyFault::Malformed);
    }

    #[test]
    fn motors_are_off_only_where_the_status_says_so() {
        assert_eq!(check_motors(&json!({})), Ok(()));
        assert_eq!(check_motors(&json!({"status": {"ready": 0, "calibrated": true}})), Ok(()));
        for name in ["power_supply", "calibrated", "ready"] {
            assert_eq!(check_motors(&json!({"status": {name: false}})), Err(ReplyFault::Unready));
        }
    }
}
