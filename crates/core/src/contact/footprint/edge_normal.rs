//! The normal of a contact over an edge: that of the tool.
//!
//! The mean of the pieces' own normals `n_i` turns over from one side of a blade to the other while the tool moves by a fraction of its
//! radius. The gradient `t_i` of the tool's distance, from a piece towards the tool, does not. So a share `c` of the contact's
//! normal is the tool's. With the means `N` of the normals, `X` of the places and `D` of `t_i - n_i`, the tool's half width `h`, and
//! the weight `v` of walls beside the contact,
//!
//! ```text
//! n ~ sum w_i (n_i + c (t_i - n_i))        c = edge bulge (1 - step(v/(v + sum w_i)))
//! bulge = step((mean(n_i . x_i) - N . X)/h)        1 - edge = (1 - step(1 - N^2)) (1 - step(|D - n_0 (n_0 . D)|))
//! ```
//!
//! with `n_0 = N/|N|`. On planes and round bodies `edge` is zero: all normals are alike there, and the tool's are theirs in the
//! mean, but for the error of a sum over few pieces. On an edge the first differ, on one side of a blade the second.
//! `bulge` is zero in creases, where the tool's normals point from one wall to the other. The last factor is zero beside
//! a wall: the contact's pieces end there as at an edge, and the body does not.

use glam::{DMat3, DVec3};

use super::crest::{self, Crest};
use super::{FootprintScratch, NearPiece, PlacedShape, Sums, smooth_step};
use crate::contact::shape::ToolShape;
use crate::tensor::outer;

/// Distances of a piece, over the tool's reach, from which the tool's normal begins to count there, and counts alone: deep inside
/// of a tool, where two of its sides are as near, its normal jumps.
const OWN_NORMAL: [f64; 2] = [-0.75, -0.25];
/// Least reach of a tool, over its thickness: one with less, as a flat ellipsoid or a file with thin parts, turns as fast as the body
/// does over an edge, and leaves the body's own normals.
const LEAST_REACH: f64 = 0.5;
/// Measure of a bulge, `mean(n_i . x_i) - N . X` over the tool's thickness, below which the pieces lie in a crease, and not at all.
const BULGING: [f64; 2] = [-0.02, 0.0];
/// Share of walls in what is near the tool from which the contact lies in a hollow, and fully so.
const WALLS: [f64; 2] = [0.0, 0.1];
/// Length of the mean difference of the tool's normals and the pieces' own, across the latter, up to which the contact has its own
/// normal, and from which it has the tool's. Pieces of a plane that are nearly as large as the tool differ by 0.05.
const APART: [f64; 2] = [0.1, 0.3];
/// Spread of the pieces' normals, likewise.
const SPREAD: [f64; 2] = [0.01, 0.1];
/// Part of the least difference below which the derivatives of the tool's normals need not be found.
const NEARLY: f64 = 0.9;

/// A share, and its derivatives by the tool's position and rotation.
type Share = (f64, [DVec3; 2]);

/// Sums over pieces, and derivatives of sums, that only an edge needs.
#[derive(Default)]
struct EdgeSums {
    /// Difference of the tool's normals and the pieces' own.
    difference: DVec3,
    difference_by: [DMat3; 2],
    offset_by: [DVec3; 2],
    walls_by: [DVec3; 2],
}

/// Reach of a tool whose own normals may count, m.
pub(super) fn reach(tool: &ToolShape) -> Option<f64> {
    let reach = tool.reach();
    (reach >= LEAST_REACH * tool.thickness()).then_some(reach)
}

impl FootprintScratch {
    /// Mixes the tool's own normals into the sum of normals; returns the crest below.
    pub(super) fn turn_to_tool(&mut self, tool: &PlacedShape<'_>, reach: f64, sums: &mut Sums) -> Option<Crest> {
        let thickness = tool.shape.thickness();
        if !sums.may_turn(thickness) {
            return None;
        }
        self.near.find_turnings(tool);
        let edge = self.sum_over_edge(reach);
        let is_edge = either(sums.share_of_spread(SPREAD), sums.share_of_difference(&edge));
        let in_air = both(sums.share_of_bulge(&edge, thickness), sums.share_without_walls(&edge));
        let crest = self.find_crest(sums, both(sums.share_of_spread(crest::SPREAD), in_air));
        let (share, share_by) = both(is_edge, in_air);
        for k in 0..2 {
            sums.normal_by[k] += edge.difference_by[k] * share + outer(edge.difference, share_by[k]);
        }
        sums.normal += edge.difference * share;
        crest
    }

