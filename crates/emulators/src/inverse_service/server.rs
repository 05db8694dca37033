//! The service as a whole: its sockets, and what a test does to it.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use palpate_devices::{Buttons, emulated};
use serde_json::json;

use super::arm::{Arm, Condition};
use super::grip::{Grip, GripKind};
use super::motion::{Held, Motion};
use super::persona::Persona;
use super::session;
use super::shared::{Shared, locked};
use super::steering::{MotorForce, TestEnd, ends};
use super::trouble::Trouble;
use super::world::World;

/// Time between two looks for clients.
const LOOK: Duration = Duration::from_millis(2);
/// Longest time to wait for what a client wants.
const PATIENCE: Duration = Duration::from_millis(500);

/// What to emulate.
pub struct Options {
    /// Port of the simulation channel and of HTTP; 0 for a free one.
    pub port: u16,
    /// Port of the channel of events; 0 for a free one.
    pub events_port: u16,
    /// The release.
    pub persona: Persona,
    /// Time after which a command that is not repeated ends. UNVERIFIED: the vendor states none.
    pub idle_timeout: Duration,
    /// Largest force of the motors an axis, N. UNVERIFIED: that of other programs.
    pub max_force: f64,
    /// Shortest time from a message to its reply.
    pub latency: Duration,
    /// By how much it may be longer.
    pub jitter: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: 0,
            events_port: 0,
            persona: Persona::V35,
            idle_timeout: Duration::from_millis(100),
            max_force: 10.0,
            latency: Duration::ZERO,
            jitter: Duration::ZERO,
        }
    }
}

/// A running service. It ends when it is dropped.
pub struct InverseService {
    shared: Arc<Shared>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    address: SocketAddr,
    events: SocketAddr,
    began: Instant,
    /// To the arms.
    ends: Mutex<BTreeMap<String, TestEnd>>,
}

