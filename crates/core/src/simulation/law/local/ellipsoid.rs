//! Wrench of an ellipsoid on an osculating surface: Hertz's ellipse, with the exact gradient of its energy.
//!
//! With `A = R E^2 R^T` (`E` the semi-axes) the plane of normal `n` that touches the ellipsoid is `h = sqrt(n.A n)` from its
//! centre and touches it at `-g = -A n/h`, where its radii of curvature are `H = (A - g g^T)/h`, restricted to the plane. A
//! small rotation changes `A` by `dtheta x A - A dtheta x`.

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::wrench::Pressed;
use crate::contact::local::cells::OsculatingSurface;
use crate::contact::local::indent_ellipse;

/// Relative curvatures are kept above about half this part of the ellipsoid's smallest: in a hollow as round as itself a tool
/// touches like a flatter one.
const CLOSEST_FIT: f64 = 0.02;

/// Presses an ellipsoid at `position`, turned by `rotation`.
pub fn press_ellipsoid(
    semi_axes: DVec3,
    (position, rotation): (DVec3, DMat3),
    surface: &OsculatingSurface,
    effective_modulus: f64,
) -> Pressed {
    let squares = rotation * DMat3::from_diagonal(semi_axes * semi_axes) * rotation.transpose();
    let [along, across, normal] = [surface.axes.x_axis, surface.axes.y_axis, surface.axes.z_axis];
    let towards = squares * normal;
    let height = normal.dot(towards).sqrt();
    let support = towards / height;
    let depth = height - (position - surface.origin).dot(normal);
    if !(depth > 0.0) {
        return Pressed::default();
    }
    let tangents = [along, across];
    let flat = DVec2::new(support.dot(along), support.dot(across));
    let entry = |a: DVec3, b: DVec3| (a.dot(squares * b) - support.dot(a) * support.dot(b)) / height;
    let [xx, xy, yy] = [entry(along, along), entry(along, across), entry(across, across)];
    let radii = DMat2::from_cols_array(&[xx, xy, xy, yy]);
    let tool = radii.inverse();
    let [k_xx, k_xy, k_yy] = surface.curvature;
    let relative = tool + DMat2::from_cols_array(&[k_xx, k_xy, k_xy, k_yy]);
    let (values, directions) = eigen(relative);
    let least = CLOSEST_FIT * semi_axes.min_element() / semi_axes.max_element().powi(2);
    let root = values.map(|value| value.hypot(least));
    let bounded = [0, 1].map(|k| 0.5 * (values[k] + root[k]));
    let contact = indent_ellipse(depth, bounded, effective_modulus);
    // Derivative of the energy by the matrix of relative curvatures.
    let mut by_relative = DMat2::ZERO;
    for k in 0..2 {
        let share = contact.energy_by_curvature[k] * 0.5 * (1.0 + values[k] / root[k]);
        let v = directions[k];
        by_relative += DMat2::from_cols(v * v.x, v * v.y) * share;
    }
    // And by the radii of curvature, with the sign turned.
    let by_radii = tool * by_relative * tool;
    let z = by_radii * flat;
    let turned = |a: DVec3, b: DVec3| (squares * b).cross(a);
    let mut turn = DVec3::ZERO;
    for (i, &a) in tangents.iter().enumerate() {
        for (j, &b) in tangents.iter().enumerate() {
            turn += turned(a, b) * (2.0 * by_radii.col(j)[i] / height);
        }
    }
    let z_world = along * z.x + across * z.y;
    turn -= (turned(z_world, normal) + turned(normal, z_world)) * (2.0 / (height * height));
    let traced = by_radii.x_axis.dot(radii.x_axis) + by_radii.y_axis.dot(radii.y_axis);
    let lean = support.cross(normal);
    turn += lean * (2.0 * flat.dot(z) / (height * height) - traced / height);
    Pressed {
        force: normal * contact.force,
        torque: turn - lean * contact.force,
        centre: position - support + normal * depth,
        normal_force: contact.force,
        radius: contact.radius,
        stiffness: contact.stiffness,
        energy: contact.energy,
        energy_by_curvature: [by_relative.x_axis.x, 2.0 * by_relative.x_axis.y, by_relative.y_axis.y],
    }
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix.
fn eigen(m: DMat2) -> ([f64; 2], [DVec2; 2]) {
    let (middle, half, off) = (0.5 * (m.x_axis.x + m.y_axis.y), 0.5 * (m.x_axis.x - m.y_axis.y), m.x_axis.y);
    let spread = half.hypot(off);
    let first = DVec2::from_angle(0.5 * off.atan2(half));
    ([middle + spread, middle - spread], [first, first.perp()])
}
