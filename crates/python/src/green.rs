//! The Green's function: precomputation, store, solutions.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use palpate_core::capacitance::{self, Change};
use palpate_core::fem::Supports;
use palpate_core::green::{
    Extension, GreensFunction, Growth, Phase, Plan, Precision, PreviousWork, Problem, Progress, RequestedPrecision,
    Target, plan, precompute, precompute_to,
};
use palpate_core::mesh::TetMesh;
use palpate_core::{Error, Result, contact};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::allocator::require_scratch_of_products;
use crate::body::{self, indices, materials, vectors};
use crate::claim::{StoreClaim, claimed};
use crate::errors::Answer;
use crate::interruptible::{locked, run_interruptible, run_interruptible_and};

/// A Green's function in memory, or in memory and its store.
#[pyclass(frozen, module = "palpate._native")]
pub struct GreenCore {
    pub(crate) green: Arc<GreensFunction>,
}

type SurfaceModuli<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, bool);

/// The reference problem from `(nodes, tets, material, fixed_dofs, surface_nodes, surface_faces, touch, loads)`;
/// `loads` (3n) in N, empty for none.
pub(crate) fn problem(arguments: &Bound<'_, PyTuple>) -> Answer<Problem> {
    type Arguments<'py> = (
        PyReadonlyArray2<'py, f64>,
        PyReadonlyArray2<'py, u32>,
        PyReadonlyArray2<'py, f64>,
        PyReadonlyArray1<'py, u32>,
        PyReadonlyArray1<'py, u32>,
        PyReadonlyArray2<'py, u32>,
        PyReadonlyArray1<'py, u32>,
        PyReadonlyArray1<'py, f64>,
    );
    let (nodes, tets, material, fixed, surface_nodes, faces, touch, loads): Arguments<'_> = arguments.extract()?;
    let mesh = TetMesh::new(vectors(&nodes)?, body::tets(&tets)?)?;
    let materials = materials(&material, mesh.tets.len())?;
    let supports = Supports::new(3 * mesh.nodes.len(), indices(&fixed))?;
    Ok(Problem {
        mesh,
        materials,
        supports,
        surface_nodes: indices(&surface_nodes),
        surface_faces: body::faces(&faces)?,
        touch: indices(&touch),
        loads: loads.as_array().to_vec(),
    })
}

fn interior(problem: &Problem) -> Result<palpate_core::green::Interior> {
    require_scratch_of_products()?;
    let stiffness = palpate_core::fem::stiffness(&problem.mesh, &problem.materials);
    palpate_core::green::Interior::new(&stiffness, &problem.supports, &problem.surface_nodes, &problem.loads)
}

/// Removes the files of contacts beside a store.
#[pyfunction]
pub(crate) fn forget_contacts(store: PathBuf) {
    contact::remove_compliance_files(&store);
}

fn precision(name: &str) -> Result<Precision> {
    let unknown = || Error::Invalid(format!("unknown precision '{name}': use 'f16', 'f32' or 'f64'"));
    Precision::parse(name).ok_or_else(unknown)
}

/// The format of a name; without one the cheapest whose typical contacts are right to `within`.
pub(crate) fn requested(name: Option<&str>, within: f64) -> Result<RequestedPrecision> {
    name.map_or(Ok(RequestedPrecision::Within(within)), |name| precision(name).map(RequestedPrecision::Named))
}

/// Displacements inside a body from those of its surface.
#[pyclass(module = "palpate._native", frozen)]
pub struct Interior {
    pub(crate) interior: Arc<palpate_core::green::Interior>,
}

#[pymethods]
impl Interior {
    /// Factorises the inner part of the stiffness of a problem.
    #[new]
    fn new(py: Python<'_>, arguments: &Bound<'_, PyTuple>) -> Answer<Self> {
        let problem = problem(arguments)?;
        let interior = py.detach(|| interior(&problem))?;
        Ok(Self { interior: Arc::new(interior) })
    }

    /// Displacements (3n) of all nodes, m, for those (3s) of the surface nodes.
    fn extend<'py>(&self, py: Python<'py>, surface: PyReadonlyArray1<'py, f64>) -> Answer<Bound<'py, PyArray1<f64>>> {
        let surface = surface.as_slice()?;
        let all = py.detach(|| self.interior.extend(surface))?;
        Ok(all.into_pyarray(py))
    }
}

