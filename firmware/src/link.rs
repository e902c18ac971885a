//! The host link by interrupts.
//!
//! A UART may hold one received byte, and the next is there 10.85 us later: this interrupt goes above sampling,
//! takes one byte in and one byte out, and neither logs nor masks anything. How late it may come: docs/rig.md.

use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use heapless::spsc::Queue;

use crate::cell::InterruptCell;
use crate::chip::{Chip, This, Uart};
use crate::counter::{Interrupter, Most, cycles, keep};
use crate::queue::{self, Sender, Taker};
use crate::totals::add;

/// Received bytes that may wait: five samples of a full wire.
const RECEIVE_BYTES: usize = 512;
/// Telemetry that may wait.
const TRANSMIT_BYTES: usize = 2048;

/// Bytes received on the link so far.
static RECEIVED: AtomicU32 = AtomicU32::new(0);
/// Bytes lost because nobody took them.
static OVERRUN: AtomicU32 = AtomicU32::new(0);
/// Bytes sent on the link so far.
static SENT: AtomicU32 = AtomicU32::new(0);
/// Most cycles of one run of the interrupt that took a byte in, and of one that sent one.
static TAKING: Most = Most::new();
static SENDING: Most = Most::new();

struct Line {
    uart: <This as Chip>::Uart,
    ends: Ends,
}

/// The interrupt's ends of the buffers.
struct Ends {
    received: Sender<u8>,
    transmit: Taker<u8>,
}

static LINE: InterruptCell<Line> = InterruptCell::new();

/// The main loop's end of the link: the interrupt's buffers as a port.
pub struct LinkEnd {
    received: Taker<u8>,
    transmit: Sender<u8>,
}

impl ErrorType for LinkEnd {
    type Error = Infallible;
}

impl ReadReady for LinkEnd {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.received.ready())
    }
}

impl Read for LinkEnd {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        while !self.received.ready() && !buffer.is_empty() {
            cortex_m::asm::nop();
        }
        let mut taken = 0;
        for place in buffer {
            let Some(byte) = self.received.pop() else {
                break;
            };
            *place = byte;
            taken += 1;
        }
        Ok(taken)
    }
}

impl WriteReady for LinkEnd {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.transmit.room() > 0)
    }
}

impl Write for LinkEnd {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        while self.transmit.room() == 0 && !bytes.is_empty() {
            cortex_m::asm::nop();
        }
        let mut taken = 0;
        for &byte in bytes {
            if !self.transmit.push(byte) {
                break;
            }
            taken += 1;
        }
        Ok(taken)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while !self.transmit.is_empty() {
            cortex_m::asm::nop();
        }
        Ok(())
    }
}

/// Bytes received so far, bytes sent so far.
#[cfg(feature = "stm32f405")]
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

/// Gives the interrupt its UART, which is set up, and its buffers; the main loop's end of them. None when called twice.
pub fn start(uart: <This as Chip>::Uart) -> Option<LinkEnd> {
    let received = cortex_m::singleton!(: Queue<u8, RECEIVE_BYTES> = Queue::new())?;
    let transmit = cortex_m::singleton!(: Queue<u8, TRANSMIT_BYTES> = Queue::new())?;
    let (received_in, received_out) = queue::split(received);
    let (transmit_in, transmit_out) = queue::split(transmit);
    let line = Line {
        uart,
        ends: Ends {
            received: received_in,
            transmit: transmit_out,
        },
    };
    #[allow(unsafe_code, reason = "what the interrupt owns")]
    // SAFETY: the board enables the interrupt after this.
    unsafe {
        LINE.fill(line);
    }
    Some(LinkEnd {
        received: received_out,
        transmit: transmit_in,
    })
}

/// The interrupt of the UART; only that may call it.
#[inline]
pub fn interrupt() {
    move_bytes(|line| (&mut line.uart, &mut line.ends));
}

/// The same where another UART stands in for the chip's.
#[cfg(feature = "stm32f405")]
pub fn interrupt_of(uart: &mut impl Uart) {
    move_bytes(|line| (uart, &mut line.ends));
}

#[inline]
fn move_bytes<'a, U: Uart + 'a>(of: impl FnOnce(&'a mut Line) -> (&'a mut U, &'a mut Ends)) {
    let start = cycles();
    #[allow(unsafe_code, reason = "what this interrupt owns")]
    // SAFETY: only this interrupt calls it.
    let line = unsafe { LINE.get() };
    let Some(line) = line else {
        return;
    };
    let (uart, ends) = of(line);
    let moved = (ends.take(uart), ends.send(uart));
    // Nothing but the ends of the program goes before it.
    let took = cycles().wrapping_sub(start);
    keep(Interrupter::Link, took);
    // A chip that holds one byte moves one a direction in a run; one with many ready would only tell how many.
    match moved {
        (1, 0 | 1) => TAKING.take(took),
        (0, 1) => SENDING.take(took),
        _ => {}
    }
}

impl Ends {
    /// Takes what was received: where the chip holds one, one byte. The loop is for one that holds more, and for the
    /// emulator, whose UART withdraws its interrupt with every byte that is read, whether another is there or not.
    fn take(&mut self, uart: &mut impl Uart) -> u32 {
        let mut taken = 0;
        while let Some((lost, byte)) = uart.take() {
            if lost {
                add(&OVERRUN, 1);
            }
            if let Some(byte) = byte {
                if !self.received.push(byte) {
                    add(&OVERRUN, 1);
                }
                add(&RECEIVED, 1);
                taken += 1;
            }
        }
        taken
    }

    /// Sends what the UART takes.
    fn send(&mut self, uart: &mut impl Uart) -> u32 {
        let mut sent = 0;
        while uart.is_ready() {
            let Some(byte) = self.transmit.pop() else {
                break;
            };
            uart.send(byte);
            add(&SENT, 1);
            sent += 1;
        }
        let more = self.transmit.ready();
        uart.ask(more);
        sent
    }
}
