//! The service: its sockets, and the functions by which a test steers it.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use palpate_devices::Buttons;
use serde_json::json;

use super::arm::{Arm, Grip};
use super::release::Release;
use super::reply_flaw::ReplyFlaw;
use super::session;
use super::shared::{Shared, locked};
use super::steering::{MotorForce, TestEnd, ends};
use super::world::World;
use crate::tip::{SteeredTip, Tip};

/// Time between two looks for clients.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
/// Longest time to wait for what a client wants.
const TIMEOUT: Duration = Duration::from_millis(500);

/// What to emulate.
#[derive(Default)]
pub struct Options {
    /// Port of the simulation channel; 0 for a free one.
    pub port: u16,
    /// Port of the channel of events; 0 for a free one.
    pub events_port: u16,
    /// The release.
    pub release: Release,
    /// Time from a message to its reply.
    pub latency: Duration,
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
        let shared = Arc::new(Shared::new(World::new(options.release, began), options.latency));
        let stop = Arc::new(AtomicBool::new(false));
        let mut service = Self { shared, stop, threads: Vec::new(), address, events, began, ends: Mutex::default() };
        service.listen(listener, |stream, shared| {
            thread::spawn(move || session::serve(stream, &shared));
        })?;
        service.listen(events_listener, |stream, shared| {
            let timeouts =
                stream.set_read_timeout(Some(TIMEOUT)).and_then(|()| stream.set_write_timeout(Some(TIMEOUT)));
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
                    _ => thread::sleep(POLL_INTERVAL),
                }
            }
        }));
        Ok(())
    }

    /// Address for a driver: with the port of the channel of events.
    pub fn address(&self) -> String {
        format!("ws://{}?events={}", self.address, self.events.port())
    }

    /// Adds an arm.
    pub fn add_arm(&self, id: &str, kind: &'static str, tip: SteeredTip) {
        let (test_end, arm_end) = ends(self.began);
        locked(&self.ends).insert(id.into(), test_end);
        locked(&self.shared.world).arms.push(Arm::new((id, kind), tip, (self.began, arm_end)));
    }

    /// Adds a grip that is paired with an arm.
    pub fn add_grip(&self, id: &str, arm: &str) {
        locked(&self.shared.world).grips.push(Grip::new(id, arm));
    }

    /// Puts the tip of an arm somewhere.
    ///
    /// # Panics
    /// No such arm.
    pub fn set_tip(&self, id: &str, tip: Tip) {
        let since = self.began.elapsed().as_secs_f64();
        locked(&self.ends).get_mut(id).expect("an arm of the emulator").put(tip, since);
    }

    /// Holds buttons of a grip.
    pub fn press(&self, id: &str, buttons: Buttons) {
        self.change_grip(id, |grip| grip.buttons = buttons);
    }

    /// Wakes a grip, or lets it sleep.
    pub fn wake(&self, id: &str, awake: bool) {
        self.change_grip(id, |grip| grip.awake = awake);
    }

    /// Lets the status of an arm say whether it is calibrated.
    pub fn set_calibrated(&self, id: &str, calibrated: bool) {
        self.change_arm(id, |arm| {
            arm.calibrated = calibrated;
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
    pub fn set_reply_flaw(&self, reply_flaw: Option<ReplyFlaw>) {
        locked(&self.shared.world).reply_flaw = reply_flaw;
    }

    /// From now on it is another release.
    pub fn set_release(&self, release: Release) {
        locked(&self.shared.world).release = release;
    }

    /// Ends all connections, as a service that starts anew.
    pub fn drop_connections(&self) {
        self.shared.drop_connections();
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
