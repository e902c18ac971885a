//! The work of `muslip diagnose`: recordings that were read go in, the diagnosis as its files hold it comes out.

use muslip_diagnose::diagnose::diagnose;
use muslip_diagnose::outcome::{Diagnosis, Fault};
use muslip_recordings::load::Campaign;

use super::json;

/// Runs the engine on a campaign, which is given up to it. What had to be mended to read the recordings joins the
/// faults of the data, and every number is finite. `progress` receives the share done and the name of the step.
#[must_use]
pub fn run(campaign: Campaign, progress: &(dyn Fn(f64, &str) + Sync)) -> Diagnosis {
    let Campaign { rig, runs, faults } = campaign;
    let mut diagnosis = diagnose(&rig, runs, progress);
    add_faults(&mut diagnosis, faults);
    json::make_finite(&mut diagnosis);
    diagnosis
}

/// Faults of reading stand before those of content.
fn add_faults(diagnosis: &mut Diagnosis, mut faults: Vec<Fault>) {
    faults.append(&mut diagnosis.data_faults);
    diagnosis.data_faults = faults;
}
