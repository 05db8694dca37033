//! Cells against closed forms, and the wrench against the energy.

use std::f64::consts::PI;

use glam::{DQuat, EulerRot};

use super::references::{Quadric, Step, hertz_ellipse};
use super::*;
use crate::contact::local::{ContactPlane, SphereOnSurface, ToolPose, indent_sphere};
use crate::contact::shape::{SurfaceShape, tests::sphere_mesh};

const MODULUS: f64 = 12.5e3;
const ALL: [Resolution; 3] = [Resolution::Fine, Resolution::Medium, Resolution::Coarse];

fn plane() -> ContactPlane {
    ContactPlane { origin: DVec3::ZERO, axes: DMat3::IDENTITY }
}

/// A tool turned by angles, whose lowest point lies `depth` below the origin.
fn pressed(shape: &ToolShape, angles: DVec3, depth: f64) -> CellProblem<'_> {
    let rotation = DQuat::from_euler(EulerRot::XYZ, angles.x, angles.y, angles.z);
    let lowest = rotation * shape.support(rotation.inverse() * DVec3::NEG_Z);
    let pose = ToolPose { position: DVec3::NEG_Z * depth - lowest, rotation };
    let (plane, crest) = (plane(), DMat3::ZERO);
    CellProblem { shape, pose, plane, crest, effective_modulus: MODULUS, resolution: Resolution::Fine, width: 1.0 }
}

fn cold(problem: &CellProblem) -> CellContact {
    cold_on([0.0; 3], problem)
}

fn bent(curvature: [f64; 3]) -> Quadric {
    Quadric { curvature, axes: DMat3::IDENTITY }
}

fn cold_on(curvature: [f64; 3], problem: &CellProblem) -> CellContact {
    cold_over(&bent(curvature), problem)
}

fn cold_over(relief: &impl Relief, problem: &CellProblem) -> CellContact {
    problem.solve(relief, &mut PressureState::default(), &mut CellScratch::default())
}

/// Shapes and how they are held: on a rim, a side, a face.
fn held_shapes() -> Vec<(ToolShape, DVec3)> {
    let (vertices, triangles) = sphere_mesh(0.008, 4);
    let vertices: Vec<DVec3> = vertices.into_iter().map(|v| v * DVec3::new(1.5, 1.0, 0.7)).collect();
    let surface = SurfaceShape::new(&vertices, &triangles).unwrap();
    let punch = || ToolShape::punch(0.006, 0.001).unwrap();
    let capsule = || ToolShape::capsule(0.004, 0.010).unwrap();
    vec![
        (ToolShape::sphere(0.008).unwrap(), DVec3::new(0.3, 0.2, 0.5)),
        (ToolShape::ellipsoid(DVec3::new(0.012, 0.006, 0.005)).unwrap(), DVec3::new(0.3, 0.2, 0.5)),
        (capsule(), DVec3::new(1.55, 0.2, 0.5)),
        (capsule(), DVec3::new(1.2, 0.2, 0.5)),
        (punch(), DVec3::new(0.01, 0.005, 0.5)),
        (punch(), DVec3::new(0.05, 0.02, 0.5)),
        (punch(), DVec3::new(0.4, 0.1, 0.5)),
        (ToolShape::Surface(Box::new(surface)), DVec3::new(0.3, 0.2, 0.5)),
    ]
}

fn near(value: f64, expected: f64, tolerance: f64) -> bool {
    (value / expected - 1.0).abs() < tolerance
}

