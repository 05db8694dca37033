//! Emulated device that runs in the process of its loop.

use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use super::hand::HandTarget;
use super::tip::Tip;
use crate::{Buttons, Device, DeviceFault, DeviceLimits, Pose, Reading, Twist, Wrench};

/// What the other side asks of an emulated device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Where the hand wants to be from now on, m; `None` leaves it to what it was made with.
    pub target: Option<DVec3>,
    /// Which buttons it holds.
    pub buttons: Buttons,
    /// Whether the tool is in the scene.
    pub active: bool,
}

impl Default for Command {
    fn default() -> Self {
        Self { target: None, buttons: Buttons::default(), active: true }
    }
}

/// True motion of the tip, which the device measures in whole steps of its encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrueMotion {
    /// m.
    pub position: DVec3,
    /// m/s.
    pub velocity: DVec3,
    /// Force of the device that acts, N.
    pub force: DVec3,
}

/// The end that steers and looks on, from any thread.
pub struct Handle {
    commands: Input<Command>,
    true_motions: Output<TrueMotion>,
}

impl Handle {
    /// Sets a command; the latest one counts. Wait-free.
    pub fn set(&mut self, command: Command) {
        self.commands.write(command);
    }

    /// True motion at the last reading. Wait-free.
    pub fn true_motion(&mut self) -> TrueMotion {
        *self.true_motions.read()
    }
}

/// The device's end, owned by the loop. Its tip moves when it is read, to the time of the tick; motors saturate at the largest
/// force of the limits, along the force's direction. It has no motors of rotation.
pub struct EmulatedDevice {
    name: String,
    tip: Tip,
    limits: DeviceLimits,
    commands: Output<Command>,
    true_motions: Input<TrueMotion>,
    read_ns: Option<u64>,
}

/// An emulated device of a name with its handle. The limits are what it says of itself, its own damping and delay included: it
/// may be wrong.
pub fn emulated(name: &str, tip: Tip, limits: DeviceLimits) -> (Handle, EmulatedDevice) {
    let (commands, received) = triple_buffer(&Command::default());
    let (published, true_motions) = triple_buffer(&TrueMotion { position: tip.position(), ..TrueMotion::default() });
    let device = EmulatedDevice {
        name: name.to_owned(),
        tip,
        limits,
        commands: received,
        true_motions: published,
        read_ns: None,
    };
    (Handle { commands, true_motions }, device)
}

impl Device for EmulatedDevice {
    fn name(&self) -> &str {
        &self.name
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        let elapsed_ns = now_ns.saturating_sub(self.read_ns.unwrap_or(now_ns));
        self.read_ns = Some(now_ns);
        self.tip.advance(1e-9 * elapsed_ns as f64);
        let command = *self.commands.read();
        if let (Some(position), Some(hand)) = (command.target, &mut self.tip.hand) {
            match &mut hand.target {
                HandTarget::At(target) => *target = position,
                // Keeps the memory of the waypoints: a tick neither allocates nor frees.
                HandTarget::Along(waypoints) => {
                    waypoints.truncate(1);
                    waypoints.iter_mut().for_each(|only| only.position = position);
                }
            }
        }
        let measured = self.tip.measure();
        self.true_motions.write(TrueMotion {
            position: self.tip.position(),
            velocity: self.tip.velocity(),
            force: self.tip.force(),
        });
        Ok(Reading {
            pose: Pose::at(measured.position),
            twist: Twist { linear: measured.velocity, angular: DVec3::ZERO },
            buttons: command.buttons,
            active: command.active,
            timestamp_ns: now_ns,
        })
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        self.tip.write(wrench.force.clamp_length_max(self.limits.max_force));
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}

#[cfg(test)]
mod tests {
    use super::super::hand::{Hand, Waypoint};
    use super::super::tip::Mechanics;
    use super::*;

    const MECHANICS: Mechanics =
        Mechanics { mass: 0.1, damping: 0.5, dry_friction: 0.0, encoder_step: 1e-5, delay: 0.0 };

    fn tick(device: &mut EmulatedDevice, tick: u64, force: DVec3) -> Reading {
        let reading = device.read(1_000_000 * tick, 1e-3).expect("an emulated device has no faults");
        device.write(Wrench { force, ..Wrench::default() }).expect("an emulated device has no faults");
        reading
    }

    #[test]
    fn a_force_moves_it_and_saturates_along_its_direction() {
        let limits = DeviceLimits { max_force: 3.0, ..DeviceLimits::UNLIMITED };
        let (mut handle, mut device) = emulated("emulated", Tip::new(MECHANICS, DVec3::ZERO, None), limits);
        let push = DVec3::new(30.0, 0.0, -40.0);
        let readings: Vec<Reading> = (0..100).map(|k| tick(&mut device, k, push)).collect();
        assert_eq!(readings[0].pose, Pose::default());
        let true_motion = handle.true_motion();
        assert!((true_motion.force - DVec3::new(1.8, 0.0, -2.4)).length() < 1e-15);
        // v = F/b (1 - exp(-b t / m)).
        let speed = 3.0 / 0.5 * (1.0 - (-0.5 * 0.099 / 0.1_f64).exp());
        assert!((true_motion.velocity - speed * push.normalize()).length() < 1e-12);
        assert!((readings[99].pose.position - true_motion.position).length() < 1e-5);
        assert!((readings[99].pose.position - true_motion.position).length() > 0.0);
    }

    #[test]
    fn the_hand_goes_where_it_is_sent() {
        for target in
            [HandTarget::At(DVec3::ZERO), HandTarget::Along(vec![Waypoint { time: 0.0, position: DVec3::ZERO }; 3])]
        {
            let hand = Hand { mass: 0.1, damping: 4.0, stiffness: 200.0, target };
            let tip = Tip::new(MECHANICS, DVec3::ZERO, Some(hand));
            let (mut handle, mut device) = emulated("emulated", tip, DeviceLimits::UNLIMITED);
            handle.set(Command { target: Some(DVec3::Y), buttons: Buttons::GRAB, active: true });
            let last = (0..3000).map(|k| tick(&mut device, k, DVec3::ZERO)).last().expect("a reading");
            assert!((last.pose.position - DVec3::Y).length() < 1e-9);
            assert!(last.buttons.grab() && last.active);
        }
    }
}
