//! The image for the STM32G474.
#![cfg_attr(target_os = "none", no_std, no_main)]

/// Start-up, then samples for ever.
#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    firmware::run::run(firmware::stm32g474::start())
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("error: this is firmware; build it with: cargo xtask firmware");
    std::process::exit(2);
}
