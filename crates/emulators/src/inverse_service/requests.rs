//! Parsing of clients' messages; keys that the service does not accept become complaints.

use glam::DVec3;
use serde_json::{Map, Value};

use super::release::Release;

/// What a message asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// Of each device it names, in their order; two entries of a device are one.
    pub devices: Vec<DeviceRequest>,
    /// Whether the reply is a full state.
    pub full_state: bool,
    /// Name of the session in the vendor's hub.
    pub profile: Option<String>,
    /// Basis of the session.
    pub basis: Option<String>,
    /// What of the message the service would not take; it works with the rest.
    pub complaints: Vec<String>,
}

/// What a message asks of an arm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeviceRequest {
    /// Its identity.
    pub id: String,
    /// Force to put out, N.
    pub force: Option<DVec3>,
    /// Whether it is addressed at all.
    pub probe: bool,
    /// Preset of its mounting.
    pub preset: Option<String>,
}

/// Keys of commands that this emulator takes as a probe: their motion is none of its business.
const OTHER_COMMANDS: [&str; 8] = [
    "probe_position",
    "probe_cursor_position",
    "probe_angular_position",
    "probe_orientation",
    "set_cursor_position",
    "set_angular_torques",
    "set_angular_position",
    "set_transform",
];
const CONFIGURES: [&str; 6] = ["preset", "basis", "mount", "damping", "force_gate", "navigation"];
/// Largest number of devices in a message that is looked at.
const MOST_DEVICES: usize = 64;

struct Reader {
    release: Release,
    request: Request,
}

impl Request {
    /// Of a message. Nothing in it can make this fail: what cannot be understood is complained about.
    pub fn parse(text: &str, release: Release) -> Self {
        let mut reader = Reader { release, request: Request::default() };
        match serde_json::from_str(text) {
            Ok(Value::Object(message)) => reader.message(&message),
            Ok(_) => reader.complain("message", "is no object"),
            Err(error) => reader.complain("message", &error.to_string()),
        }
        reader.request
    }
}

impl Reader {
    fn complain(&mut self, what: &str, why: &str) {
        self.request.complaints.push(format!("{what} {why}"));
    }

    fn message(&mut self, message: &Map<String, Value>) {
        for (key, value) in message {
            match (key.as_str(), value) {
                ("session", Value::Object(session)) => self.session(session),
                ("inverse3", Value::Array(entries)) => {
                    entries.iter().take(MOST_DEVICES).for_each(|entry| self.device(entry));
                }
                ("verse_grip" | "wireless_verse_grip" | "custom_verse_grip", Value::Array(_)) => {}
                _ => self.complain(key, "is unknown or of the wrong type"),
            }
        }
    }

    fn session(&mut self, session: &Map<String, Value>) {
        for (key, value) in session {
            match (key.as_str(), value) {
                ("force_render_full_state", Value::Object(_)) => self.request.full_state = true,
                ("configure", Value::Object(configure)) => {
                    for (key, value) in configure {
                        let text = |name: &str| value.get(name).and_then(Value::as_str).map(String::from);
                        match (key.as_str(), text("name"), text("permutation")) {
                            ("profile", Some(name), _) => self.request.profile = Some(name),
                            ("basis", _, Some(permutation)) => self.request.basis = Some(permutation),
                            _ => self.complain(key, "is no configuration of a session"),
                        }
                    }
                }
                _ => self.complain(key, "is unknown in a session"),
            }
        }
    }

    fn device(&mut self, entry: &Value) {
        let Some(id) = entry.get("device_id").and_then(Value::as_str) else {
            return self.complain("inverse3", "has an entry without device_id");
        };
        let devices = &mut self.request.devices;
        let rank = devices.iter().position(|known| known.id == id).unwrap_or_else(|| {
            devices.push(DeviceRequest { id: id.into(), ..DeviceRequest::default() });
            devices.len() - 1
        });
        for (key, value) in entry.as_object().into_iter().flatten() {
            match (key.as_str(), value) {
                ("device_id", _) => {}
                ("commands", Value::Object(commands)) => self.commands(rank, commands),
                ("configure", Value::Object(configure)) => self.configure(rank, configure),
                _ => self.complain(key, "is unknown of a device"),
            }
        }
    }

    fn commands(&mut self, rank: usize, commands: &Map<String, Value>) {
        if commands.contains_key("set_cursor_force") && commands.contains_key("set_cursor_position") {
            return self.complain("commands", "ask for a force and a position at once");
        }
        for (key, value) in commands {
            self.request.devices[rank].probe = true;
            match key.as_str() {
                "set_cursor_force" => self.force(rank, value),
                other if OTHER_COMMANDS.contains(&other) => {}
                other => self.complain(other, "is no command"),
            }
        }
    }

