//! What the main loop and its interrupts need of a chip, beyond [`muslip_control::board`]; and which chip this image is for.

use core::sync::atomic::{Ordering, compiler_fence};

use muslip_control::board::Board;
use muslip_control::controller::{Controller, Identity};
use muslip_control::emulation::Delays;
use muslip_control::store::Loaded;
use muslip_record::{Origin, Parameters};

use crate::counter::{Most, cycles};
use crate::link::{LinkEnd, Uart};
use crate::run::Took;

#[cfg(feature = "stm32f405")]
pub use crate::stm32f405::Stm32f405 as This;
#[cfg(all(feature = "stm32g474", not(feature = "stm32f405")))]
pub use crate::stm32g474::Stm32g474 as This;

/// The board of this image.
pub type ThisBoard = <This as Chip>::Board;

/// A chip. What has a body here is what the emulator wants to know or to do, and nothing on silicon.
pub trait Chip {
    /// The board with it.
    type Board: Board<Sensors: Send>;
    /// The host link's UART.
    type Uart: Uart + Send;

    /// Core cycles from one sample to the next.
    const CYCLES_PER_SAMPLE: u32;

    /// Lets samples come.
    fn start_sampling();

    /// Dumps the brake, from any context, before start-up as well, by the shortest way there is.
    fn dump();

    /// Lets the host link's interrupt look for something to send.
    fn kick();

    /// Sends a byte of the log, which there is if `byte` says so; whether more may be done.
    fn log(byte: impl FnOnce() -> Option<u8>) -> bool;

    /// Whether the interrupt that cannot be masked came for something that a program may go on after.
    fn goes_on_after_nmi() -> bool {
        false
    }

    /// Core cycles; wraps.
    #[inline]
    fn cycles() -> u32 {
        cortex_m::peripheral::DWT::cycle_count()
    }

    /// The sampling interrupt has begun.
    fn sampled() {}

    /// Whether the core must not sleep.
    fn stays_awake() -> bool {
        false
    }

    /// The work of a sample begins.
    fn begins_work() {}

    /// The valves are set.
    fn valves_are_set() {}

    /// The work of a sample is done, of so many so far; what it took, what holds interrupts off, the deepest stack, and samples
    /// raised, worked on and late so far.
    fn worked(_tick: u32, _took: &Took, _delays: Delays, _stack_bytes: u32, _totals: [u32; 3]) {}

    /// The program has come to its end, by a panic or not; the brake is dumped.
    fn ended(_panic: bool) {}
}

/// Priorities of the interrupts, in the upper four bits of their registers: 0 goes first.
/// 0 is the memory fault's: an overflow of the stack must be one in every interrupt.
pub const LINK_PRIORITY: u8 = 1;
/// Of sampling.
pub const SAMPLING_PRIORITY: u8 = 2;

/// Does something with sampling held off, and the link not.
pub fn without_sampling<T>(work: impl FnOnce() -> T) -> T {
    let start = cycles();
    #[allow(unsafe_code, reason = "a priority is masked and let go")]
    // SAFETY: nothing relies on sampling coming within the few instructions of `work`.
    unsafe {
        cortex_m::register::basepri::write(SAMPLING_PRIORITY << 4);
    }
    // The mask holds from here on, for the core and for the compiler (ARMv7-M, B5.2.3).
    cortex_m::asm::isb();
    compiler_fence(Ordering::SeqCst);
    let result = work();
    compiler_fence(Ordering::SeqCst);
    HELD_OFF.take(cycles().wrapping_sub(start));
    #[allow(unsafe_code, reason = "a priority is masked and let go")]
    // SAFETY: 0 masks nothing.
    unsafe {
        cortex_m::register::basepri::write(0);
    }
    result
}

/// Most cycles for which sampling was held off by [`without_sampling`].
static HELD_OFF: Most = Most::new();

/// Most cycles for which sampling was held off to set the valves.
pub fn sampling_held_off() -> u32 {
    HELD_OFF.get()
}

/// Where parameters come from that were loaded, or were not.
pub fn origin(loaded: Option<&Loaded>) -> Origin {
    match loaded {
        Some(Loaded { newest: true, .. }) => Origin::Stored,
        Some(_) => Origin::Previous,
        None => Origin::BuiltIn,
    }
}

/// What start-up leaves to the main loop.
pub struct Started {
    /// The board.
    pub board: ThisBoard,
    /// The controller; none only if start-up ran twice.
    pub controller: Option<&'static mut Controller>,
    /// The host link; none only if start-up ran twice.
    pub link: Option<LinkEnd>,
}

impl Started {
    /// A controller on a board that is up.
    pub fn new(
        board: ThisBoard,
        parameters: &Parameters,
        identity: Identity,
        link: Option<LinkEnd>,
    ) -> Self {
        defmt::info!(
            "muslip: emulated {}, core {} Hz, watchdog reset {}, parameters {}",
            identity.emulated,
            identity.core_clock_hz,
            identity.watchdog_reset,
            identity.parameters
        );
        // Stored parameters were checked when they were loaded, the default ones by a test.
        let controller = Controller::new(parameters, identity)
            .ok()
            .and_then(|controller| cortex_m::singleton!(: Controller = controller));
        Self {
            board,
            controller,
            link,
        }
    }
}

/// Raises samples by the core's own timer, at this core clock.
pub fn start_timer(clock_hz: u32, sample_hz: u32) {
    #[allow(unsafe_code, reason = "takes the core's peripherals")]
    // SAFETY: called once at start-up; nobody else has them.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    core.SYST
        .set_clock_source(cortex_m::peripheral::syst::SystClkSource::Core);
    core.SYST.set_reload(clock_hz / sample_hz - 1);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();
}
