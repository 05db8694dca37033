//! The normal of a contact over an edge: that of the tool.
//!
//! The mean of the pieces' own normals `n_i` turns over from one side of a blade to the other while the tool moves by a fraction of its
//! radius. The gradient `t_i` of the tool's distance, from a piece towards the tool, does not. So a share `c` of the contact's
//! normal is the tool's,
//!
//! ```text
//! n ~ sum w_i (n_i + c (t_i - n_i))        c = step((mean(n_i . x_i) - N . X)/h) (1 - step(v/(v + sum w_i)))
//! ```
//!
//! with the means `N` of the normals and `X` of the places, the tool's half width `h`, and the weight `v` of walls beside the contact.
//! The first factor is zero in creases, where the tool's normals point from one wall to the other. The second is zero beside
//! a wall: the contact's pieces end there as at an edge, and the body does not. On a plane both normals are the same, for
//! `sum w_i t_i` along it is the integral of the gradient of a function that ends at zero.

use glam::{DMat3, DVec3};

use super::{FootprintScratch, NearPiece, PlacedShape, Sums, smooth_step};
use crate::tensor::outer;

/// Distances of a piece, over the tool's thickness, from which the tool's normal begins to count there, and counts alone: deep inside
/// of a tool, beyond its middle surfaces, its normal jumps.
const OWN_NORMAL: [f64; 2] = [-0.75, -0.25];
/// Measure of a bulge, `mean(n_i . x_i) - N . X` over the tool's thickness, below which the pieces lie in a crease, and not at all.
const BULGING: [f64; 2] = [-0.02, 0.0];
/// Share of walls in what is near the tool from which the contact lies in a hollow, and fully so.
const WALLS: [f64; 2] = [0.0, 0.1];
/// Length of the mean difference of the tool's normals and the pieces' own, up to which the contact has its own normal, and from which
/// it has the tool's.
fn apart() -> [f64; 2] {
    static S: std::sync::OnceLock<[f64; 2]> = std::sync::OnceLock::new();
    *S.get_or_init(|| {
        let s = std::env::var("APART").unwrap_or("0.1,0.3".into());
        let v: Vec<f64> = s.split(',').map(|x| x.parse().unwrap()).collect();
        [v[0], v[1]]
    })
}

/// Part of the least difference below which the derivatives of the tool's normals need not be found.
const NEARLY: f64 = 0.9;

/// A share, and its derivatives by the tool's position and rotation.
type Share = (f64, [DVec3; 2]);

impl FootprintScratch {
    /// Mixes the tool's own normals into the sum of normals.
    pub(super) fn turn_to_tool(&mut self, tool: &PlacedShape<'_>, sums: &mut Sums) {
        if self.rough_difference(tool.shape.thickness()) < NEARLY * apart()[0] * sums.weight {
            return;
        }
        let (bulging, bulging_by) = sums.share_of_bulge(tool.shape.thickness());
        if bulging == 0.0 {
            return;
        }
        self.near.find_tool_normals(tool);
        let (mut difference, mut difference_by) = (DVec3::ZERO, [DMat3::ZERO; 2]);
        for near in &self.near.pieces {
            let Some((weight, by)) = near.weigh(self.near.margin) else { continue };
            let (turned, turned_by) = near.turned(tool.shape.thickness());
            difference += turned * weight;
            for k in 0..2 {
                difference_by[k] += outer(turned, by[k]) + turned_by[k] * weight;
            }
        }
        let (size, inverse) = (difference.length(), 1.0 / sums.weight);
        let (apart, apart_slope) = smooth_step(size * inverse, apart());
        if apart == 0.0 {
            return;
        }
        for k in 0..2 {
            let size_by = difference_by[k].transpose() * difference * (1.0 / size);
            let apart_by = (size_by - sums.weight_by[k] * (size * inverse)) * (apart_slope * inverse);
            let share_by = apart_by * bulging + bulging_by[k] * apart;
            sums.normal_by[k] += difference_by[k] * (apart * bulging) + outer(difference, share_by);
        }
        sums.normal += difference * (apart * bulging);
    }

    /// Length of the sum of weighted differences, as of the latest search.
    fn rough_difference(&self, thickness: f64) -> f64 {
        let weighed = |near: &NearPiece| {
            let (weight, _) = near.weigh(self.near.margin)?;
            let (share, _) = smooth_step(near.distance / thickness, OWN_NORMAL);
            Some((near.tool_normal - near.normal) * (share * weight))
        };
        self.near.pieces.iter().filter_map(weighed).sum::<DVec3>().length()
    }
}

impl NearPiece {
    /// Difference of the tool's normal and the piece's own, and its derivatives; zero deep in the tool.
    fn turned(&self, thickness: f64) -> (DVec3, [DMat3; 2]) {
        let (share, rise) = smooth_step(self.distance / thickness, OWN_NORMAL);
        let difference = self.tool_normal - self.normal;
        let rise = rise / thickness;
        let by = [0, 1].map(|k| self.tool_normal_by[k] * share + outer(difference, self.by_pose[k]) * rise);
        (difference * share, by)
    }
}

impl Sums {
    /// Share of the tool's normals, and its derivatives: with mean normal `n` and place `x`, the bulge `mean(n_i . x_i) - n . x` is
    /// positive over an edge, and negative in a crease.
    fn share_of_bulge(&self, thickness: f64) -> Share {
        let inverse = 1.0 / self.weight;
        let (normal, place, offset) = (self.normal * inverse, self.place * inverse, self.offset * inverse);
        let (bulging, bulge_slope) = smooth_step((offset - normal.dot(place)) / thickness, BULGING);
        let by = [0, 1].map(|k| {
            let weight_by = self.weight_by[k];
            let normal_by = (self.normal_by[k] - outer(normal, weight_by)) * inverse;
            let place_by = (self.place_by[k] - outer(place, weight_by)) * inverse;
            let offset_by = (self.offset_by[k] - weight_by * offset) * inverse;
            let bulge_by = offset_by - normal_by.transpose() * place - place_by.transpose() * normal;
            bulge_by * (bulge_slope / thickness)
        });
        // Beside a wall the contact's pieces end as at an edge.
        let all = self.weight + self.walls;
        let (hollow, slope) = smooth_step(self.walls / all, WALLS);
        let by = [0, 1].map(|k| {
            let walls_by = (self.walls_by[k] * self.weight - self.weight_by[k] * self.walls) / (all * all);
            by[k] * (1.0 - hollow) - walls_by * (slope * bulging)
        });
        (bulging * (1.0 - hollow), by)
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::contact::SurfaceQuery;
    use crate::contact::footprint::{Plane, PressedSurface};
    use crate::contact::regular::FanFields;
    use crate::contact::shape::ToolShape;
    use crate::contact::smooth::tests::{cube, near};
    use crate::contact::smooth::{FanWeights, SmoothSurface};

    /// From one side of a cube's edge to the other the normal's derivatives are its differences over small motions and rotations.
    #[test]
    fn over_an_edge_the_normal_turns_as_its_derivatives_say() {
        let surface = cube();
        let (query, smooth) = (SurfaceQuery::new(&surface).expect("triangles"), SmoothSurface::new(&surface));
        let fields = vec![FanFields::default(); smooth.fans().len()];
        let shapes = [
            ToolShape::ellipsoid(DVec3::new(0.2, 0.15, 0.1)).expect("a shape"),
            ToolShape::punch(0.1, 0.03).expect("a shape"),
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