    fn force(&mut self, rank: usize, command: &Value) {
        for key in command.as_object().into_iter().flatten().map(|(key, _)| key.as_str()) {
            if key != "execute" && !self.release.force_keys().contains(&key) {
                self.complain(key, "is unknown of set_cursor_force");
            }
        }
        let Some(vector) = self.release.force_keys().iter().find_map(|key| command.get(key)) else {
            return self.complain("set_cursor_force", "has no vector");
        };
        let [x, y, z] = ["x", "y", "z"].map(|axis| vector.get(axis).and_then(Value::as_f64));
        let (Some(x), Some(y), Some(z)) = (x, y, z) else {
            return self.complain("set_cursor_force", "has a vector without three numbers");
        };
        if command.get("execute").and_then(Value::as_bool) != Some(false) {
            self.request.devices[rank].force = Some(DVec3::new(x, y, z));
        }
    }

    fn configure(&mut self, rank: usize, configure: &Map<String, Value>) {
        if configure.contains_key("preset") && configure.contains_key("mount") {
            return self.complain("configure", "has a preset and a mount: ambiguous");
        }
        for (key, value) in configure {
            let is_known = self.release.has_presets() && CONFIGURES.contains(&key.as_str());
            match (is_known, key.as_str(), value.get("preset").and_then(Value::as_str)) {
                (true, "preset", Some(name)) => self.request.devices[rank].preset = Some(name.into()),
                (true, "preset", None) => self.complain("preset", "has no name"),
                (true, ..) => {}
                (false, other, _) => self.complain(other, "is no configuration of a device"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(text: &str, release: Release) -> (Option<DVec3>, usize) {
        let request = Request::parse(text, release);
        (request.devices.first().and_then(|device| device.force), request.complaints.len())
    }

    #[test]
    fn forces_of_both_dialects() {
        let values =
            r#"{"inverse3":[{"device_id":"0A01","commands":{"set_cursor_force":{"values":{"x":1,"y":0,"z":-2.5}}}}]}"#;
        let vector = values.replace("values", "vector");
        let expected = Some(DVec3::new(1.0, 0.0, -2.5));
        assert_eq!(force(values, Release::V31), (expected, 0));
        assert_eq!(force(values, Release::V35), (expected, 0));
        assert_eq!(force(&vector, Release::V35), (expected, 0));
        // An unknown key is ignored, and its force with it.
        assert_eq!(force(&vector, Release::V34), (None, 2));
        let dry_run = values.replace(r#"{"values""#, r#"{"execute":false,"values""#);
        assert_eq!(force(&dry_run, Release::V35), (None, 0));
    }

    #[test]
    fn two_entries_of_a_device_are_one() {
        let text = r#"{"inverse3":[{"device_id":"0A01","commands":{"probe_position":{}}},
            {"device_id":"0A01","commands":{"set_cursor_force":{"values":{"x":0,"y":1,"z":0}}}}]}"#;
        let request = Request::parse(text, Release::V35);
        assert_eq!(request.devices.len(), 1);
        assert_eq!((request.devices[0].probe, request.devices[0].force), (true, Some(DVec3::Y)));
        assert_eq!(request.complaints, Vec::<String>::new());
    }

    #[test]
    fn what_is_ambiguous_or_unknown_is_complained_about() {
        for text in [
            "{",
            "[]",
            r#"{"inverse":[]}"#,
            r#"{"inverse3":{}}"#,
            r#"{"inverse3":[{}]}"#,
            r#"{"session":{"name":1}}"#,
            r#"{"inverse3":[{"device_id":"0A01","configure":{"preset":{"preset":"arm_front"},"mount":{"transform":{}}}}]}"#,
            r#"{"inverse3":[{"device_id":"0A01","commands":{"set_cursor_force":{"values":{"x":1}}}}]}"#,
            r#"{"inverse3":[{"device_id":"0A01","commands":{"set_cursor_force":{},"set_cursor_position":{}}}]}"#,
        ] {
            assert!(!Request::parse(text, Release::V35).complaints.is_empty(), "{text}");
        }
        assert_eq!(Request::parse("{}", Release::V35), Request::default());
        let presets = r#"{"inverse3":[{"device_id":"0A01","configure":{"preset":{"preset":"arm_front_centered"}}}]}"#;
        assert_eq!(Request::parse(presets, Release::V34).complaints.len(), 1);
        let request = Request::parse(presets, Release::V35);
        assert_eq!(request.devices[0].preset.as_deref(), Some("arm_front_centered"));
    }
}
