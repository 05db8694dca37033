//! Numbers as the service writes them: `0` and `0.0` are the same, and what is not a number is `null`.

use glam::{DQuat, DVec3};
use serde_json::Value;

use super::fault::ReplyFault;

/// Farthest that a tip can be from its base, m, with room: an arm reaches 0.3 m.
const FARTHEST: f64 = 10.0;
/// Fastest that a tip can move, m/s, with room.
const FASTEST: f64 = 1000.0;
/// How far the square of a quaternion's length may be from one.
const UNIT_TOLERANCE: f64 = 0.05;

/// A number.
///
/// # Errors
/// Nothing there, or something else; `null`, which is how JSON libraries write what is not finite.
fn number(value: Option<&Value>) -> Result<f64, ReplyFault> {
    match value {
        Some(Value::Number(number)) => number.as_f64().filter(|x| x.is_finite()).ok_or(ReplyFault::NotFinite),
        Some(Value::Null) => Err(ReplyFault::NotFinite),
        Some(Value::String(text)) if text.parse().is_ok_and(|x: f64| !x.is_finite()) => Err(ReplyFault::NotFinite),
        _ => Err(ReplyFault::Incomplete),
    }
}

fn vector(value: Option<&Value>, largest: f64) -> Result<DVec3, ReplyFault> {
    let value = value.ok_or(ReplyFault::Incomplete)?;
    let vector = DVec3::new(number(value.get("x"))?, number(value.get("y"))?, number(value.get("z"))?);
    if vector.abs().max_element() <= largest { Ok(vector) } else { Err(ReplyFault::OutOfRange) }
}

/// A position, m.
///
/// # Errors
/// What is wrong with it.
pub fn position(value: Option<&Value>) -> Result<DVec3, ReplyFault> {
    vector(value, FARTHEST)
}

/// A velocity, m/s.
///
/// # Errors
/// What is wrong with it.
pub fn velocity(value: Option<&Value>) -> Result<DVec3, ReplyFault> {
    vector(value, FASTEST)
}

/// A rotation.
///
/// # Errors
/// What is wrong with it; a quaternion that is no rotation, such as the zeros of a grip that has not been heard of yet, is
/// out of range.
pub fn rotation(value: Option<&Value>) -> Result<DQuat, ReplyFault> {
    let value = value.ok_or(ReplyFault::Incomplete)?;
    let [x, y, z, w] = ["x", "y", "z", "w"].map(|name| number(value.get(name)));
    let rotation = DQuat::from_xyzw(x?, y?, z?, w?);
    if (rotation.length_squared() - 1.0).abs() <= UNIT_TOLERANCE {
        Ok(rotation.normalize())
    } else {
        Err(ReplyFault::OutOfRange)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn integers_are_numbers_and_null_is_none() {
        assert_eq!(position(Some(&json!({"z": 0, "x": 1, "y": -0.5}))), Ok(DVec3::new(1.0, -0.5, 0.0)));
        for (bad, fault) in [
            (json!({"x": null, "y": 0, "z": 0}), ReplyFault::NotFinite),
            (json!({"x": "NaN", "y": 0, "z": 0}), ReplyFault::NotFinite),
            (json!({"x": "1", "y": 0, "z": 0}), ReplyFault::Incomplete),
            (json!({"x": 1, "y": 0}), ReplyFault::Incomplete),
            (json!([1, 2, 3]), ReplyFault::Incomplete),
            (json!({"x": 1e300, "y": 0, "z": 0}), ReplyFault::OutOfRange),
        ] {
            assert_eq!(position(Some(&bad)), Err(fault), "{bad}");
        }
        assert_eq!(position(None), Err(ReplyFault::Incomplete));
    }

    #[test]
    fn rotations_are_of_unit_length() {
        assert_eq!(rotation(Some(&json!({"w": 1, "x": 0, "y": 0, "z": 0}))), Ok(DQuat::IDENTITY));
        let nearly = rotation(Some(&json!({"w": 0.71, "x": 0.71, "y": 0, "z": 0}))).unwrap();
        assert!((nearly.length() - 1.0).abs() < 1e-15);
        assert_eq!(rotation(Some(&json!({"w": 0, "x": 0, "y": 0, "z": 0}))), Err(ReplyFault::OutOfRange));
        assert_eq!(rotation(Some(&json!({"w": null, "x": 0, "y": 0, "z": 0}))), Err(ReplyFault::NotFinite));
    }
}
