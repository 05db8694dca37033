//! Contact below the size of elements: a local law in series with finite elements.
//!
//! The body carries the surface below the tool along by `u = C_reg(x) f` (`contact::regular`). What is left between the
//! tool, at `p' = p - u`, and the smooth surface at rest is contact with a half-space: Sneddon's sphere, and friction. With the
//! energy `Phi(p')` of the one and `f^T C_reg f / 2` of the other, all of it is the stationary value over `u` of
//!
//! ```text
//! E(p) = min_u  u^T C_reg(x)^-1 u / 2 + Phi(p - u)        x = x(p - u)
//! ```
//!
//! so that `dE/dp = C_reg^-1 u = f`, and with `d(C^-1) = -C^-1 dC C^-1`
//!
//! ```text
//! f = dPhi/dp' - (1/2) f^T (dC_reg/dp') f
//! ```
//!
//! The last term inclines the force as the surface under load is inclined. Whatever forces friction adds to `dPhi/dp'`, the
//! work of the tool less that of friction is the change of one energy: `f . dp = d(f^T C f / 2) + f_local . dp'`.

mod contact;
mod friction;
mod met;
mod reference;
mod response;
mod wrench;

pub(in crate::simulation) use contact::ASKED;
pub use contact::LocalContact;
pub use met::{LocalBody, LocalTool};
pub use reference::depth_below;
pub use response::{Guess, LocalResponse, Others, evaluate};
pub use wrench::{Cells, takes_cells};

use glam::{DMat3, DQuat, DVec3};

use self::reference::Reference;
use super::{Approach, Law};
use crate::contact::Refusal;
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{DrawnSurface, FootPoint, Neighbourhood, SmoothSurface};
use crate::simulation::body::LocalSurface;
use crate::simulation::contacts::{Contact, Mode};
use crate::simulation::covering::Covering;
use crate::simulation::state::Entry;
use crate::simulation::tool::LawKind;

/// A tool that goes farther than this in a tick, over its radius, has jumped: its contact ends.
const JUMP: f64 = 2.0;

/// A tool that begins to touch has come by no more than this, over the way that it has gone in the tick; smoothed surfaces are
/// not quite the level sets of a distance.
const WAY: f64 = 2.0;

/// A place is expected to go no farther than this many times as far as its tool.
const AHEAD: f64 = 1.5;

/// The law.
pub struct Local;

/// A tool that comes is followed from where it was in steps no longer than this, over its radius: within one of them it does not
/// pass the middle of a part that is thicker than its radius.
const STRIDE: f64 = 0.25;

/// The foot of a tool that comes to a place over the surface at rest: once the tool touches on its way, the foot is followed, so
/// that it lies on the side that the tool has come from. And how far the tool reaches below the plane through it, m. `None` where
/// it is too far to reach it.
fn arrival(
    approach: &Approach<'_>,
    local: &LocalSurface,
    place: DVec3,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    let (gone, radius) = (approach.gone, approach.tool.radius);
    let strides = (gone.length() / (STRIDE * radius)).ceil();
    if strides > JUMP / STRIDE {
        return first_foot(approach, local, place, near);
    }
    let mut touched: Option<FootPoint> = None;
    for left in (1..strides.max(1.0) as u32).rev() {
        let at = place - gone * (f64::from(left) / strides);
        touched = match touched {
            Some(foot) => Some(follow(approach, local, at, &foot, near)?.0),
            None => first_foot(approach, local, at, near).filter(|(_, depth)| *depth > 0.0).map(|(foot, _)| foot),
        };
    }
    match touched {
        Some(foot) => follow(approach, local, place, &foot, near),
        None => first_foot(approach, local, place, near),
    }
}

/// The foot followed from an earlier one, and the depth.
fn follow(
    approach: &Approach<'_>,
    local: &LocalSurface,
    place: DVec3,
    from: &FootPoint,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    let (body, shape) = (approach.body, &approach.tool.shape);
    place_near((&local.smooth, body.drawn()), shape, (place, approach.orientation), from, near)
}

