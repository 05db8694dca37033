//! Consistent contact weights `w_i = int N_i phi dA / int phi dA` over a disc of the surface.
//!
//! The mask `phi = (1 - r^2/a^2)^2` falls smoothly to zero at the contact radius `a`, so weights are continuously
//! differentiable in the contact point. Only the part of the surface that is connected to the contact point inside the
//! ball of radius `a`, and does not face away from it, is covered: a thin sheet is never gripped through to its far side.
//! As `a -> 0` the weights become the shape functions `N_i` at the point. Weights sum to one; those of the corners of a
//! quadratic face may be negative. `N_i` and `dA` are those of the elements' faces, curved ones included.

use std::marker::PhantomData;

use glam::DVec3;

use super::SurfacePoint;
use crate::element::{Face, Tri3, Tri6};
use crate::mesh::{Faces, Surface};

/// Most nodes a patch of the servo may have: its 3x3 compliance costs the square of it, once a contact.
pub const MAX_PATCH_NODES: usize = 256;

/// Quadrature cells are split until their edges are below this part of the contact radius.
const CELL_SIZE: f64 = 0.2;

/// Depth at which splitting stops: cells of 2^-24 of a triangle's edge are below any physical radius.
const MAX_DEPTH: u32 = 24;

/// The nodes under a contact and their shares.
#[derive(Clone, Debug)]
pub struct Patch {
    /// How many of the arrays' entries are in use.
    pub count: usize,
    /// Ranks of the surface nodes.
    pub nodes: [u32; MAX_PATCH_NODES],
    /// Weights; they sum to one.
    pub weights: [f64; MAX_PATCH_NODES],
}

impl Default for Patch {
    fn default() -> Self {
        Self { count: 0, nodes: [0; MAX_PATCH_NODES], weights: [0.0; MAX_PATCH_NODES] }
    }
}

impl Patch {
    /// The `(node, weight)` pairs.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.nodes[..self.count].iter().zip(&self.weights[..self.count]).map(|(&n, &w)| (n as usize, w))
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

/// Weights of a contact of radius `radius` (m) around `centre`, into `patch`. Returns the number of nodes covered; more
/// than [`MAX_PATCH_NODES`] leave `patch` empty.
pub fn patch_weights(
    surface: &Surface,
    centre: &SurfacePoint,
    radius: f64,
    scratch: &mut PatchScratch,
    patch: &mut Patch,
) -> usize {
    match &surface.faces {
        Faces::Linear(faces) => weights_on::<Tri3, 3>(surface, faces, centre, radius, scratch, patch),
        Faces::Quadratic(faces) => weights_on::<Tri6, 6>(surface, faces, centre, radius, scratch, patch),
    }
}

fn weights_on<F: Face<N>, const N: usize>(
    surface: &Surface,
    faces: &[[u32; N]],
    centre: &SurfacePoint,
    radius: f64,
    scratch: &mut PatchScratch,
    patch: &mut Patch,
) -> usize {
    patch.count = 0;
    let walk = Walk::<F, N>::new(surface, faces, centre, radius);
    walk.collect_sums(centre.triangle, scratch);
    let total: f64 = scratch.touched.iter().map(|&n| scratch.sums[n as usize]).sum();
    let covered = scratch.touched.len();
    for (k, &node) in scratch.touched.iter().enumerate() {
        if covered <= MAX_PATCH_NODES {
            patch.nodes[k] = node;
            patch.weights[k] = scratch.sums[node as usize] / total;
        }
        scratch.sums[node as usize] = 0.0;
    }
    if total <= 0.0 {
        return walk.point_weights(centre, patch);
    }
    patch.count = if covered <= MAX_PATCH_NODES { covered } else { 0 };
    covered
}

/// The faces around a contact, whose shape functions are `F`'s.
struct Walk<'a, F, const N: usize> {
    surface: &'a Surface,
    faces: &'a [[u32; N]],
    /// The contact point on its face: where the closest point on the drawn triangle is mapped to. On straight faces it is
    /// that point; on curved ones they differ by the sagitta of a drawn triangle.
    centre: DVec3,
    squared_radius: f64,
    facing: DVec3,
    face: PhantomData<F>,
}

