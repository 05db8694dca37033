//! Modal motion predicted one step ahead, so that a tick reads and writes every mode once.
//!
//! A step is a free motion and what new forces add to it. The free motion of the next step follows from the end of this
//! one, so a single pass adds the forces, predicts, and reads what the prediction makes of the loaded patches. At
//! the next tick their forces are known from a 3x3 solve alone.
//!
//! The pass takes blocks of modes through all its loops: what a block touches stays in the first-level cache, and each
//! loop is small enough for its sums to stay in registers (one loop over everything was half as fast).

use glam::DVec3;
use pulp::NullaryFnOnce;

use super::kernels::{AddRows, Correct, EnergySums, Predict, Read, WorkSums};
use super::lanes::Lanes;
use super::model::ModalModel;
use super::projection::Projection;
use crate::dynamics::integration::Integration;

/// Groups of modes a block: about 20 arrays of them fill half of a first-level cache.
const BLOCK: usize = 16;

/// A motion and where it goes without new forces.
#[derive(Clone, Debug)]
pub struct PredictedState {
    /// Modal displacements now, m sqrt(kg).
    pub q: Vec<Lanes>,
    /// Modal velocities now, m sqrt(kg)/s.
    pub v: Vec<Lanes>,
    /// Displacements at the end of the next step if no force acts there.
    pub free_q: Vec<Lanes>,
    /// Velocities there.
    pub free_v: Vec<Lanes>,
    /// Modal forces now, N/sqrt(kg), where they are held within a step; else nothing reads them.
    load: Vec<Lanes>,
    /// Kinetic and strain energy now, J.
    energy: f64,
}

/// A patch under a force, and where it goes.
#[derive(Clone, Copy)]
pub struct LoadedPatch<'a> {
    /// Its rows.
    pub projection: &'a Projection,
    /// Force at the end of the step, N.
    pub force: DVec3,
    /// Mean displacement in the free motion of the next step, m; written by the step.
    pub free: DVec3,
    sums: [Lanes; 3],
}

/// What a step leaves.
#[derive(Clone, Copy, Debug)]
pub struct StepEnergy {
    /// `v M v / 2` at the step's end, J.
    pub kinetic: f64,
    /// `u K u / 2` there, J.
    pub strain: f64,
    /// What damping took out within the step, J: by Newmark's scheme at the mean velocity; of exact modes what they do not hold
    /// of the work done on them.
    pub dissipated: f64,
}

impl<'a> LoadedPatch<'a> {
    /// A patch and its force.
    pub fn new(projection: &'a Projection, force: DVec3) -> Self {
        Self { projection, force, free: DVec3::ZERO, sums: Default::default() }
    }
}

impl ModalModel {
    /// At rest.
    pub fn predicted_state(&self) -> PredictedState {
        let zero = || vec![Lanes::default(); self.groups];
        PredictedState { q: zero(), v: zero(), free_q: zero(), free_v: zero(), load: zero(), energy: 0.0 }
    }

    /// Ends the step by the forces of patches, and predicts the next one.
    pub fn advance(&self, state: &mut PredictedState, patches: &mut [LoadedPatch<'_>]) -> StepEnergy {
        let [kinetic, strain, third] = self.arch.dispatch(Advance { model: self, state, patches });
        for patch in patches {
            patch.free = DVec3::from(patch.sums.map(Lanes::sum));
        }
        let (kinetic, strain, before) = (0.5 * kinetic, 0.5 * strain, state.energy);
        state.energy = kinetic + strain;
        let dissipated = match self.integration {
            Integration::ExactHeld { .. } => third - (state.energy - before),
            _ => 0.25 * self.dt * third,
        };
        StepEnergy { kinetic, strain, dissipated }
    }
}

impl PredictedState {
    /// Comes to rest.
    pub fn rest(&mut self) {
        for x in [&mut self.q, &mut self.v, &mut self.free_q, &mut self.free_v, &mut self.load] {
            x.fill(Lanes::default());
        }
        self.energy = 0.0;
    }
}

/// The pass.
struct Advance<'a, 'b> {
    model: &'a ModalModel,
    state: &'a mut PredictedState,
    patches: &'a mut [LoadedPatch<'b>],
}

impl NullaryFnOnce for Advance<'_, '_> {
    type Output = [f64; 3];
    #[inline(always)]
    fn call(self) -> [f64; 3] {
        let Self { model, state, patches } = self;
        let mut sums = [Lanes::default(); 3];
        let mut load = [Lanes::default(); BLOCK];
        for start in (0..model.groups).step_by(BLOCK) {
            let block = start..model.groups.min(start + BLOCK);
            let load = &mut load[..block.len()];
            load.fill(Lanes::default());
            for patch in patches.iter() {
                let rows = patch.projection.rows().map(|row| &row[block.clone()]);
                AddRows { load, rows, forces: patch.force.to_array() }.call();
            }
            let [q, v] = [&mut state.q, &mut state.v].map(|x| &mut x[block.clone()]);
            let [free_q, free_v] = [&mut state.free_q, &mut state.free_v].map(|x| &mut x[block.clone()]);

            // The step's end, in place of the free motion.
            let (q_load, v_load) = (&model.q_load[block.clone()], &model.v_load[block.clone()]);
            Correct { q_load, v_load, q: free_q, v: free_v, load }.call();
            let (stiffness, damping) = (&model.stiffness[block.clone()], &model.damping[block.clone()]);
            sums = match model.integration {
                Integration::ExactHeld { weight, .. } => {
                    let before = &mut state.load[block.clone()];
                    let loads = [&*before, &*load];
                    let sums = WorkSums { q: free_q, v: free_v, before: q, stiffness, loads, weight, sums }.call();
                    before.copy_from_slice(load);
                    sums
                }
                _ => EnergySums { q: free_q, v: free_v, before: v, stiffness, damping, sums }.call(),
            };
            q.copy_from_slice(free_q);
            v.copy_from_slice(free_v);

            // The next one, and what it makes of the patches.
            Predict { steps: &model.free_steps[block.clone()], q: free_q, v: free_v, load }.call();
            for patch in patches.iter_mut() {
                let rows = patch.projection.rows().map(|row| &row[block.clone()]);
                patch.sums = Read { rows, x: free_q, sums: patch.sums }.call();
            }
        }
        sums.map(Lanes::sum)
    }
}
