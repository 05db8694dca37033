//! A sphere near a sharp convex corner or a blade: partly the closed form, partly pressure cells (`contact::CornerSurface`).
//!
//! With the share `s(p')` of cells the energies of the half-space and of the body are means,
//!
//! ```text
//! Phi = (1 - s) Phi_sphere + s Phi_cells        C = (1 - s) C_sphere + s C_cells
//! ```
//!
//! so that forces, the terms from `ds/dp'` included, are the gradient of one energy.

use glam::{DMat3, DQuat, DVec3};

use super::half_space::{Indentation, LocalBody, LocalTool};
use super::inclination::OtherContacts;
use super::response::{Guess, LocalResponse, bounded, evaluate_shape, evaluate_sphere};
use super::wrench::CellMemory;
use crate::contact::CornerSurface;
use crate::contact::smooth::{FanWeights, FootPoint};
use crate::simulation::contacts::{Contact, LocalContact};
use crate::simulation::model::Model;

/// Axes of the cells under a sphere, which has none of its own: along no direction that bodies are likely to have.
const AXES: DQuat = DQuat::from_xyzw(0.22, 0.41, 0.13, 0.875_385_629_654_298_5);

/// Share of cells in a contact, and its gradient by the position, 1/m. A contact that fades stays as it is on its plane.
fn share_of_cells(corners: Option<&CornerSurface>, is_fading: bool, triangle: u32, position: DVec3) -> (f64, DVec3) {
    corners.filter(|_| !is_fading).map_or((0.0, DVec3::ZERO), |corners| corners.share(triangle, position))
}

/// Share of cells in a contact of a sphere as of the last tick.
pub fn share_of_contact(model: &Model, contact: &Contact) -> f64 {
    let (corners, local) = (model.corner_surfaces[contact.tool][contact.body].as_deref(), &contact.local);
    share_of_cells(corners, local.is_fading, local.foot.triangle, local.relative_position).0
}

/// Depth from which the next contact of the tool may begin after this one, m. On cells a sphere may lie over a sharp edge and overlap no
/// cell yet, but the next contact counts from its closest point.
pub fn last_depth(model: &Model, contact: &Contact) -> f64 {
    let (tool, body) = (&model.tools[contact.tool], &model.bodies[contact.body]);
    if tool.shape.needs_cells() || share_of_contact(model, contact) == 0.0 {
        return contact.depth;
    }
    let closest = body.closest(contact.local.relative_position);
    closest.map_or(contact.depth, |closest| contact.depth.max(tool.radius - closest.signed_distance))
}

/// Whether a contact needs pressure cells.
pub fn contact_needs_cells(model: &Model, contact: &Contact) -> bool {
    model.tools[contact.tool].shape.needs_cells() || share_of_contact(model, contact) > 0.0
}

/// Writes the response to the tool at a position into `response`, without copies of that large struct. `None`, and nothing is
/// written, where the body is not touchable.
pub fn evaluate(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: &OtherContacts,
    cells: CellMemory<'_>,
    (weights, response): (&mut FanWeights, &mut LocalResponse),
) -> Option<()> {
    // Set again with each foot.
    weights.touchable = 1.0;
    let share = share_of_cells(body.corners, contact.is_fading, guess.foot.triangle, guess.place);
    match (body.pressed_surface, body.corners) {
        (Some(pressed), _) => {
            evaluate_shape((body, pressed), tool, contact, guess, others, cells, (weights, response))?;
        }
        (None, Some(corners)) if share.0 > 0.0 => {
            let at = (body, corners, share);
            *response = evaluate_near_corner(at, tool, contact, guess, others, weights, cells)?;
        }
        (None, _) => evaluate_sphere(body, tool, contact, guess, others, (weights, response))?,
    }
    response.find_force(tool, contact, guess.place, others);
    Some(())
}

