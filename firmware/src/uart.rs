//! The host link on USART2 by interrupts, the log on USART1 by polling.
//!
//! The chip's UART holds one received byte, and the next is there 10.85 us later: this interrupt goes above sampling,
//! takes one byte in and one byte out, and neither logs nor masks anything. How late it may come: docs/rig.md.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::spsc::Queue;
use muslip_control::link::Transmit;
use muslip_record::LINK_BAUD;
use stm32f4::stm32f405::{Interrupt, NVIC, RCC, USART1, USART2, interrupt};

use crate::bits::low_u8;
use crate::cell::InterruptCell;
use crate::counter::{Interrupter, Most, cycles, keep};
use crate::queue::{self, Sender, Taker};
use crate::settings::{APB1_HZ, APB2_HZ, HSI_HZ, LOG_BAUD, baud_divisor};
use crate::totals::add;

/// Received bytes that may wait: five samples of a full wire.
const RECEIVE_BYTES: usize = 512;
/// Telemetry that may wait.
const TRANSMIT_BYTES: usize = 2048;

/// Bits of a USART's SR and CR1 (RM0090, 30.6).
pub const RXNE: u16 = 1 << 5;
/// Transmit register empty.
pub const TXE: u16 = 1 << 7;
const ORE: u16 = 1 << 3;
const UE: u16 = 1 << 13;
const TXEIE: u16 = 1 << 7;
/// Receive interrupt enable.
pub const RXNEIE: u16 = 1 << 5;
const TE: u16 = 1 << 3;
const RE: u16 = 1 << 2;

/// Bytes received on the link so far.
static RECEIVED: AtomicU32 = AtomicU32::new(0);
/// Bytes lost because nobody took them.
static OVERRUN: AtomicU32 = AtomicU32::new(0);
/// Bytes sent on the link so far.
static SENT: AtomicU32 = AtomicU32::new(0);
/// In the emulator, whose UART takes no time: bytes that the wire still takes in this sample.
static ALLOWANCE: AtomicU32 = AtomicU32::new(0);
/// Whether the allowance counts.
static PACED: AtomicBool = AtomicBool::new(false);

/// Most cycles of one run of the interrupt that took a byte in, and of one that sent one.
static TAKING: Most = Most::new();
static SENDING: Most = Most::new();

struct Line {
    uart: USART2,
    received: Sender<u8>,
    transmit: Taker<u8>,
}

static LINE: InterruptCell<Line> = InterruptCell::new();

/// The main loop's end of the link.
pub struct LinkEnd {
    /// Bytes in.
    pub receiver: Receiver,
    /// Bytes out.
    pub transmitter: Transmitter,
}

/// Received bytes.
pub struct Receiver(Taker<u8>);

impl Receiver {
    /// The oldest received byte.
    pub fn receive(&mut self) -> Option<u8> {
        self.0.pop()
    }
}

/// Bytes to be sent.
pub struct Transmitter(Sender<u8>);

impl Transmit for Transmitter {
    fn room(&self) -> usize {
        self.0.room()
    }

    fn send(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if !self.0.push(byte) {
                return;
            }
        }
    }
}

/// Lets the interrupt look for something to send.
pub fn kick() {
    NVIC::pend(Interrupt::USART2);
}

/// Bytes received so far, bytes sent so far.
pub fn totals() -> (u32, u32) {
    (
        RECEIVED.load(Ordering::Relaxed),
        SENT.load(Ordering::Relaxed),
    )
}

/// Most cycles that the interrupt took for a byte in, and for a byte out.
pub fn worst_cycles() -> [u32; 2] {
    [TAKING.get(), SENDING.get()]
}

/// Bytes lost before they were read.
pub fn overrun_bytes() -> u32 {
    OVERRUN.load(Ordering::Relaxed)
}

/// Paces the link: so many bytes until the next call.
pub fn allow(bytes: u32) {
    ALLOWANCE.store(bytes, Ordering::Relaxed);
    PACED.store(true, Ordering::Relaxed);
}

