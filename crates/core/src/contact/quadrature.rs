//! Quadrature of shape functions against the mask `phi = (1 - r^2/a^2)^2` over one drawn triangle of a face.
//!
//! The triangle is split until its cells' edges are below a fifth of the contact radius `a`; each cell takes the mid-edge
//! rule, exact for quadratics. The sums are the moments `int phi s^m t^n dA` over the face's coordinates; the
//! integrals of the shape functions are fixed combinations of them.
//!
//! On a flat face with straight edges all cells are alike, so their mid-edges form a lattice, and along a row of it `r^2`
//! is a quadratic in the running index: the rows and the part of each that the ball of radius `a` covers are known
//! beforehand. Curved faces are in `curved`.

use glam::DVec3;

use super::curved::{Cell, CellRules, DEEPEST, PlacedPoints, Polynomial, common_depth};
use super::face::FaceGeometry;
use super::lattice::Lattice;
use super::moments::{CELL_SIZE, Coordinates, Moments, cell_reach, halfway};
use crate::element::{Face, Tri3, Tri6};
use crate::memory::Ranges;
use crate::mesh::{Faces, Surface};

/// Depths whose points are placed beforehand: those of triangles that are not much larger than a fifth of the radius, of which
/// a contact covers many.
const PLACED_DEPTHS: usize = 2;

/// Data of a drawn triangle that do not depend on the contact.
pub struct TriangleGeometry {
    /// In the coordinates of its face.
    pub(super) corners: [Coordinates; 3],
    ends: [DVec3; 3],
    polynomial: Polynomial,
    /// Shortest and longest of the cells' longest edges by depth, squared, m^2.
    squared_edges: [[f64; 2]; DEEPEST + 1],
    /// Points of the lattices of the first depths.
    placed: [Vec<PlacedPoints>; PLACED_DEPTHS],
    centroid: DVec3,
    /// Bound on the distance of its points from the centroid, m.
    reach: f64,
    /// Distance of the middle of each edge from its chord, m.
    pub(super) bulges: [f64; 3],
}

/// The faces of a surface at rest, prepared.
pub struct PatchGeometry {
    pub(super) faces: Vec<FaceGeometry>,
    pub(super) triangles: Vec<TriangleGeometry>,
    rules: CellRules,
    /// Largest contact radius known to be within the limit everywhere, m, as bits.
    pub(super) verified_radius: std::sync::atomic::AtomicU64,
}

impl PatchGeometry {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.faces);
        ranges.add(&self.triangles);
    }

    /// Prepares faces and triangles.
    pub fn new(surface: &Surface) -> Self {
        let at = |n: u32| surface.positions[n as usize];
        let (faces, parts): (Vec<_>, Vec<_>) = match &surface.faces {
            Faces::Linear(faces) => {
                (faces.iter().map(|f| FaceGeometry::linear(f.map(at))).collect(), corners_of::<Tri3, 3>())
            }
            Faces::Quadratic(faces) => {
                (faces.iter().map(|f| FaceGeometry::quadratic(f.map(at))).collect(), corners_of::<Tri6, 6>())
            }
        };
        let rules = CellRules::new();
        let of_triangle = |t: usize| {
            TriangleGeometry::new(&rules, &faces[t / parts.len()], parts[t % parts.len()], surface.corners(t as u32))
        };
        let triangles = (0..surface.triangles.len()).map(of_triangle).collect();
        Self { faces, triangles, rules, verified_radius: 0.into() }
    }

    /// Moments of the mask around `centre` over triangle `t` of a face.
    pub fn integrate(&self, t: usize, face: &FaceGeometry, centre: DVec3, radius: f64) -> Moments {
        let (triangle, mut moments) = (&self.triangles[t], Moments::default());
        let reach = radius + triangle.reach;
        if (triangle.centroid - centre).length_squared() > reach * reach {
            return moments;
        }
        match common_depth(&triangle.squared_edges, CELL_SIZE * CELL_SIZE * radius * radius) {
            Some(depth) => {
                let own = match triangle.placed.get(depth) {
                    Some(placed) => self.rules.sum_placed(depth, placed, centre, radius),
                    None => self.rules.sum(depth, &triangle.polynomial, centre, radius),
                };
                moments.add_cell(triangle.corners, own);
            }
            None if face.flat => {
                Lattice::new(triangle.corners, triangle.ends, centre, radius, face.area_ratio).integrate(&mut moments);
            }
            None => Cell { corners: triangle.corners, ends: triangle.ends }.integrate(
                face,
                &self.rules,
                centre,
                radius,
                0,
                &mut moments,
            ),
        }
        moments
    }
}

impl TriangleGeometry {
    fn new(rules: &CellRules, face: &FaceGeometry, corners: [Coordinates; 3], ends: [DVec3; 3]) -> Self {
        let ([la, lb, lc], [a, b, c]) = (corners, ends);
        let at = [halfway(la, lb), halfway(lb, lc), halfway(lc, la)].map(|l| face.at(l));
        let chords = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        let bulges = [0, 1, 2].map(|k| if face.flat { 0.0 } else { at[k].distance(chords[k]) });
        let squared_longest = [b - a, c - b, a - c].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
        let polynomial = Polynomial::through(ends, at);
        Self {
            corners,
            ends,
            squared_edges: polynomial.squared_edges(),
            placed: std::array::from_fn(|depth| rules.place(depth, &polynomial)),
            polynomial,
            centroid: (a + b + c) / 3.0,
            reach: cell_reach(squared_longest, bulges.into_iter().fold(0.0, f64::max)),
            bulges,
        }
    }
}

/// Corners of the drawn triangles of a face in its coordinates.
fn corners_of<F: Face<N>, const N: usize>() -> Vec<[Coordinates; 3]> {
    F::PARTS.iter().map(|part| part.map(|k| [F::NODES[k].y, F::NODES[k].z])).collect()
}
