//! Wrench of a tool that is not a sphere: the gradient of its energy by the tool's pose.
//!
//! Cells on the plane of the contact (origin `o`, normal `n`) give the energy `U`, its wrench on the tool `F`, `M` about `o`, and
//! that on the body, `B`, `N`. As `U` does not change where tool, body and plane move together,
//!
//! ```text
//! dU = -F.dp - M_p.dtheta + (F - B).do + (n x dn).(M - N) + (U/E*) dE*
//! ```
//!
//! where `o` and `n` follow the tool's pose (`contact::footprint`).

use glam::{DMat3, DQuat, DVec3};

use super::half_space::{HalfSpace, Indentation, LocalTool};
use super::shape_strain::correct_shape;
use crate::contact::Tessellation;
use crate::contact::footprint::{Footprint, FootprintScratch, NearPieces, NearRelief, PlacedShape};
use crate::contact::local::cells::{CellProblem, CellScratch, PressureState, Resolution};
use crate::contact::local::{ContactPlane, ToolPose};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::FanWeights;
use crate::simulation::contacts::LocalContact;

/// State and memory of pressure cells, and their resolution.
pub struct CellMemory<'a> {
    /// Start of the solution, updated to its result.
    pub state: &'a mut PressureState,
    pub scratch: &'a mut CellScratch,
    pub footprint: &'a mut FootprintScratch,
    pub resolution: Resolution,
    /// Weights of the fans for a share of a sphere's contact.
    pub corner_weights: &'a mut FanWeights,
}

/// The shape of a tool as it is pressed: lifted by the approach at which the contact began.
pub fn placed_shape<'a>(shape: &'a ToolShape, contact: &LocalContact, place: DVec3) -> PlacedShape<'a> {
    let contact_normal = contact.foot.normal;
    PlacedShape {
        shape,
        position: place + contact_normal * contact.entry_depth,
        rotation: DMat3::from_quat(contact.orientation),
        contact_normal,
        penetration: contact.penetration,
    }
}

/// Largest overlap of a tool and the body over a footprint, along its normal, m. It is less than the depth below the plane, which
/// is as high as the highest piece next to the tool.
pub fn largest_overlap(
    fine: &Tessellation,
    (shape, place, rotation): (&ToolShape, DVec3, DQuat),
    footprint: &Footprint,
    near: &NearPieces,
    scratch: &mut CellScratch,
) -> f64 {
    let problem = CellProblem {
        shape,
        pose: ToolPose { position: place, rotation },
        plane: ContactPlane::new(footprint.origin, footprint.normal),
        crest: crest_extents(footprint),
        // The gaps do not depend on these.
        effective_modulus: 1.0,
        width: 1.0,
        resolution: Resolution::Fine,
    };
    problem.largest_overlap(&NearRelief { near, fine }, scratch)
}

/// Energy of a tool at `place` over its footprint, and its gradient, given the gradients by rotation of `E*`, Pa, and of the width,
/// m.
pub fn indent_shape(
    fine: &Tessellation,
    tool: LocalTool<'_>,
    contact: &LocalContact,
    place: DVec3,
    footprint: &Footprint,
    (half_space, [modulus_by_rotation, width_by_rotation]): (&HalfSpace, [DVec3; 2]),
    cells: CellMemory<'_>,
) -> Indentation {
    let normal = footprint.normal;
    let position = place + normal * contact.entry_depth;
    let problem = CellProblem {
        shape: tool.shape,
        pose: ToolPose { position, rotation: contact.orientation },
        plane: ContactPlane::new(footprint.origin, normal),
        crest: crest_extents(footprint),
        effective_modulus: half_space.modulus,
        resolution: cells.resolution,
        width: half_space.width,
    };
    let relief = NearRelief { near: &cells.footprint.near, fine };
    let pressed = problem.solve(&relief, cells.state, cells.scratch);
    let moment = pressed.torque + (position - footprint.origin).cross(pressed.force);
    let by_origin = pressed.force - pressed.body_force;
    let by_normal = (moment - pressed.body_torque).cross(normal) - pressed.force * contact.entry_depth;
    let stiffer = pressed.energy / half_space.modulus;
    let [by_place, by_rotation] =
        [0, 1].map(|k| footprint.origin_by[k].transpose() * by_origin + footprint.normal_by[k].transpose() * by_normal);
    let by_crest = footprint.crest.map(|crest| cells.footprint.crest_by(&crest, &pressed.energy_by_crest));
    let by_crest = by_crest.unwrap_or_default();
    let linear = Indentation {
        force: pressed.normal_force,
        material: half_space.material,
        depth: pressed.overlap,
        radius: pressed.stiffness / (2.0 * half_space.modulus),
        stiffness: pressed.stiffness,
        energy: pressed.energy,
        gradient: by_place - pressed.force
            + half_space.slope * stiffer
            + half_space.width_slope * pressed.energy_by_width
            + by_crest[0],
        torque: pressed.torque
            - by_rotation
            - by_crest[1]
            - modulus_by_rotation * stiffer
            - width_by_rotation * pressed.energy_by_width,
        lever: if pressed.normal_force > 0.0 { pressed.centre_of_pressure - place } else { DVec3::ZERO },
        tangential: half_space.tangential,
    };
    let rotation = DMat3::from_quat(contact.orientation);
    correct_shape(linear, (tool.shape, rotation), half_space, footprint, modulus_by_rotation)
}

