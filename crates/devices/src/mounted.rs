//! Placement of a device in a scene: its workspace mapped to the scene, its limits seen from there, its clutch.
//!
//! With `R` the device's orientation, `s` the scene's metres per metre of the device, `c` the force on the hand per force in
//! the scene:
//!
//! ```text
//! x_scene = p + s R x_device + offset       force_device  = c R^T force_scene
//! v_scene = s R v_device                    torque_device = (c / s) R^T torque_scene      (lever arms shrink by s)
//! ```
//!
//! Power on the hand is `c / s` times that in the scene, for forces and torques alike: what takes no energy out of the scene takes
//! none out of the hand. A spring `K` of the scene is `c s K` in the hand.

use glam::{DQuat, DVec3};

use crate::{Device, DeviceFault, DeviceLimits, Pose, Reading, Twist, Wrench};

/// How the workspace of a device lies in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// The device's origin in the scene, m.
    pub position: DVec3,
    /// Scene from device, a unit quaternion.
    pub orientation: DQuat,
    /// Metres of the scene per metre of the device.
    pub scale: f64,
    /// Newtons on the hand per newton in the scene.
    pub force_scale: f64,
    /// Button that takes the tool out of the scene while it is held, so that the hand can reach for more.
    pub clutch: Option<u8>,
}

impl Default for Workspace {
    /// The device's frame is the scene's.
    fn default() -> Self {
        Self { position: DVec3::ZERO, orientation: DQuat::IDENTITY, scale: 1.0, force_scale: 1.0, clutch: None }
    }
}

impl Workspace {
    /// What a device can render, as the scene sees it.
    pub fn limits_in_scene(&self, device: &DeviceLimits) -> DeviceLimits {
        let (s, c) = (self.scale, self.force_scale);
        // Angles are not scaled: a torque per angle goes by the torque alone.
        let turning = c / s;
        DeviceLimits {
            max_force: device.max_force / c,
            max_torque: device.max_torque / turning,
            max_stiffness: device.max_stiffness / (c * s),
            max_damping: device.max_damping / (c * s),
            max_angular_damping: device.max_angular_damping / turning,
            own_damping: device.own_damping.map(|damping| damping / (c * s)),
            delay: device.delay,
            max_speed: device.max_speed.map(|speed| speed * s),
            rate: device.rate,
        }
    }

    fn turns(&self) -> bool {
        self.orientation != DQuat::IDENTITY
    }
}

/// A device in a scene: itself a device, in the scene's frame and units.
pub struct MountedDevice {
    device: Box<dyn Device>,
    workspace: Workspace,
    limits: DeviceLimits,
    /// What the clutch has added to the position, m of the scene.
    offset: DVec3,
    /// Where the tool was, in the scene, when the clutch was pressed.
    held_at: Option<DVec3>,
}

impl MountedDevice {
    /// With limits of the scene on top of the device's own, both at the device.
    pub fn new(device: Box<dyn Device>, workspace: Workspace, scene_limits: &DeviceLimits) -> Self {
        let limits = workspace.limits_in_scene(&device.limits().lower_of(scene_limits));
        Self { device, workspace, limits, offset: DVec3::ZERO, held_at: None }
    }

    /// Takes the clutch's button out of the reading, and the tool out of the scene while that button is held.
    fn apply_clutch(&mut self, reading: &mut Reading) {
        let Some(button) = self.workspace.clutch else { return };
        let bit = 1u32.checked_shl(u32::from(button)).unwrap_or(0);
        let pressed = reading.buttons.0 & bit != 0;
        reading.buttons.0 &= !bit;
        let position = reading.pose.position;
        // A device that is away, or measures nothing, says nothing of its button either.
        if !reading.active || !position.is_finite() {
            return;
        }
        match (pressed, self.held_at) {
            (true, None) => self.held_at = Some(position),
            (false, Some(held)) => {
                self.offset += held - position;
                reading.pose.position = held;
                self.held_at = None;
            }
            _ => {}
        }
        if let Some(held) = self.held_at {
            (reading.pose.position, reading.twist, reading.active) = (held, Twist::default(), false);
        }
    }
}

