//! Force and its derivative for a position of the tool over the surface at rest.

use glam::{DMat3, DVec3};

use super::half_space::{Fields, HalfSpace, Indentation, LocalBody, LocalTool};
use super::wrench::{CellMemory, indent_shape, placed_shape};
use crate::contact::footprint::PressedSurface;
use crate::contact::local::{Friction, FrictionResponse, WidenedContact, Widening};
use crate::contact::regular::{COMPLIANCE, GAUSS, MEAN, PLANE_STRAIN, WIDENING, WIDTH, compliance_of, reference_area};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{FanWeights, FootPoint};
use crate::simulation::contacts::LocalContact;
use crate::simulation::rotation::rotation_vector;
use crate::tensor::outer;

/// Least `(1/R + kappa_1) (1/R + kappa_2)` over `1/R^2`: a concavity that fits the tool more closely counts as flatter.
const LEAST_CURVATURE_PRODUCT: f64 = 0.1;
/// Largest inclination of the force by the body's change of compliance, over the pressing force.
const STEEPEST_INCLINATION: f64 = 0.5;

/// Effect of the other contacts of the body at a contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct OtherContacts {
    /// Derivative of `f^T sum_b C_ab f_b` by the position of the tool, N.
    pub slope: DVec3,
    /// On a body in motion: derivative by the position of the surface's displacement `u_k` less the static response to this
    /// contact, columns by `k`. The latter's part is `f^T (dC_reg/dp') f / 2`. Taken from the displacements of nodes it would
    /// differ by the patch's width and the modes left out, and slow closed paths near a rim would release 0.4 % of their peak
    /// energy.
    pub motion_slope: Option<DMat3>,
    /// The same by the tool's rotation, N m.
    pub turn: DVec3,
    pub motion_turn: Option<DMat3>,
}

/// The response at one position.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalResponse {
    pub foot: FootPoint,
    /// Force on the body, N, and its derivative by the position, N/m.
    pub force: DVec3,
    pub jacobian: DMat3,
    /// `C_reg` there, m/N.
    pub compliance: DMat3,
    /// Direction of the force without friction, towards the tool.
    pub normal: DVec3,
    /// Contact point on the body at rest, m.
    pub point: DVec3,
    pub indentation: Indentation,
    /// Force on the tool from the gradients of this place's compliance and of the body's motion, N, without other contacts; the
    /// same by the tool's rotation, N m.
    pub slope: DVec3,
    pub turn: DVec3,
    pub friction: FrictionResponse,
    /// Torque on the tool about its tip, N m.
    pub torque: DVec3,
}

/// Position at which the response is evaluated, and the latest approximations.
#[derive(Clone, Copy)]
pub struct Guess<'a> {
    /// Position of the tool over the surface at rest, m.
    pub place: DVec3,
    /// Force on the body, N.
    pub force: DVec3,
    /// The foot of a position near it.
    pub foot: &'a FootPoint,
}

/// Evaluates the response to the tool at a position. `None` where the body is not touchable.
pub fn evaluate(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: OtherContacts,
    weights: &mut FanWeights,
    cells: CellMemory<'_>,
) -> Option<LocalResponse> {
    // Set again with each foot.
    weights.touchable = 1.0;
    match body.pressed_surface {
        Some(pressed) => evaluate_shape((body, pressed), tool, contact, guess, others, weights, cells),
        None => evaluate_sphere(body, tool, contact, guess, others, weights),
    }
}

/// A matrix scaled down to a bound of its norm. At an edge the normal of a footprint turns faster than its force does.
fn bounded(matrix: DMat3, most: f64) -> DMat3 {
    let size = matrix.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>().sqrt();
    if size > most { matrix * (most / size) } else { matrix }
}

fn evaluate_sphere(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: OtherContacts,
    weights: &mut FanWeights,
) -> Option<LocalResponse> {
    let foot = match contact.is_fading {
        true => contact.foot.frozen(guess.place),
        false => body.smooth.foot(body.drawn, guess.place, guess.foot, &mut weights.near)?,
    };
    body.smooth.weigh(&foot, weights);
    if weights.is_outside() {
        return None;
    }
    let fields = weights.blend(body.fields);
    // A new contact has no force: its approach counts from the present depth.
    let indentation = if contact.is_new { Indentation::default() } else { indent(body, tool, contact, &foot, &fields) };
    let mut response = LocalResponse::at(body, foot, &fields, indentation);
    response.slope = slope(body, guess.force, others, &fields);
    response.find_force(tool, contact, guess.place, others);
    Some(response)
}