#[test]
fn a_sphere_is_sneddons() {
    let shape = ToolShape::sphere(0.01).unwrap();
    for (resolution, tolerance, of_stiffness) in
        [(Resolution::Fine, 0.004, 0.05), (Resolution::Medium, 0.01, 0.1), (Resolution::Coarse, 0.03, 0.35)]
    {
        for depth in [1e-5, 5e-4, 2e-3, 5e-3] {
            let contact = cold(&CellProblem { resolution, ..pressed(&shape, DVec3::ZERO, depth) });
            let sphere = indent_sphere(depth, SphereOnSurface::on_plane(0.01), MODULUS);
            assert!(near(contact.force.z, sphere.force, tolerance), "{resolution:?} {depth}: {contact:?} {sphere:?}");
            assert!(near(contact.energy, sphere.energy, tolerance), "{resolution:?} {depth}");
            // Cells at the rim count as whole.
            assert!(near(contact.stiffness, sphere.stiffness, of_stiffness), "{resolution:?} {depth}");
            assert!(contact.centre_of_pressure.length() < 1e-9);
        }
    }
}

#[test]
fn a_flat_punch_is_boussinesqs() {
    let shape = ToolShape::punch(0.006, 1e-5).unwrap();
    for (resolution, tolerance) in [(Resolution::Fine, 0.005), (Resolution::Medium, 0.02), (Resolution::Coarse, 0.1)] {
        let depth = 2e-4;
        let contact = cold(&CellProblem { resolution, ..pressed(&shape, DVec3::ZERO, depth) });
        let stiffness = 2.0 * MODULUS * 0.006;
        assert!(near(contact.force.z, stiffness * depth, tolerance), "{resolution:?} {contact:?}");
        assert!(near(contact.stiffness, stiffness, tolerance), "{resolution:?}");
    }
}

#[test]
fn an_ellipsoid_is_hertzs_ellipse() {
    let semi_axes = DVec3::new(0.012, 0.006, 0.005);
    let shape = ToolShape::ellipsoid(semi_axes).unwrap();
    // Radii at its lowest point: the squares of the other semi-axes over the third.
    let curvatures = [semi_axes.z / semi_axes.x.powi(2), semi_axes.z / semi_axes.y.powi(2)];
    for (depth, tolerance) in [(2e-5, 0.01), (2e-4, 0.01), (1e-3, 0.05)] {
        let contact = cold(&pressed(&shape, DVec3::Z * 0.4, depth));
        let force = hertz_ellipse(depth, curvatures, MODULUS);
        assert!(near(contact.force.z, force, tolerance), "{depth}: {} {force}", contact.force.z);
        assert!(near(contact.energy, 0.4 * force * depth, tolerance), "{depth}");
    }
    // On a curved surface the curvatures add up: along the tangents that the ellipsoid's axes are turned from.
    let problem = pressed(&shape, DVec3::ZERO, 2e-4);
    let contact = cold_on([30.0, 0.0, 10.0], &problem);
    let force = hertz_ellipse(2e-4, [curvatures[0] + 30.0, curvatures[1] + 10.0], MODULUS);
    assert!(near(contact.force.z, force, 0.01), "{} {force}", contact.force.z);
}

/// Johnson, Contact Mechanics, eq. 4.45: under a cylinder with the load `P` per length the largest pressure is
/// `sqrt(P E*/(pi R))`.
#[test]
fn the_side_of_a_capsule_presses_like_a_cylinder() {
    let radius = 0.004;
    let shape = ToolShape::capsule(radius, 0.02).unwrap();
    let problem = pressed(&shape, DVec3::X * (PI / 2.0), 4e-4);
    let (mut state, mut scratch) = (PressureState::default(), CellScratch::default());
    let contact = problem.solve(&bent([0.0; 3]), &mut state, &mut scratch);
    // Its area is its length times its width, 2 sqrt(4 P R/(pi E*)).
    let across: Vec<f64> = (0..MAX_CELLS).map(|j| 0.5 * (state.q[j][7] + state.q[j][8])).collect();
    let share = across.iter().sum::<f64>() / state.q.iter().flatten().sum::<f64>();
    let tool = ToolInSurfaceFrame {
        shape: &shape,
        rotation: DMat3::from_quat(problem.pose.rotation),
        tip: problem.pose.position,
        crest: DMat3::ZERO,
    };
    let cells = Cells::new(tool.rectangle(), MAX_CELLS, MODULUS);
    let load = contact.normal_force * share / cells.sides[0];
    let largest =
        cells.force_scale * across.iter().fold(0.0, |a: f64, &b| a.max(b)) / (cells.sides[0] * cells.sides[1]);
    assert!(near(largest, (load * MODULUS / (PI * radius)).sqrt(), 0.02), "{largest} {load}");
    // As long as the straight part.
    assert!(cells.sides[0] * 16.0 > 0.04 && cells.sides[0] * 16.0 < 0.046);
}

