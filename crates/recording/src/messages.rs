//! Messages of a tick in ROS 2's CDR encoding, one topic for each kind.
//!
//! `schemas` tells readers of other programs what is in them, field by field in the same order; the tests hold the two
//! together with readers that are not ours.

use glam::{DQuat, DVec3};
use palpate_core::dynamics::Energy;
use palpate_core::simulation::{MAX_TOOLS, Mode, Strike};
use palpate_devices::{Buttons, DeviceFault, Pose, Reading, Twist, Wrench};
use palpate_servo::{
    ComputedWrench, FaultReason, RecordedContact, RecordedInput, RecordedOutput, RecordedTool, Settings,
    StrainArrivals, StrainRequestId, TickRecord,
};
use serde::{Deserialize, Serialize};

/// `builtin_interfaces/Time`.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Time {
    sec: i32,
    nanosec: u32,
}

impl Time {
    pub fn from_ns(ns: u64) -> Self {
        Self { sec: (ns / 1_000_000_000) as i32, nanosec: (ns % 1_000_000_000) as u32 }
    }
}

/// `geometry_msgs/Pose`: position, orientation x y z w.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct PoseMessage([f64; 3], [f64; 4]);

/// `geometry_msgs/Twist` and `geometry_msgs/Wrench`: linear and angular.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Vectors([f64; 3], [f64; 3]);

impl From<&Pose> for PoseMessage {
    fn from(pose: &Pose) -> Self {
        Self(pose.position.to_array(), pose.orientation.to_array())
    }
}

impl From<PoseMessage> for Pose {
    fn from(PoseMessage(position, orientation): PoseMessage) -> Self {
        Self { position: position.into(), orientation: DQuat::from_array(orientation) }
    }
}

impl From<&Twist> for Vectors {
    fn from(twist: &Twist) -> Self {
        Self(twist.linear.to_array(), twist.angular.to_array())
    }
}

impl From<Vectors> for Twist {
    fn from(Vectors(linear, angular): Vectors) -> Self {
        Self { linear: linear.into(), angular: angular.into() }
    }
}

impl From<&Wrench> for Vectors {
    fn from(wrench: &Wrench) -> Self {
        Self(wrench.force.to_array(), wrench.torque.to_array())
    }
}

impl From<Vectors> for Wrench {
    fn from(Vectors(force, torque): Vectors) -> Self {
        Self { force: force.into(), torque: torque.into() }
    }
}

/// `geometry_msgs/PoseStamped`.
#[derive(Serialize)]
pub struct PoseStamped<'a>(pub Time, pub &'a str, pub PoseMessage);

/// `geometry_msgs/WrenchStamped`.
#[derive(Serialize)]
pub struct WrenchStamped<'a>(pub Time, pub &'a str, pub Vectors);

/// `rcl_interfaces/Log`: what happened, for people.
#[derive(Serialize)]
pub struct Log<'a> {
    pub stamp: Time,
    pub level: u8,
    pub name: &'a str,
    pub message: &'a str,
    pub file: &'a str,
    pub function: &'a str,
    pub line: u32,
}

/// A fault by number; zero for none.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Fault {
    kind: u8,
    driver_code: i32,
}

impl From<Option<FaultReason>> for Fault {
    fn from(reason: Option<FaultReason>) -> Self {
        let (kind, driver_code) = match reason {
            None => (0, 0),
            Some(FaultReason::WrenchNotFinite) => (1, 0),
            Some(FaultReason::ReadingNotFinite) => (2, 0),
            Some(FaultReason::StaleInput) => (3, 0),
            Some(FaultReason::JumpingInput) => (4, 0),
            Some(FaultReason::Overrun) => (5, 0),
            Some(FaultReason::StoreLost) => (6, 0),
            Some(FaultReason::Panic) => (7, 0),
            Some(FaultReason::ContactUnsound) => (8, 0),
            Some(FaultReason::Device(DeviceFault::Disconnected)) => (10, 0),
            Some(FaultReason::Device(DeviceFault::Stale)) => (11, 0),
            Some(FaultReason::Device(DeviceFault::NotFinite)) => (12, 0),
            Some(FaultReason::Device(DeviceFault::MotorsOff)) => (13, 0),
            Some(FaultReason::Device(DeviceFault::Driver(code))) => (14, code),
            Some(FaultReason::Device(DeviceFault::Program)) => (15, 0),
        };
        Self { kind, driver_code }
    }
}

