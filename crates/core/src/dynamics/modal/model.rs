//! Motion by modes: `ModalModel` is fixed, `ModalState` evolves. Nothing here allocates in a step.
//!
//! `u = Phi q` with `Phi^T M Phi = I` and `Phi^T K Phi = diag(k)`. A step is `predict`, the motion under no new force,
//! then `correct` by the modal force `p = Phi^T F` at the step's end. Between both a contact may ask for the free motion
//! and choose its force: the new displacement is `u_free + [Phi diag(q_load) Phi^T] F`.

use pulp::Arch;

use super::kernels::{AddRows, Correct, Dot, FreeStep, Predict};
use super::lanes::{LANES, Lanes, grouped};
use crate::dynamics::integration::Integration;
use crate::dynamics::scheme::Rayleigh;
use crate::memory::Ranges;
use crate::{Error, Result};

/// Modes, the rows of their shapes at the wanted dofs, and the step of each mode.
pub struct ModalModel {
    pub(super) arch: Arch,
    pub(super) groups: usize,
    modes: usize,
    rows: usize,
    /// Shapes at each row, modes contiguous; 1/sqrt(kg).
    shapes: Vec<Lanes>,
    /// Eigenvalues `omega^2`, 1/s^2; zero where a group is filled up.
    pub(super) stiffness: Vec<Lanes>,
    /// Their inverses, s^2; zero for rigid modes.
    pub(super) flexibility: Vec<Lanes>,
    /// Damping of each mode, 1/s.
    pub(super) damping: Vec<Lanes>,
    pub(super) free_steps: Vec<FreeStep>,
    /// What a unit of modal force at the step's end adds to the displacement, s^2, and to the velocity, s.
    pub(super) q_load: Vec<Lanes>,
    pub(super) v_load: Vec<Lanes>,
    /// Which step they take.
    pub integration: Integration,
    /// Time step, s.
    pub dt: f64,
}

/// Where the motion is.
#[derive(Clone, Debug)]
pub struct ModalState {
    /// Modal displacements, m sqrt(kg).
    pub q: Vec<Lanes>,
    /// Modal velocities, m sqrt(kg)/s.
    pub v: Vec<Lanes>,
    /// Modal force at this time, N/sqrt(kg).
    pub load: Vec<Lanes>,
    /// Steps made.
    pub steps: u64,
}