#[test]
fn the_wrench_is_the_gradient_of_the_energy() {
    for (shape, angles) in held_shapes() {
        for curvature in [[0.0; 3], [20.0, 5.0, 10.0]] {
            for (depth, resolution) in [(3e-4, Resolution::Fine), (2e-3, Resolution::Fine), (1e-3, Resolution::Medium)]
            {
                let mut problem = pressed(&shape, angles, depth);
                problem.pose.position += DVec3::new(3e-4, -2e-4, 0.0);
                problem.resolution = resolution;
                let contact = cold_on(curvature, &problem);
                let energy = |shift: DVec3, turn: DVec3| {
                    let pose = ToolPose {
                        position: problem.pose.position + shift,
                        rotation: DQuat::from_scaled_axis(turn) * problem.pose.rotation,
                    };
                    cold_on(curvature, &CellProblem { pose, ..problem }).energy
                };
                let (h, angle) = (1e-7, 1e-5);
                let fall = |along: [DVec3; 2], by: f64| {
                    (energy(-along[0], -along[1]) - energy(along[0], along[1])) / (2.0 * by)
                };
                let force = DVec3::from_array(DVec3::AXES.map(|e| fall([h * e, DVec3::ZERO], h)));
                let torque = DVec3::from_array(DVec3::AXES.map(|e| fall([DVec3::ZERO, angle * e], angle)));
                let scale = contact.force.length();
                assert!(force.distance(contact.force) < 1e-5 * scale, "{shape:?} {depth} {force} {contact:?}");
                assert!(
                    torque.distance(contact.torque) < 1e-5 * scale * 0.006,
                    "{shape:?} {depth} {torque} {contact:?}"
                );
            }
        }
    }
}

/// The plane may be raised and turned under a tool that stays where it is.
#[test]
fn the_energy_changes_with_the_plane_as_its_wrenches_have_it() {
    for (shape, angles) in held_shapes() {
        let curvature = [20.0, 5.0, 10.0];
        let problem = pressed(&shape, angles, 1e-3);
        let contact = cold_on(curvature, &problem);
        let moment = contact.torque + problem.pose.position.cross(contact.force);
        let (h, angle) = (1e-7, 1e-5);
        for axis in DVec3::AXES {
            let energy = |shift: f64, turn: f64| {
                let axes = DMat3::from_axis_angle(axis, turn);
                cold_on(curvature, &CellProblem { plane: ContactPlane { origin: axis * shift, axes }, ..problem })
                    .energy
            };
            let raised = (energy(h, 0.0) - energy(-h, 0.0)) / (2.0 * h);
            let turned = (energy(0.0, angle) - energy(0.0, -angle)) / (2.0 * angle);
            let scale = contact.force.length();
            let value = (contact.force - contact.body_force).dot(axis);
            assert!((raised - value).abs() < 1e-4 * scale, "{shape:?} {raised} {value}");
            // A turn about the normal moves the grid of an upright tool.
            if axis != DVec3::Z {
                let value = (moment - contact.body_torque).dot(axis);
                assert!((turned - value).abs() < 1e-4 * scale * 0.006, "{shape:?} {turned} {value}");
            }
        }
    }
}

