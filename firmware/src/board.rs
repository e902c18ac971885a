//! A board that is up: priorities, the sampling timer, and what start-up leaves to the main loop.

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::scb::SystemHandler;
use muslip_control::controller::{Controller, Identity};
use muslip_control::store::Loaded;
use muslip_record::{Origin, Parameters};

use crate::chip::ThisBoard;
use crate::counter::{Most, cycles};
use crate::link::LinkEnd;

/// Priorities of the interrupts, in the upper four bits of their registers: 0 goes first.
/// 0 is the memory fault's: an overflow of the stack must be one in every interrupt.
const LINK_PRIORITY: u8 = 1;
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

/// Sets the priorities of the host link's interrupt and of sampling: the link goes first, for sampling takes longer than
/// its next byte. docs/design/0013-silicon.md.
pub fn set_priorities(link: impl InterruptNumber) {
    #[allow(
        unsafe_code,
        reason = "takes the core's peripherals and sets priorities"
    )]
    // SAFETY: called once at start-up; nobody else has them, and nothing relies on another order.
    unsafe {
        let mut core = cortex_m::Peripherals::steal();
        core.NVIC.set_priority(link, LINK_PRIORITY << 4);
        core.SCB
            .set_priority(SystemHandler::SysTick, SAMPLING_PRIORITY << 4);
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