impl<'a, F: Face<N>, const N: usize> Walk<'a, F, N> {
    fn new(surface: &'a Surface, faces: &'a [[u32; N]], centre: &SurfacePoint, radius: f64) -> Self {
        let facing = surface.normals[centre.triangle as usize];
        let mut walk =
            Self { surface, faces, centre: DVec3::ZERO, squared_radius: radius * radius, facing, face: PhantomData };
        let (places, corners) = walk.face_of(centre.triangle);
        walk.centre = place::<F, N>(&places, along(&corners, centre.barycentric));
        walk
    }

    /// Node positions of the face to which triangle `t` belongs, and the triangle's corners in its coordinates.
    fn face_of(&self, t: u32) -> ([DVec3; N], [DVec3; 3]) {
        let (face, part) = (t as usize / F::PARTS.len(), t as usize % F::PARTS.len());
        let places = self.faces[face].map(|n| self.surface.positions[n as usize]);
        (places, F::PARTS[part].map(|k| F::NODES[k]))
    }

    /// The limit of a vanishing radius: the shape functions at the point.
    fn point_weights(&self, centre: &SurfacePoint, patch: &mut Patch) -> usize {
        let (_, corners) = self.face_of(centre.triangle);
        let nodes = self.faces[centre.triangle as usize / F::PARTS.len()];
        for (node, weight) in nodes.into_iter().zip(F::shapes(along(&corners, centre.barycentric))) {
            if weight.abs() > 1e-12 {
                patch.nodes[patch.count] = node;
                patch.weights[patch.count] = weight;
                patch.count += 1;
            }
        }
        patch.count
    }

    /// Walks the connected triangles inside the ball, from triangle `first`, and adds `int N_i phi dA` to each node's sum.
    fn collect_sums(&self, first: u32, scratch: &mut PatchScratch) {
        scratch.touched.clear();
        scratch.queue.clear();
        scratch.visit = scratch.visit.wrapping_add(1);
        scratch.visited[first as usize] = scratch.visit;
        scratch.queue.push(first);
        let mut next = 0;
        while next < scratch.queue.len() {
            let t = scratch.queue[next];
            next += 1;
            let (places, corners) = self.face_of(t);
            let mut cell = Cell::<F, N> { walk: self, places, sums: [0.0; N], covered: false };
            let ends = corners.map(|l| place::<F, N>(&places, l));
            cell.integrate(corners, ends, 0);
            if cell.covered {
                for (node, sum) in self.faces[t as usize / F::PARTS.len()].into_iter().zip(cell.sums) {
                    if scratch.touched_by[node as usize] != scratch.visit {
                        scratch.touched_by[node as usize] = scratch.visit;
                        scratch.touched.push(node);
                    }
                    scratch.sums[node as usize] += sum;
                }
            }
            for (k, &other) in self.surface.neighbours[t as usize].iter().enumerate() {
                let (i, j) = (k, (k + 1) % 3);
                if other != u32::MAX
                    && scratch.visited[other as usize] != scratch.visit
                    && self.surface.normals[other as usize].dot(self.facing) > 0.0
                    && self.reaches(&places, [corners[i], corners[j]], [ends[i], ends[j]])
                {
                    scratch.visited[other as usize] = scratch.visit;
                    scratch.queue.push(other);
                }
            }
        }
    }

    /// Whether an edge comes into the ball. A curved edge bulges from its chord by no more than its middle does.
    fn reaches(&self, places: &[DVec3; N], corners: [DVec3; 2], ends: [DVec3; 2]) -> bool {
        let middle = place::<F, N>(places, (corners[0] + corners[1]) / 2.0);
        let bulge = (middle - (ends[0] + ends[1]) / 2.0).length();
        let reach = self.squared_radius.sqrt() + bulge;
        squared_distance_to_segment(self.centre, ends[0], ends[1]) < reach * reach
    }
}

