//! A device without hardware: a pointer or a program sets the target, a light damped hand follows it.
//!
//! A pointer moves about a hundred times a second; passed on as it comes, its stairs would be felt and heard. The tip
//! follows the target as a critically damped second-order system,
//!
//! ```text
//! x'' = omega^2 (target - x) - 2 omega x',      omega = 1 / TIME_CONSTANT,
//! ```
//!
//! advanced by its exact solution over each period, so that the path does not depend on the tick rate.

use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use crate::{Device, DeviceState};

/// Time constant with which the tip follows its target, s: a step is followed to 98 % in about six of them.
pub const TIME_CONSTANT: f64 = 0.008;

/// What the other side asks of the simulated device.
#[derive(Clone, Copy, Debug, Default)]
pub struct Target {
    /// Where the tip should go, m.
    pub position: DVec3,
    /// Whether the tip is in the scene.
    pub active: bool,
    /// Whether the grab button is held.
    pub grab: bool,
}

/// The end that sets targets, from any thread; the latest one counts.
pub struct Handle {
    targets: Input<Target>,
}

impl Handle {
    /// Sets the target; wait-free.
    pub fn set(&mut self, target: Target) {
        self.targets.write(target);
    }
}

/// The device's end, owned by the servo.
pub struct SimulatedDevice {
    targets: Output<Target>,
    state: DeviceState,
}

/// A simulated device and the handle that moves it.
pub fn simulated() -> (Handle, SimulatedDevice) {
    let (input, output) = triple_buffer(&Target::default());
    (Handle { targets: input }, SimulatedDevice { targets: output, state: DeviceState::default() })
}

impl Device for SimulatedDevice {
    fn read(&mut self, period: f64) -> DeviceState {
        let target = *self.targets.read();
        let appears = target.active && !self.state.active;
        (self.state.active, self.state.grab) = (target.active, target.grab);
        if appears || !self.state.position.is_finite() {
            // A tip that comes into the scene starts where it is, without a sweep from its last place.
            (self.state.position, self.state.velocity) = (target.position, DVec3::ZERO);
        } else {
            let (decay, omega) = ((-period / TIME_CONSTANT).exp(), 1.0 / TIME_CONSTANT);
            let offset = self.state.position - target.position;
            let slope = self.state.velocity + omega * offset;
            self.state.position = target.position + (offset + slope * period) * decay;
            self.state.velocity = (self.state.velocity - omega * slope * period) * decay;
        }
        self.state
    }

    fn write(&mut self, _force: DVec3) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follows_a_step_as_the_closed_form_says_at_any_rate() {
        for period in [1e-3, 0.25e-3] {
            let (mut handle, mut device) = simulated();
            handle.set(Target { active: true, ..Target::default() });
            device.read(period);
            handle.set(Target { position: DVec3::X, active: true, grab: false });
            let ticks = (0.02 / period).round() as usize;
            let mut tip = DeviceState::default();
            for _ in 0..ticks {
                tip = device.read(period);
            }
            let t: f64 = 0.02 / TIME_CONSTANT;
            assert!((tip.position.x - (1.0 - (1.0 + t) * (-t).exp())).abs() < 1e-12);
        }
    }

    #[test]
    fn appears_at_its_target_without_a_sweep() {
        let (mut handle, mut device) = simulated();
        handle.set(Target { position: DVec3::Y, active: true, grab: true });
        let tip = device.read(1e-3);
        assert_eq!(tip.position, DVec3::Y);
        assert_eq!(tip.velocity, DVec3::ZERO);
        assert!(tip.grab);
    }
}