/// Press, tilt, slide and lift along closed curves of all six coordinates: what is put in comes back.
#[test]
fn closed_paths_do_no_work() {
    let steps = 1500;
    for (n, (shape, angles)) in held_shapes().into_iter().enumerate() {
        let base = pressed(&shape, angles, 8e-4);
        let (mut state, mut scratch) = (PressureState::default(), CellScratch::default());
        let mut at = |k: usize| {
            let u = 2.0 * PI * (k % steps) as f64 / steps as f64;
            let phase = n as f64;
            let shift = DVec3::new((u + phase).sin(), (u + 2.0).cos(), 0.7 * (2.0 * u + phase).sin()) * 1e-3;
            let turn = DVec3::new((u + 0.3).sin(), (2.0 * u + phase).cos(), (u + phase).cos()) * 0.1;
            let mut problem = base;
            problem.pose = ToolPose {
                position: base.pose.position + shift,
                rotation: DQuat::from_scaled_axis(turn) * base.pose.rotation,
            };
            let contact = problem.solve(&bent([15.0, 3.0, 5.0]), &mut state, &mut scratch);
            (problem.pose, contact)
        };
        let (mut work, mut peak, mut exchanged) = (0.0, 0.0f64, 0.0);
        let mut before = at(0);
        for k in 1..=steps {
            let after = at(k);
            let turn = (after.0.rotation * before.0.rotation.inverse()).to_scaled_axis();
            let done = 0.5
                * ((before.1.force + after.1.force).dot(after.0.position - before.0.position)
                    + (before.1.torque + after.1.torque).dot(turn));
            work += done;
            exchanged += done.abs();
            peak = peak.max(after.1.energy);
            before = after;
        }
        assert!(exchanged > peak, "{shape:?} does not move enough");
        assert!(work.abs() < 1e-5 * peak, "{shape:?}: {} of the peak", work / peak);
    }
}

#[test]
fn sliding_over_a_plane_changes_nothing() {
    for (shape, angles) in held_shapes() {
        let problem = pressed(&shape, angles, 1e-3);
        let here = cold(&problem);
        assert!(here.force.truncate().length() < 1e-9 * here.force.z);
        for k in 1..20 {
            let shift = DVec3::new(0.00037, 0.00023, 0.0) * k as f64;
            let mut moved = problem;
            moved.pose.position += shift;
            let there = cold(&moved);
            assert!(here.force.distance(there.force) < 1e-6 * here.force.z, "{shape:?}");
            assert!(here.torque.distance(there.torque) < 1e-8 * here.force.z, "{shape:?}");
            assert!(there.centre_of_pressure.distance(here.centre_of_pressure + shift) < 1e-8);
            // Turning the world changes nothing either.
            let world = DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.1 * k as f64));
            moved.pose = ToolPose { position: world * moved.pose.position, rotation: world * moved.pose.rotation };
            moved.plane.axes = DMat3::from_quat(world);
            let turned = Quadric { curvature: [0.0; 3], axes: moved.plane.axes };
            let there = moved.solve(&turned, &mut PressureState::default(), &mut CellScratch::default());
            assert!((world.inverse() * there.force).distance(here.force) < 1e-6 * here.force.z, "{shape:?}");
        }
    }
}

/// Pressures on a plane act along its normal at their centre.
#[test]
fn the_torque_is_that_of_the_centre_of_pressure() {
    for (shape, angles) in held_shapes() {
        for resolution in [Resolution::Fine, Resolution::Medium] {
            let problem = CellProblem { resolution, ..pressed(&shape, angles, 1e-3) };
            let contact = cold(&problem);
            let expected = (contact.centre_of_pressure - problem.pose.position).cross(contact.force);
            let allowed = contact.force.z * contact.area.sqrt() * 0.06;
            assert!(contact.torque.distance(expected) < allowed, "{shape:?} {} {expected}", contact.torque);
        }
    }
}

