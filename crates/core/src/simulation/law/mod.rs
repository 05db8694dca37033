//! Contact laws: when a contact begins, how it follows its tool, when it ends.
//!
//! A law is a file here that implements [`Law`]; `step` calls it and knows nothing else of it. What a law does must not
//! allocate, and must not hand out energy over a closed path of the tool.

mod local;
mod node;
mod patch;
mod stick;

pub(super) use local::ASKED;
pub use local::{
    Cells, Guess, LocalBody, LocalContact, LocalResponse, LocalTool, Others, depth_below, evaluate, posed, takes_cells,
};
pub use stick::series_compliance;

use glam::{DQuat, DVec3};

use super::body::BodyModel;
use super::contacts::Contact;
use super::covering::Covering;
use super::input::Input;
use super::model::Model;
use super::motion::Motion;
use super::rotation::rotation_vector;
use super::state::{Entry, ToolState};
use super::tool::{LawKind, ToolModel};
use crate::contact::footprint::PressedSurface;
use crate::contact::shape::ToolShape;
use crate::contact::{Refusal, SurfacePoint};

/// A tool farther than this many radii from the surface at rest meets it there: displacements are smaller than that.
const MOVING_REACH: f64 = 4.0;

/// What a kind of law says.
pub fn law_of(kind: LawKind) -> &'static dyn Law {
    match kind {
        LawKind::Local => &local::Local,
        LawKind::Patch => &stick::Sticking(patch::Patch),
        LawKind::Node => &stick::Sticking(node::Node),
    }
}

/// What a contact law says, in the order of a tick.
pub trait Law: Sync {
    /// For a tool without a contact: begins one where it reaches the body, with its patch in `covering`. `entry` is what
    /// the tool remembers of this body.
    ///
    /// # Errors
    /// Why the body cannot be touched there.
    fn begin(
        &self,
        approach: &Approach<'_>,
        entry: &mut Entry,
        covering: &mut Covering,
    ) -> Result<Option<Contact>, Refusal>;

    /// Follows the tool; false ends the contact.
    fn update(&self, approach: &Approach<'_>, contact: &mut Contact) -> bool;

    /// Whether the contact ends by the force that was found.
    fn end(&self, contact: &Contact) -> bool;

    /// Most tangential force of a contact that sticks, over its pressing force: beyond it the anchor slips. `None` for any.
    fn cone(&self, _contact: &Contact) -> Option<f64> {
        None
    }
}

/// A tool beside a body; vectors are in the body's frame.
pub struct Approach<'a> {
    /// The body.
    pub body: &'a BodyModel,
    /// Index of the body.
    pub body_index: usize,
    /// How it moves.
    pub motion: Option<&'a Motion>,
    /// The tool.
    pub tool: &'a ToolModel,
    /// Index of the tool.
    pub tool_index: usize,
    /// Where the tool is, m.
    pub position: DVec3,
    /// How it is turned.
    pub orientation: DQuat,
    /// Whether it holds on to what it touches.
    pub grab: bool,
    /// Contact radius of a contact that begins now, m.
    pub contact_radius: f64,
    /// How far the tool has gone since the last tick, m, where it was in the scene then, and turned, rad.
    pub gone: DVec3,
    pub turned: f64,
    /// Whether the tool has just come back into the scene.
    pub returned: bool,
    /// The body's surface for a tool that is no sphere, under the local law.
    pub pressed: Option<&'a PressedSurface>,
}

impl<'a> Approach<'a> {
    /// Of a tool as its device has it.
    pub fn new(
        model: &'a Model,
        motion: Option<&'a Motion>,
        (tool, body): (usize, usize),
        known: &ToolState,
        input: &Input,
    ) -> Self {
        let said = &input.tools[tool];
        let position = model.bodies[body].placement.point_to_body(said.pose.position);
        let contact_radius = input.controls.contact_radius[tool];
        let orientation = DQuat::from_mat3(&model.bodies[body].placement.rotation.transpose()) * said.pose.orientation;
        let before = known.before.unwrap_or(said.pose);
        let gone = position - model.bodies[body].placement.point_to_body(before.position);
        let turned = rotation_vector(before.orientation, said.pose.orientation).length();
        let returned = known.before.is_none() && known.has_left;
        let at = Self::at(model, motion, tool, body, position);
        Self { grab: said.grab, orientation, contact_radius, gone, turned, returned, ..at }
    }

    /// Of a tool at a place of the body's frame.
    pub fn at(model: &'a Model, motion: Option<&'a Motion>, tool: usize, body: usize, position: DVec3) -> Self {
        Self {
            body: &model.bodies[body],
            body_index: body,
            motion,
            tool: &model.tools[tool],
            tool_index: tool,
            position,
            orientation: DQuat::IDENTITY,
            grab: false,
            contact_radius: 0.0,
            gone: DVec3::ZERO,
            turned: 0.0,
            returned: false,
            pressed: model.pressed[tool][body].as_deref(),
        }
    }

    /// How far any point of the tool has gone at most, m.
    pub fn way(&self) -> f64 {
        match self.tool.shape {
            ToolShape::Sphere { .. } => self.gone.length(),
            ref shape => self.gone.length() + 2.0 * shape.bounding_radius() * self.turned,
        }
    }

    /// Closest point of the surface where it is now, as a point of the loaded surface at rest.
    pub fn closest(&self) -> Option<SurfacePoint> {
        let closest = self.body.closest(self.position)?;
        match (self.motion, &self.body.dynamics) {
            (Some(motion), Some(dynamics)) if closest.signed_distance.abs() < MOVING_REACH * self.tool.radius => {
                self.body.closest(self.position - motion.displacement_at(self.body, &dynamics.modes, &closest))
            }
            _ => Some(closest),
        }
    }

    /// Displacement of the surface below the tool in the free motion of the body, m.
    pub fn carried(&self) -> DVec3 {
        match (self.motion, &self.body.dynamics, self.body.closest(self.position)) {
            (Some(motion), Some(dynamics), Some(closest))
                if closest.signed_distance.abs() < MOVING_REACH * self.tool.radius =>
            {
                motion.displacement_at(self.body, &dynamics.modes, &closest)
            }
            _ => DVec3::ZERO,
        }
    }

    /// How deep the tool is in the untouched surface, m; zero outside.
    pub fn depth(&self) -> f64 {
        self.closest().map_or(0.0, |closest| self.reach(closest.normal) - closest.signed_distance).max(0.0)
    }

    /// How far the tool reaches from its origin towards a surface of the given normal, m.
    pub fn reach(&self, normal: DVec3) -> f64 {
        match self.tool.shape {
            ToolShape::Sphere { radius } => radius,
            ref shape => {
                let own = self.orientation.conjugate() * normal;
                -shape.support(-own).dot(own)
            }
        }
    }
}
