//! State of the service: arms, grips, sessions, time.

use std::collections::BTreeMap;
use std::time::Instant;

use glam::DVec3;
use serde_json::{Value, json};

use super::arm::{Arm, Grip};
use super::release::Release;
use super::reply_flaw::ReplyFlaw;
use super::requests::Request;

/// Most complaints and events that are kept.
const MAX_STORED: usize = 1000;

/// A client's session.
#[derive(Clone, Debug, Default)]
pub struct Session {
    /// Its name in the vendor's hub.
    pub profile: Option<String>,
    /// Preset of each arm's mounting, by identity.
    pub presets: BTreeMap<String, String>,
    /// Basis, if it has chosen one.
    pub basis: Option<String>,
}

impl Session {
    /// Preset of an arm's mounting.
    pub fn preset(&self, arm: &str) -> &str {
        self.presets.get(arm).map_or("defaults", String::as_str)
    }
}

/// The state of the service.
pub struct World {
    /// What it speaks.
    pub release: Release,
    /// Its arms, unplugged ones too.
    pub arms: Vec<Arm>,
    /// Its grips.
    pub grips: Vec<Grip>,
    /// Open sessions by their number.
    pub sessions: BTreeMap<u64, Session>,
    /// What is wrong with its replies.
    pub reply_flaw: Option<ReplyFlaw>,
    /// What clients sent that the service would not take.
    pub complaints: Vec<String>,
    /// Events that have not been sent yet.
    pub events: Vec<Value>,
    /// Messages taken since the start.
    pub messages: u64,
    began: Instant,
    last_session: u64,
}

impl World {
    /// Without devices.
    pub fn new(release: Release, began: Instant) -> Self {
        Self {
            release,
            arms: Vec::new(),
            grips: Vec::new(),
            sessions: BTreeMap::new(),
            reply_flaw: None,
            complaints: Vec::new(),
            events: Vec::new(),
            messages: 0,
            began,
            last_session: 0,
        }
    }

