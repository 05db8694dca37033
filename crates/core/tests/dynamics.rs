//! A modal step never allocates, repeats its bits, and its parts fit together.
#![allow(unsafe_code)] // a counting allocator

#[path = "common/counting_allocator.rs"]
mod counting_allocator;

use counting_allocator::allocations;
use glam::{DMat3, DVec3};
use palpate_core::dynamics::{
    EnergyAccount, Integration, Lanes, LoadedPatch, ModalModel, Newmark, Projection, Rayleigh,
};

const MODES: usize = 37;
const ROWS: usize = 30;

/// Modes with made-up shapes; their number fills no group of lanes.
fn model(integration: Integration) -> ModalModel {
    let eigenvalues: Vec<f64> = (0..MODES).map(|i| if i == 0 { 0.0 } else { 300.0 * (i * i) as f64 }).collect();
    let shapes: Vec<f64> = (0..MODES * ROWS).map(|i| ((i * 7919 % 1000) as f64 / 500.0 - 1.0) * 3.0).collect();
    let rayleigh = Rayleigh { mass: 1.0, stiffness: 1e-4 };
    ModalModel::new(&eigenvalues, &shapes, &rayleigh, integration).expect("a valid model")
}

fn newmark() -> Integration {
    Integration::Newmark(Newmark::new(1e-3, 0.3025, 0.6).expect("a valid scheme"))
}

const LINEAR: Integration = Integration::ExactLinear { dt: 1e-3 };
const HELD: Integration = Integration::ExactHeld { dt: 1e-3, weight: 0.6 };

fn bits(x: &[Lanes]) -> Vec<u64> {
    x.iter().flat_map(|g| g.0).map(f64::to_bits).collect()
}

#[test]
fn steps_never_allocate_and_repeat_their_bits() {
    let patch: Vec<(usize, f64)> = (0..7).map(|i| (3 * i, 0.2 - 0.01 * i as f64)).collect();
    for integration in [newmark(), LINEAR, HELD] {
        let model = model(integration);
        let end = || steps_of(&model, &patch);
        assert_eq!(end(), end());
    }
}

fn steps_of(model: &ModalModel, patch: &[(usize, f64)]) -> Vec<u64> {
    let (mut state, mut scratch) = (model.state(), model.scratch());
    let (mut account, mut pressed) = (EnergyAccount::new(model, &state), Projection::new(model));
    let mut predicted = model.predicted_state();
    let mut seen = [0.0; 2];
    let before = allocations();
    for tick in 0..500 {
        let t = f64::from(tick) * 1e-3;
        // A row that does not exist is left out, never a panic.
        model.step(&mut state, &mut scratch, &[(4, (9.0 * t).sin()), (5, 0.1), (u32::MAX, 1.0)]);
        account.book(model, &state);
        pressed.gather(model, patch.iter().copied());
        model.advance(&mut predicted, &mut [LoadedPatch::new(&pressed, DVec3::new(0.0, 1e-3, -t * 1e-2))]);
        model.read(&state.q, [0, 5].into_iter(), &mut seen);
    }
    assert_eq!(allocations(), before, "a step allocated");
    assert!(seen.iter().all(|x| x.is_finite() && *x != 0.0));
    [bits(&state.q), bits(&predicted.free_q)].concat()
}

#[test]
fn bad_numbers_never_panic() {
    let model = model(newmark());
    let (mut state, mut scratch) = (model.state(), model.scratch());
    let (mut patch, mut predicted) = (Projection::new(&model), model.predicted_state());
    patch.gather(&model, [(0, f64::NAN), (usize::MAX - 2, 1.0)].into_iter());
    let mut loaded = [LoadedPatch::new(&patch, DVec3::NAN)];
    model.advance(&mut predicted, &mut loaded);
    assert!(loaded[0].free.is_nan());
    model.step(&mut state, &mut scratch, &[(0, f64::INFINITY)]);
}

/// `u_new = u_free + step_compliance f`, whichever scheme makes the coefficients; and statics for a load held long.
#[test]
fn a_patch_moves_by_its_free_motion_and_its_compliance() {
    for integration in [newmark(), LINEAR, HELD] {
        let model = model(integration);
        let (mut state, mut scratch) = (model.state(), model.scratch());
        for _ in 0..20 {
            model.step(&mut state, &mut scratch, &[(2, 0.3), (17, -0.2)]);
        }
        let mut patches = [Projection::new(&model), Projection::new(&model)];
        patches[0].gather(&model, [(0, 0.5), (6, 0.3), (12, 0.2)].into_iter());
        patches[1].gather(&model, [(15, 0.6), (18, 0.4)].into_iter());
        let [here, there] = &patches;
        let force = DVec3::new(0.2, -0.4, 0.7);
        model.predict(&mut state);
        let free = here.read(&model, &state.q);
        scratch.fill(Lanes::default());
        there.add_force(&model, force, &mut scratch);
        model.correct(&mut state, &scratch);
        let moved = here.read(&model, &state.q) - free;
        let expected = here.step_compliance(&model, there) * force;
        assert!((moved - expected).length() < 1e-12 * expected.length().max(1e-6), "{moved} {expected}");
        let back = there.step_compliance(&model, here).transpose();
        assert!(max_abs(here.step_compliance(&model, there) - back) < 1e-12 * max_abs(back));
    }
}

