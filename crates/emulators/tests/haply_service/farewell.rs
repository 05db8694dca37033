//! The last message to a service whose replies cannot be parsed takes the force off: it may still act on it.

use std::io::Write;
use std::net::TcpListener;
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::haply::open;
use palpate_devices::{Connection, Wrench};
use serde_json::{Value, json};
use tungstenite::Message;

use super::{ARM, alone};

/// Answers as a service of one arm does until it is told of a force, then by a frame that no websocket has; the forces of
/// which it is told after that.
fn forces_after_nonsense(listener: TcpListener) -> Vec<Value> {
    let (stream, _) = listener.accept().expect("the driver");
    // Nobody listens when it connects again.
    drop(listener);
    let mut socket = tungstenite::accept(stream).expect("a handshake");
    let at_rest = json!({"x": 0, "y": 0, "z": 0});
    let state = json!({"cursor_position": at_rest, "cursor_velocity": at_rest});
    let reply = json!({"inverse3": [{"device_id": ARM, "state": state}]}).to_string();
    let force_in = |text: &str| {
        let message: Value = serde_json::from_str(text).expect("JSON");
        message.pointer("/inverse3/0/commands/set_cursor_force/values/z").cloned()
    };
    let mut force = None;
    while force != Some(json!(2.0)) {
        socket.send(Message::text(reply.as_str())).expect("the driver listens");
        let message = socket.read().expect("the driver speaks");
        force = force_in(message.to_text().expect("a text"));
    }
    const RESERVED_OPCODE: [u8; 2] = [0x83, 0];
    socket.get_mut().write_all(&RESERVED_OPCODE).expect("the driver listens");
    let rest = std::iter::from_fn(|| socket.read().ok());
    rest.filter_map(|message| if let Message::Text(text) = message { force_in(&text) } else { None }).collect()
}

#[test]
fn a_service_that_speaks_nonsense_is_told_to_take_the_force_off() {
    let _alone = alone();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = Some(format!("ws://{}", listener.local_addr().expect("an address")));
    let service = std::thread::spawn(move || forces_after_nonsense(listener));
    let mut device = open(&Connection { address, ..Connection::default() }).expect("the arm opens").device;
    let began = Instant::now();
    while !service.is_finished() {
        assert!(began.elapsed() < Duration::from_secs(4), "the driver keeps the connection");
        let reading = device.read(0, 1e-3);
        let _ = device
            .write(Wrench { force: if reading.is_ok() { 2.0 * DVec3::Z } else { DVec3::ZERO }, ..Wrench::default() });
        std::thread::sleep(Duration::from_millis(1));
    }
    let forces = service.join().expect("the service");
    assert_eq!(forces.last(), Some(&json!(0.0)), "{forces:?}");
}
