//! Force and its derivative for a place of the tool over the surface at rest.

use glam::{DMat3, DVec3};

use super::LocalContact;
use super::friction::{Answer, Friction};
use super::met::{Fields, HalfSpace, Indentation, LocalBody, LocalTool};
use super::wrench::{Cells, indent_shape, posed, sunk};
use crate::contact::footprint::PressedSurface;
use crate::contact::local::{WidenedContact, Widening};
use crate::contact::regular::{COMPLIANCE, GAUSS, MEAN, PLANE_STRAIN, WIDENING, compliance_of, reference_area};
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
    /// Of a body in motion the derivative by the place of the surface's displacement `u_k` less what this contact itself does
    /// at rest, columns by `k`. That part is `f^T (dC_reg/dp') f / 2`: taken from the displacements of nodes it would be the
    /// same but for the patch's width and the modes left out, and slow closed paths near a rim gave out 0.4 % of their peak.
    pub moving: Option<DMat3>,
    /// The same by the tool's rotation, N m.
    pub turn: DVec3,
    pub moving_turn: Option<DMat3>,
}

/// The answer at one place.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalResponse {
    pub foot: FootPoint,
    /// How deep a tool that is no sphere lies below the plane of its footprint, m.
    pub sunk: f64,
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
    // Not known before a foot is found.
    weights.touchable = 1.0;
    match body.pressed {
        Some(pressed) => evaluate_shape((body, pressed), tool, contact, guess, others, weights, cells),
        None => evaluate_sphere(body, tool, contact, guess, others, weights),
    }
}

/// A matrix no larger than a bound. At an edge the normal of a tool's footprint turns faster than its force does.
fn bounded(matrix: DMat3, most: f64) -> DMat3 {
    let size = matrix.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>().sqrt();
    if size > most { matrix * (most / size) } else { matrix }
}

fn evaluate_sphere(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: Others,
    weights: &mut FanWeights,
) -> Option<LocalResponse> {
    let foot = match contact.held {
        true => contact.foot.held(guess.place),
        false => body.smooth.foot(body.drawn, guess.place, guess.foot, &mut weights.near)?,
    };
    body.smooth.weigh(&foot, weights);
    if weights.is_outside() {
        return None;
    }
    let fields = weights.blend(body.fields);
    // One that has just been found counts from where it is.
    let indentation = if contact.found { Indentation::default() } else { indent(body, tool, contact, &foot, &fields) };
    let mut response = LocalResponse::at(body, foot, &fields, indentation);
    let slope = slope(body, guess.force, others, &fields).clamp_length_max(STEEPEST * indentation.force);
    response.push(tool, contact, guess.place, slope);
    Some(response)
}

fn evaluate_shape(
    (body, pressed): (LocalBody<'_>, &PressedSurface),
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: Others,
    weights: &mut FanWeights,
    cells: Cells<'_>,
) -> Option<LocalResponse> {
    let Guess { place, force, .. } = guess;
    let posed = posed(tool.shape, contact, place);
    cells.footprint.near.gather(pressed, body.drawn.query, &posed);
    let found = cells.footprint.find(&pressed.fine, body.smooth, contact.plane(), weights);
    let Some(footprint) = found else {
        // Away from the body: no force.
        let compliance = DMat3::ZERO;
        return Some(LocalResponse {
            foot: contact.foot,
            compliance,
            jacobian: DMat3::ZERO,
            ..LocalResponse::default()
        });
    };
    if weights.is_outside() {
        return None;
    }
    let fields = weights.blend(&pressed.fields);
    let half_space = HalfSpace::new(body, tool, &fields, contact.part);
    // Gradients by the tool's rotation of `E*` and of `f^T C_reg f / 2`.
    let moving = others.moving_turn.map_or(DVec3::ZERO, |moving| moving * force);
    let (mut modulus_turns, mut compliance_turns) = (DVec3::ZERO, others.turn + moving);
    for (fan, turn) in weights.with_turns() {
        let own = &pressed.fields[fan];
        modulus_turns += turn * own[PLANE_STRAIN];
        compliance_turns += turn * (0.5 / body.scale * force.dot(compliance_of(own) * force));
    }
    modulus_turns *= half_space.by_own;
    let sunk = sunk(&posed, &footprint);
    let indentation =
        indent_shape(&pressed.fine, tool, contact, place, &footprint, (&half_space, modulus_turns), cells);
    let mut response = LocalResponse::at(body, footprint.foot(place), &fields, indentation);
    response.sunk = sunk;
    response.point = place + indentation.lever;
    let whole = slope(body, force, others, &fields);
    let slope = whole.clamp_length_max(STEEPEST * indentation.force);
    let share = if whole == DVec3::ZERO { 1.0 } else { slope.length() / whole.length() };
    response.push(tool, contact, place, slope);
    if response.force != DVec3::ZERO {
        response.torque += indentation.torque + compliance_turns * share;
    }
    Some(response)
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
    /// At a foot, before anything is pushed.
    fn at(body: LocalBody<'_>, foot: FootPoint, fields: &Fields, indentation: Indentation) -> Self {
        let compliance = compliance_of(&fields.values) * (1.0 / body.scale);
        let (normal, point) = (foot.normal, foot.position);
        // A matrix is the identity by default.
        Self { foot, compliance, normal, point, indentation, jacobian: DMat3::ZERO, ..Self::default() }
    }

    /// Adds the force that follows from the indentation, inclined by `slope`, and friction.
    fn push(&mut self, tool: LocalTool<'_>, contact: &LocalContact, place: DVec3, slope: DVec3) {
        let indentation = self.indentation;
        let push = slope - indentation.gradient;
        let pressing = push.length();
        if indentation.force == 0.0 || pressing == 0.0 {
            return;
        }
        let lever = indentation.lever;
        let rotation = rotation_vector(contact.turned, contact.orientation);
        let displacement = place - contact.relative + rotation.cross(lever);
        self.normal = push / pressing;
        let stiffness = indentation.tangential * indentation.stiffness;
        let bound = tool.coefficient * pressing;
        self.friction = contact.friction.answer(displacement, bound, tool.coefficient, stiffness, self.normal);
        self.force = self.friction.force - push;
        let n = self.foot.normal;
        let turning = match tool.shape {
            ToolShape::Sphere { .. } => self.foot.turning,
            shape => bounded(self.foot.turning, 1.0 / shape.thickness()),
        };
        self.jacobian = outer(n, n) * indentation.stiffness - turning * indentation.force
            + self.friction.by_displacement
            - outer(self.friction.by_pressing, n) * indentation.stiffness;
        self.torque = -lever.cross(self.friction.force);
    }

    /// Its springs; without a force none is stretched.
    pub fn springs(&self) -> Friction {
        if self.force == DVec3::ZERO { Friction::default() } else { self.friction.friction }
    }
}
