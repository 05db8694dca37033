//! Fans: the faces around a surface node on one smooth side of it, with the quadric fitted to them.
//!
//! Edges that turn by more than [`CREASE`] are creases, but for convex ones that end within a smooth surface. The triangles around a
//! node fall into fans between its creases; a node of a smooth surface has one, the corner of a cube three. A fan has a normal and a
//! curvature of its own, from the least-squares quadric `z = a x + b y + (c x^2 + 2 d x y + e y^2) / 2` through the node and weighted
//! by its neighbours (Cazals and Pouget, 2005).

use glam::{DMat3, DVec2, DVec3};

use crate::math::acos;
use crate::mesh::{Surface, is_convex};
use crate::tensor::outer;

/// Cosine of the turn beyond which an edge is a crease: 50 degrees.
const CREASE: f64 = 0.642_787_609_686_539_4;
/// Cosine of the turn from which a convex edge that ends within a smooth surface is a crease too: 80 degrees.
const SHARP_CREASE: f64 = 0.173_648_177_666_930_3;
/// Reach of a fan's blending weight over its longest edge.
const REACH: f64 = 1.8;
/// Largest distance of neighbours in the fit, over the longest edge.
const FIT: f64 = 2.2;
/// Largest curvature times the longest edge: a mesh cannot resolve more.
const SHARPEST: f64 = 1.0;
/// Number of fits, each in the frame of the previous one.
const FITS: usize = 2;

/// One smooth side of a surface node.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fan {
    /// Rank of the surface node.
    pub node: u32,
    /// A triangle of it.
    pub triangle: u32,
    /// Position of the node, m.
    pub position: DVec3,
    /// Unit outward normal.
    pub normal: DVec3,
    /// Curvature of the surface, tangential, positive where it is convex, 1/m.
    pub curvature: DMat3,
    /// Mean curvature, 1/m.
    pub mean: f64,
    /// Gaussian curvature, 1/m^2.
    pub gauss: f64,
    /// Distance at which its blending weight ends, m.
    pub reach: f64,
    /// Mean length of its edges, m.
    pub spacing: f64,
}

/// The fans of a surface, those of each triangle's corners, and which edges are creases.
pub struct Fans {
    pub fans: Vec<Fan>,
    pub of_corners: Vec<[u32; 3]>,
    /// For each fan those that share a triangle with it.
    pub neighbours: Vec<Vec<u32>>,
    pub creases: Vec<[bool; 3]>,
}

impl Fans {
    /// Finds and fits them.
    pub fn new(surface: &Surface) -> Self {
        let creases = creases(surface);
        let (of_corners, count) = corners(surface, &creases);
        // A matrix is the identity by default.
        let mut fans = vec![Fan { curvature: DMat3::ZERO, ..Fan::default() }; count];
        outline(surface, &of_corners, &mut fans);
        let neighbours = neighbours(&of_corners, count);
        for _ in 0..FITS {
            let before = fans.clone();
            for (rank, fan) in fans.iter_mut().enumerate() {
                fit(rank as u32, fan, &before, &neighbours);
            }
        }
        Self { fans, of_corners, neighbours, creases }
    }
}

