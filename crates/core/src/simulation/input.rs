//! Inputs of a tick (tools, settings) and its outputs.

use glam::{DMat3, DQuat, DVec3};

use super::{MAX_BODIES, MAX_TOOLS};
use crate::tensor::rotation_vector;

/// Position and orientation of a rigid tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Of the tip, m, in the world.
    pub position: DVec3,
    /// World from tool, a unit quaternion.
    pub orientation: DQuat,
}

impl Pose {
    /// At a position, without rotation.
    pub fn at(position: DVec3) -> Self {
        Self { position, orientation: DQuat::IDENTITY }
    }

    /// Shortest rotation in the world from the orientation of another pose to this one's, rad along its axis.
    pub fn rotation_from(&self, other: &Pose) -> DVec3 {
        rotation_vector(other.orientation, self.orientation)
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.position.is_finite() && self.orientation.is_finite()
    }
}

/// Velocity of a rigid tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Of the tip, m/s, in the world.
    pub linear: DVec3,
    /// Angular velocity, rad/s, in the world.
    pub angular: DVec3,
}

/// Force and torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// N, in the world.
    pub force: DVec3,
    /// About the tip, N m, in the world.
    pub torque: DVec3,
}

/// Input of a tick from one device.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToolInput {
    /// Pose of the tool.
    pub pose: Pose,
    /// Its velocity.
    pub twist: Twist,
    /// Whether the tool is in the scene.
    pub active: bool,
    /// Whether it grabs the surface that it touches.
    pub grab: bool,
}

/// An impulse for a body in motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strike {
    /// Index of the body.
    pub body: usize,
    /// Point in the world, m; the strike acts on the closest surface point.
    pub point: DVec3,
    /// Impulse on the body, N s, in the world.
    pub impulse: DVec3,
    /// Radius of the patch that it acts on, m.
    pub radius: f64,
    /// Duration in the body's time, s. The force is half a sine wave of at least one step.
    pub duration: f64,
}

/// Settings of a tick.
#[derive(Clone, Copy, Debug)]
pub struct Controls {
    /// Contact radius of each tool's contacts that begin now, m.
    pub contact_radius: [f64; MAX_TOOLS],
    /// Coulomb's coefficient of friction of each tool.
    pub friction: [f64; MAX_TOOLS],
    /// Young's modulus of each body over that of its Green's function: it only scales forces.
    pub stiffness_scale: [f64; MAX_BODIES],
    /// Limit of each body's strain; zero for none.
    pub strain_limit: [f64; MAX_BODIES],
    /// Ends all contacts and brings moving bodies to rest.
    pub reset: bool,
    /// Time by which bodies in motion advance in this tick, s.
    pub advance: f64,
    /// A strike that begins now.
    pub strike: Option<Strike>,
}

impl Default for Controls {
    fn default() -> Self {
        Self {
            contact_radius: [0.0; MAX_TOOLS],
            friction: [0.0; MAX_TOOLS],
            stiffness_scale: [1.0; MAX_BODIES],
            strain_limit: [0.0; MAX_BODIES],
            reset: false,
            advance: 1e-3,
            strike: None,
        }
    }
}

/// All inputs of a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Input {
    /// From the devices.
    pub tools: [ToolInput; MAX_TOOLS],
    /// Settings.
    pub controls: Controls,
}

/// Outputs of a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Output {
    /// Wrench on each device: minus that of the tool on the bodies. It has not passed the safety stage.
    pub wrench_on_device: [Wrench; MAX_TOOLS],
    /// The same before the strain limit reduces the forces of sliding contacts: the part that follows from one energy.
    pub unlimited: [Wrench; MAX_TOOLS],
    /// Whether each tool touches.
    pub in_contact: [bool; MAX_TOOLS],
    /// Whether the strain limit keeps each tool from following its device.
    pub limited: [bool; MAX_TOOLS],
    /// Whether a contact of each tool fails the last check: it lies off its body or its tool, or its force is too large. The wrench
    /// of that tool is zero.
    pub unsound: [bool; MAX_TOOLS],
}

/// Position and rotation of a body in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Of the body's origin, m.
    pub position: DVec3,
    /// World from body, a rotation.
    pub rotation: DMat3,
}

impl Default for Placement {
    fn default() -> Self {
        Self { position: DVec3::ZERO, rotation: DMat3::IDENTITY }
    }
}

impl Placement {
    /// A point of the world in the body's frame.
    pub fn point_to_body(&self, point: DVec3) -> DVec3 {
        self.vector_to_body(point - self.position)
    }

    /// A vector of the world in the body's frame.
    pub fn vector_to_body(&self, vector: DVec3) -> DVec3 {
        self.rotation.transpose() * vector
    }

    /// A point of the body's frame in the world.
    pub fn point_to_world(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.position
    }

    /// A vector of the body's frame in the world.
    pub fn vector_to_world(&self, vector: DVec3) -> DVec3 {
        self.rotation * vector
    }
}
