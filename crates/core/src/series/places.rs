//! Series at places spread over a surface, and their coefficients at all of its fans.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::body::{HyperelasticBody, PatchLoad, SeriesAt};
use super::half_space::half_space_terms;
use crate::contact::local::StrainLaw;
use crate::contact::smooth::{Fan, SmoothSurface};
use crate::contact::{PatchGeometry, PatchScratch, SeriesFields, centre_of, wide_patch_weights};
use crate::green::{Problem, Progress};
use crate::math::cbrt;
use crate::mesh::{Surface, node_elements};
use crate::{Error, Result};

/// Radius of the patch over the tool's, and over the thickness of the body below it. A patch that is cut off by the sides of a column
/// has no half-space below it: with three radii the force on a column of 2.5 radii was 14 % off, with 7.5 it is within 2 %. Where the
/// sides are farther away both agree.
const RADII: f64 = 7.5;
const THICKNESSES: f64 = 1.5;
/// Least radius of the patch over the tool's. A patch that stays as wide as the contact has a limit load, which a sphere has not.
const LEAST_RADII: f64 = 0.9;
/// Distance of places over the tool's radius: the coefficients are as smooth as the patch is wide.
const SPACING: f64 = 0.9;
/// Distance up to which a place counts at a fan, over that of places.
const REACH: f64 = 2.0;
/// Cosine between normals of fans on one side of a body.
const SAME_SIDE: f64 = 0.5;
/// Places that are solved together.
const BLOCK: usize = 8;
/// Least part of the compliance at rest that is left where the series ends.
const LEAST_COMPLIANCE: f64 = 0.2;
/// `|U_5| / U_2` at which the series of a body that softens ends, and that of a body that hardens: its further orders alternate.
const LARGEST_REST: [f64; 2] = [0.01, 0.05];

/// Where a series is computed.
struct Place {
    fan: usize,
    width: f64,
    load: PatchLoad,
}

/// Places chosen on a surface for a tool.
pub struct SeriesPlan<'a> {
    problem: &'a Problem,
    laws: &'a [StrainLaw],
    smooth: SmoothSurface,
    places: Vec<Place>,
    spacing: f64,
}

impl<'a> SeriesPlan<'a> {
    /// Chooses the places for tools of `radius`, m.
    ///
    /// # Errors
    /// A surface that is not the mesh's.
    pub fn new(problem: &'a Problem, laws: &'a [StrainLaw], radius: f64) -> Result<Self> {
        let surface = problem.surface()?;
        let smooth = SmoothSurface::new(&surface);
        let spacing = SPACING * radius;
        let touched = |fan: &Fan| problem.touch.binary_search(&fan.node).is_ok();
        let chosen = spread(smooth.fans(), spacing, touched);
        let geometry = PatchGeometry::new(&surface);
        let place = |scratch: &mut PatchScratch, fan: usize| {
            let at = &smooth.fans()[fan];
            let width = (RADII * radius).min(THICKNESSES * thickness(&surface, at));
            let patch = wide_patch_weights(&surface, &geometry, &centre_of(&surface, at), width, scratch);
            let weights: Vec<_> = patch.iter().map(|&(node, w)| (problem.surface_nodes[node as usize], w)).collect();
            let is_known = width >= LEAST_RADII * radius && !weights.is_empty();
            is_known.then(|| Place { fan, width, load: PatchLoad { weights, direction: -at.normal } })
        };
        let memory = || PatchScratch::new(&surface);
        let places: Vec<Option<Place>> = chosen.into_par_iter().map_init(memory, place).collect();
        Ok(Self { problem, laws, places: places.into_iter().flatten().collect(), smooth, spacing })
    }

    /// How many places there are.
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// Coefficients at the chosen places.
    fn solve(&self, progress: Progress<'_>) -> Result<Vec<SeriesFields>> {
        let body = HyperelasticBody::new(self.problem, self.laws)?;
        let (done, all) = (AtomicUsize::new(0), self.places.len());
        let blocks: Vec<&[Place]> = self.places.chunks(BLOCK).collect();
        let elements = node_elements_of(self.problem);
        let solve = |places: &&[Place]| {
            let loads: Vec<PatchLoad> = places.iter().map(|place| place.load.clone()).collect();
            let found = body.series(&loads, &mut body.scratch(loads.len()));
            let before = done.fetch_add(places.len(), Ordering::Relaxed);
            if !progress(before + places.len(), all) {
                return Err(Error::Interrupted);
            }
            let fields = places.iter().zip(&found).map(|(place, at)| self.fields_of(place, at, &elements));
            Ok(fields.collect::<Vec<_>>())
        };
        let found: Result<Vec<Vec<SeriesFields>>> = blocks.par_iter().map(solve).collect();
        Ok(found?.into_iter().flatten().collect())
    }

