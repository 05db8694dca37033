//! A device without hardware: a pointer or a program sets the target, a light damped hand follows it.

mod hand;

use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use self::hand::Hand;
pub use self::hand::TIME_CONSTANT;
use crate::{Buttons, Device, DeviceFault, DeviceLimits, MountedDevice, Pose, Reading, Twist, Workspace, Wrench};

/// Longest time for which a target goes on at its velocity, s: a pointer that says nothing more has stopped.
const EXTRAPOLATION: f64 = 0.1;

/// What the device resolves, as the encoders of a real one do, only finer: 2^-30 m (1 nm), and 2^-20 m/s and rad/s. The digits
/// below would only fill recordings.
const POSITION_GRID: f64 = 1.0 / (1 << 30) as f64;
const VELOCITY_GRID: f64 = 1.0 / (1 << 20) as f64;

fn on_grid(vector: DVec3, grid: f64) -> DVec3 {
    (vector / grid).round() * grid
}

/// What the other side asks of the simulated device.
#[derive(Clone, Copy, Debug, Default)]
pub struct Target {
    /// Where the tool should go.
    pub pose: Pose,
    /// Velocity at which the target goes on from there, m/s, for [`EXTRAPOLATION`] at most.
    pub velocity: DVec3,
    /// Whether the tool is in the scene.
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
    hand: Hand,
    active: bool,
    /// Time since the latest target was set, s.
    age: f64,
}

/// A simulated device and the handle that moves it.
pub fn simulated() -> (Handle, SimulatedDevice) {
    let (input, output) = triple_buffer(&Target::default());
    (Handle { targets: input }, SimulatedDevice { targets: output, hand: Hand::default(), active: false, age: 0.0 })
}

/// The same, as a device for a loop, with the limits that a scene gives it.
pub fn simulated_with(limits: &DeviceLimits) -> (Handle, Box<dyn Device>) {
    let (handle, device) = simulated();
    match *limits == DeviceLimits::UNLIMITED {
        true => (handle, Box::new(device)),
        false => (handle, Box::new(MountedDevice::new(Box::new(device), Workspace::default(), limits))),
    }
}

impl Device for SimulatedDevice {
    fn name(&self) -> &str {
        "simulated"
    }

    fn read(&mut self, now_ns: u64, period: f64) -> Result<Reading, DeviceFault> {
        self.age = if self.targets.update() { 0.0 } else { self.age + period };
        let mut target = *self.targets.output_buffer_mut();
        target.pose.position += target.velocity * self.age.min(EXTRAPOLATION);
        let appears = target.active && !self.active;
        self.active = target.active;
        if appears || !self.hand.is_finite() {
            // A tool that comes into the scene starts where it is, without a sweep from its last place.
            self.hand = Hand::resting(target.pose);
        } else {
            self.hand.follow(target.pose, period);
        }
        let Hand { pose, twist } = self.hand;
        let linear = on_grid(twist.linear, VELOCITY_GRID);
        Ok(Reading {
            pose: Pose { position: on_grid(pose.position, POSITION_GRID), ..pose },
            twist: Twist { linear, angular: on_grid(twist.angular, VELOCITY_GRID) },
            buttons: if target.grab { Buttons::GRAB } else { Buttons::default() },
            active: target.active,
            timestamp_ns: now_ns,
        })
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceFault> {
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        DeviceLimits::UNLIMITED
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    fn read(device: &mut SimulatedDevice, period: f64) -> Reading {
        device.read(0, period).expect("a simulated device has no faults")
    }

    /// Unit step response of the critically damped system.
    fn step_response(time: f64) -> f64 {
        let t = time / TIME_CONSTANT;
        1.0 - (1.0 + t) * (-t).exp()
    }

    #[test]
    fn follows_a_step_as_the_closed_form_says_at_any_rate() {
        for period in [1e-3, 0.25e-3] {
            let (mut handle, mut device) = simulated();
            handle.set(Target { active: true, ..Target::default() });
            read(&mut device, period);
            let pose = Pose { position: DVec3::X, orientation: DQuat::from_rotation_z(2.0) };
            handle.set(Target { pose, active: true, ..Target::default() });
            let ticks = (0.02 / period).round() as usize;
            let mut tip = Reading::default();
            for _ in 0..ticks {
                tip = read(&mut device, period);
            }
            assert!((tip.pose.position.x - step_response(0.02)).abs() < 1e-9);
            let turned = DQuat::from_rotation_z(2.0 * step_response(0.02));
            assert!(tip.pose.orientation.angle_between(turned) < 1e-7);
            assert!((tip.twist.angular.z - 2.0 * tip.twist.linear.x).abs() < 3e-6);
        }
    }

    #[test]
    fn turns_the_short_way_and_arrives() {
        let (mut handle, mut device) = simulated();
        handle.set(Target { active: true, ..Target::default() });
        read(&mut device, 1e-3);
        // The same rotation by a quaternion of either sign; 3.5 rad one way is 2.78 rad the other.
        for orientation in [DQuat::from_rotation_x(3.5), -DQuat::from_rotation_x(3.5)] {
            let pose = Pose { position: DVec3::ZERO, orientation };
            handle.set(Target { pose, active: true, ..Target::default() });
            let first = read(&mut device, 1e-3);
            assert!(first.twist.angular.x <= 0.0);
            let last = (0..300).map(|_| read(&mut device, 1e-3)).last().expect("a reading");
            assert!(last.pose.orientation.dot(orientation).abs() > 1.0 - 1e-12);
            assert!((last.pose.orientation.length() - 1.0).abs() < 1e-14);
        }
    }

    /// In the long run a critically damped hand trails a steady target by twice its time constant.
    #[test]
    fn a_target_with_a_velocity_goes_on_for_a_tenth_of_a_second() {
        let (mut handle, mut device) = simulated();
        handle.set(Target { active: true, ..Target::default() });
        read(&mut device, 1e-3);
        handle.set(Target { active: true, velocity: DVec3::X, ..Target::default() });
        let path: Vec<f64> = (0..1000).map(|_| read(&mut device, 1e-3).pose.position.x).collect();
        assert!((path[90] - (0.09 - 2.0 * TIME_CONSTANT)).abs() < 1e-3, "{}", path[90]);
        assert!((path[999] - EXTRAPOLATION).abs() < 1e-9);
    }

    #[test]
    fn appears_at_its_target_without_a_sweep() {
        let (mut handle, mut device) = simulated();
        let pose = Pose { position: DVec3::Y, orientation: DQuat::from_rotation_y(1.0) };
        handle.set(Target { pose, active: true, grab: true, ..Target::default() });
        let tip = read(&mut device, 1e-3);
        assert_eq!(tip.pose, pose);
        assert_eq!(tip.twist.linear, DVec3::ZERO);
        assert!(tip.buttons.grab());
    }
}
