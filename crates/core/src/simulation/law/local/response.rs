//! Force and its derivative for a position of the tool over the surface at rest.

use glam::{DMat3, DVec3};

use super::acceleration::Iterate;
use super::half_space::{Fields, HalfSpace, Indentation, LocalBody, LocalTool};
use super::inclination::{OtherContacts, compliance_slope, slope};
use super::near_edge::NearEdge;
use super::wrench::{CellMemory, indent_shape, placed_shape};
use crate::contact::footprint::PressedSurface;
use crate::contact::local::{
    Friction, FrictionResponse, HigherOrders, SERIES_FIELDS, SphereOnSurface, WidenedContact, Widening, blended_series,
    higher_orders,
};
use crate::contact::regular::{
    GAUSS, INVERSE_MODULUS, MEAN, WIDENING, WIDTH, blend_fields, compliance_of, reference_area,
};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{Blended, FanWeights, FootPoint};
use crate::math::hypot;
use crate::simulation::contacts::LocalContact;
use crate::tensor::{across, outer, rotation_vector};

/// Least `(1/R + kappa_1) (1/R + kappa_2)` over `1/R^2`: a concavity that fits the tool more closely counts as flatter.
const LEAST_CURVATURE_PRODUCT: f64 = 0.1;
/// Largest inclination of the force by the body's change of compliance, over the pressing force.
const STEEPEST_INCLINATION: f64 = 0.5;
/// Least guess of the force from which a turned contact is followed, and its largest change from the guess, over the force.
const LEAST_GUESS: f64 = 0.5;
const LARGEST_CHANGE: f64 = 0.5;
/// Change of the force from the guess, over the force, up to which higher orders follow from their derivatives at the guess. A
/// converged change is below 1e-7.
const CLOSE: f64 = 1e-2;

/// A force, the part of it by friction, N, and an offset of the tool from above its contact, m, that are close to the result.
#[derive(Clone, Copy, Debug, Default)]
struct ForceGuess {
    force: DVec3,
    friction: DVec3,
    offset: DVec3,
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
    /// Derivative of the force by the position that comes from sharp edges, N/m.
    pub bending: DMat3,
    pub friction: FrictionResponse,
    /// Derivative of the force by friction by the position, N/m.
    pub friction_by_position: DMat3,
    /// Higher orders of the body's displacement, at the force, and at the guess.
    pub higher: HigherOrders,
    higher_at_guess: HigherOrders,
    series: Option<Blended<SERIES_FIELDS>>,
    /// Part to which these turn the contact (`turned_push`).
    turned_part: f64,
    /// Part of the place where they are known.
    pub known: f64,
    scale: f64,
    /// Offset of the tool along the surface from above its contact, m, and its distance from the contact, m.
    pub offset: DVec3,
    distance: f64,
    /// Derivative of the offset by the position.
    pub offset_by_position: DMat3,
    /// Derivatives of the slope and of the offset by the force, and of the force by what it would be if neither depended on it.
    slope_by_force: DMat3,
    offset_by_force: DMat3,
    turning: DMat3,
    /// The factor of the force's derivative by which the contact turns, and the rest without friction's change by the pressing force.
    unturned: (DMat3, DMat3),
    /// Where the slope is known, and whether all of it follows the force from there.
    guess: ForceGuess,
    pub slope_follows: bool,
    /// Torque on the tool about its tip, N m.
    pub torque: DVec3,
}

/// Position at which the response is evaluated, and the latest approximations.
#[derive(Clone, Copy)]
pub struct Guess<'a> {
    /// Position of the tool over the surface at rest, m.
    pub place: DVec3,
    /// Force on the body, and the part of it by friction, N.
    pub force: DVec3,
    pub friction: DVec3,
    /// The foot of a position near it.
    pub foot: &'a FootPoint,
    /// Offset of the tool from above it, m.
    pub offset: DVec3,
}

/// A matrix scaled down to a bound of its norm. At an edge the normal of a footprint turns faster than its force does.
pub(super) fn bounded(matrix: DMat3, most: f64) -> DMat3 {
    let size = matrix.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>().sqrt();
    if size > most { matrix * (most / size) } else { matrix }
}