fn crest_extents(footprint: &Footprint) -> DMat3 {
    footprint.crest.map_or(DMat3::ZERO, |crest| crest.extents)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::SurfaceQuery;
    use crate::contact::footprint::PressedSurface;
    use crate::contact::local::effective_modulus;
    use crate::contact::local::{SphereOnSurface, indent_sphere};
    use crate::contact::regular::{FanFields, INVERSE_MODULUS, POISSON, STRAIN_TERMS, WIDTH};
    use crate::contact::smooth::tests::{ball, cube, near};
    use crate::contact::smooth::{DrawnSurface, FanWeights, SmoothSurface};
    use crate::mesh::Surface;
    use crate::simulation::law::local::half_space::LocalBody;
    use crate::simulation::law::local::inclination::OtherContacts;
    use crate::simulation::law::local::near_corner::evaluate;
    use crate::simulation::law::local::response::{Guess, LocalResponse};

    /// A body whose modulus rises by two thirds over a length of two.
    struct Body {
        surface: Surface,
        query: SurfaceQuery,
        smooth: SmoothSurface,
        fields: Vec<FanFields>,
    }

    impl Body {
        fn new(surface: Surface) -> Self {
            let query = SurfaceQuery::new(&surface).expect("triangles");
            let smooth = SmoothSurface::new(&surface);
            let modulus = |z: f64| 1e4 * (1.0 + 0.25 * z) / (1.0 - 0.45 * 0.45);
            let fields = smooth.fans().iter().map(|fan| {
                let mut fields = FanFields::default();
                (fields[INVERSE_MODULUS], fields[POISSON]) = (1.0 / modulus(fan.position.z), 0.45);
                fields[WIDTH] = 0.5 + 0.1 * fan.position.x;
                fields[STRAIN_TERMS].copy_from_slice(&[-0.2, 0.1, -0.15]);
                fields
            });
            Self { fields: fields.collect(), smooth, query, surface }
        }

        fn press(&self, shape: &ToolShape, place: DVec3, orientation: DQuat) -> LocalResponse {
            let drawn = DrawnSurface { surface: &self.surface, query: &self.query };
            let pressed =
                PressedSurface::new(&self.surface, &self.query, &self.smooth, &self.fields, shape.thickness());
            let body = LocalBody {
                drawn,
                smooth: &self.smooth,
                fields: &self.fields,
                series: None,
                pressed_surface: Some(&pressed),
                corners: None,
                edges: None,
                scale: 1.0,
                is_hyperelastic: true,
            };
            let tool = LocalTool { shape, radius: shape.bounding_radius(), pad: None, coefficient: 0.0 };
            let mut contact = LocalContact { orientation, part: 1.0, ..LocalContact::default() };
            let mut weights = FanWeights::new(near(&self.smooth));
            let (mut state, mut scratch) = (PressureState::default(), CellScratch::default());
            let mut footprint = FootprintScratch::default();
            let mut corner_weights = weights.clone();
            let at = PlacedShape { contact_normal: DVec3::ZERO, ..placed_shape(shape, &contact, place) };
            footprint.near.find(&pressed, &self.query, &at);
            let first = footprint.first_touched(DVec3::ZERO).expect("a piece");
            (contact.foot.position, contact.foot.normal) = (first.point, first.normal);
            contact.entry_depth = 0.003;
            let mut response = LocalResponse::default();
            for _ in 0..8 {
                let guess = Guess {
                    place,
                    force: response.force,
                    friction: DVec3::ZERO,
                    foot: &contact.foot,
                    offset: DVec3::ZERO,
                };
                let resolution = Resolution::Medium;
                let cells = CellMemory {
                    state: &mut state,
                    scratch: &mut scratch,
                    footprint: &mut footprint,
                    resolution,
                    corner_weights: &mut corner_weights,
                };
                let others = OtherContacts::default();
                let mut evaluated = LocalResponse::default();
                evaluate(body, tool, &contact, guess, &others, cells, (&mut weights, &mut evaluated))
                    .expect("an answer");
                response = evaluated;
                (contact.foot, contact.penetration) = (response.foot, response.indentation.depth);
            }
            response
        }
    }

    /// Differences of the energy over small motions and rotations are force and torque.
    fn check(body: &Body, shape: &ToolShape, (place, orientation): (DVec3, DQuat), tolerance: f64) {
        let expected = body.press(shape, place, orientation).indentation;
        assert!(expected.force > 0.0);
        let h = 1e-4;
        let energy = |place: DVec3, orientation: DQuat| body.press(shape, place, orientation).indentation.energy;
        for axis in DVec3::AXES {
            let [ahead, behind] = [h, -h].map(|h| energy(place + h * axis, orientation));
            let error = ((ahead - behind) / (2.0 * h) - expected.gradient.dot(axis)).abs() / expected.force;
            assert!(error < tolerance, "force {error:e} {shape:?} {place}");
            let turned = |h: f64| DQuat::from_scaled_axis(h * axis) * orientation;
            let [ahead, behind] = [h, -h].map(|h| energy(place, turned(h)));
            let error = ((ahead - behind) / (2.0 * h) + expected.torque.dot(axis)).abs() / expected.force;
            assert!(error < tolerance, "torque {error:e} {shape:?} {place}");
        }
    }

    fn shapes() -> [(ToolShape, f64); 3] {
        [
            (ToolShape::ellipsoid(DVec3::new(0.2, 0.15, 0.1)).expect("a shape"), 0.07),
            (ToolShape::punch(0.1, 0.03).expect("a shape"), -0.03),
            (ToolShape::capsule(0.1, 0.1).expect("a shape"), 0.08),
        ]
    }

    #[test]
    fn the_wrench_on_a_ball_is_the_gradient_of_the_energy() {
        let body = Body::new(ball(12));
        for (shape, out) in shapes() {
            for k in 0..6 {
                let turn = f64::from(k);
                let orientation = DQuat::from_euler(glam::EulerRot::XYZ, 0.25 * turn.sin(), 0.25 * turn.cos(), turn);
                let towards = DVec3::new(0.3 * (2.0 * turn).cos(), 0.3 * (2.0 * turn).sin(), 1.0).normalize();
                let lean = DQuat::from_rotation_arc(DVec3::Z, towards);
                check(&body, &shape, ((1.0 + out) * towards, lean * orientation), 2e-3);
            }
        }
    }

    /// Over the edge between two faces of a cube, from the one to the other: 8 x 8 cells pass it row by row.
    #[test]
    fn the_wrench_over_an_edge_is_the_gradient_of_the_energy() {
        let body = Body::new(cube());
        for (shape, _) in shapes() {
            for k in 0..9 {
                let angle = (f64::from(k) * 11.25 + 0.3).to_radians();
                let towards = DVec3::new(angle.sin(), 0.02, angle.cos()).normalize();
                // For a capsule that stands upright the cells have no direction.
                let lies = matches!(shape, ToolShape::Capsule { .. });
                let lying = DQuat::from_rotation_x(if lies { 1.5 } else { 0.0 });
                let orientation =
                    DQuat::from_rotation_arc(DVec3::Z, towards) * DQuat::from_rotation_z(0.3 + angle) * lying;
                let lowest = orientation * shape.support(orientation.conjugate() * -towards);
                let place = DVec3::new(1.0, 0.52, 1.0) - lowest - 0.04 * towards;
                check(&body, &shape, (place, orientation), 0.15);
            }
        }
    }

    /// Its face is round, so its angle about its axis makes no difference. Cells obliquely over the edge would not resolve it.
    #[test]
    fn a_punch_that_spins_on_an_edge_keeps_its_force() {
        let body = Body::new(cube());
        let punch = ToolShape::punch(0.1, 0.03).expect("a shape");
        for angle in [0.2f64, 0.5, 0.785] {
            let towards = DVec3::new(angle.sin(), 0.0, angle.cos());
            let lean = DQuat::from_rotation_arc(DVec3::Z, towards);
            let lowest = lean * punch.support(lean.conjugate() * -towards);
            let place = DVec3::new(1.0, 0.52, 1.0) - lowest - 0.01 * towards;
            let force = |spin: f64| body.press(&punch, place, lean * DQuat::from_rotation_z(spin)).indentation.force;
            for spin in [0.3, 0.8, 1.3] {
                let ratio = force(spin) / force(0.0);
                assert!((ratio - 1.0).abs() < 0.03, "{angle} {spin} {ratio}");
            }
        }
    }

    /// Compared with the closed form of a sphere on the same curvatures.
    #[test]
    fn a_round_ellipsoid_is_a_sphere() {
        let body = Body::new(ball(24));
        let round = ToolShape::ellipsoid(DVec3::splat(0.2)).expect("a shape");
        let expected = body.press(&round, DVec3::Z * 1.18, DQuat::from_rotation_x(0.7)).indentation;
        // The depth is 0.02 less what it began with.
        let modulus = effective_modulus(1.25e4, 0.45, None);
        let sphere = indent_sphere(0.017, SphereOnSurface { radius: 0.2, curvature: 1.0 }, modulus);
        // The body's material beyond small strain (`Body::new`), by the sphere's own s.
        let s = (0.017_f64 / 0.2).sqrt();
        let force = sphere.force * (1.0 - 0.2 * s + 0.1 * s * s - 0.15 * s.powi(3));
        assert!((expected.force / force - 1.0).abs() < 0.02, "{} {force}", expected.force);
        assert!(expected.torque.length() < 1e-3 * expected.force * 0.2);
    }
}
