//! Settings that may be changed while a loop runs.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use palpate_core::simulation::Strike;

use crate::arguments::shared;
use crate::force_loop::{FrameSide, Loop};
use crate::status::{Outcome, Refusal, Status, catching_panics};

/// Changes a setting of what `rank` finds in the loop.
///
/// # Safety
/// The pointer is null or points to a loop.
unsafe fn set(
    force_loop: *const Loop,
    name: &str,
    rank: impl FnOnce(&FrameSide) -> Outcome<usize>,
    value: f64,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's.
        let mut side = unsafe { shared(force_loop, "loop") }?.frame();
        let rank = rank(&side)?;
        side.set(name, rank, value)
    })
}

/// Changes Coulomb's coefficient of friction of a tool.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_set_friction(force_loop: *mut Loop, tool: u32, friction: f64) -> Status {
    // SAFETY: the caller's pointer.
    unsafe { set(force_loop, "friction", |side| side.tool(tool), friction) }
}

/// Changes the radius of contacts of a tool that begin from now on, m: of patches, and of what a grab holds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_set_contact_radius(force_loop: *mut Loop, tool: u32, radius: f64) -> Status {
    let rank = |side: &FrameSide| {
        side.prepared.model.check_contact_radius(radius)?;
        side.tool(tool)
    };
    // SAFETY: the caller's pointer.
    unsafe { set(force_loop, "contact_radius", rank, radius) }
}

/// Changes Young's modulus of a body to so many times that of its store: of a body of one material at rest, without loads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_set_stiffness_scale(force_loop: *mut Loop, body: u32, scale: f64) -> Status {
    let rank = |side: &FrameSide| {
        let rank = side.body(body)?;
        let model = &side.prepared.model.bodies[rank];
        if model.green().youngs_modulus.is_none() || model.moves() {
            let why = "the body has several materials, or loads, or moves: its stiffness cannot be changed";
            return Err(Refusal::argument(why));
        }
        Ok(rank)
    };
    // SAFETY: the caller's pointer.
    unsafe { set(force_loop, "stiffness_scale", rank, scale) }
}

/// Changes the largest strain to which tools may take the bodies; 0 for any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_set_strain_limit(force_loop: *mut Loop, limit: f64) -> Status {
    let refused = || Refusal::argument(format!("limit is {limit}, it must lie in [0, 1]"));
    // SAFETY: the caller's pointer.
    unsafe { set(force_loop, "strain_limit", |_| (0.0..=1.0).contains(&limit).then_some(0).ok_or_else(refused), limit) }
}

/// Changes how many seconds bodies in motion advance in a second: below one is slow motion.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_set_time_scale(force_loop: *mut Loop, scale: f64) -> Status {
    let refused = || Refusal::argument(format!("scale is {scale}, it must lie in (0, 1]"));
    // SAFETY: the caller's pointer.
    unsafe { set(force_loop, "time_scale", |_| (scale > 0.0 && scale <= 1.0).then_some(0).ok_or_else(refused), scale) }
}

/// Strikes a body in motion: an impulse, N s, on the patch of `radius`, m, around the surface point closest to `point`, m, in the
/// world; the force is half a wave of `duration`, s. Strikes that come faster than ticks are given one a tick, in order; 64 may
/// wait.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_strike(
    force_loop: *mut Loop,
    body: u32,
    point: *const f64,
    impulse: *const f64,
    radius: f64,
    duration: f64,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers, to three numbers each.
        let (own, point, impulse) = unsafe {
            (
                shared(force_loop, "loop")?,
                shared(point.cast::<[f64; 3]>(), "point")?,
                shared(impulse.cast::<[f64; 3]>(), "impulse")?,
            )
        };
        let mut side = own.frame();
        let rank = side.body(body)?;
        let numbers = point.iter().chain(impulse).chain([&radius, &duration]);
        if !numbers.copied().all(f64::is_finite) || radius < 0.0 || duration < 0.0 {
            return Err(Refusal::argument("a strike's numbers must be finite, its radius and duration not negative"));
        }
        if !side.prepared.model.bodies[rank].moves() {
            return Err(Refusal::argument("the body does not move: a strike does nothing to it"));
        }
        side.handle().strike(Strike {
            body: rank,
            point: (*point).into(),
            impulse: (*impulse).into(),
            radius,
            duration,
        })?;
        Ok(())
    })
}

/// Lets go of everything, brings bodies in motion to rest and clears a fault; forces ramp in anew.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_reset(force_loop: *mut Loop) -> Status {
    // SAFETY: the caller's pointer.
    catching_panics(|| unsafe { Ok(shared(force_loop, "loop")?.frame().handle().reset()?) })
}
