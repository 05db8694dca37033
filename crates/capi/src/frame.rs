//! Results of a tick for drawing: forces, contacts, deformed surfaces, statistics.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use std::ffi::c_char;

use glam::DVec3;
use palpate_core::simulation::{Contact, MAX_CONTACTS, MAX_TOOLS, Mode};
use palpate_scene::{PreparedScene, wxyz};
use palpate_servo::{Published, Summary};

use crate::arguments::{array_mut, exclusive, require_count, shared};
use crate::force_loop::Loop;
use crate::status::{Outcome, Status, catching_panics};
use crate::store::put_triangles;
use crate::versioned_struct::{self, VersionedStruct};

/// Most tools of a scene.
pub const PALPATE_MAX_TOOLS: usize = 4;
/// Most contacts at once.
pub const PALPATE_MAX_CONTACTS: usize = 24;
/// Bytes of palpate_frame.fault.
pub const PALPATE_FAULT_BYTES: usize = 192;

const _: () = assert!(PALPATE_MAX_TOOLS == MAX_TOOLS && PALPATE_MAX_CONTACTS == MAX_CONTACTS);

/// Times, us. Never grows.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct Times {
    /// Half are below.
    pub p50: f64,
    /// 99 % are below.
    pub p99: f64,
    /// 99.9 % are below.
    pub p999: f64,
    /// The largest.
    pub max: f64,
}

impl From<Summary> for Times {
    fn from(Summary { p50, p99, p999, max }: Summary) -> Self {
        Self { p50, p99, p999, max }
    }
}

/// Numbers of a tick; tools stand in the order in which they were added to the scene. Set struct_size before it is filled.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Frame {
    /// sizeof(palpate_frame).
    pub struct_size: u32,
    /// Tools of the loop.
    pub tools: u32,
    /// Contacts that palpate_loop_get_contacts writes.
    pub contacts: u32,
    /// Whether a fault has latched: 0 or 1.
    pub faulty: u32,
    /// What happened, and what to do; empty without a fault.
    pub fault: [c_char; PALPATE_FAULT_BYTES],
    /// Ticks since the start.
    pub ticks: u64,
    /// Time since the first tick, s.
    pub time: f64,
    /// Force on each device, N.
    pub forces: [[f64; 3]; PALPATE_MAX_TOOLS],
    /// Torque about each tip, N m.
    pub torques: [[f64; 3]; PALPATE_MAX_TOOLS],
    /// Tip of each tool, m.
    pub positions: [[f64; 3]; PALPATE_MAX_TOOLS],
    /// Orientation of each tool, w x y z.
    pub orientations: [[f64; 4]; PALPATE_MAX_TOOLS],
    /// Whether each tool is in the scene: 0 or 1.
    pub active: [u32; PALPATE_MAX_TOOLS],
    /// Whether the limit of strain keeps each tool from following its device: 0 or 1.
    pub limited: [u32; PALPATE_MAX_TOOLS],
    /// How long ticks take, us.
    pub compute_us: Times,
    /// How late ticks begin, us.
    pub wakeup_us: Times,
    /// Deadlines that passed within ticks that took too long.
    pub missed_computing: u64,
    /// Deadlines that passed before ticks that began too late.
    pub missed_waking: u64,
    /// Whether the system granted the loop's own thread real-time scheduling: 0 or 1.
    pub realtime: u32,
    /// Whether the system granted that thread locked memory: 0 or 1.
    pub locked_memory: u32,
}

impl Default for Frame {
    fn default() -> Self {
        versioned_struct::zeroed()
    }
}

// SAFETY: numbers only; the size comes first.
unsafe impl VersionedStruct for Frame {
    const NAME: &str = "palpate_frame";
    const FIRST_SIZE: usize = 760;
}

