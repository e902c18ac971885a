//! The host link's UART, USART2, and the log's, USART1 (RM0440, 37.8), each with a buffer of eight bytes in either direction.

use muslip_record::LINK_BAUD;
use stm32g4::stm32g474::{Interrupt, NVIC, interrupt};

use super::settings::{CORE_HZ, HSI_HZ, LOG_BAUD};
use super::table;
use crate::bits::low_byte;
use crate::link::{self, LinkEnd};
use crate::registers::{Registers, set_up};
use crate::stm32::baud_divisor;
use crate::stm32::bus::Bus;

const USART1: u32 = 0x4001_3800;
const USART2: u32 = 0x4000_4400;

const CR1: u32 = 0x00;
const BRR: u32 = 0x0C;
const ISR: u32 = 0x1C;
const ICR: u32 = 0x20;
const RDR: u32 = 0x24;
const TDR: u32 = 0x28;

const UE: u32 = 1;
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
/// Something received, something may be sent: flags of ISR and, in the same places, their interrupts of CR1.
const RXFNE: u32 = 1 << 5;
const TXFNF: u32 = 1 << 7;
/// Overrun: in ISR, and to clear it in ICR.
const ORE: u32 = 1 << 3;
const FIFOEN: u32 = 1 << 29;

/// Sets up both UARTs (pins are the board's) for the clock that the core has come up with. `None` when called twice.
pub fn start(full_clock: bool) -> Option<LinkEnd> {
    let clock_hz = if full_clock { CORE_HZ } else { HSI_HZ };
    set_up(&table::UART_CLOCKS, &mut Bus);
    Bus.write(USART1 + BRR, u32::from(baud_divisor(clock_hz, LOG_BAUD)));
    Bus.write(USART1 + CR1, UE | TE | FIFOEN);
    Bus.write(USART2 + BRR, u32::from(baud_divisor(clock_hz, LINK_BAUD)));
    Bus.write(USART2 + CR1, UE | TE | RE | FIFOEN | RXFNE);
    let end = link::start(Uart)?;
    #[allow(unsafe_code, reason = "lets an interrupt come")]
    // SAFETY: nothing relies on this interrupt being masked.
    unsafe {
        NVIC::unmask(Interrupt::USART2);
    }
    Some(end)
}

/// Sends a byte of the log where the UART takes one; whether it did.
pub fn log(byte: impl FnOnce() -> Option<u8>) -> bool {
    if Bus.read(USART1 + ISR) & TXFNF == 0 {
        return false;
    }
    let Some(byte) = byte() else {
        return false;
    };
    Bus.write(USART1 + TDR, u32::from(byte));
    true
}

/// USART2, as its interrupt uses it.
pub struct Uart;

impl crate::chip::Uart for Uart {
    fn take(&mut self) -> Option<(bool, Option<u8>)> {
        let status = Bus.read(USART2 + ISR);
        if status & (RXFNE | ORE) == 0 {
            return None;
        }
        if status & ORE != 0 {
            Bus.write(USART2 + ICR, ORE);
        }
        let byte = (status & RXFNE != 0).then(|| low_byte(Bus.read(USART2 + RDR)));
        Some((status & ORE != 0, byte))
    }

    fn is_ready(&mut self) -> bool {
        Bus.read(USART2 + ISR) & TXFNF != 0
    }

    fn send(&mut self, byte: u8) {
        Bus.write(USART2 + TDR, u32::from(byte));
    }

    fn ask(&mut self, more: bool) {
        let bits = Bus.read(USART2 + CR1);
        let bits = if more { bits | TXFNF } else { bits & !TXFNF };
        Bus.write(USART2 + CR1, bits);
    }
}

#[interrupt]
fn USART2() {
    link::interrupt();
}
