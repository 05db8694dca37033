//! Tessellation of the smooth surface into small flat pieces, for tools that are not spheres.
//!
//! Each drawn triangle is divided into `n^2` pieces whose vertices lie on the smooth surface. Nodes and edges of creases stay
//! where they are drawn, so that pieces of two sides meet without a gap. Heights over a plane are then known everywhere, over
//! edges, grooves and corners as over a smooth part, and are continuous.

use glam::DVec3;

use super::smooth::{DrawnSurface, FootPoint, Neighbourhood, SmoothSurface};
use super::{SurfaceQuery, map_with};
use crate::memory::Ranges;
use crate::mesh::Surface;

/// Most divisions of an edge.
const MOST_DIVISIONS: usize = 6;
/// Largest distance of a vertex from the drawn surface, over the edge of its triangle; a farther one stays on it.
const FARTHEST: f64 = 0.3;
/// Three edges bent alike raise a piece's middle by a third of the bend, each edge itself by a quarter.
const EDGE_TO_MIDDLE: f64 = 4.0 / 3.0;

/// A surface in pieces.
pub struct Tessellation {
    divisions: usize,
    /// Edge of a piece on average, m.
    pub edge: f64,
    /// Vertices of each drawn triangle, row by row, m.
    vertices: Vec<DVec3>,
    /// Normals of the smooth surface there; on a crease that of the triangle.
    normals: Vec<DVec3>,
    /// Ranks of the corners of each piece among the vertices of its triangle.
    corners: Vec<[u8; 3]>,
    /// Barycentric coordinates of each piece's middle in its triangle.
    barycentric: Vec<[f64; 3]>,
    /// The piece across each edge of a piece, for all triangles; `u32::MAX` where there is none.
    across: Vec<[u32; 3]>,
    /// Whether each of these edges lies on a crease.
    creases: Vec<[bool; 3]>,
    /// A ball around each triangle's vertices.
    balls: Vec<(DVec3, f64)>,
    /// The pieces of all triangles.
    pieces: Vec<Piece>,
    /// The largest of all [`Self::bulges`], m.
    largest_bulge: f64,
}

/// A piece, as a flat triangle.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// The middle of its corners, m.
    pub middle: DVec3,
    /// Unit outward normal.
    pub normal: DVec3,
    /// Its area, m^2.
    pub area: f64,
    /// Farthest corner from the middle, m.
    pub size: f64,
}

impl Piece {
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let (middle, across) = ((a + b + c) / 3.0, (b - a).cross(c - a));
        let size = [a, b, c].iter().map(|corner| corner.distance_squared(middle)).fold(0.0, f64::max).sqrt();
        Self { middle, normal: across.normalize_or_zero(), area: 0.5 * across.length(), size }
    }
}

impl Tessellation {
    /// Divides the triangles until their edges are mostly no longer than `longest`, m.
    pub fn new(surface: &Surface, query: &SurfaceQuery, smooth: &SmoothSurface, longest: f64) -> Self {
        let edges = surface.triangles.iter().enumerate().map(|(t, _)| longest_edge(surface, t as u32));
        let mean = edges.sum::<f64>() / surface.triangles.len().max(1) as f64;
        let divisions = ((mean / longest).ceil() as usize).clamp(1, MOST_DIVISIONS);
        let lattice = Lattice { n: divisions };
        let drawn = DrawnSurface { surface, query };
        let on_crease = smooth.crease_nodes(surface);
        let place = |near: &mut Neighbourhood, t: usize| placed(&lattice, drawn, smooth, &on_crease, (near, t as u32));
        let memory = || Neighbourhood::new(std::iter::once(smooth));
        let vertices = map_with(surface.triangles.len(), memory, place);
        let ball = |vertices: &Vec<(DVec3, DVec3)>| {
            let centre = vertices.iter().map(|v| v.0).sum::<DVec3>() / vertices.len() as f64;
            (centre, vertices.iter().map(|v| v.0.distance(centre)).fold(0.0, f64::max))
        };
        let pieces = Self {
            divisions,
            edge: mean / divisions as f64,
            balls: vertices.iter().map(ball).collect(),
            normals: vertices.iter().flatten().map(|v| v.1).collect(),
            vertices: vertices.into_iter().flatten().map(|v| v.0).collect(),
            corners: lattice.pieces(),
            barycentric: lattice.middles(),
            across: lattice.across(surface),
            creases: lattice.creases(surface.triangles.len(), smooth),
            pieces: Vec::new(),
            largest_bulge: 0.0,
        };
        let count = (surface.triangles.len() * pieces.pieces_of_triangle()) as u32;
        let largest_bulge = (0..count).flat_map(|piece| pieces.bulges(piece)).fold(0.0, f64::max);
        let flat = (0..count).map(|piece| Piece::new(pieces.corners(piece))).collect();
        Self { largest_bulge, pieces: flat, ..pieces }
    }