impl From<Fault> for Option<FaultReason> {
    fn from(Fault { kind, driver_code }: Fault) -> Self {
        Some(match kind {
            0 => return None,
            1 => FaultReason::WrenchNotFinite,
            2 => FaultReason::ReadingNotFinite,
            3 => FaultReason::StaleInput,
            4 => FaultReason::JumpingInput,
            5 => FaultReason::Overrun,
            6 => FaultReason::StoreLost,
            7 => FaultReason::Panic,
            8 => FaultReason::ContactUnsound,
            10 => FaultReason::Device(DeviceFault::Disconnected),
            11 => FaultReason::Device(DeviceFault::Stale),
            12 => FaultReason::Device(DeviceFault::NotFinite),
            13 => FaultReason::Device(DeviceFault::MotorsOff),
            15 => FaultReason::Device(DeviceFault::Program),
            code => FaultReason::Device(DeviceFault::Driver(if code == 14 { driver_code } else { i32::from(code) })),
        })
    }
}

/// One tool in a tick.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Tool {
    pose: PoseMessage,
    twist: Vectors,
    measured_ns: u64,
    buttons: u32,
    active: bool,
    reading_fault: Fault,
    fault_before: Fault,
    fault: Fault,
    limited: bool,
    wrench: Vectors,
    computed: Vectors,
    law: Vectors,
    port_energy: [f32; 3],
}

impl Tool {
    fn of(input: &RecordedInput, tool: usize, output: &RecordedTool) -> Self {
        let result = input.readings[tool];
        let reading = result.unwrap_or_default();
        Self {
            pose: (&reading.pose).into(),
            twist: (&reading.twist).into(),
            measured_ns: reading.timestamp_ns,
            buttons: reading.buttons.0,
            active: reading.active,
            reading_fault: result.err().map(FaultReason::Device).into(),
            fault_before: input.tool_faults[tool].into(),
            fault: output.fault.into(),
            limited: output.limited,
            wrench: (&output.wrench).into(),
            computed: (&output.computed.limited).into(),
            law: (&output.computed.law).into(),
            port_energy: output.port,
        }
    }

    fn reading(&self) -> Result<Reading, DeviceFault> {
        match self.reading_fault.into() {
            Some(FaultReason::Device(fault)) => Err(fault),
            _ => Ok(Reading {
                pose: self.pose.into(),
                twist: self.twist.into(),
                buttons: Buttons(self.buttons),
                active: self.active,
                timestamp_ns: self.measured_ns,
            }),
        }
    }

    fn recorded(&self) -> RecordedTool {
        RecordedTool {
            computed: ComputedWrench { law: self.law.into(), limited: self.computed.into() },
            wrench: self.wrench.into(),
            port: self.port_energy,
            limited: self.limited,
            fault: self.fault.into(),
        }
    }
}

/// A contact in a tick.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Contact {
    tool: u8,
    body: u8,
    mode: u8,
    slipping: bool,
    limited: bool,
    point: [f32; 3],
    normal: [f32; 3],
    force: [f32; 3],
    torque: [f32; 3],
    radius: f32,
    depth: f32,
    stiffness: f32,
    error: f32,
}

const GRAB: u8 = 2;

impl From<&RecordedContact> for Contact {
    fn from(c: &RecordedContact) -> Self {
        let mode = if c.mode == Mode::Grab { GRAB } else { 1 };
        let &RecordedContact { tool, body, slipping, limited, point, normal, force, torque, .. } = c;
        let &RecordedContact { radius, depth, stiffness, error, .. } = c;
        Self { tool, body, mode, slipping, limited, point, normal, force, torque, radius, depth, stiffness, error }
    }
}

impl From<Contact> for RecordedContact {
    fn from(c: Contact) -> Self {
        let mode = if c.mode == GRAB { Mode::Grab } else { Mode::Press };
        let Contact { tool, body, slipping, limited, point, normal, force, torque, .. } = c;
        let Contact { radius, depth, stiffness, error, .. } = c;
        Self { tool, body, mode, slipping, limited, point, normal, force, torque, radius, depth, stiffness, error }
    }
}

/// A body in motion at a tick.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Body {
    body: u8,
    time: f64,
    kinetic: f64,
    strain: f64,
    coupling: f64,
    dissipated: f64,
    work: f64,
}

/// A strain response that came before a tick.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Strain {
    body: u8,
    asked: u64,
}

/// A tick.
#[derive(Clone, Serialize, Deserialize)]
pub struct Tick {
    stamp: Time,
    number: u64,
    due_ns: u64,
    period: f64,
    delay_ns: u32,
    took_ns: u32,
    reset: bool,
    strike: bool,
    fault: Fault,
    unsent: u32,
    tools: Vec<Tool>,
    contacts: Vec<Contact>,
    bodies: Vec<Body>,
    strain: Vec<Strain>,
}

