//! The fans that reach a triangle, copied into lanes for the processor's vectors when a tool crosses into the triangle.
//!
//! A tick evaluates the surface several times at about one point. Sums over the fans go through fixed lanes that are added up
//! in a fixed order, so that processors with short and with long vectors find the same bits.

use super::SmoothSurface;
use super::fans::Fan;

/// Fans side by side.
pub const LANES: usize = 4;
/// A number for each of them.
pub type Lane = [f64; LANES];

/// Fans side by side.
#[derive(Clone, Copy, Debug)]
pub struct FanLanes {
    pub position: [Lane; 3],
    pub normal: [Lane; 3],
    /// Curvature by `xx, xy, xz, yy, yz, zz`.
    pub curvature: [Lane; 6],
    pub inverse_squared_reach: Lane,
    /// One where the node is touchable, else zero.
    pub touchable: Lane,
    pub ranks: [u32; LANES],
}

impl FanLanes {
    /// Fans without reach, to fill a group.
    const NONE: Self = Self {
        position: [[1e9; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        curvature: [[0.0; LANES]; 6],
        inverse_squared_reach: [1.0; LANES],
        touchable: [0.0; LANES],
        ranks: [0; LANES],
    };

    fn set(&mut self, lane: usize, rank: u32, fan: &Fan, touchable: bool) {
        let [x, y, z] = [fan.curvature.x_axis, fan.curvature.y_axis, fan.curvature.z_axis];
        for k in 0..3 {
            self.position[k][lane] = fan.position[k];
            self.normal[k][lane] = fan.normal[k];
        }
        for (to, of) in self.curvature.iter_mut().zip([x.x, y.x, z.x, y.y, z.y, z.z]) {
            to[lane] = of;
        }
        self.inverse_squared_reach[lane] = 1.0 / (fan.reach * fan.reach);
        self.touchable[lane] = f64::from(u8::from(touchable));
        self.ranks[lane] = rank;
    }

    /// Offset of a place from each fan, and its square over that of the fan's reach.
    #[inline(always)]
    pub fn offset(&self, x: [f64; 3]) -> ([Lane; 3], Lane) {
        let (mut offset, mut relative) = ([[0.0; LANES]; 3], [0.0; LANES]);
        for l in 0..LANES {
            for k in 0..3 {
                offset[k][l] = x[k] - self.position[k][l];
            }
            let square = offset[0][l] * offset[0][l] + offset[1][l] * offset[1][l] + offset[2][l] * offset[2][l];
            relative[l] = square * self.inverse_squared_reach[l];
        }
        (offset, relative)
    }
}

/// Whether any fan reaches as far as these squares.
#[inline(always)]
pub fn reaches(relative: &Lane) -> bool {
    relative.iter().any(|&square| square < 1.0)
}

/// Sum over the lanes.
#[inline(always)]
pub fn total([a, b, c, d]: Lane) -> f64 {
    (a + c) + (b + d)
}

/// The fans around a triangle, first those on its side of all creases.
#[derive(Clone, Debug)]
pub struct Neighbourhood {
    triangle: Option<u32>,
    groups: Vec<FanLanes>,
    same_side_count: usize,
    count: usize,
    /// Spacing of the first fan, m.
    pub(super) spacing: f64,
}

impl Neighbourhood {
    /// Memory for any triangle of some surfaces.
    pub fn new<'a>(surfaces: impl Iterator<Item = &'a SmoothSurface>) -> Self {
        let most = surfaces.map(SmoothSurface::most_groups).max().unwrap_or(0);
        Self { triangle: None, groups: vec![FanLanes::NONE; most], same_side_count: 0, count: 0, spacing: 0.0 }
    }

    /// Invalidates the triangle: the next may be of another surface.
    pub fn invalidate(&mut self) {
        self.triangle = None;
    }

    /// Loads the fans of a triangle.
    pub(super) fn load(&mut self, surface: &SmoothSurface, triangle: u32) {
        if self.triangle == Some(triangle) {
            return;
        }
        self.triangle = Some(triangle);
        let [from, between, to] = surface.ranges[triangle as usize].map(|place| place as usize);
        self.spacing = surface.fans[surface.reaching[from] as usize].spacing;
        self.same_side_count = self.fill(surface, &surface.reaching[from..between], 0);
        self.count = self.fill(surface, &surface.reaching[between..to], self.same_side_count);
    }

    /// Fills groups from `first` on; returns the start of the next.
    fn fill(&mut self, surface: &SmoothSurface, ranks: &[u32], first: usize) -> usize {
        for (group, chunk) in self.groups[first..].iter_mut().zip(ranks.chunks(LANES)) {
            *group = FanLanes::NONE;
            for (lane, &rank) in chunk.iter().enumerate() {
                group.set(lane, rank, &surface.fans[rank as usize], surface.touchable[rank as usize]);
            }
        }
        first + ranks.len().div_ceil(LANES)
    }

    /// Fans on the triangle's side of all creases.
    pub(super) fn same_side(&self) -> &[FanLanes] {
        &self.groups[..self.same_side_count]
    }

    /// All fans.
    pub(super) fn all(&self) -> &[FanLanes] {
        &self.groups[..self.count]
    }
}
