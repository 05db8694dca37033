//! Contact weights `int N_i phi dA / int phi dA` against integrals done another way, on flat and curved faces.

use glam::DVec3;
use palpate_core::contact::{Patch, PatchGeometry, PatchScratch, SurfacePoint, SurfaceQuery, patch_weights};
use palpate_core::element::{Face, Tri6};
use palpate_core::mesh::{Faces, Surface};

/// Squares to a side of the unit square.
const CELLS: u32 = 6;

/// The unit square lifted to `z = bend (x^2 + y^2)`, in faces of 3 or 6 nodes; quadratic faces follow it exactly.
fn sheet(quadratic: bool, bend: f64) -> Surface {
    let side = 2 * CELLS + 1;
    let node = |i: u32, j: u32| i * side + j;
    let mut positions = Vec::new();
    for (i, j) in (0..side * side).map(|k| (k / side, k % side)) {
        let (x, y) = (f64::from(i) / f64::from(side - 1), f64::from(j) / f64::from(side - 1));
        positions.push(DVec3::new(x, y, bend * (x * x + y * y)));
    }
    let mut faces = Vec::new();
    for (i, j) in (0..CELLS * CELLS).map(|k| (2 * (k / CELLS), 2 * (k % CELLS))) {
        faces.push([(i, j), (i + 2, j), (i + 2, j + 2), (i + 1, j), (i + 2, j + 1), (i + 1, j + 1)]);
        faces.push([(i, j), (i + 2, j + 2), (i, j + 2), (i + 1, j + 1), (i + 1, j + 2), (i, j + 1)]);
    }
    let faces: Vec<[u32; 6]> = faces.into_iter().map(|f| f.map(|(i, j)| node(i, j))).collect();
    let faces = if quadratic {
        Faces::Quadratic(faces)
    } else {
        Faces::Linear(faces.iter().map(|f| [f[0], f[1], f[2]]).collect())
    };
    Surface::new(positions, faces).expect("a valid surface")
}

fn weigh(surface: &Surface, centre: &SurfacePoint, radius: f64) -> Patch {
    let (geometry, mut scratch, mut patch) =
        (PatchGeometry::new(surface), PatchScratch::new(surface), Patch::default());
    patch_weights(surface, &geometry, centre, radius, &mut scratch, &mut patch).expect("not too many nodes");
    patch
}

fn weights(surface: &Surface, centre: &SurfacePoint, radius: f64) -> Vec<(DVec3, f64)> {
    weigh(surface, centre, radius).iter().map(|(node, weight)| (surface.positions[node], weight)).collect()
}

fn touch(surface: &Surface, x: f64, y: f64, z: f64) -> SurfacePoint {
    let query = SurfaceQuery::new(surface).expect("a searchable surface");
    query.closest(surface, DVec3::new(x, y, z)).expect("a finite point")
}

fn mean(weights: &[(DVec3, f64)], field: impl Fn(DVec3) -> f64) -> f64 {
    weights.iter().map(|&(x, w)| w * field(x)).sum()
}

#[test]
fn weights_sum_to_one_and_reproduce_what_the_faces_can() {
    for quadratic in [false, true] {
        let surface = sheet(quadratic, 0.0);
        for (x, y, radius) in [(0.47, 0.52, 0.2), (0.5, 0.5, 0.31), (0.61, 0.44, 0.02), (0.5, 1.0 / 3.0, 0.1)] {
            let weights = weights(&surface, &touch(&surface, x, y, 0.0), radius);
            assert!((mean(&weights, |_| 1.0) - 1.0).abs() < 1e-13);
            assert!((mean(&weights, |p| p.x) - x).abs() < 1e-3 * radius);
            if quadratic {
                // The second moment of the mask (1 - r^2/a^2)^2 about its middle is a^2/8 a direction.
                let second = mean(&weights, |p| (p.x - x) * (p.x - x));
                assert!((second / (radius * radius) - 0.125).abs() < 2e-3, "{second} {radius}");
            }
        }
    }
}

