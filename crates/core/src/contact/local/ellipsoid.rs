//! An ellipsoid, or a sphere, on a smooth surface: Hertz's ellipse at its lowest point, with the wrench of one energy.
//!
//! With `A = Q diag(e^2) Q^T` for the semi-axes `e` along the columns of `Q`, and the normal `n`, the lowest point lies
//! `-A n/h` from the centre, `h^2 = n.A n`. There the ellipsoid's height has the second derivative `h A^-1`, restricted to the
//! tangent plane. With the body's curvatures `B` the gap is
//!
//! ```text
//! z_0 + x_0.B x_0/2 + x_0.B x + x.K x/2        K = h A^-1 + B,    x counted from the lowest point x_0
//! ```
//!
//! least at `x = -y`, `K y = B x_0`. Approach and `K` give the energy `U(d, K)`; all that the pose changes follows from the
//! derivatives of `A`, which turns with the ellipsoid.

use glam::{DMat2, DMat3, DVec2, DVec3, Vec3Swizzles};

use super::ellipse::{EllipseContact, indent_ellipse};
use super::place::{OsculatingSurface, ToolPose};
use crate::contact::shape::ellipsoid::symmetric_eigen;

/// Least ratio of the principal values of `K` at which the place of the least gap is looked for: in a hollow that is nearly
/// as narrow as the tool the gap is taken at the lowest point.
const LEAST_RATIO: f64 = 1e-2;

/// An ellipsoid at a place.
#[derive(Clone, Copy, Debug)]
pub struct EllipsoidProblem {
    /// Half its lengths along its own axes, m; all equal for a sphere.
    pub semi_axes: DVec3,
    /// Where it is.
    pub pose: ToolPose,
    /// What it touches.
    pub surface: OsculatingSurface,
    /// `E*`, Pa.
    pub effective_modulus: f64,
}

/// State of an ellipsoid pressed into a half-space; vectors in the world's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EllipsoidContact {
    /// Force on the tool, N.
    pub force: DVec3,
    /// Torque on the tool about its centre, N m.
    pub torque: DVec3,
    /// Middle of the contact on the surface, m.
    pub centre_of_pressure: DVec3,
    /// The approach along the normal, m.
    pub approach: f64,
    /// Normal force, stiffness, energy and the ellipse.
    pub indentation: EllipseContact,
    /// Directions of the ellipse's semi-axes.
    pub directions: [DVec3; 2],
    /// Derivative of the energy with respect to each curvature of the surface, J m.
    pub energy_by_curvature: [f64; 3],
}

/// The ellipsoid over the tangent plane, in the frame of the surface.
struct Lowest {
    /// `A` and its inverse.
    squares: DMat3,
    inverse: DMat3,
    height: f64,
    /// The lowest point from the centre, m.
    point: DVec3,
    /// Curvatures of the ellipsoid there.
    curvature: DMat2,
}

impl Lowest {
    fn new(semi_axes: DVec3, rotation: DMat3) -> Self {
        let square = semi_axes * semi_axes;
        let squares = rotation * DMat3::from_diagonal(square) * rotation.transpose();
        let inverse = rotation * DMat3::from_diagonal(square.recip()) * rotation.transpose();
        let height = squares.z_axis.z.sqrt();
        Self {
            squares,
            inverse,
            height,
            point: -squares.z_axis / height,
            curvature: DMat2::from_mat3(inverse) * height,
        }
    }

    /// Derivatives of the lowest point and of the curvatures by a rotation about an axis through the centre.
    fn turned(&self, axis: DVec3) -> (DVec3, DMat2) {
        let [squares, inverse] = [self.squares, self.inverse].map(|m| {
            let half = DMat3::from_cols(axis.cross(m.x_axis), axis.cross(m.y_axis), axis.cross(m.z_axis));
            half + half.transpose()
        });
        let height = 0.5 * squares.z_axis.z / self.height;
        let point = -(squares.z_axis + self.point * height) / self.height;
        (point, DMat2::from_mat3(self.inverse) * height + DMat2::from_mat3(inverse) * self.height)
    }
}

