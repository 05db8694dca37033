//! Parts of a body that are too thin for the half-space of the local contact law.

use glam::DVec3;

use super::closest::SurfaceQuery;
use super::shape::ToolShape;
use crate::mesh::Surface;

/// From this thickness on, over the tool's radius, a layer on a table is as accurate as a block: docs/accuracy.md.
const THICK: f64 = 1.5;
/// Depths below the contact at which the nearest surface is looked for, over the thickness: the first, the last, how many.
const FIRST: f64 = 0.1;
const LAST: f64 = 0.95;
const DEPTHS: u32 = 8;
/// Least cosine between the way down and the direction to a surface that ends the part below.
const BELOW: f64 = 0.7;

/// Thickness from which on a part is no longer thin for a tool, m; zero for the surface of a file, which has no radius.
pub fn thickness_for(shape: &ToolShape) -> f64 {
    if matches!(shape, ToolShape::Surface(_)) { 0.0 } else { THICK * shape.thickness() }
}

/// Whether a body ends within a thickness, m, below a point of its surface, along the inward normal.
pub fn is_thin_at(query: &SurfaceQuery, surface: &Surface, point: DVec3, normal: DVec3, thickness: f64) -> bool {
    (0..DEPTHS).any(|k| {
        let depth = thickness * (FIRST + (LAST - FIRST) * f64::from(k) / f64::from(DEPTHS - 1));
        let place = point - depth * normal;
        query.closest(surface, place).is_some_and(|found| {
            let way = found.position - place;
            -way.dot(normal) >= BELOW * way.length() && depth + way.length() < thickness
        })
    })
}