    fn sum_over_edge(&self, reach: f64) -> EdgeSums {
        let zero = [DMat3::ZERO; 2];
        let mut edge = EdgeSums { difference_by: zero, ..EdgeSums::default() };
        for (near, turning) in self.near.pieces.iter().zip(&self.near.turnings) {
            let Some([(weight, by), (_, whole_by)]) = near.weigh_with_wall(self.near.margin) else { continue };
            let (turned, turned_by) = near.turned(turning, reach);
            let offset = (near.middle - self.near.centre).dot(near.normal);
            edge.difference += turned * weight;
            for k in 0..2 {
                edge.difference_by[k] += outer(turned, by[k]) + turned_by[k] * weight;
                edge.offset_by[k] += by[k] * offset;
                edge.walls_by[k] += whole_by[k] - by[k];
            }
        }
        edge
    }
}

/// Share of what has both.
fn both((a, a_by): Share, (b, b_by): Share) -> Share {
    (a * b, [0, 1].map(|k| a_by[k] * b + b_by[k] * a))
}

/// Share of what has either.
fn either((a, a_by): Share, (b, b_by): Share) -> Share {
    (a + b - a * b, [0, 1].map(|k| a_by[k] * (1.0 - b) + b_by[k] * (1.0 - a)))
}

impl NearPiece {
    /// Difference of the tool's normal, as of the latest search, and the piece's own; zero deep in the tool.
    pub(super) fn difference(&self, reach: f64) -> DVec3 {
        (self.tool_normal - self.normal) * smooth_step(self.distance / reach, OWN_NORMAL).0
    }

    /// The difference and its derivatives, with those of the tool's normal.
    fn turned(&self, turning: &[DMat3; 2], reach: f64) -> (DVec3, [DMat3; 2]) {
        let (share, rise) = smooth_step(self.distance / reach, OWN_NORMAL);
        let difference = self.tool_normal - self.normal;
        let rise = rise / reach;
        let by = [0, 1].map(|k| turning[k] * share + outer(difference, self.by_pose[k]) * rise);
        (difference * share, by)
    }
}

impl Sums {
    /// Whether the tool's normals can have a share. Planes, round bodies and creases end here.
    fn may_turn(&self, thickness: f64) -> bool {
        let spread = self.weight * self.weight * (1.0 - SPREAD[0]) - self.normal.length_squared();
        let across =
            self.difference.cross(self.normal).length() - NEARLY * APART[0] * self.weight * self.normal.length();
        let walls = self.walls - WALLS[1] * (self.weight + self.walls);
        (spread > 0.0 || across > 0.0) && walls < 0.0 && self.bulge() > BULGING[0] * thickness
    }

    /// `mean(n_i . x_i) - N . X`, m: positive over an edge, and negative in a crease.
    fn bulge(&self) -> f64 {
        let inverse = 1.0 / self.weight;
        (self.offset - self.normal.dot(self.place) * inverse) * inverse
    }

    fn share_of_bulge(&self, edge: &EdgeSums, thickness: f64) -> Share {
        let inverse = 1.0 / self.weight;
        let (normal, place, offset) = (self.normal * inverse, self.place * inverse, self.offset * inverse);
        let (share, slope) = smooth_step(self.bulge() / thickness, BULGING);
        let by = [0, 1].map(|k| {
            let weight_by = self.weight_by[k];
            let normal_by = (self.normal_by[k] - outer(normal, weight_by)) * inverse;
            let place_by = (self.place_by[k] - outer(place, weight_by)) * inverse;
            let offset_by = (edge.offset_by[k] - weight_by * offset) * inverse;
            (offset_by - normal_by.transpose() * place - place_by.transpose() * normal) * (slope / thickness)
        });
        (share, by)
    }

    /// Beside a wall the contact's pieces end as at an edge.
    fn share_without_walls(&self, edge: &EdgeSums) -> Share {
        let all = self.weight + self.walls;
        let (share, slope) = smooth_step(self.walls / all, WALLS);
        let by = [0, 1].map(|k| {
            let walls_by = edge.walls_by[k] * self.weight - self.weight_by[k] * self.walls;
            walls_by * (-slope / (all * all))
        });
        (1.0 - share, by)
    }

    pub(super) fn share_of_spread(&self, bounds: [f64; 2]) -> Share {
        let inverse = 1.0 / self.weight;
        let normal = self.normal * inverse;
        let (share, slope) = smooth_step(1.0 - normal.length_squared(), bounds);
        let by = [0, 1].map(|k| {
            let normal_by = (self.normal_by[k] - outer(normal, self.weight_by[k])) * inverse;
            normal_by.transpose() * normal * (-2.0 * slope)
        });
        (share, by)
    }

