//! Full state that the service sends on connection and on request: arms, grips, and why an arm cannot be used.

use serde_json::Value;

use super::fault::ReplyFault;
use super::{entries, grips};
use crate::OpenError;

/// An arm of the service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arm {
    /// Four hexadecimal digits.
    pub id: String,
    /// Place in the service's array.
    pub rank: usize,
    /// As a person knows it.
    pub model: String,
    /// Where positions are measured from.
    pub origin: Origin,
    /// Why it cannot be used now.
    pub obstacle: Option<OpenError>,
    /// Whether another session uses it.
    pub is_in_use: bool,
    /// What else there is to know, by name.
    pub facts: Vec<(&'static str, String)>,
}

/// Where positions are measured from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A preset of 3.5, by name, which can be changed for a session.
    Preset(String),
    /// What an earlier service is set to, if it says so.
    Fixed(Option<String>),
}

impl Origin {
    /// The preset with its origin in the middle of the workspace that differs from this one in nothing else; `None` where it
    /// is there already or a person has mounted the arm in a way of its own.
    pub fn centred(&self) -> Option<&'static str> {
        match self {
            Origin::Preset(name) => match name.as_str() {
                "defaults" | "arm_front" => Some("arm_front_centered"),
                "led_front" => Some("led_front_centered"),
                _ => None,
            },
            Origin::Fixed(_) => None,
        }
    }
}

/// Where a session of ours has it.
impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = match self {
            Origin::Preset(name) => self.centred().unwrap_or(name),
            Origin::Fixed(name) => name.as_deref().unwrap_or("device_base"),
        };
        match name {
            "workspace_center" | "arm_front_centered" | "led_front_centered" => write!(f, "middle of the workspace"),
            "device_base" | "defaults" | "arm_front" | "led_front" => write!(f, "mounting face of the base"),
            other => write!(f, "of the mounting {other:?}"),
        }
    }
}

/// What the service greets with.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Its arms.
    pub arms: Vec<Arm>,
    /// Grips that are awake.
    pub grips: Vec<String>,
    /// Whether it is of 3.5 or later.
    pub has_session: bool,
    /// Basis of the session other than the service's own.
    pub other_basis: Option<String>,
}

impl Snapshot {
    /// Of a message.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, ReplyFault> {
        let message = entries::parse(text)?;
        let arms = entries::inverses(&message)?;
        let basis = message.pointer("/session/config/basis/permutation").and_then(Value::as_str);
        Ok(Self {
            arms: arms.iter().enumerate().filter_map(|(rank, entry)| arm(rank, entry)).collect(),
            grips: grips::awake(&message),
            has_session: message.get("session").is_some_and(Value::is_object),
            other_basis: basis.filter(|&basis| basis != "XYZ").map(String::from),
        })
    }
}

fn arm(rank: usize, entry: &Value) -> Option<Arm> {
    let id = entries::id(entry)?;
    let config = entry.get("config").unwrap_or(&Value::Null);
    let text = |path: &str| config.pointer(path).and_then(Value::as_str);
    let number = |path: &str| config.pointer(path).and_then(Value::as_u64);
    let kind = text("/type").or_else(|| match number("/device_info/device_type") {
        Some(6) => Some("minverse"),
        Some(4) => Some("inverse3"),
        _ => text("/device_info/device_type"),
    });
    let model = match kind.map(str::to_ascii_lowercase).as_deref() {
        Some("minverse") => "Haply Minverse".into(),
        Some("inverse3x") => "Haply Inverse3x".into(),
        None | Some("inverse3") => "Haply Inverse3".into(),
        Some(other) => format!("Haply {other}"),
    };
    let origin = match text("/preset").or(text("/preset/preset")) {
        Some(preset) => Origin::Preset(preset.into()),
        None => Origin::Fixed(text("/coordinate_origin").map(String::from)),
    };
    let mut facts = vec![("origin of positions", origin.to_string())];
    if let Some(major) = number("/device_info/major_version") {
        let minor = number("/device_info/minor_version").unwrap_or(0);
        facts.push(("firmware", format!("{major}.{minor}")));
    }
    for (name, path) in [("port", "/port"), ("handedness", "/handedness"), ("connected by", "/streaming_mode")] {
        facts.extend(text(path).map(|value| (name, value.to_string())));
    }
    let (obstacle, is_in_use) = (obstacle(&model, &id, entry), entries::flag(entry, "in_use") == Some(true));
    Some(Arm { id, rank, model, origin, obstacle, is_in_use, facts })
}

