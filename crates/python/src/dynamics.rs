//! Motion: modal and direct Newmark, factors of sparse matrices, files of modes.

use std::path::PathBuf;

use faer::Par;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use palpate_core::dynamics::{
    Basis, Direct, DirectScratch, DirectState, Energy, EnergyAccount, Integration, Lanes, ModalModel, ModalState,
    Newmark, Rayleigh, Solver, basis_key as core_basis_key, partition,
};
use palpate_core::fem::SymmetricCsc;
use palpate_core::solver::Factor;
use palpate_core::{Error, Result};
use pyo3::prelude::*;

use crate::allocator::require_scratch_of_products;
use crate::errors::Answer;

/// Steps between two looks at Ctrl-C.
const STEPS_UNWATCHED: usize = 500;

type CscArguments<'py> = (PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, u32>, PyReadonlyArray1<'py, f64>);
/// Time step, alpha, delta, and the two Rayleigh factors.
pub type SchemeArguments = (f64, f64, f64, f64, f64);
type EnergyTuple = (f64, f64, f64, f64);

fn matrix(arguments: &CscArguments<'_>) -> SymmetricCsc {
    let (start, rows, values) = arguments;
    SymmetricCsc {
        dimension: start.as_array().len() - 1,
        column_start: start.as_array().iter().map(|&s| s as usize).collect(),
        rows: rows.as_array().to_vec(),
        values: values.as_array().to_vec(),
    }
}

pub fn scheme(arguments: SchemeArguments) -> Result<(Newmark, Rayleigh)> {
    let (dt, alpha, delta, mass, stiffness) = arguments;
    for (name, value) in [("mass", mass), ("stiffness", stiffness)] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Error::Invalid(format!("the Rayleigh factor of the {name} must not be negative, got {value}")));
        }
    }
    Ok((Newmark::new(dt, alpha, delta)?, Rayleigh { mass, stiffness }))
}

fn tuple(energies: Energy) -> EnergyTuple {
    (energies.kinetic, energies.strain, energies.dissipated, energies.work)
}

/// Runs `step` `count` times without the interpreter lock, looking for Ctrl-C now and then.
fn repeat(py: Python<'_>, count: usize, mut step: impl FnMut(usize) + Send) -> Answer<()> {
    let mut done = 0;
    while done < count {
        let until = count.min(done + STEPS_UNWATCHED);
        py.detach(|| (done..until).for_each(&mut step));
        done = until;
        py.check_signals()?;
    }
    Ok(())
}

/// Rows that are pushed (k), their forces (steps, k), and rows that are watched (w).
type ForceHistory<'py> = (Vec<u32>, PyReadonlyArray2<'py, f64>, Vec<usize>);

/// Makes a step for each row of forces on a body of so many rows; displacements (steps, w). `step` is given the forces, and
/// where what is watched goes.
fn played<'py>(
    py: Python<'py>,
    count: usize,
    (rows, forces, watch): ForceHistory<'py>,
    mut step: impl FnMut(&[(u32, f64)], &[usize], &mut [f64]) + Send,
) -> Answer<Bound<'py, PyArray2<f64>>> {
    let forces = forces.as_array();
    if forces.ncols() != rows.len() || watch.iter().any(|&r| r >= count) {
        return Err(Error::Invalid("the rows do not fit the forces or the body".into()).into());
    }
    let mut seen = vec![0.0; forces.nrows() * watch.len()];
    repeat(py, forces.nrows(), |i| {
        let now: Vec<(u32, f64)> = rows.iter().copied().zip(forces.row(i).iter().copied()).collect();
        step(&now, &watch, &mut seen[i * watch.len()..(i + 1) * watch.len()]);
    })?;
    Ok(seen.into_pyarray(py).reshape([forces.nrows(), watch.len()])?)
}

/// Largest stable time step, s, for a largest eigenvalue (1/s^2); infinite where every step is stable.
#[pyfunction]
pub fn largest_stable_dt(arguments: SchemeArguments, eigenvalue: f64) -> Answer<f64> {
    let (newmark, rayleigh) = scheme(arguments)?;
    Ok(newmark.largest_stable_dt(&rayleigh, eigenvalue))
}

/// Refuses an unstable time step.
#[pyfunction]
pub fn require_stable(arguments: SchemeArguments, eigenvalue: f64) -> Answer<()> {
    let (newmark, rayleigh) = scheme(arguments)?;
    Ok(newmark.require_stable(&rayleigh, eigenvalue)?)
}

