//! What Python calls: the work of the command, on a thread of its own, without the interpreter's lock. The package around it is `python/muslip`.

mod columns;
mod failure;
mod filter;
mod job;
mod rig;
mod work;

use pyo3::prelude::*;

/// The engine of the package muslip.
#[pymodule(gil_used = false)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // A library that gives up on a damaged file is one error about the file.
    muslip_formats::quiet_panics();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<columns::Columns>()?;
    module.add_class::<rig::Rig>()?;
    module.add_class::<rig::Model>()?;
    module.add_class::<work::Estimate>()?;
    module.add_class::<work::Diagnosed>()?;
    module.add_class::<filter::Estimator>()?;
    module.add_function(wrap_pyfunction!(rig::map_json, module)?)?;
    module.add_function(wrap_pyfunction!(work::channels, module)?)?;
    module.add_function(wrap_pyfunction!(work::estimate, module)?)?;
    module.add_function(wrap_pyfunction!(work::fit, module)?)?;
    module.add_function(wrap_pyfunction!(work::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(work::fleet_page, module)?)?;
    module.add_function(wrap_pyfunction!(work::predict, module)?)?;
    module.add_function(wrap_pyfunction!(work::simulate, module)?)?;
    #[cfg(debug_assertions)]
    module.add_function(wrap_pyfunction!(job::panics, module)?)?;
    Ok(())
}