#[pymethods]
impl GreenCore {
    /// Content key of the Green's function of a problem; without a name of that whose format the body chooses.
    #[staticmethod]
    #[pyo3(signature = (arguments, precision_name=None))]
    fn content_key(py: Python<'_>, arguments: &Bound<'_, PyTuple>, precision_name: Option<&str>) -> Answer<String> {
        let problem = problem(arguments)?;
        let precision = precision_name.map(precision).transpose()?;
        Ok(py.detach(|| problem.key(precision)))
    }

    /// Solves the reference problem in memory. `progress(done, total)` is called a few times a second; Ctrl-C stops.
    #[staticmethod]
    fn precompute(
        py: Python<'_>,
        arguments: &Bound<'_, PyTuple>,
        precision_name: &str,
        description: String,
        progress: Option<Py<PyAny>>,
    ) -> Answer<Self> {
        let problem = problem(arguments)?;
        let precision = precision(precision_name)?;
        let total = 3 * problem.touch.len();
        crate::allocator::return_large_blocks();
        let compute = |note: Progress<'_>| {
            require_scratch_of_products()?;
            precompute(&problem, precision, note)
        };
        let mut green = run_interruptible(py, total, progress.as_ref(), compute)?;
        green.description = description;
        Ok(Self { green: Arc::new(green) })
    }

    /// Solves the reference problem into a file within `memory` bytes, going on where an interrupted computation of the
    /// same thing stopped. Returns how many columns it had finished, and whether something else was thrown away. Without a
    /// name of the format it is the cheapest whose typical contacts are right to `within`.
    ///
    /// `growth` is `(first, next, ready)`: ranks of the surface nodes that are computed first, a function that gives those
    /// to come next or `None`, and one that is told of each store on the way by its number of touchable nodes.
    /// `phase` is told the name of each phase as it begins.
    #[staticmethod]
    #[pyo3(signature = (arguments, precision_name, within, description, progress, path, memory=None, growth=None, phase=None, claim=None))]
    #[allow(clippy::too_many_arguments)] // one call of one caller
    fn precompute_to(
        py: Python<'_>,
        arguments: &Bound<'_, PyTuple>,
        precision_name: Option<&str>,
        within: f64,
        description: &str,
        progress: Option<Py<PyAny>>,
        path: PathBuf,
        memory: Option<usize>,
        growth: Option<(PyReadonlyArray1<'_, u32>, Py<PyAny>, Py<PyAny>)>,
        phase: Option<Py<PyAny>>,
        claim: Option<&StoreClaim>,
    ) -> Answer<(usize, bool)> {
        let problem = problem(arguments)?;
        let precision = requested(precision_name, within)?;
        let total = 3 * problem.touch.len();
        let phase = |begun: Phase| {
            crate::allocator::return_free_pages();
            if let Some(phase) = &phase {
                // What it raises is for nobody: a computation does not end because its name cannot be shown.
                drop(Python::attach(|py| phase.call1(py, (begun.name(),))));
            }
        };
        let claim = claimed(claim, path)?;
        let target = Target { precision, memory, description, phase: &phase };
        let (first, next, ready) = match growth {
            Some((first, next, ready)) => (indices(&first), Some(next), Some(ready)),
            None => (Vec::new(), None, None),
        };
        let (asked, written) = (Mutex::new(Vec::new()), AtomicUsize::new(0));
        let mut meanwhile = || -> PyResult<()> {
            if let Some(next) = &next {
                let nodes: Option<Vec<u32>> = next.call0(py)?.extract(py)?;
                locked(&asked).extend(nodes.unwrap_or_default());
            }
            match (written.swap(0, Ordering::Relaxed), &ready) {
                (0, _) | (_, None) => Ok(()),
                (nodes, Some(ready)) => ready.call1(py, (nodes,)).map(|_| ()),
            }
        };
        crate::allocator::return_large_blocks();
        let found = run_interruptible_and(py, total, progress.as_ref(), &mut meanwhile, |note| {
            require_scratch_of_products()?;
            let next = || Some(std::mem::take(&mut *locked(&asked))).filter(|nodes| !nodes.is_empty());
            let ready = |nodes| written.store(nodes, Ordering::Relaxed);
            let growth = Growth { first: &first, next: &next, ready: &ready };
            let mut found = PreviousWork::default();
            precompute_to(claim, &problem, &target, &growth, &mut |f| found = f, note)?;
            Ok(found)
        })?;
        Ok((found.resumed, found.discarded))
    }

    /// Counts of the precomputation of a problem within `memory` bytes; without a name, of the best format that fits.
    #[staticmethod]
    #[pyo3(signature = (arguments, precision_name=None, memory=None))]
    fn plan<'py>(
        py: Python<'py>,
        arguments: &Bound<'py, PyTuple>,
        precision_name: Option<&str>,
        memory: Option<usize>,
    ) -> Answer<Bound<'py, PyDict>> {
        let problem = problem(arguments)?;
        let precision = precision_name.map(precision).transpose()?;
        let counts = py.detach(|| plan(&problem, precision, memory))?;
        Ok(plan_dict(py, &counts)?)
    }

    /// Writes the store, beside and then renamed.
    fn save(&self, py: Python<'_>, path: PathBuf) -> Answer<()> {
        Ok(py.detach(|| self.green.save(&path))?)
    }

    /// A store of what contacts and pictures read, for a page that fetches it: see `GreensFunction::packed`.
    fn packed<'py>(&self, py: Python<'py>) -> Answer<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.green.packed())?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Reads and verifies a store.
    #[staticmethod]
    #[pyo3(signature = (path, expected_key=None))]
    fn load(py: Python<'_>, path: PathBuf, expected_key: Option<String>) -> Answer<Self> {
        let green = py.detach(|| GreensFunction::load(&path, expected_key.as_deref()))?;
        Ok(Self { green: Arc::new(green) })
    }

    /// Answers a change of boundary conditions, forces (N), displacements (m) and released supports by their columns:
    /// displacements (3s), forces (3s), reactions at the fixed dofs, and the estimated relative error.
    #[allow(clippy::type_complexity)] // three arrays and a number; naming them would need a class nobody else uses
    fn solve<'py>(
        &self,
        py: Python<'py>,
        forces: BTreeMap<usize, f64>,
        displacements: BTreeMap<usize, f64>,
        released: BTreeSet<usize>,
    ) -> Answer<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, f64)> {
        let green = &self.green;
        let solve = || {
            let (known, switched) = Change { forces, displacements, released }.sorted(green).map_err(|column| {
                let (node, axis) = (green.surface_nodes[green.touch[column / 3] as usize], ["x", "y", "z"][column % 3]);
                Error::Invalid(format!("node {node} has both a force and a displacement along {axis}"))
            })?;
            require_scratch_of_products()?;
            capacitance::solve(green, &known, &switched)
        };
        let answer = py.detach(solve)?;
        let (u, f) = (answer.displacements.into_pyarray(py), answer.forces.into_pyarray(py));
        Ok((u, f, answer.reactions.into_pyarray(py), answer.error))
    }

    /// Young's modulus (s), Pa, and Poisson's ratio (s) at the surface nodes, and whether all of the body is of one material;
    /// `None` of a store that does not say it.
    fn surface_moduli<'py>(&self, py: Python<'py>) -> Answer<Option<SurfaceModuli<'py>>> {
        let known = palpate_scene::moduli_of_store(&self.green)?;
        Ok(known.map(|m| (m.youngs.into_pyarray(py), m.poissons.into_pyarray(py), m.homogeneous)))
    }

    /// Shortest of `repeats` times of a plain copy of the entries between touchable nodes (ranks), us: what benchmarks of the
    /// force loop compare with.
    fn gather_us(&self, py: Python<'_>, nodes: Vec<u32>, repeats: usize) -> Answer<f64> {
        let columns: Option<Vec<_>> = nodes.iter().map(|&node| self.green.touchable(node as usize)).collect();
        let untouchable = || Error::Invalid("a node is not touchable".into());
        let columns = columns.ok_or_else(untouchable)?;
        let mut entries = vec![0.0; 9 * nodes.len() * nodes.len()];
        let mut time = || {
            let begun = std::time::Instant::now();
            self.green.block(&nodes, &columns, &mut entries);
            begun.elapsed().as_secs_f64()
        };
        Ok(py.detach(|| 1e6 * (0..repeats).map(|_| time()).fold(f64::INFINITY, f64::min)))
    }

    /// Presses a patch: force on the body (3), displacements (3s), and the estimated relative error.
    fn touch<'py>(
        &self,
        py: Python<'py>,
        point: [f64; 3],
        displacement: [Option<f64>; 3],
        radius: f64,
    ) -> Answer<([f64; 3], Bound<'py, PyArray1<f64>>, f64)> {
        let touch = py.detach(|| contact::touch(&self.green, DVec3::from(point), displacement, radius))?;
        Ok((touch.force.to_array(), touch.displacements.into_pyarray(py), touch.error))
    }

    /// Whether a contact of this radius, m, can be weighed everywhere on the surface.
    fn accepts_contact_radius(&self, py: Python<'_>, radius: f64) -> bool {
        py.detach(|| contact::PatchGeometry::new(&self.green.surface).check_radius(&self.green, radius).is_ok())
    }

    /// Largest contact radius up to `limit`, m, that can be weighed everywhere, to about a hundredth.
    fn largest_contact_radius(&self, py: Python<'_>, limit: f64) -> f64 {
        py.detach(|| palpate_scene::largest_contact_radius(&self.green, limit))
    }

    /// One entry of the operator.
    fn entry(&self, row: usize, column: usize) -> PyResult<f64> {
        if row < self.green.rows && column < 3 * self.green.touch.len() {
            Ok(self.green.entry(row, column))
        } else {
            Err(PyIndexError::new_err("row or column out of range"))
        }
    }

    /// Mesh indices of the surface nodes (s).
    #[getter]
    fn surface_nodes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.green.surface_nodes.clone().into_pyarray(py)
    }

    /// Rest positions of the surface nodes (3s), m.
    #[getter]
    fn surface_positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.green.surface.positions.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>().into_pyarray(py)
    }

    /// Surface triangles as ranks of surface nodes (3k).
    #[getter]
    fn surface_triangles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.green.surface.triangles.as_flattened().to_vec().into_pyarray(py)
    }

    /// The elements' faces on the surface as ranks of surface nodes, and nodes a face.
    #[getter]
    fn surface_faces<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<u32>>, usize) {
        let faces = &self.green.surface.faces;
        (faces.as_flattened().to_vec().into_pyarray(py), faces.nodes_per_face())
    }

    /// Touchable nodes as ranks of surface nodes (t).
    #[getter]
    fn touch_ranks<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.green.touch.clone().into_pyarray(py)
    }

    /// Fixed dofs, ascending.
    #[getter]
    fn fixed_dofs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.green.fixed_dofs.clone().into_pyarray(py)
    }

    /// Reference loads on all dofs (3n), N; empty for none.
    #[getter]
    fn loads<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.green.loads.clone().into_pyarray(py)
    }

    /// Displacements (3s) under the reference loads alone, m.
    #[getter]
    fn free_displacements<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.green.free_displacements().into_pyarray(py)
    }

    /// Estimated relative errors of typical contacts: of the force of a pressed node or patch, and of nodal forces under a
    /// stamp.
    #[getter]
    fn typical_errors(&self) -> (f64, f64) {
        (self.green.accuracy.touch, self.green.accuracy.stamp)
    }

    /// Stored number format.
    #[getter]
    fn precision(&self) -> &'static str {
        self.green.precision().name()
    }

    /// Content key.
    #[getter]
    fn key(&self) -> &str {
        &self.green.key
    }

    /// What it was made from (JSON).
    #[getter]
    fn description(&self) -> &str {
        &self.green.description
    }

    /// Young's modulus, if the whole body has one, Pa.
    #[getter]
    fn youngs_modulus(&self) -> Option<f64> {
        self.green.youngs_modulus
    }

    /// The store's file, if any.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.green.path.clone()
    }
}

/// Multiplies matrices so many times on every thread, in single precision or in double; the operations that took.
#[pyfunction]
pub(crate) fn products(py: Python<'_>, single: bool, count: usize) -> Answer<f64> {
    require_scratch_of_products()?;
    Ok(py.detach(|| palpate_core::green::products(single, count)))
}

fn plan_dict<'py>(py: Python<'py>, plan: &Plan) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("precision", plan.precision.name())?;
    dict.set_item("free_dofs", plan.free_dofs)?;
    dict.set_item("columns", plan.columns)?;
    dict.set_item("rows", plan.rows)?;
    dict.set_item("factor_entries", plan.factor_entries)?;
    dict.set_item("factor_flops", plan.factor_flops)?;
    dict.set_item("sweep_flops", plan.sweep_flops)?;
    dict.set_item("surface_last_flops", plan.surface_last_flops)?;
    dict.set_item("block", plan.width)?;
    dict.set_item("tasks", plan.tasks)?;
    dict.set_item("memory", plan.memory)?;
    dict.set_item("store", plan.store)?;
    Ok(dict)
}
