//! Direction of a crest below a contact.
//!
//! A contact on a sharp crest is long and narrow, and cells that lie obliquely over it do not resolve it. So the cells follow the
//! crest. Beside the extents of the tool, `E`, those of the surface count, `S`, by the spread of the pieces' normals, which is zero
//! along a straight crest:
//!
//! ```text
//! S = -W c T        T = sum w_i n_i n_i^T / sum w_i        c = step(1 - N^2) a
//! ```
//!
//! with the mean `N` of the normals, and the share `a` to which the contact lies on something convex (`edge_normal`).

use glam::{DMat3, DVec3};

use super::{FootprintScratch, Sums, Weight};
use crate::tensor::outer;

/// `W`: extents of a crest over that of a long tool. On an edge of 60 degrees `T` is 0.75 across it, on one of 120 degrees 0.25.
const WEIGHT: f64 = 4.0;
/// Spread of the normals, `1 - N^2`, from which the surface counts, and fully: 0.07 on an edge of 150 degrees, 0.25 on one of 120.
pub(super) const SPREAD: [f64; 2] = [0.05, 0.2];

/// Extents of a surface on a crest.
#[derive(Clone, Copy, Debug)]
pub struct Crest {
    /// `S`, in the axes of the world.
    pub extents: DMat3,
    /// `c`, `T`, `sum w_i` and the derivatives of the latter.
    share: Weight,
    spread: DMat3,
    weight: f64,
    weight_by: [DVec3; 2],
}

impl FootprintScratch {
    /// The crest below a contact with these sums and the share `c`; `None` without one.
    pub(super) fn find_crest(&self, sums: &Sums, share: Weight) -> Option<Crest> {
        if share.0 <= 0.0 {
            return None;
        }
        let weighed = self.near.pieces.iter().filter_map(|near| Some((near.normal, near.weigh(self.near.margin)?.0)));
        let spread: DMat3 = weighed.map(|(normal, weight)| outer(normal, normal) * weight).sum();
        let spread = spread * (1.0 / sums.weight);
        let extents = spread * (-WEIGHT * share.0);
        Some(Crest { extents, share, spread, weight: sums.weight, weight_by: sums.weight_by })
    }

    /// Derivatives by the tool's position and rotation of a function with the derivative `G` by the extents: with `S = -W c Q/w`,
    /// `G . dS = -W (dc G . T + c (G . dQ - dw G . T)/w)`.
    pub fn crest_by(&self, crest: &Crest, by_extents: &DMat3) -> [DVec3; 2] {
        let whole: f64 = (0..3).map(|k| by_extents.col(k).dot(crest.spread.col(k))).sum();
        let mut by = crest.weight_by.map(|weight_by| weight_by * -whole);
        for near in &self.near.pieces {
            let Some((_, weight_by)) = near.weigh(self.near.margin) else { continue };
            let part = near.normal.dot(*by_extents * near.normal);
            (0..2).for_each(|k| by[k] += weight_by[k] * part);
        }
        let (share, share_by) = crest.share;
        [0, 1].map(|k| (by[k] * (share / crest.weight) + share_by[k] * whole) * -WEIGHT)
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::contact::SurfaceQuery;
    use crate::contact::footprint::{PlacedShape, Plane, PressedSurface};
    use crate::contact::regular::FanFields;
    use crate::contact::shape::ToolShape;
    use crate::contact::smooth::tests::{ball, cube, near};
    use crate::contact::smooth::{FanWeights, SmoothSurface};
    use crate::mesh::Surface;

    /// The crest below a capsule whose lowest point against a direction is a point, and the derivatives of a part of its extents.
    fn crest_below(
        surface: &Surface,
        (point, towards): (DVec3, DVec3),
        [moved, turned]: [DVec3; 2],
        by_extents: &DMat3,
    ) -> Option<(Crest, [DVec3; 2])> {
        let (query, smooth) = (SurfaceQuery::new(surface).expect("triangles"), SmoothSurface::new(surface));
        let fields = vec![FanFields::default(); smooth.fans().len()];
        let shape = ToolShape::capsule(0.1, 0.1).expect("a shape");
        let pressed = PressedSurface::new(surface, &query, &smooth, &fields, shape.thickness());
        let orientation =
            DQuat::from_rotation_arc(DVec3::Z, towards) * DQuat::from_euler(glam::EulerRot::XYZ, 1.4, 0.2, 0.5);
        let lowest = orientation * shape.support(orientation.conjugate() * -towards);
        let place = point - lowest - 0.01 * towards;
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(turned) * orientation);
        let at = PlacedShape {
            shape: &shape,
            position: place + moved,
            rotation,
            contact_normal: towards,
            penetration: 0.01,
        };
        let mut scratch = FootprintScratch::default();
        scratch.near.find(&pressed, &query, &at);
        let known = Plane { point, normal: towards };
        let found = scratch.find(&at, (&pressed.fine, &smooth), known, &mut FanWeights::new(near(&smooth)));
        found.expect("a footprint").crest.map(|crest| (crest, scratch.crest_by(&crest, by_extents)))
    }

    const STILL: [DVec3; 2] = [DVec3::ZERO; 2];

    #[test]
    fn a_crest_has_no_extent_along_its_edge_and_flat_and_smooth_surfaces_have_none() {
        let (on_edge, axes) = (DVec3::new(1.0, 0.52, 1.0), &DMat3::IDENTITY);
        let (crest, _) =
            crest_below(&cube(), (on_edge, DVec3::new(1.0, 0.0, 1.0).normalize()), STILL, axes).expect("a crest");
        assert!((crest.extents * DVec3::Y).length() < 1e-12);
        // The pieces' normals are along x and z.
        assert!(((crest.extents.x_axis.x + crest.extents.z_axis.z) / -WEIGHT - 1.0).abs() < 1e-12, "{}", crest.extents);
        assert!(crest.extents.x_axis.x < -0.25 * WEIGHT && crest.extents.z_axis.z < -0.25 * WEIGHT);
        assert!(crest_below(&cube(), (DVec3::new(0.5, 0.52, 1.0), DVec3::Z), STILL, axes).is_none());
        assert!(crest_below(&ball(24), (DVec3::Z, DVec3::Z), STILL, axes).is_none());
    }

    #[test]
    fn a_part_of_the_extents_has_its_derivatives() {
        let cube = cube();
        let axes = [DVec3::new(0.8, 0.0, 0.6), DVec3::new(-0.3, 0.5, 0.4)];
        let by_extents = &(outer(axes[0], axes[1]) + outer(axes[1], axes[0]));
        let h = 1e-6;
        for angle in [0.25f64, 0.5, 0.785, 1.2] {
            let at = (DVec3::new(1.0, 0.52, 1.0), DVec3::new(angle.sin(), 0.02, angle.cos()).normalize());
            let (_, by) = crest_below(&cube, at, STILL, by_extents).expect("a crest");
            for axis in DVec3::AXES {
                for k in 0..2 {
                    let part = |h: f64| {
                        let pose = if k == 0 { [h * axis, DVec3::ZERO] } else { [DVec3::ZERO, h * axis] };
                        2.0 * axes[0]
                            .dot(crest_below(&cube, at, pose, by_extents).expect("a crest").0.extents * axes[1])
                    };
                    let difference = (part(h) - part(-h)) / (2.0 * h);
                    assert!(
                        (difference - by[k].dot(axis)).abs() < 1e-3,
                        "{angle} {k} {difference} {}",
                        by[k].dot(axis)
                    );
                }
            }
        }
    }
}
