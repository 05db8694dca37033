//! Options of bodies, tools, devices and scenes.
#![allow(unsafe_code)] // structs of callers are filled
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use std::collections::BTreeMap;
use std::ffi::c_char;

use palpate_core::contact::shape::ToolShape;
use palpate_core::simulation::LawKind;
use palpate_devices::{DeviceLimits, known};
use palpate_scene::{DEFAULT_FRICTION, DEFAULT_MAX_STIFFNESS, Scene, Tool};

use crate::arguments::{array, text};
use crate::status::{Outcome, Refusal, Status, catching_panics};
use crate::versioned_struct::{self, VersionedStruct};

/// A sphere of `radius` around the tool's origin.
pub const PALPATE_SHAPE_SPHERE: u32 = 0;
/// An ellipsoid of `semi_axes`.
pub const PALPATE_SHAPE_ELLIPSOID: u32 = 1;
/// A cylinder of `radius` and `length` along z, with a hemisphere around the origin and one at its other end.
pub const PALPATE_SHAPE_CAPSULE: u32 = 2;
/// A cylinder of `radius` along z, whose flat face with a rim of `rounding` lies in the plane z = 0.
pub const PALPATE_SHAPE_PUNCH: u32 = 3;
/// A closed surface of `vertices` and `triangles`.
pub const PALPATE_SHAPE_SURFACE: u32 = 4;

/// The local law where the elastic constants of every body are known, else patches.
pub const PALPATE_LAW_DEFAULT: u32 = 0;
/// Contact with a half-space in series with the finite elements: slides and rubs.
pub const PALPATE_LAW_LOCAL: u32 = 1;
/// A disc of `contact_radius` that sticks to what it first touched; for spheres.
pub const PALPATE_LAW_PATCH: u32 = 2;
/// The node closest to where the tool first touched; for spheres.
pub const PALPATE_LAW_NODE: u32 = 3;

/// Where a body stands and what it is made of. Fill it by palpate_body_options_init first.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct BodyOptions {
    /// sizeof(palpate_body_options).
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Of the body's own origin, m.
    pub position: [f64; 3],
    /// World from body, a unit quaternion w x y z.
    pub orientation: [f64; 4],
    /// Young's modulus at the surface, Pa, of a body of one material whose store does not say it; 0 for what the store says.
    pub youngs_modulus: f64,
    /// Poisson's ratio at the surface.
    pub poissons_ratio: f64,
}

impl Default for BodyOptions {
    fn default() -> Self {
        Self { orientation: [1.0, 0.0, 0.0, 0.0], ..versioned_struct::zeroed() }
    }
}

// SAFETY: numbers only; the size comes first.
unsafe impl VersionedStruct for BodyOptions {
    const NAME: &str = "palpate_body_options";
    const FIRST_SIZE: usize = 80;
}

/// What a tool looks like and how it touches. Fill it by palpate_tool_options_init first.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ToolOptions {
    /// sizeof(palpate_tool_options).
    pub struct_size: u32,
    /// PALPATE_SHAPE_...
    pub shape: u32,
    /// Of sphere, capsule and punch, m; 0 for a sphere of a sixteenth of the smallest body.
    pub radius: f64,
    /// Of a capsule: distance between the centres of its hemispheres, m.
    pub length: f64,
    /// Of a punch: radius of its rim, m.
    pub rounding: f64,
    /// Of an ellipsoid, m.
    pub semi_axes: [f64; 3],
    /// Of a surface: x y z of each vertex, m; read when the tool is added.
    pub vertices: *const f64,
    /// Vertices of a surface.
    pub vertex_count: usize,
    /// Of a surface: three vertices of each triangle, outward.
    pub triangles: *const u32,
    /// Triangles of a surface.
    pub triangle_count: usize,
    /// PALPATE_LAW_...
    pub law: u32,
    /// 0.
    pub reserved: u32,
    /// Radius of patches, and of what a grab holds, m; 0 for one that suits the bodies.
    pub contact_radius: f64,
    /// Coulomb's coefficient of friction; 0 slides freely.
    pub friction: f64,
    /// Young's modulus of its pad, Pa; 0 for a rigid tool.
    pub pad_youngs_modulus: f64,
    /// Stiffest contact rendered, N/m.
    pub max_stiffness: f64,
}

impl Default for ToolOptions {
    fn default() -> Self {
        // A sphere under the law that suits the bodies: both are zero.
        Self { friction: DEFAULT_FRICTION, max_stiffness: DEFAULT_MAX_STIFFNESS, ..versioned_struct::zeroed() }
    }
}

// SAFETY: numbers and pointers only; the size comes first.
unsafe impl VersionedStruct for ToolOptions {
    const NAME: &str = "palpate_tool_options";
    const FIRST_SIZE: usize = 96 + 4 * size_of::<usize>();
}