/// The pass that keeps one step ahead is `predict` and `correct`, for any number of patches that carry a force.
#[test]
fn a_predicted_motion_is_the_same_motion() {
    for integration in [newmark(), HELD] {
        is_the_same_motion(&model(integration));
    }
}

fn is_the_same_motion(model: &ModalModel) {
    let patches: Vec<Projection> = (0..5)
        .map(|i| {
            let mut patch = Projection::new(model);
            patch.gather(model, [(3 * i, 0.7), (3 * i + 12, 0.3)].into_iter());
            patch
        })
        .collect();
    for count in 0..=patches.len() {
        let (mut state, mut scratch, mut predicted) = (model.state(), model.scratch(), model.predicted_state());
        let mut account = EnergyAccount::new(model, &state);
        let mut dissipated = 0.0;
        for tick in 0..50 {
            let forces: Vec<DVec3> =
                (0..count).map(|i| DVec3::new(0.3, -0.1, (0.2 * f64::from(tick) + i as f64).sin())).collect();
            let mut loaded: Vec<LoadedPatch> =
                patches.iter().zip(&forces).map(|(patch, &force)| LoadedPatch::new(patch, force)).collect();
            let advanced = model.advance(&mut predicted, &mut loaded);
            model.predict(&mut state);
            scratch.fill(Lanes::default());
            for (patch, &force) in patches.iter().zip(&forces) {
                patch.add_force(model, force, &mut scratch);
            }
            model.correct(&mut state, &scratch);
            account.book(model, &state);
            dissipated += advanced.dissipated;
            assert_eq!(bits(&predicted.q), bits(&state.q));
            assert_eq!(bits(&predicted.v), bits(&state.v));
            let energies = account.energies(model, &state);
            for (got, want) in [
                (advanced.kinetic, energies.kinetic),
                (advanced.strain, energies.strain),
                (dissipated, energies.dissipated),
            ] {
                assert!((got - want).abs() <= 1e-12 * energies.work, "{got} {want}");
            }
            for patch in &loaded {
                let expected = patch.projection.read(model, &predicted.free_q);
                assert!((patch.free - expected).length() <= 1e-12 * expected.length());
            }
        }
    }
}

#[test]
fn static_compliance_is_where_a_held_force_ends() {
    let model = model(newmark());
    let mut patch = Projection::new(&model);
    patch.gather(&model, [(0, 0.5), (6, 0.5)].into_iter());
    let (mut state, mut scratch) = (model.state(), model.scratch());
    let force = DVec3::new(0.0, 0.1, 0.4);
    for _ in 0..60_000 {
        model.predict(&mut state);
        scratch.fill(Lanes::default());
        patch.add_force(&model, force, &mut scratch);
        // The first mode is rigid: it would fly away.
        scratch[0].0[0] = 0.0;
        model.correct(&mut state, &scratch);
    }
    let expected = patch.static_compliance(&model, &patch) * force;
    let got = patch.read(&model, &state.q);
    assert!((got - expected).length() < 1e-9 * expected.length(), "{got} {expected}");
    assert!(patch.read(&model, &state.v).length() < 1e-9);
}

fn max_abs(m: DMat3) -> f64 {
    m.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max)
}

fn subnormals(x: &[Lanes]) -> usize {
    x.iter().flat_map(|group| group.0).filter(|x| x.is_subnormal()).count()
}

/// A body that is struck and left alone: its motion ends at zero, and on the way there it is never of subnormal numbers,
/// with which an operation takes a hundred times as long on many processors.
#[test]
fn a_motion_decays_to_zero_without_subnormal_numbers() {
    let eigenvalues: Vec<f64> = (1..=MODES).map(|i| 300.0 * (i * i) as f64).collect();
    let shapes: Vec<f64> = (0..MODES * ROWS).map(|i| ((i * 7919 % 1000) as f64 / 500.0 - 1.0) * 3.0).collect();
    // All modes lose a factor of e within a hundred steps: as long as minutes of an organ's.
    let rayleigh = Rayleigh { mass: 40.0, stiffness: 1e-3 };
    for integration in [newmark(), LINEAR, HELD] {
        let model = ModalModel::new(&eigenvalues, &shapes, &rayleigh, integration).expect("a valid model");
        let (mut state, mut scratch, mut predicted) = (model.state(), model.scratch(), model.predicted_state());
        let mut struck = Projection::new(&model);
        struck.gather(&model, [(3, 1.0)].into_iter());
        for tick in 0..60_000 {
            let force = if tick == 0 { 1.0 } else { 0.0 };
            model.step(&mut state, &mut scratch, &[(4, force)]);
            let mut loaded = [LoadedPatch::new(&struck, DVec3::splat(force))];
            let energy = model.advance(&mut predicted, &mut loaded);
            let vectors = [&state.q, &state.v, &predicted.q, &predicted.v, &predicted.free_q, &predicted.free_v];
            assert_eq!(vectors.map(|x| subnormals(x)), [0; 6], "{integration:?}, step {tick}");
            let energies = [energy.kinetic, energy.strain, energy.dissipated, loaded[0].free.x];
            assert!(!energies.into_iter().any(f64::is_subnormal), "{integration:?}, step {tick}: {energies:?}");
        }
        assert!(bits(&predicted.q).into_iter().chain(bits(&state.q)).all(|bits| f64::from_bits(bits) == 0.0));
    }
}
