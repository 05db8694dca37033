//! Places spread over a surface, at which a series is computed in blocks.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::body::{HyperelasticBody, PatchLoad};
use super::coefficients::{coefficients, rise};
use super::half_space::half_space_terms;
use super::internal::Elements;
use super::known::{BLOCK, Layout, SAME_SIDE, Side};
use crate::Result;
use crate::contact::local::StrainLaw;
use crate::contact::smooth::{Fan, SmoothSurface};
use crate::contact::{PatchGeometry, PatchScratch, SeriesFields, centre_of, wide_patch_weights};
use crate::green::{Problem, spatial_order};
use crate::mesh::{Surface, node_elements};

/// Radius of the patch over the tool's, and over the thickness of the body below it, on a flat surface and on a convex one. A patch that
/// is cut off by the sides of a column has no half-space below it: with three radii the force on a column of 2.5 radii was 14 % off,
/// with 7.5 it is within 2 %. Where the sides are farther away both agree. On a convex surface a wide patch carries a whole lobe, which
/// then hardly bends: beside a rim of the liver the force was 9 % too high at one radius.
const RADII: [f64; 2] = [7.5, 2.5];
const THICKNESSES: [f64; 2] = [1.5, 0.65];
/// Curvature times the tool's radius from which a surface counts as convex, and fully so, and radius over the tool's, and over the
/// elements, within which it is a mean.
const CONVEX: [f64; 2] = [0.02, 0.1];
const AROUND: [f64; 2] = [3.0, 1.5];
/// Least radius of the patch over the tool's. A patch that stays as wide as the contact has a limit load, which a sphere has not.
const LEAST_RADII: f64 = 0.9;
/// Distance of places over the tool's radius: the coefficients are as smooth as the patch is wide.
const SPACING: f64 = 0.7;

/// Where a series is computed.
struct Place {
    fan: usize,
    width: f64,
    load: PatchLoad,
}

/// Places chosen on a surface for a tool, along a Hilbert curve: the places of a block are close together.
pub struct SeriesPlan {
    problem: Arc<Problem>,
    laws: Arc<[StrainLaw]>,
    smooth: SmoothSurface,
    places: Vec<Place>,
    spacing: f64,
    elements: (Vec<usize>, Vec<(u32, u8)>),
}

impl SeriesPlan {
    /// Chooses the places for tools of `radius`, m.
    ///
    /// # Errors
    /// A surface that is not the mesh's.
    pub fn new(problem: Arc<Problem>, laws: Arc<[StrainLaw]>, radius: f64) -> Result<Self> {
        let surface = problem.surface()?;
        let smooth = SmoothSurface::new(&surface);
        let spacing = SPACING * radius;
        let touched = |fan: &Fan| problem.touch.binary_search(&fan.node).is_ok();
        let chosen = spread(smooth.fans(), spacing, touched);
        let positions: Vec<DVec3> = chosen.iter().map(|&fan| smooth.fans()[fan].position).collect();
        let ordered: Vec<usize> =
            spatial_order(&positions, &[]).into_iter().map(|rank| chosen[rank as usize]).collect();
        let geometry = PatchGeometry::new(&surface);
        let place = |scratch: &mut PatchScratch, fan: usize| {
            let at = &smooth.fans()[fan];
            let mut patch_of =
                |width: f64| wide_patch_weights(&surface, &geometry, &centre_of(&surface, at), width, scratch);
            let around = patch_of((AROUND[0] * radius).max(AROUND[1] * at.spacing));
            let convex = rise(radius * curvature(&surface, at, &around), CONVEX);
            let width = patch_width(radius, thickness(&surface, at), convex);
            let patch = patch_of(width);
            let weights: Vec<_> = patch.iter().map(|&(node, w)| (problem.surface_nodes[node as usize], w)).collect();
            let is_known = width >= LEAST_RADII * radius && !weights.is_empty();
            let middle = problem.surface_nodes[at.node as usize];
            is_known.then(|| Place { fan, width, load: PatchLoad { weights, direction: -at.normal, middle } })
        };
        let memory = || PatchScratch::new(&surface);
        let places: Vec<Option<Place>> = ordered.into_par_iter().map_init(memory, place).collect();
        let places = places.into_iter().flatten().collect();
        let elements = elements_of_nodes(&problem);
        Ok(Self { problem, laws, places, smooth, spacing, elements })
    }

    /// Where the places lie among the fans of the surface.
    pub fn layout(&self) -> Layout {
        let sides = self.smooth.fans().iter().map(|fan| Side { position: fan.position, normal: fan.normal });
        let places = self.places.iter().map(|place| place.fan as u32).collect();
        Layout { sides: sides.collect(), places, spacing: self.spacing }
    }

    /// Points of quadrature of the body, at each of which the series of a place is summed.
    pub fn points(&self) -> usize {
        let Problem { mesh, materials, .. } = &*self.problem;
        Elements { mesh, materials, laws: &self.laws }.points()
    }

    /// The factor that all blocks are solved with.
    ///
    /// # Errors
    /// A body that is not held.
    pub fn factorize(&self) -> Result<HyperelasticBody> {
        HyperelasticBody::new(self.problem.clone(), self.laws.clone())
    }

    /// Coefficients at the places of a block.
    pub fn solve(&self, body: &HyperelasticBody, block: usize) -> Vec<SeriesFields> {
        let places = &self.places[BLOCK * block..self.places.len().min(BLOCK * (block + 1))];
        let loads: Vec<PatchLoad> = places.iter().map(|place| place.load.clone()).collect();
        let found = body.series(&loads, &mut body.scratch(loads.len()));
        let fields = places.iter().zip(&found).map(|(place, at)| {
            let inward = -self.smooth.fans()[place.fan].normal;
            coefficients(at, inward, self.half_space(place))
        });
        fields.collect()
    }

