//! A device of a Python program: the end that its polling thread holds, until a loop takes the other.

use std::sync::{Arc, Mutex, PoisonError};

use palpate_devices::programmed::{ProgramEnd, ProgrammedDevice as Device, programmed};
use palpate_devices::{Buttons, DeviceFault, DeviceLimits, Opened, Pose, Twist};
use palpate_servo::{Fault, FaultReason};
use pyo3::prelude::*;

use crate::scene::quaternion;

/// Largest force (N), torque (N m), stiffness (N/m), damping (N s/m) and damping of rotation (N m s/rad), damping of its own
/// (N s/m), delay (s), fastest tip (m/s), rate (Hz).
pub type LimitArguments = (f64, f64, f64, f64, f64, Option<f64>, f64, Option<f64>, Option<f64>);

/// How far a quaternion's length may be from one.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Why the program failed last, in its own words: for people, never for the loop.
#[derive(Clone, Default)]
pub struct Failure(Arc<Mutex<Option<String>>>);

impl Failure {
    fn tell(&self, message: String) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
    }

    fn message(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// A fault in the words of the program whose device has it, where there is one: `failures` is by tool.
pub fn fault_text(fault: Fault, failures: &[Option<Failure>]) -> String {
    let of_program = (fault.reason == FaultReason::Device(DeviceFault::Program)).then_some(fault.tool).flatten();
    let told = of_program.and_then(|tool| Some((tool, failures.get(tool)?.as_ref()?.message()?)));
    match told {
        Some((tool, message)) => format!("tool {tool}: {message}; forces are off until a reset"),
        None => fault.to_string(),
    }
}

/// Both ends of a device that a program polls.
#[pyclass(module = "palpate._native")]
pub struct ProgrammedDevice {
    end: ProgramEnd,
    device: Option<Device>,
    failure: Failure,
}

impl ProgrammedDevice {
    /// The servo's end, once, and what will tell why the program failed.
    pub fn take(&mut self) -> Option<(Opened, Failure)> {
        let device = self.device.take()?;
        Some((Opened { device: Box::new(device), scheduler: None }, self.failure.clone()))
    }
}

#[pymethods]
impl ProgrammedDevice {
    /// A device that is polled at `rate`, Hz.
    #[new]
    fn new(name: String, limits: LimitArguments, rate: f64) -> Self {
        let (end, device) = programmed(name, limits_of(limits), rate);
        Self { end, device: Some(device), failure: Failure::default() }
    }

    /// Says where the tool is, m and a quaternion w x y z, how it moves, m/s and rad/s, and which buttons are held, a bit each. False
    /// where a number is not finite, or the quaternion not a unit one: nothing is said then.
    fn publish(
        &mut self,
        position: [f64; 3],
        orientation: [f64; 4],
        velocity: [f64; 3],
        angular_velocity: [f64; 3],
        buttons: u32,
    ) -> bool {
        let length = orientation.iter().map(|part| part * part).sum::<f64>().sqrt();
        let pose = Pose { position: position.into(), orientation: quaternion(orientation) };
        let twist = Twist { linear: velocity.into(), angular: angular_velocity.into() };
        let finite = pose.is_finite() && twist.linear.is_finite() && twist.angular.is_finite();
        if !finite || (length - 1.0).abs() > UNIT_TOLERANCE {
            return false;
        }
        self.end.publish(pose, twist, Buttons(buttons));
        true
    }

    /// Says that the tool is out of the scene.
    fn publish_absent(&mut self) {
        self.end.publish_absent();
    }

    /// Says that there is no reading, and why in one line; forces are then zero from the next tick on.
    fn fail(&mut self, message: String) {
        self.failure.tell(message);
        self.end.fail(DeviceFault::Program);
    }

    /// Force (N) and torque (N m) to put out, and their age (s) if a loop has asked; zero where no tick has renewed them.
    fn wrench(&mut self) -> ([f64; 3], [f64; 3], Option<f64>) {
        let (wrench, age) = self.end.wrench();
        (wrench.force.to_array(), wrench.torque.to_array(), age.map(|age| age.as_secs_f64()))
    }
}

/// Limits of a device from Python.
pub fn limits_of(given: LimitArguments) -> DeviceLimits {
    let (max_force, max_torque, max_stiffness, max_damping, max_angular_damping, own_damping, delay, max_speed, rate) =
        given;
    DeviceLimits {
        max_force,
        max_torque,
        max_stiffness,
        max_damping,
        max_angular_damping,
        own_damping,
        delay,
        max_speed,
        rate,
    }
}

/// The same for Python.
pub fn limit_arguments(limits: &DeviceLimits) -> LimitArguments {
    let DeviceLimits {
        max_force,
        max_torque,
        max_stiffness,
        max_damping,
        max_angular_damping,
        own_damping,
        delay,
        max_speed,
        rate,
    } = *limits;
    (max_force, max_torque, max_stiffness, max_damping, max_angular_damping, own_damping, delay, max_speed, rate)
}
