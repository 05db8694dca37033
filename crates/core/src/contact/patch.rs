//! Consistent contact weights `w_i = int N_i phi dA / int phi dA` over a disc of the surface.
//!
//! The mask `phi = (1 - r^2/a^2)^2` falls smoothly to zero at the contact radius `a`, so weights are continuously
//! differentiable in the contact point. Only the part of the surface that is connected to the contact point inside the
//! ball of radius `a`, and does not face away from it, is covered: a thin sheet is never gripped through to its far side.
//! As `a -> 0` the weights become the shape functions `N_i` at the point. Weights sum to one; those of the corners of a
//! quadratic face may be negative. `N_i` and `dA` are those of the elements' faces, curved ones included.

use std::marker::PhantomData;
use std::sync::atomic::Ordering;

use glam::DVec3;

use super::closest::SurfacePoint;
use super::map_with;
use super::quadrature::PatchGeometry;
use crate::element::{Face, Tri3, Tri6};
use crate::green::GreensFunction;
use crate::mesh::{Faces, Surface};
use crate::{Error, Result};

/// Most nodes a patch of the servo may have: its 3x3 compliance costs the square of it, once a contact.
pub const MAX_PATCH_NODES: usize = 256;
/// Least cosine between the normals of a patch's middle and of a triangle in it. Zero would leave right angles to rounding.
const FACING: f64 = 1e-6;

/// Reason why no contact begins at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A node under the contact lies outside the touch region; its rank among the surface nodes.
    NotTouchable(u32),
    /// The contact covers more than [`MAX_PATCH_NODES`] nodes.
    TooManyNodes,
}

impl Refusal {
    /// Message of one line.
    pub fn message(self) -> &'static str {
        match self {
            Refusal::NotTouchable(_) => "the contact reaches outside the touch region",
            Refusal::TooManyNodes => "the contact covers too many nodes: choose a smaller contact radius",
        }
    }
}

/// The nodes under a contact and their weights.
#[derive(Clone, Debug)]
pub struct Patch {
    /// How many of the arrays' entries are in use.
    pub count: usize,
    nodes: [u32; MAX_PATCH_NODES],
    weights: [f64; MAX_PATCH_NODES],
}

impl Default for Patch {
    fn default() -> Self {
        Self { count: 0, nodes: [0; MAX_PATCH_NODES], weights: [0.0; MAX_PATCH_NODES] }
    }
}

impl Patch {
    /// The `(node, weight)` pairs.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.nodes().iter().zip(self.weights()).map(|(&n, &w)| (n as usize, w))
    }

    /// Ranks of the surface nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.count]
    }

    /// Weights; they sum to one.
    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.count]
    }

    /// Becomes a single node.
    pub fn set_node(&mut self, node: u32) {
        (self.count, self.nodes[0], self.weights[0]) = (1, node, 1.0);
    }

    /// Becomes a copy of another; only the entries in use are copied.
    pub fn copy_from(&mut self, other: &Patch) {
        self.count = other.count;
        self.nodes[..self.count].copy_from_slice(other.nodes());
        self.weights[..self.count].copy_from_slice(other.weights());
    }

    /// Multiplies all weights.
    pub(super) fn scale(&mut self, factor: f64) {
        self.weights[..self.count].iter_mut().for_each(|weight| *weight *= factor);
    }

    /// Empties the patch.
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    /// Sets the weights if these are its nodes in their order; otherwise it has to be set anew.
    pub(super) fn replace_weights(&mut self, mut nodes: impl Iterator<Item = (u32, f64)>) -> bool {
        let mut own = self.nodes[..self.count].iter().zip(&mut self.weights);
        let replace = |(&own, weight): (&u32, &mut f64)| match nodes.next() {
            Some((node, new)) if node == own => {
                *weight = new;
                true
            }
            _ => false,
        };
        own.all(replace) && nodes.next().is_none()
    }

    /// Adds a node, or to its weight where it is there already; false where there is no place.
    pub(super) fn add(&mut self, node: u32, weight: f64) -> bool {
        match self.nodes[..self.count].iter().position(|&known| known == node) {
            Some(place) => self.weights[place] += weight,
            None if self.count == MAX_PATCH_NODES => return false,
            None => self.push(node, weight),
        }
        true
    }

    pub(super) fn push(&mut self, node: u32, weight: f64) {
        (self.nodes[self.count], self.weights[self.count]) = (node, weight);
        self.count += 1;
    }
}

/// Reusable memory of [`patch_weights`], sized for one surface.
#[derive(Clone)]
pub struct PatchScratch {
    /// Last visit of each triangle.
    visited: Vec<u32>,
    visit: u32,
    queue: Vec<u32>,
    /// Sum for each node; zero between calls.
    sums: Vec<f64>,
    touched: Vec<u32>,
    /// Last visit that touched each node.
    touched_by: Vec<u32>,
}

