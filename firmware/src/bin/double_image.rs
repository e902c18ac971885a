//! Multiplies in double precision, which the core has no instruction for: the check of images must see it.
#![cfg_attr(target_os = "none", no_std, no_main)]

/// Start-up, a product, then samples for ever.
#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    let started = firmware::stm32f405::start();
    let factor = core::hint::black_box(1.5_f64);
    core::hint::black_box(factor * core::hint::black_box(2.0));
    firmware::run::run(started)
}

#[cfg(not(target_os = "none"))]
fn main() {}
