//! Frictionless contact of a tool of any shape: pressures on a grid of cells over the plane of the contact.
//!
//! The stored energy is `U = max over f >= 0 of - f.gap - f.G f/2`, where `gap` is how far the tool lies above the body at
//! the middle of each cell (negative where it overlaps) and `G` the influence of the cells' forces on each other, that of a
//! half-space. Wrenches are the gradients of this energy by the pose of the tool and by that of the body, to the precision of the
//! solution: at the maximum the forces may be held constant, and the gap, the cells' places and their influence are
//! differentiated.
//!
//! The gap is measured along the normal, as in Sneddon's and Hertz's solutions. Of a sphere 16 x 16 cells give force and
//! energy to 0.3 %, 8 x 8 to 1 %, 4 x 4 to 3 %.

mod grid;
mod influence;
mod pressure;
mod relief;
mod wrench;

use glam::{DMat3, DVec3};

use super::super::shape::ToolShape;
use super::contact_plane::{ContactPlane, ToolPose};
use grid::{Rectangle, ToolInSurfaceFrame};
pub use influence::MAX_CELLS;
use influence::{Grid, Influence, ZERO};
use pressure::PressureScratch;
pub use pressure::{Convergence, MAX_PRODUCTS, TOLERANCE};
pub use relief::{GridFrame, Heights, LEAST_COSINE, Relief, SurfaceEnd, Wedge};

/// Number of cells along a side of the grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resolution {
    /// 16 x 16.
    #[default]
    Fine,
    /// 8 x 8.
    Medium,
    /// 4 x 4.
    Coarse,
}

impl Resolution {
    /// Cells along a side.
    pub fn cells(self) -> usize {
        match self {
            Resolution::Fine => MAX_CELLS,
            Resolution::Medium => MAX_CELLS / 2,
            Resolution::Coarse => MAX_CELLS / 4,
        }
    }
}

/// A tool at a pose over a contact plane.
#[derive(Clone, Copy, Debug)]
pub struct CellProblem<'a> {
    /// Shape of the tool.
    pub shape: &'a ToolShape,
    /// Its pose.
    pub pose: ToolPose,
    /// The plane of the contact: no lower than any point that the tool touches.
    pub plane: ContactPlane,
    /// Extents of the surface on a crest, beside those of the tool (`contact::footprint`); zero elsewhere.
    pub crest: DMat3,
    /// `E*`, Pa.
    pub effective_modulus: f64,
    /// Resolution of the grid.
    pub resolution: Resolution,
    /// Radius over which the body's own compliance spreads a force, m.
    pub width: f64,
}

/// Where the cells lie, relative to the origin of the tool, in the axes of the problem.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellPlace {
    /// Corner of the grid, m.
    pub corner: DVec3,
    /// Side of a cell along its first axis, m.
    pub along: DVec3,
    /// Side of a cell along its second axis, m.
    pub across: DVec3,
    /// Cells along each side of the grid.
    pub count: usize,
}

/// Pressures that the next solution starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressureState {
    resolution: Resolution,
    /// Where the cells lay in the last solution.
    pub place: CellPlace,
    /// Normal forces of the cells in the last solution, up to a common factor: across the grid, then along it.
    pub forces: Grid,
    /// Forces over `pi E* sqrt(hx hy)`, m.
    q: Grid,
    /// Forces of a punch on the same cells for a unit approach.
    punch: Grid,
}

impl Default for PressureState {
    fn default() -> Self {
        Self { resolution: Resolution::Fine, place: CellPlace::default(), forces: ZERO, q: ZERO, punch: ZERO }
    }
}

/// Memory of a solution.
#[derive(Clone, Debug)]
pub struct CellScratch {
    influence: Influence,
    solver: PressureScratch,
    heights: Heights,
    gap: Grid,
    /// Gaps over the roots `s` of the compliance.
    scaled: Grid,
    root: Grid,
    /// Slopes of the tool's height along both axes of the grid.
    slopes: [Grid; 2],
    image: Grid,
}