impl ToolOptions {
    /// The tool of a scene.
    ///
    /// # Safety
    /// Vertices and triangles are null or as many as stated.
    pub unsafe fn tool(&self) -> Outcome<Tool> {
        let of = ToolShape::of_lengths;
        let shape = match self.shape {
            PALPATE_SHAPE_SPHERE if self.radius == 0.0 => None,
            PALPATE_SHAPE_SPHERE => Some(of("sphere", [self.radius, 0.0, 0.0])?),
            PALPATE_SHAPE_ELLIPSOID => Some(of("ellipsoid", self.semi_axes)?),
            PALPATE_SHAPE_CAPSULE => Some(of("capsule", [self.radius, self.length, 0.0])?),
            PALPATE_SHAPE_PUNCH => Some(of("punch", [self.radius, self.rounding, 0.0])?),
            // SAFETY: the caller's.
            PALPATE_SHAPE_SURFACE => Some(unsafe { self.surface() }?),
            other => return Err(Refusal::argument(format!("there is no shape {other}"))),
        };
        let law = match self.law {
            PALPATE_LAW_DEFAULT => None,
            PALPATE_LAW_LOCAL => Some(LawKind::LOCAL),
            PALPATE_LAW_PATCH => Some(LawKind::PATCH),
            PALPATE_LAW_NODE => Some(LawKind::NODE),
            other => return Err(Refusal::argument(format!("there is no contact law {other}"))),
        };
        let given = |name: &str, value: f64| match value {
            0.0 => Ok(None),
            _ if value > 0.0 && value.is_finite() => Ok(Some(value)),
            _ => Err(Refusal::argument(format!("{name} is {value}, it must be positive, or 0 for the default"))),
        };
        if !matches!(shape, None | Some(ToolShape::Sphere { .. })) && !matches!(law, None | Some(LawKind::LOCAL)) {
            return Err(Refusal::argument(
                "patches and nodes are for spheres: a tool of another shape takes the local law",
            ));
        }
        let mut settings = BTreeMap::from([("friction".into(), self.friction)]);
        settings.extend(given("contact_radius", self.contact_radius)?.map(|radius| ("contact_radius".into(), radius)));
        Ok(Tool {
            shape,
            law,
            settings,
            pad_youngs_modulus: given("pad_youngs_modulus", self.pad_youngs_modulus)?,
            max_stiffness: self.max_stiffness,
            ..Tool::default()
        })
    }

    /// # Safety
    /// As of [`ToolOptions::tool`].
    unsafe fn surface(&self) -> Outcome<ToolShape> {
        // SAFETY: the caller's.
        let (vertices, triangles) = unsafe {
            (
                array(self.vertices.cast::<[f64; 3]>(), self.vertex_count, "vertices")?,
                array(self.triangles.cast::<[u32; 3]>(), self.triangle_count, "triangles")?,
            )
        };
        if let Some(beyond) = triangles.as_flattened().iter().find(|&&v| v as usize >= vertices.len()) {
            return Err(Refusal::argument(format!("triangles: there is no vertex {beyond}, of {}", vertices.len())));
        }
        Ok(ToolShape::surface(vertices, triangles)?)
    }
}

/// What the device of a tool can render, for loops that the program ticks. Fill it by palpate_device_limits_init, a device
/// without hardware, or by palpate_device_limits_known first. What is INFINITY is not limited.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct DeviceOptions {
    /// sizeof(palpate_device_limits).
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Largest force, N.
    pub max_force: f64,
    /// Largest torque, N m.
    pub max_torque: f64,
    /// Stiffest contact that it holds without oscillating, N/m.
    pub max_stiffness: f64,
    /// Strongest damping that it holds, N s/m.
    pub max_damping: f64,
    /// Strongest damping of rotation that it holds, N m s/rad.
    pub max_angular_damping: f64,
    /// Damping of its own mechanics at the tip, N s/m; 0 where it is not known.
    pub own_damping: f64,
    /// Time from a measurement to the force that answers it beyond that of the tick, s.
    pub delay: f64,
    /// Fastest that a hand moves its tip, m/s: what looks faster is a fault of its sensors.
    pub max_speed: f64,
    /// Fastest rate at which it takes wrenches, Hz.
    pub rate: f64,
}

impl DeviceOptions {
    fn of(limits: DeviceLimits) -> Self {
        Self {
            struct_size: size_of::<Self>() as u32,
            reserved: 0,
            max_force: limits.max_force,
            max_torque: limits.max_torque,
            max_stiffness: limits.max_stiffness,
            max_damping: limits.max_damping,
            max_angular_damping: limits.max_angular_damping,
            own_damping: limits.own_damping.unwrap_or(0.0),
            delay: limits.delay,
            max_speed: limits.max_speed.unwrap_or(f64::INFINITY),
            rate: limits.rate.unwrap_or(f64::INFINITY),
        }
    }

    /// As the safety stage takes them.
    pub fn limits(&self) -> DeviceLimits {
        DeviceLimits {
            max_force: self.max_force,
            max_torque: self.max_torque,
            max_stiffness: self.max_stiffness,
            max_damping: self.max_damping,
            max_angular_damping: self.max_angular_damping,
            own_damping: (self.own_damping != 0.0).then_some(self.own_damping),
            delay: self.delay,
            max_speed: (self.max_speed != f64::INFINITY).then_some(self.max_speed),
            rate: (self.rate != f64::INFINITY).then_some(self.rate),
        }
    }
}