impl ModalModel {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        for lanes in [&self.shapes, &self.stiffness, &self.flexibility, &self.damping, &self.q_load, &self.v_load] {
            ranges.add(lanes);
        }
        ranges.add(&self.free_steps);
    }

    /// Prepares the recurrences.
    ///
    /// `shapes` holds `rows` x modes numbers, row by row.
    ///
    /// # Errors
    /// Lengths that do not match, or a number that is not finite.
    pub fn new(eigenvalues: &[f64], shapes: &[f64], rayleigh: &Rayleigh, integration: Integration) -> Result<Self> {
        let modes = eigenvalues.len();
        if modes == 0 || !shapes.len().is_multiple_of(modes) {
            return Err(Error::Invalid(format!("{} shape values do not fit {modes} modes", shapes.len())));
        }
        if !eigenvalues.iter().all(|k| k.is_finite() && *k >= 0.0) || !shapes.iter().all(|s| s.is_finite()) {
            return Err(Error::Invalid("eigenvalues must not be negative and shapes must be finite".into()));
        }
        let groups = modes.div_ceil(LANES);
        let damping: Vec<f64> = eigenvalues.iter().map(|&k| rayleigh.modal(k)).collect();
        let mut free_steps = vec![FreeStep::default(); groups];
        let [mut q_load, mut v_load] = [(); 2].map(|()| vec![Lanes::default(); groups]);
        for (i, (&k, &c)) in eigenvalues.iter().zip(&damping).enumerate() {
            let (m, g, l) = (integration.mode_step(k, c), i / LANES, i % LANES);
            let to = &mut free_steps[g];
            (to.qq.0[l], to.qv.0[l], to.qp.0[l]) = (m.qq, m.qv, m.qp);
            (to.vq.0[l], to.vv.0[l], to.vp.0[l]) = (m.vq, m.vv, m.vp);
            (q_load[g].0[l], v_load[g].0[l]) = (m.q_load, m.v_load);
        }
        let flexibility: Vec<f64> = eigenvalues.iter().map(|&k| if k > 0.0 { 1.0 / k } else { 0.0 }).collect();
        Ok(Self {
            arch: Arch::new(),
            groups,
            modes,
            rows: shapes.len() / modes,
            shapes: shapes.chunks_exact(modes).flat_map(grouped).collect(),
            stiffness: grouped(eigenvalues),
            flexibility: grouped(&flexibility),
            damping: grouped(&damping),
            free_steps,
            q_load,
            v_load,
            integration,
            dt: integration.dt(),
        })
    }

    /// Number of rows of the shapes.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// At rest.
    pub fn state(&self) -> ModalState {
        let zero = || vec![Lanes::default(); self.groups];
        ModalState { q: zero(), v: zero(), load: zero(), steps: 0 }
    }

    /// In motion, with modal displacements and velocities and no force.
    ///
    /// # Errors
    /// A length other than the number of modes.
    pub fn state_from(&self, q: &[f64], v: &[f64]) -> Result<ModalState> {
        if q.len() != self.modes || v.len() != self.modes {
            return Err(Error::Invalid(format!("{} modal displacements and velocities are needed", self.modes)));
        }
        Ok(ModalState { q: grouped(q), v: grouped(v), load: vec![Lanes::default(); self.groups], steps: 0 })
    }

    /// Memory for the modal force of a step, N/sqrt(kg).
    pub fn scratch(&self) -> Vec<Lanes> {
        vec![Lanes::default(); self.groups]
    }

    /// Shapes at a row.
    pub(super) fn row(&self, row: usize) -> &[Lanes] {
        &self.shapes[row * self.groups..(row + 1) * self.groups]
    }

    /// Advances by one step under forces `(row, N)` at the step's end; rows that do not exist are left out.
    pub fn step(&self, state: &mut ModalState, load: &mut [Lanes], forces: &[(u32, f64)]) {
        self.predict(state);
        load.fill(Lanes::default());
        for &(row, force) in forces {
            self.add_force(row, force, load);
        }
        self.correct(state, load);
    }

    /// Modal force of a force at a row: `load += Phi_row^T force`.
    pub fn add_force(&self, row: u32, force: f64, load: &mut [Lanes]) {
        if (row as usize) < self.rows && force != 0.0 {
            self.arch.dispatch(AddRows { load, rows: [self.row(row as usize)], forces: [force] });
        }
    }

    /// Adds to the displacements at a step's end what a modal force there does: `q += diag(q_load) load`.
    pub fn add_step(&self, load: &[Lanes], q: &mut [Lanes]) {
        add_products(load, &self.q_load, q);
    }

    /// Adds what a modal force does to the elastic modes at rest: `q += diag(1/k) load`.
    pub fn add_static(&self, load: &[Lanes], q: &mut [Lanes]) {
        add_products(load, &self.flexibility, q);
    }

    /// The step without a new force: afterwards `q`, `v` are the free motion at the step's end.
    pub fn predict(&self, state: &mut ModalState) {
        let ModalState { q, v, load, .. } = state;
        self.arch.dispatch(Predict { steps: &self.free_steps, q, v, load });
    }

    /// Completes a predicted step by the modal force at its end.
    pub fn correct(&self, state: &mut ModalState, load: &[Lanes]) {
        let ModalState { q, v, .. } = state;
        self.arch.dispatch(Correct { q_load: &self.q_load, v_load: &self.v_load, q, v, load });
        state.load.copy_from_slice(load);
        state.steps += 1;
    }

    /// Values at rows: `Phi_row . x`, for `x` the state's `q` or `v`.
    pub fn read(&self, x: &[Lanes], rows: impl Iterator<Item = usize>, out: &mut [f64]) {
        for (value, row) in out.iter_mut().zip(rows) {
            *value = self.arch.dispatch(Dot(self.row(row), x));
        }
    }

    /// Modal accelerations, `p - c v - k q`, m sqrt(kg)/s^2.
    pub fn accelerations(&self, state: &ModalState) -> Vec<Lanes> {
        (0..self.groups)
            .map(|g| {
                let of = |l: usize| {
                    let resisting = self.damping[g].0[l] * state.v[g].0[l] + self.stiffness[g].0[l] * state.q[g].0[l];
                    state.load[g].0[l] - resisting
                };
                Lanes(std::array::from_fn(of))
            })
            .collect()
    }
}

fn add_products(load: &[Lanes], factors: &[Lanes], q: &mut [Lanes]) {
    for ((q, p), factor) in q.iter_mut().zip(load).zip(factors) {
        *q = q.plus(p, factor);
    }
}
