//! Ctrl-C: nothing half-written stays.

/// Has an interrupt remove what is half written before it ends the process as it always does.
#[cfg(unix)]
pub(super) fn removes_half_written() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    // A system that does not let signals be heard ends the process as before.
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else {
        return;
    };
    std::thread::spawn(move || {
        for signal in signals.forever() {
            muslip_recordings::output::remove_half_written();
            let _ = signal_hook::low_level::emulate_default_handler(signal);
        }
    });
}

/// Elsewhere an interrupt may leave a temporary file.
#[cfg(not(unix))]
pub(super) fn removes_half_written() {}
