//! What the image needs of a chip, beyond [`muslip_control::board`]; and which chip this image is for.

use muslip_control::board::Board;
use muslip_control::emulation::Delays;

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

    /// Whether the timer has come for something else than a sample, and that is done.
    #[inline]
    fn timer_is_taken() -> bool {
        false
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

/// A UART, as the link's interrupt uses it.
pub trait Uart {
    /// What was received; whether a byte was lost, and the byte. None where nothing was.
    fn take(&mut self) -> Option<(bool, Option<u8>)>;

    /// Whether it takes a byte to send.
    fn is_ready(&mut self) -> bool;

    /// Sends a byte.
    fn send(&mut self, byte: u8);

    /// Whether it is to ask for more.
    fn ask(&mut self, more: bool);
}

/// What a sample's work took, in cycles.
pub struct Took {
    /// The sampling interrupt.
    pub interrupt: u32,
    /// The control step.
    pub control: u32,
    /// The step and the link's work.
    pub step: u32,
}