impl EllipsoidProblem {
    /// Presses the ellipsoid into the surface.
    pub fn solve(&self) -> EllipsoidContact {
        let to_surface = self.surface.axes.transpose();
        let lowest = Lowest::new(self.semi_axes, to_surface * DMat3::from_quat(self.pose.rotation));
        let point = to_surface * (self.pose.position - self.surface.origin) + lowest.point;
        let [xx, xy, yy] = self.surface.curvature;
        let body = DMat2::from_cols_array(&[xx, xy, xy, yy]);
        let relative = lowest.curvature + body;
        let (curvatures, direction) = symmetric_eigen(relative);
        if curvatures[0].is_nan() || curvatures[0] <= 0.0 {
            return EllipsoidContact::default();
        }
        let seeks = curvatures[1] > LEAST_RATIO * curvatures[0];
        let aside = if seeks { relative.inverse() * (body * point.xy()) } else { DVec2::ZERO };
        let centre = point.xy() - aside;
        // The least gap: at the lowest point, less what the surface rises from there to the middle of the contact.
        let approach = self.surface.height(point) - point.z + 0.5 * aside.dot(body * point.xy());
        let indentation = indent_ellipse(approach, curvatures, self.effective_modulus);
        let force = indentation.force;
        if force == 0.0 {
            return EllipsoidContact { approach, ..EllipsoidContact::default() };
        }
        let [large, small] = indentation.energy_by_curvature;
        let across = direction.perp();
        let by_relative = outer(direction) * large + outer(across) * small;
        // Derivatives of the energy by the lowest point, and by the relative curvatures through the approach as well.
        let slope = self.surface.slope(centre.extend(0.0));
        let by_point = force * (if seeks { slope } else { self.surface.slope(point) } - DVec3::Z);
        let by_curvature = by_relative - outer(aside) * (0.5 * force);
        let by_turn = |axis: DVec3| {
            let (point, curvature) = lowest.turned(axis);
            by_point.dot(point) + by_curvature.x_axis.dot(curvature.x_axis) + by_curvature.y_axis.dot(curvature.y_axis)
        };
        let by_body = by_relative - outer(centre) * (0.5 * force);
        let axes = self.surface.axes;
        let place = centre.extend(0.0);
        EllipsoidContact {
            force: -(axes * by_point),
            torque: -(axes * DVec3::from_array(DVec3::AXES.map(by_turn))),
            centre_of_pressure: self.surface.origin + axes * place.with_z(self.surface.height(place)),
            approach,
            indentation,
            directions: [direction, across].map(|d| axes * d.extend(0.0)),
            energy_by_curvature: [by_body.x_axis.x, 2.0 * by_body.x_axis.y, by_body.y_axis.y],
        }
    }
}