#[test]
fn every_solution_ends_and_does_not_depend_on_its_start() {
    for resolution in ALL {
        for (shape, angles) in held_shapes() {
            let (mut state, mut scratch) = (PressureState::default(), CellScratch::default());
            for k in 0..120 {
                let u = k as f64 * 0.11;
                let turn = angles + 0.3 * DVec3::new(u.sin(), (1.3 * u).cos(), u);
                let depth = 1e-3 + 1.2e-3 * (2.1 * u).sin();
                let problem = CellProblem { resolution, ..pressed(&shape, turn, depth) };
                let curvature = [30.0 * u.sin(), 10.0 * u.cos(), -20.0 * u.sin()];
                let mut before = state;
                let warm = problem.solve(&bent(curvature), &mut state, &mut scratch);
                assert!(warm.convergence.products <= MAX_PRODUCTS);
                assert!(
                    warm.convergence.residual <= TOLERANCE * 4.0 * warm.overlap,
                    "{shape:?} {resolution:?} {:?}",
                    warm.convergence
                );
                // On a surface that falls away nothing may overlap below the plane.
                assert!(warm.overlap == 0.0 || depth > 0.0);
                let cold = cold_on(curvature, &problem);
                assert!(warm.force.distance(cold.force) <= 1e-5 * cold.force.length(), "{shape:?} {resolution:?} {k}");
                assert!((warm.energy - cold.energy).abs() <= 1e-9 * cold.energy);
                // The same start gives the same bits.
                assert_eq!(problem.solve(&bent(curvature), &mut before, &mut CellScratch::default()), warm);
            }
        }
    }
}

/// Cells that are no longer beside an edge keep nothing of its softer compliance, nor of the slopes of that.
#[test]
fn nothing_of_an_edge_is_left_in_the_memory() {
    let shape = ToolShape::ellipsoid(DVec3::new(0.012, 0.006, 0.005)).unwrap();
    let problem = CellProblem { width: 0.02, ..pressed(&shape, DVec3::ZERO, 1e-3) };
    let (mut state, mut scratch) = (PressureState::default(), CellScratch::default());
    let beside = problem.solve(&Step { edge: 1e-3, reach: 0.004 }, &mut state, &mut scratch);
    assert!(beside.force.x.abs() > 0.01 * beside.force.z, "{}", beside.force);
    let [after, far] = [5e-3, 1.0].map(|edge| {
        let step = Step { edge, reach: 0.004 };
        let after = problem.solve(&step, &mut PressureState::default(), &mut scratch);
        assert_eq!(after, cold_over(&step, &problem));
        after
    });
    assert!(after.energy < far.energy);
    assert!(far.force.truncate().length() < 1e-9 * far.force.z, "{}", far.force);
}

/// Beside an edge the wrench has the slope of the softer compliance: the energy falls towards it.
#[test]
fn the_force_beside_an_edge_is_the_gradient_of_the_energy() {
    let (shape, h) = (ToolShape::ellipsoid(DVec3::new(0.008, 0.006, 0.005)).unwrap(), 1e-6);
    let at = |edge: f64| {
        let problem = CellProblem { width: 0.02, ..pressed(&shape, DVec3::ZERO, 1e-3) };
        cold_over(&Step { edge, reach: 0.004 }, &problem)
    };
    for edge in [1e-3, 2.5e-3, 4e-3] {
        let slope = (at(edge + h).energy - at(edge - h).energy) / (2.0 * h);
        let aside = at(edge).body_force.x;
        assert!(near(aside, slope, 0.02), "{edge} {aside} {slope}");
    }
}

