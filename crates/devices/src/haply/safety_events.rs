//! The channel of events (3.4 and later): the arm's own safety stages. Without it the driver works as well.

use std::net::SocketAddr;

use serde_json::Value;
use tungstenite::http::Uri;

use super::entries;
use super::socket::Socket;

/// Most events taken at once: the thread has a device to serve.
const MAX_EVENTS: usize = 16;

/// What the arm's safety has done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SafetyEvent {
    /// The brake holds the arm until it is released.
    Braked,
    /// The brake is released.
    Released,
    /// Another stage has taken forces off.
    Triggered,
}

/// The event in a message, if it is one of safety for the arm with an identity; one that names no arm is for all.
pub fn parse(text: &str, id: &str) -> Option<SafetyEvent> {
    let event: Value = entries::parse(text).ok()?;
    if event.get("name")?.as_str()? != "device-safety-triggered" {
        return None;
    }
    let data = event.get("data").unwrap_or(&Value::Null);
    if entries::id(data).is_some_and(|named| named != id) {
        return None;
    }
    Some(match data.get("safety_type").and_then(Value::as_str) {
        Some("ebrake_triggered") => SafetyEvent::Braked,
        Some("ebrake_released") => SafetyEvent::Released,
        _ => SafetyEvent::Triggered,
    })
}

/// The channel, if there is one.
pub struct SafetyEvents {
    socket: Option<Socket>,
    id: String,
    braked: bool,
}

impl SafetyEvents {
    /// For an arm. A service without the channel is as good.
    pub fn connect(channel: Option<(&[SocketAddr], &Uri)>, id: &str) -> Self {
        let socket = channel.and_then(|(addresses, uri)| Socket::connect(addresses, uri).ok());
        Self { socket, id: id.into(), braked: false }
    }

    /// Takes up what has come; whether the arm has taken forces off since the last call, or holds its brake.
    pub fn motors_off(&mut self) -> bool {
        let mut triggered = false;
        for _ in 0..MAX_EVENTS {
            let Some(socket) = &mut self.socket else { break };
            match socket.poll() {
                Ok(Some(text)) => match parse(&text, &self.id) {
                    Some(SafetyEvent::Braked) => (self.braked, triggered) = (true, true),
                    Some(SafetyEvent::Released) => self.braked = false,
                    Some(SafetyEvent::Triggered) => triggered = true,
                    None => {}
                },
                Ok(None) => break,
                // Whether it brakes is not known any more; its status still is.
                Err(_) => (self.socket, self.braked) = (None, false),
            }
        }
        triggered || self.braked
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_of_safety_for_this_arm() {
        let event = |id: &str, kind: &str| {
            format!(
                r#"{{"name":"device-safety-triggered","level":"critical","data":{{"device_id":{id},"safety_type":{kind}}}}}"#
            )
        };
        for (text, expected) in [
            (event("\"049D\"", "\"ebrake_triggered\""), Some(SafetyEvent::Braked)),
            (event("\"049D\"", "\"ebrake_released\""), Some(SafetyEvent::Released)),
            (event("\"049D\"", "\"stall_detected\""), Some(SafetyEvent::Triggered)),
            (event("\"0A01\"", "\"ebrake_triggered\""), None),
            (event("null", "7"), Some(SafetyEvent::Triggered)),
            (r#"{"name":"device-safety-triggered"}"#.into(), Some(SafetyEvent::Triggered)),
            (r#"{"name":"device-connected","data":{"device_id":"049D"}}"#.into(), None),
            ("{".into(), None),
            ("[1]".into(), None),
        ] {
            assert_eq!(parse(&text, "049D"), expected, "{text}");
        }
    }
}