impl Default for CellScratch {
    fn default() -> Self {
        Self {
            influence: Influence::new(),
            solver: PressureScratch::new(),
            heights: Heights::default(),
            gap: ZERO,
            scaled: ZERO,
            root: ZERO,
            slopes: [ZERO; 2],
            image: ZERO,
        }
    }
}

/// State of a tool pressed into a half-space; vectors in the world's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellContact {
    /// Force on the tool, N.
    pub force: DVec3,
    /// Torque on the tool about its origin, N m.
    pub torque: DVec3,
    /// Sum of the pressures' normal forces, N.
    pub normal_force: f64,
    /// Point of the surface where their resultant acts, m.
    pub centre_of_pressure: DVec3,
    /// Normal stiffness `dF/dd` of the cells under pressure, N/m; cells at the rim count as whole, so it is up to 5 % too large
    /// (10 % with 8 x 8 cells).
    pub stiffness: f64,
    /// Stored energy, J.
    pub energy: f64,
    /// Its derivative by the problem's `width`, J/m.
    pub energy_by_width: f64,
    /// Area of the cells under pressure, m^2.
    pub area: f64,
    /// Largest overlap of the tool and the surface along the normal, m.
    pub overlap: f64,
    /// Gradient of the energy by the body's place, N.
    pub body_force: DVec3,
    /// Gradient of the energy by a rotation of the body about the plane's origin, N m.
    pub body_torque: DVec3,
    /// Derivative of the energy by the extents of a crest, J.
    pub energy_by_crest: DMat3,
    /// Convergence of the solution.
    pub convergence: Convergence,
}

impl CellProblem<'_> {
    /// Presses the tool into a surface. There is no contact unless the tool reaches below the plane.
    ///
    /// `state` is the start of the solution and is updated to its result; it changes the result by no more than [`TOLERANCE`].
    pub fn solve(&self, relief: &impl Relief, state: &mut PressureState, scratch: &mut CellScratch) -> CellContact {
        if state.resolution != self.resolution {
            *state = PressureState { resolution: self.resolution, ..Default::default() };
        }
        let Some(Overlap { tool, cells, largest }) = self.overlap(relief, scratch) else {
            return CellContact::default();
        };
        scratch.influence.set_aspect(cells.count, cells.sides[1] / cells.sides[0]);
        let edges = EdgeSoftening::new(&cells, self.width);
        scratch.soften(&cells, &edges);
        let convergence = scratch.solver.solve(&scratch.influence, cells.count, &scratch.scaled, largest, &mut state.q);
        let contact = scratch.integrate(&tool, &cells, &edges, &self.plane, &state.q);
        state.place = cells.place(&self.plane, self.pose.position);
        scratch.write_forces(cells.count, state);
        let punch = scratch.solver.punch(&scratch.influence, cells.count, &state.q, &mut state.punch);
        CellContact { stiffness: cells.force_scale * punch, overlap: largest, convergence, ..contact }
    }

    /// Largest overlap of the tool and the surface along the plane's normal, m.
    pub fn largest_overlap(&self, relief: &impl Relief, scratch: &mut CellScratch) -> f64 {
        self.overlap(relief, scratch).map_or(0.0, |overlap| overlap.largest)
    }

    /// Computes the gaps under the tool; `None` without any overlap.
    fn overlap(&self, relief: &impl Relief, scratch: &mut CellScratch) -> Option<Overlap<'_>> {
        let to_plane = self.plane.axes.transpose();
        let tool = ToolInSurfaceFrame {
            shape: self.shape,
            rotation: to_plane * DMat3::from_quat(self.pose.rotation),
            tip: to_plane * (self.pose.position - self.plane.origin),
            crest: to_plane * self.crest * self.plane.axes,
        };
        let depth = -tool.support(DVec3::NEG_Z).z;
        if !(depth > 0.0 && depth.is_finite()) {
            return None;
        }
        let rectangle = tool.within(tool.rectangle(), |direction, enough| {
            let end = relief.end(&self.plane, self.plane.axes * direction, (-depth, enough))?;
            Some((to_plane * (end.point - self.plane.origin), end.by_level))
        });
        let cells = Cells::new(rectangle, self.resolution.cells(), self.effective_modulus);
        if !(cells.sides[0] > 0.0 && cells.sides[1] > 0.0) {
            return None;
        }
        scratch.heights.clear();
        relief.fill(&cells.frame(&self.plane, depth), &mut scratch.heights);
        let largest = scratch.measure_gaps(&tool, &cells, depth);
        (largest > 0.0).then_some(Overlap { tool, cells, largest })
    }
}

