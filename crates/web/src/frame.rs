//! The latest tick as the page draws it: its numbers as JSON, fields as arrays.

use palpate_core::simulation::{Contact, LawKind, Mode};
use palpate_scene::wxyz;
use serde_json::{Value, json};

use crate::session::Session;

/// The part of a frame message that follows from the tick; displacements and colours come as arrays.
pub fn frame(session: &mut Session) -> Value {
    let (model, missed) = (session.scene.model.clone(), session.paced.missed());
    let recorded = session.recorded().map(|(ticks, error)| json!({"ticks": ticks, "error": error}));
    let settings = session.scene.settings;
    let latest = session.latest();
    let (status, state) = (&latest.status, &latest.state);
    let mut thin = vec![false; model.tools.len()];
    for (contact, _) in state.contacts.iter().filter(|(contact, _)| is_local(contact)) {
        thin[contact.tool] |= model.bodies[contact.body].is_thin_below(contact, &model.tools[contact.tool].shape);
    }
    let tools = (0..model.tools.len()).map(|tool| {
        let device = status.readings[tool].pose;
        let limited = status.limited[tool];
        let held = state.contacts.iter().map(|(contact, _)| contact).find(|c| c.tool == tool && c.limited);
        // A tool that is limited stays where its contact has it; the device goes on.
        let position = held.map_or(device.position, |contact| {
            let placement = &model.bodies[contact.body].placement;
            placement.point_to_world(contact.anchor) + placement.vector_to_world(contact.displacement)
        });
        json!({
            "position": position.to_array(),
            "orientation": wxyz(device.orientation),
            "active": status.readings[tool].active,
            "limited": limited,
            "wanted": limited.then(|| device.position.to_array()),
            "force": status.wrenches[tool].force.to_array(),
            "refused": state.tools[tool].refused.iter().flatten().next().map(|refusal| refusal.message()),
            "thin": thin[tool],
        })
    });
    let tools: Vec<Value> = tools.collect();
    let contact = |contact: &Contact| {
        let own = |number: f64| is_local(contact).then_some(number);
        json!({
            "tool": contact.tool,
            "body": contact.body,
            "mode": if contact.mode == Mode::Grab { "grab" } else { "press" },
            "point": contact.point.to_array(),
            "normal": contact.normal.to_array(),
            "force": model.bodies[contact.body].placement.vector_to_world(contact.force).to_array(),
            "radius": own(contact.radius).unwrap_or(settings.contact_radius[contact.tool]),
            "depth": own(contact.depth),
            "stiffness": own(contact.stiffness),
            "slipping": contact.slipping,
            // A linear material states none.
            "error": (contact.error > 0.0).then_some(contact.error),
        })
    };
    let contacts: Vec<Value> = state.contacts.iter().map(|(c, _)| contact(c)).collect();
    let summary = |s: palpate_servo::Summary| json!({"p50": s.p50, "p99": s.p99, "p999": s.p999, "max": s.max});
    let times: Vec<f64> = (0..model.bodies.len()).map(|body| state.body_time(body)).collect();
    json!({
        "time": status.time,
        "tools": tools,
        "contacts": contacts,
        "compute_us": summary(status.compute),
        "wakeup_us": summary(status.wakeup),
        "ticks": status.ticks,
        "missed_deadlines": missed,
        "fault": status.fault.map(|fault| fault.to_string()),
        "realtime": false,
        "recorded": recorded,
        "body_time": times,
    })
}

/// Whether a contact follows the local law, which grabs do not.
fn is_local(contact: &Contact) -> bool {
    contact.mode == Mode::Press && contact.law == LawKind::LOCAL
}

/// Displacements of the surface of a body (3s), m, in its frame.
pub fn displacements(session: &mut Session, body: usize) -> Vec<f64> {
    let model = session.scene.model.clone();
    if body < model.bodies.len() { session.latest().state.displacements(&model, body) } else { Vec::new() }
}

/// Rows of the log since the last call: time, force of the first tool, computing time in us; of `body` its time, the
/// displacement of the watched node, and kinetic, strain and coupling energy and the work on it.
pub fn log(session: &mut Session, body: usize) -> Vec<f64> {
    let mut numbers = Vec::new();
    for row in session.rows.drain(..) {
        numbers.extend([row.time, row.force.length(), row.compute_us]);
        let energy = row.energy.get(body).copied().unwrap_or_default();
        numbers.push(row.body_time.get(body).copied().unwrap_or_default());
        numbers.extend(row.watched.unwrap_or_default().to_array());
        numbers.extend([energy.kinetic, energy.strain, energy.coupling, energy.work]);
    }
    numbers
}
