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
mod response;
mod wrench;

pub(in crate::simulation) use contact::ASKED;
pub use contact::LocalContact;
pub use met::{LocalBody, LocalTool};
pub use response::{Guess, LocalResponse, Others, evaluate};
pub use wrench::{Cells, posed, takes_cells};

use glam::{DMat3, DVec3};

use super::{Approach, Law};
use crate::contact::Refusal;
use crate::contact::footprint::{NearPiece, PosedShape, PressedSurface};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{FootPoint, Neighbourhood};
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
/// Most of these steps for a tool that is no sphere.
const MOST_STRIDES: f64 = 8.0;

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
    let foot = local.smooth.foot(approach.body.drawn(), place, from, near)?;
    Some((foot, approach.tool.radius - foot.distance))
}

/// The foot of a sphere at a place over the surface at rest, and how far it reaches below the plane through it, m. `None` where
/// it is too far to reach it.
fn first_foot(
    approach: &Approach<'_>,
    local: &LocalSurface,
    place: DVec3,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    let (body, tool) = (approach.body, approach.tool);
    let closest = body.closest(place)?;
    if local.smooth.surely_beyond(tool.radius, &closest) {
        return None;
    }
    let foot = local.smooth.foot_from(body.drawn(), place, &closest, near);
    Some((foot, tool.radius - foot.distance))
}

/// The footprint of a tool that is no sphere, as a foot, and how deep it is in the pieces below, m. `None` where it is near none.
///
/// The contact faces the side that the tool has come from: the first piece that it has been near on its way.
fn shape_arrival(
    approach: &Approach<'_>,
    local: &LocalSurface,
    pressed: &PressedSurface,
    place: DVec3,
    covering: &mut Covering,
) -> Option<(FootPoint, f64)> {
    let (body, shape) = (approach.body, &approach.tool.shape);
    let (drawn, rotation, thickness) = (body.drawn(), DMat3::from_quat(approach.orientation), shape.thickness());
    let closest = body.closest(place + rotation * shape.centre())?;
    if closest.signed_distance > shape.bounding_radius() + pressed.margin + approach.gone.length() {
        return None;
    }
    let Covering { footprint, weights, .. } = covering;
    let jumped = approach.gone.length() > JUMP * approach.tool.radius;
    let gone = if jumped { DVec3::ZERO } else { approach.gone };
    let strides = (gone.length() / (STRIDE * thickness)).ceil().clamp(1.0, MOST_STRIDES);
    let mut at = PosedShape { shape, place, rotation, facing: DVec3::ZERO, sunk: 0.0 };
    footprint.near.forget();
    let mut met = None;
    for left in (0..strides as u32).rev() {
        at.place = place - gone * (f64::from(left) / strides);
        footprint.near.gather(pressed, drawn.query, &at);
        met = footprint.first_met(if approach.motion.is_some() { DVec3::ZERO } else { gone });
        if met.is_some() {
            break;
        }
    }
    let met = met?;
    let at = PosedShape { place, sunk: gone.length(), facing: met.normal, ..at };
    footprint.near.gather(pressed, drawn.query, &at);
    let found = footprint.find(&pressed.fine, &local.smooth, met, weights)?;
    let facing = |near: &&NearPiece| near.normal.dot(found.normal) > 0.0;
    let deepest = footprint.near.pieces.iter().filter(facing).map(|near| -near.distance).fold(0.0, f64::max);
    Some((found.foot(place), deepest))
}

/// How far a tool at `place` reaches below the plane through a foot, m; negative where it does not.
pub fn depth_below(shape: &ToolShape, (place, rotation): (DVec3, DMat3), foot: &FootPoint) -> f64 {
    let deepest = place + rotation * shape.support(-(rotation.transpose() * foot.normal));
    (foot.position - deepest).dot(foot.normal)
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
        let arrived = match approach.pressed {
            Some(pressed) => shape_arrival(approach, local, pressed, met, covering),
            None => arrival(approach, local, met, &mut covering.near),
        };
        let Some((foot, depth)) = arrived else {
            *entry = Entry::default();
            return Ok(None);
        };
        let before = std::mem::replace(&mut entry.reached, depth.max(0.0));
        entry.depth = entry.depth.min(entry.reached);
        if approach.returned {
            entry.depth = entry.reached;
        }
        if approach.motion.is_none() && approach.way() > 0.0 {
            // A distance changes by no more than the way: where it seems to, the foot a tick ago was another one.
            entry.depth = entry.depth.max(depth - before - WAY * approach.way());
        }
        // Pieces do not show where between them a tool first touches: one that has come from outside is tried as soon as it is near.
        let tried = approach.pressed.is_some() && entry.depth == 0.0;
        if depth <= entry.depth && !tried {
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
