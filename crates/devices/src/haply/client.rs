//! The driver's thread: sends the latest force, takes one state, publishes it, and so on.
//!
//! What stands on the motors is the latest force of a loop that goes on, or zero: zero when the loop or the measurements stop
//! for a few milliseconds, when anything is wrong with a reply, and last of all when the device is dropped.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use glam::DVec3;
use triple_buffer::{Input, Output as Latest};
use tungstenite::Utf8Bytes;

use super::commands::{self, ForceMessage, KEEPALIVE};
use super::fault::ReplyFault;
use super::grips::Turning;
use super::handoff::{Asked, Clock, Published};
use super::output::Output;
use super::priority;
use super::reading::understand;
use super::safety_events::SafetyEvents;
use super::service::Service;
use super::snapshot::{Arm, Snapshot};
use super::socket::{Socket, SocketError};
use crate::{DeviceFault, Reading};

/// After this time without a measurement the reading is a fault, ns: as long as the safety stage waits for one.
pub const STALE_NS: u64 = 50_000_000;
/// After this time without a reply the connection is given up.
const DEAD: Duration = Duration::from_millis(500);
/// Messages without force to an arm that a reply does not have: it may still have one.
const ABSENT_FORCES: u32 = 16;
/// Time between two questions for an arm that is not there.
const ABSENT_PERIOD: Duration = Duration::from_millis(20);
/// First and longest time between two attempts to connect.
const RETRY: [Duration; 2] = [Duration::from_millis(50), Duration::from_millis(1000)];
/// Longest time for the last message, which takes the force off.
const FAREWELL: Duration = Duration::from_millis(20);
/// Time between two looks at the channel of events, ns.
const EVENTS_NS: u64 = 5_000_000;
/// Most messages beyond the replies that are thrown away at once.
const MOST_UNASKED: usize = 64;

/// What to say next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The arm was there all along: forces.
    Forces,
    /// It has just come: how it is to be set.
    Hello,
    /// It is not there, for so many messages.
    Absent(u32),
}

/// The thread's side of a device.
pub struct Client {
    service: Service,
    socket: Option<Socket>,
    arm: Arm,
    hello: String,
    phase: Phase,
    message: ForceMessage,
    turning: Turning,
    output: Output,
    events: SafetyEvents,
    events_ns: u64,
    /// Latest state of the channel of events.
    motors_off: bool,
    clock: Clock,
    /// What is published.
    pub published: Published,
    to_loop: Input<Published>,
    from_loop: Latest<Asked>,
    stop: Arc<AtomicBool>,
    /// When the next message is due.
    due: Instant,
    period: Duration,
    /// From the latest message to its reply.
    pub round_trip: Duration,
}

impl Client {
    /// For an arm of a service that has been connected to.
    pub fn new(
        service: Service,
        socket: Socket,
        (arm, snapshot): (Arm, &Snapshot),
        clock: Clock,
        (to_loop, from_loop): (Input<Published>, Latest<Asked>),
    ) -> Self {
        let period = Duration::from_secs_f64(1.0 / service.address.rate);
        Self {
            hello: commands::hello(&arm, snapshot),
            message: ForceMessage::new(&arm.id),
            events: service.safety_events(&arm.id),
            published: Published::new(Reading::default()),
            socket: Some(socket),
            phase: Phase::Hello,
            turning: Turning::default(),
            output: Output::default(),
            events_ns: 0,
            motors_off: false,
            stop: Arc::default(),
            due: Instant::now(),
            round_trip: Duration::ZERO,
            service,
            arm,
            clock,
            to_loop,
            from_loop,
            period,
        }
    }

