//! The emulator's board: sensors and valves by frames on USART3.

use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m::peripheral::syst::SystClkSource;
use muslip_control::board::{Actuators, NotStored, RawSample, Sensors};
use muslip_control::brake::BrakeOutput;
use muslip_control::emulation::{Delays, FromFirmware, ToFirmware};
use muslip_record::{FRAME_BYTES, FrameReader, Parameters, encode};
use stm32f4::stm32f405::{Interrupt, NVIC, TIM2, USART3, interrupt};

use super::settings::CYCLES_PER_SAMPLE;
use super::{uart, wire};
use crate::bits::{low_u8, low_u16};
use crate::cell::InterruptCell;
use crate::chip::Took;
use crate::counter::cycles;
use crate::dump::dump;
use crate::{link, totals};

/// True once the emulated board is in use.
static EMULATED: AtomicBool = AtomicBool::new(false);
/// The emulated pins: duty in the lower half, dump valve above.
static PINS: AtomicU32 = AtomicU32::new(0);
/// Link bytes that must have arrived before the sample's work.
static EXPECTED: AtomicU32 = AtomicU32::new(0);
/// Instructions to waste in the sample's work.
static BURN: AtomicU32 = AtomicU32::new(0);
/// Samples that the timer is still to raise by itself.
static FREE_SAMPLES: AtomicU16 = AtomicU16::new(0);
/// Instruction count at the start of a free run.
static FREE_START: AtomicU32 = AtomicU32::new(0);
/// True from the beginning of a free run until it has been told of.
static FREE_RUN: AtomicBool = AtomicBool::new(false);

/// Sample that the sensors read next: written by USART3's interrupt before it raises the sampling one.
static MAILBOX: InterruptCell<RawSample> = InterruptCell::new();
static RECEIVER: InterruptCell<FrameReader> = InterruptCell::new();

const DUMP_VALVE: u32 = 1 << 16;

/// Sensors that read the last frame.
pub struct EmulatedSensors;

/// Valves that are told of in the next frame.
pub struct EmulatedActuators;

/// Sets up USART3 and the instruction counter.
#[allow(
    unsafe_code,
    reason = "raw register values, and what the emulator's interrupt owns"
)]
pub fn start(rig: &USART3, counter: &TIM2) -> (EmulatedSensors, EmulatedActuators) {
    // SAFETY: UE, TE, RE, RXNEIE (RM0090, 30.6.4).
    rig.cr1()
        .write(|w| unsafe { w.bits(1 << 13 | 1 << 3 | 1 << 2 | uart::RXNEIE) });
    // SAFETY: the interrupts that use them are enabled after this.
    unsafe {
        MAILBOX.fill(RawSample::default());
        RECEIVER.fill(FrameReader::new());
    }
    uart::allow(0);
    start_emulated(counter);
    // SAFETY: nothing relies on this interrupt being masked.
    unsafe { NVIC::unmask(Interrupt::USART3) };
    (EmulatedSensors, EmulatedActuators)
}

/// Lets TIM2 count instructions, which it does with `-icount shift=0`.
#[allow(unsafe_code, reason = "raw register values")]
fn start_emulated(counter: &TIM2) {
    // SAFETY: no prescaler (RM0090, 18.4.11).
    counter.psc().write(|w| unsafe { w.bits(0) });
    // SAFETY: all 32 bits (18.4.12).
    counter.arr().write(|w| unsafe { w.bits(u32::MAX) });
    // SAFETY: CEN, counting up (18.4.1).
    counter.cr1().write(|w| unsafe { w.bits(1) });
    EMULATED.store(true, Ordering::Relaxed);
}

/// Whether this is the emulator.
#[inline]
pub fn is_emulated() -> bool {
    EMULATED.load(Ordering::Relaxed)
}

/// Instructions; wraps.
#[inline]
pub fn instructions() -> u32 {
    #[allow(unsafe_code, reason = "reads a register")]
    // SAFETY: reading a counter has no effect.
    unsafe {
        (*TIM2::ptr()).cnt().read().bits()
    }
}

/// The emulated pins are dumped.
pub fn dump_pins() {
    PINS.store(0, Ordering::Relaxed);
}

