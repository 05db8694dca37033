//! A sphere beside a sharp convex edge: a softer half-space, a compliance without a kink, and one depth inside the wedge
//! (`contact::ConvexEdges`).

use glam::{DMat3, DVec3};

use super::half_space::{Fields, Indentation, LocalBody};
use super::inclination::{OtherContacts, slope};
use crate::contact::regular::{INVERSE_MODULUS, blend_fields};
use crate::contact::smooth::{FanWeights, FootPoint};
use crate::contact::{BetweenFaces, Faces, Share};
use crate::tensor::{across, outer};

/// Where a sphere is beside edges.
#[derive(Clone, Copy)]
pub struct NearEdge {
    /// Share of the half-space's modulus.
    share: Share,
    /// Second derivatives of `f^T C f / 2`.
    bending: DMat3,
    /// Depth that is gained by a step along the normal, over this step: less than one between two faces.
    steepness: f64,
    /// Part to which higher orders turn the contact: between two faces the force follows from the gradient of the energy.
    pub turned_part: f64,
}

impl NearEdge {
    /// Beside none.
    const NONE: Self = Self { share: Share::WHOLE, bending: DMat3::ZERO, steepness: 1.0, turned_part: 1.0 };

    /// For a foot, a centre and a force on the body, N, near the result. Sets the weights of the place; between two faces the foot becomes
    /// that of a plane at the depth below both. `None` away from edges.
    pub fn find(
        body: LocalBody<'_>,
        (foot, centre): (&mut FootPoint, DVec3),
        force: DVec3,
        [weights, other_weights]: [&mut FanWeights; 2],
    ) -> Option<Self> {
        let Some(edges) = body.edges else {
            body.smooth.weigh(foot, weights);
            return None;
        };
        if let Some(face) = edges.other_face(foot, centre)
            && let Some(other) = body.smooth.foot(body.drawn, centre, &face.start, &mut other_weights.near)
        {
            match face.faces(foot, &other) {
                Faces::Own => {}
                Faces::Other => *foot = other,
                Faces::Both(between) => {
                    let feet = [&*foot, &other];
                    let near = Self::between_faces(body, feet, &between, (centre, force), [weights, other_weights]);
                    put_between(foot, &other, &between, centre);
                    return Some(near);
                }
            }
        }
        Self::beside(body, foot, (centre, force), weights)
    }

    /// The same for a foot on one face.
    fn beside(
        body: LocalBody<'_>,
        foot: &FootPoint,
        (centre, force): (DVec3, DVec3),
        weights: &mut FanWeights,
    ) -> Option<Self> {
        let Some(beside) = body.edges.and_then(|edges| edges.beside(foot, centre)) else {
            body.smooth.weigh(foot, weights);
            return None;
        };
        // Gradient by the foot itself.
        let fixed = FootPoint { shift: DMat3::IDENTITY, turning: DMat3::ZERO, ..beside.slowed };
        body.smooth.weigh(&fixed, weights);
        let by_foot = slope(body, force, OtherContacts::default(), &blend_fields(weights, body.fields, false));
        body.smooth.weigh(&beside.slowed, weights);
        Some(Self { share: beside.share, bending: beside.bending(by_foot), ..Self::NONE })
    }

    /// The same for feet on both faces of an edge.
    fn between_faces(
        body: LocalBody<'_>,
        [own, other]: [&FootPoint; 2],
        between: &BetweenFaces,
        at: (DVec3, DVec3),
        [weights, other_weights]: [&mut FanWeights; 2],
    ) -> Self {
        let one = Self::beside(body, own, at, weights).unwrap_or(Self::NONE);
        let two = Self::beside(body, other, at, other_weights).unwrap_or(Self::NONE);
        let BetweenFaces { share, share_gradient, .. } = *between;
        weights.mix(other_weights, share, share_gradient);
        let [own_part, other_part] = [one.share.scaled(1.0 - share, 0.0), two.share.scaled(share, 0.0)];
        let turned = share_gradient * (two.share.value - one.share.value);
        Self {
            share: Share {
                value: own_part.value + other_part.value,
                gradient: own_part.gradient + other_part.gradient + turned,
                hessian: own_part.hessian + other_part.hessian,
            },
            bending: one.bending * (1.0 - share) + two.bending * share,
            steepness: between.depth.gradient.length(),
            turned_part: between.single,
        }
    }

    /// Gives the half-space its share of the modulus.
    pub fn soften(&self, fields: &mut Fields) {
        fields.divide(INVERSE_MODULUS, (self.share.value, self.share.gradient));
    }

    /// The indentation in the direction of a normal, from that by the depth.
    pub fn along_normal(&self, indentation: &mut Indentation, normal: DVec3) {
        indentation.gradient += normal * (indentation.force * (1.0 - self.steepness));
        indentation.force *= self.steepness;
        indentation.stiffness *= self.steepness * self.steepness;
    }

    /// Derivative of the force on the body by the position that comes from edges, N/m. The energy of the half-space goes with its
    /// modulus.
    pub fn bending(&self, indentation: &Indentation, normal: DVec3) -> DMat3 {
        let mixed = outer(normal, self.share.gradient);
        let softer = self.share.hessian * indentation.energy - (mixed + mixed.transpose()) * indentation.force;
        softer * (1.0 / self.share.value) - self.bending
    }
}

/// Puts a foot onto a plane at the depth between two faces.
fn put_between(foot: &mut FootPoint, other: &FootPoint, between: &BetweenFaces, centre: DVec3) {
    let Share { value, gradient, hessian } = between.depth;
    let steepness = gradient.length();
    (foot.normal, foot.turning) = (gradient * (-1.0 / steepness), hessian * (-1.0 / steepness));
    (foot.distance, foot.position) = (-value, centre + foot.normal * value);
    foot.shift = across(foot.normal) + foot.turning * value;
    if between.share > 0.5 {
        foot.triangle = other.triangle;
    }
}