fn evaluate_shape(
    (body, pressed): (LocalBody<'_>, &PressedSurface),
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: OtherContacts,
    weights: &mut FanWeights,
    cells: CellMemory<'_>,
) -> Option<LocalResponse> {
    let Guess { place, force, .. } = guess;
    let shape = placed_shape(tool.shape, contact, place);
    cells.footprint.near.find(pressed, body.drawn.query, &shape);
    let footprint = cells.footprint.find(&pressed.fine, body.smooth, contact.plane(), weights);
    let Some(footprint) = footprint else {
        // The tool is away from the body: no force.
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
    // Gradients by the tool's rotation of `E*`, of the width, and of `f^T C_reg f / 2`.
    let motion_turn = others.motion_turn.map_or(DVec3::ZERO, |motion_turn| motion_turn * force);
    let (mut modulus_turns, mut width_turns, mut compliance_turns) = (DVec3::ZERO, DVec3::ZERO, motion_turn);
    for (fan, turn) in weights.with_turns() {
        let own = &pressed.fields[fan];
        modulus_turns += turn * own[PLANE_STRAIN];
        width_turns += turn * own[WIDTH];
        compliance_turns += turn * (0.5 / body.scale * force.dot(compliance_of(own) * force));
    }
    modulus_turns *= half_space.by_body_modulus;
    let indentation = indent_shape(
        &pressed.fine,
        tool,
        contact,
        place,
        &footprint,
        (&half_space, [modulus_turns, width_turns]),
        cells,
    );
    let mut response = LocalResponse::at(body, footprint.foot(place), &fields, indentation);
    response.point = place + indentation.lever;
    (response.slope, response.turn) = (slope(body, force, others, &fields), compliance_turns);
    response.find_force(tool, contact, place, others);
    Some(response)
}

/// Force on the tool from the gradients of the body's compliance and of its motion, N. It is computed from the guessed force, which
/// agrees with the result when the steps have converged.
fn slope(body: LocalBody<'_>, force: DVec3, others: OtherContacts, fields: &Fields) -> DVec3 {
    let [x, y, z] = force.to_array();
    let products = [x * x, 2.0 * x * y, 2.0 * x * z, y * y, 2.0 * y * z, z * z];
    let own: DVec3 = COMPLIANCE.zip(products).map(|(field, product)| fields.slope(field) * product).sum();
    let motion_slope = others.motion_slope.map_or(DVec3::ZERO, |motion_slope| motion_slope * force);
    own * (0.5 / body.scale) + motion_slope
}

/// Indentation by a sphere.
fn indent(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    foot: &FootPoint,
    fields: &Fields,
) -> Indentation {
    let depth = tool.radius - contact.entry_depth - foot.distance;
    let [mean, gauss] = [MEAN, GAUSS].map(|field| fields.values[field]);
    let [mean_slope, gauss_slope] = [MEAN, GAUSS].map(|field| fields.slope(field));
    let half_space = HalfSpace::new(body, tool, fields, contact.part);
    let curved = 1.0 / tool.radius;
    let product = curved * curved + 2.0 * mean * curved + gauss;
    let product_slope = mean_slope * (2.0 * curved) + gauss_slope;
    // A maximum with continuous derivatives.
    let least = LEAST_CURVATURE_PRODUCT * curved * curved;
    let root = (product * product + least * least).sqrt();
    let (bounded, share) = (0.5 * (product + root), 0.5 * (1.0 + product / root));
    let radius = 1.0 / bounded.sqrt();
    let radius_slope = product_slope * (-0.5 * radius * radius * radius * share);
    let rate_slope = fields.slope(WIDENING) / body.scale;
    let widening = Widening { rate: fields.values[WIDENING] / body.scale, reference: reference_area(tool.radius) };
    let WidenedContact { sphere, energy_by_modulus, energy_by_rate, energy_by_terms } =
        widening.indent(depth, radius, half_space.modulus, &half_space.strain_terms);
    let by_terms: DVec3 = half_space.strain_slopes.iter().zip(energy_by_terms).map(|(&slope, by)| slope * by).sum();
    let gradient = radius_slope * sphere.energy_by_radius
        + half_space.slope * energy_by_modulus
        + rate_slope * energy_by_rate
        + by_terms
        - foot.normal * sphere.force;
    Indentation {
        depth,
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
    /// At a foot, without a force.
    fn at(body: LocalBody<'_>, foot: FootPoint, fields: &Fields, indentation: Indentation) -> Self {
        let compliance = compliance_of(&fields.values) * (1.0 / body.scale);
        let (normal, point) = (foot.normal, foot.position);
        // A matrix is the identity by default.
        Self { foot, compliance, normal, point, indentation, jacobian: DMat3::ZERO, ..Self::default() }
    }

    /// Finds the wrench that follows from the indentation, inclined by the gradients of the compliance and by the other contacts,
    /// and from friction. It costs little beside the indentation, so that it is found again when the other contacts are known.
    pub fn find_force(&mut self, tool: LocalTool<'_>, contact: &LocalContact, place: DVec3, others: OtherContacts) {
        let indentation = self.indentation;
        let whole = self.slope + others.slope;
        let slope = whole.clamp_length_max(STEEPEST_INCLINATION * indentation.force);
        let push = slope - indentation.gradient;
        let pressing = push.length();
        if indentation.force == 0.0 || pressing == 0.0 {
            return;
        }
        let lever = indentation.lever;
        let rotation = rotation_vector(contact.previous_orientation, contact.orientation);
        let displacement = place - contact.relative_position + rotation.cross(lever);
        self.normal = push / pressing;
        let stiffness = indentation.tangential * indentation.stiffness;
        let bound = tool.coefficient * pressing;
        self.friction = contact.friction.respond(displacement, bound, tool.coefficient, stiffness, self.normal);
        self.force = self.friction.force - push;
        let n = self.foot.normal;
        let turning = match tool.shape {
            ToolShape::Sphere { .. } => self.foot.turning,
            shape => bounded(self.foot.turning, 1.0 / shape.thickness()),
        };
        self.jacobian = outer(n, n) * indentation.stiffness - turning * indentation.force
            + self.friction.by_displacement
            - outer(self.friction.by_pressing, n) * indentation.stiffness;
        let share = if whole == DVec3::ZERO { 1.0 } else { slope.length() / whole.length() };
        self.torque = indentation.torque - lever.cross(self.friction.force) + (self.turn + others.turn) * share;
    }

    /// The springs of friction; without a force none is stretched.
    pub fn springs(&self) -> Friction {
        if self.force == DVec3::ZERO { Friction::default() } else { self.friction.friction }
    }
}