#[test]
fn warm_starts_take_fewer_products() {
    let shape = ToolShape::punch(0.006, 0.001).unwrap();
    let (mut state, mut scratch) = (PressureState::default(), CellScratch::default());
    let (mut warm, mut fresh) = (0, 0);
    for k in 0..100 {
        let problem = pressed(&shape, DVec3::new(0.1 * (0.02 * k as f64).sin(), 0.05, 0.0), 1e-3 + 1e-6 * k as f64);
        warm += problem.solve(&bent([0.0; 3]), &mut state, &mut scratch).convergence.products;
        fresh += cold(&problem).convergence.products;
    }
    assert!(3 * warm < 2 * fresh, "{warm} {fresh}");
}

#[test]
fn nothing_touches_from_outside() {
    for (shape, angles) in held_shapes() {
        for depth in [-1e-12, -1e-6, -1.0, f64::NAN] {
            let contact = cold(&pressed(&shape, angles, depth));
            assert_eq!((contact.force, contact.energy), (DVec3::ZERO, 0.0), "{shape:?} {depth}");
        }
        // Just below: a force that is small and finite, and beyond zero where the shape is convex.
        let force = cold(&pressed(&shape, angles, 1e-9)).force;
        let convex = !matches!(shape, ToolShape::Surface(_));
        assert!(force.is_finite() && (force.z > 0.0 || !convex) && force.z < 1e-3, "{shape:?} {force}");
    }
}

#[test]
fn influence_is_loves() {
    for aspect in [1.0, 0.3, 7.0] {
        let mut influence = Influence::new();
        influence.set_aspect(MAX_CELLS, aspect);
        // Cells of sides 1 and `aspect`, split into points of equal force; q = f/(pi E* sqrt(aspect)).
        let splits = 200;
        for (i, j) in [(1usize, 0usize), (0, 1), (2, 3), (15, 9)] {
            let mut q = [[0.0; MAX_CELLS]; MAX_CELLS];
            q[0][0] = 1.0;
            let mut out = q;
            influence.product(MAX_CELLS, &q, &mut out);
            let mut displacement = 0.0;
            for a in 0..splits {
                for b in 0..splits {
                    let x = i as f64 - (a as f64 + 0.5) / splits as f64 + 0.5;
                    let y = aspect * (j as f64 - (b as f64 + 0.5) / splits as f64 + 0.5);
                    displacement += aspect.sqrt() / x.hypot(y) / (splits * splits) as f64;
                }
            }
            assert!(near(out[j][i], displacement, 1e-3), "{aspect} {i} {j}: {} {displacement}", out[j][i]);
        }
    }
    // Under the middle of a square of side s (Johnson, eq. 3.26): u = 4 ln(1 + sqrt 2) p s/(pi E*).
    let (mut q, mut out) = ([[0.0; MAX_CELLS]; MAX_CELLS], [[0.0; MAX_CELLS]; MAX_CELLS]);
    q[5][6] = 1.0;
    Influence::new().product(MAX_CELLS, &q, &mut out);
    assert!(near(out[5][6], 4.0 * (1.0 + 2f64.sqrt()).ln(), 1e-12));
    assert_eq!((out[5][4], out[3][6], out[4][4]), (out[5][8], out[7][6], out[6][8]));
}

#[test]
fn influence_changes_with_aspect_as_said() {
    let (mut q, mut image) = ([[0.0; MAX_CELLS]; MAX_CELLS], [[0.0; MAX_CELLS]; MAX_CELLS]);
    q[3][2] = 1.0;
    for aspect in [0.4, 1.0, 3.0] {
        let at = |aspect: f64| {
            let (mut influence, mut out) = (Influence::new(), q);
            influence.set_aspect(MAX_CELLS, aspect);
            influence.product(MAX_CELLS, &q, &mut out);
            (influence, out)
        };
        let h = 1e-6;
        let (above, below) = (at(aspect + h).1, at(aspect - h).1);
        at(aspect).0.product_by_aspect(MAX_CELLS, &q, &mut image);
        for j in 0..MAX_CELLS {
            for i in 0..MAX_CELLS {
                assert!(((above[j][i] - below[j][i]) / (2.0 * h) - image[j][i]).abs() < 1e-8);
            }
        }
    }
}