impl Frame {
    fn of(published: &Published, tools: usize) -> Self {
        let Published { status, state } = published;
        let mut frame = Self {
            tools: tools as u32,
            contacts: state.contacts.iter().count() as u32,
            ticks: status.ticks,
            time: status.time,
            compute_us: status.compute.into(),
            wakeup_us: status.wakeup.into(),
            missed_computing: status.missed_computing,
            missed_waking: status.missed_waking,
            realtime: u32::from(status.realtime.priority),
            locked_memory: u32::from(status.realtime.locked_memory),
            ..Self::default()
        };
        if let Some(fault) = status.fault {
            frame.faulty = 1;
            // The last byte stays the zero that ends it.
            let text = fault.to_string();
            let bytes = text.bytes().take(PALPATE_FAULT_BYTES - 1);
            frame.fault.iter_mut().zip(bytes).for_each(|(to, byte)| *to = byte as c_char);
        }
        for tool in 0..tools {
            let (wrench, reading) = (&status.wrenches[tool], &status.readings[tool]);
            frame.forces[tool] = wrench.force.to_array();
            frame.torques[tool] = wrench.torque.to_array();
            frame.positions[tool] = reading.pose.position.to_array();
            frame.orientations[tool] = wxyz(reading.pose.orientation);
            frame.active[tool] = u32::from(reading.active);
            frame.limited[tool] = u32::from(status.limited[tool]);
        }
        frame
    }
}

/// A contact; vectors are in the world. Never grows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ContactRecord {
    /// Handle of the tool.
    pub tool: u32,
    /// Handle of the body.
    pub body: u32,
    /// Whether the tool holds on: 0 or 1.
    pub grabs: u32,
    /// Whether it slips: 0 or 1.
    pub slips: u32,
    /// Whether the limit of strain holds it back: 0 or 1.
    pub limited: u32,
    /// 0.
    pub reserved: u32,
    /// Contact point on the untouched surface, m.
    pub point: [f64; 3],
    /// Outward unit normal there.
    pub normal: [f64; 3],
    /// On the body, N.
    pub force: [f64; 3],
    /// On the body about the contact point, N m.
    pub torque: [f64; 3],
    /// Radius of the contact, m, under the local law; 0 otherwise, as what follows.
    pub radius: f64,
    /// Depth, m, under the local law.
    pub depth: f64,
    /// Stiffness, N/m, under the local law.
    pub stiffness: f64,
}

/// Takes the latest tick and writes its numbers. Contacts and surfaces that are read next are of the same tick. Never waits for
/// the tick; callers of frames and settings wait for each other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_get_frame(force_loop: *mut Loop, frame: *mut Frame) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let own = unsafe { shared(force_loop, "loop") }?;
        let mut side = own.frame();
        let tools = side.prepared.tools.len();
        let filled = Frame::of(side.refresh(), tools);
        // SAFETY: the caller's pointer.
        unsafe { versioned_struct::write(&filled, frame) }
    })
}

/// Contacts of the tick of the last palpate_loop_get_frame: `count` gets how many there are, of which `capacity` are written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_get_contacts(
    force_loop: *mut Loop,
    contacts: *mut ContactRecord,
    capacity: usize,
    count: *mut usize,
) -> Status {
    // SAFETY: the caller's pointers.
    catching_panics(|| unsafe { put_contacts(force_loop, (contacts, capacity, "contacts"), count, record) })
}

/// Estimated relative error of the force of each contact, in the order of palpate_loop_get_contacts; 0 for a linear material.
/// `count` gets how many there are, of which `capacity` are written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_get_contact_errors(
    force_loop: *mut Loop,
    errors: *mut f64,
    capacity: usize,
    count: *mut usize,
) -> Status {
    // SAFETY: the caller's pointers.
    catching_panics(|| unsafe {
        put_contacts(force_loop, (errors, capacity, "errors"), count, |_, contact| contact.error)
    })
}