/// `v v^T`.
fn outer(v: DVec2) -> DMat2 {
    DMat2::from_cols(v * v.x, v * v.y)
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, EulerRot};

    use super::*;
    use crate::contact::local::cells::{CellProblem, CellScratch, PressureState, Resolution};
    use crate::contact::local::indent_sphere;
    use crate::contact::shape::ToolShape;

    const MODULUS: f64 = 12.5e3;
    const SEMI_AXES: DVec3 = DVec3::new(0.012, 0.006, 0.005);

    /// An ellipsoid turned by angles, near the point of the surface it touches.
    fn pressed(semi_axes: DVec3, angles: DVec3, depth: f64, curvature: [f64; 3]) -> EllipsoidProblem {
        let rotation = DQuat::from_euler(EulerRot::XYZ, angles.x, angles.y, angles.z);
        let lowest = Lowest::new(semi_axes, DMat3::from_quat(rotation)).point;
        let position = DVec3::new(4e-4, -3e-4, -depth) - lowest;
        EllipsoidProblem {
            semi_axes,
            pose: ToolPose { position, rotation },
            surface: OsculatingSurface { origin: DVec3::ZERO, axes: DMat3::IDENTITY, curvature },
            effective_modulus: MODULUS,
        }
    }

    fn problems() -> Vec<EllipsoidProblem> {
        let mut problems = Vec::new();
        for curvature in [[0.0; 3], [20.0, 5.0, 10.0], [-15.0, 0.0, 30.0]] {
            for angles in [DVec3::ZERO, DVec3::new(0.3, 0.2, 0.5), DVec3::new(1.2, -0.7, 2.0)] {
                for depth in [2e-4, 1e-3] {
                    problems.push(pressed(SEMI_AXES, angles, depth, curvature));
                    problems.push(pressed(DVec3::splat(0.008), angles, depth, curvature));
                }
            }
        }
        problems
    }

    #[test]
    fn the_wrench_is_the_gradient_of_the_energy() {
        for problem in problems() {
            let contact = problem.solve();
            let energy = |shift: DVec3, turn: DVec3| {
                let position = problem.pose.position + shift;
                let rotation = DQuat::from_scaled_axis(turn) * problem.pose.rotation;
                EllipsoidProblem { pose: ToolPose { position, rotation }, ..problem }.solve().indentation.energy
            };
            let (h, angle, none) = (1e-8, 1e-6, DVec3::ZERO);
            let force = DVec3::AXES.map(|e| (energy(-h * e, none) - energy(h * e, none)) / (2.0 * h));
            let torque = DVec3::AXES.map(|e| (energy(none, -angle * e) - energy(none, angle * e)) / (2.0 * angle));
            let scale = contact.force.length();
            assert!(DVec3::from_array(force).distance(contact.force) < 1e-6 * scale, "{problem:?} {contact:?}");
            assert!(
                DVec3::from_array(torque).distance(contact.torque) < 1e-6 * scale * 0.006,
                "{problem:?} {contact:?}"
            );
            for k in 0..3 {
                let energy = |by: f64| {
                    let mut moved = problem;
                    moved.surface.curvature[k] += by;
                    moved.solve().indentation.energy
                };
                let difference = (energy(1e-4) - energy(-1e-4)) / 2e-4;
                let error = (difference - contact.energy_by_curvature[k]).abs();
                assert!(error < 1e-6 * contact.indentation.energy * 0.01, "{k} {difference} {contact:?}");
            }
        }
    }

    /// Cells solve the same contact without Hertz's assumptions.
    #[test]
    fn cells_agree() {
        for problem in problems() {
            let told = problem.solve();
            let shape = ToolShape::ellipsoid(problem.semi_axes).unwrap();
            let cells = CellProblem {
                shape: &shape,
                pose: problem.pose,
                surface: problem.surface,
                effective_modulus: MODULUS,
                resolution: Resolution::Fine,
            };
            let cells = cells.solve(&mut PressureState::default(), &mut CellScratch::default());
            let scale = told.force.length();
            assert!(cells.force.distance(told.force) < 0.05 * scale, "{problem:?} {} {}", cells.force, told.force);
            assert!(cells.torque.distance(told.torque) < 0.05 * scale * 0.006, "{} {}", cells.torque, told.torque);
            let apart = cells.centre_of_pressure.distance(told.centre_of_pressure);
            assert!(apart < 0.15 * told.indentation.radius, "{apart}");
        }
    }

    #[test]
    fn equal_semi_axes_are_a_sphere() {
        for angles in [DVec3::ZERO, DVec3::new(0.3, 0.2, 0.5)] {
            // A sphere on a sphere, met straight below its centre.
            let mut problem = pressed(DVec3::splat(0.008), angles, 1e-3, [40.0, 0.0, 40.0]);
            problem.pose.position = DVec3::Z * 0.007;
            let (contact, sphere) = (problem.solve(), indent_sphere(1e-3, 1.0 / 165.0, MODULUS));
            assert!(contact.force.distance(DVec3::Z * sphere.force) < 1e-12 * sphere.force);
            assert!(contact.torque.length() < 1e-14 * sphere.force);
        }
    }

    #[test]
    fn nothing_touches_from_outside() {
        for depth in [-1e-3, f64::NAN] {
            let contact = pressed(SEMI_AXES, DVec3::new(0.3, 0.2, 0.5), depth, [20.0, 5.0, 10.0]).solve();
            assert_eq!((contact.force, contact.indentation.energy), (DVec3::ZERO, 0.0));
        }
    }
}