/// The response of a sphere that is partly on cells; its force is found afterwards. `None` where the body is not touchable.
fn evaluate_near_corner(
    (body, corners, (share, gradient)): (LocalBody<'_>, &CornerSurface, (f64, DVec3)),
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: &OtherContacts,
    weights: &mut FanWeights,
    cells: CellMemory<'_>,
) -> Option<LocalResponse> {
    let CellMemory { state, scratch, footprint, resolution, corner_weights } = cells;
    let turned = LocalContact { orientation: AXES, ..*contact };
    let mut on_cells = |weights: &mut FanWeights, unused: &mut FanWeights| {
        let cells = CellMemory { state, scratch, footprint, resolution, corner_weights: unused };
        let mut response = LocalResponse::default();
        let at = (body, &corners.pressed);
        evaluate_shape(at, tool, &turned, guess, others, cells, (weights, &mut response))?;
        // A sphere that turns stays the same.
        (response.indentation.torque, response.turn) = (DVec3::ZERO, DVec3::ZERO);
        response.foot.turning = bounded(response.foot.turning, 1.0 / tool.radius);
        if contact.is_new {
            response.indentation = Indentation::default();
        }
        Some(response)
    };
    if share == 1.0 {
        let mut response = on_cells(weights, corner_weights)?;
        response.set_series(body, weights, guess, 0.0);
        return Some(response);
    }
    let mut sphere = LocalResponse::default();
    evaluate_sphere(body, tool, contact, guess, others, (weights, &mut sphere))?;
    corner_weights.touchable = 1.0;
    let Some(on_cells) = on_cells(corner_weights, weights) else {
        weights.touchable = corner_weights.touchable;
        return None;
    };
    let mut response = sphere.mixed(&on_cells, (share, gradient), guess.force);
    weights.mix(corner_weights, share, gradient);
    response.set_series(body, weights, guess, 1.0 - share);
    Some(response)
}

impl LocalResponse {
    /// The mean of two responses without their forces, of which the other has a share.
    fn mixed(&self, other: &Self, (share, gradient): (f64, DVec3), force: DVec3) -> Self {
        let softer = other.compliance - self.compliance;
        let mut mixed = *self;
        mixed.bending = self.bending * (1.0 - share);
        mixed.foot = mixed_foot(&self.foot, &other.foot, share);
        mixed.compliance = self.compliance + softer * share;
        mixed.indentation = mixed_indentation(&self.indentation, &other.indentation, (share, gradient));
        // Higher orders are added with the mean weights.
        mixed.slope = self.slope - self.linear_slope()
            + self.linear_slope().lerp(other.slope, share)
            + gradient * (0.5 * force.dot(softer * force));
        (mixed.normal, mixed.point) = (mixed.foot.normal, self.point.lerp(other.point, share));
        mixed
    }
}

fn mixed_foot(sphere: &FootPoint, on_cells: &FootPoint, share: f64) -> FootPoint {
    let mean = |one: DMat3, other: DMat3| one * (1.0 - share) + other * share;
    FootPoint {
        position: sphere.position.lerp(on_cells.position, share),
        normal: sphere.normal.lerp(on_cells.normal, share).normalize_or(sphere.normal),
        distance: sphere.distance + share * (on_cells.distance - sphere.distance),
        turning: mean(sphere.turning, on_cells.turning),
        shift: mean(sphere.shift, on_cells.shift),
        ..*sphere
    }
}

fn mixed_indentation(sphere: &Indentation, on_cells: &Indentation, (share, gradient): (f64, DVec3)) -> Indentation {
    let mean = |one: f64, other: f64| one + share * (other - one);
    Indentation {
        depth: mean(sphere.depth, on_cells.depth),
        force: mean(sphere.force, on_cells.force),
        radius: mean(sphere.radius, on_cells.radius),
        stiffness: mean(sphere.stiffness, on_cells.stiffness),
        energy: mean(sphere.energy, on_cells.energy),
        gradient: sphere.gradient.lerp(on_cells.gradient, share) + gradient * (on_cells.energy - sphere.energy),
        lever: sphere.lever.lerp(on_cells.lever, share),
        ..*sphere
    }
}
