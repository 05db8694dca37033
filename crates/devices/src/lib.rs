//! Haptic devices behind one trait. A driver knows positions and forces in world coordinates, nothing of bodies.

pub mod simulated;

use glam::DVec3;

/// What a device says at a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct DeviceState {
    /// Tip position, m.
    pub position: DVec3,
    /// Tip velocity, m/s.
    pub velocity: DVec3,
    /// Whether the tip is in the scene.
    pub active: bool,
    /// Whether the grab button is held.
    pub grab: bool,
}

/// One haptic device. Both calls belong to the tick: they never allocate, lock or block.
pub trait Device: Send {
    /// The device's state now; `period` is the time since the last call, s.
    fn read(&mut self, period: f64) -> DeviceState;
    /// Puts out a force on the hand, N.
    fn write(&mut self, force: DVec3);
}
