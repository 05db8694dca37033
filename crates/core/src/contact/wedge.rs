//! A sphere whose centre lies inside a body beside a sharp convex edge: one depth from those below both faces.
//!
//! Each face has its own closest point. If the nearer one counted, the force would turn at once where the centre passes the plane
//! between them, and the sphere would snap over an edge. With the depths `s_1`, `s_2` of the centre below the faces and
//! `sigma = s_1 + s_2`, `t = s_1 - s_2`, the depth in the wedge is a smooth minimum of both,
//!
//! ```text
//! s = sigma/2 - t^2/(4 w) - w/4      for |t| < w, else min(s_1, s_2)      w = W R sigma/(sigma + W R)
//! ```
//!
//! `s` and its gradient are continuous. Of all such functions this one turns the force the most evenly. The band `w` begins without width
//! at the edge, where the closest point goes round it, and is wider than the displacement of the surface deeper inside: there the
//! sphere is stable, and closed paths give back what was put in. A share `(1 + x (3 - x^2)/2)/2` of the compliance is that of the other
//! face, `x = t/w`.

use glam::{DMat3, DVec3};

use super::convex_edges::{ConvexEdges, Edge};
use super::modulus_share::Share;
use super::smooth::FootPoint;
use crate::tensor::outer;

/// `W`.
const BAND: f64 = 2.5;
/// Cosine between the normal of a foot and that of an edge's face from which the foot lies on this face.
const SAME_FACE: f64 = 0.5;
/// Difference of depths beyond the band, over the radius, from which the other face is not looked for: faces may be curved.
const MARGIN: f64 = 0.2;

/// The face beyond an edge, seen from a foot inside a body.
#[derive(Clone, Copy, Debug)]
pub struct OtherFace {
    /// Where the search for its closest point starts.
    pub start: FootPoint,
    /// Part of the edge there, which rises from zero at its ends.
    part: Share,
    radius: f64,
}

/// A position between two faces.
#[derive(Clone, Copy, Debug)]
pub struct BetweenFaces {
    /// The depth `s`, m.
    pub depth: Share,
    /// Share of the other face.
    pub share: f64,
    /// Its gradient, 1/m.
    pub share_gradient: DVec3,
    /// How far the depth is that of one face: 1 at the borders of the band and 0 in its middle.
    pub single: f64,
}

/// Which faces count.
#[derive(Clone, Copy, Debug)]
pub enum Faces {
    /// That of the foot.
    Own,
    /// The one beyond the edge.
    Other,
    /// The centre lies in the band between them.
    Both(BetweenFaces),
}

/// `w`, m, and its derivatives by `sigma`, for a part of an edge.
fn band(sigma: f64, part: f64, radius: f64) -> [f64; 3] {
    let whole = BAND * radius;
    let left = sigma + whole;
    let rate = part * whole * whole / (left * left);
    [part * whole * sigma / left, rate, -2.0 * rate / left]
}

impl ConvexEdges {
    /// The face beyond the nearest sharp edge for a centre inside the body, with its foot. `None` where it does not count.
    pub fn other_face(&self, foot: &FootPoint, centre: DVec3) -> Option<OtherFace> {
        if foot.on_crease || foot.distance >= 0.0 {
            return None;
        }
        let around = self.around_inside.at(foot.triangle).iter().map(|&edge| &self.edges[edge as usize]);
        let here = around.filter(|edge| edge.normals.iter().any(|normal| foot.normal.dot(*normal) > SAME_FACE));
        let nearest = here.map(|edge| (edge.distance_squared(foot.position), edge));
        let (_, edge) = nearest.min_by(|one, other| one.0.total_cmp(&other.0))?;
        let other = usize::from(foot.normal.dot(edge.normals[0]) > foot.normal.dot(edge.normals[1]));
        let normal = edge.normals[other];
        let distance = (centre - edge.ends[0]).dot(normal);
        let part = edge.part_inside(centre, self.radius);
        let [width, ..] = band(-foot.distance - distance, part.value, self.radius);
        if distance >= 0.0 || part.value == 0.0 || foot.distance - distance > width + MARGIN * self.radius {
            return None;
        }
        let position = centre - normal * distance;
        let start = FootPoint { triangle: edge.triangles[other], distance, ..FootPoint::at(position, normal) };
        Some(OtherFace { start, part, radius: self.radius })
    }
}

impl Edge {
    /// The box of what lies within a distance, m.
    pub(super) fn box_around(&self, reach: f64) -> [DVec3; 2] {
        let [first, second] = self.ends;
        [first.min(second) - reach, first.max(second) + reach]
    }

    /// Part of the edge for a centre inside the body: less within a radius of its ends.
    fn part_inside(&self, centre: DVec3, radius: f64) -> Share {
        let before_end = |k: usize, inward: DVec3| Share {
            value: (centre - self.ends[k]).dot(inward),
            gradient: inward,
            hessian: DMat3::ZERO,
        };
        let mut part = Share::WHOLE;
        for (k, inward) in [self.along, -self.along].into_iter().enumerate().filter(|&(k, _)| self.is_last[k]) {
            part = part.times(&before_end(k, inward).stepped([0.0, radius]));
        }
        part
    }
}

