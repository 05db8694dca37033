//! Gaps under the cells, and the energy's gradient by the tool's pose.

use glam::DVec3;

use super::grid::ToolInSurfaceFrame;
use super::influence::Grid;
use super::pressure::dot;
use super::{CellContact, CellScratch, Cells, EdgeSoftening, PressureState};
use crate::contact::local::ContactPlane;

/// Least normal component of a tool's normal: its walls do not press along the normal.
const LEAST_NORMAL: f64 = 1e-3;

/// Derivatives of the energy by the positions of the cells, J/m.
#[derive(Default)]
struct ByPlace {
    /// By a shift of all along each axis.
    shift: [f64; 2],
    /// By the cells' sides.
    side: [f64; 2],
    /// By a rotation of all about the origin, J.
    turn: f64,
}

impl CellScratch {
    /// Gap between tool and surface in the middle of each cell, negative where they overlap and zero elsewhere, m; returns the
    /// largest overlap, m.
    pub(super) fn measure_gaps(&mut self, tool: &ToolInSurfaceFrame, cells: &Cells, depth: f64) -> f64 {
        let to_tool = tool.rotation.transpose();
        let upwards = to_tool * DVec3::Z;
        let axes = cells.rectangle.axes;
        let mut overlap = 0.0f64;
        for j in 0..cells.count {
            for i in 0..cells.count {
                let at = cells.middle(i, j);
                self.gap[j][i] = 0.0;
                // From the plane through the tool's lowest point.
                let origin = to_tool * (at.with_z(-depth) - tool.tip);
                let height = depth + self.heights.height[j][i];
                if height <= 0.0 {
                    continue;
                }
                let Some(entry) = tool.shape.line_entry(origin, upwards, height) else { continue };
                let normal = tool.rotation * entry.normal;
                let gap = entry.distance - height;
                if gap < 0.0 && normal.z < -LEAST_NORMAL {
                    self.gap[j][i] = gap;
                    overlap = overlap.max(-gap);
                    self.slopes[0][j][i] = -normal.dot(axes[0]) / normal.z;
                    self.slopes[1][j][i] = -normal.dot(axes[1]) / normal.z;
                }
            }
        }
        overlap
    }

    /// Scales gaps: with the compliance `s_i G_ij s_j` the forces are those of the half-space under gaps over `s`, over `s`.
    pub(super) fn soften(&mut self, cells: &Cells, edges: &EdgeSoftening) {
        for j in 0..cells.count {
            for i in 0..cells.count {
                let root = (1.0 + edges.share * self.heights.softening[j][i]).sqrt();
                self.root[j][i] = root;
                self.scaled[j][i] = self.gap[j][i] / root;
            }
        }
    }

    /// Writes the forces of the solution, up to a common factor.
    pub(super) fn write_forces(&self, count: usize, state: &mut PressureState) {
        for j in 0..count {
            for i in 0..count {
                state.forces[j][i] = state.q[j][i] / self.root[j][i];
            }
        }
    }

