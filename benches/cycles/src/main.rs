//! One candidate of the cycles table, updated with the article's 41 points and reported by semihosting.
//!
//! `run_full` calls the candidate's `update` once a sample, and nothing else until `roi_end`: what a trace
//! executes outside `run_full` is one update a call.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};

mod candidate;

/// Friction's noise at 41 slips (i/40)² in units of 0.001, drawn once from a normal distribution of 0.04.
#[cfg(not(feature = "long"))]
const NOISE: [i16; 41] = [
    -31, 12, 48, -7, 25, -52, 3, 61, -18, -40, 33, 8, -24, 71, -5, -36, 19, 44, -63, 2, 28, -11,
    -47, 36, 15, -29, 55, -2, -20, 41, -58, 10, 23, -34, 6, 66, -45, 17, -13, 30, -8,
];

/// The article's points; with the feature `long`, ten applications of a rig: a ramp to skid and a release
/// each thousand samples, noise from sums of uniform numbers.
struct Samples {
    next: u32,
    #[cfg(feature = "long")]
    random: u32,
}

#[cfg(feature = "long")]
const CURVE: (f32, f32) = (0.6, 0.15);
#[cfg(not(feature = "long"))]
const CURVE: (f32, f32) = (0.35, 0.15);

#[inline(always)]
fn law(slip: f32) -> f32 {
    let (mup, sp) = CURVE;
    let r = slip / sp;
    2.0 * mup * r / (1.0 + r * r)
}

#[cfg(not(feature = "long"))]
impl Iterator for Samples {
    type Item = (f32, f32);

    #[inline(always)]
    fn next(&mut self) -> Option<(f32, f32)> {
        let noise = NOISE.get(self.next as usize)?;
        let part = self.next as f32 / 40.0;
        let slip = part * part;
        self.next += 1;
        Some((slip, law(slip) + 0.001 * f32::from(*noise)))
    }
}

#[cfg(feature = "long")]
impl Iterator for Samples {
    type Item = (f32, f32);

    #[inline(always)]
    fn next(&mut self) -> Option<(f32, f32)> {
        if self.next == 10_000 {
            return None;
        }
        let phase = (self.next % 1000) as f32 / 1000.0;
        let (ramp, release) = (phase / 0.6, (1.0 - phase) / 0.3);
        let slip = if phase < 0.6 {
            ramp * ramp * ramp
        } else if phase < 0.7 {
            1.0
        } else {
            release * release * release * release
        };
        self.next += 1;
        let mut noise = -6.0;
        for _ in 0..12 {
            // Numerical Recipes' generator; its upper bits.
            self.random = self
                .random
                .wrapping_mul(1_664_525)
                .wrapping_add(1_013_904_223);
            noise += (self.random >> 8) as f32 / 16_777_216.0;
        }
        Some((slip, law(slip) + 0.04 * noise))
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
fn run_full(memory: &mut candidate::Memory, samples: Samples) {
    for (slip, friction) in samples {
        // What is told of it, if anything, is the caller's to read.
        let _ = candidate::update(memory, slip, friction);
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
    let samples = black_box(Samples {
        next: 0,
        #[cfg(feature = "long")]
        random: 1,
    });
    let mut memory = black_box(candidate::start());
    run_full(&mut memory, samples);
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
