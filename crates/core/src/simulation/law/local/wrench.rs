//! A tool of any shape on the smooth surface: the gradient of its energy by the tool's pose.
//!
//! The surface around the foot `x` is taken as its osculating surface: a frame and curvatures that follow the foot. A tool on a
//! half-space (an ellipsoid, or cells) gives the energy `U`, its wrench on the tool `F`, `M` about `x`, and its derivatives
//! `e_ab` by the curvatures. As `U` does not change where tool and surface move together,
//!
//! ```text
//! dU = -F.dp - M_p.dtheta + F.dx + dw.M + e_ab dk_ab + (U/E*) dE*        dw = n x dn
//! ```
//!
//! with `dk_ab` of the blended curvature tensor, whose components change with the frame as well.

use glam::{DMat3, DQuat, DVec3};

use super::contact::LocalContact;
use super::met::{Fields, HalfSpace, Indentation, LocalBody, LocalTool};
use super::reference::Reference;
use crate::contact::local::cells::{CellProblem, CellScratch, PressureState, Resolution};
use crate::contact::local::{EllipsoidProblem, OsculatingSurface, ToolPose};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{FanWeights, FootPoint};

/// A tool pressed into an osculating surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pressed {
    /// Force on the tool, N, and torque about the place that it was pressed at, N m.
    pub force: DVec3,
    pub torque: DVec3,
    /// Centre of pressure, m.
    pub centre: DVec3,
    pub normal_force: f64,
    /// Radius of the circle of the same stiffness, m.
    pub radius: f64,
    pub stiffness: f64,
    pub energy: f64,
    pub energy_by_curvature: [f64; 3],
}

/// What pressure cells need beside the shape.
pub struct Cells<'a> {
    /// Where the solution starts, and what it leaves for the next.
    pub state: &'a mut PressureState,
    pub scratch: &'a mut CellScratch,
    pub resolution: Resolution,
}

/// Whether a shape has no closed form.
pub fn takes_cells(shape: &ToolShape) -> bool {
    !matches!(shape, ToolShape::Sphere { .. } | ToolShape::Ellipsoid { .. })
}

/// Energy of a tool at `place` over the foot of its reference point, and its gradient.
pub fn indent_shape(
    body: LocalBody<'_>,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    place: DVec3,
    (foot, reference): (&FootPoint, &Reference),
    (weights, fields): (&FanWeights, &Fields),
    cells: Cells<'_>,
) -> Indentation {
    let fans = body.smooth.fans();
    let half_space = HalfSpace::new(body, tool, fields, contact.part);
    let (surface, curvature) = osculating_surface(body, foot, weights);
    // What it began with counts as if the tool were not so deep.
    let position = place + foot.normal * contact.entry;
    let pressed = press(tool.shape, (position, contact.orientation), &surface, half_space.modulus, cells);
    let moment = pressed.torque + (position - surface.origin).cross(pressed.force);
    let [along, across, normal] = [surface.axes.x_axis, surface.axes.y_axis, surface.axes.z_axis];
    let [xx, xy, yy] = pressed.energy_by_curvature;
    let (bent_along, bent_across) = (curvature * along, curvature * across);
    let spin = 2.0 * (xx * along.cross(bent_along) + yy * across.cross(bent_across))
        + xy * (across.cross(bent_along) + along.cross(bent_across));
    let by_normal = (moment + spin).cross(normal) - pressed.force * contact.entry;
    let mut by_reference = foot.shift.transpose() * pressed.force + foot.turning.transpose() * by_normal;
    for (fan, _, gradient) in weights.with_gradients() {
        let own = fans[fan].curvature;
        let bent = own * along;
        by_reference += gradient * (xx * along.dot(bent) + xy * across.dot(bent) + yy * across.dot(own * across));
    }
    by_reference += half_space.slope * (pressed.energy / half_space.modulus);
    let (by_place, by_rotation) = reference.by_pose(by_reference);
    Indentation {
        force: pressed.normal_force,
        radius: pressed.radius,
        stiffness: pressed.stiffness,
        energy: pressed.energy,
        gradient: by_place - pressed.force,
        torque: pressed.torque - by_rotation,
        lever: pressed.centre - place,
        tangential: half_space.tangential,
    }
}