    /// Coefficients from a series: less the half-space's, as `U_3 = F^2 b_3 . f` and `U_4 = F^3 b_4 . f`.
    fn fields_of(&self, place: &Place, at: &SeriesAt, elements: &(Vec<usize>, Vec<(u32, u8)>)) -> SeriesFields {
        let fan = &self.smooth.fans()[place.fan];
        let inward = -fan.normal;
        let node = self.problem.surface_nodes[fan.node as usize] as usize;
        let around = &elements.1[elements.0[node]..elements.0[node + 1]];
        let [mut second, mut third] = [0.0; 2];
        for &(element, _) in around {
            let (material, law) = (&self.problem.materials[element as usize], &self.laws[element as usize]);
            let [h2, h3] = half_space_terms(law, material.poissons_ratio);
            second += h2 / (material.youngs_modulus.powi(2) * around.len() as f64);
            third += h3 / (material.youngs_modulus.powi(3) * around.len() as f64);
        }
        let [first, q2, q3] = at.displacements;
        let q2 = q2 - inward * (second / place.width.powi(3));
        let q3 = q3 - inward * (third / place.width.powi(5));
        let compliance = first.dot(inward);
        let [second, third] = [q2, q3].map(|field| field.dot(inward));
        let Hardening { share, bending, hardening } = Hardening::new(compliance, [second, third]);
        // In powers of y = F - alpha F^2 + .. in place of F.
        let q3 = q3 + inward * (2.0 * bending * second);
        // The gradients of both forms at f = F inward are F^2 (b_3 + 2 (b_3 . n) n) and F^3 (b_4 + 3 (b_4 . n) n).
        let cubic = q2 - inward * (2.0 / 3.0 * q2.dot(inward));
        let quartic = q3 - inward * (0.75 * q3.dot(inward));
        // The displacement of order four that c_1 y + (1 - share) c_2 y^2 lacks.
        let square = bending * bending;
        let fourth = 5.0 * bending * (hardening - square) * compliance;
        let fourth = fourth + (1.0 - share) * second * (5.0 * square - 2.0 * hardening);
        let fifth = at.fifth - 0.2 * fourth;
        let rest = LARGEST_REST[0] + share * (LARGEST_REST[1] - LARGEST_REST[0]);
        let ending = cbrt(fifth.abs() / (0.5 * rest * compliance));
        let ending = ending.max(softest(compliance, [2.0 * second, 3.0 * third], share));
        // So far of y.
        let ending = if ending > 0.0 { ending / (1.0 + (bending + hardening / ending) / ending) } else { 0.0 };
        let fields = [cubic.x, cubic.y, cubic.z, quartic.x, quartic.y, quartic.z, ending, hardening, bending];
        // A place on a support is not displaced.
        if fields.iter().all(|field| field.is_finite()) { fields } else { SeriesFields::default() }
    }
}

/// How a body hardens: `F = y + alpha y^2 + kappa y^3`, where `q = c_1 y + (1 - share) c_2 y^2`.
struct Hardening {
    share: f64,
    /// `alpha`, 1/N.
    bending: f64,
    /// `kappa`, 1/N^2.
    hardening: f64,
}

impl Hardening {
    /// Of the displacement `c_1 F + c_2 F^2 + c_3 F^3`. `alpha = -share c_2/c_1`, and the cubic terms cancel for
    /// `kappa = -(c_3 + 2 alpha c_2)/c_1`. Both are zero for a body that softens, `c_3 >= 0`. The share is 1 where `-c_3/c_1` is at least
    /// `(c_2/c_1)^2`: then the force as a function of the displacement is a cubic polynomial, `c_1 y = q`. As
    /// `kappa >= 2 share (c_2/c_1)^2`, the force always grows with `y`.
    fn new(compliance: f64, [second, third]: [f64; 2]) -> Self {
        let (relative, hardens) = (second / compliance, (-third / compliance).max(0.0));
        let square = relative * relative;
        let share = if hardens > 0.0 { (hardens / square).min(1.0) } else { 0.0 };
        Self { share, bending: -share * relative, hardening: hardens + 2.0 * share * square }
    }
}

