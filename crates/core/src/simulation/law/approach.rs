//! Pose and motion of a tool relative to a body, as contact laws need them.

use glam::{DQuat, DVec3};

use crate::contact::SurfacePoint;
use crate::contact::footprint::PressedSurface;
use crate::contact::shape::ToolShape;
use crate::simulation::body::BodyModel;
use crate::simulation::input::Input;
use crate::simulation::model::Model;
use crate::simulation::motion::Motion;
use crate::simulation::state::ToolState;
use crate::simulation::tool::ToolModel;
use crate::tensor::rotation_vector;

/// Distance from the surface at rest, over the tool's radius, beyond which displacements by motion are neglected: they are smaller.
const MOVING_REACH: f64 = 4.0;

/// A tool relative to a body; vectors are in the body's frame.
pub struct Approach<'a> {
    /// The body.
    pub body: &'a BodyModel,
    /// Index of the body.
    pub body_index: usize,
    /// Its motion.
    pub motion: Option<&'a Motion>,
    /// The tool.
    pub tool: &'a ToolModel,
    /// Index of the tool.
    pub tool_index: usize,
    /// Position of the tool, m.
    pub position: DVec3,
    /// Its orientation.
    pub orientation: DQuat,
    /// Whether it grabs.
    pub grab: bool,
    /// Contact radius of a new contact, m.
    pub contact_radius: f64,
    /// Displacement since the last tick, m, and angle of rotation, rad; zero for a tool that was not in the scene.
    pub displacement: DVec3,
    pub rotation_angle: f64,
    /// Whether the tool has just returned into the scene.
    pub has_returned: bool,
    /// The body's surface in pieces, for a tool that is not a sphere under the local law.
    pub pressed_surface: Option<&'a PressedSurface>,
}

impl<'a> Approach<'a> {
    /// Of a tool at the pose of its device.
    pub fn new(
        model: &'a Model,
        motion: Option<&'a Motion>,
        (tool, body): (usize, usize),
        tool_state: &ToolState,
        input: &Input,
    ) -> Self {
        let tool_input = &input.tools[tool];
        let position = model.bodies[body].placement.point_to_body(tool_input.pose.position);
        let contact_radius = input.controls.contact_radius[tool];
        let orientation = model.frames[body] * tool_input.pose.orientation;
        let before = tool_state.previous_pose.unwrap_or(tool_input.pose);
        let displacement = position - model.bodies[body].placement.point_to_body(before.position);
        let rotation_angle = rotation_vector(before.orientation, tool_input.pose.orientation).length();
        let has_returned = tool_state.previous_pose.is_none() && tool_state.has_left;
        let at = Self::at(model, motion, tool, body, position);
        Self { grab: tool_input.grab, orientation, contact_radius, displacement, rotation_angle, has_returned, ..at }
    }

    /// Of a tool at a position in the body's frame.
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
            displacement: DVec3::ZERO,
            rotation_angle: 0.0,
            has_returned: false,
            pressed_surface: model.pressed_surfaces[tool][body].as_deref(),
        }
    }

    /// Largest displacement of any point of the tool since the last tick, m.
    pub fn largest_motion(&self) -> f64 {
        match self.tool.shape {
            ToolShape::Sphere { .. } => self.displacement.length(),
            ref shape => self.displacement.length() + 2.0 * shape.bounding_radius() * self.rotation_angle,
        }
    }

    /// Closest point of the surface as displaced now, as a point of the loaded surface at rest.
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
    pub fn surface_displacement(&self) -> DVec3 {
        match (self.motion, &self.body.dynamics, self.body.closest(self.position)) {
            (Some(motion), Some(dynamics), Some(closest))
                if closest.signed_distance.abs() < MOVING_REACH * self.tool.radius =>
            {
                motion.displacement_at(self.body, &dynamics.modes, &closest)
            }
            _ => DVec3::ZERO,
        }
    }

    /// Depth of the tool in the untouched surface, m; zero outside.
    pub fn depth(&self) -> f64 {
        self.closest().map_or(0.0, |closest| self.reach(closest.normal) - closest.signed_distance).max(0.0)
    }

    /// Extent of the tool from its origin towards a surface of the given normal, m.
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
