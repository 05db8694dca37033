//! The driver's thread: sends the latest force, receives one state and publishes it, at a fixed rate.
//!
//! The motors exert the latest force of a running loop, or zero: if the loop or the measurements stop for a few milliseconds, if a
//! reply is faulty, and finally when the device is dropped.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use glam::DVec3;
use triple_buffer::{Input, Output as Latest};
use tungstenite::Utf8Bytes;

use super::commands::{self, ForceMessage, KEEPALIVE};
use super::fault::ReplyFault;
use super::grips::GripMotion;
use super::handoff::{Clock, ForceRequest, PublishedReading};
use super::output::Output;
use super::priority;
use super::reading::parse_reading;
use super::safety_events::SafetyEvents;
use super::service::Service;
use super::snapshot::{Arm, Snapshot};
use super::socket::{Socket, SocketError};
use crate::{DeviceFault, Reading};

/// Time without a measurement after which the reading is a fault, ns; the same as in the safety stage.
pub const STALE_NS: u64 = 50_000_000;
/// Time without a reply after which the connection is closed and opened again.
const RECONNECT_AFTER: Duration = Duration::from_millis(500);
/// Messages with zero force to an arm that is missing in replies: its motors may still exert the last one.
const ABSENT_FORCES: u32 = 16;
/// Time between two messages while the arm is absent.
const ABSENT_PERIOD: Duration = Duration::from_millis(20);
/// First and longest time between two attempts to connect.
const RETRY: [Duration; 2] = [Duration::from_millis(50), Duration::from_millis(1000)];
/// Longest time for the last message, which sets the force to zero, and again for closing the connection.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(20);
/// Interval at which the channel of events is polled, ns.
const EVENTS_NS: u64 = 5_000_000;
/// Most unsolicited messages that are discarded at once.
const MAX_UNSOLICITED: usize = 64;

/// Kind of the next message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Forces, for an arm that is set up.
    Forces,
    /// Configuration of an arm that has just appeared.
    Hello,
    /// The arm has been absent for so many messages.
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
    grip_motion: GripMotion,
    output: Output,
    events: SafetyEvents,
    events_ns: u64,
    /// Latest state of the channel of events.
    motors_off: bool,
    clock: Clock,
    /// The published reading.
    pub published: PublishedReading,
    to_loop: Input<PublishedReading>,
    from_loop: Latest<ForceRequest>,
    /// The flag that stops it.
    pub stop: Arc<AtomicBool>,
    /// When the next message is due.
    due: Instant,
    period: Duration,
    /// Time from the latest message to its reply.
    pub round_trip: Duration,
}

impl Client {
    /// Client of an arm of a connected service.
    pub fn new(
        service: Service,
        socket: Socket,
        (arm, snapshot): (Arm, &Snapshot),
        clock: Clock,
        (to_loop, from_loop): (Input<PublishedReading>, Latest<ForceRequest>),
    ) -> Self {
        let period = Duration::from_secs_f64(1.0 / service.address.rate);
        Self {
            hello: commands::hello(&arm, snapshot),
            message: ForceMessage::new(&arm.id),
            events: service.safety_events(&arm.id),
            published: PublishedReading::new(Reading::default()),
            socket: Some(socket),
            phase: Phase::Hello,
            grip_motion: GripMotion::default(),
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

    /// Runs until it is stopped.
    pub fn run(mut self) {
        priority::raise();
        while !self.is_stopped() {
            match self.exchange() {
                Ok(()) => self.wait_until_due(),
                Err(_) => {
                    self.fail(DeviceFault::Disconnected);
                    self.connect_again();
                }
            }
        }
        self.close_connection();
    }

    /// Sends one message and receives its reply.
    ///
    /// # Errors
    /// A broken connection.
    pub fn exchange(&mut self) -> Result<(), SocketError> {
        self.poll_events();
        let force = self.next_force();
        let socket = self.socket.as_mut().ok_or(SocketError::Closed)?;
        // An unsolicited message left in the queue would be taken for the next reply, and delay every later one.
        let mut unsolicited = 0;
        while socket.poll()?.is_some() {
            unsolicited += 1;
            if unsolicited > MAX_UNSOLICITED {
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
        self.publish(&reply);
        Ok(())
    }

    /// Waits until the next message is due.
    pub fn wait_until_due(&mut self) {
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

    /// Waits for the reply. If it is late, an extra message sets the force to zero, and its reply is used.
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
        let mut outstanding = 2;
        while sent.elapsed() < RECONNECT_AFTER && !self.stop.load(Ordering::Relaxed) {
            let socket = self.socket.as_mut().ok_or(SocketError::Closed)?;
            match socket.receive(Instant::now() + Duration::from_nanos(STALE_NS)) {
                Ok(reply) if outstanding == 1 => return Ok(reply),
                Ok(_) => outstanding -= 1,
                Err(SocketError::TimedOut) => self.fail(DeviceFault::Stale),
                Err(error) => return Err(error),
            }
        }
        Err(SocketError::Closed)
    }

    /// Publishes the reading of a reply.
    fn publish(&mut self, reply: &str) {
        let now_ns = self.clock.now_ns();
        let parsed = parse_reading(reply, (&self.arm.id, self.arm.rank), &mut self.grip_motion, now_ns);
        match (self.phase, &parsed) {
            (Phase::Absent(messages), Err(ReplyFault::Absent)) => {
                self.phase = Phase::Absent(messages.saturating_add(1))
            }
            (_, Err(ReplyFault::Absent)) => self.phase = Phase::Absent(0),
            // The state is from before the arm was set up.
            (Phase::Absent(_), Ok(_)) => return self.phase = Phase::Hello,
            (Phase::Hello, Ok(_)) => self.phase = Phase::Forces,
            _ => {}
        }
        match parsed {
            Ok(_) if self.motors_off => self.fail(DeviceFault::MotorsOff),
            Ok(reading) => {
                self.published.succeed(reading);
                self.to_loop.write(self.published);
            }
            Err(fault) => self.fail(fault.into()),
        }
    }

    fn poll_events(&mut self) {
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
        self.close_connection();
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

    /// Sleeps, and returns early when stopped.
    fn sleep(&self, time: Duration) {
        let until = Instant::now() + time;
        while !self.is_stopped() && Instant::now() < until {
            thread::sleep(RETRY[0].min(until.saturating_duration_since(Instant::now())));
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Sets the force to zero, if the service still accepts messages, and closes the connection.
    fn close_connection(&mut self) {
        let Some(mut socket) = self.socket.take() else { return };
        if socket.send(self.message.of(DVec3::ZERO)).is_ok() {
            let _ = socket.receive(Instant::now() + CLOSE_TIMEOUT);
        }
        socket.close(Instant::now() + CLOSE_TIMEOUT);
    }
}
