//! Force and its derivative for a place of the tool over the surface at rest.

use glam::{DMat3, DVec3};

use super::LocalContact;
use super::friction::{Answer, Friction};
use super::met::{HalfSpace, Indentation, LocalBody, LocalTool};
use super::reference::Reference;
use super::wrench::{Cells, indent_shape};
use crate::contact::local::indent_sphere;
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{FanWeights, FootPoint};
use crate::simulation::rotation::rotation_vector;
use crate::tensor::outer;

/// Least `(1/R + kappa_1) (1/R + kappa_2)` over `1/R^2`: a tool that fits a hollow closely touches it as a flatter one.
const CLOSEST_FIT: f64 = 0.1;
/// The force is inclined by the body's change of compliance by no more than this, over the pressing force.
const STEEPEST: f64 = 0.5;

/// What other contacts of the body do at a contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct Others {
    /// Derivative of `f^T sum_b C_ab f_b` by the place of the tool, N.
    pub slope: DVec3,
    /// Of a body in motion the derivative of the surface's displacement `u_k` by the place, columns by `k`: it takes the place
    /// of the compliance's, for `f . du(x)/dp'` at rest is `f^T (dC/dp') f / 2`.
    pub moving: Option<DMat3>,
}

/// The answer at one place.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalResponse {
    pub foot: FootPoint,
    /// Force on the body, N, and its derivative by the place, N/m.
    pub force: DVec3,
    pub jacobian: DMat3,
    /// `C_reg` there, m/N.
    pub compliance: DMat3,
    /// Direction of the force without friction, turned towards the tool.
    pub normal: DVec3,
    /// Where the body is touched, at rest, m.
    pub point: DVec3,
    pub indentation: Indentation,
    pub friction: Answer,
    /// Torque on the tool about its tip, N m.
    pub torque: DVec3,
}

/// Where a tool meets the surface.
struct Met {
    foot: FootPoint,
    /// How its foot follows it; that of a sphere's centre follows the tip.
    reference: Option<Reference>,
}

/// Answers to the tool at `place`; `force` is what is known of the force so far. `None` where nothing may be touched.
pub fn evaluate(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    (place, force): (DVec3, DVec3),
    others: Others,
    weights: &mut FanWeights,
    cells: Cells<'_>,
) -> Option<LocalResponse> {
    let Met { foot, reference } = meet(body, tool, contact, place)?;
    body.smooth.weigh(&foot, weights);
    if weights.touchable < 0.5 {
        return None;
    }
    // One that has just been found counts from where it is.
    let indentation = match &reference {
        _ if contact.found => Indentation::default(),
        None => indent(body, tool, contact, &foot, weights),
        Some(reference) => indent_shape(body, tool, contact, place, (&foot, reference), weights, cells),
    };
    let mut compliance = DMat3::ZERO;
    for (fan, weight) in weights.iter() {
        compliance += body.regular[fan] * (weight / body.scale);
    }
    let (normal, point) = (foot.normal, foot.position);
    // A matrix is the identity by default.
    let jacobian = DMat3::ZERO;
    let mut response =
        LocalResponse { foot, compliance, normal, point, indentation, jacobian, ..LocalResponse::default() };
    if indentation.force == 0.0 {
        return Some(response);
    }
    let lever = indentation.lever;
    let rotation = rotation_vector(contact.turned, contact.orientation);
    let displacement = place - contact.relative + rotation.cross(lever);
    let slope = slope(body, force, others, weights).clamp_length_max(STEEPEST * indentation.force);
    let (slope, twist) = reference.map_or((slope, DVec3::ZERO), |reference| reference.by_pose(slope));
    let push = slope - indentation.gradient;
    let pressing = push.length();
    response.normal = push / pressing;
    let stiffness = indentation.tangential * indentation.stiffness;
    let bound = tool.coefficient * pressing;
    response.friction = contact.friction.answer(displacement, bound, tool.coefficient, stiffness, response.normal);
    response.force = response.friction.force - push;
    let turning = reference.map_or(foot.turning, |reference| reference.turning(&foot));
    let n = foot.normal;
    response.jacobian = outer(n, n) * indentation.stiffness - turning * indentation.force
        + response.friction.by_displacement
        - outer(response.friction.by_pressing, n) * indentation.stiffness;
    response.torque = -lever.cross(response.friction.force);
    if reference.is_some() {
        response.torque += indentation.torque + twist;
        response.point = place + lever;
    }
    Some(response)
}

fn meet(body: LocalBody<'_>, tool: LocalTool<'_>, contact: &LocalContact, place: DVec3) -> Option<Met> {
    if let ToolShape::Sphere { .. } = tool.shape {
        if contact.held {
            return Some(Met { foot: contact.foot.held(place), reference: None });
        }
        let start = (contact.foot.triangle, contact.foot.position);
        return Some(Met { foot: body.smooth.foot(body.surface, body.query, place, start)?, reference: None });
    }
    let pose = (place, DMat3::from_quat(contact.orientation));
    let (foot, reference) = match contact.held {
        true => Reference::held(tool.shape, pose, &contact.foot)?,
        false => Reference::find((body.smooth, body.surface, body.query), tool.shape, pose, &contact.foot)?,
    };
    Some(Met { foot, reference: Some(reference) })
}

/// What the change of the body's compliance, and the other contacts, add to the force on the tool, by the place of the foot's
/// point. It follows from the force of the step before: they agree where the steps end.
fn slope(body: LocalBody<'_>, force: DVec3, others: Others, weights: &FanWeights) -> DVec3 {
    let mut slope = others.slope;
    match others.moving {
        Some(moving) => slope += moving * force,
        None => {
            for (fan, _, gradient) in weights.with_gradients() {
                slope += gradient * (0.5 / body.scale * force.dot(body.regular[fan] * force));
            }
        }
    }
    slope
}

/// Of a sphere.
fn indent(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    foot: &FootPoint,
    weights: &FanWeights,
) -> Indentation {
    let depth = tool.radius - contact.entry - foot.distance;
    let fans = body.smooth.fans();
    let (mean, mean_slope) = weights.field(|fan| fans[fan].mean);
    let (gauss, gauss_slope) = weights.field(|fan| fans[fan].gauss);
    let half_space = HalfSpace::new(body, tool, weights, contact.part);
    let curved = 1.0 / tool.radius;
    let product = curved * curved + 2.0 * mean * curved + gauss;
    let product_slope = mean_slope * (2.0 * curved) + gauss_slope;
    // A maximum with continuous derivatives.
    let least = CLOSEST_FIT * curved * curved;
    let root = (product * product + least * least).sqrt();
    let (bounded, share) = (0.5 * (product + root), 0.5 * (1.0 + product / root));
    let radius = 1.0 / bounded.sqrt();
    let radius_slope = product_slope * (-0.5 * radius * radius * radius * share);
    let sphere = indent_sphere(depth, radius, half_space.modulus);
    let gradient = radius_slope * sphere.energy_by_radius + half_space.slope * (sphere.energy / half_space.modulus)
        - foot.normal * sphere.force;
    Indentation {
        force: sphere.force,
        radius: sphere.radius,
        stiffness: sphere.stiffness,
        energy: sphere.energy,
        gradient,
        torque: DVec3::ZERO,
        lever: -foot.normal * tool.radius,
        tangential: half_space.tangential,
    }
}

impl LocalResponse {
    /// Its springs; without a force none is stretched.
    pub fn springs(&self) -> Friction {
        if self.force == DVec3::ZERO { Friction::default() } else { self.friction.friction }
    }
}
