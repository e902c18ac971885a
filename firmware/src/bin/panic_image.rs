//! Starts up like the image and panics: its handler must dump the brake first.
#![cfg_attr(target_os = "none", no_std, no_main)]

/// Start-up with the brake applied, then a panic.
#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use muslip_control::board::{Actuators, Board};
    use muslip_control::brake::BrakeOutput;

    let (_, mut actuators) = firmware::stm32f405::start().board.split();
    actuators.actuate(BrakeOutput {
        valve_duty: 30_000,
        hold_pressure: true,
    });
    #[expect(clippy::panic, reason = "that is what this image is for")]
    {
        panic!("on purpose")
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
