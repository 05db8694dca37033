//! What an emulated device gives the suite.

use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use palpate_devices::{Buttons, DeviceFault, OpenError, Opened, Wrench};

/// An emulated device and the way to open its driver on it.
///
/// The suite calls it from the thread that ticks, between two ticks: what it sets counts from the next reading.
pub trait Bench: Send + 'static {
    /// What is known of the emulated device and of its driver.
    fn facts(&self) -> Facts;

    /// Opens the driver on the emulated device.
    ///
    /// # Errors
    /// Those of the driver.
    fn open(&mut self) -> Result<Opened, OpenError>;

    /// Puts the tip at a place, from which it goes on at its velocity until it is put elsewhere. What holds it there is
    /// stronger than the motors.
    fn set_tip(&mut self, tip: Tip);

    /// Holds these buttons and no others.
    fn press(&mut self, buttons: Buttons);

    /// What the motors put out.
    fn motors(&mut self) -> Motors;

    /// Makes something go wrong, instead of what went wrong before; `None`: all is well again.
    fn disturb(&mut self, disturbance: Option<Disturbance>);

    /// Lets a device that has its own scheduler tick as fast as it can, or at its rate again. Nothing to do for others.
    fn hurry(&mut self, _as_fast_as_possible: bool) {}
}

/// A place of the tip and its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip {
    /// From the middle of the workspace, m.
    pub position: DVec3,
    /// m/s.
    pub velocity: DVec3,
    /// Of the stylus, from how it lies at rest.
    pub orientation: DQuat,
    /// rad/s.
    pub angular_velocity: DVec3,
}

impl Default for Tip {
    fn default() -> Self {
        Self::at(DVec3::ZERO)
    }
}

impl Tip {
    /// At rest.
    pub fn at(position: DVec3) -> Self {
        Self { position, velocity: DVec3::ZERO, orientation: DQuat::IDENTITY, angular_velocity: DVec3::ZERO }
    }
}

/// What the motors put out, and since when.
#[derive(Clone, Copy, Debug)]
pub struct Motors {
    /// On the hand.
    pub wrench: Wrench,
    /// When they were last told so.
    pub at: Instant,
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// The cable is out.
    Unplugged,
    /// The vendor's software reports an error of the device whenever it is asked where it is, by a number that [`Facts::driver_error`] tells.
    DriverError,
    /// The vendor's software says that it is of a version with which the driver cannot work.
    WrongVersion,
    /// The vendor's software answers too late, for longer than [`Facts::stale_after`].
    SlowReplies,
    /// Positions are not numbers.
    NotFinite,
}

/// What is known of an emulated device and of its driver.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Where the middle of the workspace is by the device's own origin, m.
    pub middle: DVec3,
    /// How exactly positions are told, m.
    pub position_tolerance: f64,
    /// How exactly the velocity of an even motion is told, m/s.
    pub velocity_tolerance: f64,
    /// Time for which a motion must have been even for its velocity to be told.
    pub velocity_settles: Duration,
    /// How exactly forces reach the motors, N. Torques: the same number in N m, over ten.
    pub force_tolerance: f64,
    /// Whether the orientation of the stylus and its rate are told.
    pub turns: bool,
    /// How many buttons there are.
    pub buttons: u32,
    /// Ticks after which a reading at the latest shows what was done to the tip, or the motors what was written: 0 where the
    /// tick itself asks the device.
    pub late_ticks: usize,
    /// The age of a measurement, or the time without one, from which on the driver says that it is stale.
    pub stale_after: Duration,
    /// Longest time for which the motors hold a force that the loop does not write again.
    pub force_holds: Duration,
    /// Longest time from the moment at which a device is well again to readings.
    pub recovers_within: Duration,
    /// What the driver says at [`Disturbance::DriverError`].
    pub driver_error: DeviceFault,
    /// Whether ticks may follow each other faster than at 1 kHz.
    pub hurries: bool,
}
