//! Pressures of contacts on the taxels of a tool.
//!
//! Taxels lie on a rectangle in the plane z = 0 of the tool's frame and look along -z, to where capsule and punch have their front.
//! A taxel reads the normal force of the surface that it covers, seen along z, over its own area: facing the surface that is the
//! mean pressure, and forces are conserved whatever the inclination.

use glam::{DMat3, DVec3};

use super::contacts::Contact;
use super::model::Model;
use super::state::State;
use super::tool::LawKind;
use crate::contact::local::SpherePressure;
use crate::contact::local::cells::{MAX_CELLS, PressureState};
use crate::contact::shape::ToolShape;

/// Least cosine of the angle between a contact's normal and the tool's axis: what is seen more obliquely is left out.
const LEAST_COSINE: f64 = 0.1;
/// Points along each side of a pressure cell, by which its force is shared among the taxels.
const POINTS: usize = 4;

/// Taxels of a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelGrid {
    /// Along the tool's y and x.
    pub rows: usize,
    /// Along the tool's x.
    pub columns: usize,
    /// Width (along x) and height (along y) of the whole rectangle, whose middle is the tool's axis, m.
    pub sides: [f64; 2],
}

impl TaxelGrid {
    fn area(&self) -> f64 {
        self.sides[0] * self.sides[1] / (self.rows * self.columns) as f64
    }

    fn row(&self, rank: usize) -> f64 {
        self.sides[1] * (rank as f64 / self.rows as f64 - 0.5)
    }

    fn column(&self, rank: usize) -> f64 {
        self.sides[0] * (rank as f64 / self.columns as f64 - 0.5)
    }

    /// Index of the taxel over a point of the tool's frame.
    fn taxel(&self, point: DVec3) -> Option<usize> {
        let rank = |at: f64, side: f64, count: usize| {
            let rank = (at / side + 0.5) * count as f64;
            (rank >= 0.0 && rank < count as f64).then_some(rank as usize)
        };
        let (row, column) = (rank(point.y, self.sides[1], self.rows)?, rank(point.x, self.sides[0], self.columns)?);
        Some(row * self.columns + column)
    }
}

impl State {
    /// Adds the normal pressures of a tool's contacts under the local law, Pa, to taxels in rows, columns fastest.
    pub fn add_pressures(&self, model: &Model, tool: usize, grid: &TaxelGrid, pressures: &mut [f64]) {
        for slot in (0..self.contacts.slots.len()).filter(|&slot| {
            let contact = &self.contacts.slots[slot];
            contact.tool == tool && contact.law == LawKind::LOCAL && contact.force != DVec3::ZERO
        }) {
            let contact = &self.contacts.slots[slot];
            match (&model.tools[tool].shape, self.pressures.get(slot)) {
                (&ToolShape::Sphere { radius }, _) => add_sphere(contact, radius, grid, pressures),
                (_, Some(cells)) => add_cells(contact, cells, grid, pressures),
                _ => {}
            }
        }
    }
}

/// Normal force of a contact, N, and the axes of the body in the tool's frame.
fn seen_by_tool(contact: &Contact) -> Option<(f64, DMat3, DVec3)> {
    let tool_from_body = DMat3::from_quat(contact.local.orientation).transpose();
    let normal = tool_from_body * contact.normal;
    let force = -contact.force.dot(contact.normal);
    (normal.z >= LEAST_COSINE && force > 0.0).then_some((force, tool_from_body, normal))
}

fn add_sphere(contact: &Contact, radius: f64, grid: &TaxelGrid, pressures: &mut [f64]) {
    let Some((force, tool_from_body, normal)) = seen_by_tool(contact) else { return };
    if contact.radius.is_nan() || contact.radius <= 0.0 {
        return;
    }
    let middle = tool_from_body * (contact.local.foot.position - contact.local.relative_position);
    let pressure = SpherePressure::new(middle, normal, contact.radius, (contact.radius / radius).min(1.0));
    let scale = force / grid.area();
    let edges = (0..=grid.columns).map(|rank| grid.column(rank));
    for row in 0..grid.rows {
        let of_row = &mut pressures[row * grid.columns..][..grid.columns];
        let sides = [grid.row(row), grid.row(row + 1)];
        pressure.row(sides, edges.clone(), |column, share| of_row[column] += scale * share);
    }
}

fn add_cells(contact: &Contact, cells: &PressureState, grid: &TaxelGrid, pressures: &mut [f64]) {
    let Some((force, tool_from_body, _)) = seen_by_tool(contact) else { return };
    let PressureState { place, forces, .. } = cells;
    let all: f64 = forces.iter().flatten().sum();
    if all.is_nan() || all <= 0.0 {
        return;
    }
    let [corner, along, across] = [place.corner, place.along, place.across].map(|vector| tool_from_body * vector);
    let scale = force / (all * grid.area() * (POINTS * POINTS) as f64);
    let within = |k: usize| (k as f64 + 0.5) / POINTS as f64;
    for (j, row) in forces.iter().enumerate().take(place.count.min(MAX_CELLS)) {
        for (i, &of_cell) in row.iter().enumerate().take(place.count).filter(|(_, force)| **force > 0.0) {
            for k in 0..POINTS * POINTS {
                let point = corner + along * (i as f64 + within(k % POINTS)) + across * (j as f64 + within(k / POINTS));
                if let Some(taxel) = grid.taxel(point) {
                    pressures[taxel] += scale * of_cell;
                }
            }
        }
    }
}
