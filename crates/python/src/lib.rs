//! `palpate._native`: the numerical core for Python. Arguments are checked arrays; the Python package names things for
//! people. The interpreter lock is released in everything long.

mod allocator;
mod body;
mod changes;
mod children;
mod claim;
mod columns;
mod connection;
mod devices;
mod drawing;
mod dynamics;
mod emulated;
mod errors;
mod exchange;
mod frame;
mod green;
mod programmed;
mod recording;
mod replay;
mod rerun;
mod scene;
mod simulation;
mod strain;
mod surface;
mod watched;

use pyo3::prelude::*;

/// The module `palpate._native`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("TOOL_SETTINGS", scene::tool_settings())?;
    module.add_function(wrap_pyfunction!(body::stiffness, module)?)?;
    module.add_function(wrap_pyfunction!(green::products, module)?)?;
    module.add_function(wrap_pyfunction!(body::mass, module)?)?;
    module.add_function(wrap_pyfunction!(body::determinant_ranges, module)?)?;
    module.add_function(wrap_pyfunction!(body::volumes, module)?)?;
    module.add_function(wrap_pyfunction!(dynamics::largest_stable_dt, module)?)?;
    module.add_function(wrap_pyfunction!(dynamics::require_stable, module)?)?;
    module.add_function(wrap_pyfunction!(dynamics::basis_key, module)?)?;
    module.add_function(wrap_pyfunction!(dynamics::save_basis, module)?)?;
    module.add_function(wrap_pyfunction!(dynamics::load_basis, module)?)?;
    module.add_class::<dynamics::SparseFactor>()?;
    module.add_class::<dynamics::ModalMotion>()?;
    module.add_class::<dynamics::DirectMotion>()?;
    module.add_class::<green::GreenCore>()?;
    module.add_class::<green::Interior>()?;
    module.add_function(wrap_pyfunction!(children::end_with_parent, module)?)?;
    module.add_function(wrap_pyfunction!(exchange::exchange, module)?)?;
    module.add_function(wrap_pyfunction!(green::forget_contacts, module)?)?;
    module.add_class::<columns::ColumnJob>()?;
    module.add_class::<columns::ColumnLayout>()?;
    module.add_class::<columns::ColumnStore>()?;
    module.add_class::<claim::StoreClaim>()?;
    module.add_class::<simulation::SimulationCore>()?;
    module.add_function(wrap_pyfunction!(emulated::known_devices, module)?)?;
    module.add_function(wrap_pyfunction!(emulated::emulate, module)?)?;
    module.add_class::<connection::OpenedDevice>()?;
    module.add_class::<programmed::ProgrammedDevice>()?;
    module.add_class::<devices::DeviceCheck>()?;
    module.add_function(wrap_pyfunction!(devices::device_kinds, module)?)?;
    module.add_function(wrap_pyfunction!(devices::list_devices, module)?)?;
    module.add_function(wrap_pyfunction!(changes::connect, module)?)?;
    module.add_function(wrap_pyfunction!(changes::disconnect, module)?)?;
    module.add_function(wrap_pyfunction!(changes::device_limits, module)?)?;
    module.add_function(wrap_pyfunction!(changes::tool_stiffness, module)?)?;
    module.add_function(wrap_pyfunction!(changes::assume_devices, module)?)?;
    module.add_function(wrap_pyfunction!(changes::set_strain_measures, module)?)?;
    module.add_function(wrap_pyfunction!(changes::add_body, module)?)?;
    module.add_function(wrap_pyfunction!(changes::replace_body, module)?)?;
    module.add_function(wrap_pyfunction!(changes::remove_body, module)?)?;
    module.add_function(wrap_pyfunction!(changes::place_body, module)?)?;
    module.add_function(wrap_pyfunction!(changes::add_tool, module)?)?;
    module.add_function(wrap_pyfunction!(changes::remove_tool, module)?)?;
    module.add_class::<replay::Replay>()?;
    module.add_function(wrap_pyfunction!(replay::read_recording, module)?)?;
    module.add_function(wrap_pyfunction!(rerun::rerun, module)?)?;
    module.add_class::<surface::SurfaceSearch>()?;
    module.add_function(wrap_pyfunction!(drawing::simplified, module)?)?;
    module.add_class::<strain::StrainMeasure>()?;
    module.add_class::<strain::StrainResponse>()?;
    module.add_function(wrap_pyfunction!(scene::checksum, module)?)?;
    module.add_function(wrap_pyfunction!(strain::contact_patch, module)?)?;
    module.add_function(wrap_pyfunction!(strain::provisional_displacement, module)?)?;
    Ok(())
}
