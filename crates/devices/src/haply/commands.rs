//! Messages to the service.
//!
//! Forces go as `{"values": {x, y, z}}`: what 3.1 to 3.4 take, and 3.5 still does; `{"vector": ...}` came with 3.5.

use std::fmt::Write;

use glam::DVec3;
use serde_json::{Value, json};

use super::snapshot::{Arm, Snapshot};

/// A tick of the service that commands nothing.
pub const KEEPALIVE: &str = "{}";
/// Name of the session in the vendor's hub.
const PROFILE: &str = "org.palpate.servo";

/// The message with which a session begins: its name, the basis x right, y away, z up, the origin in the middle of the
/// workspace where that can be chosen, and no force.
pub fn hello(arm: &Arm, snapshot: &Snapshot) -> String {
    let mut configure = json!({"profile": {"name": PROFILE}});
    if snapshot.other_basis.is_some() {
        configure["basis"] = json!({"permutation": "XYZ"});
    }
    let mut device =
        json!({"device_id": arm.id, "commands": {"set_cursor_force": {"values": {"x": 0, "y": 0, "z": 0}}}});
    if let Some(preset) = arm.origin.centred() {
        device["configure"] = json!({"preset": {"preset": preset}});
    }
    json!({"session": {"configure": configure}, "inverse3": [device]}).to_string()
}

/// Writes the messages of forces for one arm into the same memory.
pub struct ForceMessage {
    text: String,
    prefix: usize,
}

impl ForceMessage {
    /// For the arm with an identity.
    pub fn new(id: &str) -> Self {
        let id = Value::String(id.into());
        let text = format!(r#"{{"inverse3":[{{"device_id":{id},"commands":{{"set_cursor_force":{{"values":"#);
        Self { prefix: text.len(), text }
    }

    /// The message of a force, N. One that is not finite is none.
    pub fn of(&mut self, force: DVec3) -> &str {
        let DVec3 { x, y, z } = if force.is_finite() { force } else { DVec3::ZERO };
        self.text.truncate(self.prefix);
        // Rust's debug format of a finite number is JSON, exact, and short for small ones.
        let written = write!(self.text, r#"{{"x":{x:?},"y":{y:?},"z":{z:?}}}}}}}}}]}}"#);
        debug_assert!(written.is_ok(), "a string takes what is written");
        &self.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_arrive_to_the_bit() {
        let mut message = ForceMessage::new("04\"9D");
        for force in [DVec3::new(1.0, -2.5, 0.1), DVec3::new(1e-300, 1e22, -0.0), DVec3::ZERO, DVec3::MAX] {
            let value: Value = serde_json::from_str(message.of(force)).unwrap();
            let entry = &value["inverse3"][0];
            assert_eq!(entry["device_id"], "04\"9D");
            let sent = &entry["commands"]["set_cursor_force"]["values"];
            for (name, component) in [("x", force.x), ("y", force.y), ("z", force.z)] {
                assert_eq!(sent[name].as_f64().unwrap().to_bits(), component.to_bits());
            }
        }
        for force in [DVec3::new(f64::NAN, 1.0, 1.0), DVec3::new(1.0, f64::INFINITY, 1.0)] {
            let value: Value = serde_json::from_str(message.of(force)).unwrap();
            assert_eq!(value["inverse3"][0]["commands"]["set_cursor_force"]["values"]["y"], 0.0);
        }
    }
}