    /// The highest points of a piece, m, that may be higher than its corners: for each edge the place and how far the surface lies
    /// over it along a direction of unit length. No point of the piece is higher than the highest of them: for equal corners and
    /// bends `b` that is `b/3`, in its middle.
    pub fn highest_points(&self, piece: u32, corners: [DVec3; 3], direction: DVec3) -> [(DVec3, f64); 3] {
        let bulges = self.bulges(piece);
        std::array::from_fn(|k| {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let (rise, bend) = ((to - from).dot(direction), EDGE_TO_MIDDLE * bulges[k]);
            let part =
                if bend > 0.0 { (0.5 + 0.5 * rise / bend).clamp(0.0, 1.0) } else { f64::from(u8::from(rise > 0.0)) };
            (from.lerp(to, part), part * (1.0 - part) * bend.max(0.0))
        })
    }

    /// Largest height of a piece over its corners, m.
    pub fn most_over_corners(&self) -> f64 {
        0.25 * EDGE_TO_MIDDLE * self.largest_bulge
    }

    /// Pieces of a triangle.
    pub fn pieces_of_triangle(&self) -> usize {
        self.divisions * self.divisions
    }

    /// A ball around the pieces of a triangle: its centre and radius, m.
    pub fn ball(&self, triangle: u32) -> (DVec3, f64) {
        self.balls[triangle as usize]
    }

    /// Corners of a piece, m; the pieces of triangle `t` begin at `t` times [`Self::pieces_of_triangle`].
    pub fn corners(&self, piece: u32) -> [DVec3; 3] {
        self.ranks(piece).map(|rank| self.vertices[rank])
    }

    /// Ranks of the corners of a piece among the vertices.
    fn ranks(&self, piece: u32) -> [usize; 3] {
        let (triangle, own) = (piece as usize / self.corners.len(), piece as usize % self.corners.len());
        let first = triangle * (self.divisions + 1) * (self.divisions + 2) / 2;
        self.corners[own].map(|corner| first + usize::from(corner))
    }

    /// For each edge `(k, k + 1)` of a piece how much the surface bulges over it, four times over its middle, m: with the normals
    /// at its ends `(n_1 - n_0).(x_1 - x_0) / 2`.
    pub fn bulges(&self, piece: u32) -> [f64; 3] {
        let ranks = self.ranks(piece);
        std::array::from_fn(|k| {
            let (from, to) = (ranks[k], ranks[(k + 1) % 3]);
            0.5 * (self.normals[to] - self.normals[from]).dot(self.vertices[to] - self.vertices[from])
        })
    }

    /// Barycentric coordinates of a piece's middle in its triangle.
    pub fn barycentric(&self, piece: u32) -> [f64; 3] {
        self.barycentric[piece as usize % self.corners.len()]
    }

    /// The piece across the edge `(k, k + 1)`; none at the border of an open surface.
    pub fn across(&self, piece: u32, k: usize) -> Option<u32> {
        Some(self.across[piece as usize][k]).filter(|&other| other != u32::MAX)
    }

    /// Whether the edge `(k, k + 1)` of a piece lies on a crease.
    pub fn is_crease(&self, piece: u32, k: usize) -> bool {
        self.creases[piece as usize][k]
    }

    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.vertices);
        ranges.add(&self.normals);
        ranges.add(&self.corners);
        ranges.add(&self.barycentric);
        ranges.add(&self.across);
        ranges.add(&self.creases);
        ranges.add(&self.balls);
        ranges.add(&self.pieces);
    }

    /// A piece as a flat triangle.
    pub fn piece(&self, piece: u32) -> &Piece {
        &self.pieces[piece as usize]
    }
}

