//! What runs when nothing else can: the brake is dumped before anything is said, then the end is recorded and the chip
//! reset.
//!
//! The stack may be what is broken. Its last bytes are out of bounds for the core (see [`guard_stack`]); an overflow is
//! a memory fault, whose own frame no longer fits either, so that it becomes a hard fault that is entered without one
//! (ARMv7-M, B1.5.7). The handlers therefore take another stack before anything else.

use core::arch::naked_asm;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use muslip_record::{End, PostMortem, State};

use crate::chip::{Chip, This};
use crate::dump::dump;
use crate::post_mortem::{WORDS, packed, state_of, unpacked};
use crate::stack::GUARD_BYTES;
use crate::{heat, totals};

/// Bytes of the handlers' own stack.
const HANDLER_STACK_BYTES: usize = 2048;

#[repr(C, align(8))]
struct HandlerStack(UnsafeCell<[u8; HANDLER_STACK_BYTES]>);

#[allow(unsafe_code, reason = "memory that a handler takes as its stack")]
// SAFETY: only a fault handler uses it, which never returns.
unsafe impl Sync for HandlerStack {}

static HANDLER_STACK: HandlerStack = HandlerStack(UnsafeCell::new([0; HANDLER_STACK_BYTES]));

struct Record(UnsafeCell<MaybeUninit<[u32; WORDS]>>);

#[allow(unsafe_code, reason = "memory that a reset leaves alone")]
// SAFETY: written by a handler that never returns, read at start-up.
unsafe impl Sync for Record {}

#[allow(unsafe_code, reason = "memory that a reset leaves alone")]
// SAFETY: what is in it is checked when it is read.
#[unsafe(link_section = ".uninit.post_mortem")]
static RECORD: Record = Record(UnsafeCell::new(MaybeUninit::uninit()));

struct Heat(UnsafeCell<MaybeUninit<[u32; heat::WORDS]>>);

#[allow(unsafe_code, reason = "memory that a reset leaves alone")]
// SAFETY: written by the thread alone, read at start-up.
unsafe impl Sync for Heat {}

#[allow(unsafe_code, reason = "memory that a reset leaves alone")]
// SAFETY: what is in it is checked when it is read.
#[unsafe(link_section = ".uninit.heat")]
static HEAT: Heat = Heat(UnsafeCell::new(MaybeUninit::uninit()));

/// State of the run after the last sample, by its number.
static STATE: AtomicU32 = AtomicU32::new(0);

/// Remembers the state of the run, for a record, and the energy in the brake in J, for after any reset.
#[allow(unsafe_code, reason = "memory that a reset leaves alone")]
pub fn remember(state: State, brake_energy_j: u32) {
    STATE.store(state as u32, Ordering::Relaxed);
    let place = HEAT.0.get().cast::<u32>();
    for (at, word) in heat::packed(brake_energy_j).into_iter().enumerate() {
        // SAFETY: within the words; one after the other, so that a reset in between spoils one copy at most.
        unsafe { ptr::write_volatile(place.add(at), word) };
    }
}

/// Energy in the brake in J before the reset; 0 where memory has not kept it.
#[allow(unsafe_code, reason = "memory that a reset leaves alone")]
pub fn last_brake_energy_j() -> u32 {
    // SAFETY: words, whatever they hold; nobody else is running yet.
    heat::unpacked(&unsafe { ptr::read_volatile(HEAT.0.get().cast::<[u32; heat::WORDS]>()) })
}

/// The record of the last end, which is forgotten.
#[allow(unsafe_code, reason = "memory that a reset leaves alone")]
pub fn last_end() -> Option<PostMortem> {
    let place = RECORD.0.get().cast::<[u32; WORDS]>();
    // SAFETY: words, whatever they hold; nobody else is running yet.
    unsafe {
        let words = ptr::read_volatile(place);
        ptr::write_volatile(place, [0; WORDS]);
        unpacked(&words)
    }
}

