//! What the page calls.
#![expect(
    unsafe_code,
    reason = "names of exports must not be mangled; nothing else here is unsafe"
)]

use std::cell::RefCell;

use crate::{Run, Start};

thread_local! {
    /// The page's run.
    static RUN: RefCell<Option<Run>> = const { RefCell::new(None) };
}

/// Starts a run; 1 if the filter takes the start, else 0.
#[unsafe(no_mangle)]
pub extern "C" fn start(
    efficient: u32,
    peak_friction: f64,
    critical_slip: f64,
    peak_friction_std: f64,
    critical_slip_std: f64,
    pseudonoise: u32,
) -> u32 {
    let run = Run::new(&Start {
        efficient: efficient != 0,
        peak_friction,
        critical_slip,
        peak_friction_std,
        critical_slip_std,
        pseudonoise: pseudonoise != 0,
    });
    let taken = u32::from(run.is_some());
    RUN.set(run);
    taken
}

/// Corrects with one measurement; 1 if the filter used it, else 0.
#[unsafe(no_mangle)]
pub extern "C" fn update(slip_ratio: f64, friction: f64, friction_std: f64) -> u32 {
    RUN.with_borrow_mut(|run| {
        let used = run
            .as_mut()
            .is_some_and(|run| run.update(slip_ratio, friction, friction_std));
        u32::from(used)
    })
}

/// A figure of the run by its number; NaN where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn value(index: u32) -> f64 {
    RUN.with_borrow(|run| run.as_ref().map_or(f64::NAN, |run| run.value(index)))
}