impl Tick {
    /// Of a record, with some tools in the scene.
    pub fn new(record: &TickRecord, tools: usize, stamp: Time) -> Self {
        let TickRecord { input, output, .. } = record;
        let body = |(body, energies): (usize, &Option<(f64, Energy)>)| {
            energies.map(|(time, e)| Body {
                body: body as u8,
                time,
                kinetic: e.kinetic,
                strain: e.strain,
                coupling: e.coupling,
                dissipated: e.dissipated,
                work: e.work,
            })
        };
        let strain = |asked: &StrainRequestId| Strain { body: asked.body as u8, asked: asked.tick };
        Self {
            stamp,
            number: record.tick,
            due_ns: input.due_ns,
            period: input.period,
            delay_ns: record.delay_ns.min(u32::MAX.into()) as u32,
            took_ns: record.took_ns.min(u32::MAX.into()) as u32,
            reset: input.reset,
            strike: input.strike.is_some(),
            fault: input.fault.into(),
            unsent: input.strain.unsent,
            tools: (0..tools).map(|tool| Tool::of(input, tool, &output.tools[tool])).collect(),
            contacts: output.contacts.iter().map(Contact::from).collect(),
            bodies: output.bodies.iter().enumerate().filter_map(body).collect(),
            strain: input.strain.arrived().iter().map(strain).collect(),
        }
    }

    /// The record again, with the settings that were in force and the latest strike.
    pub fn record(&self, (settings, strike): (Settings, Strike)) -> TickRecord {
        let mut strain = StrainArrivals::default();
        strain.unsent = self.unsent;
        self.strain.iter().for_each(|s| strain.push(StrainRequestId { body: s.body.into(), tick: s.asked }));
        let mut input = RecordedInput {
            due_ns: self.due_ns,
            period: self.period,
            settings,
            reset: self.reset,
            strike: self.strike.then_some(strike),
            readings: [Ok(Reading::default()); MAX_TOOLS],
            strain,
            fault: self.fault.into(),
            tool_faults: Default::default(),
        };
        let contacts = self.contacts.iter().map(|&contact| contact.into()).collect();
        let mut output = RecordedOutput { contacts, ..RecordedOutput::default() };
        for (tool, message) in self.tools.iter().enumerate().take(output.tools.len()) {
            input.readings[tool] = message.reading();
            input.tool_faults[tool] = message.fault_before.into();
            output.tools[tool] = message.recorded();
        }
        for b in &self.bodies {
            if let Some(body) = output.bodies.get_mut(usize::from(b.body)) {
                let (kinetic, strain, coupling) = (b.kinetic, b.strain, b.coupling);
                let energy = Energy { kinetic, strain, coupling, dissipated: b.dissipated, work: b.work };
                *body = Some((b.time, energy));
            }
        }
        let (delay_ns, took_ns) = (self.delay_ns.into(), self.took_ns.into());
        TickRecord { tick: self.number, input, output, delay_ns, took_ns }
    }
}

/// Settings, from a tick on.
#[derive(Clone, Serialize, Deserialize)]
pub struct SettingsMessage {
    stamp: Time,
    number: u64,
    contact_radius: Vec<f64>,
    friction: Vec<f64>,
    stiffness_scale: Vec<f64>,
    strain_limit: f64,
    time_scale: f64,
    strike_body: u8,
    strike_point: [f64; 3],
    strike_impulse: [f64; 3],
    strike_radius: f64,
    strike_duration: f64,
}

impl SettingsMessage {
    /// Of a record and the latest strike, with some tools and bodies in the scene.
    pub fn new(record: &TickRecord, strike: &Strike, tools: usize, bodies: usize, stamp: Time) -> Self {
        let settings = &record.input.settings;
        Self {
            stamp,
            number: record.tick,
            contact_radius: settings.contact_radius[..tools].to_vec(),
            friction: settings.friction[..tools].to_vec(),
            stiffness_scale: settings.stiffness_scale[..bodies].to_vec(),
            strain_limit: settings.strain_limit,
            time_scale: settings.time_scale,
            strike_body: strike.body as u8,
            strike_point: strike.point.to_array(),
            strike_impulse: strike.impulse.to_array(),
            strike_radius: strike.radius,
            strike_duration: strike.duration,
        }
    }

    /// The settings and the latest strike again.
    pub fn settings(&self) -> (Settings, Strike) {
        let mut settings = Settings { strain_limit: self.strain_limit, ..Settings::default() };
        fill(&mut settings.contact_radius, &self.contact_radius);
        fill(&mut settings.friction, &self.friction);
        fill(&mut settings.stiffness_scale, &self.stiffness_scale);
        settings.time_scale = self.time_scale;
        let strike = Strike {
            body: self.strike_body.into(),
            point: DVec3::from(self.strike_point),
            impulse: DVec3::from(self.strike_impulse),
            radius: self.strike_radius,
            duration: self.strike_duration,
        };
        (settings, strike)
    }
}

fn fill(to: &mut [f64], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
}

/// Whether two settings are the same as far as a recording goes: the watched node aside.
pub fn same_settings(a: &Settings, b: &Settings) -> bool {
    Settings { watch: a.watch, ..*b } == *a
}