/// Puts the end of the stack out of bounds (ARMv7-M, B3.5: one region, no access, the default map for all else) and
/// lets memory faults be faults of their own.
#[allow(unsafe_code, reason = "sets up the memory protection unit")]
pub fn guard_stack() {
    unsafe extern "C" {
        static _stack_end: u32;
    }
    // SAFETY: called once at start-up, far above the guarded bytes.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    let end = (&raw const _stack_end) as u32;
    // SAFETY: a region of GUARD_BYTES, aligned because the stack begins with a memory (board.x); nothing else
    // lives there.
    unsafe {
        core.MPU.rnr.write(0);
        core.MPU.rbar.write(end);
        // XN, no access, size, enable.
        core.MPU
            .rasr
            .write(1 << 28 | (GUARD_BYTES.ilog2() - 1) << 1 | 1);
        // PRIVDEFENA, ENABLE; off in a hard fault.
        core.MPU.ctrl.write(0b101);
    }
    core.SCB
        .enable(cortex_m::peripheral::scb::Exception::MemoryManagement);
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    dump();
    let line = info.location().map_or(0, core::panic::Location::line);
    end(End::Panic, [line, 0])
}

/// Takes another stack, then [`on_fault`] with the one that was.
#[allow(unsafe_code, reason = "the vector of a fault, before any stack")]
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
unsafe extern "C" fn hard_fault() -> ! {
    naked_asm!(
        "mov r0, sp",
        "ldr r1, ={stack}",
        "add.w r1, r1, #{bytes}",
        "mov sp, r1",
        "b {handler}",
        stack = sym HANDLER_STACK,
        bytes = const HANDLER_STACK_BYTES,
        handler = sym on_fault,
    )
}

/// The same for a memory fault whose own frame still fitted.
#[allow(unsafe_code, reason = "the vector of a fault, before any stack")]
#[unsafe(naked)]
#[unsafe(export_name = "MemoryManagement")]
unsafe extern "C" fn memory_fault() -> ! {
    naked_asm!("b {handler}", handler = sym hard_fault)
}

/// `frame` is where the fault's frame would lie: believed only within the stack and outside its guard.
#[allow(unsafe_code, reason = "looks at a frame")]
extern "C" fn on_fault(frame: *const u32) -> ! {
    dump();
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    let (bottom, top) = (
        (&raw const _stack_end).wrapping_byte_add(GUARD_BYTES) as u32,
        (&raw const _stack_start) as u32,
    );
    let at = frame as u32;
    let whole = at.is_multiple_of(4) && at >= bottom && at.saturating_add(32) <= top;
    let [link_register, program_counter] = if whole {
        // SAFETY: eight words within the stack (ARMv7-M, B1.5.6): r0 to r3, r12, lr, pc, xpsr.
        unsafe { [*frame.add(5), *frame.add(6)] }
    } else {
        [0; 2]
    };
    let cause = if whole { End::HardFault } else { End::Stack };
    end(cause, [program_counter, link_register])
}

/// The crystal has stopped: the core runs on from its internal oscillator, at a tenth of its clock (RM0090, 7.2.7).
// SAFETY: never returns to what it interrupted, but from what changes nothing there.
#[allow(unsafe_code, reason = "the handler is unsafe by its type")]
#[exception]
unsafe fn NonMaskableInt() {
    if This::goes_on_after_nmi() {
        return;
    }
    dump();
    end(End::Crystal, [0; 2])
}

/// Records the end and resets the chip, which starts up faulted.
#[allow(unsafe_code, reason = "reads fault registers, writes the record")]
fn end(cause: End, [program_counter, link_register]: [u32; 2]) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: reading these has no effect.
    let (fault_status, hard_fault_status, memory, bus) = unsafe {
        let scb = &*SCB::PTR;
        (
            scb.cfsr.read(),
            scb.hfsr.read(),
            scb.mmfar.read(),
            scb.bfar.read(),
        )
    };
    // MMARVALID is bit 7, BFARVALID bit 15 (B3.2.15).
    let address = match (fault_status & 1 << 7 != 0, fault_status & 1 << 15 != 0) {
        (true, _) => memory,
        (_, true) => bus,
        _ => 0,
    };
    let state = STATE.load(Ordering::Relaxed);
    let record = PostMortem {
        end: cause,
        program_counter,
        link_register,
        fault_status,
        hard_fault_status,
        address,
        state: state_of(state).unwrap_or(State::Fault),
        tick: totals::WORKED.load(Ordering::Relaxed),
    };
    // SAFETY: nobody reads it before the reset.
    unsafe {
        ptr::write_volatile(RECORD.0.get().cast::<[u32; WORDS]>(), packed(&record));
    }
    This::ended(cause == End::Panic);
    SCB::sys_reset()
}
