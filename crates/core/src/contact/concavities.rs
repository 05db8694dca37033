//! Concavities of a surface, where a tool may touch at several places at once: grooves, folds, corners.
//!
//! A sphere of radius `R` that touches the surface at `x` has its centre at `c = x + t n`, `t <= R`. It may touch at another place
//! `y` too if the distance `|c - y|` has a local minimum there which is about as small, and `c` lies outside of the surface at `y`,
//! which excludes the far side of a thin part. The minima are searched among the nodes, separately on each side of a crease, by
//! descent from neighbour to neighbour. As `c` is one of few, they are only starting points of the search in a tick.

use glam::DVec3;

use super::map_with;
use super::smooth::SmoothSurface;
use crate::memory::Ranges;

/// Heights `t` of the centre over the surface, over `R`.
const HEIGHTS: [f64; 3] = [0.4, 0.7, 1.0];
/// Largest distance of a starting node from the centre, over `R`.
const REACH: f64 = 1.25;
/// Largest cosine of the angle between the normals of two contacts.
const APART: f64 = 0.97;
/// Least cosine of the angle between the normal of a starting node and the direction to the centre.
const FACING: f64 = 0.3;
/// Most starting nodes of a triangle.
pub const MAX_STARTS: usize = 8;

/// For each triangle the fans from which the search for additional contacts starts while the tool touches that triangle.
#[derive(Clone, Debug, Default)]
pub struct Concavities {
    /// Offset of each triangle's fans; empty for a surface without concavities.
    offsets: Vec<u32>,
    fans: Vec<u32>,
}

impl Concavities {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.offsets);
        ranges.add(&self.fans);
    }

    /// For a tool that fits into a ball of `radius`, m.
    pub fn new(smooth: &SmoothSurface, radius: f64) -> Self {
        let by_x = sorted(smooth);
        let of_fan = |(): &mut (), fan: usize| starts(smooth, &by_x, fan, radius);
        let starts_of_fans = map_with(smooth.fans().len(), || (), of_fan);
        if starts_of_fans.iter().all(Vec::is_empty) {
            return Self::default();
        }
        let mut concavities = Self::default();
        for corners in &smooth.of_corners {
            concavities.offsets.push(concavities.fans.len() as u32);
            let first = concavities.fans.len();
            for &start in corners.iter().flat_map(|&corner| &starts_of_fans[corner as usize]) {
                if concavities.fans.len() < first + MAX_STARTS && !concavities.fans[first..].contains(&start) {
                    concavities.fans.push(start);
                }
            }
        }
        concavities.offsets.push(concavities.fans.len() as u32);
        concavities
    }

    /// Fans from which the search starts; at most [`MAX_STARTS`].
    pub fn starts(&self, triangle: u32) -> &[u32] {
        match self.offsets.get(triangle as usize..triangle as usize + 2) {
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
    let mut starts_of_fans = Vec::new();
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
            if minimum != own_end && starts_of_fans.len() < MAX_STARTS && !starts_of_fans.contains(&minimum) {
                starts_of_fans.push(minimum);
            }
        }
    }
    starts_of_fans
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