fn longest_edge(surface: &Surface, t: u32) -> f64 {
    let [a, b, c] = surface.corners(t);
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// Vertices of a triangle and their normals, on the smooth surface where it has no crease.
fn placed(
    lattice: &Lattice,
    drawn: DrawnSurface<'_>,
    smooth: &SmoothSurface,
    on_crease: &[bool],
    (near, t): (&mut Neighbourhood, u32),
) -> Vec<(DVec3, DVec3)> {
    let (surface, n) = (drawn.surface, lattice.n);
    let ([a, b, c], nodes) = (surface.corners(t), surface.triangles[t as usize]);
    let creases = smooth.creases_of(t);
    let far = FARTHEST * longest_edge(surface, t);
    let vertex = |(i, j): (usize, usize)| {
        let x = a + (b - a) * (i as f64 / n as f64) + (c - a) * (j as f64 / n as f64);
        let on_edge = [j == 0, i + j == n, i == 0];
        let corner = [(0, 0), (n, 0), (0, n)].iter().position(|&at| at == (i, j));
        let sharp = corner.is_some_and(|k| on_crease[nodes[k] as usize]) || (0..3).any(|k| on_edge[k] && creases[k]);
        let flat = surface.normals[t as usize];
        if sharp {
            return (x, flat);
        }
        let from = FootPoint { triangle: t, ..FootPoint::at(x, flat) };
        match smooth.foot(drawn, x, &from, near) {
            Some(foot) if !foot.on_crease && foot.position.distance(x) < far => (foot.position, foot.normal),
            _ => (x, flat),
        }
    };
    lattice.vertices().map(vertex).collect()
}

/// Vertices `(i, j)` of a triangle with `i + j <= n`, `i` along its first edge and `j` along its last.
struct Lattice {
    n: usize,
}

impl Lattice {
    fn vertices(&self) -> impl Iterator<Item = (usize, usize)> {
        let n = self.n;
        (0..=n).flat_map(move |j| (0..=n - j).map(move |i| (i, j)))
    }

    fn vertex(&self, i: usize, j: usize) -> u8 {
        let before: usize = (0..j).map(|row| self.n + 1 - row).sum();
        (before + i) as u8
    }

    /// Pieces `(i, j)` that stand as their triangle does, and those turned by half a turn, row by row.
    fn cells(&self) -> impl Iterator<Item = (usize, usize, bool)> {
        let n = self.n;
        (0..n).flat_map(move |j| {
            (0..n - j)
                .flat_map(move |i| [(i, j, false), (i, j, true)])
                .filter(move |&(i, j, turned)| !turned || i + j + 1 < n)
        })
    }

    fn piece(&self, i: usize, j: usize, turned: bool) -> u32 {
        let before: usize = (0..j).map(|row| 2 * (self.n - row) - 1).sum();
        (before + 2 * i + usize::from(turned)) as u32
    }

    fn places(&self) -> impl Iterator<Item = [(usize, usize); 3]> {
        self.cells().map(|(i, j, turned)| match turned {
            false => [(i, j), (i + 1, j), (i, j + 1)],
            true => [(i + 1, j), (i + 1, j + 1), (i, j + 1)],
        })
    }

    fn pieces(&self) -> Vec<[u8; 3]> {
        self.places().map(|corners| corners.map(|(i, j)| self.vertex(i, j))).collect()
    }

    fn middles(&self) -> Vec<[f64; 3]> {
        let third = 1.0 / (3 * self.n) as f64;
        self.places()
            .map(|corners| {
                let (i, j) = corners.iter().fold((0, 0), |(i, j), corner| (i + corner.0, j + corner.1));
                let (b, c) = (i as f64 * third, j as f64 * third);
                [1.0 - b - c, b, c]
            })
            .collect()
    }

    /// The piece with the `q`-th part of the edge `k` of its triangle.
    fn at_edge(&self, k: usize, q: usize) -> u32 {
        let last = self.n - 1 - q;
        let (i, j) = [(q, 0), (last, q), (0, last)][k];
        self.piece(i, j, false)
    }

    fn creases(&self, triangles: usize, smooth: &SmoothSurface) -> Vec<[bool; 3]> {
        let of_triangle = |t: usize| {
            let creases = smooth.creases_of(t as u32);
            self.cells().map(move |(i, j, turned)| {
                let at = [j == 0, i + j + 1 == self.n, i == 0];
                std::array::from_fn(|k| !turned && at[k] && creases[k])
            })
        };
        (0..triangles).flat_map(of_triangle).collect()
    }

    fn across(&self, surface: &Surface) -> Vec<[u32; 3]> {
        let (n, count) = (self.n, self.n * self.n);
        let mut across = Vec::with_capacity(count * surface.triangles.len());
        for (t, beside) in surface.neighbours.iter().enumerate() {
            let own = (t * count) as u32;
            let outside = |k: usize, q: usize| {
                let other = beside[k];
                if other == u32::MAX {
                    return u32::MAX;
                }
                let shared = surface.neighbours[other as usize].iter().position(|&back| back == t as u32);
                shared.map_or(u32::MAX, |back| other * count as u32 + self.at_edge(back, n - 1 - q))
            };
            across.extend(self.cells().map(|(i, j, turned)| match turned {
                true => [(i + 1, j), (i, j + 1), (i, j)].map(|(i, j)| own + self.piece(i, j, false)),
                false => [
                    if j > 0 { own + self.piece(i, j - 1, true) } else { outside(0, i) },
                    if i + j + 1 < n { own + self.piece(i, j, true) } else { outside(1, j) },
                    if i > 0 { own + self.piece(i - 1, j, true) } else { outside(2, n - 1 - j) },
                ],
            }));
        }
        across
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::smooth::tests::{ball, cube};

    fn tessellated(surface: &Surface, longest: f64) -> Tessellation {
        let query = SurfaceQuery::new(surface).expect("triangles");
        Tessellation::new(surface, &query, &SmoothSurface::new(surface), longest)
    }

    /// Pieces side by side share their edge, turned round.
    #[test]
    fn pieces_meet_across_their_edges() {
        for (surface, longest) in [(ball(8), 0.1), (cube(), 0.3), (cube(), 10.0)] {
            let fine = tessellated(&surface, longest);
            for piece in 0..(surface.triangles.len() * fine.pieces_of_triangle()) as u32 {
                for k in 0..3 {
                    let other = fine.across(piece, k).expect("a closed surface");
                    let back = (0..3).find(|&back| fine.across(other, back) == Some(piece)).expect("it meets it too");
                    let (own, others) = (fine.corners(piece), fine.corners(other));
                    assert!(own[k].distance(others[(back + 1) % 3]) < 1e-6, "{piece} {k}");
                    assert!(own[(k + 1) % 3].distance(others[back]) < 1e-6, "{piece} {k}");
                }
            }
        }
    }

    /// Facets of the drawn ball lie up to 5 % of its radius below it.
    #[test]
    fn vertices_lie_on_the_smooth_surface() {
        let surface = ball(8);
        let fine = tessellated(&surface, 0.1);
        for piece in 0..(surface.triangles.len() * fine.pieces_of_triangle()) as u32 {
            for corner in fine.corners(piece) {
                assert!((corner.length() - 1.0).abs() < 0.006, "{}", corner.length());
            }
            let [a, b, c] = fine.barycentric(piece);
            assert!((a + b + c - 1.0).abs() < 1e-12 && a > 0.0 && b > 0.0 && c > 0.0);
        }
        let area = |piece: u32| {
            let [a, b, c] = fine.corners(piece);
            0.5 * (b - a).cross(c - a).length()
        };
        let total: f64 = (0..(surface.triangles.len() * fine.pieces_of_triangle()) as u32).map(area).sum();
        assert!((total / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.01, "{total}");
    }

    #[test]
    fn edges_of_a_cube_stay_sharp() {
        let fine = tessellated(&cube(), 0.3);
        let total = (0..12 * fine.pieces_of_triangle() as u32).map(|piece| {
            let [a, b, c] = fine.corners(piece);
            0.5 * (b - a).cross(c - a).length()
        });
        assert!((total.sum::<f64>() - 6.0).abs() < 1e-9);
    }
}
