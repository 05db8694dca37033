//! Cells against closed forms, and the wrench against the energy.

use super::*;
use crate::contact::local::{indent_ellipse, indent_sphere};

const MODULUS: f64 = 12.5e3;

fn plane() -> OsculatingSurface {
    OsculatingSurface { origin: DVec3::ZERO, axes: DMat3::IDENTITY, curvature: [0.0; 3] }
}

fn at_height(shape: &ToolShape, z: f64) -> CellProblem<'_> {
    CellProblem {
        shape,
        pose: ToolPose { position: DVec3::Z * z, rotation: DQuat::IDENTITY },
        surface: plane(),
        effective_modulus: MODULUS,
        resolution: Resolution::Fine,
    }
}

fn cold(problem: &CellProblem) -> CellContact {
    problem.solve(&mut PressureState::default(), &mut CellScratch::default())
}

#[test]
fn spheres_are_sneddons() {
    let shape = ToolShape::sphere(0.01).unwrap();
    for (resolution) in [Resolution::Fine, Resolution::Medium, Resolution::Coarse] {
        for depth in [1e-5, 5e-4, 2e-3, 5e-3] {
            let contact = cold(&CellProblem { resolution, ..at_height(&shape, 0.01 - depth) });
            let sphere = indent_sphere(depth, 0.01, MODULUS);
            println!(
                "{resolution:?} {depth}: F {} k {} U {} Fsum {} A {} {:?}",
                contact.force.z / sphere.force - 1.0,
                contact.stiffness / sphere.stiffness - 1.0,
                contact.energy / sphere.energy - 1.0,
                contact.normal_force / sphere.force - 1.0,
                contact.area / (std::f64::consts::PI * sphere.radius.powi(2)),
                contact.convergence
            );
        }
    }
    let shape = ToolShape::punch(0.006, 0.00005).unwrap();
    for (resolution) in [Resolution::Fine, Resolution::Medium, Resolution::Coarse] {
        let contact = cold(&CellProblem { resolution, ..at_height(&shape, -2e-4) });
        println!(
            "punch F {} k {} {:?}",
            contact.force.z / (2.0 * MODULUS * 0.006 * 2e-4),
            contact.stiffness / (2.0 * MODULUS * 0.006),
            contact.convergence
        );
    }
}

fn turned(shape: &ToolShape, angles: DVec3, depth: f64, curvature: [f64; 3]) -> CellProblem<'_> {
    let rotation = DQuat::from_euler(glam::EulerRot::XYZ, angles.x, angles.y, angles.z);
    let lowest = rotation * shape.support(rotation.inverse() * DVec3::NEG_Z);
    let position = DVec3::new(0.0003 - lowest.x, -0.0002 - lowest.y, -lowest.z - depth);
    CellProblem {
        pose: ToolPose { position, rotation },
        surface: OsculatingSurface { curvature, ..plane() },
        ..at_height(shape, 0.0)
    }
}

#[test]
fn wrench_is_gradient() {
    let cases: Vec<(&str, ToolShape, DVec3)> = vec![
        ("ell", ToolShape::ellipsoid(DVec3::new(0.012, 0.006, 0.005)).unwrap(), DVec3::new(0.3, 0.2, 0.5)),
        ("capflat", ToolShape::capsule(0.004, 0.010).unwrap(), DVec3::new(1.55, 0.2, 0.5)),
        ("captilt", ToolShape::capsule(0.004, 0.010).unwrap(), DVec3::new(1.2, 0.2, 0.5)),
        ("punchflat", ToolShape::punch(0.006, 0.001).unwrap(), DVec3::new(0.0, 0.0, 0.5)),
        ("punch", ToolShape::punch(0.006, 0.001).unwrap(), DVec3::new(0.05, 0.02, 0.5)),
        ("punchtilt", ToolShape::punch(0.006, 0.001).unwrap(), DVec3::new(0.4, 0.1, 0.5)),
        (
            "surface",
            ToolShape::Surface(Box::new({
                let (v, t) = crate::contact::shape::tests::sphere_mesh(0.008, 4);
                super::super::super::shape::SurfaceShape::new(
                    &v.iter().map(|v| *v * DVec3::new(1.5, 1.0, 0.7)).collect::<Vec<_>>(),
                    &t,
                )
                .unwrap()
            })),
            DVec3::new(0.3, 0.2, 0.5),
        ),
    ];
    for (name, shape, angles) in &cases {
        for curvature in [[0.0; 3], [20.0, 5.0, 10.0]] {
            for depth in [3e-4, 2e-3] {
                let problem = turned(shape, *angles, depth, curvature);
                let contact = cold(&problem);
                let energy = |v: DVec3, w: DVec3| {
                    let pose = ToolPose {
                        position: problem.pose.position + v,
                        rotation: DQuat::from_scaled_axis(w) * problem.pose.rotation,
                    };
                    cold(&CellProblem { pose, ..problem }).energy
                };
                let (h, ha) = (1e-7, 1e-5);
                let force = DVec3::from_array(
                    DVec3::AXES.map(|e| (energy(-h * e, DVec3::ZERO) - energy(h * e, DVec3::ZERO)) / (2.0 * h)),
                );
                let torque = DVec3::from_array(
                    DVec3::AXES.map(|e| (energy(DVec3::ZERO, -ha * e) - energy(DVec3::ZERO, ha * e)) / (2.0 * ha)),
                );
                let arm = contact.force.length() * 0.006;
                println!(
                    "{name} k={:?} d={depth}: F {} {:?} err {:.1e} torque err {:.1e}  tau {} T {} it {:?} k {}",
                    curvature[0],
                    contact.normal_force,
                    contact.force,
                    force.distance(contact.force) / contact.force.length(),
                    torque.distance(contact.torque) / arm,
                    contact.torque,
                    torque,
                    contact.convergence,
                    contact.stiffness
                );
            }
        }
    }
}
