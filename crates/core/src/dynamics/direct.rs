//! Newmark's scheme on all dofs, the reference for the modes.
//!
//! In accelerations: with `u* = u0 + dt v0 + dt^2 (1/2 - alpha) a0` and `v* = v0 + dt (1 - delta) a0`,
//!
//! ```text
//! S a1 = F1 - B v* - K u*,   S = M + delta dt B + alpha dt^2 K
//! u1 = u* + alpha dt^2 a1,   v1 = v* + delta dt a1
//! ```
//!
//! `S` is `alpha dt^2` times the effective stiffness of equation 4.4, and stays usable at `alpha = 0` (central
//! difference). It is factorised once; `Solver::Inverse` keeps its dense inverse instead, which is the paper's method.

use faer::Par;
use faer::dyn_stack::{MemBuffer, StackReq};

use super::{Energy, Newmark, Rayleigh};
use crate::fem::{Supports, SymmetricCsc};
use crate::solver::Factor;
use crate::{Error, Result};

/// Columns of the dense inverse solved at once.
const BLOCK: usize = 128;

/// How `S` is solved.
pub enum Solver {
    /// By its sparse Cholesky factor.
    Factor,
    /// By its dense inverse.
    Inverse,
}

enum StepSolver {
    Factor(Box<Factor>),
    Inverse(Vec<f64>),
}

/// The scheme on one body.
pub struct Direct {
    stiffness: SymmetricCsc,
    mass: SymmetricCsc,
    supports: Supports,
    scheme: Newmark,
    rayleigh: Rayleigh,
    solved: StepSolver,
}

/// Where the motion is; all dofs, those of supports zero.
#[derive(Clone, Debug)]
pub struct DirectState {
    /// Displacements, m.
    pub u: Vec<f64>,
    /// Velocities, m/s.
    pub v: Vec<f64>,
    /// Accelerations, m/s^2.
    pub a: Vec<f64>,
    /// Forces at this time, N.
    pub force: Vec<f64>,
    /// Steps made.
    pub steps: u64,
    work: f64,
    dissipated: f64,
}

/// Memory of a step.
pub struct DirectScratch {
    mean_velocity: Vec<f64>,
    combined: Vec<f64>,
    right: Vec<f64>,
    solution: Vec<f64>,
    memory: MemBuffer,
}

impl Direct {
    /// Factorises `S`, or inverts it.
    ///
    /// # Errors
    /// Matrices of different structure, fixed dofs out of range, or `S` not positive definite (a node without mass).
    pub fn new(
        stiffness: SymmetricCsc,
        mass: SymmetricCsc,
        fixed: Vec<u32>,
        scheme: Newmark,
        rayleigh: Rayleigh,
        solver: Solver,
    ) -> Result<Self> {
        let supports = partition(stiffness.dimension, fixed)?;
        let Newmark { dt, alpha, delta } = scheme;
        let of_mass = 1.0 + delta * dt * rayleigh.mass;
        let of_stiffness = delta * dt * rayleigh.stiffness + alpha * dt * dt;
        let factor = Factor::new(&combination(&mass, of_mass, &stiffness, of_stiffness)?, &supports, Par::rayon(0))?;
        let solved = match solver {
            Solver::Factor => StepSolver::Factor(Box::new(factor)),
            Solver::Inverse => StepSolver::Inverse(inverse(&factor)),
        };
        Ok(Self { stiffness, mass, supports, scheme, rayleigh, solved })
    }