/// Content key of modes from the bytes that determine them.
#[pyfunction]
pub fn basis_key(parts: Vec<Vec<u8>>) -> String {
    core_basis_key(&parts.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

/// Writes modes to a file.
#[pyfunction]
pub fn save_basis(
    py: Python<'_>,
    path: PathBuf,
    key: String,
    description: String,
    eigenvalues: PyReadonlyArray1<'_, f64>,
    shapes: PyReadonlyArray2<'_, f64>,
) -> Answer<()> {
    let (eigenvalues, shapes) = (eigenvalues.as_slice()?.to_vec(), shapes.as_slice()?.to_vec());
    let basis = Basis { key, description, eigenvalues, shapes };
    Ok(py.detach(|| basis.save(&path))?)
}

/// Key, description, eigenvalues (m) and shapes (3n m) of a verified file.
#[pyfunction]
#[allow(clippy::type_complexity)] // four things read once
pub fn load_basis(
    py: Python<'_>,
    path: PathBuf,
) -> Answer<(String, String, Bound<'_, PyArray1<f64>>, Bound<'_, PyArray1<f64>>)> {
    let basis = py.detach(|| Basis::load(&path))?;
    Ok((basis.key, basis.description, basis.eigenvalues.into_pyarray(py), basis.shapes.into_pyarray(py)))
}

/// Cholesky factor of a sparse symmetric positive definite matrix without its fixed dofs.
#[pyclass(frozen, module = "palpate._native")]
pub struct SparseFactor {
    factor: Factor,
}

#[pymethods]
impl SparseFactor {
    /// Orders and factorises.
    #[new]
    fn new(py: Python<'_>, arguments: CscArguments<'_>, fixed: Vec<u32>) -> Answer<Self> {
        let matrix = matrix(&arguments);
        require_scratch_of_products()?;
        let make = || Factor::new(&matrix, &partition(matrix.dimension, fixed)?, Par::rayon(0));
        Ok(Self { factor: py.detach(make)? })
    }

    /// Solution on the free dofs for a right-hand side on them.
    fn solve<'py>(&self, py: Python<'py>, right: PyReadonlyArray1<'py, f64>) -> Answer<Bound<'py, PyArray1<f64>>> {
        let mut x = right.as_array().to_vec();
        let rows = self.factor.dimension();
        if x.len() != rows {
            return Err(Error::Invalid(format!("{rows} numbers are needed, got {}", x.len())).into());
        }
        py.detach(|| {
            let mut memory = self.factor.solve_scratch(1);
            self.factor.solve_in_place(&mut x, &mut memory);
        });
        Ok(x.into_pyarray(py))
    }
}

/// Motion by modes.
#[pyclass(module = "palpate._native")]
pub struct ModalMotion {
    model: ModalModel,
    state: ModalState,
    scratch: Vec<Lanes>,
    account: EnergyAccount,
}

#[pymethods]
impl ModalMotion {
    /// Prepares the recurrences; `exact` integrates each mode exactly instead of by Newmark's weights.
    #[new]
    fn new(
        py: Python<'_>,
        eigenvalues: PyReadonlyArray1<'_, f64>,
        shapes: PyReadonlyArray2<'_, f64>,
        arguments: SchemeArguments,
        exact: bool,
        displacements: PyReadonlyArray1<'_, f64>,
        velocities: PyReadonlyArray1<'_, f64>,
    ) -> Answer<Self> {
        let (k, shapes) = (eigenvalues.as_slice()?, shapes.as_slice()?);
        let (q, v) = (displacements.as_slice()?, velocities.as_slice()?);
        let build = || -> Result<Self> {
            let (newmark, rayleigh) = scheme(arguments)?;
            let linear = Integration::ExactLinear { dt: newmark.dt };
            let integration = if exact { linear } else { Integration::Newmark(newmark) };
            let model = ModalModel::new(k, shapes, &rayleigh, integration)?;
            let state = model.state_from(q, v)?;
            let (scratch, account) = (model.scratch(), EnergyAccount::new(&model, &state));
            Ok(Self { model, state, scratch, account })
        };
        Ok(py.detach(build)?)
    }

    /// Makes `count` steps under constant forces at rows.
    fn step(&mut self, py: Python<'_>, forces: Vec<(u32, f64)>, count: usize) -> Answer<()> {
        repeat(py, count, |_| {
            self.model.step(&mut self.state, &mut self.scratch, &forces);
            self.account.book(&self.model, &self.state);
        })
    }

    /// Makes a step for each row of `forces` (steps, k) at `rows` (k); displacements (steps, w) at the rows `watch` (w).
    fn play<'py>(
        &mut self,
        py: Python<'py>,
        rows: Vec<u32>,
        forces: PyReadonlyArray2<'py, f64>,
        watch: Vec<usize>,
    ) -> Answer<Bound<'py, PyArray2<f64>>> {
        played(py, self.model.rows(), (rows, forces, watch), |now, watch, out| {
            self.model.step(&mut self.state, &mut self.scratch, now);
            self.account.book(&self.model, &self.state);
            self.model.read(&self.state.q, watch.iter().copied(), out);
        })
    }

    /// Displacements, velocities or accelerations (`order` 0, 1, 2) at rows; None: at all.
    fn at<'py>(&self, py: Python<'py>, rows: Option<Vec<usize>>, order: usize) -> Answer<Bound<'py, PyArray1<f64>>> {
        let rows = rows.unwrap_or_else(|| (0..self.model.rows()).collect());
        if rows.iter().any(|&r| r >= self.model.rows()) {
            return Err(Error::Invalid("a row does not exist".into()).into());
        }
        let mut out = vec![0.0; rows.len()];
        py.detach(|| self.model.read(&self.modal_numbers(order), rows.into_iter(), &mut out));
        Ok(out.into_pyarray(py))
    }

    /// Kinetic, strain, dissipated energy and work, J.
    fn energies(&self) -> EnergyTuple {
        tuple(self.account.energies(&self.model, &self.state))
    }

    /// Steps made.
    #[getter]
    fn steps(&self) -> u64 {
        self.state.steps
    }
}

