//! Copies of a scene that are stepped together by poses given: contact as a sensor of a robot simulator.

use std::sync::Mutex;

use numpy::{IntoPyArray, PyReadonlyArray3, PyUntypedArrayMethods};
use palpate_core::simulation::{Model, TaxelGrid};
use palpate_core::{Error, Result};
use palpate_scene::{PreparedScene, device_pose};
use palpate_servo::{Settings, Stepper};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::errors::Answer;
use crate::interruptible::locked;
use crate::simulation::SimulationCore;

/// Numbers of a pose (position and orientation w x y z) and of a wrench (force and torque).
const POSE: usize = 7;
const WRENCH: usize = 6;

/// A contact as a row of numbers: copy, tool, body, whether it slips and is limited, radius (m), depth (m) and stiffness (N/m) under the
/// local law and relative error of the force; point (m), normal, force on the body (N) and torque on it about the tip (N m), in the world.
type ContactRow = [f64; 21];

/// Scene copies, each with a state of its own.
#[pyclass(frozen, module = "palpate._native")]
pub struct SensorCore {
    copies: Mutex<Vec<Copy>>,
    tools: usize,
    /// Taxels of each tool; empty for none.
    grids: Vec<TaxelGrid>,
    /// Whether wrenches pass the limits of the devices.
    limited: bool,
}

/// One copy, and what its last tick gave.
struct Copy {
    stepper: Stepper,
    model: std::sync::Arc<Model>,
    wrenches: Vec<f64>,
    contacts: Vec<ContactRow>,
    pressures: Vec<f64>,
    fault: Option<String>,
}

#[pymethods]
impl SensorCore {
    /// So many copies of a simulation's scene, with its settings as they are now; taxels (rows, columns) with the sides (m) of the
    /// rectangle of each tool.
    #[new]
    fn new(
        py: Python<'_>,
        core: &SimulationCore,
        count: usize,
        limited: bool,
        taxels: Option<(usize, usize, Vec<[f64; 2]>)>,
    ) -> Answer<Self> {
        let PreparedScene { model, limits, settings, strain, devices, .. } = core.prepared(py);
        let settings = Settings { watch: None, ..settings };
        let copy = |_| -> Result<_> {
            let stepper = Stepper::new(&model, &devices, limits, settings, &strain)?;
            let (wrenches, contacts, pressures) = (Vec::new(), Vec::new(), Vec::new());
            Ok(Copy { stepper, model: model.clone(), wrenches, contacts, pressures, fault: None })
        };
        let copies = Mutex::new(py.detach(|| (0..count).map(copy).collect::<Result<Vec<_>>>())?);
        let of_tool = |(rows, columns, sides): (usize, usize, Vec<[f64; 2]>)| {
            sides.into_iter().map(|sides| TaxelGrid { rows, columns, sides }).collect()
        };
        let grids = taxels.map(of_tool).unwrap_or_default();
        Ok(Self { copies, tools: model.tools.len(), grids, limited })
    }

    /// A tick of all copies, with poses (copies, tools, 7), NaN for a tool that is out of the scene, a time `period` (s) after the last:
    /// wrenches on the tools (copies * tools * 6), contacts, pressures, and faults by copy.
    fn step<'py>(&self, py: Python<'py>, poses: PyReadonlyArray3<'py, f64>, period: f64) -> Answer<Bound<'py, PyDict>> {
        let (shape, poses) = (poses.shape().to_vec(), poses.as_slice()?.to_vec());
        let (wrenches, contacts, pressures, faults) = py.detach(|| {
            let mut copies = locked(&self.copies);
            if shape != [copies.len(), self.tools, POSE] {
                return Err(Error::Invalid(format!("poses have the shape {shape:?}")));
            }
            let numbers = self.tools * POSE;
            copies
                .par_iter_mut()
                .zip(poses.par_chunks_exact(numbers))
                .enumerate()
                .for_each(|(rank, (copy, poses))| copy.step(self, rank, poses, period));
            Ok((
                copies.iter().flat_map(|copy| copy.wrenches.iter().copied()).collect::<Vec<_>>(),
                copies.iter().flat_map(|copy| copy.contacts.iter().flatten().copied()).collect::<Vec<_>>(),
                copies.iter().flat_map(|copy| copy.pressures.iter().copied()).collect::<Vec<_>>(),
                copies
                    .iter()
                    .enumerate()
                    .filter_map(|(rank, copy)| Some((rank, copy.fault.clone()?)))
                    .collect::<Vec<_>>(),
            ))
        })?;
        let answer = PyDict::new(py);
        answer.set_item("wrenches", wrenches.into_pyarray(py))?;
        answer.set_item("contacts", contacts.into_pyarray(py))?;
        answer.set_item("pressures", pressures.into_pyarray(py))?;
        answer.set_item("faults", faults)?;
        Ok(answer)
    }

    /// Begins some copies anew in their next tick: without contacts, bodies at rest, faults cleared.
    fn reset(&self, copies: Vec<usize>) -> Answer<()> {
        let mut all = locked(&self.copies);
        for rank in copies {
            let missing = || Error::Invalid(format!("there is no copy {rank}"));
            all.get_mut(rank).ok_or_else(missing)?.stepper.reset()?;
        }
        Ok(())
    }
}

impl Copy {
    fn step(&mut self, sensor: &SensorCore, rank: usize, poses: &[f64], period: f64) {
        let pose = |&[x, y, z, orientation @ ..]: &[f64; POSE]| device_pose([x, y, z], orientation);
        let poses: Vec<_> = poses.as_chunks::<POSE>().0.iter().map(pose).collect();
        self.stepper.step(&poses, &[], period);
        self.wrenches.clear();
        for tool in 0..sensor.tools {
            let wrench = match sensor.limited {
                true => self.stepper.latest().status.wrenches[tool],
                false => self.stepper.contact_wrench(tool),
            };
            self.wrenches.extend(wrench.force.to_array());
            self.wrenches.extend(wrench.torque.to_array());
        }
        debug_assert_eq!(self.wrenches.len(), sensor.tools * WRENCH);
        self.read_contacts(rank);
        self.pressures.clear();
        for (tool, grid) in sensor.grids.iter().enumerate() {
            let begin = self.pressures.len();
            self.pressures.resize(begin + grid.rows * grid.columns, 0.0);
            self.stepper.add_pressures(tool, grid, &mut self.pressures[begin..]);
        }
    }

    fn read_contacts(&mut self, rank: usize) {
        let Self { stepper, model, contacts, fault, .. } = self;
        let published = stepper.latest();
        contacts.clear();
        *fault = published.status.fault.map(|fault| fault.to_string());
        for (contact, _) in published.state.contacts.iter() {
            let placement = &model.bodies[contact.body].placement;
            let point = placement.point_to_world(contact.point);
            let [normal, force, torque] =
                [contact.normal, contact.force, -contact.torque].map(|vector| placement.vector_to_world(vector));
            let flags = [contact.slipping, contact.limited].map(|flag| f64::from(u8::from(flag)));
            let mut row = [0.0; 21];
            row[..3].copy_from_slice(&[rank as f64, contact.tool as f64, contact.body as f64]);
            let numbers = [contact.radius, contact.depth, contact.stiffness, contact.error];
            row[3..5].copy_from_slice(&flags);
            row[5..9].copy_from_slice(&numbers);
            for (to, vector) in row[9..].chunks_exact_mut(3).zip([point, normal, force, torque]) {
                to.copy_from_slice(&vector.to_array());
            }
            contacts.push(row);
        }
    }
}