    /// In motion with displacements `u` (m) and velocities `v` (m/s) of all dofs, no force; the supports' are dropped.
    ///
    /// # Errors
    /// A wrong length, or a mass matrix that is not positive definite.
    pub fn state(&self, u: &[f64], v: &[f64]) -> Result<DirectState> {
        let n = self.stiffness.dimension;
        if u.len() != n || v.len() != n {
            return Err(Error::Invalid(format!("displacements and velocities of {n} dofs are needed")));
        }
        let mut start = DirectState {
            u: u.to_vec(),
            v: v.to_vec(),
            a: vec![0.0; n],
            force: vec![0.0; n],
            steps: 0,
            work: 0.0,
            dissipated: 0.0,
        };
        for &dof in &self.supports.fixed {
            (start.u[dof as usize], start.v[dof as usize]) = (0.0, 0.0);
        }
        if start.u.iter().chain(&start.v).any(|&x| x != 0.0) {
            // M a0 = -B v0 - K u0
            let factor = Factor::new(&combination(&self.mass, 1.0, &self.mass, 0.0)?, &self.supports, Par::rayon(0))?;
            let mut scratch = self.scratch();
            self.resistance(&start.u, &start.v, &mut scratch);
            for (x, &dof) in scratch.solution.iter_mut().zip(&self.supports.free) {
                *x = -scratch.right[dof as usize];
            }
            let mut memory = factor.solve_scratch(1);
            factor.solve_in_place(&mut scratch.solution, &mut memory);
            for (x, &dof) in scratch.solution.iter().zip(&self.supports.free) {
                start.a[dof as usize] = *x;
            }
        }
        Ok(start)
    }

    /// Memory for a step.
    pub fn scratch(&self) -> DirectScratch {
        let (n, free) = (self.stiffness.dimension, self.supports.free.len());
        let memory = match &self.solved {
            StepSolver::Factor(factor) => factor.solve_scratch(1),
            StepSolver::Inverse(_) => MemBuffer::new(StackReq::EMPTY),
        };
        DirectScratch {
            mean_velocity: vec![0.0; n],
            combined: vec![0.0; n],
            right: vec![0.0; n],
            solution: vec![0.0; free],
            memory,
        }
    }

    /// Advances by one step under the forces (N, all dofs) at its end.
    pub fn step(&self, state: &mut DirectState, scratch: &mut DirectScratch, force: &[f64]) {
        let Newmark { dt, alpha, delta } = self.scheme;
        let free = || self.supports.free.iter().map(|&dof| dof as usize);
        let mut work = 0.0;
        for i in free() {
            work -= (state.force[i] + delta * (force[i] - state.force[i])) * state.u[i];
            scratch.mean_velocity[i] = 0.5 * state.v[i];
            state.u[i] += dt * state.v[i] + dt * dt * (0.5 - alpha) * state.a[i];
            state.v[i] += dt * (1.0 - delta) * state.a[i];
        }
        self.resistance(&state.u, &state.v, scratch);
        for (x, i) in scratch.solution.iter_mut().zip(free()) {
            *x = force[i] - scratch.right[i];
        }
        self.solve(scratch);
        for (&a, i) in scratch.solution.iter().zip(free()) {
            state.a[i] = a;
            state.u[i] += alpha * dt * dt * a;
            state.v[i] += delta * dt * a;
            work += (state.force[i] + delta * (force[i] - state.force[i])) * state.u[i];
            scratch.mean_velocity[i] += 0.5 * state.v[i];
        }
        state.work += work;
        if self.rayleigh != Rayleigh::default() {
            let of_mass = self.rayleigh.mass * quadratic_form(&self.mass, &scratch.mean_velocity);
            let of_stiffness = self.rayleigh.stiffness * quadratic_form(&self.stiffness, &scratch.mean_velocity);
            state.dissipated += dt * (of_mass + of_stiffness);
        }
        state.force.copy_from_slice(force);
        state.steps += 1;
    }

    /// Energy at a state.
    pub fn energies(&self, state: &DirectState) -> Energy {
        Energy {
            kinetic: 0.5 * quadratic_form(&self.mass, &state.v),
            strain: 0.5 * quadratic_form(&self.stiffness, &state.u),
            coupling: 0.0,
            dissipated: state.dissipated,
            work: state.work,
        }
    }