/// What the emulated pins say.
pub fn output() -> BrakeOutput {
    let pins = PINS.load(Ordering::Relaxed);
    BrakeOutput {
        valve_duty: low_u16(pins),
        hold_pressure: pins & DUMP_VALVE != 0,
    }
}

impl Sensors for EmulatedSensors {
    fn read(&mut self) -> RawSample {
        if wire::is_on() {
            wire::wait_for_buses();
        }
        #[allow(unsafe_code, reason = "what the emulator's interrupt owns")]
        // SAFETY: USART3's interrupt, or the wire's tick, has written it before the sampling interrupt was raised. The first
        // cannot run while that one does, which is above it; the second writes once a sample, before it is raised.
        let mailbox = unsafe { MAILBOX.get() };
        mailbox.copied().unwrap_or_default()
    }

    fn dump(&mut self) {
        dump();
    }
}

impl Actuators for EmulatedActuators {
    fn actuate(&mut self, output: BrakeOutput) {
        let valve = if output.hold_pressure { DUMP_VALVE } else { 0 };
        PINS.store(u32::from(output.valve_duty) | valve, Ordering::Relaxed);
    }

    fn feed_watchdog(&mut self) {}

    fn store(&mut self, _: &Parameters) -> Result<(), NotStored> {
        Err(NotStored)
    }
}

/// Waits until the link bytes that belong before this sample have arrived.
pub fn await_link() {
    while is_emulated()
        && !wire::is_on()
        && (link::totals()
            .0
            .wrapping_sub(EXPECTED.load(Ordering::Relaxed)))
        .cast_signed()
            < 0
    {
        cortex_m::asm::wfi();
    }
}

/// Wastes as many instructions as the simulator asked for.
pub fn burn() {
    // Three instructions a turn: no-operation, subtraction, branch.
    for _ in 0..BURN.load(Ordering::Relaxed) / 3 {
        cortex_m::asm::nop();
    }
}

/// Answers the simulator after a sample's work; `totals` are samples raised, worked on and late so far.
pub fn answer(tick: u32, took: &Took, delays: Delays, stack_bytes: u32, totals: [u32; 3]) {
    if !is_emulated() || wire::is_on() {
        return;
    }
    if FREE_RUN.load(Ordering::Relaxed) {
        if FREE_SAMPLES.load(Ordering::Relaxed) == 0 {
            FREE_RUN.store(false, Ordering::Relaxed);
            let [samples, worked, late] = totals;
            say(&FromFirmware::FreeRun {
                samples,
                worked,
                late,
                elapsed_ns: cycles().wrapping_sub(FREE_START.load(Ordering::Relaxed)),
                output: output(),
            });
        }
        return;
    }
    say(&FromFirmware::Sample {
        tick,
        output: output(),
        interrupt_instructions: took.interrupt,
        control_instructions: took.control,
        step_instructions: took.step,
        delays,
        stack_bytes,
        link_sent: link::totals().1,
    });
}

/// Whether the core must not sleep: while the timer raises samples by itself in the emulator, because QEMU's
/// virtual time leaps when it does, and past its timers; awake it counts instructions and nothing else. And while
/// a frame is on its way, because each sleep between two of its bytes costs QEMU more than the byte.
pub fn runs_freely() -> bool {
    FREE_SAMPLES.load(Ordering::Relaxed) > 0
}

/// Counts a sample that the timer raised by itself; stops it after the last.
#[allow(
    unsafe_code,
    reason = "raw register values, and what the emulator's interrupt owns"
)]
pub fn count_free_sample() {
    let left = FREE_SAMPLES.load(Ordering::Relaxed);
    if left > 0 {
        FREE_SAMPLES.store(left - 1, Ordering::Relaxed);
        if left == 1 {
            // SAFETY: CSR of the timer whose handler this is.
            unsafe { (*cortex_m::peripheral::SYST::PTR).csr.write(0) };
        }
    }
}