#[test]
fn weights_on_curved_faces_equal_the_integral_over_the_true_surface() {
    let (bend, x, y, radius) = (0.6, 0.47, 0.55, 0.3);
    let surface = sheet(true, bend);
    let lifted = |x: f64, y: f64| DVec3::new(x, y, bend * (x * x + y * y));
    let centre = touch(&surface, x, y, lifted(x, y).z);
    // The contact point on the face itself, found by the limit of a vanishing patch.
    let point = weights(&surface, &centre, 0.0).iter().map(|&(p, w)| p * w).sum::<DVec3>();
    assert!((point - lifted(point.x, point.y)).length() < 1e-14, "the point is on the paraboloid");
    assert!((point - centre.position).length() < 3e-3, "off the drawn triangle by its sagitta");
    let patch = weights(&surface, &centre, radius);
    let (mut total, mut sums) = (0.0, [0.0; 3]);
    let count = 2000;
    for (i, j) in (0..count * count).map(|k| (k / count, k % count)) {
        let (u, v) = ((f64::from(i) + 0.5) / f64::from(count), (f64::from(j) + 0.5) / f64::from(count));
        let place = lifted(u, v);
        let inside = 1.0 - (place - point).length_squared() / (radius * radius);
        if inside > 0.0 {
            let weight = inside * inside * (1.0 + 4.0 * bend * bend * (u * u + v * v)).sqrt();
            total += weight;
            for (sum, value) in sums.iter_mut().zip([u, v, place.z]) {
                *sum += weight * value;
            }
        }
    }
    for (axis, sum) in sums.into_iter().enumerate() {
        let error = mean(&patch, |p| p[axis]) - sum / total;
        assert!(error.abs() < 1e-3 * radius, "axis {axis}: {error:e}");
    }
    // Against the flat triangles of the corners the curvature shows.
    let flat = sheet(false, bend);
    let flat_centre = touch(&flat, x, y, lifted(x, y).z);
    assert!((mean(&weights(&flat, &flat_centre, radius), |p| p.z) - sums[2] / total).abs() > 2e-3 * radius);
}

#[test]
fn weights_become_the_shape_functions_as_the_radius_vanishes() {
    for bend in [0.0, 0.4] {
        let surface = sheet(true, bend);
        let Faces::Quadratic(faces) = &surface.faces else { panic!("quadratic faces") };
        for part in 0..4u32 {
            let triangle = 4 * 31 + part;
            let barycentric = [0.2, 0.5, 0.3];
            let centre = SurfacePoint { triangle, barycentric, ..SurfacePoint::default() };
            let corners = Tri6::PARTS[part as usize].map(|k| Tri6::NODES[k]);
            let shapes = Tri6::shapes(corners[0] * 0.2 + corners[1] * 0.5 + corners[2] * 0.3);
            let mut previous = f64::INFINITY;
            for radius in [1e-2, 1e-3, 1e-6, 0.0] {
                let patch = weigh(&surface, &centre, radius);
                let expected = |node| faces[31].iter().position(|&n| n as usize == node).map_or(0.0, |k| shapes[k]);
                let error = patch.iter().map(|(node, w)| (w - expected(node)).abs()).fold(0.0, f64::max);
                assert!(error < 30.0 * radius + 1e-12, "radius {radius}: {error:e}");
                assert!(error <= previous);
                previous = error;
            }
        }
    }
}

#[test]
fn weights_are_continuous_where_drawn_triangles_and_faces_meet() {
    let surface = sheet(true, 0.5);
    let step = 1e-7;
    for radius in [0.05, 0.2] {
        // Across a drawn triangle's edge inside a face, and across a face's own.
        for x in [0.5 + 1.0 / 24.0, 0.5] {
            let sides = [-step, step].map(|d| {
                let centre = touch(&surface, x + d, 0.53, 0.5 * ((x + d) * (x + d) + 0.53 * 0.53));
                let patch = weigh(&surface, &centre, radius);
                let mut of_node = vec![0.0; surface.positions.len()];
                patch.iter().for_each(|(node, w)| of_node[node] = w);
                of_node
            });
            let jump = sides[0].iter().zip(&sides[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(jump < 1e-3, "jump of {jump:e} at {x}, radius {radius}");
        }
    }
}