impl OtherFace {
    /// Which faces count, by the feet on both.
    pub fn faces(&self, own: &FootPoint, other: &FootPoint) -> Faces {
        let [sigma, t] = [1.0, -1.0].map(|sign| -own.distance - sign * other.distance);
        let [w, rise, bend] = band(sigma, self.part.value, self.radius);
        if other.distance >= 0.0 || t <= -w {
            return Faces::Own;
        }
        if t >= w {
            return Faces::Other;
        }
        let [along, across] = [1.0, -1.0].map(|sign| -own.normal - other.normal * sign);
        let [along_bend, across_bend] = [1.0, -1.0].map(|sign| own.turning * -1.0 - other.turning * sign);
        let x = t / w;
        // Derivatives of s by t, by w, and by sigma with that of w.
        let (by_t, by_w) = (-0.5 * x, 0.25 * (x * x - 1.0));
        let by_sigma = 0.5 + by_w * rise;
        let by_part = self.part.gradient * (w / self.part.value);
        let mixed = outer(across, along);
        let depth = Share {
            value: 0.5 * sigma - 0.25 * (t * x + w),
            gradient: along * by_sigma + across * by_t + by_part * by_w,
            hessian: along_bend * by_sigma
                + across_bend * by_t
                + outer(along, along) * (by_w * bend - 0.5 * x * x * rise * rise / w)
                + (mixed + mixed.transpose()) * (0.5 * x * rise / w)
                - outer(across, across) * (0.5 / w),
        };
        let turned = across * (1.0 / w) - (along * rise + by_part) * (x / w);
        Faces::Both(BetweenFaces {
            depth,
            share: 0.5 + 0.25 * x * (3.0 - x * x),
            share_gradient: turned * (0.75 * (1.0 - x * x)),
            single: x * x,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::SurfaceQuery;
    use crate::contact::smooth::tests::{cube, near};
    use crate::contact::smooth::{DrawnSurface, SmoothSurface};

    const RADIUS: f64 = 0.15;

    /// Depth below both faces at the edge x = z = 1 of a cube, and the share of the other one; seen from the face at x = 1 where
    /// `from_side`.
    fn check(each: impl Fn(&mut dyn FnMut(DVec3, bool) -> BetweenFaces)) {
        let surface = cube();
        let (smooth, query) = (SmoothSurface::new(&surface), SurfaceQuery::new(&surface).expect("triangles"));
        let edges = ConvexEdges::new((&surface, &query, &smooth), RADIUS).expect("edges");
        let (drawn, mut around) = (DrawnSurface { surface: &surface, query: &query }, near(&smooth));
        let mut depth = |centre: DVec3, from_side: bool| {
            let outside = if from_side { DVec3 { x: 1.01, ..centre } } else { DVec3 { z: 1.01, ..centre } };
            let above = smooth.foot_anywhere(drawn, outside, &mut around).expect("a foot");
            let foot = smooth.foot(drawn, centre, &above, &mut around).expect("a foot");
            let alone = |foot: &FootPoint, share: f64| BetweenFaces {
                depth: Share { value: -foot.distance, gradient: -foot.normal, hessian: -foot.turning },
                share,
                share_gradient: DVec3::ZERO,
                single: 1.0,
            };
            let Some(face) = edges.other_face(&foot, centre) else { return alone(&foot, 0.0) };
            let other = smooth.foot(drawn, centre, &face.start, &mut around).expect("a foot");
            match face.faces(&foot, &other) {
                Faces::Both(between) => between,
                Faces::Own => alone(&foot, 0.0),
                Faces::Other => alone(&other, 1.0),
            }
        };
        each(&mut depth);
    }

    #[test]
    fn derivatives_are_those_of_the_depth_and_of_the_share() {
        check(|depth| {
            let h = 1e-6;
            for [x, y, z] in [[0.99, 0.5, 0.98], [0.9, 0.5, 0.87], [0.8, 0.1, 0.85], [0.95, 0.93, 0.94]] {
                let centre = DVec3::new(x, y, z);
                let at = depth(centre, false);
                assert!(at.share > 0.0 && at.share < 1.0, "{centre}");
                for axis in DVec3::AXES {
                    let [ahead, behind] = [h, -h].map(|h| depth(centre + axis * h, false));
                    let slope = (ahead.depth.value - behind.depth.value) / (2.0 * h);
                    assert!((slope - at.depth.gradient.dot(axis)).abs() < 1e-7, "{centre}");
                    let turned = (ahead.share - behind.share) / (2.0 * h);
                    assert!((turned - at.share_gradient.dot(axis)).abs() < 1e-6, "{centre}");
                    let bent = (ahead.depth.gradient - behind.depth.gradient) / (2.0 * h);
                    // Near the end of an edge the second derivatives lack those of its part.
                    assert!(y > 0.9 || (bent - at.depth.hessian * axis).length() < 1e-5, "{centre}");
                }
            }
        });
    }

    #[test]
    fn the_depth_is_the_same_from_both_faces_and_continuous_across_the_wedge() {
        check(|depth| {
            let way = |k: f64| DVec3::new(0.75 + 0.2 * k, 0.5, 0.9 - 0.05 * k);
            let mut before: Option<BetweenFaces> = None;
            for step in 0..=400 {
                let centre = way(f64::from(step) / 400.0);
                let [at, same] = [false, true].map(|from_side| depth(centre, from_side));
                assert!((at.depth.value - same.depth.value).abs() < 1e-12, "{centre}");
                assert!((at.share + same.share - 1.0).abs() < 1e-9, "{centre}");
                assert!(at.depth.value <= (1.0 - centre.x).min(1.0 - centre.z) + 1e-12, "{centre}");
                if let Some(before) = before {
                    assert!(before.depth.gradient.distance(at.depth.gradient) < 0.02, "{centre}");
                }
                before = Some(at);
            }
        });
    }
}
