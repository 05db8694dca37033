//! A sphere beside a sharp convex edge: a softer half-space, and a compliance without a kink (`contact::ConvexEdges`).

use glam::{DMat3, DVec3};

use super::half_space::{Fields, Indentation, LocalBody};
use super::inclination::{OtherContacts, slope};
use crate::contact::BesideEdges;
use crate::contact::regular::{INVERSE_MODULUS, blend_fields};
use crate::contact::smooth::{FanWeights, FootPoint};
use crate::tensor::outer;

/// Where a sphere is beside edges, and the second derivatives of `f^T C f / 2` there.
#[derive(Clone, Copy)]
pub struct NearEdge {
    beside: BesideEdges,
    bending: DMat3,
}

impl NearEdge {
    /// For a foot, a centre and a force on the body, N, near the result. Sets the weights for the slowed foot. `None` away from edges.
    pub fn find(
        body: LocalBody<'_>,
        (foot, centre): (&FootPoint, DVec3),
        force: DVec3,
        weights: &mut FanWeights,
    ) -> Option<Self> {
        let beside = body.edges?.beside(foot, centre)?;
        // Gradient by the foot itself.
        let fixed = FootPoint { shift: DMat3::IDENTITY, turning: DMat3::ZERO, ..beside.slowed };
        body.smooth.weigh(&fixed, weights);
        let by_foot = slope(body, force, &OtherContacts::default(), &blend_fields(weights, body.fields, false));
        body.smooth.weigh(&beside.slowed, weights);
        Some(Self { beside, bending: beside.bending(by_foot) })
    }

    /// Gives the half-space its share of the modulus.
    pub fn soften(&self, fields: &mut Fields) {
        let share = &self.beside.share;
        fields.divide(INVERSE_MODULUS, (share.value, share.gradient));
    }

    /// Derivative of the force on the body by the position that comes from edges, N/m. The energy of the half-space goes with its
    /// modulus.
    pub fn bending(&self, indentation: &Indentation, normal: DVec3) -> DMat3 {
        let share = &self.beside.share;
        let mixed = outer(normal, share.gradient);
        let softer = share.hessian * indentation.energy - (mixed + mixed.transpose()) * indentation.force;
        softer * (1.0 / share.value) - self.bending
    }
}
