//! Device of a Python program: the end that its polling thread uses; a loop takes the other end.

use palpate_devices::programmed::{ProgramEnd, ProgrammedDevice as Device, programmed};
use palpate_devices::{Buttons, DeviceFault, Pose, ReadyDevice, Twist};
use palpate_scene::unit_quaternion;
use pyo3::prelude::*;

use crate::connection::{LimitsArguments, OpenedDevice, limits_of};

/// How far a quaternion's length may be from one.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Both ends of a device that a program polls.
#[pyclass(module = "palpate._native")]
pub struct ProgrammedDevice {
    end: ProgramEnd,
    device: Option<Device>,
}

#[pymethods]
impl ProgrammedDevice {
    /// A device that is polled at `rate`, Hz.
    #[new]
    fn new(name: String, limits: LimitsArguments, rate: f64) -> Self {
        let (end, device) = programmed(name, limits_of(limits), rate);
        Self { end, device: Some(device) }
    }

    /// What a loop takes, once.
    fn opened(&mut self) -> Option<OpenedDevice> {
        let device = self.device.take()?;
        Some(ReadyDevice { device: Box::new(device), scheduler: None }.into())
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
        let pose = Pose { position: position.into(), orientation: unit_quaternion(orientation) };
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

    /// Says that there is no reading, for the program has failed; forces are then zero from the next tick on.
    fn fail(&mut self) {
        self.end.fail(DeviceFault::Program);
    }

    /// Force (N) and torque (N m) to put out, and their age (s) if a loop has asked; zero where no tick has renewed them.
    fn wrench(&mut self) -> ([f64; 3], [f64; 3], Option<f64>) {
        let (wrench, age) = self.end.wrench();
        (wrench.force.to_array(), wrench.torque.to_array(), age.map(|age| age.as_secs_f64()))
    }
}
