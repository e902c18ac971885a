//! The host link's UART, USART2, and the log's, USART1 (RM0090, 30.6).

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use muslip_record::LINK_BAUD;
use stm32f4::stm32f405::{Interrupt, NVIC, RCC, USART1, USART2, interrupt};

use super::settings::{APB1_HZ, APB2_HZ, HSI_HZ, LOG_BAUD};
use super::wire::{self, Wire};
use crate::bits::low_u8;
use crate::chip::Uart;
use crate::link::{self, LinkEnd};
use crate::stm32::baud_divisor;

/// Bits of a USART's SR and CR1.
pub const RXNE: u16 = 1 << 5;
const TXE: u16 = 1 << 7;
const ORE: u16 = 1 << 3;
const UE: u16 = 1 << 13;
const TXEIE: u16 = 1 << 7;
/// Receive interrupt enable.
pub const RXNEIE: u16 = 1 << 5;
const TE: u16 = 1 << 3;
const RE: u16 = 1 << 2;

/// In the emulator, whose UART takes no time: bytes that the wire still takes in this sample.
static ALLOWANCE: AtomicU32 = AtomicU32::new(0);
/// Whether the allowance counts.
static PACED: AtomicBool = AtomicBool::new(false);

/// Paces the link: so many bytes until the next call.
pub fn allow(bytes: u32) {
    ALLOWANCE.store(bytes, Ordering::Relaxed);
    PACED.store(true, Ordering::Relaxed);
}

fn allowed() -> bool {
    !PACED.load(Ordering::Relaxed) || ALLOWANCE.load(Ordering::Relaxed) > 0
}

/// Sets up both UARTs (pins are the board's) for the clock that the core has come up with: on the internal
/// oscillator buses are not divided, and the host must still be told of the fault. `None` when called twice.
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
    let end = link::start(Usart2(link))?;
    // SAFETY: nothing relies on this interrupt being masked.
    unsafe { NVIC::unmask(Interrupt::USART2) };
    Some(end)
}

/// No interrupt comes of the link's UART itself any more, in the emulator: another stands in for it.
pub fn silence() {
    // SAFETY: two bits change, to a value that they may have; the link's interrupt is not in the midst of it, for what
    // calls this goes after it.
    unsafe {
        (*USART2::ptr())
            .cr1()
            .modify(|r, w| w.bits(r.bits() & !(RXNEIE | TXEIE)));
    }
}

/// Sends a byte of the log where the UART takes one; whether it did.
pub fn log(byte: impl FnOnce() -> Option<u8>) -> bool {
    // SAFETY: the thread's alone.
    let log = unsafe { &*USART1::ptr() };
    if log.sr().read().bits() & TXE == 0 {
        return false;
    }
    let Some(byte) = byte() else {
        return false;
    };
    // SAFETY: any byte may be sent.
    log.dr().write(|w| unsafe { w.bits(u16::from(byte)) });
    true
}

/// USART2, as its interrupt uses it.
pub struct Usart2(USART2);

impl Uart for Usart2 {
    fn take(&mut self) -> Option<(bool, Option<u8>)> {
        let status = self.0.sr().read().bits();
        if status & (RXNE | ORE) == 0 {
            return None;
        }
        // Reading the data after the status clears both flags.
        let byte = low_u8(self.0.dr().read().bits());
        Some((status & ORE != 0, (status & RXNE != 0).then_some(byte)))
    }

    fn is_ready(&mut self) -> bool {
        self.0.sr().read().bits() & TXE != 0 && allowed()
    }

    fn send(&mut self, byte: u8) {
        // SAFETY: any byte may be sent.
        self.0.dr().write(|w| unsafe { w.bits(u16::from(byte)) });
        if PACED.load(Ordering::Relaxed) {
            let left = ALLOWANCE.load(Ordering::Relaxed);
            ALLOWANCE.store(left.saturating_sub(1), Ordering::Relaxed);
        }
    }

    fn ask(&mut self, more: bool) {
        let more = more && allowed();
        self.0.cr1().modify(|r, w| {
            let bits = r.bits();
            let bits = if more { bits | TXEIE } else { bits & !TXEIE };
            // SAFETY: one bit changes, to a value it may have.
            unsafe { w.bits(bits) }
        });
    }
}

#[interrupt]
fn USART2() {
    if wire::is_on() {
        link::interrupt_of(&mut Wire);
    } else {
        link::interrupt();
    }
}
