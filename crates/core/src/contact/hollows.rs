//! Where a tool may touch a surface at several places at once: in a groove, in a fold, in a corner.
//!
//! A sphere of radius `R` that touches the surface at `x` has its centre at `c = x + t n`, `t <= R`. It may touch at another
//! place `y` too if the distance `|c - y|` has a local minimum there which is about as small, and `c` lies outside of the
//! surface at `y`: so the far side of a thin part is none. The minima are looked for among the nodes, each side of a crease for
//! itself, by descent from neighbour to neighbour. They are only where the search for a place starts: `c` is one of few.

use glam::DVec3;

use super::smooth::SmoothSurface;
use crate::memory::Ranges;

/// Heights `t` of the centre over the surface, over `R`.
const HEIGHTS: [f64; 3] = [0.4, 0.7, 1.0];
/// A node as far from the centre as this, over `R`, may be where another place starts.
const REACH: f64 = 1.25;
/// Largest cosine of the angle between the normals of two places.
const APART: f64 = 0.97;
/// Least cosine of the angle between a place's normal and the direction to the centre.
const FACING: f64 = 0.3;
/// Most places that are known beside a node.
pub const MAX_STARTS: usize = 8;

/// For each triangle the fans from which other places are looked for, while the tool touches that triangle.
#[derive(Clone, Debug, Default)]
pub struct Hollows {
    /// Where those of each triangle begin; empty for a surface without any.
    begins: Vec<u32>,
    fans: Vec<u32>,
}

impl Hollows {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.begins);
        ranges.add(&self.fans);
    }

    /// For a tool that fits into a ball of `radius`, m.
    pub fn new(smooth: &SmoothSurface, radius: f64) -> Self {
        let by_x = sorted(smooth);
        let of_fan = |fan: usize| starts(smooth, &by_x, fan, radius);
        #[cfg(feature = "offline")]
        let found: Vec<Vec<u32>> = {
            use rayon::prelude::*;
            (0..smooth.fans().len()).into_par_iter().map(of_fan).collect()
        };
        #[cfg(not(feature = "offline"))]
        let found: Vec<Vec<u32>> = (0..smooth.fans().len()).map(of_fan).collect();
        if found.iter().all(Vec::is_empty) {
            return Self::default();
        }
        let mut hollows = Self::default();
        for corners in &smooth.of_corners {
            hollows.begins.push(hollows.fans.len() as u32);
            let first = hollows.fans.len();
            for &start in corners.iter().flat_map(|&corner| &found[corner as usize]) {
                if hollows.fans.len() < first + MAX_STARTS && !hollows.fans[first..].contains(&start) {
                    hollows.fans.push(start);
                }
            }
        }
        hollows.begins.push(hollows.fans.len() as u32);
        hollows
    }

    /// Fans from which other places are looked for; at most [`MAX_STARTS`].
    pub fn starts(&self, triangle: u32) -> &[u32] {
        match self.begins.get(triangle as usize..triangle as usize + 2) {
            Some(&[from, to]) => &self.fans[from as usize..to as usize],
            _ => &[],
        }
    }
}

/// Fans in the order of their x.
fn sorted(smooth: &SmoothSurface) -> Vec<u32> {
    let mut order: Vec<u32> = (0..smooth.fans().len() as u32).collect();
    order.sort_by(|&a, &b| smooth.fans()[a as usize].position.x.total_cmp(&smooth.fans()[b as usize].position.x));
    order
}

/// Minima of the distance other than the fan's own.
fn starts(smooth: &SmoothSurface, by_x: &[u32], own: usize, radius: f64) -> Vec<u32> {
    let fans = smooth.fans();
    let fan = &fans[own];
    let reach = (1.0 + REACH) * radius;
    let x_of = |&rank: &u32| fans[rank as usize].position.x;
    let from = by_x.partition_point(|rank| x_of(rank) < fan.position.x - reach);
    let to = by_x.partition_point(|rank| x_of(rank) <= fan.position.x + reach);
    let mut found = Vec::new();
    for height in HEIGHTS {
        let centre = fan.position + fan.normal * (height * radius);
        let near = |rank: usize| {
            let offset = centre - fans[rank].position;
            let distance = offset.length();
            let faces = fans[rank].normal.dot(offset) > FACING * distance;
            distance < REACH * radius && faces && fans[rank].normal.dot(fan.normal) < APART
        };
        let mut minima: Vec<u32> = by_x[from..to]
            .iter()
            .filter(|&&rank| near(rank as usize))
            .map(|&rank| descend(smooth, centre, rank))
            .filter(|&rank| near(rank as usize))
            .collect();
        minima.sort_unstable();
        minima.dedup();
        let own_end = descend(smooth, centre, own as u32);
        for minimum in minima {
            if minimum != own_end && found.len() < MAX_STARTS && !found.contains(&minimum) {
                found.push(minimum);
            }
        }
    }
    found
}

/// The fan at which a descent of the distance from a point ends.
fn descend(smooth: &SmoothSurface, from: DVec3, start: u32) -> u32 {
    let squared = |rank: u32| smooth.fans()[rank as usize].position.distance_squared(from);
    let (mut at, mut least) = (start, squared(start));
    loop {
        let next = smooth.neighbours[at as usize].iter().copied().min_by(|&a, &b| squared(a).total_cmp(&squared(b)));
        match next {
            Some(next) if squared(next) < least => (at, least) = (next, squared(next)),
            _ => return at,
        }
    }
}