    /// With the unit normal `n`, of the part `d - (d . n) n` of the difference across it.
    fn share_of_difference(&self, edge: &EdgeSums) -> Share {
        let (inverse, length) = (1.0 / self.weight, self.normal.length());
        let normal = self.normal * (1.0 / length.max(f64::MIN_POSITIVE));
        let along = edge.difference.dot(normal);
        let part = edge.difference - normal * along;
        let size = part.length();
        let (share, slope) = smooth_step(size * inverse, APART);
        if slope == 0.0 {
            return (share, [DVec3::ZERO; 2]);
        }
        let by = [0, 1].map(|k| {
            // The part is across `n`: d|part| = part . (dd - (d . n) dn)/|part|.
            let by = edge.difference_by[k] - self.normal_by[k] * (along / length);
            (by.transpose() * part * (1.0 / size) - self.weight_by[k] * (size * inverse)) * (slope * inverse)
        });
        (share, by)
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::contact::SurfaceQuery;
    use crate::contact::footprint::{Plane, PressedSurface};
    use crate::contact::regular::FanFields;
    use crate::contact::shape::{SurfaceShape, tests::box_mesh};
    use crate::contact::smooth::tests::{cube, near};
    use crate::contact::smooth::{FanWeights, SmoothSurface};

    /// From one side of a cube's edge to the other the normal's derivatives are its differences over small motions and rotations.
    #[test]
    fn over_an_edge_the_normal_turns_as_its_derivatives_say() {
        let surface = cube();
        let (query, smooth) = (SurfaceQuery::new(&surface).expect("triangles"), SmoothSurface::new(&surface));
        let fields = vec![FanFields::default(); smooth.fans().len()];
        let (vertices, triangles) = box_mesh(DVec3::new(0.2, 0.25, 0.3));
        let shapes = [
            ToolShape::Surface(Box::new(SurfaceShape::new(&vertices, &triangles).expect("a shape"))),
            ToolShape::punch(0.1, 0.01).expect("a shape"),
            ToolShape::ellipsoid(DVec3::new(0.2, 0.15, 0.1)).expect("a shape"),
            ToolShape::punch(0.1, 0.08).expect("a shape"),
            ToolShape::capsule(0.1, 0.1).expect("a shape"),
        ];
        for shape in &shapes {
            let pressed = PressedSurface::new(&surface, &query, &smooth, &fields, shape.thickness());
            let mut weights = FanWeights::new(near(&smooth));
            let mut normal_at = |place: DVec3, orientation: DQuat, towards: DVec3| {
                let mut scratch = FootprintScratch::default();
                let (rotation, penetration) = (DMat3::from_quat(orientation), 0.01);
                let at = PlacedShape { shape, position: place, rotation, contact_normal: towards, penetration };
                let known = Plane { point: DVec3::new(1.0, 0.52, 1.0), normal: towards };
                scratch.near.find(&pressed, &query, &at);
                scratch.find(&at, (&pressed.fine, &smooth), known, &mut weights).expect("a footprint")
            };
            for k in 0..9 {
                let angle = (f64::from(k) * 11.25 + 0.3).to_radians();
                let towards = DVec3::new(angle.sin(), 0.02, angle.cos()).normalize();
                let orientation = DQuat::from_rotation_arc(DVec3::Z, towards) * DQuat::from_rotation_x(0.4);
                let lowest = orientation * shape.support(orientation.conjugate() * -towards);
                let place = DVec3::new(1.0, 0.52, 1.0) - lowest - 0.01 * towards;
                let by = normal_at(place, orientation, towards).normal_by;
                let h = 1e-6;
                for axis in DVec3::AXES {
                    let moved = [h, -h].map(|h| normal_at(place + h * axis, orientation, towards).normal);
                    let turned = |h: f64| DQuat::from_scaled_axis(h * axis) * orientation;
                    let turned = [h, -h].map(|h| normal_at(place, turned(h), towards).normal);
                    for ([ahead, behind], by) in [(moved, by[0]), (turned, by[1])] {
                        let error = ((ahead - behind) / (2.0 * h) - by * axis).length();
                        assert!(error < 1e-3 * (1.0 / shape.thickness()), "{error:e} {shape:?} {angle} {axis}");
                    }
                }
            }
        }
    }
}