/// Edges of each triangle that are creases. A convex one that ends at a node with no other crease does not part the surface there:
/// it comes from a coarse mesh of something round, as that of a scan. The smooth surface and the drawn edge, up to a millimetre
/// above it, would then hold the same tool at different depths. No tool reaches the edge of a concave one.
fn creases(surface: &Surface) -> Vec<[bool; 3]> {
    let cosine = |t: usize, other: u32| match other {
        u32::MAX => -1.0,
        other => surface.normals[t].dot(surface.normals[other as usize]),
    };
    let edges_of = |t: usize| surface.neighbours[t].into_iter().enumerate().map(move |(k, other)| (t, k, other));
    let ends =
        |t: usize, k: usize| [surface.triangles[t][k], surface.triangles[t][(k + 1) % 3]].map(|node| node as usize);
    let turns_away = |t: usize, k: usize, other: usize| {
        let [from, to] = ends(t, k).map(|node| surface.positions[node]);
        is_convex(surface.normals[t], surface.normals[other], to - from)
    };
    let mut creases = vec![[false; 3]; surface.triangles.len()];
    let (mut count, mut soft) = (vec![0u32; surface.positions.len()], Vec::new());
    for (t, k, other) in (0..creases.len()).flat_map(edges_of) {
        creases[t][k] = cosine(t, other) < CREASE;
        if creases[t][k] && (other == u32::MAX || other as usize > t) {
            ends(t, k).into_iter().for_each(|node| count[node] += 1);
            if cosine(t, other) > SHARP_CREASE && turns_away(t, k, other as usize) {
                soft.push((t, k, other as usize));
            }
        }
    }
    loop {
        let before = soft.len();
        soft.retain(|&(t, k, other)| {
            let ends = ends(t, k);
            let parts = ends.iter().all(|&node| count[node] > 1);
            if !parts {
                ends.into_iter().for_each(|node| count[node] -= 1);
                creases[t][k] = false;
                if let Some(k) = surface.neighbours[other].iter().position(|&back| back as usize == t) {
                    creases[other][k] = false;
                }
            }
            parts
        });
        if soft.len() == before {
            return creases;
        }
    }
}