/// Sets up both UARTs (pins are the board's) for the clock that the core has come up with: on the internal
/// oscillator buses are not divided, and the host must still be told of the fault. `None` when called twice.
#[allow(
    unsafe_code,
    reason = "raw register values, and what the interrupt owns"
)]
pub fn start(rcc: &RCC, log: &USART1, link: USART2, full_clock: bool) -> Option<LinkEnd> {
    let (log_hz, link_hz) = if full_clock {
        (APB2_HZ, APB1_HZ)
    } else {
        (HSI_HZ, HSI_HZ)
    };
    // SAFETY: USART2EN (RM0090, 7.3.13).
    rcc.apb1enr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 1 << 17) });
    // SAFETY: USART1EN (7.3.14).
    rcc.apb2enr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 1 << 4) });
    // The write right after an enable can be lost (ES0182, 2.1.13), one after a look at it cannot.
    rcc.apb2enr().read();
    // SAFETY: mantissa and fraction (30.6.3).
    log.brr()
        .write(|w| unsafe { w.bits(baud_divisor(log_hz, LOG_BAUD)) });
    // SAFETY: bits of 30.6.4.
    log.cr1().write(|w| unsafe { w.bits(UE | TE) });
    // SAFETY: mantissa and fraction.
    link.brr()
        .write(|w| unsafe { w.bits(baud_divisor(link_hz, LINK_BAUD)) });
    // SAFETY: bits of 30.6.4.
    link.cr1()
        .write(|w| unsafe { w.bits(UE | TE | RE | RXNEIE) });

    let received = cortex_m::singleton!(: Queue<u8, RECEIVE_BYTES> = Queue::new())?;
    let transmit = cortex_m::singleton!(: Queue<u8, TRANSMIT_BYTES> = Queue::new())?;
    let (received_in, received_out) = queue::split(received);
    let (transmit_in, transmit_out) = queue::split(transmit);
    let line = Line {
        uart: link,
        received: received_in,
        transmit: transmit_out,
    };
    // SAFETY: the interrupt is enabled after this.
    unsafe { LINE.fill(line) };
    // SAFETY: nothing relies on this interrupt being masked.
    unsafe { NVIC::unmask(Interrupt::USART2) };
    Some(LinkEnd {
        receiver: Receiver(received_out),
        transmitter: Transmitter(transmit_in),
    })
}

/// Sends a byte of the log where there is one and the UART takes it; whether more may be done.
#[allow(
    unsafe_code,
    reason = "raw register values, and what the interrupt owns"
)]
pub fn pump_log(log: &USART1) -> bool {
    if crate::log::is_empty() || log.sr().read().bits() & TXE == 0 {
        return false;
    }
    let Some(byte) = crate::log::pop() else {
        return false;
    };
    // SAFETY: any byte may be sent.
    log.dr().write(|w| unsafe { w.bits(u16::from(byte)) });
    true
}

#[interrupt]
fn USART2() {
    let start = cycles();
    #[allow(unsafe_code, reason = "what this interrupt owns")]
    // SAFETY: only this interrupt calls it.
    let line = unsafe { LINE.get() };
    let Some(line) = line else {
        return;
    };
    let moved = (line.take(), line.send());
    // Nothing but the ends of the program goes before it.
    let took = cycles().wrapping_sub(start);
    keep(Interrupter::Link, took);
    // The chip moves one byte a direction in a run; the emulator, which has many ready, would only tell how many.
    match moved {
        (1, 0 | 1) => TAKING.take(took),
        (0, 1) => SENDING.take(took),
        _ => {}
    }
}

impl Line {
    /// Takes what was received: on the chip one byte. The loop is the emulator's, whose UART withdraws its interrupt
    /// with every byte that is read, whether another is there or not.
    fn take(&mut self) -> u32 {
        let mut taken = 0;
        loop {
            let status = self.uart.sr().read().bits();
            if status & (RXNE | ORE) == 0 {
                return taken;
            }
            // Reading the data after the status clears both flags.
            let byte = low_u8(self.uart.dr().read().bits());
            if status & ORE != 0 {
                add(&OVERRUN, 1);
            }
            if status & RXNE != 0 {
                if !self.received.push(byte) {
                    add(&OVERRUN, 1);
                }
                add(&RECEIVED, 1);
                taken += 1;
            }
        }
    }

    /// Sends what the UART takes: on the chip one byte, in the emulator what the simulated wire has room for.
    #[allow(unsafe_code, reason = "raw register values")]
    fn send(&mut self) -> u32 {
        let mut sent = 0;
        while self.uart.sr().read().bits() & TXE != 0 && allowed() {
            let Some(byte) = self.transmit.pop() else {
                break;
            };
            // SAFETY: any byte may be sent.
            self.uart.dr().write(|w| unsafe { w.bits(u16::from(byte)) });
            add(&SENT, 1);
            sent += 1;
            if PACED.load(Ordering::Relaxed) {
                let left = ALLOWANCE.load(Ordering::Relaxed);
                ALLOWANCE.store(left.saturating_sub(1), Ordering::Relaxed);
            }
        }
        let more = self.transmit.ready() && allowed();
        self.uart.cr1().modify(|r, w| {
            let bits = r.bits();
            let bits = if more { bits | TXEIE } else { bits & !TXEIE };
            // SAFETY: one bit changes, to a value it may have.
            unsafe { w.bits(bits) }
        });
        sent
    }
}

fn allowed() -> bool {
    !PACED.load(Ordering::Relaxed) || ALLOWANCE.load(Ordering::Relaxed) > 0
}