/// Sends a frame to the simulator, where there is one.
#[allow(
    unsafe_code,
    reason = "raw register values, and what the emulator's interrupt owns"
)]
pub fn say(message: &FromFirmware) {
    if !is_emulated() {
        return;
    }
    let mut buffer = [0; FRAME_BYTES];
    let Ok(frame) = encode(message, &mut buffer) else {
        return;
    };
    // SAFETY: the transmitter is used by the main loop, and by fault handlers that never return to it.
    let rig = unsafe { &*USART3::ptr() };
    // QEMU's UART is always ready, and each look at its status costs QEMU more than the byte.
    for &byte in frame {
        // SAFETY: any byte may be sent.
        rig.dr().write(|w| unsafe { w.bits(u16::from(byte)) });
    }
}

/// Takes the next sample at the wire's pace, byte by byte; the bytes that the link brings with it.
#[allow(unsafe_code, reason = "what the emulator's interrupts own")]
pub fn heard_sample(mut byte: impl FnMut() -> u8) -> u16 {
    // SAFETY: the wire's tick calls it, while USART3's interrupt is masked.
    let Some(reader) = (unsafe { RECEIVER.get() }) else {
        return 0;
    };
    loop {
        if let Some(Ok(ToFirmware::Pace { raw, link_bytes })) = reader.push(byte()) {
            put(&raw, 0);
            return link_bytes;
        }
    }
}

#[interrupt]
fn USART3() {
    #[allow(unsafe_code, reason = "what the emulator's interrupt owns")]
    // SAFETY: only this interrupt calls it, and the receiver's registers are read here only.
    let (receiver, rig) = unsafe { (RECEIVER.get(), &*USART3::ptr()) };
    let Some(reader) = receiver else {
        return;
    };
    while rig.sr().read().bits() & uart::RXNE != 0 {
        let byte = low_u8(rig.dr().read().bits());
        if let Some(Ok(message)) = reader.push::<ToFirmware>(byte) {
            obey(&message);
        }
    }
}

#[allow(
    unsafe_code,
    reason = "raw register values, and what the emulator's interrupt owns"
)]
fn obey(message: &ToFirmware) {
    match message {
        ToFirmware::Sample {
            raw,
            link_sent,
            link_room,
            burn,
        } => {
            put(raw, *burn);
            EXPECTED.store(*link_sent, Ordering::Relaxed);
            uart::allow(u32::from(*link_room));
            SCB::set_pendst();
        }
        ToFirmware::FreeRun { raw, samples, burn } => {
            put(raw, *burn);
            uart::allow(u32::MAX);
            totals::reset();
            FREE_SAMPLES.store(*samples, Ordering::Relaxed);
            FREE_RUN.store(true, Ordering::Relaxed);
            FREE_START.store(cycles(), Ordering::Relaxed);
            // SAFETY: in the emulator nobody else uses the timer.
            let mut timer = unsafe { cortex_m::Peripherals::steal() }.SYST;
            timer.set_clock_source(SystClkSource::Core);
            timer.set_reload(CYCLES_PER_SAMPLE - 1);
            timer.clear_current();
            timer.enable_interrupt();
            timer.enable_counter();
        }
        // The first; then the wire's tick hears them.
        ToFirmware::Pace { raw, .. } => {
            put(raw, 0);
            totals::reset();
            uart::silence();
            wire::start();
        }
        ToFirmware::HardFault => cortex_m::asm::udf(),
        ToFirmware::ExhaustStack => {
            core::hint::black_box(deeper(&[0; 16]));
        }
        // SAFETY: NMIPENDSET (ARMv7-M, B3.2.4); zeros change nothing.
        ToFirmware::NonMaskable => unsafe { (*SCB::PTR).icsr.write(1 << 31) },
    }
}

/// Calls itself until the stack is used up.
#[inline(never)]
#[allow(unconditional_recursion, reason = "that is what it is for")]
fn deeper(words: &[u32; 16]) -> u32 {
    let more = core::hint::black_box([words[0].wrapping_add(1); 16]);
    deeper(&more).wrapping_add(more[1])
}

#[allow(
    unsafe_code,
    reason = "raw register values, and what the emulator's interrupt owns"
)]
fn put(raw: &RawSample, burn: u32) {
    // SAFETY: the sampling interrupt is not pending: the simulator waits for its answer before it sends.
    if let Some(place) = unsafe { MAILBOX.get() } {
        *place = *raw;
    }
    BURN.store(burn, Ordering::Relaxed);
}