    /// Energy, wrench and their derivatives from the solution, whose residual must not have been overwritten.
    pub(super) fn integrate(
        &mut self,
        tool: &ToolInSurfaceFrame,
        cells: &Cells,
        edges: &EdgeSoftening,
        plane: &ContactPlane,
        q: &Grid,
    ) -> CellContact {
        let mut contact = CellContact::default();
        let mut by_place = ByPlace::default();
        let (mut work, mut moment) = (0.0, DVec3::ZERO);
        for j in 0..cells.count {
            for i in 0..cells.count {
                if q[j][i] <= 0.0 {
                    continue;
                }
                let root = self.root[j][i];
                let (force, gap) = (cells.force_scale * q[j][i] / root, self.gap[j][i]);
                let slopes = [self.slopes[0][j][i], self.slopes[1][j][i]];
                let at = cells.middle(i, j);
                let body_slopes = [self.heights.slopes[0][j][i], self.heights.slopes[1][j][i]];
                // A softer cell counts as one with a smaller gap.
                let by_softening = 0.5 * gap / (root * root);
                let by_share = force * by_softening * self.heights.softening[j][i];
                let softening = [0, 1].map(|k| by_softening * edges.share * self.heights.softening_slopes[k][j][i]);
                let gap_slopes = [0, 1].map(|k| slopes[k] - body_slopes[k] - softening[k]);
                (0..2).for_each(|k| by_place.side[k] += by_share * edges.by_side[k]);
                contact.energy_by_width += by_share * edges.by_width;
                by_place.add(cells, (at, gap_slopes), force, (i, j));
                (0..2).for_each(|k| by_place.side[k] += force * self.heights.by_side[k][j][i]);
                // A lift of the tool widens the gap by as much, a shift by the tool's slope times it.
                let [along, across] = cells.rectangle.axes;
                let push = force * (DVec3::Z - slopes[0] * along - slopes[1] * across);
                let height = self.heights.height[j][i];
                contact.force += push;
                contact.torque += (at.with_z(height + gap) - tool.tip).cross(push);
                contact.normal_force += force;
                let against = force * (DVec3::Z - body_slopes[0] * along - body_slopes[1] * across);
                let [u, v, w] = [0, 1, 2].map(|k| self.heights.surface_point[k][j][i]);
                contact.body_force += against;
                contact.body_torque += (along * u + across * v).with_z(w).cross(against);
                let aside = -force * (softening[0] * along + softening[1] * across);
                let [u, v, w] = [0, 1, 2].map(|k| self.heights.edge[k][j][i]);
                let turns = [0, 1].map(|k| force * by_softening * edges.share * self.heights.softening_turns[k][j][i]);
                contact.body_force += aside;
                contact.body_torque += (along * u + across * v).with_z(w).cross(aside);
                contact.body_torque += turns[0] * along + turns[1] * across;
                contact.area += cells.sides[0] * cells.sides[1];
                work -= force * gap;
                moment += force * at.with_z(height);
            }
        }
        let elastic = cells.force_scale * self.solver.energy(&self.scaled, q);
        contact.energy = work - 0.5 * elastic;
        self.add_influence(cells, q, elastic, &mut by_place);
        by_place.move_with_tool(tool, cells, &mut contact);
        if contact.normal_force > 0.0 {
            contact.centre_of_pressure = plane.origin + plane.axes * (moment / contact.normal_force);
        }
        for vector in [&mut contact.force, &mut contact.torque, &mut contact.body_force, &mut contact.body_torque] {
            *vector = plane.axes * *vector;
        }
        contact.energy_by_crest = plane.axes * contact.energy_by_crest * plane.axes.transpose();
        contact
    }

    /// The influence `T/(pi E* sqrt(hx hy))` changes with the cells' sides, by the root and by the aspect `hy/hx`.
    fn add_influence(&mut self, cells: &Cells, q: &Grid, elastic: f64, by_place: &mut ByPlace) {
        self.influence.product_by_aspect(cells.count, q, &mut self.image);
        let by_aspect = dot(q, &self.image) * 0.5 * cells.force_scale * cells.sides[1] / cells.sides[0];
        by_place.side[0] += (0.25 * elastic + by_aspect) / cells.sides[0];
        by_place.side[1] += (0.25 * elastic - by_aspect) / cells.sides[1];
    }
}

impl ByPlace {
    /// Adds a cell with the slopes of its gap at its middle `at`.
    fn add(&mut self, cells: &Cells, (at, gap_slopes): (DVec3, [f64; 2]), force: f64, (i, j): (usize, usize)) {
        let [along, across] = cells.rectangle.axes;
        let from_middle = [i, j].map(|k| k as f64 + 0.5 - 0.5 * cells.count as f64);
        for k in 0..2 {
            self.shift[k] -= force * gap_slopes[k];
            self.side[k] -= force * gap_slopes[k] * from_middle[k];
        }
        self.turn -= force * (gap_slopes[1] * at.dot(along) - gap_slopes[0] * at.dot(across));
    }

    /// The rectangle moves with the tool: its sides with the supports below, its angle with the long axis.
    fn move_with_tool(&self, tool: &ToolInSurfaceFrame, cells: &Cells, contact: &mut CellContact) {
        let [along, across] = cells.rectangle.axes;
        // Derivatives of both axes by the angle.
        let rotated_axes = [across, -along];
        let mut by_angle = self.turn;
        for k in 0..2 {
            let by_side = self.side[k] / cells.count as f64;
            for (side, share) in cells.rectangle.sides[k].iter().zip([-by_side, by_side]) {
                let share = 0.5 * self.shift[k] + share;
                contact.force -= share * side.gradient;
                contact.torque -= share * (side.support - tool.tip).cross(side.gradient);
                contact.body_force += share * side.by_surface;
                contact.body_torque += share * side.point.cross(side.by_surface);
                by_angle += share * side.point.dot(rotated_axes[k]);
            }
        }
        let [by_tool, by_surface] = cells.rectangle.angle_by_rotation;
        contact.torque -= by_angle * by_tool;
        contact.body_torque += by_angle * by_surface;
        contact.energy_by_crest = cells.rectangle.angle_by_crest * by_angle;
    }
}