/// Writes a value of each contact of the last frame, and how many contacts there are.
///
/// # Safety
/// The pointers are null, or point to a loop, to as many values as stated, and to a count.
unsafe fn put_contacts<T>(
    force_loop: *const Loop,
    (values, capacity, name): (*mut T, usize, &'static str),
    count: *mut usize,
    value: impl Fn(&PreparedScene, &Contact) -> T,
) -> Outcome {
    // SAFETY: the caller's pointers.
    let (own, values, count) =
        unsafe { (shared(force_loop, "loop")?, array_mut(values, capacity, name)?, exclusive(count, "count")?) };
    let side = own.frame();
    let found = || side.latest.state.contacts.iter();
    *count = found().count();
    values.iter_mut().zip(found()).for_each(|(to, (contact, _))| *to = value(&side.prepared, contact));
    Ok(())
}

fn record(prepared: &PreparedScene, contact: &Contact) -> ContactRecord {
    let placement = &prepared.model.bodies[contact.body].placement;
    let vector = |v: DVec3| placement.vector_to_world(v).to_array();
    let (body, tool) = (prepared.bodies[contact.body].0, prepared.tools[contact.tool].0);
    ContactRecord {
        tool,
        body,
        grabs: u32::from(contact.mode == Mode::Grab),
        slips: u32::from(contact.slipping),
        limited: u32::from(contact.limited),
        reserved: 0,
        point: placement.point_to_world(contact.point).to_array(),
        normal: vector(contact.normal),
        force: vector(contact.force),
        torque: vector(-contact.torque),
        radius: contact.radius,
        depth: contact.depth,
        stiffness: contact.stiffness,
    }
}

/// How many surface nodes and triangles a body has; either place may be null. They never change.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_get_surface_size(
    force_loop: *const Loop,
    body: u32,
    nodes: *mut usize,
    triangles: *mut usize,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (own, nodes, triangles) = unsafe { (shared(force_loop, "loop")?, nodes.as_mut(), triangles.as_mut()) };
        let side = own.frame();
        let surface = &side.prepared.model.bodies[side.body(body)?].green().surface;
        nodes.into_iter().for_each(|count| *count = surface.positions.len());
        triangles.into_iter().for_each(|count| *count = surface.triangles.len());
        Ok(())
    })
}

/// Triangles of a body, outward, three numbers of surface nodes each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_get_triangles(
    force_loop: *const Loop,
    body: u32,
    nodes: *mut u32,
    triangles: usize,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let own = unsafe { shared(force_loop, "loop") }?;
        let side = own.frame();
        let surface = &side.prepared.model.bodies[side.body(body)?].green().surface;
        // SAFETY: the caller's pointer.
        unsafe { put_triangles(surface, nodes, triangles) }
    })
}

/// Positions of the surface nodes of a body at rest, without its loads, x y z of each, m, in the world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_get_rest_positions(
    force_loop: *const Loop,
    body: u32,
    positions: *mut f64,
    nodes: usize,
) -> Status {
    // SAFETY: the caller's pointers.
    catching_panics(|| unsafe { put_positions(force_loop, body, positions, nodes, false) })
}

/// Positions of the surface nodes of a body in the tick of the last palpate_loop_get_frame, x y z of each, m, in the world.
/// Worked out by the caller, in some hundred microseconds: not for the thread that ticks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_get_positions(
    force_loop: *mut Loop,
    body: u32,
    positions: *mut f64,
    nodes: usize,
) -> Status {
    // SAFETY: the caller's pointers.
    catching_panics(|| unsafe { put_positions(force_loop, body, positions, nodes, true) })
}

/// Positions of surface nodes in the world, at rest or where the latest tick has moved them.
///
/// # Safety
/// The pointers are null, or point to a loop and to `nodes` of three numbers.
unsafe fn put_positions(own: *const Loop, body: u32, positions: *mut f64, nodes: usize, moved: bool) -> Outcome {
    // SAFETY: the caller's pointer.
    let own = unsafe { shared(own, "loop") }?;
    let side = own.frame();
    let (rank, model) = (side.body(body)?, &side.prepared.model);
    let body = &model.bodies[rank];
    let rest = &body.green().surface.positions;
    require_count("nodes", nodes, rest.len())?;
    // SAFETY: the caller's pointer.
    let out = unsafe { array_mut(positions.cast::<[f64; 3]>(), nodes, "positions") }?;
    let mut places = rest.clone();
    if moved {
        body.green().require_intact()?;
        let displacements = side.latest.state.displacements(model, rank);
        places.iter_mut().zip(displacements.chunks_exact(3)).for_each(|(p, u)| *p += DVec3::from_slice(u));
    }
    out.iter_mut().zip(places).for_each(|(to, p)| *to = body.placement.point_to_world(p).to_array());
    Ok(())
}