impl ModalMotion {
    fn modal_numbers(&self, order: usize) -> Vec<Lanes> {
        match order {
            0 => self.state.q.clone(),
            1 => self.state.v.clone(),
            _ => self.model.accelerations(&self.state),
        }
    }
}

/// Motion of all dofs.
#[pyclass(module = "palpate._native")]
pub struct DirectMotion {
    direct: Direct,
    state: DirectState,
    scratch: DirectScratch,
}

#[pymethods]
impl DirectMotion {
    /// Factorises the effective matrix, or keeps its dense inverse.
    #[new]
    #[allow(clippy::too_many_arguments)] // one of each thing
    fn new(
        py: Python<'_>,
        stiffness: CscArguments<'_>,
        mass: CscArguments<'_>,
        fixed: Vec<u32>,
        arguments: SchemeArguments,
        dense: bool,
        displacements: PyReadonlyArray1<'_, f64>,
        velocities: PyReadonlyArray1<'_, f64>,
    ) -> Answer<Self> {
        let (stiffness, mass) = (matrix(&stiffness), matrix(&mass));
        let (u, v) = (displacements.as_slice()?, velocities.as_slice()?);
        let solver = if dense { Solver::Inverse } else { Solver::Factor };
        let build = || -> Result<Self> {
            let (newmark, rayleigh) = scheme(arguments)?;
            let direct = Direct::new(stiffness, mass, fixed, newmark, rayleigh, solver)?;
            let (state, scratch) = (direct.state(u, v)?, direct.scratch());
            Ok(Self { direct, state, scratch })
        };
        Ok(py.detach(build)?)
    }

    /// Makes `count` steps under constant forces at dofs.
    fn step(&mut self, py: Python<'_>, forces: Vec<(u32, f64)>, count: usize) -> Answer<()> {
        let force = self.spread(&forces);
        repeat(py, count, |_| self.direct.step(&mut self.state, &mut self.scratch, &force))
    }

    /// Makes a step for each row of `forces` (steps, k) at the dofs `rows` (k); displacements (steps, w) at the dofs
    /// `watch` (w).
    fn play<'py>(
        &mut self,
        py: Python<'py>,
        rows: Vec<u32>,
        forces: PyReadonlyArray2<'py, f64>,
        watch: Vec<usize>,
    ) -> Answer<Bound<'py, PyArray2<f64>>> {
        played(py, self.state.u.len(), (rows, forces, watch), |now, watch, out| {
            let force = self.spread(now);
            self.direct.step(&mut self.state, &mut self.scratch, &force);
            out.iter_mut().zip(watch).for_each(|(out, &row)| *out = self.state.u[row]);
        })
    }

    /// Displacements, velocities or accelerations (`order` 0, 1, 2) at dofs; None: at all.
    fn at<'py>(&self, py: Python<'py>, rows: Option<Vec<usize>>, order: usize) -> Answer<Bound<'py, PyArray1<f64>>> {
        let rows = rows.unwrap_or_else(|| (0..self.state.u.len()).collect());
        let all = match order {
            0 => &self.state.u,
            1 => &self.state.v,
            _ => &self.state.a,
        };
        let values: Option<Vec<f64>> = rows.iter().map(|&row| all.get(row).copied()).collect();
        let missing = || Error::Invalid("a row does not exist".into());
        Ok(values.ok_or_else(missing)?.into_pyarray(py))
    }

    /// Kinetic, strain, dissipated energy and work, J.
    fn energies(&self) -> EnergyTuple {
        tuple(self.direct.energies(&self.state))
    }

    /// Steps made.
    #[getter]
    fn steps(&self) -> u64 {
        self.state.steps
    }
}

impl DirectMotion {
    fn spread(&self, forces: &[(u32, f64)]) -> Vec<f64> {
        let mut all = vec![0.0; self.state.u.len()];
        for &(dof, force) in forces {
            if let Some(value) = all.get_mut(dof as usize) {
                *value += force;
            }
        }
        all
    }
}