impl Default for DeviceOptions {
    fn default() -> Self {
        Self::of(DeviceLimits::UNLIMITED)
    }
}

// SAFETY: numbers only; the size comes first.
unsafe impl VersionedStruct for DeviceOptions {
    const NAME: &str = "palpate_device_limits";
    const FIRST_SIZE: usize = 80;
}

/// Limits of the safety stage, and how the loop's own thread runs. Read those of a scene by palpate_scene_get_options first.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SceneOptions {
    /// sizeof(palpate_scene_options).
    pub struct_size: u32,
    /// Priority of the loop's own thread under SCHED_FIFO, 1 to 99, where the system grants it; 0 asks for none.
    pub priority: u32,
    /// Largest force, N.
    pub max_force: f64,
    /// Fastest change of the force other than a release, N/s.
    pub max_slew: f64,
    /// Largest torque, N m.
    pub max_torque: f64,
    /// Fastest change of the torque other than a release, N m/s.
    pub max_torque_slew: f64,
    /// Time over which forces are let in after the start and after a reset, s.
    pub ramp: f64,
    /// Largest strain to which tools may take a body; 0 for any.
    pub strain_limit: f64,
    /// Ticks a second of the loop's own thread, 100 to 10000 Hz, and of palpate_scene_run.
    pub rate: f64,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self::of(&Scene::default())
    }
}

// SAFETY: numbers only; the size comes first.
unsafe impl VersionedStruct for SceneOptions {
    const NAME: &str = "palpate_scene_options";
    const FIRST_SIZE: usize = 64;
}

impl SceneOptions {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self {
            struct_size: size_of::<Self>() as u32,
            priority: scene.scheduling.priority.into(),
            max_force: scene.limits.max_force,
            max_slew: scene.limits.max_slew,
            max_torque: scene.limits.max_torque,
            max_torque_slew: scene.limits.max_torque_slew,
            ramp: scene.limits.ramp,
            strain_limit: scene.strain_limit,
            rate: scene.scheduling.rate,
        }
    }

    /// Gives them to a scene, which stays as it is where one of them is out of range.
    ///
    /// # Errors
    /// The one that is, by name.
    pub fn apply_to(&self, scene: &mut Scene) -> Outcome {
        let mut limits = scene.limits;
        (limits.max_force, limits.max_slew, limits.ramp) = (self.max_force, self.max_slew, self.ramp);
        (limits.max_torque, limits.max_torque_slew) = (self.max_torque, self.max_torque_slew);
        limits.check()?;
        let priority = u8::try_from(self.priority).unwrap_or(u8::MAX);
        let scheduling = palpate_servo::Scheduling { rate: self.rate, priority, cpus: scene.scheduling.cpus.clone() };
        scheduling.check()?;
        if !(0.0..=1.0).contains(&self.strain_limit) {
            return Err(Refusal::argument(format!("strain_limit is {}, it must lie in [0, 1]", self.strain_limit)));
        }
        (scene.limits, scene.scheduling, scene.strain_limit) = (limits, scheduling, self.strain_limit);
        Ok(())
    }
}

/// Fills the options of a body with defaults: at the origin, not turned. Pass sizeof(palpate_body_options).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_body_options_init(options: *mut BodyOptions, struct_size: usize) -> Status {
    // SAFETY: the caller's pointer.
    unsafe { init(options, struct_size) }
}

/// Fills the options of a tool with defaults: a ball that suits the bodies. Pass sizeof(palpate_tool_options).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_tool_options_init(options: *mut ToolOptions, struct_size: usize) -> Status {
    // SAFETY: the caller's pointer.
    unsafe { init(options, struct_size) }
}

/// Fills the limits of a device: none at all, a device without hardware. Pass sizeof(palpate_device_limits).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_device_limits_init(limits: *mut DeviceOptions, struct_size: usize) -> Status {
    // SAFETY: the caller's pointer.
    unsafe { init(limits, struct_size) }
}

/// Fills the limits of a device that is sold, by its name: Touch, PHANTOM Omni, PHANTOM Desktop, Falcon, omega, sigma.7,
/// lambda.7 or Inverse3. Pass sizeof(palpate_device_limits).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_device_limits_known(
    name: *const c_char,
    limits: *mut DeviceOptions,
    struct_size: usize,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let name = unsafe { text(name, "name") }?;
        let found = known::ALL.iter().find(|(other, _)| other.eq_ignore_ascii_case(name));
        let Some((_, found)) = found else {
            let names: Vec<_> = known::ALL.iter().map(|(name, _)| *name).collect();
            return Err(Refusal::argument(format!("no device '{name}' is known: there are {}", names.join(", "))));
        };
        // SAFETY: the caller's pointer.
        unsafe { versioned_struct::write_as(&DeviceOptions::of(*found), limits, struct_size) }
    })
}

/// # Safety
/// The pointer is null or points to `struct_size` bytes.
unsafe fn init<T: VersionedStruct>(options: *mut T, struct_size: usize) -> Status {
    // SAFETY: the caller's.
    catching_panics(|| unsafe { versioned_struct::write_as(&T::default(), options, struct_size) })
}