/// The response of a sphere without its force.
pub(super) fn evaluate_sphere(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: &OtherContacts,
    (weights, response): (&mut FanWeights, &mut LocalResponse),
) -> Option<()> {
    let mut foot = match contact.is_fading {
        true => contact.foot.frozen(guess.place),
        false => body.smooth.foot(body.drawn, guess.place - guess.offset, guess.foot, &mut weights.near)?,
    };
    let near_edge = match contact.is_fading {
        true => None,
        false => NearEdge::find(body, (&foot, guess.place - guess.offset), guess.force, weights),
    };
    if near_edge.is_none() {
        body.smooth.weigh(&foot, weights);
    }
    if weights.is_outside() {
        return None;
    }
    if contact.is_fading {
        foot.normal = contact.plane_normal;
        foot.distance = (guess.place - foot.position).dot(foot.normal);
    }
    let distance = match body.series {
        Some(_) if !contact.is_fading => foot.distance.signum() * hypot(foot.distance, guess.offset.length()),
        _ => foot.distance,
    };
    let mut fields = blend_fields(weights, body.fields, body.is_hyperelastic);
    if let Some(near_edge) = &near_edge {
        near_edge.soften(&mut fields);
    }
    // A new contact has no force: its approach counts from the present depth.
    let indentation = match contact.is_new {
        true => Indentation::default(),
        false => indent(body, tool, contact, (&foot, distance), &fields),
    };
    *response = LocalResponse::at(body, foot, &fields, indentation);
    response.slope = slope(body, guess.force, others, &fields);
    if let Some(near_edge) = &near_edge {
        response.bending = near_edge.bending(&response.indentation, response.foot.normal);
    }
    response.slope_by_force = compliance_slope(body, guess.force, &fields);
    if let Some(series) = body.series {
        let (blended, known) = blended_series(series, weights);
        (response.series, response.known) = (Some(blended), known);
    }
    response.distance = distance;
    response.guess = ForceGuess { force: guess.force, friction: guess.friction, offset: guess.offset };
    if response.series.is_some() {
        let higher = response.higher_orders_at(guess.force);
        response.higher_at_guess = higher;
        response.slope += higher.slope;
        response.slope_by_force += higher.slope_by_force;
    }
    Some(())
}

