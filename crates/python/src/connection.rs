//! Opening of devices from Python, and their hand-over to the loop.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use palpate_core::Error;
use palpate_devices::simulated::Handle;
use palpate_devices::{Connection, Device, DeviceLimits, MountedDevice, OpenError, ReadyDevice, Scheduler, Workspace};
use palpate_scene::unit_quaternion;
use pyo3::prelude::*;

use crate::errors::Answer;

/// Largest force (N), torque (N m), stiffness (N/m), damping (N s/m), damping of rotation (N m s/rad), own damping (N s/m)
/// or None, delay (s), greatest speed (m/s) or None, greatest rate (Hz) or None.
pub type LimitsArguments = (f64, f64, f64, f64, f64, Option<f64>, f64, Option<f64>, Option<f64>);
/// Position (m) and orientation (w x y z) of a device in the scene, metres of the scene per metre of the device, force on the hand per
/// force in the scene, and the button of the clutch.
pub type WorkspaceArguments = ([f64; 3], [f64; 4], f64, f64, Option<u8>);

/// From Python.
pub fn limits_of(arguments: LimitsArguments) -> DeviceLimits {
    let (max_force, max_torque, max_stiffness, max_damping, max_angular_damping, own_damping, delay, max_speed, rate) =
        arguments;
    DeviceLimits {
        max_force,
        max_torque,
        max_stiffness,
        max_damping,
        max_angular_damping,
        own_damping,
        delay,
        max_speed,
        rate,
    }
}

/// For Python.
pub fn limits_tuple(limits: &DeviceLimits) -> LimitsArguments {
    let l = limits;
    let (damping, turning) = (l.max_damping, l.max_angular_damping);
    (l.max_force, l.max_torque, l.max_stiffness, damping, turning, l.own_damping, l.delay, l.max_speed, l.rate)
}

/// A device that has been opened, until a loop takes it.
#[pyclass(module = "palpate._native")]
pub struct OpenedDevice {
    /// Shared by no two threads at once.
    opened: Mutex<Option<ReadyDevice>>,
    name: String,
    limits: DeviceLimits,
}

impl From<ReadyDevice> for OpenedDevice {
    fn from(opened: ReadyDevice) -> Self {
        let (name, limits) = (opened.device.name().to_owned(), opened.device.limits());
        Self { opened: Mutex::new(Some(opened)), name, limits }
    }
}

impl OpenedDevice {
    /// What a loop takes, once.
    ///
    /// # Errors
    /// A device that a loop has taken already.
    pub fn take(&mut self) -> Result<ReadyDevice, OpenError> {
        let taken = || OpenError::new(self.name.clone(), "another loop has this device: open it once more");
        let opened = self.opened.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        opened.ok_or_else(taken)
    }
}

#[pymethods]
impl OpenedDevice {
    /// Opens the device of a kind.
    #[new]
    fn new(
        py: Python<'_>,
        kind: &str,
        id: Option<String>,
        address: Option<String>,
        library: Option<PathBuf>,
    ) -> Answer<Self> {
        let connection = Connection { id, address, library };
        Ok(py.detach(|| palpate_devices::open(kind, &connection))?.into())
    }

    /// What a person knows it by.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// What it can render.
    #[getter]
    fn limits(&self) -> LimitsArguments {
        limits_tuple(&self.limits)
    }
}

/// A device as a tool of a scene has it.
pub struct Connected {
    /// Shared by no two threads at once.
    pub device: Mutex<Box<dyn Device>>,
    pub limits: DeviceLimits,
    pub scheduler: Option<Arc<dyn Scheduler>>,
}

impl Connected {
    /// In a workspace, with limits of the scene at the device.
    ///
    /// # Errors
    /// A device that a loop has taken already.
    pub fn new(
        device: &mut OpenedDevice,
        workspace: WorkspaceArguments,
        limits: LimitsArguments,
    ) -> Result<Self, OpenError> {
        let (position, orientation, scale, force_scale, clutch) = workspace;
        let (position, orientation) = (position.into(), unit_quaternion(orientation));
        let workspace = Workspace { position, orientation, scale, force_scale, clutch };
        let ReadyDevice { device, scheduler } = device.take()?;
        let mounted = MountedDevice::new(device, workspace, &limits_of(limits));
        Ok(Self { limits: mounted.limits(), device: Mutex::new(Box::new(mounted)), scheduler })
    }
}

/// A device for the loop, and what moves it if it is a simulated one.
pub struct LoopDevice {
    pub device: Box<dyn Device>,
    pub handle: Option<Handle>,
    pub scheduler: Option<Arc<dyn Scheduler>>,
}

/// The driver that calls the tick, if some device has one.
///
/// # Errors
/// Two of them, or one at another rate than the scene's.
pub fn common_scheduler(devices: &[LoopDevice], rate: f64) -> palpate_core::Result<Option<Arc<dyn Scheduler>>> {
    let mut schedulers = devices.iter().filter_map(|device| device.scheduler.clone());
    let Some(first) = schedulers.next() else { return Ok(None) };
    if schedulers.any(|other| !Arc::ptr_eq(&first, &other)) {
        return Err(Error::Invalid("two devices have drivers that each call the loop: use one of them".into()));
    }
    let its_own = first.rate();
    if its_own != rate {
        return Err(Error::Invalid(format!(
            "the device's driver calls the loop {its_own} times a second, the scene asks for {rate}: set device.rate = {its_own}"
        )));
    }
    Ok(Some(first))
}
