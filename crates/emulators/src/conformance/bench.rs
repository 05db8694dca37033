//! The `Bench` trait: steering of an emulated device, and what is known of it.

use std::time::Duration;

use glam::DVec3;
use palpate_devices::{Buttons, DeviceFault, OpenError, ReadyDevice, Wrench};

use crate::tip::Tip;

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
    fn open(&mut self) -> Result<ReadyDevice, OpenError>;

    /// Puts the tip at a place, from which it goes on at its velocity until it is put elsewhere. What holds it there is
    /// stronger than the motors.
    fn set_tip(&mut self, tip: Tip);

    /// Holds these buttons and no others.
    fn press(&mut self, buttons: Buttons);

    /// What the motors put out on the hand.
    fn motors(&mut self) -> Wrench;

    /// Makes something go wrong, instead of what went wrong before; `None`: all is well again.
    fn disturb(&mut self, disturbance: Option<Disturbance>);

    /// Lets a device that has its own scheduler tick as fast as it can, or at its rate again. Nothing to do for others.
    fn run_fast(&mut self, _as_fast_as_possible: bool) {}
}

/// What goes wrong. The suite uses the first five of them; the rest is for the tests of single drivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Disturbance {
    /// The cable is out.
    Unplugged = 1,
    /// The vendor's software reports an error of the device whenever it is asked where it is, by the number of [`Facts::driver_error`].
    DriverError,
    /// The vendor's software has a version with which the driver cannot work.
    WrongVersion,
    /// The vendor's software answers too late, for longer than [`Facts::stale_after`].
    SlowReplies,
    /// Positions are not numbers.
    NotFinite,
    /// Every answer of the vendor's software is random.
    Nonsense,
    /// The device has not been calibrated since it was switched on.
    Uncalibrated,
    /// The motors are off, because they are too warm or a button on the device is held down.
    MotorsOff,
    /// Readings fail as if the device were unplugged. It is not: its motors keep the last wrench that was written.
    ReadsFail,
    /// The scheduler of the vendor's software does not start.
    SchedulerFails,
}

impl Disturbance {
    const ALL: [Self; 10] = [
        Self::Unplugged,
        Self::DriverError,
        Self::WrongVersion,
        Self::SlowReplies,
        Self::NotFinite,
        Self::Nonsense,
        Self::Uncalibrated,
        Self::MotorsOff,
        Self::ReadsFail,
        Self::SchedulerFails,
    ];

    /// Its number, by which it goes into an emulated library; 0 is none.
    pub fn number(disturbance: Option<Self>) -> u32 {
        disturbance.map_or(0, |disturbance| disturbance as u32)
    }

    /// The one of a number.
    pub fn numbered(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|disturbance| *disturbance as u32 == number)
    }
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
    pub can_run_fast: bool,
}
