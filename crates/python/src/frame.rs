//! Conversion of a published tick to Python.

use numpy::IntoPyArray;
use palpate_core::simulation::{Model, Snapshot};
use palpate_devices::DeviceFault;
use palpate_scene::wxyz;
use palpate_servo::{Fault, FaultReason, LogRow, Published};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::errors::Answer;
use crate::scene::{contact_records, energy_array};

/// A tick as a dictionary.
pub fn frame<'py>(py: Python<'py>, model: &Model, published: Published) -> Answer<Bound<'py, PyDict>> {
    let Published { status, state } = published;
    let tools = model.tools.len();
    let surfaces = py.detach(|| {
        let intact = model.bodies.iter().try_for_each(|body| body.green().require_intact());
        intact.map(|()| (0..model.bodies.len()).map(|body| state.displacements(model, body)).collect::<Vec<_>>())
    });
    let surfaces = surfaces?;
    let frame = PyDict::new(py);
    let bodies = PyList::empty(py);
    for (body, displacements) in surfaces.into_iter().enumerate() {
        let scale = status.settings.stiffness_scale[body];
        bodies.append((displacements.into_pyarray(py), state.energy(body).as_ref().map(energy_array), scale))?;
    }
    frame.set_item("bodies", bodies)?;
    frame.set_item("time", status.time)?;
    frame.set_item("forces", status.wrenches[..tools].iter().map(|w| w.force.to_array()).collect::<Vec<_>>())?;
    frame.set_item("torques", status.wrenches[..tools].iter().map(|w| w.torque.to_array()).collect::<Vec<_>>())?;
    let poses = || status.readings[..tools].iter().map(|reading| reading.pose);
    frame.set_item("positions", poses().map(|pose| pose.position.to_array()).collect::<Vec<_>>())?;
    frame.set_item("orientations", poses().map(|pose| wxyz(pose.orientation)).collect::<Vec<_>>())?;
    frame.set_item("active", status.readings[..tools].iter().map(|reading| reading.active).collect::<Vec<_>>())?;
    frame.set_item("limited", status.limited[..tools].to_vec())?;
    frame.set_item("contacts", contact_records(model, &state))?;
    frame.set_item("refused", refusals(&state, tools))?;
    let summary = |s: palpate_servo::Summary| [s.p50, s.p99, s.p999, s.max];
    frame.set_item("compute_us", summary(status.compute))?;
    frame.set_item("wakeup_us", summary(status.wakeup))?;
    frame.set_item("ticks", status.ticks)?;
    frame.set_item("missed_deadlines", status.missed_deadlines())?;
    frame.set_item("missed_computing", status.missed_computing)?;
    frame.set_item("dropped_rows", status.dropped_rows)?;
    let port = |port: &palpate_servo::PortEnergy| [port.given, port.owed, port.unpaid];
    frame.set_item("port_energy", status.ports[..tools].iter().map(port).collect::<Vec<_>>())?;
    frame.set_item("fault", status.fault.map(|fault| fault.to_string()))?;
    // A program tells why by itself.
    let of_program = |fault: &Fault| fault.reason == FaultReason::Device(DeviceFault::Program);
    frame.set_item("failed_program", status.fault.filter(of_program).and_then(|fault| fault.tool))?;
    frame.set_item("realtime", (status.realtime.priority, status.realtime.locked_memory))?;
    Ok(frame)
}

/// A row of the log (18 numbers): time, position and force of the first tool, computing time, wake-up delay, displacement
/// of the watched node, and time and energies of the watched body.
pub fn push_row(rows: &mut Vec<f64>, row: &LogRow, body: usize) {
    rows.push(row.time);
    rows.extend(row.position.to_array());
    rows.extend(row.force.to_array());
    rows.extend([row.compute_us, row.wakeup_us]);
    rows.extend(row.watched.unwrap_or_default().to_array());
    rows.push(row.body_time[body]);
    rows.extend(energy_array(&row.energy[body]));
}

/// For each tool why no contact began, or None.
fn refusals(state: &Snapshot, tools: usize) -> Vec<Option<&'static str>> {
    let of_tool =
        |tool: &palpate_core::simulation::ToolState| tool.refused.iter().flatten().next().map(|r| r.message());
    state.tools[..tools].iter().map(of_tool).collect()
}