/// The response of a tool on pressure cells without its force.
pub(super) fn evaluate_shape(
    (body, pressed): (LocalBody<'_>, &PressedSurface),
    tool: LocalTool<'_>,
    contact: &LocalContact,
    guess: Guess<'_>,
    others: &OtherContacts,
    cells: CellMemory<'_>,
    (weights, response): (&mut FanWeights, &mut LocalResponse),
) -> Option<()> {
    let Guess { place, force, .. } = guess;
    let shape = placed_shape(tool.shape, contact, place);
    cells.footprint.near.find(pressed, body.drawn.query, &shape);
    let footprint = cells.footprint.find(&shape, (&pressed.fine, body.smooth), contact.plane(), weights);
    let Some(footprint) = footprint else {
        // The tool is away from the body: no force.
        let compliance = DMat3::ZERO;
        *response = LocalResponse {
            foot: contact.foot,
            compliance,
            jacobian: DMat3::ZERO,
            slope_by_force: DMat3::ZERO,
            offset_by_position: DMat3::ZERO,
            friction_by_position: DMat3::ZERO,
            ..LocalResponse::default()
        };
        return Some(());
    };
    if weights.is_outside() {
        return None;
    }
    let fields = blend_fields(weights, &pressed.fields, body.is_hyperelastic);
    let half_space = HalfSpace::new(body, tool, &fields, contact.part);
    // Gradients by the tool's rotation of `E*`, of the width, and of `f^T C_reg f / 2`.
    let motion_turn = others.motion_turn.map_or(DVec3::ZERO, |motion_turn| motion_turn * force);
    let (mut modulus_turns, mut width_turns, mut compliance_turns) = (DVec3::ZERO, DVec3::ZERO, motion_turn);
    for (fan, turn) in weights.with_turns() {
        let own = &pressed.fields[fan];
        modulus_turns += turn * own[INVERSE_MODULUS];
        width_turns += turn * own[WIDTH];
        compliance_turns += turn * (0.5 / body.scale * force.dot(compliance_of(own) * force));
    }
    modulus_turns *= half_space.by_inverse_modulus;
    let indentation = indent_shape(
        &pressed.fine,
        tool,
        contact,
        place,
        &footprint,
        (&half_space, [modulus_turns, width_turns]),
        cells,
    );
    *response = LocalResponse::at(body, footprint.foot(place), &fields, indentation);
    response.point = place + indentation.lever;
    (response.slope, response.turn) = (slope(body, force, others, &fields), compliance_turns);
    Some(())
}

/// Indentation by a sphere.
fn indent(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    (foot, distance): (&FootPoint, f64),
    fields: &Fields,
) -> Indentation {
    let depth = tool.radius - contact.entry_depth - distance;
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
    // That of a surface of revolution with the same product.
    let pair = SphereOnSurface { radius: tool.radius, curvature: bounded.sqrt() - curved };
    let curvature_slope = product_slope * (0.5 * share / bounded.sqrt());
    let rate_slope = fields.slope(WIDENING) / body.scale;
    let widening = Widening { rate: fields.values[WIDENING] / body.scale, reference: reference_area(tool.radius) };
    let WidenedContact { sphere, energy_by_modulus, energy_by_rate, energy_by_terms } =
        widening.indent(depth, pair, half_space.modulus, body.is_hyperelastic.then_some(&half_space.strain_terms));
    let by_terms: DVec3 = half_space.strain_slopes.iter().zip(energy_by_terms).map(|(&slope, by)| slope * by).sum();
    let gradient = curvature_slope * sphere.energy_by_curvature
        + half_space.slope * energy_by_modulus
        + rate_slope * energy_by_rate
        + by_terms
        - foot.normal * sphere.force;
    Indentation {
        material: half_space.material,
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
    #[inline(always)]
    fn at(body: LocalBody<'_>, foot: FootPoint, fields: &Fields, indentation: Indentation) -> Self {
        let compliance = compliance_of(&fields.values) * (1.0 / body.scale);
        let (normal, point) = (foot.normal, foot.position);
        // A matrix is the identity by default.
        let scale = body.scale;
        let (jacobian, slope_by_force) = (DMat3::ZERO, DMat3::ZERO);
        Self {
            foot,
            compliance,
            normal,
            point,
            indentation,
            scale,
            jacobian,
            slope_by_force,
            bending: DMat3::ZERO,
            offset_by_position: DMat3::ZERO,
            offset_by_force: DMat3::ZERO,
            friction_by_position: DMat3::ZERO,
            turned_part: 1.0,
            ..Self::default()
        }
    }

    /// Whether the body's displacement has higher orders here.
    pub fn has_higher_orders(&self) -> bool {
        self.series.is_some()
    }

    /// Higher orders of the body's displacement at a force, N.
    fn higher_orders_at(&self, force: DVec3) -> HigherOrders {
        let at = |series| higher_orders(series, (self.foot.normal, &self.foot.turning), force, self.scale);
        self.series.as_ref().map_or_else(HigherOrders::default, at)
    }

    /// Takes the higher orders of the body's displacement with other weights of the fans. The contact is turned by a part only:
    /// on cells the force follows from the gradient of the energy.
    pub(super) fn set_series(&mut self, body: LocalBody<'_>, weights: &FanWeights, guess: Guess<'_>, turned_part: f64) {
        let Some(series) = body.series else { return };
        self.slope -= self.higher_at_guess.slope;
        let (blended, known) = blended_series(series, weights);
        (self.series, self.known, self.turned_part) = (Some(blended), known, turned_part);
        self.guess = ForceGuess { force: guess.force, friction: guess.friction, offset: guess.offset };
        self.higher_at_guess = self.higher_orders_at(guess.force);
        self.slope += self.higher_at_guess.slope;
        let linear = compliance_slope(body, guess.force, &weights.blend(body.fields));
        self.slope_by_force = linear + self.higher_at_guess.slope_by_force;
    }

    /// Slope without the part of the higher orders, N.
    pub(super) fn linear_slope(&self) -> DVec3 {
        self.slope - self.higher_at_guess.slope
    }

    /// Finds the wrench that follows from the indentation, inclined by the gradients of the compliance and by the other contacts,
    /// and from friction. It costs little beside the indentation, so that it is found again when the other contacts are known.
    pub fn find_force(&mut self, tool: LocalTool<'_>, contact: &LocalContact, place: DVec3, others: &OtherContacts) {
        let indentation = self.indentation;
        let whole = self.slope + others.slope;
        let slope = whole.clamp_length_max(STEEPEST_INCLINATION * indentation.force);
        // Higher orders have their own in `turned_push`; a slope at its bound has none.
        let follows = self.series.is_none() && slope == whole && self.slope_by_force != DMat3::ZERO;
        self.slope_follows = follows && others.slope == DVec3::ZERO && others.motion_slope.is_none();
        let by_guess = if follows { (DMat3::IDENTITY + self.slope_by_force).inverse() } else { DMat3::IDENTITY };
        let part = if self.series.is_some() { self.turned_part } else { 0.0 };
        let mut push = slope - indentation.gradient;
        if part > 0.0 {
            let turned = self.turned_push(whole);
            push = if part == 1.0 { turned } else { push.lerp(turned, part) };
        }
        let pressing = push.length();
        if indentation.force == 0.0 || pressing == 0.0 {
            return;
        }
        let lever = if part > 0.0 { push * (-tool.radius / pressing) } else { indentation.lever };
        let rotation = rotation_vector(contact.previous_orientation, contact.orientation);
        let displacement = place - contact.relative_position + rotation.cross(lever);
        self.normal = push / pressing;
        let stiffness = indentation.tangential * indentation.stiffness;
        let bound = tool.coefficient * pressing;
        self.friction = contact.friction.respond(displacement, bound, tool.coefficient, stiffness, self.normal);
        // The slope is that at the guess; what the difference changes follows from its derivative.
        self.force = self.guess.force + by_guess * (self.friction.force - push - self.guess.force);
        let change = self.force - self.guess.force;
        if self.series.is_some() {
            self.higher = match change.length_squared() < (CLOSE * CLOSE) * self.force.length_squared() {
                true => self.higher_at_guess.moved(change),
                false => self.higher_orders_at(self.force),
            };
        }
        let n = self.foot.normal;
        let turning = match tool.shape {
            ToolShape::Sphere { .. } => self.foot.turning,
            shape => bounded(self.foot.turning, 1.0 / shape.thickness()),
        };
        self.friction_by_position =
            self.friction.by_displacement - outer(self.friction.by_pressing, n) * indentation.stiffness;
        self.jacobian = outer(n, n) * indentation.stiffness - turning * indentation.force + self.friction_by_position;
        self.jacobian += self.bending;
        self.jacobian = by_guess * self.jacobian;
        if self.series.is_some() {
            let pressed = outer(self.friction.by_pressing, n) * indentation.stiffness;
            self.unturned = (DMat3::IDENTITY * (1.0 - part) + self.turning * part, self.jacobian + pressed);
        }
        if part > 0.0 {
            (self.offset, self.offset_by_force) = (self.offset * part, self.offset_by_force * part);
            self.jacobian = self.unturned.0 * self.jacobian;
            self.offset_by_position = self.offset_by_force * self.jacobian;
        }
        let share = if slope == whole { 1.0 } else { slope.length() / whole.length() };
        self.torque = indentation.torque - lever.cross(self.friction.force) + (self.turn + others.turn) * share;
    }

    /// Force on the tool along the sphere's radius where the body turns under it.
    ///
    /// The contact lies where the whole energy is stationary, not below the tool: with the unit vector `e` from the contact to the
    /// sphere's centre, at the distance `D`, and the offset `o = D e_t` along the surface,
    ///
    /// ```text
    /// F e_t = S(f)        f = -F e        dE/dp = -F e
    /// ```
    ///
    /// where `S` is the gradient of the energy along the surface. `S`, `o` and with it the approach depend on the force `f` itself.
    /// They are known at the guess `f_g`, `o_g`, and the change `x` from it follows from their derivatives:
    ///
    /// ```text
    /// S = S_g + G x      o = D S_g/F_g + B x,  B = D/F (I - n n^T) (G + e_t e^T)      F = F_g - k e_t . (o - o_g)
    /// ```
    fn turned_push(&mut self, slope: DVec3) -> DVec3 {
        let (Indentation { force, stiffness, gradient, .. }, n) = (self.indentation, self.foot.normal);
        let guess = self.guess.force - self.guess.friction;
        let before = -n.dot(guess);
        (self.turning, self.offset_by_force) = (DMat3::IDENTITY, DMat3::ZERO);
        if force == 0.0 || before <= LEAST_GUESS * force {
            self.offset = DVec3::ZERO;
            return n * force;
        }
        let along = (across(n) * (slope - gradient)).clamp_length_max(STEEPEST_INCLINATION * before);
        let before = hypot(before, along.length());
        let inclination = along * (1.0 / before);
        let direction = n * (1.0 - inclination.length_squared()).sqrt() + inclination;
        let by_force = across(n) * (self.slope_by_force + outer(inclination, direction)) * (self.distance / before);
        let whole = DMat3::IDENTITY + self.slope_by_force - outer(n, by_force.transpose() * inclination) * stiffness;
        self.turning = whole.inverse();
        let offset = inclination * self.distance;
        let relieved = stiffness * inclination.dot(offset - self.guess.offset);
        let pressing = (force * force - along.length_squared()).max(0.0).sqrt();
        let change = self.turning * (n * (relieved - pressing) - along - guess);
        let change = change.clamp_length_max(LARGEST_CHANGE * force);
        self.offset = offset + by_force * change;
        self.offset_by_force = by_force;
        -(guess + change)
    }

    /// Derivative of the body's displacement by the position at constant force: the contact moves along the surface.
    pub fn displacement_by_position(&self) -> DMat3 {
        self.slope_by_force.transpose() * (DMat3::IDENTITY - self.offset_by_position) * self.turned_part
    }

    /// What the response was evaluated from, beside its position.
    pub(super) fn guessed(&self, position: DVec3) -> Iterate {
        [position, self.guess.force, self.guess.friction, self.guess.offset]
    }

    /// What the next response at a position is evaluated from.
    pub(super) fn iterate(&self, position: DVec3) -> Iterate {
        [position, self.force, self.friction.force, self.offset]
    }

    /// Extrapolates that by a share of its difference from an earlier one.
    pub(super) fn extrapolate(&mut self, position: DVec3, before: &Iterate, share: f64) -> Iterate {
        let now = self.iterate(position);
        let next: Iterate = std::array::from_fn(|k| now[k] + (now[k] - before[k]) * share);
        (self.force, self.friction.force, self.offset) = (next[1], next[2], next[3]);
        next
    }

    /// A matrix that shows whether the contact is stable, and the factor with which a change of it changes the derivative of the
    /// force. With higher orders the derivative itself does not: it turns, and a sliding contact's friction grows with the pressing
    /// force, so that it is far from symmetric, and on a soft body its symmetric part seems unstable.
    pub fn stability_matrix(&self) -> (DMat3, DMat3) {
        let (turning, unturned) = self.unturned;
        if self.series.is_some() { (unturned, turning) } else { (self.jacobian, DMat3::IDENTITY) }
    }

    /// The springs of friction; without a force none is stretched.
    pub fn springs(&self) -> Option<&Friction> {
        (self.force != DVec3::ZERO).then_some(&self.friction.friction)
    }

    /// Energy stored outside the body, J: of the indentation and of the springs of friction.
    #[inline]
    pub fn local_energy(&self) -> f64 {
        self.indentation.energy + self.springs().map_or(0.0, Friction::energy)
    }
}
