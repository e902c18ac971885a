//! One candidate of the cycles table, updated with the article's 41 points and reported by semihosting.
//!
//! `run_full` calls the candidate once a sample and `roi_end` marks the end: between the two a trace of
//! executed instructions is one update a call.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};

mod candidate;

/// 41 slips (i/40)² and frictions of the article's curve (0.35, 0.15) with a noise of 0.04.
const POINTS: usize = 41;

/// Friction's noise in units of 0.001, drawn once from a normal distribution of 0.04.
const NOISE: [i16; POINTS] = [
    -31, 12, 48, -7, 25, -52, 3, 61, -18, -40, 33, 8, -24, 71, -5, -36, 19, 44, -63, 2, 28, -11,
    -47, 36, 15, -29, 55, -2, -20, 41, -58, 10, 23, -34, 6, 66, -45, 17, -13, 30, -8,
];

fn points() -> [(f32, f32); POINTS] {
    let mut points = [(0.0, 0.0); POINTS];
    let mut i = 0.0_f32;
    for (point, noise) in points.iter_mut().zip(NOISE) {
        let slip = (i / 40.0) * (i / 40.0);
        let r = slip / 0.15;
        *point = (
            slip,
            2.0 * 0.35 * r / (1.0 + r * r) + 0.001 * f32::from(noise),
        );
        i += 1.0;
    }
    points
}

#[inline(never)]
#[unsafe(no_mangle)]
fn run_full(memory: &mut candidate::Memory, points: &[(f32, f32); POINTS]) {
    for &(slip, friction) in points {
        candidate::update(memory, slip, friction);
    }
    roi_end();
}

#[inline(never)]
#[unsafe(no_mangle)]
fn roi_end() {
    black_box(());
    cortex_m::asm::nop();
}

#[entry]
fn main() -> ! {
    let points = black_box(points());
    let mut memory = black_box(candidate::start());
    run_full(&mut memory, &points);
    let [peak, slip] = candidate::answer(&memory);
    // In millionths: no floating-point formatting on the target.
    hprintln!("{} {}", (peak * 1e6) as i32, (slip * 1e6) as i32);
    debug::exit(debug::EXIT_SUCCESS);
    loop {}
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}