    /// The flag that ends it.
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }

    /// Until it is stopped.
    pub fn run(mut self) {
        priority::raise();
        while !self.is_stopped() {
            match self.exchange() {
                Ok(()) => self.pace(),
                Err(_) => {
                    self.fail(DeviceFault::Disconnected);
                    self.connect_again();
                }
            }
        }
        self.hang_up();
    }

    /// One message and its reply.
    ///
    /// # Errors
    /// A connection of no more use.
    pub fn exchange(&mut self) -> Result<(), SocketError> {
        self.look_at_events();
        let force = self.next_force();
        let socket = self.socket.as_mut().ok_or(SocketError::Closed)?;
        // A reply that nobody waits for would make every later one an old one.
        let mut unasked = 0;
        while socket.poll()?.is_some() {
            unasked += 1;
            if unasked > MOST_UNASKED {
                return Err(SocketError::Protocol("messages that nobody asked for".into()));
            }
        }
        let sent = Instant::now();
        socket.send(match self.phase {
            Phase::Hello => &self.hello,
            Phase::Absent(ABSENT_FORCES..) => KEEPALIVE,
            Phase::Forces | Phase::Absent(_) => self.message.of(force),
        })?;
        let reply = self.reply(sent, force)?;
        self.round_trip = sent.elapsed();
        self.take(&reply);
        Ok(())
    }

    /// Waits until the next message is due.
    pub fn pace(&mut self) {
        let now = Instant::now();
        let period = if matches!(self.phase, Phase::Absent(ABSENT_FORCES..)) { ABSENT_PERIOD } else { self.period };
        self.due = (self.due + period).max(now);
        thread::sleep(self.due - now);
    }

    /// The force for the next message.
    fn next_force(&mut self) -> DVec3 {
        let now_ns = self.clock.now_ns();
        let longest_ns = self.service.address.hold.max(2 * self.period).as_nanos() as u64;
        let age_ns = now_ns.saturating_sub(self.published.reading.timestamp_ns);
        let measured = self.published.fault.is_none() && age_ns <= longest_ns && self.phase == Phase::Forces;
        self.output.choose(self.from_loop.read(), self.published.faults, measured, now_ns)
    }

    /// Waits for the reply. Where it is late, the force is taken off by a message of its own, and the reply to that is the
    /// one that counts.
    fn reply(&mut self, sent: Instant, force: DVec3) -> Result<Utf8Bytes, SocketError> {
        let socket = self.socket.as_mut().ok_or(SocketError::Closed)?;
        match socket.receive(sent + self.service.address.hold) {
            Err(SocketError::TimedOut) => {}
            reply => return reply,
        }
        if force != DVec3::ZERO {
            self.output.withhold();
        }
        socket.send(self.message.of(DVec3::ZERO))?;
        let mut owed = 2;
        while sent.elapsed() < DEAD && !self.stop.load(Ordering::Relaxed) {
            let socket = self.socket.as_mut().ok_or(SocketError::Closed)?;
            match socket.receive(Instant::now() + Duration::from_nanos(STALE_NS)) {
                Ok(reply) if owed == 1 => return Ok(reply),
                Ok(_) => owed -= 1,
                Err(SocketError::TimedOut) => self.fail(DeviceFault::Stale),
                Err(error) => return Err(error),
            }
        }
        Err(SocketError::Closed)
    }

    /// Publishes what a reply says.
    fn take(&mut self, reply: &str) {
        let now_ns = self.clock.now_ns();
        let understood = understand(reply, (&self.arm.id, self.arm.rank), &mut self.turning, now_ns);
        match (self.phase, &understood) {
            (Phase::Absent(messages), Err(ReplyFault::Absent)) => {
                self.phase = Phase::Absent(messages.saturating_add(1))
            }
            (_, Err(ReplyFault::Absent)) => self.phase = Phase::Absent(0),
            // Its state is that of before it was set up.
            (Phase::Absent(_), Ok(_)) => return self.phase = Phase::Hello,
            (Phase::Hello, Ok(_)) => self.phase = Phase::Forces,
            _ => {}
        }
        match understood {
            Ok(_) if self.motors_off => self.fail(DeviceFault::MotorsOff),
            Ok(reading) => {
                self.published.succeed(reading);
                self.to_loop.write(self.published);
            }
            Err(fault) => self.fail(fault.into()),
        }
    }

    fn look_at_events(&mut self) {
        let now_ns = self.clock.now_ns();
        if now_ns.saturating_sub(self.events_ns) >= EVENTS_NS {
            self.events_ns = now_ns;
            self.motors_off = self.events.motors_off();
            if self.motors_off {
                self.fail(DeviceFault::MotorsOff);
            }
        }
    }

    fn fail(&mut self, fault: DeviceFault) {
        self.published.fail(fault);
        self.to_loop.write(self.published);
    }

    fn connect_again(&mut self) {
        self.hang_up();
        let [mut wait, longest] = RETRY;
        while !self.is_stopped() {
            if let Ok((socket, snapshot)) = self.service.connect() {
                self.begin_session(socket, &snapshot);
                return;
            }
            self.sleep(wait);
            wait = (2 * wait).min(longest);
        }
    }

    fn begin_session(&mut self, socket: Socket, snapshot: &Snapshot) {
        self.socket = Some(socket);
        self.phase = Phase::Absent(0);
        if let Some(arm) = snapshot.arms.iter().find(|arm| arm.id == self.arm.id) {
            self.arm = arm.clone();
            self.hello = commands::hello(arm, snapshot);
            self.phase = Phase::Hello;
        }
        self.events = self.service.safety_events(&self.arm.id);
        self.due = Instant::now();
    }

    /// Sleeps unless it is stopped.
    fn sleep(&self, time: Duration) {
        let until = Instant::now() + time;
        while !self.is_stopped() && Instant::now() < until {
            thread::sleep(RETRY[0].min(until.saturating_duration_since(Instant::now())));
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Takes the force off, which whoever sends what cannot be understood may still obey, and says goodbye.
    fn hang_up(&mut self) {
        let Some(mut socket) = self.socket.take() else { return };
        if socket.send(self.message.of(DVec3::ZERO)).is_ok() {
            let _ = socket.receive(Instant::now() + FAREWELL);
        }
        socket.close();
    }
}