/// A tool that overlaps a surface; the gaps are in the scratch memory.
struct Overlap<'a> {
    tool: ToolInSurfaceFrame<'a>,
    cells: Cells,
    /// Largest overlap with the surface, m.
    largest: f64,
}

/// Share of the additional compliance beside edges that the body's own compliance lacks.
///
/// Beside an edge a contact of radius `a` has an additional compliance `k/a`. The body's own compliance, spread over the radius
/// `b`, contains `k/b` of it. The remainder goes to zero as `a` approaches `b`. It is approximated by `(1 - a^2/b^2)^2`, whose slope goes to
/// zero too, with half the grid's diagonal for `a`.
#[derive(Default)]
struct EdgeSoftening {
    share: f64,
    /// Its derivatives by the cells' sides, and by `b`, 1/m.
    by_side: [f64; 2],
    by_width: f64,
}

impl EdgeSoftening {
    fn new(cells: &Cells, width: f64) -> Self {
        let scale = cells.count as f64 / (2.0 * width);
        let [x, y] = cells.sides.map(|side| side * scale);
        let left = 1.0 - x * x - y * y;
        if left.is_nan() || left <= 0.0 {
            return Self::default();
        }
        let by_side = [x, y].map(|side| -4.0 * left * side * scale);
        Self { share: left * left, by_side, by_width: 4.0 * left * (1.0 - left) / width }
    }
}

/// The grid of cells on the tangent plane, in the frame of the surface.
struct Cells {
    rectangle: Rectangle,
    /// Cells along each side.
    count: usize,
    /// Sides of a cell, m.
    sides: [f64; 2],
    /// `pi E* sqrt(hx hy)`, N/m: force of a cell over `q`.
    force_scale: f64,
}

impl Cells {
    fn new(rectangle: Rectangle, count: usize, effective_modulus: f64) -> Self {
        let sides = rectangle.sides.map(|[lower, upper]| (upper.coordinate - lower.coordinate) / count as f64);
        let force_scale = std::f64::consts::PI * effective_modulus * (sides[0] * sides[1]).sqrt();
        Self { rectangle, count, sides, force_scale }
    }

    /// The grid in the axes of the world.
    fn frame(&self, plane: &ContactPlane, depth: f64) -> GridFrame {
        let [along, across] = self.rectangle.axes;
        let [[left, _], [below, _]] = &self.rectangle.sides;
        GridFrame {
            origin: plane.origin,
            axes: DMat3::from_cols(plane.axes * along, plane.axes * across, plane.axes.z_axis),
            corner: [left.coordinate, below.coordinate],
            sides: self.sides,
            count: self.count,
            lowest: -depth,
        }
    }

    /// The grid in the axes of the world, relative to a point.
    fn place(&self, plane: &ContactPlane, origin: DVec3) -> CellPlace {
        let [along, across] = self.rectangle.axes;
        let [[left, _], [below, _]] = &self.rectangle.sides;
        let corner = left.coordinate * along + below.coordinate * across;
        CellPlace {
            corner: plane.origin + plane.axes * corner - origin,
            along: plane.axes * (along * self.sides[0]),
            across: plane.axes * (across * self.sides[1]),
            count: self.count,
        }
    }

    /// Middle of a cell, m.
    fn middle(&self, i: usize, j: usize) -> DVec3 {
        let [[left, _], [below, _]] = &self.rectangle.sides;
        let along = left.coordinate + (i as f64 + 0.5) * self.sides[0];
        let across = below.coordinate + (j as f64 + 0.5) * self.sides[1];
        along * self.rectangle.axes[0] + across * self.rectangle.axes[1]
    }
}

#[cfg(test)]
mod references;
#[cfg(test)]
mod tests;