fn press(
    shape: &ToolShape,
    (position, orientation): (DVec3, DQuat),
    surface: &OsculatingSurface,
    effective_modulus: f64,
    cells: Cells<'_>,
) -> Pressed {
    let (pose, surface) = (ToolPose { position, rotation: orientation }, *surface);
    if let ToolShape::Ellipsoid { semi_axes } = *shape {
        let contact = EllipsoidProblem { semi_axes, pose, surface, effective_modulus }.solve();
        return Pressed {
            force: contact.force,
            torque: contact.torque,
            centre: contact.centre_of_pressure,
            normal_force: contact.indentation.force,
            radius: contact.indentation.radius,
            stiffness: contact.indentation.stiffness,
            energy: contact.indentation.energy,
            energy_by_curvature: contact.energy_by_curvature,
        };
    }
    let problem = CellProblem { shape, pose, surface, effective_modulus, resolution: cells.resolution };
    let contact = problem.solve(cells.state, cells.scratch);
    Pressed {
        force: contact.force,
        torque: contact.torque,
        centre: contact.centre_of_pressure,
        normal_force: contact.normal_force,
        radius: contact.stiffness / (2.0 * effective_modulus),
        stiffness: contact.stiffness,
        energy: contact.energy,
        energy_by_curvature: contact.energy_by_curvature,
    }
}