/// The preconditioner's symbol is positive: it is positive definite on any set of cells.
#[test]
fn the_local_inverse_is_positive_definite() {
    for aspect in [1e-3, 0.02, 0.3, 1.0, 2.0, 17.0, 300.0, 1e4] {
        let mut influence = Influence::new();
        influence.set_aspect(MAX_CELLS, aspect);
        let (mut r, mut out) = ([[0.0; MAX_CELLS]; MAX_CELLS], [[0.0; MAX_CELLS]; MAX_CELLS]);
        r[8][8] = 1.0;
        influence.precondition(MAX_CELLS, &r, &mut out);
        for a in 0..=32 {
            for b in 0..=32 {
                let (x, y) = ((PI * a as f64 / 32.0).cos(), (PI * b as f64 / 32.0).cos());
                let symbol = out[8][8] + 2.0 * (out[8][9] * x + out[9][8] * y) + 4.0 * out[9][9] * x * y;
                assert!(symbol > 1e-3 * out[8][8], "{aspect} {x} {y} {symbol}");
            }
        }
    }
}

/// A rigid square punch of side `s` (King, Elastic analysis of some punch problems for a layered medium, 1987):
/// `k = 1.012 (2/sqrt pi) E* s`.
#[test]
fn a_cube_from_a_file_is_a_square_punch() {
    let (side, depth) = (0.01, 2e-4);
    let corner = |k: u32| DVec3::new(f64::from(k & 1) - 0.5, f64::from(k >> 1 & 1) - 0.5, f64::from(k >> 2)) * side;
    let vertices: Vec<DVec3> = (0..8).map(corner).collect();
    let squares = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = squares.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let shape = ToolShape::Surface(Box::new(SurfaceShape::new(&vertices, &triangles).unwrap()));
    let mut problem = pressed(&shape, DVec3::ZERO, 0.0);
    problem.pose.position = DVec3::NEG_Z * depth;
    let contact = cold(&problem);
    // The grid of distances rounds its edges.
    let expected = 1.012 * 2.0 / PI.sqrt() * MODULUS * side * depth;
    assert!(near(contact.force.z, expected, 0.04), "{} {expected}", contact.force.z);
    assert!(contact.centre_of_pressure.length() < 1e-8 && contact.torque.length() < 2e-3 * side * contact.force.z);
}

/// The grid is laid out for a plane, and wide enough for a hollow of half the tool's curvature.
#[test]
fn a_sphere_in_a_hollow_is_a_flatter_sphere() {
    let shape = ToolShape::sphere(0.008).unwrap();
    for curvature in [-30.0, -60.0] {
        for depth in [1e-4, 5e-4] {
            let problem = pressed(&shape, DVec3::ZERO, depth);
            let expected = indent_sphere(depth, SphereOnSurface { radius: 1.0 / 125.0, curvature }, MODULUS).force;
            assert!(
                near(cold_on([curvature, 0.0, curvature], &problem).force.z, expected, 0.02),
                "{curvature} {depth}"
            );
        }
    }
}

/// Upright, where the direction of its grid turns fastest, a capsule is a sphere all the same.
#[test]
fn a_capsule_on_its_end_is_a_sphere() {
    let shape = ToolShape::capsule(0.004, 0.010).unwrap();
    for tilt in [0.0, 5e-4, 2e-3, 0.05, 0.5] {
        let contact = cold(&pressed(&shape, DVec3::new(tilt, 0.3 * tilt, 0.4), 1e-3));
        let sphere = indent_sphere(1e-3, SphereOnSurface::on_plane(0.004), MODULUS);
        assert!(near(contact.force.z, sphere.force, 0.004), "{tilt}");
        assert!(contact.torque.length() < 1e-6 * 0.004 * sphere.force, "{tilt}: {}", contact.torque);
    }
}
