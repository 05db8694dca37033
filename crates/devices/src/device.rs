//! The `Device` trait, which every driver implements, and its readings, faults and limits.

use std::fmt;

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

/// Reading of a device at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// The program that brings it has failed, and tells why itself.
    Program,
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
            DeviceFault::Program => write!(f, "the device's program has failed"),
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
    /// Strongest damping of rotation it holds without oscillating, N m s/rad.
    pub max_angular_damping: f64,
    /// Viscous damping of its mechanics at the tip, N s/m, where it is known.
    pub own_damping: Option<f64>,
    /// Time from a measurement to the force that answers it beyond that of the tick, s: a driver's queue, a bus.
    pub delay: f64,
    /// Fastest that a hand moves its tip, m/s: what looks faster is a fault of its sensors. `None` for a device without
    /// sensors, whose pose is commanded and may jump.
    pub max_speed: Option<f64>,
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
        max_angular_damping: f64::INFINITY,
        own_damping: None,
        delay: 0.0,
        max_speed: None,
        rate: None,
    };

    /// Stiffest contact that the device holds at a time `period` between two ticks, N/m.
    ///
    /// A force held for a tick while the tip moves on at `v` lags the spring `K` by half a period, and by the delay: it gives
    /// out `K v^2 (T/2 + d)` of power. The device's own damping takes `b v^2`, so the loop is passive for
    ///
    /// ```text
    /// K <= b / (T/2 + d)
    /// ```
    ///
    /// Source: Colgate and Schenkel, Passivity of a class of sampled-data systems (J. Robotic Systems 14, 1997), for the
    /// spring without delay; Diolaiti et al. (IEEE Trans. Robotics 22, 2006) with it.
    pub fn largest_stiffness(&self, period: f64) -> f64 {
        let passive = self.own_damping.map_or(f64::INFINITY, |damping| damping / (0.5 * period + self.delay));
        self.max_stiffness.min(passive)
    }

    /// The lower of both limits, one by one.
    pub fn lower_of(&self, other: &Self) -> Self {
        let lower = |one: Option<f64>, other: Option<f64>| match (one, other) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        };
        Self {
            max_force: self.max_force.min(other.max_force),
            max_torque: self.max_torque.min(other.max_torque),
            max_stiffness: self.max_stiffness.min(other.max_stiffness),
            max_damping: self.max_damping.min(other.max_damping),
            max_angular_damping: self.max_angular_damping.min(other.max_angular_damping),
            own_damping: lower(self.own_damping, other.own_damping),
            delay: self.delay.max(other.delay),
            max_speed: lower(self.max_speed, other.max_speed),
            rate: lower(self.rate, other.rate),
        }
    }
}

/// One haptic device. `read` and `write` belong to the tick: they never allocate, lock or block, and never panic. A driver
/// that must wait for its hardware does so on a thread of its own and hands the latest reading over.
pub trait Device: Send {
    /// What a person knows it by: maker, model, and which one.
    fn name(&self) -> &str;

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

#[cfg(test)]
mod tests {
    use super::*;

    /// A mass `m` with damping `b` on a sampled spring `K`, held over each period and late by whole ones: its free motion
    /// within a period is exact. Whether it comes to rest.
    fn comes_to_rest(stiffness: f64, damping: f64, period: f64, late_ticks: usize) -> bool {
        let mass = 0.05;
        let decay = (-damping * period / mass).exp();
        let (mut x, mut v) = (1e-3, 0.0);
        let mut seen = vec![x; late_ticks + 1];
        let mut largest = 0.0_f64;
        for tick in 0..40_000 {
            seen.rotate_right(1);
            seen[0] = x;
            // Towards the speed at which damping balances the held force.
            let steady = -stiffness * seen[late_ticks] / damping;
            x += steady * period + (v - steady) * mass / damping * (1.0 - decay);
            v = steady + (v - steady) * decay;
            largest = if tick < 39_000 { 0.0 } else { largest.max(x.abs()) };
        }
        largest < 1e-3
    }

    #[test]
    fn a_spring_within_colgates_bound_comes_to_rest() {
        for (period, late_ticks) in [(1e-3, 0), (2.5e-4, 0), (1e-3, 1), (1e-3, 3)] {
            let delay = late_ticks as f64 * period;
            let limits = DeviceLimits { own_damping: Some(0.8), delay, ..DeviceLimits::UNLIMITED };
            let largest = limits.largest_stiffness(period);
            assert!((largest * (0.5 * period + delay) / 0.8 - 1.0).abs() < 1e-12);
            assert!(comes_to_rest(0.98 * largest, 0.8, period, late_ticks));
            // The bound is Colgate's for any hand; a mass alone needs about as much.
            assert!(!comes_to_rest(1.3 * largest, 0.8, period, late_ticks), "{period} {late_ticks}");
        }
    }

    #[test]
    fn the_lower_bound_counts() {
        let limits = DeviceLimits { max_stiffness: 700.0, own_damping: Some(0.2), ..DeviceLimits::UNLIMITED };
        assert_eq!(limits.largest_stiffness(1e-3), 400.0);
        assert_eq!(limits.largest_stiffness(1e-4), 700.0);
        assert_eq!(DeviceLimits::UNLIMITED.largest_stiffness(1e-3), f64::INFINITY);
    }
}
