//! The emulator's link at the pace of its wire: bytes come and go one at a time, whether the program is ready or not.
//!
//! QEMU's UART takes no time. Here the core's timer ticks once a byte, above every interrupt of the program
//! (`pace.rs`); a tick brings the next byte, takes the one that is sent, and raises the link's interrupt as silicon would.

use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering};

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use heapless::spsc::Queue;
use muslip_control::emulation::NS_PER_INSTRUCTION_LOG2;
use muslip_record::LINK_BAUD;
use stm32f4::stm32f405::{Interrupt, NVIC, TIM2, USART2};

use super::settings::CORE_HZ;
use crate::bits::low_u8;
use crate::board::SAMPLING_PRIORITY;
use crate::cell::InterruptCell;
use crate::chip::Uart;
use crate::counter::{Most, cycles};
use crate::queue::{self, Sender, Taker};
use crate::totals::add;

/// Core cycles of a byte's ten bits.
pub const CYCLES_PER_BYTE: u32 = CORE_HZ / (LINK_BAUD / 10);
/// Time in which sampling waits for its buses at the worst: the table of *Interrupts* in docs/rig.md without the
/// instructions.
const BUSES_NS: u32 = 34_000;
/// TIM2 counts nanoseconds; by this prescaler core cycles, to 1 %.
const CYCLE_PRESCALER: u32 = 5;
/// Bytes of the simulator that may wait for the wire.
const WAITING_BYTES: usize = 256;

/// In the halves that a byte is kept in: there is one.
const FULL: u16 = 1 << 8;
/// A byte came before the last was taken.
const OVERRUN: u16 = 1 << 9;

static ON: AtomicBool = AtomicBool::new(false);
/// The data register's two halves.
static RECEIVED: AtomicU16 = AtomicU16::new(0);
static SENDING: AtomicU16 = AtomicU16::new(0);
/// Whether the link asks for an interrupt when it may send.
static ASKS: AtomicBool = AtomicBool::new(false);
/// When the byte in the data register came, and the longest that one waited there, in cycles.
static CAME: AtomicU32 = AtomicU32::new(0);
static WAITED: Most = Most::new();

struct Waiting {
    to: Sender<u8>,
    from: Taker<u8>,
}

/// Bytes that the wire still brings.
static WAITING: InterruptCell<Waiting> = InterruptCell::new();

/// Whether the link goes at the wire's pace.
#[inline]
pub fn is_on() -> bool {
    ON.load(Ordering::Relaxed)
}

/// From now on, in which nothing waits and no sample is under way.
#[allow(
    unsafe_code,
    reason = "raw register values, and what the timer's interrupt owns"
)]
pub fn start() {
    let Some(bytes) = cortex_m::singleton!(: Queue<u8, WAITING_BYTES> = Queue::new()) else {
        return;
    };
    let (to, from) = queue::split(bytes);
    // SAFETY: the timer is started after this; registers are those of the emulator's board, whose interrupts call this.
    unsafe {
        WAITING.fill(Waiting { to, from });
        // What the simulator says is taken while time stands still.
        NVIC::mask(Interrupt::USART3);
        (*TIM2::ptr()).psc().write(|w| w.bits(CYCLE_PRESCALER));
    }
    ON.store(true, Ordering::Relaxed);
    // SAFETY: in the emulator nobody else uses the timer, and nothing relies on another order.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    // SAFETY: as above.
    unsafe {
        core.SCB.set_priority(SystemHandler::SysTick, 0);
        core.SCB
            .set_priority(SystemHandler::PendSV, SAMPLING_PRIORITY << 4);
    }
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(CYCLES_PER_BYTE - 1);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();
}

/// What the wire does in a byte's time.
#[allow(
    unsafe_code,
    reason = "raw register values, and what this interrupt owns"
)]
pub fn move_bytes() {
    let sent = SENDING.swap(0, Ordering::Relaxed);
    if sent & FULL != 0 {
        // SAFETY: any byte may be sent; QEMU's UART is always ready.
        unsafe { (*USART2::ptr()).dr().write(|w| w.bits(sent & 0xFF)) };
    }
    // SAFETY: this interrupt's alone.
    let next = unsafe { WAITING.get() }.and_then(|waiting| waiting.from.pop());
    let before = RECEIVED.load(Ordering::Relaxed);
    match next {
        Some(_) if before & FULL != 0 => RECEIVED.store(before | OVERRUN, Ordering::Relaxed),
        Some(byte) => {
            RECEIVED.store(u16::from(byte) | FULL | before, Ordering::Relaxed);
            CAME.store(cycles(), Ordering::Relaxed);
        }
        None => {}
    }
    if RECEIVED.load(Ordering::Relaxed) != 0 || ASKS.load(Ordering::Relaxed) {
        NVIC::pend(Interrupt::USART2);
    }
}

/// Bytes that the wire has still to bring.
#[allow(unsafe_code, reason = "what the tick owns")]
pub fn ready() -> u16 {
    // SAFETY: only the tick calls it.
    let waiting = unsafe { WAITING.get() };
    waiting.map_or(0, |waiting| {
        u16::try_from(WAITING_BYTES - 1 - waiting.to.room()).unwrap_or(u16::MAX)
    })
}

/// One more that it brings.
#[allow(unsafe_code, reason = "what the tick owns")]
pub fn bring(byte: u8) {
    // SAFETY: only the tick calls it.
    if let Some(waiting) = unsafe { WAITING.get() } {
        waiting.to.push(byte);
    }
}

/// So many cycles passed while time stood still.
pub fn stood_still(cycles: u32) {
    add(&CAME, cycles);
}

/// The longest that a received byte waited to be taken, in cycles.
pub fn waited() -> u32 {
    WAITED.get()
}

/// The link's UART at the wire's pace.
pub struct Wire;

impl Uart for Wire {
    fn take(&mut self) -> Option<(bool, Option<u8>)> {
        let received = RECEIVED.swap(0, Ordering::Relaxed);
        if received == 0 {
            return None;
        }
        WAITED.take(cycles().wrapping_sub(CAME.load(Ordering::Relaxed)));
        Some((
            received & OVERRUN != 0,
            (received & FULL != 0).then_some(low_u8(received)),
        ))
    }

    fn is_ready(&mut self) -> bool {
        SENDING.load(Ordering::Relaxed) == 0
    }

    fn send(&mut self, byte: u8) {
        SENDING.store(u16::from(byte) | FULL, Ordering::Relaxed);
    }

    /// The next tick raises the interrupt.
    fn ask(&mut self, more: bool) {
        ASKS.store(more, Ordering::Relaxed);
    }
}

/// Waits as long as sampling waits for its buses.
pub fn wait_for_buses() {
    cortex_m::asm::delay(BUSES_NS >> NS_PER_INSTRUCTION_LOG2);
}