impl Device for MountedDevice {
    fn name(&self) -> &str {
        self.device.name()
    }

    fn read(&mut self, now_ns: u64, period: f64) -> Result<Reading, DeviceFault> {
        let Workspace { position, orientation, scale, .. } = self.workspace;
        let mut reading = self.device.read(now_ns, period)?;
        if self.workspace.turns() {
            let Reading { pose, twist, .. } = &mut reading;
            *pose = Pose { position: orientation * pose.position, orientation: orientation * pose.orientation };
            *twist = Twist { linear: orientation * twist.linear, angular: orientation * twist.angular };
        }
        reading.pose.position = position + scale * reading.pose.position + self.offset;
        reading.twist.linear *= scale;
        self.apply_clutch(&mut reading);
        Ok(reading)
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        let Workspace { orientation, scale, force_scale, .. } = self.workspace;
        let mut of_device = Wrench { force: force_scale * wrench.force, torque: (force_scale / scale) * wrench.torque };
        if self.workspace.turns() {
            let back = orientation.inverse();
            of_device = Wrench { force: back * of_device.force, torque: back * of_device.torque };
        }
        self.device.write(of_device)
    }

    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::Buttons;

    /// Says what it is told to, and remembers what it got.
    struct FixedDevice {
        input: Arc<Mutex<Reading>>,
        written: Arc<Mutex<Wrench>>,
    }

    impl Device for FixedDevice {
        fn name(&self) -> &str {
            "told"
        }

        fn read(&mut self, _: u64, _: f64) -> Result<Reading, DeviceFault> {
            Ok(*self.input.lock().expect("not poisoned"))
        }

        fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
            *self.written.lock().expect("not poisoned") = wrench;
            Ok(())
        }