/// The osculating surface at a foot, and the blended curvature tensor that it has its curvatures from.
fn osculating_surface(body: LocalBody<'_>, foot: &FootPoint, weights: &FanWeights) -> (OsculatingSurface, DMat3) {
    let mut curvature = DMat3::ZERO;
    for (fan, weight) in weights.iter() {
        curvature += body.smooth.fans()[fan].curvature * weight;
    }
    let along = foot.normal.any_orthonormal_vector();
    let across = foot.normal.cross(along);
    let components = [along.dot(curvature * along), along.dot(curvature * across), across.dot(curvature * across)];
    let axes = DMat3::from_cols(along, across, foot.normal);
    (OsculatingSurface { origin: foot.position, axes, curvature: components }, curvature)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::local::effective_modulus;
    use crate::contact::regular::{PLANE_STRAIN, POISSON};
    use crate::contact::smooth::tests::{ball, near};
    use crate::contact::smooth::{DrawnSurface, SmoothSurface};
    use crate::contact::{FanFields, SurfaceQuery};
    use crate::mesh::Surface;

    /// A ball of radius 1 whose modulus rises by a half from one pole to the other.
    struct Ball {
        surface: Surface,
        query: SurfaceQuery,
        smooth: SmoothSurface,
        fields: Vec<FanFields>,
    }

    impl Ball {
        fn new() -> Self {
            let surface = ball(24);
            let query = SurfaceQuery::new(&surface).expect("triangles");
            let smooth = SmoothSurface::new(&surface);
            let modulus = |z: f64| 1e4 * (1.0 + 0.25 * z) / (1.0 - 0.45 * 0.45);
            let fields = smooth.fans().iter().map(|fan| {
                let mut fields = FanFields::default();
                (fields[PLANE_STRAIN], fields[POISSON]) = (modulus(fan.position.z), 0.45);
                fields
            });
            Self { fields: fields.collect(), smooth, query, surface }
        }

        fn press(&self, shape: &ToolShape, place: DVec3, orientation: DQuat) -> Indentation {
            let drawn = DrawnSurface { surface: &self.surface, query: &self.query };
            let body = LocalBody { drawn, smooth: &self.smooth, fields: &self.fields, scale: 1.0 };
            let contact = LocalContact { orientation, entry: 0.003, part: 1.0, ..LocalContact::default() };
            let tool = LocalTool { shape, radius: shape.bounding_radius(), pad: None, coefficient: 0.0 };
            let rotation = DMat3::from_quat(orientation);
            let centre = place + rotation * shape.centre();
            let mut weights = FanWeights::new(near(&self.smooth));
            let from = self.smooth.foot_anywhere(drawn, centre, &mut weights.near).expect("a foot");
            let met = (&self.smooth, drawn);
            let found = Reference::find(met, shape, (place, rotation), &from, &mut weights.near);
            let (foot, reference) = found.expect("a foot");
            self.smooth.weigh(&foot, &mut weights);
            let fields = weights.blend(&self.fields);
            let (mut state, mut scratch) = (PressureState::default(), CellScratch::default());
            let cells = Cells { state: &mut state, scratch: &mut scratch, resolution: Resolution::Medium };
            indent_shape(body, tool, &contact, place, (&foot, &reference), (&weights, &fields), cells)
        }
    }

    /// Differences of the energy over small motions and rotations are what force and torque say.
    fn check(shape: &ToolShape, out: f64, tolerance: f64) {
        let ball = Ball::new();
        for k in 0..6 {
            let turn = f64::from(k);
            let orientation = DQuat::from_euler(glam::EulerRot::XYZ, 0.25 * turn.sin(), 0.25 * turn.cos(), turn);
            let towards = DVec3::new(0.3 * (2.0 * turn).cos(), 0.3 * (2.0 * turn).sin(), 1.0).normalize();
            let lean = DQuat::from_rotation_arc(DVec3::Z, towards);
            let (place, orientation) = (out * towards, lean * orientation);
            let told = ball.press(shape, place, orientation);
            assert!(told.force > 0.0);
            let h = 1e-4;
            for axis in DVec3::AXES {
                let [ahead, behind] = [h, -h].map(|h| ball.press(shape, place + h * axis, orientation).energy);
                let difference = (ahead - behind) / (2.0 * h);
                let miss = (difference - told.gradient.dot(axis)).abs() / told.force;
                assert!(miss < tolerance, "force {miss:e} at {k}");
                let turned = |h: f64| DQuat::from_scaled_axis(h * axis) * orientation;
                let [ahead, behind] = [h, -h].map(|h| ball.press(shape, place, turned(h)).energy);
                let difference = (ahead - behind) / (2.0 * h);
                let miss = (difference + told.torque.dot(axis)).abs() / told.force;
                assert!(miss < tolerance, "torque {miss:e} at {k}");
            }
        }
    }

    #[test]
    fn wrench_of_an_ellipsoid_is_the_gradient_of_its_energy() {
        check(&ToolShape::ellipsoid(DVec3::new(0.2, 0.15, 0.1)).expect("a shape"), 1.07, 1e-5);
    }

    #[test]
    fn wrench_of_a_punch_is_the_gradient_of_its_energy() {
        check(&ToolShape::punch(0.1, 0.03).expect("a shape"), 0.97, 1e-4);
    }

    #[test]
    fn wrench_of_a_capsule_is_the_gradient_of_its_energy() {
        check(&ToolShape::capsule(0.1, 0.1).expect("a shape"), 1.08, 1e-4);
    }

    /// Round, it is the sphere of the closed form on the same curvatures.
    #[test]
    fn a_round_ellipsoid_is_a_sphere() {
        let ball = Ball::new();
        let round = ToolShape::ellipsoid(DVec3::splat(0.2)).expect("a shape");
        let told = ball.press(&round, DVec3::Z * 1.18, DQuat::from_rotation_x(0.7));
        // The relative radius is 1/(5 + 1), the depth 0.02 less what it began with.
        let modulus = effective_modulus(1.25e4, 0.45, None);
        let sphere = crate::contact::local::indent_sphere(0.017, 1.0 / 6.0, modulus);
        assert!((told.force / sphere.force - 1.0).abs() < 0.02, "{} {}", told.force, sphere.force);
        assert!(told.torque.length() < 1e-3 * told.force * 0.2);
    }
}