/// Position of a face's point with barycentric coordinates `l`.
fn place<F: Face<N>, const N: usize>(places: &[DVec3; N], l: DVec3) -> DVec3 {
    places.iter().zip(F::shapes(l)).map(|(&x, n)| x * n).sum()
}

/// Point of a triangle by its corners and its barycentric coordinates in it.
fn along(corners: &[DVec3; 3], [a, b, c]: [f64; 3]) -> DVec3 {
    corners[0] * a + corners[1] * b + corners[2] * c
}

/// Quadrature of one triangle of a face against the mask.
struct Cell<'a, F, const N: usize> {
    walk: &'a Walk<'a, F, N>,
    places: [DVec3; N],
    sums: [f64; N],
    /// Whether any of it lies under the mask.
    covered: bool,
}

impl<F: Face<N>, const N: usize> Cell<'_, F, N> {
    /// Splits the cell (`corners` in the face's coordinates, `ends` in space) until it is small against the radius, then
    /// applies the mid-edge rule, exact for quadratics.
    fn integrate(&mut self, corners: [DVec3; 3], ends: [DVec3; 3], depth: u32) {
        let ([a, b, c], [la, lb, lc]) = (ends, corners);
        let squared_edges = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
        let longest = squared_edges[0].max(squared_edges[1]).max(squared_edges[2]);
        let chord_mids = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        let mid_corners = [(la + lb) / 2.0, (lb + lc) / 2.0, (lc + la) / 2.0];
        let mids = mid_corners.map(|l| place::<F, N>(&self.places, l));
        // A face is at most quadratic: it leaves the plane of the cell's corners by `4 sum l_i l_j d_ij`, with the
        // deviations `d` at the middles of the edges; the sum of the products is at most a third.
        let deviation = (0..3).map(|k| (mids[k] - chord_mids[k]).length_squared()).fold(0.0, f64::max).sqrt();
        // No point of the flat cell is farther from its centroid than two thirds of its longest edge.
        let squared_radius = self.walk.squared_radius;
        let reach = squared_radius.sqrt() + 2.0 / 3.0 * longest.sqrt() + 4.0 / 3.0 * deviation;
        if ((a + b + c) / 3.0 - self.walk.centre).length_squared() > reach * reach {
            return;
        }
        if longest > CELL_SIZE * CELL_SIZE * squared_radius && depth < MAX_DEPTH {
            self.integrate([la, mid_corners[0], mid_corners[2]], [a, mids[0], mids[2]], depth + 1);
            self.integrate([mid_corners[0], lb, mid_corners[1]], [mids[0], b, mids[1]], depth + 1);
            self.integrate([mid_corners[2], mid_corners[1], lc], [mids[2], mids[1], c], depth + 1);
            self.integrate(mid_corners, mids, depth + 1);
            return;
        }
        // The cell's part of the face's coordinates, of which the whole has the area 1/2.
        let part = 0.5 * ((lb.y - la.y) * (lc.z - la.z) - (lc.y - la.y) * (lb.z - la.z));
        for (l, point) in mid_corners.into_iter().zip(mids) {
            let inside = 1.0 - (point - self.walk.centre).length_squared() / squared_radius;
            if inside > 0.0 {
                self.covered = true;
                let weight = part / 3.0 * self.stretch(l) * inside * inside;
                for (sum, shape) in self.sums.iter_mut().zip(F::shapes(l)) {
                    *sum += weight * shape;
                }
            }
        }
    }

    /// Area in space over area in the face's coordinates.
    fn stretch(&self, l: DVec3) -> f64 {
        let mut tangents = [DVec3::ZERO; 2];
        for (&x, [s, t]) in self.places.iter().zip(F::derivatives(l)) {
            tangents[0] += x * s;
            tangents[1] += x * t;
        }
        tangents[0].cross(tangents[1]).length()
    }
}

fn squared_distance_to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let edge = b - a;
    let along = ((p - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
    (a + along * edge - p).length_squared()
}
