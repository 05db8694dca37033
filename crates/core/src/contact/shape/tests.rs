//! Shapes against their definitions: distances against points of the boundary, supports against all of them, curvatures
//! against a circle through three points.

use super::*;

fn shapes() -> Vec<ToolShape> {
    vec![
        ToolShape::sphere(0.008).unwrap(),
        ToolShape::ellipsoid(DVec3::new(0.008, 0.005, 0.012)).unwrap(),
        ToolShape::ellipsoid(DVec3::new(0.02, 0.001, 0.005)).unwrap(),
        ToolShape::capsule(0.004, 0.015).unwrap(),
        ToolShape::punch(0.006, 0.001).unwrap(),
        ToolShape::punch(0.006, 0.006).unwrap(),
    ]
}

/// Directions spread over the sphere, none of them special.
fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |k| {
        let z = 1.0 - (2 * k + 1) as f64 / count as f64;
        let (sin, cos) = (2.399_963 * k as f64 + 0.1).sin_cos();
        ((1.0 - z * z).sqrt() * DVec3::new(cos, sin, 0.0)).with_z(z)
    })
}

/// A sphere of triangles: an octahedron whose faces are split.
pub(crate) fn sphere_mesh(radius: f64, splits: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut vertices: Vec<DVec3> = vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let mut triangles = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    for _ in 0..splits {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (vertices.into_iter().map(|v| radius * v).collect(), triangles)
}

#[test]
fn distances_are_to_a_point_of_the_boundary_and_no_point_is_closer() {
    for shape in shapes() {
        // A boundary point in every direction, as support.
        let boundary: Vec<DVec3> = directions(20_000).map(|d| shape.support(d)).collect();
        for (k, direction) in directions(60).enumerate() {
            let point = shape.centre() + direction * shape.bounding_radius() * (0.05 + 0.03 * k as f64);
            let (distance, gradient) = shape.signed_distance(point);
            assert!((gradient.length() - 1.0).abs() < 1e-12);
            let closest = point - distance * gradient;
            assert!(shape.signed_distance(closest).0.abs() < 1e-12, "{shape:?} {point}");
            if distance > 0.0 {
                // Convex: the closest point is the support in the gradient's direction, and boundary points are farther.
                assert!((shape.support(gradient) - closest).dot(gradient).abs() < 1e-12, "{shape:?} {point}");
                assert!(boundary.iter().all(|b| b.distance(point) >= distance - 1e-12));
            } else {
                assert!(boundary.iter().all(|b| b.distance(point) >= -distance - 1e-12), "{shape:?} {point}");
            }
        }
    }
}

#[test]
fn gradients_are_those_of_the_distance() {
    for shape in shapes().into_iter().chain(files()) {
        for (k, direction) in directions(40).enumerate() {
            let point = shape.centre() + direction * shape.bounding_radius() * (0.3 + 0.04 * k as f64);
            let (_, gradient) = shape.signed_distance(point);
            // Coefficients of splines are single numbers.
            let h = if matches!(shape, ToolShape::Surface(_)) { 1e-6 } else { 1e-8 };
            let difference = DVec3::from_array(DVec3::AXES.map(|axis| {
                (shape.signed_distance(point + h * axis).0 - shape.signed_distance(point - h * axis).0) / (2.0 * h)
            }));
            assert!(difference.distance(gradient) < 1e-4, "{shape:?} {point} {difference} {gradient}");
        }
    }
}

#[test]
fn an_ellipsoid_in_its_planes_of_symmetry() {
    // On the axes the closest point is known, outside, and inside as far as the centre of curvature.
    let semi_axes = DVec3::new(3.0, 2.0, 1.0);
    let shape = ToolShape::ellipsoid(semi_axes).unwrap();
    for (point, distance) in [
        (DVec3::new(5.0, 0.0, 0.0), 2.0),
        (DVec3::new(0.0, -2.5, 0.0), 0.5),
        (DVec3::new(0.0, 0.0, 0.4), -0.6),
        (DVec3::new(0.0, 0.0, 0.0), -1.0),
        (DVec3::new(2.9, 0.0, 0.0), -0.1),
    ] {
        let (computed, gradient) = shape.signed_distance(point);
        assert!((computed - distance).abs() < 1e-11, "{point}: {computed}");
        assert!(gradient.is_finite());
    }
}

#[test]
fn supports_reach_farther_than_anything_inside() {
    for shape in shapes() {
        for direction in directions(40) {
            let support = shape.support(direction);
            assert!(shape.signed_distance(support).0.abs() < 1e-12, "{shape:?}");
            assert!(support.distance(shape.centre()) <= shape.bounding_radius() * (1.0 + 1e-12));
            for other in directions(500) {
                assert!(shape.support(other).dot(direction) <= support.dot(direction) + 1e-15);
            }
        }
    }
}

#[test]
fn lines_enter_where_the_distance_is_first_zero() {
    for shape in shapes() {
        let mut met = 0;
        for (k, direction) in directions(60).enumerate() {
            let aside = direction.any_orthonormal_vector() * shape.bounding_radius() * 0.0203 * k as f64;
            let origin = shape.centre() + aside - 3.0 * shape.bounding_radius() * direction;
            // By small steps of the distance.
            let mut s = 0.0;
            for _ in 0..20_000 {
                s += shape.signed_distance(origin + s * direction).0.min(shape.bounding_radius());
            }
            let passes = s > 6.0 * shape.bounding_radius();
            let entry = shape.line_entry(origin, direction, 1.0);
            assert_eq!(entry.is_none(), passes, "{shape:?} {k}");
            if let Some(entry) = entry {
                met += 1;
                let slope = entry.normal.dot(direction);
                assert!((entry.distance - s).abs() * slope.abs() < 1e-9, "{shape:?}: {} {s}", entry.distance);
                let (_, gradient) = shape.signed_distance(origin + entry.distance * direction);
                assert!(entry.normal.distance(gradient) < 1e-6);
            }
        }
        assert!(met > 3);
    }
}

#[test]
fn a_sphere_of_triangles_is_a_sphere() {
    let radius = 0.008;
    let (vertices, triangles) = sphere_mesh(radius, 5);
    // Turned inwards: it is turned back.
    let inwards: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [b, a, c]).collect();
    for triangles in [triangles, inwards] {
        let shape = ToolShape::Surface(Box::new(SurfaceShape::new(&vertices, &triangles).unwrap()));
        let spacing = 2.0 * radius / 48.0;
        for (k, direction) in directions(200).enumerate() {
            let point = direction * radius * (0.3 + 0.005 * k as f64);
            let (distance, gradient) = shape.signed_distance(point);
            // Facets lie up to 1e-3 R inside the sphere.
            let error = (distance - (point.length() - radius)).abs();
            // Beyond the grid what is told is only a bound.
            assert!(error < 2e-2 * radius, "{k}: {distance}");
            if point.length() < radius + 2.0 * spacing {
                assert!(error < 1.2e-3 * radius, "{k}: {distance}");
                assert!(gradient.distance(direction) < 0.03, "{k}: {}", gradient.distance(direction));
            }
            let entry = shape.line_entry(2.0 * radius * direction, -direction, 1.0).unwrap();
            assert!((entry.distance - radius).abs() < 1.2e-3 * radius);
            assert!((0.0..0.02).contains(&(shape.support(direction).dot(direction) / radius - 1.0)));
        }
        assert!((shape.bounding_radius() / radius - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_distance_of_a_surface_has_a_continuous_gradient() {
    let (vertices, triangles) = sphere_mesh(0.008, 4);
    let shape = SurfaceShape::new(&vertices, &triangles).unwrap();
    let (from, to) = (DVec3::new(-0.007, 0.001, 0.002), DVec3::new(0.007, 0.0013, 0.0024));
    let (mut before, steps) = (shape.signed_distance(from).1, 20_000);
    for k in 1..=steps {
        let (_, gradient) = shape.signed_distance(from.lerp(to, k as f64 / steps as f64));
        // 0.7 um of a length of at least 2 mm, over which the gradient turns once.
        assert!(gradient.distance(before) < 2e-3, "{k}");
        before = gradient;
    }
}

#[test]
fn surfaces_that_are_none_are_refused() {
    let (vertices, triangles) = sphere_mesh(0.008, 1);
    let message = |vertices: &[DVec3], triangles: &[[u32; 3]]| {
        SurfaceShape::new(vertices, triangles).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(message(&vertices, &triangles[1..]).contains("open: 3 of its edges"));
    assert!(message(&vertices, &triangles[..3]).contains("3 triangles"));
    let mut turned = triangles.clone();
    turned[0].swap(0, 1);
    assert!(message(&vertices, &turned).contains("turned against"));
    let mut missing = triangles.clone();
    missing[5][1] = 1000;
    assert!(message(&vertices, &missing).contains("triangle 5"));
    let mut broken = vertices.clone();
    broken[3].x = f64::NAN;
    assert!(message(&broken, &triangles).contains("vertex 3"));
    let flat: Vec<DVec3> = vertices.iter().map(|v| v.with_z(0.0)).collect();
    assert!(message(&flat, &triangles).contains("no volume"));
}

#[test]
fn sizes_that_are_none_are_refused() {
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(ToolShape::sphere(wrong).is_err());
        assert!(ToolShape::ellipsoid(DVec3::new(1.0, wrong, 1.0)).is_err());
        assert!(ToolShape::capsule(1.0, wrong).is_err());
        assert!(ToolShape::punch(1.0, wrong).is_err());
    }
    assert!(ToolShape::punch(1.0, 1.5).unwrap_err().to_string().contains("more than its radius"));
}

/// A box of triangles, in the middle of its lengths.
pub(crate) fn box_mesh(lengths: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let side = |bit: u32, k: u32| if k >> bit & 1 == 1 { 0.5 } else { -0.5 };
    let vertices = (0..8).map(|k| lengths * DVec3::new(side(0, k), side(1, k), side(2, k))).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (vertices, faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

fn from_mesh((vertices, triangles): (Vec<DVec3>, Vec<[u32; 3]>)) -> ToolShape {
    ToolShape::Surface(Box::new(SurfaceShape::new(&vertices, &triangles).unwrap()))
}

fn files() -> [ToolShape; 2] {
    [from_mesh(sphere_mesh(0.008, 4)), from_mesh(box_mesh(DVec3::new(0.008, 0.006, 0.02)))]
}

#[test]
fn the_rounded_gradient_turns_as_its_differences_do() {
    for shape in shapes().into_iter().chain(files()) {
        let size = shape.thickness();
        for (k, direction) in directions(60).enumerate() {
            let on = shape.support(direction);
            let point = on + direction * size * (0.01 * k as f64 - 0.15);
            let (gradient, turning) = shape.rounded_gradient(point);
            assert_eq!(gradient, shape.rounded_direction(point));
            let h = 1e-5 * size;
            for axis in DVec3::AXES {
                let [ahead, behind] = [h, -h].map(|h| shape.rounded_gradient(point + h * axis).0);
                let error = ((ahead - behind) / (2.0 * h) - turning * axis).length();
                assert!(error < 1e-3 * turning.x_axis.length().max(1.0 / size), "{error:e} {shape:?} {point}");
            }
        }
    }
}

#[test]
fn sharp_tools_face_as_rounded_ones_do() {
    let lengths = DVec3::new(0.008, 0.006, 0.02);
    let (half, sharp) = (0.5 * lengths, from_mesh(box_mesh(lengths)));
    assert!((sharp.reach() / half.y - 1.0).abs() < 0.05, "{}", sharp.reach());
    // In the middle of a side it faces away from it, inside and outside.
    for height in [-0.5, -0.2, 0.0, 0.3] {
        let (direction, _) = sharp.rounded_gradient(DVec3::Y * half.y * (1.0 + height));
        assert!(direction.distance(DVec3::Y) < 1e-3, "{height} {direction}");
    }
    // Round an edge it turns by 90 degrees, never faster than around a quarter of the reach; the distance itself turns at once.
    let (mut before, step, steps) = (DVec3::Y, 1e-5, 500);
    let mut fastest = [0.0f64; 2];
    let mut exact = DVec3::Y;
    for k in 0..=2 * steps {
        let along = step * f64::from(k - steps);
        let point = half.with_z(0.0) + if k < steps { DVec3::X * along } else { DVec3::NEG_Y * along };
        let (direction, own) = (sharp.rounded_gradient(point).0, sharp.signed_distance(point).1);
        fastest = [fastest[0].max(direction.distance(before)), fastest[1].max(own.distance(exact))];
        (before, exact) = (direction, own);
    }
    assert!(before.distance(DVec3::X) < 0.15, "{before}");
    assert!(fastest[0] < step / (0.25 * sharp.reach()), "{fastest:?}");
    assert!(fastest[1] > 2.0 * fastest[0], "{fastest:?}");
    // A ball of triangles faces as a ball does, and a rounded punch as itself.
    let ball = from_mesh(sphere_mesh(0.008, 4));
    for (k, direction) in directions(100).enumerate() {
        let point = direction * 0.008 * (0.6 + 0.006 * k as f64);
        let off = ball.rounded_gradient(point).0.distance(direction);
        assert!(off < 0.05, "{point} {off}");
    }
    let punch = ToolShape::punch(0.006, 0.004).unwrap();
    let at = DVec3::new(0.0045, 0.002, -0.0005);
    assert_eq!(punch.rounded_gradient(at).0, punch.signed_distance(at).1);
}
