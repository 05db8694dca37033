//! Bodies for tests.

use glam::DVec3;
use palpate_core::fem::{Isotropic, Supports};
use palpate_core::green::Problem;
use palpate_core::mesh::TetMesh;

/// A cube of `n`^3 cells of five tetrahedra each, 0.1 m wide, clamped below.
pub fn cube(n: u32) -> Problem {
    let at = |i: u32, j: u32, k: u32| (i * (n + 1) + j) * (n + 1) + k;
    let mut nodes = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            for k in 0..=n {
                nodes.push(0.1 / f64::from(n) * DVec3::new(f64::from(i), f64::from(j), f64::from(k)));
            }
        }
    }
    let mut tets = Vec::new();
    for (i, j, k) in (0..n * n * n).map(|c| (c / (n * n), c / n % n, c % n)) {
        let corner = |b: u32| at(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2));
        // The two cuts of a cube alternate, so that the diagonals of neighbours meet.
        let cuts: [[u32; 4]; 5] = if (i + j + k) % 2 == 0 {
            [[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]]
        } else {
            [[1, 0, 5, 3], [2, 3, 6, 0], [4, 5, 0, 6], [7, 6, 3, 5], [0, 3, 5, 6]]
        };
        for cut in cuts {
            let [a, b, c, d] = cut.map(corner);
            let p = [a, b, c, d].map(|v| nodes[v as usize]);
            let positive = (p[1] - p[0]).cross(p[2] - p[0]).dot(p[3] - p[0]) > 0.0;
            tets.push(if positive { [a, b, c, d] } else { [b, a, c, d] });
        }
    }
    let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::new();
    for &[a, b, c, d] in &tets {
        for face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            let mut key = face;
            key.sort_unstable();
            faces.push((key, face));
        }
    }
    faces.sort_unstable();
    let triangles: Vec<[u32; 3]> = faces.chunk_by(|x, y| x.0 == y.0).filter(|c| c.len() == 1).map(|c| c[0].1).collect();
    let mut surface_nodes: Vec<u32> = triangles.iter().flatten().copied().collect();
    surface_nodes.sort_unstable();
    surface_nodes.dedup();
    let below = (0..nodes.len() as u32).filter(|&i| nodes[i as usize].z < 1e-9);
    let fixed: Vec<u32> = below.flat_map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let (elements, dofs) = (tets.len(), 3 * nodes.len());
    Problem {
        mesh: TetMesh::new(nodes, tets).expect("a valid mesh"),
        materials: vec![Isotropic::new(10e3, 0.4, 1000.0).expect("a valid material"); elements],
        supports: Supports::new(dofs, fixed).expect("valid supports"),
        touch: (0..surface_nodes.len() as u32).collect(),
        loads: Vec::new(),
        surface_nodes,
        surface_faces: triangles.into(),
    }
}