/// Why an arm cannot be used, and what to do; what has to be done first comes first.
fn obstacle(model: &str, id: &str, entry: &Value) -> Option<OpenError> {
    let (what, advice) = if entries::flag(entry, "power_supply") == Some(false) {
        ("has no power for its motors", "connect its power supply, not only USB")
    } else if entries::flag(entry, "in_use") == Some(true) {
        ("is used by another program", "close that program, or end its session in the Haply Hub")
    } else if entries::flag(entry, "calibrated") == Some(false) {
        ("is not calibrated", "put the arm into its starting position as the Haply Hub shows and wait for the light")
    } else if entries::flag(entry, "ready") == Some(false) {
        ("is not ready", "wait for it to start; if that takes longer than a minute, unplug it and plug it in again")
    } else {
        return None;
    };
    Some(OpenError::new(format!("the {model} {id} {what}"), advice))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn snapshot(entry: &Value) -> Arm {
        Snapshot::parse(&json!({"inverse3": [entry]}).to_string()).unwrap().arms[0].clone()
    }

    #[test]
    fn models_by_type_or_number() {
        for (config, model) in [
            (json!({"type": "inverse3x"}), "Haply Inverse3x"),
            (json!({"device_info": {"device_type": 6}}), "Haply Minverse"),
            (json!({"device_info": {"device_type": 4}}), "Haply Inverse3"),
            (json!({"device_info": {"device_type": "minverse"}}), "Haply Minverse"),
            (json!({}), "Haply Inverse3"),
        ] {
            assert_eq!(snapshot(&json!({"device_id": "049D", "config": config})).model, model);
        }
    }

    #[test]
    fn the_centred_preset_keeps_the_way_the_arm_stands() {
        for (preset, centred) in [
            ("defaults", Some("arm_front_centered")),
            ("arm_front", Some("arm_front_centered")),
            ("led_front", Some("led_front_centered")),
            ("led_front_centered", None),
            ("custom", None),
        ] {
            let arm = snapshot(&json!({"device_id": "049D", "config": {"preset": preset}}));
            assert_eq!(arm.origin.centred(), centred, "{preset}");
        }
        let earlier = snapshot(&json!({"device_id": "049D", "config": {"coordinate_origin": "workspace_center"}}));
        assert_eq!((earlier.origin.centred(), earlier.origin.to_string().as_str()), (None, "middle of the workspace"));
    }

    #[test]
    fn obstacles_say_what_to_do() {
        for (status, part) in [
            (json!({"power_supply": false, "calibrated": false}), "power supply"),
            (json!({"in_use": true, "calibrated": true}), "another program"),
            (json!({"calibrated": false, "ready": false}), "starting position"),
            (json!({"ready": false}), "wait"),
        ] {
            let message = snapshot(&json!({"device_id": "049D", "status": status})).obstacle.unwrap().to_string();
            assert!(message.contains(part) && message.contains("Haply Inverse3 049D"), "{message}");
        }
        let fine = json!({"in_use": false, "calibrated": true, "power_supply": true, "ready": true});
        assert_eq!(snapshot(&json!({"device_id": "049D", "status": fine})).obstacle, None);
    }

    #[test]
    fn a_service_of_3_0_is_recognised() {
        assert_eq!(Snapshot::parse(r#"{"inverse3":{"049D":{}}}"#), Err(ReplyFault::Dialect));
        assert_eq!(Snapshot::parse("[]"), Err(ReplyFault::Incomplete));
    }
}