/// Joins the corners of triangles that meet at a node across edges that are no creases.
fn corners(surface: &Surface, creases: &[[bool; 3]]) -> (Vec<[u32; 3]>, usize) {
    let triangles = &surface.triangles;
    let mut parent: Vec<u32> = (0..3 * triangles.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for (t, across) in surface.neighbours.iter().enumerate() {
        for k in (0..3).filter(|&k| !creases[t][k] && across[k] as usize > t) {
            for corner in [k, (k + 1) % 3] {
                let node = triangles[t][corner];
                let other = triangles[across[k] as usize].iter().position(|&n| n == node);
                if let Some(place) = other {
                    let a = root(&mut parent, (3 * t + corner) as u32);
                    let b = root(&mut parent, 3 * across[k] + place as u32);
                    parent[a.max(b) as usize] = a.min(b);
                }
            }
        }
    }
    let mut rank = vec![u32::MAX; parent.len()];
    let mut count = 0;
    let of_corners = (0..triangles.len())
        .map(|t| {
            [0, 1, 2].map(|k| {
                let top = root(&mut parent, (3 * t + k) as u32) as usize;
                if rank[top] == u32::MAX {
                    rank[top] = count;
                    count += 1;
                }
                rank[top]
            })
        })
        .collect();
    (of_corners, count as usize)
}

/// Places, normals by angle, and lengths of edges.
fn outline(surface: &Surface, of_corners: &[[u32; 3]], fans: &mut [Fan]) {
    let mut edges = vec![(0.0f64, 0.0f64, 0u32); fans.len()];
    for (t, corners) in of_corners.iter().enumerate() {
        let ends = surface.corners(t as u32);
        for k in 0..3 {
            let (here, next, last) = (ends[k], ends[(k + 1) % 3] - ends[k], ends[(k + 2) % 3] - ends[k]);
            let (rank, lengths) = (corners[k] as usize, [next.length(), last.length()]);
            let fan = &mut fans[rank];
            (fan.node, fan.triangle, fan.position) = (surface.triangles[t][k], t as u32, here);
            fan.normal += surface.normals[t]
                * acos((next.dot(last) / (next.length_squared() * last.length_squared()).sqrt()).clamp(-1.0, 1.0));
            for length in lengths {
                edges[rank].0 = edges[rank].0.max(length);
                edges[rank].1 += length;
                edges[rank].2 += 1;
            }
        }
    }
    for (fan, (longest, sum, count)) in fans.iter_mut().zip(edges) {
        fan.normal = fan.normal.normalize_or(DVec3::Z);
        (fan.reach, fan.spacing) = (REACH * longest, sum / f64::from(count.max(1)));
    }
}

/// For each fan those that share a triangle with it.
fn neighbours(of_corners: &[[u32; 3]], count: usize) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); count];
    for corners in of_corners {
        for &a in corners {
            neighbours[a as usize].extend(corners.iter().filter(|&&b| b != a));
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    neighbours
}

/// Fans within reach of the fit, found from neighbour to neighbour; those that face another way do not count.
fn around(rank: u32, fans: &[Fan], neighbours: &[Vec<u32>], radius: f64) -> Vec<u32> {
    let own = &fans[rank as usize];
    let (mut found, mut next) = (vec![rank], 0);
    while next < found.len() {
        for &other in &neighbours[found[next] as usize] {
            let fan = &fans[other as usize];
            let near = fan.position.distance(own.position) < radius && fan.normal.dot(own.normal) > 0.3;
            if near && !found.contains(&other) {
                found.push(other);
            }
        }
        next += 1;
    }
    found.remove(0);
    found
}

/// Fits normal and curvature; where there are too few neighbours the surface is taken for flat.
fn fit(rank: u32, fan: &mut Fan, before: &[Fan], neighbours: &[Vec<u32>]) {
    let longest = fan.reach / REACH;
    let radius = FIT * longest;
    let around = around(rank, before, neighbours, radius);
    let (x, y) = fan.normal.any_orthonormal_pair();
    let (mut matrix, mut right) = ([[0.0; 5]; 5], [0.0; 5]);
    for &other in &around {
        let offset = before[other as usize].position - fan.position;
        let (u, v, z) = (offset.dot(x) / longest, offset.dot(y) / longest, offset.dot(fan.normal) / longest);
        let weight = (1.0 - offset.length_squared() / (radius * radius)).max(0.0).powi(2);
        let row = [u, v, 0.5 * u * u, u * v, 0.5 * v * v];
        for i in 0..5 {
            right[i] += weight * row[i] * z;
            (0..5).for_each(|j| matrix[i][j] += weight * row[i] * row[j]);
        }
    }
    if around.len() < 5 {
        return;
    }
    let Some([a, b, c, d, e]) = solved(matrix, right) else { return };
    let slope = DVec2::new(a, b);
    // Steeper neighbours are no graph over the plane.
    if slope.length() > 1.0 {
        return;
    }
    let flatter = 1.0 / (1.0 + slope.length_squared()).sqrt();
    let normal = ((fan.normal - a * x - b * y) * flatter).normalize();
    // The second fundamental form in the tangents of the graph, brought to an orthonormal frame of the new plane.
    let (tx, ty) = (x + a * fan.normal, y + b * fan.normal);
    let inverse =
        glam::DMat2::from_cols(DVec2::new(tx.dot(tx), tx.dot(ty)), DVec2::new(tx.dot(ty), ty.dot(ty))).inverse();
    let form = glam::DMat2::from_cols(DVec2::new(c, d), DVec2::new(d, e)) * (-flatter / longest);
    let raised = inverse * form * inverse;
    let bound = (SHARPEST / longest / raised_size(&raised)).min(1.0);
    let raised = raised * bound;
    fan.curvature = outer(tx, tx) * raised.x_axis.x
        + (outer(tx, ty) + outer(ty, tx)) * raised.x_axis.y
        + outer(ty, ty) * raised.y_axis.y;
    let mixed = inverse * form * bound;
    (fan.mean, fan.gauss) = (0.5 * (mixed.x_axis.x + mixed.y_axis.y), mixed.determinant());
    fan.normal = normal;
}

fn raised_size(m: &glam::DMat2) -> f64 {
    (m.x_axis.length_squared() + m.y_axis.length_squared()).sqrt().max(f64::MIN_POSITIVE)
}

/// Solves five normal equations with a slight ridge; `None` if they are singular.
fn solved(mut a: [[f64; 5]; 5], mut b: [f64; 5]) -> Option<[f64; 5]> {
    let trace: f64 = (0..5).map(|i| a[i][i]).sum();
    (0..5).for_each(|i| a[i][i] += 1e-10 * trace);
    for k in 0..5 {
        if a[k][k] <= 1e-9 * trace {
            return None;
        }
        for i in k + 1..5 {
            let factor = a[i][k] / a[k][k];
            for j in k..5 {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..5).rev() {
        let known: f64 = (k + 1..5).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    Some(b)
}