impl PatchScratch {
    /// Memory for patches of `surface`.
    pub fn new(surface: &Surface) -> Self {
        let (triangles, nodes) = (surface.triangles.len(), surface.positions.len());
        Self {
            visited: vec![0; triangles],
            visit: 0,
            queue: Vec::with_capacity(triangles),
            sums: vec![0.0; nodes],
            touched: Vec::with_capacity(nodes),
            touched_by: vec![0; nodes],
        }
    }
}

/// Weights of a contact of radius `radius` (m) around `centre`, into `patch`.
///
/// # Errors
/// More than [`MAX_PATCH_NODES`] nodes; the walk over the surface stops there, and `patch` is empty.
pub fn patch_weights(
    surface: &Surface,
    geometry: &PatchGeometry,
    centre: &SurfacePoint,
    radius: f64,
    scratch: &mut PatchScratch,
    patch: &mut Patch,
) -> Result<(), Refusal> {
    match &surface.faces {
        Faces::Linear(faces) => weights_on::<Tri3, 3>(surface, faces, geometry, centre, radius, scratch, patch),
        Faces::Quadratic(faces) => weights_on::<Tri6, 6>(surface, faces, geometry, centre, radius, scratch, patch),
    }
}

fn weights_on<F: Face<N>, const N: usize>(
    surface: &Surface,
    faces: &[[u32; N]],
    geometry: &PatchGeometry,
    centre: &SurfacePoint,
    radius: f64,
    scratch: &mut PatchScratch,
    patch: &mut Patch,
) -> Result<(), Refusal> {
    patch.count = 0;
    let walk = Walk::<F, N>::new(surface, faces, geometry, centre, radius);
    let finished = walk.collect_sums(centre.triangle, MAX_PATCH_NODES, scratch);
    let total: f64 = scratch.touched.iter().map(|&n| scratch.sums[n as usize]).sum();
    for &node in &scratch.touched {
        let sum = std::mem::take(&mut scratch.sums[node as usize]);
        if finished {
            patch.push(node, sum / total);
        }
    }
    if !finished {
        return Err(Refusal::TooManyNodes);
    }
    if total <= 0.0 {
        patch.count = 0;
        walk.point_weights(centre, patch);
    }
    Ok(())
}

/// The same with any number of nodes, as pairs of node and weight; none where the patch is smaller than a point of quadrature's
/// share of the surface.
#[cfg(feature = "offline")]
pub fn wide_patch_weights(
    surface: &Surface,
    geometry: &PatchGeometry,
    centre: &SurfacePoint,
    radius: f64,
    scratch: &mut PatchScratch,
) -> Vec<(u32, f64)> {
    match &surface.faces {
        Faces::Linear(faces) => wide_weights_on::<Tri3, 3>(surface, faces, geometry, centre, radius, scratch),
        Faces::Quadratic(faces) => wide_weights_on::<Tri6, 6>(surface, faces, geometry, centre, radius, scratch),
    }
}

#[cfg(feature = "offline")]
fn wide_weights_on<F: Face<N>, const N: usize>(
    surface: &Surface,
    faces: &[[u32; N]],
    geometry: &PatchGeometry,
    centre: &SurfacePoint,
    radius: f64,
    scratch: &mut PatchScratch,
) -> Vec<(u32, f64)> {
    let walk = Walk::<F, N>::new(surface, faces, geometry, centre, radius);
    walk.collect_sums(centre.triangle, usize::MAX, scratch);
    let PatchScratch { touched, sums, .. } = scratch;
    let weights: Vec<(u32, f64)> =
        touched.iter().map(|&node| (node, std::mem::take(&mut sums[node as usize]))).collect();
    let total: f64 = weights.iter().map(|&(_, sum)| sum).sum();
    if total > 0.0 { weights.into_iter().map(|(node, sum)| (node, sum / total)).collect() } else { Vec::new() }
}

impl PatchGeometry {
    /// Rejects a contact radius under which some contact would have more nodes than a patch may have. Contacts lie where `green` is
    /// touchable. A radius below one that has passed before passes at once.
    ///
    /// # Errors
    /// The radius and the limit.
    pub fn check_radius(&self, green: &GreensFunction, radius: f64) -> Result<()> {
        if radius <= f64::from_bits(self.verified_radius.load(Ordering::Relaxed)) {
            return Ok(());
        }
        let surface = &green.surface;
        let memory = || (PatchScratch::new(surface), Patch::default());
        let fits = |(scratch, patch): &mut (PatchScratch, Patch), triangle: usize| {
            if !surface.triangles[triangle].iter().any(|&node| green.touchable(node as usize).is_some()) {
                return true;
            }
            let triangle = triangle as u32;
            let corners = surface.corners(triangle);
            let position: DVec3 = (corners[0] + corners[1] + corners[2]) / 3.0;
            let normal = surface.normals[triangle as usize];
            let centre = SurfacePoint { position, triangle, barycentric: [1.0 / 3.0; 3], normal, signed_distance: 0.0 };
            patch_weights(surface, self, &centre, radius, scratch, patch).is_ok()
        };
        if map_with(surface.triangles.len(), memory, fits).contains(&false) {
            return Err(Error::Invalid(format!(
                "a contact radius of {radius} m covers too many surface nodes, the limit is {MAX_PATCH_NODES}: \
                 choose a smaller radius or a coarser mesh"
            )));
        }
        // Positive numbers are ordered as their bits are.
        self.verified_radius.fetch_max(radius.to_bits(), Ordering::Relaxed);
        Ok(())
    }
}