impl InverseService {
    /// Starts one without devices.
    ///
    /// # Errors
    /// A port that is taken.
    pub fn start(options: &Options) -> io::Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", options.port))?;
        let events_listener = TcpListener::bind(("127.0.0.1", options.events_port))?;
        let (address, events) = (listener.local_addr()?, events_listener.local_addr()?);
        let began = Instant::now();
        let mut world = World::new(options.persona, began);
        (world.idle_timeout, world.max_force) = (options.idle_timeout, options.max_force);
        let shared = Arc::new(Shared::new(world, options.latency, options.jitter));
        let stop = Arc::new(AtomicBool::new(false));
        let mut service = Self { shared, stop, threads: Vec::new(), address, events, began, ends: Mutex::default() };
        service.listen(listener, |stream, shared| {
            thread::spawn(move || {
                if !answer_http(&stream) {
                    session::serve(stream, &shared);
                }
            });
        })?;
        service.listen(events_listener, |stream, shared| {
            let timeouts =
                stream.set_read_timeout(Some(PATIENCE)).and_then(|()| stream.set_write_timeout(Some(PATIENCE)));
            if let (Ok(()), Ok(socket)) = (timeouts, tungstenite::accept(stream)) {
                locked(&shared.listeners).push(socket);
            }
        })?;
        Ok(service)
    }

    fn listen(&mut self, listener: TcpListener, serve: fn(TcpStream, Arc<Shared>)) -> io::Result<()> {
        listener.set_nonblocking(true)?;
        let (shared, stop) = (self.shared.clone(), self.stop.clone());
        self.threads.push(thread::spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) if stream.set_nonblocking(false).is_ok() => serve(stream, shared.clone()),
                    Err(error) if error.kind() != ErrorKind::WouldBlock => return,
                    _ => thread::sleep(LOOK),
                }
            }
        }));
        Ok(())
    }

    /// Address for a driver: with the port of the channel of events.
    pub fn address(&self) -> String {
        format!("ws://{}?events={}", self.address, self.events.port())
    }

    /// Adds an arm that a test holds in the middle of its workspace.
    pub fn add_held_arm(&self, id: &str, kind: &'static str) {
        self.add(id, kind, Motion::Held(Held::at(glam::DVec3::ZERO), self.began.elapsed().as_secs_f64()));
    }

    /// Adds an arm that its mechanics and a hand move, in metres from the middle of its workspace.
    pub fn add_arm(&self, id: &str, kind: &'static str, tip: emulated::Tip) {
        self.add(id, kind, Motion::Free(Box::new(tip)));
    }

    fn add(&self, id: &str, kind: &'static str, motion: Motion) {
        let (test_end, arm_end) = ends(self.began);
        locked(&self.ends).insert(id.into(), test_end);
        locked(&self.shared.world).arms.push(Arm::new((id, kind), motion, (self.began, arm_end)));
    }

    /// Adds a grip that is paired with an arm.
    pub fn add_grip(&self, id: &str, kind: GripKind, arm: &str) {
        locked(&self.shared.world).grips.push(Grip::new(id, kind, arm));
    }

    /// Holds the tip of an arm somewhere.
    ///
    /// # Panics
    /// No such arm.
    pub fn hold(&self, id: &str, held: Held) {
        let since = self.began.elapsed().as_secs_f64();
        locked(&self.ends).get_mut(id).expect("an arm of the emulator").hold(held, since);
    }

    /// Holds buttons of a grip.
    pub fn press(&self, id: &str, buttons: Buttons) {
        self.change_grip(id, |grip| grip.buttons = buttons);
    }

    /// Wakes a grip, or lets it sleep.
    pub fn wake(&self, id: &str, awake: bool) {
        self.change_grip(id, |grip| grip.awake = awake);
    }

    /// Changes what the status of an arm says; its cable aside.
    pub fn set_condition(&self, id: &str, condition: Condition) {
        self.change_arm(id, |arm| {
            let plugged = arm.condition.plugged;
            arm.condition = Condition { plugged, ..condition };
            arm.release();
        });
    }

    /// Puts the cable of an arm in or out.
    pub fn plug(&self, id: &str, plugged: bool) {
        locked(&self.shared.world).plug(id, plugged);
        self.shared.send_events();
    }

    /// The arm's own safety does something, by the name that the service has for it.
    pub fn trigger_safety(&self, id: &str, kind: &str) {
        let data = json!({"device_family": "inverse3", "device_id": id, "safety_type": kind});
        locked(&self.shared.world).announce("device-safety-triggered", "critical", data);
        self.shared.send_events();
    }

    /// From now on replies are wrong, or right again.
    pub fn set_trouble(&self, trouble: Option<Trouble>) {
        locked(&self.shared.world).trouble = trouble;
    }

    /// From now on it is another release.
    pub fn set_persona(&self, persona: Persona) {
        locked(&self.shared.world).persona = persona;
    }

    /// Ends all connections, as a service that starts anew.
    pub fn drop_connections(&self) {
        self.shared.next_generation();
        locked(&self.shared.listeners).clear();
    }

    /// What the motors of an arm put out now.
    ///
    /// # Panics
    /// No such arm.
    pub fn motors(&self, id: &str) -> MotorForce {
        locked(&self.ends).get_mut(id).expect("an arm of the emulator").motors()
    }

    /// All forces that have been on the motors of an arm since the last call, oldest first.
    ///
    /// # Panics
    /// No such arm.
    pub fn take_changes(&self, id: &str) -> Vec<MotorForce> {
        self.change_arm(id, |arm| std::mem::take(&mut arm.changes)).expect("an arm of the emulator")
    }

    /// How many commands to an arm were larger than its motors.
    ///
    /// # Panics
    /// No such arm.
    pub fn clamped(&self, id: &str) -> u64 {
        self.change_arm(id, |arm| arm.clamped).expect("an arm of the emulator")
    }

    /// What clients sent since the last call that the service would not take.
    pub fn take_complaints(&self) -> Vec<String> {
        std::mem::take(&mut locked(&self.shared.world).complaints)
    }

    /// Messages taken since the start.
    pub fn messages(&self) -> u64 {
        locked(&self.shared.world).messages
    }

    /// Names of the sessions that are open.
    pub fn profiles(&self) -> Vec<Option<String>> {
        locked(&self.shared.world).sessions.values().map(|session| session.profile.clone()).collect()
    }

    fn change_arm<R>(&self, id: &str, change: impl FnOnce(&mut Arm) -> R) -> Option<R> {
        let mut world = locked(&self.shared.world);
        world.advance();
        world.arm(id).map(change)
    }

    fn change_grip(&self, id: &str, change: impl FnOnce(&mut Grip)) {
        let mut world = locked(&self.shared.world);
        world.grips.iter_mut().find(|grip| grip.id == id).map(change);
    }
}

impl Drop for InverseService {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.drop_connections();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Answers `GET /version`, which comes to the same port; whether it was that.
fn answer_http(stream: &TcpStream) -> bool {
    const ASKED: &[u8] = b"GET /version ";
    let mut head = [0; ASKED.len()];
    let mut stream = stream;
    if stream.set_read_timeout(Some(PATIENCE)).is_err() || stream.peek(&mut head).is_err() || head != ASKED {
        return false;
    }
    let body = json!({"project_name": "haply-inverse-service", "project_version": "emulated"}).to_string();
    let length = body.len();
    let _ = write!(
        stream,
        "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
    );
    // What is not read would cut the answer off.
    let _ = stream.read(&mut [0; 4096]);
    true
}