    /// `1/(E* b)` of the material at a place, m/N, and a half-space's displacements of the second to fourth order, m/N^2 to m/N^4.
    fn half_space(&self, place: &Place) -> [f64; 4] {
        let node = self.problem.surface_nodes[self.smooth.fans()[place.fan].node as usize] as usize;
        let around = &self.elements.1[self.elements.0[node]..self.elements.0[node + 1]];
        let [mut first, mut second, mut third, mut fourth] = [0.0; 4];
        for &(element, _) in around {
            let (material, law) = (&self.problem.materials[element as usize], &self.laws[element as usize]);
            let [h2, h3, h4] = half_space_terms(law, material.poissons_ratio);
            first += (1.0 - material.poissons_ratio.powi(2)) / (material.youngs_modulus * around.len() as f64);
            second += h2 / (material.youngs_modulus.powi(2) * around.len() as f64);
            third += h3 / (material.youngs_modulus.powi(3) * around.len() as f64);
            fourth += h4 / (material.youngs_modulus.powi(4) * around.len() as f64);
        }
        [first / place.width, second / place.width.powi(3), third / place.width.powi(5), fourth / place.width.powi(7)]
    }
}

/// Fans among those `within` that are no closer to each other than `spacing`, m, on one side of the body.
fn spread(fans: &[Fan], spacing: f64, within: impl Fn(&Fan) -> bool) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::new();
    for (rank, fan) in fans.iter().enumerate().filter(|(_, fan)| within(fan)) {
        let is_near = |&other: &usize| {
            let other = &fans[other];
            other.position.distance(fan.position) < spacing && other.normal.dot(fan.normal) > SAME_SIDE
        };
        if !chosen.iter().any(is_near) {
            chosen.push(rank);
        }
    }
    chosen
}

/// Radius of the patch on a surface that is `convex` in part, m. Convexity alone leaves no place without a series.
fn patch_width(radius: f64, thickness: f64, convex: f64) -> f64 {
    let [radii, thicknesses] = [RADII, THICKNESSES].map(|[flat, round]| flat + (round - flat) * convex);
    let width = (radii * radius).min(thicknesses * thickness);
    width.max(LEAST_RADII * radius).min(THICKNESSES[0] * thickness)
}

/// Mean curvature of a surface over nodes around a fan and their weights, 1/m, positive where it is convex: that of the paraboloid as
/// far below the fan's plane.
fn curvature(surface: &Surface, fan: &Fan, around: &[(u32, f64)]) -> f64 {
    let (mut below, mut squares) = (0.0, 0.0);
    for &(node, weight) in around {
        let offset = surface.positions[node as usize] - fan.position;
        let height = offset.dot(fan.normal);
        below -= weight * height;
        squares += weight * (offset.length_squared() - height * height);
    }
    if squares > 0.0 { 2.0 * below / squares } else { 0.0 }
}

/// Distance through the body from a fan along its inward normal, m.
fn thickness(surface: &Surface, fan: &Fan) -> f64 {
    let inward = -fan.normal;
    let through = |t: usize| {
        let [a, b, c] = surface.corners(t as u32);
        let (u, v) = (b - a, c - a);
        let across = inward.cross(v);
        let determinant = u.dot(across);
        if surface.normals[t].dot(inward) <= 0.0 || determinant == 0.0 {
            return f64::INFINITY;
        }
        let from = fan.position - a;
        let x = from.dot(across) / determinant;
        let turned = from.cross(u);
        let y = inward.dot(turned) / determinant;
        let depth = v.dot(turned) / determinant;
        if x >= 0.0 && y >= 0.0 && x + y <= 1.0 && depth > 0.0 { depth } else { f64::INFINITY }
    };
    (0..surface.triangles.len()).map(through).fold(f64::INFINITY, f64::min)
}

fn elements_of_nodes(problem: &Problem) -> (Vec<usize>, Vec<(u32, u8)>) {
    match &problem.mesh.tets {
        crate::mesh::Tets::Linear(tets) => node_elements(problem.mesh.nodes.len(), tets),
        crate::mesh::Tets::Quadratic(tets) => node_elements(problem.mesh.nodes.len(), tets),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::smooth::tests::{ball, cube};

    /// Curvatures at all fans of a surface, over patches of a radius.
    fn curvatures(surface: &Surface, width: f64) -> Vec<f64> {
        let (smooth, geometry) = (SmoothSurface::new(surface), PatchGeometry::new(surface));
        let mut scratch = PatchScratch::new(surface);
        let at = |fan: &Fan| {
            let around = wide_patch_weights(surface, &geometry, &centre_of(surface, fan), width, &mut scratch);
            curvature(surface, fan, &around)
        };
        smooth.fans().iter().map(at).collect()
    }

    #[test]
    fn a_ball_is_convex_and_the_faces_of_a_cube_are_not() {
        // Of points at an angle from the fan, 2 (1 - cos)/sin^2 is the mean curvature.
        let round = curvatures(&ball(16), 0.5);
        assert!(round.iter().all(|&found| (found - 1.0).abs() < 0.1), "{round:?}");
        let flat = curvatures(&cube(), 0.7);
        assert!(flat.iter().all(|&found| found.abs() < 1e-9), "{flat:?}");
    }
}