    /// `right = B v + K u = K (u + stiffness v) + mass M v`.
    fn resistance(&self, u: &[f64], v: &[f64], scratch: &mut DirectScratch) {
        for (x, (u, v)) in scratch.combined.iter_mut().zip(u.iter().zip(v)) {
            *x = u + self.rayleigh.stiffness * v;
        }
        for (i, y) in scratch.right.iter_mut().enumerate() {
            *y = row_dot(&self.stiffness, i, &scratch.combined);
        }
        if self.rayleigh.mass != 0.0 {
            for (i, y) in scratch.right.iter_mut().enumerate() {
                *y += self.rayleigh.mass * row_dot(&self.mass, i, v);
            }
        }
    }

    fn solve(&self, scratch: &mut DirectScratch) {
        let n = scratch.solution.len();
        match &self.solved {
            StepSolver::Factor(factor) => factor.solve_in_place(&mut scratch.solution, &mut scratch.memory),
            StepSolver::Inverse(inverse) => {
                scratch.right[..n].copy_from_slice(&scratch.solution);
                scratch.solution.fill(0.0);
                for (column, &r) in inverse.chunks_exact(n).zip(&scratch.right) {
                    for (x, c) in scratch.solution.iter_mut().zip(column) {
                        *x += r * c;
                    }
                }
            }
        }
    }
}

/// Free and fixed dofs; a body may have no support at all.
///
/// # Errors
/// A fixed dof out of range, or no free dof left.
pub fn partition(dof_count: usize, fixed: Vec<u32>) -> Result<Supports> {
    if fixed.is_empty() {
        let all: Vec<u32> = (0..dof_count as u32).collect();
        return Ok(Supports { fixed, free: all.clone(), free_rank: all });
    }
    Supports::new(dof_count, fixed)
}

/// `a A + b B`, zeros left out (a lumped mass is a diagonal).
fn combination(a_matrix: &SymmetricCsc, a: f64, b_matrix: &SymmetricCsc, b: f64) -> Result<SymmetricCsc> {
    if a_matrix.dimension != b_matrix.dimension {
        return Err(Error::Invalid("the stiffness and the mass matrix differ in size".into()));
    }
    let mut sum = SymmetricCsc { column_start: vec![0], rows: vec![], values: vec![], ..*a_matrix };
    for j in 0..a_matrix.dimension {
        let (mut left, mut right) = (a_matrix.column(j).peekable(), b_matrix.column(j).peekable());
        while let Some(row) = [left.peek(), right.peek()].into_iter().flatten().map(|entry| entry.0).min() {
            let x = left.next_if(|entry| entry.0 == row).map_or(0.0, |entry| entry.1);
            let y = right.next_if(|entry| entry.0 == row).map_or(0.0, |entry| entry.1);
            let value = a * x + b * y;
            if value != 0.0 || row as usize == j {
                sum.rows.push(row);
                sum.values.push(value);
            }
        }
        sum.column_start.push(sum.rows.len());
    }
    Ok(sum)
}

/// Dense inverse, column after column.
fn inverse(factor: &Factor) -> Vec<f64> {
    let n = factor.dimension();
    let mut inverse = vec![0.0; n * n];
    let mut memory = factor.solve_scratch(BLOCK.min(n));
    for (block, columns) in inverse.chunks_mut(BLOCK * n).enumerate() {
        for (j, column) in columns.chunks_exact_mut(n).enumerate() {
            column[block * BLOCK + j] = 1.0;
        }
        factor.solve_in_place(columns, &mut memory);
    }
    inverse
}

fn row_dot(matrix: &SymmetricCsc, i: usize, x: &[f64]) -> f64 {
    matrix.column(i).map(|(j, value)| value * x[j as usize]).sum()
}

fn quadratic_form(matrix: &SymmetricCsc, x: &[f64]) -> f64 {
    x.iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(i, v)| v * row_dot(matrix, i, x)).sum()
}
