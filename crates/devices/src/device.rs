//! What a driver implements.

use std::fmt;

use glam::DVec3;

use crate::{Pose, Twist, Wrench};

/// Buttons of a device, a bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buttons(pub u32);

impl Buttons {
    /// Button 0, which holds on to what the tool touches.
    pub const GRAB: Buttons = Buttons(1);

    /// Whether button 0 is held.
    pub fn grab(self) -> bool {
        self.0 & Self::GRAB.0 != 0
    }
}

/// What a device says at a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading {
    /// Where the tool is.
    pub pose: Pose,
    /// How it moves.
    pub twist: Twist,
    /// Which buttons are held.
    pub buttons: Buttons,
    /// Whether the tool is in the scene.
    pub active: bool,
    /// When the device measured this, ns. Any clock that only goes forward will do: the servo looks at differences.
    pub timestamp_ns: u64,
}

/// Why a device gives no reading or takes no wrench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceFault {
    /// It is no longer there.
    Disconnected,
    /// It has had no new measurement for longer than its driver allows.
    Stale,
    /// It measured something that is not a finite number.
    NotFinite,
    /// It has switched its motors off: too hot, or an emergency stop.
    MotorsOff,
    /// Its driver reports an error by number.
    Driver(i32),
}

impl fmt::Display for DeviceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DeviceFault::Disconnected => write!(f, "the device is disconnected: connect it again"),
            DeviceFault::Stale => write!(f, "the device has stopped sending measurements: check its cable and driver"),
            DeviceFault::NotFinite => write!(f, "the device measured something that is not a finite number"),
            DeviceFault::MotorsOff => {
                write!(f, "the device has switched its motors off: let it cool, or release its stop")
            }
            DeviceFault::Driver(code) => write!(f, "the device's driver reports error {code}"),
        }
    }
}

/// What a device can render. What it does not limit is infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceLimits {
    /// Largest force, N.
    pub max_force: f64,
    /// Largest torque, N m; zero for a device without rotary motors.
    pub max_torque: f64,
    /// Stiffest contact it holds without oscillating, N/m.
    pub max_stiffness: f64,
    /// Strongest damping it holds without oscillating, N s/m.
    pub max_damping: f64,
    /// Fastest that a hand moves its tip, m/s: what looks faster is a fault of its sensors. `None` for a device without
    /// sensors, whose pose is commanded and may jump.
    pub max_speed: Option<f64>,
    /// Opposite corners of the box that its tip reaches, m, in the world.
    pub workspace: Option<(DVec3, DVec3)>,
    /// Fastest rate at which it takes wrenches, Hz.
    pub rate: Option<f64>,
}

impl DeviceLimits {
    /// None at all: a device without hardware.
    pub const UNLIMITED: DeviceLimits = DeviceLimits {
        max_force: f64::INFINITY,
        max_torque: f64::INFINITY,
        max_stiffness: f64::INFINITY,
        max_damping: f64::INFINITY,
        max_speed: None,
        workspace: None,
        rate: None,
    };
}

/// One haptic device. `read` and `write` belong to the tick: they never allocate, lock or block, and never panic. A driver
/// that must wait for its hardware does so on a thread of its own and hands the latest reading over.
pub trait Device: Send {
    /// The device's state now: `now_ns` is the tick's time, ns, `period` the time between two ticks, s.
    ///
    /// # Errors
    /// Why there is no reading. The servo then keeps the wrench at zero until a reset.
    fn read(&mut self, now_ns: u64, period: f64) -> Result<Reading, DeviceFault>;

    /// Puts out a wrench on the hand.
    ///
    /// # Errors
    /// Why it was not put out. The servo then keeps the wrench at zero until a reset.
    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault>;

    /// What it can render; asked once, before the first tick.
    fn limits(&self) -> DeviceLimits;
}
