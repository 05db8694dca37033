//! Sharp convex edges of a surface: pieces between nodes, which go on in chains.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::smooth::{ConvexCrease, SmoothSurface};
use crate::math::acos;
use crate::mesh::Surface;

/// `L`: least share of the modulus over an edge.
const LEAST_SHARE: f64 = 0.35;
/// Cosine of the angle between two edges that meet, from which they are pieces of one.
const SAME_CHAIN: f64 = 0.7;
/// `m = q (M_0 + M_1 q)` with the turn `q` of the normal over a right angle, and its largest value.
const BY_TURN: [f64; 2] = [0.8, 0.2];
const MOST_BY_TURN: f64 = 1.0;

/// A piece of a sharp convex edge.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    pub ends: [DVec3; 2],
    pub along: DVec3,
    /// Unit vectors from the edge into both faces, and the normals of these.
    pub into: [DVec3; 2],
    pub normals: [DVec3; 2],
    /// Turn of the normal over it, over a right angle.
    pub turn: f64,
    /// `m (1 - L)`.
    pub deficit: f64,
    /// Number of the edge; all its pieces have the same.
    pub chain: u32,
    /// Whether the edge ends with each end of this piece.
    pub is_last: [bool; 2],
}

impl Edge {
    /// Its point that is closest to another one.
    pub fn closest(&self, point: DVec3) -> DVec3 {
        let length = self.ends[0].distance(self.ends[1]);
        let at = (point - self.ends[0]).dot(self.along).clamp(0.0, length);
        self.ends[0] + self.along * at
    }

    /// Squared distance of a point, m^2.
    pub fn distance_squared(&self, point: DVec3) -> f64 {
        point.distance_squared(self.closest(point))
    }

    /// Opposite corners of a box that holds all within a distance, m.
    pub fn box_around(&self, reach: f64) -> [DVec3; 2] {
        let ([first, second], reach) = (self.ends, DVec3::splat(reach));
        [first.min(second) - reach, first.max(second) + reach]
    }
}

/// Creases whose faces turn away from each other, sorted by chain.
pub fn convex_edges(surface: &Surface, smooth: &SmoothSurface) -> Vec<Edge> {
    let (mut edges, mut nodes) = (Vec::new(), Vec::new());
    for crease in smooth.convex_creases(surface) {
        let ConvexCrease { ends, normals, .. } = crease;
        let turn = acos(normals[0].dot(normals[1]).clamp(-1.0, 1.0)) / FRAC_PI_2;
        let along = (ends[1] - ends[0]).normalize_or_zero();
        let into = [normals[0].cross(along), along.cross(normals[1])];
        let by_turn = (turn * (BY_TURN[0] + BY_TURN[1] * turn)).min(MOST_BY_TURN);
        let deficit = by_turn * (1.0 - LEAST_SHARE);
        edges.push(Edge { ends, along, into, normals, turn, deficit, chain: u32::MAX, is_last: [true; 2] });
        nodes.push(crease.nodes);
    }
    number_chains(&mut edges, &nodes);
    edges.sort_by_key(|edge| edge.chain);
    edges
}

/// Keeps edges that are no shorter than a length, m.
pub fn keep_long(edges: &mut Vec<Edge>, length: f64) {
    let mut lengths: BTreeMap<u32, f64> = BTreeMap::new();
    edges.iter().for_each(|edge| *lengths.entry(edge.chain).or_default() += edge.ends[0].distance(edge.ends[1]));
    edges.retain(|edge| lengths[&edge.chain] >= length);
}