        fn limits(&self) -> DeviceLimits {
            DeviceLimits { max_force: 4.0, max_stiffness: 600.0, own_damping: Some(2.0), ..DeviceLimits::UNLIMITED }
        }
    }

    fn mounted(workspace: Workspace) -> (MountedDevice, Arc<Mutex<Reading>>, Arc<Mutex<Wrench>>) {
        let (input, written) = (Arc::default(), Arc::default());
        let fixed = FixedDevice { input: Arc::clone(&input), written: Arc::clone(&written) };
        (MountedDevice::new(Box::new(fixed), workspace, &DeviceLimits::UNLIMITED), input, written)
    }

    fn workspace() -> Workspace {
        Workspace {
            position: DVec3::new(0.1, 0.2, 0.3),
            orientation: DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
            scale: 2.0,
            force_scale: 0.5,
            clutch: Some(1),
        }
    }

    fn reading(position: DVec3, buttons: u32) -> Reading {
        let twist = Twist { linear: DVec3::new(0.0, 0.3, 0.1), angular: DVec3::X };
        Reading { pose: Pose::at(position), twist, buttons: Buttons(buttons), active: true, timestamp_ns: 0 }
    }

    #[test]
    fn positions_are_mapped_and_power_keeps_its_ratio() {
        let (mut device, input, written) = mounted(workspace());
        *input.lock().expect("not poisoned") = reading(DVec3::new(0.01, 0.0, 0.02), 0);
        let seen = device.read(0, 1e-3).expect("a reading");
        // x of the device is y of the scene.
        assert!((seen.pose.position - DVec3::new(0.1, 0.22, 0.34)).length() < 1e-15);
        assert!((seen.twist.linear - DVec3::new(-0.6, 0.0, 0.2)).length() < 1e-15);
        assert!((seen.pose.orientation * DVec3::X - DVec3::Y).length() < 1e-15);
        let wrench = Wrench { force: DVec3::new(1.0, -2.0, 3.0), torque: DVec3::new(0.1, 0.4, 0.2) };
        device.write(wrench).expect("taken");
        let (written, input) = (*written.lock().expect("not poisoned"), *input.lock().expect("not poisoned"));
        assert!((written.force - DVec3::new(-1.0, -0.5, 1.5)).length() < 1e-15, "{:?}", written.force);
        for (of_scene, of_device) in [
            (wrench.force.dot(seen.twist.linear), written.force.dot(input.twist.linear)),
            (wrench.torque.dot(seen.twist.angular), written.torque.dot(input.twist.angular)),
        ] {
            assert!((of_device - 0.25 * of_scene).abs() < 1e-15);
        }
    }

    #[test]
    fn limits_are_those_of_the_hand() {
        let (device, ..) = mounted(workspace());
        let limits = device.limits();
        // 600 N/m in the hand: c s K = 0.5 * 2 * 600.
        assert_eq!((limits.max_force, limits.max_stiffness), (8.0, 600.0));
        let (coarse, ..) = mounted(Workspace { scale: 4.0, force_scale: 1.0, ..workspace() });
        assert_eq!(coarse.limits().max_stiffness, 150.0);
        assert_eq!(coarse.limits().own_damping, Some(0.5));
        let lower = DeviceLimits { max_force: 1.0, ..DeviceLimits::UNLIMITED };
        let fixed = FixedDevice { input: Arc::default(), written: Arc::default() };
        assert_eq!(MountedDevice::new(Box::new(fixed), Workspace::default(), &lower).limits().max_force, 1.0);
    }

    #[test]
    fn the_clutch_lets_the_hand_reach_for_more() {
        let (mut device, input, _) = mounted(Workspace { orientation: DQuat::IDENTITY, ..workspace() });
        let mut tick = |x: f64, buttons: u32| {
            *input.lock().expect("not poisoned") = reading(DVec3::new(x, 0.0, 0.0), buttons);
            device.read(0, 1e-3).expect("a reading")
        };
        assert_eq!(tick(0.05, 0b01).pose.position.x, 0.2);
        let held = tick(0.05, 0b10);
        assert!(!held.active && held.buttons == Buttons(0) && held.twist.linear == DVec3::ZERO);
        assert_eq!(tick(-0.05, 0b11).pose.position.x, 0.2);
        let free = tick(-0.05, 0b01);
        assert!(free.active && free.buttons.grab());
        assert!((free.pose.position.x - 0.2).abs() < 1e-15, "it goes on from where it was");
        assert!((tick(-0.04, 0).pose.position.x - 0.22).abs() < 1e-15);
        // Away while the button is held: it is where it was when it is back.
        assert!(!tick(-0.04, 0b10).active);
        *input.lock().expect("not poisoned") = Reading::default();
        assert!(!device.read(0, 1e-3).expect("a reading").active);
        *input.lock().expect("not poisoned") = reading(DVec3::new(f64::NAN, 0.0, 0.0), 0);
        assert!(device.read(0, 1e-3).expect("a reading").pose.position.x.is_nan());
        *input.lock().expect("not poisoned") = reading(DVec3::new(-0.04, 0.0, 0.0), 0);
        assert!((device.read(0, 1e-3).expect("a reading").pose.position.x - 0.22).abs() < 1e-15);
    }

    #[test]
    fn a_device_in_place_changes_no_bit() {
        let (mut device, input, written) = mounted(Workspace::default());
        let exact = reading(DVec3::new(0.1, 1.0 / 3.0, -0.7), 3);
        *input.lock().expect("not poisoned") = exact;
        assert_eq!(device.read(0, 1e-3), Ok(exact));
        let wrench = Wrench { force: DVec3::new(1.0 / 3.0, 0.0, 2.0), torque: DVec3::Z };
        device.write(wrench).expect("taken");
        assert_eq!(*written.lock().expect("not poisoned"), wrench);
    }
}