/// The faces around a contact, whose shape functions are `F`'s.
struct Walk<'a, F, const N: usize> {
    surface: &'a Surface,
    faces: &'a [[u32; N]],
    geometry: &'a PatchGeometry,
    /// The contact point on its face: where the closest point on the drawn triangle is mapped to. On straight faces it is
    /// that point; on curved ones they differ by the sagitta of a drawn triangle.
    centre: DVec3,
    radius: f64,
    facing: DVec3,
    face: PhantomData<F>,
}

impl<'a, F: Face<N>, const N: usize> Walk<'a, F, N> {
    fn new(
        surface: &'a Surface,
        faces: &'a [[u32; N]],
        geometry: &'a PatchGeometry,
        centre: &SurfacePoint,
        radius: f64,
    ) -> Self {
        let facing = surface.normals[centre.triangle as usize];
        let face = &geometry.faces[centre.triangle as usize / F::PARTS.len()];
        let on_face = along(corners_of::<F, N>(centre.triangle), centre.barycentric);
        let place = face.at([on_face.y, on_face.z]);
        Self { surface, faces, geometry, centre: place, radius, facing, face: PhantomData }
    }

    /// The limit of a vanishing radius: the shape functions at the point.
    fn point_weights(&self, centre: &SurfacePoint, patch: &mut Patch) {
        let nodes = self.faces[centre.triangle as usize / F::PARTS.len()];
        let on_face = along(corners_of::<F, N>(centre.triangle), centre.barycentric);
        for (node, weight) in nodes.into_iter().zip(F::shapes(on_face)) {
            if weight.abs() > 1e-12 {
                patch.push(node, weight);
            }
        }
    }

    /// Walks the connected triangles inside the ball, from triangle `first`, and adds `int N_i phi dA` to each node's sum.
    /// False where there are more than `most` nodes.
    fn collect_sums(&self, first: u32, most: usize, scratch: &mut PatchScratch) -> bool {
        scratch.touched.clear();
        scratch.queue.clear();
        scratch.visit = scratch.visit.wrapping_add(1);
        scratch.visited[first as usize] = scratch.visit;
        scratch.queue.push(first);
        let mut next = 0;
        while next < scratch.queue.len() {
            let t = scratch.queue[next];
            next += 1;
            let face = &self.geometry.faces[t as usize / F::PARTS.len()];
            let (bulges, ends) = (&self.geometry.triangles[t as usize].bulges, self.surface.corners(t));
            let moments = self.geometry.integrate(t as usize, face, self.centre, self.radius);
            if moments.overlaps_mask {
                for (node, sum) in self.faces[t as usize / F::PARTS.len()].into_iter().zip(moments.of_shapes::<N>()) {
                    if scratch.touched_by[node as usize] != scratch.visit {
                        if scratch.touched.len() == most {
                            return false;
                        }
                        scratch.touched_by[node as usize] = scratch.visit;
                        scratch.touched.push(node);
                    }
                    scratch.sums[node as usize] += sum;
                }
            }
            for (k, &other) in self.surface.neighbours[t as usize].iter().enumerate() {
                if other != u32::MAX
                    && scratch.visited[other as usize] != scratch.visit
                    && self.surface.normals[other as usize].dot(self.facing) > FACING
                    && self.reaches([ends[k], ends[(k + 1) % 3]], bulges[k])
                {
                    scratch.visited[other as usize] = scratch.visit;
                    scratch.queue.push(other);
                }
            }
        }
        true
    }

    /// Whether an edge intersects the ball. A curved edge bulges from its chord by no more than its middle does.
    fn reaches(&self, ends: [DVec3; 2], bulge: f64) -> bool {
        let reach = self.radius + bulge;
        squared_distance_to_segment(self.centre, ends[0], ends[1]) < reach * reach
    }
}

/// Corners of triangle `t` in the barycentric coordinates of its face.
fn corners_of<F: Face<N>, const N: usize>(t: u32) -> [DVec3; 3] {
    F::PARTS[t as usize % F::PARTS.len()].map(|k| F::NODES[k])
}

/// Point of a triangle by its corners and its barycentric coordinates in it.
fn along(corners: [DVec3; 3], [a, b, c]: [f64; 3]) -> DVec3 {
    corners[0] * a + corners[1] * b + corners[2] * c
}

fn squared_distance_to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let edge = b - a;
    let along = ((p - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
    (a + along * edge - p).length_squared()
}
