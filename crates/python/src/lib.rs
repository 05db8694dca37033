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
mod interruptible;
mod program_device;
mod recording;
mod replay;
mod rerun;
mod scene;
mod sensor;
mod series;
mod simulation;
mod strain;
mod surface;

/// The module `palpate._native`.
#[pyo3::pymodule]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::body::{determinant_ranges, mass, stiffness, volumes};
    #[pymodule_export]
    use crate::changes::{
        add_body, add_tool, assume_devices, connect, device_limits, disconnect, hold_series, place_body, remove_body,
        remove_tool, replace_body, set_series, set_strain_measures, tool_positions, tool_stiffness,
    };
    #[pymodule_export]
    use crate::children::end_with_parent;
    #[pymodule_export]
    use crate::claim::StoreClaim;
    #[pymodule_export]
    use crate::columns::{ColumnJob, ColumnLayout, ColumnStore};
    #[pymodule_export]
    use crate::connection::OpenedDevice;
    #[pymodule_export]
    use crate::devices::{DeviceCheck, device_kinds, list_devices};
    #[pymodule_export]
    use crate::drawing::simplified;
    #[pymodule_export]
    use crate::dynamics::{
        DirectMotion, ModalMotion, SparseFactor, basis_key, largest_stable_dt, load_basis, require_stable, save_basis,
    };
    #[pymodule_export]
    use crate::emulated::{emulate, known_devices};
    #[pymodule_export]
    use crate::exchange::exchange;
    #[pymodule_export]
    use crate::green::{GreenCore, Interior, forget_contacts, products};
    #[pymodule_export]
    use crate::program_device::ProgrammedDevice;
    #[pymodule_export]
    use crate::replay::{Replay, read_recording};
    #[pymodule_export]
    use crate::rerun::rerun;
    #[pymodule_export]
    use crate::scene::checksum;
    #[pymodule_export]
    use crate::sensor::SensorCore;
    #[pymodule_export]
    use crate::series::{GatheredSeries, Series, SeriesBlocks, SeriesFile, strain_terms};
    #[pymodule_export]
    use crate::simulation::SimulationCore;
    #[pymodule_export]
    use crate::strain::{StrainMeasure, StrainResponse, contact_patch, provisional_displacement};
    #[pymodule_export]
    use crate::surface::SurfaceSearch;

    /// Answers that may be wrong by more than this are refused.
    #[pymodule_export]
    const REFUSED_ERROR: f64 = palpate_core::green::accuracy::REFUSED_ERROR;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("TOOL_SETTINGS", crate::scene::tool_settings())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
