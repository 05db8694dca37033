//! Force and its derivative for a place of the tool over the surface at rest.

use glam::{DMat3, DVec3};

use super::LocalContact;
use super::friction::{Answer, Friction};
use super::met::{Fields, HalfSpace, Indentation, LocalBody, LocalTool};
use super::reference::Reference;
use super::wrench::{Cells, indent_shape};
use crate::contact::local::{WidenedContact, Widening};
use crate::contact::regular::{COMPLIANCE, GAUSS, MEAN, WIDENING, compliance_of, reference_area};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{FanWeights, FootPoint, Neighbourhood};
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
    /// Of a body in motion the derivative by the place of the surface's displacement `u_k` less what this contact itself does
    /// at rest, columns by `k`. That part is `f^T (dC_reg/dp') f / 2`: taken from the displacements of nodes it would be the
    /// same but for the patch's width and the modes left out, and slow closed paths near a rim gave out 0.4 % of their peak.
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

/// Where an answer is asked for, and what is known of it so far.
#[derive(Clone, Copy)]
pub struct Guess<'a> {
    /// Place of the tool over the surface at rest, m.
    pub place: DVec3,
    /// Force on the body, N.
    pub force: DVec3,
    /// The foot of a place near it.
    pub foot: &'a FootPoint,
}

/// Answers to the tool at a place. `None` where nothing may be touched.
pub fn evaluate(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: Others,
    weights: &mut FanWeights,
    cells: Cells<'_>,
) -> Option<LocalResponse> {
    let Guess { place, force, .. } = guess;
    // Not known before a foot is found.
    weights.touchable = 1.0;
    let Met { foot, reference } = meet(body, tool, contact, guess, &mut weights.near)?;
    body.smooth.weigh(&foot, weights);
    if weights.is_outside() {
        return None;
    }
    let fields = weights.blend(body.fields);
    // One that has just been found counts from where it is.
    let indentation = match &reference {
        _ if contact.found => Indentation::default(),
        None => indent(body, tool, contact, &foot, &fields),
        Some(reference) => indent_shape(body, tool, contact, place, (&foot, reference), (weights, &fields), cells),
    };
    let compliance = compliance_of(&fields.values) * (1.0 / body.scale);
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
    let slope = slope(body, force, others, &fields).clamp_length_max(STEEPEST * indentation.force);
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

fn meet(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    near: &mut Neighbourhood,
) -> Option<Met> {
    if let ToolShape::Sphere { .. } = tool.shape {
        let foot = match contact.held {
            true => contact.foot.held(guess.place),
            false => body.smooth.foot(body.drawn, guess.place, guess.foot, near)?,
        };
        return Some(Met { foot, reference: None });
    }
    let pose = (guess.place, DMat3::from_quat(contact.orientation));
    let (foot, reference) = match contact.held {
        true => Reference::held(tool.shape, pose, &contact.foot)?,
        false => Reference::find((body.smooth, body.drawn), tool.shape, pose, guess.foot, near)?,
    };
    Some(Met { foot, reference: Some(reference) })
}

/// What the change of the body's compliance, and the other contacts, add to the force on the tool, by the place of the foot's
/// point. It follows from the force that is guessed: they agree where the steps end.
fn slope(body: LocalBody<'_>, force: DVec3, others: Others, fields: &Fields) -> DVec3 {
    let [x, y, z] = force.to_array();
    let products = [x * x, 2.0 * x * y, 2.0 * x * z, y * y, 2.0 * y * z, z * z];
    let own: DVec3 = COMPLIANCE.zip(products).map(|(field, product)| fields.slope(field) * product).sum();
    let moving = others.moving.map_or(DVec3::ZERO, |moving| moving * force);
    others.slope + own * (0.5 / body.scale) + moving
}

/// Of a sphere.
fn indent(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    foot: &FootPoint,
    fields: &Fields,
) -> Indentation {
    let depth = tool.radius - contact.entry - foot.distance;
    let [mean, gauss] = [MEAN, GAUSS].map(|field| fields.values[field]);
    let [mean_slope, gauss_slope] = [MEAN, GAUSS].map(|field| fields.slope(field));
    let half_space = HalfSpace::new(body, tool, fields, contact.part);
    let curved = 1.0 / tool.radius;
    let product = curved * curved + 2.0 * mean * curved + gauss;
    let product_slope = mean_slope * (2.0 * curved) + gauss_slope;
    // A maximum with continuous derivatives.
    let least = CLOSEST_FIT * curved * curved;
    let root = (product * product + least * least).sqrt();
    let (bounded, share) = (0.5 * (product + root), 0.5 * (1.0 + product / root));
    let radius = 1.0 / bounded.sqrt();
    let radius_slope = product_slope * (-0.5 * radius * radius * radius * share);
    let rate_slope = fields.slope(WIDENING) / body.scale;
    let widening = Widening { rate: fields.values[WIDENING] / body.scale, reference: reference_area(tool.radius) };
    let WidenedContact { sphere, energy_by_modulus, energy_by_rate } =
        widening.indent(depth, radius, half_space.modulus);
    let gradient =
        radius_slope * sphere.energy_by_radius + half_space.slope * energy_by_modulus + rate_slope * energy_by_rate
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
