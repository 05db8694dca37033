//! A tick never allocates: counted, through contact, sliding target, release and a bad number.
#![allow(unsafe_code)] // a counting allocator

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;
use palpate_core::dynamics::{Model as Modes, Newmark, Rayleigh};
use palpate_core::fem::{Isotropic, Supports};
use palpate_core::green::{Precision, Problem, precompute};
use palpate_core::mesh::{Faces, TetMesh, Tets};
use palpate_core::simulation::{Dynamics, Input, MAX_TOOLS, Model, Snapshot, Strike};
use palpate_devices::DeviceState;
use palpate_servo::{SafetyLimits, Ticker};

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        COUNT.with(|c| c.set(c.get() + 1));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A cube of `n`^3 cells of five tetrahedra each, 0.1 m wide, clamped below.
fn cube(n: u32) -> Problem {
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
        // The two ways of cutting a cube alternate, so that the diagonals of neighbours meet.
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

/// The same body in 10-node tetrahedra, with the middles of its edges after its nodes.
fn raised(linear: Problem) -> Problem {
    let (Tets::Linear(tets), Faces::Linear(triangles)) = (&linear.mesh.tets, &linear.surface_faces) else {
        panic!("4-node tetrahedra")
    };
    let mut nodes = linear.mesh.nodes.clone();
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            nodes.push(0.5 * (nodes[a as usize] + nodes[b as usize]));
            nodes.len() as u32 - 1
        })
    };
    let edges = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
    let tets: Vec<[u32; 10]> = tets
        .iter()
        .map(|t| std::array::from_fn(|k| if k < 4 { t[k] } else { middle(t[edges[k - 4][0]], t[edges[k - 4][1]]) }))
        .collect();
    let faces: Vec<[u32; 6]> = triangles
        .iter()
        .map(|t| std::array::from_fn(|k| if k < 3 { t[k] } else { middle(t[k - 3], t[(k - 2) % 3]) }))
        .collect();
    let mut surface_nodes = faces.as_flattened().to_vec();
    surface_nodes.sort_unstable();
    surface_nodes.dedup();
    let below = (0..nodes.len() as u32).filter(|&i| nodes[i as usize].z < 1e-9);
    let fixed: Vec<u32> = below.flat_map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Problem {
        supports: Supports::new(3 * nodes.len(), fixed).expect("valid supports"),
        mesh: TetMesh::new(nodes, tets).expect("a valid mesh"),
        materials: linear.materials,
        touch: (0..surface_nodes.len() as u32).collect(),
        loads: Vec::new(),
        surface_nodes,
        surface_faces: faces.into(),
    }
}

#[test]
fn a_tick_never_allocates_and_repeats_its_bits() {
    exercise(&cube(6));
}

#[test]
fn a_tick_of_a_body_in_motion_never_allocates() {
    let green = Arc::new(precompute(&cube(4), Precision::F32, &|_, _| true).expect("a solvable cube"));
    let dofs = 3 * green.surface_count();
    // Any shapes will do: what is counted does not depend on them.
    let modes = 20;
    let eigenvalues: Vec<f64> = (0..modes).map(|i| 1e3 * f64::from(i + 1)).collect();
    let shapes: Vec<f64> = (0..dofs * modes as usize).map(|i| (0.1 * i as f64).sin()).collect();
    let (newmark, rayleigh) = (Newmark::new(1e-3, 0.3025, 0.6).expect("valid"), Rayleigh::default());
    let modes = Modes::new(&eigenvalues, &shapes, &rayleigh, 1e-3, |k, c| newmark.mode_step(k, c)).expect("valid");
    let model = Model::new(green, 0.005, 5000.0).expect("a valid model");
    let model = model.with_dynamics(Dynamics::new(modes, 500.0).expect("valid")).expect("rows that match");
    let strike = Strike { point: DVec3::new(0.02, 0.02, 0.1), impulse: DVec3::new(0.0, 0.0, -1e-4), duration: 3e-3 };
    exercise_model(Arc::new(model), |tick| (tick % 300 == 100).then_some(strike));
}

#[test]
fn a_tick_on_quadratic_elements_never_allocates() {
    exercise(&raised(cube(4)));
}

fn exercise(problem: &Problem) {
    let green = precompute(problem, Precision::F32, &|_, _| true).expect("a solvable cube");
    exercise_model(Arc::new(Model::new(Arc::new(green), 0.005, 5000.0).expect("a valid model")), |_| None);
}

fn exercise_model(model: Arc<Model>, strike: impl Fn(usize) -> Option<Strike>) {
    let settings = Input { contact_radius: 0.02, ..Input::default() };
    let path = |tick: usize| {
        let t = tick as f64 * 1e-3;
        let depth = 0.012 * (6.0 * t).sin();
        DVec3::new(0.03 + 0.02 * t, 0.05, 0.105 - depth)
    };
    let mut runs = [Vec::with_capacity(2000), Vec::with_capacity(2000)];
    let mut touched = 0;
    for run in &mut runs {
        let mut ticker = Ticker::new(model.clone(), SafetyLimits::default());
        let mut snapshot = Snapshot::new(&model);
        let before = COUNT.with(Cell::get);
        for tick in 0..2000 {
            let mut devices = [DeviceState::default(); MAX_TOOLS];
            let grab = (1200..1500).contains(&tick);
            let position = if tick == 1990 { DVec3::splat(f64::NAN) } else { path(tick) };
            devices[0] = DeviceState { position, active: true, grab, ..DeviceState::default() };
            devices[1] = DeviceState { position: DVec3::new(0.07, 0.05, 0.101), active: tick > 500, ..devices[1] };
            let output = ticker.tick(&devices, &Input { strike: strike(tick), ..settings }, 1e-3);
            ticker.snapshot_into(&mut snapshot);
            touched += usize::from(output.forces[0].z > 0.0);
            run.push(output.forces.map(|f| f.to_array().map(f64::to_bits)));
        }
        assert_eq!(COUNT.with(Cell::get), before, "a tick allocated");
    }
    assert!(touched > 1000, "the tool hardly touched: {touched}");
    assert_eq!(runs[0], runs[1]);
    assert_eq!(runs[0][1999][0], [0; 3], "a latched fault must keep the force at zero");
}
