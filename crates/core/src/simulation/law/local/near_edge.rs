//! A sphere beside a sharp convex edge: a softer half-space, and a compliance without a kink (`contact::ConvexEdges`).

use glam::DMat3;

use super::half_space::{Fields, LocalBody};
use super::response::{Guess, LocalResponse, OtherContacts, compliance_slope, slope};
use crate::contact::BesideEdges;
use crate::contact::regular::{PLANE_STRAIN, blend_fields};
use crate::contact::smooth::{FanWeights, FootPoint};
use crate::simulation::contacts::LocalContact;
use crate::tensor::outer;

/// Where a sphere is beside edges, and the second derivatives of `f^T C f / 2` there.
#[derive(Clone, Copy)]
pub struct NearEdge {
    beside: BesideEdges,
    bending: DMat3,
}

impl NearEdge {
    /// With the weights of the slowed foot; `None` away from edges, and for a contact that fades on its plane.
    pub fn find(
        body: LocalBody<'_>,
        contact: &LocalContact,
        guess: Guess<'_>,
        foot: &FootPoint,
        weights: &mut FanWeights,
    ) -> Option<Self> {
        let edges = body.edges.filter(|_| !contact.is_fading)?;
        let beside = edges.beside(foot, guess.place - guess.offset)?;
        // Gradient by the foot itself.
        let fixed = FootPoint { shift: DMat3::IDENTITY, turning: DMat3::ZERO, ..beside.slowed };
        body.smooth.weigh(&fixed, weights);
        let fields = blend_fields(weights, body.fields, false);
        let by_foot = slope(body, guess.force, OtherContacts::default(), &fields);
        let near = Self { beside, bending: beside.bending(by_foot) };
        body.smooth.weigh(&near.beside.slowed, weights);
        Some(near)
    }

    /// Gives the half-space its share of the modulus.
    pub fn soften(&self, fields: &mut Fields) {
        let share = &self.beside.share;
        fields.divide(PLANE_STRAIN, (1.0 / share.value, -share.gradient / (share.value * share.value)));
    }

    /// Adds the derivatives of the force that come from the edges. The energy of the half-space goes with its modulus.
    pub fn add_derivatives(
        &self,
        body: LocalBody<'_>,
        guess: Guess<'_>,
        fields: &Fields,
        response: &mut LocalResponse,
    ) {
        let (share, indentation) = (&self.beside.share, &response.indentation);
        let mixed = outer(response.foot.normal, share.gradient);
        let softer = share.hessian * indentation.energy - (mixed + mixed.transpose()) * indentation.force;
        response.bending = softer * (1.0 / share.value) - self.bending;
        if body.series.is_none() {
            response.slope_by_force = compliance_slope(body, guess.force, fields);
        }
    }
}