/// The foot of a tool at a place, followed from one near it, and how far the tool reaches below the plane through it, m.
pub fn place_near(
    (smooth, drawn): (&SmoothSurface, DrawnSurface<'_>),
    shape: &ToolShape,
    (place, orientation): (DVec3, DQuat),
    from: &FootPoint,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    if let ToolShape::Sphere { radius } = *shape {
        let foot = smooth.foot(drawn, place, from, near)?;
        return Some((foot, radius - foot.distance));
    }
    let pose = (place, DMat3::from_quat(orientation));
    let (foot, _) = Reference::find((smooth, drawn), shape, pose, from, near)?;
    Some((foot, depth_below(shape, pose, &foot)))
}

/// The foot of a tool at a place over the surface at rest, and how far it reaches below the plane through it, m. `None` where it
/// is too far to reach it.
fn first_foot(
    approach: &Approach<'_>,
    local: &LocalSurface,
    place: DVec3,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    let (body, tool) = (approach.body, approach.tool);
    let (drawn, rotation) = (body.drawn(), DMat3::from_quat(approach.orientation));
    let centre = place + rotation * tool.shape.centre();
    let closest = body.closest(centre)?;
    if local.smooth.surely_beyond(tool.shape.bounding_radius(), &closest) {
        return None;
    }
    let from = local.smooth.foot_from(drawn, centre, &closest, near);
    if let ToolShape::Sphere { radius } = tool.shape {
        return Some((from, radius - from.distance));
    }
    if from.distance > tool.shape.bounding_radius() {
        return Some((from, 0.0));
    }
    let (foot, _) = Reference::find((&local.smooth, drawn), &tool.shape, (place, rotation), &from, near)?;
    Some((foot, depth_below(&tool.shape, (place, rotation), &foot)))
}

impl Law for Local {
    fn begin(
        &self,
        approach: &Approach<'_>,
        entry: &mut Entry,
        covering: &mut Covering,
    ) -> Result<Option<Contact>, Refusal> {
        let (body, met) = (approach.body, approach.position - approach.carried());
        let Some(local) = &body.local else { return Ok(None) };
        covering.near.forget();
        let Some((foot, depth)) = arrival(approach, local, met, &mut covering.near) else {
            *entry = Entry::default();
            return Ok(None);
        };
        let before = std::mem::replace(&mut entry.reached, depth.max(0.0));
        entry.depth = entry.depth.min(entry.reached);
        if let (ToolShape::Sphere { .. }, None) = (&approach.tool.shape, approach.motion)
            && approach.gone != DVec3::ZERO
        {
            // A distance changes by no more than the way: where it seems to, the foot a tick ago was another one.
            entry.depth = entry.depth.max(depth - before - WAY * approach.gone.length());
        }
        if depth <= entry.depth {
            return Ok(None);
        }
        let local = LocalContact {
            tool: approach.position,
            orientation: approach.orientation,
            relative: met,
            turned: approach.orientation,
            entry: entry.depth,
            foot,
            part: 1.0,
            share: 1.0,
            asked: [foot.position; ASKED],
            ..LocalContact::default()
        };
        Ok(Some(Contact {
            mode: Mode::Press,
            law: LawKind::Local,
            tool: approach.tool_index,
            body: approach.body_index,
            point: foot.position,
            normal: foot.normal,
            anchor: approach.position,
            local,
            ..Contact::default()
        }))
    }

    fn update(&self, approach: &Approach<'_>, contact: &mut Contact) -> bool {
        let local = &mut contact.local;
        let gone = approach.position.distance(local.tool);
        let jumped = gone > JUMP * approach.tool.radius;
        // A place over the surface at rest goes about as far as its tool, or less. What it has gone beyond is the remainder of the
        // method, less than its tolerance a tick: it would be repeated until the tolerance is passed, then taken back at once.
        if approach.motion.is_none() {
            local.advance = local.advance.clamp_length_max(AHEAD * gone);
        }
        (local.tool, local.orientation) = (approach.position, approach.orientation);
        // Withdrawn, it may come in again as deep as it has been left.
        !approach.grab && !jumped
    }

    fn end(&self, contact: &Contact) -> bool {
        contact.force == DVec3::ZERO && !contact.local.further
    }
}