/// One over the `y` from which the compliance along the force is less than a part of what it was; zero if there is none. The energy
/// is convex up to there. A body that softens has the compliance `c + s_2 y + s_3 y^2` and `y = F`, one that hardens
/// `c + (1 - share) s_2 y` times a positive factor.
fn softest(compliance: f64, [second, third]: [f64; 2], share: f64) -> f64 {
    // In x = 1/y: (1 - part) c x^2 + s_2 x + s_3 = 0, its largest root.
    let (second, third) = ((1.0 - share) * second, third.max(0.0));
    let whole = (1.0 - LEAST_COMPLIANCE) * compliance;
    let discriminant = second * second - 4.0 * whole * third;
    if discriminant < 0.0 { 0.0 } else { ((discriminant.sqrt() - second) / (2.0 * whole)).max(0.0) }
}

/// Coefficients at the fans of the smooth surface of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Nodes of the fans, m.
    pub positions: Vec<[f64; 3]>,
    /// Coefficients of each.
    pub fields: Vec<SeriesFields>,
}

/// Computes the series of all places, and its coefficients at every fan.
///
/// # Errors
/// A body that is not held, or an interruption by `progress`.
pub fn compute_series(plan: &SeriesPlan<'_>, progress: Progress<'_>) -> Result<Series> {
    let found = plan.solve(progress)?;
    let fans = plan.smooth.fans();
    let at = |fan: &Fan| {
        let near = plan.places.iter().zip(&found).map(|(place, fields)| (&fans[place.fan], fields));
        let near = near.filter(|(other, _)| other.normal.dot(fan.normal) > SAME_SIDE);
        interpolate(fan, near, REACH * plan.spacing)
    };
    let positions = fans.iter().map(|fan| fan.position.to_array()).collect();
    Ok(Series { positions, fields: fans.par_iter().map(at).collect() })
}

/// Mean of fields around a fan, weighted by distance; zero where there is none.
fn interpolate<'a>(fan: &Fan, near: impl Iterator<Item = (&'a Fan, &'a SeriesFields)>, reach: f64) -> SeriesFields {
    let (mut sum, mut weights) = (SeriesFields::default(), 0.0);
    for (other, fields) in near {
        let distance = fan.position.distance(other.position) / reach;
        if distance < 1.0 {
            let weight = (1.0 - distance * distance).powi(2) / (distance * distance + 1e-4);
            weights += weight;
            sum.iter_mut().zip(fields).for_each(|(sum, field)| *sum += weight * field);
        }
    }
    if weights > 0.0 { sum.map(|value| value / weights) } else { sum }
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

fn node_elements_of(problem: &Problem) -> (Vec<usize>, Vec<(u32, u8)>) {
    match &problem.mesh.tets {
        crate::mesh::Tets::Linear(tets) => node_elements(problem.mesh.nodes.len(), tets),
        crate::mesh::Tets::Quadratic(tets) => node_elements(problem.mesh.nodes.len(), tets),
    }
}

#[cfg(test)]
mod tests {
    use super::{Hardening, softest};

    #[test]
    fn the_series_ends_where_the_compliance_vanishes() {
        // 1 - 0.4 F reaches 0.2 at F = 2, and 1 - 0.2 F^2 too.
        assert!((softest(1.0, [-0.4, 0.0], 0.0) - 0.5).abs() < 1e-14);
        // One that hardens has none, unless the second order softens it.
        assert_eq!(softest(1.0, [0.0, -0.2], 0.0), 0.0);
        assert!((softest(1.0, [-0.4, -0.2], 0.0) - 0.5).abs() < 1e-14);
        assert_eq!(softest(1.0, [0.3, 0.1], 0.0), 0.0);
        // Nor one whose displacement is y itself.
        assert_eq!(softest(1.0, [-0.4, -0.2], 1.0), 0.0);
    }

    /// The displacement of a cubic spring `F = 2 q - 0.3 q^2 + 5 q^3` up to the third order gives the spring.
    #[test]
    fn a_cubic_spring_is_found_from_its_series() {
        let (first, second, third) = (2.0f64, -0.3f64, 5.0f64);
        let compliance = 1.0 / first;
        let q2 = -second * compliance.powi(3);
        let q3 = (2.0 * second * second - first * third) * compliance.powi(5);
        let found = Hardening::new(compliance, [q2, q3]);
        assert_eq!(found.share, 1.0);
        // y = q/c_1.
        assert!((found.bending / (second * compliance * compliance) - 1.0).abs() < 1e-14);
        assert!((found.hardening / (third * compliance.powi(3)) - 1.0).abs() < 1e-14);
        // One that softens stays a series.
        let soft = Hardening::new(compliance, [q2, -q3]);
        assert_eq!([soft.share, soft.bending, soft.hardening], [0.0; 3]);
    }
}