/// Keeps edges without another one beside them: between two edges the body is a bar or a rim, not a wedge.
pub fn keep_single(edges: &mut Vec<Edge>, distance: f64) {
    let middle = |edge: &Edge| (edge.ends[0] + edge.ends[1]) * 0.5;
    // Pieces by cubes of a size that holds each and its surroundings.
    let longest = edges.iter().map(|edge| edge.ends[0].distance(edge.ends[1])).fold(distance, f64::max);
    let cube = |at: DVec3| (at / longest).floor().to_array().map(|place| place as i64);
    let mut cubes: BTreeMap<[i64; 3], Vec<Edge>> = BTreeMap::new();
    edges.iter().for_each(|edge| cubes.entry(cube(middle(edge))).or_default().push(*edge));
    let is_beside = |edge: &Edge, other: &Edge| {
        let near = |point: &DVec3| other.distance_squared(*point) < distance * distance;
        other.chain != edge.chain
            && other.along.dot(edge.along).abs() > SAME_CHAIN
            && (edge.ends.iter().any(near) || near(&middle(edge)))
    };
    edges.retain(|edge| {
        let [x, y, z] = cube(middle(edge));
        let around = (0..125).map(|k| [x + k % 5 - 2, y + k / 5 % 5 - 2, z + k / 25 - 2]);
        !around.filter_map(|place| cubes.get(&place)).flatten().any(|other| is_beside(edge, other))
    });
}

/// Numbers the chains of pieces that go on in about the same direction.
fn number_chains(edges: &mut [Edge], nodes: &[[u32; 2]]) {
    let mut at_node: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (edge, ends) in nodes.iter().enumerate() {
        ends.iter().for_each(|&node| at_node.entry(node).or_default().push(edge));
    }
    let mut chains = 0;
    for first in 0..edges.len() {
        if edges[first].chain != u32::MAX {
            continue;
        }
        edges[first].chain = chains;
        let mut open = vec![first];
        while let Some(edge) = open.pop() {
            for end in 0..2 {
                let node = nodes[edge][end];
                let away = |edge: usize| edges[edge].along * if nodes[edge][0] == node { 1.0 } else { -1.0 };
                // Two pieces that leave a node in about the same direction are the sides of a rim.
                let goes_on = |&&other: &&usize| away(edge).dot(away(other)) < -SAME_CHAIN;
                let next: Vec<usize> = at_node[&node].iter().filter(goes_on).copied().collect();
                edges[edge].is_last[end] = next.is_empty();
                for other in next {
                    if edges[other].chain == u32::MAX {
                        edges[other].chain = chains;
                        open.push(other);
                    }
                }
            }
        }
        chains += 1;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::contact::smooth::tests::{ball, cube};
    use crate::mesh::Faces;

    #[test]
    fn a_ball_has_no_edges_and_a_cube_has_twelve() {
        let of = |surface: &Surface| convex_edges(surface, &SmoothSurface::new(surface));
        assert!(of(&ball(24)).is_empty());
        let edges = of(&cube());
        assert_eq!(edges.iter().map(|edge| edge.chain).collect::<BTreeSet<_>>().len(), 12);
        assert!(edges.iter().all(|edge| (edge.deficit - (1.0 - LEAST_SHARE)).abs() < 1e-12));
    }

    /// A thin wedge of length 1: its top has two edges that leave the tip at 10 degrees.
    fn wedge() -> Surface {
        let [tip, left, right] = [DVec3::ZERO, DVec3::new(1.0, 0.09, 0.0), DVec3::new(1.0, -0.09, 0.0)];
        let positions = [0.0, 1.0].iter().flat_map(|&z| [tip, left, right].map(|at| at + z * DVec3::Z)).collect();
        let faces = vec![[0, 1, 2], [3, 5, 4], [0, 4, 1], [0, 3, 4], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]];
        Surface::new(positions, Faces::Linear(faces)).expect("a surface")
    }

    #[test]
    fn edges_that_leave_a_node_side_by_side_are_two_and_end_there() {
        let surface = wedge();
        let edges = convex_edges(&surface, &SmoothSurface::new(&surface));
        let on_top = |edge: &&Edge| edge.ends.iter().all(|end| end.z == 1.0) && edge.ends.contains(&DVec3::Z);
        let sides: Vec<&Edge> = edges.iter().filter(on_top).collect();
        assert_eq!(sides.len(), 2);
        assert_ne!(sides[0].chain, sides[1].chain);
        assert!(sides.iter().all(|edge| edge.is_last == [true; 2]));
    }
}
