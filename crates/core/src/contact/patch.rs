//! Consistent contact weights `w_i = int N_i phi dA / int phi dA` over a disc of the surface.
//!
//! The mask `phi = (1 - r^2/a^2)^2` falls smoothly to zero at the contact radius `a`, so weights are continuously
//! differentiable in the contact point. Only the part of the surface that is connected to the contact point inside the
//! ball of radius `a`, and does not face away from it, is covered: a thin sheet is never gripped through to its far side.
//! As `a -> 0` the weights become the shape functions `N_i` at the point. Weights sum to one.

use glam::DVec3;

use super::SurfacePoint;
use crate::mesh::Surface;

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
    patch.count = 0;
    collect_sums(surface, centre, radius, scratch);
    let total: f64 = scratch.touched.iter().map(|&n| scratch.sums[n as usize]).sum();
    if total <= 0.0 {
        return point_weights(surface, centre, patch);
    }
    let covered = scratch.touched.len();
    for (k, &node) in scratch.touched.iter().enumerate() {
        if covered <= MAX_PATCH_NODES {
            patch.nodes[k] = node;
            patch.weights[k] = scratch.sums[node as usize] / total;
        }
        scratch.sums[node as usize] = 0.0;
    }
    patch.count = if covered <= MAX_PATCH_NODES { covered } else { 0 };
    covered
}

/// The limit of a vanishing radius: the shape functions at the point.
fn point_weights(surface: &Surface, centre: &SurfacePoint, patch: &mut Patch) -> usize {
    for (node, weight) in surface.triangles[centre.triangle as usize].into_iter().zip(centre.barycentric) {
        if weight.abs() > 1e-12 {
            patch.nodes[patch.count] = node;
            patch.weights[patch.count] = weight;
            patch.count += 1;
        }
    }
    patch.count
}

/// Walks the connected triangles inside the ball and adds `int N_i phi dA` to each node's sum.
fn collect_sums(surface: &Surface, centre: &SurfacePoint, radius: f64, scratch: &mut PatchScratch) {
    scratch.touched.clear();
    scratch.queue.clear();
    scratch.visit = scratch.visit.wrapping_add(1);
    scratch.visited[centre.triangle as usize] = scratch.visit;
    scratch.queue.push(centre.triangle);
    let facing = surface.normals[centre.triangle as usize];
    let mut next = 0;
    while next < scratch.queue.len() {
        let t = scratch.queue[next];
        next += 1;
        let corners = surface.corners(t);
        let mut cell = Cell { centre: centre.position, squared_radius: radius * radius, sums: [0.0; 3] };
        let unit = [DVec3::X, DVec3::Y, DVec3::Z];
        cell.integrate(corners, unit, 0);
        for (node, sum) in surface.triangles[t as usize].into_iter().zip(cell.sums) {
            if sum > 0.0 {
                if scratch.sums[node as usize] == 0.0 {
                    scratch.touched.push(node);
                }
                scratch.sums[node as usize] += sum;
            }
        }
        for (k, &other) in surface.neighbours[t as usize].iter().enumerate() {
            let shared_edge_inside =
                squared_distance_to_segment(centre.position, corners[k], corners[(k + 1) % 3]) < radius * radius;
            if other != u32::MAX
                && shared_edge_inside
                && scratch.visited[other as usize] != scratch.visit
                && surface.normals[other as usize].dot(facing) > 0.0
            {
                scratch.visited[other as usize] = scratch.visit;
                scratch.queue.push(other);
            }
        }
    }
}

/// Quadrature of one triangle against the mask.
struct Cell {
    centre: DVec3,
    squared_radius: f64,
    sums: [f64; 3],
}

impl Cell {
    /// Splits the cell (`corners`, whose shape function values are `shapes`) until it is small against the radius, then
    /// applies the mid-edge rule, exact for quadratics.
    fn integrate(&mut self, corners: [DVec3; 3], shapes: [DVec3; 3], depth: u32) {
        let [a, b, c] = corners;
        let squared_edges = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
        let longest = squared_edges[0].max(squared_edges[1]).max(squared_edges[2]);
        let middle = (a + b + c) / 3.0;
        // No point of the cell is farther from its centroid than two thirds of its longest edge.
        let reach = self.squared_radius.sqrt() + 2.0 / 3.0 * longest.sqrt();
        if (middle - self.centre).length_squared() > reach * reach {
            return;
        }
        let mids = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        let [na, nb, nc] = shapes;
        let mid_shapes = [(na + nb) / 2.0, (nb + nc) / 2.0, (nc + na) / 2.0];
        if longest > CELL_SIZE * CELL_SIZE * self.squared_radius && depth < MAX_DEPTH {
            self.integrate([a, mids[0], mids[2]], [na, mid_shapes[0], mid_shapes[2]], depth + 1);
            self.integrate([mids[0], b, mids[1]], [mid_shapes[0], nb, mid_shapes[1]], depth + 1);
            self.integrate([mids[2], mids[1], c], [mid_shapes[2], mid_shapes[1], nc], depth + 1);
            self.integrate(mids, mid_shapes, depth + 1);
            return;
        }
        let area = 0.5 * (b - a).cross(c - a).length();
        for (point, shape) in mids.into_iter().zip(mid_shapes) {
            let inside = 1.0 - (point - self.centre).length_squared() / self.squared_radius;
            if inside > 0.0 {
                let weight = area / 3.0 * inside * inside;
                self.sums[0] += weight * shape.x;
                self.sums[1] += weight * shape.y;
                self.sums[2] += weight * shape.z;
            }
        }
    }
}

fn squared_distance_to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let edge = b - a;
    let along = ((p - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
    (a + along * edge - p).length_squared()
}