    /// Time since the start, s.
    pub fn time(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// Moves everything on to now.
    pub fn advance(&mut self) {
        let now = self.time();
        self.arms.iter_mut().for_each(|arm| arm.advance(now));
    }

    /// The arm with an identity.
    pub fn arm(&mut self, id: &str) -> Option<&mut Arm> {
        self.arms.iter_mut().find(|arm| arm.id == id)
    }

    /// Begins a session: its number.
    pub fn begin_session(&mut self) -> u64 {
        self.last_session += 1;
        self.sessions.insert(self.last_session, Session::default());
        self.last_session
    }

    /// Ends a session and with it its commands.
    pub fn end_session(&mut self, number: u64) {
        self.advance();
        self.sessions.remove(&number);
        self.arms.iter_mut().filter(|arm| arm.commanded_by() == Some(number)).for_each(Arm::release);
    }

    /// A session's connection has broken off: its client should have taken its force off before.
    pub fn note_broken(&mut self, number: u64) {
        let left = self.arms.iter().filter(|arm| arm.commanded_by() == Some(number) && arm.motors.force != DVec3::ZERO);
        self.complaints.extend(left.map(|arm| format!("a connection has broken off with a force on {}", arm.id)));
    }

    /// Puts a cable in or out.
    pub fn plug(&mut self, id: &str, plugged: bool) {
        self.advance();
        let Some(arm) = self.arm(id).filter(|arm| arm.plugged != plugged) else { return };
        arm.plugged = plugged;
        arm.release();
        let data = json!({"device_family": "inverse3", "device_id": id});
        self.announce(if plugged { "device-connected" } else { "device-disconnected" }, "notice", data);
    }

    /// Puts an event on its way.
    pub fn announce(&mut self, name: &str, level: &str, data: Value) {
        if self.events.len() < MAX_STORED {
            let category = name.split('-').next().unwrap_or("system");
            self.events
                .push(json!({"name": name, "category": category, "level": level, "data": data, "message": name}));
        }
    }

    /// Does what a session's message asks for; whether the reply is a full state.
    pub fn take(&mut self, number: u64, text: &str) -> bool {
        self.advance();
        self.messages += 1;
        let request = Request::parse(text, self.release);
        for complaint in &request.complaints {
            let data = json!({"field": complaint, "reason": "not taken", "context": "simulation"});
            self.announce("invalid-value", "warning", data);
        }
        let room = MAX_STORED.saturating_sub(self.complaints.len());
        self.complaints.extend(request.complaints.iter().take(room).cloned());
        for device in &request.devices {
            self.take_device(number, device.id.as_str(), device.force, device.probe);
        }
        let Some(session) = self.sessions.get_mut(&number) else { return request.full_state };
        session.profile = request.profile.or(session.profile.take());
        session.basis = request.basis.or(session.basis.take());
        for device in request.devices {
            if let Some(preset) = device.preset {
                session.presets.insert(device.id, preset);
            }
        }
        request.full_state
    }

    fn take_device(&mut self, number: u64, id: &str, force: Option<DVec3>, probe: bool) {
        let Some(arm) = self.arm(id).filter(|arm| arm.plugged) else { return };
        if force.is_some() && arm.commanded_by().is_some_and(|other| other != number) {
            return self.announce("device-busy", "warning", json!({"device_family": "inverse3", "device_id": id}));
        }
        if let Some(force) = force {
            arm.command(number, force);
        }
        if probe {
            arm.refresh();
            let orientation = arm.measured.orientation;
            let paired = self.grips.iter_mut().filter(|grip| grip.arm == id && grip.awake);
            paired.for_each(|grip| grip.orientation = orientation);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::state::render;
    use super::super::steering::ends;
    use super::*;
    use crate::tip::SteeredTip;

    /// Takes messages whatever is in them: motors stay within their force, and states are JSON.
    fn takes(messages: &[String], release: Release) {
        let began = Instant::now();
        let mut world = World::new(release, began);
        world.arms.push(Arm::new(("0A01", "inverse3"), SteeredTip::held(), (began, ends(began).1)));
        let session = world.begin_session();
        for message in messages {
            let full = world.take(session, message);
            let force = world.arms[0].motors.force;
            assert!(force.abs().max_element() <= 10.0, "{force}");
            assert!(render(&world, session, full).get("inverse3").is_some());
        }
        world.end_session(session);
        assert_eq!(world.arms[0].motors.force, DVec3::ZERO);
    }

    fn any_release() -> impl Strategy<Value = Release> {
        prop::sample::select(Release::ALL.to_vec())
    }

    /// What a client could have meant.
    fn message() -> impl Strategy<Value = String> {
        let number = prop_oneof![
            "-?[0-9]{1,3}(e[0-9]{1,3})?",
            Just("null".to_string()),
            Just("\"1\"".into()),
            Just("{}".into())
        ];
        let key = prop::sample::select(vec!["values", "vector", "position", "execute"]);
        let command = prop::sample::select(vec!["set_cursor_force", "set_cursor_position", "probe_position", "x"]);
        let id = prop::sample::select(vec!["\"0A01\"", "\"0B02\"", "7", "null"]);
        (id, command, key, number.clone(), number).prop_map(|(id, command, key, x, y)| {
            format!(
                r#"{{"inverse3":[{{"device_id":{id},"commands":{{"{command}":{{"{key}":{{"x":{x},"y":{y},"z":0}}}}}}}}]}}"#
            )
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text(texts in prop::collection::vec(".{0,200}", 1..5), release in any_release()) {
            takes(&texts, release);
        }

        #[test]
        fn any_command(messages in prop::collection::vec(message(), 1..8), release in any_release()) {
            takes(&messages, release);
        }

        #[test]
        fn commands_cut_short(message in message(), end in any::<prop::sample::Index>(), release in any_release()) {
            takes(&[message[..end.index(message.len())].to_string()], release);
        }
    }
}
